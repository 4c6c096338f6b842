//! The least time of a pass, from standstill to standstill or with free ends: a lower bound, and a motion that holds all limits.
//!
//! ```text
//! PassPath ──bound.rs──► lower bound; largest speeds ──► grid ──programme.rs──► motion, faster each time ──timing.rs──► one
//!                                                                  ▲  sample a period, differences held against the limits  │
//!                                                                  └──────────────────── shares of the limits ◄─────────────┘
//! ```
//!
//! The motion is not proved to be optimal: the least time is between the two.

use super::bound::{MaxSpeedProfile, PathBounds as _, bound_of};
use super::path::PassPath;
use super::profile::SpeedPoint;
use super::programme::{Interval, MotionProfile, Programme};
use super::timing::Timing;
use glam::DVec3;
use job::AxisLimits;

/// Largest number of successive programmes.
const PROGRAMMES: usize = 30;
/// Relative gain of a programme below which no other follows.
const GAIN_MIN: f64 = 1e-4;
/// Largest number of redistributions of the limits by the samples' use of them.
const ROUNDS: usize = 5;
/// Tolerance of the use of a limit above 1.
const ABOVE: f64 = 3e-4;
/// Share of the jerk limit in the ramps before the first node and after the last one.
const END_JERK: f64 = 0.999;
/// Duration of these ramps as a share of a ramp to the largest speed.
const END_SHARE: f64 = 0.02;
/// Least number of intervals over a pass.
const PASS_INTERVALS: f64 = 160.0;
/// Number of intervals over the distance in which the speed changes at ends and breaks.
const RAMP: f64 = 40.0;
/// Growth of the intervals away from ends and breaks, as a share.
const GROWTH: f64 = 0.15;
/// Change of speed over an interval, as a share of the largest, once a motion is known.
const CHANGE: f64 = 0.04;
/// Largest slope of the speed at a node in those of the intervals beside it.
const SLOPES: f64 = 3.0;
/// Least squared speed used for linearisation, as a share of the largest.
const LEAST: f64 = 1e-9;
/// Steps of a derivative below this share of a jerk limit are ignored.
const STEP_JERK_SHARE_MIN: f64 = 1e-3;

/// How a pass begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PassEnd {
    /// At standstill.
    Rest,
    /// At any speed and acceleration within the limits: the tool comes from beyond the boundary, or goes there.
    Free,
}

/// Bounds of the least time of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Optimum {
    /// Lower bound of the time of any motion within the limits, s.
    pub lower_bound_s: f64,
    /// Time of the motion found within the limits, s.
    pub feasible_s: f64,
    /// Largest use of the limits by that motion's samples: velocity, acceleration, jerk.
    pub uses: [f64; 3],
}

/// The solver found no motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no motion within the limits was found")]
pub struct NoFeasibleMotion;

/// The least time of a pass at this feed of the contact (above 0), with one sample per period: bound and motion. Both are 0 for a pass of
/// zero length.
///
/// # Errors
/// [`NoFeasibleMotion`] where the solver fails.
pub fn optimum(
    path: &PassPath<'_>,
    feed_mm_s: f64,
    limits: &AxisLimits,
    period_s: f64,
    ends: [PassEnd; 2],
) -> Result<Optimum, NoFeasibleMotion> {
    optimum_profile(path, feed_mm_s, limits, period_s, ends).map(|(optimum, _)| optimum)
}

/// As [`optimum`], with the speed of the motion and the limit that binds it, period by period.
///
/// # Errors
/// [`NoFeasibleMotion`] where the solver fails.
pub fn optimum_profile(
    path: &PassPath<'_>,
    feed_mm_s: f64,
    limits: &AxisLimits,
    period_s: f64,
    ends: [PassEnd; 2],
) -> Result<(Optimum, Vec<SpeedPoint>), NoFeasibleMotion> {
    if path.length_mm() <= 0.0 {
        let nothing = Optimum {
            lower_bound_s: 0.0,
            feasible_s: 0.0,
            uses: [0.0; 3],
        };
        return Ok((nothing, Vec::new()));
    }
    let fastest = MaxSpeedProfile::new(path, feed_mm_s, limits, ends);
    let lower_bound_s = bound_of(&fastest, path, feed_mm_s, limits, ends);
    let search = MotionSearch::new(path, feed_mm_s, limits, period_s, &fastest, ends);
    let motion = search.motion()?;
    let optimum = Optimum {
        lower_bound_s,
        feasible_s: motion.time_s,
        uses: motion.uses,
    };
    let profile = motion
        .timing
        .profile(path, feed_mm_s, limits, period_s, motion.slower);
    Ok((optimum, profile))
}

