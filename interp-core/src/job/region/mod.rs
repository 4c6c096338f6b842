//! A job's region: the part of the surface that is machined, as the edges of closed polygons in the store, and its intervals on a line of constant side
//! parameter. It is one or more cells, machined one after the other, so that the tool need not cross a hole on each line.
//!
//! Words after the patches, four a record:
//!
//! | record | content |
//! |---|---|
//! | head of a cell | number of its edges, side of its first and of its last line, shortest interval on the path parameter |
//! | each of its edges | side and path at its lower end, side and path at its upper end; sorted by the first |
//!
//! A place on a parameter is an i32: the span in the upper bits, the fraction in the lower [`FRACTION_BITS`]. Edges of constant side are left out. A line meets an
//! edge where lower end <= line < upper end, so that one through a vertex meets one of two edges that pass on and none or both of two that turn back. Between the
//! first crossing and the second, the third and the fourth, ... the line is inside.
//!
//! For passes of constant scallop height a place on the side parameter is a share of all of it, units of 2^-[`FRONT_SIDE_BITS`], counted from the starts of its spans
//! ([`front_side_starts`]), and edges of constant side are among the others: curves cross them. The shortest interval is a place on the path there, too. A cell other than
//! the first whose last line is below its first one is machined backwards; its first line is that of the cell before it, and not passed again.

mod check;
mod scan_line;

use crate::job::Header;
use crate::math::arith::{to_f32, truncated};
use crate::sample::SpanParameter;
pub(crate) use check::RegionCheck;
pub(crate) use scan_line::{BadLine, FirstLine, ScanLine};

/// Bits of the fraction of a place.
pub const FRACTION_BITS: u32 = 21;
const FRACTION_MASK: i32 = (1 << FRACTION_BITS) - 1;
/// Bits of the side parameter as a share of all of it.
pub const FRONT_SIDE_BITS: u32 = 28;
/// Words of an edge, and of the head of a cell.
pub const EDGE_WORDS: usize = 4;
/// Most edges that a line may meet; half as many intervals.
pub const CROSSINGS_MAX: usize = 32;
/// Most spans of a parameter of a surface with a region: the end of the last one is a place, too.
pub const REGION_SPANS_MAX: u16 = 1_023;

/// Edges of a record, for the checks at load.
pub(crate) const EDGES_A_RECORD: u32 = 8;

/// The place at the end of a parameter of this number of spans.
#[must_use]
pub const fn end_of(spans: u16) -> i32 {
    (spans as i32) << FRACTION_BITS
}

/// Where each span of the side parameter begins, as a share of all of it, by the spans' widths: the places of edges are between them.
pub fn front_side_starts(widths: &[f32]) -> impl Iterator<Item = i32> {
    let mut sum = 0.0;
    for width in widths {
        sum += width;
    }
    let mut start = 0_i32;
    widths.iter().map(move |width| {
        let own = start;
        start = start.saturating_add(front_side_width(*width, front_side_scale(sum)));
        own
    })
}

/// Units per unit of the parameter's widths, by their sum.
pub(crate) fn front_side_scale(sum: f32) -> f32 {
    to_f32(1 << FRONT_SIDE_BITS) / sum
}

/// Width of a span other than the last, units of the fronts; the last span has the rest.
pub(crate) fn front_side_width(width: f32, scale: f32) -> i32 {
    truncated(width * scale).max(1)
}

/// An edge, from its lower end upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Edge {
    /// Side parameter at both ends, the lower end first.
    pub side: [i32; 2],
    /// Path parameter at both ends.
    pub path: [i32; 2],
}

impl Edge {
    /// The edge between two vertices for curved passes, which cross edges of constant side, too; none where both are the same.
    #[must_use]
    pub fn for_fronts(a: [i32; 2], b: [i32; 2]) -> Option<Self> {
        let ([a_path, a_side], [b_path, b_side]) = (a, b);
        Self::between(a, b).or((a_path != b_path).then_some(Self {
            side: [a_side, b_side],
            path: [a_path, b_path],
        }))
    }

    /// The edge between two vertices, each a place on the path and one on the side parameter; none where the side is the same.
    #[must_use]
    pub const fn between(a: [i32; 2], b: [i32; 2]) -> Option<Self> {
        let ([a_path, a_side], [b_path, b_side]) = (a, b);
        if a_side < b_side {
            Some(Self {
                side: [a_side, b_side],
                path: [a_path, b_path],
            })
        } else if a_side > b_side {
            Some(Self {
                side: [b_side, a_side],
                path: [b_path, a_path],
            })
        } else {
            None
        }
    }

    /// Its words.
    #[must_use]
    pub const fn to_words(self) -> [i32; EDGE_WORDS] {
        let ([from, to], [path_from, path_to]) = (self.side, self.path);
        [from, path_from, to, path_to]
    }

    /// The edge with these words.
    #[must_use]
    pub const fn from_words([from, path_from, to, path_to]: [i32; EDGE_WORDS]) -> Self {
        Self {
            side: [from, to],
            path: [path_from, path_to],
        }
    }

    /// Whether a line meets it.
    #[must_use]
    pub const fn meets(&self, side: i32) -> bool {
        let [from, to] = self.side;
        from <= side && side < to
    }

