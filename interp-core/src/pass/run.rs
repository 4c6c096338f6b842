//! A run of a job, sample by sample: the one file that chains the stages.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::{Job, Program};
use crate::job::{Pattern, Spacing};
use crate::math::arith::{advanced, dot_hi, fraction_to_f32, truncated};
use crate::pass::buffer::PatchBuffer;
use crate::pass::contact::{self, Reach};
use crate::pass::front::{FrontSequence, NextRoute};
use crate::pass::lines::{NextPass, RegionLines};
use crate::pass::patch::Patch;
use crate::pass::route::{Piece, Route};
use crate::pass::scan::PassScan;
use crate::pass::schedule;
use crate::pass::step_over::{PassMaximum, StepOverEstimator};
use crate::sample::{Sample, SpanParameter, interval_of};
use crate::surface::{AnyPass, Pass, PathSpeed};

/// Patch boundaries that one period's arc may cross. One is enough where every patch is longer than the arc; a second
/// crossing would add its cost to the worst-case tick.
const CROSSINGS_MAX: u8 = 1;

/// Step of the parameter on a pole: 16 per span. Between two steps the speed of the side lines, a rational cubic of the path
/// parameter, changes little.
const POLE_STEP: u64 = 1 << 60;

/// The same on a front, whose intervals are two periods long, except on short passes.
const CROSSINGS_ON_FRONT_MAX: u8 = 4;

/// The task of the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// Begin the pass at the current side parameter.
    Pass,
    /// Advance by one period's arc.
    Along,
    /// Find the next pass, and begin it.
    Over,
    /// None: the last sample was emitted.
    End,
}

/// Position and progress of the run.
#[derive(Clone, Copy, Debug)]
struct Travel {
    next: Next,
    route: Route,
    piece: Piece,
    /// Fraction of the span, in the direction of travel.
    fraction: u64,
    /// The parametrisation at the last sample, and the logarithmic speed derivative at the sample before; NaN where that is on another patch.
    path: PathSpeed,
    log_speed_derivative_before: f32,
    /// r N at the last sample, in the ball's units.
    offset: [i32; 3],
    /// Maximum inverse square interval of the pass, with the surface's curvature at that sample; see [`PassMaximum`].
    max_inv_interval_sq: f32,
    shape: [f32; 2],
    /// Samples so far.
    ticks: u32,
    pass: u32,
    /// Side parameter at the last sample.
    side: SpanParameter,
}

/// What is planned while the tool is on a pass, by the job's spacing.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "one lives in the interpolator for ever")]
enum PassPlanning {
    /// The step to the next straight pass.
    Scan(PassScan),
    /// The next front of a job of constant scallop height.
    Fronts(FrontSequence),
}

impl PassPlanning {
    /// The starts as constants, so that they are not made on the stack.
    const SCAN: Self = Self::Scan(PassScan::START);
    const FRONTS: Self = Self::Fronts(FrontSequence::START);
}

/// A run: the travel and the patch buffer.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    travel: Travel,
    buffer: PatchBuffer,
    planning: PassPlanning,
    /// r N at the pass's first sample.
    first_offset: [i32; 3],
    /// Minimum interval of the last finished pass, in units of the side parameter.
    last_interval: f32,
    /// Step-over from that pass to the next, in units of the side parameter, where it is known.
    step_over: Option<f32>,
    /// That pass, once its first patch is collapsed.
    next_route: Option<Route>,
    /// Feed factor of the last step along the pass.
    last_feed_factor: f32,
    /// The passes of a region, and the next of them without axis limits; a fault of theirs is reported when the tool is there.
    pub(crate) lines: RegionLines,
    next_pass: NextPass,
    pending: Option<Fault>,
}

impl Travel {
    const START: Self = Self {
        next: Next::Pass,
        route: Route::NONE,
        piece: Piece::NONE,
        fraction: 0,
        path: PathSpeed {
            inv_speed: 0.0,
            log_speed_derivative: 0.0,
        },
        log_speed_derivative_before: f32::NAN,
        offset: [0; 3],
        max_inv_interval_sq: 0.0,
        shape: [0.0; 2],
        ticks: 0,
        pass: 0,
        side: SpanParameter { span: 0, fraction: 0 },
    };

