//! A motion along a pass as a function of time, and the use of the limits by its samples.

use super::path::PassPath;
use super::programme::MotionProfile;
use glam::DVec3;
use job::AxisLimits;

/// Newton steps for the duration of an interval: each doubles the digits.
const NEWTON_STEPS: usize = 20;
/// Below this `c t^2` the series of the motion is exact to f64 precision.
const SERIES: f64 = 1e-3;

/// Between two nodes: arc, speed, acceleration at the first; rate of the acceleration with the arc, 1/s^2.
struct MotionSegment {
    time: f64,
    arc: f64,
    speed: f64,
    acceleration: f64,
    rate: f64,
}

impl MotionSegment {
    /// Distance and speed after a time: `x'' = a + c x`.
    fn after(&self, t: f64) -> [f64; 2] {
        let (a, c, v) = (self.acceleration, self.rate, self.speed);
        let z = c * t * t;
        // (cosh - 1) / z and sinh / sqrt z, continued to negative z.
        let (even, odd, cosh) = if z.abs() < SERIES {
            (
                0.5 + z / 24.0 * (1.0 + z / 30.0 * (1.0 + z / 56.0)),
                1.0 + z / 6.0 * (1.0 + z / 20.0 * (1.0 + z / 42.0)),
                1.0 + z / 2.0 * (1.0 + z / 12.0 * (1.0 + z / 30.0)),
            )
        } else if z > 0.0 {
            let root = z.sqrt();
            ((root.cosh() - 1.0) / z, root.sinh() / root, root.cosh())
        } else {
            let root = (-z).sqrt();
            ((root.cos() - 1.0) / z, root.sin() / root, root.cos())
        };
        [a * t * t * even + v * t * odd, a * t * odd + v * cosh]
    }

    /// Time to the end of the interval.
    fn duration(&self, length: f64, next_speed: f64) -> f64 {
        let mut t = 2.0 * length / (self.speed + next_speed);
        for _ in 0..NEWTON_STEPS {
            let [way, speed] = self.after(t);
            let by = (length - way) / speed.max(1e-12);
            t = (t + by).max(0.0);
            if by.abs() <= 1e-15 * t {
                break;
            }
        }
        t
    }
}

/// A motion as a function of time.
pub(super) struct Timing {
    segments: Vec<MotionSegment>,
    /// Jerk and duration of the ramp before the first segment and of the ramp after the last.
    ends: [(f64, f64); 2],
    /// Beginning of the final ramp.
    fall: f64,
    length: f64,
}

impl Timing {
    pub(super) fn new(arcs: &[f64], profile: &MotionProfile, ends: [(f64, f64); 2], length: f64) -> Self {
        let mut time = ends[0].1;
        let mut segments = Vec::with_capacity(arcs.len());
        let speed = |node: usize| profile.squares[node].max(0.0).sqrt();
        for k in 0..arcs.len() - 1 {
            let way = arcs[k + 1] - arcs[k];
            let [a, next] = [profile.accelerations[k], profile.accelerations[k + 1]];
            let segment = MotionSegment {
                time,
                arc: arcs[k],
                speed: speed(k),
                acceleration: a,
                rate: (next - a) / way,
            };
            time += segment.duration(way, speed(k + 1));
            segments.push(segment);
        }
        Self {
            segments,
            ends,
            fall: time,
            length,
        }
    }

    /// Whether the motion begins (0) or ends (1) at rest.
    pub(super) fn rests(&self, end: usize) -> bool {
        self.ends[end].1 > 0.0
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.fall + self.ends[1].1
    }

    /// Arc length at a time, and its interval.
    pub(super) fn at(&self, time: f64) -> (f64, usize) {
        let [(rise, _), (fall, last)] = self.ends;
        let segment = self
            .segments
            .partition_point(|segment| segment.time <= time)
            .clamp(1, self.segments.len())
            - 1;
        let arc = if time < self.ends[0].1 {
            rise * time.max(0.0).powi(3) / 6.0
        } else if time >= self.fall {
            self.length - fall * (self.fall + last - time).max(0.0).powi(3) / 6.0
        } else {
            let from = &self.segments[segment];
            from.arc + from.after(time - from.time)[0]
        };
        (arc.clamp(0.0, self.length), segment)
    }

    /// Largest use of the limits by samples at one per period: overall, and of acceleration and jerk in each interval.
    pub(super) fn uses(
        &self,
        path: &PassPath<'_>,
        limits: &AxisLimits,
        period_s: f64,
    ) -> ([f64; 3], Vec<[f64; 2]>) {
        let mut uses = [0.0_f64; 3];
        let mut most = vec![[0.0_f64; 2]; self.segments.len()];
        let mut last = [DVec3::ZERO; 3];
        last[0] = path.position(0.0);
        let mut intervals = [0_usize; 4];
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count of periods"
        )]
        let periods = if self.rests(1) {
            (self.duration_s() / period_s).ceil() as u32 + 3
        } else {
            (self.duration_s() / period_s).floor() as u32
        };
        let unit = [
            (limits.velocity_mm_s, period_s),
            (limits.acceleration_mm_s2, period_s.powi(2)),
            (limits.jerk_mm_s3, period_s.powi(3)),
        ];
        for tick in 1..=periods {
            let (arc, interval) = self.at(f64::from(tick) * period_s);
            intervals.rotate_right(1);
            intervals[0] = interval;
            let mut value = path.position(arc);
            let mut here = [0.0_f64; 3];
            for (order, (last, (limit, per))) in (0_u32..).zip(last.iter_mut().zip(unit)) {
                let before = std::mem::replace(last, value);
                value -= before;
                // Before a free end there is no motion to take differences with.
                if self.rests(0) || tick > order {
                    here[order as usize] = (value.abs() / per / DVec3::from(limit)).max_element();
                }
            }
            for (most, use_) in uses.iter_mut().zip(here) {
                *most = most.max(use_);
            }
            let [newest, .., oldest] = intervals;
            for interval in &mut most[oldest..=newest.max(oldest)] {
                interval[0] = interval[0].max(here[1]);
                interval[1] = interval[1].max(here[2]);
            }
        }
        (uses, most)
    }
}
