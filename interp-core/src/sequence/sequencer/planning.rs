//! The planning: pieces of work by their cycles, and what comes next.

use super::{Phase, Planning, Sequencer, both};
use crate::fault::{Fault, FaultKind};
use crate::feed::deadlines::Deadlines;
use crate::feed::limits::MotionLimits;
use crate::feed::planner::PORTION_CYCLES;
use crate::feed::turn::Turn;
use crate::job::links::Link;
use crate::job::program::{Job, Program};
use crate::job::{AxisLimits, Pattern};
use crate::math::arith::count_to_f32;
use crate::math::number::{Bounded, to_f32};
use crate::pass::front::NextRoute;
use crate::pass::run::Run;
use crate::pass::scan::cycles::{NEXT, PATCH};
use crate::sample::SpanParameter;
use crate::sequence::legs::Goal;
use crate::sequence::link::BoundaryEnd;
use crate::sequence::lookahead::PassPlan;
use crate::sequence::turning::road;

/// Periods that a pass takes longer than the planning of the next one.
const SPARE_PERIODS: u32 = 15;
const SPARE_BEFORE_TURN: u32 = 30;

/// Cycles of one place of a search for a change of the pace, along a pass and along a link, and of its begin along a pass; of a portion of a
/// step-over's planning.
const PACE_CYCLES: u32 = 2_950;
const PACE_BEGIN_CYCLES: u32 = 14_000;
const LINK_PACE_CYCLES: u32 = 2_300;
const STEP_OVER_CYCLES: u32 = 6_000;

/// Cycles of the same of a hop, and of its planning.
const HOP_PACE_CYCLES: u32 = 3_700;
const HOP_CYCLES: u32 = 24_000;

/// Cycles of the first sample of a pass that is prepared.
const FIRST_SAMPLE: u32 = 2_000;

/// Cycles of the begin of a look-ahead, and of the planning of a leg.
const BEGIN_CYCLES: u32 = 1_500;
const LEG_CYCLES: u32 = 5_000;

/// Greatest number of pieces of work in a period: the shortest is the step to the next station.
const PIECES_MAX: u32 = 36;

/// Share of the pace at which the tool would reach the pass's end with the check of the next plan, which the change of the pace and its search leave; and
/// the least pace.
const WAIT_SHARE: f32 = 0.6;
pub(super) const WAIT_PACE_MIN: f32 = 0.02;
/// Periods that the search for that change takes: with fewer left it would only delay the plan; and those by which that may be late without it.
pub(super) const PERIODS_A_SEARCH: f32 = 30.0;
const PERIODS_LATE: f32 = 8.0;

