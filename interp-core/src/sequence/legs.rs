//! Straight legs off the surface: retract, traverse, plunge. Each is planned in the planning of the period before it begins.

use crate::fault::{Fault, Result};
use crate::job::AxisLimits;
use crate::job::links::Link;
use crate::job::program::Job;
use crate::math::number::Bounded;
use crate::pass::run::Run;
use crate::sample::Sample;
use crate::sequence::link::check_faces_up;
use crate::sequence::lookahead::check_travel;
use crate::sequence::sequencer::{FeedCommand, Phase, Planning, Sequencer, both};

/// How far the tool rises from the end of a pass to wait for the planning of the next one, nm.
const ABOVE_NM: i32 = 300_000;
/// What counts as straight above, nm.
const BESIDE_NM: u32 = 1_000;

/// A straight leg off the surface, towards the goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leg {
    Retract,
    Traverse,
    Plunge,
}

/// The goal of a sequence of legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Goal {
    /// The start of the next pass.
    Pass,
    /// The end of the run: home, or where the job ends instead.
    End,
    /// The safe height, above the tool's position.
    SafeHeight,
    /// The same, to wait there.
    Lift,
    /// A little above the end of a pass, and back when the next one is planned.
    Above,
    /// The place that a pause has led away from.
    Back,
}

/// Planning of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LegPlanning {
    /// It begins once the goal is known.
    Requested,
    /// The leg can begin.
    Complete,
    /// The leg must not begin.
    Refused(Fault),
}

/// Whether a place is straight above another: up to a micrometre, for a place in the coordinates of a work offset.
fn is_above(place: &[i32; 3], other: &[i32; 3]) -> bool {
    let ([x, y, z], [other_x, other_y, other_z]) = (place, other);
    x.abs_diff(*other_x) <= BESIDE_NM && y.abs_diff(*other_y) <= BESIDE_NM && z >= other_z
}

impl Sequencer {
    /// Waits for the goal of a leg.
    pub(super) const fn await_goal(&mut self, leg: Leg) {
        self.phase = Phase::AwaitGoal(leg);
        self.leg = LegPlanning::Requested;
    }

    /// Whether the leg can be planned, and is not.
    pub(super) fn has_to_plan_leg(&self, leg: Leg) -> bool {
        self.leg == LegPlanning::Requested && self.knows_goal(leg)
    }

    /// The traverse needs the stations of the next pass, the plunge its plan; or a fault there is reported.
    fn knows_goal(&self, leg: Leg) -> bool {
        if self.goal == Goal::Above && leg == Leg::Plunge {
            return self.knows_link() || self.pending.is_some();
        }
        if self.goal != Goal::Pass || self.pending.is_some() {
            return true;
        }
        match leg {
            Leg::Retract => true,
            Leg::Traverse => !matches!(
                self.planning,
                Planning::Awaited(_) | Planning::Requested(..) | Planning::Stations
            ),
            Leg::Plunge => self.is_planned(),
        }
    }

    /// Plans a leg whose goal is known. One without length is over.
    pub(super) fn plan_leg(&mut self, leg: Leg, job: &Job<'_>, axes: &AxisLimits) {
        match self.lead_leg(leg, job, axes) {
            Ok(true) => self.leg = LegPlanning::Complete,
            Ok(false) => self.end_leg(leg),
            Err(fault) => self.leg = LegPlanning::Refused(fault),
        }
    }

