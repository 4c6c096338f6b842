//! The commands, one file each; this file parses the arguments and maps results to exit codes.

mod along;
mod approach;
mod attach;
mod axes;
#[cfg(feature = "developer")]
mod budget;
mod completions;
mod error_json;
mod explain;
mod export;
mod flash;
mod home;
mod import;
mod interrupt;
mod judge;
mod log;
mod motion_words;
mod new;
mod numbers;
mod operate;
mod out;
mod outcome;
mod output_file;
#[cfg(feature = "developer")]
mod paper;
mod part_words;
mod progress;
mod reach_words;
mod region_words;
mod resume;
mod run;
mod scripted;
mod settings;
mod simulate;
mod spindle;
mod stored;
mod swept_words;
mod typed;
mod verify;

use out::{complain, say};
use programs::with_command_name;
use progress::{Bar, progress, spinner};

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::{Resettable, StyledStr};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use output_file::OutputFile;

use ::approach::ApproachError;
use inspect::InspectError;
use job::{AlongChoice, Job, MachineProfile};
use job_file::FaceError;
use machine::direction::{self, DirectionError};
use machine::prepare::Prepared;
use part_program::add_links;

/// Failure of a command, with its exit code.
#[derive(Debug)]
pub enum Failure {
    /// Bad usage or bad input: exit code 2.
    Input(miette::Report),
    /// The run or the check failed: exit code 1; no message if stdout already has it.
    Failed(Option<String>),
}

impl From<job::JobError> for Failure {
    fn from(error: job::JobError) -> Self {
        Self::Input(error.into())
    }
}

impl From<DirectionError> for Failure {
    fn from(error: DirectionError) -> Self {
        match error {
            DirectionError::Refused(error) => error.into(),
            DirectionError::Faults(sentence) => Self::Failed(Some(sentence)),
        }
    }
}

impl From<FaceError> for Failure {
    fn from(error: FaceError) -> Self {
        Self::input(error.what, error.remedy)
    }
}

impl From<InspectError> for Failure {
    fn from(error: InspectError) -> Self {
        match error {
            InspectError::Refused(error) => error.into(),
            InspectError::NoOracle(error) => Self::input(error.to_string(), "set side = \"+\" or \"-\""),
            InspectError::Trace(error) => Self::Failed(Some(format!("cannot write the trace: {error}"))),
        }
    }
}

impl From<ApproachError> for Failure {
    /// A surface that an approach cannot cut is a failed run, not bad input: the job itself is valid.
    fn from(error: ApproachError) -> Self {
        Self::Failed(Some(match error {
            ApproachError::Fault(sentence) => sentence,
            other => format!("{other}\n  help: {}", other.remedy()),
        }))
    }
}

impl Failure {
    /// Bad input that has no line in a job file.
    fn input(what: impl Into<String>, remedy: impl Into<String>) -> Self {
        let (what, remedy) = (what.into(), remedy.into());
        Self::Input(miette::miette!(
            help = job::printable(&remedy).into_owned(),
            "{}",
            job::printable(&what)
        ))
    }
}

/// Result of a command.
pub type Result<T> = std::result::Result<T, Failure>;

/// Runs surface jobs on this computer or on a board, and checks them.
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
    Operate(operate::Arguments),
    Attach(attach::Arguments),
    Verify(verify::Arguments),
    Judge(judge::Arguments),
    Export(export::Arguments),
    Import(import::Arguments),
    #[cfg(feature = "developer")]
    Paper(paper::Arguments),
    #[cfg(feature = "developer")]
    Budget(budget::Arguments),
    Flash(flash::Arguments),
    Log(log::Arguments),
    Settings(settings::Arguments),
    New(new::Arguments),
    Explain(explain::Arguments),
    Completions(completions::Arguments),
}

