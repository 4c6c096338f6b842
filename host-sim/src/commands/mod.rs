//! The commands, one file each; this one reads the arguments and turns results into exit codes.

mod approach;
mod budget;
mod export;
mod outcome;
mod paper;
mod run;
mod simulate;
mod swept_words;
mod verify;

pub use verify::BOUNDS;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};

use crate::approach::ApproachError;
use crate::job_file::JobFile;
use crate::prepare::{Prepared, prepare};

/// Why a command did not do what it was asked.
#[derive(Debug)]
pub enum Failure {
    /// Bad usage or bad input: exit code 2.
    Input(miette::Report),
    /// The run or the check failed: exit code 1. What there is to say may have been said on stdout already.
    Failed(Option<String>),
}

impl From<crate::job_file::JobFileError> for Failure {
    fn from(error: crate::job_file::JobFileError) -> Self {
        Self::Input(error.into())
    }
}

impl From<ApproachError> for Failure {
    /// A surface that an approach cannot cut is a failed run; the job may be as good as any.
    fn from(error: ApproachError) -> Self {
        Self::Failed(Some(match error {
            ApproachError::Fault(sentence) => sentence,
            other => format!("{other}\n  help: {}", other.remedy()),
        }))
    }
}

impl Failure {
    /// Bad input that no job file's line is to blame for.
    fn input(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Input(miette::miette!(help = remedy.into(), "{}", what.into()))
    }
}

/// Result of a command.
pub type Result<T> = std::result::Result<T, Failure>;

/// Runs surface jobs on this machine or on a board, and checks them.
#[derive(Debug, Parser)]
#[command(name = "cargo sim", bin_name = "cargo sim", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Simulate(simulate::Arguments),
    Run(run::Arguments),
    Verify(verify::Arguments),
    Export(export::Arguments),
    Paper(paper::Arguments),
    Budget(budget::Arguments),
}

/// Reads the arguments, runs the command, and returns its exit code: 0 done, 1 failed, 2 bad usage or bad input.
#[must_use]
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Simulate(arguments) => simulate::command(&arguments),
        Command::Run(arguments) => run::command(&arguments),
        Command::Verify(arguments) => verify::command(&arguments),
        Command::Export(arguments) => export::command(&arguments),
        Command::Paper(arguments) => paper::command(&arguments),
        Command::Budget(arguments) => budget::command(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure::Failed(message)) => {
            if let Some(message) = message {
                eprintln!("error: {message}");
            }
            ExitCode::from(1)
        }
        Err(Failure::Input(report)) => {
            eprintln!("{report:?}");
            ExitCode::from(2)
        }
    }
}

/// Reads and prepares a job, and says what of it this version does not do yet.
fn load(path: &Path) -> Result<(JobFile, Prepared)> {
    let job = JobFile::load(path)?;
    let prepared = prepare(&job)?;
    Ok((job, prepared))
}

/// The axis limits that a job asks for and that nothing holds yet.
fn unheld_limits(job: &JobFile) -> Option<String> {
    let machine = &job.machine;
    let keys = [
        ("velocity_max_mm_s", machine.velocity_max_mm_s.is_some()),
        ("acceleration_max_mm_s2", machine.acceleration_max_mm_s2.is_some()),
        ("jerk_max_mm_s3", machine.jerk_max_mm_s3.is_some()),
        ("travel_mm", machine.travel_mm.is_some()),
    ];
    let given: Vec<_> = keys
        .into_iter()
        .filter_map(|(key, given)| given.then_some(key))
        .collect();
    (!given.is_empty()).then(|| {
        format!(
            "{} not held yet: the feed is constant from the first sample to the last",
            given.join(", ")
        )
    })
}

fn warn_of_limits(job: &JobFile) {
    if let Some(limits) = unheld_limits(job) {
        eprintln!("warning: {limits}");
    }
}

/// A bar on stderr, where that is a terminal.
fn progress(length: u64, what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(length);
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} % {eta}") {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}

/// A trace file, if one is wanted.
fn trace(path: Option<&PathBuf>, job: &JobFile) -> Result<Option<crate::trace::Trace>> {
    path.map(|path| {
        crate::trace::Trace::create(path, job.machine.period_us).map_err(|error| cannot_write(path, &error))
    })
    .transpose()
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    Failure::input(
        format!("cannot write {}: {error}", path.display()),
        "name a file in a folder that exists",
    )
}
