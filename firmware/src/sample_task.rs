//! The body of the sample task, without RTIC, so that it can be linked separately: `no-panic`
//! proves that no panic is reachable from this file and the functions that it calls.

use core::hint::black_box;

use controller::{
    machine::Instruction,
    realtime::{RealTime, TickInput},
};
use heapless::spsc::Consumer;

use crate::{
    drivers::{
        cycle_counter::CycleCounter,
        drive_enable::{DriveEnable, WritePorts},
        safety_inputs::{ReadPorts, SafetyInputs},
        sample_timer::SampleTimer,
        step_output::StepDriver,
        supply,
        watchdog::{Registers, Watchdog},
    },
    events::EventQueue,
    plan_task,
};

/// The safety peripherals: inputs, drive enables, watchdog. Separate from the task, because in one structure with them the compiler
/// no longer knows the lengths of the task's queues.
pub(crate) struct Guards<I, O, W> {
    /// The safety inputs.
    pub(crate) inputs: SafetyInputs<I>,
    /// The drives, spindle and coolant.
    pub(crate) drives: DriveEnable<O>,
    /// The watchdog, started.
    pub(crate) watchdog: Watchdog<W>,
}

/// The task's local state.
pub(crate) struct SampleTask {
    timer: SampleTimer,
    counter: CycleCounter,
    commands: Consumer<'static, Instruction>,
    events: EventQueue,
    /// Periods missed at the end of the last tick.
    missed: u32,
    /// Cycles of the last tick.
    cycles: u32,
}

impl SampleTask {
    /// The task before its first tick.
    pub(crate) const fn new(
        timer: SampleTimer,
        counter: CycleCounter,
        commands: Consumer<'static, Instruction>,
        events: EventQueue,
    ) -> Self {
        Self {
            timer,
            counter,
            commands,
            events,
            missed: 0,
            cycles: 0,
        }
    }

    /// One tick. The output is not part of the task: the compiler knows the queues' capacities only as long as no part of the
    /// task is passed by reference, and otherwise divides by them.
    #[inline]
    pub(crate) fn tick<S, I, O, W>(
        &mut self,
        real_time: &mut RealTime<S>,
        guards: &mut Guards<I, O, W>,
        output: &mut StepDriver,
    ) where
        S: AsRef<[i32]> + AsMut<[i32]>,
        I: ReadPorts,
        O: WritePorts,
        W: Registers,
    {
        // The address is a link-time constant, and each access to a field would load its own address in
        // two instructions. Opaque to the compiler, it stays in a register, and fields are offsets.
        let real_time = black_box(real_time);
        let begun = self.counter.now();
        self.timer.begin();
        // First, because the pulses of a reversing axis depend on the direction.
        if let Err(fault) = output.begin(real_time.directions()) {
            real_time.controlled_stop(fault);
        }
        if let Some(command) = self.commands.dequeue() {
            real_time.obey(command, &mut self.events);
        }
        let input = TickInput {
            missed: self.missed,
            cycles: self.cycles,
            lines: guards.inputs.read().or(supply::lines()),
        };
        real_time.tick(input, &mut self.events);
        if let Some(inverted) = guards.drives.set(real_time.outputs()) {
            output.set_levels(inverted);
        }
        if let Some(slots) = output.slots() {
            real_time.pulses(slots);
        }
        self.cycles = self.counter.since(begun);
        self.missed = self.timer.end();
        if real_time.feeds_watchdog(self.missed, self.cycles) {
            guards.watchdog.feed();
        }
        plan_task::pend(real_time);
    }
}
