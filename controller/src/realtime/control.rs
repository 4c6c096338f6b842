//! State of the real-time half except the interpolator.

use interp_core::{
    command::Command,
    fault::{Fault, FaultKind},
    sample::Sample,
};
use protocol::message::{Clock, PassDigest, Report};

use super::{TickInput, moves, run::RunRecord};
use crate::{
    machine::{Event, Events, Instruction},
    manual::Manual,
    safety::Safety,
    spindle::Spindle,
};

/// The planning of a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Planning {
    /// Complete, or there was nothing to plan.
    Complete,
    /// Not complete.
    Due,
    /// Complete, but not before the next sample was due.
    Late,
}

/// State of the real-time half except the interpolator.
#[derive(Debug)]
pub(super) struct Control {
    pub(super) run: RunRecord,
    /// In lockstep: periods that may still pass.
    pub(super) credit: u32,
    /// In lockstep: an instruction was executed in this tick. Time stands still for that tick, so that the instruction does not add to the cycles of a period.
    pub(super) obeyed: bool,
    /// In lockstep: the last period with credit has ended, and that is to be reported in the next tick, in which time stands still likewise.
    pub(super) spent: bool,
    /// Cycles that a tick may take while the tool moves on a free clock.
    pub(super) tick_budget: u32,
    /// Halts reported, or lost, since power-up.
    pub(super) halts: u32,
    pub(super) clock: Clock,
    /// Planning of the last period.
    pub(super) planning: Planning,
    pub(super) report: Report,
    /// Command that waits for the next period.
    pub(super) command: Option<Command>,
    pub(super) safety: Safety,
    /// Motion outside a job.
    pub(super) manual: Manual,
    pub(super) spindle: Spindle,
    /// The profile's levels of steps and enables, as in [`crate::spindle::output`].
    pub(super) levels: u32,
    /// The next run within limits has to begin at its job's home.
    pub(super) from_home: bool,
    /// The run is to be held because the host is gone.
    pub(super) host_is_gone: bool,
    /// The run is to be held above the surface.
    pub(super) pauses: bool,
    /// The step outputs lead to drives.
    pub(super) has_drives: bool,
    /// Words of a streamed job up to which there was room, as last reported.
    pub(super) room: u32,
    /// A pass that is over, until it is reported: the tick that begins the next one is the longest.
    pub(super) over: Option<PassDigest>,
}

impl Control {
    pub(super) const fn new() -> Self {
        Self {
            run: RunRecord::NEW,
            credit: 0,
            obeyed: false,
            spent: false,
            tick_budget: u32::MAX,
            halts: 0,
            clock: Clock::Free,
            planning: Planning::Complete,
            report: Report::Digests,
            command: None,
            safety: Safety::NEW,
            manual: Manual::NEW,
            spindle: Spindle::NEW,
            levels: 0,
            from_home: true,
            host_is_gone: false,
            pauses: false,
            has_drives: false,
            room: 0,
            over: None,
        }
    }

    /// Enqueues an event, or counts it as lost.
    pub(super) fn put(&mut self, event: Event, events: &mut impl Events) {
        if !events.put(event) {
            self.run.events_lost = self.run.events_lost.saturating_add(1);
        }
    }

    /// Reports the pass that is over, if it is not reported yet.
    #[cold]
    #[inline(never)]
    pub(super) fn report_over(&mut self, events: &mut impl Events) {
        if let Some(over) = self.over.take() {
            self.put(Event::Pass(over), events);
        }
    }

    /// Whether this sample has no path from the previous one: without limits, the first of each pass.
    #[inline]
    pub(super) const fn jumps(&self, sample: &Sample, has_limits: bool) -> bool {
        !has_limits && moves(sample.state) && sample.tick == self.run.pass.first_tick
    }

    /// Executes an instruction; false where a `Halted` is due: for a `Run` without ticks, and for
    /// a change of the clock before the end of a `Run` was reported.
    pub(super) fn obey(&mut self, instruction: Instruction) -> bool {
        self.obeyed = true;
        if let Instruction::Command(command) = instruction {
            // Taken back by a hold, a resume leaves the spindle as it was.
            if command == Command::Hold && self.spindle.is_awaited() {
                self.spindle.off();
            }
            self.spindle.stop_waiting();
        }
        match instruction {
            // A queued abort or stop is not replaced by a later command.
            Instruction::Command(_) if self.command == Some(Command::Abort) => {}
            Instruction::Command(command)
                if self.command == Some(Command::Stop) && command != Command::Abort => {}
            Instruction::Command(command) => self.command = Some(command),
            Instruction::Clock(clock) => {
                self.clock = clock;
                self.credit = 0;
                return !core::mem::take(&mut self.spent);
            }
            Instruction::Run { ticks } => {
                if self.clock == Clock::Lockstep {
                    self.credit = self.credit.saturating_add(ticks);
                }
                return self.credit > 0;
            }
            Instruction::Report(report) => self.report = report,
            Instruction::Override { percent } => self.safety.set_override(percent),
        }
        true
    }

    /// Whether the last tick needs no record: no tick was missed, and its cycles exceed neither the maximum so far nor the budget.
    #[inline]
    pub(super) const fn is_in_time(&self, input: TickInput) -> bool {
        input.missed == 0 && input.cycles <= self.run.tick_cycles_max && input.cycles <= self.tick_budget
    }

    /// Records misses and cycles; returns their fault while the tool moves on a free clock.
    #[cold]
    pub(super) fn note_time(&mut self, input: TickInput) -> Option<Fault> {
        self.run.deadline_misses = self.run.deadline_misses.saturating_add(input.missed);
        self.run.tick_cycles_max = self.run.tick_cycles_max.max(input.cycles);
        if self.clock != Clock::Free {
            None
        } else if input.missed > 0 {
            Some(Fault::new(FaultKind::DeadlineMissed, count(input.missed)))
        } else if input.cycles > self.tick_budget {
            Some(Fault::new(FaultKind::TickOverBudget, count(input.cycles)))
        } else {
            None
        }
    }
}

/// A count as the value of a fault: exact up to 2^24, which is 4.6 h of missed ticks or 0.1 s of cycles.
#[allow(
    clippy::cast_precision_loss,
    reason = "a count beyond 2^24 needs no last digit"
)]
const fn count(number: u32) -> f32 {
    number as f32
}
