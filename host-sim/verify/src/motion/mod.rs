//! Reference for a run's motion: nothing here comes from `interp-core`.
//!
//! ```text
//! samples ──limits.rs──► use of each axis's velocity, acceleration and jerk limit
//!         ──times.rs───► the time's parts, stands in contact
//!           point.rs     rest to rest along a line: the time-optimal jerk-limited duration
//! Oracle ───path.rs────► PassPath ──optimum.rs──► the least time of a pass: a lower bound, and a motion within the limits
//!                                   profile.rs    its speed, and the limit that binds it, place by place
//!                                   pass_time.rs  the run's passes and the whole job against it
//! ```

pub mod limits;
pub mod point;
pub mod times;

mod bound;
mod optimum;
#[cfg(test)]
mod optimum_tests;
mod pass_time;
mod path;
mod profile;
mod programme;
mod timing;

pub use bound::lower_bound_s;
pub use limits::{Peak, PeakMeter, Peaks};
pub use optimum::{NoFeasibleMotion, Optimum, PassEnd, optimum, optimum_profile};
pub use pass_time::{OptimumTimes, PassTime, RunPass, optimum_times};
pub use path::{CurvePoint, PassPath, PathPoint};
pub use profile::{Binding, EmittedSpeed, SpeedPoint};
pub use times::{JobTimes, LinkTime, Stand, StandPlace, TimeMeter};
