//! The planning: pieces of work by their cycles, and what comes next.

use super::{Phase, Planning, Sequencer, both};
use crate::fault::{Fault, FaultKind};
use crate::feed::MM_PER_Q10;
use crate::feed::limits::MotionLimits;
use crate::feed::pace::Course as _;
use crate::feed::planner::PORTION_CYCLES;
use crate::feed::turn::Turn;
use crate::job::program::{Job, Link, Program};
use crate::job::{AxisLimits, Pattern};
use crate::math::arith::count_to_f32;
use crate::math::number::{Bounded, to_f32};
use crate::pass::front::NextRoute;
use crate::pass::run::Run;
use crate::pass::scan::cycles::{NEXT, PATCH};
use crate::sequence::link::BoundaryEnd;
use crate::sequence::lookahead::{PassPlan, has_turns};
use crate::sequence::turning::road;

/// Periods that a pass takes longer than the planning of the next one.
const SPARE_PERIODS: u32 = 15;

/// Cycles of one place of a search for a change of the pace, along a pass and along a link, and of its begin along a pass; of a portion of a
/// step-over's planning.
const PACE_CYCLES: u32 = 2_150;
const PACE_BEGIN_CYCLES: u32 = 9_500;
const LINK_PACE_CYCLES: u32 = 1_300;
const STEP_OVER_CYCLES: u32 = 6_000;

/// Cycles of the same of a hop, and of its planning.
const HOP_PACE_CYCLES: u32 = 3_300;
const HOP_CYCLES: u32 = 24_000;

/// Cycles of the begin of a look-ahead, and of the planning of a leg.
const BEGIN_CYCLES: u32 = 1_500;
const LEG_CYCLES: u32 = 5_000;

/// Cycles of replacing the rest of a plan, or of the wait until that is possible: once a period.
const TAKE_OVER_CYCLES: u32 = 20_000;

/// Greatest number of pieces of work in a period: the shortest is the step to the next station.
const PIECES_MAX: u32 = 36;

/// Feed above that of a plan for which it is planned anew, as a ratio.
const REPLANNED: f32 = 1.001;

/// Periods that planning takes: a node, the rest of a pass apart from its nodes, a whole pass.
const PERIODS_A_NODE: f32 = 3.4;
const PERIODS_A_REST: f32 = 40.0;
const PERIODS_A_PASS: f32 = 100.0;

/// Share of the time of a rest by which a turn may slow its plan down.
const REST_SHARE: f32 = 0.3;

/// Steps in which the tool's place after the planning is estimated.
const AHEAD_STEPS: u16 = 64;

impl Sequencer {
    /// Whether [`Self::plan`] has anything to do.
    pub(crate) fn has_to_plan(&self, run: &Run) -> bool {
        let is_busy = match self.phase {
            Phase::Pass | Phase::Turn => self.pace.has_work(),
            Phase::StepOver => self.step_over.progress.has_work(),
            Phase::Leg(_) => self.straight.progress.has_work(),
            Phase::Hop => self.hop.has_work(),
            Phase::AwaitGoal(leg) => self.has_to_plan_leg(leg),
            Phase::Await | Phase::Lifted | Phase::Done => false,
        };
        let wants_more = self.phase == Phase::Pass && self.feed_factor > 1.0;
        is_busy
            || wants_more
            || self.pass_ahead().is_some()
            || (self.pending.is_none()
                && (self.planning != Planning::Complete
                    || self.has_to_plan_step_over()
                    || self.has_hop
                    || self.may_choose()
                    || run.front_cycles() > 0))
    }

    pub(super) fn has_to_plan_step_over(&self) -> bool {
        self.has_step_over && !self.step_over.is_planned()
    }

    /// Whether the link to the next pass can be chosen, and has to be.
    fn may_choose(&self) -> bool {
        self.has_to_choose
            && matches!(self.phase, Phase::Pass | Phase::Await)
            && matches!(
                self.planning,
                Planning::Feed | Planning::Rest | Planning::Complete
            )
    }

