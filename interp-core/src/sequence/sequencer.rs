//! The sequence of a job on a machine with limits: approach, passes from rest to rest, links, retract.
//!
//! [`Sequencer::tick`] moves the tool by one period. [`Sequencer::plan`] plans, a fixed portion a period: a change of the pace, the link to the next
//! pass, the next pass. A pass is slowed down where the pass after it would not be planned in time.

use crate::fault::{Fault, FaultKind, Result};
use crate::feed::MM_PER_Q10;
use crate::feed::follow::Follower;
use crate::feed::limits::MotionLimits;
use crate::feed::pace::{Course as _, Pace};
use crate::feed::plan::{Cursor, Plan};
use crate::feed::planner::{PORTION_CYCLES, Planner};
use crate::feed::profile::Profiles;
use crate::feed::turn::Turn;
use crate::job::program::{Job, Link, Program};
use crate::job::{AxisLimits, Pattern};
use crate::math::arith::count_to_f32;
use crate::math::number::{Bounded, to_f32};
use crate::pass::front::NextRoute;
use crate::pass::route::Route;
use crate::pass::run::Run;
use crate::pass::scan::cycles::{NEXT, PATCH};
use crate::sample::{Sample, SpanParameter};
use crate::sequence::hop::Hop;
use crate::sequence::legs::{Goal, Leg, LegPlanning};
use crate::sequence::link::{BoundaryEnd, BoundaryStepOver, StraightMove, check_faces_up};
use crate::sequence::lookahead::{Lookahead, PassPlan, has_turns};
use crate::sequence::pause::Return;
use crate::sequence::turning::{Part, road};

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
/// Periods by which a correction of the progress waits for a cheaper tick, at most.
const WAITS_MAX: u8 = 4;
/// Steps in which the tool's place after the planning is estimated.
const AHEAD_STEPS: u16 = 64;

/// Phase of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// The tool waits until the next pass is planned.
    Await,
    /// A step-over along the boundary.
    StepOver,
    /// The tool waits until the goal of the leg is known.
    AwaitGoal(Leg),
    /// A straight move off the surface.
    Leg(Leg),
    /// Up, across and down to the next pass as one motion.
    Hop,
    /// The tool is on a pass.
    Pass,
    /// The tool is in a turn from pass to pass.
    Turn,
    /// The tool is held at the safe height, for a pause.
    Lifted,
    /// The sequence is over.
    Done,
}

/// Outcome of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// The tool is on a pass.
    Pass,
    /// The tool is between passes.
    Link,
    /// The last sample was emitted.
    Finished,
    /// The tool has retracted for a pause, and waits.
    Lifted,
}

/// Planning of the next pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Planning {
    /// It waits until the pass with this number is made, of a job of constant scallop height.
    Awaited(u32),
    /// It is to be begun, for this number of the pass on the plan's route.
    Requested(u32),
    /// Its stations are being located.
    Stations,
    /// Its feed is being planned.
    Feed,
    /// The rest of this pass is being planned anew, for an override above its plan.
    Rest,
    /// There is no next pass, or it is planned.
    Complete,
}

/// Arc before the end of a pass on a front from which on the progress is corrected in each period, units of 2^-10 nm, and the part of the difference that is taken
/// in a period: a twelfth of 0.15 um takes 3 % of the jerk limit.
const END_Q10: i64 = 300_000 << 10;
const END_PARTS: i64 = 12;

/// A correction of the progress: how far the tool is ahead of it, units of 2^-10 nm, and for how many periods that has been known.
#[derive(Clone, Copy, Debug)]
struct Correction {
    apart_q10: i64,
    waited: u8,
}

/// The feed that is commanded for a period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeedCommand {
    /// Feed factor, 0 to 2.
    pub(crate) feed_factor: f32,
    /// A controlled stop after a fault.
    pub(crate) is_fault: bool,
}

