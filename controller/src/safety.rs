//! Inputs, drives, home and link timeout: what may start, and what has to stop.
//!
//! ```text
//!  inputs ──► Debounce ──► Safety::watch ──► Stop::Uncontrolled  category 0: drives off, the run ends in this tick
//!                              │         └─► Stop::Controlled    category 1: the run slows down along its path
//!  Order (from the host) ──► Safety::obey
//! ```
//!
//! **Emergency stop.** Taken at its first tick. Drives off, home lost, a run under way ends at once; latched until the host
//! acknowledges it, which it may only once the input was released for [`DEBOUNCE_TICKS`].
//! **Drive fault.** The same, once it is steady.
//! **Limit switch.** Steady: a run under way slows down along its path. The position stays good, and nothing is latched, but no
//! run starts while a switch is asserted.
//! **Drives.** Off after power-up; on only when asked for, and never while one of the first two is asserted or latched.
//! Emergency stop and drive fault switch them off, and so does the host, but not under a run.
//! **Home.** There are no encoders and no homing moves: the operator places the axes, switches the drives on, and
//! declares where they stand. Without drives the axes may be moved by hand, so whatever switches the drives off loses the home.
//! **Cost.** A tick in which the inputs are as before is one comparison and one count (`is_unchanged`).

use interp_core::{
    fault::{Fault, FaultKind},
    sample::State,
};
use protocol::message::{
    Clock, Configuration, InputLines, LinkTimeoutAction, OVERRIDE_MAX_PERCENT, Reason, ResetCause,
    SafetyStatus,
};

/// Ticks in a row in which an input has to differ before it counts, and the emergency stop before it counts as released: at 1 ms, the
/// third comes 2 to 3 ms after the change. Contacts bounce for less, and at 100 mm/s an axis goes at most 0.3 mm meanwhile.
pub const DEBOUNCE_TICKS: u32 = 3;

/// A value that no inputs have: the next tick is evaluated although they have not changed.
const UNSETTLED: u32 = u32::MAX;

/// The host's orders for drives and home. Executed at once, under the lock of the real-time half, so that no tick comes between
/// check and execution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// What the machine is like.
    Configure(Configuration),
    /// Drives on or off.
    Drives {
        /// Whether they are to be on.
        on: bool,
    },
    /// The axes stand here.
    SetHome {
        /// Where, nm.
        home_nm: [i32; 3],
    },
    /// Clear the latch.
    Acknowledge,
}

/// How an input stops a run, by the categories of IEC 60204-1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stop {
    /// Category 0, at once: the drives are off.
    Uncontrolled(Fault),
    /// Category 1, along the path.
    Controlled(Fault),
}

/// Eleven counters to three, side by side: bit n of both words is the count of input n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Debounce {
    steady: u16,
    ones: u16,
    twos: u16,
}

impl Debounce {
    const NEW: Self = Self {
        steady: 0,
        ones: 0,
        twos: 0,
    };

    /// These count from their first tick on.
    const fn assert(&mut self, at_once: u16) {
        self.steady |= at_once;
        self.ones &= !at_once;
        self.twos &= !at_once;
    }

    /// Takes one tick's inputs in. An input that differs for the third time in a row is taken over.
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
    /// The inputs that need nothing done; [`UNSETTLED`] where none do.
    settled: u32,
    /// Ticks until the link times out.
    ticks_to_timeout: u32,
    status: SafetyStatus,
    debounce: Debounce,
    home_nm: [i32; 3],
    /// The end of a run has still to be reported.
    pub(crate) ending: bool,
}

