//! Gradient and Hessian of the barrier, a band of three diagonals, and its solution.

use super::rows::{Side, Sums};
use super::{DIAGONALS, GRADIENT, SHAPE};
use crate::feed::lists::{LIST, Lists, draft, get, put};
use crate::feed::plan::PINNED;
use crate::math::number::Bounded;

/// Share of a diagonal entry below which its pivot is rounding.
const PIVOT_MIN: f32 = 1e-6;

/// Sets gradient and Hessian to 0 from this coefficient on.
pub(crate) fn clear(lists: &mut Lists) {
    for list in lists.iter_mut().take(SHAPE) {
        *list = [0.0; LIST];
    }
}

pub(super) fn positive(lists: &mut Lists, index: u16, mu: f32) {
    let value = draft(lists).get(usize::from(index)).copied().unwrap_or(1.0);
    let force = 1.0 / value.at_least(1e-9);
    add(lists, GRADIENT, index, -mu * force);
    let [diagonal, _, _] = DIAGONALS;
    add(lists, diagonal, index, mu * force * force);
}

/// Adds derivatives at a node to those by the coefficients: c = (P0 + P1)/2, c' = P1 - P0, c'' = P-1 - 2 P0 + P1 or P0 - 2 P1 + P2.
pub(super) fn scatter_node(lists: &mut Lists, node: u16, intervals: u16, sums: &Sums) {
    let [h0, h1, h2] = DIAGONALS;
    let Sums {
        g0,
        g1,
        k00,
        k01,
        k11,
        sides,
    } = *sums;
    let [before, after] = sides;
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
        let Side { g2, k02, k12, k22 } = after;
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
pub(super) fn scatter_jump(lists: &mut Lists, index: u16, weights: &[[f32; 3]; 3], sums: &Sums) {
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
pub(super) fn scatter(lists: &mut Lists, index: u16, weights: &[f32; 3], slope: f32, bend: f32) {
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

pub(super) fn add(lists: &mut Lists, list: usize, index: u16, value: f32) {
    if let Some(place) = lists
        .get_mut(list)
        .and_then(|list| list.get_mut(usize::from(index)))
    {
        *place += value;
    }
}
