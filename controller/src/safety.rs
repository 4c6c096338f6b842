//! Inputs, drives, home and link timeout: conditions for a start, and causes of a stop.
//!
//! ```text
//!  inputs ──► Debounce ──► Safety::watch ──► Stop::Uncontrolled  category 0: drives off, the run ends in this tick
//!                              │         └─► Stop::Controlled    category 1: the run slows down along its path
//!  Order (from the host) ──► Safety::obey
//! ```
//!
//! **Emergency stop.** Acts in its first tick. Drives off, home cleared, a run under way ends immediately; latched until the host
//! acknowledges it, which is accepted only once the input was released for [`DEBOUNCE_TICKS`].
//! **Drive fault.** The same, after debouncing.
//! **Limit switch.** After debouncing: controlled stop along the path. The position stays valid, and nothing is latched, but no
//! run starts while a switch is asserted.
//! **Safety door.** After debouncing: a run pauses, leaving the surface, and resumes only when the door is shut. Nothing is latched.
//! **Drives.** Off after power-up; on only by an order of the host, and never while emergency stop or drive fault is asserted or latched.
//! Emergency stop and drive fault switch them off; the host can switch them off except during a run.
//! **Home.** There are no encoders: the axes are homed by their switches ([`crate::manual`]), or the operator places them, switches the drives on, and
//! declares their position. Without drives the axes may move, so every switch-off of the drives clears the home, unless the profile says that it survives.
//! **Cost.** A tick with unchanged inputs takes one comparison and one count (`is_unchanged`).

use crate::manual::{HEARD_TICKS, Motion, Setup};
use interp_core::{
    fault::{Fault, FaultKind},
    sample::{RunStart, State},
};
use protocol::message::{
    Clock, Configuration, InputLines, LinkTimeoutAction, OVERRIDE_MAX_PERCENT, PauseCause, Reason,
    ResetCause, SafetyStatus, SpindleOrder, Turning,
};

/// Debounce: consecutive ticks for which an input has to differ before it is accepted, and before the emergency stop counts as released. At 1 ms, the
/// third comes 2 to 3 ms after the change. Contacts bounce for less, and at 100 mm/s an axis moves at most 0.3 mm in this time.
pub const DEBOUNCE_TICKS: u32 = 3;

/// A value that no inputs can have, so that the next tick is evaluated although the inputs have not changed.
const UNSETTLED: u32 = u32::MAX;

/// Inputs that only a machine with a profile has.
const OPTIONAL: InputLines = InputLines::DOOR.or(InputLines::AT_SPEED);

/// The host's orders for drives and home. Executed at once, under the lock of the real-time half, so that no tick comes between
/// check and execution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    /// The profile's part for motion outside a job.
    SetUp(Option<Setup>),
    /// Motion outside a job.
    Move(Motion),
    /// Spindle and coolant of the loaded job.
    Spindle(SpindleOrder),
    /// The spindle, outside a run.
    Turn {
        /// How it turns.
        turning: Turning,
        /// Speed, 1/min.
        rpm: u32,
    },
    /// The coolant.
    Coolant {
        /// Whether to switch it on.
        on: bool,
    },
    /// Where the next run begins; one after it, or after a start that was given up, begins with the first pass.
    BeginAt(RunStart),
    /// Configuration of the machine.
    Configure(Configuration),
    /// Drives on or off.
    Drives {
        /// Whether to switch the drives on.
        on: bool,
    },
    /// Declares the position of the axes.
    SetHome {
        /// Position, nm.
        home_nm: [i32; 3],
    },
    /// Clear the latch.
    Acknowledge,
}

/// How an input stops a run, by the categories of IEC 60204-1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stop {
    /// Category 0, immediate: the drives are off.
    Uncontrolled(Fault),
    /// Category 1, along the path.
    Controlled(Fault),
}

/// Sixteen two-bit vertical counters: bit n of both words is the count of input n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Debounce {
    /// Inputs as accepted.
    steady: u16,
    /// Low bit of each input's count of ticks in which it differed.
    ones: u16,
    /// High bit of the same.
    twos: u16,
}

impl Debounce {
    const NEW: Self = Self {
        steady: 0,
        ones: 0,
        twos: 0,
    };

    /// Accepts these inputs without debouncing.
    const fn assert(&mut self, at_once: u16) {
        self.steady |= at_once;
        self.ones &= !at_once;
        self.twos &= !at_once;
    }

    /// Processes one tick's inputs. An input that differs for the third consecutive tick is accepted.
    const fn push(&mut self, raw: u16) {
        let differs = raw ^ self.steady;
        let carry = self.ones & differs;
        self.ones = !self.ones & differs;
        self.twos = (self.twos ^ carry) & differs;
        let counted = self.ones & self.twos;
        self.steady ^= counted;
        self.ones &= !counted;
        self.twos &= !counted;
    }
}