impl Command {
    /// Whether the output is JSON.
    fn as_json(&self) -> bool {
        match self {
            Self::Simulate(arguments) => arguments.json,
            Self::Run(arguments) => arguments.json,
            Self::Operate(arguments) => arguments.json,
            Self::Attach(arguments) => arguments.json,
            Self::Verify(arguments) => arguments.json,
            Self::Judge(arguments) => arguments.json,
            Self::Export(arguments) => arguments.json,
            Self::Import(arguments) => arguments.json,
            #[cfg(feature = "developer")]
            Self::Paper(arguments) => arguments.json,
            #[cfg(feature = "developer")]
            Self::Budget(arguments) => arguments.json,
            Self::Flash(arguments) => arguments.json,
            Self::Log(arguments) => arguments.json,
            Self::Settings(arguments) => arguments.json,
            Self::New(arguments) => arguments.json,
            Self::Explain(arguments) => arguments.json,
            Self::Completions(_) => false,
        }
    }

    fn execute(&self) -> Result<()> {
        match self {
            Self::Simulate(arguments) => simulate::command(arguments),
            Self::Run(arguments) => run::command(arguments),
            Self::Operate(arguments) => operate::command(arguments),
            Self::Attach(arguments) => attach::command(arguments),
            Self::Verify(arguments) => verify::command(arguments),
            Self::Judge(arguments) => judge::command(arguments),
            Self::Export(arguments) => export::command(arguments),
            Self::Import(arguments) => import::command(arguments),
            #[cfg(feature = "developer")]
            Self::Paper(arguments) => paper::command(arguments),
            #[cfg(feature = "developer")]
            Self::Budget(arguments) => budget::command(arguments),
            Self::Flash(arguments) => flash::command(arguments),
            Self::Log(arguments) => log::command(arguments),
            Self::Settings(arguments) => settings::command(arguments),
            Self::New(arguments) => new::command(arguments),
            Self::Explain(arguments) => explain::command(arguments),
            Self::Completions(arguments) => completions::command(arguments),
        }
    }
}

/// The command line, with the name that the tool has here.
fn arguments() -> clap::Command {
    let name = programs::command_name();
    with_name(Cli::command().name(name).bin_name(name))
}

/// The same command with the tool's name in its help, that of its arguments and of its subcommands.
fn with_name(command: clap::Command) -> clap::Command {
    let text = |text: Option<&StyledStr>| {
        Resettable::<StyledStr>::from(
            text.map(|text| with_command_name(&text.to_string()).into_owned().into()),
        )
    };
    let (about, long_about) = (text(command.get_about()), text(command.get_long_about()));
    command
        .about(about)
        .long_about(long_about)
        .mut_args(move |argument| {
            let (help, long_help) = (text(argument.get_help()), text(argument.get_long_help()));
            argument.help(help).long_help(long_help)
        })
        .mut_subcommands(with_name)
}

/// Reads the arguments, runs the command, and returns its exit code: 0 done, 1 failed, 2 bad usage or bad input.
#[must_use]
pub fn main() -> ExitCode {
    let parsed = arguments()
        .try_get_matches()
        .and_then(|matches| Cli::from_arg_matches(&matches));
    let command = match parsed {
        Ok(parsed) => parsed.command,
        Err(error) => {
            // The arguments were not understood, so only their text tells whether JSON is expected.
            if error.use_stderr() && std::env::args_os().any(|argument| argument == "--json") {
                say!("{}", error_json::of_usage(&error));
                out::finish();
            }
            error.exit()
        }
    };
    if command.as_json() {
        progress::silence();
    }
    let result = command.execute();
    if let (true, Err(failure)) = (command.as_json() && !out::printed(), &result)
        && let Some(object) = error_json::of_failure(failure)
    {
        say!("{object}");
    }
    let unwritten = out::finish();
    if let Some(error) = &unwritten {
        complain!("error: cannot write to standard output: {error}");
    }
    match result {
        Ok(()) if unwritten.is_none() => ExitCode::SUCCESS,
        Ok(()) => ExitCode::from(1),
        Err(Failure::Failed(message)) => {
            if let Some(message) = message {
                complain!("error: {message}");
            }
            ExitCode::from(1)
        }
        Err(Failure::Input(report)) => {
            complain!("{report:?}");
            ExitCode::from(2)
        }
    }
}

