//! Import of surfaces: from a face of a STEP, IGES or 3DM file to the `[surface]` of a job.
//!
//! ```text
//! file ──reader.rs──► Face: Surface (exact, mm, placed) + boundary      a separate program, `host-sim/cad-reader`
//!                     │ orientation.rs the normals of a solid that is inside out are turned
//!                     │ outline.rs     boundary -> a rectangle of (u, v), and whether the boundary is that rectangle
//!                     │ plane.rs, edges/   parameters that suit the face, where those of the file do not
//!                     ▼
//!                   Surface over a rectangle
//!                     │ exact.rs       analytic -> rational quadratics; B-splines by knot insertion; degree <= 3
//!                     │ fit.rs         others: a bicubic B-spline within a tolerance, measured
//!                     ▼
//!                   NurbsSpec ──measure.rs──► size, least concave radius ──job.rs──► a job file
//! ```
//!
//! Not in the sample path: f64; lengths in mm, angles in rad.

mod aspect;
mod crossings;
mod curve;
mod edges;
mod error;
mod exact;
mod faces;
mod fit;
mod interpolation;
mod invert;
mod job;
mod loops;
mod machinable;
mod measure;
mod orientation;
mod outline;
mod placement;
mod plane;
mod reader;
mod remap;
mod removal;
mod spline;
mod straight;
mod surface;
mod sweeps;
#[cfg(test)]
mod tests;
mod trim;
#[cfg(test)]
mod trim_tests;

pub use curve::Curve;
pub use error::CadError;
pub use faces::{Original, machinable_once, model_with, surface_of};
pub use fit::Deviation;
pub use interpolation::interpolation_error_mm;
pub use job::{FEED_MM_MIN, JobOptions, JobText, LIMITS, default_scallop_mm, machined_sign, write_job};
pub use machinable::{Form, MachinableFace, Options, degrees, machinable};
pub use measure::{Measures, measure};
pub use orientation::Solid;
pub use outline::{Outline, outline};
pub use placement::Placement;
pub use reader::{Model, read, read_once};
pub use spline::{Axis, DEGREE_MAX, Pole, SplineCurve, SplineSurface};
pub use surface::{Periodic, Surface};
pub use trim::{Polygon, TrimError, polylines, trim};

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// One smooth boundary edge as points at equal steps of its parameter, mm, in the order of the loop. Between them a cubic through the nearest four
/// is within 0.1 um of the edge.
pub type Edge = Vec<DVec3>;

/// Boundary of a face.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Boundary {
    /// The boundary of the surface itself.
    Natural,
    /// Closed loops of edges.
    Loops(Vec<Vec<Edge>>),
    /// A boundary that could not be read, and the reason.
    Unknown(String),
}

/// A face of a file, in mm, at its position in the assembly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// Number of the face, from 1, in the order of the file.
    pub number: usize,
    /// Name of its entity in the file, e.g. `#141` or `D5`.
    pub entity: String,
    /// Its name in the CAD system, or that of its body or part.
    #[serde(default)]
    pub name: Option<String>,
    /// Its colour, or that of its body: red, green, blue.
    #[serde(default)]
    pub colour: Option<[u8; 3]>,
    /// Its untrimmed surface.
    pub surface: Surface,
    /// Its boundary.
    pub boundary: Boundary,
    /// Sign of the normal of the face on `S_u x S_v`.
    pub sense: f64,
    /// Whether it bounds a solid; its normal then points out of the material, unless the file has the solid inside out: [`read`] turns it.
    pub solid: bool,
}

impl Face {
    /// The face, transformed; `None` if the placement distorts its kind of surface.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Option<Self> {
        let turn = if by.mirrors() { -1.0 } else { 1.0 };
        Some(Self {
            surface: self.surface.placed(by)?,
            boundary: self.boundary.placed(by),
            sense: self.sense * turn,
            ..self.clone()
        })
    }
}

impl Boundary {
    /// The boundary, transformed.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        let place = |edge: &Edge| edge.iter().map(|p| by.point(*p)).collect();
        match self {
            Self::Loops(loops) => Self::Loops(
                loops
                    .iter()
                    .map(|edges| edges.iter().map(place).collect())
                    .collect(),
            ),
            other => other.clone(),
        }
    }
}
