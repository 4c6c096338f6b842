//! The times of passes and of the whole job, against the fastest motion within the limits.
//!
//! ```text
//! every pass ──bound.rs──► time / lower bound, in descending order ──optimum.rs──► time / optimum, until no other pass can be worse
//! ```
//!
//! The lower bound is quick and the optimum slow; a pass's time over its optimum is at most its time over its bound, so the passes with the
//! largest quotients of the latter decide.

use rayon::prelude::*;

use super::bound::{PathBounds as _, lower_bound_s};
use super::optimum::{Optimum, optimum};
use super::path::PassPath;
use super::point::LineLimits;
use super::times::{JobTimes, LinkTime};
use glam::DVec3;
use job::{AxisLimits, Job};
use oracle::Oracle;

/// Optima computed besides those of the first, the middle and the last pass.
const OPTIMA_MAX: usize = 6;
/// Optima computed before it is asked again whether another pass can be worse.
const AT_ONCE: usize = 2;

/// A pass as it ran.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunPass {
    /// Pass, from 0.
    pub pass: usize,
    /// Side parameter.
    pub side: f64,
    /// Number of samples.
    pub samples: u64,
}

/// The time of a pass, and the least time within the limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// Pass, from 0.
    pub pass: usize,
    /// Length of the contact's path, mm.
    pub length_mm: f64,
    /// The fastest motion found offline, and the lower bound.
    pub best: Optimum,
    /// Time of the job's own samples, s; `None` where the job has no limits.
    pub ours_s: Option<f64>,
}

impl PassTime {
    /// The pass's time over that of the fastest motion found; `None` without limits.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        Some(self.ours_s? / self.best.feasible_s)
    }
}

/// The times of a job against the optimum.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OptimumTimes {
    /// The first, the middle and the last pass, and of the others those that could be slowest; in the order of passes.
    pub passes: Vec<PassTime>,
    /// Largest time of a pass over its optimum; `None` without limits, or where no pass was solved.
    pub ratio_max: Option<f64>,
    /// Upper bound of that quotient for the passes without an optimum: theirs over the lower bound.
    pub ratio_bound: f64,
    /// Time of the whole job over the sum of the optima, and where a pass has none, of the lower bounds: at most so much over the optimum.
    /// `None` without limits, and where a pass has neither.
    pub whole_ratio: Option<f64>,
}

/// A pass with its lower bound.
struct Bounded {
    run: RunPass,
    bound_s: f64,
    ours_s: f64,
}

/// Times of the passes by the job's limits, or by [`AxisLimits::DEFAULT`] where it has none: of these the first, the middle and the last
/// only. Passes for which the oracle has no result, and passes that are a point, are left out.
#[must_use]
pub fn optimum_times(job: &Job, oracle: &Oracle, passes: &[RunPass], times: &JobTimes) -> OptimumTimes {
    let limits = job.machine.limits.unwrap_or(AxisLimits::DEFAULT);
    let period_s = job.machine.period_s();
    let feed_mm_s = job.feed_mm_s();
    let has_limits = job.machine.has_limits();
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let ours_s = |run: &RunPass| run.samples.saturating_sub(1) as f64 * period_s;
    let solve = |run: &RunPass| {
        let path = PassPath::of_pass(oracle, run.side).ok()?;
        let best = optimum(&path, feed_mm_s, &limits, period_s).ok()?;
        (best.feasible_s > 0.0).then(|| PassTime {
            pass: run.pass,
            length_mm: path.length_mm(),
            best,
            ours_s: has_limits.then(|| ours_s(run)),
        })
    };
    let last = passes.len().saturating_sub(1);
    let mut chosen = vec![0, last / 2, last];
    chosen.dedup();
    let first: Vec<RunPass> = chosen
        .iter()
        .filter_map(|index| passes.get(*index).copied())
        .collect();
    let mut solved: Vec<PassTime> = first.par_iter().filter_map(solve).collect();
    if !has_limits {
        return OptimumTimes {
            passes: solved,
            ..OptimumTimes::default()
        };
    }
    let bounded: Vec<Option<Bounded>> = passes
        .par_iter()
        .map(|run| {
            let path = PassPath::of_pass(oracle, run.side).ok()?;
            let bound_s = lower_bound_s(&path, feed_mm_s, &limits);
            Some(Bounded {
                run: *run,
                bound_s,
                ours_s: ours_s(run),
            })
        })
        .collect();
    let mut open: Vec<&Bounded> = bounded
        .iter()
        .flatten()
        .filter(|pass| pass.bound_s > 0.0 && !chosen.contains(&pass.run.pass))
        .collect();
    open.sort_by(|a, b| (b.ours_s / b.bound_s).total_cmp(&(a.ours_s / a.bound_s)));
    let most = |solved: &[PassTime]| solved.iter().filter_map(PassTime::ratio).fold(0.0, f64::max);
    let bound_of = |open: &[&Bounded]| open.first().map_or(0.0, |pass| pass.ours_s / pass.bound_s);
    let mut left = &open[..];
    for _ in 0..OPTIMA_MAX / AT_ONCE {
        if bound_of(left) <= most(&solved) {
            break;
        }
        let (now, later) = left.split_at(AT_ONCE.min(left.len()));
        solved.par_extend(now.par_iter().filter_map(|pass| solve(&pass.run)));
        left = later;
    }
    solved.sort_by_key(|time| time.pass);
    OptimumTimes {
        ratio_max: (!solved.is_empty()).then(|| most(&solved)),
        ratio_bound: bound_of(left),
        whole_ratio: whole_ratio(job, &limits, &bounded, &solved, times),
        passes: solved,
    }
}

