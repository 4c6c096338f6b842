//! A plan: the path's stations, a walk along them and the pace of the walk; and a cursor that moves along it.

use super::limits::{AxisMotion, FeedChange, MotionLimits};
use super::pace::{Course, Use};
use super::profile::{SlotAt, Span, fastest_around};
use super::stations::{Derivatives, Stations};
use super::{MM_PER_Q10, Q10_BITS, Q10_PER_MM, to_q10};
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, to_f32};

/// Greatest and least number of intervals of a walk, and the least where their planning takes longer than the pass.
pub(crate) const NODES_MAX: usize = 160;
pub(crate) const NODES_MIN: u16 = 40;
pub(crate) const NODES_FEW: u16 = 30;

/// Coefficients of a walk's steps and of its pace.
pub(crate) const COEFFICIENTS: usize = NODES_MAX + 2;

/// Jumps of a path that a plan takes into account.
pub(crate) const KNOTS_MAX: usize = 84;

/// Distance from a jump within which a period may see it, periods.
const JUMP_REACH: f32 = 1.2;

/// Intervals before a place from which a jump near it is sought, and places that are looked at.
const KNOT_NEAR: u16 = 2;
const KNOTS_NEAR: usize = 8;
const KNOT_BITS: u32 = 7;
const _: () = assert!(KNOTS_MAX < 1 << KNOT_BITS);

/// Intervals that a step of a cursor may pass, and steps that a period is made of where nodes are closer together than that.
const INTERVALS_A_STEP: u16 = 4;
const PARTS_MAX: u8 = 8;
const INTERVALS_A_PART: f32 = 2.0;

/// Part of an interval by which a cursor is shifted at most.
const SHIFT_MAX: f32 = 0.05;

/// Coefficients of the pace next to an end at speed: the interval there has the speed of the end.
pub(crate) const PINNED: u16 = 3;

/// Distance from an end at speed within which the walk is made slower until the plan can begin at it, nm.
const NEAR_TURN_NM: u32 = 4_000_000;

/// Distance from an end at speed within which a change of the pace is looked at closely, nm.
const UNEVEN_NM: u32 = 15_000_000;

/// Where a jump lies: interval, fraction of it in units of 2^-16, and the first of its two stations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Knot {
    pub(crate) interval: u16,
    pub(crate) part: u16,
    pub(crate) station: u16,
}

/// The last stop before the end of a plan that goes on: the interval that it begins at, and its duration from the greatest pace, s.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gate {
    pub(crate) interval: u16,
    pub(crate) duration: f32,
    /// Time from there to the end at pace 1, s.
    pub(crate) before_end: f32,
}

/// A place ahead of the tool, and for how long the plan has been near the feed there, in periods at the plan's own pace.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lead {
    pub(crate) cursor: Cursor,
    pub(crate) near: f32,
}

impl Lead {
    pub(crate) const NONE: Self = Self {
        cursor: Cursor::START,
        near: 0.0,
    };
}

/// The plan of one path.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) stations: Stations,
    pub(crate) limits: MotionLimits,
    pub(crate) change: FeedChange,
    /// Speeds at the start and the end, mm/s: those of the apexes of turns, or rests.
    pub(crate) ends: [f32; 2],
    /// Greatest pace at which it may be followed.
    pub(crate) pace_max: f32,
    /// Use of the feed at the plan's own pace, where it is more than 1.
    pub(crate) over: f32,
    /// Where the last stop before the end begins.
    pub(crate) gate: Gate,
    /// Intervals of the walk, and the time of one at pace 1, s.
    pub(crate) intervals: u16,
    pub(crate) step_s: f32,
    pub(crate) inverse_step: f32,
    /// The walk: S is a cubic B-spline; differences of its coefficients, mm.
    pub(crate) walk: [f32; COEFFICIENTS],
    /// The pace c that is followed: coefficients of a quadratic B-spline.
    pub(crate) pace: [f32; COEFFICIENTS],
    /// Cell of the stations at each node, and the fraction of it in units of 2^-16.
    pub(crate) cells: [u16; NODES_MAX + 1],
    pub(crate) parts: [u16; NODES_MAX + 1],
    pub(crate) knots: [Knot; KNOTS_MAX],
    pub(crate) knot_count: u16,
    /// Periods that the plan takes at its own pace.
    pub(crate) periods: u32,
    /// What the length of each interval is corrected by, so that all of them are the path's length to a tenth of a nanometre, units of 2^-10 nm.
    pub(crate) trim_q10: i64,
    /// Intervals in which the axes allow the programmed feed where the plan is near it, a bit each.
    exact: [u32; NODES_MAX / 32],
    /// The place that a follower looks ahead from when it begins.
    pub(crate) lead: Lead,
}

