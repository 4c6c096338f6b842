//! Drive enable of the axes, spindle and coolant: off after a reset, and switched off in the tick that detects a cause.

use boards::{Axis, Board, Line, Port, Role};
use controller::spindle::output;

/// The set/reset registers of the chip's ports, and the speed output.
pub(crate) trait WritePorts {
    /// Writes `BSRR` of this port: a bit of the lower half sets a pin, of the upper half resets one.
    fn set_reset(&mut self, port: Port, bits: u32);

    /// Sets the duty cycle of the speed output, in steps of `PWM_STEPS`.
    fn duty(&mut self, steps: u32);
}

/// The enable lines of all axes, and those of spindle and coolant.
pub(crate) struct DriveEnable<P> {
    ports: P,
    /// Each line with its bit of [`output`].
    lines: [(Line, u32); 6],
    has_speed: bool,
    word: u32,
}

impl<P: WritePorts> DriveEnable<P> {
    /// The lines of this board. The pins have to be set up and inactive. `has_speed`: the speed output's timer is there.
    pub(crate) const fn new(ports: P, board: &Board, has_speed: bool) -> Self {
        Self {
            ports,
            lines: [
                (board.axis(Axis::X).enable, output::DRIVES),
                (board.axis(Axis::Y).enable, output::DRIVES),
                (board.axis(Axis::Z).enable, output::DRIVES),
                (board.line(Role::SpindleDirection), output::COUNTERCLOCKWISE),
                (board.line(Role::SpindleEnable), output::SPINDLE),
                (board.line(Role::Coolant), output::COOLANT),
            ],
            has_speed,
            word: 0,
        }
    }

    /// Switches all outputs, by [`controller::realtime::RealTime::outputs`].
    #[inline]
    pub(crate) fn set(&mut self, word: u32) {
        if word != self.word {
            self.switch(word);
        }
    }

    #[cold]
    #[inline(never)]
    fn switch(&mut self, word: u32) {
        let changed = self.word ^ word;
        self.word = word;
        for (line, bit) in &self.lines {
            if changed & bit != 0 {
                self.ports
                    .set_reset(line.pin.port, line.set_reset(word & bit != 0));
            }
        }
        if self.has_speed {
            self.ports.duty(word >> output::DUTY_SHIFT);
        }
    }
}
