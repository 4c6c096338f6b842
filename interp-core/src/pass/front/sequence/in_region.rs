//! The passes of a region: intervals of the first line of a cell, of each front, and of the last line; then the next cell.
//!
//! A front that holds no pass is the next one's origin like any other, in columns of its own, because the tool may still be on the one before.
//!
//! A cell that goes backwards begins on the first line of the one before it, which is not passed again.

use super::{FrontSequence, Line, NextRoute, is_reversed};
use crate::fault::{Fault, Result};
use crate::job::program::Job;
use crate::job::region::BadLine;
use crate::pass::front::advance::Made;
use crate::pass::front::clip::{self, FrontClip};
use crate::pass::front::side::{Direction, fine};
use crate::pass::front::table::{Column, Table};
use crate::pass::lines::{RegionLines, too_many};
use crate::pass::route::Route;

/// What is known of the region.
#[derive(Clone, Copy, Debug)]
pub(super) struct InRegion {
    is_used: bool,
    /// The first line of the cell is its last one, and another cell follows.
    is_flat: bool,
    has_next: bool,
    clip: FrontClip,
    /// The line whose intervals are sought.
    scan: Option<Line>,
    is_scanned: bool,
    /// The line's distance from the first one; the latest pass is on it, and not on a curve.
    at: i32,
    is_on_line: bool,
    /// All of the cell is below the last front.
    is_passed: bool,
    fault: Option<Fault>,
    /// Distances of the latest pass from the first one at both ends of the path.
    before: [i32; 2],
}

impl InRegion {
    pub(super) const NONE: Self = Self {
        is_used: false,
        is_flat: false,
        has_next: false,
        clip: FrontClip::IDLE,
        scan: None,
        is_scanned: false,
        at: 0,
        is_on_line: false,
        is_passed: false,
        fault: None,
        before: [0; 2],
    };

    pub(super) const fn is_used(&self) -> bool {
        self.is_used
    }

    /// Whether the cell has one line only.
    pub(super) const fn is_flat(&self) -> bool {
        self.is_flat
    }

    /// Whether a line is sought, or another cell follows.
    pub(super) const fn goes_on(&self) -> bool {
        self.has_next || self.scan.is_some()
    }

    pub(super) const fn is_on_line(&self) -> bool {
        self.is_on_line
    }

    pub(super) const fn has_work(&self) -> bool {
        (self.scan.is_some() && !self.is_scanned) || self.clip.has_work()
    }

    /// Seeks the intervals of the front that is made, unless that has begun.
    pub(super) const fn clip_front(&mut self) {
        if self.clip.is_idle() && self.fault.is_none() && !self.is_passed {
            self.clip.begin(self.before);
        }
    }

    /// Seeks the intervals of a line.
    const fn scan(&mut self, line: Line) {
        self.scan = Some(line);
        self.is_scanned = false;
    }
}

impl FrontSequence {
    /// Begins with the first pass of a region; none where the job has none.
    pub(super) fn start_in_region(&mut self, job: &Job<'_>, lines: &mut RegionLines) -> Option<Route> {
        self.set_cell(job, lines)?;
        self.part_search.stop();
        self.line = Line::First;
        lines.begin_passes(is_reversed(job.header.pattern, 0, 0));
        self.begin_cell();
        self.take_on_line(job, lines)
    }

    /// The cell that the lines are in.
    fn set_cell(&mut self, job: &Job<'_>, lines: &RegionLines) -> Option<()> {
        let cell = lines.cell(job)?;
        self.direction = Direction::over(cell.first(), cell.last());
        self.part = u8::from(!self.direction.forwards);
        self.region = InRegion {
            is_used: true,
            is_flat: cell.first() == cell.last(),
            has_next: lines.has_next_cell(job),
            ..InRegion::NONE
        };
        Some(())
    }

    /// Begins the fronts of a cell.
    pub(super) const fn begin_cell(&mut self) {
        self.advance.stop();
        if !self.region.is_flat {
            self.region.clip.begin_cell();
        }
    }

    /// A portion of the search for intervals.
    pub(super) fn work_in_region(&mut self, job: &Job<'_>, words: &[i32], lines: &mut RegionLines) {
        if self.region.scan.is_some() && !self.region.is_scanned {
            if let Err(fault) = lines.work_line(job, self.fronts) {
                self.region.fault = Some(fault);
            }
            self.region.is_scanned = lines.is_line_known() || self.region.fault.is_some();
            return;
        }
        let Some(cell) = lines.cell(job) else {
            self.region.clip.stop();
            return;
        };
        let stations = self.advance.stations();
        let pair = self.next_pair();
        let table = Table::new(words, stations, [pair; 2]);
        let clip = &mut self.region.clip;
        let measures = clip.is_at_extent();
        if let Err(BadLine) = clip.work(job, (&cell, &self.direction), &table, lines.scratch()) {
            clip.stop();
            self.region.fault = Some(too_many(self.fronts));
            return;
        }
        if measures && clip.is_idle() {
            let extent = clip.extent();
            self.advance.begin_within(self.cursor, self.direction, extent);
        } else if clip.is_found() {
            self.take_front(job, &table, lines);
        }
    }

    /// The intervals of a front are known: it holds the next pass, or the next front is made from it.
    fn take_front(&mut self, job: &Job<'_>, table: &Table<&[i32]>, lines: &mut RegionLines) {
        lines.begin_passes(is_reversed(
            job.header.pattern,
            self.fronts.wrapping_add(1),
            self.part,
        ));
        if lines.is_any_left() {
            let last = table.stations().count().saturating_sub(1);
            self.region.before = [0, last].map(|station| table.word(Column::Front, station));
            self.seek_part(lines);
            return;
        }
        self.region.clip.stop();
        if self.region.clip.is_below() {
            self.region.is_passed = true;
        } else {
            self.from = self.next_pair();
            self.advance.go_on();
        }
    }

