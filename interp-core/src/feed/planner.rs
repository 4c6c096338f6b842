//! Plans a path in portions: walk, barrier method, check.

use super::deadlines::Deadlines;
use super::limits::{FeedChange, MotionLimits};
use super::lists::{LIST, Lists, draft, draft_mut};
use super::newton::{self, Reach, Sweep};
use super::pace::{Course, Use};
use super::plan::{COEFFICIENTS, Cursor, Lead, Plan};
use super::road::GateSearch;
use super::walk::{NODES_COUNT, Walker};
use crate::math::arith::{inverse_sqrt, sqrt, truncated};
use crate::math::number::{Bounded, cube_root};

/// Weight of the barrier in the first steps, with an end at speed, and in the last one. A greater one leads away from the limits first.
const BARRIER_FIRST: f32 = 0.02;
const BARRIER_FIRST_AT_SPEED: f32 = 0.05;
const BARRIER_LAST: f32 = 2.5e-4;
const STEPS_FIRST: u8 = 3;
/// How it changes after a step: where the step could go as far as the first of these shares of its way, or of the second, or less. A step that is cut
/// short is too close to a limit, and a greater weight leads away from it.
const WENT_FAR: f32 = 0.6;
const WENT: f32 = 0.25;
const AFTER_FAR: f32 = 0.4;
const AFTER_NEAR: f32 = 0.6;
const AFTER_CUT: f32 = 1.5;
/// The greatest weight in the last steps, and how many those are.
const BARRIER_AT_END: f32 = 7e-4;
const STEPS_AT_END: u16 = 2;
/// Share of the motion by which a whole step at the last weight still shortens it where it is not the last one; and share of what the motion takes more than the
/// walk by which a step shortens it, whatever the one before it did.
const UNSOLVED: f32 = 0.05;
const SHORTENS: f32 = 0.125;
/// The last weight with an end at speed: what the plan leaves of the limits is what the last stop before the end begins with.
const BARRIER_LAST_AT_SPEED: f32 = 1e-3;
/// Most steps from rest to rest; with an end at speed, and the fewest.
const STEPS_MAX: u8 = 18;
const STEPS_AT_SPEED: u8 = 12;
const STEPS_LEAST: u8 = 8;
/// Share of the time that a motion takes after the first steps, and after some more, that the plan takes about.
const LASTS_FIRST: f32 = 0.72;
const LASTS: f32 = 0.9;
const STEPS_SOME: u8 = 7;
/// Periods that a step of the method takes for each node and apart from them, the check for each period of the plan, and what is left. Before a turn, where a
/// plan is given more time to spare, that is the time for a part of the check.
const PERIODS_A_STEP: f32 = 0.27;
const PERIODS_OF_STEP: f32 = 3.0;
const PERIODS_A_PLACE: f32 = 0.084;
const PERIODS_A_PLACE_AT_SPEED: f32 = 0.07;
const PERIODS_LEFT: f32 = 3.0;
/// Periods from the choice of the nodes to the first step.
const PERIODS_TO_STEPS: f32 = 50.0;
/// The same of the search for the last stop before an end at speed, with that stop.
const PERIODS_OF_STOP: f32 = 400.0;

/// Share of the greatest factor of the walk's pace that the method starts from.
const START_SHARE: f32 = 0.85;

/// Share of the caps that a walk uses near an end at speed, so that the method can start from its own pace there.
const WALK_NEAR_TURN: f32 = 0.3;
/// Coefficients over which the start goes from the pace near an end at speed to the factor.
const BLENDED: u16 = 30;

/// Share of the planned jerk that is used in a turn.
const TURN_JERK: f32 = 0.9;

/// Room above the greatest use of a limit by which limits are relaxed.
const RELAXED: f32 = 1.05;

/// Use of the jerk that the check passes: a plan with more is slowed down.
const JERK_CHECKED: f32 = 0.998;
/// In a turn the third derivative bends between stations: the jerk is up to this much more than the check finds.
const JERK_IN_TURN: f32 = 1.04;

