//! The barrier method: the coefficients P of the pace that minimise `sum 1/sqrt(c)` within the limits.
//!
//! At a place with walk rates v, a, j (by time at pace 1), per axis:
//! `|X0 c + X1 c'| < 1` for the acceleration and `|Y0 c + Y1 c' + Y2 c''| < (1 - E2 c)/sqrt(c) - E1` for the jerk, E from a jump nearby; `Z c < 1` for the
//! speed. The rows are taken at each node (that of the jerk on both sides) and on either side of each jump, those of the
//! speed also in the middle of each interval. A place is weighted by its share of the time.

use super::limits::MotionLimits;
use super::lists::{LIST, Lists, draft, get, put};
use super::plan::{COEFFICIENTS, PINNED, Plan};
use super::stations::Derivatives;

use crate::math::arith::{inverse_sqrt, sqrt};
use crate::math::number::Bounded;

/// Distance from a jump within which a node sees it, periods.
const JUMP_REACH: f32 = 2.0;
/// Least slack of a row that is divided by.
const SLACK_MIN: f32 = 1e-6;
/// Share of the way to the next limit that a step goes.
const STEP_SHARE: f32 = 0.97;
/// Share of a diagonal entry below which its pivot is rounding.
const PIVOT_MIN: f32 = 1e-6;

/// Lists of the method: gradient, three diagonals of the Hessian, and the shape of the pace by which places are weighted.
const GRADIENT: usize = 0;
const DIAGONALS: [usize; 3] = [1, 2, 3];
pub(crate) const SHAPE: usize = 4;
const _: () = assert!(LIST >= COEFFICIENTS);

/// c, c' of the pace, and c'' before and behind.
#[derive(Clone, Copy, Debug)]
struct Local {
    c: f32,
    c1: f32,
    c2: [f32; 2],
}

/// A place of the plan: its motion at pace 1, and the path there.
struct Place {
    /// mm/s, mm/s^2; jerk before and behind, mm/s^3; inverse time of an interval, 1/s.
    v: f32,
    a: f32,
    j: [f32; 2],
    h: f32,
    q: Derivatives,
    /// Jerk that a jump nearby takes, and the speed over it, mm/s.
    jump: [[f32; 2]; 3],
    at_jump: f32,
}

/// The rows of an axis at a place.
#[derive(Clone, Copy, Debug)]
struct AxisRows {
    x0: f32,
    x1: f32,
    /// Y0 before and behind.
    y0: [f32; 2],
    y1: f32,
    y2: f32,
    e1: f32,
    e2: f32,
}

impl Place {
    /// The rows of each axis.
    #[inline(always)]
    fn rows(&self, limits: &MotionLimits, mut each: impl FnMut(&AxisRows)) {
        let (v, a, h) = (self.v, self.a, self.h);
        let v2 = v * v;
        let [before, behind] = self.j;
        for (([q1, q2, q3], inverse), [first, second]) in self.q.iter().zip(&limits.inverse).zip(&self.jump) {
            let t1 = 0.5 * h * q1 * v;
            let t2 = q2 * v2 + q1 * a;
            let t3 = (q3 * v2 + 3.0 * q2 * a) * v;
            each(&AxisRows {
                x0: t2 * inverse.acceleration,
                x1: t1 * inverse.acceleration,
                y0: [
                    (t3 + q1 * before) * inverse.jerk,
                    (t3 + q1 * behind) * inverse.jerk,
                ],
                y1: 1.5 * h * t2 * inverse.jerk,
                y2: h * t1 * inverse.jerk,
                e1: first * self.at_jump,
                e2: second * self.at_jump * self.at_jump,
            });
        }
    }

    /// Greatest factor of the pace that keeps the rows.
    fn factor(&self, limits: &MotionLimits, speed: f32, pace: &Local) -> f32 {
        let Local { c, c1, c2 } = *pace;
        let c = c.at_least(1e-9);
        let root = sqrt(c);
        let mut factor = 1.0 / (speed * c).at_least(1e-9);
        self.rows(limits, |rows| {
            factor = factor.at_most(1.0 / (rows.x0 * c + rows.x1 * c1).abs().at_least(1e-9));
            let mut y = 0.0_f32;
            for (y0, c2) in rows.y0.iter().zip(&c2) {
                y = y.at_least((y0 * c + rows.y1 * c1 + rows.y2 * c2).abs());
            }
            // In z, the root of the factor: y root z^3 + e2 c z^2 + e1 root z < 1.
            let use_of = |z: f32| ((y * root * z + rows.e2 * c) * z + rows.e1 * root) * z;
            let mut z = sqrt(factor);
            for _ in 0..FACTOR_STEPS {
                if use_of(z) < 1.0 {
                    break;
                }
                z *= FACTOR_STEP;
            }
            factor = factor.at_most(z * z);
        });
        factor
    }

