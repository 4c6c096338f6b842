//! `run`: loads the job into the firmware, runs it there, and compares with `simulate` sample by sample.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use indicatif::ProgressBar;
use interp_core::{Fault, FaultKind, Sample, State};
use protocol::digest::Digest;
use protocol::message::{HostGone, Reason, Status};
use serde_json::{Value, json};

use super::flash::{board_of, board_parser};
use super::home::{self, PlaceNm};
use super::out::{say, to_stderr};
use super::outcome::Outcome;
use super::simulate::{Timed, machine, remarks, report, surveyed, timed};
use super::typed::{Typist, WORDS};
use super::{Failure, Result, cannot_write, progress, scripted, spinner, trace};
use crate::approach::Kind;
use crate::explain;
use crate::job_file::JobFile;
use crate::prepare::Prepared;
use crate::remote::chip::{self, Chip, ChipError};
use crate::remote::operate::{self, Operator, Setup};
use crate::remote::qemu::{self, Qemu, QemuError};
use crate::remote::{RemoteError, Session, drive, port};
use crate::survey::is_on_pass;
use crate::travel;

/// Runs a job in the firmware, in QEMU, on a board, or a board's image on models of its chip, and compares every sample with this machine's. While a board runs, type what an
/// operator wants, and Enter: hold, resume, stop, abort, override 50, status. A run that was commanded is not compared.
///
/// Example: cargo sim run jobs/freeform.toml --qemu
/// Example: cargo sim run jobs/plate_machine.toml --qemu --script jobs/operator.txt
/// Example: cargo sim run jobs/plate_machine.toml --port /dev/ttyUSB0 --home 40,30,40
/// Example: cargo sim run jobs/plate_machine.toml --chip skr-pro
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    #[command(flatten)]
    place: Place,
    /// Firmware image for QEMU; without it, the image is built.
    #[arg(long, value_name = "ELF", requires = "qemu")]
    firmware: Option<PathBuf>,
    /// With --chip, as fast as it goes instead of in real time; the job must not hold for a host that is gone.
    #[arg(long, requires = "chip")]
    fast: bool,
    /// Writes every sample that the board sent as a row of this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Writes a page with a view that turns, charts and figures into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// The axes stand here, mm: declared as home before the run, and the job's home where it has no `home_mm`. In QEMU and on models of
    /// a chip, where there are no axes, the job's home is declared.
    #[arg(long, value_name = "X,Y,Z", value_parser = home::place, allow_hyphen_values = true)]
    home: Option<PlaceNm>,
    /// Does what this file says an operator does, in lockstep: lines `tick N: hold`, or resume, stop, abort, start, override P.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "report", "trace"])]
    script: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Place {
    /// In QEMU, which this command starts and ends.
    #[arg(long)]
    qemu: bool,
    /// The image for this board, unchanged, on models of its chip, in real time (wants Debian's libunicorn2).
    #[arg(long, value_name = "BOARD", value_parser = board_parser())]
    chip: Option<String>,
    /// On a board behind this serial port.
    #[arg(long, value_name = "DEV")]
    port: Option<String>,
}

/// What the board did.
struct Ran {
    status: Status,
    compared: u64,
    first_difference: Option<u64>,
    /// An operator commanded it, so that it is no run of this machine's.
    commanded: bool,
    ticks_per_second: f64,
}

impl From<RemoteError> for Failure {
    fn from(error: RemoteError) -> Self {
        if let Some(refusal) = unsafe_to(&error).or_else(|| home::elsewhere(&error)) {
            return Self::Failed(Some(refusal));
        }
        let code = match &error {
            RemoteError::Refused {
                reason: Reason::Job { fault, .. },
                ..
            } => fault.code.to_string(),
            RemoteError::Refused { reason, .. } => format!("R{}", reason.code()),
            RemoteError::Version(_) => "R3".to_owned(),
            _ => return Self::Failed(Some(error.to_string())),
        };
        Self::Failed(Some(format!("{error}\n  help: cargo sim explain {code}")))
    }
}