/// The sequence of a job.
#[derive(Clone, Debug)]
pub(crate) struct Sequencer {
    pub(super) phase: Phase,
    pub(super) goal: Goal,
    /// The planning of the leg that is waited for.
    pub(super) leg: LegPlanning,
    lookahead: Lookahead,
    planner: Planner,
    pub(super) planning: Planning,
    pub(super) plans: [PassPlan; 2],
    /// The second plan is that of the current or last pass.
    pub(super) second: bool,
    /// Whether the tool has been on a pass since the start.
    pub(super) on_surface: bool,
    /// The leg to the next pass goes straight there from the end of the last one.
    pub(super) is_straight: bool,
    /// A fault of the next pass, reported when the tool reaches the pass.
    pub(super) pending: Option<Fault>,
    pub(super) follower: Follower,
    pub(super) pace: Pace<Cursor>,
    pub(super) profiles: Profiles,
    /// The turn that the tool is in, or was last.
    pub(super) turn: Turn,
    pub(super) straight: StraightMove,
    pub(super) hop: Hop,
    /// Whether the hop to the next pass is to be planned.
    has_hop: bool,
    step_over: BoundaryStepOver,
    /// Whether the step-over to the next pass is begun.
    has_step_over: bool,
    /// Whether the link to the next pass of a job of constant scallop height is to be chosen.
    has_to_choose: bool,
    /// Periods of planning of the next pass so far, and of making the next front and the one before it.
    spent: u32,
    front_spent: u32,
    front_last: u32,
    /// Feed factor of the last period, and the feed that the rest of the pass was last planned for, mm/s.
    feed_factor: f32,
    replanned: f32,
    /// The tool's position, once it is known.
    pub(super) at: Option<[i32; 3]>,
    /// Whether the first patch of the pass ahead is to be collapsed.
    has_first_patch: bool,
    /// Patch of the pass and cell of the patch that the tool is in.
    cell: [u16; 2],
    correction: Option<Correction>,
    /// Whether the rows of patches are there that the planning of the pass after the next needs.
    has_rows: bool,
    /// Where a pause leads back to.
    pub(super) back: Return,
    /// The first pass of the next run, and of this one: those before it are skipped.
    wanted_pass: u32,
    first_pass: u32,
}

/// The plans of the current or last pass, and of the next.
pub(super) const fn both(plans: &mut [PassPlan; 2], second: bool) -> (&mut PassPlan, &mut PassPlan) {
    let [one, other] = plans;
    if second { (other, one) } else { (one, other) }
}

impl Sequencer {
    /// State before the first run.
    pub(crate) const START: Self = Self {
        phase: Phase::Done,
        goal: Goal::Pass,
        leg: LegPlanning::Requested,
        lookahead: Lookahead::START,
        planner: Planner::IDLE,
        planning: Planning::Complete,
        plans: [PassPlan::NONE; 2],
        second: false,
        on_surface: false,
        is_straight: false,
        pending: None,
        follower: Follower::START,
        pace: Pace::REST,
        profiles: Profiles::NONE,
        turn: Turn::NONE,
        straight: StraightMove::NONE,
        hop: Hop::NONE,
        has_hop: false,
        step_over: BoundaryStepOver::NONE,
        has_step_over: false,
        has_to_choose: false,
        spent: 0,
        front_spent: 0,
        front_last: 0,
        feed_factor: 1.0,
        replanned: 0.0,
        at: None,
        has_first_patch: false,
        cell: [0; 2],
        correction: None,
        has_rows: false,
        back: Return::NONE,
        wanted_pass: 0,
        first_pass: 0,
    };

    /// Sets the pass with which the next run begins.
    pub(crate) const fn begin_at(&mut self, pass: u32) {
        self.wanted_pass = pass;
    }

    /// The pass with which this run begins.
    pub(crate) const fn first_pass(&self) -> u32 {
        self.first_pass
    }

    /// Starts the job from the tool's position.
    pub(crate) fn restart(&mut self, first: Route, axes: &AxisLimits) {
        self.first_pass = core::mem::take(&mut self.wanted_pass);
        self.at.get_or_insert(axes.home_nm);
        self.back = Return::NONE;
        self.phase = Phase::Await;
        self.second = false;
        self.on_surface = false;
        self.is_straight = false;
        self.pending = None;
        self.has_first_patch = true;
        self.has_rows = false;
        self.planner.stop();
        for pass in &mut self.plans {
            pass.tail = Turn::NONE;
        }
        self.lookahead.restart();
        self.feed_factor = 1.0;
        (self.front_spent, self.front_last) = (0, 0);
        self.has_to_choose = false;
        let (_, next) = both(&mut self.plans, self.second);
        next.route = first;
        self.request_planning(Planning::Requested(0));
    }

    /// The tool's position, nm, once it is known.
    pub(crate) const fn stands_nm(&self) -> Option<[i32; 3]> {
        self.at
    }

    /// Sets the tool's position, nm; none where it is unknown. Not within a run.
    pub(crate) const fn stand_at(&mut self, at_nm: Option<[i32; 3]>) {
        self.at = at_nm;
    }

