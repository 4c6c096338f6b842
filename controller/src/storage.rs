//! Records in flash that survive a power cut at any instant.
//!
//! Two sectors, each divided into slots, of [`SLOT`] bytes for settings and [`JOURNAL_SLOT`] for a journal. A record is appended to the active sector: sequence number, kind, payload, then a CRC-32;
//! one that was not written to its end does not count. The active sector is that of the newest record. When it is full the other one goes on, with a
//! copy of what is in force. **An erase stops the processor for seconds**, so it happens at power-up only ([`Storage::open`]): then the spare sector is erased,
//! and a record in the active one says so. Without that record it is erased again, because an erase that was cut short may leave bits that read differently
//! every time.
//!
//! | slot byte | |
//! |---|---|
//! | 0 to 3 | sequence number, low byte first |
//! | 4, 5 | kind, length of the payload |
//! | 6, 7 | 0xff |
//! | 8 .. | payload |
//! | last four | CRC-32 of the bytes before, low byte first |

use embedded_storage::nor_flash::NorFlash;
use protocol::frame::crc32;

/// Bytes of a slot of settings.
pub const SLOT: usize = 256;
/// Bytes of a slot of a journal: 4096 in a sector of 128 KB.
pub const JOURNAL_SLOT: usize = 32;

/// Bytes before the payload, and longest payload.
const HEAD: usize = 8;
const CRC: usize = 4;
/// Longest payload of a record of settings, bytes.
pub const PAYLOAD_MAX: usize = SLOT - HEAD - CRC;

/// The value of erased flash.
const BLANK: u8 = 0xff;

/// Kind of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The other sector is erased.
    SpareErased = 0,
    /// The machine's profile; an empty payload: none.
    Profile = 1,
    /// Work offsets and tool length.
    Offsets = 2,
    /// How far a run came.
    Journal = 3,
}

impl Kind {
    /// The kinds whose newest record is in force.
    const KEPT: [Self; 3] = [Self::Profile, Self::Offsets, Self::Journal];
}

/// Flash could not be written: what was kept before is still kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StorageError;

/// The payload of the newest record of a kind.
#[derive(Clone, Copy, Debug)]
pub struct Payload<const SLOT: usize = 256> {
    bytes: [u8; SLOT],
    length: usize,
}

impl<const SLOT: usize> Payload<SLOT> {
    /// Its bytes.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(HEAD..HEAD + self.length).unwrap_or(&[])
    }
}

/// A slot's content.
#[allow(clippy::large_enum_variant, reason = "there is no allocator to box with")]
enum Content<const SLOT: usize> {
    Blank,
    /// Neither blank nor a record: its writing was cut short.
    Broken,
    Record {
        sequence: u32,
        kind: u8,
        payload: Payload<SLOT>,
    },
}

/// The active sector.
#[derive(Clone, Copy, Debug)]
struct Active {
    /// 0 or 1.
    sector: u32,
    /// The first slot behind its last record, and behind whatever else is not blank.
    next: u32,
    /// Sequence number of the newest record; 0 where there is none.
    sequence: u32,
    /// The other sector is erased.
    has_spare: bool,
}

/// Records in two sectors of a flash of `2 * F::ERASE_SIZE` bytes, in which single bytes can be written.
#[derive(Debug)]
pub struct Storage<F, const SLOT: usize = 256> {
    flash: F,
    active: Active,
}

impl<F: NorFlash, const SLOT: usize> Storage<F, SLOT> {
    const SLOTS: u32 = (F::ERASE_SIZE / SLOT) as u32;
    /// Longest payload, bytes.
    const PAYLOAD_MAX: usize = SLOT - HEAD - CRC;

    /// Finds the records; erases the spare sector if it is not known to be erased, which takes up to some seconds.
    pub fn open(flash: F) -> Self {
        let mut storage = Self {
            flash,
            active: Active {
                sector: 0,
                next: 0,
                sequence: 0,
                has_spare: false,
            },
        };
        let [first, second] = [storage.look(0), storage.look(1)];
        let (active, other) = if second.sequence > first.sequence {
            (second, first)
        } else {
            (first, second)
        };
        storage.active = active;
        if active.sequence == 0 {
            // A new chip, or one with something else in these sectors.
            let are_blank = active.next == 0 && other.next == 0;
            if are_blank {
                storage.active.has_spare = true;
            } else if storage.erase(0).is_ok() && storage.erase(1).is_ok() {
                storage.active.next = 0;
                storage.active.has_spare = true;
            }
        } else if active.has_spare && other.next == 0 {
            // It is erased, and nothing was begun in it.
        } else if storage.carry_over().is_ok() && storage.erase(1 - active.sector).is_ok() {
            storage.active.has_spare = true;
            // Without the record it is erased again at the next power-up.
            let _ = storage.append(Kind::SpareErased, &[]);
        }
        storage
    }

    /// The flash.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// Copies what is in force only in the other sector.
    fn carry_over(&mut self) -> Result<(), StorageError> {
        for kind in Kind::KEPT {
            let newest = |storage: &mut Self, sector| storage.newest_in(sector, kind);
            let there = newest(self, 1 - self.active.sector);
            if let (None, Some((_, payload))) = (newest(self, self.active.sector), there) {
                self.append(kind, payload.bytes())?;
            }
        }
        Ok(())
    }

