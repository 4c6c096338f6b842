//! The step of a front at a place: from the contact of the pass that reaches farthest there, its foot.
//!
//! The new point is one distance in the metric from a contact of the pass, `a dx^2 + 2 b dx dy + c dy^2 = K`. Any contact gives a point that is near enough, so the step is
//! stable whatever the stations' distance, and the greatest is the front. A foot beyond an end of the pass is the end.

use core::ops::Deref;

use crate::fault::{Fault, Result};
use crate::math::arith::{sqrt, to_f32, truncated};
use crate::math::number::Bounded;
use crate::pass::front::crest::{CURRENT, Place, Tools, offset, shifted};
use crate::pass::front::frame::Frame;
use crate::pass::front::side::{UNIT, WHOLE};
use crate::pass::front::table::Table;

/// Iterations for the foot, in the metric at the place.
const ROUNDS: u8 = 4;
/// Longest step, as a share of the whole side parameter.
const STEP_MAX: f32 = 1.5;

/// A quadratic form over K, of the distance from the foot.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Form {
    path: f32,
    mixed: f32,
    side: f32,
}

impl Form {
    const fn of(frame: &Frame, scale: f32) -> Self {
        Self {
            path: frame.a * scale,
            mixed: frame.b * scale,
            side: frame.c * scale,
        }
    }

    fn mean(parts: &[(Self, f32)]) -> Self {
        let mut sum = Self::default();
        for (part, weight) in parts {
            sum.path += part.path * weight;
            sum.mixed += part.mixed * weight;
            sum.side += part.side * weight;
        }
        sum
    }

    /// The step across at this distance along the path at which the form is `square`; none where it is nowhere.
    fn across(&self, along: f32, square: f32) -> Option<f32> {
        let root = self.side * square - (self.path * self.side - self.mixed * self.mixed) * along * along;
        if !(root >= 0.0) {
            return None;
        }
        let step = (sqrt(root) - self.mixed * along) / self.side;
        Some(step.at_most(STEP_MAX))
    }
}

/// The step at one place, an evaluation at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FootStep {
    pub(crate) place: Place,
    pub(crate) next: u8,
    foot: Place,
    /// The front at the place and at the foot.
    at: i32,
    base: i32,
    /// From the foot to the place, path parameter, and the step across.
    along: f32,
    across: f32,
    /// Half a step straight across.
    half: f32,
    /// Share of the step that is left at an end of the pass.
    share: f32,
    forms: [Form; 3],
    /// The slope at the foot.
    slope: f32,
}

/// What an evaluation gives.
pub(crate) enum Found {
    /// More are needed; the frame half way is for the limits, with the slope there.
    More(Option<(Frame, f32)>),
    /// The next front at the place, units of the fronts.
    Front(i32),
    /// The surface is faulty there.
    Faulty(Fault),
}

impl FootStep {
    pub(crate) const NONE: Self = Self {
        place: (0, 0),
        next: 0,
        foot: (0, 0),
        at: 0,
        base: 0,
        along: 0.0,
        across: 0.0,
        half: 0.0,
        share: 1.0,
        forms: [Form {
            path: 0.0,
            mixed: 0.0,
            side: 0.0,
        }; 3],
        slope: 0.0,
    };

    pub(crate) const fn begin(&mut self, place: Place) {
        self.place = place;
        self.next = 0;
    }

    /// Half a step straight across at the place, units of the fronts.
    pub(crate) fn half_step(&self) -> i32 {
        to_units(self.half)
    }

    /// An evaluation. `is_end`: the place is an end of the pass; `margin`: the scallop height is this share of the limit.
    pub(crate) fn work<W: Deref<Target = [i32]>>(
        &mut self,
        tools: &mut Tools<'_, '_>,
        table: &Table<W>,
        is_end: bool,
        margin: f32,
    ) -> Found {
        let number = self.next;
        self.next = number.saturating_add(1);
        self.evaluate(tools, table, number, is_end, margin)
            .unwrap_or_else(Found::Faulty)
    }

