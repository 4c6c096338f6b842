//! Jobs that are larger than the board's store: streamed while they run, see [`interp_core::job::stream`].

use interp_core::job::stream::{DIGEST_WORDS, WINDOW_MAX, WINDOW_MIN, head_words, row_words, rows_max};
use interp_core::{Header, STORE_WORDS, front_words};
use job::{Job, JobError};
use protocol::digest::Digest;

use super::Prepared;

/// Patches of a job at most: their words, and the time in which they are placed and prepared, stay within reason.
pub const PATCHES_MAX: usize = 65_536;

/// The job, streamed where it does not fit into the board's store.
///
/// # Errors
/// It can be neither stored nor streamed, with the remedy.
pub(super) fn fit(job: &Job, prepared: Prepared) -> Result<Prepared, JobError> {
    let stored = prepared.words.len() + front_words(&prepared.header).unwrap_or(0);
    if stored <= STORE_WORDS {
        return Ok(prepared);
    }
    let patches = prepared.patches();
    let no = |key: &str, what: &str, remedy: &str| {
        let what = format!(
            "the surface takes {patches} patches, more than the board's store holds at once, and {what}"
        );
        Err(job.origin.error(key, what, remedy))
    };
    if prepared.header.spacing.is_constant() {
        return no(
            "cut.spacing",
            "passes of constant scallop height need all of them at once",
            "write spacing = \"exact\", use fewer knots, or cut the part into several jobs",
        );
    }
    if prepared.header.edges > 0 {
        return no(
            "region",
            "a region needs all of them at once",
            "remove the section, use fewer knots, or cut the part into several jobs",
        );
    }
    if job.overrun_mm > 0.0 {
        return no(
            "cut.overrun_mm",
            "the tool has to be able to wait for the next ones at the end of each pass",
            "remove `overrun_mm`, use fewer knots, or cut the part into several jobs",
        );
    }
    let header = Header {
        window: WINDOW_MIN,
        ..prepared.header
    };
    let rows = rows_max(&header, STORE_WORDS);
    if rows < WINDOW_MIN.into() {
        let what = format!(
            "{} of them lie along a pass: the store holds {rows} such rows, and {WINDOW_MIN} are needed",
            prepared.path.spans()
        );
        return no(
            "surface",
            &what,
            "give the other direction with `along`, use fewer knots, or cut the part into several jobs",
        );
    }
    let window = u16::try_from(rows).unwrap_or(u16::MAX).min(WINDOW_MAX);
    Ok(streamed(&prepared, window))
}

/// The job in the form in which it is streamed, with a window of this number of rows.
#[must_use]
pub fn streamed(prepared: &Prepared, window: u16) -> Prepared {
    let mut job = prepared.clone();
    let row = row_words(&prepared.header);
    let (head, rows) = prepared.words.split_at(head_words(&prepared.header));
    job.header.window = window;
    job.words = head.to_vec();
    job.words
        .reserve(rows.len() + DIGEST_WORDS * prepared.side.spans());
    let mut digest = Digest::new();
    digest.words(head);
    for row in rows.chunks(row) {
        digest.words(row);
        job.words.extend(row);
        job.words.extend(digest_words(digest.value()));
    }
    job
}

/// The two words of a digest, the low one first.
#[allow(clippy::cast_possible_truncation, reason = "its halves")]
fn digest_words(digest: u64) -> [i32; DIGEST_WORDS] {
    [digest as u32, (digest >> 32) as u32].map(u32::cast_signed)
}
