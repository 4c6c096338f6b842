//! `along = "auto"`: the direction of the passes with the least machining time.
//!
//! The core runs the whole job in both directions, on two threads, and counts the periods: the machine's exact time, identical
//! on every computer. The cost is one more run than the job itself, some tenths of a second per million samples.

use std::fmt;

use crate::Machine;
use crate::prepare::{Prepared, prepare};
use explain;
use job::{Along, AlongChoice, DirectionTrial, Job, JobError};

/// A job with a chosen direction, ready for the machine.
type Ready = (Job, Prepared);

/// Neither direction can be machined.
#[derive(Debug)]
pub enum DirectionError {
    /// Neither can be prepared or loaded: the error is in the job file.
    Refused(JobError),
    /// At least one starts; both fail.
    Faults(String),
}

impl fmt::Display for DirectionError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => error.fmt(out),
            Self::Faults(sentence) => out.write_str(sentence),
        }
    }
}

impl std::error::Error for DirectionError {}

/// Result of a trial of one direction.
struct TrialResult {
    trial: DirectionTrial,
    ready: Option<Ready>,
    /// The machine accepted the job.
    started: bool,
}

/// Chooses the direction of a job: as given in its file, or the faster of the two; u if both take the same time.
///
/// # Errors
/// The given direction cannot be prepared, or, with `"auto"`, neither direction can be machined.
pub fn choose(job: Job) -> Result<Ready, DirectionError> {
    if job.origin.along_choice() != &AlongChoice::Auto {
        let prepared = prepare(&job).map_err(DirectionError::Refused)?;
        return Ok((job, prepared));
    }
    let (first, second) = std::thread::scope(|scope| {
        let second = scope.spawn(|| run_trial(&job, Along::V));
        (run_trial(&job, Along::U), second.join())
    });
    let second = second.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let trials = [first.trial.clone(), second.trial.clone()];
    let started = first.started || second.started;
    // `None` where a direction cannot be machined; the first of equal times is the minimum.
    let best = [first, second]
        .into_iter()
        .filter(|tried| tried.trial.rejection.is_none())
        .min_by_key(|tried| tried.trial.ticks);
    match best.and_then(|tried| tried.ready) {
        Some((mut job, prepared)) => {
            job.origin.set_along_choice(AlongChoice::Chosen(trials));
            Ok((job, prepared))
        }
        None => Err(neither(&job, &trials, started)),
    }
}

fn neither(job: &Job, trials: &[DirectionTrial; 2], started: bool) -> DirectionError {
    let each = trials.iter().map(|trial| {
        let rejection = trial.rejection.as_deref().unwrap_or("");
        format!("along {}: {rejection}", trial.along.name())
    });
    let what = format!(
        "neither direction of the passes can be machined\n{}",
        each.collect::<Vec<_>>().join("\n")
    );
    let remedy = "remove the cause given for one of the directions";
    if started {
        DirectionError::Faults(format!("{what}\n  help: {remedy}"))
    } else {
        DirectionError::Refused(job.origin.error("cut.along", what, remedy))
    }
}

