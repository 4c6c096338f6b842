//! The tool in a turn from pass to pass: the same plan's first or last part, off the surface.

use super::lookahead::PassPlan;
use super::sequencer::Sequencer;
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::plan::{Cursor, Plan};
use crate::feed::road::Road;
use crate::feed::turn::Turn;
use crate::job::program::Job;
use crate::math::number::Bounded;
use crate::pass::run::Run;
use crate::sample::Sample;

/// Changes of the pace below this are ignored.
const SAME: f32 = 1e-4;

/// Where a plan's arc is: in the half turn before the pass or after it at this arc of the turn, or on the pass; units of 2^-10 nm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Turn(i64),
    Pass,
}

impl PassPlan {
    /// Whether a turn leads to the next pass.
    pub(super) fn turns(&self) -> bool {
        self.tail.exists()
    }

    /// The part of the path at an arc. `head`: the turn before the pass.
    pub(super) fn part(&self, arc_q10: i64, head: &Turn) -> Part {
        if arc_q10 < self.head_q10 {
            Part::Turn(arc_q10 + head.half_q10())
        } else if self.turns() && arc_q10 >= self.tail_q10 {
            Part::Turn(arc_q10 - self.tail_q10)
        } else {
            Part::Pass
        }
    }
}

/// The plans ahead of the tool.
pub(super) fn road<'a>(now: &'a Plan, next: Option<&'a Plan>, next_pace: f32, stops: bool) -> Road<'a> {
    Road {
        now,
        next: next.filter(|_| now.goes_on()),
        next_pace,
        stops,
    }
}

impl Sequencer {
    /// The pace that is wanted before a turn: that of both passes, or a stop where the next is not planned in time.
    pub(super) fn pace_before_turn(&mut self, wanted: f32, next_pace: Option<f32>) -> f32 {
        let (now, next) = self.plans_ref();
        let next_most = next.plan.pace_max + SAME;
        // Faster than planned is possible where the whole pace is.
        let wanted = if now.plan.pace_max < 1.0 {
            wanted.at_most(now.plan.pace_max)
        } else {
            wanted
        };
        if !now.turns() {
            return wanted;
        }
        let is_past = now.plan.is_past_gate(&self.follower.cursor);
        let (gate, greatest) = (now.plan.gate, now.plan.pace_max);
        let pace = self.pace.now();
        let goes_on = next_pace.is_some() && (self.pace.is_changing() || self.pace.goal() <= next_most);
        if is_past && !goes_on && self.pace.goal() > 0.0 {
            // Slower than the greatest pace, the same stop takes longer.
            self.pace
                .stop_within(gate.duration * greatest / pace.at_least(1e-3));
        }
        match next_pace {
            Some(next) if next < 1.0 => wanted.at_most(next),
            Some(_) => wanted,
            None if is_past => 0.0,
            None => wanted,
        }
    }

    /// One period in a turn, into `last`.
    pub(super) fn emit_turn(&self, turn: &Turn, arc_q10: i64, run: &mut Run, last: &mut Sample) {
        let (now, _) = self.plans_ref();
        let speed = self.pace.now() * self.follower.cursor.speed(&now.plan);
        run.off_surface(turn.position_at(arc_q10), turn.speed_at(arc_q10, speed), last);
    }

    /// The tool has crossed the apex: the next plan is followed, from what is left of the period on.
    pub(super) fn cross_apex(&mut self, job: &Job<'_>, run: &mut Run) -> Result<()> {
        // By the last stop before the apex the tool stands where the next plan is not complete.
        if !self.knows_next() {
            return Err(Fault::new(FaultKind::PatchTooShort, 0.0));
        }
        let (now, _) = self.plans_ref();
        let beyond = now.plan.beyond(&self.follower.cursor);
        self.turn = now.tail;
        self.swap(run);
        let (now, _) = self.plans_ref();
        run.arrive(job, now.pass, now.route, now.interval)?;
        let mut follower = self.follower;
        follower.begin(&now.plan);
        follower.tick(&now.plan, beyond / job.header.period_s);
        self.follower = follower;
        self.pace.relocate(Cursor::come_near);
        self.start_pass(job);
        Ok(())
    }
}
