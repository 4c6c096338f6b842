//! Drive enable of the axes: off after a reset, and switched off in the tick that detects a cause.

use boards::{Axis, Board, Line, Port};

/// The set/reset registers of the chip's ports.
pub(crate) trait WritePorts {
    /// Writes `BSRR` of this port: a bit of the lower half sets a pin, of the upper half resets one.
    fn set_reset(&mut self, port: Port, bits: u32);
}

/// The enable lines of all axes.
pub(crate) struct DriveEnable<P> {
    ports: P,
    lines: [Line; 3],
    on: bool,
}

impl<P: WritePorts> DriveEnable<P> {
    /// The enable lines of this board. The pins have to be set up and inactive.
    pub(crate) const fn new(ports: P, board: &Board) -> Self {
        Self {
            ports,
            lines: [
                board.axis(Axis::X).enable,
                board.axis(Axis::Y).enable,
                board.axis(Axis::Z).enable,
            ],
            on: false,
        }
    }

    /// Switches all drives.
    #[inline]
    pub(crate) fn set(&mut self, on: bool) {
        if on != self.on {
            self.switch(on);
        }
    }

    #[cold]
    #[inline(never)]
    fn switch(&mut self, on: bool) {
        self.on = on;
        for line in &self.lines {
            self.ports.set_reset(line.pin.port, line.set_reset(on));
        }
    }
}
