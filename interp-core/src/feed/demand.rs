//! What a path asks of the axes: from the cutter centre at three or four neighbouring stations, the speed, acceleration and jerk along the
//! path that each axis leaves.
//!
//! With q(s) the centre over the arc of the contact, q' v is an axis's velocity, q'' v^2 + q' a its acceleration and q''' v^3 + 3 q'' v a +
//! q' j its jerk. Derivatives are divided differences of the stations, less what rounding to nanometres can make of them.

use super::plan::Top;
use crate::job::Axes;
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, nm_to_mm};

/// Share of an axis's acceleration that bends of the path may take; the rest is kept for the feed to change.
const BEND_SHARE: f32 = 0.8;
/// Shares of an axis's jerk that bends may take: at a steady feed, and by a feed that changes in a bend.
const STEADY_SHARE: f32 = 0.35;
const CHANGE_SHARE: f32 = 0.15;
/// Share of the jerk that the feed may take where the path jumps.
pub(crate) const ZONE_JERK: f32 = 0.1;
/// What is not used of acceleration and jerk: the differences of a period are not the derivatives, nor the stations the path.
const ACCEL_MARGIN: f32 = 0.995;
const JERK_MARGIN: f32 = 0.99;
/// Where the path bends: cutter locations are good to a nanometre or two, which a third difference makes eight times.
const BEND_MARGIN: f32 = 0.93;
/// A part of a path that no axis sees counts as so long, to be divided by.
const SLOPE_MIN: f32 = 1e-6;
/// Half a nanometre, mm: what a station may be off by.
const ROUNDING: f32 = 0.5e-6;

/// What is left along the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Room {
    /// Square of the greatest speed, (mm/s)^2.
    pub(crate) square: f32,
    /// mm/s^2.
    pub(crate) accel: f32,
    /// mm/s^3.
    pub(crate) jerk: f32,
    /// Share of an axis's jerk that is taken at that speed and acceleration.
    pub(crate) taken: f32,
}

impl Room {
    /// Where nothing is asked.
    pub(crate) const WIDE: Self = Self {
        square: f32::MAX,
        accel: f32::MAX,
        jerk: f32::MAX,
        taken: 0.0,
    };

    /// Along a straight line with these direction cosines.
    pub(crate) fn straight(axes: &Axes, cosines: &[f32; 3]) -> Self {
        let mut room = Self::WIDE;
        let limits = axes
            .velocity_mm_s
            .iter()
            .zip(&axes.acceleration_mm_s2)
            .zip(&axes.jerk_mm_s3);
        for (((v, a), j), cosine) in limits.zip(cosines) {
            let slope = 1.0 / cosine.abs().at_least(SLOPE_MIN);
            room.square = room.square.at_most(squared(v * slope));
            room.accel = room.accel.at_most(ACCEL_MARGIN * a * slope);
            room.jerk = room.jerk.at_most(JERK_MARGIN * j * slope);
        }
        room
    }
}

/// Differences over the last stations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stencil {
    last: [i32; 3],
    /// Lengths of the last three cells, mm, the newest first; 0 where there is none yet.
    lengths: [f32; 3],
    first: [f32; 3],
    second: [f32; 3],
    /// Bounds of the first three derivatives of each axis at the last station.
    bends: [[f32; 3]; 3],
}

impl Stencil {
    /// Before the first station.
    pub(crate) const START: Self = Self {
        last: [0; 3],
        lengths: [0.0; 3],
        first: [0.0; 3],
        second: [0.0; 3],
        bends: [[0.0; 3]; 3],
    };

    /// Direction of the last cell.
    pub(crate) fn cosines(&self) -> [f32; 3] {
        let [x, y, z] = self.first;
        let inverse = 1.0 / root(x * x + y * y + z * z).at_least(SLOPE_MIN);
        self.first.map(|d| d * inverse)
    }

    /// The first station of a path.
    pub(crate) const fn begin(&mut self, centre_nm: [i32; 3]) {
        *self = Self::START;
        self.last = centre_nm;
    }

    /// What the path leaves at the last station and over the cells before, as far as three of them reach.
    pub(crate) fn room(&self, axes: &Axes, top: &Top) -> Room {
        room(&self.bends, axes, top)
    }

