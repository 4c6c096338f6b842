//! A straight move.

use super::{NOTHING_NM, Progress, Whole, to_mm};
use crate::feed::curve::{Curve, CurveCursor, CurveLimits};
use crate::feed::limits::SLOPE_MIN;
use crate::feed::pace::Trajectory as _;
use crate::feed::to_q10;
use crate::job::AxisLimits;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;

/// A straight line from point to point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StraightPath {
    from: [i32; 3],
    to: [i32; 3],
    length_q10: i64,
    whole: Whole,
}

impl StraightPath {
    pub(crate) const NONE: Self = Self {
        from: [0; 3],
        to: [0; 3],
        length_q10: 0,
        whole: Whole::NONE,
    };

    /// Becomes a line from point to point; returns its length, mm, and the limits along it. None where the length is negligible.
    pub(crate) fn lead(
        &mut self,
        from: [i32; 3],
        to: [i32; 3],
        axes: &AxisLimits,
    ) -> Option<(f32, CurveLimits)> {
        let mut apart = [0_i64; 3];
        for ((apart, from), to) in apart.iter_mut().zip(&from).zip(&to) {
            *apart = i64::from(*to) - i64::from(*from);
        }
        (self.from, self.to) = (from, to);
        if apart.iter().all(|apart| apart.abs() <= NOTHING_NM) {
            self.length_q10 = 0;
            return None;
        }
        let mm = apart.map(to_mm);
        let [x, y, z] = mm;
        let length = sqrt(x * x + y * y + z * z);
        let mut limits = CurveLimits {
            speed: f32::MAX,
            acceleration: f32::MAX,
            jerk: f32::MAX,
        };
        let axis = axes
            .velocity_mm_s
            .iter()
            .zip(&axes.acceleration_mm_s2)
            .zip(&axes.jerk_mm_s3)
            .zip(&mm);
        for (((v, a), j), mm) in axis {
            let slope = 1.0 / (mm / length).abs().at_least(SLOPE_MIN);
            limits.speed = limits.speed.at_most(v * slope);
            limits.acceleration = limits.acceleration.at_most(a * slope);
            limits.jerk = limits.jerk.at_most(j * slope);
        }
        self.length_q10 = to_q10(length);
        self.whole = Whole::new(self.length_q10);
        Some((length, limits))
    }

    /// The position at a place of the motion along it.
    pub(crate) fn position_at(&self, curve: &Curve, cursor: &CurveCursor) -> [i32; 3] {
        if curve.is_over(cursor) || cursor.moved_q10 >= self.length_q10 {
            return self.to;
        }
        let part = self.whole.part_q30(cursor.moved_q10);
        let mut at = self.from;
        for (at, to) in at.iter_mut().zip(&self.to) {
            // 32 bits times 30 bits fits 64.
            let apart = i64::from(*to) - i64::from(*at);
            let nm = (apart * part + (1 << 29)) >> 30;
            *at = i32::try_from(i64::from(*at) + nm).unwrap_or(*at);
        }
        at
    }
}

/// A straight move.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StraightMove {
    pub(crate) progress: Progress,
    path: StraightPath,
}

impl StraightMove {
    /// No move.
    pub(crate) const NONE: Self = Self {
        progress: Progress::NONE,
        path: StraightPath::NONE,
    };

    /// Becomes a move from point to point whose last `slow_mm` does not exceed `feed_mm_s`; returns whether its length is more than negligible: if not, it is
    /// over. In place, because a copy costs more than the rest.
    pub(crate) fn lead(
        &mut self,
        from: [i32; 3],
        to: [i32; 3],
        slow_mm: f32,
        feed_mm_s: f32,
        axes: &AxisLimits,
    ) -> bool {
        let Some((length, limits)) = self.path.lead(from, to, axes) else {
            self.progress.end();
            return false;
        };
        self.progress
            .lead(length, Curve::new(length, &limits, slow_mm, feed_mm_s));
        true
    }

    /// The position.
    pub(crate) fn position(&self) -> [i32; 3] {
        self.path.position_at(&self.progress.curve, &self.progress.cursor)
    }
}
