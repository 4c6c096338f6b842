//! A job's region: the part of the surface that is machined, as the edges of closed polygons in the store, and its intervals on a line of constant side
//! parameter. It is one or more cells, machined one after the other, so that the tool need not cross a hole on each line.
//!
//! Words behind the patches, four a record:
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
//! ([`front_side_starts`]), and edges of constant side are among the others: curves cross them. The shortest interval is a place on the path there, too.

use crate::job::Header;
use crate::math::arith::{to_f32, truncated};
use crate::sample::SpanParameter;

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
/// Edges that are taken in, and that are met, in a portion of the planning.
const TAKEN: u16 = 32;
const MET: u8 = 2;
/// Portions of a line whose edges are taken in.
const PORTIONS_MAX: usize = CROSSINGS_MAX / MET as usize + 2;

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

/// Width of a span other than the last, whose width is what is left.
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

    /// The cell whose head is this record; `None` behind the last one.
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
    fn is_sound(&self, header: &Header) -> bool {
        !self.edges.is_empty()
            && self.least() > 0
            && 0 <= self.first()
            && self.first() <= self.last()
            && self.last() <= side_end(header)
    }
}

/// The next task on a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Drop the edges that end at the line or below it.
    Drop,
    /// Take in those that begin below it or at it.
    TakeIn,
    /// Find where the line meets the edge with this number in the list.
    Meet(u8),
    /// Keep the intervals that are long enough.
    Keep,
    /// The line is known.
    Done,
}

/// A region has more edges at a line than there is room for, or an odd number of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BadLine;

/// A line of constant side parameter that goes over a cell from its first line to its last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScanLine {
    task: Task,
    side: i32,
    /// The line before.
    before: i32,
    /// Edges that were taken in so far, and those of them that the line meets.
    taken: u16,
    active: [u16; CROSSINGS_MAX],
    count: u8,
    /// Where the line meets them, ascending; then the ends of the intervals.
    crossings: [i32; CROSSINGS_MAX],
    met: u8,
    /// Whether the region reaches from the line before to this one along the boundary at the start of the path parameter, and at its end.
    joins: [bool; 2],
}

impl ScanLine {
    /// Before the first line.
    pub(crate) const START: Self = Self {
        task: Task::Drop,
        side: 0,
        before: i32::MIN,
        taken: 0,
        active: [0; CROSSINGS_MAX],
        count: 0,
        crossings: [0; CROSSINGS_MAX],
        met: 0,
        joins: [false; 2],
    };

    /// Goes back to the first line of the first cell: its edges are known from the checks at load.
    pub(crate) fn restart(&mut self, first: &FirstLine) {
        self.side = first.side;
        self.before = i32::MIN;
        self.taken = first.taken;
        self.active = first.active;
        self.count = first.count;
        self.met = 0;
        self.joins = [false; 2];
        self.task = Task::Meet(0);
    }

    /// Goes to a line of another cell, or to one that does not go on from the last one; the region may reach there from `before`.
    pub(crate) const fn begin(&mut self, side: i32, before: i32) {
        self.taken = 0;
        self.count = 0;
        self.go_on(side, true);
        self.before = before;
    }

    /// Begins with the crossings of a curve, which [`Self::insert`] takes.
    pub(crate) const fn begin_curve(&mut self) {
        self.met = 0;
        self.joins = [false; 2];
        self.task = Task::Done;
    }

    /// The region reaches from the pass before to this one along a boundary of the path parameter: at its start, or at its end.
    pub(crate) const fn join(&mut self, [is_near, is_far]: [bool; 2]) {
        let [near, far] = self.joins;
        self.joins = [near || is_near, far || is_far];
    }

    /// The whole rest of the work on a line whose edges are taken in.
    pub(crate) fn finish(&mut self, cell: &CellWords<'_>, path_end: i32) -> Result<(), BadLine> {
        for _ in 0..PORTIONS_MAX {
            self.work(cell, path_end)?;
        }
        Ok(())
    }

    /// Goes on to a line further up. `skips`: this one is left out, and does not count as the line before.
    pub(crate) const fn go_on(&mut self, side: i32, skips: bool) {
        if !skips {
            self.before = self.side;
        }
        self.side = side;
        self.met = 0;
        self.joins = [false; 2];
        self.task = Task::Drop;
    }

    /// Side of the line.
    pub(crate) const fn side(&self) -> i32 {
        self.side
    }

    /// Whether the line is known.
    pub(crate) fn is_done(&self) -> bool {
        self.task == Task::Done
    }

