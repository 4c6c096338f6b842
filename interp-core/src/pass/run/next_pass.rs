//! From pass to pass: the planning of the next pass while the tool is on the current one, and the begin of the next pass.

use super::Run;
use super::ahead::Prepared;
use super::travel::{FirstSample, Next, Travel};
use crate::fault::Result;
use crate::job::program::Job;
use crate::job::stream::RowsNeeded;
use crate::job::{Pattern, Spacing};
use crate::pass::front::{FrontSequence, NextRoute};
use crate::pass::lines::{NextPass, RegionLines};
use crate::pass::route::Route;
use crate::pass::scan::PassScan;
use crate::pass::step_over::{PassMaximum, StepOverEstimator};
use crate::sample::SpanParameter;

/// The offset before the first sample of a pass on a front, which may begin far from both ends of the last one: no normal folds against it.
pub(super) const BEGINS_ANYWHERE: [i32; 3] = [0; 3];

/// What is planned while the tool is on a pass, by the job's spacing.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "one lives in the interpolator for ever")]
pub(super) enum PassPlanning {
    /// The step to the next straight pass.
    Scan(PassScan),
    /// The next front of a job of constant scallop height.
    Fronts(FrontSequence),
}

impl PassPlanning {
    /// The starts as constants, so that they are not made on the stack.
    pub(super) const SCAN: Self = Self::Scan(PassScan::START);
    pub(super) const FRONTS: Self = Self::Fronts(FrontSequence::START);
}

impl Run {
    /// Begins the first pass, or the next one. `Some(false)`: that pass is not made yet; `None`: there is no further pass.
    #[inline(never)]
    pub(super) fn change_pass(&mut self, job: &Job<'_>) -> Result<Option<bool>> {
        let next = if self.travel.next == Next::Pass {
            NextRoute::Pass(self.first_route(job))
        } else if self.lines.is_in_use() {
            self.take_pass(job)?
        } else {
            self.step_over(job)?
        };
        match next {
            NextRoute::Pass(route) => self.begin_pass(job, route)?,
            NextRoute::NotYet => return Ok(Some(false)),
            NextRoute::None => return Ok(None),
        }
        Ok(Some(true))
    }

    /// The next pass of a region, once it is known.
    fn take_pass(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        if let Some(fault) = self.pending {
            return Err(fault);
        }
        match self.next_pass {
            NextPass::Found => {
                let Some(route) = self.lines.next_route(job.header) else {
                    return Ok(NextRoute::None);
                };
                self.next_pass = NextPass::Sought;
                self.travel.pass = self.travel.pass.wrapping_add(1);
                Ok(NextRoute::Pass(route))
            }
            NextPass::None => Ok(NextRoute::None),
            // It stands until the next pass is known.
            NextPass::Sought => Ok(NextRoute::NotYet),
        }
    }

    /// The next pass. Its first sample is adjacent to the last pass's first, or to its last where the
    /// pattern is zigzag.
    fn step_over(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        if let PassPlanning::Fronts(fronts) = &mut self.planning {
            if let Some(fault) = self.pending {
                return Err(fault);
            }
            let next = match self.next_route.take() {
                Some(route) => NextRoute::Pass(route),
                None => fronts.next(job, &mut self.lines)?,
            };
            if let NextRoute::Pass(_) = next {
                fronts.arrive();
                self.travel.pass = self.travel.pass.wrapping_add(1);
                self.travel.offset = BEGINS_ANYWHERE;
            }
            return Ok(next);
        }
        let step = self.step_over.take();
        let pass = self.travel.pass.wrapping_add(1);
        let route = if let Some(route) = self.next_route.take() {
            route
        } else {
            let step = match step {
                Some(step) => step,
                None => self.find_step_over(job),
            };
            Route::of_pass(job.header, pass, self.side_after(job, step)?)
        };
        self.travel.pass = pass;
        if job.header.pattern == Pattern::Zig {
            self.travel.offset = self.first_offset;
        }
        Ok(NextRoute::Pass(route))
    }

    /// Side parameter of the next pass, a step away.
    fn side_after(&self, job: &Job<'_>, step: f32) -> Result<SpanParameter> {
        let side = self.travel.route.side;
        match &self.planning {
            PassPlanning::Scan(scan) => scan.estimator_ref().next_side(job, side, step),
            PassPlanning::Fronts(_) => Ok(side),
        }
    }

    /// Whether [`Self::plan`] has anything to do.
    pub(crate) fn has_to_plan(&self, spacing: Spacing) -> bool {
        self.has_to_prepare() || self.has_to_plan_pass(spacing) || self.may_move_ahead()
    }

