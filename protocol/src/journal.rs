//! The journal of a run: how far it came, kept beyond a power cut.

use interp_core::{RunStart, SpanParameter, job::Header};
use serde::{Deserialize, Serialize};

use crate::{codes, frame::crc32, records::HeaderFields};

/// How far the last run of a job with axis limits came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Journal {
    /// [`job_mark`] of the job.
    #[serde(with = "postcard::fixint::le")]
    pub job: u64,
    /// [`crate::message::Profile::digest`] of the profile that it ran under; 0: none.
    #[serde(with = "postcard::fixint::le")]
    pub profile: u32,
    /// The first pass that is not complete.
    #[serde(with = "postcard::fixint::le")]
    pub pass: u32,
    /// The run came to its end.
    pub is_finished: bool,
    /// Path parameter of a place on that pass up to which it is complete; [`SpanParameter::NONE`]: its start.
    #[serde(with = "codes::span_parameter")]
    pub path: SpanParameter,
}

/// Bytes of a [`Journal`], at most.
pub const JOURNAL_BYTES: usize = 28;

impl Journal {
    /// The journal as bytes.
    #[must_use]
    pub fn write(&self) -> [u8; JOURNAL_BYTES] {
        let mut bytes = [0; JOURNAL_BYTES];
        // It has a fixed length, which a test holds.
        let _ = postcard::to_slice(self, &mut bytes);
        bytes
    }

    /// Where a run of the job goes on.
    #[must_use]
    pub const fn start(&self) -> RunStart {
        RunStart {
            pass: self.pass,
            path: self.path,
        }
    }

    /// Reads what [`Self::write`] has written.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        postcard::from_bytes(bytes).ok()
    }
}

/// Bytes of a header on the wire, at most.
const HEADER_MAX: usize = 192;

#[derive(Serialize)]
struct Head(#[serde(with = "HeaderFields")] Header);

/// A mark of a job: its header and the digest of its words. Apart from its home, its end and its safe height, which a job without them takes from where the axes stand: its passes are
/// the same from anywhere.
#[must_use]
#[inline(never)]
pub fn job_mark(header: &Header, words_digest: u64) -> u64 {
    let mut bytes = [0; HEADER_MAX];
    let mut header = *header;
    if let Some(axes) = &mut header.axes {
        (axes.home_nm, axes.end_nm) = ([0; 3], None);
        (axes.safe_z_nm, axes.end_height_nm) = (0, 0);
    }
    let crc = postcard::to_slice(&Head(header), &mut bytes).map_or(0, |bytes| crc32(bytes));
    words_digest ^ u64::from(crc) << 16
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_is_read_as_it_was_written() {
        let journal = Journal {
            job: u64::MAX - 1,
            profile: 7,
            pass: 1 << 31,
            is_finished: true,
            path: SpanParameter {
                span: u16::MAX,
                fraction: u64::MAX - 2,
            },
        };
        assert_eq!(Journal::read(&journal.write()), Some(journal));
        assert_eq!(Journal::read(&[0; 3]), None);
    }

    #[test]
    fn a_mark_tells_headers_and_words() {
        let one = Header::default();
        let other = Header {
            feed_mm_s: one.feed_mm_s + 1.0,
            ..one
        };
        assert_eq!(job_mark(&one, 5), job_mark(&one, 5));
        assert_ne!(job_mark(&one, 5), job_mark(&other, 5));
        assert_ne!(job_mark(&one, 5), job_mark(&one, 6));
    }
}
