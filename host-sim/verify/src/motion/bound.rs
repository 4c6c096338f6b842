//! Lower bound of the time of a pass, from standstill to standstill or with ends that are free: passed at any speed and acceleration.
//!
//! Two relaxations are combined. Within the pass jerk is ignored: velocity and acceleration alone give the largest speed of any motion
//! at each point, by a backward and a forward sweep over `v^2` (Q.-C. Pham, H. Pham, "A New Approach to Time-Optimal Path
//! Parameterization Based on Reachability Analysis", IEEE Trans. Robotics 34, 2018). At each end the path is replaced by the distance of the
//! centre along its first (last) direction, whose least time from standstill includes the jerk limit. The bound is the larger of this and of the
//! time of the jerk-limited move over the chord. At a free end there is no ramp, and no chord. The extra time for steps of the path's derivatives is ignored.

use super::optimum::PassEnd;
use super::path::PassPath;
use super::point::LineLimits;
use glam::DVec3;
use job::AxisLimits;

/// Bounds of the motion along a path, from the axis limits.
pub(super) trait PathBounds {
    /// The largest velocity, acceleration and jerk along a unit direction of any motion within the limits.
    fn along(&self, direction: DVec3) -> LineLimits;
    /// Largest speed of the contact at a point, by its feed and the axis velocities.
    fn speed_cap(&self, first: DVec3, feed_mm_s: f64) -> f64;
    /// Range of path accelerations (second time derivative of the contact's arc length) that the axes allow, mm/s^2. `first`, `second`: derivatives
    /// of the centre by that arc length; `b`: square of the speed. Descending ends mean an empty range.
    fn accelerations(&self, first: DVec3, second: DVec3, b: f64) -> [f64; 2];
}

impl PathBounds for AxisLimits {
    fn along(&self, direction: DVec3) -> LineLimits {
        let reach = |limit: &[f64; 3]| direction.abs().dot(DVec3::from(*limit));
        LineLimits {
            velocity: reach(&self.velocity_mm_s),
            acceleration: reach(&self.acceleration_mm_s2),
            jerk: reach(&self.jerk_mm_s3),
        }
    }

    fn speed_cap(&self, first: DVec3, feed_mm_s: f64) -> f64 {
        (0..3).fold(feed_mm_s, |cap, axis| {
            cap.min(self.velocity_mm_s[axis] / first[axis].abs())
        })
    }

    fn accelerations(&self, first: DVec3, second: DVec3, b: f64) -> [f64; 2] {
        let mut range = [f64::NEG_INFINITY, f64::INFINITY];
        for axis in 0..3 {
            let (gain, drift, limit) = (first[axis], second[axis] * b, self.acceleration_mm_s2[axis]);
            if gain.abs() > GAIN_MIN {
                let ends = [(-limit - drift) / gain, (limit - drift) / gain];
                range[0] = range[0].max(ends[0].min(ends[1]));
                range[1] = range[1].min(ends[0].max(ends[1]));
            } else if drift.abs() > limit * (1.0 + GAIN_MIN) {
                return [f64::INFINITY, f64::NEG_INFINITY];
            }
        }
        range
    }
}

/// An axis whose derivative is below this is left out of the range of path accelerations: at its reversal the range would consist
/// of rounding errors.
const GAIN_MIN: f64 = 1e-6;
/// Steps of the sweep over a pass.
const STEPS: usize = 4000;
/// Bisections of a squared speed: to f64 precision.
const BISECTIONS: usize = 60;

/// The speed profile without jerk limits.
pub(super) struct MaxSpeedProfile {
    /// Arc lengths, evenly spaced within each smooth span.
    pub(super) arcs: Vec<f64>,
    /// Square of the largest speed at each arc length.
    pub(super) squares: Vec<f64>,
    firsts: Vec<DVec3>,
    seconds: Vec<DVec3>,
}

