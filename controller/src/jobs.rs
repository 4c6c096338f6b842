//! Jobs kept in flash: several, by name, each whole or not there.
//!
//! Two sectors, each filled from its begin on. An entry is a head of `HEAD` bytes (a mark, sequence number, words and name, which are enough to find it; what [`StoredJob`] has; a CRC-32), the job's words, and two words: one
//! that is written last, and one that is written when the job is deleted. An entry whose last word is missing was cut short: it is no job, and its place is lost until the
//! sector is erased. The words themselves are checked by their digest when the job is loaded, as those of a host are.
//! **An erase stops the processor for a second**, so it happens at power-up only ([`JobStore::open`]): of a sector in which nothing is kept any more. Of two jobs
//! of one name the later counts, so a job is replaced as a whole.

use embedded_storage::nor_flash::NorFlash;
use protocol::{
    digest::Digest,
    frame::crc32,
    message::{JOB_NAME_MAX, STORED_JOB_BYTES_MAX, StoredJob},
};

use crate::storage::StorageError;

/// Bytes of an entry's head.
const HEAD: usize = 284;
/// Bytes of a word.
const WORD: u32 = 4;
/// Bytes of the two words after a job's.
const TAIL: u32 = 2 * WORD;
/// Bytes of the CRC of a head.
const CRC: usize = 4;
/// Bytes before the [`StoredJob`] in a head: mark, sequence number, words, name.
const BEGIN: usize = 12 + JOB_NAME_MAX;
const _: () = assert!(BEGIN + STORED_JOB_BYTES_MAX + CRC == HEAD && HEAD.is_multiple_of(WORD as usize));

/// First word of a head.
const MARK: u32 = 0x626f_6a31;
/// The word after the words of a job that was stored to its end.
const WHOLE: u32 = 0x6c6c_6121;
/// A word of erased flash.
const BLANK: u32 = u32::MAX;

/// Words written or read at once.
const CHUNK: usize = 16;

/// Where a job is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JobPlace {
    /// Offset of the job's entry, bytes.
    offset: u32,
    /// Number of the job's words.
    words: u32,
    /// Order of storing: the job with the greater number was stored later.
    sequence: u32,
}

impl JobPlace {
    const fn data(&self) -> u32 {
        self.offset + HEAD as u32
    }

    const fn tail(&self) -> u32 {
        self.data() + self.words * WORD
    }

    const fn end(&self) -> u32 {
        self.tail() + TAIL
    }
}

/// A job's name, filled up with zeros.
type Name = [u8; JOB_NAME_MAX];

fn padded(name: &str) -> Name {
    let mut padded = [0; JOB_NAME_MAX];
    for (to, from) in padded.iter_mut().zip(name.bytes()) {
        *to = from;
    }
    padded
}

/// Content of a sector at an offset.
enum Entry {
    /// Nothing: the end of the written part.
    Blank,
    /// A head that was not written to its end.
    Broken,
    /// A job, and whether it is kept.
    Job(JobPlace, Name, bool),
}

/// Jobs in two sectors of a flash of `2 * F::ERASE_SIZE` bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct JobStore<F> {
    flash: F,
    /// Offset of the first free byte of each sector.
    ends: [u32; 2],
    /// Sequence number of the job that was begun last.
    sequence: u32,
    writing: Option<Writing>,
}

/// The job that is being written.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Writing {
    place: JobPlace,
    name: Name,
    /// Digest of all its words, as announced.
    digest: u64,
    /// Words written so far.
    done: u32,
}

impl<F: NorFlash + Default> Default for JobStore<F> {
    fn default() -> Self {
        Self::open(F::default())
    }
}

impl<F: NorFlash> JobStore<F> {
    const SECTOR: u32 = F::ERASE_SIZE as u32;

