//! The words of a streamed job that the board has no room for yet: sent while it runs.

use protocol::message::{CHUNK_WORDS_MAX, Request, Words};

use crate::prepare::Prepared;

/// A streamed job, and how much of it the board has.
#[derive(Clone, Debug)]
pub(super) struct Feed {
    pub(super) job: Prepared,
    offset: usize,
    /// Words up to which the board has room, as far as it reported.
    room: usize,
    /// Most words of a chunk.
    most: usize,
}

/// Fewest words of a chunk on a bad line.
const MOST_MIN: usize = 8;

impl Feed {
    /// The board has received this number of words.
    pub(super) fn new(job: &Prepared, received: u32) -> Self {
        Self {
            job: job.clone(),
            offset: received as usize,
            room: 0,
            most: CHUNK_WORDS_MAX,
        }
    }

    /// The board reported up to which word it has room: never less than before.
    pub(super) fn has_room(&mut self, room: u32) {
        self.room = self.room.max(room as usize);
    }

    /// The board has this number of words, or room for no more.
    pub(super) const fn has(&mut self, received: u32) {
        self.offset = received as usize;
    }

    /// The board refused words beyond these.
    pub(super) const fn has_no_room(&mut self, room: u32) {
        self.room = room as usize;
    }

    /// The last chunk needed many tries, or few: shorter frames are damaged less often.
    pub(super) fn adapt(&mut self, is_bad: bool) {
        self.most = if is_bad {
            (self.most / 2).max(MOST_MIN)
        } else {
            (self.most + 1).min(CHUNK_WORDS_MAX)
        };
    }

    /// Whether all words were sent.
    pub(super) fn is_over(&self) -> bool {
        self.offset >= self.job.words.len()
    }

    /// The next words, if there is room for any, and the number of words sent with them.
    pub(super) fn next(&self, most: u16) -> Option<(Request, u32)> {
        let most = usize::from(most).clamp(1, self.most);
        let end = (self.offset + most).min(self.room).min(self.job.words.len());
        let words = self
            .job
            .words
            .get(self.offset..end)
            .filter(|words| !words.is_empty())?;
        let chunk = Request::JobChunk {
            offset: u32::try_from(self.offset).ok()?,
            words: Words::new(words)?,
        };
        Some((chunk, u32::try_from(end).ok()?))
    }
}