/// The safety state of the board.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Safety {
    /// Inputs that require no evaluation; [`UNSETTLED`] where all do.
    settled: u32,
    /// Ticks until the link times out.
    ticks_to_timeout: u32,
    status: SafetyStatus,
    debounce: Debounce,
    /// Inputs whose level means the opposite of the one in the board's table.
    inverted: InputLines,
    /// Inputs that the machine does not have.
    ignored: InputLines,
    /// The position stays valid while the drives are off.
    home_survives_off: bool,
    /// Position last declared or found by homing, nm; valid while `status.homed`.
    home_nm: [i32; 3],
    /// Whether the end of a run is still to be reported.
    pub(crate) ending: bool,
}

impl Safety {
    pub(crate) const NEW: Self = Self {
        settled: 0,
        ticks_to_timeout: u32::MAX,
        status: SafetyStatus::DEFAULT,
        debounce: Debounce::NEW,
        inverted: InputLines::NONE,
        ignored: OPTIONAL,
        home_survives_off: false,
        home_nm: [0; 3],
        ending: false,
    };

    pub(crate) const fn status(&self) -> SafetyStatus {
        self.status
    }

    pub(crate) const fn set_reset_cause(&mut self, cause: ResetCause) {
        self.status.reset = cause;
    }

    pub(crate) const fn drives_on(&self) -> bool {
        self.status.drives_on
    }

    /// The position that the host declared as home, nm; none where the machine is not homed.
    pub(crate) const fn home_nm(&self) -> Option<[i32; 3]> {
        if self.status.homed {
            Some(self.home_nm)
        } else {
            None
        }
    }

    /// Counts the tick, and returns whether it needs no evaluation: the inputs are settled and unchanged, and the link has not
    /// timed out.
    #[inline(always)]
    pub(crate) const fn is_unchanged(&mut self, lines: InputLines) -> bool {
        self.ticks_to_timeout = self.ticks_to_timeout.wrapping_sub(1);
        lines.0 as u32 == self.settled && self.ticks_to_timeout != 0
    }

    /// Processes the inputs of a tick for which [`Self::is_unchanged`] was false; returns how they stop a run under way.
    pub(crate) fn watch(&mut self, lines: InputLines, under_way: bool) -> Option<Stop> {
        let raw = self.raw(lines);
        self.debounce.assert(raw.and(InputLines::EMERGENCY_STOP).0);
        self.debounce.push(raw.0);
        let steady = InputLines(self.debounce.steady);
        self.status.lines = steady;
        self.settled = if self.ending || raw != steady {
            UNSETTLED
        } else {
            u32::from(lines.0)
        };
        let stops = steady.and(InputLines::EMERGENCY_STOP.or(InputLines::DRIVE_FAULTS));
        if !stops.is_none() {
            self.status.latched = self.status.latched.or(stops);
            self.status.drives_on = false;
            self.status.homed = false;
        }
        hindrance_of(steady).filter(|_| under_way).map(|fault| {
            if stops.is_none() {
                Stop::Controlled(fault)
            } else {
                Stop::Uncontrolled(fault)
            }
        })
    }

    /// The asserted inputs, as read.
    pub(crate) const fn raw(&self, lines: InputLines) -> InputLines {
        InputLines(lines.0 ^ self.inverted.0)
            .and(InputLines::ALL)
            .without(self.ignored)
    }

    /// Puts the profile's part in force: the meaning of the inputs' levels, and whether the home survives drives that are off.
    pub(crate) fn set_up(&mut self, setup: Option<&Setup>) {
        self.home_survives_off = setup.is_some_and(Setup::home_survives_off);
        self.inverted = setup.map_or(InputLines::NONE, Setup::inverted);
        self.ignored = setup.map_or(OPTIONAL, Setup::ignored);
        self.recheck();
    }

    /// The axes are homed here, or the position is lost.
    pub(crate) fn set_homed(&mut self, home_nm: Option<[i32; 3]>) {
        self.status.homed = home_nm.is_some();
        self.home_nm = home_nm.unwrap_or(self.home_nm);
    }

    /// Whether the axes may be moved.
    pub(crate) fn may_move(&self) -> Result<(), Reason> {
        may_drive(&self.status)?;
        if self.status.drives_on {
            Ok(())
        } else {
            Err(Reason::DrivesOff)
        }
    }

    /// Forces a call of [`Self::watch`] in the next tick.
    pub(crate) const fn recheck(&mut self) {
        self.settled = UNSETTLED;
    }

    /// Reports a sign of life of the host. `is_commanded`: spindle or coolant is on by a command, and so only while the host is heard.
    pub(crate) const fn heard(&mut self, is_commanded: bool) {
        self.ticks_to_timeout = match self.status.configuration.link_timeout_ticks {
            _ if is_commanded => HEARD_TICKS,
            0 => u32::MAX,
            ticks => ticks,
        };
    }

    /// Whether the host was not heard for too long, before [`Self::check_link_timeout`].
    pub(crate) const fn has_timed_out(&self) -> bool {
        self.ticks_to_timeout == 0
    }