/// An interval of a plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Interval {
    walk: [f32; 3],
    pace: [f32; 3],
}

impl Interval {
    /// Arc from the interval's start, mm.
    pub(crate) fn arc(&self, x: f32) -> f32 {
        let [a, b, c] = self.walk;
        let y = 1.0 - x;
        let start = a * (1.0 - y * y * y) + c * (x * x * x);
        start * (1.0 / 6.0) + b * x * (0.5 + x * (0.5 - x * (1.0 / 3.0)))
    }

    /// S', S'', S''' by k, mm.
    pub(crate) fn walk_rates(&self, x: f32) -> [f32; 3] {
        let [a, b, c] = self.walk;
        let y = 1.0 - x;
        [
            0.5 * (a * y * y + c * x * x) + b * (0.5 + x * y),
            y * (b - a) + x * (c - b),
            c - 2.0 * b + a,
        ]
    }

    /// c, c', c'' by k.
    pub(crate) fn pace_rates(&self, x: f32) -> [f32; 3] {
        let [a, b, c] = self.pace;
        let y = 1.0 - x;
        [
            0.5 * (a * y * y + c * x * x) + b * (0.5 + x * y),
            y * (b - a) + x * (c - b),
            c - 2.0 * b + a,
        ]
    }

    /// Square root of the pace.
    fn speed(&self, x: f32) -> f32 {
        let [pace, _, _] = self.pace_rates(x);
        sqrt(pace.at_least(0.0))
    }
}

impl Plan {
    /// Of no path.
    pub(crate) const NONE: Self = Self {
        stations: Stations::NONE,
        limits: MotionLimits::NONE,
        change: FeedChange::NONE,
        ends: [0.0; 2],
        pace_max: 1.0,
        over: 1.0,
        gate: Gate {
            interval: 0,
            duration: 0.0,
            before_end: 0.0,
        },
        intervals: 0,
        step_s: 0.0,
        inverse_step: 0.0,
        walk: [0.0; COEFFICIENTS],
        pace: [0.0; COEFFICIENTS],
        cells: [0; NODES_MAX + 1],
        parts: [0; NODES_MAX + 1],
        knots: [Knot {
            interval: 0,
            part: 0,
            station: 0,
        }; KNOTS_MAX],
        knot_count: 0,
        periods: 0,
        trim_q10: 0,
        exact: [0; NODES_MAX / 32],
        lead: Lead::NONE,
    };

    pub(crate) fn interval(&self, index: u16) -> Interval {
        self.interval_of(&self.pace, index)
    }

    /// An interval with this pace.
    fn interval_of(&self, pace: &[f32], index: u16) -> Interval {
        let three = |values: &[f32]| {
            let from = usize::from(index);
            match values.get(from..from + 3) {
                Some(&[a, b, c]) => [a, b, c],
                _ => [0.0; 3],
            }
        };
        Interval {
            walk: three(&self.walk),
            pace: three(pace),
        }
    }

    /// Length of an interval, units of 2^-10 nm.
    fn interval_q10(&self, index: u16) -> i64 {
        to_q10(self.interval(index).arc(1.0)) + self.trim_q10
    }

    /// Places a node at this arc among the stations, from this cell on; the cell, and the arc of the next node, units of 2^-10 nm.
    pub(crate) fn place_node(&mut self, node: u16, cell: u16, arc_q10: i64) -> (u16, i64) {
        let cell = self.stations.cell_between(cell, self.stations.count(), arc_q10);
        let since = self.stations.since(cell, arc_q10);
        let part = (since / self.stations.cell_mm(cell).at_least(1e-7))
            .at_least(0.0)
            .at_most(1.0);
        let index = usize::from(node);
        if let (Some(to_cell), Some(to_part)) = (self.cells.get_mut(index), self.parts.get_mut(index)) {
            *to_cell = cell;
            *to_part = u16::try_from(truncated(part * 65535.0)).unwrap_or(u16::MAX);
        }
        let length_q10 = if node < self.intervals {
            self.interval_q10(node)
        } else {
            0
        };
        (cell, arc_q10 + length_q10)
    }

