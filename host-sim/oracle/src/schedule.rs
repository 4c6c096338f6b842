//! The passes of a job without running it: the least interval of each pass by a dense scan.
//!
//! The paper's interval is evaluated at the pass itself (first order). The largest admissible distance of the next pass depends on the gap:
//! the density 1/interval^2 is scanned on two more lines, with the exact scallop heights of a ball, and at the ends of skew passes with those
//! of the crest beyond the end. The rule is the core's (`interp-core`, `step_over.rs`), the geometry is this oracle's; the resulting heights are
//! measured independently from the swept ball.

use super::contact::{Oracle, OracleError};
use super::smooth::SmoothParameter;
use job::{Along, Spacing};

/// Points per span scanned for the least interval of a pass.
const SCAN_PER_SPAN: usize = 64;
/// Least number of these points per pass.
const SCAN_MIN: usize = 512;
/// Golden-section steps: each shortens the bracket to 0.618, so 48 reduce it to 1e-10 of its length; the interval is stationary at its
/// minimum, hence exact.
const GOLDEN_STEPS: usize = 48;
/// Minima of the scan within this share of the least one are refined.
const REFINE_SHARE: f64 = 1e-2;
/// A pass that ends closer than this share of its interval to the boundary lies on the boundary.
const BOUNDARY_SHARE: f64 = 1e-9;
/// Least and greatest ratio of a pass's step to its first-order step; the core's values.
const STEP_RANGE: [f64; 2] = [0.25, 1.25];
/// Greatest ratio of the step expected of a pass to the one before; the core's value.
const TREND_MAX: f64 = 1.25;
/// Error of the core's cutter location along the normal, for which it lowers the scallop limit: mm, and a share of the ball's radius; and the least
/// share of the limit that is left.
const LOCATION_ERROR_MM: f64 = 0.87e-6;
const LOCATION_ERROR_SHARE: f64 = 1.0 / 16_777_216.0;
const HEIGHT_SHARE_MIN: f64 = 0.5;
/// Newton iterations for the root of a cubic: more than needed.
const NEWTON_STEPS: u8 = 12;
/// Part of a step-over that a pass leaves within the limit without the next one; the core's value.
const ONE_SIDED: f64 = 0.49;
/// Largest number of passes of a schedule.
const PASSES_MAX: usize = 1_000_000;

/// A pass: its side parameter and its ends, and the largest distance to the next line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScheduledPass {
    /// Side parameter.
    pub side: f64,
    /// Path parameters of its ends, ascending: those of the surface, or of an interval of the region.
    pub ends: [f64; 2],
    /// Largest step to the next line, in the side parameter; for passes spaced by the first order the least interval on the pass.
    pub interval: f64,
}

impl Oracle {
    /// All passes from one boundary of the side parameter to the other (steps 5 and 6), or of a region: its intervals on lines from the first to the last of each cell.
    ///
    /// # Errors
    /// [`OracleError::BallDoesNotFit`] and [`OracleError::Degenerate`] at the first such point,
    /// [`OracleError::TooManyPasses`] if the intervals converge to 0.
    pub fn schedule(&self) -> Result<Vec<ScheduledPass>, OracleError> {
        self.schedule_scaled(1.0)
    }

    /// [`Oracle::schedule`] with every step longer by this factor: the error that a step may have.
    ///
    /// # Errors
    /// As [`Oracle::schedule`].
    pub fn schedule_scaled(&self, factor: f64) -> Result<Vec<ScheduledPass>, OracleError> {
        if self.cells.len() < 2 {
            return self.schedule_of_one(factor);
        }
        let mut passes = Vec::new();
        for index in 0..self.cells.len() {
            passes.extend(self.of_cell(index).schedule_of_one(factor)?);
        }
        Ok(passes)
    }

    fn schedule_of_one(&self, factor: f64) -> Result<Vec<ScheduledPass>, OracleError> {
        let [start, _] = self.pass_range();
        let end = self.last_line();
        let smooth = SmoothParameter::new(self, self.across());
        // In the smooth parameter.
        let mut passes = Vec::new();
        let mut steps = Vec::new();
        let Some(mut side) = self.next_line(start) else {
            return Ok(passes);
        };
        while passes.len() < PASSES_MAX {
            let scale = smooth.scale(side);
            let before: Vec<f64> = steps.iter().rev().take(2).map(|step| step / scale).collect();
            let interval = match self.spacing {
                Spacing::FirstOrder => self.least_interval(side)?,
                Spacing::Exact | Spacing::Constant(_) => self.exact_interval(side, &before, &smooth)?,
            };
            steps.push(interval * scale);
            let interval = factor * self.beside_point(side, interval, smooth.distance(side, end));
            let intervals = self.certain_intervals(side).into_iter();
            passes.extend(intervals.map(|ends| ScheduledPass { side, ends, interval }));
            if side >= end {
                return Ok(passes);
            }
            // Lines without an interval are left out; where the line meets nothing at all, the region begins again.
            let mut next = side;
            loop {
                let beyond = smooth.advanced(next, interval * scale / smooth.scale(next));
                if beyond <= next {
                    return Err(OracleError::TooManyPasses);
                }
                next = beyond;
                if end - next <= BOUNDARY_SHARE * interval {
                    next = end;
                }
                if next >= end || !self.certain_intervals(next).is_empty() {
                    break;
                }
                if self.intervals(next).is_empty() {
                    next = self.next_line(next).unwrap_or(end);
                    break;
                }
            }
            side = next;
        }
        Err(OracleError::TooManyPasses)
    }

