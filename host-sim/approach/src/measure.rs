//! Figures of a run by an approach, measured in the same way for all four.

use protocol::digest::Digest;

use super::{ApproachError, Kind, Motion, Planned, run};
use job::Job;
use oracle::{Oracle, SampleCheck, Verifier};
use verify::speeds::{PeriodSpeed, SpeedRecorder};
use verify::survey::SurveyResult;

/// Figures of a run.
#[derive(Clone, Debug)]
pub struct Measured {
    /// Size of the CNC program.
    pub planned: Planned,
    /// What a run of the core reports too.
    pub findings: SurveyResult,
    /// Machining time, s: samples times the period, as the product counts it.
    pub time_s: f64,
    /// Digest of all samples: tick, pass, CC and CL.
    pub digest: u64,
}

/// Runs a job by an approach and measures it. Passes on every motion, with the speeds over its period if it ends one, and the
/// result of its check.
///
/// # Errors
/// As [`run`].
pub fn measure(
    kind: Kind,
    job: &Job,
    mut each: impl FnMut(&Motion, Option<PeriodSpeed>, &SampleCheck),
) -> Result<Measured, ApproachError> {
    measure_run(job, &mut each, |each| run(kind, job, each))
}

/// As [`measure`], for a given run.
///
/// # Errors
/// Those of the run.
pub fn measure_run(
    job: &Job,
    each: &mut dyn FnMut(&Motion, Option<PeriodSpeed>, &SampleCheck),
    run: impl FnOnce(&mut dyn FnMut(&Motion)) -> Result<Planned, ApproachError>,
) -> Result<Measured, ApproachError> {
    let oracle = Oracle::new(job)?;
    let mut verifier = Verifier::new(&oracle);
    let mut speeds = SpeedRecorder::new(oracle.period_s);
    let mut digest = Digest::new();
    let mut interval = f64::INFINITY;
    let planned = run(&mut |motion| {
        let checked = verifier.add(&motion.emitted);
        interval = interval.min(motion.emitted.interval);
        digest.word(motion.emitted.tick as u32);
        digest.word(motion.emitted.pass);
        digest.words(&motion.emitted.cc_nm);
        digest.words(&motion.emitted.cl_nm);
        let speed = speeds.add(&motion.emitted, checked.arc_mm, motion.cl_mm);
        each(motion, speed, &checked);
    })?;
    let report = verifier.finish();
    Ok(Measured {
        planned,
        time_s: report.samples as f64 * oracle.period_s,
        findings: SurveyResult {
            samples: report.samples,
            passes: u32::try_from(planned.passes).unwrap_or(u32::MAX),
            speeds: speeds.finish(planned.speed_step_mm_s),
            interval_min: interval,
            report,
        },
        digest: digest.value(),
    })
}
