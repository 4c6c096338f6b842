//! Surfaces out of CAD files: from a STEP, IGES or 3DM file to the `[surface]` of a job.
//!
//! ```text
//! file ──reader.rs──► Face: Surface (exact, mm, placed) + boundary      a program of its own, `host-sim/cad-reader`
//!                     │ outline.rs     boundary -> a rectangle of (u, v), and whether the boundary is that rectangle
//!                     ▼
//!                   Surface over a rectangle
//!                     │ exact.rs       analytic -> rational quadratics; B-splines cut by knot insertion; degree <= 3
//!                     │ fit.rs         what has no such form: a bicubic B-spline within a tolerance, measured
//!                     ▼
//!                   NurbsSpec ──measure.rs──► size, least concave radius ──job.rs──► a job file
//! ```
//!
//! Nothing here is in the sample path: lengths are f64 mm, angles rad.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

mod curve;
mod error;
mod exact;
mod faces;
mod fit;
mod invert;
mod job;
mod machinable;
mod measure;
mod outline;
mod placement;
mod reader;
mod spline;
mod surface;
#[cfg(test)]
mod tests;

pub use curve::Curve;
pub use error::CadError;
pub use faces::Faces;
pub use fit::Deviation;
pub use job::{JobOptions, Written, write_job};
pub use machinable::{Form, Machinable, Options, degrees, machinable};
pub use measure::{Measures, measure};
pub use outline::{Outline, outline};
pub use placement::Placement;
pub use reader::{Model, read};
pub use spline::{Axis, DEGREE_MAX, Pole, SplineCurve, SplineSurface};
pub use surface::Surface;

use oracle::vector::Vector;
use serde::{Deserialize, Serialize};

/// One smooth boundary edge as points along it, mm, in the order of the loop.
pub type Edge = Vec<Vector>;

/// How a face is bounded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Boundary {
    /// By the surface's own ends.
    Natural,
    /// By closed loops of edges.
    Loops(Vec<Vec<Edge>>),
    /// By something that could not be read; the text says what.
    Unknown(String),
}

/// A face as its file gives it, in mm, where its assembly places it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// Number for people, from 1, in the order of the file.
    pub number: usize,
    /// Its entity in the file, e.g. `#141` or `D5`.
    pub entity: String,
    /// The surface that it lies on.
    pub surface: Surface,
    /// Its boundary.
    pub boundary: Boundary,
    /// Sign of the face's own normal on `S_u x S_v`.
    pub sense: f64,
    /// It bounds a solid, so that its normal points out of the material.
    pub solid: bool,
}