/// A refusal for the sake of safety, with what it means and what to do.
fn unsafe_to(error: &RemoteError) -> Option<String> {
    let RemoteError::Refused {
        request,
        reason: Reason::Unsafe { fault },
    } = error
    else {
        return None;
    };
    let (what, remedy) = explain::fault(Fault::new(fault.kind()?, fault.value));
    let code = fault.code;
    Some(format!(
        "the board refused {request}: {what}\n  help: {remedy}\n        cargo sim explain {code}"
    ))
}

impl From<QemuError> for Failure {
    fn from(error: QemuError) -> Self {
        match error {
            QemuError::Missing => {
                Self::input(error.to_string(), "install it, or run the job with `simulate`")
            }
            QemuError::Firmware(_) | QemuError::Plugin(_) | QemuError::Start(_) => {
                Self::Failed(Some(error.to_string()))
            }
        }
    }
}

impl From<ChipError> for Failure {
    fn from(error: ChipError) -> Self {
        Self::Failed(Some(error.to_string()))
    }
}

/// A number for a session: they have to differ, no more than that.
fn session_number() -> u32 {
    std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .map_or(1, |now| now.subsec_nanos() ^ std::process::id().rotate_left(16))
}

/// Opens a session with the board behind this serial port.
pub(super) fn open_port(name: &str) -> Result<Session> {
    let stream = port::open(name).map_err(|error| {
        let why = match error {
            RemoteError::Line(cause) => format!("cannot open it as a serial port: {cause}"),
            other => other.to_string(),
        };
        Failure::input(
            format!("{name}: {why}"),
            "name the board's serial port, such as /dev/ttyUSB0",
        )
    })?;
    Ok(Session::open(stream, session_number())?)
}