/// The faces of CAD files, noted as inputs.
struct Faces;

impl job_file::FaceReader for Faces {
    fn surface(
        &self,
        face: &job_file::Face,
    ) -> std::result::Result<job_file::FaceSurface, job_file::FaceError> {
        output_file::note_input(&face.path);
        part::Faces.surface(face)
    }

    fn region(&self, job: &Job) -> std::result::Result<job_file::FaceRegion, job_file::FaceError> {
        if let Some(part) = job.origin.part() {
            output_file::note_input(&part.path);
        }
        part::Faces.region(job)
    }
}

/// Reads a job, which may be one face of a file (`FILE#FACE`), and notes the file as an input.
fn read_job(path: &Path, profile: Option<&MachineProfile>) -> Result<Job> {
    output_file::note_input(&job_file::file_of(path));
    Ok(job_file::load_on(path, &Faces, profile)?)
}

/// Reads a machine's profile, if one is given, and notes it as an input.
fn read_profile(path: Option<&PathBuf>) -> Result<Option<MachineProfile>> {
    let Some(path) = path else { return Ok(None) };
    output_file::note_input(path);
    Ok(Some(job_file::load_profile(path)?))
}

/// Reads a job, chooses its direction if `along = "auto"`, and prepares it.
fn load(path: &Path) -> Result<(Job, Prepared)> {
    settled(read_job(path, None)?)
}

/// Reads and prepares a job as [`load`] does, without the words of its links.
#[cfg(feature = "developer")]
fn load_without_links(path: &Path) -> Result<(Job, Prepared)> {
    chosen(read_job(path, None)?)
}

/// Chooses direction and start of a job as [`chosen`] does, and gives it the words of its links.
fn settled(job: Job) -> Result<(Job, Prepared)> {
    let (job, mut prepared) = chosen(job)?;
    add_links(&job, &mut prepared)?;
    Ok((job, prepared))
}

/// Chooses the direction of a job if `along = "auto"`, the start if `start = "auto"`, and prepares it.
fn chosen(job: Job) -> Result<(Job, Prepared)> {
    if job.origin.has_to_choose() {
        let bar = spinner(match job.origin.along_choice() {
            AlongChoice::Auto => "running along u and along v",
            _ => "running from the edge and from the middle",
        });
        let settled = direction::choose(job);
        bar.finish_and_clear();
        Ok(settled?)
    } else {
        Ok(direction::choose(job)?)
    }
}

/// Refuses passes of a region, which only the core makes. `who`: what works on whole surfaces.
fn whole_surface(job: &Job, who: &str) -> Result<()> {
    if job.region.is_none() {
        return Ok(());
    }
    let whole = "for the whole surface, without regard to the part: cargo sim import FILE --face N --untrimmed; or machine this job with cargo sim run";
    let (key, has, remedy) = if job.origin.part().is_some() {
        (
            "part",
            "a face of a part, of which the tool reaches a region",
            whole,
        )
    } else if job.origin.reach().is_some() {
        ("surface.face", "a trimmed face", whole)
    } else {
        (
            "region",
            "a section [region]",
            "remove the section [region], or machine this job with cargo sim run",
        )
    };
    let what = format!("{who} works on whole surfaces only, and this job has {has}");
    Err(job.origin.error(key, what, remedy).into())
}

