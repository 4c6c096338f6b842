//! The rows of a region in the order in which its passes need them: found by running the job on the core once, with every row at hand.

use interp_core::Header;
use interp_core::job::region::FRACTION_BITS;
use interp_core::job::stream::{RowsNeeded, Strip};

use crate::Machine;
use crate::prepare::Prepared;

/// The job in the form in which it is streamed.
pub(super) fn streamed(prepared: &Prepared, window: u16) -> Prepared {
    let all = all_rows(prepared, window);
    let needed = Machine::load(&all).map_or(Vec::new(), |mut machine| machine.rows_needed());
    let strips = Strips::new(prepared, window, &needed);
    Prepared {
        least_rows: strips.least(&needed).max(window.into()),
        ..strips.job(prepared, window)
    }
}

/// The job with every row for each cell.
fn all_rows(prepared: &Prepared, window: u16) -> Prepared {
    let all = Strip {
        first: 0,
        rows: prepared.header.side_spans,
    };
    Strips(vec![all; heads(prepared).count()]).job(prepared, window)
}

/// The side of the first line of each cell.
fn heads(prepared: &Prepared) -> impl Iterator<Item = i32> + '_ {
    let header = &prepared.header;
    let region = prepared.words.len() - usize::from(header.links) - 4 * usize::from(header.edges);
    let (records, _) = prepared.words[region..].as_chunks::<4>();
    let mut at = 0;
    std::iter::from_fn(move || {
        let [count, first, ..] = *records.get(at)?;
        at += 1 + usize::try_from(count).ok()?;
        (at <= header.edges.into()).then_some(first)
    })
}

/// Strips of rows, in the order of the job.
struct Strips(Vec<Strip>);

impl Strips {
    /// Those that hold the rows that each pass after the first one needs.
    fn new(prepared: &Prepared, window: u16, needed: &[RowsNeeded]) -> Self {
        let end = prepared.header.side_spans - 1;
        let first = heads(prepared).next().unwrap_or(0) >> FRACTION_BITS;
        let first = u16::try_from(first).unwrap_or(0).min(end);
        let mut strips = vec![[first, first.saturating_add(window - 1).min(end)]];
        for needed in needed {
            let last = needed.last.min(end);
            // What lies beyond a gap is a strip of its own only where the core's window begins anew.
            let most = needed.before.saturating_add(window - 1);
            match strips.last_mut() {
                Some([_, after]) if needed.own >= needed.before && needed.own <= most.max(*after + 1) => {
                    *after = last.max(*after);
                }
                _ => strips.push([needed.own, last]),
            }
        }
        let strip = |[first, last]: [u16; 2]| Strip {
            first,
            rows: last - first + 1,
        };
        Self(strips.into_iter().map(strip).collect())
    }

    /// Rows that have to be there at once.
    fn least(&self, needed: &[RowsNeeded]) -> usize {
        let (mut number, mut at, mut first) = (0, 0, 0);
        let mut least = 0;
        for needed in needed {
            let place = |at: usize, number: usize, row: u16| {
                let strip: Option<&Strip> = self.0.get(number);
                at + usize::from(strip.and_then(|strip| strip.index(row)).unwrap_or(0))
            };
            let after = needed.after.map(|row| place(at, number, row));
            if needed.own < needed.before || self.0[number].index(needed.own).is_none() {
                at += usize::from(self.0[number].rows);
                number = (number + 1).min(self.0.len() - 1);
            }
            first = after.unwrap_or_else(|| place(at, number, needed.own)).max(first);
            let last = needed.last.min(self.0[number].first + self.0[number].rows - 1);
            least = least.max(place(at, number, last) + 1 - first);
        }
        least
    }

    /// The job with these rows.
    fn job(&self, prepared: &Prepared, window: u16) -> Prepared {
        let header = Header {
            window,
            strips: u16::try_from(self.0.len()).unwrap_or(u16::MAX),
            ..prepared.header
        };
        let words: Vec<i32> = self.0.iter().map(|strip| strip.to_word()).collect();
        let rows: Vec<usize> = (self.0.iter())
            .flat_map(|strip| usize::from(strip.first)..usize::from(strip.first + strip.rows))
            .collect();
        super::in_rows(prepared, header, &words, &rows)
    }
}
