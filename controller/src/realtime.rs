//! The real-time half: one call per tick of the sample timer, and one for the planning after each.
//!
//! **Bound.** A tick: one [`Interpolator::tick`], a digest of 17 words (about 125 cycles on a Cortex-M4), no loop. The planning: one
//! [`Interpolator::plan`].
//! **Cost.** Rare cases (commands, misses, ends of passes and runs) are separate functions: a tick in the middle of a
//! pass copies no data and creates no event except the sample, if the host requested samples.
//! **Missed tick.** Counted; on a free clock while the tool moves it stops the run with
//! [`FaultKind::DeadlineMissed`], because the tool stopped for a period in which the feed was commanded. The run stops
//! along the path ([`Interpolator::controlled_stop`]).
//! **Late planning.** The planning of a period that is not complete when the next sample is due counts as a missed tick and stops the run in the
//! same way. In lockstep the next period waits for it.
//! **Tick over budget.** The next tick reads its cycles and stops the run with [`FaultKind::TickOverBudget`] in the
//! same way, before ticks are missed.
//! **Inputs.** Evaluated in every tick of the timer, in lockstep also between periods; see [`crate::safety`].

mod control;
mod load;
mod pause;
mod run;
mod start;
mod status;

use interp_core::{
    command::{Command, Inputs},
    fault::{Fault, FaultKind, Result},
    interpolator::Interpolator,
    job::STORE_WORDS,
    sample::State,
    steps::{BUFFER_WORDS, CheckedSteps, Steps},
};
use protocol::message::{Clock, InputLines, MotionEnd, Report, ResetCause};

use self::control::{Control, Planning};
use crate::{
    machine::{Event, Events, Instruction},
    safety::Stop,
};

/// Inputs of a tick of the sample timer: timing of the one before, and the board's inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickInput {
    /// Ticks of the sample timer that were missed since the last call.
    pub missed: u32,
    /// CPU cycles of the last tick; 0 where the board cannot measure.
    pub cycles: u32,
    /// The present safety inputs.
    pub lines: InputLines,
}

/// Whether the tool moves, so that each sample belongs to the run.
const fn moves(state: State) -> bool {
    matches!(
        state,
        State::Running | State::Linking | State::Holding | State::Stopping
    )
}

/// The real-time half of the board. `S`: the job store, see [`Interpolator`].
#[derive(Debug)]
pub struct RealTime<S = [i32; STORE_WORDS]> {
    control: Control,
    /// `None` on a machine without step outputs.
    steps: Option<Steps>,
    interpolator: Interpolator<S>,
}

impl<const WORDS: usize> Default for RealTime<[i32; WORDS]> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const WORDS: usize> RealTime<[i32; WORDS]> {
    /// An idle machine on a free clock, reporting digests, with a store that it owns; ticks have no cycle budget.
    #[must_use]
    pub const fn new() -> Self {
        Self::with_store([0; WORDS])
    }
}

impl<S> RealTime<S> {
    /// An idle machine on a free clock, reporting digests; ticks have no cycle budget.
    #[must_use]
    pub const fn with_store(store: S) -> Self {
        Self {
            control: Control::new(),
            steps: None,
            interpolator: Interpolator::with_store(store),
        }
    }
}

impl<S: AsRef<[i32]> + AsMut<[i32]>> RealTime<S> {
    /// Sets the cycle budget of a tick while the tool moves on a free clock, CPU cycles.
    pub const fn set_tick_budget(&mut self, cycles: u32) {
        self.control.tick_budget = cycles;
    }

    /// Sets the reset cause.
    pub const fn set_reset_cause(&mut self, cause: ResetCause) {
        self.control.safety.set_reset_cause(cause);
    }

    /// Declares that the step outputs lead to drives: jobs without limits are then refused, unless no homing is required.
    pub const fn set_has_drives(&mut self, has_drives: bool) {
        self.control.has_drives = has_drives;
    }

    /// Adds step outputs on these pins of a port, with the axes at the origin.
    pub fn set_step_pins(&mut self, checked: CheckedSteps, pins: [u8; 3]) {
        self.steps = Some(Steps::new(checked, pins));
    }

