//! A machining job in plain f64: surface, ball, cut and machine. Every default is applied when a [`Job`] is made, and [`MachineSpec::limits`]
//! alone decides whether the job has limits. The crate depends neither on TOML nor on the core, so the oracle can depend on this crate alone.
//!
//! Lengths are mm and angles rad; the feed stays in mm/min, as in the file. All values are finite and within their documented ranges.

mod error;
mod machine;
mod origin;
mod region;
mod setup;
mod surface;
mod text;
pub mod units;

pub use error::JobError;
pub use machine::{
    AT_SPEED_DEFAULT_MS, AXES, AxisLimits, CLEARANCE_DEFAULT_MM, Contact, HEARTBEAT_TIMEOUT_DEFAULT_MS,
    HEARTBEAT_TIMEOUT_RANGE_MS, HeartbeatAction, Homing, MachineProfile, MachineSpec, PERIOD_DEFAULT_US,
    PERIOD_RANGE_US, Ratio, Spindle, SpindleDrive, StepOutput,
};
pub use origin::{
    AlongChoice, CadSource, DirectionTrial, FaceParameters, FaceReach, Origin, PartSource, SpacingTrial,
    StartChoice,
};
pub use region::Region;
pub use setup::{Block, Fixture, HolderPart, Setup, TOOL_SIZE_MAX_MM, ToolBody};
pub use surface::{NurbsSpec, SurfaceSpec};
pub use text::{one_line, printable, read_regular};

/// Largest ball radius, mm: the core's limit, ten times the radius of any ball-end mill.
pub const RADIUS_MAX_MM: f64 = 1000.0;

/// Greatest overrun of a turn, mm.
pub const OVERRUN_MAX_MM: f64 = 100.0;
/// Lower bound of the feed (exclusive), mm/min (1 um/s): below it the core's parameter step loses digits.
pub const FEED_MIN_MM_MIN: f64 = 0.06;
/// Largest feed, mm/min (10 m/s): the core's limit.
pub const FEED_MAX_MM_MIN: f64 = 600_000.0;
/// Default of the chord error limit, mm: the paper's.
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

/// The side of the surface on which the tool is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Towards +z, for either sign of `S_u x S_v`.
    Up,
    /// The tool normal is `+ S_u x S_v`, for either pass direction.
    Plus,
    /// The tool normal is `- S_u x S_v`, for either pass direction.
    Minus,
}

/// Order of the passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Every pass runs in the same direction.
    Zig,
    /// Every second pass runs in the opposite direction.
    Zigzag,
}

/// Rule for the distance between passes at the given scallop height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Spacing {
    /// The largest interval for which the scallop height holds across the gap to the next pass.
    Exact,
    /// The paper's interval, evaluated at the pass alone; the scallop may exceed the height limit.
    FirstOrder,
    /// Passes of constant scallop height: curves, each made from the one before.
    Constant(Start),
}

/// Where passes of constant scallop height begin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// The first side boundary of the surface.
    Edge,
    /// The middle of the side parameter: from there to its end, then from there to its start.
    Middle,
}

impl Start {
    /// The word for it in job files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Edge => "edge",
            Self::Middle => "middle",
        }
    }
}

impl Spacing {
    /// The word for it in job files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::FirstOrder => "first-order",
            Self::Constant(_) => "constant",
        }
    }

    /// Where passes of constant scallop height begin.
    #[must_use]
    pub const fn start(self) -> Option<Start> {
        match self {
            Self::Constant(start) => Some(start),
            _ => None,
        }
    }

    /// Whether the passes are curves of constant scallop height.
    #[must_use]
    pub const fn is_constant(self) -> bool {
        matches!(self, Self::Constant(_))
    }
}

/// A job as its file states it.
#[derive(Clone, Debug, PartialEq)]
pub struct Job {
    /// The surface to be cut, placed as the file's `[placement]` states.
    pub surface: SurfaceSpec,
    /// The part of the surface that is cut; `None` for the whole surface.
    pub region: Option<Region>,
    /// Ball radius r, mm, above 0, at most [`RADIUS_MAX_MM`].
    pub radius_mm: f64,
    /// The tool above the ball.
    pub body: ToolBody,
    /// Stock and fixtures.
    pub setup: Setup,
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
    /// Rule for the distance between passes. The start of passes of constant scallop height is undefined while [`Origin::start_choice`] is
    /// [`StartChoice::Auto`].
    pub spacing: Spacing,
    /// Chord error limit delta, mm, above 0, below the ball radius; used by the approaches that cut chords.
    pub chord_mm: f64,
    /// Greatest length by which a turn of a zigzag job leaves the surface beyond its boundary, mm, 0 to [`OVERRUN_MAX_MM`]; 0 for a standstill at each
    /// pass end.
    pub overrun_mm: f64,
    /// The machine.
    pub machine: MachineSpec,
    /// The file, the line of each key, and the choice of the direction.
    pub origin: Origin,
}

impl Job {
    /// Feed along the surface, mm/s.
    #[must_use]
    pub fn feed_mm_s(&self) -> f64 {
        self.feed_mm_min / units::S_PER_MIN
    }

    /// The step-over on a plane, mm.
    #[must_use]
    pub fn plane_step_over_mm(&self) -> f64 {
        plane_step_over_mm(self.radius_mm, self.scallop_mm)
    }
}

/// The step-over of a ball on a plane, mm, at a scallop height far below its radius: sqrt(8 r h).
#[must_use]
pub fn plane_step_over_mm(radius_mm: f64, scallop_mm: f64) -> f64 {
    (8.0 * radius_mm * scallop_mm).sqrt()
}
