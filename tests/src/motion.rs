//! What emitted positions use of the limits of the axes.

use interp_core::{AxisLimits, Sample};
use std::collections::VecDeque;

/// Largest permitted use of the limits of velocity, acceleration and jerk, after the rounding of the positions to nm is subtracted.
pub const PERMITTED: [f64; 3] = [1.0005, 1.0, 1.02];
/// Rounding of a quotient.
const ROUNDING: f64 = 1e-12;

/// Periods over which differences are taken for the jerk: over one, a jerk of 10 000 mm/s^3 is 10 nm, as much as positions that are good to a
/// nanometre or two can make of nothing.
const BASE: usize = 4;

/// Differences of the emitted positions over the limits, in every state.
#[derive(Clone, Debug, Default)]
pub struct Uses {
    /// The last positions, the newest first.
    last: VecDeque<[i64; 3]>,
    /// Greatest uses of velocity, acceleration and jerk.
    pub worst: [f64; 3],
}

impl Uses {
    /// Adds a sample; before the first one the tool stood there.
    #[allow(clippy::cast_precision_loss, reason = "far below 2^53")]
    pub fn add(&mut self, sample: &Sample, axes: &AxisLimits, period_s: f32) {
        self.last.push_front(sample.cl_nm.map(i64::from));
        self.last.truncate(3 * BASE + 1);
        let limits = [axes.velocity_mm_s, axes.acceleration_mm_s2, axes.jerk_mm_s3];
        for (order, (worst, limits)) in (1..).zip(self.worst.iter_mut().zip(limits)) {
            let base = if order == 3 { BASE } else { 1 };
            let weights: &[i64] = [&[1, -1][..], &[1, -2, 1], &[1, -3, 3, -1]][order - 1];
            let base_s = base as f64 * f64::from(period_s);
            for (axis, limit) in limits.into_iter().enumerate() {
                let at = |back: usize| self.last.get(back).or(self.last.back()).map_or(0, |at| at[axis]);
                let places = weights.iter().enumerate();
                let nm: i64 = places.map(|(index, weight)| weight * at(index * base)).sum();
                // Each position has a rounding error of at most half a nanometre.
                let rounding = (1_u32 << (order - 1)) as f64;
                let value = (nm.abs() as f64 - rounding).max(0.0) * 1e-6 / base_s.powi(order as i32);
                *worst = worst.max(value / f64::from(limit));
            }
        }
    }

    /// Whether they are permitted.
    #[must_use]
    pub fn are_permitted(&self) -> bool {
        let mut each = self.worst.iter().zip(PERMITTED);
        each.all(|(worst, most)| *worst <= most * (1.0 + ROUNDING))
    }

    /// Panics if they are not permitted.
    pub fn check(&self, what: &str) {
        assert!(
            self.are_permitted(),
            "{what}: velocity, acceleration, jerk {:?} of their limits",
            self.worst
        );
    }
}
