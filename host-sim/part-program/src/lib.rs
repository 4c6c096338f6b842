//! The program of a part: a job for each face that the tool reaches, their order, and the links between passes and between faces.
//!
//! ```text
//! faces of a file ──setup.rs──► PartSetup: side up, translation, the part on the machine
//!                      │ face.rs      region of a face, its job, the direction of its passes (estimate.rs)
//!                      ▼
//! FacePlan of each face ──order.rs──► order of the faces by the time of their links ──text.rs──► one job file of all faces
//!
//! a job that is read ──links.rs──► words of the links between its passes
//! the jobs of all faces ──stops.rs──► where the run of each face begins and ends
//! ```
//!
//! Not in the sample path: f64; lengths in mm.

mod estimate;
mod face;
mod links;
mod order;
mod planner;
mod setup;
#[cfg(test)]
mod sources;
mod stops;
mod sums;
mod text;

pub use estimate::PassEstimate;
pub use face::{FaceJob, FacePlan, FaceRefused};
pub use links::add_links;
pub use order::FaceOrder;
pub use planner::{CutOptions, JobFolder, Planner};
pub use setup::{PartSetup, UpSide};
pub use stops::{Stop, stops};
pub use sums::{Sums, percent};
