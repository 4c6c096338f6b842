//! Records in flash that survive a power cut at any instant.
//!
//! Two sectors, each divided into slots of [`SLOT`] bytes; a record takes as many slots as it needs. A record is appended to the active sector: sequence number, kind, payload,
//! then a CRC-32; one that was not written to its end does not count. The active sector is that of the newest record. When it is full, the other sector becomes active, and
//! begins with the next record and a copy of those in force, so that the full one can be erased whatever follows. Where there is no other, the last slot is left blank.
//! **An erase stops the processor for seconds**, so it happens at power-up only ([`Storage::open`]): then the spare sector is erased,
//! and a record in the active one says so. Without that record it is erased again, because an erase that was cut short may leave bits that read differently
//! every time.
//!
//! | byte | |
//! |---|---|
//! | 0 to 3 | sequence number, low byte first |
//! | 4, 5 | kind, length of the payload |
//! | 6, 7 | 0xff |
//! | 8 .. | payload |
//! | last four of the last slot | CRC-32 of the bytes before, low byte first |

use embedded_storage::nor_flash::NorFlash;
use protocol::frame::crc32;

/// Bytes of a slot: what a record of the journal takes, 3276 in a sector of 128 KB.
pub const SLOT: usize = 40;

/// Byte of the kind.
const KIND: usize = 4;
/// Byte of the payload's length.
const LENGTH: usize = 5;
/// Bytes before the payload.
const HEAD: usize = 8;
/// Bytes of the CRC.
const CRC: usize = 4;
/// Most slots of a record.
const SLOTS_MAX: usize = 6;
/// Bytes of the longest record.
const RECORD_MAX: usize = SLOTS_MAX * SLOT;
/// Longest payload of a record, bytes.
pub const PAYLOAD_MAX: usize = RECORD_MAX - HEAD - CRC;

/// Slots of a record with a payload of this length.
const fn slots_of(payload: usize) -> usize {
    (HEAD + payload + CRC).div_ceil(SLOT)
}

/// Slots left blank where there is no other sector: for a record that has to be written when the flash is full ([`Storage::keep_last`]).
const RESERVE: u32 = 1;

/// Blank slots after which there is no record: one is left blank by a record that was prepared.
const BLANK_SLOTS: u32 = 4;

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

/// A record of one slot that is not written yet, and where it will be.
#[derive(Clone, Copy, Debug)]
pub struct Prepared {
    /// Offset of its slot.
    pub offset: u32,
    /// All bytes of the slot.
    pub bytes: [u8; SLOT],
}

/// Where a record is.
#[derive(Clone, Copy)]
struct Place {
    /// Offset of its first slot.
    offset: u32,
    /// Length of its payload.
    length: u8,
}

/// A slot's content.
enum Content {
    Blank,
    /// Neither blank nor a record: its writing was cut short.
    Broken,
    Record {
        sequence: u32,
        kind: u8,
        length: u8,
    },
}

/// The active sector.
#[derive(Clone, Copy, Debug)]
struct Active {
    /// 0 or 1.
    sector: u32,
    /// The first slot after its last record and all others that are not blank.
    next: u32,
    /// Sequence number of the newest record; 0 where there is none.
    sequence: u32,
    /// The other sector is erased.
    has_spare: bool,
}

/// Records in two sectors of a flash of `2 * F::ERASE_SIZE` bytes, in which single bytes can be written.
#[derive(Debug)]
pub struct Storage<F> {
    flash: F,
    active: Active,
}

