//! Passes of constant scallop height: a front y = g(x) over path share x and side share y that steps over the surface.
//!
//! ```text
//! Oracle ──strip.rs──► I - r II over (x, y) ──step.rs──► the next front ──limits.rs──► lowered until a spline can follow it
//!                                                │
//!                                                └──spline.rs──► Pass ──path.rs──► segments, length, bends
//!                                                                      └─crest.rs─► scallop heights by the swept ball
//! ```
//!
//! The ball at a contact leaves above the surface point at a small parameter distance d the height (I - r II)(d, d) / (2 r). So the scallop height is a squared
//! distance in that metric (T. Kim, "Constant cusp height tool paths as geodesic parallels on an abstract Riemannian manifold", Computer-Aided Design 39
//! (2007)), and the next pass is the parallel curve one step out. The metric gives direction and first length of a step; the length is then measured by the balls
//! at its two contacts.

mod crest;
mod limits;
mod path;
mod spline;
mod step;
mod strip;
#[cfg(test)]
mod tests;

pub use crest::CrestHeights;
pub use path::{Bends, Segment};
pub use spline::Spline;

use std::fmt;

use super::contact::{Oracle, OracleError};
use step::Stepper;
use strip::Strip;

/// Largest number of passes of a part.
const PASSES_MAX: usize = 20_000;
/// Least advance of some station in one pass, as a share of its range.
const ADVANCE_MIN: f64 = 1e-7;

/// Line from which the front starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartLine {
    /// The boundary at the start of the side parameter's range.
    Edge,
    /// The boundary at its end.
    FarEdge,
    /// The middle of the range: to its end, then from the middle to its start.
    Middle,
}

/// Reason for which there is no front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrontError {
    /// No contact geometry.
    Oracle(OracleError),
    /// The ball does not fit.
    BallDoesNotFit {
        /// Path share.
        x: f64,
        /// Side share.
        y: f64,
    },
    /// The front does not advance.
    Stalls {
        /// Number of the pass.
        pass: usize,
    },
}

impl From<OracleError> for FrontError {
    fn from(error: OracleError) -> Self {
        Self::Oracle(error)
    }
}

impl fmt::Display for FrontError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Oracle(error) => error.fmt(out),
            Self::BallDoesNotFit { x, y } => write!(out, "the ball does not fit at shares {x}, {y}"),
            Self::Stalls { pass } => write!(out, "the front does not advance after pass {pass}"),
        }
    }
}

impl std::error::Error for FrontError {}

/// Settings of a front.
#[derive(Clone, Debug, PartialEq)]
pub struct FrontOptions {
    /// Design height as a share of the scallop limit.
    pub margin: f64,
    /// Greatest angle of a pass to the lines of constant side parameter, rad.
    pub angle_max_rad: f64,
    /// Greatest turn from one interval to the next, towards the next pass and away from it, rad.
    pub turn_towards: f64,
    /// See `turn_towards`.
    pub turn_away: f64,
    /// Rounds of the check between stations.
    pub repairs: usize,
    /// Least number of parts of a span, and of stations of a pass.
    pub stations_per_span: usize,
    /// See `stations_per_span`.
    pub stations_min: usize,
    /// Least distance of stations, as a share of the step-over on a plane.
    pub station_spacing: f64,
    /// Least radius of a bend, as a multiple of the length of a sample's step, times 1 + the tangent of the pass's angle to the lines across.
    pub radius_min: f64,
    /// Excess of the step between stations, as a share.
    pub slack: f64,
    /// How far beyond the end line the front is followed, side share.
    pub beyond: f64,
}

impl Default for FrontOptions {
    fn default() -> Self {
        Self {
            margin: 0.9965,
            angle_max_rad: 80.0_f64.to_radians(),
            turn_towards: 0.10,
            turn_away: 0.15,
            repairs: 3,
            stations_per_span: 8,
            stations_min: 65,
            station_spacing: 0.5,
            radius_min: 20.0,
            slack: 0.0005,
            beyond: 0.5,
        }
    }
}

/// The fronts from one line to a boundary.
#[derive(Clone, Debug)]
pub struct FrontPart {
    /// Side parameter of the start line and of the end line.
    pub side: [f64; 2],
    /// The passes y = g(x) over path share and side share (0 on the start line, 1 on the end line). The last one lies on the end line.
    pub passes: Vec<Spline>,
}

/// The passes of a job.
#[derive(Clone, Debug)]
pub struct Fronts<'a> {
    oracle: &'a Oracle,
    /// One part, or two from the middle; the second one's first pass is the first one's, and is not machined again.
    pub parts: Vec<FrontPart>,
}

impl<'a> Fronts<'a> {
    /// Steps fronts over the whole surface.
    ///
    /// # Errors
    /// [`FrontError`] at the first place without a step.
    pub fn new(oracle: &'a Oracle, start: StartLine, options: &FrontOptions) -> Result<Self, FrontError> {
        let [low, high] = oracle.side_range();
        let middle = 0.5 * (low + high);
        let sides = match start {
            StartLine::Edge => vec![[low, high]],
            StartLine::FarEdge => vec![[high, low]],
            StartLine::Middle => vec![[middle, high], [middle, low]],
        };
        let parts = sides
            .into_iter()
            .map(|side| FrontPart::new(oracle, side, options))
            .collect::<Result<_, _>>()?;
        Ok(Self { oracle, parts })
    }

    fn strip(&self, part: &FrontPart) -> Strip<'a> {
        Strip {
            oracle: self.oracle,
            path: self.oracle.path_range(),
            side: part.side,
        }
    }
}

impl FrontPart {
    fn new(oracle: &Oracle, side: [f64; 2], options: &FrontOptions) -> Result<Self, FrontError> {
        let strip = Strip {
            oracle,
            path: oracle.path_range(),
            side,
        };
        let stepper = Stepper::new(strip, options)?;
        let x = stepper.stations();
        let mut passes = vec![Spline::new(x, vec![0.0; x.len()])];
        while let Some(pass) = passes.last() {
            let next = stepper.advance(pass)?;
            if next.iter().all(|y| *y >= 1.0) {
                break;
            }
            let advances = next
                .iter()
                .zip(pass.values())
                .any(|(new, old)| new - old > ADVANCE_MIN);
            if !advances || passes.len() > PASSES_MAX {
                return Err(FrontError::Stalls { pass: passes.len() });
            }
            passes.push(Spline::new(x, next));
        }
        passes.push(Spline::new(x, vec![1.0; x.len()]));
        Ok(Self { side, passes })
    }
}
