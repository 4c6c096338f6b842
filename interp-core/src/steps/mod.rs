//! Steps: cutter locations become step and direction signals, three axes, one period at a time.
//!
//! ```text
//!  CL, nm ──► scale: exact fraction ──► steps of this period, and where in it each falls
//!                                              │ axis: direction, pauses, steps carried over
//!                                              ▼
//!                                     slots of the next period ──► a timer hands one word a slot to the port
//! ```
//!
//! The axes lag by one period: during a period, the tick computes the pulses of the next. Between two samples
//! the axes move at constant velocity, so a step is due where that straight line crosses the midpoint between two step positions; pulses are
//! equidistant across periods too, at any rate.
//!
//! # Words
//! A slot's word goes to a port's set/reset register: set bits in its low half, reset bits in its high half; set has priority
//! where both are given (RM0090, 8.4.7). A slot without a pulse holds every step pin at its idle level ([`Steps::rest`]); a pulse exchanges the set and the reset bit of
//! its pin in one slot per slot of its length. So a pulse ends without further action, an unwritten buffer holds every pin idle, and a pin whose pulses are low costs what
//! any other does.
//!
//! # Guarantees
//! - The number of steps is that of the position, rounded to the nearest, at any distance: the position is kept as
//!   steps and remainder, both integers. A reversal makes no step within [`HOLD_NM`] (hysteresis), so that a position that alternates by
//!   1 nm at the midpoint between two steps does not make the motor step.
//! - A pulse lies within one slot of its ideal time; two pulses of an axis are at least two pulse lengths apart, across
//!   period boundaries too.
//! - The direction changes between periods, never within a pulse or the pause after it; the first pulse then comes after the
//!   set-up time. Pulses that do not fit are output in the next period.
//! - More steps than a period holds are a fault. They are not lost: steps that do not fit are carried over to the next period.

mod axis;
mod scale;
#[cfg(test)]
mod tests;

use crate::fault::{Fault, FaultKind, Result};
use axis::{Axis, Timing};
use scale::Scale;

/// Slots of a period. 1000 a millisecond are 168 clocks of the 168 MHz timer, an integer; so would be 800 (210),
/// but not 1250 (134.4). With one slot high and one slot low the maximum rate is 500 kHz.
pub const SLOTS: u32 = 1000;

/// Words of a buffer: 2^10, so that no ten-bit index can be out of range. Words from [`SLOTS`] on are never output.
pub const BUFFER_WORDS: usize = 1024;

/// Maximum pulse length, slots: a pulse that begins in the last slot has to end within the buffer.
pub const PULSE_SLOTS_MAX: u8 = 24;

/// Slots at the beginning of a period within which the board sets the direction pins: its interrupt latency.
pub const TURN_SLOTS: u32 = 16;

/// Maximum set-up time of the direction, slots: with [`TURN_SLOTS`] about half the period.
pub const SETUP_SLOTS_MAX: u16 = 480;

/// Hysteresis of a reversal: distance beyond the midpoint between two steps before the axis steps back, nm. Twice the rounding
/// of a tool at standstill, and below the resolution of any axis. At most a quarter of a step.
pub const HOLD_NM: u32 = 4;

/// Steps per millimetre of one axis, as an exact fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisSteps {
    /// Numerator: steps.
    pub steps: u32,
    /// Denominator: the millimetres for this number of steps.
    pub mm: u32,
    /// Whether the direction is inverted: the level towards plus is the opposite of that in the board's table.
    pub inverted: bool,
}

/// Step scale and pulse timing of the axes' drives. [`StepConfig::check`] validates them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepConfig {
    /// The axes x, y, z.
    pub axes: [AxisSteps; 3],
    /// Length of a pulse, and minimum pause after a pulse, slots: 1 to [`PULSE_SLOTS_MAX`].
    pub pulse_slots: u8,
    /// Minimum slots from a change of direction to the first pulse, 0 to [`SETUP_SLOTS_MAX`]. The first pulse comes at least this number plus
    /// [`TURN_SLOTS`] slots after the beginning of the period.
    pub setup_slots: u16,
}

