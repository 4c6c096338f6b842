//! Whether passes of constant scallop height take less time than straight ones, by trials of the whole job.

use job::{Along, AlongChoice, AxisLimits, Job, Spacing, SpacingTrial, Start};

use crate::direction::{fastest, run_trial};

/// Time that passes of constant scallop height have to save to be advised, as a share.
const SAVED_MIN: f64 = 0.02;
/// Longest trial, periods: more than an hour of machine time, some seconds here.
const TICKS_MAX: u64 = 4_000_000;

/// The rule for the distance between passes that takes the least time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SpacingAdvice {
    /// Straight passes at the exact step; passes of constant scallop height from the edge and from the middle. With `along = "auto"` each in its faster
    /// direction.
    pub trials: [SpacingTrial; 3],
    /// The rule to take: straight passes unless the others save more than 2 % of the time.
    pub spacing: Spacing,
}

impl SpacingAdvice {
    fn best_constant(&self) -> Option<&SpacingTrial> {
        let [_, constant @ ..] = &self.trials;
        let runs = constant.iter().filter(|trial| trial.rejection.is_none());
        runs.min_by_key(|trial| trial.ticks)
    }

    /// Time that the faster of both starts saves against straight passes, as a share, negative where it takes more; `None` where one of them cannot be
    /// machined.
    #[must_use]
    pub fn saved(&self) -> Option<f64> {
        let [exact, ..] = &self.trials;
        #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
        let saved = 1.0 - self.best_constant()?.ticks as f64 / exact.ticks.max(1) as f64;
        exact.rejection.is_none().then_some(saved)
    }

    /// Reason against passes of constant scallop height, if neither start can be machined, or against any trial.
    #[must_use]
    pub fn rejection(&self) -> Option<&str> {
        let [exact, edge, middle] = &self.trials;
        let reason = |trial: &'_ SpacingTrial| trial.rejection.is_some();
        if reason(exact) {
            return exact.rejection.as_deref();
        }
        if reason(edge) && reason(middle) {
            return edge.rejection.as_deref();
        }
        None
    }

    /// The advice in a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        let Some(saved) = self.saved() else {
            let why = self.rejection().unwrap_or("not tried").trim_end_matches('.');
            return format!("straight passes; with those of constant scallop height: {why}");
        };
        let percent = 100.0 * saved;
        match self.spacing.start() {
            Some(Start::Edge) => format!(
                "curves of constant scallop height from the edge, {percent:.1} % less time than straight passes"
            ),
            Some(Start::Middle) => {
                format!(
                    "curves of constant scallop height from the middle, {percent:.1} % less time than straight passes"
                )
            }
            None if percent < 0.0 => {
                format!(
                    "straight passes; those of constant scallop height take {:.1} % more time",
                    -percent
                )
            }
            None => format!(
                "straight passes; those of constant scallop height save {percent:.1} % of the time only"
            ),
        }
    }
}

/// Runs the whole job with straight passes and with those of constant scallop height. A job without axis limits is tried within the usual ones: what follows from
/// rests and links counts.
#[must_use]
pub fn advise_spacing(job: &Job) -> SpacingAdvice {
    let mut limited = job.clone();
    limited.machine.limits.get_or_insert(AxisLimits::DEFAULT);
    let advice = advise(&limited);
    if advice.saved().is_some() || job.machine.has_limits() {
        return advice;
    }
    advise(job)
}

fn advise(job: &Job) -> SpacingAdvice {
    let spacings = [
        Spacing::Exact,
        Spacing::Constant(Start::Edge),
        Spacing::Constant(Start::Middle),
    ];
    let trial = |spacing: Spacing| {
        let along = |along: Along| run_trial(job, along, spacing, TICKS_MAX);
        match job.origin.along_choice() {
            AlongChoice::Auto => fastest(along(Along::U), along(Along::V)).trial,
            _ => along(job.along).trial,
        }
    };
    let trial = &trial;
    let trials = std::thread::scope(|scope| {
        let threads = spacings.map(|spacing| scope.spawn(move || trial(spacing)));
        threads.map(|thread| {
            thread
                .join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    });
    let mut advice = SpacingAdvice {
        trials,
        spacing: Spacing::Exact,
    };
    if advice.saved().is_some_and(|saved| saved > SAVED_MIN)
        && let Some(best) = advice.best_constant()
    {
        advice.spacing = best.spacing;
    }
    advice
}

#[cfg(test)]
mod tests {
    use super::*;

    fn advice(text: &str) -> SpacingAdvice {
        let mut job = job_file::parse("job.toml", text).unwrap();
        // Coarse, so that the test is short.
        job.scallop_mm *= 10.0;
        advise_spacing(&job)
    }

    #[test]
    fn curves_are_advised_where_they_save_time() {
        let found = advice(include_str!("../../../jobs/sphere_cap.toml"));
        assert!(
            found.spacing.is_constant() && found.saved().unwrap() > 0.02,
            "{}",
            found.sentence()
        );
        // Along the groove's arcs all passes are of one curvature: nothing to save.
        let found = advice(include_str!("../../../jobs/torus.toml"));
        assert_eq!(found.spacing, Spacing::Exact, "{}", found.sentence());
    }

    #[test]
    fn what_is_refused_is_told() {
        // A roof: its ridge lies across the passes.
        let found = advice(
            "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 0.5, 1, 1]\nknots_v = [0, 0, 1, 1]\n\
             poles_mm = [[[0, 0, 0], [0, 9, 0]], [[5, 0, 1], [5, 9, 1]], [[10, 0, 0], [10, 9, 0]]]\n\
             [tool]\nkind = \"ball\"\nradius_mm = 5\n[cut]\nfeed_mm_min = 1200\nscallop_mm = 0.005\nalong = \"u\"\nside = \"up\"\n",
        );
        assert_eq!((found.spacing, found.saved()), (Spacing::Exact, None));
        assert!(found.sentence().contains("jumps"), "{}", found.sentence());
    }
}