    /// Trims the intervals, which have this length together, to the path's length.
    pub(crate) fn trim(&mut self, length_q10: i64) {
        let missing = self.length_q10() - length_q10;
        self.trim_q10 = missing.checked_div(i64::from(self.intervals)).unwrap_or(0);
    }

    /// Cell of a node, and the fraction of it in units of 2^-16.
    pub(crate) fn node(&self, node: u16) -> [u16; 2] {
        let index = usize::from(node);
        [&self.cells, &self.parts].map(|values| values.get(index).copied().unwrap_or(0))
    }

    pub(crate) fn knot(&self, index: u16) -> Option<Knot> {
        let knots = self.knots.get(..usize::from(self.knot_count))?;
        knots.get(usize::from(index)).copied()
    }

    /// Whether the axes allow the programmed feed in an interval where the plan is near it.
    pub(crate) fn allows_feed(&self, interval: u16) -> bool {
        let word = self.exact.get(usize::from(interval / 32)).copied().unwrap_or(0);
        word >> (interval % 32) & 1 != 0
    }

    /// Whether every interval from this one on allows it, as far as is known.
    pub(crate) fn allow_feed_from(&mut self, first: u16, does: bool) {
        let mut left = u32::from(first);
        for word in &mut self.exact {
            let before = left.min(32);
            let kept = u32::MAX.checked_shr(32 - before).unwrap_or(0);
            *word = (*word & kept) | if does { !kept } else { 0 };
            left -= before;
        }
    }

    /// An interval does not allow it.
    pub(crate) fn forbid_feed(&mut self, interval: u16) {
        if let Some(word) = self.exact.get_mut(usize::from(interval / 32)) {
            *word &= !(1 << (interval % 32));
        }
    }

    /// Length of the path, units of 2^-10 nm.
    pub(crate) fn length_q10(&self) -> i64 {
        i64::from(self.stations.length_nm()) << Q10_BITS
    }
}

/// A place on a plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cursor {
    pub(crate) interval: u16,
    /// Fraction of the interval.
    pub(crate) x: f32,
    /// On the plan after the one that is followed.
    pub(crate) is_next: bool,
    /// Arc at the start of the interval, units of 2^-10 nm.
    pub(super) start_q10: i64,
}

impl Cursor {
    pub(crate) const START: Self = Self {
        interval: 0,
        x: 0.0,
        is_next: false,
        start_q10: 0,
    };

    /// The same place on the plan that is followed, of a place on the one after it.
    pub(crate) fn come_near(&self) -> Option<Self> {
        self.is_next.then_some(Self {
            is_next: false,
            ..*self
        })
    }

    /// At a node, to within rounding of its part of a cell.
    pub(crate) fn at_node(plan: &Plan, node: u16) -> Self {
        let [cell, part] = plan.node(node);
        let start = i64::from(plan.stations.get(cell).arc_nm) << Q10_BITS;
        let since = plan.stations.cell_mm(cell) * f32::from(part) * (1.0 / 65536.0);
        Self {
            interval: node,
            x: 0.0,
            is_next: false,
            start_q10: start + to_q10(since),
        }
    }

    /// Arc from the start of the path, units of 2^-10 nm.
    pub(crate) fn arc_q10(&self, plan: &Plan) -> i64 {
        self.start_q10 + to_q10(plan.interval(self.interval).arc(self.x))
    }

    /// Speed of the plan's own pace, mm/s.
    pub(crate) fn speed(&self, plan: &Plan) -> f32 {
        self.speed_of(&plan.interval(self.interval), plan)
    }

    fn speed_of(&self, interval: &Interval, plan: &Plan) -> f32 {
        let [slope, _, _] = interval.walk_rates(self.x);
        slope * interval.speed(self.x) * plan.inverse_step
    }

    /// Square of the speed of the plan's own pace, (mm/s)^2: without a root.
    pub(crate) fn speed_sqr(&self, plan: &Plan) -> f32 {
        self.speed_sqr_of(&plan.interval(self.interval), plan)
    }

    /// The same of a pace that is being planned.
    pub(crate) fn draft_speed_sqr(&self, plan: &Plan, draft: &[f32]) -> f32 {
        self.speed_sqr_of(&plan.interval_of(draft, self.interval), plan)
    }

    fn speed_sqr_of(&self, interval: &Interval, plan: &Plan) -> f32 {
        let [slope, _, _] = interval.walk_rates(self.x);
        let [pace, _, _] = interval.pace_rates(self.x);
        let slope = slope * plan.inverse_step;
        slope * slope * pace.at_least(0.0)
    }