fn whole_ratio(
    job: &Job,
    limits: &AxisLimits,
    bounded: &[Option<Bounded>],
    solved: &[PassTime],
    times: &JobTimes,
) -> Option<f64> {
    let mut best_s = 0.0;
    for pass in bounded {
        let Bounded { run, bound_s, .. } = pass.as_ref()?;
        let optimum = solved.iter().find(|time| time.pass == run.pass);
        best_s += optimum.map_or(*bound_s, |time| time.best.feasible_s);
    }
    best_s += times
        .links
        .iter()
        .map(|link| link_s(job, limits, link))
        .sum::<f64>();
    (best_s > 0.0).then(|| times.whole_s / best_s)
}

/// Lower bound of the time of a link, s: of a turn that of its chord; else of its legs up, across and down, with the last part at the feed.
fn link_s(job: &Job, limits: &AxisLimits, link: &LinkTime) -> f64 {
    let [from, to] = link.ends_mm;
    let line = |from: DVec3, to: DVec3| -> Option<(LineLimits, f64)> {
        let length = from.distance(to);
        (length > 0.0).then(|| (along(limits, (to - from) / length), length))
    };
    let rest_to_rest =
        |from: DVec3, to: DVec3| line(from, to).map_or(0.0, |(limits, length)| limits.rest_to_rest_s(length));
    if link.turn {
        // Any motion from end to end, on whatever way.
        let length = from.distance(to);
        return if length > 0.0 {
            limits.along((to - from) / length).rest_to_rest_s(length)
        } else {
            0.0
        };
    }
    let [above_from, above_to] = [from, to].map(|end| end.with_z(link.top_mm));
    let down = line(above_to, to).map_or(0.0, |(limits, length)| {
        let slow_mm = job.machine.plunge_mm.min(length);
        let fast_s = limits.reach_s(length - slow_mm) + slow_mm / job.feed_mm_s().min(limits.velocity);
        limits.rest_to_rest_s(length).max(fast_s)
    });
    rest_to_rest(from, above_from) + rest_to_rest(above_from, above_to) + down
}

/// Limits of a motion along a unit direction.
fn along(limits: &AxisLimits, direction: DVec3) -> LineLimits {
    let least = |limit: &[f64; 3]| (DVec3::from(*limit) / direction.abs()).min_element();
    LineLimits {
        velocity: least(&limits.velocity_mm_s),
        acceleration: least(&limits.acceleration_mm_s2),
        jerk: least(&limits.jerk_mm_s3),
    }
}
