//! The passes of a job of constant scallop height in order, from the first line over the parts of the fronts to the last line.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::{Pattern, Spacing};
use crate::math::number::Bounded;
use crate::pass::front::advance::{Advance, Made};
use crate::pass::front::line::FrontLine;
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Table};
use crate::pass::route::Route;
use crate::sample::SpanParameter;

/// Cycles of the planning in a period of 1 ms, a share of the period; never less than one portion, nor more than in 1 ms.
const PORTION_CYCLES: f32 = 26_500.0;
const PORTION_PERIOD_S: f32 = 1e-3;
/// Most portions of a period.
const PORTIONS_MAX: u8 = 8;

/// The line of the latest pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    /// The first one.
    First,
    /// A front.
    Front,
    /// The boundary that the fronts move to.
    Last,
}

/// The next pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum NextRoute {
    /// It is not made yet.
    NotYet,
    Pass(Route),
    /// There is none.
    None,
}

/// The sequence of passes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrontSequence {
    line: Line,
    /// The table's columns of the front before the next one and of the next one are swapped.
    swapped: bool,
    /// Part of the surface, from 0, and fronts so far.
    part: u8,
    fronts: u32,
    direction: Direction,
    cursor: SideCursor,
    /// The station after the end of the latest pass, in the order of travel.
    after: u16,
    /// The latest pass is the last one on its front.
    is_last_part: bool,
    /// The latest pass is on a front, or a line, that the tool has not come to: the front before it is still needed.
    is_ahead: bool,
    /// The other part of the surface follows.
    begins_part: bool,
    advance: Advance,
}

impl FrontSequence {
    pub(crate) const START: Self = Self {
        line: Line::First,
        swapped: false,
        part: 0,
        fronts: 0,
        direction: Direction::FROM_EDGE,
        cursor: SideCursor::NONE,
        after: 0,
        is_last_part: true,
        is_ahead: false,
        begins_part: false,
        advance: Advance::START,
    };

    /// Ends the work.
    pub(crate) const fn stop(&mut self) {
        self.advance.stop();
    }

    /// Begins, with the first pass.
    pub(crate) fn start(&mut self, job: &Job<'_>) -> Route {
        self.cursor = SideCursor::new(job);
        (self.part, self.fronts, self.swapped) = (0, 0, false);
        (self.is_ahead, self.begins_part) = (false, false);
        self.direction = if job.header.spacing == Spacing::ConstantFromMiddle {
            let [first, _] = Direction::FROM_MIDDLE;
            first
        } else {
            Direction::FROM_EDGE
        };
        self.advance.begin(self.cursor, self.direction, true);
        self.line = Line::First;
        let (side, _) = self.cursor.seek(job, &self.direction, 0);
        self.whole_line(job, side)
    }

    /// Whether [`Self::plan`] has anything to do.
    pub(crate) fn has_work(&self) -> bool {
        self.advance.has_work()
    }

    /// Most cycles of the next portion; 0 where there is none.
    pub(crate) const fn cycles(&self) -> u32 {
        self.advance.cycles()
    }

    /// A portion of the next front, into the words behind the job's. Returns its cycles.
    pub(crate) fn work(&mut self, job: &Job<'_>, words: &mut [i32]) -> u32 {
        let mut table = Table::new(&mut *words, self.advance.stations(), self.swapped);
        self.advance.work(job, &mut table)
    }

    /// The planning of one period of a job without limits.
    #[inline(never)]
    pub(crate) fn plan(&mut self, job: &Job<'_>, words: &mut [i32]) {
        let share = (job.header.period_s / PORTION_PERIOD_S).at_most(1.0);
        let mut left = share * PORTION_CYCLES;
        for portion in 0..PORTIONS_MAX {
            let real = |cycles: u32| f32::from(u16::try_from(cycles).unwrap_or(u16::MAX));
            let most = real(self.cycles());
            if most == 0.0 || (most > left && portion > 0) {
                return;
            }
            left -= real(self.work(job, words));
        }
    }

    /// Whether the front of this number is travelled backwards.
    const fn is_reversed(&self, pattern: Pattern) -> bool {
        match pattern {
            Pattern::Zigzag => self.fronts % 2 == 1,
            // The other direction keeps the side on which the material is.
            Pattern::Zig => self.part == 1,
        }
    }

    fn whole_line(&self, job: &Job<'_>, side: SpanParameter) -> Route {
        Route::whole(side, self.is_reversed(job.header.pattern), job.header.path_spans)
    }

