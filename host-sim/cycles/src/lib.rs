//! Cycle budgets: the firmware in QEMU with the plugin that counts what each tick takes on a Cortex-M4F.
//!
//! ```text
//!  image ──stages──► plan ──► plugin in QEMU ──► a record a tick ──figures──► min, mean, max, histogram
//!    (which stage an instruction belongs to,      │ measure                      │ golden, chart
//!     from the image's line tables)               └─ runs a job's first ticks    ▼ table, JSON, SVG
//! ```
//!
//! What a cycle is, and what the two models leave out, is said in `cycle_plugin::cost`.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

pub mod chart;
pub mod figures;
pub mod golden;
pub mod graph;
pub mod image;
pub mod lab;
pub mod measure;
pub mod search;
pub mod stages;

use std::path::PathBuf;

use machine::remote::RemoteError;
use machine::remote::qemu::QemuError;

/// Cycles of a period: 1 ms at 168 MHz.
pub const PERIOD_CYCLES: u32 = 168_000;

/// Ticks of each job: enough for changes of passes and of patches.
pub const TICKS: u32 = 20_000;

/// The kinds of surface, each with a job of it.
pub const SURFACES: [(&str, &str); 6] = [
    ("revolved along u", "revolved"),
    ("revolved along v", "revolved_v"),
    ("ruled", "ruled_printed"),
    ("bicubic", "plate"),
    ("NURBS non-rational", "freeform"),
    ("NURBS rational", "torus"),
];

/// Ticks of a job with limits: the first pass looked over, the way there, a pass and a link, and the next. They are dear to count.
pub const TICKS_WITHIN_LIMITS: u32 = 10_000;

/// Jobs of `tests/golden` that are counted besides, and their ticks: those that ask pulses or limits, which no kind of surface has
/// to do with.
pub const FURTHER: [(&str, &str, u32); 4] = [
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

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
pub enum BudgetError {
    /// QEMU, the firmware or the plugin is missing.
    #[error(transparent)]
    Qemu(#[from] QemuError),
    /// The board does not answer, or refuses.
    #[error(transparent)]
    Remote(#[from] RemoteError),
    /// A file cannot be read or written.
    #[error("{0}: {1}")]
    File(PathBuf, String),
    /// The image is not what is expected.
    #[error("the firmware image cannot be used: {0}")]
    Image(String),
    /// The plugin's figures are not whole.
    #[error("the figures are not whole: {0}")]
    Figures(String),
}
