use super::*;
use crate::ram_flash::{OutOfBounds, RamFlash};
use embedded_storage::nor_flash::{ErrorType, ReadNorFlash};
use std::vec::Vec;

/// Slots of a sector.
const SLOTS: usize = 6;
const SECTOR: usize = SLOTS * SLOT;

/// Flash whose supply fails after a number of bytes written and halves of sectors erased: the one after that is done in part, those after it not at all.
#[derive(Clone, Debug)]
struct Failing {
    flash: RamFlash<SECTOR>,
    left: u32,
    /// Bits of the last byte that are still written.
    bits: u8,
}

impl ErrorType for Failing {
    type Error = OutOfBounds;
}

impl ReadNorFlash for Failing {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), OutOfBounds> {
        self.flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for Failing {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        // The order in which a sector is erased is not specified: the second half first, so that the older records last.
        let middle = from + (to - from) / 2;
        for (from, to) in [(middle, to), (from, middle)] {
            self.left = self.left.checked_sub(1).ok_or(OutOfBounds)?;
            self.flash.erase(from, to)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        for (at, byte) in (offset..).zip(bytes) {
            let Some(left) = self.left.checked_sub(1) else {
                self.flash.write(at, &[byte | !self.bits])?;
                self.bits = 0;
                return Err(OutOfBounds);
            };
            self.left = left;
            self.flash.write(at, &[*byte])?;
        }
        Ok(())
    }
}

fn read(flash: &RamFlash<SECTOR>) -> Option<Vec<u8>> {
    newest(&mut Storage::open(flash.clone()), Kind::Profile)
}

fn newest<F: NorFlash>(storage: &mut Storage<F>, kind: Kind) -> Option<Vec<u8>> {
    let mut bytes = [0; PAYLOAD_MAX];
    storage.newest(kind, &mut bytes).map(<[u8]>::to_vec)
}

#[test]
fn the_newest_record_is_in_force() {
    let mut storage = Storage::open(RamFlash::<SECTOR>::new());
    assert!(newest(&mut storage, Kind::Profile).is_none());
    for length in 0..3 * SLOTS {
        let payload: Vec<u8> = (0..length as u8).collect();
        storage.keep(Kind::Profile, &payload).unwrap();
        assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), payload);
        // At a power-up in between.
        storage = Storage::open(storage.flash);
        assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), payload);
    }
    assert_eq!(
        storage.keep(Kind::Profile, &[0; PAYLOAD_MAX + 1]),
        Err(StorageError)
    );
    storage.keep(Kind::Profile, &[0; PAYLOAD_MAX]).unwrap();
}

#[test]
fn without_a_power_up_there_is_room_for_two_sectors() {
    let mut storage = Storage::open(RamFlash::<SECTOR>::new());
    // One is left blank after the first record of a sector that has become active.
    for record in 0..2 * SLOTS - 2 {
        storage.keep(Kind::Profile, &[record as u8]).unwrap();
    }
    assert_eq!(storage.keep(Kind::Profile, &[98]), Err(StorageError));
    assert_eq!(
        newest(&mut storage, Kind::Profile).unwrap(),
        [2 * SLOTS as u8 - 3]
    );
    // One is left for a record that has to be written.
    assert!(storage.prepare(Kind::Journal, &[98]).is_none());
    storage.keep_last(Kind::Profile, &[97]).unwrap();
    assert_eq!(storage.keep_last(Kind::Profile, &[98]), Err(StorageError));
    assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), [97]);
    let mut storage = Storage::open(storage.flash);
    storage.keep(Kind::Profile, &[99]).unwrap();
    assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), [99]);
}

/// A profile and many runs: both sectors are full of the journal, and the next power-up makes room again.
#[test]
fn records_of_one_kind_do_not_take_the_room_of_another() {
    let mut storage = Storage::open(RamFlash::<SECTOR>::new());
    storage.keep(Kind::Profile, &[7]).unwrap();
    for turn in 0..5_u8 {
        let mut record = 0;
        while storage.keep(Kind::Journal, &[turn, record]).is_ok() {
            record += 1;
        }
        assert!(usize::from(record) >= SLOTS - 3, "{turn}: {record}");
        storage = Storage::open(storage.flash);
        assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), [7]);
        assert_eq!(newest(&mut storage, Kind::Journal).unwrap(), [turn, record - 1]);
    }
}