    /// Derivatives of the barrier of every row, times `mu`.
    #[inline(always)]
    fn barrier(&self, limits: &MotionLimits, pace: &Local, mu: f32, sums: &mut Sums) {
        let Local { c, c1, c2 } = *pace;
        let inverse_mu = 1.0 / mu;
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        self.rows(limits, |rows| {
            let AxisRows { x0, x1, y1, y2, .. } = *rows;
            let x = x0 * c + x1 * c1;
            let u = 1.0 / (1.0 - x * x).at_least(SLACK_MIN);
            let slope = 2.0 * mu * x * u;
            let bend = 2.0 * mu * (1.0 + x * x) * u * u;
            sums.g0 += x0 * slope;
            sums.g1 += x1 * slope;
            sums.k00 += x0 * x0 * bend;
            sums.k01 += x0 * x1 * bend;
            sums.k11 += x1 * x1 * bend;
            let w = (1.0 - rows.e2 * c) * root - rows.e1;
            let wc = -0.5 * root * (inverse + rows.e2);
            let part = y1 * c1;
            let Sums { sides, .. } = sums;
            let [mut g0, mut g1, mut k00, mut k01, mut k11] = [0.0; 5];
            for ((side, y0), c2) in sides.iter_mut().zip(&rows.y0).zip(&c2) {
                let y = y0 * c + part + y2 * c2;
                let t = mu / (w * w - y * y).at_least(SLACK_MIN * w * w);
                let (up, down) = ((w + y) * t, (w - y) * t);
                let (slope, sum) = (up - down, up + down);
                let bend = (up * up + down * down) * inverse_mu;
                let skew = slope * sum * inverse_mu;
                let cross = y0 * bend - wc * skew;
                g0 += y0 * slope - wc * sum;
                g1 += slope;
                k00 += y0 * cross + wc * (wc * bend - y0 * skew);
                k01 += cross;
                k11 += bend;
                side.g2 += y2 * slope;
                side.k02 += y2 * cross;
                side.k12 += y1 * y2 * bend;
                side.k22 += y2 * y2 * bend;
            }
            sums.g0 += g0;
            sums.g1 += y1 * g1;
            sums.k00 += k00;
            sums.k01 += y1 * k01;
            sums.k11 += y1 * y1 * k11;
        });
    }

    /// The row that is used up first along a direction.
    #[inline(always)]
    fn reach(&self, limits: &MotionLimits, pace: &Local, direction: &Local, reach: &mut Reach) {
        let Local { c, c1, c2 } = *pace;
        let (d, d1, d2) = (direction.c, direction.c1, direction.c2);
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        self.rows(limits, |rows| {
            let (x, dx) = (rows.x0 * c + rows.x1 * c1, rows.x0 * d + rows.x1 * d1);
            // Of the two sides of a row only that which is approached is used up.
            reach.add(1.0 - if dx < 0.0 { -x } else { x }, dx.abs());
            let w = (1.0 - rows.e2 * c) * root - rows.e1;
            let dw = -0.5 * root * (inverse + rows.e2) * d;
            let (part, dpart) = (rows.y1 * c1, rows.y1 * d1);
            for ((y0, c2), d2) in rows.y0.iter().zip(&c2).zip(&d2) {
                let y = y0 * c + part + rows.y2 * c2;
                let dy = y0 * d + dpart + rows.y2 * d2;
                reach.add(w - y, dy - dw);
                reach.add(w + y, -dy - dw);
            }
        });
    }
}

/// Derivatives by c, c' and by c'' on each side.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    g0: f32,
    g1: f32,
    k00: f32,
    k01: f32,
    k11: f32,
    sides: [Side; 2],
}

#[derive(Clone, Copy, Debug, Default)]
struct Side {
    g2: f32,
    k02: f32,
    k12: f32,
    k22: f32,
}