    /// Fraction of the span, in the surface's own direction.
    const fn own_fraction(&self) -> u64 {
        self.route.turned(self.fraction)
    }

    /// Path span, in the surface's own direction.
    const fn span(&self) -> u16 {
        self.piece.position.span
    }

    /// The place a step beyond, if it is on the piece.
    #[inline(always)]
    fn beyond(&self, step: u64) -> Option<u64> {
        advanced(self.fraction, step).filter(|fraction| *fraction <= self.piece.end())
    }

    /// Steps 2 to 4 at the run's position. A fault leaves `last` unchanged. Not inlined: a separate function for
    /// each kind of surface saves only the registers that the kind uses.
    #[inline(never)]
    fn sample<P: Pass>(&mut self, pass: &P, patch: &Patch, last: &mut Sample) -> Result<()> {
        let (contact, located) = patch.evaluate_on(pass, self.fraction)?;
        if patch.locator.folds(dot_hi(&self.offset, &contact.offset)) {
            return Err(folded());
        }
        let inv_interval_sq = patch.interval.inv_interval_sq(&contact);
        if inv_interval_sq > self.max_inv_interval_sq {
            self.max_inv_interval_sq = inv_interval_sq;
            self.shape = [contact.across, contact.lateral_squared];
        }
        self.offset = contact.offset;
        self.log_speed_derivative_before = self.path.log_speed_derivative;
        self.path = contact.path;
        last.tick = self.ticks;
        last.path.fraction = self.own_fraction();
        last.cc_nm = located.cc_nm;
        last.cl_nm = located.cl_nm;
        last.inv_interval_sq = inv_interval_sq;
        self.ticks = self.ticks.wrapping_add(1);
        Ok(())
    }
}

#[cold]
#[inline(never)]
fn folded() -> Fault {
    Fault::new(FaultKind::DegenerateSurface, 0.0)
}

impl Run {
    /// State before the first sample.
    pub(crate) const START: Self = Self {
        travel: Travel::START,
        buffer: PatchBuffer::START,
        planning: PassPlanning::SCAN,
        first_offset: [0; 3],
        last_interval: f32::INFINITY,
        step_over: None,
        next_route: None,
        last_feed_factor: 0.0,
        lines: RegionLines::START,
        next_pass: NextPass::Sought,
        pending: None,
    };

    /// Resets to the start of a job.
    pub(crate) fn restart(&mut self, program: &Program, job: &Job<'_>) {
        self.lines.restart(job, program.first_line());
        self.next_pass = NextPass::Sought;
        self.pending = None;
        match (&mut self.planning, program.header().spacing.is_constant()) {
            (PassPlanning::Scan(scan), false) => scan.restart(),
            (PassPlanning::Fronts(fronts), true) => fronts.stop(),
            (planning, true) => *planning = PassPlanning::FRONTS,
            (planning, false) => *planning = PassPlanning::SCAN,
        }
        self.travel = Travel::START;
        self.last_interval = f32::INFINITY;
        self.step_over = None;
        self.next_route = None;
    }

    /// A job was loaded: collapses the first patch of its first pass, ahead of the tick that begins it. A fault is left for that tick.
    pub(crate) fn prepare_start(&mut self, job: &Job<'_>) {
        self.buffer.forget();
        let is_scanned = matches!(self.planning, PassPlanning::Scan(_));
        // The rows of a streamed job may not be here yet; with limits the first pass is planned, and prepared on the way to it.
        if is_scanned && !self.lines.is_in_use() && job.header.window == 0 && job.header.axes.is_none() {
            let route = self.first_route(job);
            self.buffer.prepare(job, &route);
        }
    }

    /// The first pass.
    pub(crate) fn first_route(&mut self, job: &Job<'_>) -> Route {
        if let PassPlanning::Fronts(fronts) = &mut self.planning {
            return fronts.start(job);
        }
        let of_region = self.lines.take(job.header);
        of_region.unwrap_or_else(|| Route::of_pass(job.header, 0, SpanParameter::default()))
    }