    /// Changes the settings of the drives; no effect without step outputs.
    ///
    /// # Errors
    /// [`FaultKind::WrongState`] while a run is under way.
    pub fn set_steps(&mut self, checked: &CheckedSteps) -> Result<()> {
        let state = self.interpolator.state();
        if state.is_under_way() {
            return Err(Fault::new(FaultKind::WrongState, f32::from(state as u8)));
        }
        if let Some(steps) = &mut self.steps {
            steps.configure(*checked);
        }
        Ok(())
    }

    /// The step generator, if the machine has step outputs.
    #[must_use]
    pub const fn steps(&self) -> Option<&Steps> {
        self.steps.as_ref()
    }

    /// Axes whose direction is minus in the period that begins, one bit each; see [`Steps::directions`].
    #[must_use]
    #[inline]
    pub fn directions(&self) -> u8 {
        self.steps.as_ref().map_or(0, Steps::directions)
    }

    /// After the tick: computes the pulses that move the axes to its sample in the next period; see [`Steps::step`]. Too many steps
    /// stop the run, or the motion outside a job, along its path; those that do not fit are made up for in the periods after.
    ///
    /// A job without limits has no approach to its passes: the axes are assumed to stand at the first sample of each, as if
    /// moved there by other means. Such a job is for evaluation only, not for a machine.
    #[inline]
    pub fn pulses(&mut self, slots: &mut [u32; BUFFER_WORDS]) {
        let Some(steps) = &mut self.steps else { return };
        let sample = self.interpolator.last();
        if self.control.jumps(sample, self.interpolator.has_limits()) {
            steps.place(sample.cl_nm);
        }
        let to = if moves(sample.state) {
            sample.cl_nm
        } else if core::mem::take(&mut self.control.manual.emits) {
            self.control.manual.at_nm()
        } else {
            steps.target_nm()
        };
        if let Err(fault) = steps.step(to, slots) {
            self.controlled_stop(fault);
        }
    }

    /// Controlled stop (category 1) with an external fault, along the path. Outside a run the faults of the steps stop the axes; pulses that were not emitted lose
    /// their position.
    #[cold]
    #[inline(never)]
    pub fn controlled_stop(&mut self, fault: Fault) {
        if fault.kind == FaultKind::StepOutput {
            self.control.safety.set_homed(None);
            self.lose_position();
        }
        match fault.kind {
            _ if moves(self.interpolator.state()) => self.interpolator.controlled_stop(fault),
            FaultKind::StepRate => self.control.manual.stop(MotionEnd::StepRate),
            FaultKind::StepOutput => self.control.manual.stop(MotionEnd::StepOutput),
            _ => {}
        }
    }

    /// Executes an instruction, before the tick.
    #[cold]
    #[inline(never)]
    pub fn obey(&mut self, instruction: Instruction, events: &mut impl Events) {
        if !self.control.obey(instruction) {
            self.halt(events);
        }
    }

    /// One tick of the sample timer. In lockstep time stands still while the queue of events is full, so that none is lost.
    #[inline]
    pub fn tick(&mut self, input: TickInput, events: &mut impl Events) {
        if !self.control.safety.is_unchanged(input.lines) {
            self.guard(input.lines, events);
        }
        let was_under_way = self.interpolator.state().is_under_way();
        if !self.control.is_in_time(input) {
            self.note_time(input);
        }
        if self.control.planning != Planning::Complete {
            self.note_late_planning();
        }
        if self.control.clock == Clock::Lockstep && !self.may_step(events) {
            return;
        }
        self.step(was_under_way, input.lines, events);
    }

    /// A missed tick, or one with more cycles than before or than the budget.
    #[cold]
    #[inline(never)]
    fn note_time(&mut self, input: TickInput) {
        if let Some(fault) = self.control.note_time(input) {
            self.controlled_stop(fault);
        }
    }

    /// A planning that was not complete when this tick was due: a missed deadline. Not in lockstep, where time waits for the planning.
    #[cold]
    #[inline(never)]
    fn note_late_planning(&mut self) {
        if self.control.clock == Clock::Free {
            self.note_time(TickInput {
                missed: 1,
                ..TickInput::default()
            });
        }
        if self.control.planning == Planning::Late {
            self.control.planning = Planning::Complete;
        }
    }

