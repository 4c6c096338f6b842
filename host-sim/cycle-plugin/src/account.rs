//! Follows the processor from instruction to instruction, and charges each to the exception it runs in and to a stage.
//!
//! What is known is only which address is executed next. From that follows whether a branch was taken; that a handler's
//! first instruction without a branch to it is an exception entry; and that a return in a handler that has no call left to
//! return from leaves the exception (`BX LR` or `POP {PC}` with `0xFFFFFFxx`).

use crate::cost::{self, Cycles, EXCEPTION, LAZY_STACKING, Placed};
use crate::decode::{Branch, Class, decode};
use crate::operations::{Counter, Operations};
use crate::plan::{Plan, STAGES, Stage};
use crate::record::Record;

/// Exceptions that can be nested: as many as there are priorities.
const CONTEXTS_MAX: usize = 17;

/// Exceptions of the STM32F405: 16 of the core, 82 of the chip.
const VECTORS: u32 = 98;

/// An instruction of the image.
#[derive(Clone, Copy, Debug)]
struct Known {
    placed: Placed,
    stage: Option<Stage>,
    handler: Option<u32>,
    /// A function begins here.
    starts: bool,
}

/// What runs: the thread, or a handler.
#[derive(Debug, Default)]
struct Context {
    exception: u32,
    /// Index of the instruction executed last.
    last: Option<usize>,
    /// Where the cycles of that went.
    charged: usize,
    /// Stages of the callers, the innermost last.
    callers: Vec<Stage>,
    float: bool,
    instructions: u32,
    stages: [Cycles; STAGES],
    counter: Counter,
    operations: [Operations; STAGES],
}

impl Context {
    /// The stage of an instruction: that of a caller who keeps its callees, its own, or its caller's.
    fn stage(&self, own: Option<Stage>) -> Stage {
        match self.callers.last() {
            Some(caller) if caller.keeps_callees() => *caller,
            caller => own.or(caller.copied()).unwrap_or(Stage::Rest),
        }
    }

    fn charge(&mut self, stage: usize, cycles: Cycles) {
        if let Some(account) = self.stages.get_mut(stage) {
            account.add(cycles);
        }
    }
}

/// All accounts.
#[derive(Debug)]
pub struct Account {
    plan: Plan,
    known: Vec<Option<Known>>,
    contexts: Vec<Context>,
    elsewhere: u32,
    unknown: u32,
    stack_low: u32,
}

impl Account {
    /// Accounts of a plan, nothing executed yet.
    #[must_use]
    pub fn new(plan: Plan) -> Self {
        let halfwords = plan.code.len() / 2;
        let stack_low = plan.stack_end;
        Self {
            plan,
            known: vec![None; halfwords],
            contexts: vec![Context::default()],
            elsewhere: 0,
            unknown: 0,
            stack_low,
        }
    }

    /// Index of the instruction at an address; has to be asked for before it is executed. None outside the code.
    pub fn place(&mut self, address: u32) -> Option<usize> {
        let index = (address.checked_sub(self.plan.base)? / 2) as usize;
        let (first, second) = (self.plan.halfword(index), self.plan.halfword(index + 1));
        let handler = (2..VECTORS).find(|exception| self.plan.vector(*exception) == address);
        *self.known.get_mut(index)? = Some(Known {
            placed: Placed {
                address,
                instruction: decode(address, first, second),
            },
            stage: self.plan.stages.get(index).copied().flatten(),
            handler,
            starts: self.plan.starts.get(index).copied().unwrap_or(false),
        });
        Some(index)
    }

    /// Whether an address belongs to the stack; remembers the lowest.
    pub fn wrote(&mut self, address: u32) {
        if (0x2000_0000..self.stack_low).contains(&address) {
            self.stack_low = address;
        }
    }

    fn known(&self, index: Option<usize>) -> Option<Known> {
        self.known.get(index?).copied().flatten()
    }

    /// The instruction at this index is about to be executed. Yields the record of the tick that ended with the one
    /// before, if one did.
    pub fn execute(&mut self, index: usize) -> Option<Record> {
        let known = self.known(Some(index))?;
        let (ended, leaves) = self.leave(&known);
        if let Some(exception) = known.handler.filter(|_| leaves || self.is_entry(&known)) {
            self.enter(exception, &known);
        }
        self.run(index, &known);
        ended
    }

