//! Runs a loaded job and compares it with the simulation, by the digests of its passes or by every sample.

use indicatif::ProgressBar;

use super::super::attach::unreachable_run;
use super::super::out::to_stderr;
use super::super::typed::{Console, WORDS};
use super::super::{Failure, Result, WantedTrace, begun, completed, progress};
use super::Arguments;
use inspect::comparison::{self, BoardRun, ComparisonError, Reference};
use job::Job;
use machine::remote::Session;
use machine::remote::operate::Operator;

/// Runs and compares the digest of each pass; where one differs in QEMU, finds the first sample that does.
pub(super) fn by_digest(
    arguments: &Arguments,
    reference: &Reference<'_>,
    session: &mut Session,
) -> Result<BoardRun> {
    let bar = progress(reference.run.samples, "running");
    let mut console = console(arguments, &bar, reference.job.machine.has_limits());
    let operator = console.as_mut().map(|console| console as &mut dyn Operator);
    let run = comparison::by_digest(reference, session, arguments.target.qemu, operator, |samples| {
        bar.set_position(samples)
    });
    bar.finish_and_clear();
    run.map_err(|error| left(error, arguments, reference.job))
}

/// The failure of a comparison: on a board the run goes on, or is held.
fn left(error: ComparisonError, arguments: &Arguments, job: &Job) -> Failure {
    match (error, &arguments.target.port) {
        (ComparisonError::Remote(error), Some(port)) => unreachable_run(error, port, Some(&job.machine)),
        (error, _) => error.into(),
    }
}

/// The operator's console of a run on a board; QEMU has none.
fn console(arguments: &Arguments, bar: &ProgressBar, has_limits: bool) -> Option<Console> {
    if arguments.target.qemu {
        return None;
    }
    if !arguments.json {
        bar.suspend(|| to_stderr(format_args!("type a command and Enter: {WORDS}")));
    }
    Some(Console::new(bar.clone(), Some(has_limits)))
}

/// Runs with every sample on the line, writes the trace, and compares each sample.
pub(super) fn by_sample(
    arguments: &Arguments,
    reference: &Reference<'_>,
    session: &mut Session,
) -> Result<BoardRun> {
    let wanted = WantedTrace::new(arguments.trace.as_ref(), arguments.force);
    let (mut file, whole) = begun(wanted, reference.job)?;
    let mut written = Ok(());
    let bar = progress(reference.run.samples, "running");
    let mut console = console(arguments, &bar, reference.job.machine.has_limits());
    let operator = console.as_mut().map(|console| console as &mut dyn Operator);
    let length = reference.run.samples;
    let run = comparison::by_sample(
        reference,
        session,
        arguments.target.qemu,
        operator,
        |samples| {
            if samples % 4096 == 0 {
                bar.set_position(samples.min(length));
            }
        },
        |sample| {
            if let (Some(file), Ok(())) = (&mut file, &written) {
                written = file.write(&inspect::plain(reference.prepared, sample));
            }
        },
    );
    bar.finish_and_clear();
    let run = run.map_err(|error| left(error, arguments, reference.job))?;
    // Otherwise no file is left behind.
    if run.is_complete() {
        completed(written, file, whole, wanted)?;
    }
    Ok(run)
}
