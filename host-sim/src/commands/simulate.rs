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
use super::{
    Bar, Failure, Result, WantedTrace, approach, begun, cannot_write, completed, home, output_file,
    read_profile, scripted, warn_of_limits,
};

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
    /// Machine profile (TOML): what the job does not say of the machine is the profile's, and the job may not exceed it.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    #[command(flatten)]
    placed: home::Placed,
    /// Writes every sample as a row of this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Writes a report page into this folder: 3D view, charts, figures.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Overwrites existing files of --trace and --report.
    #[arg(long)]
    force: bool,
    /// Applies the operator commands in this file: lines `tick N: hold`, or pause, resume, stop, abort, start, override P.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["report", "approach"])]
    script: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// Approach to the tool path.
    #[arg(long, value_enum, default_value = "surface")]
    approach: Kind,
}

/// The files of a report, the page first.
const REPORT_FILES: [&str; 2] = ["index.html", "path.svg"];

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
    wanted: Option<WantedTrace<'_>>,
    sketched: bool,
) -> Result<(SurveyResult, Option<Sketch>)> {
    let mut sketch = sketched.then(|| Sketch::new(job, timed.passes.len()));
    let mut draw = sketch
        .as_mut()
        .map(|sketch| |emitted: &PassSample, checked: &SampleCheck| sketch.add(emitted, checked));
    let each = draw.as_mut().map(|draw| draw as &mut SampleObserver<'_>);
    let bar = Bar::new();
    let (trace, output) = begun(wanted, job)?;
    let findings = inspect::survey_run(job, prepared, timed.samples, trace, each, &bar);
    bar.clear();
    let findings = findings.map_err(|error| match (error, wanted) {
        (InspectError::Trace(error), Some(wanted)) => cannot_write(wanted.path, &error),
        (error, _) => error.into(),
    })?;
    completed(Ok(()), None, output, wanted)?;
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

/// A report that a command was asked for.
#[derive(Clone, Copy)]
pub(super) struct WantedReport<'a> {
    directory: &'a Path,
    force: bool,
}

impl<'a> WantedReport<'a> {
    /// Checks that the report can be written, before the work for it is done.
    pub(super) fn new(directory: Option<&'a Path>, force: bool) -> Result<Option<Self>> {
        directory
            .map(|directory| {
                output_file::check_folder(directory, &REPORT_FILES, force)?;
                Ok(Self { directory, force })
            })
            .transpose()
    }
}

/// Writes the report if one is wanted, and returns the path of its page.
pub(super) fn report(
    job: &Job,
    wanted: Option<WantedReport<'_>>,
    sketch: Option<&Sketch>,
    findings: &SurveyResult,
    remarks: &Remarks,
) -> Result<Option<PathBuf>> {
    let write = |(wanted, sketch): (WantedReport<'_>, &Sketch)| {
        let WantedReport { directory, force } = wanted;
        output_file::write_folder(directory, &REPORT_FILES, force, |folder| {
            let name = Path::new(job.origin.name());
            sketch.write(folder, name, findings, remarks).map(|_| ())
        })?;
        Ok(directory.join(REPORT_FILES[0]))
    };
    wanted.zip(sketch).map(write).transpose()
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let profile = read_profile(arguments.machine.as_ref())?;
    let (job, prepared) = home::load(&arguments.job, profile.as_ref(), arguments.placed.origin, None)?;
    arguments
        .script
        .iter()
        .for_each(|script| output_file::note_input(script));
    let wanted = WantedTrace::new(arguments.trace.as_ref(), arguments.force);
    wanted.map_or(Ok(()), |wanted| output_file::check(wanted.path, wanted.force))?;
    let directory = WantedReport::new(arguments.report.as_deref(), arguments.force)?;
    if arguments.approach != Kind::Surface {
        warn_of_limits(&job);
        return approach::command(arguments.approach, &job, wanted, directory, arguments.json);
    }
    travel::check(&job)?;
    if let Some(script) = &arguments.script {
        let scripted = scripted::play(&job, &prepared, script, wanted)?;
        return scripted.output(&job, arguments.json);
    }
    let timed = timed(&job, &prepared)?;
    let (findings, sketch) = surveyed(&job, &prepared, &timed, wanted, directory.is_some())?;
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