impl<F: NorFlash> Storage<F> {
    const SLOTS: u32 = (F::ERASE_SIZE / SLOT) as u32;
    /// Bytes of a sector.
    const SECTOR: u32 = F::ERASE_SIZE as u32;

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
        let [mut first, mut second] = [0, 1].map(|sector| storage.look(sector, BLANK_SLOTS));
        if first.sequence == 0 && second.sequence == 0 {
            // No record was found near the beginnings: search every slot.
            [first, second] = [0, 1].map(|sector| storage.look(sector, Self::SLOTS));
        }
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
            if let (None, Some(place)) = (newest(self, self.active.sector), there) {
                self.copy(place)?;
            }
        }
        Ok(())
    }

    /// Copies a record of the other sector into the next slots. A function of its own, so that no search has its buffer on the stack.
    #[inline(never)]
    fn copy(&mut self, place: Place) -> Result<(), StorageError> {
        let mut record = [BLANK; RECORD_MAX];
        let bytes = slots_of(place.length.into()) * SLOT;
        let record = record.get_mut(..bytes).ok_or(StorageError)?;
        self.flash.read(place.offset, record).map_err(|_| StorageError)?;
        self.write(record)
    }

    /// The payload of the newest record of a kind, read into `bytes`. None where there is no record, or it is longer than `bytes`.
    #[inline(never)]
    pub fn newest<'a>(&mut self, kind: Kind, bytes: &'a mut [u8]) -> Option<&'a [u8]> {
        let active = self.active.sector;
        let newest = self.newest_in(active, kind);
        let place = newest.or_else(|| self.newest_in(1 - active, kind))?;
        let payload = bytes.get_mut(..place.length.into())?;
        self.flash.read(place.offset + HEAD as u32, payload).ok()?;
        Some(payload)
    }

    /// The place of the newest record of a kind in a sector.
    #[inline(never)]
    fn newest_in(&mut self, sector: u32, kind: Kind) -> Option<Place> {
        let mut newest = None;
        let mut newest_sequence = 0;
        let (mut slot, mut blank) = (0, 0);
        while slot < Self::SLOTS && blank < BLANK_SLOTS {
            let content = self.slot(sector, slot);
            blank = content.blank_after(blank);
            if let Content::Record {
                sequence,
                kind: found,
                length,
            } = content
                && found == kind as u8
                && sequence > newest_sequence
            {
                let offset = Self::offset(sector, slot);
                (newest, newest_sequence) = (Some(Place { offset, length }), sequence);
            }
            slot += content.slots();
        }
        newest
    }

    /// Keeps a record of a kind in place of the one before.
    ///
    /// # Errors
    /// The payload is longer than [`PAYLOAD_MAX`], the flash fails, or it is full until the next power-up.
    pub fn keep(&mut self, kind: Kind, payload: &[u8]) -> Result<(), StorageError> {
        if payload.len() > PAYLOAD_MAX {
            return Err(StorageError);
        }
        let is_full = self.active.next + slots_of(payload.len()) as u32 > self.slots();
        if is_full {
            self.swap()?;
        }
        self.append(kind, payload)?;
        if is_full {
            // A prepared record has the slot after the first.
            self.active.next += 1;
            self.carry_over_now();
        }
        Ok(())
    }

    /// Keeps a record of one slot where [`Self::keep`] finds the flash full. Once until the next power-up.
    ///
    /// # Errors
    /// It is written already, or the flash fails.
    pub fn keep_last(&mut self, kind: Kind, payload: &[u8]) -> Result<(), StorageError> {
        self.append(kind, payload)
    }

    /// Slots of the active sector that records may take.
    const fn slots(&self) -> u32 {
        if self.active.has_spare {
            Self::SLOTS
        } else {
            Self::SLOTS - RESERVE
        }
    }

    /// After the other sector has become the active one: copies what is in force, so that there is room for it whatever follows. What cannot be copied now is copied at the
    /// next power-up.
    fn carry_over_now(&mut self) {
        let _ = self.carry_over();
    }

    /// Makes the other sector the active one. The full one stays until the next power-up, which erases it.
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

    /// A record for the slot after the next one, because a record may be half written in the next one when it is needed. It counts as soon as its bytes are written, until the next
    /// record.
    /// None where there is no room. After it was written, [`Self::look_again`] has to be called.
    pub fn prepare(&self, kind: Kind, payload: &[u8]) -> Option<Prepared> {
        let Active {
            sector,
            next,
            sequence,
            has_spare,
        } = self.active;
        let after = next + 1;
        let (sector, slot) = match after.checked_sub(self.slots()) {
            None => (sector, after),
            Some(beyond) if has_spare => (1 - sector, beyond),
            Some(_) => return None,
        };
        let mut bytes = [BLANK; SLOT];
        let record = lay_out(&mut bytes, kind, payload)?;
        seal(record, sequence.checked_add(2)?);
        Some(Prepared {
            offset: Self::offset(sector, slot),
            bytes,
        })
    }

    /// Finds the newest record again, after a prepared one was written.
    pub fn look_again(&mut self) {
        let [first, second] = [0, 1].map(|sector| self.look(sector, BLANK_SLOTS));
        let before = self.active;
        self.active = if second.sequence > first.sequence {
            second
        } else {
            first
        };
        // A new chip's spare has no record that says so.
        self.active.has_spare |= before.has_spare && before.sector == self.active.sector;
        if self.active.sector != before.sector {
            self.carry_over_now();
        }
    }

    /// Writes a record of a kind into the next slots.
    #[inline(never)]
    fn append(&mut self, kind: Kind, payload: &[u8]) -> Result<(), StorageError> {
        let mut bytes = [BLANK; RECORD_MAX];
        let record = lay_out(&mut bytes, kind, payload).ok_or(StorageError)?;
        self.write(record)
    }

    /// Writes a record into the next slots with the next sequence number, and reads it back.
    #[inline(never)]
    fn write(&mut self, record: &mut [u8]) -> Result<(), StorageError> {
        let sequence = self.active.sequence.checked_add(1).ok_or(StorageError)?;
        seal(record, sequence);
        let slots = (record.len() / SLOT) as u32;
        if self.active.next + slots > Self::SLOTS {
            return Err(StorageError);
        }
        let offset = Self::offset(self.active.sector, self.active.next);
        // Whatever happens, the slots are not blank any more.
        self.active.next += slots;
        let (data, crc) = record.split_last_chunk::<CRC>().ok_or(StorageError)?;
        // To whole words, which a driver may write as such. The words behind the payload stay blank.
        let length = data.get(LENGTH).copied().map_or(0, usize::from);
        let written = data.get(..(HEAD + length).next_multiple_of(CRC)).unwrap_or(data);
        self.flash.write(offset, written).map_err(|_| StorageError)?;
        let last = offset + data.len() as u32;
        self.flash.write(last, crc).map_err(|_| StorageError)?;
        for (at, slot) in (offset..).step_by(SLOT).zip(record.chunks_exact(SLOT)) {
            let mut again = [0; SLOT];
            self.flash.read(at, &mut again).map_err(|_| StorageError)?;
            if again != *slot {
                return Err(StorageError);
            }
        }
        self.active.sequence = sequence;
        Ok(())
    }

    fn erase(&mut self, sector: u32) -> Result<(), StorageError> {
        let (from, to) = (sector * Self::SECTOR, (sector + 1) * Self::SECTOR);
        self.flash.erase(from, to).map_err(|_| StorageError)
    }

    const fn offset(sector: u32, slot: u32) -> u32 {
        sector * Self::SECTOR + slot * SLOT as u32
    }

    /// The content of a slot, and of those after it that belong to it.
    fn slot(&mut self, sector: u32, slot: u32) -> Content {
        // Most slots are blank: a look at their head is enough, because it is written first.
        let mut head = [0; HEAD];
        let offset = Self::offset(sector, slot);
        if self.flash.read(offset, &mut head).is_err() {
            return Content::Broken;
        }
        if head == [BLANK; HEAD] {
            return Content::Blank;
        }
        self.record(slot, offset, head)
    }

    /// The content of a slot that begins with this head.
    #[inline(never)]
    fn record(&mut self, slot: u32, offset: u32, head: [u8; HEAD]) -> Content {
        let mut bytes = [BLANK; RECORD_MAX];
        let [a, b, c, d, kind, length, ..] = head;
        let slots = slots_of(length.into());
        if slots > SLOTS_MAX || slot + slots as u32 > Self::SLOTS {
            return Content::Broken;
        }
        let Some(whole) = bytes.get_mut(..slots * SLOT) else {
            return Content::Broken;
        };
        if self.flash.read(offset, whole).is_err() {
            return Content::Broken;
        }
        let (data, crc) = whole.split_at(whole.len() - CRC);
        if crc32(data).to_le_bytes() != *crc {
            return Content::Broken;
        }
        Content::Record {
            sequence: u32::from_le_bytes([a, b, c, d]),
            kind,
            length,
        }
    }

    /// A sector's newest record and next slot, as if it were the active one; after this number of blank slots there is nothing.
    #[inline(never)]
    fn look(&mut self, sector: u32, blank_slots: u32) -> Active {
        let mut active = Active {
            sector,
            next: 0,
            sequence: 0,
            has_spare: false,
        };
        let (mut slot, mut blank) = (0, 0);
        while slot < Self::SLOTS && blank < blank_slots {
            let content = self.slot(sector, slot);
            blank = content.blank_after(blank);
            slot += content.slots();
            match content {
                Content::Blank => {}
                Content::Broken => active.next = slot,
                Content::Record { sequence, kind, .. } => {
                    active.next = slot;
                    active.sequence = active.sequence.max(sequence);
                    active.has_spare |= kind == Kind::SpareErased as u8;
                }
            }
        }
        active
    }
}