    /// After a tick for which [`Self::is_unchanged`] was false: whether the link timeout requires a hold now, or that a run that is held stands without its spindle.
    /// `holds`: whether the state accepts a hold, or is held.
    pub(crate) fn check_link_timeout(&mut self, clock: Clock, state: State, holds: bool) -> bool {
        if self.ticks_to_timeout != 0 {
            return false;
        }
        self.heard(false);
        if clock != Clock::Free || !state.is_under_way() || self.status.configuration.link_timeout_ticks == 0
        {
            return false;
        }
        self.status.link_timed_out = true;
        if self.status.configuration.on_link_timeout == LinkTimeoutAction::Finish {
            return false;
        }
        if !holds {
            // In transition between states: repeated in the next tick.
            self.ticks_to_timeout = 1;
        }
        holds
    }

    /// Reports the start of a run. A spindle that a command has switched on is the run's now, and the link timeout the profile's.
    pub(crate) const fn begin_run(&mut self) {
        self.heard(false);
        self.status.link_timed_out = false;
        self.status.pause = PauseCause::None;
    }

    /// Reports that the board pauses a run by itself, for this cause; `None`: the run continues.
    pub(crate) const fn set_pause(&mut self, cause: PauseCause) {
        self.status.pause = cause;
    }

    /// Sets the feed override, percent.
    pub(crate) fn set_override(&mut self, percent: u8) {
        self.status.feed_override = percent.min(OVERRIDE_MAX_PERCENT);
    }

    /// Executes an order of the host, or returns the reason of its refusal.
    pub(crate) fn obey(&mut self, order: Order, state: State) -> Result<(), Reason> {
        let under_way = state.is_under_way();
        match order {
            Order::Acknowledge => {
                let stops = InputLines::EMERGENCY_STOP.or(InputLines::DRIVE_FAULTS);
                no_hindrance(self.status.lines.and(stops))?;
                self.status.latched = InputLines::NONE;
            }
            // Also in a run.
            Order::Coolant { .. } => {}
            _ if under_way => return Err(Reason::WrongState { state }),
            Order::Configure(configuration) => {
                self.status.configuration = configuration;
                self.heard(false);
            }
            Order::Drives { on: false } => {
                self.status.drives_on = false;
                self.status.homed &= self.home_survives_off;
            }
            Order::Drives { on: true } => {
                may_drive(&self.status)?;
                self.status.drives_on = true;
            }
            Order::SetHome { home_nm } => {
                may_drive(&self.status)?;
                if !self.status.drives_on {
                    return Err(Reason::DrivesOff);
                }
                self.home_nm = home_nm;
                self.status.homed = true;
            }
            Order::SetUp(_) | Order::Spindle(_) | Order::Turn { .. } | Order::BeginAt(_) => {}
            Order::Move(_) => self.may_move()?,
        }
        Ok(())
    }
}

/// The most severe stop that these inputs require.
fn hindrance_of(lines: InputLines) -> Option<Fault> {
    let (class, kind) = if lines.has(InputLines::EMERGENCY_STOP) {
        (InputLines::EMERGENCY_STOP, FaultKind::EmergencyStop)
    } else if lines.has(InputLines::DRIVE_FAULTS) {
        (InputLines::DRIVE_FAULTS, FaultKind::DriveFault)
    } else if lines.has(InputLines::LIMITS) {
        (InputLines::LIMITS, FaultKind::LimitSwitch)
    } else {
        return None;
    };
    Some(Fault::new(kind, f32::from(lines.and(class).0)))
}

fn no_hindrance(lines: InputLines) -> Result<(), Reason> {
    hindrance_of(lines).map_or(Ok(()), |fault| Err(Reason::Unsafe { fault: fault.into() }))
}

/// Whether the drives may be switched on.
fn may_drive(status: &SafetyStatus) -> Result<(), Reason> {
    let stops = InputLines::EMERGENCY_STOP.or(InputLines::DRIVE_FAULTS);
    no_hindrance(status.latched.or(status.lines).and(stops))
}

/// Whether inputs, drives and home let a run start.
///
/// # Errors
/// The reason of the refusal: an input asserted or latched, the drives off, the machine not homed.
pub fn may_start(status: &SafetyStatus) -> Result<(), Reason> {
    no_hindrance(status.latched.or(status.lines))?;
    may_resume(status)?;
    if !status.drives_on {
        return Err(Reason::DrivesOff);
    }
    if status.configuration.homing_required && !status.homed {
        let fault = Fault::new(FaultKind::NotHomed, 0.0);
        return Err(Reason::Unsafe { fault: fault.into() });
    }
    Ok(())
}

/// Whether the safety door lets a run resume, and the spindle turn.
///
/// # Errors
/// The door is open.
pub fn may_resume(status: &SafetyStatus) -> Result<(), Reason> {
    if !status.lines.has(InputLines::DOOR) {
        return Ok(());
    }
    let fault = Fault::new(FaultKind::DoorOpen, f32::from(InputLines::DOOR.0));
    Err(Reason::Unsafe { fault: fault.into() })
}

/// Whether a run may go on that is held in this state, or slows down for it.
///
/// # Errors
/// The door is open, or the tool slows down because the spindle is below its speed: only a resume from rest waits for it.
pub(crate) fn may_go_on(status: &SafetyStatus, state: State) -> Result<(), Reason> {
    may_resume(status)?;
    if state == State::Holding && status.pause == PauseCause::BelowSpeed {
        return Err(Reason::WrongState { state });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
