//! Links from interval to interval of a region: where they begin and end, and the words that tell the board how high each has to go.
//!
//! Passes do not depend on their links, so the job is run once with every link at the safe height, and then given its words.

use interp_core::job::links::{Detour, LINK_HEIGHT_MIN, LINK_STRAIGHT};
use interp_core::{STORE_WORDS, State, front_words};

use crate::Machine;
use crate::prepare::{Prepared, stream};

/// How a link goes to its pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// Straight, at the feed.
    Straight,
    /// Around the obstacle between the passes, at the feed.
    Around(Detour),
    /// Up to this height of the ball's centre, nm, across, and down.
    Across(i32),
}

/// The ball's centre at the start and at the end of each pass, nm, up to the end of the run or a fault. Empty without axis limits.
#[must_use]
pub fn passes(prepared: &Prepared) -> Vec<[[i32; 3]; 2]> {
    let mut passes: Vec<[[i32; 3]; 2]> = Vec::new();
    if prepared.header.axes.is_none() {
        return passes;
    }
    let Ok(mut machine) = Machine::load(prepared) else {
        return passes;
    };
    let mut present = None;
    // Of a run that faults the passes up to there count.
    let _fault = machine.run(|sample| {
        if sample.state == State::Running {
            match passes.last_mut() {
                Some([_, end]) if present == Some(sample.pass) => *end = sample.cl_nm,
                _ => passes.push([sample.cl_nm; 2]),
            }
            present = Some(sample.pass);
        }
        true
    });
    passes
}

/// The end of each pass and the start of the next.
#[must_use]
pub fn between<T: Copy>(passes: &[[T; 2]]) -> Vec<[T; 2]> {
    let pairs = passes.windows(2);
    pairs.map(|pair| [pair[0][1], pair[1][0]]).collect()
}

/// Gives a job the words of its links, the first one that to the second pass: as many as fit into the board's store; the others go at the safe height.
pub fn add(prepared: &mut Prepared, links: &[Link]) {
    let is_streamed = prepared.header.window > 0;
    let spare = if is_streamed {
        stream::spare_words(prepared)
    } else {
        let stations = front_words(&prepared.header).unwrap_or(0);
        STORE_WORDS.saturating_sub(prepared.words.len() + stations)
    };
    let words = links.iter().take(spare).map(|link| match link {
        Link::Straight => LINK_STRAIGHT,
        Link::Around(detour) => detour.to_word(),
        Link::Across(height_nm) => (*height_nm).max(LINK_HEIGHT_MIN),
    });
    let words: Vec<i32> = words.collect();
    let Ok(count) = u16::try_from(words.len()) else {
        return;
    };
    set(prepared, &words, count);
}

/// Takes the words of its links from a job, which then goes at the safe height.
pub fn remove(prepared: &mut Prepared) {
    set(prepared, &[], 0);
}

fn set(prepared: &mut Prepared, words: &[i32], count: u16) {
    if prepared.header.window > 0 {
        return stream::set_links(prepared, words, count);
    }
    let after = prepared.words.len() - usize::from(prepared.header.links);
    prepared.words.truncate(after);
    prepared.words.extend(words);
    prepared.header.links = count;
}
