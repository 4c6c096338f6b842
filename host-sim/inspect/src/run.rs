//! Runs of the core: alone and timed, or with every sample surveyed.

use std::time::Instant;

use glam::DVec3;
use interp_core::{Fault, SpanParameter};
use job::units::MM_PER_NM;
use job::{Job, JobError};
use machine::Machine;
use machine::prepare::Prepared;
use oracle::{Oracle, PassSample, SampleCheck};
use protocol::digest::Digest;
use verify::survey::{SampleObserver, Survey, SurveyResult};
use verify::swept::Progress;
use verify::trace::Trace;

use crate::{FaultAt, InspectError, is_on_pass, plain};

/// Samples per step of a progress bar.
pub(crate) const PROGRESS_SAMPLES: u64 = 65_536;
/// Steps of the progress bar of a run with an unknown number of samples: the bar follows the side parameter.
const PROGRESS_PARTS: u64 = 1000;

/// A pass of a timed run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassDigest {
    /// Tick of its first sample.
    pub first_tick: u32,
    /// Number of samples, with the link to the next pass.
    pub samples: u32,
    /// Digest of the run up to the end of the pass.
    pub digest: u64,
}

/// A run of the core alone, timed.
#[derive(Clone, Debug)]
pub struct TimedRun {
    /// Digest of all samples.
    pub digest: u64,
    /// Number of samples.
    pub samples: u64,
    /// Samples per second of wall time.
    pub samples_per_second: f64,
    /// The passes, in order.
    pub passes: Vec<PassDigest>,
    /// The fault that stopped the run.
    pub fault: Option<FaultAt>,
}

/// The error of a job that the core refuses, at its line.
#[must_use]
pub fn load_error(job: &Job, fault: Fault) -> JobError {
    let (what, remedy) = explain::fault(fault);
    let remedy = format!("{remedy}; more: cargo sim explain {}", fault.kind.code());
    job.origin.error("surface", what, remedy)
}

/// A machine with the job loaded.
pub(crate) fn machine(job: &Job, prepared: &Prepared) -> Result<Machine, JobError> {
    Machine::load(prepared).map_err(|fault| load_error(job, fault))
}

/// The oracle of a job.
///
/// # Errors
/// The job requests an upper side, and the surface has none.
pub fn oracle(job: &Job) -> Result<Oracle, InspectError> {
    Ok(Oracle::new(job)?)
}

/// Completed share of the surface, in units of 1/[`PROGRESS_PARTS`].
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a share of a bar"
)]
fn parts_done(side: SpanParameter, prepared: &Prepared) -> u64 {
    let [start, end] = [0, prepared.side.breaks.len() - 1].map(|end| prepared.side.breaks[end]);
    let share = (prepared.side.parameter(side) - start) / (end - start);
    (share * PROGRESS_PARTS as f64) as u64
}

/// Runs the core alone.
///
/// # Errors
/// The core refuses the job.
pub fn time_run(job: &Job, prepared: &Prepared, progress: &dyn Progress) -> Result<TimedRun, JobError> {
    let mut machine = machine(job, prepared)?;
    let mut run = Digest::new();
    let mut passes: Vec<PassDigest> = Vec::new();
    let (mut current, mut samples, mut parts) = (None, 0_u64, 0);
    progress.begin("running", PROGRESS_PARTS);
    let start = Instant::now();
    let result = machine.run(|sample| {
        if current != Some(sample.pass) {
            if let Some(last) = passes.last_mut() {
                last.digest = run.value();
            }
            current = Some(sample.pass);
            passes.push(PassDigest {
                first_tick: sample.tick,
                samples: 0,
                digest: 0,
            });
            if is_on_pass(sample) {
                let done = parts_done(sample.side, prepared);
                progress.done(done.saturating_sub(parts));
                parts = parts.max(done);
            }
        }
        run.sample(sample);
        if let Some(last) = passes.last_mut() {
            last.samples += 1;
        }
        samples += 1;
        true
    });
    let elapsed = start.elapsed().as_secs_f64();
    if let Some(last) = passes.last_mut() {
        last.digest = run.value();
    }
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let samples_per_second = samples as f64 / elapsed.max(1e-9);
    let fault = result
        .err()
        .map(|fault| FaultAt::of(fault, &machine, samples, prepared, job));
    Ok(TimedRun {
        digest: run.value(),
        samples,
        samples_per_second,
        passes,
        fault,
    })
}

/// The centres of the ball of a run, mm, and the fault that stopped it.
///
/// # Errors
/// The core refuses the job.
pub fn centres_of_run(job: &Job, prepared: &Prepared) -> Result<(Vec<DVec3>, Option<FaultAt>), JobError> {
    let mut centres_mm = Vec::new();
    let mut machine = machine(job, prepared)?;
    let ran = machine.run(|sample| {
        centres_mm.push(DVec3::from(sample.cl_nm.map(f64::from)) * MM_PER_NM);
        true
    });
    let fault = ran.err();
    let fault = fault.map(|fault| FaultAt::of(fault, &machine, centres_mm.len() as u64, prepared, job));
    Ok((centres_mm, fault))
}

/// Runs the core, measures every sample, and writes the trace if one is given. `samples`: expected number; `each`: called for every
/// sample on a pass, with its errors.
///
/// # Errors
/// The core refuses the job, the oracle has no result for it, or the trace cannot be written.
pub fn survey_run(
    job: &Job,
    prepared: &Prepared,
    samples: u64,
    trace: Option<Trace>,
    each: Option<&mut SampleObserver<'_>>,
    progress: &dyn Progress,
) -> Result<SurveyResult, InspectError> {
    let oracle = oracle(job)?;
    let mut survey = Survey::new(&oracle, trace);
    let mut ignore = |_: &PassSample, _: &SampleCheck| ();
    let each: &mut SampleObserver<'_> = each.unwrap_or(&mut ignore);
    progress.begin("measuring", samples);
    let mut written = Ok(());
    let ran = machine(job, prepared)?.run(|sample| {
        written = survey.add(&plain(prepared, sample), each);
        if u64::from(sample.tick) % PROGRESS_SAMPLES == PROGRESS_SAMPLES - 1 {
            progress.done(PROGRESS_SAMPLES);
        }
        written.is_ok()
    });
    written?;
    Ok(survey.finish(ran.is_ok(), each)?)
}
