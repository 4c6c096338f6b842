//! Spindle and coolant.

use serde::{Deserialize, Serialize};

/// Steps of the speed output: its duty cycle is a whole number of them.
pub const PWM_STEPS: u32 = 16_800;

/// How the spindle turns, seen from above.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Turning {
    /// 0: it stands.
    #[default]
    Off,
    /// 1: clockwise, as most cutters need.
    Clockwise,
    /// 2: counterclockwise.
    Counterclockwise,
}

/// Spindle and coolant of a run: on from its start to its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpindleOrder {
    /// How it turns.
    pub turning: Turning,
    /// Speed, 1/min.
    pub rpm: u32,
    /// Coolant.
    pub coolant: bool,
}

impl SpindleOrder {
    /// Nothing is switched on.
    pub const OFF: Self = Self {
        turning: Turning::Off,
        rpm: 0,
        coolant: false,
    };
}

/// How the board knows that the spindle is at speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum AtSpeed {
    /// 0: by time alone.
    #[default]
    ByTime,
    /// 1: the drive's contact closes at speed: a broken wire counts as below it.
    Closes,
    /// 2: the contact opens at speed.
    Opens,
}

/// The spindle of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SpindleSettings {
    /// Speed at the full output, 1/min.
    pub max_rpm: u32,
    /// Periods from switching on to the first motion; with an input, after which its silence is a fault.
    pub at_speed_ticks: u32,
    /// It is switched off while the tool is lifted for a pause.
    pub stops_at_pause: bool,
    /// How the board knows that it is at speed.
    pub at_speed: AtSpeed,
}
