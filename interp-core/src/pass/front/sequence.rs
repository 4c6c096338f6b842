//! The passes of a job of constant scallop height in order, from the first line over the parts of the fronts to the last line.

mod in_region;

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::{Pattern, Spacing};
use crate::math::number::Bounded;
use crate::pass::front::advance::{Advance, Made};
use crate::pass::front::cost;
use crate::pass::front::part::PartSearch;
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::front::table::{Pair, Table, free_pair};
use crate::pass::lines::RegionLines;
use crate::pass::route::Route;
use crate::sample::SpanParameter;
use in_region::InRegion;

/// Cycles for making fronts in a period of 1 ms or more; a shorter period has its share, at least one portion.
const PORTION_CYCLES: f32 = 23_500.0;
/// Period to which [`PORTION_CYCLES`] refers, s.
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
    /// Columns of the front that the tool is on, or was last, and of the latest one, from which the next is made. They differ after fronts that hold no pass.
    on: Pair,
    from: Pair,
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
    region: InRegion,
}

impl FrontSequence {
    pub(crate) const START: Self = Self {
        line: Line::First,
        on: 0,
        from: 0,
        part: 0,
        fronts: 0,
        direction: Direction::FROM_EDGE,
        cursor: SideCursor::NONE,
        part_search: PartSearch::IDLE,
        is_last_part: true,
        is_ahead: false,
        begins_part: false,
        advance: Advance::START,
        region: InRegion::NONE,
    };

    /// Ends the work.
    pub(crate) const fn stop(&mut self) {
        self.advance.stop();
        self.part_search.stop();
        self.region = InRegion::NONE;
    }

    /// Begins, with the first pass.
    pub(crate) fn start(&mut self, job: &Job<'_>, lines: &mut RegionLines) -> Route {
        self.cursor = SideCursor::new(job);
        (self.on, self.from, self.fronts) = (0, 0, 0);
        (self.is_ahead, self.begins_part) = (false, false);
        self.is_last_part = true;
        self.region = InRegion::NONE;
        if let Some(route) = self.start_in_region(job, lines) {
            return route;
        }
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
        self.part_search.has_work() || self.region.has_work() || self.advance.has_work()
    }

    /// Most cycles of the next portion; 0 where there is none.
    pub(crate) const fn cycles(&self) -> u32 {
        if self.part_search.has_work() {
            cost::PART
        } else if self.region.has_work() {
            cost::CLIP
        } else {
            self.advance.cycles()
        }
    }

    /// A portion of the next front, into the words after the job's. Returns its cycles.
    pub(crate) fn work(&mut self, job: &Job<'_>, words: &mut [i32], lines: &mut RegionLines) -> u32 {
        let stations = self.advance.stations();
        if self.part_search.has_work() {
            let table = Table::new(&*words, stations, [self.part_search.pair; 2]);
            self.part_search.work(job, &table);
            return cost::PART;
        }
        if self.region.has_work() {
            self.work_in_region(job, words, lines);
            return cost::CLIP;
        }
        let pairs = [self.from, self.next_pair()];
        let mut table = Table::new(&mut *words, stations, pairs);
        let cycles = self.advance.work(job, &mut table);
        self.seek_first_part(job);
        cycles
    }

    /// Columns of the front that is made.
    const fn next_pair(&self) -> Pair {
        free_pair([self.on, self.from])
    }

    /// Begins the search for the first part of the front that is made, once no part of the one before is left.
    fn seek_first_part(&mut self, job: &Job<'_>) {
        let is_made = matches!(self.advance.made(), Some(Ok(Made::Front)));
        if !is_made || self.is_ahead || !self.needs_front() {
            return;
        }
        if self.region.is_used() {
            self.region.clip_front();
        } else if self.part_search.is_idle() {
            let part = if self.begins_part { 1 } else { self.part };
            let reversed = is_reversed(job.header.pattern, self.fronts.wrapping_add(1), part);
            self.part_search
                .begin(self.advance.direction, self.cursor, reversed, self.next_pair());
        }
    }

    /// Whether the pass after the latest one is another part of its front, and found.
    pub(crate) const fn has_part(&self) -> bool {
        let is_known = self.part_search.is_found() || self.region.is_on_line();
        !self.is_last_part && is_known
    }

    /// The planning of one period of a job without limits, of which some cycles are spent already.
    #[inline(never)]
    pub(crate) fn plan(&mut self, job: &Job<'_>, words: &mut [i32], lines: &mut RegionLines, spent: u32) {
        let share = (job.header.period_s / PORTION_PERIOD_S).at_most(1.0);
        let real = |cycles: u32| f32::from(u16::try_from(cycles).unwrap_or(u16::MAX));
        let mut left = share * PORTION_CYCLES - real(spent);
        for portion in 0..PORTIONS_MAX {
            let most = real(self.cycles());
            if most == 0.0 || (most > left && portion > 0) {
                return;
            }
            left -= real(self.work(job, words, lines));
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
            Line::First => self.begin_cell(),
            Line::Front => {
                self.on = self.next_pair();
                self.from = self.on;
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
            Line::First | Line::Front => self.is_last_part,
            Line::Last => self.begins_part,
        }
    }

    /// Whether the latest pass is the last one.
    pub(crate) const fn is_over(&self) -> bool {
        let is_last_line = match self.line {
            Line::First => self.region.is_flat(),
            Line::Front => false,
            Line::Last => !self.begins_part,
        };
        is_last_line && self.is_last_part && !self.region.goes_on()
    }

    /// The pass after the latest one, which becomes the latest.
    ///
    /// # Errors
    /// [`FaultKind::IntervalTooSmall`] where the front does not move.
    pub(crate) fn next(&mut self, job: &Job<'_>, lines: &mut RegionLines) -> Result<NextRoute> {
        if self.region.is_used() {
            return self.next_in_region(job, lines);
        }
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
        let (route, is_last) = self.part_search.next_route(self.advance.stations(), self.cursor);
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
