//! Feed along a path that a machine can follow: from standstill to the wanted feed and back, within what the axes allow.
//!
//! Two stages, so that each stays simple:
//!
//! 1. [`plan`] looks over the whole path in fixed portions: what the cutter centre's derivatives by arc length leave of each axis's
//!    velocity, acceleration and jerk becomes a cap of the speed, an acceleration along the path and a share of the jerk; from the end
//!    backwards, it becomes the greatest speed from which braking is still in time.
//! 2. [`profile`] follows, a step a period: an acceleration-limited speed below these bounds, and the mean of the last n periods of it.
//!    The mean of an acceleration that changes by no more than n J in n periods has a jerk of no more than J. With n and the acceleration
//!    chosen as [`plan`] does, a path from rest to rest takes the time of the optimum.
//!
//! Wishes (feed, override, hold, stop) are nothing but another wanted speed, in any period: what is taken up acts in the same one, and
//! no sequence of them can break a limit or leave the path.
//!
//! Speeds are in quanta (2^-10 nm) a period, so sums are exact integers.

pub(crate) mod demand;
pub(crate) mod plan;
pub(crate) mod profile;

/// Quanta of the arc in a nanometre, as a power of two.
pub(crate) const QUANTA_BITS: u32 = 10;

/// Quanta in a millimetre.
pub(crate) const QUANTA_PER_MM: f32 = 1_024e6;

/// Longest step of a period, quanta: it fits an i32.
pub(crate) const STEP_MAX: f32 = crate::job::STEP_MAX_MM * QUANTA_PER_MM;
