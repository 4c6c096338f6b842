//! Links from interval to interval of a region: where they begin and end, and the words that tell the board how high each has to go.
//!
//! Passes do not depend on their links, so the job is run once with every link at the safe height, and then given its words.

use interp_core::job::links::{Detour, LINK_HEIGHT_MIN, LINK_STRAIGHT};
use interp_core::{STORE_WORDS, State};

use crate::Machine;
use crate::prepare::Prepared;

/// How a link goes to its pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Link {
    /// Straight, at the feed.
    Straight,
    /// Around what is between, at the feed.
    Around(Detour),
    /// Up to this height of the ball's centre, nm, across, and down.
    Across(i32),
}

/// The ball's centre at the end of each pass and at the start of the next, nm, up to the end of the run or a fault. Empty without axis limits.
#[must_use]
pub fn ends(prepared: &Prepared) -> Vec<[[i32; 3]; 2]> {
    let mut ends = Vec::new();
    if prepared.header.axes.is_none() {
        return ends;
    }
    let Ok(mut machine) = Machine::load(prepared) else {
        return ends;
    };
    let mut last: Option<(u32, [i32; 3])> = None;
    // Of a run that faults the links up to there count.
    let _fault = machine.run(|sample| {
        if sample.state == State::Running {
            if let Some((pass, cl_nm)) = last
                && pass != sample.pass
            {
                ends.push([cl_nm, sample.cl_nm]);
            }
            last = Some((sample.pass, sample.cl_nm));
        }
        true
    });
    ends
}

/// Gives a job the words of its links, the first one that to the second pass: as many as fit into the board's store; the others go at the safe height.
pub fn add(prepared: &mut Prepared, links: &[Link]) {
    let room = STORE_WORDS.saturating_sub(prepared.words.len()).min(links.len());
    let Ok(count) = u16::try_from(room) else {
        return;
    };
    prepared.header.links = count;
    prepared
        .words
        .extend(links.iter().take(room).map(|link| match link {
            Link::Straight => LINK_STRAIGHT,
            Link::Around(detour) => detour.to_word(),
            Link::Across(height_nm) => (*height_nm).max(LINK_HEIGHT_MIN),
        }));
}
