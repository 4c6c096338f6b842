//! Reference for a run's motion: nothing here comes from `interp-core`.
//!
//! ```text
//! samples ──limits.rs──► use of each axis's velocity, acceleration and jerk limit
//!           point.rs     rest to rest along a line: the time-optimal jerk-limited duration
//! Oracle ───path.rs────► PassPath ──optimum.rs──► the least time of a pass: a lower bound, and a motion within the limits
//! ```

pub mod limits;
pub mod point;

mod bound;
mod optimum;
#[cfg(test)]
mod optimum_tests;
mod path;
mod programme;
mod timing;

pub use bound::lower_bound_s;
pub use limits::{Peak, PeakMeter, Peaks};
pub use optimum::{NoFeasibleMotion, Optimum, optimum};
pub use path::{CurvePoint, PassPath, PathPoint};
