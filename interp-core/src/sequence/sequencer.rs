//! The sequence of a job on a machine with limits: approach, passes from standstill to standstill, links, retract.
//!
//! While a pass runs, [`Sequencer::plan`], a portion after each tick, plans the next one ([`Lookahead`]); where the plan is not complete in time the
//! tool waits at the end of the pass. [`Profile`] computes the motion along every path: a pass, a straight leg off the surface, a step-over along
//! the boundary.

use crate::fault::{Fault, Result};
use crate::feed::QUANTA_PER_MM;
use crate::feed::plan::CELLS_STANDING;
use crate::feed::profile::Profile;
use crate::job::program::Job;
use crate::job::{AxisLimits, Pattern};
use crate::math::number::Bounded;
use crate::pass::position::PassPosition;
use crate::pass::run::Run;
use crate::sample::{Sample, SpanParameter};
use crate::sequence::link::{BoundaryStepOver, StraightMove, check_faces_up};
use crate::sequence::lookahead::{Lookahead, PassPlan, check_travel, top};

/// The portion of the planning in a period, processor cycles on a Cortex-M4F by the costs below.
const PORTION_CYCLES: u32 = 30_000;
/// Cost of a task of the look-ahead that collapses a patch, and of any other, cycles: no task was found to cost more than 1 800, by the pessimistic
/// model of `cargo sim budget --search`.
const PATCH_CYCLES: u32 = 3_700;
const TASK_CYCLES: u32 = 1_850;
/// Greatest number of tasks in a portion.
const TASKS_MAX: u32 = PORTION_CYCLES / TASK_CYCLES;

/// Phase of the sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The tool waits until the look-ahead has planned the next pass.
    AwaitPlan,
    /// Plans a step-over along the boundary.
    PlanStepOver,
    /// Follows the step-over.
    StepOver,
    /// Plans a leg, a straight move off the surface.
    PlanLeg(Leg),
    /// Computes the speed bounds of the leg.
    BoundLeg(Leg),
    /// Follows the leg.
    FollowLeg(Leg),
    /// The tool stands at the start of the next pass, whose first patch was collapsed in a separate tick.
    EnterPass,
    /// The tool is on a pass.
    FollowPass,
    /// The sequence is over.
    Done,
}

/// A straight leg off the surface, towards the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Leg {
    Retract,
    Traverse,
    Plunge,
}

/// The goal of a sequence of legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    /// The start of the next pass.
    Pass,
    /// The position at which the first run began.
    Home,
    /// The safe height, above the tool's position.
    SafeHeight,
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
}

/// The sequence of a job.
#[derive(Clone, Debug)]
pub(crate) struct Sequencer {
    phase: Phase,
    goal: Goal,
    lookahead: Lookahead,
    plans: [PassPlan; 2],
    /// The second plan is that of the current or last pass.
    second: bool,
    /// Whether the tool has been on a pass since the start.
    on_surface: bool,
    /// A fault of the next pass, reported when the tool reaches the pass.
    pending: Option<Fault>,
    profile: Profile,
    straight: StraightMove,
    step_over: BoundaryStepOver,
    /// Programmed speed of a leg or a step-over, units of 2^-10 nm per period.
    usual: f32,
    /// The tool's position, once it is known.
    at: Option<[i32; 3]>,
    /// Cell of the pass that the tool is in.
    cell: u16,
}

/// The plans of the current or last pass, and of the next.
const fn both(plans: &mut [PassPlan; 2], second: bool) -> (&mut PassPlan, &mut PassPlan) {
    let [one, other] = plans;
    if second { (other, one) } else { (one, other) }
}

impl Sequencer {
    /// State before the first run.
    pub(crate) const START: Self = Self {
        phase: Phase::Done,
        goal: Goal::Pass,
        lookahead: Lookahead::START,
        plans: [PassPlan::NONE; 2],
        second: false,
        on_surface: false,
        pending: None,
        profile: Profile::START,
        straight: StraightMove::NONE,
        step_over: BoundaryStepOver::NONE,
        usual: 0.0,
        at: None,
        cell: 0,
    };

