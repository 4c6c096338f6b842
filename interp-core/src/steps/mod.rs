//! Steps: cutter locations become step and direction signals, three axes, one period at a time.
//!
//! ```text
//!  CL, nm ──► scale: exact fraction ──► steps of this period, and where in it each falls
//!                                              │ axis: direction, pauses, steps carried over
//!                                              ▼
//!                                     slots of the next period ──► a timer hands one word a slot to the port
//! ```
//!
//! The axes follow one period behind: while a period passes, the tick works out the pulses of the next. Between two samples
//! the axes move evenly, so a step belongs where that straight line crosses the middle between two step positions; pulses are
//! even from period to period too, however slow they come.
//!
//! # Words
//! A slot's word goes to a port's set/reset register: set bits in its low half, reset bits in its high half, set winning
//! where both are given (RM0090, 8.4.7). A slot at rest resets every step pin ([`Steps::rest`]); a pulse adds its set bit to as
//! many slots as it is long. So a pulse ends by itself, and a buffer that nobody writes holds every pin low.
//!
//! # What holds
//! - The number of steps is that of the position, rounded to the nearest, at any distance: the position is kept as
//!   steps and remainder, both integers. The tool may turn without stepping back for [`HOLD_NM`], so that a position that trembles by
//!   a nanometre where two steps meet does not make the motor tremble.
//! - A pulse lies within a slot of its place; two pulses of an axis are never nearer than two pulse lengths, over the ends of
//!   periods too.
//! - The direction changes between periods, never within a pulse or the pause after it; the first pulse then comes after the
//!   set-up time. Pulses that no longer fit come in the next period.
//! - More steps than a period holds are a fault. They are not lost: what does not fit stays owed, and follows.

mod axis;
mod scale;
#[cfg(test)]
mod tests;

use crate::fault::{Fault, FaultKind, Result};
use axis::{Axis, Timing};
use scale::Scale;

/// Slots of a period. 1000 a millisecond are 168 clocks of the 168 MHz timer, a whole number as 800 (210) would be
/// and 1250 (134.4) would not; with a slot up and a slot down, 500 kHz.
pub const SLOTS: u32 = 1000;

/// Words of a buffer: as many as ten bits count, so that no index can be out of range. Those from [`SLOTS`] on are never played.
pub const BUFFER_WORDS: usize = 1024;

/// Longest pulse, slots: a pulse that begins in the last slot has to end within the buffer.
pub const PULSE_SLOTS_MAX: u8 = 24;

/// Slots that the board has for setting the direction pins when a period begins: its interrupt's delay.
pub const TURN_SLOTS: u32 = 16;

/// Longest set-up time of the direction, slots: with [`TURN_SLOTS`] about half the period.
pub const SETUP_SLOTS_MAX: u16 = 480;

/// How far a position may go back over the middle between two steps before the axis follows, nm. Twice what rounding
/// makes of a standing tool, and less than any axis shows. A quarter of a step at most.
pub const HOLD_NM: u32 = 4;

/// Steps of one axis a millimetre, as an exact fraction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisSteps {
    /// Numerator: steps.
    pub steps: u32,
    /// Denominator: the millimetres of these steps.
    pub mm: u32,
    /// Whether the direction pin has the level towards plus that the board's table does not name: the opposite one.
    pub inverted: bool,
}

/// What the axes' drives want. [`StepConfig::check`] makes it usable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepConfig {
    /// The axes x, y, z.
    pub axes: [AxisSteps; 3],
    /// Length of a pulse, and least pause after it, in slots: 1 to [`PULSE_SLOTS_MAX`].
    pub pulse_slots: u8,
    /// Slots from a change of direction to the first pulse, at least: at most [`SETUP_SLOTS_MAX`]. The pulse comes so many and
    /// [`TURN_SLOTS`] after the beginning of the period.
    pub setup_slots: u16,
}

