//! How many Newton steps a plan gets: as many as the time allows, and more where a step pays.

use super::{Planner, Stage};
use crate::feed::deadlines::Deadlines;
use crate::feed::lists::draft;
use crate::feed::plan::Plan;
use crate::math::arith::{count_to_f32, inverse_sqrt, truncated};
use crate::math::number::Bounded;

/// Weight of the barrier in the first steps: of a plan from rest to rest, and of one with a turn.
pub(super) const BARRIER_FIRST: f32 = 0.02;
pub(super) const BARRIER_FIRST_IN_TURN: f32 = 0.05;
/// Weight in the last step. With a turn it is greater: the last stop before the turn begins with what the plan leaves of the limits.
const BARRIER_LAST: f32 = 2.5e-4;
const BARRIER_LAST_IN_TURN: f32 = 1e-3;
/// Greatest weight in the last [`STEPS_AT_END`] steps.
const BARRIER_AT_END: f32 = 7e-4;
const STEPS_AT_END: u16 = 2;

/// Factors on the weight, by the share of its way that the step before could go: more than [`WENT_FAR`], more than [`WENT`], less. A step that
/// is cut short is too close to a limit, and a greater weight leads away from it.
const WENT_FAR: f32 = 0.6;
const WENT: f32 = 0.25;
const AFTER_FAR: f32 = 0.4;
const AFTER_NEAR: f32 = 0.6;
const AFTER_CUT: f32 = 1.5;

/// Steps that every plan gets.
const STEPS_FIRST: u8 = 3;
/// Most steps from rest to rest.
const STEPS_MAX: u8 = 18;
/// Fewest and most steps of a plan with a turn.
const STEPS_LEAST_IN_TURN: u8 = 8;
const STEPS_MAX_IN_TURN: u8 = 12;

/// The method goes on as long as a whole step at the last weight shortens the motion by more than this share.
const UNSOLVED: f32 = 0.05;
/// Least share of (motion - walk) by which a step is assumed to shorten the motion.
const SHORTENS: f32 = 0.125;
/// Final duration of a plan over its duration after [`STEPS_FIRST`] steps, and after fewer than [`STEPS_SOME`]: estimates.
const LASTS_FIRST: f32 = 0.72;
const LASTS: f32 = 0.9;
const STEPS_SOME: u8 = 7;

/// Planning time of a Newton step, in periods: for each node, and apart from them.
const PERIODS_A_NODE: f32 = 0.27;
const PERIODS_OF_STEP: f32 = 3.0;
/// Planning time of the check, in periods for each period of the plan. With a turn, for which more time is spare, that of a part of the check.
const PERIODS_A_PLACE: f32 = 0.084;
const PERIODS_A_PLACE_IN_TURN: f32 = 0.07;
/// Planning time after the check, in periods.
const PERIODS_LEFT: f32 = 3.0;
/// Periods from the choice of the nodes to the first step.
const PERIODS_TO_STEPS: f32 = 50.0;
/// Periods of the search for the last stop before a turn, and of that stop.
const PERIODS_OF_STOP: f32 = 400.0;

impl Planner {
    /// Least planning time that is left, in periods; 0 before the first Newton step.
    pub(crate) fn least_left(&self, plan: &Plan) -> f32 {
        let (steps, checked) = match self.stage {
            Stage::Walk | Stage::Weigh | Stage::Finish | Stage::Gate | Stage::Done => return 0.0,
            Stage::Factor
            | Stage::Scale
            | Stage::Relax
            | Stage::Assemble
            | Stage::Solve
            | Stage::Reach
            | Stage::Take => (STEPS_FIRST.saturating_sub(self.step), 0),
            Stage::Check => (0, self.periods),
        };
        let check = PERIODS_A_PLACE * (self.lasts - count_to_f32(checked)).at_least(0.0) + PERIODS_LEFT;
        f32::from(steps) * self.periods_of_step(plan) + check
    }

    /// Periods left of the Newton step under way; only if [`Self::least_left`] does not count it.
    pub(crate) fn step_left(&self, plan: &Plan, spent: u32) -> f32 {
        let is_in_step = !matches!(
            self.stage,
            Stage::Check | Stage::Finish | Stage::Gate | Stage::Done
        );
        if !is_in_step || self.step < STEPS_FIRST {
            return 0.0;
        }
        (self.periods_of_step(plan) - count_to_f32(spent.saturating_sub(self.taken))).at_least(0.0)
    }

    /// Planning time of a Newton step, in periods: that of the last one, if there is one.
    fn periods_of_step(&self, plan: &Plan) -> f32 {
        if self.step > 1 {
            count_to_f32(self.of_step) + 1.0
        } else {
            PERIODS_A_NODE * f32::from(plan.intervals) + PERIODS_OF_STEP
        }
    }

