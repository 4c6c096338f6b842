//! The times of passes and of the whole job, against the fastest motion within the limits.
//!
//! ```text
//! every pass ──bound.rs──► time / lower bound, in descending order ──optimum.rs──► time / optimum, until no other pass can be worse
//! ```
//!
//! The lower bound is quick and the optimum slow; a pass's time over its optimum is at most its time over its bound, so the passes with the
//! largest quotients of the latter decide.
//!
//! A pass is compared from its first sample to its last. Where a turn beyond the boundary leads to it or away from it, that end is free: the
//! optimum passes it at any speed, so it is not slower than any motion through the turn, and the quotient includes what the turn costs the pass.

use rayon::prelude::*;

use super::bound::{PathBounds as _, lower_bound_s};
use super::optimum::{Optimum, PassEnd, optimum_profile};
use super::path::PassPath;
use super::profile::{EmittedSpeed, SpeedPoint, emitted_speeds};
use super::times::{JobTimes, LinkTime};
use crate::swept::ToolPathPass;
use glam::DVec3;
use job::{AxisLimits, Job};
use oracle::Oracle;

/// Optima computed besides those of the first, the middle and the last pass.
const OPTIMA_MAX: usize = 6;
/// Optima computed before it is asked again whether another pass can be worse.
const AT_ONCE: usize = 2;

/// A pass as it ran.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunPass<'a> {
    /// Pass, from 0.
    pub pass: usize,
    /// Its samples, without those near the one before.
    pub track: &'a ToolPathPass,
    /// Ticks and path parameters of these.
    pub slow: &'a [(u64, f64)],
    /// Number of samples.
    pub samples: u64,
    /// Path parameters of the first and the last sample.
    pub path: [f64; 2],
    /// How it begins and ends.
    pub ends: [PassEnd; 2],
}

impl RunPass<'_> {
    /// Whether it runs against its path parameter.
    fn is_reversed(&self) -> bool {
        self.path[0] > self.path[1]
    }

    /// The ends in the order of the path parameter.
    fn path_ends(&self) -> [PassEnd; 2] {
        let [first, last] = self.ends;
        if self.is_reversed() {
            [last, first]
        } else {
            self.ends
        }
    }
}

/// The time of a pass, and the least time within the limits.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTime {
    /// Pass, from 0.
    pub pass: usize,
    /// Length of the contact's path, mm.
    pub length_mm: f64,
    /// The fastest motion found offline, and the lower bound.
    pub best: Optimum,
    /// Time of the job's own samples, s; `None` where the job has no limits.
    pub ours_s: Option<f64>,
    /// How it begins and ends.
    pub ends: [PassEnd; 2],
    /// The fastest motion found, period by period.
    pub profile: Vec<SpeedPoint>,
    /// The job's own motion, from sample to sample.
    pub emitted: Vec<EmittedSpeed>,
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
    /// Time of the whole job over the sum of the optima, with the lower bound for a pass without an optimum: an upper bound of the true quotient.
    /// `None` without limits, and where a pass has neither.
    pub whole_ratio: Option<f64>,
    /// Ends of passes that are free, because the tool turns beyond the boundary there.
    pub free_ends: usize,
}

/// A pass with its lower bound.
struct Bounded<'a> {
    run: RunPass<'a>,
    bound_s: f64,
    ours_s: f64,
}

