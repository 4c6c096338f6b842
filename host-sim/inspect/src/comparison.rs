//! The run of a board against the run of the core on this computer.
//!
//! ```text
//! TimedRun ──┬─ by_digest ──► digest of each pass; in QEMU, the samples of the first pass that differs ──┬──► BoardRun ──failure──► verdict
//! board ─────┴─ by_sample ──► every sample, bit by bit ──────────────────────────────────────────────────┘
//! ```

use std::time::Instant;

use interp_core::{Fault, FaultKind, Sample, State};
use job::{Job, JobError};
use machine::prepare::Prepared;
use machine::remote::operate::Operator;
use machine::remote::session::LineLosses;
use machine::remote::{RemoteError, Session, drive};
use protocol::digest::Digest;
use protocol::message::Status;

use crate::TimedRun;
use crate::run::machine;

/// The run of the core that a board's run is compared with.
#[derive(Clone, Copy, Debug)]
pub struct Reference<'a> {
    /// The job.
    pub job: &'a Job,
    /// The job, prepared.
    pub prepared: &'a Prepared,
    /// The run of the core.
    pub run: &'a TimedRun,
}

/// The run of a board, compared with the core's.
#[derive(Clone, Debug)]
pub struct BoardRun {
    /// Last status of the run.
    pub status: Status,
    /// Number of samples compared, by digest or bit by bit.
    pub compared: u64,
    /// Samples that were wanted one by one and did not come. If the run has no other difference, its digest proves that they are the core's.
    pub missing: u64,
    /// What the line lost of the board's events.
    pub losses: LineLosses,
    /// Tick of the first sample that differs, or of the first pass that does where only digests are known; `None` if all are
    /// identical.
    pub first_difference: Option<u64>,
    /// Whether the run had operator commands or an override. Its samples then differ from the core's by intent.
    pub commanded: bool,
    /// Ticks per second of wall time.
    pub ticks_per_second: f64,
}

