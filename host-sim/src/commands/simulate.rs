//! `simulate`: runs the core on this machine.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use interp_core::{Fault, SpanParameter};
use protocol::digest::Digest;

use super::outcome::{FaultAt, Outcome};
use super::{
    BOUNDS, Failure, Result, approach, cannot_write, load, progress, scripted, trace, warn_of_limits,
};
use crate::approach::Kind;
use crate::explain;
use crate::job_file::JobFile;
use crate::machine::Machine;
use crate::oracle::{Checked, Emitted, Oracle};
use crate::prepare::Prepared;
use crate::report::{Remarks, Sketch};
use crate::survey::{Each, Findings, Survey, is_on_pass};
use crate::travel;

/// Runs a job on this machine: the same core, the same bits as on the board; or one of the paper's other approaches.
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
    /// Writes a page with a view that turns, charts and figures into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Does what this file says an operator does: lines `tick N: hold`, or resume, stop, abort, start, override P.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["report", "approach"])]
    script: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    /// How the tool path is made.
    #[arg(long, value_enum, default_value = "surface")]
    approach: Kind,
}

/// A run of the core alone, timed: digests of the run and of each pass.
#[derive(Debug)]
pub(super) struct Timed {
    pub(super) digest: u64,
    pub(super) samples: u64,
    pub(super) samples_per_second: f64,
    /// Of each pass: first tick, samples, digest of the run up to its end.
    pub(super) passes: Vec<(u32, u32, u64)>,
    pub(super) fault: Option<FaultAt>,
}

/// A machine with the job loaded, or the reason against it as bad input.
pub(super) fn machine(job: &JobFile, prepared: &Prepared) -> Result<Machine> {
    Machine::load(prepared).map_err(|fault| refused(job, fault))
}

fn refused(job: &JobFile, fault: Fault) -> Failure {
    let (what, remedy) = explain::fault(fault);
    let remedy = format!("{remedy}; more: cargo sim explain {}", fault.kind.code());
    job.origin.error("surface", what, remedy).into()
}

/// Parts of the bar of a run, which goes by the side parameter: nobody knows the samples before.
const PARTS: u64 = 1000;

/// Parts of the surface that lie behind a pass.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "a share of a bar"
)]
fn parts_done(side: SpanParameter, prepared: &Prepared) -> u64 {
    let [start, end] = [0, prepared.side.breaks.len() - 1].map(|end| prepared.side.breaks[end]);
    let share = (prepared.side.parameter(side) - start) / (end - start);
    (share * PARTS as f64) as u64
}

/// Runs the core alone.
pub(super) fn timed(job: &JobFile, prepared: &Prepared) -> Result<Timed> {
    let mut machine = machine(job, prepared)?;
    let mut run = Digest::new();
    let mut passes: Vec<(u32, u32, u64)> = Vec::new();
    let mut current = None;
    let mut samples = 0_u64;
    let bar = progress(PARTS, "running");
    let start = Instant::now();
    let result = machine.run(|sample| {
        if current != Some(sample.pass) {
            if let Some(last) = passes.last_mut() {
                last.2 = run.value();
            }
            current = Some(sample.pass);
            passes.push((sample.tick, 0, 0));
            if is_on_pass(sample) {
                bar.set_position(parts_done(sample.side, prepared));
            }
        }
        run.sample(sample);
        if let Some(last) = passes.last_mut() {
            last.1 += 1;
        }
        samples += 1;
        true
    });
    let elapsed = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    if let Some(last) = passes.last_mut() {
        last.2 = run.value();
    }
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let samples_per_second = samples as f64 / elapsed.max(1e-9);
    let fault = result
        .err()
        .map(|fault| FaultAt::of(fault, &machine, samples, prepared));
    Ok(Timed {
        digest: run.value(),
        samples,
        samples_per_second,
        passes,
        fault,
    })
}

/// Runs the core again, measures every sample, and writes the trace if it is wanted; with what a report needs if one is
/// `sketched`.
pub(super) fn surveyed(
    job: &JobFile,
    prepared: &Prepared,
    timed: &Timed,
    trace_file: Option<&PathBuf>,
    sketched: bool,
) -> Result<(Findings, Option<Sketch>)> {
    let oracle = oracle(job)?;
    let mut sketch = sketched.then(|| Sketch::new(job, timed.passes.len()));
    let mut draw = sketch
        .as_mut()
        .map(|sketch| |emitted: &Emitted, checked: &Checked| sketch.add(emitted, checked));
    let each = draw.as_mut().map(|draw| draw as &mut Each<'_>);
    let mut survey = Survey::new(prepared, &oracle, trace(trace_file, job)?, each);
    let bar = progress(timed.samples, "measuring");
    let mut written = Ok(());
    let mut machine = machine(job, prepared)?;
    let ran = machine.run(|sample| {
        written = survey.add(sample);
        if sample.tick % 65_536 == 0 {
            bar.set_position(sample.tick.into());
        }
        written.is_ok()
    });
    bar.finish_and_clear();
    let name = trace_file.cloned().unwrap_or_default();
    let findings = written
        .and_then(|()| survey.finish(ran.is_ok()))
        .map_err(|error| cannot_write(&name, &error))?;
    Ok((findings, sketch))
}

/// What a report says besides the samples: the fault, figures out of their bounds, limits that are not held.
pub(super) fn remarks(timed: &Timed, findings: &Findings) -> Remarks {
    let failures = match &timed.fault {
        Some(fault) => vec![fault.sentence()],
        None => findings.report.failures(&BOUNDS),
    };
    Remarks {
        failures,
        ..Remarks::default()
    }
}

/// Writes the report if one is wanted, and returns the page's path.
pub(super) fn report(
    job: &JobFile,
    directory: Option<&Path>,
    sketch: Option<&Sketch>,
    findings: &Findings,
    remarks: &Remarks,
) -> Result<Option<PathBuf>> {
    let write = |(directory, sketch): (&Path, &Sketch)| {
        sketch
            .write(directory, Path::new(job.origin.name()), findings, remarks)
            .map_err(|error| cannot_write(directory, &error))
    };
    directory.zip(sketch).map(write).transpose()
}

/// The oracle of a job that was prepared, hence has one.
pub(super) fn oracle(job: &JobFile) -> Result<Oracle> {
    Oracle::new(job).map_err(|error| Failure::input(error.to_string(), "say side = \"+\" or \"-\""))
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
        return scripted.tell(&job, arguments.json);
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
    outcome.tell(arguments.json, page.as_deref());
    match outcome.fault {
        None => Ok(()),
        Some(fault) => Err(Failure::Failed(Some(fault.sentence_of(&job)))),
    }
}