    /// Whether the region reaches from the line before to this one along the path parameter's boundaries.
    pub(crate) const fn joins(&self) -> [bool; 2] {
        self.joins
    }

    /// Intervals of the line.
    pub(crate) const fn intervals(&self) -> u8 {
        self.met / 2
    }

    /// Ends of an interval, ascending.
    pub(crate) fn interval(&self, index: u8) -> Option<[i32; 2]> {
        if index >= self.intervals() {
            return None;
        }
        let (pairs, _) = self.crossings.as_chunks::<2>();
        pairs.get(usize::from(index)).copied()
    }

    /// The side at which the region begins again, where the line is above one part of it and below the next.
    pub(crate) fn begins_again(&self, cell: &CellWords<'_>) -> Option<i32> {
        if self.count > 0 {
            return None;
        }
        let [from, _] = cell.edge(self.taken)?.side;
        Some(from)
    }

    /// One portion of the work on a line.
    ///
    /// # Errors
    /// The line meets too many edges, or an odd number of them.
    #[inline(never)]
    pub(crate) fn work(&mut self, cell: &CellWords<'_>, path_end: i32) -> Result<(), BadLine> {
        self.task = match self.task {
            Task::Drop => {
                self.drop_passed(cell);
                Task::TakeIn
            }
            Task::TakeIn => {
                if self.take_in(cell)? {
                    Task::TakeIn
                } else {
                    Task::Meet(0)
                }
            }
            Task::Meet(index) => {
                let end = index.saturating_add(MET).min(self.count);
                for index in index..end {
                    let number = self.active.get(usize::from(index)).copied().unwrap_or(0);
                    if let Some(edge) = cell.edge(number) {
                        self.meet(&edge, path_end)?;
                    }
                }
                if end < self.count {
                    Task::Meet(end)
                } else {
                    Task::Keep
                }
            }
            Task::Keep => {
                self.keep(cell.least())?;
                Task::Done
            }
            Task::Done => Task::Done,
        };
        Ok(())
    }

    /// Drops the edges that the line does not meet any more.
    fn drop_passed(&mut self, cell: &CellWords<'_>) {
        let mut kept = 0_u8;
        for index in 0..self.count {
            let number = self.active.get(usize::from(index)).copied().unwrap_or(0);
            let is_met = cell.edge(number).is_some_and(|edge| edge.meets(self.side));
            if is_met && let Some(place) = self.active.get_mut(usize::from(kept)) {
                *place = number;
                kept += 1;
            }
        }
        self.count = kept;
    }

    /// Takes in a portion of edges; returns whether more of them may be due.
    fn take_in(&mut self, cell: &CellWords<'_>) -> Result<bool, BadLine> {
        for _ in 0..TAKEN {
            let Some(edge) = cell.edge(self.taken) else {
                return Ok(false);
            };
            let [from, _] = edge.side;
            if from > self.side {
                return Ok(false);
            }
            self.take(&edge)?;
        }
        Ok(true)
    }

    /// Takes in the next edge, which begins below the line or at it.
    fn take(&mut self, edge: &Edge) -> Result<(), BadLine> {
        if edge.meets(self.side) {
            let place = self.active.get_mut(usize::from(self.count)).ok_or(BadLine)?;
            *place = self.taken;
            self.count += 1;
        }
        self.taken += 1;
        Ok(())
    }

    /// Inserts the crossing with an edge.
    fn meet(&mut self, edge: &Edge, path_end: i32) -> Result<(), BadLine> {
        let at = edge.crossing(self.side);
        let ([from, _], [path_from, path_to]) = (edge.side, edge.path);
        if path_from == path_to && from <= self.before {
            self.join([at == 0, at == path_end]);
        }
        self.insert(at)
    }

    /// Inserts a crossing.
    ///
    /// # Errors
    /// There is no room for it.
    pub(crate) fn insert(&mut self, at: i32) -> Result<(), BadLine> {
        let mut place = usize::from(self.met);
        if place >= CROSSINGS_MAX {
            return Err(BadLine);
        }
        while place > 0 {
            let before = self.crossings.get(place - 1).copied().unwrap_or(i32::MIN);
            if before <= at {
                break;
            }
            if let Some(to) = self.crossings.get_mut(place) {
                *to = before;
            }
            place -= 1;
        }
        if let Some(to) = self.crossings.get_mut(place) {
            *to = at;
        }
        self.met += 1;
        Ok(())
    }

