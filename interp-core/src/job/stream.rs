//! Jobs that are larger than the store: loaded while they run, row by row.
//!
//! A row is the patches of one side span. The store keeps a ring of rows: the one that the tool is on and as many after it as fit. All other words stay at its
//! start. The words of a streamed job, in order:
//!
//! | words | content |
//! |---|---|
//! | widths | of all spans, as in any job |
//! | with a region | its cells and edges, then the words of the links |
//! | [`Header::strips`] | which rows follow: [`Strip`] |
//! | of each row | its patches, then [`DIGEST_WORDS`] words: the digest of the job's words up to there (apart from those of the digests), low word first; the core does not read them |
//!
//! **Strips.** Without a region the rows are those of the surface, in order. With one, some are not needed, and a cell may begin below the end of the one before it.
//! So the rows come as strips, each a first row and the rows next to it, in the order in which the passes need them: a pass lies in the strip of
//! the pass before it where that holds its row and the row is not below that pass's, else in the next strip. The host makes the strips from the rows of the passes.
//!
//! **The window.** [`Header::window`] is the number of rows that is certain to be in the ring: it belongs to the job, so that the passes do not depend on the
//! ring's size. What is planned for a pass looks at rows up to `window - 1`
//! after the first one that is needed then: the pass's own, that of the pass before, or, where the tool goes along the boundary from one to the other, that of the pass before
//! that (`pass/row_history.rs`). Where an interval reaches farther it is cut short; an interval that fits three times into one row never is.
//!
//! **Turns.** Where turns lead from pass to pass the tool is not at rest, so nothing can be waited for. At a rest all rows of the window are asked for, and turns lead on for as
//! long as these last; then the tool rests at the end of a pass. So a job with turns rests more often than one that is no stream, by its window alone.
//!
//! **Waiting.** The planning of a pass begins only when the rows that it needs are checked. Until then the whole machine stands still at the end of the last
//! pass but one, or above it: neither tool nor planning goes on, and the tick is not counted. So the samples are those of a job that was loaded before.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::{bad_patch, record_words, tail_words};
use crate::job::{Header, width_words};
use crate::surface::{POLYNOMIAL_WORDS, PolynomialRecord, RATIONAL_WORDS, RationalRecord, split_patch};

/// Words of the digest after a row.
pub const DIGEST_WORDS: usize = 2;
/// Least window: the row of the tool, the one of the next pass, the one that is looked at from there.
pub const WINDOW_MIN: u16 = 3;
/// Greatest window that changes anything: an interval crosses 16 rows at most.
pub const WINDOW_MAX: u16 = 18;

/// Words of a row in the job, with its digest.
#[must_use]
pub fn row_words(header: &Header) -> usize {
    let digest = if header.window > 0 { DIGEST_WORDS } else { 0 };
    usize::from(header.path_spans) * record_words(header.kind) + digest
}

/// Words of the job before its first row.
#[must_use]
pub fn head_words(header: &Header) -> usize {
    let widths = width_words(header.path_spans, header.side_spans) as usize;
    if header.window == 0 {
        return widths;
    }
    widths + tail_words(header) + usize::from(header.strips)
}

/// Rows of a streamed job that a store of this size keeps.
#[must_use]
pub fn rows_max(header: &Header, store_words: usize) -> usize {
    store_words
        .saturating_sub(head_words(header))
        .checked_div(row_words(header))
        .unwrap_or(0)
}

/// Rows that follow one another in a job and on the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Strip {
    /// The side span of the first row.
    pub first: u16,
    /// Number of rows.
    pub rows: u16,
}

impl Strip {
    /// Its word.
    #[must_use]
    pub const fn to_word(self) -> i32 {
        ((self.first as u32) << 16 | self.rows as u32).cast_signed()
    }

    #[allow(clippy::cast_possible_truncation, reason = "16 bits each")]
    const fn from_word(word: i32) -> Self {
        let word = word.cast_unsigned();
        Self {
            first: (word >> 16) as u16,
            rows: word as u16,
        }
    }

    /// Number of a row in the strip, if it is there.
    #[must_use]
    pub const fn index(&self, row: u16) -> Option<u16> {
        match row.checked_sub(self.first) {
            Some(index) if index < self.rows => Some(index),
            _ => None,
        }
    }

    /// The last row.
    const fn last(&self) -> u16 {
        self.first.saturating_add(self.rows).saturating_sub(1)
    }
}

