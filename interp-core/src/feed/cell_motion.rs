//! The motion of a walk over one cell of the stations.

use crate::math::arith::sqrt;
use crate::math::number::Bounded;

/// The motion over a cell: at a constant acceleration; next to a rest, at the greatest one for as long as it takes; from rest to rest, over each half of it.
pub(super) struct CellMotion {
    /// s.
    pub(super) duration: f32,
    length: f32,
    /// Speed at the start, or from the rest's end at the other, and acceleration.
    speed: f32,
    acceleration: f32,
    /// Time of the acceleration, and whether the rest is at the end.
    ramp: f32,
    is_end: bool,
    /// Rests at both ends.
    is_between: bool,
}

impl CellMotion {
    /// Between these squares of the speed.
    pub(super) fn of(here: f32, there: f32, length: f32, acceleration: f32) -> Self {
        let is_end = there == 0.0 && here > 0.0;
        if !(length > 0.0) {
            return Self {
                duration: 0.0,
                length: 0.0,
                speed: 0.0,
                acceleration: 0.0,
                ramp: 0.0,
                is_end,
                is_between: false,
            };
        }
        if here == 0.0 && there == 0.0 {
            let acceleration = acceleration.at_least(1e-6);
            let ramp = sqrt(length / acceleration);
            return Self {
                duration: 2.0 * ramp,
                length,
                speed: 0.0,
                acceleration,
                ramp,
                is_end: false,
                is_between: true,
            };
        }
        let top = sqrt(here.at_least(there)).at_least(1e-6);
        if here > 0.0 && there > 0.0 {
            let duration = 2.0 * length / (sqrt(here) + sqrt(there));
            return Self {
                duration,
                length,
                speed: sqrt(here),
                acceleration: 0.5 * (there - here) / length,
                ramp: duration,
                is_end: false,
                is_between: false,
            };
        }
        let acceleration = acceleration.at_least(0.5 * top * top / length);
        let ramp = top / acceleration;
        Self {
            duration: ramp + (length - 0.5 * top * ramp).at_least(0.0) / top,
            length,
            speed: 0.0,
            acceleration,
            ramp,
            is_end,
            is_between: false,
        }
    }

    /// Length after this time.
    pub(super) fn at(&self, time: f32) -> f32 {
        let is_end = self.is_end || (self.is_between && time > self.ramp);
        let time = if is_end { self.duration - time } else { time };
        let ramp = time.at_most(self.ramp);
        let top = self.speed + self.acceleration * ramp;
        let moved = 0.5 * (self.speed + top) * ramp + top * (time - ramp);
        if is_end { self.length - moved } else { moved }
    }
}

#[cfg(test)]
mod tests {
    use super::CellMotion;

    #[test]
    fn from_rest_to_rest() {
        let motion = CellMotion::of(0.0, 0.0, 4.0, 100.0);
        // Half of the way, s = a t^2 / 2.
        assert!((motion.duration - 0.4).abs() < 1e-6);
        for (time, length) in [(0.0, 0.0), (0.1, 0.5), (0.2, 2.0), (0.3, 3.5), (0.4, 4.0)] {
            assert!((motion.at(time) - length).abs() < 1e-5, "{time}");
        }
    }
}
