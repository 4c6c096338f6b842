//! Every example, table and figure of Lo's paper: the printed values and ours.
//!
//! ```text
//! jobs (the paper's surfaces) ─► geometry.rs   lengths, speeds, passes by quadrature and scan
//!                             ─► examples.rs   Examples 1 to 6 as items: printed, ours, note
//!                             ─► table_1.rs    operations and cycles of a period
//!                             ─► compare.rs    the four approaches on whole jobs
//!                             ─► spacing.rs    constant scallop height beside straight passes, on whole jobs
//!                             ─► figures.rs    the data of Figures 3, 4, 5, 7, 8, 9
//! study ─► report/paper/: the page;  commands/paper.rs: terminal and JSON
//! ```
//!
//! Source: C.-C. Lo, "A new approach to CNC tool path generation", Computer-Aided Design 30 (1998). The project has notes on the
//! paper's algorithms and numbers, but not its pictures: the figures are reconstructions from the examples that they belong to.

pub mod compare;
mod examples;
pub mod figures;
pub mod geometry;
pub mod spacing;
pub mod table_1;

use approach::ApproachError;
use job::{Job, Spacing};
use oracle::Oracle;

pub use compare::{Comparison, Row};
pub use figures::Figures;
pub use spacing::{SpacingRow, SpacingTable};

/// A number of the paper, or a related one that the paper does not print.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Part of the paper: "Example 1", "Table 1".
    pub part: &'static str,
    /// Name.
    pub what: String,
    /// Unit, empty for counts.
    pub unit: &'static str,
    /// Decimals shown.
    pub decimals: usize,
    /// The paper's value; `None` where it prints none.
    pub printed: Option<f64>,
    /// Our value; `None` where it is not measured.
    pub ours: Option<f64>,
    /// Explanation.
    pub note: String,
}

impl Item {
    /// Relative difference of our value from the printed one, %.
    #[must_use]
    pub fn difference_pct(&self) -> Option<f64> {
        let (printed, ours) = (self.printed?, self.ours?);
        if printed == 0.0 {
            return (ours == 0.0).then_some(0.0);
        }
        Some(100.0 * (ours - printed) / printed)
    }

    /// Part, name and unit in one line.
    #[must_use]
    pub fn name(&self) -> String {
        let unit = if self.unit.is_empty() {
            String::new()
        } else {
            format!(", {}", self.unit)
        };
        format!("{}: {}{unit}", self.part, self.what)
    }
}

/// A built-in job with its geometry.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of the file under `jobs/`, without extension.
    pub name: &'static str,
    /// The job.
    pub job: Job,
    /// Its geometry.
    pub oracle: Oracle,
}

impl Case {
    /// Parses a job and sets its spacing.
    fn new(name: &'static str, text: &str, spacing: Spacing) -> Result<Self, ApproachError> {
        let file = format!("jobs/{name}.toml");
        let mut job =
            job_file::parse(&file, text).map_err(|error| ApproachError::Fault(error.to_string()))?;
        job.spacing = spacing;
        let oracle = Oracle::new(&job)?;
        Ok(Self { name, job, oracle })
    }

    /// A copy with another sampling period.
    #[must_use]
    pub fn with_period_us(&self, period_us: f64) -> Self {
        let mut case = self.clone();
        case.job.machine.period_us = period_us;
        case.oracle.period_s = case.job.machine.period_s();
        case
    }
}

/// The jobs of the study: built-in copies of the sample jobs.
#[derive(Clone, Debug)]
pub struct Cases {
    /// Examples 1, 3, 4, 5, passes along u.
    pub revolved: Case,
    /// The same, passes along v.
    pub revolved_v: Case,
    /// Example 2 as printed.
    pub printed: Case,
    /// Example 2 reconstructed from its results.
    pub reconstructed: Case,
    /// The freeform part, which is not in the paper.
    pub freeform: Case,
}

impl Cases {
    /// Parses all jobs.
    ///
    /// # Errors
    /// None that these jobs cause.
    pub fn new() -> Result<Self, ApproachError> {
        let paper = Spacing::FirstOrder;
        Ok(Self {
            revolved: Case::new("revolved", include_str!("../../../../jobs/revolved.toml"), paper)?,
            revolved_v: Case::new(
                "revolved_v",
                include_str!("../../../../jobs/revolved_v.toml"),
                paper,
            )?,
            printed: Case::new(
                "ruled_printed",
                include_str!("../../../../jobs/ruled_printed.toml"),
                paper,
            )?,
            reconstructed: Case::new(
                "ruled_reconstructed",
                include_str!("../../../../jobs/ruled_reconstructed.toml"),
                paper,
            )?,
            freeform: Case::new(
                "freeform",
                include_str!("../../../../jobs/freeform.toml"),
                Spacing::Exact,
            )?,
        })
    }
}

/// The results of the study.
#[derive(Clone, Debug)]
pub struct Study {
    /// The jobs.
    pub cases: Cases,
    /// All numbers.
    pub items: Vec<Item>,
    /// The four approaches on whole jobs.
    pub comparisons: Vec<Comparison>,
    /// Passes of constant scallop height beside straight ones.
    pub spacings: Vec<SpacingTable>,
    /// Data of the figures.
    pub figures: Figures,
}

/// Progress steps of the study.
pub const STEPS: u64 = 2 + compare::RUNS * compare::PARTS + spacing::STEPS;

/// Runs the study. `step` is called after each of [`STEPS`] steps, from any thread.
///
/// # Errors
/// None that these jobs cause; those of the approaches.
pub fn study(step: &(dyn Fn() + Sync)) -> Result<Study, ApproachError> {
    let cases = Cases::new()?;
    let comparisons = compare::comparisons(&cases, step)?;
    let spacings = spacing::tables(&cases, step)?;
    let figures = Figures::new(&cases)?;
    step();
    let mut items = examples::items(&cases, &comparisons)?;
    items.extend(table_1::items(&table_1::Ours::golden()));
    step();
    Ok(Study {
        cases,
        items,
        comparisons,
        spacings,
        figures,
    })
}