/// What is behind the line, if this command has started it, and ends it.
enum Behind {
    Board,
    Qemu(#[expect(dead_code, reason = "ended when it is dropped")] Qemu),
    Chip(Chip),
}

/// Starts a board's image on models of its chip.
fn connect_chip(name: &str, fast: bool) -> Result<(Behind, Session)> {
    let bar = spinner("building the firmware, and what executes it");
    let built = chip::image(board_of(name)).and_then(|image| Ok((chip::program()?, image)));
    bar.finish_and_clear();
    let (program, image) = built?;
    let (chip, stream) = Chip::start(&program, &image, fast)?;
    Ok((Behind::Chip(chip), Session::open(stream, session_number())?))
}

/// What the models of a chip complained about, or lost.
fn models_complaint(behind: &mut Behind, json: bool) -> Option<String> {
    let Behind::Chip(chip) = behind else { return None };
    let Some(said) = chip.end() else {
        return Some("the models of the chip ended without a word".to_owned());
    };
    if !json {
        say!(
            "  models       {} complaints, {} bytes lost, a byte waited {} cycles at most",
            said.complaints.len(),
            said.bytes_lost,
            said.byte_wait_max_cycles
        );
    }
    if let Some(first) = said.complaints.first() {
        return Some(format!("the models of the chip complain: {first}"));
    }
    (said.bytes_lost > 0).then(|| format!("{} bytes were lost on their way into the chip", said.bytes_lost))
}

/// Opens the line, and keeps what is behind it alive.
fn connect(arguments: &Arguments) -> Result<(Behind, Session)> {
    if let Some(name) = &arguments.place.port {
        return Ok((Behind::Board, open_port(name)?));
    }
    if let Some(name) = &arguments.place.chip {
        return connect_chip(name, arguments.fast);
    }
    let image = match &arguments.firmware {
        Some(image) if !image.exists() => {
            return Err(Failure::input(
                format!("there is no {}", image.display()),
                "build it with `cargo fw-qemu`",
            ));
        }
        Some(image) => image.clone(),
        None => {
            let bar = spinner("building the firmware");
            let image = qemu::firmware();
            bar.finish_and_clear();
            image?
        }
    };
    let (qemu, stream) = Qemu::start(&image)?;
    Ok((Behind::Qemu(qemu), Session::open(stream, session_number())?))
}

/// Where the axes are declared to stand: where they were said to, or in QEMU, which has none, where the job begins.
fn declared(arguments: &Arguments, prepared: &Prepared) -> Option<PlaceNm> {
    let simulated = arguments.place.port.is_none().then(|| home::of(prepared));
    arguments.home.or(simulated)
}

/// Configures the board, switches its drives on, and declares home where that is known here.
fn make_ready(
    arguments: &Arguments,
    job: &JobFile,
    prepared: &Prepared,
    session: &mut Session,
) -> Result<()> {
    let setup = Setup {
        configuration: job.machine.configuration(),
        home_nm: declared(arguments, prepared).map(|place| place.0),
    };
    Ok(operate::make_ready(session, &setup)?)
}

/// The board's timer has to tick as the job wants it.
fn check_period(job: &JobFile, session: &Session) -> Result<()> {
    let period_us = session.capabilities().description.period_us;
    if f64::from(period_us) == job.machine.period_us {
        return Ok(());
    }
    let what = format!(
        "the job wants a period of {} us, the board's is {period_us} us",
        job.machine.period_us
    );
    Err(job
        .origin
        .error(
            "machine.period_us",
            what,
            "say period_us as the board has it, or build the firmware for the other",
        )
        .into())
}

/// Runs and compares the digest of each pass; where one differs in QEMU, finds the first sample that does.
fn by_digest(
    arguments: &Arguments,
    job: &JobFile,
    prepared: &Prepared,
    here: &Timed,
    session: &mut Session,
) -> Result<Ran> {
    let expected: Vec<_> = here
        .passes
        .iter()
        .map(|&(first_tick, samples, digest)| drive::Expected {
            first_tick,
            samples,
            digest,
        })
        .collect();
    let bar = progress(here.samples, "running");
    let start = Instant::now();
    let mut typist = typist(arguments, &bar);
    let operator = typist.as_mut().map(|typist| typist as &mut dyn Operator);
    let compared = drive::run_digests(session, &expected, arguments.place.qemu, operator, |samples| {
        bar.set_position(samples)
    })?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let mut first_difference = None;
    if let Some(pass) = compared.first_bad_pass {
        let from = expected.get(pass as usize).map_or_else(
            || expected.last().map_or(0, |last| last.first_tick + last.samples),
            |pass| pass.first_tick,
        );
        first_difference = Some(from.into());
        if arguments.place.qemu {
            let count = expected.get(pass as usize).map_or(0, |pass| pass.samples) + 1;
            let there = drive::samples_between(session, from, count)?;
            let there = &there[..there.len().min(count as usize)];
            let ours = samples_here(job, prepared, from, count)?;
            first_difference = drive::first_difference(&ours, there)
                .map(u64::from)
                .or(first_difference);
        }
    } else if !compared.commanded && compared.status.digest != here.digest {
        first_difference = Some(here.samples);
    }
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let ticks_per_second = compared.samples as f64 / seconds.max(1e-9);
    Ok(Ran {
        status: compared.status,
        compared: compared.samples,
        first_difference,
        commanded: compared.commanded,
        ticks_per_second,
    })
}

/// Who can command the run: on a board, whoever types.
fn typist(arguments: &Arguments, bar: &ProgressBar) -> Option<Typist> {
    if arguments.place.qemu {
        return None;
    }
    if !arguments.json {
        bar.suspend(|| to_stderr(format_args!("type, and Enter: {WORDS}")));
    }
    Some(Typist::new(bar.clone()))
}

fn samples_here(job: &JobFile, prepared: &Prepared, from: u32, count: u32) -> Result<Vec<Sample>> {
    let mut samples = Vec::new();
    // A fault ends the samples, which is what is compared.
    let _fault = machine(job, prepared)?.run(|sample| {
        if sample.tick >= from {
            samples.push(*sample);
        }
        samples.len() < count as usize
    });
    Ok(samples)
}

/// Runs with every sample on the line, writes them, and compares each.
fn by_sample(
    arguments: &Arguments,
    job: &JobFile,
    prepared: &Prepared,
    here: &Timed,
    session: &mut Session,
) -> Result<Ran> {
    let ours = samples_here(job, prepared, 0, u32::MAX)?;
    let mut file = trace(arguments.trace.as_ref(), job)?;
    let mut written = Ok(());
    let mut theirs = Vec::with_capacity(ours.len());
    let mut digest = Digest::new();
    let bar = progress(here.samples, "running");
    let start = Instant::now();
    let mut typist = typist(arguments, &bar);
    let operator = typist.as_mut().map(|typist| typist as &mut dyn Operator);
    let (status, commanded) = drive::run_samples(session, arguments.place.qemu, operator, |sample| {
        digest.sample(sample);
        if let (Some(file), Ok(())) = (&mut file, &written) {
            let parameters = is_on_pass(sample).then(|| prepared.parameters(sample.path, sample.side));
            written = file.write(sample, parameters);
        }
        theirs.push(*sample);
        if sample.tick % 4096 == 0 {
            bar.set_position(sample.tick.into());
        }
    })?;
    let seconds = start.elapsed().as_secs_f64();
    bar.finish_and_clear();
    let name = arguments.trace.clone().unwrap_or_default();
    written
        .and_then(|()| file.map_or(Ok(()), crate::trace::Trace::finish))
        .map_err(|error| cannot_write(&name, &error))?;
    let difference = drive::first_difference(&ours, &theirs)
        .filter(|_| !commanded)
        .map(u64::from);
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    let ticks_per_second = theirs.len() as f64 / seconds.max(1e-9);
    let wrong_digest = (status.digest != digest.value()).then_some(here.samples);
    Ok(Ran {
        status,
        compared: theirs.len().min(ours.len()) as u64,
        first_difference: difference.or(wrong_digest),
        commanded,
        ticks_per_second,
    })
}

/// The inputs that stopped the run, or kept it from beginning, in a sentence.
fn stopped_from_outside(status: &Status) -> Option<String> {
    let fault = status.fault?;
    let kind = fault.kind()?;
    if !matches!(
        kind,
        FaultKind::EmergencyStop | FaultKind::LimitSwitch | FaultKind::DriveFault
    ) {
        return None;
    }
    let (what, remedy) = explain::fault(Fault::new(kind, fault.value));
    let Status { tick, pass, .. } = status;
    Some(format!(
        "the board stopped the run at tick {tick}, pass {pass}: {what}\n  help: {remedy}"
    ))
}

/// What is wrong with the board's run, if anything is.
fn complaint(ran: &Ran, here: &Timed, job: &JobFile) -> Option<String> {
    let status = &ran.status;
    if let Some(stopped) = stopped_from_outside(status) {
        return Some(stopped);
    }
    if status.deadline_misses > 0 {
        return Some(format!(
            "{} ticks of the sample timer were missed",
            status.deadline_misses
        ));
    }
    if let Some(tick) = ran.first_difference {
        return Some(format!(
            "the board differs from this machine, first at tick {tick}"
        ));
    }
    if status.samples_lost > 0 {
        return Some(format!("{} samples were lost on the line", status.samples_lost));
    }
    if ran.commanded {
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
            "the board ended {}, this machine {}",
            status.state.name(),
            expected.name()
        ));
    }
    here.fault.as_ref().map(|fault| fault.sentence_of(job))
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let (job, prepared) = home::load(&arguments.job, arguments.home)?;
    travel::check(&job)?;
    if arguments.fast && job.machine.host_gone == HostGone::Hold {
        return Err(Failure::input(
            "the chip's time runs faster than this machine can keep its link alive, and the job says host_gone = \"hold\"",
            "leave --fast out, or say host_gone = \"finish\"",
        ));
    }
    if let Some(script) = &arguments.script {
        let scripted = scripted::play(&job, &prepared, script, None)?;
        let (_behind, mut session) = connect(arguments)?;
        check_period(&job, &session)?;
        make_ready(arguments, &job, &prepared, &mut session)?;
        drive::upload(&mut session, &prepared, |_| {})?;
        return scripted.run(&job, &mut session, arguments.json);
    }
    let here = timed(&job, &prepared)?;
    if let Some(fault) = here
        .fault
        .as_ref()
        .filter(|at| at.fault.kind == FaultKind::StepRate)
    {
        return Err(Failure::Failed(Some(fault.sentence_of(&job))));
    }
    let (mut behind, mut session) = connect(arguments)?;
    check_period(&job, &session)?;
    make_ready(arguments, &job, &prepared, &mut session)?;
    let bar = progress(prepared.words.len() as u64, "uploading");
    drive::upload(&mut session, &prepared, |words| bar.set_position(words as u64))?;
    bar.finish_and_clear();
    let ran = if arguments.trace.is_some() {
        by_sample(arguments, &job, &prepared, &here, &mut session)?
    } else {
        by_digest(arguments, &job, &prepared, &here, &mut session)?
    };
    let directory = arguments.report.as_deref();
    let (findings, sketch) = surveyed(&job, &prepared, &here, None, directory.is_some())?;
    let complaint = complaint(&ran, &here, &job);
    let mut remarks = remarks(&here, &findings);
    if let Some(complaint) = complaint.as_ref().filter(|_| here.fault.is_none()) {
        remarks.failures.insert(0, complaint.clone());
    }
    let page = report(&job, directory, sketch.as_ref(), &findings, &remarks)?;
    let outcome = Outcome {
        kind: Kind::Surface,
        job: &job,
        segments: prepared.patches(),
        bytes: prepared.bytes(),
        findings: &findings,
        digest: ran.status.digest,
        samples_per_second: here.samples_per_second,
        fault: here.fault,
    };
    let board = session.capabilities().description.board.as_str();
    if arguments.json {
        say!("{}", json_of(&outcome, &ran, board));
    } else {
        say!("{} on {board}", arguments.job.display());
        outcome.print(page.as_deref());
        let (speed, missed) = (ran.ticks_per_second.round(), ran.status.deadline_misses);
        say!("  board        {speed} ticks a second, {missed} missed");
        if arguments.place.port.is_none() && arguments.home.is_none() {
            let place = home::of(&prepared).words();
            say!("  home         declared at {place} mm: a simulated board has no axes");
        }
        if ran.status.safety.host_gone {
            say!("  host         was gone during the run: see cargo sim explain host-gone");
        }
        match (ran.commanded, ran.first_difference) {
            (true, _) => say!("  compared     nothing: the run was commanded, or its feed is overridden"),
            (false, None) => compared(&ran, "bit for bit the same"),
            (false, Some(_)) => compared(&ran, "NOT the same"),
        }
    }
    let complaint = complaint.or_else(|| models_complaint(&mut behind, arguments.json));
    complaint.map_or(Ok(()), |complaint| Err(Failure::Failed(Some(complaint))))
}

fn compared(ran: &Ran, verdict: &str) {
    say!(
        "  compared     {} samples with this machine's: {verdict}",
        ran.compared
    );
}

/// The keys of `simulate`, and those of the board.
fn json_of(outcome: &Outcome<'_>, ran: &Ran, board: &str) -> Value {
    let mut keys = outcome.json();
    let mut put = |key: &str, value| keys.insert(key.to_owned(), value);
    let compared = if ran.commanded { 0 } else { ran.compared };
    put("compared_samples", json!(compared));
    put("first_difference", json!(ran.first_difference));
    put("commanded", json!(ran.commanded));
    put("deadline_misses", json!(ran.status.deadline_misses));
    put("tick_cycles_max", json!(ran.status.tick_cycles_max));
    put("ticks_per_second", json!(ran.ticks_per_second));
    put("samples_lost", json!(ran.status.samples_lost));
    put("board", json!(board));
    Value::Object(keys)
}
