//! The board's safety inputs, drives and home: the safety part of the messages.

use serde::{Deserialize, Serialize};

use crate::spindle::SpindleOrder;

pub use interp_core::command::{OVERRIDE_MAX_PERCENT, OVERRIDE_NORMAL_PERCENT};

/// The board's safety inputs, one bit each, set where the input is asserted, independent of its electrical level.
///
/// | bit | input |
/// |---|---|
/// | 0 | emergency stop |
/// | 1, 2 | limit switches x-, x+ |
/// | 3, 4 | limit switches y-, y+ |
/// | 5, 6 | limit switches z-, z+ |
/// | 7, 8, 9 | drive fault x, y, z |
/// | 10 | drive fault, one input for all drives |
/// | 11 | probe |
/// | 12 | safety door, or another request for a hold |
/// | 13 | the spindle is at speed |
/// | 14 | start button |
/// | 15 | the supply of the board is low; counts as a drive fault |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputLines(pub u16);

impl InputLines {
    /// No input asserted.
    pub const NONE: Self = Self(0);
    /// The emergency stop.
    pub const EMERGENCY_STOP: Self = Self(1);
    /// All limit switches.
    pub const LIMITS: Self = Self(0x7e);
    /// The drive faults of all axes, the common one, and that of the supply.
    pub const DRIVE_FAULTS: Self = Self(0x8780);
    /// All inputs.
    pub const ALL: Self = Self(0xffff);
    /// The start button, which stops no run.
    pub const START: Self = Self(0x4000);
    /// The supply of the board is low.
    pub const SUPPLY: Self = Self(0x8000);
    /// The probe, which stops no run.
    pub const PROBE: Self = Self(0x800);
    /// The safety door is open: a run pauses.
    pub const DOOR: Self = Self(0x1000);
    /// The spindle is at speed.
    pub const AT_SPEED: Self = Self(0x2000);

    /// Names of the inputs, by bit.
    pub const NAMES: [&str; 16] = [
        "emergency stop",
        "limit switch x-",
        "limit switch x+",
        "limit switch y-",
        "limit switch y+",
        "limit switch z-",
        "limit switch z+",
        "drive fault x",
        "drive fault y",
        "drive fault z",
        "drive fault",
        "probe",
        "safety door",
        "spindle at speed",
        "start button",
        "supply",
    ];

    /// Intersection.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Union.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Difference: inputs that are not in the other set.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the sets have an input in common.
    #[must_use]
    pub const fn has(self, any_of: Self) -> bool {
        self.0 & any_of.0 != 0
    }

    /// The limit switch of an axis (from 0) at its upper or lower end.
    #[must_use]
    pub const fn limit(axis: u8, is_upper: bool) -> Self {
        match axis {
            0..=2 => Self(2 << (2 * axis + is_upper as u8)),
            _ => Self::NONE,
        }
    }

    /// Whether no input is asserted.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// The names of the asserted inputs, in order of their bits.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .into_iter()
            .enumerate()
            .filter(move |(bit, _)| (self.0 >> bit) & 1 != 0)
            .map(|(_, name)| name)
    }
}

/// Reaction of a run on a free clock to a link timeout.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum LinkTimeoutAction {
    /// 0: the run continues to its end.
    #[default]
    Finish,
    /// 1: feed hold, to be resumed.
    Hold,
}

/// The host's description of the machine around the board. The default is the strictest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Configuration {
    /// Whether a run requires a homed machine.
    pub homing_required: bool,
    /// Reaction of a run to a link timeout.
    pub on_link_timeout: LinkTimeoutAction,
    /// Link timeout: periods without a sign of life of the host; 0: none.
    pub link_timeout_ticks: u32,
}

impl Configuration {
    /// The configuration of a board before `Configure`.
    pub const DEFAULT: Self = Self {
        homing_required: true,
        on_link_timeout: LinkTimeoutAction::Finish,
        link_timeout_ticks: 0,
    };
}

impl Default for Configuration {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Why the board started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum ResetCause {
    /// 0: not reported by the board.
    #[default]
    Unknown,
    /// 1: power-on.
    PowerOn,
    /// 2: brown-out.
    Brownout,
    /// 3: the reset pin.
    Pin,
    /// 4: software reset, or a debugger.
    Software,
    /// 5: the watchdog: ticks had stopped, or had missed their deadline repeatedly.
    Watchdog,
    /// 6: a low-power mode that was entered by mistake.
    LowPower,
}

impl ResetCause {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::PowerOn => "power on",
            Self::Brownout => "brown-out",
            Self::Pin => "reset pin",
            Self::Software => "software or debugger",
            Self::Watchdog => "watchdog",
            Self::LowPower => "low power",
        }
    }
}

/// Why the board has paused a run by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum PauseCause {
    /// 0: it has not.
    #[default]
    None,
    /// 1: the safety door was opened.
    Door,
    /// 2: the spindle fell below its speed.
    BelowSpeed,
}

impl PauseCause {
    /// Its name in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Door => "door",
            Self::BelowSpeed => "below-speed",
        }
    }
}

/// What the safety door's contact does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum DoorContact {
    /// 0: there is none; the input is not read.
    #[default]
    None,
    /// 1: opens with the door: a broken wire counts as an open door.
    NormallyClosed,
    /// 2: closes when the door opens.
    NormallyOpen,
}

/// The safety state of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SafetyStatus {
    /// Asserted inputs: the emergency stop immediately, the others debounced.
    pub lines: InputLines,
    /// Emergency stop and drive faults that were asserted since they were last acknowledged.
    pub latched: InputLines,
    /// The machine is homed: the position of the axes is known.
    pub homed: bool,
    /// The drives are enabled.
    pub drives_on: bool,
    /// The link timed out during this run, or the last one.
    pub link_timed_out: bool,
    /// Feed override, percent.
    pub feed_override: u8,
    /// The host's configuration.
    pub configuration: Configuration,
    /// Why the board started.
    pub reset: ResetCause,
    /// Why the board has paused this run, or the last one, by itself; until the next resume or start.
    pub pause: PauseCause,
    /// Spindle and coolant as they are switched now.
    pub spindle: SpindleOrder,
}

impl SafetyStatus {
    /// The state after power-up: drives off, not homed.
    pub const DEFAULT: Self = Self {
        lines: InputLines::NONE,
        latched: InputLines::NONE,
        homed: false,
        drives_on: false,
        link_timed_out: false,
        feed_override: OVERRIDE_NORMAL_PERCENT,
        configuration: Configuration::DEFAULT,
        reset: ResetCause::Unknown,
        pause: PauseCause::None,
        spindle: SpindleOrder::OFF,
    };
}

impl Default for SafetyStatus {
    fn default() -> Self {
        Self::DEFAULT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_has_one_name_and_one_class() {
        let classes = [
            InputLines::EMERGENCY_STOP,
            InputLines::LIMITS,
            InputLines::DRIVE_FAULTS,
            InputLines::PROBE,
            InputLines::DOOR,
            InputLines::AT_SPEED,
            InputLines::START,
        ];
        let counts = classes.map(|class| class.names().count());
        assert_eq!(counts, [1, 6, 5, 1, 1, 1, 1]);
        let all = classes.into_iter().fold(InputLines::NONE, InputLines::or);
        assert_eq!(all, InputLines::ALL);
        assert_eq!(all.names().count(), InputLines::NAMES.len());
        let both: [&str; 2] = core::array::from_fn(|n| InputLines(0x101).names().nth(n).unwrap_or(""));
        assert_eq!(both, ["emergency stop", "drive fault y"]);
    }
}
