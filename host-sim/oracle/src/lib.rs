//! Independent geometry in f64, to check the core against.
//!
//! Nothing here comes from `interp-core` or from the preparation of its data: surfaces are evaluated straight from the
//! job file, parameters and positions are plain numbers. What both could get wrong the same way is caught by the golden
//! table in `tests/golden`, computed elsewhere with 40 digits.
//!
//! ```text
//! SurfaceSpec -> surface.rs, nurbs.rs   S and its derivatives up to the second order
//!             -> contact.rs             normal, curvatures, step-over, interval (steps 2 to 4 of the interpolator)
//!             -> arc.rs                 arc length along a pass
//!             -> offset.rs              the tool centre's path: its velocity, and the contact under a given centre
//!             -> schedule.rs            passes by a dense scan
//! samples     -> verify.rs, report.rs   errors of what a machine emitted
//! ```
//!
//! Lengths are mm, angles rad, curvatures 1/mm (above 0 where the surface bends towards the tool), unless a name's
//! suffix says otherwise. The normal's sign refers to `S_u x S_v`, whichever parameter the passes run along.
//!
//! Source: C.-C. Lo, "A new approach to CNC tool path generation", Computer-Aided Design 30 (1998), here "Lo"; and
//! L. Piegl, W. Tiller, "The NURBS Book" (2nd ed., 1997), here "P&T".
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

mod arc;
mod contact;
mod nurbs;
mod offset;
mod report;
mod schedule;
mod surface;
#[cfg(test)]
mod tests;
pub mod vector;
mod verify;

pub use contact::{Contact, Oracle, OracleError};
pub use offset::Offset;
pub use report::{Bounds, Figure, Report, Spot};
pub use schedule::Pass;
pub use surface::{Derivatives, Surface};
pub use verify::{Checked, Emitted, Verifier};