    /// The planning of one period: work of at most [`PORTION_CYCLES`] cycles.
    #[inline(never)]
    pub(crate) fn plan(&mut self, program: &Program, store: &mut [i32], run: &mut Run) {
        let Some(axes) = &program.header().axes else {
            return;
        };
        let mut left = PORTION_CYCLES;
        match self.planning {
            Planning::Requested(..) | Planning::Stations | Planning::Feed => {
                self.spent = self.spent.saturating_add(1);
            }
            Planning::Complete => {
                if let Ok(job) = program.job(store)
                    && self.wants_more(&job)
                {
                    self.plan_for_override(&job, axes);
                    if run.front_cycles() == 0 {
                        return;
                    }
                }
            }
            Planning::Awaited(_) | Planning::Rest => {}
        }
        let mut makes_front = false;
        for _ in 0..PIECES_MAX {
            let (is_front, cycles) = self.next_cycles(run);
            if cycles == 0 || cycles > left {
                break;
            }
            if is_front {
                makes_front = true;
                if let Ok((job, rest)) = program.job_and_rest(store) {
                    left = left.saturating_sub(run.make_front(&job, rest));
                }
                continue;
            }
            left -= cycles;
            if let Ok(job) = program.job(store) {
                self.work(&job, axes, run);
            }
        }
        self.front_spent = self.front_spent.saturating_add(u32::from(makes_front));
    }

    /// Whether the override asks for more than the plans give.
    fn wants_more(&self, job: &Job<'_>) -> bool {
        if has_turns(job) {
            return false;
        }
        let [one, other] = &self.plans;
        let feed = job.header.feed_mm_s * self.feed_factor;
        let of = |pass: &PassPlan| feed > REPLANNED * pass.plan.limits.feed;
        self.phase == Phase::Pass && self.feed_factor > 1.0 && (of(one) || of(other)) && !self.pace.has_work()
    }

    /// Cycles of the next piece of planning, 0 where there is none; and whether it is a portion of the next front.
    fn next_cycles(&self, run: &Run) -> (bool, u32) {
        let cycles = self.next_own_cycles(run);
        let waits = matches!(self.planning, Planning::Awaited(_) | Planning::Complete);
        let front = run.front_cycles();
        match cycles {
            Some(cycles) => (false, cycles),
            None if matches!(self.planning, Planning::Awaited(_)) && run.has_part() => (false, BEGIN_CYCLES),
            None if waits && front > 0 => (true, front),
            None if matches!(self.planning, Planning::Awaited(_)) => (false, BEGIN_CYCLES),
            None => (false, 0),
        }
    }

    /// Cycles of the next piece apart from the next front; none where there is none, or the next front comes first.
    fn next_own_cycles(&self, run: &Run) -> Option<u32> {
        let [one, other] = &self.plans;
        let (now, next) = if self.second {
            (&other.plan, &one.plan)
        } else {
            (&one.plan, &other.plan)
        };
        match self.phase {
            Phase::Pass | Phase::Turn if self.pace.has_work() && self.pace.begins_search() => {
                return Some(PACE_BEGIN_CYCLES);
            }
            Phase::Pass | Phase::Turn if self.pace.has_work() => return Some(PACE_CYCLES),
            Phase::StepOver if self.step_over.progress.has_work() => return Some(LINK_PACE_CYCLES),
            Phase::Leg(_) if self.straight.progress.has_work() => return Some(LINK_PACE_CYCLES),
            Phase::Hop if self.hop.has_work() => return Some(HOP_PACE_CYCLES),
            Phase::AwaitGoal(leg) if self.has_to_plan_leg(leg) => return Some(LEG_CYCLES),
            _ => {}
        }
        if self.pass_ahead().is_some() {
            return Some(PATCH);
        }
        if self.pending.is_some() {
            return Some(0);
        }
        if self.may_choose() {
            return Some(NEXT);
        }
        if self.has_to_plan_step_over() {
            return Some(STEP_OVER_CYCLES);
        }
        Some(match self.planning {
            Planning::Awaited(_) => return None,
            Planning::Requested(..) => BEGIN_CYCLES,
            Planning::Stations => self.lookahead.cycles(run.estimator_ref()),
            Planning::Feed => self.planner.cycles(next),
            Planning::Rest if self.planner.is_done() => TAKE_OVER_CYCLES,
            Planning::Rest => self.planner.cycles(now),
            Planning::Complete if self.has_hop => HOP_CYCLES,
            Planning::Complete => return None,
        })
    }

