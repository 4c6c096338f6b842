//! The board's safety inputs, and what follows from them: the part of the messages that is about people and drives.

use serde::{Deserialize, Serialize};

pub use interp_core::command::{OVERRIDE_MAX_PERCENT, OVERRIDE_NORMAL_PERCENT};

/// The board's safety inputs, one bit each, set where the input is asserted whatever its level on the wire.
///
/// | bit | input |
/// |---|---|
/// | 0 | emergency stop |
/// | 1, 2 | limit switches x-, x+ |
/// | 3, 4 | limit switches y-, y+ |
/// | 5, 6 | limit switches z-, z+ |
/// | 7, 8, 9 | drive fault x, y, z |
/// | 10 | drive fault, one input for all drives |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputLines(pub u16);

impl InputLines {
    /// Nothing asserted.
    pub const NONE: Self = Self(0);
    /// The emergency stop.
    pub const EMERGENCY_STOP: Self = Self(1);
    /// All limit switches.
    pub const LIMITS: Self = Self(0x7e);
    /// The drive faults of all axes, and the common one.
    pub const DRIVE_FAULTS: Self = Self(0x780);
    /// Every input there is.
    pub const ALL: Self = Self(0x7ff);

    /// Names of the inputs, by bit.
    pub const NAMES: [&str; 11] = [
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
    ];

    /// Those that are in both.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Those that are in either.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Those that are not in the other.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether any is in both.
    #[must_use]
    pub const fn has(self, any_of: Self) -> bool {
        self.0 & any_of.0 != 0
    }

    /// Whether none is asserted.
    #[must_use]
    pub const fn is_none(self) -> bool {
        self.0 == 0
    }

    /// The names of those that are asserted, in order of their bits.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES
            .into_iter()
            .enumerate()
            .filter(move |(bit, _)| (self.0 >> bit) & 1 != 0)
            .map(|(_, name)| name)
    }
}

/// What a run on a free clock does when the host is gone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum HostGone {
    /// 0: it goes on to its end.
    #[default]
    Finish,
    /// 1: it is held along the path, to be resumed.
    Hold,
}

/// What the host tells the board of the machine around it. The default is the strict one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Configuration {
    /// A run starts only where the machine is homed.
    pub homing_required: bool,
    /// What a run does when the host is gone.
    pub host_gone: HostGone,
    /// Periods without a frame after which the host is gone; 0: never.
    pub host_gone_ticks: u32,
}

impl Configuration {
    /// A board that nobody has told anything.
    pub const DEFAULT: Self = Self {
        homing_required: true,
        host_gone: HostGone::Finish,
        host_gone_ticks: 0,
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
    /// 0: the board does not say.
    #[default]
    Unknown,
    /// 1: power came on.
    PowerOn,
    /// 2: the supply had sunk too low.
    Brownout,
    /// 3: the reset pin.
    Pin,
    /// 4: the program or a debugger.
    Software,
    /// 5: the watchdog: ticks had stopped, or missed their deadline again and again.
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

/// The safety state of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SafetyStatus {
    /// Inputs that are asserted: the emergency stop at once, the others as soon as they are steady.
    pub lines: InputLines,
    /// Emergency stop and drive faults that were asserted since they were last acknowledged.
    pub latched: InputLines,
    /// The axes stand where the board believes they do.
    pub homed: bool,
    /// The drives are enabled.
    pub drives_on: bool,
    /// The host was gone during this run, or the last one.
    pub host_gone: bool,
    /// Feed override, percent.
    pub feed_override: u8,
    /// What the host has told.
    pub configuration: Configuration,
    /// Why the board started.
    pub reset: ResetCause,
}

impl SafetyStatus {
    /// A board after power-up: drives off, not homed.
    pub const DEFAULT: Self = Self {
        lines: InputLines::NONE,
        latched: InputLines::NONE,
        homed: false,
        drives_on: false,
        host_gone: false,
        feed_override: OVERRIDE_NORMAL_PERCENT,
        configuration: Configuration::DEFAULT,
        reset: ResetCause::Unknown,
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
        ];
        let counts = classes.map(|class| class.names().count());
        assert_eq!(counts, [1, 6, 4]);
        let all = classes.into_iter().fold(InputLines::NONE, InputLines::or);
        assert_eq!(all, InputLines::ALL);
        assert_eq!(all.names().count(), InputLines::NAMES.len());
        let both: [&str; 2] = core::array::from_fn(|n| InputLines(0x101).names().nth(n).unwrap_or(""));
        assert_eq!(both, ["emergency stop", "drive fault y"]);
    }
}