    /// The payload of the newest record of a kind, if there is one.
    pub fn newest(&mut self, kind: Kind) -> Option<Payload<SLOT>> {
        let active = self.active.sector;
        let found = self
            .newest_in(active, kind)
            .or_else(|| self.newest_in(1 - active, kind));
        found.map(|(_, payload)| payload)
    }

    /// The newest record of a kind in a sector, with its sequence number.
    fn newest_in(&mut self, sector: u32, kind: Kind) -> Option<(u32, Payload<SLOT>)> {
        let mut newest: Option<(u32, Payload<SLOT>)> = None;
        for slot in 0..Self::SLOTS {
            if let Content::Record {
                sequence,
                kind: found,
                payload,
            } = self.slot(sector, slot)
                && found == kind as u8
                && newest.as_ref().is_none_or(|(before, _)| sequence > *before)
            {
                newest = Some((sequence, payload));
            }
        }
        newest
    }

    /// Keeps a record of a kind in place of the one before.
    ///
    /// # Errors
    /// The payload is longer than a slot has room for, the flash fails, or it is full until the next power-up.
    pub fn keep(&mut self, kind: Kind, payload: &[u8]) -> Result<(), StorageError> {
        if self.active.next >= Self::SLOTS {
            self.swap()?;
        }
        self.append(kind, payload)
    }

    /// Goes on in the other sector. The full one stays until the next power-up, when what is in force there is copied, and it is erased.
    fn swap(&mut self) -> Result<(), StorageError> {
        if !self.active.has_spare {
            return Err(StorageError);
        }
        self.active = Active {
            sector: 1 - self.active.sector,
            next: 0,
            has_spare: false,
            ..self.active
        };
        Ok(())
    }

    /// Writes a record into the next slot, and reads it back.
    fn append(&mut self, kind: Kind, payload: &[u8]) -> Result<(), StorageError> {
        if self.active.next >= Self::SLOTS {
            return Err(StorageError);
        }
        let sequence = self.active.sequence.checked_add(1).ok_or(StorageError)?;
        let mut bytes = [BLANK; SLOT];
        let length = u8::try_from(payload.len()).map_err(|_| StorageError)?;
        let (data, crc) = bytes.split_at_mut(SLOT - CRC);
        let (head, place) = data.split_at_mut(HEAD);
        let place = place.get_mut(..payload.len()).ok_or(StorageError)?;
        place.copy_from_slice(payload);
        for (to, from) in head
            .iter_mut()
            .zip(sequence.to_le_bytes().into_iter().chain([kind as u8, length]))
        {
            *to = from;
        }
        crc.copy_from_slice(&crc32(data).to_le_bytes());
        let offset = self.offset(self.active.sector, self.active.next);
        // Whatever happens, the slot is not blank any more.
        self.active.next += 1;
        let (data, crc) = bytes.split_at(SLOT - CRC);
        let written = data.get(..HEAD + payload.len()).unwrap_or(data);
        self.flash.write(offset, written).map_err(|_| StorageError)?;
        let last = offset + (SLOT - CRC) as u32;
        self.flash.write(last, crc).map_err(|_| StorageError)?;
        let mut again = [0; SLOT];
        self.flash.read(offset, &mut again).map_err(|_| StorageError)?;
        if again != bytes {
            return Err(StorageError);
        }
        self.active.sequence = sequence;
        Ok(())
    }

    fn erase(&mut self, sector: u32) -> Result<(), StorageError> {
        let (from, to) = (self.offset(sector, 0), self.offset(sector, Self::SLOTS));
        self.flash.erase(from, to).map_err(|_| StorageError)
    }

    fn offset(&self, sector: u32, slot: u32) -> u32 {
        (sector * Self::SLOTS + slot) * SLOT as u32
    }

    fn slot(&mut self, sector: u32, slot: u32) -> Content<SLOT> {
        // Most slots are blank: a look at their head is enough, because it is written first.
        let mut head = [0; HEAD];
        let mut bytes = [0; SLOT];
        let offset = self.offset(sector, slot);
        if self.flash.read(offset, &mut head).is_err() {
            return Content::Broken;
        }
        if head == [BLANK; HEAD] {
            return Content::Blank;
        }
        if self.flash.read(offset, &mut bytes).is_err() {
            return Content::Broken;
        }
        let (data, crc) = bytes.split_at(SLOT - CRC);
        let [a, b, c, d, kind, length, ..] = *data else {
            return Content::Broken;
        };
        if crc32(data).to_le_bytes() != *crc || usize::from(length) > Self::PAYLOAD_MAX {
            return Content::Broken;
        }
        Content::Record {
            sequence: u32::from_le_bytes([a, b, c, d]),
            kind,
            payload: Payload {
                bytes,
                length: length.into(),
            },
        }
    }

    /// A sector's newest record and next slot, as if it were the active one.
    fn look(&mut self, sector: u32) -> Active {
        let mut active = Active {
            sector,
            next: 0,
            sequence: 0,
            has_spare: false,
        };
        for slot in 0..Self::SLOTS {
            match self.slot(sector, slot) {
                Content::Blank => {}
                Content::Broken => active.next = slot + 1,
                Content::Record { sequence, kind, .. } => {
                    active.next = slot + 1;
                    active.sequence = active.sequence.max(sequence);
                    active.has_spare |= kind == Kind::SpareErased as u8;
                }
            }
        }
        active
    }
}

#[cfg(test)]
mod tests;
