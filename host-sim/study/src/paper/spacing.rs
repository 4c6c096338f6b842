//! Passes of constant scallop height, which the paper does not have, beside its straight ones: the core on whole jobs.

use super::{Case, Cases};
use approach::ApproachError;
use inspect::{PathFigures, path_and_crests};
use job::{AxisLimits, Pattern, Spacing, Start};
use machine::prepare::prepare;
use rayon::prelude::*;

/// The rules for the distance between passes, in the order of the table.
const RULES: [Spacing; 4] = [
    Spacing::FirstOrder,
    Spacing::Exact,
    Spacing::Constant(Start::Edge),
    Spacing::Constant(Start::Middle),
];
/// Number of jobs.
const JOBS: usize = 5;
/// Progress steps of the table.
pub const STEPS: u64 = (JOBS * RULES.len()) as u64;
/// Axis limits of `jobs/plate_machine.toml`: the paper has none, and without them the time is the length over the feed.
const LIMITS: AxisLimits = AxisLimits {
    velocity_mm_s: [100.0, 100.0, 50.0],
    acceleration_mm_s2: [1000.0, 1000.0, 500.0],
    jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
};
/// Least distance of the samples from which crests are measured, mm. The error of the measurement states what it costs.
const SAMPLES_MM: f64 = 0.005;

/// A job with one rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpacingRow {
    /// The rule.
    pub spacing: Spacing,
    /// Passes, length and time.
    pub path: PathFigures,
    /// Highest crest, as a share of the limit.
    pub crest_max: f64,
    /// Mean of the crests by area, as a share of the limit.
    pub crest_mean: f64,
    /// Error of the measured crests, as a share of the limit.
    pub error: f64,
}

impl SpacingRow {
    /// Name of the rule, with the start.
    #[must_use]
    pub fn name(&self) -> String {
        match self.spacing.start() {
            Some(start) => format!("{}, {}", self.spacing.name(), start.name()),
            None => self.spacing.name().to_owned(),
        }
    }

    /// Whether no crest is above the limit by more than the measuring error.
    #[must_use]
    pub fn holds_the_limit(&self) -> bool {
        self.crest_max <= 1.0 + self.error
    }
}

/// The rules on one job.
#[derive(Clone, Debug, PartialEq)]
pub struct SpacingTable {
    /// Name of the job.
    pub name: &'static str,
    /// Title of the job.
    pub title: &'static str,
    /// Feed of the contact, mm/s.
    pub feed_mm_s: f64,
    /// Scallop height limit, mm.
    pub scallop_mm: f64,
    /// The rows, straight passes first.
    pub rows: Vec<SpacingRow>,
}

impl SpacingTable {
    /// Length of a row's passes over that of the paper's straight ones.
    #[must_use]
    pub fn length_ratio(&self, row: &SpacingRow) -> f64 {
        self.ratio(row, |path| path.length_mm)
    }

    /// Time of a row over that of the paper's straight passes.
    #[must_use]
    pub fn time_ratio(&self, row: &SpacingRow) -> f64 {
        self.ratio(row, |path| path.time_s)
    }

    /// The row with the least time of those within the limit; the first of equal ones.
    #[must_use]
    pub fn fastest(&self) -> Option<&SpacingRow> {
        let within = self.rows.iter().filter(|row| row.holds_the_limit());
        within.min_by(|a, b| a.path.time_s.total_cmp(&b.path.time_s))
    }

    fn ratio(&self, row: &SpacingRow, of: fn(&PathFigures) -> f64) -> f64 {
        self.rows
            .first()
            .map_or(f64::NAN, |straight| of(&row.path) / of(&straight.path))
    }
}

fn row(case: &Case, spacing: Spacing) -> Result<SpacingRow, ApproachError> {
    let mut job = case.job.clone();
    (job.spacing, job.pattern) = (spacing, Pattern::Zigzag);
    job.machine.limits = Some(LIMITS);
    let fault = |error: String| ApproachError::Fault(error);
    let prepared = prepare(&job).map_err(|error| fault(error.to_string()))?;
    let (path, swept) =
        path_and_crests(&job, &prepared, SAMPLES_MM).map_err(|error| fault(error.to_string()))?;
    let share = |height_mm: f64| height_mm / job.scallop_mm;
    Ok(SpacingRow {
        spacing,
        path,
        crest_max: share(swept.scallop_max.height_mm),
        crest_mean: share(swept.scallop_mean_mm),
        error: share(swept.measurement_error_mm),
    })
}

/// The tables of all jobs; `step` is called after each of [`STEPS`] runs.
///
/// # Errors
/// The core refuses a job, or a fault ends it.
pub fn tables(cases: &Cases, step: &(dyn Fn() + Sync)) -> Result<Vec<SpacingTable>, ApproachError> {
    let jobs: [(&Case, &'static str); JOBS] = [
        (&cases.revolved, "Example 1, the bell, along u"),
        (&cases.revolved_v, "Example 1, the bell, along v"),
        (&cases.printed, "Example 2 as printed"),
        (&cases.reconstructed, "Example 2, reconstructed"),
        (&cases.freeform, "The freeform shell, which is not in the paper"),
    ];
    let table = |(case, title): &(&Case, &'static str)| {
        let rows = RULES.par_iter().map(|spacing| {
            let row = row(case, *spacing);
            step();
            row
        });
        Ok(SpacingTable {
            name: case.name,
            title,
            feed_mm_s: case.job.feed_mm_s(),
            scallop_mm: case.job.scallop_mm,
            rows: rows.collect::<Result<_, ApproachError>>()?,
        })
    };
    jobs.par_iter().map(table).collect()
}