/// A warning of the axis limits that a job sets and that the other approaches do not keep.
fn unheld_limits(job: &Job) -> Option<String> {
    let machine = &job.machine;
    let keys = [
        ("velocity_max_mm_s", machine.has_limits()),
        ("acceleration_max_mm_s2", machine.has_limits()),
        ("jerk_max_mm_s3", machine.has_limits()),
        ("travel_mm", machine.travel_mm.is_some()),
    ];
    let given: Vec<_> = keys
        .into_iter()
        .filter_map(|(key, given)| given.then_some(key))
        .collect();
    (!given.is_empty()).then(|| {
        format!(
            "{} not kept by this approach: it runs at the constant feed of the paper",
            given.join(", ")
        )
    })
}

fn warn_of_limits(job: &Job) {
    if let Some(limits) = unheld_limits(job) {
        complain!("warning: {limits}");
    }
}

/// A trace that a command was asked for.
#[derive(Clone, Copy)]
struct WantedTrace<'a> {
    path: &'a Path,
    /// Overwrites an existing file.
    force: bool,
}

impl<'a> WantedTrace<'a> {
    fn new(path: Option<&'a PathBuf>, force: bool) -> Option<Self> {
        path.map(|path| Self { path, force })
    }

    /// Begins the file.
    fn begin(self, job: &Job) -> Result<(::verify::trace::Trace, OutputFile)> {
        let output = OutputFile::begin(self.path, self.force)?;
        let trace = ::verify::trace::Trace::new(output.file()?, job.machine.period_us)
            .map_err(|error| cannot_write(self.path, &error))?;
        Ok((trace, output))
    }
}

/// Begins the trace, if one is wanted.
fn begun(
    wanted: Option<WantedTrace<'_>>,
    job: &Job,
) -> Result<(Option<::verify::trace::Trace>, Option<OutputFile>)> {
    Ok(wanted.map(|wanted| wanted.begin(job)).transpose()?.unzip())
}

/// Gives a trace its name, after its last row: `written` is what came of writing it.
fn completed(
    written: std::io::Result<()>,
    trace: Option<::verify::trace::Trace>,
    output: Option<OutputFile>,
    wanted: Option<WantedTrace<'_>>,
) -> Result<()> {
    let path = wanted.map_or(Path::new(""), |wanted| wanted.path);
    written
        .and_then(|()| trace.map_or(Ok(()), ::verify::trace::Trace::finish))
        .map_err(|error| cannot_write(path, &error))?;
    output.map_or(Ok(()), OutputFile::finish)
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    use std::io::ErrorKind;
    let remedy = match error.kind() {
        ErrorKind::IsADirectory => "that is a folder: give a file in it",
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => "that is a file: give a folder",
        ErrorKind::NotFound => "create the folder first, or give a file in an existing one",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose a folder that you may write to"
        }
        ErrorKind::StorageFull => "free space on the disk",
        _ => "give a file in an existing folder",
    };
    Failure::input(format!("cannot write {}: {error}", path.display()), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    /// Every command has an example that the command line understands; the jobs in it exist.
    #[test]
    fn every_command_has_an_example_that_parses() {
        let jobs = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for command in Cli::command().get_subcommands() {
            let about = command
                .get_long_about()
                .or(command.get_about())
                .unwrap()
                .to_string();
            let examples: Vec<_> = about
                .lines()
                .filter_map(|line| line.trim().strip_prefix("Example: "))
                .collect();
            assert!(!examples.is_empty(), "{} has no example", command.get_name());
            for example in examples {
                // The rest is shell syntax.
                let words = example
                    .split(['>', '#'])
                    .next()
                    .unwrap()
                    .split_whitespace()
                    .skip(1);
                let words: Vec<_> = words.collect();
                assert_eq!(words[..2], ["sim", command.get_name()], "{example}");
                if let Err(error) = Cli::try_parse_from(&words) {
                    panic!("{example}: {error}");
                }
                for job in words.iter().filter(|word| word.starts_with("jobs/")) {
                    assert!(jobs.join(job).exists(), "{example}");
                }
            }
        }
    }

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