    /// Where a line that meets it crosses it, rounded to the nearest place.
    #[must_use]
    pub fn crossing(&self, side: i32) -> i32 {
        let ([from, to], [path_from, path_to]) = (self.side, self.path);
        let apart = i64::from(path_to) - i64::from(path_from);
        if apart == 0 {
            return path_from;
        }
        let whole = i64::from(to) - i64::from(from);
        // Places are below 2^31, so the product is below 2^62.
        let part = (i64::from(side) - i64::from(from)) * apart;
        let half = whole >> 1;
        let rounded = if part < 0 { part - half } else { part + half };
        let moved = rounded.checked_div(whole).unwrap_or(0);
        i32::try_from(i64::from(path_from) + moved).unwrap_or(path_from)
    }

    /// Whether its places are on the surface, and it goes upwards, or for curved passes not downwards.
    pub(crate) const fn is_sound(&self, header: &Header) -> bool {
        let ([from, to], [path_from, path_to]) = (self.side, self.path);
        let (side_end, path_end) = (side_end(header), end_of(header.path_spans));
        0 <= from
            && (from < to || from == to && header.spacing.is_constant())
            && to <= side_end
            && 0 <= path_from
            && path_from <= path_end
            && 0 <= path_to
            && path_to <= path_end
    }
}

/// The end of the side parameter.
const fn side_end(header: &Header) -> i32 {
    if header.spacing.is_constant() {
        1 << FRONT_SIDE_BITS
    } else {
        end_of(header.side_spans)
    }
}

/// A place that a span begins at or that lies within it.
pub(crate) const fn place_from(at: i32) -> SpanParameter {
    SpanParameter {
        span: span_of(at),
        fraction: fraction_of(at),
    }
}

/// A place that a span ends at or that lies within it.
pub(crate) const fn place_to(at: i32) -> SpanParameter {
    if at & FRACTION_MASK == 0 && at > 0 {
        SpanParameter {
            span: span_of(at - 1),
            fraction: u64::MAX,
        }
    } else {
        place_from(at)
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "ten bits of a place that is not negative"
)]
const fn span_of(at: i32) -> u16 {
    (at >> FRACTION_BITS) as u16
}

#[allow(clippy::cast_sign_loss, reason = "masked")]
const fn fraction_of(at: i32) -> u64 {
    ((at & FRACTION_MASK) as u64) << (64 - FRACTION_BITS)
}

/// The place of a parameter, rounded down.
#[allow(clippy::cast_possible_truncation, reason = "the upper bits")]
pub(crate) const fn place_of(at: SpanParameter) -> i32 {
    if at.fraction == u64::MAX {
        end_of(at.span + 1)
    } else {
        ((at.span as i32) << FRACTION_BITS) | (at.fraction >> (64 - FRACTION_BITS)) as i32
    }
}

/// The words of a region: cells, each of a head and edges.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionWords<'a> {
    records: &'a [[i32; EDGE_WORDS]],
}

impl<'a> RegionWords<'a> {
    pub(crate) const fn new(words: &'a [i32]) -> Self {
        Self {
            records: words.as_chunks().0,
        }
    }

    /// The cell whose head is this record; `None` after the last one.
    pub(crate) fn cell(&self, at: u16) -> Option<CellWords<'a>> {
        let (head, rest) = self.records.get(usize::from(at)..)?.split_first()?;
        let [count, ..] = *head;
        Some(CellWords {
            at,
            head: *head,
            edges: rest.get(..usize::try_from(count).ok()?)?,
        })
    }
}

/// The words of a cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CellWords<'a> {
    at: u16,
    head: [i32; EDGE_WORDS],
    edges: &'a [[i32; EDGE_WORDS]],
}

impl CellWords<'_> {
    /// Side of the first line.
    pub(crate) const fn first(&self) -> i32 {
        let [_, first, _, _] = self.head;
        first
    }

    /// Side of the last line.
    pub(crate) const fn last(&self) -> i32 {
        let [_, _, last, _] = self.head;
        last
    }

    /// Shortest interval.
    pub(crate) const fn least(&self) -> i32 {
        let [_, _, _, least] = self.head;
        least
    }

    /// Head of the next cell.
    #[allow(
        clippy::cast_possible_truncation,
        reason = "a region has fewer than 2^16 records"
    )]
    pub(crate) const fn next(&self) -> u16 {
        self.at.saturating_add(1).saturating_add(self.edges.len() as u16)
    }

    /// An edge by its number.
    pub(crate) fn edge(&self, index: u16) -> Option<Edge> {
        self.edges.get(usize::from(index)).copied().map(Edge::from_words)
    }

    /// Whether its lines are in order and on the surface, and the shortest interval has a length.
    pub(super) fn is_sound(&self, header: &Header) -> bool {
        let lines = [self.first(), self.last()];
        let is_ordered = self.first() <= self.last() || (self.at > 0 && header.spacing.is_constant());
        !self.edges.is_empty()
            && self.least() > 0
            && is_ordered
            && lines.iter().all(|line| (0..=side_end(header)).contains(line))
    }
}

#[cfg(test)]
mod tests;
