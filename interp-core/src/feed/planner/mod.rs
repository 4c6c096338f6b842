//! Plans a path in portions: walk, barrier method, check.

mod cycles;
mod effort;

use self::effort::{BARRIER_FIRST, BARRIER_FIRST_IN_TURN};
use super::deadlines::Deadlines;
use super::limits::{FeedChange, MotionLimits};
use super::lists::{LIST, Lists, draft, draft_mut};
use super::newton::{self, Reach, Sweep};
use super::pace::{Trajectory, Use};
use super::plan::{COEFFICIENTS, Cursor, Lead, Plan};
use super::road::GateSearch;
use super::walk::Walker;
use crate::math::arith::{count_to_f32, inverse_sqrt, sqrt, truncated};
use crate::math::number::{Bounded, cube_root};

/// Share of the greatest factor of the walk's pace that the method starts from.
const START_SHARE: f32 = 0.85;

/// Share of the caps that the walk uses near a turn, where the method starts from the walk's own pace.
const WALK_NEAR_TURN: f32 = 0.3;
/// Coefficients over which the start blends from the walk's pace near a turn into the scaled one.
const BLENDED: u16 = 30;

/// Share of the planned jerk that is used in a turn.
const TURN_JERK: f32 = 0.9;

/// Limits are relaxed to the greatest use of them times this.
const RELAXED: f32 = 1.05;

/// Greatest use of the jerk limit that the check accepts: a plan with more is slowed down.
const JERK_CHECKED: f32 = 0.998;
/// Jerk in a turn over the one that the check finds, at most: the third derivative bends between stations.
const JERK_IN_TURN: f32 = 1.04;

