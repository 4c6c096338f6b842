//! Soft limits, checked before any motion: every centre of the job must be within the travel of the axes.
//!
//! The bounding box of the surface, enlarged by the ball's radius, contains every centre: if the box fits, the job fits. Otherwise the passes
//! are run here, at constant feed, and the centres are compared.

use interp_core::Sample;

use crate::Machine;
use crate::prepare::{Prepared, prepare};
use job::{AXES, Job, JobError, MachineSpec, units};
use patches::placement::extent_mm;

/// Key of the job at which the error points.
const KEY: &str = "machine.travel_mm";

/// The sample with an extreme position on an axis.
#[derive(Clone, Copy)]
struct ExtremeSample {
    mm: f64,
    sample: Sample,
}

/// Checks a job whose direction is chosen.
///
/// # Errors
/// Centres outside the travel, with distance, location and remedy; the errors of the preparation. Samples after a
/// fault are not checked: the run would not reach them.
pub fn check(job: &Job) -> Result<(), JobError> {
    let Some(travel) = job.machine.travel_mm else {
        return Ok(());
    };
    let fits = extent_mm(&job.surface)
        .iter()
        .zip(travel)
        .all(|(reach, ends)| reach[0] - job.radius_mm >= ends[0] && reach[1] + job.radius_mm <= ends[1]);
    if fits {
        return Ok(());
    }
    // Without the axis limits the run is shorter. Passes of constant scallop height then differ by micrometres; the core checks the true ones.
    let mut bare = job.clone();
    bare.machine = MachineSpec {
        period_us: job.machine.period_us,
        ..MachineSpec::default()
    };
    let prepared = prepare(&bare)?;
    let Some(farthest) = farthest(&prepared) else {
        return Ok(());
    };
    let (mut what, mut remedies) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        let ([least, most], [low, high]) = (farthest[axis], travel[axis]);
        for (far, beyond) in [(least, low - least.mm), (most, most.mm - high)] {
            if beyond > 0.0 {
                let [u, v] = prepared.parameters(far.sample.path, far.sample.side);
                what.push(format!(
                    "{} reaches {:.3} mm on pass {}, u = {u:.6}, v = {v:.6}: {beyond:.3} mm beyond its travel of {low} to {high} mm",
                    AXES[axis], far.mm, far.sample.pass
                ));
                remedies.push(remedy(axis, [least.mm, most.mm], [low, high]));
            }
        }
    }
    if what.is_empty() {
        return Ok(());
    }
    remedies.dedup();
    Err(job.origin.error(
        KEY,
        format!("the tool centre leaves the travel: {}", what.join("; ")),
        remedies.join("; "),
    ))
}

/// Remedy for an axis out of its travel.
fn remedy(axis: usize, [least, most]: [f64; 2], [low, high]: [f64; 2]) -> String {
    let name = AXES[axis];
    if most - least > high - low {
        return format!(
            "the job takes {:.3} mm along {name}, more than its travel: rotate or scale the part in [placement]",
            most - least
        );
    }
    format!(
        "move the part along {name} by {:.3} to {:.3} mm: add that to translate_mm in [placement]",
        low - least,
        high - most
    )
}

/// Samples with the least and the greatest position of each axis; `None` without samples.
fn farthest(prepared: &Prepared) -> Option<[[ExtremeSample; 2]; 3]> {
    let mut machine = Machine::load(prepared).ok()?;
    let mut farthest: Option<[[ExtremeSample; 2]; 3]> = None;
    // Samples up to a fault are used.
    let _fault = machine.run(|sample| {
        let at = |axis: usize| ExtremeSample {
            mm: units::millimetres(sample.cl_nm[axis]),
            sample: *sample,
        };
        let ends = farthest.get_or_insert_with(|| std::array::from_fn(|axis| [at(axis); 2]));
        for (axis, [least, most]) in ends.iter_mut().enumerate() {
            let here = units::millimetres(sample.cl_nm[axis]);
            if here < least.mm {
                *least = at(axis);
            }
            if here > most.mm {
                *most = at(axis);
            }
        }
        true
    });
    farthest
}

#[cfg(test)]
mod tests {
    use super::*;

    const TORUS: &str = include_str!("../../../jobs/torus.toml");

    fn said(travel: &str) -> Result<(), (String, String)> {
        let text = format!("{TORUS}\n[machine]\ntravel_mm = {travel}\n");
        let job = job_file::parse("job.toml", &text).unwrap();
        check(&job).map_err(|error| {
            let lines = text.lines().count();
            assert_eq!(error.line_and_column().unwrap().0, lines);
            (error.what().to_owned(), error.remedy().to_owned())
        })
    }

    /// Centres of the torus: x and y 0 to 42.598, z -2.997 to -1.500; its surface 5 mm below.
    #[test]
    fn a_job_that_leaves_the_travel_is_refused_with_location_and_remedy() {
        // Within by the box alone, then by the samples alone.
        assert_eq!(said("[[-50, 50], [-50, 60], [-20, 20]]"), Ok(()));
        assert_eq!(said("[[-0.001, 43], [-0.001, 43], [-3, -1.499]]"), Ok(()));
        let (what, remedy) = said("[[0, 43], [-1, 43], [-10, -2]]").unwrap_err();
        assert!(what.contains("z reaches -1.500 mm on pass"), "{what}");
        assert!(
            what.contains("0.500 mm beyond its travel of -10 to -2 mm"),
            "{what}"
        );
        assert!(!what.contains("x reaches"), "{what}");
        assert!(remedy.contains("along z by -7.003 to -0.500 mm"), "{remedy}");
        let (what, remedy) = said("[[1, 40], [-1, 43], [-10, 2]]").unwrap_err();
        assert_eq!(what.matches("x reaches").count(), 2);
        assert!(
            remedy.starts_with("the job takes 42.598 mm along x, more than") && !remedy.contains(';'),
            "{remedy}"
        );
    }
}