    /// Moves by this arc, mm, small against an interval; not where the walk nearly stands, and would have to go far. Returns whether it moved.
    pub(crate) fn shift(&mut self, mm: f32, plan: &Plan) -> bool {
        let [slope, _, _] = plan.interval(self.interval).walk_rates(self.x);
        let by = mm / slope.at_least(1e-9);
        let is_small = by.abs() < SHIFT_MAX;
        if is_small {
            self.x = (self.x + by).at_least(0.0);
            self.carry(plan);
        }
        is_small
    }

    /// Into the next interval where the fraction is above 1.
    fn carry(&mut self, plan: &Plan) {
        for _ in 0..INTERVALS_A_STEP {
            if self.x < 1.0 || self.interval + 1 >= plan.intervals {
                break;
            }
            self.start_q10 += plan.interval_q10(self.interval);
            self.x -= 1.0;
            self.interval += 1;
        }
    }
}

impl Plan {
    /// Whether it goes on in the plan of the next pass.
    pub(crate) fn goes_on(&self) -> bool {
        let [_, end] = self.ends;
        end > 0.0
    }

    /// Whether a cursor is where the last stop before the end has begun.
    pub(crate) const fn is_past_gate(&self, cursor: &Cursor) -> bool {
        cursor.interval >= self.gate.interval
    }

    /// Time to the gate at pace 1, s.
    pub(crate) fn before_gate(&self) -> f32 {
        to_f32(i64::from(self.periods)) * self.limits.period - self.gate.before_end
    }

    /// Whether an arc is near an end at speed.
    pub(crate) fn is_near_turn(&self, arc_nm: u32) -> bool {
        self.is_near_end_at_speed(arc_nm, NEAR_TURN_NM)
    }

    fn is_near_end_at_speed(&self, arc_nm: u32, near_nm: u32) -> bool {
        let [start, end] = self.ends;
        let left = self.stations.length_nm().saturating_sub(arc_nm);
        (start > 0.0 && arc_nm < near_nm) || (end > 0.0 && left < near_nm)
    }

    /// Time at pace 1 by which a cursor is beyond the end, s.
    pub(crate) fn beyond(&self, cursor: &Cursor) -> f32 {
        (cursor.x - 1.0).at_least(0.0) * self.step_s
    }

    /// Coefficients of the pace that the speeds at the ends fix, at the start and at the end.
    pub(crate) fn pinned(&self) -> [u16; 2] {
        self.ends.map(|speed| if speed > 0.0 { PINNED } else { 0 })
    }
}

impl Course for Plan {
    type Cursor = Cursor;

    fn advance(&self, cursor: &mut Cursor, seconds: f32) {
        self.advance_at(&self.pace, cursor, seconds);
    }

    fn is_over(&self, cursor: &Cursor) -> bool {
        cursor.interval + 1 >= self.intervals && cursor.x >= 1.0
    }

    fn use_at(&self, cursor: &Cursor, rates: [f32; 3], around: f32) -> Use {
        self.use_of(&self.pace, &self.limits, cursor, rates, around)
    }

    fn is_uneven(&self, cursor: &Cursor) -> bool {
        let arc_nm = u32::try_from(cursor.start_q10 >> Q10_BITS).unwrap_or(u32::MAX);
        self.is_near_end_at_speed(arc_nm, UNEVEN_NM)
    }

    fn span_at(&self, cursor: &Cursor, slot: &SlotAt, room: &Use) -> Span {
        self.span_of(&self.limits, cursor, slot, room)
    }
}

impl Plan {
    /// Moves on at this pace; see [`Course::advance`].
    fn advance_at(&self, pace: &[f32], cursor: &mut Cursor, seconds: f32) {
        let by = seconds * self.inverse_step;
        let intervals = by * self.interval_of(pace, cursor.interval).speed(cursor.x);
        // As a rule a step stays within two intervals.
        if intervals <= INTERVALS_A_PART {
            return self.step_at(pace, cursor, by);
        }
        let parts = u8::try_from(truncated(intervals * (1.0 / INTERVALS_A_PART)))
            .unwrap_or(u8::MAX)
            .saturating_add(1)
            .min(PARTS_MAX);
        for _ in 0..parts {
            self.step_at(pace, cursor, by / f32::from(parts));
        }
    }