/// Steps of the search for a row's factor.
const FACTOR_STEPS: u8 = 32;
const FACTOR_STEP: f32 = 0.85;

/// The least ratio of a slack to what it loses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    slack: f32,
    loss: f32,
    /// Rows that do not hold, which the start next to an end at speed may have, do not bound the step.
    passes: bool,
}

impl Reach {
    /// None yet.
    pub(crate) const NONE: Self = Self {
        slack: 0.0,
        loss: 0.0,
        passes: false,
    };

    /// No row is used up.
    pub(crate) const FAR: Self = Self {
        slack: 1.0,
        loss: 0.0,
        passes: false,
    };

    /// Far, for a plan with an end at speed or without.
    pub(crate) fn far(passes: bool) -> Self {
        Self { passes, ..Self::FAR }
    }

    fn add(&mut self, slack: f32, loss: f32) {
        if self.passes && slack <= 0.0 {
            return;
        }
        if loss * self.slack > slack * self.loss {
            (self.slack, self.loss) = (slack, loss);
        }
    }

    /// Length of a step that keeps every row.
    pub(crate) fn step(&self) -> f32 {
        if self.loss > 0.0 {
            (STEP_SHARE * self.slack / self.loss).at_least(0.0).at_most(1.0)
        } else {
            1.0
        }
    }
}

/// A sweep over the nodes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sweep {
    node: u16,
    /// The node to begin at.
    first: u16,
    /// The next jump.
    knot: u16,
    /// Inverse square of the speed that the path allows at the node before, (s/mm)^2.
    speed: f32,
}

impl Sweep {
    pub(crate) const START: Self = Self::from(0);
    /// The node.
    pub(crate) const fn node(&self) -> u16 {
        self.node
    }

