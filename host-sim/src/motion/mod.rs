//! What a run's motion is judged by: nothing here comes from `interp-core`.
//!
//! ```text
//! samples ──limits.rs──► use of each axis's velocity, acceleration and jerk limit
//!           point.rs     rest to rest along a line: the time-optimal jerk-limited duration
//! ```

pub mod limits;
pub mod point;

pub use limits::{Gauge, Peak, Peaks};
