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
        step: 0.0,
    };

    /// Resets to the first line of a job with a region.
    pub(crate) fn restart(&mut self, job: &Job<'_>, first: &FirstLine) {
        self.is_in_use = false;
        self.reversed = false;
        self.done = 0;
        self.cell = 0;
        self.is_seeking = false;
        if let Some(cell) = self.cell(job) {
            self.line.restart(first);
            // It was checked at load.
            self.is_in_use = self.line.finish(&cell, end_of(job.header.path_spans)).is_ok();
        }
    }

    /// The words of the cell.
    fn cell<'a>(&self, job: &Job<'a>) -> Option<CellWords<'a>> {
        job.region()?.cell(self.cell)
    }

    /// The line, for the checks of a job that is loaded.
    pub(crate) const fn scratch(&mut self) -> &mut ScanLine {
        &mut self.line
    }

    /// Whether the job has a region.
    pub(crate) const fn is_in_use(&self) -> bool {
        self.is_in_use
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
    pub(crate) fn take(&mut self, header: &Header) -> Option<Route> {
        if !self.has_more() {
            return None;
        }
        let index = if self.reversed {
            self.line.intervals().saturating_sub(1 + self.done)
        } else {
            self.done
        };
        let [from, to] = self.line.interval(index)?;
        self.done += 1;
        let ends = if self.reversed {
            [place_to(to), place_from(from)]
        } else {
            [place_from(from), place_to(to)]
        };
        Some(Route {
            side: side_at(header, self.line.side()),
            reversed: self.reversed,
            ends,
            front: None,
        })
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
        if side >= cell.last() {
            return Ok(self.next_cell(job, &cell));
        }
        let next = match self.line.begins_again(&cell) {
            Some(next) => next.max(side + 1),
            None => {
                let width = |span| job.side_width(span);
                let from = place_from(side);
                let at = match rows {
                    Some(rows) => rows.next_side(job.header, from, self.step, width),
                    None => schedule::next_side(from, self.step, job.header.side_spans, width),
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
        self.line.begin(cell.first());
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
        let Some(cell) = self.cell(job) else {
            return Ok(NextPass::None);
        };
        if !self.is_seeking {
            return Ok(NextPass::None);
        }
        if !self.line.is_done() {
            let worked = self.line.work(&cell, end_of(job.header.path_spans));
            if worked.is_err() {
                let pass = crate::math::arith::count_to_f32(pass);
                return Err(Fault::new(FaultKind::BadPatch, pass));
            }
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

/// The side parameter of a line: the boundary where the line is a unit or less below it, because no edge reaches it.
fn side_at(header: &Header, at: i32) -> SpanParameter {
    if at + 1 >= end_of(header.side_spans) {
        place_to(end_of(header.side_spans))
    } else {
        place_from(at)
    }
}