/// A strip of the job: its number, and that of its first row in the order of the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct StripInJob {
    strip: Strip,
    number: u16,
    at: u32,
}

impl StripInJob {
    /// Number of a row in the order of the job, if it is in the strip.
    #[inline(always)]
    fn place(&self, row: u16) -> Option<u32> {
        self.strip.index(row).map(|index| self.at + u32::from(index))
    }
}

/// The rows that have to be there before a pass is planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowsNeeded {
    /// The first row that the passes before the planned one still need; none where these are over.
    pub after: Option<u16>,
    /// The row of the pass before the planned one.
    pub before: u16,
    /// The row of the planned pass.
    pub own: u16,
    /// The last row that the planning reads.
    pub last: u16,
}

/// The ring of rows. A row has a number in the order of the job, its place; of a job that is stored as a whole that is its side span.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    /// Words before the rows and of a row, rows in the ring and of the job, patches of a row, and the window.
    head: u32,
    row_words: u32,
    slots: u32,
    count: u32,
    patches: u16,
    window: u16,
    /// Strips of the job, where their words are, and the first one.
    strips: u16,
    strips_from: u32,
    start: StripInJob,
    /// The strips of the last pass but one and of the last one that rows were asked for.
    current: [StripInJob; 2],
    /// What was asked for last.
    asked: Option<RowsNeeded>,
    /// Place of the first row that is needed, and of the oldest that is not overwritten.
    first: u32,
    oldest: u32,
    /// Words received, records checked, and rows complete with all records checked.
    received: u32,
    checked: u32,
    sealed: u32,
    /// Why the next record is not sound.
    bad: Option<Fault>,
}

impl Rows {
    /// No job.
    pub(crate) const NONE: Self = {
        let none = StripInJob {
            strip: Strip { first: 0, rows: 0 },
            number: 0,
            at: 0,
        };
        Self {
            head: 0,
            row_words: 0,
            slots: 1,
            count: 0,
            patches: 0,
            window: 0,
            strips: 0,
            strips_from: 0,
            start: none,
            current: [none; 2],
            asked: None,
            first: 0,
            oldest: 0,
            received: 0,
            checked: 0,
            sealed: 0,
            bad: None,
        }
    };

    /// No rows yet, of a job of this number of words in a store of this capacity.
    pub(crate) fn new(header: &Header, words: u32, capacity: usize) -> Self {
        let number = |words: usize| u32::try_from(words).unwrap_or(u32::MAX);
        let (head, row_words) = (number(head_words(header)), number(row_words(header)));
        let is_streamed = header.window > 0;
        let count = if header.strips > 0 {
            words.saturating_sub(head).checked_div(row_words).unwrap_or(0)
        } else {
            header.side_spans.into()
        };
        let slots = if is_streamed {
            number(rows_max(header, capacity)).clamp(1, count.max(1))
        } else {
            count.max(1)
        };
        let all = StripInJob {
            strip: Strip {
                first: 0,
                rows: header.side_spans,
            },
            number: 0,
            at: 0,
        };
        Self {
            head,
            row_words,
            slots,
            count,
            patches: header.path_spans,
            window: header.window,
            strips: header.strips,
            strips_from: head.saturating_sub(header.strips.into()),
            start: all,
            current: [all; 2],
            sealed: if is_streamed { 0 } else { u32::MAX },
            ..Self::NONE
        }
    }

    /// Rows of the job.
    pub(crate) const fn count(&self) -> u32 {
        self.count
    }

    /// Words of the job.
    pub(crate) fn words(&self) -> u64 {
        u64::from(self.head) + u64::from(self.count) * u64::from(self.row_words)
    }

    /// Words of the store for the least number of rows.
    pub(crate) fn least_words(&self) -> u64 {
        u64::from(self.head) + u64::from(self.window).min(self.count.into()) * u64::from(self.row_words)
    }

    /// First word of a row in the store, if it is there.
    #[inline(always)]
    pub(crate) fn start(&self, row: u16) -> Option<usize> {
        let [before, now] = &self.current;
        let is_there = |place: &u32| (self.oldest..self.sealed).contains(place);
        let place = now.place(row).filter(is_there);
        let place = place.or_else(|| before.place(row).filter(is_there))?;
        self.start_of(place)
    }

