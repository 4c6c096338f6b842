//! A run of a job, sample by sample: the one file that chains the stages.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::{Pattern, Spacing};
use crate::math::arith::{advanced, dot_hi, fraction_to_f32};
use crate::pass::across::{self, Across, Densities};
use crate::pass::buffer::Lane;
use crate::pass::contact::{self, Reach};
use crate::pass::patch::Patch;
use crate::pass::position::Line;
use crate::pass::schedule;
use crate::sample::{Place, Sample, interval_of};
use crate::surface::{AnyPass, Pass, PathSpeed};

/// Patch boundaries that one period's arc may cross. One lets every patch through that is longer than the arc; the cost of a second,
/// of patches that are not, would come on top of the dearest tick there is.
const CROSSINGS_MAX: u8 = 1;

/// Step from place to place on a pole: 16 to a span. Between two the speed of the side lines, a rational cubic of the path
/// parameter, changes by a small part of itself.
const POLE_STEP: u64 = 1 << 60;

/// What the next tick has to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// Begin the pass at the current side place.
    Pass,
    /// One period's arc further.
    Along,
    /// Find the next pass, and begin it.
    Over,
    /// Nothing: the last sample is out.
    End,
}

/// Where the run is.
#[derive(Clone, Copy, Debug)]
struct Travel {
    next: Next,
    reversed: bool,
    /// Path span, in the surface's own direction.
    span: u16,
    /// Fraction of the span, in the direction of travel.
    fraction: u64,
    /// The parametrisation at the last sample, and its stretch at the one before; NaN where that is on another patch.
    path: PathSpeed,
    stretch_before: f32,
    /// r N at the last sample, in the ball's units.
    offset: [i32; 3],
    /// Greatest density of the pass, and the surface's shape there, see [`Densities`].
    most: f32,
    shape: [f32; 2],
    /// Samples so far.
    ticks: u32,
    pass: u32,
    side: Place,
}

/// A run: the travel, and the patches that it is on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    travel: Travel,
    lane: Lane,
    across: Across,
    /// r N at the pass's first sample.
    first_offset: [i32; 3],
    /// Least interval of the pass that was finished last, in units of the side parameter.
    last_interval: f32,
    /// How far from it the next pass lies.
    step_over: f32,
    /// Share of the feed of the last step along the pass.
    pace: f32,
}

impl Travel {
    const START: Self = Self {
        next: Next::Pass,
        reversed: false,
        span: 0,
        fraction: 0,
        path: PathSpeed {
            inverse: 0.0,
            stretch: 0.0,
        },
        stretch_before: f32::NAN,
        offset: [0; 3],
        most: 0.0,
        shape: [0.0; 2],
        ticks: 0,
        pass: 0,
        side: Place { span: 0, fraction: 0 },
    };

    /// Fraction of the span, in the surface's own direction.
    const fn own_fraction(&self) -> u64 {
        if self.reversed {
            !self.fraction
        } else {
            self.fraction
        }
    }

    /// The patch that the run is on.
    const fn line(&self) -> Line {
        Line {
            side: self.side,
            reversed: self.reversed,
            span: self.span,
        }
    }

