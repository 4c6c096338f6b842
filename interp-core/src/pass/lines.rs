//! The passes of a job with a region: its intervals on one line after the other.
//!
//! The first line is known since the job was loaded. From there the next one is sought in portions of the planning, once the step-over is known: lines that meet no
//! interval long enough are skipped by the same step, and where the line meets no edge at all, it goes on where the cell begins again. The last line is the
//! last one that meets an interval; after it the next cell begins, at a first line of its own.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::region::{CellWords, FirstLine, ScanLine, end_of, place_from, place_of, place_to};
use crate::job::{Header, Pattern};
use crate::pass::route::Route;
use crate::pass::row_history::RowHistory;
use crate::pass::schedule;
use crate::sample::SpanParameter;

/// Cycles of a portion, by the pessimistic model of `cargo sim budget`.
pub(crate) const PORTION_CYCLES: u32 = 2_600;

/// The next pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NextPass {
    /// It is still sought.
    Sought,
    /// [`RegionLines::take`] gives it.
    Found,
    /// There is none.
    None,
}

/// The lines of a region.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionLines {
    line: ScanLine,
    reversed: bool,
    /// Intervals of the line that were passes already.
    done: u8,
    /// Head of the cell.
    cell: u16,
    /// A further line is sought.
    is_seeking: bool,
    /// The job has a region.
    is_in_use: bool,
    /// The line is not one step beyond the one before: it begins a cell, or the region again, or lines between were skipped.
    is_apart: bool,
    /// The last step-over, units of the side parameter.
    step: f32,
}

impl RegionLines {
    /// Without a region.
    pub(crate) const START: Self = Self {
        line: ScanLine::START,
        reversed: false,
        done: 0,
        cell: 0,
        is_seeking: false,
        is_in_use: false,
        is_apart: true,
        step: 0.0,
    };

    /// Resets to the first line of a job with a region. Curved passes are found elsewhere.
    pub(crate) fn restart(&mut self, job: &Job<'_>, first: &FirstLine) {
        self.is_in_use = false;
        self.is_apart = true;
        self.reversed = false;
        self.done = 0;
        self.cell = 0;
        self.is_seeking = false;
        if let Some(cell) = self.cell(job) {
            self.line.restart(first);
            // It was checked at load.
            let is_known = self.line.finish(&cell, end_of(job.header.path_spans)).is_ok();
            self.is_in_use = is_known && !job.header.spacing.is_constant();
        }
    }

