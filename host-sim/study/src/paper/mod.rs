//! Lo's paper, whole: every example, table and figure, printed against ours.
//!
//! ```text
//! jobs (the paper's surfaces) ─► geometry.rs   lengths, speeds, passes by quadrature and scan
//!                             ─► examples.rs   Examples 1 to 6 as items: printed, ours, note
//!                             ─► table_1.rs    operations and cycles of a period
//!                             ─► compare.rs    the four approaches on whole jobs
//!                             ─► figures.rs    the data of Figures 3, 4, 5, 7, 8, 9
//! study ─► report/paper/: the page;  commands/paper.rs: terminal and JSON
//! ```
//!
//! Source: C.-C. Lo, "A new approach to CNC tool path generation", Computer-Aided Design 30 (1998). The project has the
//! paper's algorithms and figures as its notes tell them, not the paper's pictures: the figures here are reconstructions
//! of what a figure of that number shows, by the examples that it goes with.

pub mod compare;
mod examples;
pub mod figures;
pub mod geometry;
pub mod table_1;

use approach::ApproachError;
use job::{Job, Spacing};
use oracle::Oracle;

pub use compare::{Comparison, Row};
pub use figures::Figures;

/// One figure of the paper, or one that it could have printed.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// Where it belongs: "Example 1", "Table 1".
    pub part: &'static str,
    /// What it is.
    pub what: String,
    /// Its unit, empty for counts.
    pub unit: &'static str,
    /// Decimals that it is shown with.
    pub decimals: usize,
    /// What the paper prints.
    pub printed: Option<f64>,
    /// What we get; `None` where it is not measured.
    pub ours: Option<f64>,
    /// What there is to say about it.
    pub note: String,
}

impl Item {
    /// Ours against the printed, %.
    #[must_use]
    pub fn difference_pct(&self) -> Option<f64> {
        let (printed, ours) = (self.printed?, self.ours?);
        if printed == 0.0 {
            return (ours == 0.0).then_some(0.0);
        }
        Some(100.0 * (ours - printed) / printed)
    }

    /// Part, what and unit in one line.
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

/// A job that is built in, with its geometry.
#[derive(Clone, Debug)]
pub struct Case {
    /// The file's name under `jobs/`, without its ending.
    pub name: &'static str,
    /// The job.
    pub job: Job,
    /// Its geometry.
    pub oracle: Oracle,
}

impl Case {
    /// `spacing`: the paper's own examples have the paper's.
    fn new(name: &'static str, text: &str, spacing: Spacing) -> Result<Self, ApproachError> {
        let file = format!("jobs/{name}.toml");
        let mut job =
            job_file::parse(&file, text).map_err(|error| ApproachError::Fault(error.to_string()))?;
        job.spacing = spacing;
        let oracle = Oracle::new(&job)?;
        Ok(Self { name, job, oracle })
    }

    /// The same with another sampling period.
    #[must_use]
    pub fn with_period_us(&self, period_us: f64) -> Self {
        let mut case = self.clone();
        case.job.machine.period_us = period_us;
        case.oracle.period_s = case.job.machine.period_s();
        case
    }
}

/// The jobs of the study: the sample jobs of the same names, built in.
#[derive(Clone, Debug)]
pub struct Cases {
    /// Examples 1, 3, 4, 5, passes along u.
    pub revolved: Case,
    /// The same, passes along v.
    pub revolved_v: Case,
    /// Example 2 as printed.
    pub printed: Case,
    /// Example 2 as its results have it.
    pub reconstructed: Case,
    /// The freeform part, which is not in the paper.
    pub freeform: Case,
}

impl Cases {
    /// All of them.
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

/// All of it.
#[derive(Clone, Debug)]
pub struct Study {
    /// The jobs.
    pub cases: Cases,
    /// Every number.
    pub items: Vec<Item>,
    /// The four approaches on whole jobs.
    pub comparisons: Vec<Comparison>,
    /// What the pictures show.
    pub figures: Figures,
}

/// Steps of the study, for a progress bar.
pub const STEPS: u64 = 2 + compare::RUNS * compare::PARTS;

/// Computes all of it. `step` is called after each of [`STEPS`] steps, from any thread.
///
/// # Errors
/// None that these jobs cause; those of the approaches.
pub fn study(step: &(dyn Fn() + Sync)) -> Result<Study, ApproachError> {
    let cases = Cases::new()?;
    let comparisons = compare::comparisons(&cases, step)?;
    let figures = Figures::new(&cases)?;
    step();
    let mut items = examples::items(&cases, &comparisons)?;
    items.extend(table_1::items(None, table_1::golden_cycles().as_ref()));
    step();
    Ok(Study {
        cases,
        items,
        comparisons,
        figures,
    })
}
