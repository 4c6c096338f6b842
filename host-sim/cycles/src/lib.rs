//! Cycle budgets: the firmware in QEMU with a plugin that counts the cycles of each tick on a Cortex-M4F.
//!
//! ```text
//!  image ──stages──► plan ──► plugin in QEMU ──► a record a tick ──figures──► min, mean, max, histogram
//!    (stage of each instruction,                  │ measure       └─operations─► operations of a sample
//!     from the image's line tables)               └─ runs a job's first ticks      golden, chart: table, SVG
//! ```
//!
//! The cycle models and their limits: `cycle_plugin::cost`.

pub mod chart;
pub mod figures;
pub mod golden;
pub mod graph;
pub mod image;
pub mod measure;
pub mod operations;
pub mod search;
pub mod session;
pub mod stages;

use std::path::PathBuf;

use machine::remote::RemoteError;
use machine::remote::qemu::QemuError;

/// Cycles of a period of 1 ms at 168 MHz.
pub const PERIOD_CYCLES: u32 = 168_000;

/// Greatest portion of the planning task in a period, cycles, in the pessimistic model: 21 % of the period. By the nominal model it is below
/// 30 000.
pub const PLANNING_CYCLES_MAX: u32 = 36_000;

/// Ticks of each job, which contain changes of pass and of patch.
pub const TICKS: u32 = 20_000;

/// Kinds of surface, each with the name of a sample job.
pub const SURFACES: [(&str, &str); 6] = [
    ("revolved along u", "revolved"),
    ("revolved along v", "revolved_v"),
    ("ruled", "ruled_printed"),
    ("bicubic", "plate"),
    ("NURBS non-rational", "freeform"),
    ("NURBS rational", "torus"),
];

/// Ticks of a job with limits: look-ahead of the first pass, approach, a pass, a link, and the next pass. Fewer, because they run
/// slowly.
pub const TICKS_WITHIN_LIMITS: u32 = 10_000;

/// Ticks of a job of constant scallop height: the first pass, which is straight, and some curved ones.
pub const TICKS_ON_CURVES: u32 = 8_000;

/// Ticks of a job of constant scallop height with axis limits, or of one with a region: the first passes, and some links.
pub const TICKS_ON_CURVES_WITHIN_LIMITS: u32 = 5_000;

/// Greatest share of the period that a tick of a job of the table takes, in the pessimistic model, %.
pub const TICK_SHARE_MAX_PCT: f64 = 3.0;

/// Further jobs, of `tests/golden`, with their ticks: curved passes; step rates and limits, which are independent of the kind of surface.
pub const FURTHER: [(&str, &str, u32); 10] = [
    ("constant height, bicubic", "constant_bicubic", TICKS_ON_CURVES),
    ("constant height, rational", "constant_rational", TICKS_ON_CURVES),
    (
        "constant height, rational, pole",
        "constant_pole",
        TICKS_ON_CURVES,
    ),
    (
        "constant height, limits",
        "constant_limits",
        TICKS_ON_CURVES_WITHIN_LIMITS,
    ),
    (
        "constant height, region",
        "constant_region",
        TICKS_ON_CURVES_WITHIN_LIMITS,
    ),
    (
        "constant height, region, limits",
        "constant_region_limits",
        TICKS_ON_CURVES_WITHIN_LIMITS,
    ),
    ("three axes at 400 kHz", "pulses", TICKS),
    ("limits, zig", "limits_zig", TICKS_WITHIN_LIMITS),
    ("limits, zigzag", "limits_zigzag", TICKS_WITHIN_LIMITS),
    (
        "limits, three axes at 400 kHz",
        "limits_pulses",
        TICKS_WITHIN_LIMITS,
    ),
];

/// All jobs of the table: their names, files and ticks.
#[must_use]
pub fn jobs() -> Vec<(&'static str, PathBuf, u32)> {
    let surfaces = SURFACES.map(|(name, job)| (name, programs::sample_job(job), TICKS));
    let further = FURTHER.map(|(name, job, ticks)| (name, programs::golden(&format!("{job}.toml")), ticks));
    surfaces.into_iter().chain(further).collect()
}

/// Reason for a missing figure.
#[derive(Debug, thiserror::Error)]
pub enum BudgetError {
    /// QEMU, the firmware or the plugin is missing.
    #[error(transparent)]
    Qemu(#[from] QemuError),
    /// The board does not answer, or refuses a request.
    #[error(transparent)]
    Remote(#[from] RemoteError),
    /// A file cannot be read or written.
    #[error("{0}: {1}")]
    File(PathBuf, String),
    /// The image is not of the expected form.
    #[error("the firmware image cannot be used: {0}")]
    Image(String),
    /// The plugin's records are incomplete.
    #[error("the records of the plugin are incomplete: {0}")]
    Figures(String),
}
