//! Flash in RAM: for a board that has none, as in QEMU, and for tests. Its content ends with the power.

use core::convert::Infallible;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Two sectors of this number of bytes, erased at first.
#[derive(Clone, Debug, PartialEq)]
pub struct RamFlash<const SECTOR: usize> {
    sectors: [[u8; SECTOR]; 2],
}

/// A place outside of the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutOfBounds;

impl From<Infallible> for OutOfBounds {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

impl NorFlashError for OutOfBounds {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::OutOfBounds
    }
}

impl<const SECTOR: usize> RamFlash<SECTOR> {
    /// Erased flash.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sectors: [[0xff; SECTOR]; 2],
        }
    }

    /// The bytes of this range.
    fn range(&mut self, offset: u32, bytes: usize) -> Result<&mut [u8], OutOfBounds> {
        let from = offset as usize;
        let to = from.checked_add(bytes).ok_or(OutOfBounds)?;
        self.sectors
            .as_flattened_mut()
            .get_mut(from..to)
            .ok_or(OutOfBounds)
    }
}

impl<const SECTOR: usize> Default for RamFlash<SECTOR> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const SECTOR: usize> ErrorType for RamFlash<SECTOR> {
    type Error = OutOfBounds;
}

impl<const SECTOR: usize> ReadNorFlash for RamFlash<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        bytes.copy_from_slice(self.range(offset, bytes.len())?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR
    }
}

impl<const SECTOR: usize> NorFlash for RamFlash<SECTOR> {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        let bytes = to.checked_sub(from).ok_or(OutOfBounds)?;
        self.range(from, bytes as usize)?.fill(0xff);
        Ok(())
    }

    /// As in flash, bits are only cleared.
    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        for (at, byte) in self.range(offset, bytes.len())?.iter_mut().zip(bytes) {
            *at &= byte;
        }
        Ok(())
    }
}
