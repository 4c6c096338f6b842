//! A run of a job, sample by sample: chains the stages.
//!
//! | file | holds |
//! |---|---|
//! | [`travel`] | position and progress, and the sample there |
//! | [`next_pass`] | the planning of the next pass, and its begin |
//! | [`ahead`] | the move of the next tick, made before it |
//! | [`place`] | where the run is on its pass, for the feed |

mod ahead;
mod next_pass;
mod place;
mod travel;

use crate::fault::{Fault, FaultKind, Result};
use crate::job::Pattern;
use crate::job::program::{Job, Program};
use crate::math::arith::{advanced, fraction_from_f32, fraction_to_f32};
use crate::pass::buffer::{self, PatchBuffer};
use crate::pass::contact::{self, Parts, Reach};
use crate::pass::lines::{NextPass, RegionLines};
use crate::pass::route::Route;
use crate::pass::schedule;
use crate::sample::{Sample, SpanParameter, interval_of};
use crate::surface::{AnyCurve, AnyPass, PathSpeed};
use ahead::Prepared;
use next_pass::{BEGINS_ANYWHERE, PassPlanning};
use travel::{Next, Travel};

/// Patch boundaries that one period's arc may cross. One is enough where every patch is longer than the arc; a second
/// crossing would add its cost to the worst-case tick.
const CROSSINGS_MAX: u8 = 1;

/// [`CROSSINGS_MAX`] of jobs of constant scallop height within axis limits: the intervals of a front are two periods long, except on short passes, and the shortest passes are
/// lines beside a point.
const CROSSINGS_ON_FRONT_MAX: u8 = 4;

/// [`CROSSINGS_MAX`] of a front without axis limits, which is passed at the full feed in a sharp corner of the surface, too.
const CROSSINGS_AT_FEED_MAX: u8 = 7;

/// Step of the parameter on a pole: 16 per span. Between two steps the speed of the side lines, a rational cubic of the path
/// parameter, changes little.
const POLE_STEP: u64 = 1 << 60;

/// Greatest correction of a step beyond a station, as a share of the arc beyond the station.
const SHARE_MAX: f32 = 1.0 / 256.0;

