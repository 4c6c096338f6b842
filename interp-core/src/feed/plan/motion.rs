//! The motion of the axes at a place of a plan, and what it uses of their limits.

use super::{Cursor, KNOTS_MAX, Plan};
use crate::feed::limits::{AxisMotion, MotionLimits};
use crate::feed::pace::Use;
use crate::feed::profile::{SlotAt, Span, fastest_around};
use crate::feed::stations::Derivatives;
use crate::feed::to_q10;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;

/// Distance from a jump within which a period may see it, periods; from the end of a slot of a profile: the jerk of a period is a mean over three.
const JUMP_REACH: f32 = 1.2;
const JUMP_BEYOND: f32 = 0.8;

/// Least c that the change of the jerk is divided by.
const C_MIN: f32 = 1e-6;

/// Intervals before a place from which a jump near it is sought, and places that are looked at.
const KNOT_NEAR: u16 = 2;
const KNOTS_NEAR: usize = 8;
const KNOT_BITS: u32 = 7;
const _: () = assert!(KNOTS_MAX < 1 << KNOT_BITS);

impl Plan {
    /// Use of these limits at this pace; see [`use_at`](crate::feed::pace::Trajectory::use_at).
    pub(super) fn use_of(
        &self,
        pace: &[f32],
        limits: &MotionLimits,
        cursor: &Cursor,
        rates: [f32; 3],
        around: f32,
    ) -> Use {
        let [r, r1, r2] = rates;
        let here = self.motion_at(pace, limits, cursor, r, [around; 2]);
        let v = here.v;
        let speed = v * r;
        let mut most = Use {
            feed: speed / limits.feed,
            ..Use::NONE
        };
        here.each_axis(limits, |axis| {
            let jerk = |j: f32| {
                let jerk = (j * r * r + 3.0 * axis.acceleration * r1) * r + axis.slope * v * r2;
                jerk.abs()
            };
            let [j, j_beside] = axis.jerk;
            let of_pace = jerk(j).at_least(jerk(j_beside));
            most.add(&Use {
                feed: 0.0,
                velocity: (axis.slope * speed).abs() * axis.inverse.velocity,
                acceleration: (axis.acceleration * r * r + axis.slope * v * r1).abs()
                    * axis.inverse.acceleration,
                jerk: of_pace * axis.inverse.jerk + axis.of_jump,
            });
        });
        most
    }

    /// What the limits leave to the derivatives of the pace; see [`span_at`](crate::feed::pace::Trajectory::span_at).
    pub(super) fn span_of(&self, limits: &MotionLimits, cursor: &Cursor, slot: &SlotAt, room: &Use) -> Span {
        let SlotAt {
            r,
            first,
            slot_s,
            around,
        } = *slot;
        let sees = around + JUMP_BEYOND * limits.period;
        let here = self.motion_at(&self.pace, limits, cursor, r, [around, sees]);
        // The speed changes over the time around the place.
        let [j, j_beside] = here.j;
        let fastest = fastest_around([here.v, here.a, j.abs().at_least(j_beside.abs())], r * around);
        let mut span = Span::WIDE;
        here.each_axis(limits, |axis| {
            let along = axis.slope * fastest;
            let [jerk, _] = axis.jerk;
            let later = axis.acceleration + 0.5 * slot_s * r * jerk;
            span.add_acceleration(
                [axis.acceleration, later].map(|a| a * r * r * axis.inverse.acceleration),
                axis.slope * here.v * axis.inverse.acceleration,
                room.acceleration,
            );
            let inverse = axis.inverse.jerk;
            let by_first = 3.0 * axis.acceleration * r;
            let [one, other] = axis.jerk;
            let cube = r * r * r * inverse;
            let of_first = by_first * first * inverse;
            span.add_jerk(
                [one.at_most(other), one.at_least(other)].map(|j| j * cube + of_first),
                [along * inverse, (along + by_first * slot_s) * inverse],
                room.jerk - axis.of_jump,
            );
        });
        span
    }

