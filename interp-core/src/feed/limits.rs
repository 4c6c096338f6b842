//! What a plan may use of the limits of the machine.

use super::stations::{Derivatives, Jump};
use crate::job::AxisLimits;
use crate::math::arith::{sqrt, truncated};
use crate::math::number::Bounded;

/// Fractions of the limits that a plan uses. The jerk left over is what a hold begins with while the plan's own jerk is at its limit.
const VELOCITY: f32 = 0.999;
const ACCELERATION: f32 = 0.98;
const JERK: f32 = 0.96;
/// Fraction of the programmed feed that a plan uses. [`super::follow`] adds the rest.
const FEED: f32 = 0.9995;

/// Jerk of a step of the acceleration, as a multiple of step/period: a third difference sees 0.75 at its worst phase.
const STEP_SHARE: f32 = 0.78;

/// Least and greatest number of periods in which the speed changes from the plan's to the feed.
pub(crate) const CHANGE_MIN: u16 = 32;
const CHANGE_MAX: u16 = 16 * CHANGE_MIN;
/// Greatest relative difference of the plan's speed from the feed that is made up for, and the one that is worth a longer change.
const NEAR: f32 = 3e-3;
const NEAR_WORTH: f32 = 2e-3;
/// Share of the least jerk limit that a change takes, and its jerk as a multiple of difference/duration^2.
const JERK_SHARE: f32 = 0.03;
const CHANGE_JERK: f32 = 5.78;

/// Least `|q'|` that is divided by.
pub(crate) const SLOPE_MIN: f32 = 1e-6;

/// Velocity, acceleration and jerk of an axis, mm/s, mm/s^2, mm/s^3, or their inverses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AxisMotion {
    pub(crate) velocity: f32,
    pub(crate) acceleration: f32,
    pub(crate) jerk: f32,
}

impl AxisMotion {
    const NONE: Self = Self {
        velocity: 0.0,
        acceleration: 0.0,
        jerk: 0.0,
    };

    fn inverse(&self) -> Self {
        Self {
            velocity: 1.0 / self.velocity,
            acceleration: 1.0 / self.acceleration,
            jerk: 1.0 / self.jerk,
        }
    }
}

/// Limits along a path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionLimits {
    /// Programmed feed of the contact, mm/s.
    pub(crate) feed: f32,
    /// Limits of each axis, and their inverses.
    pub(crate) axes: [AxisMotion; 3],
    pub(crate) inverse: [AxisMotion; 3],
    /// Inverse square of the feed, (s/mm)^2.
    inverse_feed_sqr: f32,
    /// Curvature times the square of the speed at which a period's path is as far from its chord as allowed: its inverse, s^2/mm.
    inverse_chord: f32,
    /// s, and 1/s.
    pub(crate) period: f32,
    rate: f32,
}

impl MotionLimits {
    /// No limits yet.
    pub(crate) const NONE: Self = Self {
        feed: 0.0,
        axes: [AxisMotion::NONE; 3],
        inverse: [AxisMotion::NONE; 3],
        inverse_feed_sqr: 0.0,
        inverse_chord: 0.0,
        period: 0.0,
        rate: 0.0,
    };

    /// The machine's limits at this feed.
    pub(crate) fn new(machine: &AxisLimits, feed: f32, period: f32) -> Self {
        let mut axes = [AxisMotion::NONE; 3];
        let limits = machine
            .velocity_mm_s
            .iter()
            .zip(&machine.acceleration_mm_s2)
            .zip(&machine.jerk_mm_s3);
        for (axis, ((velocity, acceleration), jerk)) in axes.iter_mut().zip(limits) {
            *axis = AxisMotion {
                velocity: *velocity,
                acceleration: *acceleration,
                jerk: *jerk,
            };
        }
        // The chord of a period is off by curvature (v T)^2 / 8.
        let inverse_chord = period * period / (8.0 * machine.chord_mm);
        Self::of(feed, axes, inverse_chord, period)
    }

    /// Least time in which an axis reaches its acceleration, s.
    pub(crate) fn ramp_s(&self) -> f32 {
        let ramps = self.axes.iter().zip(&self.inverse);
        ramps.fold(f32::MAX, |least, (axis, inverse)| {
            least.at_most(axis.acceleration * inverse.jerk)
        })
    }