    #[inline(never)]
    pub(super) fn work(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &mut Run) {
        if let Phase::AwaitGoal(leg) = self.phase
            && self.has_to_plan_leg(leg)
        {
            return self.plan_leg(leg, job, axes);
        }
        let is_known = self.knows_next();
        let (now, next) = both(&mut self.plans, self.second);
        match self.phase {
            Phase::Pass | Phase::Turn if self.pace.has_work() => {
                let known = is_known.then_some(&next.plan);
                let stops = self.pace.wanted() == 0.0;
                let road = road(&now.plan, known, next.plan.pace_max, stops);
                return self.pace.work(&road, &self.follower.cursor, &mut self.profiles);
            }
            Phase::StepOver if self.step_over.progress.has_work() => {
                return self.step_over.progress.work(&mut self.profiles);
            }
            Phase::Leg(_) if self.straight.progress.has_work() => {
                return self.straight.progress.work(&mut self.profiles);
            }
            Phase::Hop if self.hop.has_work() => return self.hop.work(&mut self.profiles),
            _ => {}
        }
        if let Some(route) = self.pass_ahead().map(|pass| pass.route) {
            self.has_first_patch = false;
            return run.prepare_pass(job, &route);
        }
        if self.may_choose() {
            return self.choose_link(job);
        }
        let (now, next) = both(&mut self.plans, self.second);
        if self.has_step_over && self.step_over.is_requested() {
            let start = if job.header.spacing.is_constant() {
                Some(next.start())
            } else {
                now.next.map(|route| BoundaryEnd {
                    path: route.ends[0],
                    side: route.side,
                })
            };
            if let Some(start) = start {
                let feed = job.header.feed_mm_s * self.feed_factor.at_least(1.0);
                let way = (now.end_boundary(job), now.route.reversed);
                self.step_over.begin(job, axes, way, [now.end(), start], feed);
            }
            return;
        }
        if self.has_step_over && !self.step_over.is_planned() {
            self.pending = self.step_over.work(job, axes).err();
            return;
        }
        match self.planning {
            Planning::Awaited(pass) => match run.next_pass(job) {
                Ok(NextRoute::Pass(route)) => {
                    next.route = route;
                    self.planning = Planning::Requested(pass);
                }
                // Nothing that could make it is left: a fault, not a wait without end.
                Ok(NextRoute::NotYet) if run.front_cycles() == 0 => {
                    self.pending = Some(Fault::new(FaultKind::IntervalTooSmall, 0.0));
                }
                Ok(NextRoute::NotYet) => {}
                Ok(NextRoute::None) => self.planning = Planning::Complete,
                Err(fault) => self.pending = Some(fault),
            },
            Planning::Requested(pass) => {
                if let (Some(estimator), _) = run.estimator_and_lines() {
                    estimator.enter_row(next.route.side.span);
                }
                if pass == self.first_pass {
                    // It begins at rest, wherever the pass before it would have led.
                    now.tail = Turn::NONE;
                }
                self.lookahead.begin(pass, next.route, &now.tail, next);
                next.is_last = run.is_last_pass();
                self.planning = Planning::Stations;
            }
            Planning::Stations => {
                let (estimator, lines) = run.estimator_and_lines();
                self.pending = self.lookahead.work(job, axes, estimator, lines, next).err();
                if self.lookahead.is_done() {
                    next.is_last |= next.next.is_none() && !job.header.spacing.is_constant();
                    if next.pass < self.first_pass {
                        return self.skip(run);
                    }
                    self.planning = if next.point {
                        Planning::Complete
                    } else {
                        let feed = job.header.feed_mm_s * self.feed_factor.at_least(1.0);
                        next.set_limits(job, MotionLimits::new(axes, feed, job.header.period_s));
                        self.planner.begin(&mut next.plan);
                        Planning::Feed
                    };
                }
            }
            Planning::Feed => {
                // The pass after it takes as long to plan; off the surface it can be waited for.
                let is_last = next.is_last && !self.planner.is_walking();
                let is_on_surface = if job.header.spacing.is_constant() {
                    job.header.pattern == Pattern::Zigzag
                } else {
                    next.steps_over || job.link_to(next.pass.wrapping_add(1), axes) == Link::Straight
                };
                let least = if !is_last && is_on_surface {
                    let front = if run.needs_front() {
                        front_periods(self.front_spent, self.front_last)
                    } else {
                        0
                    };
                    self.spent.saturating_add(front).saturating_add(SPARE_PERIODS)
                } else {
                    0
                };
                self.planner.work(&mut next.plan, least);
                if self.planner.is_done() {
                    self.planning = Planning::Complete;
                    if next.turns() && is_too_slow(next) {
                        self.lookahead.avoid_turns();
                    }
                }
            }
            Planning::Rest => {
                if !self.planner.is_done() {
                    return self.planner.work(&mut now.plan, 0);
                }
                // A change of the pace was checked on the plan as it is.
                let is_ahead = self.planner.rest().is_some_and(|first| {
                    self.phase == Phase::Pass && self.follower.cursor.interval + 4 < first
                });
                if is_ahead && !(self.pace.is_constant() && self.follower.is_as_planned()) {
                    return;
                }
                if is_ahead {
                    let limits = self.planner.take_over(&mut now.plan);
                    now.set_limits(job, limits);
                    self.follower.restart_lead(&now.plan);
                }
                self.follower.keep_to_plan(false);
                self.planning = Planning::Complete;
            }
            Planning::Complete if self.has_hop => {
                self.has_hop = false;
                if let Link::Across(height_nm) = job.link_to(next.pass, axes) {
                    let ends = [now.ends[1], next.ends[0]];
                    self.hop.plan(ends, height_nm, job.header.feed_mm_s, axes);
                }
            }
            Planning::Complete => {}
        }
    }