    /// The motion at a place that stands for some time around it, and at the pace r the jumps within another time.
    #[inline(always)]
    fn motion_at(
        &self,
        pace: &[f32],
        limits: &MotionLimits,
        cursor: &Cursor,
        r: f32,
        [around, sees]: [f32; 2],
    ) -> MotionAt {
        let interval = self.interval_of(pace, cursor.interval);
        let x = cursor.x.at_most(1.0);
        let inverse = self.inverse_step;
        let [walk, rates] = [interval.walk_rates(x), interval.pace_rates(x)];
        let [s1, s2, _] = walk;
        let [c, c1, _] = rates;
        let root = sqrt(c.at_least(0.0)) * inverse;
        let v = s1 * root;
        let a = (s2 * c + 0.5 * s1 * c1) * inverse * inverse;
        let [j, change] = jerk(walk, rates, inverse);
        let [mut least, mut most] = [j, j];
        if around > 0.0 {
            // The jerk changes along an interval and steps at a node: all of the time that the place stands for counts.
            let within = around * root * r;
            // The jerk of a period is a mean over three.
            let reach = within + limits.period * root * r;
            let mut add = |j: f32| (least, most) = (least.at_most(j), most.at_least(j));
            add(j - change * within.at_most(x));
            add(j + change * within.at_most(1.0 - x));
            let mut add_beside = |index: u16, node: f32, beyond: f32| {
                let beside = self.interval_of(pace, index);
                let [j, change] = jerk(beside.walk_rates(node), beside.pace_rates(node), inverse);
                add(j);
                add(j + beyond * change);
            };
            if x < reach && cursor.interval > 0 {
                add_beside(cursor.interval - 1, 1.0, (x - within).at_most(0.0));
            }
            if x + reach > 1.0 && cursor.interval + 1 < self.intervals {
                add_beside(cursor.interval + 1, 0.0, (x + within - 1.0).at_least(0.0));
            }
        }
        // Near the feed the tool moves at exactly that, and the plan's own jerk may help nothing.
        let is_near = (v - self.limits.feed).abs() < self.change.near;
        let exact = if is_near { 0.0 } else { j };
        let j = [least.at_most(exact), most.at_least(exact)];
        let arc_q10 = cursor.start_q10 + to_q10(interval.arc(x));
        let [from, _] = self.node(cursor.interval);
        let [to, _] = self.node(cursor.interval + 1);
        let cell = self.stations.cell_between(from, to, arc_q10);
        let length = self.stations.cell_mm(cell);
        let since = self.stations.since(cell, arc_q10);
        let part = (since / length.at_least(1e-7)).at_least(0.0).at_most(1.0);
        let q = self.stations.blend(cell, part);
        let near = (JUMP_REACH * limits.period).at_least(sees) * v * r;
        let jump = if since <= near && cell > 0 && self.stations.is_jump(cell - 1) {
            Some(cell - 1)
        } else if length - since <= near && self.stations.is_jump(cell + 1) {
            Some(cell + 1)
        } else {
            None
        };
        let mut at_jump = 0.0;
        let jump = jump.map_or([[0.0; 2]; 3], |station| {
            at_jump = self.speed_over(pace, station, cursor.interval).unwrap_or(v) * r;
            limits.jump_jerk(&self.stations.jump(station))
        });
        MotionAt {
            v,
            a,
            j,
            at_jump,
            q,
            jump,
        }
    }

    /// Speed of a pace over a jump that is near an interval, mm/s; none of a jump that does not matter.
    fn speed_over(&self, pace: &[f32], station: u16, near: u16) -> Option<f32> {
        let knots = self.knots.get(..usize::from(self.knot_count))?;
        let from = near.saturating_sub(KNOT_NEAR);
        let mut first = 0;
        for bit in (0..KNOT_BITS).rev() {
            let further = first + (1 << bit);
            if knots.get(further - 1).is_some_and(|knot| knot.interval < from) {
                first = further;
            }
        }
        let mut near = knots.get(first..)?.iter().take(KNOTS_NEAR);
        let knot = near.find(|knot| knot.station == station)?;
        let x = f32::from(knot.part) * (1.0 / 65536.0);
        let interval = self.interval_of(pace, knot.interval);
        let [slope, _, _] = interval.walk_rates(x);
        Some(slope * interval.speed(x) * self.inverse_step)
    }
}

/// The jerk at a place, mm/s^3, and its change by k within the interval, from S', S'', S''' and c, c', c'' there.
#[inline(always)]
fn jerk([s1, s2, s3]: [f32; 3], [c, c1, c2]: [f32; 3], inverse: f32) -> [f32; 2] {
    let scale = sqrt(c.at_least(0.0)) * inverse * inverse * inverse;
    let jerk = scale * (s3 * c + 1.5 * s2 * c1 + 0.5 * s1 * c2);
    let of_root = 0.5 * c1 / c.at_least(C_MIN);
    [jerk, scale * (2.5 * s3 * c1 + 2.0 * s2 * c2) + of_root * jerk]
}

/// The motion of a plan at a place.
struct MotionAt {
    /// mm/s, mm/s^2; least and greatest jerk around the place, mm/s^3.
    v: f32,
    a: f32,
    j: [f32; 2],
    /// Speed at the pace over a jump nearby, mm/s.
    at_jump: f32,
    q: Derivatives,
    jump: [[f32; 2]; 3],
}

/// The motion of an axis at a place.
struct AxisAt<'a> {
    slope: f32,
    /// mm/s^2, and the least and the greatest around the place, mm/s^3.
    acceleration: f32,
    jerk: [f32; 2],
    /// Jerk of a jump nearby, as a fraction of the limit.
    of_jump: f32,
    inverse: &'a AxisMotion,
}

impl MotionAt {
    /// Calls `each` with each axis.
    #[inline(always)]
    fn each_axis(&self, limits: &MotionLimits, mut each: impl FnMut(&AxisAt)) {
        let Self { v, a, at_jump, .. } = *self;
        for ((inverse, [q1, q2, q3]), [first, second]) in limits.inverse.iter().zip(&self.q).zip(&self.jump) {
            let bend = (q3 * v * v + 3.0 * q2 * a) * v;
            each(&AxisAt {
                slope: *q1,
                acceleration: q2 * v * v + q1 * a,
                jerk: self.j.map(|j| bend + q1 * j),
                of_jump: (first + second * at_jump) * at_jump,
                inverse,
            });
        }
    }
}