/// Cycles of the pieces of work in a period's planning, of which the first may take more, by the pessimistic model of `cargo sim budget`.
pub(crate) const PORTION_CYCLES: u32 = 24_000;

/// Cycles of one piece of work, by the same model.
mod cycles {
    pub(super) const FACTOR: u32 = 3_000;
    pub(super) const ASSEMBLE: u32 = 3_950;
    pub(super) const SOLVE: u32 = 22_500;
    pub(super) const REACH: u32 = 2_600;
    /// More for a jump behind the node.
    pub(super) const JUMP: u32 = 3_500;
    pub(super) const CHECK: u32 = 1_900;
    pub(super) const GATE: u32 = 2_950;
    pub(super) const GATE_PLACE: u32 = 22_000;
    /// The start of a plan with an end at speed.
    pub(super) const BLEND: u32 = 25_000;
    /// Something for each coefficient, of the most that there may be; apart from the coefficients.
    pub(super) const LIST: u32 = 15_000;
    pub(super) const LEAST: u32 = 2_000;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Done,
    Walk,
    /// Weighs the places.
    Weigh,
    Factor,
    /// Takes the factor.
    Scale,
    /// Finds by how much the limits are relaxed for the next step.
    Relax,
    Assemble,
    Solve,
    Reach,
    /// Takes the step.
    Take,
    Check,
    /// Slows the plan down where it uses too much.
    Finish,
    /// Finds the last stop before the end.
    Gate,
}

/// The planning of one path.
#[derive(Clone, Debug)]
pub(crate) struct Planner {
    stage: Stage,
    lists: Lists,
    walker: Walker,
    /// Limits of the path, and what the plan may use of them.
    machine: MotionLimits,
    limits: MotionLimits,
    turn_limits: MotionLimits,
    /// Factor by which both are relaxed as long as the pace does not keep them.
    relaxed: f32,
    sweep: Sweep,
    /// Steps of the method so far, and the weight of its barrier.
    step: u8,
    barrier: f32,
    /// One over the sum of the coefficients' times, and the greatest factor of the start.
    weight: f32,
    factor: f32,
    reach: Reach,
    /// Periods that the motion takes at the draft's pace; those of planning when the last step was taken, and from the one before it.
    lasts: f32,
    taken: u32,
    of_step: u32,
    /// The check's place, what the plan uses so far, and periods.
    cursor: Cursor,
    most: Use,
    periods: u32,
    lead: Lead,
    gate: GateSearch,
}

impl Planner {
    /// Idle.
    pub(crate) const IDLE: Self = Self {
        stage: Stage::Done,
        lists: [[0.0; LIST]; 6],
        walker: Walker::IDLE,
        machine: MotionLimits::NONE,
        limits: MotionLimits::NONE,
        turn_limits: MotionLimits::NONE,
        relaxed: 1.0,
        sweep: Sweep::START,
        step: 0,
        barrier: BARRIER_FIRST,
        weight: 0.0,
        factor: 0.0,
        reach: Reach::NONE,
        cursor: Cursor::START,
        most: Use::NONE,
        periods: 0,
        lasts: 0.0,
        taken: 0,
        of_step: 0,
        lead: Lead::NONE,
        gate: GateSearch::START,
    };

    /// Begins to plan the path of the plan's stations within the plan's limits.
    pub(crate) fn begin(&mut self, plan: &mut Plan) {
        plan.change = FeedChange::new(&plan.limits);
        self.machine = plan.limits;
        self.relax(1.0);
        self.walker.begin(plan.limits.period, WALK_NEAR_TURN);
        self.stage = Stage::Walk;
    }

    /// Gives up.
    pub(crate) const fn stop(&mut self) {
        self.stage = Stage::Done;
    }

    /// Whether the walk is being made, whose nodes are chosen by the time that is left.
    pub(crate) fn is_walking(&self) -> bool {
        self.stage == Stage::Walk
    }

    pub(crate) fn is_done(&self) -> bool {
        self.stage == Stage::Done
    }