/// Most arcs of one period: one up to each boundary, and more in sharp bends of a front.
const ARCS_MAX: u8 = 32;

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
    /// The prepared part of the next sample.
    prepared: Prepared,
    /// Feed factor of the last step along the pass.
    last_feed_factor: f32,
    /// The passes of a region.
    pub(crate) lines: RegionLines,
    /// The next pass of the region, without axis limits.
    next_pass: NextPass,
    /// A fault of that pass, reported when the tool comes to it.
    pending: Option<Fault>,
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
        prepared: Prepared::Nothing,
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
        self.first_offset = [0; 3];
        self.last_interval = f32::INFINITY;
        self.step_over = None;
        self.next_route = None;
        self.prepared = Prepared::Nothing;
    }

    /// Minimum path interval of the last finished pass.
    pub(crate) const fn last_interval(&self) -> f32 {
        self.last_interval
    }

    /// Removes the minimum, as before a run.
    pub(crate) const fn forget_interval(&mut self) {
        self.last_interval = f32::INFINITY;
    }

    /// Sets the minimum, as after a pass.
    pub(crate) const fn keep_interval(&mut self, interval: f32) {
        self.last_interval = interval;
    }

    /// Whether the next sample continues the pass.
    pub(crate) const fn is_along(&self) -> bool {
        matches!(self.travel.next, Next::Along)
    }

    /// Writes the next sample into `last`; false after the last sample.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is unchanged.
    #[inline(always)]
    pub(crate) fn advance(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<bool> {
        let travel = &self.travel;
        if travel.next == Next::Along && !self.is_ahead() {
            let step = contact::step(
                &travel.path,
                travel.log_speed_derivative_before,
                self.buffer.patch().arc,
            );
            if let Some(step) = step
                && self.moves(job, step)?
            {
                self.sample(last)?;
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
        let has_moved = !begins && self.has_moved(job, feed_factor)?;
        match self.travel.next {
            Next::Along if has_moved => {}
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
            Next::Begun => self.travel.next = Next::Along,
            Next::End => return Ok(false),
        }
        if begins {
            self.first_sample(last)?;
        } else {
            self.sample_seldom(last)?;
        }
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

    /// Collapses the first patch of this pass. The tool does not move.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn enter_pass(&mut self, job: &Job<'_>, pass: u32, route: Route) -> Result<()> {
        if job.header.spacing.is_constant() {
            self.travel.offset = BEGINS_ANYWHERE;
        } else if pass > 0 && job.header.pattern == Pattern::Zig {
            self.travel.offset = self.first_offset;
        }
        self.travel.pass = pass;
        self.begin_pass(job, route)
    }

    /// Collapses the first patch of a pass ahead of [`Self::enter_pass`], once the present pass needs no further patch.
    pub(crate) fn prepare_pass(&mut self, job: &Job<'_>, route: &Route) {
        self.buffer.prepare(job, route);
        self.evaluate_first();
    }

    /// Emits the first sample of the pass that was entered; its minimum interval is known from the look-ahead.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn begin(&mut self, interval: f32, last: &mut Sample) -> Result<()> {
        self.first_sample(last)?;
        self.first_offset = self.travel.offset;
        self.last_interval = interval;
        self.last_feed_factor = 0.0;
        self.describe(0.0, last);
        Ok(())
    }

    /// The first sample of the pass lies within the surface: the next pass begins elsewhere, and its normal may be any.
    pub(crate) const fn forget_first(&mut self) {
        self.first_offset = [0; 3];
    }

    /// Prepares the pass that a turn leads to, at its start, without a sample.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn arrive(&mut self, job: &Job<'_>, pass: u32, route: Route, interval: f32) -> Result<()> {
        self.enter_pass(job, pass, route)?;
        let ticks = self.travel.ticks;
        let mut start = Sample::START;
        self.first_sample(&mut start)?;
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
        if !self.has_moved(job, feed_factor)? {
            let before = self.derivative_before(job, feed_factor);
            let step = contact::step(&self.travel.path, before, feed_factor * self.buffer.patch().arc);
            if let Some(step) = step
                && self.moves(job, step)?
            {
                self.last_feed_factor = feed_factor;
                self.sample(last)?;
                last.feed_mm_s = job.header.feed_mm_s * feed_factor;
                return Ok(());
            }
            self.step_far(job, feed_factor)?;
        }
        self.last_feed_factor = feed_factor;
        self.sample(last)?;
        self.describe(job.header.feed_mm_s * feed_factor, last);
        Ok(())
    }

    /// The logarithmic speed derivative one sample before, for a step by this part of a period's arc.
    #[inline(always)]
    fn derivative_before(&self, job: &Job<'_>, feed_factor: f32) -> f32 {
        let travel = &self.travel;
        if job.header.axes.is_none() {
            return travel.log_speed_derivative_before;
        }
        // The third-order term assumes equal steps: the change over the last step is scaled to this one.
        let change = (travel.path.log_speed_derivative - travel.log_speed_derivative_before)
            * (feed_factor / self.last_feed_factor);
        travel.path.log_speed_derivative - change
    }

    /// Moves to the end of the pass, which differs from the position by rounding only.
    ///
    /// # Errors
    /// As [`Self::advance`]; [`FaultKind::PatchTooShort`] where a whole patch is still left.
    pub(crate) fn finish_pass(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<()> {
        self.take_back(job)?;
        if self.is_along() {
            let Self { travel, buffer, .. } = self;
            let is_last = buffer.next(job, &travel.route, &travel.piece).is_none();
            if !is_last && !self.next_piece(job)? {
                return Err(Fault::new(FaultKind::PatchTooShort, 0.0));
            }
            self.end_pass(job);
            self.sample_seldom(last)?;
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
    pub(crate) fn show(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<()> {
        self.take_back(job)?;
        let before = self.travel.log_speed_derivative_before;
        // The period is counted already.
        let ticks = self.travel.ticks;
        self.travel.ticks = last.tick;
        self.sample_seldom(last)?;
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

    /// Whether anything is left to prepare of the next piece of the pass.
    pub(crate) fn has_to_prepare(&self) -> bool {
        self.is_along() && self.buffer.has_work()
    }

    /// Prepares an item of the next piece of the pass, in the planning of a period. Returns its cycles.
    pub(crate) fn prepare_piece(&mut self, job: &Job<'_>) -> u32 {
        if !self.has_to_prepare() {
            return 0;
        }
        self.buffer.work(job, &self.travel.route, &self.travel.piece);
        buffer::CYCLES
    }

    /// Writes the fields of a sample that change only with the pass.
    const fn describe(&self, feed_mm_s: f32, last: &mut Sample) {
        last.pass = self.travel.pass;
        last.path.span = self.travel.span();
        last.side = self.travel.side;
        last.feed_mm_s = feed_mm_s;
    }

    /// The first sample of the pass that has begun.
    fn first_sample(&mut self, last: &mut Sample) -> Result<()> {
        match self.take_first() {
            Some(first) => self.travel.first_sample(&first, self.buffer.patch(), last),
            None => self.sample_seldom(last),
        }
    }

    /// [`Self::sample`], of which each call is a copy, for ticks that are seldom.
    #[inline(never)]
    fn sample_seldom(&mut self, last: &mut Sample) -> Result<()> {
        self.sample(last)
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
                let side = pass.side(travel.fraction);
                let fraction = pass.own_side(&side);
                match pass.on(side) {
                    AnyCurve::Polynomial(pass) => travel.sample(&pass, patch, last),
                    AnyCurve::Rational(pass) => travel.sample(&pass, patch, last),
                    AnyCurve::Pole(pass) => travel.sample(&pass, patch, last),
                    AnyCurve::Revolved(pass) => travel.sample(&pass, patch, last),
                }?;
                travel.side = SpanParameter {
                    span: travel.piece.position.side.span,
                    fraction,
                };
                last.side = travel.side;
                Ok(())
            }
        }
    }

    /// Moves by a step of the series, if that ends on the piece, or on the next one where that is on the same patch: at a station of a front slope and
    /// curvature are continuous.
    #[inline(always)]
    fn moves(&mut self, job: &Job<'_>, step: u64) -> Result<bool> {
        let travel = &mut self.travel;
        if let Some(fraction) = travel.beyond(step) {
            travel.fraction = fraction;
            return Ok(true);
        }
        self.crosses_station(job, step)
    }

    #[inline(never)]
    fn crosses_station(&mut self, job: &Job<'_>, step: u64) -> Result<bool> {
        let Self { travel, buffer, .. } = self;
        let Some(((piece, jump), fraction)) = buffer.station().zip(advanced(travel.fraction, step)) else {
            return Ok(false);
        };
        let end = travel.piece.end();
        let [before, beyond] = [(end, travel.fraction), (fraction, end)]
            .map(|(to, from)| fraction_to_f32(to.saturating_sub(from)));
        // The speed beyond the station differs by a relative `jump x^2 / 2` at the distance x, the arc by that of the cube.
        let share = jump * beyond * beyond * (1.0 / 6.0);
        if fraction > piece.end() || !(share.abs() <= SHARE_MAX) {
            return Ok(false);
        }
        let correction = fraction_from_f32(beyond * share.abs());
        let corrected = if jump > 0.0 {
            fraction.saturating_sub(correction)
        } else {
            fraction.saturating_add(correction)
        };
        travel.fraction = corrected.max(piece.start()).min(piece.end());
        travel.piece = *piece;
        // The last sample's, had it been on the next curve.
        travel.path.log_speed_derivative -= jump * before;
        buffer.advance(job, &travel.route)?;
        Ok(true)
    }

    /// `feed_factor` of a period's arc along the pass, by quadrature, across at most [`CROSSINGS_MAX`] boundaries.
    fn step_far(&mut self, job: &Job<'_>, feed_factor: f32) -> Result<()> {
        let mut rest = feed_factor * job.header.feed_mm_s * job.header.period_s;
        let mut start = self.travel.path;
        if self.travel.is_at_start() && self.continues(&start, rest, feed_factor) {
            return Ok(());
        }
        // Within axis limits the speed is low in a bend.
        let may_bend = self.travel.route.is_on_front() && job.header.axes.is_none();
        let most = match (job.header.spacing.is_constant(), may_bend) {
            (_, true) => CROSSINGS_AT_FEED_MAX,
            (true, false) => CROSSINGS_ON_FRONT_MAX,
            (false, false) => CROSSINGS_MAX,
        };
        let (mut crossings, mut parts) = (0, Parts::WHOLE);
        for _ in 0..ARCS_MAX {
            let Self { travel, buffer, .. } = self;
            let patch = buffer.patch();
            let length = parts.next(rest);
            let arc = length * patch.per_mm;
            let end = || Some(patch.end());
            let path_at = |fraction| patch.surface.path_at(fraction);
            let range = [travel.fraction, travel.piece.end()];
            let covered = match contact::solve(path_at, range, &start, end, (arc, &parts)) {
                Ok(Reach::Within(fraction)) => {
                    travel.fraction = fraction;
                    if length >= rest {
                        return Ok(());
                    }
                    start = path_at(fraction).checked()?;
                    rest -= length;
                    parts.lengthen();
                    continue;
                }
                Ok(Reach::Beyond(covered)) => covered,
                Err(fault) => {
                    let is_too_long = fault.kind == FaultKind::ParameterBackwards;
                    if is_too_long && may_bend && parts.shorten(length) {
                        continue;
                    }
                    return Err(fault);
                }
            };
            rest = rest - length + (arc - covered) / patch.per_mm;
            let Self { travel, buffer, .. } = self;
            if buffer.next(job, &travel.route, &travel.piece).is_none() {
                self.end_pass(job);
                return Ok(());
            }
            if crossings == most {
                break;
            }
            crossings += 1;
            self.next_piece(job)?;
            start = self.buffer.patch().start().checked()?;
            if self.continues(&start, rest, feed_factor) {
                return Ok(());
            }
        }
        Err(Fault::new(FaultKind::PatchTooShort, rest))
    }

    /// Moves by the rest of a period's arc, mm, by the series from the start of a piece, where the change of the parametrisation there is known: without
    /// an evaluation. Returns whether it holds.
    fn continues(&mut self, start: &PathSpeed, rest: f32, feed_factor: f32) -> bool {
        let Self { travel, buffer, .. } = self;
        let patch = buffer.patch();
        let Some(change) = patch.change() else {
            return false;
        };
        let arc = rest * patch.per_mm;
        let part = arc / patch.arc;
        let before = start.log_speed_derivative - part * change;
        let step = contact::step(start, before, arc);
        let Some(fraction) = step.and_then(|step| travel.beyond(step)) else {
            return false;
        };
        travel.fraction = fraction;
        // That of a sample one such period before the next one.
        travel.path.log_speed_derivative = start.log_speed_derivative + (part - feed_factor) * change;
        true
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
        let Self { travel, buffer, .. } = self;
        let Some(piece) = buffer.next(job, &travel.route, &travel.piece) else {
            return Ok(false);
        };
        travel.piece = *piece;
        travel.fraction = travel.piece.start();
        travel.path.log_speed_derivative = f32::NAN;
        buffer.advance(job, &travel.route)?;
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
        let (piece, is_prepared) = self.buffer.first_piece(job, &route);
        travel.piece = piece;
        travel.fraction = travel.piece.start();
        if !is_prepared {
            self.prepared = Prepared::Nothing;
        }
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
                scan.estimator().enter_row(job.header, route.side.span, false);
                if self.lines.begins_apart() {
                    scan.estimator().begin_apart();
                }
            }
            scan.begin(&route, goes_on);
        }
        self.buffer
            .begin(job, &travel.route, (&travel.piece, is_prepared))
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