impl MaxSpeedProfile {
    pub(super) fn new(path: &PassPath<'_>, feed_mm_s: f64, limits: &AxisLimits, ends: [PassEnd; 2]) -> Self {
        let (mut arcs, mut firsts, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
        for (span, ends) in path.breaks().windows(2).enumerate() {
            let share = (ends[1] - ends[0]) / path.length_mm();
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                clippy::cast_precision_loss,
                reason = "a count of steps"
            )]
            let (steps, from) = (
                (share * STEPS as f64).ceil().max(16.0) as usize,
                usize::from(span > 0),
            );
            for k in from..=steps {
                #[allow(clippy::cast_precision_loss, reason = "a count of steps")]
                let arc = ends[0] + (ends[1] - ends[0]) * k as f64 / steps as f64;
                let at = path.at(span, arc);
                arcs.push(arc);
                firsts.push(at.first);
                seconds.push(at.second);
            }
        }
        let count = arcs.len();
        let mut squares: Vec<f64> = firsts
            .iter()
            .map(|first| limits.speed_cap(*first, feed_mm_s).powi(2))
            .collect();
        for (end, index) in ends.into_iter().zip([0, count - 1]) {
            if end == PassEnd::Rest {
                squares[index] = 0.0;
            }
        }
        let mut fastest = Self {
            arcs,
            squares,
            firsts,
            seconds,
        };
        for k in (0..count - 1).rev() {
            fastest.squares[k] = fastest.controllable(k, limits);
        }
        for k in 0..count - 1 {
            let [least, most] =
                limits.accelerations(fastest.firsts[k], fastest.seconds[k], fastest.squares[k]);
            // At the limit speed the range has one value, and rounding may make it empty.
            if least <= most {
                let reached = fastest.squares[k] + 2.0 * fastest.step(k) * most;
                fastest.squares[k + 1] = fastest.squares[k + 1].min(reached.max(0.0));
            }
        }
        fastest
    }

    /// Largest speed at each arc length by the feed and the axis velocities alone, mm/s.
    pub(super) fn speed_caps(&self, feed_mm_s: f64, limits: &AxisLimits) -> Vec<f64> {
        let firsts = self.firsts.iter();
        firsts.map(|first| limits.speed_cap(*first, feed_mm_s)).collect()
    }

    fn step(&self, k: usize) -> f64 {
        self.arcs[k + 1] - self.arcs[k]
    }

    /// The largest squared speed from which the next point's can be reached.
    fn controllable(&self, k: usize, limits: &AxisLimits) -> f64 {
        let (step, next) = (self.step(k), self.squares[k + 1]);
        let can = |b: f64| {
            let [least, most] = limits.accelerations(self.firsts[k], self.seconds[k], b);
            least <= most && b + 2.0 * step * least <= next && b + 2.0 * step * most >= 0.0
        };
        let (mut low, mut high) = (0.0, self.squares[k]);
        if can(high) {
            return high;
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if can(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        // The lower end is feasible in spite of rounding: one unit in the last place below the supremum.
        low
    }

    /// Time from the beginning to each point, s: every step at the larger speed of its ends, which gives a lower bound.
    fn times(&self) -> Vec<f64> {
        let mut time = 0.0;
        let mut times = vec![0.0];
        for k in 0..self.arcs.len() - 1 {
            time += self.step(k) / self.squares[k].max(self.squares[k + 1]).sqrt();
            times.push(time);
        }
        times
    }
}

/// Least times from standstill at one end to each point, along the first direction of the path; in the order of `places`.
fn least_times_from_rest(places: &[(DVec3, DVec3)], feed_mm_s: f64, limits: &AxisLimits) -> Vec<f64> {
    let Some((from, first)) = places.first() else {
        return Vec::new();
    };
    let direction = *first / first.length();
    let along = limits.along(direction);
    let mut gain = 0.0_f64;
    let mut best = 0.0_f64;
    places
        .iter()
        .map(|(at, first)| {
            gain = gain.max(first.dot(direction).abs());
            let line = LineLimits {
                velocity: along.velocity.min(feed_mm_s * gain),
                ..along
            };
            best = best.max(line.reach_s((*at - *from).dot(direction)));
            best
        })
        .collect()
}

/// The lower bound, s. 0 for a pass of zero length.
#[must_use]
pub fn lower_bound_s(path: &PassPath<'_>, feed_mm_s: f64, limits: &AxisLimits, ends: [PassEnd; 2]) -> f64 {
    if path.length_mm() <= 0.0 {
        return 0.0;
    }
    bound_of(
        &MaxSpeedProfile::new(path, feed_mm_s, limits, ends),
        path,
        feed_mm_s,
        limits,
        ends,
    )
}

pub(super) fn bound_of(
    fastest: &MaxSpeedProfile,
    path: &PassPath<'_>,
    feed_mm_s: f64,
    limits: &AxisLimits,
    ends: [PassEnd; 2],
) -> f64 {
    let times = fastest.times();
    let whole = times[times.len() - 1];
    let mut places: Vec<(DVec3, DVec3)> = fastest
        .arcs
        .iter()
        .zip(&fastest.firsts)
        .map(|(arc, first)| (path.position(*arc), *first))
        .collect();
    let least_times = |places: &[(DVec3, DVec3)], end: PassEnd| match end {
        PassEnd::Rest => least_times_from_rest(places, feed_mm_s, limits),
        PassEnd::Free => vec![0.0; places.len()],
    };
    let forwards = least_times(&places, ends[0]);
    places.reverse();
    let mut backwards = least_times(&places, ends[1]);
    backwards.reverse();
    places.reverse();
    // Extra time of the ramps at both ends over the sweep, maximised over the two points where the relaxations change, in order.
    let mut before = 0.0_f64;
    let mut most = 0.0_f64;
    for k in 0..times.len() {
        before = before.max(forwards[k] - times[k]);
        most = most.max(before + backwards[k] - (whole - times[k]));
    }
    let chord = places[places.len() - 1].0 - places[0].0;
    let distance = chord.length();
    let mut straight = 0.0;
    if distance > 0.0 && ends == [PassEnd::Rest; 2] {
        let direction = chord / distance;
        let along = limits.along(direction);
        let gain = fastest
            .firsts
            .iter()
            .map(|first| first.dot(direction).abs())
            .fold(0.0, f64::max);
        let line = LineLimits {
            velocity: along.velocity.min(feed_mm_s * gain),
            ..along
        };
        straight = line.rest_to_rest_s(distance);
    }
    (whole + most).max(straight)
}
