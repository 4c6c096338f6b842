//! What a plan may use of the limits of the machine.

use super::stations::Derivatives;
use crate::job::AxisLimits;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;

/// Fractions of the limits that a plan uses. The jerk left over is what a hold begins with while the plan's own jerk is at its limit.
const VELOCITY: f32 = 0.999;
const ACCELERATION: f32 = 0.98;
const JERK: f32 = 0.96;
/// Fraction of the programmed feed that a plan uses. [`super::follow`] adds the rest.
const FEED: f32 = 0.9995;

/// Jerk of a step of the acceleration, as a multiple of step/period: a third difference sees 0.75 at its worst phase.
const STEP_SHARE: f32 = 0.78;

/// Least `|q'|` that is divided by.
pub(crate) const SLOPE_MIN: f32 = 1e-6;

/// Limits along a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionLimits {
    /// Programmed feed of the contact, mm/s.
    pub(crate) feed: f32,
    /// mm/s, mm/s^2, mm/s^3 of each axis.
    pub(crate) velocity: [f32; 3],
    pub(crate) acceleration: [f32; 3],
    pub(crate) jerk: [f32; 3],
    /// Greatest distance of the path from the chord of a period, mm.
    pub(crate) chord: f32,
    /// s.
    pub(crate) period: f32,
}

impl MotionLimits {
    /// No limits yet.
    pub(crate) const NONE: Self = Self {
        feed: 0.0,
        velocity: [1.0; 3],
        acceleration: [1.0; 3],
        jerk: [1.0; 3],
        chord: 1.0,
        period: 1e-3,
    };

    /// The machine's limits at this feed.
    pub(crate) const fn new(axes: &AxisLimits, feed: f32, period: f32) -> Self {
        Self {
            feed,
            velocity: axes.velocity_mm_s,
            acceleration: axes.acceleration_mm_s2,
            jerk: axes.jerk_mm_s3,
            chord: axes.chord_mm,
            period,
        }
    }

    /// What a plan uses of them.
    pub(crate) fn planned(&self) -> Self {
        Self {
            feed: FEED * self.feed,
            velocity: self.velocity.map(|limit| VELOCITY * limit),
            acceleration: self.acceleration.map(|limit| ACCELERATION * limit),
            jerk: self.jerk.map(|limit| JERK * limit),
            ..*self
        }
    }

    /// Square of the greatest speed that feed, velocity and chord allow, (mm/s)^2.
    pub(crate) fn speed_sqr(&self, [first, second, _]: &Derivatives) -> f32 {
        let mut square = self.feed * self.feed;
        let mut curvature_sqr = 0.0;
        for ((limit, first), second) in self.velocity.iter().zip(first).zip(second) {
            let speed = limit / first.abs().at_least(SLOPE_MIN);
            square = square.at_most(speed * speed);
            curvature_sqr += second * second;
        }
        // The chord of a period is off by curvature (v T)^2 / 8.
        let chord = 8.0 * self.chord / (self.period * self.period);
        square.at_most(chord / sqrt(curvature_sqr).at_least(1e-9))
    }

    /// Jerk that jumps of q' and q'' cause in the periods that see them, as fractions of each axis's limit: coefficients of v and of v^2.
    pub(crate) fn jump_jerk(&self, jump: &Jump) -> [[f32; 3]; 2] {
        let rate = 1.0 / self.period;
        let mut shares = [[0.0; 3]; 2];
        let [of_first, of_second] = &mut shares;
        let axis = of_first.iter_mut().zip(of_second).zip(&self.jerk);
        for ((((first, second), jerk), d1), d2) in axis.zip(&jump.first).zip(&jump.second) {
            *first = d1 * rate * rate / jerk;
            *second = STEP_SHARE * d2 * rate / jerk;
        }
        shares
    }

    /// Speed over a jump at which half of the jerk is left, mm/s.
    pub(crate) fn jump_speed(&self, jump: &Jump) -> f32 {
        let [first, second] = self.jump_jerk(jump);
        let mut speed = f32::MAX;
        for (first, second) in first.iter().zip(&second) {
            speed = speed
                .at_most(0.5 / first.at_least(1e-9))
                .at_most(sqrt(0.5 / second.at_least(1e-12)));
        }
        speed
    }
}

/// Sizes of the jumps of q' (1) and q'' (1/mm) of each axis at a patch boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jump {
    pub(crate) first: [f32; 3],
    pub(crate) second: [f32; 3],
}
