//! A job's course on a machine that has limits: approach, passes from standstill to standstill, links, retract.
//!
//! While a pass runs, the next one is looked over, a portion a tick ([`Lookahead`]), in ticks that have little else to do; where that is not
//! done in time the tool waits at the end of the pass. A path is followed by [`Profile`], whatever it is: a pass, a leg in the open,
//! a step along the boundary.

use crate::fault::{Fault, Result};
use crate::feed::QUANTA_PER_MM;
use crate::feed::plan::CELLS_STANDING;
use crate::feed::profile::Profile;
use crate::job::program::Job;
use crate::job::{Axes, Pattern};
use crate::math::number::Bounded;
use crate::pass::position::Line;
use crate::pass::run::Run;
use crate::sample::{Place, Sample};
use crate::sequence::link::{Leg, Step, check_up};
use crate::sequence::lookahead::{Lookahead, PassPlan, check_travel, top};

/// Portions of the look ahead in a tick in which the tool waits for it.
const PORTIONS_WAITING: u8 = 2;

/// Where the course is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Waits for the next pass to be looked over, to go there.
    Wait,
    /// Plans a step along the boundary; goes it.
    StepPlan,
    Step,
    /// Plans a leg; goes it.
    LegPlan(Way),
    LegBounds(Way),
    Leg(Way),
    /// At the start of the next pass, whose first patch is made: that is a tick's work.
    Enter,
    Pass,
    /// Behind all.
    End,
}

/// A leg in the open, on the way to the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    Up,
    Over,
    Down,
}

/// What the legs in the open lead to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Goal {
    /// The start of the next pass.
    Pass,
    /// Where the first run began.
    Home,
    /// The safe height, above where the tool is.
    Clear,
}

/// What a tick came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// On a pass.
    Pass,
    /// Between passes.
    Link,
    /// The last sample is out.
    Finished,
}

/// The course of a job.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    phase: Phase,
    goal: Goal,
    lookahead: Lookahead,
    plans: [PassPlan; 2],
    /// The pass that the tool is on, or was, is the second.
    second: bool,
    /// The tool has been on a pass since the start.
    on_surface: bool,
    /// What was found wrong with the next pass: for when the tool gets there.
    pending: Option<Fault>,
    profile: Profile,
    leg: Leg,
    step: Step,
    /// Speed that is wanted of a leg or a step as a rule, quanta a period.
    usual: f32,
    /// Where the tool is, once that is known.
    at: Option<[i32; 3]>,
    /// Cell of the pass that the tool is in.
    cell: u16,
}

/// The plan of the pass that the tool is on or was, and of the next.
const fn both(plans: &mut [PassPlan; 2], second: bool) -> (&mut PassPlan, &mut PassPlan) {
    let [one, other] = plans;
    if second { (other, one) } else { (one, other) }
}

impl Course {
    /// Before anything.
    pub(crate) const START: Self = Self {
        phase: Phase::End,
        goal: Goal::Pass,
        lookahead: Lookahead::START,
        plans: [PassPlan::NONE; 2],
        second: false,
        on_surface: false,
        pending: None,
        profile: Profile::START,
        leg: Leg::NONE,
        step: Step::NONE,
        usual: 0.0,
        at: None,
        cell: 0,
    };

    /// To the beginning of the job, from where the tool is.
    pub(crate) fn restart(&mut self, job: &Job<'_>, axes: &Axes) {
        self.at.get_or_insert(axes.home_nm);
        self.phase = Phase::Wait;
        self.second = false;
        self.on_surface = false;
        self.pending = None;
        self.profile.begin(1);
        self.lookahead.restart();
        let (_, next) = both(&mut self.plans, self.second);
        self.lookahead.begin(job, 0, Place::default(), next);
    }

    /// Where the tool is, nm, once that is known.
    pub(crate) const fn stands_nm(&self) -> Option<[i32; 3]> {
        self.at
    }

    /// The tool was brought here, nm, or nobody knows where it is. Not within a run.
    pub(crate) const fn stand_at(&mut self, at_nm: Option<[i32; 3]>) {
        self.at = at_nm;
    }