impl Content {
    /// Blank slots in a row up to this content, with this number before it.
    const fn blank_after(&self, before: u32) -> u32 {
        match self {
            Self::Blank => before + 1,
            Self::Broken | Self::Record { .. } => 0,
        }
    }

    /// Slots until the next content.
    const fn slots(&self) -> u32 {
        match self {
            Self::Record { length, .. } => slots_of(*length as usize) as u32,
            Self::Blank | Self::Broken => 1,
        }
    }
}

/// Lays a record out at the beginning of blank bytes, which [`seal`] completes. None where it is longer than they are.
fn lay_out<'a>(bytes: &'a mut [u8], kind: Kind, payload: &[u8]) -> Option<&'a mut [u8]> {
    let record = bytes.get_mut(..slots_of(payload.len()) * SLOT)?;
    let length = u8::try_from(payload.len()).ok()?;
    let fields = [kind as u8, length].into_iter().zip(KIND..);
    for (byte, at) in fields.chain(payload.iter().copied().zip(HEAD..)) {
        *record.get_mut(at)? = byte;
    }
    Some(record)
}

/// Gives a record its sequence number, and the CRC of all before.
fn seal(record: &mut [u8], sequence: u32) {
    if let Some((data, crc)) = record.split_last_chunk_mut::<CRC>()
        && let Some(place) = data.first_chunk_mut()
    {
        *place = sequence.to_le_bytes();
        *crc = crc32(data).to_le_bytes();
    }
}

#[cfg(test)]
mod tests;