    /// The words of the cell.
    pub(crate) fn cell<'a>(&self, job: &Job<'a>) -> Option<CellWords<'a>> {
        job.region()?.cell(self.cell)
    }

    /// The line: for the checks of a job that is loaded, and for the crossings of a curve.
    pub(crate) const fn scratch(&mut self) -> &mut ScanLine {
        &mut self.line
    }

    /// Whether the job has a region.
    pub(crate) const fn is_in_use(&self) -> bool {
        self.is_in_use
    }

    /// Whether the pass taken last is the first one on a line that is not one step beyond the line before: the step to it says nothing of the step from it.
    pub(crate) const fn begins_apart(&self) -> bool {
        self.is_in_use && self.is_apart && self.done == 1
    }

    /// Whether no interval is left on the line, and the next one is not sought yet.
    pub(crate) const fn is_line_over(&self) -> bool {
        !self.is_seeking && self.done >= self.line.intervals()
    }

    /// Whether another interval is left on the line.
    const fn has_more(&self) -> bool {
        self.is_in_use && !self.is_seeking && self.done < self.line.intervals()
    }

    /// Side parameter of the next pass on this line, if there is another one.
    pub(crate) fn next_side(&self, header: &Header) -> Option<SpanParameter> {
        self.has_more().then(|| side_at(header, self.line.side()))
    }

    /// The next pass on this line.
    pub(crate) fn next_route(&mut self, header: &Header) -> Option<Route> {
        if !self.has_more() {
            return None;
        }
        self.take_on(side_at(header, self.line.side()))
    }

    /// The next pass on the line at this side parameter.
    pub(crate) fn take_on(&mut self, side: SpanParameter) -> Option<Route> {
        let [from, to] = self.next_interval()?;
        let ends = if self.reversed {
            [place_to(to), place_from(from)]
        } else {
            [place_from(from), place_to(to)]
        };
        Some(Route {
            side,
            reversed: self.reversed,
            ends,
            joins: false,
            front: None,
        })
    }

    /// The next interval of the line in the order of travel, ends ascending.
    pub(crate) fn next_interval(&mut self) -> Option<[i32; 2]> {
        let index = if self.reversed {
            self.line.intervals().checked_sub(self.done.checked_add(1)?)?
        } else {
            self.done
        };
        let ends = self.line.interval(index)?;
        self.done += 1;
        Some(ends)
    }

    /// Goes to the intervals of a line, or of a curve, that is known.
    pub(crate) const fn begin_passes(&mut self, reversed: bool) {
        self.done = 0;
        self.reversed = reversed;
    }

    pub(crate) const fn is_reversed(&self) -> bool {
        self.reversed
    }

    /// Whether the line that is known has an interval.
    pub(crate) const fn has_intervals(&self) -> bool {
        self.line.intervals() > 0
    }

    /// Whether an interval is left.
    pub(crate) const fn is_any_left(&self) -> bool {
        self.done < self.line.intervals()
    }

    /// Whether the first pass of the line goes on from the one before along the boundary of the path parameter that it begins at.
    pub(crate) fn is_joined(&self) -> bool {
        let [near, far] = self.line.joins();
        self.done == 1 && if self.reversed { far } else { near }
    }

    /// Begins a line of a job of curved passes; the region may reach there from `before`.
    pub(crate) const fn begin_line(&mut self, side: i32, before: i32) {
        self.line.begin(side, before);
    }

    /// A portion of the work on it.
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`] with the number of the front, where the line meets too many edges.
    pub(crate) fn work_line(&mut self, job: &Job<'_>, number: u32) -> Result<()> {
        let Some(cell) = self.cell(job) else {
            return Ok(());
        };
        let worked = self.line.work(&cell, end_of(job.header.path_spans));
        worked.map_err(|_| too_many(number))
    }

    /// Whether the line is known.
    pub(crate) fn is_line_known(&self) -> bool {
        self.line.is_done()
    }

    /// Goes to the next cell, if there is one.
    pub(crate) fn enter_next_cell(&mut self, job: &Job<'_>) {
        if let Some(cell) = self.cell(job) {
            self.cell = cell.next();
        }
    }

    /// Whether a cell is after this one.
    pub(crate) fn has_next_cell(&self, job: &Job<'_>) -> bool {
        let next = self.cell(job).map(|cell| cell.next());
        next.is_some_and(|next| job.region().is_some_and(|region| region.cell(next).is_some()))
    }

    /// Whether the tool may go on the surface, along the boundary, from the end of a pass to the start of this one, which is the first on its line. `rows`: those of
    /// the passes up to the first of them.
    pub(crate) fn joins(&self, header: &Header, from: &Route, to: &Route, rows: Option<&RowHistory>) -> bool {
        let is_near = rows.is_none_or(|rows| header.window == 0 || !rows.jumps(header, to.side.span));
        let ([_, end], [start, _]) = (from.ends, to.ends);
        let [near, far] = self.line.joins();
        let is_boundary = if from.reversed {
            near && place_of(start) == 0
        } else {
            far && place_of(start) == end_of(header.path_spans)
        };
        is_near && self.done == 1 && is_boundary && start == end && from.reversed != to.reversed
    }

    /// Goes on to the next line after a step-over; false after the last line. `rows`: those of the last passes.
    ///
    /// # Errors
    /// [`FaultKind::IntervalTooSmall`] where the step does not advance the line.
    pub(crate) fn go_on(&mut self, job: &Job<'_>, step: f32, rows: Option<&RowHistory>) -> Result<bool> {
        self.step = step;
        self.is_seeking = true;
        self.next_line(job, rows)
    }

    /// Moves the line by the step, or to the next cell; false after the last line of the last one. `rows`: those of the last passes, where there was one on the line.
    fn next_line(&mut self, job: &Job<'_>, rows: Option<&RowHistory>) -> Result<bool> {
        let Some(cell) = self.cell(job) else {
            return Ok(false);
        };
        let side = self.line.side();
        self.is_apart = rows.is_none();
        if side >= cell.last() {
            return Ok(self.next_cell(job, &cell));
        }
        let next = match self.line.begins_again(&cell) {
            Some(next) => {
                self.is_apart = true;
                next.max(side + 1)
            }
            None => {
                let width = |span| job.side_width(span);
                let from = place_from(side);
                // The last line lies on the boundary, or a place below it.
                let step = if cell.last() + 1 >= end_of(job.header.side_spans) {
                    schedule::to_point(job.header, self.step, from, width)
                } else {
                    self.step
                };
                let at = match rows {
                    Some(rows) => rows.next_side(job.header, from, step, width),
                    None => schedule::next_side(from, step, job.header.side_spans, width),
                };
                let at = at?;
                // At the end of the window the line stays in its last row.
                let is_within = at.fraction == u64::MAX && at.span + 1 < job.header.side_spans;
                place_of(at) - i32::from(is_within)
            }
        };
        if next <= side {
            return Err(Fault::new(FaultKind::IntervalTooSmall, self.step));
        }
        self.line.go_on(next.min(cell.last()), rows.is_none());
        Ok(true)
    }

    /// Goes to the first line of the next cell; false after the last one.
    fn next_cell(&mut self, job: &Job<'_>, cell: &CellWords<'_>) -> bool {
        let next = cell.next();
        let Some(cell) = job.region().and_then(|region| region.cell(next)) else {
            return false;
        };
        self.cell = next;
        self.is_apart = true;
        self.line.begin(cell.first(), i32::MIN);
        true
    }

    /// One portion of the search for the next pass.
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`] where a line meets too many edges; as [`Self::go_on`].
    #[inline(never)]
    pub(crate) fn seek(&mut self, job: &Job<'_>, pass: u32) -> Result<NextPass> {
        if self.has_more() {
            return Ok(NextPass::Found);
        }
        if !self.is_seeking {
            return Ok(NextPass::None);
        }
        if !self.line.is_done() {
            self.work_line(job, pass)?;
            return Ok(NextPass::Sought);
        }
        if self.line.intervals() == 0 {
            return Ok(if self.next_line(job, None)? {
                NextPass::Sought
            } else {
                self.is_seeking = false;
                NextPass::None
            });
        }
        self.is_seeking = false;
        self.done = 0;
        self.reversed = job.header.pattern == Pattern::Zigzag && !self.reversed;
        Ok(NextPass::Found)
    }
}

/// A line, or a curve, meets too many edges.
pub(crate) fn too_many(number: u32) -> Fault {
    Fault::new(FaultKind::BadPatch, crate::math::arith::count_to_f32(number))
}

/// The side parameter of a line: the boundary where the line is a unit or less below it, because no edge reaches it.
fn side_at(header: &Header, at: i32) -> SpanParameter {
    if at + 1 >= end_of(header.side_spans) {
        place_to(end_of(header.side_spans))
    } else {
        place_from(at)
    }
}
