//! The smoothed walk: increments between the nodes, and their moving average.

use super::{BUSY, NODES, SPEED_SQR, TIME, Walker};
use crate::feed::cell_motion::CellMotion;
use crate::feed::lists::{Lists, draft_mut, get, put};
use crate::feed::plan::Plan;
use crate::feed::stations::between;
use crate::feed::{MM_PER_Q10, to_q10};
use crate::math::number::{Bounded, to_f32};

impl Walker {
    /// Length from the node before to a node.
    pub(super) fn increment(&mut self, lists: &mut Lists, plan: &Plan, node: u16) {
        let Some(previous) = node.checked_sub(1) else {
            return;
        };
        let last = plan.stations.count().saturating_sub(1);
        let time = get(lists, NODES, node) * self.scale;
        while self.cell + 1 < last && get(lists, TIME, self.cell + 1) <= time {
            self.cell += 1;
        }
        let [start, end] = self.speeds.map(|speed| speed * plan.step_s);
        let flat = self.mean / 2 + 2;
        let place = if node + 1 == self.times {
            (plan.stations.length_nm(), 0.0)
        } else if start > 0.0 && node <= flat {
            (0, f32::from(node) * start)
        } else if end > 0.0 && node + 1 + flat >= self.times {
            let left = f32::from(self.times - 1 - node) * end;
            (plan.stations.length_nm(), -left)
        } else {
            let since = time - get(lists, TIME, self.cell);
            let [here, there] = [self.cell, self.cell + 1].map(|station| get(lists, SPEED_SQR, station));
            let length = plan.stations.cell_mm(self.cell);
            let motion = CellMotion::of(here, there, length, self.accel(lists, self.cell));
            (
                plan.stations.get(self.cell).arc_nm,
                motion.at(since).at_least(0.0).at_most(length),
            )
        };
        let ((from, from_mm), (to, to_mm)) = (self.before, place);
        put(
            lists,
            BUSY,
            previous,
            self.flat_increment(plan, previous)
                .unwrap_or((between(from, to) + (to_mm - from_mm)).at_least(0.0)),
        );
        self.before = place;
    }

    /// The exact length of an increment at the speed of an end.
    fn flat_increment(&self, plan: &Plan, index: u16) -> Option<f32> {
        let [start, end] = self.speeds;
        let flat = self.mean / 2 + 2;
        if start > 0.0 && index < flat {
            Some(start * plan.step_s)
        } else if end > 0.0 && index + 1 + flat >= self.times {
            Some(end * plan.step_s)
        } else {
            None
        }
    }

    /// Nodes that the mean is over.
    const fn mean_nodes(&self) -> u16 {
        if self.mean > 0 {
            self.mean
        } else {
            self.intervals - self.times
        }
    }

    /// An increment and its time, also beyond the ends, where the speed is that of the end.
    fn step_of(&self, lists: &Lists, plan: &Plan, index: i32) -> (i64, f32) {
        let [start, end] = self.speeds.map(|speed| to_q10(speed * plan.step_s));
        match u16::try_from(index) {
            Err(_) => (start, plan.step_s),
            Ok(index) if index + 1 >= self.times => (end, plan.step_s),
            Ok(index) => (
                to_q10(get(lists, BUSY, index)),
                self.scale * (get(lists, NODES, index + 1) - get(lists, NODES, index)),
            ),
        }
    }

    /// Increments of the mean before the first that the walk has where it begins at speed.
    fn skipped(&self) -> i32 {
        let [start, _] = self.speeds;
        if start > 0.0 {
            i32::from(self.mean + 1) / 2
        } else {
            0
        }
    }

    /// Sums of the mean before the first coefficient.
    pub(super) fn begin_means_at_speed(&mut self, lists: &Lists, plan: &Plan) {
        let n = i32::from(self.mean);
        let newest = self.skipped() - 3;
        (self.sum_q10, self.sum_s) = (0, 0.0);
        for index in newest + 1 - n..=newest {
            let (q10, seconds) = self.step_of(lists, plan, index);
            self.sum_q10 += q10;
            self.sum_s += seconds;
        }
    }

    /// A coefficient of a walk with an end at speed.
    pub(super) fn mean_at_speed(&mut self, lists: &mut Lists, plan: &mut Plan, index: u16) {
        let n = i32::from(self.mean);
        let newest = i32::from(index) + self.skipped() - 2;
        let (in_q10, in_s) = self.step_of(lists, plan, newest);
        let (out_q10, out_s) = self.step_of(lists, plan, newest - n);
        self.sum_q10 += in_q10 - out_q10;
        self.sum_s += in_s - out_s;
        let inverse = 1.0 / f32::from(self.mean);
        let [start, end] = plan.pinned();
        let is_pinned = index < start || index + end >= plan.intervals + 2;
        let at = usize::from(index);
        if let (Some(walk), Some(pace)) = (plan.walk.get_mut(at), draft_mut(lists).get_mut(at)) {
            *walk = to_f32(self.sum_q10) * MM_PER_Q10 * inverse;
            let ratio = plan.step_s / (self.sum_s * inverse).at_least(1e-9);
            *pace = if is_pinned { 1.0 } else { ratio * ratio };
        }
    }

    pub(super) fn begin_means(&mut self, plan: &Plan) {
        self.sum_q10 = 0;
        self.sum_s = f32::from(self.mean_nodes()) * plan.step_s;
    }

    /// A mean: a step of the walk, and its pace as it is.
    pub(super) fn mean(&mut self, lists: &mut Lists, plan: &mut Plan, index: u16) {
        let pairs = self.times - 1;
        let n = self.mean_nodes();
        let inverse = 1.0 / f32::from(n);
        let h = plan.step_s;
        let increment = |index: u16| to_q10(get(lists, BUSY, index));
        let duration = |index: u16| self.scale * (get(lists, NODES, index + 1) - get(lists, NODES, index));
        // The newest is index - 2, the oldest that leaves is index - 2 - n; beyond the ends nothing moves.
        let newest = index.checked_sub(2).filter(|newest| *newest < pairs);
        let oldest = index.checked_sub(2 + n).filter(|oldest| *oldest < pairs);
        let (mut sum_q10, mut sum_s) = (self.sum_q10, self.sum_s);
        if let Some(newest) = newest {
            sum_q10 += increment(newest);
            sum_s += duration(newest) - h;
        }
        if let Some(oldest) = oldest {
            sum_q10 -= increment(oldest);
            sum_s += h - duration(oldest);
        }
        let index = usize::from(index);
        if let (Some(walk), Some(pace)) = (plan.walk.get_mut(index), draft_mut(lists).get_mut(index)) {
            *walk = to_f32(sum_q10) * MM_PER_Q10 * inverse;
            let ratio = h / (sum_s * inverse).at_least(1e-9);
            *pace = ratio * ratio;
        }
        (self.sum_q10, self.sum_s) = (sum_q10, sum_s);
    }
}
