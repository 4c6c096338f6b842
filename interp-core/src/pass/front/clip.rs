//! The intervals of a front within a cell of a region.
//!
//! An edge crosses the front where one of its ends is below the front and the other is not, and there are pairs of crossings where the front bends. So an edge is followed
//! piece by piece, each within one interval between stations: between the piece's ends and the places where the front's height over the edge has an extremum, a change of
//! side is one crossing, found by bisection. A vertex is below the front for both of its edges or for none, so that the number of crossings is even.

use core::ops::Deref;

use crate::job::program::Job;
use crate::job::region::{BadLine, CellWords, Edge, FRACTION_BITS, ScanLine, end_of};
use crate::job::stations::Stations;
use crate::math::arith::{to_f32, truncated};
use crate::math::number::Bounded;
use crate::pass::front::side::{Direction, WHOLE};
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Table};
use crate::sample::SpanParameter;

/// Bits of a place on the path within an interval between stations.
const PLACE_BITS: u32 = FRACTION_BITS;
/// Shift to a place within an interval in units of 2^-31.
const WITHIN_SHIFT: u32 = 31 - PLACE_BITS;
/// Edges in a portion that determines the extent of the cell.
const EXTENT_EDGES: u16 = 64;
/// Stations in a portion that determines the least and the greatest distance of the front.
const WINDOW_STATIONS: u16 = 24;
/// Work of a portion on edges, in units of an edge that the front does not reach.
const PORTION: u16 = 64;
/// Work of one piece of an edge, in the same units.
const PIECE: u16 = 32;

/// Stage of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Idle,
    /// How far the cell reaches along the path.
    Extent,
    /// How far the front reaches across.
    Window,
    /// Where the edges cross it.
    Edges,
    Found,
}

/// The search for the intervals of a front, in portions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrontClip {
    stage: Stage,
    /// The next edge, and the place up to which it is done; none where it is not begun.
    edge: u16,
    at: Option<i32>,
    /// The front's distances, least and greatest; of the pass before at both ends of the path.
    window: [i32; 2],
    before: [i32; 2],
    /// Path of the cell, from and to.
    extent: [i32; 2],
    /// No vertex so far is beyond the front.
    is_below: bool,
}

impl FrontClip {
    pub(crate) const IDLE: Self = Self {
        stage: Stage::Idle,
        edge: 0,
        at: None,
        window: [0; 2],
        before: [0; 2],
        extent: [0; 2],
        is_below: true,
    };

    /// Begins with how far a cell reaches along the path.
    pub(crate) const fn begin_cell(&mut self) {
        *self = Self::IDLE;
        self.extent = [i32::MAX, 0];
        self.stage = Stage::Extent;
    }

    /// Begins with a front. `before`: distances of the pass before at both ends of the path.
    pub(crate) const fn begin(&mut self, before: [i32; 2]) {
        self.stage = Stage::Window;
        (self.edge, self.at) = (0, None);
        self.window = [i32::MAX, i32::MIN];
        self.before = before;
        self.is_below = true;
    }

    pub(crate) const fn stop(&mut self) {
        self.stage = Stage::Idle;
    }

    pub(crate) const fn is_idle(&self) -> bool {
        matches!(self.stage, Stage::Idle)
    }

    pub(crate) const fn is_found(&self) -> bool {
        matches!(self.stage, Stage::Found)
    }

    pub(crate) const fn has_work(&self) -> bool {
        !matches!(self.stage, Stage::Idle | Stage::Found)
    }

    /// Whether the cell's path is sought.
    pub(crate) const fn is_at_extent(&self) -> bool {
        matches!(self.stage, Stage::Extent)
    }

    /// Path of the cell, from and to: places.
    pub(crate) const fn extent(&self) -> [i32; 2] {
        self.extent
    }

    /// Whether the whole cell is below the front.
    pub(crate) const fn is_below(&self) -> bool {
        self.is_below
    }

