//! The flash interface (RM0090, 3) and the four sectors that keep journal and settings. The sectors of the program cannot be written here.
//!
//! The processor waits while a byte is written or a sector erased, because it fetches from the same bank. The supply may fail in any of these operations.

use crate::world::{NEVER, World};

/// First address of the sectors that keep jobs, settings and the journal.
pub(crate) const SETTINGS: u32 = 0x0808_0000;
/// Bytes of these sectors together.
pub(crate) const SETTINGS_BYTES: u32 = SECTORS * SECTOR;
/// Bytes of one of these sectors.
const SECTOR: u32 = 128 * 1024;
/// Number of the first of these sectors in the chip's flash.
const FIRST: u32 = 8;
/// Number of these sectors.
const SECTORS: u32 = 4;

/// Words that unlock `CR`, in this order (RM0090, 3.9.2).
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];

/// Registers, by offset.
const KEYR: u32 = 0x04;
const SR: u32 = 0x0c;
const CR: u32 = 0x10;

/// Bits of `CR`.
const PG: u32 = 1 << 0;
const SER: u32 = 1 << 1;
const MER: u32 = 1 << 2;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;

/// Time to write a byte or a word, s (DS8626, table 40).
const WRITE_S: f64 = 16e-6;
/// Time to erase a sector of 128 KB with a parallelism of 8, 16 and 32 bits, s (DS8626, table 40).
const ERASE_S: [f64; 3] = [2.0, 1.3, 1.0];

pub(crate) struct Flash {
    sectors: Vec<u8>,
    cr: u32,
    keys: usize,
    /// A wrong key locks `CR` until the next reset.
    shut: bool,
    /// The supply fails in every operation, and in every erase, of which the number is a multiple of these.
    cut_every: [Option<u64>; 2],
    /// Time at which the supply fails, cycles.
    pub(crate) fails_at: u64,
    /// Bytes or words written, and sectors erased; the sectors alone, begun and erased.
    pub(crate) operations: u64,
    erases: u64,
    pub(crate) erased: u64,
    /// The supply has failed: nothing is written any more.
    pub(crate) is_cut: bool,
}

impl Flash {
    /// Erased.
    pub(crate) fn new(cut_every: [Option<u64>; 2]) -> Self {
        Self {
            sectors: vec![0xff; SETTINGS_BYTES as usize],
            cr: LOCK,
            keys: 0,
            shut: false,
            cut_every,
            fails_at: NEVER,
            operations: 0,
            erases: 0,
            erased: 0,
            is_cut: false,
        }
    }

    /// The state after a reset; the contents of the sectors stay.
    pub(crate) fn restart(&mut self) {
        (self.cr, self.keys, self.shut, self.is_cut) = (LOCK, 0, false, false);
    }

    /// Reads a register.
    pub(crate) fn read(&self, offset: u32, world: &mut World) -> u32 {
        match offset {
            // Nothing is under way when the processor goes on, and nothing has failed.
            SR => 0,
            CR => self.cr,
            _ => {
                world.wrong_once(format!("read of FLASH at {offset:#x}: not modelled"));
                0
            }
        }
    }

    /// Writes a register.
    pub(crate) fn write(&mut self, offset: u32, value: u32, world: &mut World) {
        match offset {
            KEYR => {
                let wanted = KEYS.get(self.keys).copied();
                if self.shut || wanted != Some(value) {
                    self.shut = true;
                    world.wrong("a wrong key of FLASH");
                } else {
                    self.keys += 1;
                    if self.keys == KEYS.len() {
                        (self.cr, self.keys) = (self.cr & !LOCK, 0);
                    }
                }
            }
            SR => {}
            CR if self.cr & LOCK != 0 => {
                // Locking it again is no mistake.
                if value & LOCK == 0 {
                    world.wrong("a write of FLASH_CR while it is locked");
                }
            }
            CR => {
                self.cr = value & !STRT;
                if value & STRT != 0 {
                    self.erase(world);
                }
            }
            _ => world.wrong_once(format!("write of FLASH at {offset:#x}: not modelled")),
        }
    }

    /// Counts an operation of this duration; false where the supply fails in it. `erases`: the number of erases, in one.
    fn holds(&mut self, lasts: u64, erases: Option<u64>, world: &mut World) -> bool {
        self.operations += 1;
        let counts = [Some(self.operations), erases];
        let mut due = self.cut_every.into_iter().zip(counts);
        if world.now + lasts > self.fails_at {
            self.is_cut = true;
        } else if due.any(|due| matches!(due, (Some(every), Some(count)) if count.is_multiple_of(every))) {
            world.event(world.now, "power cut");
            self.is_cut = true;
        }
        !self.is_cut
    }

    fn erase(&mut self, world: &mut World) {
        let sector = self.cr >> 3 & 0x1f;
        if self.cr & SER == 0
            || self.cr & (PG | MER) != 0
            || !(FIRST..FIRST + SECTORS).contains(&sector)
            || self.is_cut
        {
            if !self.is_cut {
                world.wrong(format!(
                    "an erase of sector {sector} with FLASH_CR = {:#x}",
                    self.cr
                ));
            }
            return;
        }
        let from = ((sector - FIRST) * SECTOR) as usize;
        let lasts = world.lasting(ERASE_S[(self.cr as usize >> 8 & 3).min(2)]);
        self.erases += 1;
        let whole = self.holds(lasts, Some(self.erases), world);
        // An erase that is cut short has reached a part of the sector, of another size each time, from one of its ends.
        let part = (SECTOR >> (self.erases % 10).max(1)) as usize;
        let part = match (whole, self.erases.is_multiple_of(2)) {
            (true, _) => 0..SECTOR as usize,
            (false, true) => 0..part,
            (false, false) => part..SECTOR as usize,
        };
        self.sectors[from + part.start..from + part.end].fill(0xff);
        self.erased += u64::from(whole);
        world.flash_works(if whole { lasts } else { lasts / 3 });
    }

    /// The word at an address within the sectors.
    pub(crate) fn word(&self, address: u32) -> u32 {
        let at = (address - SETTINGS) as usize & !3;
        u32::from_le_bytes([0, 1, 2, 3].map(|byte| self.sectors[at + byte]))
    }

    /// Programs a byte or a word, as `PSIZE` says: bits are only cleared.
    pub(crate) fn program(&mut self, address: u32, bytes: u32, value: u32, world: &mut World) {
        if self.is_cut {
            return;
        }
        let wanted = 1 << (self.cr >> 8 & 3);
        if self.cr & LOCK != 0
            || self.cr & PG == 0
            || self.cr & SER != 0
            || bytes != wanted
            || !address.is_multiple_of(bytes)
        {
            world.wrong(format!(
                "{bytes} bytes are written to flash at {address:#x} with FLASH_CR = {:#x}",
                self.cr
            ));
            return;
        }
        let lasts = world.lasting(WRITE_S);
        let whole = self.holds(lasts, None, world);
        let from = (address - SETTINGS) as usize;
        for (byte, value) in self.sectors[from..from + bytes as usize]
            .iter_mut()
            .zip(value.to_le_bytes())
        {
            // What is cut short has some of its bits.
            *byte &= value | if whole { 0 } else { 0x5a };
        }
        world.flash_works(lasts);
    }
}