    /// Whether a handler's first instruction was not branched to.
    fn is_entry(&self, known: &Known) -> bool {
        let before = self.contexts.last().and_then(|context| self.known(context.last));
        before.is_none_or(|before| match before.placed.instruction.class {
            Class::Branch(Branch::Direct(to) | Branch::Call(to)) => to != known.placed.address,
            _ => true,
        })
    }

    fn enter(&mut self, exception: u32, known: &Known) {
        if self.contexts.len() > CONTEXTS_MAX {
            return;
        }
        let mut context = Context {
            exception,
            ..Context::default()
        };
        context.charge(
            Stage::Exception as usize,
            Cycles {
                nominal: EXCEPTION,
                pessimistic: EXCEPTION + cost::lines_entered(None, &known.placed),
            },
        );
        self.contexts.push(context);
    }

    /// If the instruction before left the exception, closes it. Whether it did, and the record of the watched task.
    fn leave(&mut self, next: &Known) -> (Option<Record>, bool) {
        let Some(context) = self.contexts.last() else {
            return (None, false);
        };
        let Some(before) = self.known(context.last) else {
            return (None, false);
        };
        let in_handler = context.exception != 0 && context.callers.is_empty();
        let fell_through = next.placed.address == before.placed.end();
        if !in_handler || !before.placed.instruction.is_return() || fell_through {
            return (None, false);
        }
        let Some(mut context) = self.contexts.pop() else {
            return (None, false);
        };
        let restored = if context.float { LAZY_STACKING } else { 0 };
        context.charge(
            Stage::Exception as usize,
            Cycles {
                nominal: EXCEPTION,
                pessimistic: EXCEPTION + restored + cost::WAIT_STATES,
            },
        );
        (self.close(&context), true)
    }

    fn close(&mut self, context: &Context) -> Option<Record> {
        if context.exception != self.plan.exception {
            return None;
        }
        Some(Record {
            instructions: context.instructions,
            elsewhere: core::mem::take(&mut self.elsewhere),
            unknown: self.unknown,
            stack_low: self.stack_low,
            stages: context.stages,
            operations: context.operations,
        })
    }

    fn run(&mut self, index: usize, known: &Known) {
        let last = self.contexts.last().and_then(|context| context.last);
        let before = self.known(last);
        let Some(context) = self.contexts.last_mut() else {
            return;
        };
        if let Some(before) = before {
            follow(context, &before.placed, known);
        }
        let instruction = &known.placed.instruction;
        // Nothing of what was before a jump is left in the pipeline.
        let neighbour = before
            .filter(|before| before.placed.end() == known.placed.address)
            .map(|before| before.placed.instruction);
        let stage = context.stage(known.stage);
        context.last = Some(index);
        context.charged = stage as usize;
        context.charge(stage as usize, cost::straight(neighbour.as_ref(), instruction));
        let operations = context.counter.count(instruction);
        if let Some(total) = context.operations.get_mut(stage as usize) {
            *total = total.plus(operations);
        }
        if instruction.class.is_float() && context.exception != 0 && !context.float {
            context.float = true;
            let stacking = Cycles {
                nominal: 0,
                pessimistic: LAZY_STACKING,
            };
            context.charge(Stage::Exception as usize, stacking);
        }
        if instruction.class == Class::Unknown {
            self.unknown = self.unknown.saturating_add(1);
        }
        context.instructions = context.instructions.saturating_add(1);
        if context.exception != self.plan.exception {
            self.elsewhere = self.elsewhere.saturating_add(1);
        }
    }
}

/// The instruction before was a branch if what runs now does not stand behind it: charges that, and keeps the callers.
fn follow(context: &mut Context, before: &Placed, now: &Known) {
    let instruction = &before.instruction;
    if now.placed.address == before.end() || !instruction.may_branch() {
        return;
    }
    context.charge(context.charged, cost::taken(before, &now.placed));
    let stage = Stage::ALL.get(context.charged).copied().unwrap_or(Stage::Rest);
    if instruction.is_call() {
        context.callers.push(stage);
    } else if instruction.is_return() {
        context.callers.pop();
    } else if let Some(caller) = context.callers.last_mut().filter(|_| now.starts) {
        // A tail call: who branches here takes the place of his caller, to whom the function returns.
        *caller = stage;
    }
}
