//! The four approaches on whole jobs, at the same scallop height, tolerance and feed.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{Case, Cases};
use crate::approach::{ApproachError, Kind, Measured, measure};
use crate::report::Sketch;

/// Sampling periods that the linear interpolator is shown with, µs: the paper's, and the product's.
pub const PERIODS_US: [f64; 2] = [5000.0, 1000.0];
/// Threads: a run keeps a few kilobytes, so memory is no limit, and more than four runs at a time gain little.
const THREADS: usize = 4;

/// One approach on one job.
#[derive(Clone, Debug)]
pub struct Row {
    /// The approach.
    pub kind: Kind,
    /// Its sampling period, µs.
    pub period_us: f64,
    /// What it came to.
    pub measured: Measured,
    /// The passes as a picture shows them; of the product only.
    pub sketch: Option<Sketch>,
}

impl Row {
    /// The approach, with its period where that is not the product's.
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
    /// The job.
    pub name: &'static str,
    /// What it is.
    pub title: &'static str,
    /// Feed of the contact, mm/s.
    pub feed_mm_s: f64,
    /// Scallop height limit and tolerance of chords and splines, mm.
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

/// What is run on each job.
const ROWS: [(Kind, f64); 5] = [
    (Kind::ConstantCl, PERIODS_US[1]),
    (Kind::Linear, PERIODS_US[0]),
    (Kind::Linear, PERIODS_US[1]),
    (Kind::Curve, PERIODS_US[1]),
    (Kind::Surface, PERIODS_US[1]),
];
/// Jobs that are compared.
const JOBS: usize = 3;
/// Runs of all comparisons.
pub const RUNS: u64 = (JOBS * ROWS.len()) as u64;

/// Runs one.
fn row(case: &Case, kind: Kind) -> Result<Row, ApproachError> {
    let mut sketch = match kind {
        Kind::Surface => Some(Sketch::new(&case.job, case.oracle.schedule()?.len())),
        _ => None,
    };
    let measured = measure(kind, &case.job, |motion, _, checked| {
        if let Some(sketch) = &mut sketch {
            sketch.add(&motion.emitted, checked);
        }
    })?;
    Ok(Row {
        kind,
        period_us: case.job.machine.period_us,
        measured,
        sketch,
    })
}

/// All comparisons; `step` is called after each run.
///
/// # Errors
/// As [`measure`].
pub fn comparisons(cases: &Cases, step: &(dyn Fn() + Sync)) -> Result<Vec<Comparison>, ApproachError> {
    let jobs: [(&Case, &'static str); JOBS] = [
        (&cases.revolved, "Example 1, the bell"),
        (&cases.reconstructed, "Example 2, the reconstructed ruled surface"),
        (&cases.freeform, "The freeform shell, which is not in the paper"),
    ];
    let tasks: Vec<(usize, Kind, f64)> = (0..JOBS)
        .flat_map(|job| ROWS.map(|(kind, period_us)| (job, kind, period_us)))
        .collect();
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..THREADS.min(std::thread::available_parallelism().map_or(1, usize::from)) {
            scope.spawn(|| {
                while let Some((job, kind, period_us)) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let case = jobs[*job].0.with_period_us(*period_us);
                    let row = row(&case, *kind);
                    done.lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner)
                        .push((*job, *kind, *period_us, row));
                    step();
                }
            });
        }
    });
    let mut done = done
        .into_inner()
        .unwrap_or_else(std::sync::PoisonError::into_inner);
    let mut comparisons = Vec::new();
    for (index, (case, title)) in jobs.into_iter().enumerate() {
        let mut rows = Vec::new();
        for (kind, period_us) in ROWS {
            let place = done
                .iter()
                .position(|(job, of, period, _)| (*job, *of, *period) == (index, kind, period_us));
            if let Some(place) = place {
                rows.push(done.swap_remove(place).3?);
            }
        }
        comparisons.push(Comparison {
            name: case.name,
            title,
            feed_mm_s: case.job.feed_mm_s(),
            scallop_mm: case.job.scallop_mm,
            chord_mm: case.job.chord_mm,
            rows,
        });
    }
    Ok(comparisons)
}