    /// A tick with other inputs than the last, or with a link timeout.
    #[cold]
    #[inline(never)]
    fn guard(&mut self, lines: InputLines, events: &mut impl Events) {
        let under_way = self.interpolator.state().is_under_way();
        let before = self.control.safety.status().lines;
        match self.control.safety.watch(lines, under_way) {
            Some(Stop::Uncontrolled(fault)) => self.interpolator.uncontrolled_stop(fault),
            Some(Stop::Controlled(fault)) => self.interpolator.controlled_stop(fault),
            None => {}
        }
        let steady = self.control.safety.status().lines;
        self.pause_by_inputs(before, steady);
        if !self.control.safety.drives_on() {
            self.control.manual.drives_are_off(steady);
            self.control.spindle.off();
            if !self.control.safety.status().homed {
                self.lose_position();
            }
        }
        // Reported here, because in lockstep a further period that would report it may never come.
        if under_way && !self.interpolator.state().is_under_way() {
            self.control.safety.ending = true;
            // The command was for the run that has ended: an abort must not acknowledge a fault not yet reported.
            self.control.command = None;
        }
        if self.control.safety.ending {
            if self.control.clock == Clock::Free || events.has_room() {
                self.control.safety.ending = false;
                self.end_run(events);
            }
            self.control.safety.recheck();
        }
        if self.control.safety.has_timed_out() && self.control.spindle.is_commanded() {
            self.control.spindle.off();
        }
        let state = self.interpolator.state();
        let is_held = state == State::Held;
        let holds = is_held || (self.control.command.is_none() && Command::Hold.is_allowed(state));
        if self
            .control
            .safety
            .check_link_timeout(self.control.clock, state, holds)
        {
            if is_held {
                self.stand_without_host();
            } else {
                self.control.command = Some(Command::Hold);
                self.control.host_is_gone = true;
            }
        }
    }

    /// Whether a tick is required immediately: in lockstep, with credit left or with its end to report. A board whose time is
    /// simulated then need not wait for its timer.
    #[must_use]
    pub fn wants_tick(&self) -> bool {
        let has_credit = self.control.credit > 0 && !self.interpolator.is_starved();
        self.control.clock == Clock::Lockstep && (has_credit || self.control.spent)
    }

    /// Whether the planning of the last period is due: [`Self::plan`] is then to be called before the next tick.
    #[must_use]
    #[inline]
    pub const fn has_to_plan(&self) -> bool {
        matches!(self.control.planning, Planning::Due)
    }

    /// The planning of the last period, from a task of lower priority than the tick's; see [`Interpolator::plan`]. Once a period: does nothing where
    /// it is complete.
    #[inline]
    pub fn plan(&mut self) {
        if self.has_to_plan() {
            self.control.planning = Planning::Complete;
            self.interpolator.plan();
        }
    }

    /// Reports that the next sample was due before the planning was complete; the next tick counts it as a missed one.
    #[cold]
    pub const fn planning_was_late(&mut self) {
        self.control.planning = Planning::Late;
    }

    /// In lockstep: whether a period passes in this tick.
    #[inline]
    fn may_step(&mut self, events: &mut impl Events) -> bool {
        let waits = self.control.planning == Planning::Due || !events.has_room();
        if core::mem::take(&mut self.control.obeyed) || waits {
            return false;
        }
        if core::mem::take(&mut self.control.spent) {
            self.halt(events);
            return false;
        }
        let Some(credit) = self.control.credit.checked_sub(1) else {
            return false;
        };
        self.control.credit = credit;
        true
    }

    /// Executes one period.
    #[inline]
    fn step(&mut self, was_under_way: bool, lines: InputLines, events: &mut impl Events) {
        if self.control.over.is_some() {
            self.control.report_over(events);
        }
        if !was_under_way && self.control.manual.is_active() {
            self.move_manually(lines);
        }
        let mut command = self.control.command.take();
        if matches!(command, Some(Command::Start | Command::Resume)) {
            command = self.with_spindle(command);
        }
        self.control.pauses |= command == Some(Command::Pause);
        let starts = command == Some(Command::Start);
        if starts && Command::Start.is_allowed(self.interpolator.state()) {
            command = self.begin();
        }
        let inputs = Inputs {
            command,
            feed_override: self.control.safety.status().feed_override,
        };
        let state = self.interpolator.tick(inputs).state;
        if self.interpolator.is_starved() {
            return self.starve();
        }
        self.control.planning = if self.interpolator.has_to_plan() {
            Planning::Due
        } else {
            Planning::Complete
        };
        if moves(state) {
            self.count_sample(events);
        } else if self.control.host_is_gone || self.control.pauses {
            self.came_to_rest(state);
        }
        if (was_under_way || starts) && !state.is_under_way() {
            self.end_run(events);
        } else if self.control.clock == Clock::Lockstep {
            self.control.spent = self.control.credit == 0;
        }
    }