    /// Joins intervals that meet, and keeps those that are at least this long.
    ///
    /// # Errors
    /// Their number is odd.
    pub(crate) fn keep(&mut self, least: i32) -> Result<(), BadLine> {
        if self.met % 2 == 1 {
            return Err(BadLine);
        }
        let mut kept = 0_u8;
        let mut open: Option<[i32; 2]> = None;
        for index in 0..=self.intervals() {
            let next = self.interval(index);
            open = match (open, next) {
                (Some([from, to]), Some([begins, ends])) if begins == to => Some([from, ends]),
                (Some([from, to]), _) => {
                    let (pairs, _) = self.crossings.as_chunks_mut::<2>();
                    if to - from >= least
                        && let Some(pair) = pairs.get_mut(usize::from(kept))
                    {
                        *pair = [from, to];
                        kept += 1;
                    }
                    next
                }
                (None, _) => next,
            };
        }
        self.met = 2 * kept;
        Ok(())
    }
}

/// The first line of the first cell: its side, the edges up to there, and those that it meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FirstLine {
    side: i32,
    taken: u16,
    count: u8,
    active: [u16; CROSSINGS_MAX],
}

/// The checks of a region at load, record after record. They find the first line on the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionCheck {
    first: FirstLine,
    /// Head of the cell that is checked.
    cell: u16,
    /// Lower end of the last edge.
    before: i32,
    /// Combination of all ends that is 0 where each occurs an even number of times.
    parity: u32,
}

impl RegionCheck {
    /// Before the first record.
    pub(crate) const START: Self = Self {
        first: FirstLine {
            side: 0,
            taken: 0,
            count: 0,
            active: [0; CROSSINGS_MAX],
        },
        cell: 0,
        before: 0,
        parity: 0,
    };

    /// The first line, once every record is checked.
    pub(crate) const fn first_line(&self) -> &FirstLine {
        &self.first
    }

    /// Begins with the first record.
    pub(crate) const fn begin(&mut self) {
        *self = Self::START;
    }

    /// Checks a portion of records, and after the last of them, on a line that is free, the first line. Whether they are sound: edges on the surface, upwards, in order,
    /// closed in each cell; cells up to the last record.
    pub(crate) fn check(
        &mut self,
        header: &Header,
        region: &RegionWords<'_>,
        portion: u32,
        line: &mut ScanLine,
    ) -> bool {
        let from = portion.saturating_mul(EDGES_A_RECORD);
        let Some(mut cell) = region.cell(self.cell) else {
            return false;
        };
        for index in from..from.saturating_add(EDGES_A_RECORD).min(header.edges.into()) {
            let Ok(index) = u16::try_from(index) else {
                return false;
            };
            if index == cell.next() {
                if self.parity != 0 {
                    return false;
                }
                self.cell = index;
                self.before = 0;
                let Some(next) = region.cell(index) else {
                    return false;
                };
                cell = next;
            }
            let is_sound = match index.checked_sub(self.cell.saturating_add(1)) {
                None => self.check_head(header, &cell),
                Some(number) => cell
                    .edge(number)
                    .is_some_and(|edge| self.check_edge(header, &edge, number)),
            };
            if !is_sound {
                return false;
            }
        }
        if from + EDGES_A_RECORD < u32::from(header.edges) {
            return true;
        }
        let Some(first) = region.cell(0) else {
            return false;
        };
        line.restart(&self.first);
        line.finish(&first, end_of(header.path_spans)).is_ok()
            && line.intervals() > 0
            && self.parity == 0
            && cell.next() == header.edges
    }

    fn check_head(&mut self, header: &Header, cell: &CellWords<'_>) -> bool {
        if self.cell == 0 {
            self.first.side = cell.first();
        }
        cell.is_sound(header)
    }

    fn check_edge(&mut self, header: &Header, edge: &Edge, number: u16) -> bool {
        let [lower, upper] = edge.side;
        if !edge.is_sound(header) || lower < self.before {
            return false;
        }
        self.before = lower;
        self.parity ^= mixed(lower) ^ mixed(upper);
        let first = &mut self.first;
        if self.cell == 0 && lower <= first.side {
            first.taken = number.saturating_add(1);
            if edge.meets(first.side) {
                let Some(place) = first.active.get_mut(usize::from(first.count)) else {
                    return false;
                };
                *place = number;
                first.count += 1;
            }
        }
        true
    }
}

/// A place with its bits mixed, so that different ones do not cancel.
const fn mixed(at: i32) -> u32 {
    let mut bits = at.cast_unsigned().wrapping_mul(0x9e37_79b1);
    bits ^= bits >> 15;
    bits = bits.wrapping_mul(0x85eb_ca77);
    bits ^ (bits >> 13)
}

#[cfg(test)]
mod tests;