    /// Steps 2 to 4 at the place where the run now is. Nothing of `last` changes if there is a fault. Not inlined: a function for
    /// each kind of surface saves no more registers than that kind needs.
    #[inline(never)]
    fn sample<P: Pass>(&mut self, pass: &P, patch: &Patch, last: &mut Sample) -> Result<()> {
        let (contact, located) = patch.evaluate_on(pass, self.fraction)?;
        if patch.locator.folds(dot_hi(&self.offset, &contact.offset)) {
            return Err(folded());
        }
        let density = patch.interval.density(&contact);
        if density > self.most {
            self.most = density;
            self.shape = [contact.across, contact.lateral_squared];
        }
        self.offset = contact.offset;
        self.stretch_before = self.path.stretch;
        self.path = contact.path;
        last.tick = self.ticks;
        last.path.fraction = self.own_fraction();
        last.cc_nm = located.cc_nm;
        last.cl_nm = located.cl_nm;
        last.density = density;
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
    /// Before the first sample.
    pub(crate) const START: Self = Self {
        travel: Travel::START,
        lane: Lane::START,
        across: Across::START,
        first_offset: [0; 3],
        last_interval: f32::INFINITY,
        step_over: f32::INFINITY,
        pace: 0.0,
    };

    /// Back to the start.
    pub(crate) fn restart(&mut self) {
        self.travel = Travel::START;
        self.across.restart();
        self.last_interval = f32::INFINITY;
    }

    /// Pass, and where the tool is on the path and the side parameter, in the surface's own direction.
    pub(crate) const fn place(&self) -> (u32, Place, Place) {
        let travel = &self.travel;
        let path = Place {
            span: travel.span,
            fraction: travel.own_fraction(),
        };
        (travel.pass, path, travel.side)
    }

    /// Least path interval of the pass that was finished last.
    pub(crate) const fn last_interval(&self) -> f32 {
        self.last_interval
    }

    /// Whether the next sample continues the pass.
    pub(crate) fn is_along(&self) -> bool {
        self.travel.next == Next::Along
    }

    /// The next sample, into `last`; false when the last is out.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is as it was.
    #[inline(always)]
    pub(crate) fn advance(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<bool> {
        let travel = &mut self.travel;
        if travel.next == Next::Along {
            let step = contact::step(&travel.path, travel.stretch_before, self.lane.patch().arc);
            if let Some(fraction) = step.and_then(|step| advanced(travel.fraction, step)) {
                travel.fraction = fraction;
                self.sample(last)?;
                if self.lane.has_work() {
                    self.lane.work(job, &self.travel.line());
                } else if self.travel.ticks % across::EVERY == 1 {
                    self.look_across(job);
                }
                return Ok(true);
            }
        }
        self.advance_far(job, 1.0, last)
    }

    /// The next sample, when it is not just a small step further: a share of a period's arc along the pass, or the next pass.
    ///
    /// # Errors
    /// As [`Self::advance`].
    #[inline(never)]
    pub(crate) fn advance_far(&mut self, job: &Job<'_>, share: f32, last: &mut Sample) -> Result<bool> {
        let begins = !self.is_along();
        match self.travel.next {
            Next::Along if self.lane.patch().point => self.step_on_pole(job)?,
            Next::Along => self.step_far(job, share)?,
            Next::Pass => self.begin_pass(job)?,
            Next::Over => {
                self.step_over(job)?;
                self.begin_pass(job)?;
            }
            Next::End => return Ok(false),
        }
        self.sample(last)?;
        let travel = &self.travel;
        if begins {
            self.first_offset = travel.offset;
        }
        if travel.next != Next::Along {
            self.close_pass(job);
        }
        let travel = &self.travel;
        last.pass = travel.pass;
        last.path.span = travel.span;
        last.side = travel.side;
        last.feed_mm_s = if self.lane.patch().point {
            0.0
        } else {
            job.header.feed_mm_s * share
        };
        Ok(true)
    }

    /// Goes to this pass, which lies here: its first patch is made, and the tool stays where it is.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn enter(&mut self, job: &Job<'_>, pass: u32, side: Place) -> Result<()> {
        if pass > 0 && job.header.pattern == Pattern::Zig {
            self.travel.offset = self.first_offset;
        }
        (self.travel.pass, self.travel.side) = (pass, side);
        self.begin_pass(job)
    }

    /// Begins the pass that was entered, and whose least interval is known: its first sample.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn begin(&mut self, interval: f32, last: &mut Sample) -> Result<()> {
        self.sample(last)?;
        self.first_offset = self.travel.offset;
        self.last_interval = interval;
        self.pace = 0.0;
        self.describe(0.0, last);
        Ok(())
    }

