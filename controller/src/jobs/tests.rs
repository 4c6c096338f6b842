use super::*;
use crate::ram_flash::{OutOfBounds, RamFlash};
use embedded_storage::nor_flash::{ErrorType, ReadNorFlash};
use protocol::{
    digest::job_digest,
    message::{JobName, SpindleOrder},
};
use std::vec::Vec;

/// Room for three jobs of 60 words in a sector.
const SECTOR: usize = 3 * (HEAD + 60 * 4 + 8);

/// Flash whose supply fails after a number of words written and parts of sectors erased.
#[derive(Clone, Debug)]
struct Failing {
    flash: RamFlash<SECTOR>,
    left: u32,
    /// Bits of the last word that are still written; the lowest one: an erase begins at the end.
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
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), OutOfBounds> {
        // The first quarter of it has the head of a job.
        let quarter = from + (to - from) / 4;
        let mut parts = [(from, quarter), (quarter, to)];
        if self.bits & 1 > 0 {
            parts.reverse();
        }
        for (from, to) in parts {
            self.left = self.left.checked_sub(1).ok_or(OutOfBounds)?;
            self.flash.erase(from, to)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), OutOfBounds> {
        for (at, word) in (offset..).step_by(4).zip(bytes.chunks(4)) {
            let Some(left) = self.left.checked_sub(1) else {
                let part: Vec<u8> = word.iter().map(|byte| byte | !self.bits).collect();
                self.flash.write(at, &part)?;
                self.bits = 0;
                return Err(OutOfBounds);
            };
            self.left = left;
            self.flash.write(at, word)?;
        }
        Ok(())
    }
}

fn words(seed: i32, count: i32) -> Vec<i32> {
    (0..count).map(|word| word * 7919 + seed).collect()
}

fn job(name: &str, words: &[i32]) -> StoredJob {
    StoredJob {
        name: JobName::try_from(name).unwrap(),
        header: interp_core::Header::default(),
        words: words.len() as u32,
        digest: job_digest(words),
        spindle: SpindleOrder::OFF,
        begins_anywhere: true,
        offsets: 7,
    }
}

fn keep<F: NorFlash>(store: &mut JobStore<F>, name: &str, words: &[i32]) -> Result<(), StorageError> {
    store.begin(&job(name, words))?;
    for chunk in words.chunks(CHUNK) {
        store.write(chunk)?;
    }
    store.finish()
}

/// Name and words of every job that is kept; each has the digest that it was stored with.
fn kept<F: NorFlash>(store: &mut JobStore<F>) -> Vec<(JobName, Vec<i32>)> {
    let mut all = Vec::new();
    while let Some(place) = store.nth(all.len() as u32) {
        let job = store.job(&place).unwrap();
        let mut words = Vec::new();
        while words.len() < job.words as usize {
            let mut chunk = [0; CHUNK];
            let read = store.read(&place, words.len() as u32, &mut chunk);
            words.extend_from_slice(read);
        }
        assert_eq!(job_digest(&words), job.digest, "{}", job.name);
        all.push((job.name, words));
    }
    all
}

fn newest<F: NorFlash>(store: &mut JobStore<F>) -> JobName {
    let place = store.find(None).unwrap();
    store.job(&place).unwrap().name
}

#[test]
fn jobs_are_kept_replaced_and_deleted() {
    let mut store = JobStore::open(RamFlash::<SECTOR>::new());
    let [one, two, three] = [words(1, 60), words(2, 30), words(3, 60)];
    keep(&mut store, "one", &one).unwrap();
    keep(&mut store, "two", &two).unwrap();
    keep(&mut store, "one", &three).unwrap();
    let mut store = JobStore::open(store.into_flash());
    let names: Vec<_> = kept(&mut store).into_iter().collect();
    assert_eq!(names.len(), 2);
    let place = store.find(Some("one")).unwrap();
    let mut chunk = [0; CHUNK];
    assert_eq!(store.read(&place, 0, &mut chunk), &three[..CHUNK]);
    // The one that was stored last.
    assert_eq!(newest(&mut store), "one");
    assert!(store.find(Some("three")).is_none());
    assert_eq!(store.delete("one"), Ok(true));
    assert_eq!(store.delete("one"), Ok(false));
    assert_eq!(newest(&mut store), "two");
    // Room is there again once a sector keeps nothing, at the next power-up.
    for number in 0.. {
        if keep(&mut store, "more", &words(number, 60)).is_err() {
            assert!(number > 2);
            break;
        }
    }
    assert!(store.room() < 60);
    store.delete("more").unwrap();
    store.delete("two").unwrap();
    let mut store = JobStore::open(store.into_flash());
    assert!(store.room() >= 60 * 3);
    assert!(kept(&mut store).is_empty());
    // More words than there is room for, and fewer than were announced.
    assert_eq!(store.begin(&job("long", &words(0, 800))), Err(StorageError));
    store.begin(&job("short", &one)).unwrap();
    store.write(&two[..CHUNK]).unwrap();
    assert_eq!(store.finish(), Err(StorageError));
    assert!(kept(&mut store).is_empty());
}