    /// Whether the tool stands, and will while no speed is wanted.
    pub(crate) const fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::Step | Phase::Leg(_) | Phase::Pass => self.profile.is_at_rest(),
            Phase::Wait
            | Phase::StepPlan
            | Phase::LegPlan(_)
            | Phase::LegBounds(_)
            | Phase::Enter
            | Phase::End => true,
        }
    }

    /// Whether the tool is between passes.
    pub(crate) const fn is_link(&self) -> bool {
        !matches!(self.phase, Phase::Pass)
    }

    /// Pass, path and side place of what was found wrong with the next pass, if that is what stopped the run.
    pub(crate) fn place(&self) -> Option<(u32, Place, Place)> {
        let [one, other] = &self.plans;
        let next = if self.second { one } else { other };
        self.pending.map(|_| self.lookahead.place(next))
    }

    /// From standstill, up to the safe height, and no further. Where the surface does not face up there is no way, and the tool stays.
    pub(crate) fn leave(&mut self, run: &Run) {
        let is_free = self.is_link() || run.faces_up();
        self.goal = Goal::Clear;
        self.phase = if is_free {
            Phase::LegPlan(Way::Up)
        } else {
            Phase::End
        };
    }

    /// One period at this share of the feed, 0 to 2, into `last`. What the phases but that of a pass do is out of line, so that a pass does not
    /// save registers for it.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is as it was.
    #[inline(never)]
    pub(crate) fn tick(
        &mut self,
        job: &Job<'_>,
        axes: &Axes,
        run: &mut Run,
        share: f32,
        last: &mut Sample,
    ) -> Result<Outcome> {
        let was_link = self.is_link();
        match self.phase {
            Phase::Pass => self.on_pass(job, axes, run, share, last)?,
            Phase::Leg(way) => self.on_leg(way, job, run, share, last)?,
            Phase::Step => self.on_step(job, run, share, last)?,
            Phase::Wait => {
                self.wait(job, axes)?;
                match self.at {
                    Some(at) if !self.on_surface => run.off_surface(at, 0.0, last),
                    _ => run.stand(last),
                }
            }
            Phase::StepPlan => {
                self.plan_step(job, axes, run, last)?;
            }
            Phase::LegPlan(way) => self.plan_leg(way, job, axes, run, last)?,
            Phase::LegBounds(way) => {
                let (now, _) = both(&mut self.plans, self.second);
                if now.plan.work(CELLS_STANDING) {
                    self.profile.begin(now.plan.window);
                    self.phase = Phase::Leg(way);
                }
                run.stand(last);
            }
            Phase::Enter => self.begin_pass(job, run, last)?,
            Phase::End => return Ok(Outcome::Finished),
        }
        self.at = Some(last.cl_nm);
        // The last sample of a pass is one of it, and so is the first.
        Ok(if was_link && self.is_link() {
            Outcome::Link
        } else {
            Outcome::Pass
        })
    }

    /// Some portions of the look ahead, and on when it is done.
    #[inline(never)]
    fn wait(&mut self, job: &Job<'_>, axes: &Axes) -> Result<()> {
        for _ in 0..PORTIONS_WAITING {
            // A patch is a tick's work.
            let is_patch = self.lookahead.makes_patch();
            self.look_ahead(job, axes);
            if is_patch || self.lookahead.makes_patch() {
                break;
            }
        }
        if let Some(fault) = self.pending {
            return Err(fault);
        }
        if !self.lookahead.is_done() {
            return Ok(());
        }
        let (now, next) = both(&mut self.plans, self.second);
        self.phase = if self.on_surface && job.header.pattern == Pattern::Zigzag {
            self.step = Step::new(job, &run_end(job, now), next.side);
            Phase::StepPlan
        } else {
            check_up(next.up[0] && (now.up[1] || !self.on_surface))?;
            self.goal = Goal::Pass;
            Phase::LegPlan(Way::Up)
        };
        Ok(())
    }

    /// One portion of the look ahead.
    fn look_ahead(&mut self, job: &Job<'_>, axes: &Axes) {
        if self.pending.is_some() || self.lookahead.is_done() {
            return;
        }
        let (_, next) = both(&mut self.plans, self.second);
        self.pending = self.lookahead.work(job, axes, next).err();
    }

    /// On to the next pass, which begins here.
    #[inline(never)]
    fn enter_pass(&mut self, job: &Job<'_>, run: &mut Run, last: &mut Sample) -> Result<()> {
        let (_, next) = both(&mut self.plans, self.second);
        run.enter(job, next.pass, next.side)?;
        run.stand(last);
        self.phase = Phase::Enter;
        Ok(())
    }

    /// Its first sample.
    #[inline(never)]
    fn begin_pass(&mut self, job: &Job<'_>, run: &mut Run, last: &mut Sample) -> Result<()> {
        let (_, next) = both(&mut self.plans, self.second);
        run.begin(next.interval, last)?;
        self.second = !self.second;
        self.on_surface = true;
        self.phase = Phase::Pass;
        self.cell = 0;
        let (now, next) = both(&mut self.plans, self.second);
        self.profile.begin(now.plan.window);
        if let Some(side) = now.next {
            self.lookahead.begin(job, now.pass.wrapping_add(1), side, next);
        }
        Ok(())
    }

    fn on_pass(
        &mut self,
        job: &Job<'_>,
        axes: &Axes,
        run: &mut Run,
        share: f32,
        last: &mut Sample,
    ) -> Result<()> {
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
                let is_light = run.move_by(job, as_f32(moved) / period, last)?;
                self.settle_place(job, run);
                if is_light {
                    self.look_ahead(job, axes);
                }
                false
            } else {
                run.stand(last);
                self.look_ahead(job, axes);
                false
            }
        };
        if is_over {
            let (now, _) = both(&mut self.plans, self.second);
            self.phase = if now.next.is_some() {
                Phase::Wait
            } else {
                check_up(now.up[1])?;
                self.goal = Goal::Home;
                Phase::LegPlan(Way::Up)
            };
        }
        Ok(())
    }

    /// The arc up to a station is known from the plan: what adds up between stations does not go on.
    fn settle_place(&mut self, job: &Job<'_>, run: &Run) {
        let (now, _) = both(&mut self.plans, self.second);
        let Some(cell) = run.cell(job, now.parts).filter(|cell| *cell != self.cell) else {
            return;
        };
        let Some(arc_mm) = run.since_station(now.parts, now.part) else {
            return;
        };
        self.cell = cell;
        let place = now.plan.start_of(cell) + crate::feed::plan::quanta(arc_mm);
        self.profile.shift(place - self.profile.place(), &now.plan);
    }

    #[inline(never)]
    fn plan_leg(
        &mut self,
        way: Way,
        job: &Job<'_>,
        axes: &Axes,
        run: &mut Run,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, next) = both(&mut self.plans, self.second);
        let from = self.at.unwrap_or(axes.home_nm);
        let [x, y, z] = match self.goal {
            Goal::Pass => next.ends[0],
            Goal::Home => axes.home_nm,
            Goal::Clear => from,
        };
        let height = from[2].max(axes.safe_z_nm);
        let to = match way {
            Way::Up => [from[0], from[1], height],
            Way::Over => [x, y, from[2]],
            Way::Down => [x, y, z],
        };
        check_travel(axes, &to)?;
        let slow_mm = if way == Way::Down && self.goal == Goal::Pass {
            axes.plunge_mm
        } else {
            0.0
        };
        let feed = job.header.feed_mm_s;
        if let Some((leg, usual)) =
            Leg::new(from, to, slow_mm, feed, axes, job.header.period_s, &mut now.plan)
        {
            (self.leg, self.usual) = (leg, usual);
            self.phase = Phase::LegBounds(way);
            run.stand(last);
            return Ok(());
        }
        self.after_leg(way, job, run, last)
    }

    /// Behind a leg, the next one; behind the last, what it led to.
    fn after_leg(&mut self, way: Way, job: &Job<'_>, run: &mut Run, last: &mut Sample) -> Result<()> {
        self.phase = match (way, self.goal) {
            (Way::Up, Goal::Clear) | (Way::Down, Goal::Home | Goal::Clear) => Phase::End,
            (Way::Up, _) => Phase::LegPlan(Way::Over),
            (Way::Over, _) => Phase::LegPlan(Way::Down),
            (Way::Down, Goal::Pass) => return self.enter_pass(job, run, last),
        };
        run.stand(last);
        Ok(())
    }

    #[inline(never)]
    fn on_leg(
        &mut self,
        way: Way,
        job: &Job<'_>,
        run: &mut Run,
        share: f32,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        if self.profile.is_done(&now.plan) {
            return self.after_leg(way, job, run, last);
        }
        let moved = self.profile.tick(&now.plan, self.usual * share.at_most(1.0));
        let at = self.leg.at(self.profile.place(), &now.plan);
        let speed = as_f32(moved) / (QUANTA_PER_MM * job.header.period_s);
        run.off_surface(at, speed, last);
        Ok(())
    }

    #[inline(never)]
    fn plan_step(&mut self, job: &Job<'_>, axes: &Axes, run: &mut Run, last: &mut Sample) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        let patch = &mut self.lookahead.patch;
        match self.step.work(job, axes, patch, &top(job), &mut now.plan)? {
            None => return self.enter_pass(job, run, last),
            Some(false) => {}
            Some(true) => {
                self.phase = Phase::Step;
                self.profile.begin(now.plan.window);
                self.usual =
                    self.step.per_contact() * job.header.feed_mm_s * job.header.period_s * QUANTA_PER_MM;
            }
        }
        run.stand(last);
        Ok(())
    }

    #[inline(never)]
    fn on_step(&mut self, job: &Job<'_>, run: &mut Run, share: f32, last: &mut Sample) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        if self.profile.is_done(&now.plan) {
            return self.enter_pass(job, run, last);
        }
        let moved = self.profile.tick(&now.plan, self.usual * share);
        let patch = &mut self.lookahead.patch;
        let located = self.step.at(job, patch, self.profile.place(), &now.plan)?;
        let speed = as_f32(moved) / (QUANTA_PER_MM * job.header.period_s * self.step.per_contact());
        run.off_surface(located.cl_nm, speed, last);
        last.cc_nm = located.cc_nm;
        Ok(())
    }
}

/// The last patch of a pass.
fn run_end(job: &Job<'_>, pass: &PassPlan) -> Line {
    let reversed = job.header.pattern == Pattern::Zigzag && pass.pass % 2 == 1;
    Line {
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
    reason = "a step beyond 2^24 quanta, 16 um, needs no last digit"
)]
const fn as_f32(moved: i32) -> f32 {
    moved as f32
}
