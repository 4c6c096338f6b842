//! The boards that the firmware runs on: chip, pin assignment, position of each pin on the connectors.
//!
//! ```text
//! skr_pro.rs, stm32f405.rs   one board per file: its table of lines
//!        │
//!        ├─► setup.rs ──► firmware     the values of the pin registers, computed at compile time
//!        ├─► firmware's drivers        the bits of the step pulses, the active level of each input
//!        ├─► `cargo sim flash`, `log`  the chip to connect to, the image to write
//!        └─► tests                     no pin twice, each on its package, step pins on one port; the guide's tables
//! ```
//!
//! To add a board, add its file here and to [`BOARDS`], its feature and file in `firmware`, and its alias in
//! `.cargo/config.toml`.
//!
//! **Inputs are fail-safe.** Switches are normally closed and pull their pin to ground; a switch opens when it is
//! pressed, and the pull-up then makes the pin high, as with a broken wire or a disconnected plug. So the active level of
//! every input is [`Level::High`], but for the contact that reports the spindle's speed: it closes, so that a broken wire is no speed. Unused inputs are bridged to ground.
#![no_std]

pub mod setup;
mod skr_pro;
mod stm32f405;
#[cfg(test)]
mod tests;

pub use skr_pro::SKR_PRO;
pub use stm32f405::STM32F405;

/// Every board with a chip. (QEMU's board has no pins; it uses the table of [`STM32F405`].)
pub const BOARDS: [&Board; 2] = [&STM32F405, &SKR_PRO];

/// A board.
#[derive(Clone, Copy, Debug)]
pub struct Board {
    /// Its name on the command line.
    pub id: &'static str,
    /// Its display name.
    pub name: &'static str,
    /// Its chip.
    pub chip: Chip,
    /// The crystal, MHz.
    pub crystal_mhz: u32,
    /// The Cargo alias that builds its image, and the image's folder under `target/`.
    pub build: (&'static str, &'static str),
    /// Its boot loader, which takes an image from a card; none where the chip starts the image itself.
    pub loader: Option<Loader>,
    /// How to enter the chip's own loader (DFU by USB), in words; none where the board cannot.
    pub dfu: Option<&'static str>,
    /// Every pin that is used or held inactive.
    pub lines: &'static [Line],
}

/// A boot loader in the first sectors of flash.
#[derive(Clone, Copy, Debug)]
pub struct Loader {
    /// The Cargo alias that builds the image for it, and the image's folder under `target/`.
    pub build: (&'static str, &'static str),
    /// First address of the image.
    pub image_begin: u32,
    /// The file that it looks for in the card's root folder.
    pub file: &'static str,
    /// The file's name after it was written.
    pub done_file: &'static str,
}

/// A chip: its identity in the reference manual (RM0090) and in probe-rs, and its package.
#[derive(Clone, Copy, Debug)]
pub struct Chip {
    /// Its name in probe-rs.
    pub name: &'static str,
    /// `DEV_ID` in `DBGMCU_IDCODE` (RM0090, 38.6.1).
    pub device_id: u16,
    /// Flash, bytes, from [`FLASH_BEGIN`] on.
    pub flash_bytes: u32,
    /// The package, which determines the available pins.
    pub package: Package,
}

/// Symbol in a firmware image that contains the board's name: [`Board::mark`], [`MARK_BYTES`] long.
pub const MARK_SYMBOL: &str = "isofeed_board";

/// Maximum length of a board's name in an image, bytes.
pub const MARK_BYTES: usize = 24;

/// First address of flash.
pub const FLASH_BEGIN: u32 = 0x0800_0000;

/// Packages of the STM32F405 and F407 (data sheet DS8626, table 7).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Package {
    /// 64 pins: ports A to C, PD2, PH0, PH1.
    Lqfp64,
    /// 144 pins: ports A to G, PH0, PH1.
    Lqfp144,
}

impl Package {
    /// Whether the package has this pin.
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

    /// 0 for A: the index of the port's registers, and its bit in `RCC_AHB1ENR`.
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

/// The function of a pin, which defines its active level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Output: each pulse to the active level is a step.
    Step(Axis),
    /// Output: active while the axis moves towards plus.
    Direction(Axis),
    /// Output: active enables the drive.
    Enable(Axis),
    /// Input: active at the lower end of the axis.
    LimitMin(Axis),
    /// Input: active at the upper end of the axis.
    LimitMax(Axis),
    /// Input: active when the emergency stop is pressed.
    EmergencyStop,
    /// Input: active when a drive reports a fault.
    DriveFault,
    /// Input: active when the probe touches.
    Probe,
    /// Input: active when the safety door is open.
    Door,
    /// Input: active when the spindle is at speed.
    AtSpeed,
    /// Input: active while the start button is pressed. It closes, so that a broken wire starts nothing.
    Start,
    /// Output: active while the spindle turns.
    SpindleEnable,
    /// Output: active while it turns counterclockwise.
    SpindleDirection,
    /// Output: the spindle's speed as a pulse-width signal, channel 2 of TIM12.
    SpindleSpeed,
    /// Output: active switches the coolant on.
    Coolant,
    /// Output: active lights the status LED.
    StatusLed,
    /// USART1, to the host.
    SerialTx,
    /// USART1, from the host.
    SerialRx,
    /// Output that is never active: keeps other loads on the board off.
    Parked,
}

impl Role {
    /// A number for each role, for comparison in constants, where `==` is not available.
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
            Self::Probe => 21,
            Self::SpindleEnable => 22,
            Self::SpindleDirection => 23,
            Self::SpindleSpeed => 24,
            Self::Coolant => 25,
            Self::Door => 26,
            Self::AtSpeed => 27,
            Self::Start => 28,
        }
    }

    /// Whether the pin is read.
    #[must_use]
    pub const fn is_input(self) -> bool {
        matches!(
            self,
            Self::LimitMin(_)
                | Self::LimitMax(_)
                | Self::EmergencyStop
                | Self::DriveFault
                | Self::Probe
                | Self::Door
                | Self::AtSpeed
                | Self::Start
                | Self::SerialRx
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
            Self::Probe => f.write_str("probe"),
            Self::Door => f.write_str("safety door"),
            Self::AtSpeed => f.write_str("spindle at speed"),
            Self::Start => f.write_str("start button"),
            Self::SpindleEnable => f.write_str("spindle"),
            Self::SpindleDirection => f.write_str("spindle, counterclockwise"),
            Self::SpindleSpeed => f.write_str("spindle speed (PWM)"),
            Self::Coolant => f.write_str("coolant"),
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
    /// The function.
    pub role: Role,
    /// The pin.
    pub pin: Pin,
    /// The active level (see [`Role`]).
    pub active: Level,
    /// Its position on the board.
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
    /// The board's name as stored in a firmware image, padded with zeros.
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

    /// The line of this role. For use in constants, where a missing line is a compile error.
    ///
    /// # Panics
    /// The board has no such line.
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

    /// The lines of an axis. For use in constants, like [`Self::line`].
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
    /// The step pins are on several ports. For use in constants, like [`Self::line`].
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
