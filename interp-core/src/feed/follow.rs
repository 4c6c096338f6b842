//! One period along a plan. Where the plan is within a fraction of a percent of the programmed feed for long enough, the tool moves at exactly
//! that feed; the change to it and back is smooth.

use super::limits::FeedChange;
use super::pace::Trajectory;
use super::plan::{Cursor, Lead, Plan, to_mm};
use crate::math::number::Bounded;

/// Periods at the programmed feed by which the lead may be behind.
const BEHIND_MAX: f32 = 2.0;

impl Lead {
    /// [`Self::look`] at a plan that is being checked, a period after the last look.
    pub(crate) fn look_draft(&mut self, plan: &Plan, draft: &[f32], cursor: &Cursor) {
        self.count(plan, cursor, cursor.draft_speed_sqr(plan, draft), 1.0);
    }

    /// Counts the time for which the plan is near the feed. `periods`: since the last look.
    fn look(&mut self, plan: &Plan, cursor: &Cursor, periods: f32) {
        self.count(plan, cursor, cursor.speed_sqr(plan), periods);
    }

    /// By the square of the plan's speed, (mm/s)^2.
    fn count(&mut self, plan: &Plan, cursor: &Cursor, speed_sqr: f32, periods: f32) {
        let FeedChange { near, .. } = plan.change;
        let feed = plan.limits.feed;
        let (least, most) = (feed - near, feed + near);
        let is_near = speed_sqr > least * least
            && speed_sqr < most * most
            && plan.over <= 1.0
            && !plan.is_over(cursor)
            && plan.allows_feed(cursor.interval);
        self.near = if is_near {
            (self.near + periods).at_most(f32::from(plan.change.lead()))
        } else {
            0.0
        };
    }
}

/// The tool's place on a plan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Follower {
    pub(crate) cursor: Cursor,
    lead: Lead,
    /// How far the speed has changed from the plan's to the feed, periods of [`FeedChange`], and whether it changes to it.
    change: u16,
    rises: bool,
    /// Arc by which the tool has moved more than the lead, mm.
    behind: f32,
    arc_q10: i64,
}

impl Follower {
    pub(crate) const START: Self = Self {
        cursor: Cursor::START,
        lead: Lead::NONE,
        change: 0,
        rises: false,
        behind: 0.0,
        arc_q10: 0,
    };

    /// At the start of a plan.
    pub(crate) const fn begin(&mut self, plan: &Plan) {
        *self = Self::START;
        self.lead = plan.lead;
    }

    /// Arc since the start, units of 2^-10 nm.
    pub(crate) const fn arc_q10(&self) -> i64 {
        self.arc_q10
    }

    pub(crate) fn is_over(&self, plan: &Plan) -> bool {
        plan.is_over(&self.cursor)
    }

    /// One period at this pace, 0 to 1: the arc that the tool moves by, mm.
    #[inline(never)]
    pub(crate) fn tick(&mut self, plan: &Plan, pace: f32) -> f32 {
        let seconds = pace * plan.limits.period;
        plan.advance(&mut self.cursor, seconds);
        let planned_q10 = self.cursor.arc_q10(plan);
        let planned = to_mm(planned_q10 - self.arc_q10);
        self.look_ahead(plan, pace);
        let exact = seconds * plan.limits.feed;
        if self.change == 0 && planned <= exact * plan.over {
            self.arc_q10 = planned_q10;
            return planned;
        }
        let whole = plan.change.periods;
        let by = f32::from(self.change) / f32::from(whole);
        // Smooth: 10 t^3 - 15 t^4 + 6 t^5.
        let share = by * by * by * (10.0 - by * (15.0 - 6.0 * by));
        let moved = if self.change == whole {
            exact
        } else {
            (planned + share * (exact - planned)).at_most(exact)
        };
        self.arc_q10 += i64::from(super::plan::step_q10(moved));
        self.shift(moved - planned, plan);
        moved
    }

    fn look_ahead(&mut self, plan: &Plan, pace: f32) {
        let Lead { cursor, .. } = &mut self.lead;
        plan.advance(cursor, pace * plan.limits.period);
        let at = *cursor;
        self.lead.look(plan, &at, pace);
        let whole = plan.change.periods;
        self.change = match self.change {
            0 => {
                self.rises = self.lead.near >= f32::from(plan.change.lead());
                u16::from(self.rises)
            }
            change if change >= whole => {
                self.rises = false;
                whole.saturating_sub(u16::from(self.lead.near == 0.0))
            }
            change if self.rises => change + 1,
            change => change - 1,
        };
    }

    /// Moves tool and lead by this arc, mm, so that the lead stays; the lead once it is worth its time. Returns whether they moved.
    fn shift(&mut self, mm: f32, plan: &Plan) -> bool {
        if !self.cursor.shift(mm, plan) {
            return false;
        }
        self.behind += mm;
        if self.behind.abs() > BEHIND_MAX * plan.limits.feed * plan.limits.period {
            if !plan.is_over(&self.lead.cursor) {
                self.lead.cursor.shift(self.behind, plan);
            }
            self.behind = 0.0;
        }
        true
    }

    /// The tool is known to be ahead by this arc, units of 2^-10 nm: the plan goes on from there, or from the part of it that is small against an interval. Returns
    /// that part.
    pub(crate) fn correct(&mut self, plan: &Plan, apart_q10: i64) -> i64 {
        let most_q10 = i64::from(super::plan::step_q10(self.cursor.shift_max(plan)));
        let part_q10 = apart_q10.min(most_q10).max(-most_q10);
        if !self.shift(to_mm(part_q10), plan) {
            return 0;
        }
        self.arc_q10 += part_q10;
        part_q10
    }
}
