//! What the pin registers are set to, computed from the table of lines when the firmware is built (RM0090, 8.4).

use crate::{Line, Port, Role};

/// `MODER`: an output.
const OUTPUT: u32 = 0b01;
/// `MODER`: left to a peripheral.
const ALTERNATE: u32 = 0b10;
/// `OSPEEDR` of step and direction: edges of a few nanoseconds, for pulses of a microsecond.
const FAST: u32 = 0b10;
/// `PUPDR`: pulled up.
const PULL_UP: u32 = 0b01;
/// `AFR`: USART1.
const USART1: u32 = 7;

/// What is to change in a register: these bits to that value, the rest stays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Field {
    /// Bits that change.
    pub mask: u32,
    /// Their values.
    pub value: u32,
}

impl Field {
    /// The register's new value.
    #[must_use]
    pub const fn apply(self, register: u32) -> u32 {
        register & !self.mask | self.value
    }

    /// With `value` in the `width` bits of pin `number`.
    const fn with(self, number: u8, width: u32, value: u32) -> Self {
        let shift = number as u32 * width;
        Self {
            mask: self.mask | ((1 << width) - 1) << shift,
            value: self.value | value << shift,
        }
    }
}

/// The registers of one port. To be written in this order, so that an output appears at its inactive level at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortSetup {
    /// `BSRR`, written as it is: every output inactive.
    pub set_reset: u32,
    /// `OSPEEDR`.
    pub speed: Field,
    /// `PUPDR`.
    pub pull: Field,
    /// `AFRL`, `AFRH`.
    pub alternate: [Field; 2],
    /// `MODER`.
    pub mode: Field,
}

impl PortSetup {
    const NOTHING: Self = {
        let field = Field { mask: 0, value: 0 };
        Self {
            set_reset: 0,
            speed: field,
            pull: field,
            alternate: [field; 2],
            mode: field,
        }
    };

    /// Whether the port has a line at all.
    #[must_use]
    pub const fn is_used(&self) -> bool {
        self.mode.mask != 0
    }

    /// With one line more.
    const fn with(mut self, line: &Line) -> Self {
        let number = line.pin.number;
        match line.role {
            Role::SerialTx | Role::SerialRx => {
                let half = (number / 8) as usize;
                self.alternate[half] = self.alternate[half].with(number % 8, 4, USART1);
                self.mode = self.mode.with(number, 2, ALTERNATE);
            }
            role if role.is_input() => self.mode = self.mode.with(number, 2, 0),
            _ => {
                self.set_reset |= line.set_reset(false);
                self.mode = self.mode.with(number, 2, OUTPUT);
            }
        }
        if line.role.is_input() {
            self.pull = self.pull.with(number, 2, PULL_UP);
        }
        if matches!(line.role, Role::Step(_) | Role::Direction(_)) {
            self.speed = self.speed.with(number, 2, FAST);
        }
        self
    }
}

/// The registers of all ports, in the ports' order.
#[must_use]
pub const fn ports(lines: &[Line]) -> [PortSetup; Port::ALL.len()] {
    let mut ports = [PortSetup::NOTHING; Port::ALL.len()];
    let mut index = 0;
    while index < lines.len() {
        let port = lines[index].pin.port.index();
        ports[port] = ports[port].with(&lines[index]);
        index += 1;
    }
    ports
}