/// The supply fails at every word and at every part of an erase while jobs are stored, replaced and deleted: at the next power-up each job is whole, as it was before the operation that was
/// cut short or as after it, and others can be stored.
#[test]
fn a_power_cut_at_any_operation_leaves_whole_jobs() {
    let mut cuts = 0;
    for bits in [0, 0x0f, 0xff] {
        for left in 0.. {
            let mut store = JobStore::open(Failing {
                flash: RamFlash::<SECTOR>::new(),
                left,
                bits,
            });
            let mut before: Vec<(&str, Vec<i32>)> = Vec::new();
            let mut after = before.clone();
            let mut was_cut = false;
            for turn in 0..6_i32 {
                for name in ["a", "b"] {
                    let wanted = words(turn, 20 + turn);
                    before.clone_from(&after);
                    after.retain(|(other, _)| *other != name);
                    after.push((name, wanted.clone()));
                    was_cut = keep(&mut store, name, &wanted).is_err();
                    if was_cut {
                        break;
                    }
                }
                if !was_cut && turn % 2 == 1 {
                    before.clone_from(&after);
                    after.clear();
                    was_cut = store.delete("a").is_err() || store.delete("b").is_err();
                }
                if was_cut {
                    break;
                }
                store = JobStore::open(store.into_flash());
                let found = kept(&mut store);
                assert_eq!(found.len(), after.len());
                for (name, words) in &after {
                    assert!(found.iter().any(|(other, there)| other == name && there == words));
                }
            }
            let is_over = !was_cut && store.flash.left > 0;
            let mut store = JobStore::open(store.into_flash().flash);
            for (name, words) in kept(&mut store) {
                let is_in = |jobs: &[(&str, Vec<i32>)]| {
                    jobs.iter()
                        .any(|(other, there)| name == *other && *there == words)
                };
                assert!(is_in(&before) || is_in(&after), "{left}: {name}");
            }
            for (name, words) in &before {
                // What the operation did not concern is there.
                if after.contains(&(*name, words.clone())) {
                    let found = kept(&mut store);
                    assert!(
                        found.iter().any(|(other, there)| other == name && there == words),
                        "{left}: {name} is gone"
                    );
                }
            }
            // Once everything is deleted, there is room.
            store.delete("a").unwrap();
            store.delete("b").unwrap();
            let mut store = JobStore::open(store.into_flash());
            keep(&mut store, "c", &words(9, 60)).unwrap();
            assert_eq!(kept(&mut store).len(), 1);
            if is_over {
                break;
            }
            cuts += 1;
        }
    }
    assert!(cuts > 500, "{cuts}");
}

/// Two jobs of one name are kept where the power was cut between the end of the later one and the deletion of the earlier one: a second cut, in a deletion of both, never
/// leaves the earlier one alone.
#[test]
fn a_deletion_that_is_cut_short_brings_no_replaced_job_back() {
    let [old, new] = [words(1, 20), words(2, 20)];
    let mut was_cut_between = false;
    for left in 0.. {
        let mut store = JobStore::open(RamFlash::<SECTOR>::new());
        keep(&mut store, "a", &old).unwrap();
        let mut store = JobStore::open(Failing {
            flash: store.into_flash(),
            left,
            bits: 0,
        });
        if keep(&mut store, "a", &new).is_ok() {
            break;
        }
        let flash = store.into_flash().flash;
        if kept(&mut JobStore::open(flash.clone())).len() < 2 {
            continue;
        }
        was_cut_between = true;
        for (left, bits) in [(0, 0), (0, 0x0f), (1, 0), (1, 0x0f)] {
            let flash = flash.clone();
            let mut store = JobStore::open(Failing { flash, left, bits });
            assert_eq!(store.delete("a"), Err(StorageError));
            let mut store = JobStore::open(store.into_flash().flash);
            for (_, words) in kept(&mut store).iter().rev().take(1) {
                assert_eq!(*words, new, "after {left} words and bits {bits:#x}");
            }
        }
    }
    assert!(was_cut_between);
}
