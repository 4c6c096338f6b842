//! A port (RM0090, 8.4): levels that the program drives, levels from outside.

use crate::world::World;

/// A change of a port's outputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Change {
    /// Time, cycles.
    pub(crate) at: u64,
    /// The port, 0 for A.
    pub(crate) port: u8,
    /// Whether by DMA.
    pub(crate) by_dma: bool,
    /// `ODR` afterwards.
    pub(crate) levels: u16,
    /// Pins that are outputs.
    pub(crate) outputs: u16,
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Port {
    index: u8,
    moder: u32,
    otyper: u32,
    ospeedr: u32,
    pupdr: u32,
    pub(crate) odr: u32,
    afr: [u32; 2],
    /// Externally driven pins, and their levels.
    pub(crate) driven: u32,
    pub(crate) outside: u32,
}

impl Port {
    /// After a reset (8.4.1 to 8.4.4); external levels are unchanged.
    pub(crate) const fn new(index: u8, driven: u32, outside: u32) -> Self {
        let (moder, ospeedr, pupdr) = match index {
            0 => (0xa800_0000, 0x0c00_0000, 0x6400_0000),
            1 => (0x0000_0280, 0x0000_00c0, 0x0000_0100),
            _ => (0, 0, 0),
        };
        Self {
            index,
            moder,
            otyper: 0,
            ospeedr,
            pupdr,
            odr: 0,
            afr: [0; 2],
            driven,
            outside,
        }
    }

    /// Pins that are outputs, a bit each.
    fn outputs(&self) -> u16 {
        (0..16)
            .filter(|pin| self.moder >> (2 * pin) & 0b11 == 0b01)
            .fold(0, |bits, pin| bits | 1 << pin)
    }

    fn input(&self) -> u32 {
        let level = |pin: u32| {
            let bit = 1 << pin;
            match self.moder >> (2 * pin) & 0b11 {
                0b01 => self.odr & bit != 0,
                // Analogue: reads 0 (8.3.12).
                0b11 => false,
                _ if self.driven & bit != 0 => self.outside & bit != 0,
                _ => self.pupdr >> (2 * pin) & 0b11 == 0b01,
            }
        };
        (0..16)
            .filter(|pin| level(*pin))
            .fold(0, |bits, pin| bits | 1 << pin)
    }

    /// The change, for the record.
    pub(crate) fn change(&self, at: u64, by_dma: bool) -> Change {
        Change {
            at,
            port: self.index,
            by_dma,
            levels: self.odr as u16,
            outputs: self.outputs(),
        }
    }

    /// A write of `BSRR`; set has priority over reset. Returns whether a level changed.
    pub(crate) fn set_reset(&mut self, value: u32) -> bool {
        let old = self.odr;
        self.odr = old & !(value >> 16) | value & 0xffff;
        self.odr != old
    }

    /// Whether this write of `BSRR` would change no level.
    pub(crate) const fn is_at(&self, value: u32) -> bool {
        (self.odr & !(value >> 16) | value & 0xffff) == self.odr
    }

    pub(crate) fn read(&self, offset: u32, world: &mut World) -> u32 {
        match offset {
            0x00 => self.moder,
            0x04 => self.otyper,
            0x08 => self.ospeedr,
            0x0c => self.pupdr,
            0x10 => self.input(),
            0x14 => self.odr,
            0x18 => 0,
            0x20 => self.afr[0],
            0x24 => self.afr[1],
            _ => {
                world.wrong_once(format!(
                    "read of GPIO{} + {offset:#x}: not modelled",
                    self.letter()
                ));
                0
            }
        }
    }

    /// Whether an output changed.
    pub(crate) fn write(&mut self, offset: u32, value: u32, world: &mut World) -> bool {
        match offset {
            0x00 => {
                let before = self.outputs();
                self.moder = value;
                return before != self.outputs();
            }
            0x04 => self.otyper = value,
            0x08 => self.ospeedr = value,
            0x0c => self.pupdr = value,
            0x14 => {
                let old = std::mem::replace(&mut self.odr, value & 0xffff);
                return old != self.odr;
            }
            0x18 => return self.set_reset(value),
            0x20 => self.afr[0] = value,
            0x24 => self.afr[1] = value,
            _ => world.wrong_once(format!(
                "write of GPIO{} + {offset:#x}: not modelled",
                self.letter()
            )),
        }
        false
    }

    fn letter(&self) -> char {
        char::from(b'A' + self.index)
    }

    pub(crate) fn snapshot(&self) -> Vec<(String, u32)> {
        let named = [
            ("MODER", self.moder),
            ("OTYPER", self.otyper),
            ("OSPEEDR", self.ospeedr),
            ("PUPDR", self.pupdr),
            ("ODR", self.odr),
            ("AFRL", self.afr[0]),
            ("AFRH", self.afr[1]),
        ];
        named
            .map(|(name, value)| (format!("GPIO{} {name}", self.letter()), value))
            .into()
    }
}
