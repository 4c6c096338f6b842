//! The four approaches on whole jobs, at the same scallop height, tolerance and feed.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::{Case, Cases};
use approach::{ApproachError, Kind, Measured, measure};
use report::Sketch;

/// Sampling periods that the linear interpolator is shown with, µs: the paper's, and the product's.
pub const PERIODS_US: [f64; 2] = [5000.0, 1000.0];
/// Greatest number of threads: more than four gain little.
const THREADS: usize = 4;

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
    let tasks: Vec<(usize, Kind, f64)> = (0..JOBS)
        .flat_map(|job| ROWS.map(|(kind, period_us)| (job, kind, period_us)))
        .collect();
    let mut passes = [0; JOBS];
    for (count, (case, _)) in passes.iter_mut().zip(&jobs) {
        *count = case.oracle.schedule()?.len();
    }
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..THREADS.min(std::thread::available_parallelism().map_or(1, usize::from)) {
            scope.spawn(|| {
                while let Some((job, kind, period_us)) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let case = jobs[*job].0.with_period_us(*period_us);
                    let row = row(&case, *kind, passes[*job], step);
                    done.lock()
                        .unwrap_or_else(std::sync::PoisonError::into_inner)
                        .push((*job, *kind, *period_us, row));
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
