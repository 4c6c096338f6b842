//! What a motion breaks: the one place that decides it.

use job::Job;

use super::Judged;
use crate::motion::limits;
use crate::swept::FieldPoint;

/// Excess of the searched height over the scallop limit that is accepted, as a share of the limit: the search's own error.
pub const SCALLOP_SLACK: f64 = 1e-3;

impl Judged {
    /// The lowest place, if a ball cuts more than the tolerance, mm, below the surface there.
    #[must_use]
    pub fn violating_gouge(&self, path_tolerance_mm: f64) -> Option<&FieldPoint> {
        let lowest = self.field.lowest.as_ref();
        lowest.filter(|_| self.gouge_mm() > Some(path_tolerance_mm))
    }

    /// The highest place, if its scallop is above the job's limit. None where a ball does not reach all of the surface: that is a failure of its own.
    #[must_use]
    pub fn violating_scallop(&self, job: &Job) -> Option<&FieldPoint> {
        let highest = self.field.highest.as_ref();
        let is_high = self.highest_mm() > Some(job.scallop_mm * (1.0 + SCALLOP_SLACK));
        highest.filter(|_| is_high && self.field.uncut_share <= Some(0.0))
    }

    /// One sentence for each requirement that the motion breaks: contact with the surface, path error and gouges within the tolerance (mm, finite,
    /// above 0), scallops within the job's limit, the reach of the tool, the axis limits. Empty: it passes.
    #[must_use]
    pub fn failures(&self, job: &Job, path_tolerance_mm: f64) -> Vec<String> {
        if self.in_contact == 0 {
            return vec!["the motion never touches the surface: is it in the job's coordinates? --tip if it is of the ball's tip".to_owned()];
        }
        let mut failures = Vec::new();
        if let Some(error) = &self.path_error_mm
            && error.value.abs() > path_tolerance_mm
        {
            failures.push(format!(
                "the centre is {:+.6} mm off the exact offset surface at sample {}, u = {:.6}, v = {:.6}; {path_tolerance_mm} mm is accepted",
                error.value, error.sample, error.uv[0], error.uv[1]
            ));
        }
        if let Some(uncut_share) = self.field.uncut_share.filter(|share| *share > 0.0) {
            failures.push(format!(
                "no ball reaches {:.3} % of the surface",
                100.0 * uncut_share
            ));
        }
        failures.extend(self.violating_scallop(job).map(|highest| {
            format!(
                "the scallop is {:.6} mm high, {:.2} % above the limit of {} mm, at u = {:.6}, v = {:.6}",
                highest.height_mm,
                100.0 * (highest.height_mm / job.scallop_mm - 1.0),
                job.scallop_mm,
                highest.uv[0],
                highest.uv[1]
            )
        }));
        failures.extend(self.violating_gouge(path_tolerance_mm).map(|lowest| {
            format!(
                "the ball cuts {:.6} mm below the surface at u = {:.6}, v = {:.6}; {path_tolerance_mm} mm is accepted",
                -lowest.height_mm,
                lowest.uv[0],
                lowest.uv[1]
            )
        }));
        failures.extend(self.reach.failures.iter().cloned());
        failures.extend(self.travel.failures(&job.machine));
        let axes = self.axes.iter().enumerate();
        failures.extend(axes.filter_map(|(order, peak)| limits::failure(order, peak.as_ref()?)));
        failures
    }
}