    /// Finds the jobs; erases a sector that keeps none and is not blank, which takes up to some seconds.
    pub fn open(flash: F) -> Self {
        let mut store = Self {
            flash,
            // No room.
            ends: [Self::SECTOR, 2 * Self::SECTOR],
            sequence: 0,
            writing: None,
        };
        for sector in [0, 1] {
            let mut keeps = false;
            let Walked { end, newest, .. } = store.walk(sector, |_, _, is_kept| {
                keeps |= is_kept;
                false
            });
            store.sequence = store.sequence.max(newest);
            let begin = sector * Self::SECTOR;
            let is_ready = keeps
                || (end == begin && store.is_blank(begin))
                || store.flash.erase(begin, begin + Self::SECTOR).is_ok();
            if let Some(place) = store.ends.get_mut(sector as usize).filter(|_| is_ready) {
                *place = if keeps { end } else { begin };
            }
        }
        store
    }

    /// Whether the sector that begins here is blank to its end: an erase that was cut short may have reached its beginning only. Every eighth word is read, because all take
    /// 13 ms; remains of a job are longer than that, and a job that does not read back is not kept.
    fn is_blank(&mut self, begin: u32) -> bool {
        let words = (begin..begin + Self::SECTOR).step_by(8 * WORD as usize);
        for at in words {
            if self.word(at) != BLANK {
                return false;
            }
        }
        true
    }

    /// The flash.
    pub fn into_flash(self) -> F {
        self.flash
    }

    /// The entry at an offset, in a sector with this end.
    fn entry(&mut self, offset: u32, limit: u32) -> Entry {
        let mut head = [0; HEAD];
        if self.flash.read(offset, &mut head).is_err() {
            return Entry::Broken;
        }
        if head.iter().take(2 * WORD as usize).all(|byte| *byte == 0xff) {
            return Entry::Blank;
        }
        let Some((place, name)) = read_head(&head, offset) else {
            return Entry::Broken;
        };
        let Some(bytes) = place
            .words
            .checked_mul(WORD)
            .filter(|bytes| *bytes <= Self::SECTOR)
        else {
            return Entry::Broken;
        };
        let end = offset.saturating_add(HEAD as u32 + bytes + TAIL);
        if end > limit {
            return Entry::Broken;
        }
        let is_kept = self.word(place.tail()) == WHOLE && self.word(place.tail() + WORD) == BLANK;
        Entry::Job(place, name, is_kept)
    }

    /// Goes through the jobs of a sector up to the first one for which `is_it` holds, of its place, its name and whether it is kept.
    fn walk(&mut self, sector: u32, mut is_it: impl FnMut(&JobPlace, &Name, bool) -> bool) -> Walked {
        let mut walked = Walked {
            end: sector * Self::SECTOR,
            newest: 0,
            taken: None,
        };
        let limit = (sector + 1) * Self::SECTOR;
        while walked.end + HEAD as u32 + TAIL <= limit {
            match self.entry(walked.end, limit) {
                Entry::Blank => break,
                Entry::Broken => walked.end += HEAD as u32,
                Entry::Job(place, name, is_kept) => {
                    walked.end = place.end();
                    walked.newest = walked.newest.max(place.sequence);
                    if is_it(&place, &name, is_kept) {
                        walked.taken = Some(place);
                        break;
                    }
                }
            }
        }
        walked
    }

    /// The kept job with this number, in order of their places.
    pub fn nth(&mut self, number: u32) -> Option<JobPlace> {
        let mut left = number;
        self.first(|_, _| {
            let is_it = left == 0;
            left = left.saturating_sub(1);
            is_it
        })
    }

    /// The first kept job for which `is_it` holds.
    #[inline(never)]
    fn first(&mut self, mut is_it: impl FnMut(&JobPlace, &Name) -> bool) -> Option<JobPlace> {
        let mut sectors = [0, 1].into_iter();
        sectors.find_map(|sector| {
            let walked = self.walk(sector, |place, name, is_kept| is_kept && is_it(place, name));
            walked.taken
        })
    }

