//! The number of nodes and their times: close together where the speed changes.

use core::ops::Range;

use super::{ACCEL, BUSY, NODES, SPACING, SPEED_SQR, TIME, Vary, Walker};
use crate::feed::deadlines::Deadlines;
use crate::feed::limits::MotionLimits;
use crate::feed::lists::{Lists, get, put};
use crate::feed::node_times::NodeTimes;
use crate::feed::plan::{NODES_FEW, NODES_MAX, NODES_MIN, Plan};
use crate::feed::stations::between;
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, cube_root, to_f32};

pub(super) const GROWTH: f32 = 0.12;

/// The same for a pass that takes longer than this, s, so that its nodes are still fine at the rests.
const GROWTH_LONG: f32 = 0.25;
const LONG: f32 = 20.0;
const SPACING_MAX: f32 = 0.1;

/// Time between nodes that is worth its planning, s.
const SPACING_WORTH: f32 = 4e-3;

/// Shortest mean, in finest spacings: with an end at speed, and from rest to rest, where a shorter one makes slow plans beside a jump, which three periods see.
const MEAN_MIN: f32 = 4.0;
const MEAN_MIN_TO_REST: f32 = 20.0;

/// Longest mean of a walk with an end at speed, s, and the time for which it has that speed, as a multiple of it.
pub(super) const MEAN_MAX: f32 = 0.05;

/// Periods that the rest of the planning takes: for a node with an end at speed, and from rest to rest; for a place of the check, and for what is left.
const PERIODS_A_NODE: f32 = 2.5;
const PERIODS_A_NODE_TO_REST: f32 = 2.9;
const PERIODS_A_PLACE: f32 = 0.067;
const PERIODS_A_PLAN: f32 = 52.0;

/// The same for the last stop before a turn, and the shares of the walk's time that a plan takes: with an end at speed, and from rest to rest.
const PERIODS_A_STOP: f32 = 200.0;
const WALKED: f32 = 0.75;
const WALKED_TO_REST: f32 = 0.7;

impl Walker {
    /// Nodes by which the mean lengthens the walk: half of it at each rest.
    fn lengthening(&self, mean: u16) -> u16 {
        let [start, end] = self.speeds.map(|speed| u16::from(speed == 0.0));
        (start + end) * mean.div_ceil(2)
    }

    /// Length of the mean, once the duration is known.
    pub(super) fn choose_mean(&mut self, plan: &Plan) {
        let time = self.duration;
        let length = between(0, plan.stations.length_nm());
        self.mean_s = (self.acceleration / self.jerk)
            .at_most(1.2 * sqrt(length / time / self.jerk))
            .at_most(cube_root(0.5 * length / self.jerk));
        self.mean_s = if self.is_from_rest_to_rest() {
            self.mean_s.at_least(MEAN_MIN_TO_REST * self.finest)
        } else {
            self.mean_s.at_most(MEAN_MAX).at_least(MEAN_MIN * self.finest)
        };
    }

    /// As many intervals as are worth their planning, and no more than leave the plan longer than its planning, unless the tool waits for it and the
    /// next one need not be hurried.
    pub(super) fn choose_intervals(&mut self, limits: &MotionLimits, deadlines: Deadlines) {
        let Deadlines {
            least, left, waits, ..
        } = deadlines;
        let whole = |value: f32| u16::try_from(truncated(value.at_least(0.0))).unwrap_or(u16::MAX);
        let time = self.duration;
        let most = whole(time / self.finest).clamp(NODES_LEAST, NODES_COUNT);
        let wanted = whole(time / SPACING_WORTH.at_least(self.finest));
        self.intervals = wanted.clamp(NODES_MIN.min(most), most);
        if least > 0 {
            let (lasts, plan, node) = if self.is_from_rest_to_rest() {
                let lasts = WALKED_TO_REST * (time + self.mean_s);
                (lasts, PERIODS_A_PLAN, PERIODS_A_NODE_TO_REST)
            } else {
                (WALKED * time, PERIODS_A_PLAN + PERIODS_A_STOP, PERIODS_A_NODE)
            };
            let lasts = lasts / limits.period;
            let own = lasts - to_f32(i64::from(least));
            let until = own.at_most(left.unwrap_or(f32::MAX));
            let planned = whole((until - PERIODS_A_PLACE * lasts - plan) / node);
            let fewest = NODES_FEW.min(most);
            let usual = self.intervals.min(planned).max(fewest);
            if waits && usual > fewest {
                self.usual = Some((usual, least));
            } else {
                self.intervals = usual;
            }
        }
        self.growth = if time > LONG { GROWTH_LONG } else { GROWTH };
        let parts = if self.is_from_rest_to_rest() { 6.0 } else { 16.0 };
        self.ends = (self.mean_s / parts)
            .at_least(self.finest)
            .at_least(time / (4000.0 * f32::from(self.intervals)));
    }