    fn has_to_plan_pass(&self, spacing: Spacing) -> bool {
        match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.has_work() || self.is_front_due(),
            PassPlanning::Scan(scan) => {
                spacing.is_exact() && (scan.has_work() || self.is_step_due()) || self.is_pass_due()
            }
        }
    }

    /// Whether the next pass of a region is to be sought.
    fn is_pass_due(&self) -> bool {
        self.lines.is_in_use()
            && self.travel.next == Next::Over
            && self.next_pass == NextPass::Sought
            && self.pending.is_none()
    }

    /// Whether the pass is over, and the step to the next one is not known yet.
    fn is_step_due(&self) -> bool {
        self.travel.next == Next::Over && self.step_over.is_none()
    }

    /// The planning of one period without axis limits, of which some cycles are spent already: scans the pass for the step to the next one, or makes the next
    /// front in the words after the job's.
    pub(crate) fn plan(&mut self, job: &Job<'_>, rest: &mut [i32], spent: u32) {
        let has_work = match &mut self.planning {
            PassPlanning::Fronts(fronts) => return fronts.plan(job, rest, &mut self.lines, spent),
            PassPlanning::Scan(scan) if job.header.spacing.is_exact() => {
                scan.plan(job);
                scan.has_work()
            }
            PassPlanning::Scan(_) => false,
        };
        if self.lines.is_in_use() {
            if self.is_pass_due() && !has_work {
                match self.seek_pass(job) {
                    Ok(next) => self.next_pass = next,
                    Err(fault) => self.pending = Some(fault),
                }
            }
        } else if self.is_step_due() && !has_work {
            let step = self.find_step_over(job);
            self.step_over = Some(step);
            self.prepare_step_over(job, step);
        }
    }

    /// Whether the pass is over, and the next one on a front can be prepared.
    fn is_front_due(&self) -> bool {
        match &self.planning {
            PassPlanning::Fronts(fronts) => {
                self.travel.next == Next::Over
                    && self.next_route.is_none()
                    && self.pending.is_none()
                    && !fronts.has_work()
            }
            PassPlanning::Scan(_) => false,
        }
    }

    /// Prepares the next pass of a job of constant scallop height without limits, ahead of the tick that begins it, once the pass is over and its front made.
    pub(crate) fn prepare_front(&mut self, job: &Job<'_>) {
        if !self.is_front_due() {
            return;
        }
        match self.next_pass(job) {
            Ok(NextRoute::Pass(route)) => {
                self.prepare_pass(job, &route);
                self.next_route = Some(route);
            }
            Ok(NextRoute::NotYet | NextRoute::None) => {}
            Err(fault) => self.pending = Some(fault),
        }
    }

    /// Collapses the first patch of the pass a step away, ahead of the tick that begins it. A fault is left for that tick.
    fn prepare_step_over(&mut self, job: &Job<'_>, step: f32) {
        // The rows of a streamed job may not be here yet.
        if job.header.window == 0
            && let Ok(side) = self.side_after(job, step)
        {
            let route = Route::of_pass(job.header, self.travel.pass.wrapping_add(1), side);
            self.prepare_pass(job, &route);
            self.next_route = Some(route);
        }
    }

    /// A portion of the search for the next pass of a region.
    ///
    /// # Errors
    /// As [`RegionLines::seek`].
    #[inline(never)]
    fn seek_pass(&mut self, job: &Job<'_>) -> Result<NextPass> {
        if self.lines.is_line_over() {
            let step = self.find_step_over(job);
            let rows = match &self.planning {
                PassPlanning::Scan(scan) => Some(scan.estimator_ref().rows()),
                PassPlanning::Fronts(_) => None,
            };
            return Ok(if self.lines.go_on(job, step, rows)? {
                NextPass::Sought
            } else {
                NextPass::None
            });
        }
        self.lines.seek(job, self.travel.pass)
    }

    /// The step to the next pass.
    #[inline(never)]
    fn find_step_over(&mut self, job: &Job<'_>) -> f32 {
        let Travel {
            max_inv_interval_sq,
            shape,
            ..
        } = self.travel;
        match &mut self.planning {
            PassPlanning::Scan(scan) if job.header.spacing.is_exact() => scan.step(
                job,
                PassMaximum {
                    inv_interval_sq: max_inv_interval_sq,
                    shape,
                },
            ),
            _ => self.last_interval,
        }
    }

    /// The estimator of the step to the next straight pass, and the lines of a region.
    pub(crate) const fn estimator_and_lines(&mut self) -> (Option<&mut StepOverEstimator>, &mut RegionLines) {
        let estimator = match &mut self.planning {
            PassPlanning::Scan(scan) => Some(scan.estimator()),
            PassPlanning::Fronts(_) => None,
        };
        (estimator, &mut self.lines)
    }

    pub(crate) const fn estimator_ref(&self) -> Option<&StepOverEstimator> {
        match &self.planning {
            PassPlanning::Scan(scan) => Some(scan.estimator_ref()),
            PassPlanning::Fronts(_) => None,
        }
    }

    /// Cycles of the next portion of the next front; 0 where there is none.
    pub(crate) const fn front_cycles(&self) -> u32 {
        match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.cycles(),
            PassPlanning::Scan(_) => 0,
        }
    }

    /// Whether the next pass is another part of the front, and found.
    pub(crate) const fn has_part(&self) -> bool {
        match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.has_part(),
            PassPlanning::Scan(_) => false,
        }
    }

    /// Makes a portion of the next front, in the words after the job's. Returns its cycles.
    pub(crate) fn make_front(&mut self, job: &Job<'_>, rest: &mut [i32]) -> u32 {
        match &mut self.planning {
            PassPlanning::Fronts(fronts) => fronts.work(job, rest, &mut self.lines),
            PassPlanning::Scan(_) => 0,
        }
    }

    /// The pass after the latest one of a job of constant scallop height.
    ///
    /// # Errors
    /// As [`FrontSequence::next`].
    pub(crate) fn next_pass(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        match &mut self.planning {
            PassPlanning::Fronts(fronts) => fronts.next(job, &mut self.lines),
            PassPlanning::Scan(_) => Ok(NextRoute::None),
        }
    }

    /// Whether there is no pass after the latest one, of a job of constant scallop height.
    pub(crate) const fn is_last_pass(&self) -> bool {
        match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.is_over(),
            PassPlanning::Scan(_) => false,
        }
    }

    /// Whether the pass after the latest one is on a front that may not be made yet.
    pub(crate) const fn needs_front(&self) -> bool {
        match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.needs_front(),
            PassPlanning::Scan(_) => false,
        }
    }

    /// The tool leaves the pass before the latest one. Returns whether the next front is begun.
    pub(crate) const fn arrive_on_front(&mut self) -> bool {
        match &mut self.planning {
            PassPlanning::Fronts(fronts) => fronts.arrive(),
            PassPlanning::Scan(_) => false,
        }
    }

    /// The rows of patches that the next tick and the planning after it need, where the next tick begins a pass.
    pub(crate) fn rows_needed(&mut self, job: &Job<'_>) -> Option<RowsNeeded> {
        if self.travel.next != Next::Over {
            return None;
        }
        if self.lines.is_in_use() {
            let side = self
                .lines
                .next_side(job.header)
                .filter(|_| self.next_pass == NextPass::Found && self.pending.is_none());
            return side.and_then(|side| self.rows_ahead(job, side));
        }
        let step = match self.step_over {
            Some(step) => step,
            None => self.find_step_over(job),
        };
        self.step_over = Some(step);
        // A step that is too small is reported by the tick.
        let side = self.side_after(job, step).ok()?;
        self.rows_ahead(job, side)
    }

    /// The rows that the look-ahead of a job with limits needs over the next pass, at this side parameter; `None` for curved passes, which are not streamed.
    pub(crate) fn rows_ahead(&self, job: &Job<'_>, side: SpanParameter) -> Option<RowsNeeded> {
        match &self.planning {
            PassPlanning::Scan(scan) => Some(scan.estimator_ref().rows_needed(job, side)),
            PassPlanning::Fronts(_) => None,
        }
    }

    /// Whether the planning of the next pass, in this row, has to wait until its rows were asked for.
    pub(crate) fn lacks_rows(&self, job: &Job<'_>, row: u16) -> bool {
        let estimator = self.estimator_ref();
        estimator.is_some_and(|estimator| estimator.rows().lacks(job.header, row))
    }

    /// Row of patches that the tool is in.
    pub(crate) const fn row(&self) -> u16 {
        self.travel.route.side.span
    }

    /// The first pass, where it is not known from [`Self::prepare_start`].
    pub(crate) fn take_first_route(&mut self, job: &Job<'_>) -> Route {
        match self.next_route.take() {
            Some(route) => route,
            None => self.first_route(job),
        }
    }

    /// The first pass.
    pub(crate) fn first_route(&mut self, job: &Job<'_>) -> Route {
        if let PassPlanning::Fronts(fronts) = &mut self.planning {
            return fronts.start(job, &mut self.lines);
        }
        let of_region = self.lines.next_route(job.header);
        of_region.unwrap_or_else(|| Route::of_pass(job.header, 0, SpanParameter::default()))
    }

    /// Begins the first pass, ahead of the tick that starts the run. Returns whether that is done; a fault is left for that tick, and so is
    /// all of it for a streamed job, whose rows may not be here yet. With limits the first pass is planned, and prepared on the way to it.
    pub(crate) fn prepare_start(&mut self, job: &Job<'_>) -> bool {
        self.buffer.forget();
        if job.header.window > 0 {
            return false;
        }
        let route = self.first_route(job);
        if job.header.axes.is_some() {
            self.next_route = Some(route);
            return true;
        }
        let is_begun = self.begin_pass(job, route).is_ok();
        if is_begun {
            self.travel.next = Next::Begun;
            let first = FirstSample::of(self.buffer.patch(), &self.travel.piece);
            self.prepared = first.map_or(Prepared::Nothing, Prepared::First);
        }
        is_begun
    }
}