/// A motion within the limits.
struct FoundMotion {
    time_s: f64,
    /// Largest use of the limits by its samples.
    uses: [f64; 3],
    /// The motion before it is slowed down, and the factor of time by which it is.
    timing: Timing,
    slower: f64,
}

/// A point where the motion slows down: an end, or a break where the path's derivatives step.
struct SlowPoint {
    arc: f64,
    /// Speed there, mm/s.
    speed: f64,
    /// Path jerk there, mm/s^3.
    jerk: f64,
    /// Speed up to which a ramp from there leads, mm/s.
    ramp_mm_s: f64,
}

impl SlowPoint {
    /// The speed of a ramp at constant jerk, at an arc length.
    fn speed_at(&self, arc: f64) -> f64 {
        let way = (arc - self.arc).abs();
        self.speed + 0.5 * self.jerk * (6.0 * way / self.jerk).powf(2.0 / 3.0)
    }

    /// The speed at which a ramp meets the largest speeds at these arc lengths, on the side where it is higher.
    fn ramp_mm_s(&self, arcs: &[f64], caps: &[f64]) -> f64 {
        let at = arcs.partition_point(|arc| *arc < self.arc);
        let places = |k: usize| (self.speed_at(arcs[k]), caps[k]);
        let met = |(ramp, cap): (f64, f64)| (ramp >= cap).then_some(cap);
        let before = (0..at).rev().map(places).find_map(met);
        let after = (at..arcs.len()).map(places).find_map(met);
        let whole = [0, arcs.len() - 1].map(|k| self.speed_at(arcs[k]));
        let most = before.into_iter().chain(after).fold(0.0, f64::max);
        if most > 0.0 { most } else { whole[0].max(whole[1]) }
    }
}

/// A step of the derivatives at a break.
struct DerivativeStep {
    arc: f64,
    steps: [[f64; 3]; 2],
}

struct MotionSearch<'a> {
    path: &'a PassPath<'a>,
    feed_mm_s: f64,
    limits: &'a AxisLimits,
    period_s: f64,
    fastest: &'a MaxSpeedProfile,
    ends: [PassEnd; 2],
    /// Path jerk of the ramps at the ends, mm/s^3, and the speeds up to which they lead, mm/s.
    end_jerks: [f64; 2],
    end_ramps_mm_s: [f64; 2],
    /// Largest speed on the pass by feed, velocity and acceleration limits, mm/s.
    speed_max_mm_s: f64,
    slow_points: Vec<SlowPoint>,
    steps: Vec<DerivativeStep>,
}

/// The nodes of a programme.
struct NodeGrid {
    arcs: Vec<f64>,
    intervals: Vec<Interval>,
    caps: Vec<f64>,
}

/// Largest path jerk within the axis limits at a point.
fn path_jerk(first: DVec3, limits: &AxisLimits) -> f64 {
    (0..3).fold(f64::INFINITY, |least, axis| {
        least.min(limits.jerk_mm_s3[axis] / first[axis].abs())
    })
}

/// The speed at which steps of the derivatives use half of a share of the jerk limits: the other half is for the ramps at them.
fn step_speed(steps: [[f64; 3]; 2], limits: &AxisLimits, period_s: f64, share: f64) -> f64 {
    (0..3).fold(f64::INFINITY, |least, axis| {
        let [first, second] = [steps[0][axis], steps[1][axis]];
        let half = 0.5 * share * limits.jerk_mm_s3[axis] * period_s;
        least
            .min(half * period_s / first)
            .min((half / (0.75 * second)).sqrt())
    })
}