    /// Goes on to the pass after one that is skipped, as if the tool had been on it.
    fn skip(&mut self, run: &mut Run) {
        let (_, next) = both(&mut self.plans, self.second);
        if self.pending.is_some() {
            return;
        }
        if next.is_last {
            self.pending = Some(Fault::new(FaultKind::WrongState, count_to_f32(next.pass)));
            return;
        }
        self.swap(run);
    }

    /// Plans what is ahead anew where the override asks for more than the plans give.
    fn plan_for_override(&mut self, job: &Job<'_>, axes: &AxisLimits) {
        let feed = job.header.feed_mm_s * self.feed_factor;
        let (now, next) = both(&mut self.plans, self.second);
        if self.phase != Phase::Pass || now.point {
            return;
        }
        let left = to_f32(now.plan.length_q10() - self.follower.cursor.arc_q10(&now.plan)) * MM_PER_Q10;
        let left_periods = left / (feed * job.header.period_s);
        if feed > REPLANNED * now.plan.limits.feed && feed > REPLANNED * self.replanned {
            self.replanned = feed;
            let mut ahead = self.follower.cursor;
            let nodes = f32::from(now.plan.intervals - self.follower.cursor.interval);
            for _ in 0..AHEAD_STEPS {
                let step = (nodes * PERIODS_A_NODE + PERIODS_A_REST) * (1.0 / f32::from(AHEAD_STEPS));
                now.plan.advance(&mut ahead, step * job.header.period_s);
            }
            let first = ahead.interval + 5;
            if first + 8 < now.plan.intervals {
                self.planner.begin_rest(&mut now.plan, first, feed);
                self.follower.keep_to_plan(true);
                self.planning = Planning::Rest;
            }
        } else if !now.is_last
            && !next.point
            && feed > REPLANNED * next.plan.limits.feed
            && left_periods > 1.5 * f32::from(next.plan.intervals) * PERIODS_A_NODE + PERIODS_A_PASS
        {
            next.set_limits(job, MotionLimits::new(axes, feed, job.header.period_s));
            self.planner.begin(&mut next.plan);
            self.planning = Planning::Feed;
        }
    }

    /// Has the pass after the one that is followed next planned, if there is one.
    pub(super) const fn request_planning(&mut self, planning: Planning) {
        self.planning = planning;
        self.has_step_over = false;
        self.has_to_choose = false;
        self.spent = 0;
    }

    /// Chooses the link to the next pass of a job of constant scallop height: along the boundary where both passes end on the same one, near each other.
    fn choose_link(&mut self, job: &Job<'_>) {
        self.has_to_choose = false;
        let (now, next) = both(&mut self.plans, self.second);
        now.steps_over = job.header.pattern == Pattern::Zigzag && now.is_beside(next, job);
        if now.steps_over {
            self.step_over.request();
            self.has_step_over = true;
        } else {
            self.has_hop = true;
        }
    }
}

/// Whether a turn costs more than it saves: the time by which its plan is slowed down, against that of a rest.
fn is_too_slow(pass: &PassPlan) -> bool {
    let MotionLimits {
        feed, axes, period, ..
    } = &pass.plan.limits;
    let jerk = axes.iter().fold(f32::MAX, |least, axis| least.at_most(axis.jerk));
    let acceleration = axes
        .iter()
        .fold(f32::MAX, |least, axis| least.at_most(axis.acceleration));
    let rest_s = feed / acceleration + acceleration / jerk;
    let lasts_s = to_f32(i64::from(pass.plan.periods)) * period;
    lasts_s * (1.0 / pass.plan.pace_max - 1.0) > REST_SHARE * rest_s
}

/// Periods that making the front after the next takes, by those of the next front and of the one before, with a quarter more.
const fn front_periods(so_far: u32, last: u32) -> u32 {
    let most = if so_far > last { so_far } else { last };
    most.saturating_add(most / 4)
}
