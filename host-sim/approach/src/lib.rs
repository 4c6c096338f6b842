//! The paper's four ways from a surface to a moving tool, behind one interface: plan a pass, write what a CNC would have
//! to be fed for it, follow it period by period.
//!
//! ```text
//! job ─► oracle ─► PassPath ─► Approach::plan ─► Program ─┬─ write ─► segments, bytes
//!                                                          └─ follow ─► a centre each period ─► foot on the pass ─┐
//! job ─► prepare ─► machine (the core): the product ──────────────────────────────────────────────────────────────┴► Motion
//! ```
//!
//! The first three command the tool's centre; the contact under it is the foot of that centre on the exact offset path, so
//! their contact speed and ripple are measured with the same yardstick as the product's: arc length between two contacts.
//! All plan in f64 on the oracle's geometry: they get every digit that they could wish for, and what is left is theirs.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

mod arcs;
mod constant_cl;
mod cubic;
mod curve;
pub mod export;
pub mod gcode;
mod linear;
mod measure;
mod nodes;
mod pass;
mod run;

use std::fmt;

pub use arcs::Arcs;
pub use constant_cl::ConstantCl;
pub use cubic::Cubic;
pub use curve::{Curve, SPEED_SHARE};
pub use linear::{Chord, Chords, Linear, chords, even_chords};
pub use measure::{Measured, measure, measure_run};
pub use nodes::{Node, Nodes};
pub use pass::PassPath;
pub(crate) use pass::from_segment;
pub use run::{Motion, Planned, passes, planned, run};

use job::Job;
use oracle::OracleError;

/// How the tool path is made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Existing practice: chords of the tool centre's path, at constant speed of the tool's centre.
    ConstantCl,
    /// Lo's method 1: chords, each at the speed that keeps the contact at the feed, cut into whole periods.
    Linear,
    /// Lo's method 2: cubic splines for the tool centre's path and for its speed.
    Curve,
    /// Lo's method 3, the product: the surface itself, sampled each period.
    Surface,
}

impl Kind {
    /// All of them, in the paper's order.
    pub const ALL: [Self; 4] = [Self::ConstantCl, Self::Linear, Self::Curve, Self::Surface];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ConstantCl => "constant-cl",
            Self::Linear => "linear",
            Self::Curve => "curve",
            Self::Surface => "surface",
        }
    }

    /// The approach for a job; `None` for the product, which is not planned here but runs on the core.
    #[must_use]
    pub fn plan_for(self, job: &Job) -> Option<Box<dyn Approach>> {
        match self {
            Self::ConstantCl => Some(Box::new(ConstantCl::new(job))),
            Self::Linear => Some(Box::new(Linear::new(job, Chords::Held))),
            Self::Curve => Some(Box::new(Curve::new(job))),
            Self::Surface => None,
        }
    }
}

/// Why an approach has no motion for a job.
#[derive(Clone, Debug, PartialEq)]
pub enum ApproachError {
    /// The geometry has no answer.
    Geometry(OracleError),
    /// A pass cannot be cut into segments within the tolerance.
    NoSegment {
        /// Path parameter of the place.
        path: f64,
        /// Side parameter of the pass.
        side: f64,
    },
    /// The core refused the job or stopped with a fault.
    Fault(String),
}

impl From<OracleError> for ApproachError {
    fn from(error: OracleError) -> Self {
        Self::Geometry(error)
    }
}

impl fmt::Display for ApproachError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Geometry(error) => error.fmt(out),
            Self::NoSegment { path, side } => write!(
                out,
                "no segment from path parameter {path} on the pass at {side} holds the tolerance, however short"
            ),
            Self::Fault(sentence) => out.write_str(sentence),
        }
    }
}

impl std::error::Error for ApproachError {}

impl ApproachError {
    /// What to do about it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Geometry(OracleError::BallDoesNotFit { .. }) => {
                "take a smaller ball, or machine this region with another tool"
            }
            Self::Geometry(OracleError::NoUpperSide) => "say side = \"+\" or \"-\"",
            Self::Geometry(_) => {
                "end the surface before this place, or take a larger scallop height or a larger ball"
            }
            Self::NoSegment { .. } => {
                "the path has a corner there: allow more chord error, or use --approach surface"
            }
            Self::Fault(_) => "see the remedy above",
        }
    }
}

/// An approach that plans each pass before it is cut.
pub trait Approach {
    /// The pass as it is fed to a CNC.
    ///
    /// # Errors
    /// The pass has places without a normal, or no segments within the tolerance.
    fn plan(&self, pass: &PassPath<'_>) -> Result<Box<dyn Program>, ApproachError>;
}

/// What takes the tool's centre after each period, mm, with a guess of its contact's path parameter.
pub type Each<'a> = dyn FnMut([f64; 3], f64) -> Result<(), ApproachError> + 'a;

/// A pass as an approach feeds it to a CNC.
pub trait Program {
    /// Segments.
    fn segments(&self) -> usize;

    /// Appends the blocks as a CNC would read them.
    fn write(&self, out: &mut String);

    /// Largest step of the commanded centre's speed from one segment to the next, mm/s.
    fn speed_step_mm_s(&self) -> f64;

    /// Hands on the commanded tool centre after each period, with a guess of the path parameter of its contact; the
    /// last one is the pass's end. The pass's beginning is not among them.
    ///
    /// # Errors
    /// As [`Approach::plan`].
    fn follow(&self, pass: &PassPath<'_>, period_s: f64, each: &mut Each<'_>) -> Result<(), ApproachError>;
}