    /// A period in which the run waited for words: it does not count as a tick of the run, and takes no credit.
    #[cold]
    #[inline(never)]
    fn starve(&mut self) {
        let control = &mut self.control;
        control.planning = Planning::Complete;
        control.run.starved = control.run.starved.saturating_add(1);
        if control.clock == Clock::Lockstep {
            control.credit = control.credit.saturating_add(1);
        }
    }

    /// The first sample of a pass: reports the pass before it, in the next tick unless samples are reported, and the room for further words of a streamed job.
    #[cold]
    #[inline(never)]
    fn begin_pass(&mut self, events: &mut impl Events) {
        let sample = *self.interpolator.last();
        let interval = self.interpolator.last_interval();
        self.control.over = self.control.run.begin_pass(&sample, interval);
        if self.control.report == Report::Samples {
            self.control.report_over(events);
        }
        let [_, room] = self.interpolator.load_room();
        if self.interpolator.is_streamed() && room != self.control.room {
            self.control.room = room;
            self.control.put(Event::Room(room), events);
        }
    }

    /// Adds the last sample to the record of the run, and reports it as configured by `Report`.
    #[inline]
    fn count_sample(&mut self, events: &mut impl Events) {
        if self.control.run.begins_pass(self.interpolator.last()) {
            self.begin_pass(events);
        }
        let Self {
            control,
            interpolator,
            ..
        } = self;
        let sample = interpolator.last();
        control.run.add(sample);
        if control.report == Report::Samples {
            control.put(Event::Sample(*sample), events);
        }
    }

    /// Ends the run.
    #[cold]
    #[inline(never)]
    fn end_run(&mut self, events: &mut impl Events) {
        let interval = self.interpolator.last_interval();
        self.control.report_over(events);
        // A pass that was cut short is reported only where the end of the run fits after it, because the journal takes it for complete until then. In lockstep
        // both fit.
        let over = self.control.run.end_pass(interval);
        if self.control.clock == Clock::Lockstep || events.has_room() {
            self.control.over = over;
        } else if over.is_some() {
            self.control.run.events_lost = self.control.run.events_lost.saturating_add(1);
        }
        self.control.credit = 0;
        self.control.spent = false;
        self.control.spindle.end_run();
        self.halt(events);
    }

    /// Reports to the host that no credit is left, or that the run has ended.
    #[cold]
    #[inline(never)]
    fn halt(&mut self, events: &mut impl Events) {
        self.control.report_over(events);
        self.control.halts = self.control.halts.wrapping_add(1);
        let halted = Event::Halted(self.status_now());
        self.control.put(halted, events);
    }

    /// Reports a sign of life of the host.
    pub const fn heard(&mut self) {
        self.control.safety.heard(self.control.spindle.is_commanded());
        self.control.manual.heard();
    }

    /// Whether the drives are enabled. Applied after each tick, so that they are off in the tick that detects the cause.
    #[must_use]
    #[inline]
    pub const fn drives_on(&self) -> bool {
        self.control.safety.drives_on()
    }

    /// The outputs beside the steps, as in [`crate::spindle::output`]. Applied after each tick, like the drives that are a part of them.
    #[must_use]
    #[inline]
    pub const fn outputs(&self) -> u32 {
        self.control.spindle.output() | self.control.levels | self.control.safety.drives_on() as u32
    }

    /// Whether a tick feeds the watchdog: it ended before the next one, and within its budget. A planning that never ends lets no tick pass.
    #[must_use]
    #[inline]
    pub const fn feeds_watchdog(&self, missed: u32, cycles: u32) -> bool {
        missed == 0 && cycles <= self.control.tick_budget
    }
}

#[cfg(test)]
mod tests;