    /// Periods that the rest of the planning takes at least, once the method has begun.
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
        let check = PERIODS_A_PLACE * (self.lasts - to_f32(checked)).at_least(0.0) + PERIODS_LEFT;
        f32::from(steps) * self.periods_of_step(plan) + check
    }

    /// Periods that are left of the step that is being made, where it is none of those that [`Self::least_left`] counts.
    pub(crate) fn step_left(&self, plan: &Plan, spent: u32) -> f32 {
        let is_in_step = !matches!(
            self.stage,
            Stage::Check | Stage::Finish | Stage::Gate | Stage::Done
        );
        if !is_in_step || self.step < STEPS_FIRST {
            return 0.0;
        }
        (self.periods_of_step(plan) - to_f32(spent.saturating_sub(self.taken))).at_least(0.0)
    }

    /// Cycles of the next piece of work.
    pub(crate) fn cycles(&self, plan: &Plan) -> u32 {
        let jump = if self.sweep.has_jump(plan) {
            cycles::JUMP
        } else {
            0
        };
        let nodes = if plan.is_counted() {
            plan.intervals
        } else {
            NODES_COUNT
        };
        let of_nodes = |cycles: u32| {
            cycles::LEAST + (cycles - cycles::LEAST) * u32::from(nodes) / u32::from(NODES_COUNT)
        };
        match self.stage {
            Stage::Walk => self.walker.cycles(plan),
            Stage::Factor | Stage::Relax => cycles::FACTOR + jump,
            Stage::Assemble => cycles::ASSEMBLE + jump,
            Stage::Solve => of_nodes(cycles::SOLVE),
            Stage::Reach => cycles::REACH + jump,
            Stage::Check => cycles::CHECK,
            Stage::Scale if plan.pinned() != [0; 2] => cycles::BLEND,
            Stage::Weigh | Stage::Scale | Stage::Take | Stage::Finish => of_nodes(cycles::LIST),
            Stage::Gate if self.gate.is_placed() => cycles::GATE,
            Stage::Gate => cycles::GATE_PLACE,
            Stage::Done => 0,
        }
    }

    /// One piece of work.
    pub(crate) fn work(&mut self, plan: &mut Plan, deadlines: Deadlines) {
        let least = deadlines.least.min(self.usual_periods());
        self.stage = match self.stage {
            Stage::Walk => {
                if self.walker.work(&mut self.lists, plan, &self.limits, deadlines) {
                    Stage::Weigh
                } else {
                    Stage::Walk
                }
            }
            Stage::Weigh => {
                self.begin_method(plan);
                Stage::Factor
            }
            Stage::Factor => {
                let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
                let factor = newton::factor(plan, limits, &self.lists, &mut self.sweep);
                let [cell, _] = plan.node(self.sweep.node());
                if !plan.is_near_turn(plan.stations.get(cell).arc_nm) {
                    self.factor = factor.at_most(self.factor);
                }
                if self.sweep.next(plan) {
                    Stage::Scale
                } else {
                    Stage::Factor
                }
            }
            Stage::Scale => {
                let factor = START_SHARE * self.factor.at_least(1e-9);
                self.lasts *= inverse_sqrt(factor);
                if plan.pinned() == [0; 2] {
                    for pace in draft_mut(&mut self.lists).iter_mut().take(COEFFICIENTS) {
                        *pace *= factor;
                    }
                } else {
                    scale(plan, draft_mut(&mut self.lists), factor);
                }
                newton::clear(&mut self.lists);
                self.begin_step(plan)
            }
            Stage::Relax => {
                let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
                let used = newton::most_used(plan, limits, &self.lists, &mut self.sweep);
                self.factor = self.factor.at_least(used);
                if self.sweep.next(plan) {
                    let used = self.relaxed * self.factor;
                    self.relax(if used < 1.0 { 1.0 } else { RELAXED * used });
                    Stage::Assemble
                } else {
                    Stage::Relax
                }
            }
            Stage::Assemble => {
                let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
                newton::assemble(
                    plan,
                    limits,
                    &mut self.lists,
                    &mut self.sweep,
                    self.barrier,
                    self.weight,
                );
                if self.sweep.next(plan) {
                    Stage::Solve
                } else {
                    Stage::Assemble
                }
            }
            Stage::Solve => {
                let [start, end] = plan.pinned();
                newton::solve(&mut self.lists, plan.intervals + 2 - end, start);
                self.reach = Reach::FAR;
                Stage::Reach
            }
            Stage::Reach => {
                let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
                newton::extend(plan, limits, &self.lists, &mut self.sweep, &mut self.reach);
                if self.sweep.next(plan) {
                    Stage::Take
                } else {
                    Stage::Reach
                }
            }
            Stage::Take => self.take(plan, deadlines),
            Stage::Check => {
                if self.check(plan) {
                    Stage::Finish
                } else {
                    Stage::Check
                }
            }
            Stage::Finish => {
                self.slow(plan, least);
                self.gate = GateSearch::START;
                if plan.goes_on() { Stage::Gate } else { Stage::Done }
            }
            Stage::Gate => {
                if self.gate.work(plan) {
                    // The next plan has to be complete before the gate.
                    let before = plan.before_gate() / plan.limits.period;
                    let pace = before / to_f32(least).at_least(1.0);
                    plan.pace_max = plan.pace_max.at_most(pace.at_least(0.1));
                    Stage::Done
                } else {
                    Stage::Gate
                }
            }
            Stage::Done => Stage::Done,
        };
    }

    /// What the plan may use of the limits, relaxed by a factor.
    fn relax(&mut self, by: f32) {
        self.relaxed = by;
        self.limits = self.machine.planned().relaxed(by);
        self.turn_limits = self.limits.with_less_jerk(TURN_JERK);
    }

    /// Begins a step. With an end at speed the pace of the walk may not keep the limits there: they are relaxed to what it uses, and drawn in again
    /// with each step, so that every row holds from the first step on.
    fn begin_step(&mut self, plan: &Plan) -> Stage {
        let is_first = self.step == 0 && plan.pinned() != [0; 2];
        if is_first || self.relaxed > 1.0 {
            self.factor = 0.0;
            Stage::Relax
        } else {
            Stage::Assemble
        }
    }

    /// Periods that a step of the method takes: as many as the last one, if there is one.
    fn periods_of_step(&self, plan: &Plan) -> f32 {
        if self.step > 1 {
            to_f32(self.of_step) + 1.0
        } else {
            PERIODS_A_STEP * f32::from(plan.intervals) + PERIODS_OF_STEP
        }
    }

    /// Periods that the planning of a plan like this one takes with as many nodes as are usual where the tool does not wait for it; the greatest number where it has
    /// as many.
    fn usual_periods(&self) -> u32 {
        let Some((nodes, before)) = self.walker.usual() else {
            return u32::MAX;
        };
        let of_step = PERIODS_A_STEP * f32::from(nodes) + PERIODS_OF_STEP;
        let check = PERIODS_A_PLACE * to_f32(self.periods);
        let after = |steps: u8| to_f32(before) + PERIODS_TO_STEPS + f32::from(steps) * of_step + check;
        // The next one takes about as many steps as it has time for, from the fewest on; one more where the last one here was cut short.
        let is_short = self.step >= STEPS_MAX && self.reach.step() < WENT;
        let more = if is_short { of_step } else { 0.0 };
        let most = (to_f32(self.periods) + more).at_least(after(STEPS_FIRST));
        let periods = after(self.step).at_most(most);
        u32::try_from(truncated(periods)).unwrap_or(u32::MAX)
    }

    /// Steps that there is time for. A plan is slowed down to what its planning takes, so one that comes too late makes it slower; and the tool stands where
    /// the pass before is over first. With an end at speed the next plan has to be complete before the last stop. `lasts`: periods of the motion.
    fn steps_left(&self, plan: &Plan, lasts: f32, Deadlines { least, left, .. }: Deadlines) -> u16 {
        let is_between = plan.pinned() != [0; 2];
        let [fewest, most] = if is_between {
            [STEPS_LEAST, STEPS_AT_SPEED]
        } else {
            [0, STEPS_MAX]
        };
        let [fewest, most] = [fewest, most].map(|steps| f32::from(steps.saturating_sub(self.step)));
        let stop = if plan.goes_on() { PERIODS_OF_STOP } else { 0.0 };
        let own = if least == 0 || self.walker.usual().is_some() {
            f32::MAX
        } else {
            lasts - stop - to_f32(least)
        };
        let left = left.filter(|_| !is_between).unwrap_or(f32::MAX);
        let place = if is_between {
            PERIODS_A_PLACE_AT_SPEED
        } else {
            PERIODS_A_PLACE
        };
        let left = own.at_most(left) - place * lasts - PERIODS_LEFT;
        let steps = (left.at_least(0.0) / self.periods_of_step(plan))
            .at_least(fewest)
            .at_most(most);
        u16::try_from(truncated(steps)).unwrap_or(u16::MAX)
    }

    /// Whether another step is to be taken, for which there is time, or which pays; chooses its barrier. `shorter`: periods by which the last one shortened the motion.
    fn goes_on(&mut self, plan: &Plan, deadlines: Deadlines, shorter: f32) -> bool {
        if self.step < STEPS_FIRST {
            return true;
        }
        let lasts = self.lasts;
        let went = self.reach.step();
        // A step that shortens the check by more than it takes itself costs nothing.
        let walk = plan.step_s / (self.weight * plan.limits.period);
        let pays = PERIODS_A_PLACE * shorter.at_least(SHORTENS * (lasts - walk)) > self.periods_of_step(plan);
        let last = if plan.pinned() == [0; 2] {
            BARRIER_LAST
        } else {
            BARRIER_LAST_AT_SPEED
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
            BARRIER_FIRST_AT_SPEED
        };
        if self.relaxed == 1.0 {
            self.barrier = (change * self.barrier).at_least(last).at_most(most);
        }
        true
    }

    /// Periods that the motion takes at the pace as it is: by its values at the nodes. A coefficient may be much less than these.
    fn lasts(&self, plan: &Plan) -> f32 {
        let nodes = usize::from(plan.intervals) + 1;
        let pace = draft(&self.lists);
        let sum: f32 = (pace.iter().zip(pace.iter().skip(1)))
            .take(nodes)
            .map(|(here, next)| inverse_sqrt((0.5 * (here + next)).at_least(1e-9)))
            .sum();
        sum * plan.step_s / plan.limits.period
    }

    fn begin_method(&mut self, plan: &Plan) {
        let mut sum = 0.0;
        let count = usize::from(plan.intervals) + 2;
        let [.., shape, draft] = &mut self.lists;
        for (shape, pace) in shape.iter_mut().zip(draft).take(count) {
            *shape = *pace;
            sum += inverse_sqrt(pace.at_least(1e-9));
        }
        self.weight = 1.0 / sum.at_least(1e-9);
        self.lasts = sum * plan.step_s / plan.limits.period;
        self.factor = f32::MAX;
        self.step = 0;
        self.barrier = if plan.pinned() == [0; 2] {
            BARRIER_FIRST
        } else {
            BARRIER_FIRST_AT_SPEED
        };
        self.sweep = Sweep::START;
    }

    /// Takes the step that was solved for, and begins the next, or the check.
    fn take(&mut self, plan: &mut Plan, deadlines: Deadlines) -> Stage {
        newton::take(plan, &mut self.lists, self.reach.step());
        newton::clear(&mut self.lists);
        self.step += 1;
        self.of_step = deadlines.spent.saturating_sub(self.taken);
        self.taken = deadlines.spent;
        let before = self.lasts;
        self.lasts = self.lasts(plan);
        if self.goes_on(plan, deadlines, before - self.lasts) {
            return self.begin_step(plan);
        }
        self.begin_check(plan);
        Stage::Check
    }

    fn begin_check(&mut self, plan: &mut Plan) {
        plan.allow_feed();
        self.cursor = Cursor::START;
        self.most = Use::NONE;
        self.periods = 0;
        self.lead = Lead::NONE;
    }

    /// One period of the plan; whether it is over.
    fn check(&mut self, plan: &mut Plan) -> bool {
        if self.periods < u32::from(plan.change.lead()) {
            self.lead.look_draft(plan, draft(&self.lists), &self.cursor);
            self.lead.cursor = self.cursor;
        }
        let mut here = plan.use_draft(draft(&self.lists), &self.machine, &self.cursor);
        let [cell, _] = plan.node(self.cursor.interval);
        if plan.is_near_turn(plan.stations.get(cell).arc_nm) {
            here.jerk *= JERK_IN_TURN;
        }
        self.most.add(&here);
        if here.velocity > here.feed {
            plan.forbid_feed(self.cursor.interval);
        }
        let period = plan.limits.period;
        plan.advance_draft(draft(&self.lists), &mut self.cursor, period);
        self.periods = self.periods.saturating_add(1);
        plan.is_over(&self.cursor)
    }

    /// Slows the plan where it uses too much, or is too short.
    fn slow(&mut self, plan: &mut Plan, least: u32) {
        let Use {
            feed,
            velocity,
            acceleration,
            jerk,
        } = self.most;
        let factor = feed
            .at_least(velocity)
            .at_least(sqrt(acceleration))
            .at_least(cube_root(jerk / JERK_CHECKED))
            .at_least(to_f32(least) / to_f32(self.periods.max(1)))
            .at_least(1.0);
        plan.periods = u32::try_from(truncated(to_f32(self.periods) * factor)).unwrap_or(0);
        plan.lead = self.lead;
        (plan.pace_max, plan.over) = (1.0, 1.0);
        let is_between = plan.pinned() != [0; 2];
        if is_between {
            plan.pace_max = 1.0 / factor;
            plan.over = feed.at_least(1.0);
        } else if factor > 1.0 {
            plan.lead.near = 0.0;
            let share = 1.0 / (factor * factor);
            for pace in draft_mut(&mut self.lists).iter_mut().take(COEFFICIENTS) {
                *pace *= share;
            }
        }
        self.keep(plan);
    }

    /// The pace that was planned becomes the plan's.
    fn keep(&self, plan: &mut Plan) {
        for (pace, draft) in plan.pace.iter_mut().zip(draft(&self.lists)) {
            *pace = *draft;
        }
    }
}