/// Cycles of a period's planning by the pessimistic model of `cargo sim budget`: pieces of work are begun as long as they fit. The first may take
/// more.
pub(crate) const PORTION_CYCLES: u32 = 24_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Done,
    Walk,
    /// Sums the coefficients' times.
    Weigh,
    /// Finds the greatest factor of the walk's pace within the limits.
    Factor,
    /// Multiplies the walk's pace by the factor.
    Scale,
    /// Relaxes the limits for the next step.
    Relax,
    /// Assembles, solves, shortens and takes a Newton step.
    Assemble,
    Solve,
    Reach,
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
    /// Limits of the path.
    machine: MotionLimits,
    /// Limits that the plan may use, and those in a turn, both relaxed by `relaxed`.
    limits: MotionLimits,
    turn_limits: MotionLimits,
    relaxed: f32,
    sweep: Sweep,
    /// Newton steps taken.
    step: u8,
    /// Weight of the barrier.
    barrier: f32,
    /// One over the sum of the coefficients' times.
    weight: f32,
    /// Greatest factor of the walk's pace within the limits; then the greatest use of the limits.
    factor: f32,
    reach: Reach,
    /// Duration of the motion at the draft's pace, periods.
    lasts: f32,
    /// Periods of planning when the last step was taken.
    taken: u32,
    /// Periods of planning that the last step took.
    of_step: u32,
    /// Place of the check.
    cursor: Cursor,
    /// Greatest use of the limits so far.
    most: Use,
    /// Periods checked.
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

    /// One piece of work.
    pub(crate) fn work(&mut self, plan: &mut Plan, deadlines: Deadlines) {
        self.stage = match self.stage {
            Stage::Walk => {
                let is_done = self.walker.work(&mut self.lists, plan, &self.limits, deadlines);
                if is_done { Stage::Weigh } else { Stage::Walk }
            }
            Stage::Weigh => {
                self.begin_method(plan);
                Stage::Factor
            }
            Stage::Factor => self.factor_at_node(plan),
            Stage::Scale => self.scale_start(plan),
            Stage::Relax => self.use_at_node(plan),
            Stage::Assemble => self.assemble_node(plan),
            Stage::Solve => {
                let [start, end] = plan.pinned();
                newton::solve(&mut self.lists, plan.intervals + 2 - end, start);
                self.reach = Reach::FAR;
                Stage::Reach
            }
            Stage::Reach => self.reach_at_node(plan),
            Stage::Take => self.end_step(plan, deadlines),
            Stage::Check => {
                let is_done = self.check(plan);
                if is_done { Stage::Finish } else { Stage::Check }
            }
            Stage::Finish => {
                self.slow(plan, deadlines.least.min(self.usual_periods()));
                self.gate = GateSearch::START;
                if plan.goes_on() { Stage::Gate } else { Stage::Done }
            }
            Stage::Gate => self.search_gate(plan, deadlines.least.min(self.usual_periods())),
            Stage::Done => Stage::Done,
        };
    }

    /// Bounds the factor on the walk's pace by the limits at a node. Near a turn the pace is the walk's own.
    fn factor_at_node(&mut self, plan: &Plan) -> Stage {
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

    /// Multiplies the walk's pace by a share of that factor: the method starts within the limits.
    fn scale_start(&mut self, plan: &Plan) -> Stage {
        let factor = START_SHARE * self.factor.at_least(1e-9);
        self.lasts *= inverse_sqrt(factor);
        if plan.has_turn() {
            scale(plan, draft_mut(&mut self.lists), factor);
        } else {
            for pace in draft_mut(&mut self.lists).iter_mut().take(COEFFICIENTS) {
                *pace *= factor;
            }
        }
        newton::clear(&mut self.lists);
        self.begin_step(plan)
    }

    /// Finds the use of the limits at a node; after the last node, relaxes the limits to the greatest use.
    fn use_at_node(&mut self, plan: &Plan) -> Stage {
        let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
        let used = newton::most_used(plan, limits, &self.lists, &mut self.sweep);
        self.factor = self.factor.at_least(used);
        if !self.sweep.next(plan) {
            return Stage::Relax;
        }
        let used = self.relaxed * self.factor;
        self.relax(if used < 1.0 { 1.0 } else { RELAXED * used });
        Stage::Assemble
    }

    /// Adds the rows of a node to the step's equations.
    fn assemble_node(&mut self, plan: &Plan) -> Stage {
        let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
        let (lists, sweep) = (&mut self.lists, &mut self.sweep);
        newton::assemble(plan, limits, lists, sweep, self.barrier, self.weight);
        if self.sweep.next(plan) {
            Stage::Solve
        } else {
            Stage::Assemble
        }
    }

    /// Finds how far the step may go until a row of a node is broken.
    fn reach_at_node(&mut self, plan: &Plan) -> Stage {
        let limits = limits_at(plan, &self.sweep, [&self.limits, &self.turn_limits]);
        newton::extend(plan, limits, &self.lists, &mut self.sweep, &mut self.reach);
        if self.sweep.next(plan) {
            Stage::Take
        } else {
            Stage::Reach
        }
    }

    /// Goes on with the search for the last stop before the end; the next plan, which takes `least` periods, has to be complete before it.
    fn search_gate(&mut self, plan: &mut Plan, least: u32) -> Stage {
        if !self.gate.work(plan) {
            return Stage::Gate;
        }
        let before = plan.before_gate() / plan.limits.period;
        let pace = before / count_to_f32(least).at_least(1.0);
        plan.pace_max = plan.pace_max.at_most(pace.at_least(0.1));
        Stage::Done
    }

    /// Sets the limits that the plan may use, relaxed by a factor.
    fn relax(&mut self, by: f32) {
        self.relaxed = by;
        self.limits = self.machine.planned().relaxed(by);
        self.turn_limits = self.limits.with_less_jerk(TURN_JERK);
    }

    /// Begins a step. In a turn the walk's pace may exceed the limits: they are relaxed to its use of them, and drawn in again with each step, so
    /// that every row holds from the first step on.
    fn begin_step(&mut self, plan: &Plan) -> Stage {
        let is_first = self.step == 0 && plan.has_turn();
        if is_first || self.relaxed > 1.0 {
            self.factor = 0.0;
            Stage::Relax
        } else {
            Stage::Assemble
        }
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
        self.barrier = if !plan.has_turn() {
            BARRIER_FIRST
        } else {
            BARRIER_FIRST_IN_TURN
        };
        self.sweep = Sweep::START;
    }

    /// Applies the step, and begins the next one or the check.
    fn end_step(&mut self, plan: &mut Plan, deadlines: Deadlines) -> Stage {
        newton::apply_step(plan, &mut self.lists, self.reach.step());
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

    /// Checks one period of the plan. Returns whether it is the last one.
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

    /// Slows the plan down by one factor where it exceeds a limit, or takes less than `least` periods.
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
            .at_least(count_to_f32(least) / count_to_f32(self.periods.max(1)))
            .at_least(1.0);
        plan.periods = u32::try_from(truncated(count_to_f32(self.periods) * factor)).unwrap_or(0);
        plan.lead = self.lead;
        (plan.pace_max, plan.over) = (1.0, 1.0);
        if plan.has_turn() {
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
    if !plan.has_turn() {
        return usual;
    }
    let [cell, _] = plan.node(sweep.node());
    if plan.is_near_turn(plan.stations.get(cell).arc_nm) {
        in_turn
    } else {
        usual
    }
}

/// Multiplies the walk's pace by a factor, except near a turn.
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