    /// Over the nodes from this one on.
    pub(crate) const fn from(first: u16) -> Self {
        Self {
            node: first,
            first,
            knot: 0,
            speed: 0.0,
        }
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

    /// Whether there is a jump behind the node.
    pub(crate) fn has_jump(&self, plan: &Plan) -> bool {
        plan.knot(self.knot)
            .is_some_and(|knot| knot.interval == self.node)
    }

    /// Moves to the next node; whether there is none.
    pub(crate) const fn next(&mut self, plan: &Plan) -> bool {
        self.node += 1;
        let is_over = self.node > plan.intervals;
        if is_over {
            *self = Self::from(self.first);
        }
        is_over
    }
}

/// Derivatives of a B-spline's coefficients at a node: c, c', c''; at the ends c'' is that of the other side.
fn local(values: &[f32], node: u16, intervals: u16) -> Local {
    let at = |index: usize| values.get(index).copied().unwrap_or(0.0);
    let index = usize::from(node);
    let (here, next) = (at(index), at(index + 1));
    let behind = at(index + 2) - 2.0 * next + here;
    let before = match index.checked_sub(1) {
        Some(previous) => at(previous) - 2.0 * here + next,
        None => behind,
    };
    Local {
        c: 0.5 * (here + next),
        c1: next - here,
        c2: [before, if node < intervals { behind } else { before }],
    }
}

/// The three coefficients of the pace of an interval.
fn three(lists: &Lists, interval: u16) -> [f32; 3] {
    let from = usize::from(interval);
    match draft(lists).get(from..from + 3) {
        Some(&[a, b, c]) => [a, b, c],
        _ => [1.0; 3],
    }
}

/// A node's place, and the inverse square of the speed that the path allows there.
fn at_node(plan: &Plan, limits: &MotionLimits, sweep: &Sweep) -> (Place, f32) {
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

fn at_stencil(weights: &[[f32; 3]; 3], [a, b, c]: &[f32; 3]) -> Local {
    let [value, first, second] = weights.map(|[x, y, z]| x * a + y * b + z * c);
    Local {
        c: value,
        c1: first,
        c2: [second; 2],
    }
}

/// Calls `each` with the place on either side of each jump between a node and the next.
#[inline(never)]
fn at_jumps(
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
fn middle(plan: &Plan, node: u16, speeds: [f32; 2]) -> Option<(u16, f32)> {
    let before = node.checked_sub(1)?;
    let [a, b] = speeds;
    let [slope, _, _] = plan.interval(before).walk_rates(0.5);
    let v = slope * plan.inverse_step;
    Some((before, 0.5 * (a + b) * v * v))
}

/// Weights of the coefficients in the middle of an interval.
const MIDDLE: [f32; 3] = [0.125, 0.75, 0.125];

fn at_middle([a, b, c]: &[f32; 3]) -> f32 {
    0.125 * (a + c) + 0.75 * b
}

/// Greatest factor of the pace that keeps the rows of a node and behind it.
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

/// A coefficient's share of the time.
fn share(lists: &Lists, weight: f32, index: u16) -> f32 {
    weight * inverse_sqrt(get(lists, SHAPE, index).at_least(1e-9))
}

/// Sets gradient and Hessian to 0 from this coefficient on.
pub(crate) fn clear(lists: &mut Lists) {
    for list in lists.iter_mut().take(SHAPE) {
        *list = [0.0; LIST];
    }
}

/// Adds the rows of a node and behind it to gradient and Hessian. `weight`: one over the sum of `1/sqrt(shape)`.
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

fn positive(lists: &mut Lists, index: u16, mu: f32) {
    let value = draft(lists).get(usize::from(index)).copied().unwrap_or(1.0);
    let force = 1.0 / value.at_least(1e-9);
    add(lists, GRADIENT, index, -mu * force);
    let [diagonal, _, _] = DIAGONALS;
    add(lists, diagonal, index, mu * force * force);
}

/// Adds derivatives at a node to those by the coefficients: c = (P0 + P1)/2, c' = P1 - P0, c'' = P-1 - 2 P0 + P1 or P0 - 2 P1 + P2.
fn scatter_node(lists: &mut Lists, node: u16, intervals: u16, sums: &Sums) {
    let [h0, h1, h2] = DIAGONALS;
    let Sums {
        g0,
        g1,
        k00,
        k01,
        k11,
        sides,
    } = *sums;
    let [before, behind] = sides;
    add(lists, GRADIENT, node, 0.5 * g0 - g1);
    add(lists, GRADIENT, node + 1, 0.5 * g0 + g1);
    add(lists, h0, node, 0.25 * k00 - k01 + k11);
    add(lists, h0, node + 1, 0.25 * k00 + k01 + k11);
    add(lists, h1, node, 0.25 * k00 - k11);
    if let Some(previous) = node.checked_sub(1) {
        let Side { g2, k02, k12, k22 } = before;
        let k02 = 0.5 * k02;
        add(lists, GRADIENT, previous, g2);
        add(lists, GRADIENT, node, -2.0 * g2);
        add(lists, GRADIENT, node + 1, g2);
        add(lists, h0, previous, k22);
        add(lists, h0, node, 4.0 * (k12 + k22 - k02));
        add(lists, h0, node + 1, 2.0 * (k02 + k12) + k22);
        add(lists, h1, previous, k02 - k12 - 2.0 * k22);
        add(lists, h1, node, -k02 - 3.0 * k12 - 2.0 * k22);
        add(lists, h2, previous, k02 + k12 + k22);
    }
    if node < intervals {
        let Side { g2, k02, k12, k22 } = behind;
        let k02 = 0.5 * k02;
        add(lists, GRADIENT, node, g2);
        add(lists, GRADIENT, node + 1, -2.0 * g2);
        add(lists, GRADIENT, node + 2, g2);
        add(lists, h0, node, 2.0 * (k02 - k12) + k22);
        add(lists, h0, node + 1, 4.0 * (k22 - k02 - k12));
        add(lists, h0, node + 2, k22);
        add(lists, h1, node, 3.0 * k12 - k02 - 2.0 * k22);
        add(lists, h1, node + 1, k02 + k12 - 2.0 * k22);
        add(lists, h2, node, k02 - k12 + k22);
    }
}

/// Adds derivatives on one side of a jump.
fn scatter_jump(lists: &mut Lists, index: u16, weights: &[[f32; 3]; 3], sums: &Sums) {
    let [w0, w1, w2] = weights;
    let [one, other] = &sums.sides;
    let side = Side {
        g2: one.g2 + other.g2,
        k02: one.k02 + other.k02,
        k12: one.k12 + other.k12,
        k22: one.k22 + other.k22,
    };
    for (row, offset) in (0..3_usize).zip(0_u16..) {
        let of = |weights: &[f32; 3], at: usize| weights.get(at).copied().unwrap_or(0.0);
        let (a, b, c) = (of(w0, row), of(w1, row), of(w2, row));
        add(
            lists,
            GRADIENT,
            index + offset,
            a * sums.g0 + b * sums.g1 + c * side.g2,
        );
        let p = a * sums.k00 + b * sums.k01 + c * side.k02;
        let q = a * sums.k01 + b * sums.k11 + c * side.k12;
        let r = a * side.k02 + b * side.k12 + c * side.k22;
        for (column, diagonal) in (row..3).zip(DIAGONALS) {
            let value = p * of(w0, column) + q * of(w1, column) + r * of(w2, column);
            add(lists, diagonal, index + offset, value);
        }
    }
}

/// Adds derivatives by one linear form of an interval's coefficients.
fn scatter(lists: &mut Lists, index: u16, weights: &[f32; 3], slope: f32, bend: f32) {
    let [a, b, c] = *weights;
    let [h0, h1, h2] = DIAGONALS;
    for (offset, weight) in [(0, a), (1, b), (2, c)] {
        add(lists, GRADIENT, index + offset, weight * slope);
        add(lists, h0, index + offset, weight * weight * bend);
    }
    add(lists, h1, index, a * b * bend);
    add(lists, h1, index + 1, b * c * bend);
    add(lists, h2, index, a * c * bend);
}

/// Solves for the step, in place of the gradient; coefficients before `first` and from `count` on stay.
#[inline(never)]
pub(crate) fn solve(lists: &mut Lists, count: u16, first: u16) {
    let [mut l1, mut l2, mut l2_before] = [0.0_f32; 3];
    let [mut d1, mut d2, mut g1, mut g2] = [0.0_f32; 4];
    for index in first..count {
        let of = |list| get(lists, list, index);
        let [whole, beside, beyond] = DIAGONALS.map(of);
        let mut pivot = whole - l1 * l1 * d1 - l2_before * l2_before * d2;
        if !(pivot > PIVOT_MIN * whole) {
            pivot = whole;
        }
        let has = |ahead| if index + ahead < count { 1.0 } else { 0.0 };
        let inverse = 1.0 / pivot.at_least(1e-30);
        let next = has(1) * (beside - l1 * d1 * l2) * inverse;
        let after = has(2) * beyond * inverse;
        let value = of(GRADIENT) - l1 * g1 - l2_before * g2;
        put(lists, GRADIENT, index, value);
        for (list, value) in DIAGONALS.into_iter().zip([inverse, next, after]) {
            put(lists, list, index, value);
        }
        (l2_before, d2, g2) = (l2, d1, g1);
        (l1, l2, d1, g1) = (next, after, pivot, value);
    }
    let [mut x1, mut x2] = [0.0_f32; 2];
    for index in (first..count).rev() {
        let [inverse, next, after] = DIAGONALS.map(|list| get(lists, list, index));
        let value = get(lists, GRADIENT, index) * inverse - next * x1 - after * x2;
        put(lists, GRADIENT, index, value);
        (x2, x1) = (x1, value);
    }
    for index in (0..first).chain(count..count + PINNED) {
        put(lists, GRADIENT, index, 0.0);
    }
}

/// Adds the rows of a node and behind it to the reach of the step.
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
    let at = |index: usize| -gradient.get(index).copied().unwrap_or(0.0);
    let index = usize::from(node);
    let (here, next) = (at(index), at(index + 1));
    let behind = at(index + 2) - 2.0 * next + here;
    let before = match index.checked_sub(1) {
        Some(previous) => at(previous) - 2.0 * here + next,
        None => behind,
    };
    Local {
        c: 0.5 * (here + next),
        c1: next - here,
        c2: [before, if node < intervals { behind } else { before }],
    }
}

/// Takes the step.
pub(crate) fn take(plan: &Plan, lists: &mut Lists, step: f32) {
    if !(step > 0.0) {
        return;
    }
    let count = usize::from(plan.intervals) + 2;
    let [gradient, .., draft] = lists;
    for (pace, direction) in draft.iter_mut().zip(gradient).take(count) {
        *pace -= step * *direction;
    }
}

fn add(lists: &mut Lists, list: usize, index: u16, value: f32) {
    if let Some(place) = lists
        .get_mut(list)
        .and_then(|list| list.get_mut(usize::from(index)))
    {
        *place += value;
    }
}
