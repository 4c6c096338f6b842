//! Jobs that are larger than the store: loaded while they run, row by row.
//!
//! A row is the patches of one side span. Passes only go forward in the side parameter, so the store keeps a ring of rows: the one that the tool is on
//! and as many after it as fit. The widths of all spans stay at its start. A row is followed by [`DIGEST_WORDS`] words, the digest of the job's words up to it
//! (apart from those of the digests), low word first; the core does not read them.
//!
//! **The window.** [`Header::window`] is the number of rows that is certain to be in the ring: it belongs to the job, so that the passes do not depend on the
//! ring's size. What is planned for a pass looks at rows up to `window - 1`
//! after the first one that is needed then: the pass's own, that of the pass before, or, where the tool goes along the boundary from one to the other, that of the pass before
//! that (`pass/row_history.rs`). Where an interval reaches farther it is cut short: none whose three times are in a row.
//!
//! **Waiting.** The planning of a pass begins only when the rows that it needs are checked. Until then the whole machine stands still at the end of the last
//! pass but one, or above it: neither tool nor planning goes on, and the tick is not counted. So the samples are those of a job that was loaded before.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::{bad_patch, record_words};
use crate::job::{Header, width_words};
use crate::surface::{POLYNOMIAL_WORDS, PolynomialRecord, RATIONAL_WORDS, RationalRecord, split_patch};

/// Words of the digest behind a row.
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
    width_words(header.path_spans, header.side_spans) as usize
}

/// Rows of a streamed job that a store of this size keeps.
#[must_use]
pub fn rows_max(header: &Header, store_words: usize) -> usize {
    store_words
        .saturating_sub(head_words(header))
        .checked_div(row_words(header))
        .unwrap_or(0)
}

/// The ring of rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    /// Words before the rows and of a row, rows in the ring and of the job, patches of a row, and the window.
    head: u32,
    row_words: u32,
    slots: u32,
    count: u16,
    patches: u16,
    window: u16,
    /// The row of the tool.
    first: u16,
    /// Words received, and records checked.
    received: u32,
    checked: u32,
    /// Why the next record is not sound.
    bad: Option<Fault>,
}

impl Rows {
    /// No job.
    pub(crate) const NONE: Self = Self {
        head: 0,
        row_words: 0,
        slots: 1,
        count: 0,
        patches: 0,
        window: 0,
        first: 0,
        received: 0,
        checked: 0,
        bad: None,
    };

    /// No rows yet, of a job in a store of this capacity.
    pub(crate) fn new(header: &Header, capacity: usize) -> Self {
        let count = |words: usize| u32::try_from(words).unwrap_or(u32::MAX);
        let slots = if header.window > 0 {
            count(rows_max(header, capacity)).clamp(1, header.side_spans.max(1).into())
        } else {
            header.side_spans.max(1).into()
        };
        Self {
            head: count(head_words(header)),
            row_words: count(row_words(header)),
            slots,
            count: header.side_spans,
            patches: header.path_spans,
            window: header.window,
            ..Self::NONE
        }
    }

    /// Words of the store for the least number of rows.
    pub(crate) fn least_words(&self) -> u64 {
        u64::from(self.head) + u64::from(self.window.min(self.count)) * u64::from(self.row_words)
    }

    /// First word of a row in the store, if it is the row that is there or will be.
    #[inline(always)]
    pub(crate) fn start(&self, row: usize) -> Option<usize> {
        let slot = u32::try_from(row).ok()?.checked_rem(self.slots)?;
        Some((self.head + slot * self.row_words) as usize)
    }

    pub(crate) const fn received(&self) -> u32 {
        self.received
    }

    /// Words up to which there is room: all rows before that of the tool may be overwritten.
    pub(crate) fn limit(&self) -> u32 {
        let rows = u32::from(self.first).saturating_add(self.slots);
        self.head.saturating_add(rows.saturating_mul(self.row_words))
    }

    /// Rows that are complete and checked.
    fn sealed(&self) -> u32 {
        self.checked.checked_div(self.patches.into()).unwrap_or(0)
    }

    /// Stores words behind those received.
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
                Some(behind) => {
                    let row = behind.checked_div(self.row_words).unwrap_or(0);
                    let within = behind.checked_rem(self.row_words).unwrap_or(0);
                    self.start(row as usize).map(|start| start + within as usize)
                }
            };
            if let Some(slot) = place.and_then(|place| store.get_mut(place)) {
                *slot = *word;
            }
            self.received += 1;
        }
        Ok(())
    }

    /// Whether a record is the next to be checked, and complete with the digest of its row.
    pub(crate) fn is_next(&self, record: u32) -> bool {
        let row = record.checked_div(self.patches.into()).unwrap_or(0);
        let end = u64::from(self.head) + (u64::from(row) + 1) * u64::from(self.row_words);
        record == self.checked && self.bad.is_none() && row < self.count.into() && end <= self.received.into()
    }

    /// Counts a sound record; false where it is not the next one.
    pub(crate) fn accept(&mut self, record: u32) -> bool {
        let is_next = self.is_next(record);
        self.checked += u32::from(is_next);
        is_next
    }

    pub(crate) const fn reject(&mut self, fault: Fault) {
        if self.bad.is_none() {
            self.bad = Some(fault);
        }
    }

    /// Whether a run may begin.
    pub(crate) fn can_begin(&self) -> bool {
        self.sealed() >= self.window.min(self.count).into()
    }

    /// Whether a row, and those before it down to that of the tool, are there.
    ///
    /// # Errors
    /// The row is not sound.
    pub(crate) fn has(&self, row: u16) -> Result<bool> {
        if u32::from(row) < self.sealed() {
            return Ok(true);
        }
        self.bad.map_or(Ok(false), Err)
    }

    pub(crate) const fn release(&mut self, row: u16) {
        if row > self.first {
            self.first = row;
        }
    }

    /// # Errors
    /// [`FaultKind::WrongState`] where the first rows are overwritten.
    pub(crate) fn rewind(&mut self) -> Result<()> {
        if !self.can_rewind() {
            return Err(Fault::new(FaultKind::WrongState, f32::from(self.first)));
        }
        self.first = 0;
        Ok(())
    }

    /// Whether the first rows are there.
    pub(crate) fn can_rewind(&self) -> bool {
        let behind = self.received.saturating_sub(self.head);
        behind.div_ceil(self.row_words.max(1)) <= self.slots
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