    /// First word in the store of the row in this place.
    #[inline(always)]
    pub(crate) fn start_of(&self, place: u32) -> Option<usize> {
        let slot = place.checked_rem(self.slots)?;
        Some((self.head + slot * self.row_words) as usize)
    }

    pub(crate) const fn received(&self) -> u32 {
        self.received
    }

    /// Words up to which there is room: all rows before the first one that is needed may be overwritten.
    pub(crate) fn limit(&self) -> u32 {
        let rows = self.first.saturating_add(self.slots);
        self.head.saturating_add(rows.saturating_mul(self.row_words))
    }

    /// Stores words after those received.
    ///
    /// # Errors
    /// The words received, where these are not the next ones, or the words up to which there is room or a job.
    pub(crate) fn write(
        &mut self,
        store: &mut [i32],
        offset: u32,
        words: &[i32],
        length: u32,
    ) -> core::result::Result<(), u32> {
        let limit = self.limit().min(length);
        let end = u32::try_from(words.len())
            .ok()
            .and_then(|count| offset.checked_add(count));
        if offset != self.received {
            return Err(self.received);
        }
        if end.is_none_or(|end| end > limit) {
            return Err(limit);
        }
        for word in words {
            let place = match self.received.checked_sub(self.head) {
                None => Some(self.received as usize),
                Some(after) => {
                    let row = after.checked_div(self.row_words).unwrap_or(0);
                    let within = after.checked_rem(self.row_words).unwrap_or(0);
                    self.oldest = self.oldest.max((row + 1).saturating_sub(self.slots));
                    self.start_of(row).map(|start| start + within as usize)
                }
            };
            if let Some(slot) = place.and_then(|place| store.get_mut(place)) {
                *slot = *word;
            }
            self.received += 1;
        }
        Ok(())
    }

    /// Checks the strips, and takes the first one: rows of the surface, as many as the job has.
    ///
    /// # Errors
    /// [`FaultKind::BadHeader`] with the number of the strip.
    pub(crate) fn check_strips(&mut self, store: &[i32], side_spans: u16) -> Result<()> {
        if self.strips == 0 {
            return Ok(());
        }
        let bad = |number| Err(Fault::new(FaultKind::BadHeader, f32::from(number)));
        let mut rows = 0_u32;
        for number in 0..self.strips {
            let Some(strip) = self.strip(store, number) else {
                return bad(number);
            };
            if strip.rows == 0 || u32::from(strip.first) + u32::from(strip.rows) > side_spans.into() {
                return bad(number);
            }
            rows = rows.saturating_add(strip.rows.into());
        }
        let first = self.strip(store, 0).filter(|_| rows == self.count);
        let Some(strip) = first else {
            return bad(self.strips);
        };
        self.start.strip = strip;
        self.begin();
        Ok(())
    }

    /// A strip of the job.
    fn strip(&self, store: &[i32], number: u16) -> Option<Strip> {
        let at = self.strips_from as usize + usize::from(number);
        let word = store.get(at).filter(|_| number < self.strips)?;
        Some(Strip::from_word(*word))
    }

    /// The first pass is the next one.
    const fn begin(&mut self) {
        self.current = [self.start; 2];
        self.asked = None;
    }

    /// The strip of the next pass, in this row, after one in that row.
    fn strip_of(&self, store: &[i32], row: u16, before: u16) -> Option<StripInJob> {
        let [_, now] = &self.current;
        if row >= before && now.strip.index(row).is_some() {
            return Some(*now);
        }
        let number = now.number.saturating_add(1);
        let strip = self.strip(store, number)?;
        strip.index(row)?;
        Some(StripInJob {
            strip,
            number,
            at: now.at + u32::from(now.strip.rows),
        })
    }

    /// Whether the next pass can be planned: its rows are there. Those before the first that is still needed are free.
    ///
    /// # Errors
    /// A row is not sound; [`FaultKind::WrongState`] where the job does not have it; [`FaultKind::TooManyPatches`] where the ring is too small for all that
    /// has to be there at once, with the words that it takes.
    pub(crate) fn ask(&mut self, store: &[i32], needed: &RowsNeeded) -> Result<bool> {
        let absent = || Fault::new(FaultKind::WrongState, f32::from(needed.own));
        let strip = self
            .strip_of(store, needed.own, needed.before)
            .ok_or_else(absent)?;
        let [_, now] = &self.current;
        let last = strip
            .place(needed.last.min(strip.strip.last()))
            .ok_or_else(absent)?;
        let first = match needed.after {
            Some(row) => now.place(row),
            None => strip.place(needed.own),
        };
        self.first = self.first.max(first.ok_or_else(absent)?);
        let rows = (last + 1).saturating_sub(self.first);
        if rows > self.slots {
            let words = self.head.saturating_add(rows.saturating_mul(self.row_words));
            return Err(Fault::new(
                FaultKind::TooManyPatches,
                crate::math::arith::count_to_f32(words),
            ));
        }
        if last >= self.sealed {
            return self.bad.map_or(Ok(false), Err);
        }
        self.current = [*now, strip];
        self.asked = Some(*needed);
        Ok(true)
    }

