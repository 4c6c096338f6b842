//! Whole parts: what a ball-end tool, its axis along z, reaches of each face without touching another.
//!
//! ```text
//! faces of a file ──body.rs──► Part: cells of certified deviation, edges; each in a tree     distance of the part from a ball, from a cylinder
//!                                 │ clear.rs     steep, fit, ball, shank, holder: the first rule that a place of a face breaks
//!                                 ▼
//! trimmed region of a face ──region.rs──► grown by half a step-over where all rules hold ──contour.rs──► polygons of (u, v)
//!                                 ▲ crease.rs    cut at knots at which the tangent plane jumps
//!
//! ends of passes ──links.rs──► how each link goes: straight, or at the height that the tool needs over the part
//! emitted centres ──proof.rs──► the deepest place of the tool in the part, what is left on the reachable part of the face; verdicts: check.rs
//! ```
//!
//! Not in the sample path: f64; lengths in mm.

mod body;
mod cell;
mod check;
mod clear;
mod contour;
mod crease;
mod faces;
mod heights;
mod inside;
mod links;
mod picture;
mod proof;
mod region;
#[cfg(test)]
mod tests;
mod tool;
mod tree;
mod triangle;

pub use body::{Missing, Near, OwnContact, Part, PartFace};
pub use check::{PartCheck, PassCentres, check_run};
pub use clear::{Clearance, Place};
pub use contour::{Precision, Set};
pub use faces::{Asked, Faces, own_face, part_of, placed_part, placement};
pub use heights::HeightMap;
pub use inside::Inside;
pub use links::{Times, Way, crossing, passes, ways};
pub use picture::State;
pub use proof::{Deepest, LEFTOVER_SHARE, LEFTOVER_SIDE, Leftover, Passes, along, deepest, leftover};
pub use region::{GROWTH, Made, Request, STEP_MAX};
pub use tool::{Column, Reason, Tool};
pub use tree::Block;