impl<'a> MotionSearch<'a> {
    fn new(
        path: &'a PassPath<'a>,
        feed_mm_s: f64,
        limits: &'a AxisLimits,
        period_s: f64,
        fastest: &'a MaxSpeedProfile,
        ends: [PassEnd; 2],
    ) -> Self {
        let length = path.length_mm();
        let breaks = path.breaks();
        let places = [(0, 0.0), (breaks.len() - 2, length)];
        let end_jerks = places.map(|(span, arc)| END_JERK * path_jerk(path.at(span, arc).first, limits));
        // From a slow point a ramp leads to where the feed or the velocity of an axis ends it.
        let caps = fastest.speed_caps(feed_mm_s, limits);
        let slow_point = |arc: f64, speed: f64, jerk: f64| {
            let mut slow = SlowPoint {
                arc,
                speed,
                jerk,
                ramp_mm_s: 0.0,
            };
            slow.ramp_mm_s = slow.ramp_mm_s(&fastest.arcs, &caps);
            slow
        };
        let end_points = [0, 1].map(|end| slow_point(places[end].1, 0.0, end_jerks[end]));
        let end_ramps_mm_s = [0, 1].map(|end| end_points[end].ramp_mm_s);
        let mut slow_points: Vec<SlowPoint> = end_points
            .into_iter()
            .zip(ends)
            .filter_map(|(point, end)| (end == PassEnd::Rest).then_some(point))
            .collect();
        let mut steps = Vec::new();
        for (span, arc) in breaks.iter().enumerate().take(breaks.len() - 1).skip(1) {
            let (before, after) = (path.at(span - 1, *arc), path.at(span, *arc));
            let of = |a: DVec3, b: DVec3| (a - b).abs().to_array();
            let step = DerivativeStep {
                arc: *arc,
                steps: [of(before.first, after.first), of(before.second, after.second)],
            };
            let speed = step_speed(step.steps, limits, period_s, 1.0);
            let counts = (0..3).any(|axis| {
                let jerk = step.steps[0][axis] * feed_mm_s / period_s.powi(2)
                    + step.steps[1][axis] * feed_mm_s * feed_mm_s / period_s;
                jerk > STEP_JERK_SHARE_MIN * limits.jerk_mm_s3[axis]
            });
            if speed < feed_mm_s {
                let jerk = path_jerk(before.first, limits).min(path_jerk(after.first, limits));
                slow_points.push(slow_point(*arc, speed, jerk));
            }
            if counts {
                steps.push(step);
            }
        }
        Self {
            path,
            feed_mm_s,
            limits,
            period_s,
            fastest,
            ends,
            end_jerks,
            end_ramps_mm_s,
            speed_max_mm_s: fastest.squares.iter().copied().fold(0.0, f64::max).sqrt(),
            slow_points,
            steps,
        }
    }

    /// A speed close to the achievable one: the profile without jerk limits, cut by jerk ramps from the slow points.
    fn guess(&self, arc: f64) -> f64 {
        let arcs = &self.fastest.arcs;
        let after = arcs.partition_point(|at| *at <= arc).clamp(1, arcs.len() - 1);
        let share = (arc - arcs[after - 1]) / (arcs[after] - arcs[after - 1]);
        let squares = &self.fastest.squares;
        let square = squares[after - 1] + share * (squares[after] - squares[after - 1]);
        self.slow_points
            .iter()
            .fold(square.max(0.0).sqrt(), |speed, slow| {
                speed.min(slow.speed_at(arc))
            })
    }

    /// Duration of the motion before the first node, and after the last one: a ramp at the jerk limit; 0 where the end is free.
    fn end_time_s(&self, end: usize) -> f64 {
        if self.ends[end] == PassEnd::Free {
            return 0.0;
        }
        let jerk = self.end_jerks[end];
        // Limits the ramp to less than half of a short pass.
        let rise = (self.end_ramps_mm_s[end] / jerk).sqrt();
        let whole = (6.0 * self.path.length_mm() / jerk).cbrt();
        END_SHARE * rise.min(0.5 * whole)
    }

    fn end_arc(&self, end: usize) -> f64 {
        self.end_jerks[end] * self.end_time_s(end).powi(3) / 6.0
    }

    /// Squared speed and acceleration at the first node, and at the last, where the pass begins or ends at rest.
    fn ends(&self) -> [Option<[f64; 2]>; 2] {
        [0, 1].map(|end| {
            let (jerk, time) = (self.end_jerks[end], self.end_time_s(end));
            let acceleration = if end == 0 { jerk * time } else { -jerk * time };
            (time > 0.0).then_some([(0.5 * jerk * time * time).powi(2), acceleration])
        })
    }

