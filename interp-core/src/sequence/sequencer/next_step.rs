//! What the next tick on a pass needs of the feed, computed in the planning of the period before it.
//!
//! Once a tick is over, all is known that the next one begins with, except the command that may come with it: the correction of the progress, the pace, and with it the
//! step along the plan. A step that was prepared for another pace than the tick then has is dropped, and the tick computes its own. So the samples are the
//! same whether a step was prepared or not.

use super::{Phase, Sequencer};
use crate::feed::follow::Follower;
use crate::job::program::Job;
use crate::math::number::Bounded;
use crate::pass::run::Run;

/// A step along the plan.
#[derive(Clone, Debug)]
pub(super) struct NextStep {
    /// The pace that it is for.
    pace: f32,
    /// The follower after it, and the arc that the tool moves by, mm.
    follower: Follower,
    moved: f32,
}

impl Sequencer {
    /// Whether [`Self::prepare_step`] has anything to do.
    pub(super) fn has_step_to_prepare(&self) -> bool {
        match self.phase {
            Phase::Pass | Phase::Turn => {
                let stands = self.is_corrected && self.pace.is_at_rest();
                self.next_step.is_none() && !stands && !self.plans_ref().0.point
            }
            Phase::StepOver => !self.step_over.is_ahead(),
            Phase::Await => self.is_before_step_over() && !self.step_over.is_ahead(),
            _ => false,
        }
    }

    /// Whether a step-over begins with the next tick.
    fn is_before_step_over(&self) -> bool {
        let waits = !self.is_planned() || self.has_to_plan_step_over() || self.has_to_choose;
        let steps = self.on_surface && self.plans_ref().0.steps_over && !self.step_over.is_nothing();
        steps && !waits && self.pending.is_none()
    }

    /// Prepares the step of the next tick.
    #[inline(never)]
    pub(super) fn prepare_step(&mut self, job: &Job<'_>, run: &mut Run) {
        if !self.has_step_to_prepare() {
            return;
        }
        match self.phase {
            Phase::Pass | Phase::Turn => self.prepare_on_pass(job, run),
            Phase::StepOver => self.step_over.locate_ahead(job, &self.profiles),
            _ => {
                let pace = self.feed_factor * job.header.feed_mm_s / self.step_over.feed();
                self.step_over.locate_first(job, pace.at_most(1.0));
            }
        }
    }

    /// Corrects the progress, and prepares the step along the plan and the move.
    fn prepare_on_pass(&mut self, job: &Job<'_>, run: &mut Run) {
        self.correct_once(run);
        self.is_corrected = true;
        let pace = self.pace.next(&self.profiles);
        if !(pace > 0.0) {
            return;
        }
        let mut follower = self.follower;
        let (now, _) = self.plans_ref();
        let moved = follower.tick(&now.plan, pace);
        let stays = !follower.is_over(&now.plan) && !now.turns();
        self.next_step = Some(NextStep {
            pace,
            follower,
            moved,
        });
        if stays && moved > super::on_pass::MOVED_MIN {
            run.move_ahead(job, moved / (job.header.feed_mm_s * job.header.period_s));
        }
    }

    /// Corrects the progress, unless that is done since the last tick on the pass.
    pub(super) fn correct_once(&mut self, run: &Run) {
        if !core::mem::take(&mut self.is_corrected) {
            self.correct_progress(run);
        }
    }

    /// A period at this pace along the plan: the arc that the tool moves by, mm.
    pub(super) fn step_along_plan(&mut self, pace: f32) -> f32 {
        let next = self.next_step.take();
        if !(pace > 0.0) {
            return 0.0;
        }
        match next {
            Some(next) if next.pace.to_bits() == pace.to_bits() => {
                self.follower = next.follower;
                next.moved
            }
            _ => {
                let (now, _) = super::both(&mut self.plans, self.second);
                self.follower.tick(&now.plan, pace)
            }
        }
    }

    /// Drops what is prepared.
    pub(super) fn forget_step(&mut self) {
        self.next_step = None;
        self.is_corrected = false;
    }
}
