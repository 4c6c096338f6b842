//! A fault with its location on the surface.

use interp_core::{Fault, FaultKind};
use job::Job;
use machine::Machine;
use machine::prepare::Prepared;
use oracle::Oracle;

/// Places along each parameter at which the ball is tried.
const TRIED: u32 = 192;
/// A ball fits where its radius times the curvature is below this; near it the machine's rounding decides.
const FITS: f64 = 0.999;

/// A fault with its location.
#[derive(Clone, Copy, Debug)]
pub struct FaultAt {
    /// The fault.
    pub fault: Fault,
    /// Number of samples before the fault.
    pub tick: u64,
    /// Pass, from 0.
    pub pass: u32,
    /// (u, v).
    pub parameters: [f64; 2],
}

impl FaultAt {
    /// The fault that stopped this machine after `samples` samples. A ball that does not fit is found when the next pass is planned, too: its place is then ahead of the tool.
    #[must_use]
    pub fn of(fault: Fault, machine: &Machine, samples: u64, prepared: &Prepared, job: &Job) -> Self {
        let (pass, path, side) = machine.place();
        let stands = prepared.parameters(path, side);
        let ahead = match fault.kind {
            FaultKind::BallDoesNotFit => does_not_fit(job, stands),
            _ => None,
        };
        Self {
            fault,
            tick: samples,
            pass,
            parameters: ahead.unwrap_or(stands),
        }
    }

    /// The fault, its location and the remedy, in two lines.
    #[must_use]
    pub fn sentence(&self) -> String {
        let remedy = explain::fault(self.fault).1;
        let place = explain::fault_at(self.fault, self.tick, self.pass, self.parameters);
        let code = self.fault.kind.code();
        format!("{place}\n  help: {remedy}; more: cargo sim explain {code}")
    }

    /// As [`Self::sentence`], with the line of the job file that causes the fault.
    #[must_use]
    pub fn sentence_of(&self, job: &Job) -> String {
        let line = job.origin.quote(explain::key(self.fault.kind));
        line.map_or_else(
            || self.sentence(),
            |line| format!("{}\n  at {line}", self.sentence()),
        )
    }
}

/// The place nearest across the passes at which the ball of the job does not fit; `None` where it does not at the tool's own place, and where there is none.
fn does_not_fit(job: &Job, stands: [f64; 2]) -> Option<[f64; 2]> {
    let oracle = Oracle::new(job).ok()?;
    let fit = |[u, v]: [f64; 2]| {
        let contact = oracle.contact(u, v).ok()?;
        Some(contact.fit(oracle.radius_mm))
    };
    if fit(stands).is_none_or(|fit| fit >= FITS) {
        return None;
    }
    let [path, side] = [oracle.path_range(), oracle.side_range()];
    let at = |[low, high]: [f64; 2], k: u32| low + (high - low) * f64::from(k) / f64::from(TRIED);
    let (_, from) = oracle.swapped(stands[0], stands[1]);
    let on_line = |k: u32| {
        let places = (0..=TRIED).map(|i| {
            let (u, v) = oracle.swapped(at(path, i), at(side, k));
            [u, v]
        });
        let fits = places.filter(|[u, v]| oracle.is_in_region(*u, *v));
        fits.filter_map(|place| Some((fit(place)?, place)))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .filter(|(fit, _)| *fit >= FITS)
    };
    let mut lines: Vec<u32> = (0..=TRIED).collect();
    lines.sort_by(|a, b| {
        (at(side, *a) - from)
            .abs()
            .total_cmp(&(at(side, *b) - from).abs())
    });
    lines.into_iter().find_map(on_line).map(|(_, place)| place)
}

#[cfg(test)]
mod tests {
    use crate::run::time_run;
    use machine::prepare::prepare;

    /// The second pass is planned while the tool is on the first: its place was reported as that of the tool, u = 0, v = 0.
    #[test]
    fn a_ball_that_does_not_fit_ahead_is_reported_there() {
        let text = r#"
[surface]
kind = "bicubic"
coefficients_mm = [
    [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 20], [0, 0, 0, 0]],
    [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 8, 0]],
    [[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 2, 0], [0, 3.2, -3.2, 0]],
]
[tool]
kind = "ball"
radius_mm = 9.99
[cut]
feed_mm_min = 3000
scallop_mm = 0.05
along = "u"
side = "up"
pattern = "zigzag"
spacing = "exact"
[machine]
velocity_max_mm_s = [100, 100, 50]
"#;
        let job = job_file::parse("job.toml", text).unwrap();
        let prepared = prepare(&job).unwrap();
        let fault = time_run(&job, &prepared, &()).unwrap().fault.unwrap();
        let [u, v] = fault.parameters;
        let oracle = oracle::Oracle::new(&job).unwrap();
        let fit = oracle.contact(u, v).unwrap().fit(job.radius_mm);
        assert!(
            fit >= 0.999 && oracle.contact(0.0, 0.0).unwrap().fit(job.radius_mm) < 0.9,
            "{fit} at {u}, {v}"
        );
    }
}