    /// Whether the tool is at rest, and stays so while the commanded speed is 0.
    pub(crate) fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::Pass | Phase::Turn => self.pace.is_at_rest(),
            Phase::StepOver => self.step_over.progress.is_at_rest(),
            Phase::Leg(_) => self.straight.progress.is_at_rest(),
            Phase::Hop => self.hop.is_at_rest(),
            Phase::Await | Phase::AwaitGoal(_) | Phase::Lifted | Phase::Done => true,
        }
    }

    /// The first and the last row of patches that are needed to go on, where the tool stands before a pass whose successor is to be planned next: at the end of the pass before it, or
    /// above its start. With the pass begins the planning of that successor.
    pub(crate) fn rows_needed(&self, job: &Job<'_>, run: &Run) -> Option<[u16; 2]> {
        if self.has_rows || self.pending.is_some() || !self.is_planned() {
            return None;
        }
        let is_due = match self.phase {
            Phase::Await => !self.has_to_plan_step_over(),
            Phase::AwaitGoal(Leg::Plunge) => self.goal == Goal::Pass && self.leg == LegPlanning::Complete,
            Phase::Leg(Leg::Plunge) => self.goal == Goal::Pass,
            Phase::Hop => true,
            _ => false,
        };
        let (_, next) = self.plans_ref();
        let after = next.next.filter(|_| is_due)?;
        run.rows_ahead(job, after.side)
    }

    /// They are there.
    pub(crate) const fn set_has_rows(&mut self) {
        self.has_rows = true;
    }

    /// Whether [`Self::rows_needed`] is to be asked.
    pub(crate) const fn may_wait_for_rows(&self) -> bool {
        !self.has_rows && !matches!(self.phase, Phase::Pass | Phase::Turn | Phase::Done)
    }

    /// Whether the tool is between passes.
    pub(crate) const fn is_link(&self) -> bool {
        !matches!(self.phase, Phase::Pass)
    }

    /// Pass, path and side parameter of the fault of the next pass, if it stopped the run.
    pub(crate) fn fault_position(&self) -> Option<(u32, SpanParameter, SpanParameter)> {
        let [one, other] = &self.plans;
        let next = if self.second { one } else { other };
        self.pending.map(|_| self.lookahead.surface_position(next))
    }

    /// Retracts from rest to the safe height and ends there. Where the surface does not face up the tool stays.
    pub(crate) fn retract(&mut self, run: &Run) {
        let is_free = self.is_link() || run.faces_up();
        self.goal = Goal::SafeHeight;
        self.is_straight = false;
        if is_free {
            self.await_goal(Leg::Retract);
        } else {
            self.phase = Phase::Done;
        }
    }

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

    /// Whether the next pass is planned.
    pub(super) fn is_planned(&self) -> bool {
        matches!(self.planning, Planning::Complete | Planning::Rest)
    }

    fn has_to_plan_step_over(&self) -> bool {
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
    fn work(&mut self, job: &Job<'_>, axes: &AxisLimits, run: &mut Run) {
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
    const fn request_planning(&mut self, planning: Planning) {
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

    /// One period, into `last`. The phases off the passes are separate functions, so that a tick on a pass saves no registers for them.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is unchanged.
    #[inline(never)]
    pub(crate) fn tick(
        &mut self,
        job: &Job<'_>,

        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<Outcome> {
        let was_link = self.is_link() && self.phase != Phase::Turn;
        self.feed_factor = command.feed_factor;
        if let Phase::Pass | Phase::Turn = self.phase {
            self.follow_pass(job, run, command, last)?;
            if self.phase == Phase::Turn {
                self.at = Some(last.cl_nm);
                return Ok(Outcome::Link);
            }
        } else if self.phase == Phase::Done {
            return Ok(Outcome::Finished);
        } else {
            self.follow_link(job, run, command, last)?;
        }
        self.at = Some(last.cl_nm);
        if self.phase == Phase::Lifted {
            return Ok(Outcome::Lifted);
        }
        // The first and the last sample of a pass belong to the pass.
        Ok(if was_link && self.is_link() {
            Outcome::Link
        } else {
            Outcome::Pass
        })
    }

    /// One period off the passes.
    #[inline(never)]
    fn follow_link(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        self.leave(job, run, command)?;
        match self.phase {
            Phase::StepOver => self.follow_step_over(job, run, command, last),
            Phase::Leg(leg) => self.follow_leg(leg, job, run, command, last),
            Phase::Hop => self.follow_hop(job, run, command, last),
            _ => {
                match self.at {
                    Some(at) if !self.on_surface => run.off_surface(at, 0.0, last),
                    _ => run.stand(last),
                }
                Ok(())
            }
        }
    }

    /// Ends a wait where what is waited for is there.
    fn leave(&mut self, job: &Job<'_>, run: &mut Run, command: FeedCommand) -> Result<()> {
        if self.phase == Phase::Await {
            if let Some(fault) = self.pending {
                return Err(fault);
            }
            if !self.is_planned() || self.has_to_plan_step_over() || self.has_to_choose {
                return Ok(());
            }
            let (now, next) = both(&mut self.plans, self.second);
            if self.on_surface && now.steps_over {
                self.phase = Phase::StepOver;
                let pace = command.feed_factor * job.header.feed_mm_s / self.step_over.feed();
                self.step_over
                    .progress
                    .begin(pace.at_most(1.0), job.header.period_s);
                self.swap(run);
            } else {
                check_faces_up(next.faces_up[0] && (now.faces_up[1] || !self.on_surface))?;
                self.goal = Goal::Pass;
                self.await_goal(Leg::Retract);
            }
        }
        if let Phase::AwaitGoal(leg) = self.phase {
            self.begin_leg(leg, job, command)?;
        }
        Ok(())
    }

    /// The next pass becomes the one that is followed, and the one after it is planned.
    pub(super) fn swap(&mut self, run: &mut Run) {
        self.second = !self.second;
        let (now, next) = both(&mut self.plans, self.second);
        let pass = now.pass.wrapping_add(1);
        let planning = match now.next {
            Some(route) => {
                next.route = route;
                Planning::Requested(pass)
            }
            None if now.is_last => Planning::Complete,
            None => Planning::Awaited(pass),
        };
        if run.arrive_on_front() {
            (self.front_last, self.front_spent) = (self.front_spent, 0);
        }
        self.request_planning(planning);
    }

    /// Enters the pass, which begins at the tool's position, and emits its first sample.
    #[inline(never)]
    pub(super) fn enter_pass(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        run.enter_pass(job, now.pass, now.route)?;
        run.begin(now.interval, last)?;
        self.on_surface = true;
        self.is_straight = false;
        self.phase = Phase::Pass;
        self.follower.begin(&now.plan);
        let pace = pace_on(now, command.feed_factor);
        self.pace.begin(pace, job.header.period_s);
        self.start_pass(job);
        Ok(())
    }

    /// Resets what belongs to a pass, and requests the link to the next one.
    pub(super) fn start_pass(&mut self, job: &Job<'_>) {
        self.has_first_patch = true;
        let (now, _) = both(&mut self.plans, self.second);
        self.cell = [0; 2];
        self.correction = None;
        self.replanned = 0.0;
        if job.header.spacing.is_constant() {
            self.has_to_choose = !now.is_last;
            self.has_hop = false;
            self.hop.clear();
            return;
        }
        if now.steps_over && !now.turns() {
            self.step_over.request();
            self.has_step_over = true;
        }
        self.has_hop = !now.steps_over && now.next.is_some();
        self.hop.clear();
    }

    /// The plans of the current or last pass, and of the next.
    pub(super) const fn plans_ref(&self) -> (&PassPlan, &PassPlan) {
        let [one, other] = &self.plans;
        if self.second { (other, one) } else { (one, other) }
    }

    /// Whether the plan of the next pass is complete.
    pub(super) fn knows_next(&self) -> bool {
        self.is_planned() && self.pending.is_none()
    }

    /// The pass that a link leads to, if its first patch is to be collapsed, and can be.
    fn pass_ahead(&self) -> Option<&PassPlan> {
        if !self.has_first_patch || self.pending.is_some() {
            return None;
        }
        let (now, next) = self.plans_ref();
        let is_located = !matches!(
            self.planning,
            Planning::Awaited(_) | Planning::Requested(..) | Planning::Stations
        );
        match self.phase {
            Phase::StepOver => Some(now),
            Phase::Turn => {
                let is_behind = self.follower.arc_q10() >= now.tail_q10;
                Some(next).filter(|_| now.turns() && is_behind && is_located)
            }
            Phase::Hop | Phase::Leg(_) | Phase::AwaitGoal(_) => {
                Some(next).filter(|_| self.goal == Goal::Pass && is_located)
            }
            Phase::Await | Phase::Pass | Phase::Lifted | Phase::Done => None,
        }
    }

    /// The greatest pace on the next pass, if it is planned and a turn leads there.
    fn next_pace(&self) -> Option<f32> {
        let (now, next) = self.plans_ref();
        (now.turns() && self.knows_next()).then(|| pace_on(next, self.feed_factor))
    }

    fn follow_pass(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        self.correct_progress(job, run);
        let (now, _) = both(&mut self.plans, self.second);
        let is_over = if now.point {
            if command.feed_factor > 0.0 && run.is_along() {
                run.advance_far(job, 1.0, last)?;
            } else {
                run.stand(last);
            }
            !run.is_along()
        } else {
            let wanted = now.pace(command.feed_factor);
            let next_pace = self.next_pace();
            let wanted = self.pace_before_turn(wanted, next_pace);
            self.pace.want(wanted, command.is_fault);
            if let Some(fault) = self
                .pending
                .filter(|_| self.pace.is_at_rest() && command.feed_factor > 0.0)
            {
                return Err(fault);
            }
            let pace = self.pace.tick(&mut self.profiles);
            let (now, _) = both(&mut self.plans, self.second);
            let moved = if pace > 0.0 {
                self.follower.tick(&now.plan, pace)
            } else {
                0.0
            };
            if self.follower.is_over(&now.plan) && !now.turns() {
                check_end(&now.plan, &self.follower)?;
                run.finish_pass(job, last)?;
                self.phase = Phase::Pass;
                true
            } else {
                if self.follower.is_over(&now.plan) {
                    self.cross_apex(job, run)?;
                }
                self.follow_part(job, run, moved, last)?;
                false
            }
        };
        if is_over {
            self.end_pass(job, command)?;
        }
        Ok(())
    }

    /// The sample at the follower's place: on the pass or in a turn.
    fn follow_part(&mut self, job: &Job<'_>, run: &mut Run, moved: f32, last: &mut Sample) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        let arc_q10 = self.follower.arc_q10();
        if let Part::Turn(turn_q10) = now.part(arc_q10, &self.turn) {
            if self.phase == Phase::Pass {
                self.turn = now.tail;
                self.phase = Phase::Turn;
            }
            let turn = self.turn;
            self.emit_turn(&turn, turn_q10, run, last);
            return Ok(());
        }
        let moved = if self.phase == Phase::Turn {
            to_f32(arc_q10 - now.head_q10) * MM_PER_Q10
        } else {
            moved
        };
        self.phase = Phase::Pass;
        if moved > MOVED_MIN && run.is_along() {
            run.move_by(job, moved / (job.header.feed_mm_s * job.header.period_s), last)?;
        } else {
            run.stand(last);
        }
        Ok(())
    }

    /// Chooses what follows a pass.
    #[inline(never)]
    fn end_pass(&mut self, job: &Job<'_>, command: FeedCommand) -> Result<()> {
        self.has_rows = false;
        let stays = self.stays_on_surface(job);
        let (now, next) = both(&mut self.plans, self.second);
        if now.is_last {
            check_faces_up(now.faces_up[1])?;
            self.goal = Goal::Home;
            self.await_goal(Leg::Retract);
        } else if stays {
            self.phase = Phase::Await;
        } else {
            check_faces_up(now.faces_up[1])?;
            self.goal = Goal::Pass;
            // Planning never delays the lift: what is not planned yet is waited for above the surface.
            let is_planned = self.pending.is_none() && self.planning == Planning::Complete;
            let is_straight =
                (job.header.axes.as_ref()).is_some_and(|axes| job.link_to(next.pass, axes) == Link::Straight);
            if is_planned && is_straight && next.faces_up[0] {
                self.is_straight = true;
                self.await_goal(Leg::Plunge);
            } else if is_planned && next.faces_up[0] && self.hop.leads(now.ends[1], next.ends[0]) {
                self.hop
                    .begin(command.feed_factor.at_most(1.0), job.header.period_s);
                self.phase = Phase::Hop;
            } else {
                self.await_goal(Leg::Retract);
            }
        }
        Ok(())
    }

    /// Whether the tool waits on the surface for the link from a pass that has ended: along the boundary, which is planned; of straight passes of a zigzag job
    /// always, because their planning keeps ahead. A fault of the next pass stops it there.
    fn stays_on_surface(&self, job: &Job<'_>) -> bool {
        let (now, _) = self.plans_ref();
        if !job.header.spacing.is_constant() {
            return now.steps_over;
        }
        self.pending.is_some() || (self.has_step_over && self.is_planned()) || !now.faces_up[1]
    }

    /// Corrects the progress at each station by the plan's arc, so that errors do not accumulate from station to station: some periods after it was
    /// measured, because those in which the tool comes to a patch, and the patch after it is prepared, are the worst-case ticks.
    fn correct_progress(&mut self, job: &Job<'_>, run: &Run) {
        let (now, _) = both(&mut self.plans, self.second);
        if self.phase != Phase::Pass || now.point {
            return;
        }
        if now.route.is_on_front() && self.correct_to_end(job, run) {
            return;
        }
        let (now, _) = both(&mut self.plans, self.second);
        let kept = now.kept_cells();
        if let Some(correction) = &mut self.correction {
            if run.prepares_patch() && correction.waited < WAITS_MAX {
                correction.waited += 1;
            } else if self.follower.correct(&now.plan, correction.apart_q10) {
                self.correction = None;
            }
            return;
        }
        let Some(cell) = run.cell(kept.0).filter(|cell| *cell != self.cell) else {
            return;
        };
        self.cell = cell;
        let arc = match now.route.is_on_front() {
            true => now.arc_at_piece_q10(cell[0]),
            false => now.arc_q10(cell),
        };
        let (Some(start_q10), Some(since_mm)) = (arc, run.since_station(cell, kept)) else {
            return;
        };
        let arc_q10 = start_q10 + crate::feed::to_q10(since_mm);
        self.correction = Some(Correction {
            apart_q10: arc_q10 - self.follower.arc_q10(),
            waited: 0,
        });
    }

    /// Corrects the progress by the arc left, near the end of a pass on a front: the stations are far apart there, and what is left of their error would be in the
    /// last step. Returns whether it is near.
    #[inline(never)]
    fn correct_to_end(&mut self, job: &Job<'_>, run: &Run) -> bool {
        let (now, _) = both(&mut self.plans, self.second);
        let left_q10 = now.plan.length_q10() - self.follower.arc_q10();
        if left_q10 >= END_Q10 {
            return false;
        }
        let Some(left_mm) = run.arc_left(job) else {
            return false;
        };
        let apart_q10 = left_q10 - crate::feed::to_q10(left_mm);
        self.correction = None;
        self.follower.correct(&now.plan, apart_q10 / END_PARTS);
        true
    }

    fn follow_hop(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        if self.hop.tick(
            command.feed_factor.at_most(1.0),
            command.is_fault,
            job.header.period_s,
            &mut self.profiles,
        ) {
            self.swap(run);
            return self.enter_pass(job, run, command, last);
        }
        run.off_surface(self.hop.position(), self.hop.speed(), last);
        Ok(())
    }

    fn follow_step_over(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        let pace = command.feed_factor * job.header.feed_mm_s / self.step_over.feed();
        let is_over = self.step_over.is_nothing()
            || self.step_over.progress.tick(
                pace.at_most(1.0),
                command.is_fault,
                job.header.period_s,
                &mut self.profiles,
            );
        if is_over {
            return self.enter_pass(job, run, command, last);
        }
        let located = self.step_over.position(job)?;
        run.off_surface(located.cl_nm, self.step_over.contact_speed(), last);
        last.cc_nm = located.cc_nm;
        Ok(())
    }
}

/// Greatest length left at the end of a plan, mm, or as a share of what a period at the jerk limit makes of it.
const END_MAX_MM: f32 = 1e-3;
const END_MAX_SHARE: f32 = 0.25;

/// Least move of a period, mm: a millionth of a nanometre is rounding.
const MOVED_MIN: f32 = 1e-12;

/// The end of a plan is the end of its path: a step to there is none that an axis would notice.
///
/// # Errors
/// [`FaultKind::PatchTooShort`] with the length that is left, mm.
fn check_end(plan: &Plan, follower: &Follower) -> Result<()> {
    let left = to_f32(plan.length_q10() - follower.arc_q10()) * MM_PER_Q10;
    let MotionLimits {
        feed, period, axes, ..
    } = &plan.limits;
    let [x, y, z] = axes.map(|axis| axis.jerk);
    let jerk = x.at_most(y).at_most(z);
    let most = END_MAX_MM
        .at_least(END_MAX_SHARE * jerk * period * period * period)
        .at_most(feed * period);
    if left.abs() <= most {
        Ok(())
    } else {
        Err(Fault::new(FaultKind::PatchTooShort, left))
    }
}

/// The greatest pace on a pass at this feed factor.
fn pace_on(pass: &PassPlan, share: f32) -> f32 {
    pass.pace(share).at_most(pass.plan.pace_max)
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
