//! Sectors of the chip's flash that are not the program's (RM0090, 3.6): the last two for settings and the journal, the two before them for jobs.
//!
//! The chip has one bank: while a word is written (16 us, 100 at most) or a sector erased (1 s, 2 s at most) the processor waits at its next fetch from flash. So
//! records are written word by word, with one stall per word, and sectors are erased before the first tick. Interrupts are off while a word is written, from the unlocking of the
//! registers to their locking, because the supply's interrupt may write another word at any time. That delays no interrupt: none could be fetched meanwhile. Except in that
//! interrupt, a word is begun only if the longest write ends before the next tick is due: a late tick would set its direction pins too late. Writing needs 2.7 V.
//! `memory.x` leaves these sectors out of the image's region.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use stm32f4xx_hal::pac;

use crate::board::TIMER_HZ;

/// Number of the first of the two sectors for settings and journal.
const SETTINGS: u8 = 10;
/// Number of the first of the two sectors for jobs.
const JOBS: u8 = 8;
/// Bytes of a large sector; of the twelve sectors of a chip of 1 MB the last seven are large.
const SECTOR: u32 = 128 * 1024;
/// Number of the first large sector.
const FIRST_LARGE: u32 = 5;
/// Address of the first large sector: the five before it have its size together, 4 x 16 KB + 64 KB.
const LARGE_BEGIN: u32 = 0x0802_0000;

/// Words that unlock `FLASH_CR`, in this order (RM0090, 3.9.2).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// Bits of `FLASH_CR`: write, erase a sector, by words, start, locked.
const PG: u32 = 1 << 0;
const SER: u32 = 1 << 1;
const WORDS: u32 = 0b10 << 8;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// Error flags of `FLASH_SR`; writing 1 clears a flag.
const ERRORS: u32 = 0xf2;
/// `FLASH_SR`: an operation is under way.
const BUSY: u32 = 1 << 16;
/// Longest write of a word, 100 us, with the code around it, 10 us; counts of the sample timer.
const WORD_COUNTS: u32 = TIMER_HZ / 1_000_000 * 110;

/// Bytes of a word.
const WORD: usize = 4;

/// The flash refused an operation, or it was none of whole words within the sectors.
#[derive(Clone, Copy, Debug)]
pub struct FlashError;

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Counts of the sample timer, TIM2, until the next tick is due; 0 while one is.
#[allow(unsafe_code, reason = "registers of a timer that the sample task owns")]
fn counts_left() -> u32 {
    // SAFETY: reading them changes nothing.
    let timer = unsafe { pac::TIM2::steal() };
    let left = timer
        .arr()
        .read()
        .arr()
        .bits()
        .saturating_sub(timer.cnt().read().cnt().bits());
    // Read after the count: a tick that has become due since then was near.
    if timer.sr().read().uif().bit_is_set() {
        0
    } else {
        left
    }
}

/// One operation, from the unlocking to the locking of the registers.
#[allow(unsafe_code, reason = "whole registers are written")]
fn operate(flash: &pac::FLASH, control: u32, start: impl FnOnce()) -> Result<(), FlashError> {
    // SAFETY: values of the reference manual; nothing else writes these registers meanwhile, because interrupts are off.
    cortex_m::interrupt::free(|_| unsafe {
        for key in KEYS {
            flash.keyr().write(|w| w.bits(key));
        }
        flash.sr().write(|w| w.bits(ERRORS));
        flash.cr().write(|w| w.bits(control));
        start();
        while flash.sr().read().bits() & BUSY != 0 {}
        let is_done = flash.sr().read().bits() & ERRORS == 0;
        flash.cr().write(|w| w.bits(LOCK));
        if is_done { Ok(()) } else { Err(FlashError) }
    })
}

/// Two sectors as a flash of their own, from this one on. Urgent: words are not held back before a tick.
pub struct Sectors<const FIRST: u8, const URGENT: bool>(pac::FLASH);

/// The sectors of settings and journal.
pub(crate) type SettingsFlash = Sectors<SETTINGS, false>;
/// The sectors of settings and journal for the record of a failing supply, whose words are written at once.
pub(crate) type FallingFlash = Sectors<SETTINGS, true>;
/// The sectors of jobs.
pub(crate) type JobFlash = Sectors<JOBS, false>;