    /// A step beside a boundary that is cut with one normal: half of it, from the point and to it.
    ///
    /// `room`: distance to the last line.
    fn beside_point(&self, side: f64, step: f64, room: f64) -> f64 {
        let one_normal = self.has_limits && self.spacing == Spacing::Exact;
        let [start, end] = self.pass_range();
        if !one_normal {
            return step;
        }
        if side == start && self.is_point(start) {
            ONE_SIDED * step
        } else if step >= room && room > 0.5 * step && self.is_point(end) {
            room - ONE_SIDED * step
        } else {
            step
        }
    }

    /// Largest step from the pass at `side` to the next, in units of the side parameter there; `before`: steps of the previous passes, the last one first.
    ///
    /// # Errors
    /// As [`Oracle::schedule`].
    fn exact_interval(
        &self,
        side: f64,
        before: &[f64],
        smooth: &SmoothParameter,
    ) -> Result<f64, OracleError> {
        let end = self.last_line();
        let places = self.places_on(side);
        let here = self.greatest_density(side, &places)?;
        if here <= 0.0 || side >= end {
            return Ok(f64::INFINITY);
        }
        let first = 1.0 / here.sqrt();
        let expected = match *before {
            [last, older, ..] if last.is_finite() && older.is_finite() => {
                last * (last / older).clamp(1.0 / TREND_MAX, TREND_MAX)
            }
            [last, ..] if last.is_finite() => last,
            _ => first,
        };
        let distance = expected.min(smooth.distance(side, end));
        let beside = |share: f64| -> Result<f64, OracleError> {
            let line = smooth.advanced(side, share * distance);
            let scale = smooth.scale(line) / smooth.scale(side);
            Ok(self.greatest_density(line, &places)? / (scale * scale))
        };
        let (half, whole) = (beside(0.5)?, beside(1.0)?);
        let breaks = self.surface.breaks(self.across());
        let has_knot = |from: f64, to: f64| {
            breaks
                .iter()
                .any(|knot| from < *knot && *knot <= to && *knot < end)
        };
        let [middle, whole_line] = [0.5, 1.0].map(|share| smooth.advanced(side, share * distance));
        let knots = [has_knot(side, middle), has_knot(middle, whole_line)];
        let mean = mean_density(here, half, whole, knots);
        // x^2 (1 + rise x) = 1, in units of the first-order step.
        let rise = (mean / here - 1.0) * first / distance;
        let mut step = 1.0_f64;
        for _ in 0..NEWTON_STEPS {
            let slope = step * (2.0 + 3.0 * rise * step);
            let next = step - (step * step * (1.0 + rise * step) - 1.0) / slope.max(0.5);
            step = next.clamp(STEP_RANGE[0], STEP_RANGE[1]);
        }
        // A falling mean falls no further than over the distance at which it was scanned.
        if rise < 0.0 && step * first > distance {
            step = step.min((here / mean).sqrt().max(STEP_RANGE[0]));
        }
        Ok(step * first)
    }

    /// Places of the scan within the intervals of a line, their ends included.
    fn places_on(&self, side: f64) -> Vec<f64> {
        let mut places = self.scan_places();
        if self.region.is_some() {
            let intervals = self.certain_intervals(side);
            places.retain(|place| intervals.iter().any(|[from, to]| (from..=to).contains(&place)));
            places.extend(intervals.iter().flatten());
            places.sort_by(f64::total_cmp);
        }
        places
    }

    /// Greatest exact density at these places of the line at `side`, skew ends at the surface's boundaries included.
    fn greatest_density(&self, side: f64, places: &[f64]) -> Result<f64, OracleError> {
        let boundaries = self.path_range();
        let mut most = 0.0_f64;
        for place in places {
            let is_end = boundaries.contains(place);
            most = most.max(self.exact_density(*place, side, is_end)?);
        }
        Ok(most)
    }

