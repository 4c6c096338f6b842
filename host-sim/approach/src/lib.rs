//! The four approaches of the paper to the tool path of a surface, behind one interface: plan a pass, write the program of a CNC
//! for it, follow it period by period.
//!
//! ```text
//! job ─► oracle ─► PassPath ─► Approach::plan ─► Program ─┬─ write ─► segments, bytes
//!                                                          └─ follow ─► a centre each period ─► foot on the pass ─┐
//! job ─► prepare ─► machine (the core): the product ──────────────────────────────────────────────────────────────┴► Motion
//! ```
//!
//! The first three command the ball centre (CL). Its contact is the foot of the centre on the exact offset path, so that contact speed
//! and feed ripple are measured as for the product: by the arc length between two contacts. All plan in f64 on the exact geometry of
//! the oracle; the error that remains is the method's.

mod arcs;
mod chords;
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
mod side_curve;

use glam::DVec3;
use std::fmt;

pub use arcs::Arcs;
pub use chords::{Chord, Chords, chords, even_chords};
pub use constant_cl::ConstantCl;
pub use cubic::Cubic;
pub use curve::{Curve, SPEED_SHARE};
pub use linear::Linear;
pub use measure::{Measured, measure, measure_run};
pub use nodes::{Node, Nodes};
pub use pass::PassPath;
pub(crate) use pass::from_segment;
pub use run::{Motion, Planned, job_passes, passes, planned, run};
pub use side_curve::{SideCurve, side_curves};

use job::Job;
use oracle::OracleError;

/// Approach to the tool path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// Existing practice: chords of the CL path, at constant CL speed.
    ConstantCl,
    /// Lo's method 1: chords, each at the speed that keeps the contact at the feed, divided into whole periods.
    Linear,
    /// Lo's method 2: cubic splines for the CL path and for its speed.
    Curve,
    /// Lo's method 3, the product: the surface itself, sampled each period.
    Surface,
}

impl Kind {
    /// All approaches, in the order of the paper.
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

    /// The approach for a job; `None` for the product, which runs on the core.
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

/// Failure of an approach.
#[derive(Clone, Debug, PartialEq)]
pub enum ApproachError {
    /// The geometry is undefined.
    Geometry(OracleError),
    /// A pass cannot be divided into segments within the tolerance.
    NoSegment {
        /// Path parameter of the point.
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
                "no segment from path parameter {path} on the pass at {side} is within the tolerance, however short"
            ),
            Self::Fault(sentence) => out.write_str(sentence),
        }
    }
}

impl std::error::Error for ApproachError {}

impl ApproachError {
    /// The remedy.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::Geometry(OracleError::BallDoesNotFit { .. }) => {
                "take a smaller ball, or machine this region with another tool"
            }
            Self::Geometry(OracleError::NoUpperSide) => "set side = \"+\" or \"-\"",
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

/// An approach that plans each pass before it runs.
pub trait Approach {
    /// Plans a pass.
    ///
    /// # Errors
    /// The pass has points without a normal, or no segments within the tolerance.
    fn plan(&self, pass: &PassPath<'_>) -> Result<Box<dyn Program>, ApproachError>;
}

/// Receives the ball centre after each period, mm, and an estimate of the path parameter of its contact.
pub type Each<'a> = dyn FnMut(DVec3, f64) -> Result<(), ApproachError> + 'a;

/// A planned pass.
pub trait Program {
    /// Number of segments.
    fn segments(&self) -> usize;

    /// Appends the blocks of a CNC program.
    fn write(&self, out: &mut String);

    /// Largest step of the commanded CL speed between two segments, mm/s.
    fn speed_step_mm_s(&self) -> f64;

    /// Passes on the commanded ball centre after each period, with an estimate of the path parameter of its contact. The start of
    /// the pass is not included; the last one is its end.
    ///
    /// # Errors
    /// As [`Approach::plan`].
    fn follow(&self, pass: &PassPath<'_>, period_s: f64, each: &mut Each<'_>) -> Result<(), ApproachError>;
}
