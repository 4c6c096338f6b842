//! A sweep over the places that have rows: nodes, middles of intervals, both sides of jumps.

use super::rows::{Local, Place};
use crate::feed::limits::MotionLimits;
use crate::feed::lists::{Lists, draft};
use crate::feed::plan::Plan;

/// Distance from a jump within which a node sees it, periods.
const JUMP_REACH: f32 = 2.0;

/// A sweep over the nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweep {
    pub(super) node: u16,
    /// The next jump.
    pub(super) knot: u16,
    /// Inverse square of the speed that the path allows at the node before, (s/mm)^2.
    pub(super) speed: f32,
}

impl Sweep {
    /// At the first node.
    pub(crate) const START: Self = Self {
        node: 0,
        knot: 0,
        speed: 0.0,
    };

    /// The node.
    pub(crate) const fn node(&self) -> u16 {
        self.node
    }

    /// Speed of the walk over a jump near the node, mm/s; none of a jump that does not matter.
    fn speed_over(&self, plan: &Plan, station: u16) -> Option<f32> {
        let places = [
            self.knot,
            self.knot.wrapping_sub(1),
            self.knot + 1,
            self.knot.wrapping_sub(2),
        ];
        let knot = places
            .iter()
            .filter_map(|place| plan.knot(*place))
            .find(|knot| knot.station == station)?;
        let [slope, _, _] = plan
            .interval(knot.interval)
            .walk_rates(f32::from(knot.part) * (1.0 / 65536.0));
        Some(slope * plan.inverse_step)
    }

    /// Jumps after the node.
    pub(crate) fn jumps(&self, plan: &Plan) -> u16 {
        let mut knot = self.knot;
        while plan.knot(knot).is_some_and(|knot| knot.interval == self.node) {
            knot += 1;
        }
        knot - self.knot
    }

    /// Moves to the next node; whether there is none.
    pub(crate) const fn next(&mut self, plan: &Plan) -> bool {
        self.node += 1;
        let is_over = self.node > plan.intervals;
        if is_over {
            *self = Self::START;
        }
        is_over
    }
}

/// Derivatives of a B-spline's coefficients at a node: c, c', c''; at the ends c'' is that of the other side.
pub(super) fn local(values: &[f32], node: u16, intervals: u16) -> Local {
    let at = |index: usize| values.get(index).copied().unwrap_or(0.0);
    let index = usize::from(node);
    let (here, next) = (at(index), at(index + 1));
    let after = at(index + 2) - 2.0 * next + here;
    let before = match index.checked_sub(1) {
        Some(previous) => at(previous) - 2.0 * here + next,
        None => after,
    };
    Local {
        c: 0.5 * (here + next),
        c1: next - here,
        c2: [before, if node < intervals { after } else { before }],
    }
}

/// The three coefficients of the pace of an interval.
pub(super) fn three(lists: &Lists, interval: u16) -> [f32; 3] {
    let from = usize::from(interval);
    match draft(lists).get(from..from + 3) {
        Some(&[a, b, c]) => [a, b, c],
        _ => [1.0; 3],
    }
}

/// A node's place, and the inverse square of the speed that the path allows there.
pub(super) fn at_node(plan: &Plan, limits: &MotionLimits, sweep: &Sweep) -> (Place, f32) {
    let node = sweep.node;
    let h = plan.inverse_step;
    let h2 = h * h;
    let walk = local(&plan.walk, node, plan.intervals);
    let v = walk.c * h;
    let [cell, part] = plan.node(node);
    let part = f32::from(part) * (1.0 / 65536.0);
    let stations = &plan.stations;
    let length = stations.cell_mm(cell);
    let near = JUMP_REACH * limits.period * v;
    let since = part * length;
    let jump = if cell > 0 && since <= near && stations.is_jump(cell - 1) {
        Some(cell - 1)
    } else if length - since <= near && stations.is_jump(cell + 1) {
        Some(cell + 1)
    } else {
        None
    };
    let place = Place {
        v,
        a: walk.c1 * h2,
        j: walk.c2.map(|j| j * h2 * h),
        h,
        q: stations.blend(cell, part),
        jump: jump.map_or([[0.0; 2]; 3], |station| limits.jump_jerk(&stations.jump(station))),
        at_jump: jump
            .and_then(|station| sweep.speed_over(plan, station))
            .unwrap_or(v),
    };
    let speed = limits.inverse_speed_sqr(&place.q);
    (place, speed)
}

/// The weights of an interval's coefficients for c, c', c'' at a fraction of it.
fn stencil(x: f32) -> [[f32; 3]; 3] {
    let y = 1.0 - x;
    [
        [0.5 * y * y, 0.5 + x * y, 0.5 * x * x],
        [-y, y - x, x],
        [1.0, -2.0, 1.0],
    ]
}

pub(super) fn at_stencil(weights: &[[f32; 3]; 3], [a, b, c]: &[f32; 3]) -> Local {
    let [value, first, second] = weights.map(|[x, y, z]| x * a + y * b + z * c);
    Local {
        c: value,
        c1: first,
        c2: [second; 2],
    }
}

/// Calls `each` with the place on either side of each jump between a node and the next.
#[inline(never)]
pub(super) fn at_jumps(
    plan: &Plan,
    limits: &MotionLimits,
    sweep: &mut Sweep,
    each: &mut dyn FnMut(&Place, &[[f32; 3]; 3]),
) {
    while let Some(knot) = plan.knot(sweep.knot).filter(|knot| knot.interval <= sweep.node) {
        if knot.interval == sweep.node {
            let x = f32::from(knot.part) * (1.0 / 65536.0);
            let h = plan.inverse_step;
            let [s1, s2, s3] = plan.interval(knot.interval).walk_rates(x);
            let jump = if plan.stations.is_jump(knot.station) {
                limits.jump_jerk(&plan.stations.jump(knot.station))
            } else {
                [[0.0; 2]; 3]
            };
            for side in [knot.station, knot.station + 1] {
                let place = Place {
                    v: s1 * h,
                    a: s2 * h * h,
                    j: [s3 * h * h * h; 2],
                    h,
                    q: plan.stations.get(side).q,
                    jump,
                    at_jump: s1 * h,
                };
                each(&place, &stencil(x));
            }
        }
        sweep.knot += 1;
    }
}

/// The speed's row in the middle of the interval before a node.
pub(super) fn middle(plan: &Plan, node: u16, speeds: [f32; 2]) -> Option<(u16, f32)> {
    let before = node.checked_sub(1)?;
    let [a, b] = speeds;
    let [slope, _, _] = plan.interval(before).walk_rates(0.5);
    let v = slope * plan.inverse_step;
    Some((before, 0.5 * (a + b) * v * v))
}

/// Weights of the coefficients in the middle of an interval.
pub(super) const MIDDLE: [f32; 3] = [0.125, 0.75, 0.125];

pub(super) fn at_middle([a, b, c]: &[f32; 3]) -> f32 {
    0.125 * (a + c) + 0.75 * b
}
