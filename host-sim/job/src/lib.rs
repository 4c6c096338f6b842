//! A machining job in plain f64: surface, ball, cut and machine. Every default is applied when a [`Job`] is made, and [`Machine::limits`]
//! alone decides whether the job has limits. The crate knows neither TOML nor the core, so that the oracle can depend on it and on nothing else.
//!
//! Lengths are mm and angles rad; the feed stays in mm/min, as in the file. All values are finite and within their documented ranges.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

mod error;
mod machine;
mod origin;
mod surface;

pub use error::JobError;
pub use machine::{
    AXES, AxisLimits, HEARTBEAT_TIMEOUT_DEFAULT_MS, HEARTBEAT_TIMEOUT_RANGE_MS, HeartbeatAction, Machine,
    PERIOD_DEFAULT_US, PERIOD_RANGE_US, Ratio, StepOutput,
};
pub use origin::{AlongChoice, Origin, Trial};
pub use surface::{NurbsSpec, SurfaceSpec};

/// Largest ball radius, mm: ten times any ball-end mill; what the core accepts.
pub const RADIUS_MAX_MM: f64 = 1000.0;
/// Least feed, mm/min (1 um/s): below it the core's parameter step loses digits; a feed is above it.
pub const FEED_MIN_MM_MIN: f64 = 0.06;
/// Largest feed, mm/min (10 m/s): what the core accepts.
pub const FEED_MAX_MM_MIN: f64 = 600_000.0;
/// Chord error limit of a job that names none, mm: the paper's.
pub const CHORD_DEFAULT_MM: f64 = 0.005;

/// The surface parameter that runs along a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Along {
    /// Passes run along u; v is fixed on a pass.
    U,
    /// Passes run along v; u is fixed on a pass.
    V,
}

impl Along {
    /// The parameter's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::U => "u",
            Self::V => "v",
        }
    }
}

/// The side of the surface that the tool is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Towards +z, whichever sign of `S_u x S_v` that is.
    Up,
    /// The tool normal is `+ S_u x S_v`, whatever the pass direction.
    Plus,
    /// The tool normal is `- S_u x S_v`, whatever the pass direction.
    Minus,
}

/// Order of the passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Every pass runs the same way.
    Zig,
    /// Every second pass runs backwards.
    Zigzag,
}

/// How far apart passes lie for the scallop height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// As far as the height allows over the gap to the next pass.
    Exact,
    /// By the paper's interval at the pass alone, which may exceed the height.
    FirstOrder,
}

/// A job as its file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// The surface to be cut, placed where the file's `[placement]` wants it.
    pub surface: SurfaceSpec,
    /// Ball radius r, mm, above 0, at most [`RADIUS_MAX_MM`].
    pub radius_mm: f64,
    /// Feed of the cutter contact along the surface, mm/min, above [`FEED_MIN_MM_MIN`], at most [`FEED_MAX_MM_MIN`].
    pub feed_mm_min: f64,
    /// Scallop height limit h, mm, above 0, below the ball radius.
    pub scallop_mm: f64,
    /// The path parameter. Undefined while [`Origin::along_choice`] is [`AlongChoice::Auto`].
    pub along: Along,
    /// The side of the tool.
    pub side: Side,
    /// Order of the passes.
    pub pattern: Pattern,
    /// How far apart the passes lie.
    pub spacing: Spacing,
    /// Chord error limit delta, mm, above 0, below the ball radius; for the approaches that cut chords.
    pub chord_mm: f64,
    /// The machine.
    pub machine: Machine,
    /// The file, the line of each key, and who chose the direction.
    pub origin: Origin,
}

impl Job {
    /// Feed along the surface, mm/s.
    #[must_use]
    pub fn feed_mm_s(&self) -> f64 {
        self.feed_mm_min / 60.0
    }
}
