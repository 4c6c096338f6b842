//! The feed along a path, from rest to rest, as fast as each axis's velocity, acceleration and jerk allow.
//!
//! With q(s) the tool centre over the contact's arc, an axis moves with `q' v`, `q'' v^2 + q' a` and `q''' v^3 + 3 q'' v a + q' j`.
//! The planner does not seek v(s). It takes a rough walk S(k) from rest to rest and plans its pace c(k) = (dk/dt)^2:
//!
//! ```text
//! v = S' sqrt(c)      a = S'' c + S' c'/2      j = sqrt(c) (S''' c + 3/2 S'' c' + S' c''/2)
//! ```
//!
//! S carries the rests, so c is regular everywhere and of order 1: f32 suffices. The limits of velocity and acceleration are linear in c and
//! its derivatives, that of jerk is linear against `J/sqrt(c)`, which is convex. A barrier method with a fixed number of Newton steps minimises
//! the time, `sum 1/sqrt(c)`; the limits hold at the nodes after every step.
//!
//! | file | content |
//! |---|---|
//! | [`stations`] | derivatives of the path, from cutter locations rounded to nanometres |
//! | [`walk`] | the rough walk, and where its nodes lie ([`cell_motion`], [`node_times`], [`knots`]) |
//! | [`plan`] | a plan: stations, walk and pace; a cursor that moves along it |
//! | [`newton`] | the barrier method |
//! | [`planner`] | all of it in portions, and a check of the result period by period |
//! | [`follow`] | one period along a plan, at exactly the programmed feed where the plan reaches it |
//! | [`pace`] | hold, resume, override: the pace and its changes ([`change`]) |
//! | [`search`] | the search for a change that is within the limits ([`room`]) |
//! | [`profile`] | a change of the pace that uses at each place what the axes leave there |
//! | [`curve`] | rest to rest along a short or straight link in closed form |

mod cell_motion;
mod change;
pub(crate) mod curve;
pub(crate) mod deadlines;
pub(crate) mod follow;
mod knots;
pub(crate) mod limits;
mod lists;
mod newton;
mod node_times;
pub(crate) mod pace;
pub(crate) mod plan;
pub(crate) mod planner;
pub(crate) mod profile;
pub(crate) mod road;
mod room;
mod search;
pub(crate) mod stations;
pub(crate) mod turn;
mod walk;

#[cfg(test)]
mod tests;

use crate::math::number::integer_part;

/// Units of 2^-10 nm in a millimetre. Arcs are sums of these units, so that they are exact.
pub(crate) const Q10_PER_MM: f32 = 1_024e6;

/// Millimetres in a unit of 2^-10 nm.
pub(crate) const MM_PER_Q10: f32 = 1.0 / Q10_PER_MM;

/// Units of 2^-10 nm in a nanometre, as a power of two.
pub(crate) const Q10_BITS: u32 = 10;

/// A length of at least 0 in units of 2^-10 nm, rounded.
pub(crate) fn to_q10(mm: f32) -> i64 {
    integer_part(mm * Q10_PER_MM + 0.5)
}