    /// A portion.
    ///
    /// # Errors
    /// The front crosses too many edges.
    #[inline(never)]
    pub(crate) fn work<W: Deref<Target = [i32]>>(
        &mut self,
        job: &Job<'_>,
        (cell, direction): (&CellWords<'_>, &Direction),
        table: &Table<W>,
        line: &mut ScanLine,
    ) -> Result<(), BadLine> {
        match self.stage {
            Stage::Idle | Stage::Found => {}
            Stage::Extent => self.extend(cell),
            Stage::Window => self.widen(job, table, line),
            Stage::Edges => self.cross_edges(job, (cell, direction), table, line)?,
        }
        Ok(())
    }

    fn extend(&mut self, cell: &CellWords<'_>) {
        for _ in 0..EXTENT_EDGES {
            let Some(Edge { path: [from, to], .. }) = cell.edge(self.edge) else {
                self.stage = Stage::Idle;
                return;
            };
            let [least, most] = self.extent;
            self.extent = [least.min(from).min(to), most.max(from).max(to)];
            self.edge += 1;
        }
    }

    /// By the values that bound the cubic between two stations.
    fn widen<W: Deref<Target = [i32]>>(&mut self, job: &Job<'_>, table: &Table<W>, line: &mut ScanLine) {
        let stations = table.stations();
        let last = stations.count().saturating_sub(1);
        for _ in 0..WINDOW_STATIONS {
            let station = self.edge;
            if station > last {
                (self.edge, self.stage) = (0, Stage::Edges);
                line.begin_curve();
                return;
            }
            let length = stations
                .length(job, station.min(last.saturating_sub(1)))
                .at_least(stations.length(job, station.saturating_sub(1)));
            let rise = truncated(table.real(Column::Slope, station) * (length * to_f32(WHOLE / 3)))
                .saturating_abs()
                .saturating_add(2);
            let at = table.word(Column::Front, station);
            let [least, most] = self.window;
            self.window = [
                least.min(at.saturating_sub(rise)),
                most.max(at.saturating_add(rise)),
            ];
            self.edge += 1;
        }
    }

    fn cross_edges<W: Deref<Target = [i32]>>(
        &mut self,
        job: &Job<'_>,
        (cell, direction): (&CellWords<'_>, &Direction),
        table: &Table<W>,
        line: &mut ScanLine,
    ) -> Result<(), BadLine> {
        let mut work = 0;
        while work < PORTION {
            let Some(edge) = cell.edge(self.edge) else {
                let bits = u32::from(table.stations().bits);
                line.keep(cell.least().saturating_mul(1 << bits))?;
                self.stage = Stage::Found;
                return Ok(());
            };
            let [low, high] = self.window;
            let sides = edge.side.map(|side| direction.distance(side));
            let (least, most) = (min_of(sides), max_of(sides));
            if most < low || least > high {
                self.is_below &= most < low;
                self.edge += 1;
                work += 1;
                continue;
            }
            work += PIECE;
            let curve = Curve { job, table };
            let slanted = Slanted::new(&edge, sides, table.stations());
            match slanted {
                Some(edge) => self.cross_piece(&curve, &edge, line)?,
                None => self.cross_along(&curve, &edge, sides, line)?,
            }
        }
        Ok(())
    }

    /// An edge of constant path.
    fn cross_along<W: Deref<Target = [i32]>>(
        &mut self,
        curve: &Curve<'_, '_, W>,
        edge: &Edge,
        sides: [i32; 2],
        line: &mut ScanLine,
    ) -> Result<(), BadLine> {
        let [path, _] = edge.path;
        let stations = curve.table.stations();
        let at = place(stations, path);
        let front = curve.at(at);
        let (least, most) = (min_of(sides), max_of(sides));
        self.is_below &= most < front;
        if (least < front) != (most < front) {
            line.insert(at)?;
            let [near, far] = self.before;
            let is_near = path == 0 && least <= near;
            let is_far = path == end_of(stations.spans) && least <= far;
            line.join([is_near, is_far]);
        }
        self.edge += 1;
        Ok(())
    }

    /// The next piece of an edge.
    fn cross_piece<W: Deref<Target = [i32]>>(
        &mut self,
        curve: &Curve<'_, '_, W>,
        edge: &Slanted,
        line: &mut ScanLine,
    ) -> Result<(), BadLine> {
        let [first, last] = edge.path;
        let from = self.at.unwrap_or(first);
        let interval = from >> PLACE_BITS;
        let to = interval
            .saturating_add(1)
            .saturating_mul(1 << PLACE_BITS)
            .min(last);
        let piece = Piece {
            path: [from, to],
            side: [from, to].map(|at| edge.side_at(at)),
        };
        let cubic = curve.cubic(from);
        let [start, end] = piece.side;
        let mut was_below = start < curve.at(from);
        let is_end_below = end < curve.at(to);
        self.is_below &= was_below && is_end_below;
        let share = to_f32(1 << PLACE_BITS) / to_f32(to.wrapping_sub(from));
        let places = cubic
            .extrema_over(to_f32(end.wrapping_sub(start)) * share)
            .map(|within| {
                let at = (interval << PLACE_BITS).saturating_add(within? >> WITHIN_SHIFT);
                (at > from && at < to).then_some(at)
            });
        let places = match places {
            [Some(one), Some(other)] if other < one => [Some(other), Some(one)],
            places => places,
        };
        let mut low = from;
        for place in places.into_iter().flatten().chain([to]) {
            let is_below = if place == to {
                is_end_below
            } else {
                piece.side_at(place) < Curve::<W>::on(&cubic, place)
            };
            if is_below != was_below {
                let at = crossing([low, place], |at| {
                    (piece.side_at(at) < Curve::<W>::on(&cubic, at)) == was_below
                });
                line.insert(at)?;
            }
            (low, was_below) = (place, is_below);
        }
        if to >= last {
            self.edge += 1;
            self.at = None;
        } else {
            self.at = Some(to);
        }
        Ok(())
    }
}

/// A front as a function of places on the path.
struct Curve<'a, 'b, W> {
    job: &'a Job<'b>,
    table: &'a Table<W>,
}

impl<W: Deref<Target = [i32]>> Curve<'_, '_, W> {
    /// The cubic of the interval that a place is in, or begins.
    fn cubic(&self, at: i32) -> Cubic {
        let interval = u16::try_from(at >> PLACE_BITS).unwrap_or(0);
        let length = self.table.stations().length(self.job, interval);
        Cubic::of(self.table, [Column::Front, Column::Slope], interval, length)
    }

    /// The distance at a place: the station's where there is one.
    fn at(&self, at: i32) -> i32 {
        if within(at) == 0 {
            let station = u16::try_from(at >> PLACE_BITS).unwrap_or(0);
            self.table.word(Column::Front, station)
        } else {
            Self::on(&self.cubic(at), at)
        }
    }

    /// The distance on a cubic at a place within its interval.
    fn on(cubic: &Cubic, at: i32) -> i32 {
        cubic.value(within(at) << WITHIN_SHIFT)
    }
}

/// An edge that goes along the path, from its lower path to its upper one.
struct Slanted {
    path: [i32; 2],
    side: [i32; 2],
}

impl Slanted {
    fn new(edge: &Edge, sides: [i32; 2], stations: Stations) -> Option<Self> {
        let [from, to] = edge.path.map(|path| place(stations, path));
        let [near, far] = sides;
        match from.cmp(&to) {
            core::cmp::Ordering::Less => Some(Self {
                path: [from, to],
                side: [near, far],
            }),
            core::cmp::Ordering::Greater => Some(Self {
                path: [to, from],
                side: [far, near],
            }),
            core::cmp::Ordering::Equal => None,
        }
    }

    /// Its side at a place.
    fn side_at(&self, at: i32) -> i32 {
        let ([from, to], [near, far]) = (self.path, self.side);
        if at <= from {
            return near;
        }
        if at >= to {
            return far;
        }
        // Places are below 2^31, distances below 2^29.
        let part = i64::from(far.wrapping_sub(near)) * i64::from(at - from);
        let moved = part.checked_div(i64::from(to - from)).unwrap_or(0);
        near.wrapping_add(i32::try_from(moved).unwrap_or(0))
    }
}

/// A piece of an edge within an interval: a line between its ends.
struct Piece {
    path: [i32; 2],
    side: [i32; 2],
}

impl Piece {
    fn side_at(&self, at: i32) -> i32 {
        let ([from, to], [near, far]) = (self.path, self.side);
        let share = to_f32(at.wrapping_sub(from)) / to_f32(to.wrapping_sub(from));
        near.wrapping_add(truncated(to_f32(far.wrapping_sub(near)) * share))
    }
}

/// The place of a path parameter.
const fn place(stations: Stations, path: i32) -> i32 {
    path << stations.bits
}

const fn within(at: i32) -> i32 {
    at & ((1 << PLACE_BITS) - 1)
}

/// The place where a part begins or ends, in the order of travel or against it. `begins`: in the direction of the path.
pub(crate) fn parameter(stations: Stations, at: i32, begins: bool) -> SpanParameter {
    let interval = u16::try_from(at >> PLACE_BITS).unwrap_or(0);
    let within = within(at);
    if within > 0 {
        return stations.place_within(interval, within << WITHIN_SHIFT);
    }
    let start = stations.place(interval);
    if begins || interval == 0 || interval + 1 >= stations.count() {
        return start;
    }
    // The end of the interval before.
    SpanParameter {
        span: stations.span(interval - 1),
        fraction: start.fraction.wrapping_sub(1),
    }
}

/// The stations next to both ends of a part, within it or on its ends.
pub(crate) fn stations_within([from, to]: [i32; 2]) -> [u16; 2] {
    let up = from.saturating_add((1 << PLACE_BITS) - 1) >> PLACE_BITS;
    [up, to >> PLACE_BITS].map(|station| u16::try_from(station).unwrap_or(0))
}

/// The stations that enclose a range of the path, by places of regions.
pub(crate) fn stations_around(stations: Stations, extent: [i32; 2]) -> [u16; 2] {
    let [from, to] = extent.map(|path| place(stations, path));
    let up = to.saturating_add((1 << PLACE_BITS) - 1) >> PLACE_BITS;
    let last = stations.count().saturating_sub(1);
    [from >> PLACE_BITS, up].map(|station| u16::try_from(station).unwrap_or(0).min(last))
}

/// The place between two at which a condition that holds at the first ends.
fn crossing([mut low, mut high]: [i32; 2], holds: impl Fn(i32) -> bool) -> i32 {
    for _ in 0..PLACE_BITS {
        if high - low <= 1 {
            break;
        }
        let middle = i32::midpoint(low, high);
        if holds(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

const fn min_of([one, other]: [i32; 2]) -> i32 {
    if one < other { one } else { other }
}

const fn max_of([one, other]: [i32; 2]) -> i32 {
    if one < other { other } else { one }
}
