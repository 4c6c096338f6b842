//! The tool on a pass: its periods, the correction of its progress, its end.

use super::{FeedCommand, Phase, Planning, Sequencer, both, pace_on};
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::MM_PER_Q10;
use crate::feed::follow::Follower;
use crate::feed::limits::MotionLimits;
use crate::feed::plan::Plan;
use crate::job::program::Job;
use crate::math::number::{Bounded, to_f32};
use crate::pass::run::Run;
use crate::sample::Sample;
use crate::sequence::legs::{Goal, Leg};
use crate::sequence::link::check_faces_up;
use crate::sequence::turning::Part;

/// Arc before the end of a pass from which on the progress is corrected in each period, units of 2^-10 nm, and the part of the difference that is taken
/// in a period: a twelfth of 0.15 um takes 3 % of the jerk limit.
const END_Q10: i64 = 300_000 << 10;
const END_PARTS: i64 = 12;
/// The part of the difference at a station that is taken in a period, and what is taken at once, units of 2^-10 nm: the plan's speed is another there.
const PARTS: i64 = 8;
const AT_ONCE_Q10: i64 = 1 << 10;

impl Sequencer {
    /// Enters the pass, which begins at the tool's position, and emits its first sample.
    #[inline(never)]
    pub(in crate::sequence) fn enter_pass(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        let (now, _) = both(&mut self.plans, self.second);
        run.enter_pass(job, now.pass, now.route)?;
        run.begin(now.interval, last)?;
        let [at_boundary, _] = now.route.reach_boundaries(job);
        if !at_boundary {
            run.forget_first();
        }
        self.on_surface = true;
        self.is_low = false;
        self.phase = Phase::Pass;
        self.follower.begin(&now.plan);
        let pace = pace_on(now, command.feed_factor);
        self.pace.begin(pace, job.header.period_s);
        self.start_pass(job);
        Ok(())
    }

    /// Resets what belongs to a pass, and requests the link to the next one.
    pub(in crate::sequence) fn start_pass(&mut self, job: &Job<'_>) {
        self.has_first_patch = true;
        self.passed = 0.0;
        self.forget_step();
        let (now, _) = both(&mut self.plans, self.second);
        self.cell = [0; 2];
        self.correction = None;
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

    pub(super) fn follow_pass(
        &mut self,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        self.correct_once(run);
        let (now, _) = both(&mut self.plans, self.second);
        let is_over = if now.is_tip {
            run.stand(last);
            command.feed_factor > 0.0
        } else if now.point {
            if command.feed_factor > 0.0 && run.is_along() {
                run.advance_far(job, 1.0, last)?;
            } else {
                run.stand(last);
            }
            !run.is_along()
        } else {
            let wanted = now.pace(command.feed_factor).at_most(self.wait_pace);
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
            self.passed += pace;
            let moved = self.step_along_plan(pace);
            let (now, _) = both(&mut self.plans, self.second);
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
            self.goal = Goal::End;
            self.await_goal(Leg::Retract);
        } else if stays {
            self.phase = Phase::Await;
        } else {
            check_faces_up(now.faces_up[1])?;
            self.goal = Goal::Pass;
            // Planning never delays the lift: what is not planned yet is waited for above the surface.
            let is_planned = self.pending.is_none() && self.planning == Planning::Complete;
            let is_low = (job.header.axes.as_ref())
                .is_some_and(|axes| job.link_to(now.pass.wrapping_add(1), axes).is_low());
            if is_low {
                // It would take longer to rise to the safe height than to wait.
                self.phase = Phase::Await;
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

    /// Corrects the progress at each station by the plan's arc, so that errors do not accumulate from station to station: in the period after it was
    /// measured.
    pub(super) fn correct_progress(&mut self, run: &Run) {
        let (now, _) = both(&mut self.plans, self.second);
        if self.phase != Phase::Pass || now.point {
            return;
        }
        if self.correct_to_end(run) {
            return;
        }
        let (now, _) = both(&mut self.plans, self.second);
        let Some(cell) = run
            .cell(|patch| now.cells_of(patch))
            .filter(|cell| *cell != self.cell)
        else {
            self.correct_in_part();
            return;
        };
        self.cell = cell;
        let arc = match now.route.is_on_front() {
            true => now.arc_at_piece_q10(cell[0]),
            false => now.arc_q10(cell),
        };
        let kept = (now.cells_of(cell[0]), now.cell_fraction());
        let (Some(start_q10), Some(since_mm)) = (arc, run.since_station(cell, kept)) else {
            return;
        };
        let arc_q10 = start_q10 + crate::feed::to_q10(since_mm);
        self.correction = Some(arc_q10 - self.follower.arc_q10());
    }

    /// Applies a part of the correction that was measured.
    fn correct_in_part(&mut self) {
        let (now, _) = both(&mut self.plans, self.second);
        let Some(apart_q10) = self.correction else {
            return;
        };
        let part_q10 = if apart_q10.abs() > AT_ONCE_Q10 {
            apart_q10 / PARTS
        } else {
            apart_q10
        };
        let left_q10 = apart_q10 - self.follower.correct(&now.plan, part_q10);
        self.correction = Some(left_q10).filter(|left| *left != 0);
    }

    /// Corrects the progress by the arc left, near the end of a pass: what is left of the stations' error would be in the last step. On a front they are far apart;
    /// where the ball goes around an edge, the centre moves by many times that error. Returns whether it is near.
    #[inline(never)]
    fn correct_to_end(&mut self, run: &Run) -> bool {
        let (now, _) = both(&mut self.plans, self.second);
        let end_q10 = if now.turns() {
            now.tail_q10
        } else {
            now.plan.length_q10()
        };
        let left_q10 = end_q10 - self.follower.arc_q10();
        if left_q10 >= END_Q10 {
            return false;
        }
        let Some(left_mm) = run.arc_left() else {
            return false;
        };
        let apart_q10 = left_q10 - crate::feed::to_q10(left_mm);
        self.correction = None;
        self.follower.correct(&now.plan, apart_q10 / END_PARTS);
        true
    }
}

/// Greatest length left at the end of a plan, mm, or as a share of what a period at the jerk limit makes of it.
const END_MAX_MM: f32 = 1e-3;
const END_MAX_SHARE: f32 = 0.25;

/// Least move of a period, mm: a millionth of a nanometre is rounding.
pub(super) const MOVED_MIN: f32 = 1e-12;

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