    /// Planning time of the next plan, in periods, if it is like this one and has the usual number of nodes. `u32::MAX` where this one has that
    /// number itself.
    pub(super) fn usual_periods(&self) -> u32 {
        let Some((nodes, before)) = self.walker.usual() else {
            return u32::MAX;
        };
        let of_step = PERIODS_A_NODE * f32::from(nodes) + PERIODS_OF_STEP;
        let check = PERIODS_A_PLACE * count_to_f32(self.periods);
        let after = |steps: u8| count_to_f32(before) + PERIODS_TO_STEPS + f32::from(steps) * of_step + check;
        // The next one gets about as many steps as it has time for; one more than here if the last one here was cut short.
        let is_short = self.step >= STEPS_MAX && self.reach.step() < WENT;
        let more = if is_short { of_step } else { 0.0 };
        let most = (count_to_f32(self.periods) + more).at_least(after(STEPS_FIRST));
        let periods = after(self.step).at_most(most);
        u32::try_from(truncated(periods)).unwrap_or(u32::MAX)
    }

    /// Steps for which there is time. A plan is slowed down to the duration of its planning, so a long planning makes it slower; and the tool stands
    /// if the pass before is over first. Before a turn the next plan has to be complete before the last stop. `lasts`: periods of the motion.
    fn steps_left(&self, plan: &Plan, lasts: f32, Deadlines { least, left, .. }: Deadlines) -> u16 {
        let has_turn = plan.has_turn();
        let [fewest, most] = if has_turn {
            [STEPS_LEAST_IN_TURN, STEPS_MAX_IN_TURN]
        } else {
            [0, STEPS_MAX]
        };
        let [fewest, most] = [fewest, most].map(|steps| f32::from(steps.saturating_sub(self.step)));
        let stop = if plan.goes_on() { PERIODS_OF_STOP } else { 0.0 };
        let own = if least == 0 || self.walker.usual().is_some() {
            f32::MAX
        } else {
            lasts - stop - count_to_f32(least)
        };
        let left = left.filter(|_| !has_turn).unwrap_or(f32::MAX);
        let place = if has_turn {
            PERIODS_A_PLACE_IN_TURN
        } else {
            PERIODS_A_PLACE
        };
        let left = own.at_most(left) - place * lasts - PERIODS_LEFT;
        let steps = (left.at_least(0.0) / self.periods_of_step(plan))
            .at_least(fewest)
            .at_most(most);
        u16::try_from(truncated(steps)).unwrap_or(u16::MAX)
    }

    /// Decides whether another step is taken, because there is time or because it pays, and chooses its barrier. `shorter`: periods by which the last
    /// step shortened the motion.
    pub(super) fn goes_on(&mut self, plan: &Plan, deadlines: Deadlines, shorter: f32) -> bool {
        if self.step < STEPS_FIRST {
            return true;
        }
        let lasts = self.lasts;
        let went = self.reach.step();
        // A step that shortens the check by more than it takes itself costs nothing.
        let walk = plan.step_s / (self.weight * plan.limits.period);
        let pays = PERIODS_A_PLACE * shorter.at_least(SHORTENS * (lasts - walk)) > self.periods_of_step(plan);
        let last = if !plan.has_turn() {
            BARRIER_LAST
        } else {
            BARRIER_LAST_IN_TURN
        };
        let is_solved = self.barrier <= last && went >= 1.0 && shorter < UNSOLVED * lasts;
        let may_go_on = self.steps_left(plan, lasts, deadlines) > 0 || (pays && self.step < STEPS_MAX);
        if is_solved || !may_go_on {
            return false;
        }
        let change = if went > WENT_FAR {
            AFTER_FAR
        } else if went > WENT {
            AFTER_NEAR
        } else {
            AFTER_CUT
        };
        let share = match self.step {
            STEPS_FIRST => LASTS_FIRST,
            0..STEPS_SOME => LASTS,
            _ => 1.0,
        };
        let most = if !pays && self.steps_left(plan, share * lasts, deadlines) <= STEPS_AT_END {
            BARRIER_AT_END
        } else {
            BARRIER_FIRST_IN_TURN
        };
        if self.relaxed == 1.0 {
            self.barrier = (change * self.barrier).at_least(last).at_most(most);
        }
        true
    }

    /// Duration of the motion at the draft's pace, in periods, by its values at the nodes: a coefficient may be much less than these.
    pub(super) fn lasts(&self, plan: &Plan) -> f32 {
        let nodes = usize::from(plan.intervals) + 1;
        let pace = draft(&self.lists);
        let sum: f32 = (pace.iter().zip(pace.iter().skip(1)))
            .take(nodes)
            .map(|(here, next)| inverse_sqrt((0.5 * (here + next)).at_least(1e-9)))
            .sum();
        sum * plan.step_s / plan.limits.period
    }
}
