//! Jobs that are larger than the board's store: streamed while they run, see [`interp_core::job::stream`].

mod strips;

use interp_core::job::region::EDGE_WORDS;
use interp_core::job::stream::{DIGEST_WORDS, WINDOW_MAX, WINDOW_MIN, head_words, row_words, rows_max};
use interp_core::{Header, STORE_WORDS, front_words};
use job::{Job, JobError};
use protocol::digest::Digest;

use super::Prepared;

const CUT: &str = "use fewer knots, or cut the part into several jobs";

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
        let what = if prepared.header.edges > 0 {
            format!(
                "the surface and its region take {stored} words, more than the {STORE_WORDS} that the board's store holds at once, and {what}"
            )
        } else {
            format!(
                "the surface takes {patches} patches, more than the board's store holds at once, and {what}"
            )
        };
        Err(job.origin.error(key, what, format!("{remedy}{CUT}")))
    };
    if prepared.header.spacing.is_constant() {
        return no(
            "cut.spacing",
            "passes of constant scallop height need all of them at once",
            "write spacing = \"exact\", ",
        );
    }
    let header = Header {
        window: WINDOW_MIN,
        ..prepared.header
    };
    let rows = rows_max(&header, STORE_WORDS);
    let has_region = header.edges > 0;
    let beside = if has_region {
        format!(
            " beside the {} words of the region",
            usize::from(header.edges) * EDGE_WORDS
        )
    } else {
        String::new()
    };
    let key = if has_region { "region.loops" } else { "surface" };
    let too_few = |needed: usize, rows: usize| {
        let what = format!(
            "{} of them lie along a pass: the store holds {rows} such rows{beside}, and {needed} are needed",
            prepared.path.spans()
        );
        let loops = if has_region { "simplify the loops, " } else { "" };
        let remedy = format!("give the other direction with `along`, {loops}");
        no(key, &what, &remedy)
    };
    if rows < WINDOW_MIN.into() {
        return too_few(WINDOW_MIN.into(), rows);
    }
    let window = u16::try_from(rows).unwrap_or(u16::MAX).min(WINDOW_MAX);
    if !has_region {
        return Ok(streamed(&prepared, window));
    }
    // Where the passes go to another cell, the rows of both ends of the way have to be there.
    let mut needed = 0;
    for window in [window, (window / 2).max(WINDOW_MIN), WINDOW_MIN] {
        let job = strips::streamed(&prepared, window);
        if job.least_rows <= rows_max(&job.header, STORE_WORDS) {
            return Ok(job);
        }
        needed = job.least_rows;
    }
    too_few(needed, rows)
}

/// The job in the form in which it is streamed, with a window of this number of rows.
#[must_use]
pub fn streamed(prepared: &Prepared, window: u16) -> Prepared {
    if prepared.header.edges > 0 {
        return strips::streamed(prepared, window);
    }
    let rows: Vec<usize> = (0..prepared.side.spans()).collect();
    let header = Header {
        window,
        ..prepared.header
    };
    Prepared {
        least_rows: window.into(),
        ..in_rows(prepared, header, &[], &rows)
    }
}

/// The job with these strips and these rows of its surface, in this order.
fn in_rows(prepared: &Prepared, header: Header, strips: &[i32], rows: &[usize]) -> Prepared {
    let (widths, rest) = prepared.words.split_at(head_words(&prepared.header));
    let row = row_words(&prepared.header);
    let (patches, tail) = rest.split_at(row * prepared.side.spans());
    let mut words = [widths, tail, strips].concat();
    let mut digest = Digest::new();
    digest.words(&words);
    words.reserve((row + DIGEST_WORDS) * rows.len());
    for index in rows {
        let row = &patches[index * row..][..row];
        digest.words(row);
        words.extend(row);
        words.extend(digest_words(digest.value()));
    }
    Prepared {
        header,
        words,
        ..prepared.clone()
    }
}

/// Words of the board's store that a streamed job leaves beside the rows that have to be there at once.
pub(crate) fn spare_words(prepared: &Prepared) -> usize {
    let rows = prepared.least_rows * row_words(&prepared.header);
    STORE_WORDS.saturating_sub(head_words(&prepared.header) + rows)
}

/// Gives a streamed job these words of links, after those of its region, instead of those that it has.
pub(crate) fn set_links(prepared: &mut Prepared, links: &[i32], count: u16) {
    let end = head_words(&prepared.header) - usize::from(prepared.header.strips);
    let first = end - usize::from(prepared.header.links);
    prepared.words.splice(first..end, links.iter().copied());
    prepared.header.links = count;
    let (head, rows) = prepared.words.split_at_mut(head_words(&prepared.header));
    let mut digest = Digest::new();
    digest.words(head);
    for row in rows.chunks_mut(row_words(&prepared.header)) {
        let (patches, end) = row.split_at_mut(row.len() - DIGEST_WORDS);
        digest.words(patches);
        end.copy_from_slice(&digest_words(digest.value()));
    }
}

/// The two words of a digest, the low one first.
#[allow(clippy::cast_possible_truncation, reason = "its halves")]
fn digest_words(digest: u64) -> [i32; DIGEST_WORDS] {
    [digest as u32, (digest >> 32) as u32].map(u32::cast_signed)
}
