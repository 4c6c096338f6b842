//! The parts of a front before the boundary, each a pass, sought in portions of stations.

use core::ops::Deref;

use crate::job::program::Job;
use crate::job::stations::Stations;
use crate::pass::front::line::FrontLine;
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Pair, Table};
use crate::pass::route::Route;
use crate::sample::SpanParameter;

/// Stations of a portion.
const STATIONS_A_PORTION: u8 = 8;

/// Stage of the search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// No search is under way, and no result is left.
    Idle,
    /// Stations beyond the boundary, before the part.
    Before,
    /// Stations of the part.
    Within,
    /// Stations beyond the boundary, after the part.
    Behind,
    /// Stations of a part whose ends are known, up to this one.
    Known(u16),
    Found,
}

/// The search for the next part of a front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PartSearch {
    stage: Stage,
    /// The front's columns; it is travelled backwards.
    pub(crate) pair: Pair,
    reversed: bool,
    direction: Direction,
    cursor: SideCursor,
    /// Next station, in the order of travel.
    index: u16,
    start: SpanParameter,
    end: SpanParameter,
    are_on_boundary: [bool; 2],
    pieces: u16,
    /// Side span of the last station of the part.
    span: Option<u16>,
    /// There is no further part on the front, and none at all.
    is_last: bool,
    is_empty: bool,
}

impl PartSearch {
    pub(crate) const IDLE: Self = Self {
        stage: Stage::Idle,
        pair: 0,
        reversed: false,
        direction: Direction::FROM_EDGE,
        cursor: SideCursor::NONE,
        index: 0,
        start: SpanParameter { span: 0, fraction: 0 },
        end: SpanParameter { span: 0, fraction: 0 },
        are_on_boundary: [false; 2],
        pieces: 1,
        span: None,
        is_last: false,
        is_empty: false,
    };

    /// Begins on a front.
    pub(crate) const fn begin(
        &mut self,
        direction: Direction,
        cursor: SideCursor,
        reversed: bool,
        pair: Pair,
    ) {
        *self = Self::IDLE;
        (self.direction, self.cursor) = (direction, cursor);
        (self.reversed, self.pair) = (reversed, pair);
        self.stage = Stage::Before;
    }

    /// Looks at the part of the front between two places, the first one in the order of travel first, and the stations within it, ascending.
    pub(crate) const fn know(&mut self, [start, end]: [SpanParameter; 2], [low, high]: [u16; 2], count: u16) {
        (self.start, self.end) = (start, end);
        (self.pieces, self.span) = (1, None);
        let [from, to] = if self.reversed {
            let last = count.saturating_sub(1);
            [last.saturating_sub(high), last.saturating_sub(low)]
        } else {
            [low, high]
        };
        self.index = from;
        self.stage = Stage::Known(to);
    }

    pub(crate) const fn stop(&mut self) {
        self.stage = Stage::Idle;
    }

    pub(crate) const fn is_idle(&self) -> bool {
        matches!(self.stage, Stage::Idle)
    }

    pub(crate) const fn has_work(&self) -> bool {
        !matches!(self.stage, Stage::Idle | Stage::Found)
    }

    pub(crate) const fn is_found(&self) -> bool {
        matches!(self.stage, Stage::Found)
    }

    /// Takes the found part, `None` if the front has no further part, and whether it is the last one. If it is not, the search for the next one begins.
    pub(crate) fn next_route(&mut self, stations: Stations, cursor: SideCursor) -> (Option<Route>, bool) {
        let front = FrontLine {
            direction: self.direction,
            stations,
            pair: self.pair,
            cursor,
            are_on_boundary: self.are_on_boundary,
            pieces: self.pieces,
        };
        let route = if self.is_empty {
            None
        } else {
            Some(Route {
                side: SpanParameter { span: 0, fraction: 0 },
                reversed: self.reversed,
                ends: [self.start, self.end],
                joins: false,
                front: Some(front),
            })
        };
        let is_last = self.is_last;
        self.stage = if is_last { Stage::Idle } else { Stage::Before };
        (self.pieces, self.span) = (1, None);
        (route, is_last)
    }

    /// Looks at a portion of the stations.
    pub(crate) fn work<W: Deref<Target = [i32]>>(&mut self, job: &Job<'_>, table: &Table<W>) {
        for _ in 0..STATIONS_A_PORTION {
            match self.stage {
                Stage::Idle | Stage::Found => return,
                Stage::Before | Stage::Within | Stage::Behind | Stage::Known(_) => self.look(job, table),
            }
        }
    }

    /// Looks at a station.
    fn look<W: Deref<Target = [i32]>>(&mut self, job: &Job<'_>, table: &Table<W>) {
        let stations = table.stations();
        let count = stations.count();
        let index = self.index;
        let boundary = self.direction.end;
        let own = |index: u16| {
            if self.reversed {
                count.saturating_sub(index + 1)
            } else {
                index
            }
        };
        let is_over = index >= count;
        let front = table.word(Column::Front, own(index.min(count.saturating_sub(1))));
        let is_before = !is_over && front < boundary;
        let crossing = || {
            let before = index.saturating_sub(1);
            let interval = own(before).min(own(index));
            let length = stations.length(job, interval);
            let cubic = Cubic::of(table, [Column::Front, Column::Slope], interval, length);
            stations.place_within(interval, cubic.crossing(boundary))
        };
        match self.stage {
            Stage::Before if is_over => {
                (self.is_empty, self.is_last) = (true, true);
                self.stage = Stage::Found;
            }
            Stage::Before if is_before => {
                let is_from_boundary = index > 0;
                self.start = if is_from_boundary {
                    crossing()
                } else {
                    stations.place(own(0))
                };
                self.are_on_boundary = [is_from_boundary, false];
                self.stage = Stage::Within;
            }
            Stage::Within if is_before => self.count(job, front),
            Stage::Known(last) if is_over || index > last => {
                // The next part is to be named.
                self.is_last = true;
                self.stage = Stage::Found;
            }
            Stage::Known(_) => self.count(job, front),
            Stage::Within => {
                let [is_from_boundary, _] = self.are_on_boundary;
                self.are_on_boundary = [is_from_boundary, !is_over];
                self.end = if is_over {
                    stations.place(own(count.saturating_sub(1)))
                } else {
                    crossing()
                };
                self.stage = Stage::Behind;
            }
            Stage::Behind if is_over || is_before => {
                self.is_last = is_over;
                self.stage = Stage::Found;
            }
            Stage::Before | Stage::Behind => self.index += 1,
            Stage::Idle | Stage::Found => {}
        }
    }

    /// Counts the piece after a station.
    fn count(&mut self, job: &Job<'_>, front: i32) {
        self.cursor.seek(job, &self.direction, fine(front));
        let span = self.cursor.span();
        let crossed = self.span.map_or(0, |last| span.abs_diff(last));
        self.span = Some(span);
        self.pieces = self.pieces.saturating_add(1 + crossed);
        self.index += 1;
    }
}