    /// The next station, so many mm further.
    pub(crate) fn add(&mut self, centre_nm: [i32; 3], length: f32) {
        let [h1, h2, _] = self.lengths;
        self.lengths = [length, h1, h2];
        let (two, three) = (length + h1, length + h1 + h2);
        let inverse = 1.0 / length.at_least(1e-6);
        let mut bends = [[0.0; 3]; 3];
        let last = core::mem::replace(&mut self.last, centre_nm);
        let axis = centre_nm
            .iter()
            .zip(&last)
            .zip(self.first.iter_mut().zip(&mut self.second));
        for (((to, from), (first, second)), out) in axis.zip(&mut bends) {
            let d1 = nm_to_mm(to.wrapping_sub(*from)) * inverse;
            let (mut d2, mut d3) = (0.0, 0.0);
            let (mut off2, mut off3) = (0.0, 0.0);
            if h1 > 0.0 {
                d2 = 2.0 * (d1 - *first) / two;
                off2 = 4.0 * ROUNDING * (inverse + 1.0 / h1) / two;
                if h2 > 0.0 {
                    d3 = 3.0 * (d2 - *second) / three;
                    off3 = 3.0 * (off2 + 4.0 * ROUNDING * (1.0 / h1 + 1.0 / h2) / (h1 + h2)) / three;
                }
            }
            (*first, *second) = (d1, d2);
            *out = [
                d1.abs() + 0.5 * d2.abs() * length,
                (d2.abs() - off2).at_least(0.0),
                (d3.abs() - off3).at_least(0.0),
            ];
        }
        self.bends = bends;
    }
}

/// What first, second and third derivatives of each axis leave.
fn room(bends: &[[f32; 3]; 3], axes: &Axes, top: &Top) -> Room {
    let mut square = squared(top.speed);
    let mut curvature = 0.0;
    let limits = || {
        axes.velocity_mm_s
            .iter()
            .zip(&axes.acceleration_mm_s2)
            .zip(&axes.jerk_mm_s3)
    };
    for (((v, a), j), [d1, d2, d3]) in limits().zip(bends) {
        square = square.at_most(squared(v / d1.at_least(SLOPE_MIN)));
        if *d2 > 0.0 {
            square = square.at_most(BEND_SHARE * a / d2);
            curvature += d2 * d2;
        }
        if *d3 > 0.0 {
            square = square.at_most(squared(cube_root(STEADY_SHARE * j / d3)));
        }
    }
    if curvature > 0.0 {
        // The chord of a period: curvature (v T)^2 / 8.
        square = square.at_most(8.0 * axes.chord_mm / (root(curvature) * squared(top.period_s)));
    }
    let margin = if curvature > 0.0 { BEND_MARGIN } else { JERK_MARGIN };
    let speed = root(square);
    let (mut accel, mut jerk) = (f32::MAX, f32::MAX);
    for (((_, a), j), [d1, d2, d3]) in limits().zip(bends) {
        let slope = 1.0 / d1.at_least(SLOPE_MIN);
        accel = accel.at_most((ACCEL_MARGIN * a - d2 * square) * slope);
        accel = accel.at_most(CHANGE_SHARE * j / (3.0 * d2 * speed).at_least(1e-9));
        jerk = jerk.at_most((margin * j - d3 * square * speed) * slope);
    }
    // Once more, now that the acceleration is known.
    let mut most = 0.0_f32;
    for (((_, _), j), [d1, d2, d3]) in limits().zip(bends) {
        let taken = d3 * square * speed + 3.0 * d2 * speed * accel;
        jerk = jerk.at_most((margin * j - taken) / d1.at_least(SLOPE_MIN));
        most = most.at_least(taken / j);
    }
    Room {
        square,
        accel,
        jerk,
        taken: most,
    }
}

/// A jump of the path from one patch to the next: of the derivatives of 1 - r k and of r times the twist, along the path and across it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Jump {
    /// Of q' itself, 1.
    pub(crate) first: [f32; 2],
    /// Of q'', 1/mm.
    pub(crate) second: [f32; 2],
}

/// Greatest square of the speed over a jump, which an axis sees as one of its velocity and its acceleration from one period to the next.
/// `cosines`: the path's direction. `taken`: share of the jerk that the bend takes.
pub(crate) fn over_jump(jump: &Jump, cosines: &[f32; 3], taken: f32, axes: &Axes, period_s: f32) -> f32 {
    let share = (BEND_MARGIN - ZONE_JERK - taken).at_least(0.0);
    let mut square = f32::MAX;
    for ((a, j), cosine) in axes.acceleration_mm_s2.iter().zip(&axes.jerk_mm_s3).zip(cosines) {
        let along = cosine.abs();
        let across = root(1.0 - squared(along));
        let on_axis = |[on, off]: [f32; 2]| along * on + across * off;
        let (first, second) = (on_axis(jump.first), on_axis(jump.second));
        if first > 0.0 {
            square = square.at_most(squared(share * a.at_most(j * period_s) * period_s / first));
        }
        if second > 0.0 {
            square = square.at_most(share * j * period_s / second);
        }
    }
    square
}

pub(crate) fn squared(value: f32) -> f32 {
    value * value
}

pub(crate) fn root(value: f32) -> f32 {
    sqrt(value.at_least(0.0))
}

/// The cube root of a positive number, within 1e-5 of itself: a guess out of the exponent, and two of Halley's steps.
pub(crate) fn cube_root(value: f32) -> f32 {
    if !(value > 0.0) {
        return 0.0;
    }
    let mut x = f32::from_bits(value.to_bits() / 3 + 0x2a51_4067);
    for _ in 0..2 {
        let cube = x * x * x;
        x *= (cube + 2.0 * value) / (2.0 * cube + value);
    }
    x
}
