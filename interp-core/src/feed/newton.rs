//! The barrier method: the coefficients P of the pace that minimise `sum 1/sqrt(c)` within the limits.
//!
//! At a place with walk rates v, a, j (by time at pace 1), per axis:
//! `|X0 c + X1 c'| < 1` for the acceleration and `|Y0 c + Y1 c' + Y2 c''| < (1 - E2 c)/sqrt(c) - E1` for the jerk, E from a jump nearby; `Z c < 1` for the
//! speed. The rows are taken at both ends of each interval, on either side of each jump, and those of the speed also in the middle.
//! A place is weighted by its share of the time.

use super::limits::MotionLimits;
use super::plan::{COEFFICIENTS, Interval, Plan};
use super::stations::Derivatives;
use super::walk::{LIST, Lists};
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

/// Fraction of an interval, as the weights of its three coefficients for c, c', c''.
#[derive(Clone, Copy, Debug)]
struct Stencil {
    weights: [[f32; 3]; 3],
}

impl Stencil {
    fn at(x: f32) -> Self {
        let y = 1.0 - x;
        Self {
            weights: [
                [0.5 * y * y, 0.5 + x * y, 0.5 * x * x],
                [-y, y - x, x],
                [1.0, -2.0, 1.0],
            ],
        }
    }

    /// c, c', c'' of these coefficients.
    fn of(&self, coefficients: &[f32; 3]) -> [f32; 3] {
        self.weights.map(|weights| dot(&weights, coefficients))
    }
}

fn dot([a0, a1, a2]: &[f32; 3], [b0, b1, b2]: &[f32; 3]) -> f32 {
    a0 * b0 + a1 * b1 + a2 * b2
}

/// The rows of one axis at a place.
#[derive(Clone, Copy, Debug)]
struct AxisRows {
    accel: [f32; 2],
    jerk: [f32; 3],
    /// E1, E2.
    jump: [f32; 2],
}

impl AxisRows {
    const NONE: Self = Self {
        accel: [0.0; 2],
        jerk: [0.0; 3],
        jump: [0.0; 2],
    };
}

/// The rows at a place.
#[derive(Clone, Copy, Debug)]
struct Rows {
    stencil: Stencil,
    axes: [AxisRows; 3],
    /// Z.
    speed: f32,
    /// Which rows count here.
    kind: Kind,
}

/// Which rows a place has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// All, and its part of the time.
    Node,
    /// The jerk of the interval's other end, whose other rows are the next interval's.
    End,
    /// Those of acceleration and jerk.
    Jump,
    /// That of the speed.
    Middle,
}

/// Gradient and Hessian by c, c', c''.
#[derive(Clone, Copy, Debug, Default)]
struct Local {
    gradient: [f32; 3],
    /// Entries 00, 01, 02, 11, 12, 22.
    hessian: [f32; 6],
}

impl Rows {
    #[inline(always)]
    fn new(h: f32, limits: &MotionLimits, interval: &Interval, x: f32, place: &Place, kind: Kind) -> Self {
        let stencil = Stencil::at(x);
        let [s1, s2, s3] = interval.walk_rates(x);
        let h2 = h * h;
        let (v, a, j) = (s1 * h, s2 * h2, s3 * h2 * h);
        let mut axes = [AxisRows::NONE; 3];
        let speed = if matches!(kind, Kind::Node | Kind::Middle) {
            v * v * limits.inverse_speed_sqr(&place.q)
        } else {
            0.0
        };
        if kind != Kind::Middle {
            for ((rows, [q1, q2, q3]), inverse) in axes.iter_mut().zip(&place.q).zip(&limits.inverse) {
                let t1 = 0.5 * q1 * v * h;
                let t2 = q2 * v * v + q1 * a;
                let t3 = (q3 * v * v + 3.0 * q2 * a) * v + q1 * j;
                *rows = AxisRows {
                    accel: [t2 * inverse.acceleration, t1 * inverse.acceleration],
                    jerk: [
                        t3 * inverse.jerk,
                        1.5 * t2 * inverse.jerk * h,
                        t1 * inverse.jerk * h,
                    ],
                    jump: [0.0; 2],
                };
            }
            if let Some(jump) = &place.jump {
                for (rows, [first, second]) in axes.iter_mut().zip(jump) {
                    rows.jump = [first * v, second * v * v];
                }
            }
        }
        Self {
            stencil,
            axes,
            speed,
            kind,
        }
    }