    fn evaluate<W: Deref<Target = [i32]>>(
        &mut self,
        tools: &mut Tools<'_, '_>,
        table: &Table<W>,
        number: u8,
        is_end: bool,
        margin: f32,
    ) -> Result<Found> {
        let header = tools.job.header;
        let rise = self.base.saturating_add(to_units(self.across));
        match number {
            0 => {
                self.at = tools.front(table, CURRENT, self.place).at;
                let frame = tools.frame(table, self.place, self.at)?;
                self.find(tools, table, &frame, is_end, margin);
                Ok(Found::More(None))
            }
            1 => {
                let frame = tools.frame(table, self.foot, self.base)?;
                let [first, ..] = &mut self.forms;
                *first = Form::of(&frame, frame.scale(header, self.along, self.across, margin));
                Ok(Found::More(None))
            }
            2 => {
                let (middle, _) = shifted(table, tools.job, self.place, -0.5 * self.along);
                let mut half = self.base.saturating_add(to_units(0.5 * self.across));
                if tools.is_point_ahead {
                    // At the point itself there is no direction along the path.
                    let left = tools.direction.end.saturating_sub(self.at);
                    half = half.min(self.at.saturating_add(left - left / 4));
                }
                let frame = tools.frame(table, middle, half)?;
                let [_, second, _] = &mut self.forms;
                *second = Form::of(&frame, frame.scale(header, self.along, self.across, margin));
                Ok(Found::More(Some((frame, self.slope))))
            }
            _ => {
                let frame = tools.frame(table, self.place, rise)?;
                let [.., third] = &mut self.forms;
                *third = Form::of(&frame, frame.scale(header, self.along, self.across, margin));
                Ok(Found::Front(self.finish(tools.direction.cap())))
            }
        }
    }

    /// The foot in the metric at the place.
    fn find<W: Deref<Target = [i32]>>(
        &mut self,
        tools: &Tools<'_, '_>,
        table: &Table<W>,
        frame: &Frame,
        is_end: bool,
        margin: f32,
    ) {
        let own = tools.front(table, CURRENT, self.place);
        let scale = frame.scale(tools.job.header, 0.0, 1.0, margin);
        let form = Form::of(frame, scale);
        (self.foot, self.base, self.along, self.slope) = (self.place, own.at, 0.0, own.slope);
        self.across = form.across(0.0, 1.0).unwrap_or(STEP_MAX);
        let mut farthest = self.across;
        // At an end of the pass the crest is half a step from a contact, and the next pass half a step from the crest along the boundary.
        let mut half = form.across(0.0, 0.25).unwrap_or(STEP_MAX);
        let least = half;
        self.half = least;
        for square in [1.0, 0.25] {
            if square < 1.0 && !is_end {
                break;
            }
            let mut slope = own.slope;
            let mut last = None;
            for _ in 0..ROUNDS {
                let stretch = form.path + slope * (2.0 * form.mixed + form.side * slope);
                let determinant = form.path * form.side - form.mixed * form.mixed;
                let by = (form.mixed + form.side * slope) * sqrt(square / (stretch * determinant));
                if !by.is_finite() {
                    break;
                }
                let (foot, _) = shifted(table, tools.job, self.place, by);
                if last == Some(foot) {
                    break;
                }
                last = Some(foot);
                let along = offset(table, self.place) - offset(table, foot);
                let point = tools.front(table, CURRENT, foot);
                slope = point.slope;
                let Some(across) = form.across(along, square) else {
                    continue;
                };
                let total = to_f32(point.at.wrapping_sub(own.at)) * UNIT + across;
                if square < 1.0 {
                    half = half.at_least(total);
                } else if total > farthest && across > 0.0 {
                    farthest = total;
                    (self.foot, self.base, self.slope) = (foot, point.at, slope);
                    (self.along, self.across) = (along, across);
                }
            }
        }
        self.share = if is_end {
            ((half + least) / farthest).at_most(1.0)
        } else {
            1.0
        };
    }

    /// The step at which the mean of the form over the way is 1. The height at a share s of the way is the integral of (s - t) times the form, and the crest is where
    /// both sides have the same: what lies next to the passes counts most.
    fn finish(&self, cap: i32) -> i32 {
        let [first, half, whole] = self.forms;
        let mean = Form::mean(&[(first, 0.25), (half, 0.5), (whole, 0.25)]);
        let from_foot = to_f32(self.base.wrapping_sub(self.at)) * UNIT;
        let step = match mean.across(self.along, 1.0) {
            Some(across) if from_foot + across > self.half => from_foot + across,
            // The foot is too far away, near a pole, where the metric changes much on the way: straight across.
            _ => mean.across(0.0, 1.0).unwrap_or(STEP_MAX).at_most(2.0 * self.half),
        };
        let step = (step * self.share).at_least(0.0);
        self.at.saturating_add(to_units(step)).min(cap)
    }
}

/// A share of the whole in units of the fronts.
pub(crate) fn to_units(share: f32) -> i32 {
    truncated(share.at_most(STEP_MAX).at_least(-STEP_MAX) * to_f32(WHOLE))
}
