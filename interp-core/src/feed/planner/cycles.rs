//! Cycles of each piece of planning, by the pessimistic model of `cargo sim budget`.

use super::{Planner, Stage};
use crate::feed::plan::Plan;
use crate::feed::walk::NODES_COUNT;

const FACTOR: u32 = 3_000;
const ASSEMBLE: u32 = 3_950;
const SOLVE: u32 = 22_500;
const REACH: u32 = 2_600;
/// On top of the others, for each jump after the node.
const JUMP: u32 = 3_500;
const CHECK: u32 = 1_900;
/// On top of that where the path has jumps.
const CHECK_JUMPS: u32 = 200;
const GATE: u32 = 2_950;
const GATE_PLACE: u32 = 22_000;
/// [`Stage::Scale`] of a plan with a turn.
const BLEND: u32 = 25_000;
/// Work on each coefficient, for the greatest number of them.
const LIST: u32 = 15_000;
/// The part of that which does not depend on their number.
const LIST_LEAST: u32 = 2_000;

impl Planner {
    /// Cycles of the next piece of work.
    pub(crate) fn cycles(&self, plan: &Plan) -> u32 {
        let jumps = || JUMP * u32::from(self.sweep.jumps(plan));
        let nodes = if plan.has_turn() {
            NODES_COUNT
        } else {
            plan.intervals
        };
        let of_nodes =
            |cycles: u32| LIST_LEAST + (cycles - LIST_LEAST) * u32::from(nodes) / u32::from(NODES_COUNT);
        match self.stage {
            Stage::Walk => self.walker.cycles(plan),
            Stage::Factor | Stage::Relax => FACTOR + jumps(),
            Stage::Assemble => ASSEMBLE + jumps(),
            Stage::Solve => of_nodes(SOLVE),
            Stage::Reach => REACH + jumps(),
            Stage::Check if plan.knot_count > 0 => CHECK + CHECK_JUMPS,
            Stage::Check => CHECK,
            Stage::Scale if plan.has_turn() => BLEND,
            Stage::Weigh | Stage::Scale | Stage::Take | Stage::Finish => of_nodes(LIST),
            Stage::Gate if self.gate.is_placed() => GATE,
            Stage::Gate => GATE_PLACE,
            Stage::Done => 0,
        }
    }
}
