//! The barrier method: the coefficients P of the pace that minimise `sum 1/sqrt(c)` within the limits.
//!
//! At a place with walk rates v, a, j (by time at pace 1), per axis:
//! `|X0 c + X1 c'| < 1` for the acceleration and `|Y0 c + Y1 c' + Y2 c''| < (1 - E2 c)/sqrt(c) - E1` for the jerk, E from a jump nearby; `Z c < 1` for the
//! speed. The rows are taken at each node (that of the jerk on both sides) and on either side of each jump, those of the
//! speed also in the middle of each interval. A place is weighted by its share of the time.

mod rows;
mod sweep;
mod system;

use super::limits::MotionLimits;
use super::lists::{LIST, Lists, draft, get};
use super::plan::{COEFFICIENTS, Plan};
use crate::math::arith::inverse_sqrt;
use crate::math::number::Bounded;
pub(crate) use rows::Reach;
use rows::{Local, SLACK_MIN, Sums};
pub(crate) use sweep::Sweep;
use sweep::{MIDDLE, at_jumps, at_middle, at_node, at_stencil, local, middle, three};
pub(crate) use system::{clear, solve};
use system::{positive, scatter, scatter_jump, scatter_node};

/// Lists of the method: gradient, three diagonals of the Hessian, and the shape of the pace by which places are weighted.
const GRADIENT: usize = 0;
const DIAGONALS: [usize; 3] = [1, 2, 3];
pub(crate) const SHAPE: usize = 4;
const _: () = assert!(LIST >= COEFFICIENTS);

/// Greatest factor of the pace that keeps the rows of a node and after it.
#[inline(never)]
pub(crate) fn factor(plan: &Plan, limits: &MotionLimits, lists: &Lists, sweep: &mut Sweep) -> f32 {
    let (place, speed) = at_node(plan, limits, sweep);
    let pace = local(draft(lists), sweep.node, plan.intervals);
    let mut factor = place.factor(limits, speed * place.v * place.v, &pace);
    if let Some((interval, row)) = middle(plan, sweep.node, [sweep.speed, speed]) {
        let use_of_row = row * at_middle(&three(lists, interval));
        factor = factor.at_most(1.0 / use_of_row.at_least(1e-9));
    }
    sweep.speed = speed;
    let coefficients = three(lists, sweep.node);
    at_jumps(plan, limits, sweep, &mut |place, weights| {
        let pace = at_stencil(weights, &coefficients);
        factor = factor.at_most(place.factor(limits, 0.0, &pace));
    });
    factor
}

/// The greatest use of an acceleration or a jerk at a node and after it.
#[inline(never)]
pub(crate) fn most_used(plan: &Plan, limits: &MotionLimits, lists: &Lists, sweep: &mut Sweep) -> f32 {
    let (place, _) = at_node(plan, limits, sweep);
    let mut most = place.most_used(limits, &local(draft(lists), sweep.node, plan.intervals));
    let coefficients = three(lists, sweep.node);
    at_jumps(plan, limits, sweep, &mut |place, weights| {
        most = most.at_least(place.most_used(limits, &at_stencil(weights, &coefficients)));
    });
    most
}

/// A coefficient's share of the time.
fn share(lists: &Lists, weight: f32, index: u16) -> f32 {
    weight * inverse_sqrt(get(lists, SHAPE, index).at_least(1e-9))
}

/// Adds the rows of a node and after it to gradient and Hessian. `weight`: one over the sum of `1/sqrt(shape)`.
#[inline(never)]
pub(crate) fn assemble(
    plan: &Plan,
    limits: &MotionLimits,
    lists: &mut Lists,
    sweep: &mut Sweep,
    mu: f32,
    weight: f32,
) {
    let node = sweep.node;
    let (place, speed) = at_node(plan, limits, sweep);
    let pace = local(draft(lists), node, plan.intervals);
    let mu = mu * share(lists, weight, node);
    let mut sums = Sums::default();
    // The place's part of the time, and the row of its speed.
    let c = pace.c.at_least(1e-12);
    let root = inverse_sqrt(c);
    let inverse = root * root;
    let slope = 0.5 * weight * root * inverse;
    let row = speed * place.v * place.v;
    let force = row / (1.0 - row * c).at_least(SLACK_MIN);
    sums.g0 = mu * force - slope;
    sums.k00 = mu * force * force + 1.5 * slope * inverse;
    place.barrier(limits, &pace, mu, &mut sums);
    scatter_node(lists, node, plan.intervals, &sums);
    if let Some((interval, row)) = middle(plan, node, [sweep.speed, speed]) {
        let force = row / (1.0 - row * at_middle(&three(lists, interval))).at_least(SLACK_MIN);
        scatter(lists, interval, &MIDDLE, mu * force, mu * force * force);
    }
    sweep.speed = speed;
    // Every coefficient stays positive.
    positive(lists, node, mu);
    if node == plan.intervals {
        positive(lists, node + 1, mu);
    }
    let coefficients = three(lists, node);
    at_jumps(plan, limits, sweep, &mut |place, weights| {
        let mut sums = Sums::default();
        place.barrier(limits, &at_stencil(weights, &coefficients), mu, &mut sums);
        scatter_jump(lists, node, weights, &sums);
    });
}

/// Adds the rows of a node and after it to the reach of the step.
#[inline(never)]
pub(crate) fn extend(
    plan: &Plan,
    limits: &MotionLimits,
    lists: &Lists,
    sweep: &mut Sweep,
    reach: &mut Reach,
) {
    let node = sweep.node;
    let Some(gradient) = lists.get(GRADIENT) else {
        return;
    };
    let (place, speed) = at_node(plan, limits, sweep);
    let pace = local(draft(lists), node, plan.intervals);
    let direction = direction(gradient, node, plan.intervals);
    let row = speed * place.v * place.v;
    reach.add(1.0 - row * pace.c, row * direction.c);
    place.reach(limits, &pace, &direction, reach);
    let back = |index: u16| {
        let at = |index: u16| -get(lists, GRADIENT, index);
        [at(index), at(index + 1), at(index + 2)]
    };
    let coefficients = three(lists, node);
    let steps = back(node);
    // The last node has one coefficient more.
    let last = if node == plan.intervals { node + 1 } else { node };
    for index in node..=last {
        let value = draft(lists).get(usize::from(index)).copied().unwrap_or(1.0);
        reach.add(value, get(lists, GRADIENT, index));
    }
    if let Some((interval, row)) = middle(plan, node, [sweep.speed, speed]) {
        let value = at_middle(&three(lists, interval));
        reach.add(1.0 - row * value, row * at_middle(&back(interval)));
    }
    sweep.speed = speed;
    at_jumps(plan, limits, sweep, &mut |place, weights| {
        let pace = at_stencil(weights, &coefficients);
        place.reach(limits, &pace, &at_stencil(weights, &steps), reach);
    });
}

/// The step's derivatives at a node.
fn direction(gradient: &[f32; LIST], node: u16, intervals: u16) -> Local {
    let Local { c, c1, c2 } = local(gradient, node, intervals);
    Local {
        c: -c,
        c1: -c1,
        c2: c2.map(|side| -side),
    }
}

/// Applies the step to the draft.
pub(crate) fn apply_step(plan: &Plan, lists: &mut Lists, step: f32) {
    if !(step > 0.0) {
        return;
    }
    let count = usize::from(plan.intervals) + 2;
    let [gradient, .., draft] = lists;
    for (pace, direction) in draft.iter_mut().zip(gradient).take(count) {
        *pace -= step * *direction;
    }
}