    const fn has_accel(&self) -> bool {
        matches!(self.kind, Kind::Node | Kind::Jump)
    }

    const fn has_jerk(&self) -> bool {
        !matches!(self.kind, Kind::Middle)
    }

    /// Greatest factor of these coefficients that keeps every row.
    fn factor(&self, coefficients: &[f32; 3]) -> f32 {
        let [c, c1, c2] = self.stencil.of(coefficients);
        let c = c.at_least(1e-9);
        let mut factor = 1.0 / (self.speed * c).at_least(1e-9);
        for AxisRows { accel, jerk, jump } in &self.axes {
            let [x0, x1] = accel;
            if self.has_accel() {
                factor = factor.at_most(1.0 / (x0 * c + x1 * c1).abs().at_least(1e-9));
            }
            if self.has_jerk() {
                let [y0, y1, y2] = jerk;
                let [e1, e2] = jump;
                let root = sqrt(c);
                let y = (y0 * c + y1 * c1 + y2 * c2).abs() * root;
                // In z, the root of the factor: y z^3 + e2 c z^2 + e1 root z < 1.
                let use_of = |z: f32| ((y * z + e2 * c) * z + e1 * root) * z;
                let mut z = sqrt(factor);
                for _ in 0..FACTOR_STEPS {
                    if use_of(z) < 1.0 {
                        break;
                    }
                    z *= FACTOR_STEP;
                }
                factor = factor.at_most(z * z);
            }
        }
        factor
    }

    /// Adds the barrier's derivatives, times `mu`.
    fn add_barrier(&self, coefficients: &[f32; 3], mu: f32, local: &mut Local) {
        let [c, c1, c2] = self.stencil.of(coefficients);
        let inverse_mu = 1.0 / mu;
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        let [mut g0, mut g1, mut g2] = local.gradient;
        let [mut k00, mut k01, mut k02, mut k11, mut k12, mut k22] = local.hessian;
        if self.speed > 0.0 {
            let force = mu * self.speed / (1.0 - self.speed * c).at_least(SLACK_MIN);
            g0 += force;
            k00 += force * force * inverse_mu;
        }
        for AxisRows { accel, jerk, jump } in &self.axes {
            if self.has_accel() {
                let [x0, x1] = *accel;
                let x = x0 * c + x1 * c1;
                let u = 1.0 / (1.0 - x * x).at_least(SLACK_MIN);
                let slope = 2.0 * mu * x * u;
                let bend = 2.0 * mu * (1.0 + x * x) * u * u;
                g0 += x0 * slope;
                g1 += x1 * slope;
                k00 += x0 * x0 * bend;
                k01 += x0 * x1 * bend;
                k11 += x1 * x1 * bend;
            }
            if self.has_jerk() {
                let [y0, y1, y2] = *jerk;
                let [e1, e2] = *jump;
                let y = y0 * c + y1 * c1 + y2 * c2;
                let w = (1.0 - e2 * c) * root - e1;
                let wc = -0.5 * root * (inverse + e2);
                let t = mu / (w * w - y * y).at_least(SLACK_MIN * w * w);
                let (up, down) = ((w + y) * t, (w - y) * t);
                let (slope, sum) = (up - down, up + down);
                let (bend, skew) = (
                    (up * up + down * down) * inverse_mu,
                    (up * up - down * down) * inverse_mu,
                );
                g0 += y0 * slope - wc * sum;
                g1 += y1 * slope;
                g2 += y2 * slope;
                let cross = y0 * bend - wc * skew;
                k00 += y0 * cross + wc * (wc * bend - y0 * skew);
                k01 += y1 * cross;
                k02 += y2 * cross;
                k11 += y1 * y1 * bend;
                k12 += y1 * y2 * bend;
                k22 += y2 * y2 * bend;
            }
        }
        local.gradient = [g0, g1, g2];
        local.hessian = [k00, k01, k02, k11, k12, k22];
    }

    /// Adds the derivatives of this place's part of the time.
    fn add_time(&self, coefficients: &[f32; 3], weight: f32, local: &mut Local) {
        let [c, _, _] = self.stencil.of(coefficients);
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        let slope = 0.5 * weight * root * inverse;
        let [g0, _, _] = &mut local.gradient;
        *g0 -= slope;
        let [k00, ..] = &mut local.hessian;
        *k00 += 1.5 * slope * inverse;
    }