/// Why a [`StepConfig`] is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepConfigError {
    /// The steps per millimetre are outside 1/1000 to 500 000.
    StepsPerMm {
        /// The axis, from 0.
        axis: u8,
        /// Steps.
        steps: u32,
        /// Millimetres.
        mm: u32,
    },
    /// The pulse length is out of range.
    PulseSlots(u8),
    /// The set-up time is out of range.
    SetupSlots(u16),
}

impl core::fmt::Display for StepConfigError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::StepsPerMm { axis, steps, mm } => {
                write!(
                    f,
                    "{steps}/{mm} steps per mm of axis {axis} are not within 1/1000 to 500000"
                )
            }
            Self::PulseSlots(slots) => {
                write!(f, "a pulse of {slots} slots is not within 1 to {PULSE_SLOTS_MAX}")
            }
            Self::SetupSlots(slots) => {
                write!(f, "a set-up time of {slots} slots is above {SETUP_SLOTS_MAX}")
            }
        }
    }
}

impl core::error::Error for StepConfigError {}

/// A validated [`StepConfig`], with the values derived for the sample path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckedSteps {
    scales: [Scale; 3],
    /// One bit per axis.
    inverted: u8,
    timing: Timing,
}

impl StepConfig {
    /// Motors of 200 full steps at 16 microsteps with screws of 8 mm lead; pulses of 1 us, and 5 us from a change of direction to
    /// the next pulse, the requirement of the slower common drives.
    pub const DEFAULT: Self = Self {
        axes: [AxisSteps {
            steps: 400,
            mm: 1,
            inverted: false,
        }; 3],
        pulse_slots: 1,
        setup_slots: 5,
    };

    /// Checks every value, and derives those of the sample path. Takes a few thousand cycles: not for the sample path.
    ///
    /// # Errors
    /// See [`StepConfigError`].
    pub fn check(&self) -> core::result::Result<CheckedSteps, StepConfigError> {
        if !(1..=PULSE_SLOTS_MAX).contains(&self.pulse_slots) {
            return Err(StepConfigError::PulseSlots(self.pulse_slots));
        }
        if self.setup_slots > SETUP_SLOTS_MAX {
            return Err(StepConfigError::SetupSlots(self.setup_slots));
        }
        let [x, y, z] = self.axes;
        let scale = |axis, of: AxisSteps| {
            Scale::new(of.steps, of.mm).ok_or(StepConfigError::StepsPerMm {
                axis,
                steps: of.steps,
                mm: of.mm,
            })
        };
        Ok(CheckedSteps {
            scales: [scale(0, x)?, scale(1, y)?, scale(2, z)?],
            inverted: u8::from(x.inverted) | u8::from(y.inverted) << 1 | u8::from(z.inverted) << 2,
            timing: Timing {
                pulse: self.pulse_slots.into(),
                setup: TURN_SLOTS + u32::from(self.setup_slots),
            },
        })
    }
}

impl CheckedSteps {
    /// Maximum steps of an axis in a period.
    #[must_use]
    pub const fn steps_max(&self) -> u32 {
        self.timing.steps_max()
    }
}

/// Step generator of three axes: positions and steps carried over.
#[derive(Debug)]
pub struct Steps {
    checked: CheckedSteps,
    /// Set and reset bit of each axis in its port's word.
    bits: [u32; 3],
    /// The word of a slot without a pulse.
    rest: u32,
    axes: [Axis; 3],
    /// The last target position of the axes, nm.
    cl_nm: [i32; 3],
}

