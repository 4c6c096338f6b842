//! Independent f64 geometry, the reference for the core.
//!
//! Nothing here comes from `interp-core` or from the preparation of its data: surfaces are evaluated directly from the
//! job; parameters and positions are plain numbers. Errors common to both are caught by the golden
//! table in `tests/golden`, computed by other software with 40 digits.
//!
//! ```text
//! SurfaceSpec -> surface.rs, nurbs.rs   S and its derivatives up to the second order
//!             -> contact.rs             normal, curvatures, step-over, interval (steps 2 to 4 of the interpolator)
//!             -> arc.rs                 arc length along a pass
//!             -> offset.rs              the offset path of the tool centre: its derivative, and the foot point of a given centre
//!             -> region.rs              intervals of a region on a line
//!             -> schedule.rs            passes by a dense scan
//!             -> facing.rs              what looks down, and the turn after which nothing does
//!             -> front/                 passes of constant scallop height, curved and partial
//! samples     -> verify.rs, report.rs   errors of emitted samples
//! ```
//!
//! Lengths are mm, angles rad, curvatures 1/mm (above 0 where the surface is concave towards the tool), unless a name's
//! suffix states otherwise. The normal's sign refers to `S_u x S_v`, for either path parameter.
//!
//! Source: C.-C. Lo, "A new approach to CNC tool path generation", Computer-Aided Design 30 (1998), here "Lo"; and
//! L. Piegl, W. Tiller, "The NURBS Book" (2nd ed., 1997), here "P&T".

mod arc;
mod contact;
mod derivatives;
mod facing;
pub mod front;
mod nurbs;
mod offset;
mod region;
mod report;
mod schedule;
mod smooth;
mod surface;
#[cfg(test)]
mod tests;
mod verify;

pub use contact::{Contact, Oracle, OracleError};
pub use derivatives::Derivatives;
pub use facing::{Facing, facing, turned_further};
pub use offset::{OffsetPoint, foot_on};
pub use region::RegionEdges;
pub use report::{AccuracyBounds, AccuracyFigure, AccuracyReport, ErrorStatistics, SampleLocation};
pub use schedule::ScheduledPass;
pub use surface::Surface;
pub use verify::{PassSample, SampleCheck, Verifier};
