//! The last two sectors of the chip's flash, for settings (RM0090, 3.6).
//!
//! The chip has one bank: while a byte is written (16 us, 100 at most) or a sector erased (1 s, 2 s at most) the processor waits at its next fetch
//! from flash. So bytes are written at rest only, and sectors are erased before the first tick. `memory.x` leaves these sectors out of the image's region.

use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use stm32f4xx_hal::{
    flash::{Error, FlashExt as _, LockedFlash},
    pac,
};

/// Offset of the first of the two sectors in flash, and bytes of one. A chip of 1 MB has twelve sectors, the last seven of this size.
const OFFSET: u32 = 10 * SECTOR - FIRST_SECTORS;
const SECTOR: u32 = 128 * 1024;
/// The first five sectors have the size of one: 4 x 16 KB + 64 KB.
const FIRST_SECTORS: u32 = 4 * SECTOR;

/// The two sectors as a flash of their own.
pub(crate) struct SettingsFlash(LockedFlash);

impl SettingsFlash {
    /// The sectors, locked against writing except in [`NorFlash::write`] and [`NorFlash::erase`].
    pub(crate) fn new(flash: pac::FLASH) -> Self {
        Self(LockedFlash::new(flash))
    }
}

impl ErrorType for SettingsFlash {
    type Error = Error;
}

impl ReadNorFlash for SettingsFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        ReadNorFlash::read(&mut self.0, OFFSET + offset, bytes)
    }

    fn capacity(&self) -> usize {
        2 * SECTOR as usize
    }
}

impl NorFlash for SettingsFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        NorFlash::erase(&mut self.0.unlocked(), OFFSET + from, OFFSET + to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        NorFlash::write(&mut self.0.unlocked(), OFFSET + offset, bytes)
    }
}
