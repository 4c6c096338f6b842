//! The sequence of a job on a machine with limits: approach, passes from rest to rest, links, retract.
//!
//! [`Sequencer::tick`] moves the tool by one period. [`Sequencer::plan`] plans, a fixed portion a period: a change of the pace, the link to the next
//! pass, the next pass. A pass is slowed down where the pass after it would not be planned in time.

mod in_time;
mod next_step;
mod on_pass;
mod planning;

use crate::fault::{Fault, Result};
use crate::feed::follow::Follower;
use crate::feed::pace::Pace;
use crate::feed::plan::Cursor;
use crate::feed::planner::Planner;
use crate::feed::profile::Profiles;
use crate::feed::turn::Turn;
use crate::job::AxisLimits;
use crate::job::links::Link;
use crate::job::program::Job;
use crate::job::stream::RowsNeeded;
use crate::math::number::Bounded;
use crate::pass::route::Route;
use crate::pass::run::Run;
use crate::sample::{RunStart, Sample, SpanParameter};
use crate::sequence::hop::Hop;
use crate::sequence::legs::{Goal, Leg, LegPlanning};
use crate::sequence::link::{BoundaryStepOver, StraightMove, check_faces_up};
use crate::sequence::lookahead::{Lookahead, PassPlan};
use crate::sequence::pause::Return;
use next_step::NextStep;

/// Least distance of a place within a pass from its ends, 0.5 mm, units of 2^-10 nm: the rest of the pass has cells of its own.
const WITHIN_Q10: i64 = 500_000 << 10;

