//! The passes of a job of constant scallop height in order, from the first line over the parts of the fronts to the last line.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::{Pattern, Spacing};
use crate::math::number::Bounded;
use crate::pass::front::advance::{Advance, Made};
use crate::pass::front::cost;
use crate::pass::front::part::PartSearch;
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::front::table::Table;
use crate::pass::route::Route;
use crate::sample::SpanParameter;

/// Cycles of the planning in a period of 1 ms, a share of the period; never less than one portion, nor more than in 1 ms.
const PORTION_CYCLES: f32 = 23_500.0;
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
    /// The search for the next part of the latest pass's front, or for the first one of the next front.
    part_search: PartSearch,
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
        part_search: PartSearch::IDLE,
        is_last_part: true,
        is_ahead: false,
        begins_part: false,
        advance: Advance::START,
    };

    /// Ends the work.
    pub(crate) const fn stop(&mut self) {
        self.advance.stop();
        self.part_search.stop();
    }

    /// Begins, with the first pass.
    pub(crate) fn start(&mut self, job: &Job<'_>) -> Route {
        self.cursor = SideCursor::new(job);
        (self.fronts, self.swapped) = (0, false);
        (self.is_ahead, self.begins_part) = (false, false);
        // A front that moves backwards is travelled as the second part from the middle is.
        (self.part, self.direction) = match job.header.spacing {
            Spacing::ConstantFromMiddle => {
                let [first, _] = Direction::FROM_MIDDLE;
                (0, first)
            }
            Spacing::ConstantFromEnd => (1, Direction::FROM_END),
            _ => (0, Direction::FROM_EDGE),
        };
        self.part_search.stop();
        self.advance.begin(self.cursor, self.direction, true);
        self.line = Line::First;
        let (side, _) = self.cursor.seek(job, &self.direction, 0);
        self.whole_line(job, side)
    }

    /// Whether [`Self::plan`] has anything to do.
    pub(crate) fn has_work(&self) -> bool {
        self.part_search.has_work() || self.advance.has_work()
    }

    /// Most cycles of the next portion; 0 where there is none.
    pub(crate) const fn cycles(&self) -> u32 {
        if self.part_search.has_work() {
            cost::PART
        } else {
            self.advance.cycles()
        }
    }

    /// A portion of the next front, into the words behind the job's. Returns its cycles.
    pub(crate) fn work(&mut self, job: &Job<'_>, words: &mut [i32]) -> u32 {
        let stations = self.advance.stations();
        if self.part_search.has_work() {
            let table = Table::new(&*words, stations, self.part_search.swapped);
            self.part_search.work(job, &table);
            return cost::PART;
        }
        let mut table = Table::new(&mut *words, stations, self.swapped);
        let cycles = self.advance.work(job, &mut table);
        self.seek_first_part(job);
        cycles
    }

    /// Begins the search for the first part of the front that is made, once no part of the one before is left.
    fn seek_first_part(&mut self, job: &Job<'_>) {
        let is_made = matches!(self.advance.made(), Some(Ok(Made::Front)));
        if is_made && !self.is_ahead && self.needs_front() && self.part_search.is_idle() {
            let part = if self.begins_part { 1 } else { self.part };
            let reversed = is_reversed(job.header.pattern, self.fronts.wrapping_add(1), part);
            self.part_search
                .begin(self.advance.direction, self.cursor, reversed, !self.swapped);
        }
    }

    /// Whether the pass after the latest one is another part of its front, and found.
    pub(crate) const fn has_part(&self) -> bool {
        matches!(self.line, Line::Front) && !self.is_last_part && self.part_search.is_found()
    }

    /// The planning of one period of a job without limits, of which some cycles are spent already.
    #[inline(never)]
    pub(crate) fn plan(&mut self, job: &Job<'_>, words: &mut [i32], spent: u32) {
        let share = (job.header.period_s / PORTION_PERIOD_S).at_most(1.0);
        let real = |cycles: u32| f32::from(u16::try_from(cycles).unwrap_or(u16::MAX));
        let mut left = share * PORTION_CYCLES - real(spent);
        for portion in 0..PORTIONS_MAX {
            let most = real(self.cycles());
            if most == 0.0 || (most > left && portion > 0) {
                return;
            }
            left -= real(self.work(job, words));
        }
    }

    fn whole_line(&self, job: &Job<'_>, side: SpanParameter) -> Route {
        Route::whole(
            side,
            is_reversed(job.header.pattern, self.fronts, self.part),
            job.header.path_spans,
        )
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
        if self.line == Line::Front && !self.is_last_part {
            return self.take_part(job);
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
        if made == Made::Front && !self.part_search.is_found() {
            self.seek_first_part(job);
            return Ok(NextRoute::NotYet);
        }
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
                self.take_part(job)
            }
            Made::Line(at) => {
                (self.line, self.is_last_part) = (Line::Front, true);
                let (side, _) = self.cursor.seek(job, &self.direction, fine(at));
                Ok(NextRoute::Pass(self.whole_line(job, side)))
            }
            Made::Beyond => {
                self.line = Line::Last;
                self.begins_part = job.header.spacing == Spacing::ConstantFromMiddle && self.part == 0;
                let boundary = self.direction.boundary(job);
                Ok(NextRoute::Pass(self.whole_line(job, boundary)))
            }
        }
    }

    /// The part of a front that was found.
    ///
    /// # Errors
    /// [`FaultKind::IntervalTooSmall`] where the front has none.
    fn take_part(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        if !self.part_search.is_found() {
            return Ok(NextRoute::NotYet);
        }
        let (route, is_last) = self.part_search.take(self.advance.stations(), self.cursor);
        self.is_last_part = is_last;
        self.seek_first_part(job);
        let route = route.ok_or(Fault::new(FaultKind::IntervalTooSmall, 0.0))?;
        Ok(NextRoute::Pass(route))
    }
}

/// Whether the front of this number is travelled backwards.
const fn is_reversed(pattern: Pattern, fronts: u32, part: u8) -> bool {
    match pattern {
        Pattern::Zigzag => fronts % 2 == 1,
        // The other direction keeps the side on which the material is.
        Pattern::Zig => part == 1,
    }
}