    /// The greatest speed of the walk; the start is busy.
    pub(super) fn begin_busy(&mut self, lists: &mut Lists, last: u16) {
        self.top = 0.0;
        for station in 0..=last {
            self.top = get(lists, SPEED_SQR, station).at_least(self.top);
        }
        self.busy = 0;
        self.add_busy(lists, 0.0);
    }

    pub(super) fn add_busy(&mut self, lists: &mut Lists, time: f32) {
        put(lists, BUSY, self.busy, time);
        self.busy += 1;
    }

    /// Times at which something happens in these cells.
    pub(super) fn find_busy(
        &mut self,
        lists: &mut Lists,
        plan: &Plan,
        limits: &MotionLimits,
        cells: Range<u16>,
    ) {
        for cell in cells {
            let is_busy = if plan.stations.is_jump(cell) {
                limits.jump_speed(&plan.stations.jump(cell)) < 1.5 * limits.feed
            } else {
                let change = get(lists, SPEED_SQR, cell + 1) - get(lists, SPEED_SQR, cell);
                let is_capped = get(lists, ACCEL, cell) < 0.0 || get(lists, ACCEL, cell + 1) < 0.0;
                change.abs() >= 1e-3 * self.top || is_capped
            };
            if is_busy {
                let middle = 0.5 * (get(lists, TIME, cell) + get(lists, TIME, cell + 1));
                let rests = self.rests_in(lists, plan, cell);
                self.add_busy(lists, if rests { -middle } else { middle });
            }
        }
    }

    /// Spacing and growth for a value of what is varied.
    pub(super) fn spacing(&self, value: f32) -> [f32; 2] {
        match self.vary {
            Vary::Even => [value, 0.0],
            Vary::Growth => [SPACING.at_least(self.finest), value],
            Vary::Coarse => [value, self.growth],
        }
    }

    /// Nodes left for the mean over `n` of them.
    fn room(&self, spacing: f32) -> u16 {
        let mean = self.mean_at(spacing);
        if self.is_from_rest_to_rest() {
            return self.intervals.saturating_sub(mean);
        }
        (self.intervals + 1).saturating_sub(self.lengthening(mean | 1))
    }

    /// Nodes that the mean is over, at a spacing at the ends.
    fn mean_at(&self, spacing: f32) -> u16 {
        let mean = truncated(self.mean_s / spacing.at_most(self.ends) + 0.5).max(2);
        u16::try_from(mean).unwrap_or(u16::MAX).min(self.intervals)
    }

    pub(super) fn fits(&self, lists: &Lists, spacing: f32, growth: f32) -> bool {
        let room = self.room(spacing);
        let mut nodes = self.nodes_at(lists, spacing, growth);
        while nodes.next(lists).is_some() {
            if nodes.count > room {
                return false;
            }
        }
        true
    }

    fn nodes_at(&self, lists: &Lists, spacing: f32, growth: f32) -> NodeTimes {
        NodeTimes {
            duration: self.duration,
            mean_s: self.mean_s,
            spacing,
            growth,
            widest: SPACING_MAX
                .at_least(3.0 * self.duration / f32::from(self.intervals))
                .at_least(spacing),
            end_spacing: spacing.at_most(self.ends),
            end_growth: self.growth,
            at: 0.0,
            busy: 1,
            busy_count: self.busy,
            last: get(lists, BUSY, 0),
            following: get(lists, BUSY, 1),
            rests: [0.0; 2],
            rest: 1,
            count: 0,
        }
    }

    /// Writes the times of the nodes.
    pub(super) fn times(&mut self, lists: &mut Lists, plan: &mut Plan) {
        let [spacing, growth] = self.spacing(self.high);
        let mut nodes = self.nodes_at(lists, spacing, growth);
        let most = if self.is_from_rest_to_rest() {
            self.intervals - 2
        } else {
            self.room(spacing)
        };
        let mut last = 0.0;
        while let Some(time) = nodes.next(lists) {
            put(lists, NODES, nodes.count - 1, time);
            last = time;
            if nodes.count >= most {
                break;
            }
        }
        self.times = nodes.count;
        self.scale = self.duration / last.at_least(1e-9);
        (self.cell, self.before) = (0, (0, 0.0));
        plan.step_s = spacing.at_most(self.ends);
        if !self.is_from_rest_to_rest() {
            // The interval is as long as the spacing at an end, so that the walk has the speed there.
            self.mean = self.mean_at(spacing) | 1;
            self.intervals = (self.times - 1)
                .saturating_add(self.lengthening(self.mean))
                .min(NODES_COUNT);
            plan.step_s *= self.scale;
        }
        plan.intervals = self.intervals;
        plan.inverse_step = 1.0 / plan.step_s;
    }
}

/// Least intervals of a pass of few periods.
const NODES_LEAST: u16 = 12;

/// Most intervals as u16.
pub(crate) const NODES_COUNT: u16 = 160;
const _: () = assert!(NODES_COUNT as usize == NODES_MAX);
