//! Follows the program flow instruction by instruction, and charges each instruction to the exception it runs in and to a stage.
//!
//! The only input is the address that is executed next. From the addresses follows whether a branch was taken; a handler's first
//! instruction without a branch to it is an exception entry; a return in a handler without an open call leaves the exception
//! (`BX LR` or `POP {PC}` with `0xFFFFFFxx`).

use core::cell::Cell;

use crate::cost::{self, AddressedInstruction, Cycles, EXCEPTION, LAZY_STACKING};
use crate::decode::{Branch, Class, Instruction, decode};
use crate::operations::{Counter, Operations};
use crate::plan::{Plan, STAGES, Stage};
use crate::record::Record;

/// Greatest nesting of exceptions: one level for each of the 16 priorities, and the thread.
const CONTEXTS_MAX: usize = 17;

/// First address of the RAM, where the stack ends.
pub const RAM: u32 = 0x2000_0000;

/// Exceptions of the STM32F405: 16 of the core, 82 of the chip.
const VECTORS: u32 = 98;

/// An instruction of the image.
#[derive(Clone, Debug)]
struct ImageInstruction {
    located: AddressedInstruction,
    stage: Option<Stage>,
    handler: Option<u32>,
    /// Whether a function begins here.
    starts: bool,
    /// Its cycles after the instruction before it in memory, once known.
    in_line: Cell<Option<Cycles>>,
}

impl ImageInstruction {
    fn cycles_after(&self, neighbour: &Instruction) -> Cycles {
        self.in_line.get().unwrap_or_else(|| {
            let cycles = cost::straight(Some(neighbour), &self.located.instruction);
            self.in_line.set(Some(cycles));
            cycles
        })
    }
}

/// A thread of execution: the thread mode, or a handler.
#[derive(Debug, Default)]
struct Context {
    exception: u32,
    /// Index of the instruction executed last.
    last: Option<usize>,
    /// Index of the stage that it was charged to.
    charged: usize,
    /// Stages of the open calls, the innermost last.
    callers: Vec<Stage>,
    float: bool,
    instructions: u32,
    stages: [Cycles; STAGES],
    counter: Counter,
    operations: [Operations; STAGES],
}

impl Context {
    /// The stage that an instruction is charged to: that of a caller that keeps its callees, else its own, else its caller's.
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

/// Cycles and operations of all contexts.
#[derive(Debug)]
pub struct Account {
    code: Code,
    flow: Flow,
}

/// The image's instructions.
#[derive(Debug)]
struct Code {
    plan: Plan,
    decoded: Vec<Option<ImageInstruction>>,
}

/// The state of the execution.
#[derive(Debug)]
struct Flow {
    contexts: Vec<Context>,
    elsewhere: u32,
    unknown: u32,
    stack_low: u32,
}

impl Account {
    /// Zero cycles, in thread mode.
    #[must_use]
    pub fn new(plan: Plan) -> Self {
        let halfwords = plan.code.len() / 2;
        let stack_low = plan.stack_end;
        Self {
            code: Code {
                plan,
                decoded: vec![None; halfwords],
            },
            flow: Flow {
                contexts: vec![Context::default()],
                elsewhere: 0,
                unknown: 0,
                stack_low,
            },
        }
    }

    /// Decodes the instruction at an address; required before its first execution. Its index; `None` outside the code.
    pub fn decode(&mut self, address: u32) -> Option<usize> {
        self.code.decode(address)
    }

    /// Records a store: updates the lowest stack address if the address is on the stack. Returns that; a store above it changes nothing.
    pub fn store(&mut self, address: u32) -> u32 {
        let lowest = &mut self.flow.stack_low;
        if (RAM..*lowest).contains(&address) {
            *lowest = address;
        }
        *lowest
    }

    /// Charges the instruction at this index, before it is executed. The record of the tick or of the planning if the preceding instruction ended one:
    /// boxed, because most end none.
    pub fn execute(&mut self, index: usize) -> Option<Box<Record>> {
        self.flow.execute(&self.code, index)
    }
}

impl Code {
    fn decode(&mut self, address: u32) -> Option<usize> {
        let index = (address.checked_sub(self.plan.base)? / 2) as usize;
        let (first, second) = (self.plan.halfword(index), self.plan.halfword(index + 1));
        let handler = (2..VECTORS).find(|exception| self.plan.vector(*exception) == address);
        *self.decoded.get_mut(index)? = Some(ImageInstruction {
            located: AddressedInstruction {
                address,
                instruction: decode(address, first, second),
            },
            stage: self.plan.stages.get(index).copied().flatten(),
            handler,
            starts: self.plan.starts.get(index).copied().unwrap_or(false),
            in_line: Cell::new(None),
        });
        Some(index)
    }

