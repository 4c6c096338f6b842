//! Drive enable of the axes, spindle and coolant: off after a reset, and switched off in the tick that detects a cause.

use boards::{Axis, Board, Line, Pin, Port, Role};
use controller::spindle::output;

/// The set/reset registers of the chip's ports, and the speed output.
pub(crate) trait WritePorts {
    /// Writes `BSRR` of this port: a bit of the lower half sets a pin, of the upper half resets one.
    fn set_reset(&mut self, port: Port, bits: u32);

    /// Exchanges the levels of a pin for whatever makes all outputs inactive after a processor fault.
    fn invert(&mut self, pin: Pin, is_inverted: bool);

    /// Sets the duty cycle of the speed output, in steps of `PWM_STEPS`.
    fn duty(&mut self, steps: u32);
}

/// The enable lines of all axes, and those of spindle and coolant.
pub(crate) struct DriveEnable<P> {
    ports: P,
    /// The lines, in the order of [`pins_of`].
    lines: [Line; 6],
    has_speed: bool,
    word: u32,
}

impl<P: WritePorts> DriveEnable<P> {
    /// The lines of this board. The pins have to be set up and inactive. `has_speed`: the speed output's timer is there.
    pub(crate) const fn new(ports: P, board: &Board, has_speed: bool) -> Self {
        Self {
            ports,
            lines: [
                board.axis(Axis::X).enable,
                board.axis(Axis::Y).enable,
                board.axis(Axis::Z).enable,
                board.line(Role::SpindleDirection),
                board.line(Role::SpindleEnable),
                board.line(Role::Coolant),
            ],
            has_speed,
            word: 0,
        }
    }

    /// Switches all outputs, by [`controller::realtime::RealTime::outputs`]. Returns the axes whose step pulses are inverted, one bit each, where
    /// anything has changed.
    #[inline]
    pub(crate) fn set(&mut self, word: u32) -> Option<u8> {
        if word == self.word {
            return None;
        }
        self.switch(word);
        Some((word >> output::STEP_INVERTED_SHIFT) as u8 & 0b111)
    }

    #[cold]
    #[inline(never)]
    fn switch(&mut self, word: u32) {
        let (changed, pins) = (pins_of(self.word) ^ pins_of(word), pins_of(word));
        self.word = word;
        let inverted = word >> output::ENABLE_INVERTED_SHIFT;
        for (axis, line) in self.lines.iter().take(Axis::ALL.len()).enumerate() {
            self.ports.invert(line.pin, inverted >> axis & 1 != 0);
        }
        for (index, line) in self.lines.iter().enumerate() {
            if changed >> index & 1 != 0 {
                self.ports
                    .set_reset(line.pin.port, line.set_reset(pins >> index & 1 != 0));
            }
        }
        if self.has_speed {
            self.ports.duty(word >> output::DUTY_SHIFT);
        }
    }
}

/// The lines that an outputs' word makes active by the board's table, one bit each: enables of x, y, z, the spindle's direction and enable, coolant.
const fn pins_of(word: u32) -> u32 {
    let enables = if word & output::DRIVES != 0 { 0b111 } else { 0 };
    let others = [output::COUNTERCLOCKWISE, output::SPINDLE, output::COOLANT];
    let [direction, spindle, coolant] = others;
    (enables ^ (word >> output::ENABLE_INVERTED_SHIFT & 0b111))
        | ((word & direction != 0) as u32) << 3
        | ((word & spindle != 0) as u32) << 4
        | ((word & coolant != 0) as u32) << 5
}
