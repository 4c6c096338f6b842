//! The values of the pin registers, computed from the table of lines at compile time (RM0090, 8.4).

use crate::{Line, Port, Role};

/// `MODER`: an output.
const OUTPUT: u32 = 0b01;
/// `MODER`: alternate function.
const ALTERNATE: u32 = 0b10;
/// `OSPEEDR` of step and direction, medium speed (25 MHz): edges of 10 ns, short compared with pulses of 1 us and slow enough for a cable.
const MEDIUM: u32 = 0b01;
/// `PUPDR`: pulled up.
const PULL_UP: u32 = 0b01;
/// `AFR`: USART1, TIM12.
const USART1: u32 = 7;
const TIM12: u32 = 9;

/// A masked write of a register: the bits to change and their values.
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

/// The registers of one port. Write them in this order, so that each output starts at its inactive level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PortSetup {
    /// `BSRR`, written without a mask: every output inactive.
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

    /// Whether the port has a line.
    #[must_use]
    pub const fn is_used(&self) -> bool {
        self.mode.mask != 0
    }

    /// The registers with one more line.
    const fn with(mut self, line: &Line) -> Self {
        let number = line.pin.number;
        match line.role {
            Role::SerialTx | Role::SerialRx | Role::SpindleSpeed => {
                let half = (number / 8) as usize;
                let function = if matches!(line.role, Role::SpindleSpeed) {
                    TIM12
                } else {
                    USART1
                };
                self.alternate[half] = self.alternate[half].with(number % 8, 4, function);
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
            self.speed = self.speed.with(number, 2, MEDIUM);
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

/// The word for each port's `BSRR` that makes every output inactive; 0 where a port has no output.
#[must_use]
pub const fn rest(lines: &[Line]) -> [u32; Port::ALL.len()] {
    let ports = ports(lines);
    let mut rest = [0; Port::ALL.len()];
    let mut index = 0;
    while index < ports.len() {
        rest[index] = ports[index].set_reset;
        index += 1;
    }
    rest
}

/// `RCC_AHB1ENR`, whose lowest bits are the ports' clocks (RM0090, 7.3.10).
const PORT_CLOCKS: u32 = 0x4002_3830;
/// Address of port A's registers (RM0090, 2.3).
const PORTS_BEGIN: u32 = 0x4002_0000;
/// Distance between the registers of a port and those of the next one, bytes.
const PORT_BYTES: u32 = 0x400;

/// A read-modify-write of a register: three words, in the layout that the reset code reads.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Write {
    /// The register.
    pub address: u32,
    /// Bits that are cleared first.
    pub clear: u32,
    /// Bits that are set then.
    pub set: u32,
}

/// Registers written per port: `BSRR`, `OSPEEDR`, `PUPDR`, `AFRL`, `AFRH`, `MODER`.
const PORT_WRITES: usize = 6;

/// The number of [`writes`] for these lines.
#[must_use]
pub const fn writes_count(lines: &[Line]) -> usize {
    let ports = ports(lines);
    let mut count = 2;
    let mut index = 0;
    while index < ports.len() {
        if ports[index].is_used() {
            count += PORT_WRITES;
        }
        index += 1;
    }
    count
}

/// All writes that set up the pins, in order: the ports' clocks; the same write again, whose read waits for the clocks (ES0182, 2.1.13); then each port, with its
/// output levels inactive before the pins become outputs.
///
/// # Panics
/// `N` is not [`writes_count`]. For use in constants.
#[must_use]
pub const fn writes<const N: usize>(lines: &[Line]) -> [Write; N] {
    let ports = ports(lines);
    let nothing = Write {
        address: 0,
        clear: 0,
        set: 0,
    };
    let mut writes = [nothing; N];
    let (mut clocks, mut next, mut index) = (0, 2, 0);
    while index < ports.len() {
        if ports[index].is_used() {
            clocks |= 1 << index;
            let of_port = port_writes(&ports[index], PORTS_BEGIN + PORT_BYTES * index as u32);
            let mut place = 0;
            while place < PORT_WRITES {
                writes[next] = of_port[place];
                next += 1;
                place += 1;
            }
        }
        index += 1;
    }
    assert!(next == N, "as many writes as the lines need");
    let clocks = Write {
        address: PORT_CLOCKS,
        clear: 0,
        set: clocks,
    };
    (writes[0], writes[1]) = (clocks, clocks);
    writes
}

const fn port_writes(setup: &PortSetup, base: u32) -> [Write; PORT_WRITES] {
    const fn change(address: u32, field: Field) -> Write {
        Write {
            address,
            clear: field.mask,
            set: field.value,
        }
    }
    [
        Write {
            address: base + 0x18,
            clear: u32::MAX,
            set: setup.set_reset,
        },
        change(base + 0x08, setup.speed),
        change(base + 0x0c, setup.pull),
        change(base + 0x20, setup.alternate[0]),
        change(base + 0x24, setup.alternate[1]),
        change(base, setup.mode),
    ]
}