/// Share of the time of a rest by which a turn may slow its plan down.
const REST_SHARE: f32 = 0.3;

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
        let wants_more = matches!(self.phase, Phase::Pass | Phase::Turn) && self.feed_factor > 1.0;
        is_busy
            || self.has_step_to_prepare()
            || run.has_to_prepare()
            || wants_more
            || self.pass_ahead().is_some()
            || (self.pending.is_none()
                && (!matches!(self.planning, Planning::Complete | Planning::AwaitsRows(_))
                    || self.has_to_plan_step_over()
                    || self.has_hop
                    || self.may_choose()
                    || run.front_cycles() > 0))
    }

    pub(super) fn has_to_plan_step_over(&self) -> bool {
        self.has_step_over && !self.step_over.is_planned()
    }

    /// Whether a change of the pace is sought before anything else is planned.
    #[inline(always)]
    fn seeks_pace(&self) -> bool {
        self.pace.has_work() && !self.plan_comes_first && !self.waits_for_plan()
    }

    /// Whether the tool stands until the next pass is planned.
    #[inline(never)]
    fn waits_for_plan(&self) -> bool {
        let is_planning = matches!(
            self.planning,
            Planning::Requested(..) | Planning::Stations | Planning::Feed
        );
        is_planning && self.pace.is_stuck() && self.pending.is_none()
    }

    /// Whether the link to the next pass can be chosen, and has to be.
    fn may_choose(&self) -> bool {
        self.has_to_choose
            && (matches!(self.phase, Phase::Pass | Phase::Await) || self.goal == Goal::Above)
            && matches!(self.planning, Planning::Feed | Planning::Complete)
    }

    /// The planning of one period: what the next tick needs, and work of at most [`PORTION_CYCLES`] cycles with it.
    #[inline(never)]
    pub(crate) fn plan(&mut self, program: &Program, store: &mut [i32], run: &mut Run) {
        let Some(axes) = &program.header().axes else {
            return;
        };
        let spent = program.job(store).map_or(0, |job| run.prepare_piece(&job));
        self.plan_ahead((program, axes), store, run, spent);
        // Last, because a change of the pace that was found may begin with the next tick.
        if let Ok(job) = program.job(store) {
            self.prepare_step(&job, run);
        }
    }

    /// Work of a period in which some cycles are spent already.
    #[inline(always)]
    fn plan_ahead(
        &mut self,
        (program, axes): (&Program, &AxisLimits),
        store: &mut [i32],
        run: &mut Run,
        spent: u32,
    ) {
        let mut left = PORTION_CYCLES - spent.min(PORTION_CYCLES);
        if matches!(self.phase, Phase::Pass | Phase::Turn) && self.feed_factor > 1.0 {
            let most = program
                .job(store)
                .map_or(1.0, |job| self.pace_in_time(&job, axes, run));
            self.pace.allow_above(most);
        }
        self.plan_comes_first = matches!(self.phase, Phase::Pass)
            && self.planning == Planning::Feed
            && self.pace.has_work()
            && program
                .job(store)
                .is_ok_and(|job| self.is_plan_urgent(&job, axes));
        match self.planning {
            Planning::Requested(..) | Planning::Stations | Planning::Feed => {
                // Periods in which a change of the pace is sought are none of the planning's.
                let is_searching = matches!(self.phase, Phase::Pass | Phase::Turn) && self.seeks_pace();
                self.spent = self.spent.saturating_add(u32::from(!is_searching));
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
            Planning::Awaited(_) | Planning::AwaitsRows(_) => {}
        }
        let mut makes_front = false;
        // Nothing else becomes due between two pieces of the same stage of a pass's planning.
        let mut goes_on = false;
        for piece in 0..PIECES_MAX {
            let (is_front, cycles) = if goes_on {
                (false, self.cycles_of_pass(run))
            } else {
                self.next_cycles(run)
            };
            if cycles == 0 || (cycles > left && piece > 0) {
                break;
            }
            if is_front {
                makes_front = true;
                if let Ok((job, rest)) = program.job_and_rest(store) {
                    left = left.saturating_sub(run.make_front(&job, rest));
                }
                continue;
            }
            left = left.saturating_sub(cycles);
            if let Ok(job) = program.job(store) {
                let stage = self.planning;
                if goes_on {
                    self.work_on_pass(&job, axes, run);
                } else {
                    goes_on = self.work(&job, axes, run);
                }
                goes_on &= stage == self.planning && self.pending.is_none();
            }
        }
        self.front_spent = self.front_spent.saturating_add(u32::from(makes_front));
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
        match self.phase {
            Phase::Pass | Phase::Turn if self.seeks_pace() => {
                return Some(if self.pace.begins_search() {
                    PACE_BEGIN_CYCLES
                } else {
                    PACE_CYCLES
                });
            }
            Phase::StepOver if self.step_over.progress.has_work() => return Some(LINK_PACE_CYCLES),
            Phase::Leg(_) if self.straight.progress.has_work() => return Some(LINK_PACE_CYCLES),
            Phase::Hop if self.hop.has_work() => return Some(HOP_PACE_CYCLES),
            Phase::AwaitGoal(leg) if self.has_to_plan_leg(leg) => return Some(LEG_CYCLES),
            _ => {}
        }
        if self.pass_ahead().is_some() {
            return Some(PATCH + FIRST_SAMPLE);
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
        match self.planning {
            Planning::Awaited(_) => None,
            Planning::Complete if !self.has_hop => None,
            _ => Some(self.cycles_of_pass(run)),
        }
    }

    /// Cycles of the next piece of the planning of the next pass.
    fn cycles_of_pass(&self, run: &Run) -> u32 {
        let (_, next) = self.plans_ref();
        match self.planning {
            Planning::Requested(..) => BEGIN_CYCLES,
            Planning::AwaitsRows(_) | Planning::Awaited(_) => 0,
            Planning::Stations => self.lookahead.cycles(run.estimator_ref()),
            Planning::Feed => self.planner.cycles(&next.plan),
            Planning::Complete => HOP_CYCLES,
        }
    }

    /// Executes the next piece apart from the next front. Returns whether it was one of the stations or of the feed of the next pass.
    #[inline(always)]
    fn work(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &mut Run) -> bool {
        if self.work_beside(job, axes, run) {
            return false;
        }
        self.work_on_pass(job, axes, run);
        matches!(self.planning, Planning::Stations | Planning::Feed)
    }

    /// Executes a piece that comes before the planning of the next pass, if there is one.
    #[inline(never)]
    fn work_beside(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &mut Run) -> bool {
        if let Phase::AwaitGoal(leg) = self.phase
            && self.has_to_plan_leg(leg)
        {
            self.plan_leg(leg, job, axes);
            return true;
        }
        let is_known = self.knows_next();
        let seeks_pace = matches!(self.phase, Phase::Pass | Phase::Turn) && self.seeks_pace();
        let (now, next) = both(&mut self.plans, self.second);
        match self.phase {
            Phase::Pass | Phase::Turn if seeks_pace => {
                let known = is_known.then_some(&next.plan);
                let stops = self.pace.wanted() == 0.0;
                let road = road(&now.plan, known, next.plan.pace_max, stops);
                self.pace.work(&road, &self.follower.cursor, &mut self.profiles);
                return true;
            }
            Phase::StepOver if self.step_over.progress.has_work() => {
                self.step_over.progress.work(&mut self.profiles);
                return true;
            }
            Phase::Leg(_) if self.straight.progress.has_work() => {
                self.straight.progress.work(&mut self.profiles);
                return true;
            }
            Phase::Hop if self.hop.has_work() => {
                self.hop.work(&mut self.profiles);
                return true;
            }
            _ => {}
        }
        if let Some(route) = self.pass_ahead().map(|pass| pass.route) {
            self.has_first_patch = false;
            run.prepare_pass(job, &route);
            return true;
        }
        if self.may_choose() {
            self.choose_link(job);
            return true;
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
                let way = (now.end_boundary(), now.route.reversed);
                self.step_over.begin(job, axes, way, [now.end(), start], feed);
            }
            return true;
        }
        if self.has_step_over && !self.step_over.is_planned() {
            self.pending = self.step_over.work(job, axes).err();
            let may_lift = now.faces_up[1] && (next.faces_up[0] || !job.header.spacing.is_constant());
            if self.step_over.is_planned() && self.step_over.is_slower_than_lift() && may_lift {
                now.steps_over = false;
                (self.has_step_over, self.has_hop) = (false, true);
            }
            return true;
        }
        false
    }

    /// Executes a piece of the planning of the next pass.
    #[inline(never)]
    fn work_on_pass(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &mut Run) {
        let (now, next) = both(&mut self.plans, self.second);
        match self.planning {
            Planning::Awaited(pass) => self.await_route(job, run, pass),
            Planning::AwaitsRows(_) => {}
            Planning::Requested(pass) if run.lacks_rows(job, next.route.side.span) => {
                self.planning = Planning::AwaitsRows(pass);
            }
            Planning::Requested(pass) => self.begin_stations(job, run, pass),
            Planning::Stations => {
                let (estimator, lines) = run.estimator_and_lines();
                self.pending = self.lookahead.work(job, axes, estimator, lines, next).err();
                if self.lookahead.is_done() {
                    self.after_stations(job, axes, run);
                }
            }
            Planning::Feed => self.plan_feed(job, axes, run),
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

    /// Takes the route of a pass once it is known.
    fn await_route(&mut self, job: &Job<'_>, run: &mut Run, pass: u32) {
        match run.next_pass(job) {
            Ok(NextRoute::Pass(route)) => {
                let (_, next) = both(&mut self.plans, self.second);
                next.route = route;
                self.planning = Planning::Requested(pass);
            }
            // With no piece of work on the front left, the wait would have no end: a fault.
            Ok(NextRoute::NotYet) if run.front_cycles() == 0 => {
                self.pending = Some(Fault::new(FaultKind::IntervalTooSmall, 0.0));
            }
            Ok(NextRoute::NotYet) => {}
            Ok(NextRoute::None) => self.planning = Planning::Complete,
            Err(fault) => self.pending = Some(fault),
        }
    }

    fn begin_stations(&mut self, job: &Job<'_>, run: &mut Run, pass: u32) {
        let (now, next) = both(&mut self.plans, self.second);
        if pass == self.first.pass {
            // It begins at rest, whether or not a turn would lead to it.
            now.tail = Turn::NONE;
        }
        if let (Some(estimator), lines) = run.estimator_and_lines() {
            estimator.enter_row(job.header, next.route.side.span, now.tail.exists());
            if lines.begins_apart() {
                estimator.begin_apart();
            }
        }
        self.lookahead.begin(pass, next.route, &now.tail, next);
        next.is_last = run.is_last_pass();
        self.planning = Planning::Stations;
    }

    /// Begins to plan the feed of the pass whose stations are known; or goes on to the place from which the run begins.
    fn after_stations(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &mut Run) {
        let (_, next) = both(&mut self.plans, self.second);
        next.is_last |= next.next.is_none() && !job.header.spacing.is_constant();
        if next.pass < self.first.pass {
            self.skip(run);
        } else if let Some(path) = self.first.within() {
            // The whole of the pass tells what follows it; the tool moves from this place on.
            self.first.path = SpanParameter::NONE;
            self.pending = self.lookahead.begin_within(path, next).err();
        } else if next.point {
            self.planning = Planning::Complete;
        } else if next.plan.stations.length_nm() == 0 {
            let [at_boundary, _] = next.route.reach_boundaries(job);
            if next.pass > self.first.pass || at_boundary {
                self.pending = Some(Fault::new(FaultKind::PatchTooShort, 0.0));
            } else {
                // The run begins at the end of the pass.
                self.first.pass += 1;
                self.skip(run);
            }
        } else {
            self.begin_feed(job, axes, job.header.feed_mm_s * self.feed_factor.at_least(1.0));
        }
    }

    /// Begins to plan the feed of the next pass, at most `feed_mm_s`.
    fn begin_feed(&mut self, job: &Job<'_>, axes: &AxisLimits, feed_mm_s: f32) {
        let (_, next) = both(&mut self.plans, self.second);
        next.set_limits(job, MotionLimits::new(axes, feed_mm_s, job.header.period_s));
        self.ends_on_surface = ends_on_surface(job, axes, next);
        self.planner.begin(&mut next.plan);
        self.planning = Planning::Feed;
    }

    fn plan_feed(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &Run) {
        let left = self.periods_to_link(job, axes);
        let left = left.map(|left| (left - count_to_f32(SPARE_PERIODS)).at_least(0.0));
        let least = self.least_periods(run);
        let (_, next) = both(&mut self.plans, self.second);
        if let Some(left) = left
            && self.wait_pace == f32::MAX
            && left > PERIODS_A_SEARCH
        {
            let needed = self.planner.least_left(&next.plan);
            if needed > left + PERIODS_LATE {
                self.wait_pace = (WAIT_SHARE * left / needed).at_least(WAIT_PACE_MIN);
            }
        }
        let deadlines = Deadlines {
            spent: self.spent,
            least,
            left,
            waits: next.pass == self.first.pass,
        };
        self.planner.work(&mut next.plan, deadlines);
        if self.planner.is_done() {
            self.wait_pace = f32::MAX;
            self.planning = Planning::Complete;
            if next.turns() && is_too_slow(next) {
                self.lookahead.avoid_turns();
            }
        }
    }

    /// Least duration of the next pass, in periods: the pass after it takes as long to plan as this one, and the tool can wait for it only off the surface.
    fn least_periods(&self, run: &Run) -> u32 {
        let [one, other] = &self.plans;
        let next = if self.second { one } else { other };
        let is_last = next.is_last && !self.planner.is_walking();
        if is_last || !self.ends_on_surface {
            return 0;
        }
        let front = if run.needs_front() {
            front_periods(self.front_spent, self.front_last)
        } else {
            0
        };
        // Before a turn the next plan has to be complete in time: one of two passes has the longer planning.
        let spare = if next.turns() {
            SPARE_BEFORE_TURN
        } else {
            SPARE_PERIODS
        };
        self.spent.saturating_add(front).saturating_add(spare)
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

    /// Plans the next pass anew for the override.
    fn plan_for_override(&mut self, job: &Job<'_>, axes: &AxisLimits) {
        self.begin_feed(job, axes, job.header.feed_mm_s * self.feed_factor);
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
        let may_step = job.header.edges == 0 || next.route.joins;
        let may_step = may_step && !now.is_tip && job.header.pattern == Pattern::Zigzag;
        now.steps_over = may_step && now.is_beside(next);
        if now.steps_over {
            self.step_over.request();
            self.has_step_over = true;
        } else {
            self.has_hop = true;
        }
    }
}

/// Whether the tool may have to wait on the surface at the end of a pass, for the one after it.
fn ends_on_surface(job: &Job<'_>, axes: &AxisLimits, pass: &PassPlan) -> bool {
    let is_low = || job.link_to(pass.pass.wrapping_add(1), axes).is_low();
    if job.header.spacing.is_constant() && job.header.edges == 0 {
        job.header.pattern == Pattern::Zigzag
    } else if job.header.spacing.is_constant() {
        // The next pass may be joined along a boundary; what reaches one says so.
        let [_, at_boundary] = pass.route.reach_boundaries(job);
        (job.header.pattern == Pattern::Zigzag && at_boundary) || is_low()
    } else {
        pass.steps_over || is_low()
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

/// Periods that making the front after the next takes, by those of the next front and of the one before, with an eighth more: where that is not enough, the tool lifts.
const fn front_periods(so_far: u32, last: u32) -> u32 {
    let most = if so_far > last { so_far } else { last };
    most.saturating_add(most / 8)
}
