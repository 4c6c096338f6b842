//! Time-optimal move from standstill to standstill along a line, with velocity, acceleration and jerk limits.
//!
//! The profile is symmetric: acceleration with jerk J up to an acceleration a <= A and a velocity v <= V, then the mirror image. Accelerating to v
//! takes `v / a + a / J` and covers `v / 2` times that time; the four cases differ by the limits reached
//! (L. Biagiotti, C. Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 2008, section 3.4).

/// Limits along a line, all above 0: mm/s, mm/s^2, mm/s^3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineLimits {
    /// Velocity V.
    pub velocity: f64,
    /// Acceleration A.
    pub acceleration: f64,
    /// Jerk J.
    pub jerk: f64,
}

impl LineLimits {
    /// Time from standstill to a velocity v with zero final acceleration and without overshoot, s.
    #[must_use]
    pub fn ramp_s(&self, v: f64) -> f64 {
        if v * self.jerk >= self.acceleration * self.acceleration {
            v / self.acceleration + self.acceleration / self.jerk
        } else {
            2.0 * (v / self.jerk).sqrt()
        }
    }

    /// The largest velocity reached on a move over a distance, mm/s.
    #[must_use]
    pub fn peak_velocity(&self, distance: f64) -> f64 {
        let Self {
            velocity,
            acceleration: a,
            jerk,
        } = *self;
        // Distance of both ramps: v times the duration of one. v (v / a + a / J) = d, or v 2 sqrt(v / J) = d.
        let lag = a * a / jerk;
        let reached = 0.5 * ((lag * lag + 4.0 * a * distance).sqrt() - lag);
        let reached = if reached >= lag {
            reached
        } else {
            (0.25 * distance * distance * jerk).cbrt()
        };
        reached.min(velocity)
    }

    /// Duration of a move from rest to rest over a distance (0 or more), s.
    #[must_use]
    pub fn rest_to_rest_s(&self, distance: f64) -> f64 {
        if distance <= 0.0 {
            return 0.0;
        }
        let peak = self.peak_velocity(distance);
        let ramp = self.ramp_s(peak);
        let cruise = (distance - peak * ramp).max(0.0);
        // Below the velocity limit a move is two ramps: the rest is rounding.
        if peak < self.velocity {
            2.0 * ramp
        } else {
            2.0 * ramp + cruise / peak
        }
    }

    /// Upper bound of the distance from standstill in a time, at any final speed, mm: jerk, then acceleration, then
    /// velocity at their limits.
    #[must_use]
    pub fn reach_mm(&self, time_s: f64) -> f64 {
        let Self {
            velocity,
            acceleration,
            jerk,
        } = *self;
        // Velocity rises with J up to A, then with A; a real motion would reduce the acceleration before V, so this is an upper bound.
        let bend = acceleration / jerk;
        let until = if 0.5 * jerk * bend * bend >= velocity {
            (2.0 * velocity / jerk).sqrt()
        } else {
            bend + (velocity - 0.5 * jerk * bend * bend) / acceleration
        };
        let rising = |t: f64| {
            let first = t.min(bend);
            let rest = t - first;
            jerk * first.powi(3) / 6.0 + 0.5 * jerk * first * first * rest + 0.5 * acceleration * rest * rest
        };
        rising(time_s.min(until)) + velocity * (time_s - until).max(0.0)
    }

    /// Least time to a distance from standstill, s: the inverse of [`Self::reach_mm`].
    #[must_use]
    pub fn reach_s(&self, distance: f64) -> f64 {
        if distance <= 0.0 {
            return 0.0;
        }
        let (mut low, mut high) = (0.0, 1.0);
        while self.reach_mm(high) < distance {
            high *= 2.0;
        }
        // Bisection to f64 precision.
        for _ in 0..80 {
            let middle = 0.5 * (low + high);
            if self.reach_mm(middle) < distance {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOLDEN: &str = include_str!("../../../../tests/golden/ruckig.txt");

    /// Every case of the table computed with Ruckig, including moves that reach neither the velocity nor the acceleration limit.
    #[test]
    fn durations_are_ruckigs() {
        let mut cases = 0;
        let mut kinds = [0; 4];
        for line in GOLDEN.lines().filter(|line| !line.starts_with('#')) {
            let numbers: Vec<f64> = line
                .split_whitespace()
                .map(|number| number.parse().unwrap())
                .collect();
            let [distance, velocity, acceleration, jerk, duration] = numbers[..] else {
                panic!("{line}");
            };
            let limits = LineLimits {
                velocity,
                acceleration,
                jerk,
            };
            let ours = limits.rest_to_rest_s(distance);
            assert!(
                (ours / duration - 1.0).abs() <= 1e-9,
                "{line}: {ours} is not {duration}"
            );
            let peak = limits.peak_velocity(distance);
            let at_velocity = peak >= velocity * (1.0 - 1e-12);
            let at_acceleration = peak * jerk >= acceleration * acceleration;
            kinds[2 * usize::from(at_velocity) + usize::from(at_acceleration)] += 1;
            cases += 1;
        }
        assert!(cases >= 200, "{cases}");
        // All four profile types occur.
        assert!(kinds.iter().all(|count| *count >= 15), "{kinds:?}");
    }

    /// Reach by numerical integration in small time steps.
    #[test]
    fn reach_is_the_integral_of_the_fastest_rise() {
        for (velocity, acceleration, jerk) in [
            (100.0, 1000.0, 20_000.0),
            (5.0, 1000.0, 20_000.0),
            (100.0, 100.0, 1e6),
        ] {
            let limits = LineLimits {
                velocity,
                acceleration,
                jerk,
            };
            let step = 1e-6;
            let (mut x, mut v, mut a) = (0.0, 0.0, 0.0);
            for k in 1..200_000_u32 {
                let before = v;
                let risen: f64 = (a + jerk * step).min(acceleration);
                v = (v + 0.5 * (a + risen) * step).min(velocity);
                a = risen;
                x += 0.5 * (before + v) * step;
                if k % 20_000 == 0 {
                    let t = f64::from(k) * step;
                    assert!((limits.reach_mm(t) / x - 1.0).abs() < 1e-4, "{t}");
                    assert!((limits.reach_s(limits.reach_mm(t)) - t).abs() < 1e-9);
                    // Never later than a move that also stops at the distance.
                    assert!(limits.reach_s(x) <= limits.rest_to_rest_s(x));
                }
            }
        }
    }
}
