//! Stretches of a pass on a front: pieces of one path span, together long enough for differences.

use super::stations::{CELL_FINE_MM, CELL_MIN_MM, CELLS_FINE, LOOKS_MAX};
use super::{CELL_KEPT_MM, Lookahead, PATCHES, PassPlan, STATIONS, STRETCH_MIN_MM, Task};
use crate::fault::Result;
use crate::feed::stations::Window;
use crate::job::program::Job;
use crate::math::arith::{fraction_to_f32, truncated};
use crate::math::number::{Bounded, MM_PER_NM, to_f32};
use crate::pass::route::Piece;
use crate::surface::PathSpeed;

const STRETCH_KNOT_MM: f32 = 0.3;
const STRETCH_SHORT_MM: f32 = 0.2;

/// Most path spans of a pass on a front that are divided into stretches.
const SPANS_DIVIDED: u16 = 60;

impl Lookahead {
    /// Length of a part of the path span on this patch, roughly, mm; 0 where it is not known.
    fn part_mm(&self, part: u64) -> f32 {
        let length = fraction_to_f32(part) / self.speed.inv_speed;
        if length.is_finite() { length } else { 0.0 }
    }

    /// Begins a stretch of a pass on a front.
    pub(super) fn begin_stretch(&mut self, out: &mut PassPlan) -> Result<()> {
        let PathSpeed {
            inv_speed,
            log_speed_derivative,
        } = self.patch.start().checked()?;
        self.speed = PathSpeed {
            inv_speed: inv_speed * self.patch.per_mm,
            log_speed_derivative,
        };
        self.stretch = [self.piece; 2];
        if self.patches > 0 {
            return Ok(());
        }
        let [start, end] = out.route.ends;
        let spans = start.span.abs_diff(end.span) + 1;
        let pieces = out.route.front.map_or(1, |front| front.pieces);
        out.group = if spans > SPANS_DIVIDED {
            spans.div_ceil(PATCHES)
        } else {
            1
        };
        let room = PATCHES.saturating_sub(SPANS_DIVIDED.min(spans)).saturating_sub(8);
        self.least_mm = if spans > SPANS_DIVIDED {
            f32::MAX
        } else if pieces + 4 <= PATCHES {
            STRETCH_MIN_MM
        } else {
            (self.pass_mm / f32::from(room)).at_least(STRETCH_MIN_MM)
        };
        let expected = pieces.min(PATCHES - 4) + 4;
        let fit = STATIONS
            .checked_div(expected)
            .unwrap_or(1)
            .saturating_sub(1)
            .max(1);
        let kept = u16::try_from(truncated(self.least_mm / CELL_KEPT_MM)).unwrap_or(u16::MAX);
        out.cells = kept.clamp(1, fit);
        if out.group > 1 {
            out.cells = 1;
        }
        Ok(())
    }

    /// Lengthens the stretch by a piece, or ends it.
    pub(super) fn extend_stretch(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Task {
        let [first, last] = self.stretch;
        self.after = out.route.next(job, &last);
        let span = first.position.span;
        if let Some(next) = self.after.filter(|next| next.position.span == span)
            && !self.is_long_enough(&last, out)
        {
            self.stretch = [first, next];
            self.range = [self.range[0], next.end()];
            return Task::Extend;
        }
        if let Some(front) = first.front.filter(|_| self.patches.is_multiple_of(out.group)) {
            out.note_stretch(front.number);
        }
        let [start, end] = self.range;
        let length = self.part_mm(end.saturating_sub(start));
        let whole = |value: f32| u16::try_from(truncated(value)).unwrap_or(u16::MAX);
        let fine = whole(length / CELL_FINE_MM).max(CELLS_FINE);
        let most = whole(length / CELL_MIN_MM).max(2);
        self.is_short = length < STRETCH_SHORT_MM;
        self.looks = if self.is_short {
            1
        } else {
            fine.min(most).div_ceil(out.cells.max(1)).clamp(1, LOOKS_MAX)
        };
        self.cells = out.cells * self.looks;
        let part = end.saturating_sub(start).checked_div(u64::from(self.cells));
        self.cell_fraction = part.unwrap_or(u64::MAX);
        if !self.is_short {
            out.plan.stations.note_spacing(length / f32::from(self.cells));
        }
        self.window = Window::EMPTY;
        self.arc_mm = 0.0;
        self.station = 0;
        Task::Station
    }

    /// Whether the stretch that ends with this piece has the length for differences, and leaves it to the rest of the span.
    fn is_long_enough(&self, last: &Piece, out: &PassPlan) -> bool {
        let [start, end] = self.range;
        let [_, pass_end] = out.route.ends;
        let span = last.position.span;
        let span_end = if span == pass_end.span {
            out.route.turned(pass_end.fraction)
        } else {
            u64::MAX
        };
        let at_knot = last.front.is_some_and(|front| front.is_at_knot());
        let least = if at_knot {
            self.least_mm.at_most(STRETCH_KNOT_MM)
        } else {
            self.least_mm
        };
        // Each span that is left takes a stretch.
        let spans = span.abs_diff(pass_end.span) + 2;
        let taken = (self.patches + spans).saturating_mul(out.cells + 1);
        self.least_mm < f32::MAX
            && taken < STATIONS
            && self.part_mm(end.saturating_sub(start)) >= least
            && self.part_mm(span_end.saturating_sub(end)) >= STRETCH_KNOT_MM
    }

    /// A pass that is too short for derivatives is straight.
    pub(super) fn finish_short(&self, out: &mut PassPlan) {
        if !out.route.is_on_front() || self.has_derivatives {
            return;
        }
        let [from, to] = out.ends;
        let length = self.pass_mm.at_least(MM_PER_NM);
        let mut q = [[0.0; 3]; 3];
        for ((q, from), to) in q.iter_mut().zip(from).zip(to) {
            q[0] = to_f32(i64::from(to) - i64::from(from)) * MM_PER_NM / length;
        }
        for station in 1..=out.plan.stations.count() {
            if let Some(place) = out.plan.stations.back_mut(station) {
                place.q = q;
            }
        }
    }
}