    /// Starts the job from the tool's position.
    pub(crate) fn restart(&mut self, job: &Job<'_>, axes: &AxisLimits) {
        self.at.get_or_insert(axes.home_nm);
        self.phase = Phase::AwaitPlan;
        self.second = false;
        self.on_surface = false;
        self.pending = None;
        self.profile.begin(1);
        self.lookahead.restart();
        let (_, next) = both(&mut self.plans, self.second);
        self.lookahead.begin(job, 0, SpanParameter::default(), next);
    }

    /// The tool's position, nm, once it is known.
    pub(crate) const fn stands_nm(&self) -> Option<[i32; 3]> {
        self.at
    }

    /// Sets the tool's position, nm; none where it is unknown. Not within a run.
    pub(crate) const fn stand_at(&mut self, at_nm: Option<[i32; 3]>) {
        self.at = at_nm;
    }

    /// Whether the tool is at standstill, and stays so while the commanded speed is 0.
    pub(crate) const fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::StepOver | Phase::FollowLeg(_) | Phase::FollowPass => self.profile.is_at_rest(),
            Phase::AwaitPlan
            | Phase::PlanStepOver
            | Phase::PlanLeg(_)
            | Phase::BoundLeg(_)
            | Phase::EnterPass
            | Phase::Done => true,
        }
    }

    /// Whether the tool is between passes.
    pub(crate) const fn is_link(&self) -> bool {
        !matches!(self.phase, Phase::FollowPass)
    }

    /// Pass, path and side parameter of the fault of the next pass, if it stopped the run.
    pub(crate) fn fault_position(&self) -> Option<(u32, SpanParameter, SpanParameter)> {
        let [one, other] = &self.plans;
        let next = if self.second { one } else { other };
        self.pending.map(|_| self.lookahead.surface_position(next))
    }

    /// Retracts from standstill to the safe height and ends there. Where the surface does not face up the tool stays.
    pub(crate) fn retract(&mut self, run: &Run) {
        let is_free = self.is_link() || run.faces_up();
        self.goal = Goal::SafeHeight;
        self.phase = if is_free {
            Phase::PlanLeg(Leg::Retract)
        } else {
            Phase::Done
        };
    }

    /// One period at this feed factor, 0 to 2, into `last`. The phases off the passes are separate functions, so that a tick on a pass saves no
    /// registers for them.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is unchanged.
    #[inline(never)]
    pub(crate) fn tick(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        run: &mut Run,
        share: f32,
        last: &mut Sample,
    ) -> Result<Outcome> {
        let was_link = self.is_link();
        match self.phase {
            Phase::FollowPass => self.follow_pass(job, run, share, last)?,
            Phase::FollowLeg(leg) => self.follow_leg(leg, job, run, share, last)?,
            Phase::StepOver => self.follow_step_over(job, run, share, last)?,
            Phase::AwaitPlan => {
                self.await_plan(job)?;
                match self.at {
                    Some(at) if !self.on_surface => run.off_surface(at, 0.0, last),
                    _ => run.stand(last),
                }
            }
            Phase::PlanStepOver => {
                self.plan_step_over(job, axes, run, last)?;
            }
            Phase::PlanLeg(leg) => self.plan_leg(leg, job, axes, run, last)?,
            Phase::BoundLeg(leg) => {
                let (now, _) = both(&mut self.plans, self.second);
                if now.plan.work(CELLS_STANDING) {
                    self.profile.begin(now.plan.window);
                    self.phase = Phase::FollowLeg(leg);
                }
                run.stand(last);
            }
            Phase::EnterPass => self.begin_pass(job, run, last)?,
            Phase::Done => return Ok(Outcome::Finished),
        }
        self.at = Some(last.cl_nm);
        // The first and the last sample of a pass belong to the pass.
        Ok(if was_link && self.is_link() {
            Outcome::Link
        } else {
            Outcome::Pass
        })
    }

    /// Whether the plan of the next pass is incomplete.
    pub(crate) const fn has_to_plan(&self) -> bool {
        self.pending.is_none() && !self.lookahead.is_done()
    }

    /// The planning of one period: as many tasks of the look-ahead as fit into [`PORTION_CYCLES`].
    #[inline(never)]
    pub(crate) fn plan(&mut self, job: &Job<'_>, axes: &AxisLimits) {
        let mut left = PORTION_CYCLES;
        for _ in 0..TASKS_MAX {
            let cost = if self.lookahead.makes_patch() {
                PATCH_CYCLES
            } else {
                TASK_CYCLES
            };
            let Some(rest) = left.checked_sub(cost).filter(|_| self.has_to_plan()) else {
                return;
            };
            left = rest;
            let (_, next) = both(&mut self.plans, self.second);
            self.pending = self.lookahead.work(job, axes, next).err();
        }
    }

    /// Enters the next phase when the plan is complete.
    #[inline(never)]
    fn await_plan(&mut self, job: &Job<'_>) -> Result<()> {
        if let Some(fault) = self.pending {
            return Err(fault);
        }
        if !self.lookahead.is_done() {
            return Ok(());
        }
        let (now, next) = both(&mut self.plans, self.second);
        self.phase = if self.on_surface && job.header.pattern == Pattern::Zigzag {
            self.step_over = BoundaryStepOver::new(job, &last_patch(job, now), next.side);
            Phase::PlanStepOver
        } else {
            check_faces_up(next.faces_up[0] && (now.faces_up[1] || !self.on_surface))?;
            self.goal = Goal::Pass;
            Phase::PlanLeg(Leg::Retract)
        };
        Ok(())
    }

    /// Enters the next pass, which begins at the tool's position.
    #[inline(never)]
    fn enter_pass(&mut self, job: &Job<'_>, run: &mut Run, last: &mut Sample) -> Result<()> {
        let (_, next) = both(&mut self.plans, self.second);
        run.enter_pass(job, next.pass, next.side)?;
        run.stand(last);
        self.phase = Phase::EnterPass;
        Ok(())
    }

    /// Emits the first sample of the pass.
    #[inline(never)]
    fn begin_pass(&mut self, job: &Job<'_>, run: &mut Run, last: &mut Sample) -> Result<()> {
        let (_, next) = both(&mut self.plans, self.second);
        run.begin(next.interval, last)?;
        self.second = !self.second;
        self.on_surface = true;
        self.phase = Phase::FollowPass;
        self.cell = 0;
        let (now, next) = both(&mut self.plans, self.second);
        self.profile.begin(now.plan.window);
        if let Some(side) = now.next {
            self.lookahead.begin(job, now.pass.wrapping_add(1), side, next);
        }
        Ok(())
    }

    fn follow_pass(&mut self, job: &Job<'_>, run: &mut Run, share: f32, last: &mut Sample) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        let period = job.header.feed_mm_s * job.header.period_s * QUANTA_PER_MM;
        let is_over = if now.point {
            if share > 0.0 && run.is_along() {
                run.advance_far(job, 1.0, last)?;
            } else {
                run.stand(last);
            }
            !run.is_along()
        } else {
            let moved = self.profile.tick(&now.plan, share * period);
            if self.profile.is_done(&now.plan) {
                run.finish_pass(job, last)?;
                true
            } else if moved > 0 && run.is_along() {
                run.move_by(job, as_f32(moved) / period, last)?;
                self.correct_progress(job, run);
                false
            } else {
                run.stand(last);
                false
            }
        };
        if is_over {
            let (now, _) = both(&mut self.plans, self.second);
            self.phase = if now.next.is_some() {
                Phase::AwaitPlan
            } else {
                check_faces_up(now.faces_up[1])?;
                self.goal = Goal::Home;
                Phase::PlanLeg(Leg::Retract)
            };
        }
        Ok(())
    }

    /// Corrects the progress at each station by the plan's arc, so that errors do not accumulate from station to station.
    fn correct_progress(&mut self, job: &Job<'_>, run: &Run) {
        let (now, _) = both(&mut self.plans, self.second);
        let Some(cell) = run
            .cell(job, now.cells_per_patch)
            .filter(|cell| *cell != self.cell)
        else {
            return;
        };
        let Some(arc_mm) = run.since_station(now.cells_per_patch, now.cell_fraction) else {
            return;
        };
        self.cell = cell;
        let place = now.plan.start_of(cell) + crate::feed::plan::quanta(arc_mm);
        self.profile.shift(place - self.profile.place(), &now.plan);
    }

    #[inline(never)]
    fn plan_leg(
        &mut self,
        leg: Leg,
        job: &Job<'_>,
        axes: &AxisLimits,
        run: &mut Run,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, next) = both(&mut self.plans, self.second);
        let from = self.at.unwrap_or(axes.home_nm);
        let [x, y, z] = match self.goal {
            Goal::Pass => next.ends[0],
            Goal::Home => axes.home_nm,
            Goal::SafeHeight => from,
        };
        let height = from[2].max(axes.safe_z_nm);
        let to = match leg {
            Leg::Retract => [from[0], from[1], height],
            Leg::Traverse => [x, y, from[2]],
            Leg::Plunge => [x, y, z],
        };
        check_travel(axes, &to)?;
        let slow_mm = if leg == Leg::Plunge && self.goal == Goal::Pass {
            axes.plunge_mm
        } else {
            0.0
        };
        let feed = job.header.feed_mm_s;
        if let Some((straight, usual)) =
            StraightMove::new(from, to, slow_mm, feed, axes, job.header.period_s, &mut now.plan)
        {
            (self.straight, self.usual) = (straight, usual);
            self.phase = Phase::BoundLeg(leg);
            run.stand(last);
            return Ok(());
        }
        self.after_leg(leg, job, run, last)
    }

    /// Selects the next leg, or after the last leg the phase at the goal.
    fn after_leg(&mut self, leg: Leg, job: &Job<'_>, run: &mut Run, last: &mut Sample) -> Result<()> {
        self.phase = match (leg, self.goal) {
            (Leg::Retract, Goal::SafeHeight) | (Leg::Plunge, Goal::Home | Goal::SafeHeight) => Phase::Done,
            (Leg::Retract, _) => Phase::PlanLeg(Leg::Traverse),
            (Leg::Traverse, _) => Phase::PlanLeg(Leg::Plunge),
            (Leg::Plunge, Goal::Pass) => return self.enter_pass(job, run, last),
        };
        run.stand(last);
        Ok(())
    }

    #[inline(never)]
    fn follow_leg(
        &mut self,
        leg: Leg,
        job: &Job<'_>,
        run: &mut Run,
        share: f32,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        if self.profile.is_done(&now.plan) {
            return self.after_leg(leg, job, run, last);
        }
        let moved = self.profile.tick(&now.plan, self.usual * share.at_most(1.0));
        let at = self.straight.position(self.profile.place(), &now.plan);
        let speed = as_f32(moved) / (QUANTA_PER_MM * job.header.period_s);
        run.off_surface(at, speed, last);
        Ok(())
    }

    #[inline(never)]
    fn plan_step_over(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        run: &mut Run,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        let patch = &mut self.lookahead.patch;
        match self.step_over.work(job, axes, patch, &top(job), &mut now.plan)? {
            None => return self.enter_pass(job, run, last),
            Some(false) => {}
            Some(true) => {
                self.phase = Phase::StepOver;
                self.profile.begin(now.plan.window);
                self.usual =
                    self.step_over.per_contact() * job.header.feed_mm_s * job.header.period_s * QUANTA_PER_MM;
            }
        }
        run.stand(last);
        Ok(())
    }

    #[inline(never)]
    fn follow_step_over(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        share: f32,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        if self.profile.is_done(&now.plan) {
            return self.enter_pass(job, run, last);
        }
        let moved = self.profile.tick(&now.plan, self.usual * share);
        let patch = &mut self.lookahead.patch;
        let located = self
            .step_over
            .position(job, patch, self.profile.place(), &now.plan)?;
        let speed = as_f32(moved) / (QUANTA_PER_MM * job.header.period_s * self.step_over.per_contact());
        run.off_surface(located.cl_nm, speed, last);
        last.cc_nm = located.cc_nm;
        Ok(())
    }
}

/// The last patch of a pass.
fn last_patch(job: &Job<'_>, pass: &PassPlan) -> PassPosition {
    let reversed = job.header.pattern == Pattern::Zigzag && pass.pass % 2 == 1;
    PassPosition {
        side: pass.side,
        reversed,
        span: if reversed {
            0
        } else {
            job.header.path_spans.saturating_sub(1)
        },
    }
}

#[allow(
    clippy::cast_precision_loss,
    reason = "a step beyond 2^24 units of 2^-10 nm, 16 um, is rounded"
)]
const fn as_f32(moved: i32) -> f32 {
    moved as f32
}