    /// Length of the interval that begins at an arc length; `known`: a motion, whose speed changes little in the interval.
    fn interval_length(&self, arc: f64, known: Option<(&NodeGrid, &MotionProfile)>) -> f64 {
        let mut most = self.path.length_mm() / PASS_INTERVALS;
        let reach = |slow: &SlowPoint| {
            // Twice the distance in which a ramp at constant jerk reaches its speed: the extent of speed changes.
            let time = (2.0 * slow.ramp_mm_s / slow.jerk).sqrt();
            (slow.jerk * time.powi(3) / 3.0).min(self.path.length_mm())
        };
        for slow in &self.slow_points {
            let (way, reach) = ((arc - slow.arc).abs(), reach(slow));
            if way < 3.0 * reach {
                let least = (slow.speed * self.period_s).max(0.5 * self.end_arc(0).max(self.end_arc(1)));
                most = most.min((reach / RAMP).min((GROWTH * way).max(least)));
            }
        }
        for step in &self.steps {
            let near = 1.5 * self.period_s * self.guess(step.arc);
            most = most.min((0.5 * (arc - step.arc).abs()).max(near));
        }
        if let Some((grid, profile)) = known {
            let k = grid
                .arcs
                .partition_point(|at| *at <= arc)
                .clamp(1, grid.intervals.len())
                - 1;
            // dv/ds = a / v; with limits far above those that bind, accelerations of a solution alternate, and the speeds do not follow.
            let change = (k.saturating_sub(1)..=(k + 1).min(grid.intervals.len() - 1))
                .map(|near| {
                    let [before, after] = [near, near + 1].map(|node| profile.squares[node].sqrt());
                    (after - before).abs() / grid.intervals[near].length
                })
                .fold(0.0, f64::max);
            for node in [k, k + 1] {
                let of_node = profile.accelerations[node].abs() / profile.squares[node].sqrt();
                let slope = of_node.min(SLOPES * change);
                let largest = self.speed_max_mm_s;
                let floor = self.path.length_mm() * 1e-4;
                if slope > 0.0 {
                    most = most.min((CHANGE * largest / slope).max(floor.min(most)));
                }
            }
        }
        most
    }

    fn grid(&self, known: Option<(&NodeGrid, &MotionProfile)>) -> NodeGrid {
        let length = self.path.length_mm();
        let (from, to) = (self.end_arc(0), length - self.end_arc(1));
        let mut grid = NodeGrid {
            arcs: vec![from],
            intervals: Vec::new(),
            caps: Vec::new(),
        };
        for (span, ends) in self.path.breaks().windows(2).enumerate() {
            let (low, high) = (ends[0].max(from), ends[1].min(to));
            let mut arc = low;
            while arc < high {
                let by = self.interval_length(arc, known);
                // Not longer than the next one where they become shorter, and without a short remainder.
                let by = by.min(self.interval_length((arc + by).min(high), known).max(0.5 * by));
                let next = if arc + 1.3 * by >= high { high } else { arc + by };
                let points = [arc, 0.5 * (arc + next), next].map(|at| self.path.at(span, at));
                grid.intervals.push(Interval {
                    length: next - arc,
                    points,
                    steps: self.steps_near(arc, next),
                    limit_shares: [1.0; 2],
                });
                grid.arcs.push(next);
                arc = next;
            }
        }
        let cap = |first| self.limits.speed_cap(first, self.feed_mm_s).powi(2);
        grid.caps = vec![f64::INFINITY; grid.arcs.len()];
        for (k, interval) in grid.intervals.iter().enumerate() {
            grid.caps[k] = grid.caps[k].min(cap(interval.points[0].first));
            grid.caps[k + 1] = grid.caps[k + 1].min(cap(interval.points[2].first));
        }
        grid
    }

    /// The largest steps of the derivatives that one period can contain between two arc lengths.
    fn steps_near(&self, low: f64, high: f64) -> [[f64; 3]; 2] {
        let mut most = [[0.0_f64; 3]; 2];
        for step in &self.steps {
            let near = 1.5 * self.period_s * self.guess(step.arc) + 1e-12;
            if low <= step.arc + near && high >= step.arc - near {
                for (most, step) in most.iter_mut().flatten().zip(step.steps.iter().flatten()) {
                    *most = most.max(*step);
                }
            }
        }
        most
    }

