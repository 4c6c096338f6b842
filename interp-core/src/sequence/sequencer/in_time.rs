//! Whether the plan of the next pass is in time: what is left of this one, and the pace with which it is.

use super::planning::{PERIODS_A_SEARCH, WAIT_PACE_MIN};
use super::{Phase, Planning, Sequencer};
use crate::feed::MM_PER_Q10;
use crate::job::AxisLimits;
use crate::job::links::Link;
use crate::job::program::Job;
use crate::math::arith::count_to_f32;
use crate::math::number::{Bounded, to_f32};
use crate::pass::run::Run;
use crate::sequence::lookahead::has_turns;

/// Periods by which a plan is to be complete before it is needed, where a search for a pace would delay it.
const PERIODS_URGENT: f32 = 12.0;

/// Feed above that of a plan for which it is planned anew, as a ratio.
const REPLANNED: f32 = 1.001;

/// Periods that planning takes: a node, a whole pass apart from its nodes.
const PERIODS_A_NODE: f32 = 3.3;
const PERIODS_A_PASS: f32 = 98.0;
/// How much longer the planning of a pass may take than that of the last one, as a ratio, and apart from that, periods.
const LONGER: f32 = 1.3;
const LONGER_PERIODS: f32 = 30.0;
/// Periods that the planning of a step-over takes at most.
const PERIODS_A_STEP_OVER: f32 = 40.0;

impl Sequencer {
    /// Whether the plan of the next pass is to be replaced, because the override asks for more than it gives.
    pub(super) fn wants_more(&self, job: &Job<'_>) -> bool {
        let (now, next) = self.plans_ref();
        let feed = job.header.feed_mm_s * self.feed_factor;
        self.phase == Phase::Pass
            && !has_turns(job)
            && !(now.is_last || now.point || next.point)
            && feed > REPLANNED * next.plan.limits.feed
            && !self.pace.has_work()
            && self.periods_left(feed, job.header.period_s)
                > 1.5 * f32::from(next.plan.intervals) * PERIODS_A_NODE + PERIODS_A_PASS
    }

    /// Periods until the next plan is needed at the present plan's own pace: to the end of the pass, where the tool would wait for it on the surface.
    #[inline(always)]
    pub(super) fn periods_to_link(&self, job: &Job<'_>, axes: &AxisLimits) -> Option<f32> {
        let (now, next) = self.plans_ref();
        let is_joined = now.steps_over && !job.header.spacing.is_constant();
        let is_low = || job.header.links > 0 && job.link_to(next.pass, axes).is_low();
        let is_reached_on_surface = next.pass > self.first.pass && (is_joined || is_low());
        is_reached_on_surface.then(|| match self.phase {
            Phase::Pass => count_to_f32(now.plan.periods) - self.passed,
            Phase::Await => 0.0,
            _ => count_to_f32(now.plan.periods),
        })
    }

    /// Whether the next plan comes before a search for a pace: the tool would stand at the end of the pass otherwise. A stop comes before that, and so does a slower pace
    /// with which the plan is in time again.
    #[inline(never)]
    pub(super) fn is_plan_urgent(&self, job: &Job<'_>, axes: &AxisLimits) -> bool {
        let Some(left) = self.periods_to_link(job, axes).filter(|_| self.pending.is_none()) else {
            return false;
        };
        let (_, next) = self.plans_ref();
        if self.planner.is_walking() || self.pace.wanted() == 0.0 {
            return false;
        }
        let fastest = self.pace.now().at_least(self.pace.goal());
        let left = left / fastest.at_least(WAIT_PACE_MIN);
        let needed = self.planner.least_left(&next.plan) + self.planner.step_left(&next.plan, self.spent);
        let is_late = self.wait_pace < f32::MAX;
        let gains = is_late && self.pace.wanted() < self.pace.now() && left > PERIODS_A_SEARCH;
        needed + PERIODS_URGENT > left && !gains
    }

    /// Periods to the end of the pass at this feed, mm/s: at least.
    fn periods_left(&self, feed: f32, period: f32) -> f32 {
        let (now, _) = self.plans_ref();
        let left = now.plan.length_q10() - self.follower.cursor.arc_q10(&now.plan);
        to_f32(left) * MM_PER_Q10 / (feed * period)
    }

    /// The greatest pace at which the rest of the pass takes as long as what is ahead takes to be planned, where that cannot be waited for above the surface.
    pub(super) fn pace_in_time(&self, job: &Job<'_>, axes: &AxisLimits, run: &Run) -> f32 {
        let (now, _) = self.plans_ref();
        if now.point || self.pending.is_some() {
            return 1.0;
        }
        if job.header.spacing.is_constant() {
            let is_ready = self.planning == Planning::Complete && run.front_cycles() == 0;
            return if is_ready { f32::MAX } else { 1.0 };
        }
        let is_on_surface =
            now.steps_over || now.turns() || job.link_to(now.pass.wrapping_add(1), axes) == Link::Straight;
        if now.is_last || !is_on_surface {
            return f32::MAX;
        }
        let needed = match self.planning {
            Planning::Complete if self.has_to_plan_step_over() => PERIODS_A_STEP_OVER,
            Planning::Complete => return f32::MAX,
            _ => LONGER * count_to_f32(self.spent_last) + LONGER_PERIODS - count_to_f32(self.spent),
        };
        // The last stop before a turn begins before its end.
        let gate_s = if now.turns() {
            now.plan.gate.before_end
        } else {
            0.0
        };
        let period = job.header.period_s;
        self.periods_left(now.plan.limits.feed, period) / (needed.at_least(1.0) + gate_s / period)
    }
}
