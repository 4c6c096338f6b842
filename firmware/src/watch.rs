//! Periodic read of the machine's state; changes are logged.

use controller::machine::Machine;
use interp_core::{fault::FaultKind, sample::State};
use protocol::message::{InputLines, SafetyStatus, Status};

use crate::design_parameters::LOOK_PERIODS;

/// The last values read.
#[derive(Default)]
pub(crate) struct Watch {
    /// The machine's state.
    pub(crate) state: State,
    looked: u32,
    deadline_misses: u32,
    bytes_lost: u32,
    safety: SafetyStatus,
}

impl Watch {
    /// Whether a read is due; `now` counts periods.
    pub(crate) fn is_due(&self, now: u32) -> bool {
        now.wrapping_sub(self.looked) >= LOOK_PERIODS
    }

    /// Reads the state, and logs changes. A function of its own, so that no request has the status on the stack.
    #[inline(never)]
    pub(crate) fn look(&mut self, now: u32, machine: &mut impl Machine, bytes_lost: u32) {
        self.looked = now;
        let status = machine.status();
        if status.state != self.state {
            self.state = status.state;
            log_state(&status);
        }
        if status.safety != self.safety {
            log_safety(&status.safety, &self.safety);
            self.safety = status.safety;
        }
        if status.deadline_misses > self.deadline_misses {
            defmt::warn!("{=u32} ticks missed in this run", status.deadline_misses);
        }
        self.deadline_misses = status.deadline_misses;
        if bytes_lost != self.bytes_lost {
            defmt::warn!("{=u32} bytes lost on the link since the start", bytes_lost);
            self.bytes_lost = bytes_lost;
        }
    }
}

fn log_state(status: &Status) {
    let Status {
        state, tick, pass, ..
    } = status;
    match status.fault {
        None => defmt::info!("{=str}: tick {=u32}, pass {=u32}", state.name(), *tick, *pass),
        Some(fault) => defmt::error!(
            "{=str}: tick {=u32}, pass {=u32}: fault {=u8} ({=str}), value {=f32}",
            state.name(),
            *tick,
            *pass,
            fault.code,
            fault.kind().map_or("unknown", FaultKind::name),
            fault.value
        ),
    }
}

fn log_safety(now: &SafetyStatus, before: &SafetyStatus) {
    for input in now.lines.without(before.lines).names() {
        defmt::warn!("{=str} asserted", input);
    }
    for input in before.lines.without(now.lines).names() {
        defmt::info!("{=str} released", input);
    }
    if now.latched == InputLines::NONE && before.latched != InputLines::NONE {
        defmt::info!("acknowledged");
    }
    if now.drives_on != before.drives_on {
        defmt::info!("drives {=str}", if now.drives_on { "on" } else { "off" });
    }
    if now.homed != before.homed {
        defmt::info!("{=str}", if now.homed { "homed" } else { "home lost" });
    }
    if now.link_timed_out && !before.link_timed_out {
        defmt::warn!("the host is gone");
    }
}