impl Steps {
    /// A generator with the axes at the origin. `pins`: number of each axis's step pin, 0 to 15 (only the low four bits count), all on one port.
    #[must_use]
    pub fn new(checked: CheckedSteps, pins: [u8; 3]) -> Self {
        let mut steps = Self {
            checked,
            bits: pins.map(|pin| 0x1_0001 << (pin & 15)),
            rest: 0,
            axes: [Axis::new(); 3],
            cl_nm: [0; 3],
        };
        steps.set_low_pulses(0);
        steps.place([0; 3]);
        steps
    }

    /// Axes whose pulses are low, one bit each; the others' are high. The slots have to be at the new [`Self::rest`] before the next pulse.
    pub fn set_low_pulses(&mut self, axes: u8) {
        let [x, y, z] = self.bits;
        let low = [x, y, z]
            .into_iter()
            .enumerate()
            .filter(|(axis, _)| axes >> axis & 1 != 0)
            .fold(0, |bits, (_, bit)| bits | bit);
        self.rest = (low & 0xffff) | ((x | y | z) & !low & 0xffff_0000);
    }

    /// Changes the settings of the drives. The position is kept; steps carried over are dropped.
    pub fn configure(&mut self, checked: CheckedSteps) {
        self.checked = checked;
        self.place(self.cl_nm);
    }

    /// Sets the position of the axes without a pulse: after homing, or at the start of a job without an approach.
    pub fn place(&mut self, cl_nm: [i32; 3]) {
        self.cl_nm = cl_nm;
        for ((axis, scale), nm) in self.axes.iter_mut().zip(&self.checked.scales).zip(cl_nm) {
            axis.place(scale, nm);
        }
    }

    /// The last target position of the axes, nm.
    #[must_use]
    pub const fn target_nm(&self) -> [i32; 3] {
        self.cl_nm
    }

    /// The settings in force.
    #[must_use]
    pub const fn settings(&self) -> &CheckedSteps {
        &self.checked
    }

    /// The word of a slot without a pulse: every step pin at its idle level.
    #[must_use]
    pub const fn rest(&self) -> u32 {
        self.rest
    }

    /// Steps output to each axis, as of the end of the next period.
    #[must_use]
    pub fn position(&self) -> [i32; 3] {
        self.axes.each_ref().map(Axis::position)
    }

    /// Axes whose direction in the next period is minus, one bit each, inverted where the direction is inverted. To be set on the
    /// pins between the beginning of that period and its slot [`TURN_SLOTS`]; the board's table defines the level for minus.
    #[must_use]
    pub fn directions(&self) -> u8 {
        let [x, y, z] = self.axes.each_ref().map(|axis| u8::from(axis.is_negative()));
        (x | y << 1 | z << 2) ^ self.checked.inverted
    }

    /// The pulses of the next period, in which the axes go to this cutter location. `slots`: all at [`Self::rest`] on entry; receives
    /// the pulses.
    ///
    /// Bounded by [`SLOTS`]/2 writes per axis. Call it every period, also at standstill, so that steps carried over are output.
    ///
    /// # Errors
    /// [`FaultKind::StepRate`] with the commanded steps, where an axis has more than a period holds. The steps that fit are in the
    /// slots, the others are carried over: stop along the path, and continue to call.
    #[inline(never)]
    pub fn step(&mut self, cl_nm: [i32; 3], slots: &mut [u32; BUFFER_WORDS]) -> Result<()> {
        let mut asked_max = 0;
        let from = core::mem::replace(&mut self.cl_nm, cl_nm);
        let moves = from.into_iter().zip(cl_nm).zip(self.bits);
        for ((axis, scale), ((from, to), bit)) in self.axes.iter_mut().zip(&self.checked.scales).zip(moves) {
            let travel_nm = i64::from(to) - i64::from(from);
            let excess = axis.step(scale, self.checked.timing, travel_nm, bit, slots);
            asked_max = asked_max.max(excess);
        }
        if asked_max == 0 {
            return Ok(());
        }
        #[allow(
            clippy::cast_precision_loss,
            reason = "a count beyond 2^24 needs no last digit"
        )]
        Err(Fault::new(FaultKind::StepRate, asked_max as f32))
    }
}