/// The spare of a new chip is known without a record of it, also after a prepared record was written.
#[test]
fn a_prepared_record_on_a_new_chip_leaves_room_for_two_sectors() {
    let mut storage = Storage::open(RamFlash::<SECTOR>::new());
    storage.keep(Kind::Profile, &[1]).unwrap();
    let prepared = storage.prepare(Kind::Journal, &[2]).unwrap();
    storage.flash.write(prepared.offset, &prepared.bytes).unwrap();
    storage.look_again();
    assert_eq!(newest(&mut storage, Kind::Journal).unwrap(), [2]);
    // Three slots are taken: the prepared record leaves one blank. In the spare so does the first, the profile takes one more, and one is left.
    for record in 3..2 * SLOTS as u8 - 3 {
        storage.keep(Kind::Journal, &[record]).unwrap();
    }
    assert_eq!(storage.keep(Kind::Journal, &[99]), Err(StorageError));
    assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), [1]);
    // Prepared in the spare: that is the active sector then, and has none.
    let mut storage = Storage::open(RamFlash::<SECTOR>::new());
    for record in 0..SLOTS as u8 {
        storage.keep(Kind::Journal, &[record]).unwrap();
    }
    let prepared = storage.prepare(Kind::Journal, &[77]).unwrap();
    storage.flash.write(prepared.offset, &prepared.bytes).unwrap();
    storage.look_again();
    assert_eq!(newest(&mut storage, Kind::Journal).unwrap(), [77]);
    for record in 2..SLOTS as u8 - 1 {
        storage.keep(Kind::Journal, &[record]).unwrap();
    }
    assert_eq!(storage.keep(Kind::Journal, &[99]), Err(StorageError));
}

#[test]
fn what_else_was_in_the_sectors_is_erased() {
    let mut flash = RamFlash::<SECTOR>::new();
    flash.write(100, &[0; 200]).unwrap();
    let mut storage = Storage::open(flash);
    for record in 0..SLOTS as u8 {
        storage.keep(Kind::Profile, &[record]).unwrap();
    }
    assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), [SLOTS as u8 - 1]);
}

/// The supply fails at every byte and at every half of an erase, during several turns of both sectors: what is read at the next power-up is the last record
/// that was kept, or the one whose writing was cut short, and both can be followed by others.
#[test]
fn a_power_cut_at_any_operation_loses_nothing_that_was_kept() {
    let mut cuts = 0;
    for bits in [0, 0x0f, 0xff] {
        for left in 0.. {
            let mut flash = RamFlash::<SECTOR>::new();
            let mut kept = None;
            let mut tried = None;
            let mut failing = Failing {
                flash: flash.clone(),
                left,
                bits,
            };
            let mut was_cut = false;
            // There is always room for a sector of records less two, whatever the last power-up left.
            'life: for turn in 0..5_u8 {
                let mut storage = Storage::open(failing);
                for record in 0..SLOTS as u8 - 2 - turn % 2 {
                    let payload = [turn, record, 0x55];
                    tried = Some(payload.to_vec());
                    if storage.keep(Kind::Profile, &payload).is_err() {
                        was_cut = true;
                        flash = storage.flash.flash;
                        break 'life;
                    }
                    kept.clone_from(&tried);
                }
                failing = storage.flash;
                flash = failing.flash.clone();
            }
            let found = read(&flash);
            assert!(found == kept || found == tried, "{left}: {found:?}, not {kept:?}");
            // The supply is back, also if the cut was in an erase.
            let mut storage = Storage::open(flash);
            storage.keep(Kind::Profile, &[7; 40]).unwrap();
            assert_eq!(read(&storage.flash), Some([7; 40].to_vec()));
            if !was_cut {
                break;
            }
            cuts += 1;
        }
    }
    assert!(cuts > 1000, "{cuts}");
}

/// Records of several slots between records of one: each is found, and a record that was prepared counts once it is written, whatever was written beside it.
#[test]
fn long_and_prepared_records_are_found() {
    const LARGE: usize = 40 * SLOT;
    let mut storage = Storage::open(RamFlash::<LARGE>::new());
    let long: Vec<u8> = (0..PAYLOAD_MAX as u8).collect();
    storage.keep(Kind::Profile, &long).unwrap();
    for number in 0..60_u8 {
        let prepared = storage.prepare(Kind::Journal, &[number, 1]).unwrap();
        storage.keep(Kind::Journal, &[number, 0]).unwrap();
        if number % 3 == 0 {
            storage.flash.write(prepared.offset, &prepared.bytes).unwrap();
            storage.look_again();
        }
        let found = newest(&mut storage, Kind::Journal).unwrap();
        assert_eq!(found, [number, u8::from(number % 3 == 0)]);
        assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), long);
        storage = Storage::open(storage.flash);
        assert_eq!(newest(&mut storage, Kind::Journal).unwrap(), found);
        assert_eq!(newest(&mut storage, Kind::Profile).unwrap(), long);
    }
}
