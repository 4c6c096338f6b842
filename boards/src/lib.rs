//! The boards that the firmware runs on: which chip, which pin is what, where it is found on a connector.
//!
//! ```text
//! skr_pro.rs, stm32f405.rs   a board each: its table of lines
//!        │
//!        ├─► setup.rs ──► firmware     what the pin registers are set to, computed when the firmware is built
//!        ├─► firmware's drivers        which bits are step pulses, which level of an input is the alarm
//!        ├─► `cargo sim flash`, `log`  which chip to look for, which image to write
//!        └─► tests                     no pin twice, each on its package, steps on one port; the guide's tables
//! ```
//!
//! To add a board, add its file here and to [`BOARDS`], its feature and file in `firmware`, and its alias in
//! `.cargo/config.toml`.
//!
//! **Inputs fail to the safe side.** A switch is closed in the good case and pulls its pin to ground; it opens when it is
//! pressed, and then the pull-up makes the pin high, as it does when a wire breaks or a plug is out. So the active level of
//! every input is [`Level::High`]. An input that is not used is bridged to ground.
#![no_std]

pub mod setup;
mod skr_pro;
mod stm32f405;
#[cfg(test)]
mod tests;

pub use skr_pro::SKR_PRO;
pub use stm32f405::STM32F405;

/// Every board with a chip. (QEMU's board has no pins; it stands for [`STM32F405`].)
pub const BOARDS: [&Board; 2] = [&STM32F405, &SKR_PRO];

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// Its name on the command line.
    pub id: &'static str,
    /// Its name for people.
    pub name: &'static str,
    /// Its chip.
    pub chip: Chip,
    /// The crystal, MHz.
    pub crystal_mhz: u32,
    /// The alias of cargo's that builds its image, and the folder under `target/` that it is built in.
    pub build: (&'static str, &'static str),
    /// Every pin that is used or held at rest.
    pub lines: &'static [Line],
}

/// A chip, as its reference manual (RM0090) and a debug probe know it.
#[derive(Clone, Copy, Debug)]
pub struct Chip {
    /// Its name in probe-rs.
    pub name: &'static str,
    /// `DEV_ID` in `DBGMCU_IDCODE` (RM0090, 38.6.1).
    pub device_id: u16,
    /// Flash, bytes, from [`FLASH_BEGIN`] on.
    pub flash_bytes: u32,
    /// What pins there are.
    pub package: Package,
}

/// Name of the symbol in an image of the firmware under which its board is found: [`Board::mark`], [`MARK_BYTES`] long.
pub const MARK_SYMBOL: &str = "isofeed_board";

/// Room for a board's name in an image.
pub const MARK_BYTES: usize = 24;

/// Where flash begins.
pub const FLASH_BEGIN: u32 = 0x0800_0000;

/// Housings of the STM32F405 and F407, by the pins that they lead out (data sheet DS8626, table 7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Package {
    /// 64 pins: ports A to C, PD2, PH0, PH1.
    Lqfp64,
    /// 144 pins: ports A to G, PH0, PH1.
    Lqfp144,
}

impl Package {
    /// Whether it leads this pin out.
    #[must_use]
    pub const fn has(self, pin: Pin) -> bool {
        let number = pin.number;
        let everywhere = match pin.port {
            Port::A | Port::B | Port::C => number < 16,
            Port::D => number == 2,
            Port::H => number < 2,
            Port::E | Port::F | Port::G => false,
        };
        everywhere || (matches!(self, Self::Lqfp144) && number < 16 && !matches!(pin.port, Port::H))
    }
}

/// A port of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
#[expect(missing_docs, reason = "letters")]
pub enum Port {
    A,
    B,
    C,
    D,
    E,
    F,
    G,
    H,
}

impl Port {
    /// All ports, in the order of their registers.
    pub const ALL: [Self; 8] = [
        Self::A,
        Self::B,
        Self::C,
        Self::D,
        Self::E,
        Self::F,
        Self::G,
        Self::H,
    ];

    /// 0 for A: the place among the ports' registers, and the bit in `RCC_AHB1ENR`.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// A pin of the chip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Pin {
    /// The port.
    pub port: Port,
    /// Its number there, 0 to 15.
    pub number: u8,
}

impl Pin {
    /// The pin of this port and number.
    #[must_use]
    pub const fn new(port: Port, number: u8) -> Self {
        assert!(number < 16, "a port has 16 pins");
        Self { port, number }
    }

    /// Its bit in the port's data registers.
    #[must_use]
    pub const fn bit(self) -> u32 {
        1 << self.number
    }
}

impl core::fmt::Display for Pin {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "P{:?}{}", self.port, self.number)
    }
}

/// A level of a pin.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "they say it")]
pub enum Level {
    Low,
    High,
}

/// An axis of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "letters")]
pub enum Axis {
    X,
    Y,
    Z,
}

impl Axis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];
}

/// What a pin is for, and so what its active level means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Output: a pulse to the active level is a step.
    Step(Axis),
    /// Output: active while the axis moves towards plus.
    Direction(Axis),
    /// Output: active, the drive holds its motor.
    Enable(Axis),
    /// Input: active at the lower end of the axis.
    LimitMin(Axis),
    /// Input: active at the upper end of the axis.
    LimitMax(Axis),
    /// Input: active when the emergency stop is pressed.
    EmergencyStop,
    /// Input: active when a drive reports a fault.
    DriveFault,
    /// Output: active, the status LED shines.
    StatusLed,
    /// USART1, to the host.
    SerialTx,
    /// USART1, from the host.
    SerialRx,
    /// Output that is never active: what else hangs on the board stays off.
    Parked,
}

