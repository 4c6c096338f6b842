//! The four approaches on whole jobs, at the same scallop height, tolerance and feed.

use super::{Case, Cases};
use approach::{ApproachError, Kind, Measured, measure};
use rayon::prelude::*;
use report::Sketch;

/// Sampling periods that the linear interpolator is shown with, µs: the paper's, and the product's.
pub const PERIODS_US: [f64; 2] = [5000.0, 1000.0];

/// One approach on one job.
#[derive(Clone, Debug)]
pub struct Row {
    /// The approach.
    pub kind: Kind,
    /// Its sampling period, µs.
    pub period_us: f64,
    /// Its result.
    pub measured: Measured,
    /// The passes for the picture, of the surface interpolator only.
    pub sketch: Option<Sketch>,
}

impl Row {
    /// Name of the approach, with its period unless that is the product's.
    #[must_use]
    pub fn name(&self) -> String {
        if self.period_us == PERIODS_US[1] {
            self.kind.name().to_owned()
        } else {
            format!("{}, {} ms", self.kind.name(), self.period_us * 1e-3)
        }
    }
}

/// The approaches on one job.
#[derive(Clone, Debug)]
pub struct Comparison {
    /// Name of the job.
    pub name: &'static str,
    /// Title of the job.
    pub title: &'static str,
    /// Feed of the contact, mm/s.
    pub feed_mm_s: f64,
    /// Scallop height limit, mm.
    pub scallop_mm: f64,
    /// Tolerance of chords and splines, mm.
    pub chord_mm: f64,
    /// The rows, in the paper's order.
    pub rows: Vec<Row>,
}

impl Comparison {
    /// The row of an approach at the product's period.
    #[must_use]
    pub fn row(&self, kind: Kind) -> Option<&Row> {
        self.rows
            .iter()
            .find(|row| row.kind == kind && row.period_us == PERIODS_US[1])
    }
}

/// Approaches and sampling periods (µs) of each job.
const ROWS: [(Kind, f64); 5] = [
    (Kind::ConstantCl, PERIODS_US[1]),
    (Kind::Linear, PERIODS_US[0]),
    (Kind::Linear, PERIODS_US[1]),
    (Kind::Curve, PERIODS_US[1]),
    (Kind::Surface, PERIODS_US[1]),
];
/// Number of jobs.
const JOBS: usize = 3;
/// Runs of all comparisons.
pub const RUNS: u64 = (JOBS * ROWS.len()) as u64;
/// Progress steps of a run.
pub const PARTS: u64 = 50;

/// Runs an approach on a job, and calls `step` [`PARTS`] times over its `passes`.
fn row(case: &Case, kind: Kind, passes: usize, step: &dyn Fn()) -> Result<Row, ApproachError> {
    let mut sketch = (kind == Kind::Surface).then(|| Sketch::new(&case.job, passes));
    let (mut passed, mut steps) = (0, 0);
    let mut advance_to = |wanted: u64| {
        while steps < wanted.min(PARTS) {
            steps += 1;
            step();
        }
    };
    let measured = measure(kind, &case.job, |motion, _, checked| {
        if let Some(sketch) = &mut sketch {
            sketch.add(&motion.emitted, checked);
        }
        if motion.emitted.last_of_pass {
            passed += 1;
            advance_to(PARTS * passed / passes.max(1) as u64);
        }
    })?;
    advance_to(PARTS);
    Ok(Row {
        kind,
        period_us: case.job.machine.period_us,
        measured,
        sketch,
    })
}

/// All comparisons; `step` is called [`PARTS`] times a run.
///
/// # Errors
/// As [`measure`].
pub fn comparisons(cases: &Cases, step: &(dyn Fn() + Sync)) -> Result<Vec<Comparison>, ApproachError> {
    let jobs: [(&Case, &'static str); JOBS] = [
        (&cases.revolved, "Example 1, the bell"),
        (&cases.reconstructed, "Example 2, the reconstructed ruled surface"),
        (&cases.freeform, "The freeform shell, which is not in the paper"),
    ];
    let comparison = |(case, title): &(&Case, &'static str)| {
        let passes = case.oracle.schedule()?.len();
        let rows = ROWS
            .par_iter()
            .map(|(kind, period_us)| row(&case.with_period_us(*period_us), *kind, passes, step));
        Ok(Comparison {
            name: case.name,
            title,
            feed_mm_s: case.job.feed_mm_s(),
            scallop_mm: case.job.scallop_mm,
            chord_mm: case.job.chord_mm,
            rows: rows.collect::<Result<_, ApproachError>>()?,
        })
    };
    jobs.par_iter().map(comparison).collect()
}