    /// Pass, path and side parameter of the tool, in the surface's own direction.
    pub(crate) const fn surface_position(&self) -> (u32, SpanParameter, SpanParameter) {
        let travel = &self.travel;
        let path = SpanParameter {
            span: travel.span(),
            fraction: travel.own_fraction(),
        };
        (travel.pass, path, travel.side)
    }

    /// Minimum path interval of the last finished pass.
    pub(crate) const fn last_interval(&self) -> f32 {
        self.last_interval
    }

    /// Whether the next sample continues the pass.
    pub(crate) fn is_along(&self) -> bool {
        self.travel.next == Next::Along
    }

    /// Writes the next sample into `last`; false after the last sample.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is unchanged.
    #[inline(always)]
    pub(crate) fn advance(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<bool> {
        let travel = &mut self.travel;
        if travel.next == Next::Along {
            let step = contact::step(
                &travel.path,
                travel.log_speed_derivative_before,
                self.buffer.patch().arc,
            );
            if let Some(fraction) = step.and_then(|step| travel.beyond(step)) {
                travel.fraction = fraction;
                self.sample(last)?;
                if self.buffer.has_work() {
                    self.buffer.work(job, &self.travel.route, &self.travel.piece);
                }
                return Ok(true);
            }
        }
        self.advance_far(job, 1.0, last)
    }

    /// The next sample where the short path of [`Self::advance`] does not apply: `feed_factor` of a period's arc along the pass, or the next pass.
    ///
    /// # Errors
    /// As [`Self::advance`].
    #[inline(never)]
    pub(crate) fn advance_far(&mut self, job: &Job<'_>, feed_factor: f32, last: &mut Sample) -> Result<bool> {
        let begins = !self.is_along();
        match self.travel.next {
            Next::Along if self.buffer.patch().point => self.step_on_pole(job)?,
            Next::Along => self.step_far(job, feed_factor)?,
            Next::Pass | Next::Over => match self.change_pass(job)? {
                Some(true) => {}
                Some(false) => {
                    self.stand(last);
                    return Ok(true);
                }
                None => return Ok(false),
            },
            Next::End => return Ok(false),
        }
        self.sample(last)?;
        let travel = &self.travel;
        if begins {
            self.first_offset = travel.offset;
        }
        if travel.next != Next::Along {
            self.last_interval = interval_of(travel.max_inv_interval_sq);
        }
        let travel = &self.travel;
        last.pass = travel.pass;
        last.path.span = travel.span();
        last.side = travel.side;
        last.feed_mm_s = if self.buffer.patch().point {
            0.0
        } else {
            job.header.feed_mm_s * feed_factor
        };
        Ok(true)
    }

    /// Begins the first pass, or the next one. False where that is not made yet; none where there is none.
    #[inline(never)]
    fn change_pass(&mut self, job: &Job<'_>) -> Result<Option<bool>> {
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
                let Some(route) = self.lines.take(job.header) else {
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

    /// Collapses the first patch of this pass. The tool does not move.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn enter_pass(&mut self, job: &Job<'_>, pass: u32, route: Route) -> Result<()> {
        if pass > 0 && job.header.pattern == Pattern::Zig {
            self.travel.offset = self.first_offset;
        }
        self.travel.pass = pass;
        self.begin_pass(job, route)
    }

    /// Collapses the first patch of a pass ahead of [`Self::enter_pass`], once the present pass needs no further patch.
    pub(crate) fn prepare_pass(&mut self, job: &Job<'_>, route: &Route) {
        self.buffer.prepare(job, route);
    }

    /// Emits the first sample of the pass that was entered; its minimum interval is known from the look-ahead.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn begin(&mut self, interval: f32, last: &mut Sample) -> Result<()> {
        self.sample(last)?;
        self.first_offset = self.travel.offset;
        self.last_interval = interval;
        self.last_feed_factor = 0.0;
        self.describe(0.0, last);
        Ok(())
    }

    /// Prepares the pass that a turn leads to, at its start, without a sample.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn arrive(&mut self, job: &Job<'_>, pass: u32, route: Route, interval: f32) -> Result<()> {
        self.enter_pass(job, pass, route)?;
        let ticks = self.travel.ticks;
        let mut start = Sample::START;
        self.sample(&mut start)?;
        self.travel.ticks = ticks;
        self.first_offset = self.travel.offset;
        self.last_interval = interval;
        self.last_feed_factor = 0.0;
        Ok(())
    }