    /// Looks at the next interval of the latest front.
    fn seek_part(&mut self, lines: &mut RegionLines) {
        let is_new = !matches!(self.line, Line::Front) || self.is_last_part;
        let reversed = lines.is_reversed();
        let Some(interval) = lines.next_interval() else {
            return;
        };
        let pair = if is_new {
            self.next_pair()
        } else {
            self.part_search.pair
        };
        let stations = self.advance.stations();
        let ends = interval.map(|at| clip::parameter(stations, at, true));
        let [from, to] = [ends[0], clip::parameter(stations, interval[1], false)];
        let ends = if reversed { [to, from] } else { [from, to] };
        self.part_search
            .begin(self.direction, self.cursor, reversed, pair);
        self.part_search
            .know(ends, clip::stations_within(interval), stations.count());
    }

    /// The pass after the latest one in a region.
    ///
    /// # Errors
    /// As [`FrontSequence::next`]; [`crate::FaultKind::BadPatch`] where a front crosses too many edges.
    pub(super) fn next_in_region(&mut self, job: &Job<'_>, lines: &mut RegionLines) -> Result<NextRoute> {
        if let Some(fault) = self.region.fault {
            return Err(fault);
        }
        if !self.is_last_part {
            return Ok(if self.region.is_on_line {
                self.take_on_line(job, lines)
                    .map_or(NextRoute::None, NextRoute::Pass)
            } else {
                self.take_part_of_front(lines)
            });
        }
        if self.is_over() {
            return Ok(NextRoute::None);
        }
        if self.is_ahead || self.region.has_work() {
            return Ok(NextRoute::NotYet);
        }
        if let Some(line) = self.region.scan.take() {
            return self.enter_scanned(job, line, lines);
        }
        if self.line == Line::Last || self.region.is_flat {
            lines.enter_next_cell(job);
            self.set_cell(job, lines);
            if self.direction.forwards {
                self.begin_scan(lines, Line::First, 0);
            } else {
                self.line = Line::First;
                self.region.before = [i32::MIN; 2];
                self.begin_cell();
            }
            return Ok(NextRoute::NotYet);
        }
        if !self.region.is_passed {
            match self.advance.made() {
                None => return Ok(NextRoute::NotYet),
                Some(Err(fault)) => return Err(fault),
                Some(Ok(Made::Front)) => {
                    if !self.part_search.is_found() {
                        self.seek_first_part(job);
                        return Ok(NextRoute::NotYet);
                    }
                    self.line = Line::Front;
                    self.enter_line();
                    return Ok(self.take_part_of_front(lines));
                }
                Some(Ok(Made::Line(at))) => {
                    self.begin_scan(lines, Line::Front, at);
                    return Ok(NextRoute::NotYet);
                }
                Some(Ok(Made::Beyond)) => {}
            }
        }
        self.begin_scan(lines, Line::Last, self.direction.end);
        Ok(NextRoute::NotYet)
    }

    /// The first pass on a line whose intervals are known.
    ///
    /// # Errors
    /// [`crate::FaultKind::BadPatch`] where the cell's first or last line holds no pass.
    fn enter_scanned(&mut self, job: &Job<'_>, line: Line, lines: &mut RegionLines) -> Result<NextRoute> {
        if !lines.has_intervals() {
            if line != Line::Front {
                return Err(too_many(self.fronts));
            }
            self.from = self.next_pair();
            self.advance.go_on();
            return Ok(NextRoute::NotYet);
        }
        self.line = line;
        self.enter_line();
        self.region.before = [self.region.at; 2];
        lines.begin_passes(is_reversed(job.header.pattern, self.fronts, self.part));
        Ok(self
            .take_on_line(job, lines)
            .map_or(NextRoute::None, NextRoute::Pass))
    }

    /// The latest pass is on another line, or front, than the one before.
    const fn enter_line(&mut self) {
        self.fronts = self.fronts.wrapping_add(1);
        self.is_ahead = true;
        self.region.clip.stop();
    }

    /// Seeks the intervals of a line at this distance from the cell's first one.
    fn begin_scan(&mut self, lines: &mut RegionLines, line: Line, at: i32) {
        let before = if line == Line::First {
            i32::MIN
        } else {
            let [near, far] = self.region.before;
            self.direction.side(near.min(far))
        };
        lines.begin_line(self.direction.side(at), before);
        self.region.at = at;
        self.region.scan(line);
    }

    /// The next interval of a line.
    fn take_on_line(&mut self, job: &Job<'_>, lines: &mut RegionLines) -> Option<Route> {
        self.region.is_on_line = true;
        let (side, _) = self.cursor.seek(job, &self.direction, fine(self.region.at));
        let mut route = lines.take_on(side)?;
        route.joins = lines.is_joined();
        self.is_last_part = !lines.is_any_left();
        Some(route)
    }

    /// The part of a front that was found; the next one is sought.
    fn take_part_of_front(&mut self, lines: &mut RegionLines) -> NextRoute {
        if !self.part_search.is_found() {
            return NextRoute::NotYet;
        }
        self.region.is_on_line = false;
        let (route, _) = self.part_search.next_route(self.advance.stations(), self.cursor);
        let Some(mut route) = route else {
            return NextRoute::None;
        };
        route.joins = lines.is_joined();
        self.is_last_part = !lines.is_any_left();
        if !self.is_last_part {
            self.seek_part(lines);
        }
        NextRoute::Pass(route)
    }
}