/// Why a [`StepConfig`] cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepConfigError {
    /// Steps a millimetre are not within 1/1000 to 500 000.
    StepsPerMm {
        /// The axis, from 0.
        axis: u8,
        /// Steps.
        steps: u32,
        /// Millimetres.
        mm: u32,
    },
    /// The pulse's length.
    PulseSlots(u8),
    /// The set-up time.
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

/// A [`StepConfig`] that cannot be wrong, with what the sample path wants of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CheckedSteps {
    scales: [Scale; 3],
    /// A bit an axis.
    inverted: u8,
    timing: Timing,
}

impl StepConfig {
    /// Motors of 200 full steps at 16 microsteps with screws of 8 mm lead; pulses of 1 us, and 5 us from a change of direction to
    /// the next pulse, which is what the slower ones of the usual drives ask for.
    pub const DEFAULT: Self = Self {
        axes: [AxisSteps {
            steps: 400,
            mm: 1,
            inverted: false,
        }; 3],
        pulse_slots: 1,
        setup_slots: 5,
    };

    /// Checks every value, and prepares. Some thousand cycles: not for the sample path.
    ///
    /// # Errors
    /// [`StepConfigError`] as its variants say.
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
    /// Most steps of an axis that a period holds.
    #[must_use]
    pub const fn steps_max(&self) -> u32 {
        self.timing.steps_max()
    }
}

/// Three axes' steps: where they are, and what they owe.
#[derive(Debug)]
pub struct Steps {
    checked: CheckedSteps,
    /// Set bit of each axis in its port's word.
    bits: [u32; 3],
    axes: [Axis; 3],
    /// The last target position of the axes, nm.
    cl_nm: [i32; 3],
}

impl Steps {
    /// AxisLimits at the origin. `pins`: number of each axis's step pin, 0 to 15 (only the low four bits count), all on one port.
    #[must_use]
    pub fn new(checked: CheckedSteps, pins: [u8; 3]) -> Self {
        let mut steps = Self {
            checked,
            bits: pins.map(|pin| 1 << (pin & 15)),
            axes: [Axis::new(); 3],
            cl_nm: [0; 3],
        };
        steps.place([0; 3]);
        steps
    }

    /// Other drives, or other settings of them. The axes stand where they are: the position is kept, steps carried over are dropped.
    pub fn configure(&mut self, checked: CheckedSteps) {
        self.checked = checked;
        self.place(self.cl_nm);
    }

    /// Says where the axes stand, without a pulse: after homing, or where a job begins that knows no way there.
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

    /// The word of a slot in which nothing happens: every step pin low.
    #[must_use]
    pub fn rest(&self) -> u32 {
        let [x, y, z] = self.bits;
        (x | y | z) << 16
    }

    /// Steps that have gone out to each axis, as of the end of the next period.
    #[must_use]
    pub fn position(&self) -> [i32; 3] {
        self.axes.each_ref().map(Axis::position)
    }

    /// Axes whose direction pin says minus in the next period, a bit each: those that move towards minus, exchanged where inverted. To be on the
    /// pins before slot [`TURN_SLOTS`] of it, and not before it begins; which level says minus is the board's.
    #[must_use]
    pub fn directions(&self) -> u8 {
        let [x, y, z] = self.axes.each_ref().map(|axis| u8::from(axis.is_negative()));
        (x | y << 1 | z << 2) ^ self.checked.inverted
    }

    /// The pulses of the next period, in which the axes go to this cutter location. `slots`: all at [`Self::rest`]; gets
    /// the pulses added.
    ///
    /// Bounded by [`SLOTS`]/2 writes an axis. Call it every period, also where nothing moves: steps carried over follow then.
    ///
    /// # Errors
    /// [`FaultKind::StepRate`] with the steps asked for, where an axis has more than a period holds. As many as fit are in the
    /// slots, and the rest is owed: stop along the path, and go on calling.
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