    /// Advances by `feed_factor` of a period's arc along the pass.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn move_by(&mut self, job: &Job<'_>, feed_factor: f32, last: &mut Sample) -> Result<()> {
        let travel = &mut self.travel;
        // The third-order term assumes equal steps: the change over the last step is scaled to this one.
        let change = (travel.path.log_speed_derivative - travel.log_speed_derivative_before)
            * (feed_factor / self.last_feed_factor);
        let before = travel.path.log_speed_derivative - change;
        self.last_feed_factor = feed_factor;
        let step = contact::step(&travel.path, before, feed_factor * self.buffer.patch().arc);
        if let Some(fraction) = step.and_then(|step| travel.beyond(step)) {
            travel.fraction = fraction;
            self.sample(last)?;
            last.feed_mm_s = job.header.feed_mm_s * feed_factor;
            if self.buffer.has_work() {
                self.buffer.work(job, &self.travel.route, &self.travel.piece);
            }
            return Ok(());
        }
        let interval = self.last_interval;
        self.step_far(job, feed_factor)?;
        self.sample(last)?;
        self.last_interval = interval;
        self.describe(job.header.feed_mm_s * feed_factor, last);
        Ok(())
    }

    /// Moves to the end of the pass, which differs from the position by rounding only.
    ///
    /// # Errors
    /// As [`Self::advance`]; [`FaultKind::PatchTooShort`] where a whole patch is still left.
    pub(crate) fn finish_pass(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<()> {
        if self.is_along() {
            let travel = &self.travel;
            let is_last = travel.route.next(job, &travel.piece).is_none();
            if !is_last && !self.next_piece(job)? {
                return Err(Fault::new(FaultKind::PatchTooShort, 0.0));
            }
            self.end_pass(job);
            self.sample(last)?;
            self.describe(0.0, last);
        } else {
            self.stand(last);
        }
        Ok(())
    }

    /// The sample of the place where the tool stands on a pass, after it was away from there.
    ///
    /// # Errors
    /// As [`Self::advance`].
    #[cold]
    #[inline(never)]
    pub(crate) fn show(&mut self, last: &mut Sample) -> Result<()> {
        let before = self.travel.log_speed_derivative_before;
        // The period is counted already.
        let ticks = self.travel.ticks;
        self.travel.ticks = last.tick;
        self.sample(last)?;
        (self.travel.log_speed_derivative_before, self.travel.ticks) = (before, ticks);
        self.describe(0.0, last);
        Ok(())
    }

    /// The number of the pass that the tool is on its way to.
    pub(crate) const fn expect_pass(&mut self, pass: u32) {
        self.travel.pass = pass;
    }

    /// A period at standstill.
    pub(crate) const fn stand(&mut self, last: &mut Sample) {
        last.tick = self.travel.ticks;
        last.feed_mm_s = 0.0;
        self.travel.ticks = self.travel.ticks.wrapping_add(1);
    }

    /// A period off the passes.
    pub(crate) const fn off_surface(&mut self, at_nm: [i32; 3], speed_mm_s: f32, last: &mut Sample) {
        self.stand(last);
        last.feed_mm_s = speed_mm_s;
        // The sample may still hold fields of the previous job.
        last.pass = self.travel.pass;
        (last.path, last.side) = (SpanParameter::NONE, SpanParameter::NONE);
        (last.cc_nm, last.cl_nm) = (at_nm, at_nm);
        last.inv_interval_sq = 0.0;
    }

    /// Whether the patch after this one is being prepared: an item a tick.
    pub(crate) fn prepares_patch(&self) -> bool {
        self.buffer.has_work()
    }

    /// Number of the patch from the start of the pass, and of the cell within the patch, at the position, for a number of cells per patch; none where
    /// the pass is over.
    pub(crate) fn cell(&self, cells_per_patch: u16) -> Option<[u16; 2]> {
        if !self.is_along() {
            return None;
        }
        let travel = &self.travel;
        if let Some(front) = &travel.piece.front {
            return Some([front.number, 0]);
        }
        let [start, _] = travel.route.ends;
        let patch = travel.span().abs_diff(start.span);
        let piece = &travel.piece;
        let within = if piece.is_whole() {
            let high = (travel.fraction >> 32) * u64::from(cells_per_patch);
            u16::try_from(high >> 32).unwrap_or(0)
        } else {
            let part = fraction_to_f32(travel.fraction.saturating_sub(piece.start()))
                / fraction_to_f32(piece.end().saturating_sub(piece.start()));
            let cell = u16::try_from(truncated(part * f32::from(cells_per_patch))).unwrap_or(0);
            cell.min(cells_per_patch.saturating_sub(1))
        };
        Some([patch, within])
    }

    /// Arc since the start of a cell of [`Self::cell`], mm, by the number of cells per patch and the fraction of a whole patch in one of them; none where, by
    /// rounding, the position is before the cell.
    pub(crate) fn since_station(&self, [_, within]: [u16; 2], (cells, part): (u16, u64)) -> Option<f32> {
        let travel = &self.travel;
        let piece = &travel.piece;
        let part = if piece.is_whole() {
            part
        } else {
            let length = piece.end().saturating_sub(piece.start());
            length.checked_div(u64::from(cells))?
        };
        let start = piece.start() + u64::from(within).wrapping_mul(part);
        let length = fraction_to_f32(travel.fraction.checked_sub(start)?);
        let mean = 1.0 - 0.5 * travel.path.log_speed_derivative * length;
        Some(length * mean / (travel.path.inv_speed * self.buffer.patch().per_mm))
    }

    /// Arc to the end of the pass, mm, by Hermite's two-point rule; none before its last piece, and where its end is not evaluated.
    pub(crate) fn arc_left(&self, job: &Job<'_>) -> Option<f32> {
        let (travel, patch) = (&self.travel, self.buffer.patch());
        if !self.is_along() || !patch.has_ends() || travel.route.next(job, &travel.piece).is_some() {
            return None;
        }
        let length = fraction_to_f32(travel.piece.end().checked_sub(travel.fraction)?);
        let (here, end) = (&travel.path, patch.end());
        let (first, last) = (1.0 / here.inv_speed, 1.0 / end.inv_speed);
        let bow = first * here.log_speed_derivative - last * end.log_speed_derivative;
        let mean = 0.5 * (first + last) + bow * length * (1.0 / 12.0);
        // Not at a pole, where the speed is 0.
        let mm = length * mean / patch.per_mm;
        mm.is_finite().then_some(mm)
    }

    /// Whether the surface faces up at the tool, so that the tool can retract upwards.
    pub(crate) fn faces_up(&self) -> bool {
        self.buffer.patch().faces_up(self.travel.offset)
    }

    /// Writes the fields of a sample that change only with the pass.
    const fn describe(&self, feed_mm_s: f32, last: &mut Sample) {
        last.pass = self.travel.pass;
        last.path.span = self.travel.span();
        last.side = self.travel.side;
        last.feed_mm_s = feed_mm_s;
    }

    /// The sample at the run's position.
    #[inline(always)]
    fn sample(&mut self, last: &mut Sample) -> Result<()> {
        let Self { travel, buffer, .. } = self;
        let patch = buffer.patch();
        match patch.surface.pass() {
            AnyPass::Polynomial(pass) => travel.sample(&pass, patch, last),
            AnyPass::Ruled(pass) => travel.sample(&pass, patch, last),
            AnyPass::Extruded(pass) => travel.sample(&pass, patch, last),
            AnyPass::Rational(pass) => travel.sample(&pass, patch, last),
            AnyPass::Pole(pass) => travel.sample(&pass, patch, last),
            AnyPass::Profile(pass) => travel.sample(pass, patch, last),
            AnyPass::Circle(pass) => travel.sample(pass, patch, last),
            AnyPass::Curve(pass) => {
                travel.sample(pass, patch, last)?;
                travel.side = SpanParameter {
                    span: travel.piece.position.side.span,
                    fraction: pass.side(travel.fraction).fraction,
                };
                last.side = travel.side;
                Ok(())
            }
        }
    }

    /// `feed_factor` of a period's arc along the pass, by quadrature, across at most [`CROSSINGS_MAX`] boundaries.
    fn step_far(&mut self, job: &Job<'_>, feed_factor: f32) -> Result<()> {
        let mut rest = feed_factor * job.header.feed_mm_s * job.header.period_s;
        let mut start = self.travel.path;
        let most = if self.travel.route.front.is_some() {
            CROSSINGS_ON_FRONT_MAX
        } else {
            CROSSINGS_MAX
        };
        for crossings in 0..=CROSSINGS_ON_FRONT_MAX {
            let Self { travel, buffer, .. } = self;
            let patch = buffer.patch();
            let arc = rest * patch.per_mm;
            let end = || Some(patch.end());
            let path_at = |fraction| patch.surface.path_at(fraction);
            let covered =
                match contact::solve(path_at, [travel.fraction, travel.piece.end()], &start, end, arc)? {
                    Reach::Within(fraction) => {
                        travel.fraction = fraction;
                        return Ok(());
                    }
                    Reach::Beyond(covered) => covered,
                };
            rest = (arc - covered) / patch.per_mm;
            if self.travel.route.next(job, &self.travel.piece).is_none() {
                self.end_pass(job);
                return Ok(());
            }
            if crossings == most {
                break;
            }
            self.next_piece(job)?;
            start = self.buffer.patch().start().checked()?;
        }
        Err(Fault::new(FaultKind::PatchTooShort, rest))
    }

    /// On a pole, advances the path parameter: the tool stands, but the interval that the pass allows depends on the parameter.
    fn step_on_pole(&mut self, job: &Job<'_>) -> Result<()> {
        if let Some(fraction) = self.travel.beyond(POLE_STEP) {
            self.travel.fraction = fraction;
        } else if !self.next_piece(job)? {
            self.end_pass(job);
        }
        Ok(())
    }

    /// Moves to the start of the next piece of the pass; false at the pass's end.
    fn next_piece(&mut self, job: &Job<'_>) -> Result<bool> {
        let travel = &mut self.travel;
        let Some(piece) = travel.route.next(job, &travel.piece) else {
            return Ok(false);
        };
        travel.piece = piece;
        travel.fraction = piece.start();
        travel.path.log_speed_derivative = f32::NAN;
        self.buffer.advance(job, &travel.route, &piece)?;
        Ok(true)
    }

    /// Begins a pass.
    fn begin_pass(&mut self, job: &Job<'_>, route: Route) -> Result<()> {
        let travel = &mut self.travel;
        let side_before = travel.route.side;
        travel.route = route;
        travel.side = route.side;
        if route.front.is_some() {
            // Fronts begin at places that are not next to each other.
            travel.offset = [0; 3];
        }
        travel.piece = route.first(job);
        travel.fraction = travel.piece.start();
        // The maximum is that of all passes on the line.
        let goes_on = travel.pass > 0 && route.side == side_before;
        if !goes_on {
            travel.max_inv_interval_sq = 0.0;
        }
        if job.header.edges > 0 {
            // The surface may have turned away in between.
            travel.offset = [0; 3];
        }
        travel.next = Next::Along;
        travel.path.log_speed_derivative = f32::NAN;
        if let PassPlanning::Scan(scan) = &mut self.planning {
            // With limits the estimator is the look-ahead's.
            if job.header.axes.is_none() {
                scan.estimator().enter_row(route.side.span);
            }
            scan.begin(&route, goes_on);
        }
        self.buffer.begin(job, &travel.route, &travel.piece)
    }

    /// Whether [`Self::plan`] has anything to do.
    pub(crate) fn has_to_plan(&self, spacing: Spacing) -> bool {
        match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.has_work(),
            PassPlanning::Scan(scan) => {
                spacing == Spacing::Exact && (scan.has_work() || self.is_step_due()) || self.is_pass_due()
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

    /// The planning of one period without axis limits: scans the pass for the step to the next one, or makes the next front in the words behind the job's.
    pub(crate) fn plan(&mut self, job: &Job<'_>, rest: &mut [i32]) {
        let has_work = match &mut self.planning {
            PassPlanning::Fronts(fronts) => return fronts.plan(job, rest),
            PassPlanning::Scan(scan) => {
                scan.plan(job);
                scan.has_work()
            }
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

    /// Collapses the first patch of the pass a step away, ahead of the tick that begins it. A fault is left for that tick.
    fn prepare_step_over(&mut self, job: &Job<'_>, step: f32) {
        // The rows of a streamed job may not be here yet.
        if job.header.window == 0
            && let Ok(side) = self.side_after(job, step)
        {
            let route = Route::of_pass(job.header, self.travel.pass.wrapping_add(1), side);
            self.buffer.prepare(job, &route);
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
            return Ok(if self.lines.go_on(job, step)? {
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
        match (&mut self.planning, job.header.spacing) {
            (PassPlanning::Scan(scan), Spacing::Exact) => scan.step(
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

    /// Makes a portion of the next front, in the words behind the job's. Returns its cycles.
    pub(crate) fn make_front(&mut self, job: &Job<'_>, rest: &mut [i32]) -> u32 {
        match &mut self.planning {
            PassPlanning::Fronts(fronts) => fronts.work(job, rest),
            PassPlanning::Scan(_) => 0,
        }
    }

    /// The pass after the latest one of a job of constant scallop height.
    ///
    /// # Errors
    /// As [`FrontSequence::next`].
    pub(crate) fn next_pass(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        match &mut self.planning {
            PassPlanning::Fronts(fronts) => fronts.next(job),
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

    /// The next pass. Its first sample is adjacent to the last pass's first, or to its last where the
    /// pattern is zigzag.
    fn step_over(&mut self, job: &Job<'_>) -> Result<NextRoute> {
        if let PassPlanning::Fronts(fronts) = &mut self.planning {
            let next = fronts.next(job)?;
            if let NextRoute::Pass(_) = next {
                fronts.arrive();
                self.travel.pass = self.travel.pass.wrapping_add(1);
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

    /// The first and the last row of patches that the next tick and the planning after it need, where the next tick begins a pass.
    pub(crate) fn rows_needed(&mut self, job: &Job<'_>) -> Option<[u16; 2]> {
        if self.travel.next != Next::Over {
            return None;
        }
        let step = match self.step_over {
            Some(step) => step,
            None => self.find_step_over(job),
        };
        self.step_over = Some(step);
        // A step that is too small is reported by the tick.
        let side = self.side_after(job, step).ok()?;
        match &self.planning {
            PassPlanning::Scan(scan) => Some(scan.estimator_ref().rows_needed(job, side)),
            PassPlanning::Fronts(_) => None,
        }
    }

    /// The same for the look-ahead of a job with limits, over the next pass at this side parameter.
    pub(crate) fn rows_ahead(&self, job: &Job<'_>, side: SpanParameter) -> Option<[u16; 2]> {
        match &self.planning {
            PassPlanning::Scan(scan) => Some(scan.estimator_ref().rows_needed(job, side)),
            PassPlanning::Fronts(_) => None,
        }
    }

    /// Row of patches that the tool is in.
    pub(crate) const fn row(&self) -> u16 {
        self.travel.route.side.span
    }

    /// Whether the run is exactly at the end of the pass.
    fn end_pass(&mut self, job: &Job<'_>) {
        self.travel.fraction = self.travel.piece.end();
        let last = match &self.planning {
            PassPlanning::Fronts(fronts) => fronts.is_over(),
            PassPlanning::Scan(_) => {
                schedule::is_last(self.travel.route.side, job.header.side_spans) && job.header.edges == 0
            }
        };
        self.travel.next = if last { Next::End } else { Next::Over };
    }
}

#[cfg(test)]
mod tests;