    /// Returns whether the leg has a length.
    fn lead_leg(&mut self, leg: Leg, job: &Job<'_>, axes: &AxisLimits) -> Result<bool> {
        let is_approach = self.goal == Goal::Pass && leg != Leg::Retract;
        if let Some(fault) = self.pending.filter(|_| is_approach) {
            return Err(fault);
        }
        let (now, next) = both(&mut self.plans, self.second);
        let from = self.at.unwrap_or(axes.home_nm);
        let [x, y, z] = match self.goal {
            Goal::Pass => next.ends[0],
            Goal::End => axes.end_nm.unwrap_or(axes.home_nm),
            Goal::SafeHeight | Goal::Lift => from,
            Goal::Above | Goal::Back => self.back.at,
        };
        let link = match self.goal {
            Goal::Pass if self.on_surface => job.link_to(now.pass.wrapping_add(1), axes),
            Goal::Pass if is_above(&from, &[x, y, z]) => Link::Across(from[2]),
            Goal::Above => Link::Across(z.saturating_add(ABOVE_NM).min(axes.safe_z_nm)),
            Goal::End if axes.end_nm.is_some() => Link::Across(axes.end_height_nm),
            _ => Link::Across(axes.safe_z_nm),
        };
        // A low link that could not begin in time goes at the safe height.
        let height = match link {
            Link::Across(height_nm) => from[2].max(height_nm),
            _ => from[2].max(axes.safe_z_nm),
        };
        let to = match leg {
            Leg::Traverse if self.is_low => match link {
                Link::Around(detour) => detour.place([from, [x, y, z]]),
                _ => [x, y, z],
            },
            Leg::Retract => [from[0], from[1], height],
            Leg::Traverse => [x, y, from[2]],
            Leg::Plunge => [x, y, z],
        };
        if is_approach {
            check_faces_up(next.faces_up[0])?;
        }
        check_travel(axes, &to)?;
        let comes_down = (is_approach || matches!(self.goal, Goal::Above | Goal::Back)) && leg == Leg::Plunge;
        let slow_mm = if is_approach && self.is_low {
            f32::MAX
        } else if comes_down {
            axes.plunge_mm
        } else {
            0.0
        };
        let feed = job.header.feed_mm_s;
        Ok(self.straight.lead(from, to, slow_mm, feed, axes))
    }

    /// Begins a leg if it is planned.
    ///
    /// # Errors
    /// The fault for which it was refused.
    pub(super) fn begin_leg(&mut self, leg: Leg, job: &Job<'_>, command: FeedCommand) -> Result<()> {
        match self.leg {
            LegPlanning::Requested => {}
            LegPlanning::Complete => {
                self.straight
                    .progress
                    .begin(command.feed_factor.at_most(1.0), job.header.period_s);
                self.phase = Phase::Leg(leg);
            }
            LegPlanning::Refused(fault) => return Err(fault),
        }
        Ok(())
    }

    /// Chooses what follows a leg. The plunge to a pass is left by [`Self::enter_pass`].
    fn end_leg(&mut self, leg: Leg) {
        match (leg, self.goal) {
            (Leg::Retract, Goal::SafeHeight) | (Leg::Plunge, Goal::End | Goal::SafeHeight) => {
                self.phase = Phase::Done;
            }
            (Leg::Retract, Goal::Lift) => self.phase = Phase::Lifted,
            (Leg::Plunge, Goal::Above | Goal::Back | Goal::Lift) => self.phase = self.back.phase,
            (Leg::Retract, Goal::Above) => self.await_goal(Leg::Plunge),
            (Leg::Retract, _) => self.await_goal(Leg::Traverse),
            (Leg::Traverse, _) => self.await_goal(Leg::Plunge),
            (Leg::Plunge, Goal::Pass) => self.phase = Phase::Leg(Leg::Plunge),
        }
    }

    /// One period of a leg.
    pub(super) fn follow_leg(
        &mut self,
        leg: Leg,
        job: &Job<'_>,
        run: &mut Run,
        command: FeedCommand,
        last: &mut Sample,
    ) -> Result<()> {
        let is_over = self.straight.progress.tick(
            command.feed_factor.at_most(1.0),
            command.is_fault,
            job.header.period_s,
            &mut self.profiles,
        );
        if is_over && leg == Leg::Plunge && self.goal == Goal::Pass {
            self.swap(run);
            return self.enter_pass(job, run, command, last);
        }
        run.off_surface(self.straight.position(), self.straight.progress.speed(), last);
        if is_over {
            self.end_leg(leg);
            if self.phase == Phase::Pass {
                // Back from a pause: the sample of the place at which the pass was left.
                run.show(job, last)?;
            }
        }
        Ok(())
    }
}