    /// A step by the midpoint rule, in time of an interval at pace 1.
    #[inline(always)]
    fn step_at(&self, pace: &[f32], cursor: &mut Cursor, by: f32) {
        let here = self.interval_of(pace, cursor.interval);
        let half = cursor.x + 0.5 * by * here.speed(cursor.x);
        let middle = if half < 1.0 || cursor.interval + 1 >= self.intervals {
            here.speed(half.at_most(1.0))
        } else {
            self.interval_of(pace, cursor.interval + 1).speed(half - 1.0)
        };
        cursor.x += by * middle;
        cursor.carry(self);
    }

    /// Use of these limits at this pace; see [`Course::use_at`].
    fn use_of(
        &self,
        pace: &[f32],
        limits: &MotionLimits,
        cursor: &Cursor,
        rates: [f32; 3],
        around: f32,
    ) -> Use {
        let [r, r1, r2] = rates;
        let here = self.motion_at(pace, limits, cursor, r, around);
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

    /// What the limits leave to the derivatives of the pace; see [`Course::span_at`].
    fn span_of(&self, limits: &MotionLimits, cursor: &Cursor, slot: &SlotAt, room: &Use) -> Span {
        let SlotAt {
            r,
            first,
            slot_s,
            around,
        } = *slot;
        let here = self.motion_at(&self.pace, limits, cursor, r, around);
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

    /// The motion at a place, and at the pace r the jumps that a time around it sees.
    #[inline(always)]
    fn motion_at(
        &self,
        pace: &[f32],
        limits: &MotionLimits,
        cursor: &Cursor,
        r: f32,
        around: f32,
    ) -> MotionAt {
        let interval = self.interval_of(pace, cursor.interval);
        let x = cursor.x.at_most(1.0);
        let inverse = self.inverse_step;
        let [s1, s2, s3] = interval.walk_rates(x);
        let [c, c1, c2] = interval.pace_rates(x);
        let root = sqrt(c.at_least(0.0)) * inverse;
        let square = inverse * inverse;
        let v = s1 * root;
        let a = (s2 * c + 0.5 * s1 * c1) * square;
        let j = root * square * (s3 * c + 1.5 * s2 * c1 + 0.5 * s1 * c2);
        // The jerk steps at a node: where the place stands for some time around it, both sides count.
        let reach = 2.0 * around * root * r;
        let beside = if x + reach > 1.0 && cursor.interval + 1 < self.intervals {
            Some(self.interval_of(pace, cursor.interval + 1))
        } else if x < reach && cursor.interval > 0 {
            Some(self.interval_of(pace, cursor.interval - 1))
        } else {
            None
        };
        let j_beside = beside.map_or(j, |beside| {
            let [_, _, s3] = beside.walk_rates(0.0);
            let [_, _, c2] = beside.pace_rates(0.0);
            root * square * (s3 * c + 1.5 * s2 * c1 + 0.5 * s1 * c2)
        });
        let arc_q10 = cursor.start_q10 + to_q10(interval.arc(x));
        let [from, _] = self.node(cursor.interval);
        let [to, _] = self.node(cursor.interval + 1);
        let cell = self.stations.cell_between(from, to, arc_q10);
        let length = self.stations.cell_mm(cell);
        let since = self.stations.since(cell, arc_q10);
        let part = (since / length.at_least(1e-7)).at_least(0.0).at_most(1.0);
        let q = self.stations.blend(cell, part);
        let near = (JUMP_REACH * limits.period).at_least(around) * v * r;
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
            j: [j, j_beside],
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

    /// Moves on at a pace that is being planned.
    pub(crate) fn advance_draft(&self, draft: &[f32], cursor: &mut Cursor, seconds: f32) {
        self.advance_at(draft, cursor, seconds);
    }

    /// Use of these limits at a pace that is being planned.
    pub(crate) fn use_draft(&self, draft: &[f32], limits: &MotionLimits, cursor: &Cursor) -> Use {
        self.use_of(draft, limits, cursor, [1.0, 0.0, 0.0], 0.0)
    }
}

/// The motion of a plan at a place.
struct MotionAt {
    /// mm/s, mm/s^2; jerk on either side of a node nearby, mm/s^3.
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
    /// mm/s^2, and mm/s^3 on either side of a node nearby.
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

/// Arc of a plan in mm, from units of 2^-10 nm.
pub(crate) fn to_mm(q10: i64) -> f32 {
    to_f32(q10) * MM_PER_Q10
}

/// A step in units of 2^-10 nm, from mm.
#[allow(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, and a NaN becomes 0"
)]
pub(crate) fn step_q10(mm: f32) -> i32 {
    (mm * Q10_PER_MM + 0.5) as i32
}
