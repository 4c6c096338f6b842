//! A place on a plan.

use super::{Interval, Plan};
use crate::feed::{Q10_BITS, to_q10};
use crate::math::number::Bounded;

/// Intervals that a step of a cursor may pass, and steps that a period is made of where nodes are closer together than that.
const INTERVALS_A_STEP: u16 = 4;

/// Part of an interval by which a cursor is shifted at most.
const SHIFT_MAX: f32 = 0.05;

/// A place on a plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cursor {
    pub(crate) interval: u16,
    /// Fraction of the interval.
    pub(crate) x: f32,
    /// On the plan after the one that is followed.
    pub(crate) is_next: bool,
    /// Arc at the start of the interval, units of 2^-10 nm.
    pub(in crate::feed) start_q10: i64,
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
        let by = mm / self.slope(plan);
        let is_small = by.abs() < SHIFT_MAX;
        if is_small {
            self.x += by;
            self.carry(plan);
            self.borrow(plan);
        }
        is_small
    }

    /// The longest arc, mm, that it may be moved by.
    pub(crate) fn shift_max(&self, plan: &Plan) -> f32 {
        0.5 * SHIFT_MAX * self.slope(plan)
    }

    /// Arc of an interval at the slope here, mm.
    fn slope(&self, plan: &Plan) -> f32 {
        let [slope, _, _] = plan.interval(self.interval).walk_rates(self.x);
        slope.at_least(1e-9)
    }

    /// Into the interval before where the fraction is below 0; at the start of the path to that.
    fn borrow(&mut self, plan: &Plan) {
        if self.x < 0.0 && self.interval > 0 {
            self.interval -= 1;
            self.start_q10 -= plan.interval_q10(self.interval);
            self.x += 1.0;
        }
        self.x = self.x.at_least(0.0);
    }

    /// Into the next interval where the fraction is above 1.
    pub(super) fn carry(&mut self, plan: &Plan) {
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
