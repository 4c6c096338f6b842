//! The times of passes, compared with the fastest motion within the limits.

use std::collections::BTreeMap;

use job::{AxisLimits, Job};
use oracle::Oracle;
use verify::motion::{Optimum, PassPath, optimum};
use verify::swept::ToolPath;

/// The time of a pass, and the least time within the limits.
#[derive(Debug)]
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

/// Times of the first, the middle and the last pass, by the job's limits, or by [`AxisLimits::DEFAULT`] where it has none. `samples`:
/// number of samples per pass. Passes for which the oracle has no result are left out.
#[must_use]
pub fn pass_times(
    job: &Job,
    oracle: &Oracle,
    track: &ToolPath,
    samples: &BTreeMap<u32, u64>,
) -> Vec<PassTime> {
    let own = job.machine.limits;
    let limits = own.unwrap_or(AxisLimits::DEFAULT);
    let period_s = job.machine.period_s();
    let last = track.passes.len().saturating_sub(1);
    let mut chosen = vec![0, last / 2, last];
    chosen.dedup();
    let of = |pass: usize| {
        let path = PassPath::of_pass(oracle, track.passes.get(pass)?.side).ok()?;
        let best = optimum(&path, job.feed_mm_s(), &limits, period_s).ok()?;
        let count = *samples.get(&u32::try_from(pass).ok()?)?;
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let ours_s = own.map(|_| count.saturating_sub(1) as f64 * period_s);
        Some(PassTime {
            pass,
            length_mm: path.length_mm(),
            best,
            ours_s,
        })
    };
    chosen.into_iter().filter_map(of).collect()
}