    /// The rows that the planning of the latest pass needed, but the first one.
    pub(crate) const fn asked(&self) -> Option<RowsNeeded> {
        self.asked
    }

    /// Whether a record is the next to be checked, and complete with the digest of its row.
    pub(crate) fn is_next(&self, record: u32) -> bool {
        let row = record.checked_div(self.patches.into()).unwrap_or(0);
        let end = u64::from(self.head) + (u64::from(row) + 1) * u64::from(self.row_words);
        record == self.checked && self.bad.is_none() && row < self.count && end <= self.received.into()
    }

    /// Counts a sound record; false where it is not the next one.
    pub(crate) fn accept(&mut self, record: u32) -> bool {
        let is_next = self.is_next(record);
        self.checked += u32::from(is_next);
        self.sealed = self.checked.checked_div(self.patches.into()).unwrap_or(0);
        is_next
    }

    pub(crate) const fn reject(&mut self, fault: Fault) {
        if self.bad.is_none() {
            self.bad = Some(fault);
        }
    }

    /// Whether all words before the rows are there.
    pub(crate) const fn has_head(&self) -> bool {
        self.received >= self.head
    }

    /// Whether a run may begin.
    pub(crate) fn can_begin(&self) -> bool {
        self.sealed >= u32::from(self.window).min(self.count)
    }

    /// The tool is on a pass in this row, the last one that rows were asked for or the one before it: the rows before it are free.
    pub(crate) fn release(&mut self, row: u16) {
        let [before, now] = &self.current;
        let is_ahead = |place: &u32| *place >= self.first;
        let place = before.place(row).filter(is_ahead);
        if let Some(place) = place.or_else(|| now.place(row).filter(is_ahead)) {
            self.first = place;
        }
    }

    /// # Errors
    /// [`FaultKind::WrongState`] where the first rows are overwritten.
    pub(crate) fn rewind(&mut self) -> Result<()> {
        if !self.can_rewind() {
            return Err(Fault::new(
                FaultKind::WrongState,
                crate::math::arith::count_to_f32(self.oldest),
            ));
        }
        self.first = 0;
        self.begin();
        Ok(())
    }

    /// Whether the first rows are there.
    pub(crate) const fn can_rewind(&self) -> bool {
        self.oldest == 0
    }
}

/// A record's words, copied so that they can be checked while the machine goes on.
#[derive(Clone, Copy, Debug)]
pub struct RecordCopy {
    words: [i32; RATIONAL_WORDS],
    is_rational: bool,
    record: u32,
    /// Whether its side boundaries are points as those of the first patch of the row are.
    is_alike: bool,
}

impl RecordCopy {
    pub(crate) fn new(record: u32, words: &[i32], first: &[i32]) -> Self {
        let points = |words| {
            let (_, _, edges, _) = split_patch(words);
            (edges.side_start, edges.side_end)
        };
        let mut copy = Self {
            words: [0; RATIONAL_WORDS],
            is_rational: words.len() == RATIONAL_WORDS,
            record,
            is_alike: points(words) == points(first),
        };
        for (slot, word) in copy.words.iter_mut().zip(words) {
            *slot = *word;
        }
        copy
    }

    /// The checks of [`crate::Interpolator::load_check`].
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`] with the record's index.
    pub fn check(&self) -> Result<()> {
        let is_sound = if self.is_rational {
            RationalRecord::check(&self.words).is_ok()
        } else {
            self.words
                .first_chunk::<POLYNOMIAL_WORDS>()
                .is_some_and(|words| PolynomialRecord::check(words).is_ok())
        };
        if is_sound && self.is_alike {
            Ok(())
        } else {
            Err(bad_patch(self.record))
        }
    }
}
