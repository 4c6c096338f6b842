//! `along = "auto"` and `start = "auto"`: the direction of the passes, and the start of those of constant scallop height, with the least machining time.
//!
//! The core runs the whole job with each of them, on threads, and counts the periods: the machine's exact time, identical
//! on every computer. The cost of a trial is a run of the job, some tenths of a second per million samples.

use std::fmt;

use crate::Machine;
use crate::cells;
use crate::prepare::{Prepared, prepare};
use explain;
use job::{Along, AlongChoice, DirectionTrial, Job, JobError, Spacing, SpacingTrial, Start, StartChoice};

/// A job with a chosen direction, ready for the machine.
type Ready = (Job, Prepared);

/// Neither direction can be machined.
#[derive(Debug)]
pub enum DirectionError {
    /// Neither direction can be prepared or loaded: the error is in the job file.
    Refused(JobError),
    /// The run starts in at least one direction, and ends in a fault in both.
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

/// Result of a trial.
pub(crate) struct TrialResult {
    along: Along,
    pub(crate) trial: SpacingTrial,
    ready: Option<Ready>,
    /// The machine accepted the job.
    started: bool,
}

impl TrialResult {
    fn direction(&self) -> DirectionTrial {
        DirectionTrial {
            along: self.along,
            ticks: self.trial.ticks,
            rejection: self.trial.rejection.clone(),
        }
    }
}

/// The trial with less time; the first one if both take the same time, or neither can be machined.
pub(crate) fn fastest(first: TrialResult, second: TrialResult) -> TrialResult {
    let is_refused = |tried: &TrialResult| tried.trial.rejection.is_some();
    let is_faster = second.trial.ticks < first.trial.ticks || is_refused(&first);
    if is_faster && !is_refused(&second) {
        second
    } else {
        first
    }
}

/// Chooses direction and start of a job: as given in its file, or the faster of the two; u, and the edge, if both take the same time.
///
/// # Errors
/// The job as given cannot be prepared, or, with `"auto"`, no choice can be machined.
pub fn choose(mut job: Job) -> Result<Ready, DirectionError> {
    if !job.origin.has_to_choose() {
        cells::choose(&mut job);
        let prepared = prepare(&job).map_err(DirectionError::Refused)?;
        return Ok((job, prepared));
    }
    if job.origin.along_choice() != &AlongChoice::Auto {
        let (tried, trials) = run_starts(&job, job.along);
        let started = tried.started;
        return tried.ready.ok_or_else(|| neither_start(&job, &trials, started));
    }
    let (u, v) = std::thread::scope(|scope| {
        let v = scope.spawn(|| run_direction(&job, Along::V));
        (run_direction(&job, Along::U), v.join())
    });
    let v = v.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let trials = [u.direction(), v.direction()];
    let started = u.started || v.started;
    match fastest(u, v).ready {
        Some((mut job, prepared)) => {
            job.origin.set_along_choice(AlongChoice::Chosen(trials));
            Ok((job, prepared))
        }
        None => Err(neither(&job, &trials, started)),
    }
}

/// Runs the job in one direction, from the faster start if that is to be chosen.
fn run_direction(job: &Job, along: Along) -> TrialResult {
    if job.origin.start_choice() == &StartChoice::Auto {
        run_starts(job, along).0
    } else {
        run_trial(job, along, job.spacing, u64::MAX)
    }
}

/// Runs the job in one direction from the edge and from the middle: the faster, and both trials.
fn run_starts(job: &Job, along: Along) -> (TrialResult, [SpacingTrial; 2]) {
    let [edge, middle] = [Start::Edge, Start::Middle].map(Spacing::Constant);
    let (edge, middle) = std::thread::scope(|scope| {
        let middle = scope.spawn(|| run_trial(job, along, middle, u64::MAX));
        (run_trial(job, along, edge, u64::MAX), middle.join())
    });
    let middle = middle.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    let trials = [edge.trial.clone(), middle.trial.clone()];
    let started = edge.started || middle.started;
    let mut best = fastest(edge, middle);
    best.started = started;
    if let Some((job, _)) = &mut best.ready {
        job.origin.set_start_choice(StartChoice::Chosen(trials.clone()));
    }
    (best, trials)
}

fn neither_start(job: &Job, trials: &[SpacingTrial; 2], started: bool) -> DirectionError {
    let reason = |trial: &SpacingTrial| trial.rejection.clone().unwrap_or_default();
    let [edge, middle] = trials;
    let what = format!(
        "passes of constant scallop height can start neither on the edge nor in the middle\nfrom the edge: {}\nfrom the middle: {}",
        reason(edge),
        reason(middle)
    );
    let remedy = "remove the cause given for one of the starts, or write spacing = \"exact\"";
    refusal(job, "cut.start", what, remedy, started)
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
    refusal(
        job,
        "cut.along",
        what,
        "remove the cause given for one of the directions",
        started,
    )
}

fn refusal(job: &Job, key: &str, what: String, remedy: &str, started: bool) -> DirectionError {
    if started {
        DirectionError::Faults(format!("{what}\n  help: {remedy}"))
    } else {
        DirectionError::Refused(job.origin.error(key, what, remedy))
    }
}

/// Runs the job in one direction, with this spacing of the passes, to its end or for at most `ticks_max` periods.
pub(crate) fn run_trial(job: &Job, along: Along, spacing: Spacing, ticks_max: u64) -> TrialResult {
    let mut job = job.clone();
    (job.along, job.spacing) = (along, spacing);
    job.origin.set_along_choice(AlongChoice::Given);
    job.origin.set_start_choice(StartChoice::Given);
    cells::choose(&mut job);
    let trial = |ticks: u64, rejection: Option<String>| SpacingTrial {
        spacing,
        ticks,
        rejection,
    };
    let refused = |why: String| TrialResult {
        along,
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
        ticks <= ticks_max
    });
    let rejection = match ran {
        Err(fault) => {
            let (pass, path, side) = machine.place();
            Some(explain::fault_at(
                fault,
                ticks,
                pass,
                prepared.parameters(path, side),
            ))
        }
        Ok(()) if ticks > ticks_max => Some(format!("it takes more than {ticks_max} periods")),
        Ok(()) => None,
    };
    let ready = rejection.is_none().then_some((job, prepared));
    TrialResult {
        along,
        trial: trial(ticks, rejection),
        ready,
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
