//! The passes of a job, found without running it: the least interval of each pass by a dense scan.

use super::contact::{Oracle, OracleError};

/// Places a span that are scanned for the least interval, and at least so many a pass.
const SCAN_PER_SPAN: usize = 64;
const SCAN_MIN: usize = 512;
/// Golden-section steps: each shortens the bracket to 0.618, so 48 bring it to 1e-10 of itself, where the interval,
/// flat at its least, is exact.
const GOLDEN_STEPS: usize = 48;
/// Minima of the scan that are refined: those within this share of the least one.
const REFINE_SHARE: f64 = 1e-2;
/// A pass that ends closer than this share of its interval to the boundary lies on it.
const BOUNDARY_SHARE: f64 = 1e-9;
/// Passes after which a schedule is given up.
const PASSES_MAX: usize = 1_000_000;

/// A pass: where it lies, and how far the next one may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// Side parameter.
    pub side: f64,
    /// Least interval on the pass, in the side parameter.
    pub interval: f64,
}

impl Oracle {
    /// All passes from one boundary of the side parameter to the other (steps 5 and 6).
    ///
    /// # Errors
    /// [`OracleError::BallDoesNotFit`] and [`OracleError::Degenerate`] at the first such place,
    /// [`OracleError::TooManyPasses`] if the intervals shrink towards nothing.
    pub fn schedule(&self) -> Result<Vec<Pass>, OracleError> {
        let [start, end] = self.side_range();
        let mut passes = Vec::new();
        let mut side = start;
        while passes.len() < PASSES_MAX {
            let interval = self.least_interval(side)?;
            passes.push(Pass { side, interval });
            if side >= end {
                return Ok(passes);
            }
            let next = side + interval;
            if next <= side {
                return Err(OracleError::TooManyPasses);
            }
            side = if end - next <= BOUNDARY_SHARE * interval {
                end
            } else {
                next
            };
        }
        Err(OracleError::TooManyPasses)
    }

    /// Least interval of the pass at `side`; infinite if the pass has none.
    ///
    /// # Errors
    /// As [`Oracle::schedule`].
    pub fn least_interval(&self, side: f64) -> Result<f64, OracleError> {
        let places = self.scan_places();
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

    /// The interval at a place where the ball must fit.
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
