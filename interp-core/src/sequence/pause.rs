//! A pause that leaves the surface: up from wherever the tool stands to the safe height, and by the next resume back to the same place.
//!
//! Both ways are legs, so they obey hold, abort and override. What is left, a pass, a turn, a hop or a step-over, keeps its own progress, which is at rest, and goes on as after
//! a hold. A leg between passes is not left but planned anew from above: it leads to the same goal.

use crate::pass::run::Run;
use crate::sequence::legs::{Goal, Leg};
use crate::sequence::sequencer::{Phase, Sequencer};

/// Where a pause leads back to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Return {
    /// What the tool was on, and its goal.
    pub(super) phase: Phase,
    goal: Goal,
    /// Its position, nm.
    pub(super) at: [i32; 3],
}

impl Return {
    pub(super) const NONE: Self = Self {
        phase: Phase::Done,
        goal: Goal::Pass,
        at: [0; 3],
    };
}

impl Sequencer {
    /// Whether the tool is held above the place that a pause has led away from.
    pub(crate) fn is_lifted(&self) -> bool {
        self.phase == Phase::Lifted
    }

    /// Retracts from rest to the safe height, to wait there. False where the tool stays: the surface does not face up, or nothing is under way.
    pub(crate) fn lift(&mut self, run: &Run) -> bool {
        let stays =
            matches!(self.phase, Phase::Lifted | Phase::Done) || (self.is_in_contact() && !run.faces_up());
        let Some(at) = self.at.filter(|_| !stays) else {
            return false;
        };
        let is_leg = matches!(self.phase, Phase::Leg(_) | Phase::AwaitGoal(_));
        // On its way up or back it is to come back to where it was.
        if !(is_leg && matches!(self.goal, Goal::Above | Goal::Lift | Goal::Back)) {
            self.back = Return {
                phase: self.phase,
                goal: self.goal,
                at,
            };
        }
        // From above it goes across and down.
        self.is_low = false;
        self.goal = Goal::Lift;
        self.await_goal(Leg::Retract);
        true
    }

    /// Rises from the end of a pass, to wait a little above it.
    pub(super) fn rise(&mut self) {
        if let Some(at) = self.at {
            self.back = Return {
                phase: Phase::Await,
                goal: Goal::Pass,
                at,
            };
            self.goal = Goal::Above;
            self.await_goal(Leg::Retract);
        }
    }

    /// Leads a tool that is lifted back to where it was, or on towards the goal that it had.
    pub(crate) const fn come_back(&mut self) {
        if !matches!(self.phase, Phase::Lifted) {
            return;
        }
        match self.back.phase {
            Phase::Leg(_) | Phase::AwaitGoal(_) => {
                self.goal = self.back.goal;
                self.await_goal(Leg::Retract);
            }
            _ => {
                self.goal = Goal::Back;
                self.await_goal(Leg::Plunge);
            }
        }
    }
}