    /// The row that is used up first along a direction.
    fn reach(&self, coefficients: &[f32; 3], direction: &[f32; 3], reach: &mut Reach) {
        let [c, c1, c2] = self.stencil.of(coefficients);
        let [d, d1, d2] = self.stencil.of(direction);
        if self.speed > 0.0 {
            reach.add(1.0 - self.speed * c, self.speed * d);
        }
        if self.kind == Kind::Middle {
            return;
        }
        let root = inverse_sqrt(c.at_least(1e-12));
        let inverse = root * root;
        for AxisRows { accel, jerk, jump } in &self.axes {
            if self.has_accel() {
                let [x0, x1] = *accel;
                let (x, dx) = (x0 * c + x1 * c1, x0 * d + x1 * d1);
                reach.add(1.0 - x, dx);
                reach.add(1.0 + x, -dx);
            }
            let [y0, y1, y2] = *jerk;
            let [e1, e2] = *jump;
            let (y, dy) = (y0 * c + y1 * c1 + y2 * c2, y0 * d + y1 * d1 + y2 * d2);
            let w = (1.0 - e2 * c) * root - e1;
            let dw = -0.5 * root * (inverse + e2) * d;
            reach.add(w - y, dy - dw);
            reach.add(w + y, -dy - dw);
        }
    }
}

/// Steps of the search for a row's factor.
const FACTOR_STEPS: u8 = 80;
const FACTOR_STEP: f32 = 0.94;

/// The least ratio of a slack to what it loses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    slack: f32,
    loss: f32,
}

impl Reach {
    pub(crate) const FAR: Self = Self {
        slack: 1.0,
        loss: 0.0,
    };