    /// By reference: an instruction is looked up several times for each that is executed.
    fn instruction(&self, index: Option<usize>) -> Option<&ImageInstruction> {
        self.decoded.get(index?)?.as_ref()
    }
}

impl Flow {
    fn execute(&mut self, code: &Code, index: usize) -> Option<Box<Record>> {
        let now = code.instruction(Some(index))?;
        let (ended, leaves) = match self.before(code) {
            // Most instructions.
            Some(before) if before.located.end() == now.located.address => (None, false),
            _ => self.leave(code),
        };
        if let Some(exception) = now.handler.filter(|_| leaves || self.is_entry(code, now)) {
            self.enter(exception, now);
        }
        self.run(code, index, now);
        ended
    }

    /// The instruction that the running context has executed last.
    fn before<'code>(&self, code: &'code Code) -> Option<&'code ImageInstruction> {
        code.instruction(self.contexts.last()?.last)
    }

    /// Whether a handler's first instruction was reached without a branch: an exception entry.
    fn is_entry(&self, code: &Code, now: &ImageInstruction) -> bool {
        self.before(code)
            .is_none_or(|before| match before.located.instruction.class {
                Class::Branch(Branch::Direct(to) | Branch::Call(to)) => to != now.located.address,
                _ => true,
            })
    }

    fn enter(&mut self, exception: u32, now: &ImageInstruction) {
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
                pessimistic: EXCEPTION + cost::lines_entered(None, &now.located),
            },
        );
        self.contexts.push(context);
    }

    /// Closes the exception if the preceding instruction, which the next does not follow in memory, returned from it. The record if it was the sample or the planning task, and
    /// whether an exception was left.
    fn leave(&mut self, code: &Code) -> (Option<Box<Record>>, bool) {
        let (Some(context), Some(before)) = (self.contexts.last(), self.before(code)) else {
            return (None, false);
        };
        let in_handler = context.exception != 0 && context.callers.is_empty();
        if !in_handler || !before.located.instruction.is_return() {
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
        (self.close(code, &context), true)
    }

    fn close(&mut self, code: &Code, context: &Context) -> Option<Box<Record>> {
        let is_planning = context.exception == code.plan.planning;
        if !is_planning && context.exception != code.plan.exception {
            return None;
        }
        Some(Box::new(Record {
            is_planning,
            instructions: context.instructions,
            elsewhere: if is_planning {
                0
            } else {
                core::mem::take(&mut self.elsewhere)
            },
            unknown: self.unknown,
            stack_low: self.stack_low,
            stages: context.stages,
            operations: context.operations,
        }))
    }

    fn run(&mut self, code: &Code, index: usize, now: &ImageInstruction) {
        let before = self.before(code);
        let Some(context) = self.contexts.last_mut() else {
            return;
        };
        let instruction = &now.located.instruction;
        let cycles = match before {
            Some(before) if before.located.end() == now.located.address => {
                now.cycles_after(&before.located.instruction)
            }
            // A jump flushes the pipeline.
            jumped => {
                if let Some(before) = jumped {
                    follow(context, &before.located, now);
                }
                cost::straight(None, instruction)
            }
        };
        let stage = context.stage(now.stage);
        context.last = Some(index);
        context.charged = stage as usize;
        context.charge(stage as usize, cycles);
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
        if context.exception != code.plan.exception {
            self.elsewhere = self.elsewhere.saturating_add(1);
        }
    }
}

/// Charges a taken branch to an instruction that does not follow the preceding one in memory, and updates the open calls.
fn follow(context: &mut Context, before: &AddressedInstruction, now: &ImageInstruction) {
    let instruction = &before.instruction;
    if !instruction.may_branch() {
        return;
    }
    context.charge(context.charged, cost::taken(before, &now.located));
    let stage = Stage::ALL.get(context.charged).copied().unwrap_or(Stage::Rest);
    if instruction.is_call() {
        context.callers.push(stage);
    } else if instruction.is_return() {
        context.callers.pop();
    } else if let Some(caller) = context.callers.last_mut().filter(|_| now.starts) {
        // A tail call: the function returns to the caller of the function that branched, which is charged for it.
        *caller = stage;
    }
}