    /// The fastest motion found.
    fn motion(&self) -> Result<FoundMotion, NoFeasibleMotion> {
        let coarse = self.grid(None);
        let floor = LEAST * self.speed_max_mm_s.powi(2);
        let guess: Vec<f64> = coarse
            .arcs
            .iter()
            .map(|arc| self.guess(*arc).powi(2).max(floor))
            .collect();
        let profile = self.improved(&coarse, guess)?;
        let mut grid = self.grid(Some((&coarse, &profile)));
        let mut guess: Vec<f64> = grid
            .arcs
            .iter()
            .map(|arc| interpolated(&coarse, &profile, *arc).max(floor))
            .collect();
        let mut best: Option<FoundMotion> = None;
        for _ in 0..ROUNDS {
            let profile = self.improved(&grid, guess)?;
            let timing = self.timing(&grid, &profile);
            let (uses, most) = timing.uses(self.path, self.limits, self.period_s);
            // Slowed down by one factor until the samples hold every limit.
            let slower = uses[0].max(uses[1].sqrt()).max(uses[2].cbrt()).max(1.0);
            let time = timing.duration_s() * slower;
            if best.as_ref().is_none_or(|best| time < best.time_s) {
                let powers = [slower, slower.powi(2), slower.powi(3)];
                best = Some(FoundMotion {
                    time_s: time,
                    uses: std::array::from_fn(|k| uses[k] / powers[k]),
                    timing,
                    slower,
                });
            }
            if slower <= 1.0 + ABOVE {
                break;
            }
            for (interval, most) in grid.intervals.iter_mut().zip(most) {
                for (limit_shares, most) in interval.limit_shares.iter_mut().zip(most) {
                    *limit_shares /= most.max(1.0);
                }
            }
            guess = profile.squares.iter().map(|square| square.max(floor)).collect();
        }
        best.ok_or(NoFeasibleMotion)
    }

    /// Limits squared speeds where a period contains steps of the derivatives: linearised at a speed at which the steps alone use 1.5 times the jerk limit,
    /// a programme has no solution.
    fn limit_near_steps(&self, grid: &NodeGrid, squares: &mut [f64], floor: f64) {
        for (k, interval) in grid.intervals.iter().enumerate() {
            let speed = step_speed(
                interval.steps,
                self.limits,
                self.period_s,
                interval.limit_shares[1],
            );
            for square in &mut squares[k..=k + 1] {
                *square = square.min(speed.powi(2).max(floor));
            }
        }
    }

    /// Solves programme after programme, each linearised at the previous motion.
    fn improved(&self, grid: &NodeGrid, mut around: Vec<f64>) -> Result<MotionProfile, NoFeasibleMotion> {
        let floor = LEAST * self.speed_max_mm_s.powi(2);
        self.limit_near_steps(grid, &mut around, floor);
        let mut best: Option<(f64, MotionProfile)> = None;
        for _ in 0..PROGRAMMES {
            let programme = Programme {
                intervals: &grid.intervals,
                limits: self.limits,
                caps: &grid.caps,
                period_s: self.period_s,
                ends: self.ends(),
            };
            let Some(profile) = programme.solve(&around) else {
                break;
            };
            around = profile.squares.iter().map(|square| square.max(floor)).collect();
            let time = self.timing(grid, &profile).duration_s();
            let gain = best
                .as_ref()
                .map_or(f64::INFINITY, |(least, _)| 1.0 - time / least);
            if gain > 0.0 {
                best = Some((time, profile));
            }
            if gain < GAIN_MIN {
                break;
            }
        }
        best.map(|(_, profile)| profile).ok_or(NoFeasibleMotion)
    }

    fn timing(&self, grid: &NodeGrid, profile: &MotionProfile) -> Timing {
        Timing::new(
            &grid.arcs,
            profile,
            [0, 1].map(|end| (self.end_jerks[end], self.end_time_s(end))),
            self.path.length_mm(),
        )
    }
}

/// Squared speed of a motion between its nodes.
fn interpolated(grid: &NodeGrid, profile: &MotionProfile, arc: f64) -> f64 {
    let k = grid
        .arcs
        .partition_point(|at| *at <= arc)
        .clamp(1, grid.intervals.len())
        - 1;
    let share = ((arc - grid.arcs[k]) / grid.intervals[k].length).clamp(0.0, 1.0);
    profile.squares[k] + share * (profile.squares[k + 1] - profile.squares[k])
}
