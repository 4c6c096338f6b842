//! How near a job's motion comes to the best that its limits allow: of the first, the middle and the last pass.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::out::say;
use crate::job_file::JobFile;
use crate::motion::{AxisLimits, Optimum, PassPath, optimum};
use crate::oracle::Oracle;
use crate::swept::Track;

/// One pass, judged.
pub(super) struct Judged {
    pass: usize,
    length_mm: f64,
    best: Optimum,
    /// What the job's own samples take, s; `None` where it sets no limits.
    ours_s: Option<f64>,
}

/// The limits that a job sets, where it sets all three.
pub(super) fn limits(job: &JobFile) -> Option<AxisLimits> {
    let machine = &job.machine;
    Some(AxisLimits {
        velocity: machine.velocity_max_mm_s?,
        acceleration: machine.acceleration_max_mm_s2?,
        jerk: machine.jerk_max_mm_s3?,
    })
}

/// Judges the first, the middle and the last pass by the job's limits, or by usual ones where it has none. `samples`: those on each pass.
/// Passes that the oracle cannot follow are left out.
pub(super) fn judged(
    job: &JobFile,
    oracle: &Oracle,
    track: &Track,
    samples: &BTreeMap<u32, u64>,
) -> Vec<Judged> {
    let own = limits(job);
    let limits = own.unwrap_or(AxisLimits::USUAL);
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
        Some(Judged {
            pass,
            length_mm: path.length_mm(),
            best,
            ours_s,
        })
    };
    chosen.into_iter().filter_map(of).collect()
}

/// Sums over the judged passes, and each of them; null where none was judged.
pub(super) fn json(judged: &[Judged]) -> Value {
    if judged.is_empty() {
        return Value::Null;
    }
    let sum = |of: &dyn Fn(&Judged) -> f64| judged.iter().map(of).sum::<f64>();
    let ours: Option<f64> = judged.iter().map(|judged| judged.ours_s).sum();
    let passes: Vec<Value> = judged
        .iter()
        .map(|judged| {
            json!({
                "pass": judged.pass, "length_mm": judged.length_mm, "optimum_s": judged.best.feasible_s,
                "bound_s": judged.best.lower_bound_s, "ours_s": judged.ours_s,
            })
        })
        .collect();
    json!({
        "optimum_s": sum(&|judged| judged.best.feasible_s), "bound_s": sum(&|judged| judged.best.lower_bound_s),
        "ours_s": ours, "passes": passes,
    })
}

/// The same for a person.
pub(super) fn print(judged: &[Judged]) {
    for Judged {
        pass,
        length_mm,
        best,
        ours_s,
    } in judged
    {
        let (bound, optimum) = (best.lower_bound_s, best.feasible_s);
        let ours = ours_s.map_or_else(String::new, |ours| {
            format!("; ours {ours:.4} s, {:+.2} %", 100.0 * (ours / optimum - 1.0))
        });
        say!(
            "       {:<22} {length_mm:.2} mm: at least {bound:.4} s, optimum {optimum:.4} s{ours}",
            format!("motion, pass {pass}")
        );
    }
}
