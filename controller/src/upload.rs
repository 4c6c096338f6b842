//! Upload of a job: checks order, completeness and digest.

use interp_core::{fault::Fault, job::Header};
use protocol::{digest::Digest, message::Reason};

use crate::machine::Machine;

/// The upload under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Upload {
    words: u32,
    received: u32,
    wanted: u64,
    digest: Digest,
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
        if words > limit {
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
        })
    }

    /// `JobChunk`. A refusal leaves the upload unchanged.
    pub(crate) fn chunk(
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
        if end > self.words {
            return Err(Reason::TooLong {
                limit: self.words,
                wanted: end,
            });
        }
        machine
            .load_words(offset, words)
            .map_err(|fault| refused(fault, None))?;
        self.digest.words(words);
        self.received = end;
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

    /// `JobEnd`. Ends the upload with either outcome; after a refusal the machine is idle.
    pub(crate) fn finish(self, machine: &mut impl Machine) -> Result<(), Reason> {
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