    /// The kept job of this name that was stored last; the one stored last of all without a name.
    pub fn find(&mut self, name: Option<&str>) -> Option<JobPlace> {
        let wanted = name.map(padded);
        let mut newest: Option<JobPlace> = None;
        self.first(|place, name| {
            let is_it = wanted.is_none_or(|wanted| wanted == *name);
            if is_it && newest.is_none_or(|before| place.sequence > before.sequence) {
                newest = Some(*place);
            }
            false
        });
        newest
    }

    /// A job without its words.
    #[inline(never)]
    pub fn job(&mut self, place: &JobPlace) -> Option<StoredJob> {
        let mut bytes = [0; STORED_JOB_BYTES_MAX];
        self.flash.read(place.offset + BEGIN as u32, &mut bytes).ok()?;
        StoredJob::read(&bytes)
    }

    /// Words of the longest job for which there is room now.
    pub fn room(&self) -> u32 {
        let rooms = self.ends.iter().zip([1, 2]).map(|(end, sectors)| {
            let left = (sectors * Self::SECTOR).saturating_sub(*end);
            left.saturating_sub(HEAD as u32 + TAIL) / WORD
        });
        rooms.max().unwrap_or(0)
    }

    /// Begins to store a job.
    ///
    /// # Errors
    /// There is no room, or the flash cannot be written.
    #[inline(never)]
    pub fn begin(&mut self, job: &StoredJob) -> Result<(), StorageError> {
        let bytes = job.words.checked_mul(WORD).ok_or(StorageError)?;
        let needed = bytes.checked_add(HEAD as u32 + TAIL).ok_or(StorageError)?;
        let sequence = self.sequence.checked_add(1).ok_or(StorageError)?;
        let mut head = [0xff; HEAD];
        let mut payload = [0; STORED_JOB_BYTES_MAX];
        let payload = job.write(&mut payload).ok_or(StorageError)?;
        let (data, crc) = head.split_at_mut(HEAD - CRC);
        let numbers = [MARK, sequence, job.words].map(u32::to_le_bytes);
        let fields = numbers.into_iter().flatten().chain(padded(&job.name));
        for (to, from) in data.iter_mut().zip(fields.chain(payload.iter().copied())) {
            *to = from;
        }
        crc.copy_from_slice(&crc32(data).to_le_bytes());
        let free = self.ends.iter_mut().zip([1, 2]).find(|(end, sectors)| {
            **end <= sectors * Self::SECTOR && sectors * Self::SECTOR - **end >= needed
        });
        let (end, _) = free.ok_or(StorageError)?;
        let place = JobPlace {
            offset: *end,
            words: job.words,
            sequence,
        };
        // Whatever happens, this place is not blank any more.
        *end += HEAD as u32;
        self.flash.write(place.offset, &head).map_err(|_| StorageError)?;
        *end = place.end();
        self.sequence = sequence;
        self.writing = Some(Writing {
            place,
            name: padded(&job.name),
            digest: job.digest,
            done: 0,
        });
        Ok(())
    }

    /// Writes the next words of the job.
    ///
    /// # Errors
    /// The flash cannot be written, or there are more words than the job has.
    pub fn write(&mut self, words: &[i32]) -> Result<(), StorageError> {
        let writing = self.writing.as_mut().ok_or(StorageError)?;
        let Writing { place, done, .. } = *writing;
        let count = u32::try_from(words.len()).map_err(|_| StorageError)?;
        if count > place.words - done || words.len() > CHUNK {
            return Err(StorageError);
        }
        let mut bytes = [0; CHUNK * WORD as usize];
        for (to, from) in bytes.chunks_exact_mut(WORD as usize).zip(words) {
            to.copy_from_slice(&from.to_le_bytes());
        }
        let bytes = bytes.get(..words.len() * WORD as usize).ok_or(StorageError)?;
        let at = place.data() + done * WORD;
        self.flash.write(at, bytes).map_err(|_| StorageError)?;
        writing.done += count;
        Ok(())
    }