impl Safety {
    pub(crate) const NEW: Self = Self {
        settled: 0,
        ticks_to_timeout: u32::MAX,
        status: SafetyStatus::DEFAULT,
        debounce: Debounce::NEW,
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

    /// Where the axes stood when the host declared it, while that holds, nm.
    pub(crate) const fn home_nm(&self) -> Option<[i32; 3]> {
        if self.status.homed {
            Some(self.home_nm)
        } else {
            None
        }
    }

    /// Whether this tick has nothing to do here: the inputs are those that nothing more follows from, and the host may
    /// stay silent. Counts the tick.
    #[inline(always)]
    pub(crate) const fn is_unchanged(&mut self, lines: InputLines) -> bool {
        self.ticks_to_timeout = self.ticks_to_timeout.wrapping_sub(1);
        lines.0 as u32 == self.settled && self.ticks_to_timeout != 0
    }

    /// Takes the inputs of a tick for which [`Self::is_unchanged`] was false; how they stop a run that is under way.
    pub(crate) fn watch(&mut self, lines: InputLines, under_way: bool) -> Option<Stop> {
        let raw = lines.and(InputLines::ALL);
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

    /// Has [`Self::watch`] asked in the next tick, whatever the inputs are.
    pub(crate) const fn recheck(&mut self) {
        self.settled = UNSETTLED;
    }

    /// A frame of the host arrived.
    pub(crate) const fn heard(&mut self) {
        self.ticks_to_timeout = match self.status.configuration.link_timeout_ticks {
            0 => u32::MAX,
            ticks => ticks,
        };
    }

    /// After a tick that was not calm: whether the run is to be held now, because the host has been silent for too long.
    /// `holds`: whether the state takes a hold up.
    pub(crate) fn check_link_timeout(&mut self, clock: Clock, state: State, holds: bool) -> bool {
        if self.ticks_to_timeout != 0 {
            return false;
        }
        self.heard();
        if clock != Clock::Free || !state.is_under_way() || self.status.configuration.link_timeout_ticks == 0
        {
            return false;
        }
        self.status.link_timed_out = true;
        if self.status.configuration.on_link_timeout == LinkTimeoutAction::Finish || state == State::Held {
            return false;
        }
        if !holds {
            // On its way from one state to another: it is asked again in the next tick.
            self.ticks_to_timeout = 1;
        }
        holds
    }

    /// A run begins.
    pub(crate) const fn begin_run(&mut self) {
        self.status.link_timed_out = false;
    }

    /// The feed, percent.
    pub(crate) fn set_override(&mut self, percent: u8) {
        self.status.feed_override = percent.min(OVERRIDE_MAX_PERCENT);
    }

    /// Does what the host asks for, or says why not.
    pub(crate) fn obey(&mut self, order: Order, state: State) -> Result<(), Reason> {
        let under_way = state.is_under_way();
        match order {
            Order::Acknowledge => {
                let stops = InputLines::EMERGENCY_STOP.or(InputLines::DRIVE_FAULTS);
                no_hindrance(self.status.lines.and(stops))?;
                self.status.latched = InputLines::NONE;
            }
            _ if under_way => return Err(Reason::WrongState { state }),
            Order::Configure(configuration) => {
                self.status.configuration = configuration;
                self.heard();
            }
            Order::Drives { on: false } => {
                self.status.drives_on = false;
                self.status.homed = false;
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
        }
        Ok(())
    }
}

/// What these inputs mean to a run: the gravest of them.
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

/// Whether the drives may be on.
fn may_drive(status: &SafetyStatus) -> Result<(), Reason> {
    let stops = InputLines::EMERGENCY_STOP.or(InputLines::DRIVE_FAULTS);
    no_hindrance(status.latched.or(status.lines).and(stops))
}

/// Whether inputs, drives and home let a run start.
///
/// # Errors
/// Why not: an input asserted or latched, the drives off, the machine not homed.
pub fn may_start(status: &SafetyStatus) -> Result<(), Reason> {
    no_hindrance(status.latched.or(status.lines))?;
    if !status.drives_on {
        return Err(Reason::DrivesOff);
    }
    if status.configuration.homing_required && !status.homed {
        let fault = Fault::new(FaultKind::NotHomed, 0.0);
        return Err(Reason::Unsafe { fault: fault.into() });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
