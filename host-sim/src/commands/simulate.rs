//! `simulate`: runs the core on this computer.

use std::path::{Path, PathBuf};

use ::approach::Kind;
use clap::Args;
use inspect::{BOUNDS, InspectError, TimedRun};
use job::Job;
use machine::prepare::Prepared;
use machine::travel;
use oracle::{PassSample, SampleCheck};
use report::{Remarks, Sketch};
use verify::survey::{SampleObserver, SurveyResult};

use super::outcome::Outcome;
use super::{Bar, Failure, Result, approach, cannot_write, load, scripted, trace, warn_of_limits};

/// Runs a job on this computer with the core of the firmware, bit-identical to the board, or with another approach of the paper.
///
/// Example: cargo sim simulate jobs/freeform.toml --trace out.csv
/// Example: cargo sim simulate jobs/revolved.toml --approach linear --report out
/// Example: cargo sim simulate jobs/plate_machine.toml --script jobs/operator.txt
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    /// Writes every sample as a row of this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Writes a report page into this folder: 3D view, charts, figures.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Applies the operator commands in this file: lines `tick N: hold`, or resume, stop, abort, start, override P.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["report", "approach"])]
    script: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// Approach to the tool path.
    #[arg(long, value_enum, default_value = "surface")]
    approach: Kind,
}

/// Runs the core alone.
pub(super) fn timed(job: &Job, prepared: &Prepared) -> Result<TimedRun> {
    let bar = Bar::new();
    let timed = inspect::time_run(job, prepared, &bar);
    bar.clear();
    Ok(timed?)
}

/// Runs the core again, measures every sample, and writes the trace if a path is given; with the data of a report if
/// `sketched`.
pub(super) fn surveyed(
    job: &Job,
    prepared: &Prepared,
    timed: &TimedRun,
    trace_file: Option<&PathBuf>,
    sketched: bool,
) -> Result<(SurveyResult, Option<Sketch>)> {
    let mut sketch = sketched.then(|| Sketch::new(job, timed.passes.len()));
    let mut draw = sketch
        .as_mut()
        .map(|sketch| |emitted: &PassSample, checked: &SampleCheck| sketch.add(emitted, checked));
    let each = draw.as_mut().map(|draw| draw as &mut SampleObserver<'_>);
    let bar = Bar::new();
    let findings = inspect::survey_run(job, prepared, timed.samples, trace(trace_file, job)?, each, &bar);
    bar.clear();
    let findings = findings.map_err(|error| match (error, trace_file) {
        (InspectError::Trace(error), Some(path)) => cannot_write(path, &error),
        (error, _) => error.into(),
    })?;
    Ok((findings, sketch))
}

/// What a report says besides the samples: the fault, figures out of their bounds, limits that are not held.
pub(super) fn remarks(timed: &TimedRun, findings: &SurveyResult) -> Remarks {
    let failures = match &timed.fault {
        Some(fault) => vec![fault.sentence()],
        None => findings.report.failures(&BOUNDS),
    };
    Remarks {
        failures,
        ..Remarks::default()
    }
}

/// Writes the report if a folder is given, and returns the path of its page.
pub(super) fn report(
    job: &Job,
    directory: Option<&Path>,
    sketch: Option<&Sketch>,
    findings: &SurveyResult,
    remarks: &Remarks,
) -> Result<Option<PathBuf>> {
    let write = |(directory, sketch): (&Path, &Sketch)| {
        sketch
            .write(directory, Path::new(job.origin.name()), findings, remarks)
            .map_err(|error| cannot_write(directory, &error))
    };
    directory.zip(sketch).map(write).transpose()
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (job, prepared) = load(&arguments.job)?;
    if arguments.approach != Kind::Surface {
        warn_of_limits(&job);
        let Arguments {
            trace, report, json, ..
        } = arguments;
        return approach::command(arguments.approach, &job, trace.as_ref(), report.as_deref(), *json);
    }
    travel::check(&job)?;
    if let Some(script) = &arguments.script {
        let scripted = scripted::play(&job, &prepared, script, arguments.trace.as_ref())?;
        return scripted.output(&job, arguments.json);
    }
    let timed = timed(&job, &prepared)?;
    let directory = arguments.report.as_deref();
    let (findings, sketch) = surveyed(
        &job,
        &prepared,
        &timed,
        arguments.trace.as_ref(),
        directory.is_some(),
    )?;
    let remarks = remarks(&timed, &findings);
    let page = report(&job, directory, sketch.as_ref(), &findings, &remarks)?;
    let outcome = Outcome {
        kind: Kind::Surface,
        job: &job,
        segments: prepared.patches(),
        bytes: prepared.bytes(),
        findings: &findings,
        digest: timed.digest,
        samples_per_second: timed.samples_per_second,
        fault: timed.fault,
    };
    outcome.output(arguments.json, page.as_deref());
    match outcome.fault {
        None => Ok(()),
        Some(fault) => Err(Failure::Failed(Some(fault.sentence_of(&job)))),
    }
}
