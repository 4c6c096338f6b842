//! A falling supply: first the drives lose their power, then the voltage detector (PVD; RM0090, 5.2.2) interrupts by line 16 of EXTI (12.2.6), at last the chip has no supply.

use crate::world::{NEVER, World};

/// `PWR_CR`: the voltage detector is on.
const PVDE: u32 = 1 << 4;
/// `PWR_CR`: level of the detector.
const PLS: u32 = 0b111 << 5;
/// `PWR_CSR`: the supply is below the detector's level.
const PVDO: u32 = 1 << 2;
/// `PWR_CSR`: the regulator is ready.
const VOS_READY: u32 = 1 << 14;
/// Line of the detector in EXTI.
const LINE: u32 = 1 << 16;

/// Registers of EXTI, by offset.
const IMR: u32 = 0x00;
const RTSR: u32 = 0x08;
const FTSR: u32 = 0x0c;
const PR: u32 = 0x14;

/// The supply, and the part of the interrupt controller that the detector is on.
#[derive(Debug)]
pub(crate) struct Supply {
    /// The drives have no power.
    pub(crate) drives_off: bool,
    /// Time at which the supply reaches the detector's level, cycles.
    pub(crate) low_at: u64,
    /// Time at which the chip loses its supply, cycles.
    pub(crate) fails_at: u64,
    is_low: bool,
    imr: u32,
    rtsr: u32,
    ftsr: u32,
    pr: u32,
}

impl Supply {
    pub(crate) const GOOD: Self = Self {
        drives_off: false,
        low_at: NEVER,
        fails_at: NEVER,
        is_low: false,
        imr: 0,
        rtsr: 0,
        ftsr: 0,
        pr: 0,
    };

    /// The supply begins to fall.
    pub(crate) const fn fall(&mut self, low_at: u64, fails_at: u64) {
        (self.drives_off, self.low_at, self.fails_at) = (true, low_at, fails_at);
    }

    /// The supply reaches the detector's level. Returns whether that raises the interrupt.
    pub(crate) fn becomes_low(&mut self, pwr_cr: u32, world: &mut World) -> bool {
        (self.low_at, self.is_low) = (NEVER, true);
        world.event(world.now, "supply low");
        let detects = pwr_cr & PVDE != 0 && pwr_cr & PLS == PLS;
        let raises = detects && self.rtsr & self.imr & LINE != 0;
        self.pr |= if raises { LINE } else { 0 };
        raises
    }

    /// `PWR_CSR`.
    pub(crate) const fn status(&self) -> u32 {
        VOS_READY | if self.is_low { PVDO } else { 0 }
    }

    pub(crate) fn read(&self, offset: u32, world: &mut World) -> u32 {
        match offset {
            IMR => self.imr,
            RTSR => self.rtsr,
            FTSR => self.ftsr,
            PR => self.pr,
            _ => {
                world.wrong_once(format!("read of EXTI at {offset:#x}: not modelled"));
                0
            }
        }
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32, world: &mut World) {
        match offset {
            IMR => self.imr = value,
            RTSR => self.rtsr = value,
            FTSR => self.ftsr = value,
            PR => self.pr &= !value,
            _ => world.wrong_once(format!("write of EXTI at {offset:#x}: not modelled")),
        }
    }

    /// Whether the detector's interrupt is still due.
    pub(crate) const fn interrupts(&self) -> bool {
        self.pr & self.imr & LINE != 0
    }
}