    fn of(feed: f32, axes: [AxisMotion; 3], inverse_chord: f32, period: f32) -> Self {
        Self {
            feed,
            inverse: axes.map(|axis| axis.inverse()),
            axes,
            inverse_feed_sqr: 1.0 / (feed * feed),
            inverse_chord,
            period,
            rate: 1.0 / period,
        }
    }

    /// The same with this share of the jerk.
    pub(crate) fn with_less_jerk(&self, share: f32) -> Self {
        let axes = self.axes.map(|axis| AxisMotion {
            jerk: share * axis.jerk,
            ..axis
        });
        Self::of(self.feed, axes, self.inverse_chord, self.period)
    }

    /// The same with accelerations and jerks relaxed by a factor.
    pub(crate) fn relaxed(&self, by: f32) -> Self {
        let axes = self.axes.map(|axis| AxisMotion {
            acceleration: by * axis.acceleration,
            jerk: by * axis.jerk,
            ..axis
        });
        Self::of(self.feed, axes, self.inverse_chord, self.period)
    }

    /// What a plan uses of them.
    pub(crate) fn planned(&self) -> Self {
        let axes = self.axes.map(|axis| AxisMotion {
            velocity: VELOCITY * axis.velocity,
            acceleration: ACCELERATION * axis.acceleration,
            jerk: JERK * axis.jerk,
        });
        Self::of(FEED * self.feed, axes, self.inverse_chord, self.period)
    }

    /// Inverse square of the greatest speed that feed, velocity and chord allow, (s/mm)^2.
    #[inline(always)]
    pub(crate) fn inverse_speed_sqr(&self, q: &Derivatives) -> f32 {
        let mut most = self.inverse_feed_sqr;
        let mut curvature_sqr = 0.0;
        for (inverse, [first, second, _]) in self.inverse.iter().zip(q) {
            let part = first * inverse.velocity;
            most = most.at_least(part * part);
            curvature_sqr += second * second;
        }
        most.at_least(sqrt(curvature_sqr) * self.inverse_chord)
    }

    /// Jerk that a jump causes in the periods that see it, as fractions of each axis's limit: coefficients of v and of v^2.
    pub(crate) fn jump_jerk(&self, jump: &Jump) -> [[f32; 2]; 3] {
        let mut shares = [[0.0; 2]; 3];
        for ((shares, [first, second]), inverse) in shares.iter_mut().zip(jump).zip(&self.inverse) {
            *shares = [
                first * self.rate * self.rate * inverse.jerk,
                STEP_SHARE * second * self.rate * inverse.jerk,
            ];
        }
        shares
    }

    /// Speed over a jump at which half of the jerk is left, mm/s.
    pub(crate) fn jump_speed(&self, jump: &Jump) -> f32 {
        let mut speed = f32::MAX;
        for [first, second] in self.jump_jerk(jump) {
            speed = speed
                .at_most(0.5 / first.at_least(1e-9))
                .at_most(sqrt(0.5 / second.at_least(1e-12)));
        }
        speed
    }
}

/// How the speed changes from a plan's own to the programmed feed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FeedChange {
    /// Duration, periods.
    pub(crate) periods: u16,
    /// Greatest difference of speed, mm/s.
    pub(crate) near: f32,
}

impl FeedChange {
    pub(crate) const NONE: Self = Self {
        periods: CHANGE_MIN,
        near: 0.0,
    };

    /// Within these limits.
    pub(crate) fn new(limits: &MotionLimits) -> Self {
        let [x, y, z] = limits.axes.map(|axis| axis.jerk);
        let jerk = JERK_SHARE * x.at_most(y).at_most(z);
        let shortest = f32::from(CHANGE_MIN) * limits.period;
        let short = jerk * shortest * shortest * (1.0 / CHANGE_JERK);
        let longer = sqrt((NEAR_WORTH * limits.feed / short.at_least(1e-12)).at_least(1.0));
        let periods = f32::from(CHANGE_MIN) * longer.at_most(f32::from(CHANGE_MAX / CHANGE_MIN));
        let periods = u16::try_from(truncated(periods)).unwrap_or(CHANGE_MAX);
        let ratio = f32::from(periods) * (1.0 / f32::from(CHANGE_MIN));
        Self {
            periods,
            near: (short * ratio * ratio).at_most(NEAR * limits.feed),
        }
    }

    /// Periods that the lead is ahead of the tool: there is time to change to the feed and back.
    pub(crate) const fn lead(&self) -> u16 {
        self.periods.saturating_mul(2)
    }
}