impl Role {
    /// A number for each role: what `==` would compare, where it cannot be used yet (constants).
    const fn key(self) -> u8 {
        match self {
            Self::Step(axis) => axis as u8,
            Self::Direction(axis) => 3 + axis as u8,
            Self::Enable(axis) => 6 + axis as u8,
            Self::LimitMin(axis) => 9 + axis as u8,
            Self::LimitMax(axis) => 12 + axis as u8,
            Self::EmergencyStop => 15,
            Self::DriveFault => 16,
            Self::StatusLed => 17,
            Self::SerialTx => 18,
            Self::SerialRx => 19,
            Self::Parked => 20,
        }
    }

    /// Whether the pin is read.
    #[must_use]
    pub const fn is_input(self) -> bool {
        matches!(
            self,
            Self::LimitMin(_) | Self::LimitMax(_) | Self::EmergencyStop | Self::DriveFault | Self::SerialRx
        )
    }
}

impl core::fmt::Display for Role {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Step(axis) => write!(f, "{axis:?} step"),
            Self::Direction(axis) => write!(f, "{axis:?} direction"),
            Self::Enable(axis) => write!(f, "{axis:?} enable"),
            Self::LimitMin(axis) => write!(f, "{axis:?} limit, lower end"),
            Self::LimitMax(axis) => write!(f, "{axis:?} limit, upper end"),
            Self::EmergencyStop => f.write_str("emergency stop"),
            Self::DriveFault => f.write_str("drive fault"),
            Self::StatusLed => f.write_str("status LED"),
            Self::SerialTx => f.write_str("serial, to the host"),
            Self::SerialRx => f.write_str("serial, from the host"),
            Self::Parked => f.write_str("kept off"),
        }
    }
}

/// A pin in its role.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// What for.
    pub role: Role,
    /// The pin.
    pub pin: Pin,
    /// The level that means it (see [`Role`]).
    pub active: Level,
    /// Where it is found on the board.
    pub place: &'static str,
}

impl Line {
    const fn new(role: Role, port: Port, number: u8, active: Level, place: &'static str) -> Self {
        Self {
            role,
            pin: Pin::new(port, number),
            active,
            place,
        }
    }

    /// Bits of the port's set/reset register (`BSRR`) that make an output active, or inactive.
    #[must_use]
    pub const fn set_reset(&self, active: bool) -> u32 {
        if active == matches!(self.active, Level::High) {
            self.pin.bit()
        } else {
            self.pin.bit() << 16
        }
    }

    /// Whether an input is active, from its port's input register (`IDR`).
    #[must_use]
    pub const fn is_active(&self, input: u32) -> bool {
        (input & self.pin.bit() != 0) == matches!(self.active, Level::High)
    }
}

/// The lines of one axis.
#[derive(Clone, Copy, Debug)]
pub struct AxisLines {
    /// Step pulses.
    pub step: Line,
    /// Direction.
    pub direction: Line,
    /// Drive enable.
    pub enable: Line,
    /// Limit switch at the lower end.
    pub limit_min: Line,
    /// Limit switch at the upper end.
    pub limit_max: Line,
}

impl Board {
    /// The board's name as it lies in an image of the firmware: filled up with zeros.
    #[must_use]
    pub const fn mark(&self) -> [u8; MARK_BYTES] {
        let id = self.id.as_bytes();
        assert!(id.len() <= MARK_BYTES, "the name is too long");
        let mut mark = [0; MARK_BYTES];
        let mut index = 0;
        while index < id.len() {
            mark[index] = id[index];
            index += 1;
        }
        mark
    }

    /// The line of this role. To be used in constants, where a missing one is an error of the build.
    ///
    /// # Panics
    /// The board has none.
    #[must_use]
    pub const fn line(&self, role: Role) -> Line {
        let mut index = 0;
        while index < self.lines.len() {
            if self.lines[index].role.key() == role.key() {
                return self.lines[index];
            }
            index += 1;
        }
        panic!("the board has no line of this role")
    }

    /// The lines of an axis. To be used in constants, likewise.
    #[must_use]
    pub const fn axis(&self, axis: Axis) -> AxisLines {
        AxisLines {
            step: self.line(Role::Step(axis)),
            direction: self.line(Role::Direction(axis)),
            enable: self.line(Role::Enable(axis)),
            limit_min: self.line(Role::LimitMin(axis)),
            limit_max: self.line(Role::LimitMax(axis)),
        }
    }

    /// The port that all step pins are on: one transfer to its `BSRR` steps any of the axes at the same instant.
    ///
    /// # Panics
    /// They are on several; to be used in constants, likewise.
    #[must_use]
    pub const fn step_port(&self) -> Port {
        let port = self.line(Role::Step(Axis::X)).pin.port;
        assert!(
            self.line(Role::Step(Axis::Y)).pin.port as u8 == port as u8
                && self.line(Role::Step(Axis::Z)).pin.port as u8 == port as u8,
            "the step pins are on several ports"
        );
        port
    }
}