    /// Ends a job: from here on it is kept, in place of an earlier one of its name.
    ///
    /// # Errors
    /// Words are missing or read back differently: the job is not kept. The flash cannot be written: the job may be kept, and the earlier one with it.
    pub fn finish(&mut self) -> Result<(), StorageError> {
        let Writing {
            place,
            name,
            digest,
            done,
        } = self.writing.take().ok_or(StorageError)?;
        if done != place.words || self.digest(&place) != digest {
            return Err(StorageError);
        }
        self.set_word(place.tail(), WHOLE)?;
        self.delete_others(&place, &name)
    }

    /// Deletes the job of this name. Returns whether there was one.
    ///
    /// # Errors
    /// The flash cannot be written.
    pub fn delete(&mut self, name: &str) -> Result<bool, StorageError> {
        let Some(newest) = self.find(Some(name)) else {
            return Ok(false);
        };
        // The newest one last: cut short, this must not bring back one that it has replaced.
        self.delete_others(&newest, &padded(name))?;
        self.delete_at(&newest)?;
        Ok(true)
    }

    /// Keeps no other job of this name than the one at `place`.
    fn delete_others(&mut self, place: &JobPlace, name: &Name) -> Result<(), StorageError> {
        let is_other = |other: &JobPlace, its: &Name| other != place && its == name;
        while let Some(other) = self.first(is_other) {
            self.delete_at(&other)?;
        }
        Ok(())
    }

    fn delete_at(&mut self, place: &JobPlace) -> Result<(), StorageError> {
        self.set_word(place.tail() + WORD, 0)
    }

    /// Words of a job from an offset on; fewer than asked for at its end.
    pub fn read<'a>(&mut self, place: &JobPlace, offset: u32, words: &'a mut [i32; CHUNK]) -> &'a [i32] {
        let count = place.words.saturating_sub(offset).min(CHUNK as u32);
        let mut at = place.data() + offset * WORD;
        let words = words.get_mut(..count as usize).unwrap_or(&mut []);
        for word in &mut *words {
            *word = self.word(at).cast_signed();
            at += WORD;
        }
        words
    }

    /// The digest of a job's words.
    fn digest(&mut self, place: &JobPlace) -> u64 {
        let mut digest = Digest::new();
        let mut offset = 0;
        while offset < place.words {
            let mut chunk = [0; CHUNK];
            digest.words(self.read(place, offset, &mut chunk));
            offset += CHUNK as u32;
        }
        digest.value()
    }

    fn word(&mut self, at: u32) -> u32 {
        let mut bytes = [0; WORD as usize];
        // What cannot be read is no job.
        self.flash
            .read(at, &mut bytes)
            .map_or(0, |()| u32::from_le_bytes(bytes))
    }

    fn set_word(&mut self, at: u32, word: u32) -> Result<(), StorageError> {
        self.flash
            .write(at, &word.to_le_bytes())
            .map_err(|_| StorageError)?;
        if self.word(at) == word {
            Ok(())
        } else {
            Err(StorageError)
        }
    }
}

/// What a walk through a sector has found.
struct Walked {
    /// Offset after the last entry that was passed.
    end: u32,
    /// Greatest sequence number.
    newest: u32,
    /// The job at which the walk has ended.
    taken: Option<JobPlace>,
}

/// Place and name of a job with a head that is whole.
fn read_head(head: &[u8; HEAD], offset: u32) -> Option<(JobPlace, Name)> {
    let (data, crc) = head.split_at(HEAD - CRC);
    let (mark, rest) = data.split_first_chunk()?;
    let (sequence, rest) = rest.split_first_chunk()?;
    let (words, rest) = rest.split_first_chunk()?;
    let (name, _) = rest.split_first_chunk()?;
    if u32::from_le_bytes(*mark) != MARK || crc32(data).to_le_bytes() != *crc {
        return None;
    }
    let place = JobPlace {
        offset,
        words: u32::from_le_bytes(*words),
        sequence: u32::from_le_bytes(*sequence),
    };
    Some((place, *name))
}

#[cfg(test)]
mod tests;