    /// A share of a period's arc along the pass; whether that was little work.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub(crate) fn move_by(&mut self, job: &Job<'_>, share: f32, last: &mut Sample) -> Result<bool> {
        let travel = &mut self.travel;
        // The series' third term is for steps of one length: the change of the last one is scaled to this.
        let change = (travel.path.stretch - travel.stretch_before) * (share / self.pace);
        let before = travel.path.stretch - change;
        self.pace = share;
        let step = contact::step(&travel.path, before, share * self.lane.patch().arc);
        if let Some(fraction) = step.and_then(|step| advanced(travel.fraction, step)) {
            travel.fraction = fraction;
            self.sample(last)?;
            last.feed_mm_s = job.header.feed_mm_s * share;
            if !self.lane.has_work() {
                return Ok(true);
            }
            self.lane.work(job, &self.travel.line());
            return Ok(false);
        }
        let interval = self.last_interval;
        self.step_far(job, share)?;
        self.sample(last)?;
        self.last_interval = interval;
        self.describe(job.header.feed_mm_s * share, last);
        Ok(false)
    }

    /// To the end of the pass, which is here up to rounding.
    ///
    /// # Errors
    /// As [`Self::advance`]; [`FaultKind::PatchTooShort`] where a whole patch is still ahead.
    pub(crate) fn finish_pass(&mut self, job: &Job<'_>, last: &mut Sample) -> Result<()> {
        if self.is_along() {
            if self.travel.line().next(job.header.path_spans).is_some() && !self.next_span(job)? {
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

    /// A period in which the tool stands.
    pub(crate) const fn stand(&mut self, last: &mut Sample) {
        last.tick = self.travel.ticks;
        last.feed_mm_s = 0.0;
        self.travel.ticks = self.travel.ticks.wrapping_add(1);
    }

    /// A period off the passes.
    pub(crate) const fn off_surface(&mut self, at_nm: [i32; 3], speed_mm_s: f32, last: &mut Sample) {
        self.stand(last);
        last.feed_mm_s = speed_mm_s;
        // What is there may be of the job before.
        last.pass = self.travel.pass;
        (last.path, last.side) = (Place::NONE, Place::NONE);
        (last.cc_nm, last.cl_nm) = (at_nm, at_nm);
        last.density = 0.0;
    }

    /// Cell of the pass, of so many to a patch; none where the pass is over.
    pub(crate) fn cell(&self, job: &Job<'_>, parts: u16) -> Option<u16> {
        if !self.is_along() {
            return None;
        }
        let travel = &self.travel;
        let within = self.cell_of_patch(parts);
        let span = if travel.reversed {
            job.header
                .path_spans
                .saturating_sub(1)
                .saturating_sub(travel.span)
        } else {
            travel.span
        };
        Some(span.saturating_mul(parts).saturating_add(within))
    }

    fn cell_of_patch(&self, parts: u16) -> u16 {
        let high = (self.travel.fraction >> 32) * u64::from(parts);
        u16::try_from(high >> 32).unwrap_or(0)
    }

    /// Arc since the start of the cell, mm, where a patch has so many, each of which is this fraction of it; none in the rounding before it.
    pub(crate) fn since_station(&self, parts: u16, part: u64) -> Option<f32> {
        let travel = &self.travel;
        let start = u64::from(self.cell_of_patch(parts)) * part;
        let length = fraction_to_f32(travel.fraction.checked_sub(start)?);
        let mean = 1.0 - 0.5 * travel.path.stretch * length;
        Some(length * mean / (travel.path.inverse * self.lane.patch().per_mm))
    }

    /// Whether the surface faces up where the tool is, so that the tool can leave it upwards.
    pub(crate) fn faces_up(&self) -> bool {
        self.lane.patch().ball.faces_up(self.travel.offset)
    }

    /// What of a sample changes seldom.
    const fn describe(&self, feed_mm_s: f32, last: &mut Sample) {
        last.pass = self.travel.pass;
        last.path.span = self.travel.span;
        last.side = self.travel.side;
        last.feed_mm_s = feed_mm_s;
    }

    /// The sample where the run is.
    #[inline(always)]
    fn sample(&mut self, last: &mut Sample) -> Result<()> {
        let Self { travel, lane, .. } = self;
        let patch = lane.patch();
        match patch.surface.pass() {
            AnyPass::Polynomial(pass) => travel.sample(&pass, patch, last),
            AnyPass::Ruled(pass) => travel.sample(&pass, patch, last),
            AnyPass::Extruded(pass) => travel.sample(&pass, patch, last),
            AnyPass::Rational(pass) => travel.sample(&pass, patch, last),
            AnyPass::Pole(pass) => travel.sample(&pass, patch, last),
            AnyPass::Profile(pass) => travel.sample(pass, patch, last),
            AnyPass::Circle(pass) => travel.sample(pass, patch, last),
        }
    }

    /// A share of a period's arc along the pass, by quadrature, over as many patches as it takes.
    fn step_far(&mut self, job: &Job<'_>, share: f32) -> Result<()> {
        let mut rest = share * job.header.feed_mm_s * job.header.period_s;
        let mut start = self.travel.path;
        for crossings in 0..=CROSSINGS_MAX {
            let Self { travel, lane, .. } = self;
            let patch = lane.patch();
            let arc = rest * patch.per_mm;
            let end = || patch.end();
            let covered = match contact::solve(&patch.surface, travel.fraction, &start, end, arc)? {
                Reach::Within(fraction) => {
                    travel.fraction = fraction;
                    return Ok(());
                }
                Reach::Beyond(covered) => covered,
            };
            rest = (arc - covered) / patch.per_mm;
            if crossings == CROSSINGS_MAX {
                break;
            }
            if !self.next_span(job)? {
                self.end_pass(job);
                return Ok(());
            }
            start = self.lane.patch().start().checked()?;
        }
        Err(Fault::new(FaultKind::PatchTooShort, rest))
    }

    /// On a pole, the next of its places: the tool stands, but the interval that the pass allows differs from place to place.
    fn step_on_pole(&mut self, job: &Job<'_>) -> Result<()> {
        if let Some(fraction) = self.travel.fraction.checked_add(POLE_STEP) {
            self.travel.fraction = fraction;
        } else if !self.next_span(job)? {
            self.end_pass(job);
        }
        Ok(())
    }

    /// Goes to the start of the next patch along the pass; false at the pass's end.
    fn next_span(&mut self, job: &Job<'_>) -> Result<bool> {
        let travel = &mut self.travel;
        let Some(line) = travel.line().next(job.header.path_spans) else {
            return Ok(false);
        };
        travel.span = line.span;
        travel.fraction = 0;
        travel.path.stretch = f32::NAN;
        self.lane.go_on(job, &line)?;
        Ok(true)
    }

    /// Begins the pass at the current side place.
    fn begin_pass(&mut self, job: &Job<'_>) -> Result<()> {
        let header = job.header;
        let travel = &mut self.travel;
        travel.reversed = header.pattern == Pattern::Zigzag && travel.pass % 2 == 1;
        travel.span = if travel.reversed {
            header.path_spans.saturating_sub(1)
        } else {
            0
        };
        travel.fraction = 0;
        travel.most = 0.0;
        travel.next = Next::Along;
        travel.path.stretch = f32::NAN;
        self.across.begin();
        self.lane.begin(job, &travel.line())
    }

    /// One look at the line a step-over further.
    #[inline(never)]
    fn look_across(&mut self, job: &Job<'_>) {
        if job.header.spacing == Spacing::FirstOrder {
            return;
        }
        let Self {
            travel, lane, across, ..
        } = self;
        across.work(job, &travel.line(), lane.patch(), travel.fraction, travel.most);
    }

    /// The pass is over: its least interval, and the step to the next one.
    fn close_pass(&mut self, job: &Job<'_>) {
        let Travel { most, shape, .. } = self.travel;
        self.last_interval = interval_of(most);
        self.step_over = match job.header.spacing {
            Spacing::Exact => self.across.step(job.header, Densities { most, shape }),
            Spacing::FirstOrder => self.last_interval,
        };
    }

    /// The side place of the next pass; its first sample is a neighbour of the last pass's first, or of its last where the
    /// passes run to and fro.
    fn step_over(&mut self, job: &Job<'_>) -> Result<()> {
        let travel = &mut self.travel;
        let width = |span| job.side_width(span);
        travel.side = schedule::next_side(travel.side, self.step_over, job.header.side_spans, width)?;
        travel.pass = travel.pass.wrapping_add(1);
        if job.header.pattern == Pattern::Zig {
            travel.offset = self.first_offset;
        }
        Ok(())
    }

    /// The run is exactly at the end of the pass.
    fn end_pass(&mut self, job: &Job<'_>) {
        self.travel.fraction = u64::MAX;
        let last = schedule::is_last(self.travel.side, job.header.side_spans);
        self.travel.next = if last { Next::End } else { Next::Over };
    }
}

#[cfg(test)]
mod tests;