    /// 1/interval^2 at a point, to all orders of h/r on a surface of constant curvature.
    fn exact_density(&self, path: f64, side: f64, is_end: bool) -> Result<f64, OracleError> {
        self.interval_at(path, side)?;
        let (u, v) = self.swapped(path, side);
        let contact = self.contact(u, v)?;
        let room = 1.0 - self.radius_mm * contact.curvature_side;
        let across = contact.lateral_speed * contact.lateral_speed * room;
        let height = self.scallop_mm / self.radius_mm;
        let error_mm = LOCATION_ERROR_MM + LOCATION_ERROR_SHARE * self.radius_mm;
        let left = (1.0 - error_mm / self.scallop_mm).max(HEIGHT_SHARE_MIN);
        let exact = (1.0 + height * (room - 1.0)) / ((1.0 - 0.5 * height) * left);
        let density = across * exact / (8.0 * self.radius_mm * self.scallop_mm);
        if !is_end {
            return Ok(density);
        }
        // The last ball of a skew pass is at the distance along the side line: its height grows with |B|^2 (1 + r c_B).
        let at = self.surface.at(u, v);
        let (b, bb) = match self.along {
            Along::U => (at.v, at.vv),
            Along::V => (at.u, at.uu),
        };
        let outwards = b.length_squared() - self.radius_mm * bb.dot(contact.normal);
        let part = across / outwards;
        if part > 0.0 && part < 1.0 {
            Ok(density * 4.0 / (1.0 + part.sqrt()).powi(2))
        } else {
            Ok(density)
        }
    }

    /// Least interval of the pass at `side`; infinite if the pass has none.
    ///
    /// # Errors
    /// As [`Oracle::schedule`].
    pub fn least_interval(&self, side: f64) -> Result<f64, OracleError> {
        let places = self.places_on(side);
        let mut intervals = Vec::with_capacity(places.len());
        for place in &places {
            intervals.push(self.interval_at(*place, side)?);
        }
        let least = intervals.iter().copied().fold(f64::INFINITY, f64::min);
        let mut refined = least;
        for (index, interval) in intervals.iter().enumerate() {
            let (before, after) = (index.saturating_sub(1), (index + 1).min(places.len() - 1));
            let is_low = *interval <= intervals[before] && *interval <= intervals[after];
            if is_low && *interval <= least * (1.0 + REFINE_SHARE) {
                refined = refined.min(self.refine(places[before], places[after], side)?);
            }
        }
        Ok(refined)
    }

    /// Path parameters of the scan, ends and knots included.
    fn scan_places(&self) -> Vec<f64> {
        let breaks = self.surface.breaks(self.along);
        let spans = breaks.len() - 1;
        let steps = SCAN_PER_SPAN.max(SCAN_MIN.div_ceil(spans));
        let inside = |pair: &[f64]| {
            let (low, high) = (pair[0], pair[1]);
            (0..steps)
                .map(move |k| low + (high - low) * (k as f64) / (steps as f64))
                .collect::<Vec<_>>()
        };
        breaks
            .windows(2)
            .flat_map(inside)
            .chain(breaks.last().copied())
            .collect()
    }

    /// Least interval in a bracket by golden section.
    fn refine(&self, low: f64, high: f64, side: f64) -> Result<f64, OracleError> {
        let share = 0.5 * (5.0_f64.sqrt() - 1.0);
        let (mut low, mut high) = (low, high);
        let (mut left, mut right) = (high - share * (high - low), low + share * (high - low));
        let (mut at_left, mut at_right) = (self.interval_at(left, side)?, self.interval_at(right, side)?);
        for _ in 0..GOLDEN_STEPS {
            if at_left <= at_right {
                (high, right, at_right) = (right, left, at_left);
                left = high - share * (high - low);
                at_left = self.interval_at(left, side)?;
            } else {
                (low, left, at_left) = (left, right, at_right);
                right = low + share * (high - low);
                at_right = self.interval_at(right, side)?;
            }
        }
        Ok(at_left.min(at_right))
    }

    /// The interval at a point where the ball must fit.
    fn interval_at(&self, path: f64, side: f64) -> Result<f64, OracleError> {
        let (u, v) = self.swapped(path, side);
        let contact = self.contact(u, v)?;
        let fit = contact.fit(self.radius_mm);
        if fit >= 1.0 {
            return Err(OracleError::BallDoesNotFit { u, v, fit });
        }
        Ok(contact.interval)
    }
}

/// Mean density over a gap from that at its start, middle and end; at a knot in a half of it the density may jump, and the mean is the greatest that the
/// place of the knot can make it.
fn mean_density(here: f64, half: f64, whole: f64, [first, second]: [bool; 2]) -> f64 {
    let parabola = (here + 4.0 * half + whole) / 6.0;
    let lines = (here + 2.0 * half + whole) / 4.0;
    let mut mean = parabola.max(lines);
    if first {
        mean = mean.max(0.5 * (half + whole));
    }
    if second {
        mean = mean.max(0.5 * (here + half));
    }
    if first || second {
        mean = mean.max(0.5 * (here + whole));
    }
    mean
}