    /// The tool leaves the pass before the latest one: the front after the latest can be made in the place of the one before.
    /// Returns whether it is begun.
    pub(crate) const fn arrive(&mut self) -> bool {
        if !self.is_ahead {
            return false;
        }
        self.is_ahead = false;
        match self.line {
            Line::First => {}
            Line::Front => {
                self.swapped = !self.swapped;
                self.advance.go_on();
            }
            Line::Last if self.begins_part => {
                let [_, second] = Direction::FROM_MIDDLE;
                self.advance.begin(self.cursor, second, false);
            }
            Line::Last => self.advance.stop(),
        }
        true
    }

    /// Whether the pass after the latest one is on another front.
    pub(crate) const fn needs_front(&self) -> bool {
        match self.line {
            Line::First => true,
            Line::Front => self.is_last_part,
            Line::Last => self.begins_part,
        }
    }

    /// Whether the latest pass is the last one.
    pub(crate) const fn is_over(&self) -> bool {
        matches!(self.line, Line::Last) && !self.begins_part
    }

    /// The pass after the latest one, which becomes the latest.
    ///
    /// # Errors
    /// [`FaultKind::IntervalTooSmall`] where the front does not move.
    pub(crate) fn next(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        if self.line == Line::Front {
            let swapped = self.swapped != self.is_ahead;
            if let Some(route) = self.next_part(job, swapped) {
                return Ok(NextRoute::Pass(route));
            }
        }
        if self.is_over() {
            return Ok(NextRoute::None);
        }
        if self.is_ahead {
            return Ok(NextRoute::NotYet);
        }
        let Some(made) = self.advance.made() else {
            return Ok(NextRoute::NotYet);
        };
        let made = made?;
        if self.begins_part {
            self.part = 1;
        }
        self.begins_part = false;
        self.direction = self.advance.direction;
        self.fronts = self.fronts.wrapping_add(1);
        self.is_ahead = true;
        match made {
            Made::Front => {
                self.line = Line::Front;
                self.after = 0;
                let route = self.next_part(job, !self.swapped);
                let route = route.ok_or(Fault::new(FaultKind::IntervalTooSmall, 0.0))?;
                Ok(NextRoute::Pass(route))
            }
            Made::Beyond => {
                self.line = Line::Last;
                self.begins_part = job.header.spacing == Spacing::ConstantFromMiddle && self.part == 0;
                let boundary = self.direction.boundary(job);
                Ok(NextRoute::Pass(self.whole_line(job, boundary)))
            }
        }
    }

    /// The next part of the front that is before the boundary, from the station `after` in the order of travel.
    fn next_part(&mut self, job: &Job<'_>, swapped: bool) -> Option<Route> {
        let stations = self.advance.stations();
        let reversed = self.is_reversed(job.header.pattern);
        let table = Table::new(job.rest(), stations, swapped);
        let count = stations.count();
        let boundary = self.direction.end;
        let own = |index: u16| {
            if reversed {
                count.saturating_sub(index + 1)
            } else {
                index
            }
        };
        let is_before = |index: u16| table.word(Column::Front, own(index)) < boundary;
        let crossing = |index: u16| {
            let interval = own(index).min(own(index + 1));
            let length = stations.length(job, interval);
            let cubic = Cubic::of(&table, [Column::Front, Column::Slope], interval, length);
            stations.place_within(interval, cubic.crossing(boundary))
        };
        let mut index = self.after;
        while index < count && !is_before(index) {
            index += 1;
        }
        if index >= count {
            return None;
        }
        let (start, is_from_boundary) = if index == 0 {
            (stations.place(own(0)), false)
        } else {
            (crossing(index - 1), true)
        };
        let mut cursor = self.cursor;
        let mut pieces = 1_u16;
        let mut span = None;
        while index < count && is_before(index) {
            let at = table.word(Column::Front, own(index));
            cursor.seek(job, &self.direction, fine(at));
            let crossed = span.map_or(0, |span: u16| cursor.span().abs_diff(span));
            span = Some(cursor.span());
            pieces = pieces.saturating_add(1 + crossed);
            index += 1;
        }
        let (end, is_beyond) = if index < count {
            (crossing(index - 1), true)
        } else {
            (stations.place(own(count - 1)), false)
        };
        self.after = index;
        while index < count && !is_before(index) {
            index += 1;
        }
        let front = FrontLine {
            direction: self.direction,
            stations,
            swapped,
            cursor: self.cursor,
            are_on_boundary: [is_from_boundary, is_beyond],
            pieces,
        };
        self.is_last_part = index >= count;
        Some(Route {
            side: SpanParameter { span: 0, fraction: 0 },
            reversed,
            ends: [start, end],
            front: Some(front),
        })
    }
}