/// Failure of a comparison.
#[derive(Debug, thiserror::Error)]
pub enum ComparisonError {
    /// The connection to the board failed, or the board refused a request.
    #[error(transparent)]
    Remote(#[from] RemoteError),
    /// The core refused the job.
    #[error(transparent)]
    Refused(#[from] JobError),
}

#[allow(clippy::cast_precision_loss, reason = "below 2^53")]
fn rate(ticks: u64, start: Instant) -> f64 {
    ticks as f64 / start.elapsed().as_secs_f64().max(1e-9)
}

/// Runs the loaded job on a board and compares the digest of each pass. With `lockstep` (a board without a machine, such as QEMU),
/// the first pass that differs is run again to find its first differing sample. `progress` receives the number of samples so far.
///
/// # Errors
/// [`ComparisonError`].
pub fn by_digest(
    reference: &Reference<'_>,
    session: &mut Session,
    lockstep: bool,
    operator: Option<&mut dyn Operator>,
    progress: impl FnMut(u64),
) -> Result<BoardRun, ComparisonError> {
    let here = reference.run;
    let expected: Vec<_> = here
        .passes
        .iter()
        .map(|pass| drive::Expected {
            first_tick: pass.first_tick,
            samples: pass.samples,
            digest: pass.digest,
        })
        .collect();
    let start = Instant::now();
    let compared = drive::run_digests(session, &expected, lockstep, operator, progress)?;
    let ticks_per_second = rate(compared.samples, start);
    let mut first_difference = None;
    if let Some(index) = compared.first_bad_index {
        let from = expected.get(index as usize).map_or_else(
            || expected.last().map_or(0, |last| last.first_tick + last.samples),
            |pass| pass.first_tick,
        );
        first_difference = Some(from.into());
        if lockstep {
            let count = expected.get(index as usize).map_or(0, |pass| pass.samples) + 1;
            let there = drive::samples_between(session, from, count)?;
            let there = &there[..there.len().min(count as usize)];
            let ours = samples_of(reference, from, count)?;
            first_difference = drive::first_difference(&ours, there)
                .map(u64::from)
                .or(first_difference);
        }
    } else if !compared.commanded && compared.status.digest != here.digest {
        first_difference = Some(here.samples);
    }
    Ok(BoardRun {
        status: compared.status,
        compared: compared.samples,
        missing: 0,
        losses: compared.losses,
        first_difference,
        commanded: compared.commanded,
        ticks_per_second,
    })
}

/// Runs the loaded job on a board and compares every sample bit by bit. `progress` receives the number of samples so far, and `each`, at the end, the samples
/// of the board. In the place of those that the line lost it gets the core's, if the board's digest proves that they are the same; otherwise none at all
/// ([`BoardRun::is_complete`]).
///
/// # Errors
/// [`ComparisonError`].
pub fn by_sample(
    reference: &Reference<'_>,
    session: &mut Session,
    lockstep: bool,
    operator: Option<&mut dyn Operator>,
    mut progress: impl FnMut(u64),
    each: impl FnMut(&Sample),
) -> Result<BoardRun, ComparisonError> {
    let ours = samples_of(reference, 0, u32::MAX)?;
    let mut theirs = Vec::with_capacity(ours.len());
    let start = Instant::now();
    let (status, commanded) = drive::run_samples(session, lockstep, operator, |sample| {
        theirs.push(*sample);
        progress(theirs.len() as u64);
    })?;
    let ticks_per_second = rate(theirs.len() as u64, start);
    let missing = u64::from(status.samples).saturating_sub(theirs.len() as u64);
    let compared = theirs.len().min(ours.len()) as u64;
    let in_place = |(ours, theirs): &(&Sample, &Sample)| ours.tick == theirs.tick;
    let first_missing = ours.iter().zip(&theirs).take_while(in_place).count() as u64;
    let (rows, difference) = if commanded || missing == 0 {
        let difference = drive::first_difference(&ours, &theirs).filter(|_| !commanded);
        (theirs, difference)
    } else {
        completed(&ours, &theirs)
    };
    let mut digest = Digest::new();
    rows.iter().for_each(|sample| digest.sample(sample));
    let is_proven = status.digest == digest.value();
    // Missing samples of a commanded run cannot be taken from the simulation.
    let unproven = (!is_proven && (!commanded || missing == 0)).then_some(first_missing);
    let run = BoardRun {
        status,
        compared,
        missing,
        losses: session.losses(),
        first_difference: difference.map(u64::from).or(unproven),
        commanded,
        ticks_per_second,
    };
    if run.is_complete() {
        rows.iter().for_each(each);
    }
    Ok(run)
}

/// The board's samples with the core's where they are missing, and the tick of the first that came and differs. Both are in the order of their ticks.
fn completed(ours: &[Sample], theirs: &[Sample]) -> (Vec<Sample>, Option<u32>) {
    let mut rows = Vec::with_capacity(ours.len());
    let mut came = theirs.iter().peekable();
    let mut first_difference = None;
    for our in ours {
        match came.next_if(|sample| sample.tick <= our.tick) {
            Some(sample) => {
                let difference = drive::first_difference(&[*our], &[*sample]);
                first_difference = first_difference.or(difference);
                rows.push(*sample);
            }
            None => rows.push(*our),
        }
    }
    let surplus = came.peek().map(|sample| sample.tick);
    rows.extend(came.copied());
    (rows, first_difference.or(surplus))
}

/// The samples of the core from tick `from` on, at most `count`. A fault ends them, which is part of the comparison.
fn samples_of(reference: &Reference<'_>, from: u32, count: u32) -> Result<Vec<Sample>, JobError> {
    let mut samples = Vec::new();
    let _fault = machine(reference.job, reference.prepared)?.run(|sample| {
        if sample.tick >= from {
            samples.push(*sample);
        }
        samples.len() < count as usize
    });
    Ok(samples)
}

/// A sentence about the safety input that stopped the run or kept it from starting.
fn stopped_by_input(status: &Status) -> Option<String> {
    let fault = status.fault?;
    let kind = fault.kind()?;
    if !matches!(
        kind,
        FaultKind::EmergencyStop | FaultKind::LimitSwitch | FaultKind::DriveFault | FaultKind::SpindleSpeed
    ) {
        return None;
    }
    let (what, remedy) = explain::fault(Fault::new(kind, fault.value));
    let Status { tick, pass, .. } = status;
    Some(format!(
        "the board stopped the run at tick {tick}, pass {pass}: {what}\n  help: {remedy}"
    ))
}

impl BoardRun {
    /// Whether every sample that was wanted one by one is known: it came, or the digest proves that it is the core's.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        self.missing == 0 || (!self.commanded && self.first_difference.is_none())
    }

    /// The failure of the run as a sentence, the most severe first; `None` if the board ran as the core did, or as commanded.
    #[must_use]
    pub fn failure(&self, here: &TimedRun, job: &Job) -> Option<String> {
        let status = &self.status;
        if let Some(stopped) = stopped_by_input(status) {
            return Some(stopped);
        }
        if status.deadline_misses > 0 {
            return Some(format!(
                "{} ticks of the sample timer were missed",
                status.deadline_misses
            ));
        }
        if let Some(tick) = self.first_difference {
            return Some(format!(
                "the board differs from the simulation, first at tick {tick}"
            ));
        }
        if !self.is_complete() {
            let missing = self.missing;
            return Some(format!("{missing} samples of the board were lost on the line"));
        }
        if self.commanded {
            let ends = matches!(status.state, State::Finished | State::Ready);
            return (!ends).then(|| format!("the board ended {}", status.state.name()));
        }
        let expected = if here.fault.is_some() {
            State::Faulted
        } else {
            State::Finished
        };
        let code = status.fault.map(|fault| fault.code);
        if status.state != expected || code != here.fault.map(|at| at.fault.kind.code()) {
            return Some(format!(
                "the board ended {}, the simulation {}",
                status.state.name(),
                expected.name()
            ));
        }
        here.fault.as_ref().map(|fault| fault.sentence_of(job))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The verdict on a board's run with this status; the core finished without a fault.
    fn verdict(status: Status, first_difference: Option<u64>, commanded: bool) -> Option<String> {
        verdict_without(0, status, first_difference, commanded)
    }

    /// The verdict on a board's run of which `missing` samples did not arrive.
    fn verdict_without(
        missing: u64,
        status: Status,
        first_difference: Option<u64>,
        commanded: bool,
    ) -> Option<String> {
        let job = job_file::parse("torus.toml", include_str!("../../../jobs/torus.toml")).unwrap();
        let here = TimedRun {
            digest: 0,
            samples: 0,
            samples_per_second: 0.0,
            passes: Vec::new(),
            fault: None,
        };
        let run = BoardRun {
            status,
            compared: 0,
            missing,
            losses: LineLosses::default(),
            first_difference,
            commanded,
            ticks_per_second: 0.0,
        };
        run.failure(&here, &job)
    }

    fn ended(state: State) -> Status {
        Status {
            state,
            ..Status::default()
        }
    }

    #[test]
    fn the_most_severe_failure_is_reported() {
        let finished = ended(State::Finished);
        assert_eq!(verdict(finished, None, false), None);
        let missed = Status {
            deadline_misses: 2,
            samples_lost: 3,
            ..finished
        };
        let lost = Status {
            samples_lost: 3,
            ..finished
        };
        for (status, difference, text) in [
            (missed, Some(7), "2 ticks of the sample timer were missed"),
            (lost, Some(7), "first at tick 7"),
            (
                ended(State::Held),
                None,
                "the board ended held, the simulation finished",
            ),
        ] {
            let failure = verdict(status, difference, false).unwrap();
            assert!(failure.contains(text), "{text}: {failure}");
        }
    }

    /// The digest covers the whole run, so it proves what did not come; a run with commands has no digest to compare with.
    #[test]
    fn what_was_lost_on_the_line_matters_where_nothing_proves_it() {
        let lost = Status {
            samples_lost: 3,
            ..ended(State::Finished)
        };
        assert_eq!(verdict(lost, None, false), None);
        assert_eq!(verdict_without(5, lost, None, false), None);
        let failure = verdict_without(5, lost, None, true).unwrap();
        assert_eq!(failure, "5 samples of the board were lost on the line");
        assert!(
            verdict_without(5, lost, Some(7), false)
                .unwrap()
                .contains("first at tick 7")
        );
    }

    /// A sample of this tick and feed.
    fn sample(tick: u32, feed_mm_s: f32) -> Sample {
        Sample {
            tick,
            feed_mm_s,
            ..Sample::default()
        }
    }

    #[test]
    fn missing_samples_are_completed_in_their_places() {
        let ours: Vec<_> = (0..6).map(|tick| sample(tick, 1.0)).collect();
        let but = |gone: &[u32]| -> Vec<_> {
            let stays = |sample: &&Sample| !gone.contains(&sample.tick);
            ours.iter().filter(stays).copied().collect()
        };
        for gone in [&[][..], &[0], &[2, 3], &[5], &[0, 5], &[0, 1, 2, 3, 4, 5]] {
            assert_eq!(completed(&ours, &but(gone)), (ours.clone(), None), "{gone:?}");
        }
        let mut theirs = but(&[1]);
        theirs[2].feed_mm_s = 2.0;
        let (rows, difference) = completed(&ours, &theirs);
        assert_eq!((rows[3], difference), (sample(3, 2.0), Some(3)));
        let surplus = [but(&[1]), vec![sample(6, 1.0)]].concat();
        let (rows, difference) = completed(&ours, &surplus);
        assert_eq!((rows.len(), difference), (7, Some(6)));
    }

    #[test]
    fn a_commanded_run_may_end_ready_but_not_held() {
        assert_eq!(verdict(ended(State::Ready), None, true), None);
        assert_eq!(verdict(ended(State::Finished), None, true), None);
        let held = verdict(ended(State::Held), None, true).unwrap();
        assert_eq!(held, "the board ended held");
        assert!(verdict(ended(State::Ready), None, false).is_some());
    }
}
