//! Upload of a job: checks order, completeness and digest.

use interp_core::{
    fault::{Fault, FaultKind},
    job::{
        Header,
        stream::{DIGEST_WORDS, head_words, row_words},
    },
    region_checks,
};
use protocol::{digest::Digest, message::Reason};

use crate::machine::Machine;

/// The upload under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Upload {
    /// Words announced.
    words: u32,
    /// Words received.
    received: u32,
    /// Digest announced.
    wanted: u64,
    /// Digest of the words received; unused for a streamed job.
    digest: Digest,
    /// The rows of a streamed job.
    rows: Option<Rows>,
}

/// The rows of a streamed job: each is followed by the digest of the words up to it, apart from those of the digests.
#[derive(Clone, Copy, Debug)]
struct Rows {
    /// Words before the first row.
    head: u32,
    /// Words of a row with its digest.
    words: u32,
    /// Patches of a row.
    patches: u32,
    /// Records of the region, which come before the first row.
    edges: u32,
    /// Digest of all words received, without those of digests.
    digest: Digest,
    /// The last row's digest, as far as its words were received.
    announced: u64,
    /// Records checked.
    checked: u32,
}

impl Rows {
    fn new(header: &Header) -> Self {
        let count = |words: usize| u32::try_from(words).unwrap_or(u32::MAX);
        Self {
            head: count(head_words(header)),
            words: count(row_words(header)),
            patches: header.path_spans.into(),
            edges: region_checks(header),
            digest: Digest::new(),
            announced: 0,
            checked: 0,
        }
    }

    /// Takes a word; whether it completes a row.
    fn take(&mut self, at: u32, word: i32) -> bool {
        let within = at
            .checked_sub(self.head)
            .and_then(|after| after.checked_rem(self.words));
        let left = self.words - within.unwrap_or(0);
        #[allow(clippy::cast_possible_truncation, reason = "2")]
        if within.is_some() && left <= DIGEST_WORDS as u32 {
            self.announced = (self.announced >> 32) | u64::from(word.cast_unsigned()) << 32;
        } else {
            self.digest.words(&[word]);
        }
        within.is_some() && left == 1
    }

    /// Checks a row that is complete, a record at a time, so that a run is not delayed by more than a copy.
    #[inline(never)]
    fn check(&mut self, machine: &mut impl Machine) -> Result<(), Reason> {
        if self.digest.value() != self.announced {
            #[allow(clippy::cast_precision_loss, reason = "a report; at most 2^20")]
            let bad = Fault::new(FaultKind::BadPatch, self.checked as f32);
            // It returns the same fault.
            let _ = machine.load_judged(self.checked, Err(bad));
            return Err(Reason::WrongDigest {
                wanted: self.announced,
                received: self.digest.value(),
            });
        }
        while self.checked < self.edges {
            let record = self.checked;
            machine
                .load_check(record)
                .map_err(|fault| refused(fault, Some(record)))?;
            self.checked += 1;
        }
        for _ in 0..self.patches {
            check_patch(machine, self.checked)?;
            self.checked += 1;
        }
        Ok(())
    }
}

/// Checks a patch of a streamed job. Not inlined: its copy would take stack beside the checks of edges.
#[inline(never)]
fn check_patch(machine: &mut impl Machine, record: u32) -> Result<(), Reason> {
    let checked = machine.load_copy(record).and_then(|copy| copy.check());
    machine
        .load_judged(record, checked)
        .map_err(|fault| refused(fault, Some(record)))
}

/// The core's fault as the reason of a `Nak`.
fn refused(fault: Fault, record: Option<u32>) -> Reason {
    Reason::Job {
        fault: fault.into(),
        record,
    }
}

/// Refuses while a run is under way.
fn check_state(machine: &mut impl Machine) -> Result<(), Reason> {
    let state = machine.status().state;
    if state.is_under_way() {
        Err(Reason::WrongState { state })
    } else {
        Ok(())
    }
}

impl Upload {
    /// `JobBegin`. A refusal leaves machine and upload unchanged.
    pub(crate) fn begin(
        machine: &mut impl Machine,
        header: &Header,
        words: u32,
        wanted: u64,
    ) -> Result<Self, Reason> {
        check_state(machine)?;
        let limit = machine.description().store_words;
        let rows = (header.window > 0).then(|| Rows::new(header));
        if words > limit && rows.is_none() {
            return Err(Reason::TooLong { limit, wanted: words });
        }
        machine
            .load_begin(header, words)
            .map_err(|fault| refused(fault, None))?;
        Ok(Self {
            words,
            received: 0,
            wanted,
            digest: Digest::new(),
            rows,
        })
    }

    /// Whether the job is loaded while it runs.
    pub(crate) const fn is_streamed(&self) -> bool {
        self.rows.is_some()
    }

    /// `JobChunk`. A refusal leaves the upload unchanged, unless it is that of a row of a streamed job.
    pub(crate) fn chunk(
        &mut self,
        machine: &mut impl Machine,
        offset: u32,
        words: &[i32],
    ) -> Result<(), Reason> {
        self.take(machine, offset, words)?;
        let Some(rows) = &mut self.rows else {
            return Ok(());
        };
        for (at, word) in (offset..).zip(words) {
            if rows.take(at, *word) {
                rows.check(machine)?;
            }
        }
        Ok(())
    }

    /// Takes the next words of a job, without a look at the rows of a streamed one.
    pub(crate) fn take(
        &mut self,
        machine: &mut impl Machine,
        offset: u32,
        words: &[i32],
    ) -> Result<(), Reason> {
        if offset != self.received {
            return Err(Reason::WrongOffset {
                expected: self.received,
            });
        }
        let length = u32::try_from(words.len()).unwrap_or(u32::MAX);
        let end = offset.saturating_add(length);
        let limit = if self.is_streamed() {
            let [_, room] = machine.load_room();
            room
        } else {
            self.words
        };
        if end > limit {
            return Err(Reason::TooLong { limit, wanted: end });
        }
        machine
            .load_words(offset, words)
            .map_err(|fault| refused(fault, None))?;
        self.received = end;
        if self.rows.is_none() {
            self.digest.words(words);
        }
        Ok(())
    }

    /// `JobEnd` before the checks: whether all words were received. After a refusal the upload may continue.
    pub(crate) const fn check_complete(&self) -> Result<(), Reason> {
        if self.received == self.words {
            Ok(())
        } else {
            Err(Reason::Incomplete {
                wanted: self.words,
                received: self.received,
            })
        }
    }

    /// `JobEnd`. Ends the upload with either outcome; after a refusal the machine is idle. That of a streamed job goes on, and its rows are checked already.
    pub(crate) fn finish(&self, machine: &mut impl Machine) -> Result<(), Reason> {
        if self.is_streamed() {
            return machine.load_finish().map_err(|fault| refused(fault, None));
        }
        let received = self.digest.value();
        if received != self.wanted {
            return Err(Reason::WrongDigest {
                wanted: self.wanted,
                received,
            });
        }
        for record in 0..machine.load_records() {
            machine
                .load_check(record)
                .map_err(|fault| refused(fault, Some(record)))?;
        }
        machine.load_finish().map_err(|fault| refused(fault, None))
    }
}