/// Runs the job in one direction to its end.
fn run_trial(job: &Job, along: Along) -> TrialResult {
    let mut job = job.clone();
    job.along = along;
    job.origin.set_along_choice(AlongChoice::Given);
    let trial = |ticks: u64, rejection: Option<String>| DirectionTrial {
        along,
        ticks,
        rejection,
    };
    let refused = |why: String| TrialResult {
        trial: trial(0, Some(why)),
        ready: None,
        started: false,
    };
    let prepared = match prepare(&job) {
        Ok(prepared) => prepared,
        Err(error) => return refused(error.what().to_owned()),
    };
    let mut machine = match Machine::load(&prepared) {
        Ok(machine) => machine,
        Err(fault) => return refused(explain::fault(fault).0),
    };
    let mut ticks = 0_u64;
    let ran = machine.run(|_| {
        ticks += 1;
        true
    });
    let rejection = ran.err().map(|fault| {
        let (pass, path, side) = machine.place();
        explain::fault_at(fault, ticks, pass, prepared.parameters(path, side))
    });
    TrialResult {
        trial: trial(ticks, rejection),
        ready: Some((job, prepared)),
        started: true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TORUS: &str = include_str!("../../../jobs/torus.toml");
    const CAP: &str = include_str!("../../../jobs/sphere_cap.toml");

    /// A sample job with these lines replaced.
    fn job(text: &str, edits: &[(&str, &str)]) -> Job {
        let mut text = text.to_owned();
        for (key, line) in edits {
            let place = text.find(&format!("\n{key} = ")).unwrap() + 1;
            let end = place + text[place..].find('\n').unwrap();
            text.replace_range(place..end, line);
        }
        job_file::parse("job.toml", &text).unwrap()
    }

    const AUTO: (&str, &str) = ("along", "along = \"auto\"");

    fn chosen(job: &Job) -> &[DirectionTrial; 2] {
        match job.origin.along_choice() {
            AlongChoice::Chosen(trials) => trials,
            other => panic!("{other:?}"),
        }
    }

    /// Periods of a job whose file gives its direction.
    fn ticks(job: &Job) -> u64 {
        let mut ticks = 0;
        Machine::load(&prepare(job).unwrap())
            .unwrap()
            .run(|_| {
                ticks += 1;
                true
            })
            .unwrap();
        ticks
    }

    #[test]
    fn the_faster_direction_wins_and_both_times_are_reported() {
        // The torus is faster along u, the cap along v.
        for (text, faster) in [(TORUS, Along::U), (CAP, Along::V)] {
            let (settled, prepared) = choose(job(text, &[AUTO])).unwrap();
            assert_eq!((settled.along, prepared.along), (faster, faster));
            let trials = chosen(&settled);
            for (trial, (along, line)) in trials
                .iter()
                .zip([(Along::U, "along = \"u\""), (Along::V, "along = \"v\"")])
            {
                assert_eq!((trial.along, &trial.rejection), (along, &None));
                assert_eq!(trial.ticks, ticks(&job(text, &[("along", line)])), "{line}");
            }
            let least = trials.iter().min_by_key(|trial| trial.ticks).unwrap();
            assert_eq!(least.along, faster);
            // A repeated choice has the same result.
            assert_eq!(choose(job(text, &[AUTO])).unwrap(), (settled.clone(), prepared));
        }
    }

    #[test]
    fn a_direction_that_faults_loses() {
        // At 500 m/min the passes around the pole turn too fast for one period; those through it run.
        let fast = ("feed_mm_min", "feed_mm_min = 500000");
        let (settled, _) = choose(job(CAP, &[AUTO, fast])).unwrap();
        assert_eq!(settled.along, Along::U);
        let [u, v] = chosen(&settled);
        assert_eq!(u.rejection, None);
        let rejection = v.rejection.as_deref().unwrap();
        assert!(
            rejection.starts_with("fault 3 (parameter-backwards) at tick "),
            "{rejection}"
        );
        // At the lower feed the other direction is the faster one: the fault decided.
        assert_eq!(choose(job(CAP, &[AUTO])).unwrap().0.along, Along::V);
    }

    #[test]
    fn both_faults_are_reported() {
        // The groove's radius is 8 mm.
        let large = ("radius_mm", "radius_mm = 9");
        let error = choose(job(TORUS, &[AUTO, large])).unwrap_err();
        let DirectionError::Faults(sentence) = &error else {
            panic!("{error}")
        };
        for direction in ["along u: fault 1 (ball-does-not-fit)", "along v: fault 1"] {
            assert!(sentence.contains(direction), "{sentence}");
        }
    }

    #[test]
    fn a_job_without_a_direction_is_not_prepared() {
        let error = prepare(&job(TORUS, &[AUTO])).unwrap_err();
        assert!(error.what().contains("not been chosen"), "{error}");
        assert!(error.line_and_column().is_some());
    }
}