    fn add(&mut self, slack: f32, loss: f32) {
        if loss * self.slack > slack * self.loss {
            *self = Self { slack, loss };
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

/// The path at a place, and the jerk that a jump nearby takes.
struct Place {
    q: Derivatives,
    jump: Option<[[f32; 2]; 3]>,
}

/// The path at a node.
fn at_node(plan: &Plan, limits: &MotionLimits, slope: f32, node: u16) -> Place {
    let [cell, part] = plan.node(node);
    let part = f32::from(part) * (1.0 / 65536.0);
    let stations = &plan.stations;
    let length = stations.cell_mm(cell);
    let near = JUMP_REACH * limits.period * slope;
    let since = part * length;
    let jump = if cell > 0 && since <= near && stations.is_jump(cell - 1) {
        Some(cell - 1)
    } else if length - since <= near && stations.is_jump(cell + 1) {
        Some(cell + 1)
    } else {
        None
    };
    Place {
        q: stations.blend(cell, part),
        jump: jump.map(|station| limits.jump_jerk(&stations.jump(station))),
    }
}

/// Calls `each` with the rows of an interval.
#[inline(always)]
fn rows(plan: &Plan, limits: &MotionLimits, index: u16, knot: &mut u16, mut each: impl FnMut(&Rows)) {
    let interval = plan.interval(index);
    let h = plan.inverse_step;
    let slope = |x| {
        let [slope, _, _] = interval.walk_rates(x);
        slope * h
    };
    let is_last = index + 1 == plan.intervals;
    let mut places = [
        (0.0, Kind::Node, at_node(plan, limits, slope(0.0), index)),
        (
            1.0,
            if is_last { Kind::Node } else { Kind::End },
            at_node(plan, limits, slope(1.0), index + 1),
        ),
        (
            0.5,
            Kind::Middle,
            Place {
                q: [[0.0; 3]; 3],
                jump: None,
            },
        ),
    ];
    let [(_, _, start), (_, _, end), (_, _, middle)] = &mut places;
    for (middle, (start, end)) in middle.q.iter_mut().zip(start.q.iter().zip(&end.q)) {
        for (middle, (start, end)) in middle.iter_mut().zip(start.iter().zip(end)) {
            *middle = 0.5 * (start + end);
        }
    }
    for (x, kind, place) in &places {
        each(&Rows::new(h, limits, &interval, *x, place, *kind));
    }
    while let Some(at) = plan.knot(*knot).filter(|at| at.interval <= index) {
        if at.interval == index {
            let x = f32::from(at.part) * (1.0 / 65536.0);
            let jump = Some(limits.jump_jerk(&plan.stations.jump(at.station)));
            for side in [at.station, at.station + 1] {
                let q = plan.stations.get(side).q;
                each(&Rows::new(
                    h,
                    limits,
                    &interval,
                    x,
                    &Place { q, jump },
                    Kind::Jump,
                ));
            }
        }
        *knot += 1;
    }
}

/// Greatest factor of the pace that keeps the rows of an interval.
#[inline(never)]
pub(crate) fn factor(plan: &Plan, limits: &MotionLimits, index: u16, knot: &mut u16) -> f32 {
    let mut factor = f32::MAX;
    let pace = *plan.interval(index).pace();
    rows(plan, limits, index, knot, |rows| {
        factor = factor.at_most(rows.factor(&pace))
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

/// Adds the rows of an interval to gradient and Hessian. `weight`: one over the sum of `1/sqrt(shape)`.
#[inline(never)]
pub(crate) fn assemble(
    plan: &Plan,
    limits: &MotionLimits,
    lists: &mut Lists,
    index: u16,
    knot: &mut u16,
    mu: f32,
    weight: f32,
) {
    let pace = *plan.interval(index).pace();
    let mu = mu * share(lists, weight, index + 1);
    rows(plan, limits, index, knot, |rows| {
        let mut local = Local::default();
        rows.add_barrier(&pace, mu, &mut local);
        if rows.kind == Kind::Node {
            rows.add_time(&pace, weight, &mut local);
        }
        scatter(lists, index, &rows.stencil, &local);
    });
    // Every coefficient stays positive.
    let first = if index == 0 { 0 } else { 2 };
    for offset in first..3 {
        let value = pace
            .get(usize::from(offset))
            .copied()
            .unwrap_or(1.0)
            .at_least(1e-9);
        let force = mu / value;
        add(lists, GRADIENT, index + offset, -force);
        add(lists, DIAGONALS[0], index + offset, force / value);
    }
}

/// Adds derivatives by c, c', c'' to those by the three coefficients of an interval.
fn scatter(lists: &mut Lists, index: u16, stencil: &Stencil, local: &Local) {
    let [k00, k01, k02, k11, k12, k22] = local.hessian;
    let [w0, w1, w2] = &stencil.weights;
    for (row, offset) in (0..3_usize).zip(0_u16..) {
        let of = |weights: &[f32; 3]| weights.get(row).copied().unwrap_or(0.0);
        let (a, b, c) = (of(w0), of(w1), of(w2));
        let [g0, g1, g2] = local.gradient;
        add(lists, GRADIENT, index + offset, a * g0 + b * g1 + c * g2);
        let (p, q, r) = (
            a * k00 + b * k01 + c * k02,
            a * k01 + b * k11 + c * k12,
            a * k02 + b * k12 + c * k22,
        );
        for (column, diagonal) in (row..3).zip(DIAGONALS) {
            let of = |weights: &[f32; 3]| weights.get(column).copied().unwrap_or(0.0);
            add(
                lists,
                diagonal,
                index + offset,
                p * of(w0) + q * of(w1) + r * of(w2),
            );
        }
    }
}

/// Solves for the step, in place of the gradient; coefficients before `first` stay.
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
    for index in 0..first {
        put(lists, GRADIENT, index, 0.0);
    }
}

/// Adds the rows of an interval to the reach of the step.
#[inline(never)]
pub(crate) fn extend(
    plan: &Plan,
    limits: &MotionLimits,
    lists: &Lists,
    index: u16,
    knot: &mut u16,
    reach: &mut Reach,
) {
    let pace = *plan.interval(index).pace();
    let mut direction = [0.0; 3];
    for (offset, direction) in (0..).zip(&mut direction) {
        *direction = -get(lists, GRADIENT, index + offset);
    }
    for (value, direction) in pace.iter().zip(&direction) {
        reach.add(*value, -direction);
    }
    rows(plan, limits, index, knot, |rows| {
        rows.reach(&pace, &direction, reach)
    });
}

/// Takes the step.
pub(crate) fn take(plan: &mut Plan, lists: &Lists, step: f32) {
    if !(step > 0.0) {
        return;
    }
    let count = plan.intervals + 2;
    for (index, pace) in (0..count).zip(&mut plan.pace) {
        *pace -= step * get(lists, GRADIENT, index);
    }
}

fn get(lists: &Lists, list: usize, index: u16) -> f32 {
    lists
        .get(list)
        .and_then(|list| list.get(usize::from(index)))
        .copied()
        .unwrap_or(0.0)
}

fn put(lists: &mut Lists, list: usize, index: u16, value: f32) {
    if let Some(place) = lists
        .get_mut(list)
        .and_then(|list| list.get_mut(usize::from(index)))
    {
        *place = value;
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
