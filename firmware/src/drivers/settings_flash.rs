//! Sectors of the chip's flash that are not the program's (RM0090, 3.6): the last two for settings, the two before them for the journal.
//!
//! The chip has one bank: while a byte is written (16 us, 100 at most) or a sector erased (1 s, 2 s at most) the processor waits at its next fetch
//! from flash. So settings are written at rest only, a record of the journal in some 30 stalls of a byte each, and sectors are erased before the first tick. `memory.x` leaves these sectors out of the image's region.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use stm32f4xx_hal::{
    flash::{Error, FlashExt as _, LockedFlash},
    pac,
};

/// Offset of the first of the two sectors in flash, and bytes of one. A chip of 1 MB has twelve sectors, the last seven of this size.
const SETTINGS: u32 = 10 * SECTOR - FIRST_SECTORS;
const JOURNAL: u32 = 8 * SECTOR - FIRST_SECTORS;
const SECTOR: u32 = 128 * 1024;
/// The first five sectors have the size of one: 4 x 16 KB + 64 KB.
const FIRST_SECTORS: u32 = 4 * SECTOR;

/// Two sectors as a flash of their own.
pub(crate) struct Sectors<const OFFSET: u32>(LockedFlash);

/// Those of the settings.
pub(crate) type SettingsFlash = Sectors<SETTINGS>;
/// Those of the journal.
pub(crate) type JournalFlash = Sectors<JOURNAL>;

impl<const OFFSET: u32> Sectors<OFFSET> {
    fn new(flash: pac::FLASH) -> Self {
        Self(LockedFlash::new(flash))
    }
}

/// The sectors, locked against writing except in [`NorFlash::write`] and [`NorFlash::erase`].
#[allow(unsafe_code, reason = "one peripheral has both")]
pub(crate) fn sectors(flash: pac::FLASH) -> (SettingsFlash, JournalFlash) {
    // SAFETY: both are used by one context only, and each operation is complete, and the registers locked, before it returns.
    let again = unsafe { pac::FLASH::steal() };
    (Sectors::new(flash), Sectors::new(again))
}

impl<const OFFSET: u32> ErrorType for Sectors<OFFSET> {
    type Error = Error;
}

impl<const OFFSET: u32> ReadNorFlash for Sectors<OFFSET> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        ReadNorFlash::read(&mut self.0, OFFSET + offset, bytes)
    }

    fn capacity(&self) -> usize {
        2 * SECTOR as usize
    }
}

impl<const OFFSET: u32> NorFlash for Sectors<OFFSET> {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        NorFlash::erase(&mut self.0.unlocked(), OFFSET + from, OFFSET + to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        NorFlash::write(&mut self.0.unlocked(), OFFSET + offset, bytes)
    }
}