/// The limits at the node of a sweep: in a turn, where the path changes from node to node, the plan uses less of the jerk.
fn limits_at<'a>(plan: &Plan, sweep: &Sweep, [usual, in_turn]: [&'a MotionLimits; 2]) -> &'a MotionLimits {
    if plan.pinned() == [0; 2] {
        return usual;
    }
    let [cell, _] = plan.node(sweep.node());
    if plan.is_near_turn(plan.stations.get(cell).arc_nm) {
        in_turn
    } else {
        usual
    }
}

/// Multiplies the pace of the walk, but near an end at speed.
fn scale(plan: &Plan, draft: &mut [f32; LIST], factor: f32) {
    let count = plan.intervals + 2;
    let [at_start, at_end] = plan.ends.map(|speed| speed > 0.0);
    let is_near = |index: u16| {
        let [cell, _] = plan.node(index.min(plan.intervals));
        plan.is_near_turn(plan.stations.get(cell).arc_nm)
    };
    let from = if at_start {
        (0..count).find(|index| !is_near(*index)).unwrap_or(count)
    } else {
        0
    };
    let to = if at_end {
        (0..count).rev().find(|index| !is_near(*index)).unwrap_or(0)
    } else {
        count
    };
    for (index, pace) in (0..count).zip(draft) {
        let share = |is_at: bool, away: u16| {
            let by = (f32::from(away) * (1.0 / f32::from(BLENDED))).at_most(1.0);
            if is_at { by * by * (3.0 - 2.0 * by) } else { 1.0 }
        };
        let share =
            share(at_start, index.saturating_sub(from)).at_most(share(at_end, to.saturating_sub(index)));
        *pace *= 1.0 + share * (factor - 1.0);
    }
}

#[allow(clippy::cast_precision_loss, reason = "24 bits of a ratio are enough")]
const fn to_f32(count: u32) -> f32 {
    count as f32
}