/// The sectors of settings and of jobs, and those of the settings once more, for the record of a failing supply.
#[allow(unsafe_code, reason = "one peripheral has all of them")]
pub(crate) fn sectors(flash: pac::FLASH) -> (SettingsFlash, JobFlash, FallingFlash) {
    // SAFETY: each operation is complete, and the registers locked, before interrupts are on again.
    let again = || unsafe { pac::FLASH::steal() };
    (Sectors(flash), Sectors(again()), Sectors(again()))
}

impl<const FIRST: u8, const URGENT: bool> Sectors<FIRST, URGENT> {
    const BEGIN: u32 = LARGE_BEGIN + (FIRST as u32 - FIRST_LARGE) * SECTOR;
    const BYTES: u32 = 2 * SECTOR;

    /// The address of these bytes.
    fn address(offset: u32, bytes: usize) -> Result<u32, FlashError> {
        let bytes = u32::try_from(bytes).map_err(|_| FlashError)?;
        let end = offset.checked_add(bytes).ok_or(FlashError)?;
        if end <= Self::BYTES {
            Ok(Self::BEGIN + offset)
        } else {
            Err(FlashError)
        }
    }
}

impl<const FIRST: u8, const URGENT: bool> ErrorType for Sectors<FIRST, URGENT> {
    type Error = FlashError;
}

impl<const FIRST: u8, const URGENT: bool> ReadNorFlash for Sectors<FIRST, URGENT> {
    const READ_SIZE: usize = 1;

    #[allow(unsafe_code, reason = "memory that changes by itself")]
    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let begin = Self::address(offset, bytes.len())?;
        let from = core::ptr::with_exposed_provenance::<u8>(begin as usize);
        let (words, rest) = match begin.is_multiple_of(WORD as u32) {
            true => bytes.as_chunks_mut::<WORD>(),
            false => (&mut [][..], bytes),
        };
        let read = words.len() * WORD;
        for (number, word) in words.iter_mut().enumerate() {
            // SAFETY: within the sectors, and aligned.
            *word = unsafe { from.cast::<u32>().add(number).read_volatile() }.to_le_bytes();
        }
        for (number, byte) in rest.iter_mut().enumerate() {
            // SAFETY: within the sectors.
            *byte = unsafe { from.add(read + number).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::BYTES as usize
    }
}

impl<const FIRST: u8, const URGENT: bool> NorFlash for Sectors<FIRST, URGENT> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let is_whole = from.is_multiple_of(SECTOR) && to.is_multiple_of(SECTOR) && to <= Self::BYTES;
        if !is_whole {
            return Err(FlashError);
        }
        for sector in from / SECTOR..to / SECTOR {
            let control = SER | WORDS | (u32::from(FIRST) + sector) << 3;
            // SAFETY: starts the erase of a sector that is not the program's.
            #[allow(unsafe_code, reason = "a whole register is written")]
            operate(&self.0, control, || unsafe {
                self.0.cr().write(|w| w.bits(control | STRT));
            })?;
        }
        // A write reaches the data cache, an erase does not (3.6.4).
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let begin = Self::address(offset, bytes.len())?;
        let (words, rest) = bytes.as_chunks::<WORD>();
        if !rest.is_empty() || !begin.is_multiple_of(WORD as u32) {
            return Err(FlashError);
        }
        for (address, word) in (begin..).step_by(WORD).zip(words) {
            let word = u32::from_le_bytes(*word);
            let write = || {
                // SAFETY: within the sectors; the registers are set to write words.
                #[allow(unsafe_code, reason = "a write to flash")]
                operate(&self.0, PG | WORDS, || unsafe {
                    core::ptr::with_exposed_provenance_mut::<u32>(address as usize).write_volatile(word);
                })
            };
            // Held back until the slowest write ends before the next tick; the tick comes between two looks.
            while !cortex_m::interrupt::free(|_| {
                let may_write = URGENT || counts_left() >= WORD_COUNTS;
                if may_write {
                    write().map(|()| true)
                } else {
                    Ok(false)
                }
            })? {}
        }
        Ok(())
    }
}