/// Longest stand at the end of a pass, periods: for more the tool rises, however much longer that takes, because a stand leaves a mark.
const STAND_MAX: f32 = 3.0;

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
    /// It waits for the rows of patches of the pass with this number, which a turn before the last one could not know of.
    AwaitsRows(u32),
    /// Its stations are being located.
    Stations,
    /// Its feed is being planned.
    Feed,
    /// There is no next pass, or it is planned.
    Complete,
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
    /// The legs to the next pass stay low: straight there from the end of the last one, or by a place beside.
    pub(super) is_low: bool,
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
    /// Periods of planning of the next pass so far, of this one in all, and of making the next front and the one before it.
    spent: u32,
    spent_last: u32,
    front_spent: u32,
    front_last: u32,
    /// Periods of the present pass's plan that are over.
    passed: f32,
    /// Greatest pace until the next pass is planned, where the planning would last longer than the present one.
    wait_pace: f32,
    /// Whether the next plan comes before a search for a pace in this period.
    plan_comes_first: bool,
    /// Feed factor of the last period.
    feed_factor: f32,
    /// The tool may have to wait on the surface at the end of the pass that is planned.
    ends_on_surface: bool,
    /// The tool's position, once it is known.
    pub(super) at: Option<[i32; 3]>,
    /// Whether the first patch of the pass ahead is to be collapsed.
    has_first_patch: bool,
    /// Patch of the pass and cell of the patch that the tool is in.
    cell: [u16; 2],
    /// How far the tool is ahead of the progress, units of 2^-10 nm, where that was measured in the last period.
    correction: Option<i64>,
    /// Whether the progress is corrected since the last tick on the pass, and the step of the next one.
    is_corrected: bool,
    next_step: Option<NextStep>,
    /// Whether the rows of patches are there that the planning of the pass after the next needs.
    has_rows: bool,
    /// Where a pause leads back to.
    pub(super) back: Return,
    /// Where the next run begins, and this one: the passes before are skipped. A place within the pass counts until the pass is looked at from there.
    wanted: RunStart,
    first: RunStart,
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
        is_low: false,
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
        spent_last: 0,
        front_spent: 0,
        front_last: 0,
        passed: 0.0,
        wait_pace: f32::MAX,
        plan_comes_first: false,
        feed_factor: 1.0,
        ends_on_surface: false,
        at: None,
        has_first_patch: false,
        cell: [0; 2],
        correction: None,
        is_corrected: false,
        next_step: None,
        has_rows: false,
        back: Return::NONE,
        wanted: RunStart::FIRST,
        first: RunStart::FIRST,
    };

    /// Sets where the next run begins.
    pub(crate) const fn begin_at(&mut self, start: RunStart) {
        self.wanted = start;
    }

    /// Whether the tool is on a pass, away from its ends.
    pub(crate) fn is_within(&self) -> bool {
        let (now, _) = self.plans_ref();
        let arc_q10 = self.follower.arc_q10();
        let end_q10 = if now.turns() {
            now.tail_q10
        } else {
            now.plan.length_q10()
        };
        self.phase == Phase::Pass
            && !now.point
            && arc_q10 - now.head_q10 >= WITHIN_Q10
            && end_q10 - arc_q10 >= WITHIN_Q10
    }

    /// The pass with which this run begins.
    pub(crate) const fn first_pass(&self) -> u32 {
        self.first.pass
    }

    /// Starts the job from the tool's position.
    pub(crate) fn restart(&mut self, first: Route, axes: &AxisLimits) {
        self.first = core::mem::take(&mut self.wanted);
        self.at.get_or_insert(axes.home_nm);
        self.back = Return::NONE;
        self.phase = Phase::Await;
        self.second = false;
        self.on_surface = false;
        self.is_low = false;
        self.pending = None;
        self.has_first_patch = true;
        self.has_rows = false;
        self.planner.stop();
        for pass in &mut self.plans {
            pass.tail = Turn::NONE;
        }
        self.lookahead.restart();
        self.forget_step();
        self.has_hop = false;
        self.hop.clear();
        self.feed_factor = 1.0;
        (self.front_spent, self.front_last) = (0, 0);
        self.spent_last = 0;
        self.wait_pace = f32::MAX;
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
            // The tool stands on a pass that is a point, whatever the pace.
            Phase::Pass if self.plans_ref().0.point => true,
            Phase::Pass | Phase::Turn => self.pace.is_at_rest(),
            Phase::StepOver => self.step_over.progress.is_at_rest(),
            Phase::Leg(_) => self.straight.progress.is_at_rest(),
            Phase::Hop => self.hop.is_at_rest(),
            Phase::Await | Phase::AwaitGoal(_) | Phase::Lifted | Phase::Done => true,
        }
    }

    /// The rows of patches that are needed to go on, where the tool stands before a pass whose successor is to be planned next: at the end of the pass before it, or
    /// above its start. With the pass begins the planning of that successor.
    pub(crate) fn rows_needed(&self, job: &Job<'_>, run: &Run) -> Option<RowsNeeded> {
        if let Planning::AwaitsRows(_) = self.planning {
            let (_, next) = self.plans_ref();
            let is_at_rest = matches!(self.phase, Phase::Await | Phase::AwaitGoal(_));
            return run.rows_ahead(job, next.route.side).filter(|_| is_at_rest);
        }
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
        if let Planning::AwaitsRows(pass) = self.planning {
            self.planning = Planning::Requested(pass);
        } else {
            self.has_rows = true;
        }
    }

    /// Whether [`Self::rows_needed`] is to be asked.
    pub(crate) const fn may_wait_for_rows(&self) -> bool {
        !self.has_rows && !matches!(self.phase, Phase::Pass | Phase::Turn | Phase::Done)
    }

    /// Whether the tool is between passes.
    pub(crate) const fn is_link(&self) -> bool {
        !matches!(self.phase, Phase::Pass)
    }

    /// Whether the tool is on the surface, on a pass or between two.
    pub(in crate::sequence) const fn is_in_contact(&self) -> bool {
        match self.phase {
            Phase::Pass | Phase::StepOver => true,
            Phase::Await => self.on_surface,
            _ => false,
        }
    }

    /// Pass, path and side parameter of the fault of the next pass, if it stopped the run.
    pub(crate) fn fault_position(&self) -> Option<(u32, SpanParameter, SpanParameter)> {
        let [one, other] = &self.plans;
        let next = if self.second { one } else { other };
        self.pending.map(|_| self.lookahead.surface_position(next))
    }

    /// Retracts from rest to the safe height and ends there. Where the surface does not face up the tool stays.
    pub(crate) fn retract(&mut self, run: &Run) {
        let is_free = !self.is_in_contact() || run.faces_up();
        self.goal = Goal::SafeHeight;
        self.is_low = false;
        if is_free {
            self.await_goal(Leg::Retract);
        } else {
            self.phase = Phase::Done;
        }
    }

    /// Whether the next pass is planned.
    pub(super) fn is_planned(&self) -> bool {
        self.planning == Planning::Complete
    }

    /// Whether the tool can go on from the end of a pass.
    pub(super) fn knows_link(&self) -> bool {
        self.is_planned() && !self.has_to_plan_step_over() && !self.has_to_choose
    }

    /// Whether the tool would stand at the end of a pass, before a low link, for more than [`STAND_MAX`] periods, and can rise. For rows of a streamed job it stands: that
    /// time is not the job's.
    fn waits_long(&self, job: &Job<'_>) -> bool {
        let (now, next) = self.plans_ref();
        let is_long = match self.planning {
            Planning::Awaited(_) | Planning::Requested(_) | Planning::Stations => true,
            Planning::Feed => self.planner.is_walking() || self.planner.least_left(&next.plan) > STAND_MAX,
            Planning::AwaitsRows(_) | Planning::Complete => false,
        };
        let is_low = || {
            let axes = job.header.axes.as_ref();
            axes.is_some_and(|axes| job.link_to(now.pass.wrapping_add(1), axes).is_low())
        };
        is_long && self.on_surface && now.faces_up[1] && is_low()
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
            if !self.knows_link() {
                if self.waits_long(job) {
                    self.rise();
                }
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
                let link = (job.header.axes.as_ref())
                    .filter(|_| self.on_surface)
                    .map(|axes| job.link_to(next.pass, axes));
                self.is_low = link.is_some_and(|link| link.is_low());
                self.await_goal(match link {
                    Some(Link::Straight) => Leg::Plunge,
                    Some(Link::Around(_)) => Leg::Traverse,
                    _ => Leg::Retract,
                });
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
        self.spent_last = self.spent;
        if run.arrive_on_front() {
            (self.front_last, self.front_spent) = (self.front_spent, 0);
        }
        self.request_planning(planning);
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
            Planning::Awaited(_) | Planning::Requested(..) | Planning::AwaitsRows(_) | Planning::Stations
        );
        match self.phase {
            Phase::StepOver => Some(now),
            Phase::Turn => {
                let is_past = self.follower.arc_q10() >= now.tail_q10;
                Some(next).filter(|_| now.turns() && is_past && is_located)
            }
            Phase::Hop | Phase::Leg(_) | Phase::AwaitGoal(_) => {
                Some(next).filter(|_| self.goal == Goal::Pass && is_located)
            }
            // A step-over of no length ends in the tick that begins it.
            Phase::Await => Some(next).filter(|_| self.is_planned()),
            Phase::Pass | Phase::Lifted | Phase::Done => None,
        }
    }

    /// The greatest pace on the next pass, if it is planned and a turn leads there.
    fn next_pace(&self) -> Option<f32> {
        let (now, next) = self.plans_ref();
        (now.turns() && self.knows_next()).then(|| pace_on(next, self.feed_factor))
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

/// The greatest pace on a pass at this feed factor.
fn pace_on(pass: &PassPlan, share: f32) -> f32 {
    pass.pace(share).at_most(1.0).at_most(pass.plan.pace_max)
}
