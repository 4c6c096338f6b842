//! A plan: the path's stations, a walk along them and the pace of the walk; and a cursor that moves along it.

mod cursor;
mod motion;

use super::limits::{FeedChange, MotionLimits};
use super::pace::{Trajectory, Use};
use super::profile::{SlotAt, Span};
use super::stations::Stations;
use super::{MM_PER_Q10, Q10_BITS, Q10_PER_MM, to_q10};
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, to_f32};
pub(crate) use cursor::Cursor;

/// Greatest and least number of intervals of a walk, and the least where their planning takes longer than the pass.
pub(crate) const NODES_MAX: usize = 160;
pub(crate) const NODES_MIN: u16 = 40;
pub(crate) const NODES_FEW: u16 = 30;

/// Coefficients of a walk's steps and of its pace.
pub(crate) const COEFFICIENTS: usize = NODES_MAX + 2;

/// Jumps of a path that a plan takes into account.
pub(crate) const KNOTS_MAX: usize = 84;

const PARTS_MAX: u8 = 8;
const INTERVALS_A_PART: f32 = 2.0;

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

    /// Every interval allows it, as far as is known.
    pub(crate) const fn allow_feed(&mut self) {
        self.exact = [u32::MAX; NODES_MAX / 32];
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

    /// Whether it begins or ends at speed, in a turn. Such a plan takes the planning time of the greatest number of nodes and stations, however many
    /// it has: more Newton steps would leave less of the limits to a hold.
    pub(crate) fn has_turn(&self) -> bool {
        self.pinned() != [0; 2]
    }

    /// Coefficients of the pace that the speeds at the ends fix, at the start and at the end.
    pub(crate) fn pinned(&self) -> [u16; 2] {
        self.ends.map(|speed| if speed > 0.0 { PINNED } else { 0 })
    }
}

impl Trajectory for Plan {
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

    fn ramp_s(&self) -> f32 {
        self.limits.ramp_s()
    }

    fn span_at(&self, cursor: &Cursor, slot: &SlotAt, room: &Use) -> Span {
        self.span_of(&self.limits, cursor, slot, room)
    }
}

impl Plan {
    /// Moves on at this pace; see [`Trajectory::advance`].
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

    /// Moves on at a pace that is being planned.
    pub(crate) fn advance_draft(&self, draft: &[f32], cursor: &mut Cursor, seconds: f32) {
        self.advance_at(draft, cursor, seconds);
    }

    /// Use of these limits at a pace that is being planned.
    pub(crate) fn use_draft(&self, draft: &[f32], limits: &MotionLimits, cursor: &Cursor) -> Use {
        self.use_of(draft, limits, cursor, [1.0, 0.0, 0.0], 0.0)
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