/// Times of the passes by the job's limits, or by [`AxisLimits::DEFAULT`] where it has none: of these the first, the middle and the last
/// only. Passes for which the oracle has no result, and passes that are a point, are left out.
#[must_use]
pub fn optimum_times(job: &Job, oracle: &Oracle, passes: &[RunPass<'_>], times: &JobTimes) -> OptimumTimes {
    let limits = job.machine.limits.unwrap_or(AxisLimits::DEFAULT);
    let period_s = job.machine.period_s();
    let feed_mm_s = job.feed_mm_s();
    let has_limits = job.machine.has_limits();
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let ours_s = |run: &RunPass<'_>| run.samples.saturating_sub(1) as f64 * period_s;
    let solve = |run: &RunPass<'_>| {
        let path = PassPath::between(oracle, run.track.side, run.path).ok()?;
        let (best, mut profile) =
            optimum_profile(&path, feed_mm_s, &limits, period_s, run.path_ends()).ok()?;
        if run.is_reversed() {
            SpeedPoint::reverse(&mut profile, path.length_mm());
        }
        (best.feasible_s > 0.0).then(|| PassTime {
            pass: run.pass,
            length_mm: path.length_mm(),
            best,
            ours_s: has_limits.then(|| ours_s(run)),
            ends: run.ends,
            profile,
            emitted: emitted_speeds(&path, run.track, run.slow, run.path, period_s),
        })
    };
    let last = passes.len().saturating_sub(1);
    let mut chosen = vec![0, last / 2, last];
    chosen.dedup();
    let first: Vec<RunPass<'_>> = chosen
        .iter()
        .filter_map(|index| passes.get(*index).copied())
        .collect();
    let mut solved: Vec<PassTime> = first.par_iter().filter_map(solve).collect();
    if !has_limits {
        return OptimumTimes {
            passes: solved,
            free_ends: free_ends(passes),
            ..OptimumTimes::default()
        };
    }
    let bounded: Vec<Option<Bounded<'_>>> = passes
        .par_iter()
        .map(|run| {
            let path = PassPath::between(oracle, run.track.side, run.path).ok()?;
            let bound_s = lower_bound_s(&path, feed_mm_s, &limits, run.path_ends());
            Some(Bounded {
                run: *run,
                bound_s,
                ours_s: ours_s(run),
            })
        })
        .collect();
    let mut open: Vec<&Bounded<'_>> = bounded
        .iter()
        .flatten()
        .filter(|pass| pass.bound_s > 0.0 && !chosen.contains(&pass.run.pass))
        .collect();
    open.sort_by(|a, b| (b.ours_s / b.bound_s).total_cmp(&(a.ours_s / a.bound_s)));
    let most = |solved: &[PassTime]| solved.iter().filter_map(PassTime::ratio).fold(0.0, f64::max);
    let bound_of = |open: &[&Bounded<'_>]| open.first().map_or(0.0, |pass| pass.ours_s / pass.bound_s);
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
        free_ends: free_ends(passes),
        passes: solved,
    }
}

fn free_ends(passes: &[RunPass<'_>]) -> usize {
    let ends = passes.iter().flat_map(|run| run.ends);
    ends.filter(|end| *end == PassEnd::Free).count()
}

fn whole_ratio(
    job: &Job,
    limits: &AxisLimits,
    bounded: &[Option<Bounded<'_>>],
    solved: &[PassTime],
    times: &JobTimes,
) -> Option<f64> {
    let mut best_s = 0.0;
    for pass in bounded {
        let Bounded { run, bound_s, .. } = pass.as_ref()?;
        let optimum = solved.iter().find(|time| time.pass == run.pass);
        best_s += optimum.map_or(*bound_s, |time| time.best.feasible_s);
    }
    let leaves = |link: &LinkTime| {
        let mut runs = bounded.iter().flatten().map(|pass| &pass.run);
        runs.any(|run| u32::try_from(run.pass) == Ok(link.pass) && run.ends[1] == PassEnd::Free)
    };
    best_s += times
        .links
        .iter()
        .map(|link| link_s(job, limits, link, link.turn && leaves(link)))
        .sum::<f64>();
    (best_s > 0.0).then(|| times.whole_s / best_s)
}

/// Lower bound of the time of a link, s: of a turn that of its chord, `moving` without rests at its ends; else of any motion from rest to rest
/// through its highest point, the axes by themselves, with the last part of the way down at the feed.
fn link_s(job: &Job, limits: &AxisLimits, link: &LinkTime, moving: bool) -> f64 {
    let [from, to] = link.ends_mm;
    if link.turn {
        // Any motion from end to end, on whatever way.
        let length = from.distance(to);
        return if length > 0.0 {
            let along = limits.along((to - from) / length);
            if moving {
                length / along.velocity
            } else {
                along.rest_to_rest_s(length)
            }
        } else {
            0.0
        };
    }
    let across = (to - from).with_z(0.0);
    let across_s = if across.length() > 0.0 {
        limits.along(across.normalize()).rest_to_rest_s(across.length())
    } else {
        0.0
    };
    let z = limits.along(DVec3::Z);
    let (up_mm, down_mm) = ((link.top_mm - from.z).max(0.0), (link.top_mm - to.z).max(0.0));
    let slow_mm = job.machine.plunge_mm.min(down_mm);
    let plunge_s = z.reach_s(down_mm - slow_mm) + slow_mm / job.feed_mm_s().min(z.velocity);
    let height_s = z.rest_to_rest_s(up_mm) + z.rest_to_rest_s(down_mm).max(plunge_s);
    across_s.max(height_s)
}
