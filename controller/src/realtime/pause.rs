//! Spindle and coolant around a run, and what pauses a run: the operator, a safety door that is opened, a spindle below its speed.

use interp_core::{
    command::Command,
    fault::{Fault, FaultKind},
    sample::{RunStart, State},
};
use protocol::message::{Clock, InputLines, PauseCause, Reason, Turning};

use super::{RealTime, run::RunRecord};
use crate::{
    safety::{may_go_on, may_resume},
    spindle::Readiness,
};

impl<S: AsRef<[i32]> + AsMut<[i32]>> RealTime<S> {
    /// A start or resume: held back until the spindle is at speed. In lockstep time is the host's, and nothing turns. A resume that is not
    /// possible any more is dropped.
    #[cold]
    #[inline(never)]
    pub(super) fn with_spindle(&mut self, command: Option<Command>) -> Option<Command> {
        let status = self.control.safety.status();
        let state = self.interpolator.state();
        let is_start = command == Some(Command::Start);
        let may = if is_start {
            Command::Start.is_allowed(state) && self.may_start().is_ok()
        } else {
            may_go_on(&status, state).is_ok()
        };
        if !may && state == State::Holding {
            return None;
        }
        self.control.host_is_gone = false;
        // A pause that was held on its way up goes on.
        self.control.pauses &= state == State::Held && !self.interpolator.is_lifted();
        if !may {
            if self.control.spindle.is_awaited() {
                self.control.spindle.off();
            }
            // A start is refused, and its end reported, as any other.
            return command.filter(|_| is_start);
        }
        self.control.safety.set_pause(PauseCause::None);
        if !is_start && state != State::Held {
            return command;
        }
        match self.control.spindle.readiness(status.lines) {
            _ if self.control.clock == Clock::Lockstep => self.control.spindle.stop_waiting(),
            Readiness::AtSpeed => {}
            Readiness::Waits => {
                self.control.command = command;
                return None;
            }
            Readiness::TooSlow => {
                self.fail_at_rest();
                return None;
            }
        }
        command
    }

    /// The spindle did not report its speed: the run ends before it has begun, or where it is held.
    fn fail_at_rest(&mut self) {
        #[allow(clippy::cast_precision_loss, reason = "a speed to be read by a person")]
        let rpm = self.control.spindle.ordered_rpm() as f32;
        let is_start = self.interpolator.state() != State::Held;
        self.interpolator
            .fail_at_rest(Fault::new(FaultKind::SpindleSpeed, rpm));
        if is_start {
            self.control.run = RunRecord::NEW;
            self.give_up_start();
        }
    }

    /// The end of a run that has not begun, to be reported with the next tick.
    pub(super) fn give_up_start(&mut self) {
        self.control.command = None;
        self.interpolator.begin_at(RunStart::FIRST);
        self.control.spindle.end_run();
        self.control.safety.ending = true;
        self.control.safety.recheck();
    }

    /// A start waits for the spindle.
    pub(super) fn spins_up(&self) -> bool {
        self.control.spindle.is_awaited() && !self.interpolator.state().is_under_way()
    }

    /// The host is gone while the run is held: the spindle is off, and a resume that waits for it is dropped.
    #[cold]
    pub(super) fn stand_without_host(&mut self) {
        if self.control.command == Some(Command::Resume) {
            self.control.command = None;
        }
        self.control.spindle.off();
    }

    /// The run has come to rest. In a hold the spindle stops after a heartbeat timeout, and if it was below its speed; else if the profile says so and the tool is above the surface or
    /// the door is open.
    #[cold]
    #[inline(never)]
    pub(super) fn came_to_rest(&mut self, state: State) {
        let status = self.control.safety.status();
        let is_lifted = self.interpolator.is_lifted();
        let is_clear = is_lifted || status.lines.has(InputLines::DOOR);
        let stops = self.control.host_is_gone
            || status.pause == PauseCause::BelowSpeed
            || (is_clear && self.control.spindle.stops_at_pause());
        self.control.host_is_gone = false;
        // Held on its way up, a pause is not over.
        self.control.pauses &= state == State::Held && !is_lifted;
        if state == State::Held && stops {
            self.control.spindle.off();
        }
    }

    /// Pauses a run when the door opens, or when the spindle is below its speed for too long. Outside a run an open door switches off what a command switched on.
    pub(super) fn pause_by_inputs(&mut self, before: InputLines, steady: InputLines) {
        let is_open = steady.has(InputLines::DOOR);
        if is_open && self.control.spindle.is_commanded() {
            self.control.spindle.off();
        }
        if is_open && !before.has(InputLines::DOOR) {
            self.pause_by(PauseCause::Door);
        }
        if self.interpolator.state().is_under_way() {
            let [is_below, is_too_long] = self.control.spindle.is_below(steady);
            if is_below {
                self.control.safety.recheck();
            }
            if is_too_long {
                self.pause_by(PauseCause::BelowSpeed);
            }
        }
    }

    fn pause_by(&mut self, cause: PauseCause) {
        if !Command::Pause.is_allowed(self.interpolator.state()) {
            return;
        }
        self.control.safety.set_pause(cause);
        // The operator's end of the run comes before.
        if !matches!(self.control.command, Some(Command::Abort | Command::Stop)) {
            self.control.spindle.stop_waiting();
            self.control.command = Some(Command::Pause);
        }
    }

    /// Switches the spindle outside a run. Off takes back a start that waits for it, which would else begin without it.
    pub(super) fn turn(&mut self, turning: Turning, rpm: u32) -> Result<(), Reason> {
        let is_off = turning == Turning::Off || rpm == 0;
        if is_off && self.spins_up() {
            self.give_up_start();
            return Ok(());
        }
        if !is_off {
            self.may_switch_on()?;
        }
        self.control.spindle.turn(turning, rpm)?;
        self.control.safety.heard(self.control.spindle.is_commanded());
        Ok(())
    }

    /// Switches the coolant.
    pub(super) fn switch_coolant(&mut self, on: bool) -> Result<(), Reason> {
        if on {
            self.may_switch_on()?;
        }
        let is_in_run = self.spins_up() || self.interpolator.state().is_under_way();
        self.control.spindle.coolant(on, is_in_run)?;
        self.control.safety.heard(self.control.spindle.is_commanded());
        Ok(())
    }

    /// Whether spindle and coolant may be switched on by a command: drives on, nothing latched, door shut, no fault, no start that waits.
    fn may_switch_on(&self) -> Result<(), Reason> {
        let state = self.interpolator.state();
        if state == State::Faulted {
            return Err(Reason::WrongState { state });
        }
        if self.spins_up() || self.control.manual.is_probing() {
            return Err(Reason::Moving);
        }
        self.control.safety.may_move()?;
        may_resume(&self.control.safety.status())
    }
}
