//! `run`: loads a job into the firmware, runs it there, and compares the samples with those of the simulation.

mod compare;
mod connect;
mod refusals;

use std::path::{Path, PathBuf};

use clap::Args;
use interp_core::FaultKind;
use protocol::message::{JobName, Request};
use serde_json::{Value, json};

use super::flash::board_parser;
use super::home::{self, PositionNm};
use super::operate::sentence;
use super::out::say;
use super::outcome::Outcome;
use super::resume;
use super::simulate::{WantedReport, remarks, report, surveyed, timed};
use super::{Failure, Result, error_json, output_file, progress, read_profile, scripted};
use approach::Kind;
use compare::{by_digest, by_sample};
pub(super) use connect::open_port;
use connect::{Connected, connect, models_failure, with_trouble};
use inspect::FaultAt;
use inspect::comparison::{BoardRun, Reference};
use job::units::S_PER_MIN;
use job::{HeartbeatAction, Job, MachineProfile};
use machine::prepare::{self, Prepared};
use machine::profile;
use machine::remote::operate::{self, Setup};
use machine::remote::session::LineLosses;
use machine::remote::{Session, drive};
use machine::travel;
use part_program::{Stop, stops};

/// Runs a job on the firmware and compares every sample with the simulation: in QEMU, on a board, or with a board's image executed on models of
/// its chip. While a board runs, type operator commands and Enter: hold, pause, resume, stop, abort, override 50, status. A run with operator commands
/// is not compared.
///
/// Example: cargo sim run jobs/freeform.toml --qemu
/// Example: cargo sim run jobs/plate_machine.toml --qemu --script jobs/operator.txt
/// Example: cargo sim run jobs/plate_machine.toml --chip skr-pro
/// Example: cargo sim run jobs/plate_machine.toml --qemu --machine machine.toml
/// Example: cargo sim run jobs/plate_machine.toml --port /dev/ttyUSB0 --home 40,30,40
/// Example: cargo sim run part.toml --port /dev/ttyUSB0 --work 1
/// Example: cargo sim run part.toml --port /dev/ttyUSB0 --work 1 --resume
/// Example: cargo sim run part.toml --port /dev/ttyUSB0 --work 1 --store left
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Job file (TOML).
    job: PathBuf,
    #[command(flatten)]
    target: Target,
    /// Machine profile (TOML). Default with --port: the profile that the board keeps; a board with another one than this refuses the run. A simulated board
    /// keeps this one.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Firmware image for QEMU. Default: built from the sources.
    #[arg(long, value_name = "ELF", requires = "qemu")]
    firmware: Option<PathBuf>,
    /// With --chip: as fast as possible instead of in real time. Refused for a job with `host_gone = "hold"`.
    #[arg(long, requires = "chip")]
    fast: bool,
    /// Writes every sample of the board as a row of this CSV file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Writes a report page into this folder: 3D view, charts, figures.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Overwrites existing files of --trace and --report.
    #[arg(long)]
    force: bool,
    /// Position of the axes, mm: declared as home before the run, and the home of a job without `home_mm`. Default in QEMU and on
    /// models of a chip, which have no axes: the job's home.
    #[arg(long, value_name = "X,Y,Z", value_parser = home::position, allow_hyphen_values = true)]
    home: Option<PositionNm>,
    /// Places the job's origin at this work offset of the board (operate touch, zero). Default: the job's coordinates are the machine's.
    #[arg(long, value_name = "N", requires = "port", conflicts_with = "origin", value_parser = super::axes::work_number())]
    work: Option<u8>,
    #[command(flatten)]
    placed: home::Placed,
    /// Goes on with the run of this job that a power cut, a fault or an abort has ended, after what the board has journalled as complete. The axes have to be homed.
    #[arg(long, requires = "port")]
    resume: bool,
    /// Stores the job on the board by this name, and does not run it: `operate start NAME` or the start button does. A job without `home_mm` then begins where the axes stand.
    #[arg(long, value_name = "NAME", requires = "port", value_parser = super::stored::name, conflicts_with_all = ["resume", "report", "trace", "script"])]
    store: Option<JobName>,
    /// Applies the operator commands in this file, in lockstep: lines `tick N: hold`, or pause, resume, stop, abort, start, override P.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "report", "trace"])]
    script: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Target {
    /// Runs in QEMU, which the command starts and stops.
    #[arg(long)]
    qemu: bool,
    /// Executes the image of this board, unchanged, on models of its chip, in real time (requires Debian's libunicorn2).
    #[arg(long, value_name = "BOARD", value_parser = board_parser())]
    chip: Option<String>,
    /// Runs on the board at this serial port.
    #[arg(long, value_name = "DEV")]
    port: Option<String>,
}

/// Position to declare before the first run: that of `--home`; without axes (in QEMU, on models of a chip), by default the start of the job.
fn declared(arguments: &Arguments, prepared: &Prepared, has_run: bool) -> Option<PositionNm> {
    if has_run {
        return None;
    }
    let simulated = arguments.target.port.is_none().then(|| home::of(prepared));
    arguments.home.or(simulated)
}

/// Configures the board, switches its drives on, and declares home if the position is known.
fn make_ready(
    arguments: &Arguments,
    (job, prepared): (&Job, &Prepared),
    has_run: bool,
    session: &mut Session,
) -> Result<()> {
    let status = session.status()?;
    if let (true, Some(port)) = (status.state.is_under_way(), &arguments.target.port) {
        return Err(Failure::Failed(Some(format!(
            "a run is under way on the board: {}\n  help: follow it with cargo sim operate --port {port} attach, or end it there with stop",
            sentence(&status)
        ))));
    }
    let setup = Setup {
        configuration: prepare::configuration(&job.machine),
        home_nm: declared(arguments, prepared, has_run).map(|position| position.0),
    };
    Ok(operate::make_ready(session, &setup)?)
}

/// Checks that the period of the board equals that of the job.
fn check_period(job: &Job, session: &Session) -> Result<()> {
    let period_us = session.capabilities().description.period_us;
    if f64::from(period_us) == job.machine.period_us {
        return Ok(());
    }
    let what = format!(
        "the job requires a period of {} us, the period of the board is {period_us} us",
        job.machine.period_us
    );
    Err(job
        .origin
        .error(
            "machine.period_us",
            what,
            "set period_us to that of the board, or build the firmware for another period",
        )
        .into())
}

/// A machine, as a job needs it before it is computed.
struct Bench {
    /// The line to a board.
    connected: Option<Connected>,
    /// A face has been run: the board knows where the axes stand.
    has_run: bool,
    /// Of `--machine`, or the one that the board keeps.
    profile: Option<MachineProfile>,
    /// The origin of the job, in machine coordinates.
    origin: Option<PositionNm>,
    /// Where the axes stand: declared by `--home`, or known to the board.
    stands: Option<PositionNm>,
}

fn bench(arguments: &Arguments) -> Result<Bench> {
    let given = read_profile(arguments.machine.as_ref())?;
    let mut bench = Bench {
        connected: None,
        has_run: false,
        profile: given,
        origin: arguments.placed.origin,
        stands: arguments.home,
    };
    if arguments.target.port.is_none() {
        return Ok(bench);
    }
    let (peer, mut session) = connect(arguments)?;
    match &given {
        Some(given) => agree(arguments, given, &mut session)?,
        None => bench.profile = session.profile()?.as_ref().map(profile::of_board),
    }
    if bench.stands.is_none() && session.status()?.safety.homed {
        bench.stands = Some(PositionNm(session.motion()?.at_nm));
    }
    if let Some(number) = arguments.work {
        let origin = session.offsets()?.origin_nm(usize::from(number) - 1);
        bench.origin = origin.map(PositionNm);
    }
    bench.connected = Some((peer, session));
    Ok(bench)
}

/// Makes sure that the board keeps the profile that is given.
fn agree(arguments: &Arguments, given: &MachineProfile, session: &mut Session) -> Result<()> {
    let what = match session.status()?.profile {
        kept if kept == profile::for_board(given).digest() => return Ok(()),
        0 => "the board keeps no machine profile",
        _ => "the board keeps another machine profile than the one given",
    };
    let port = arguments.target.port.as_deref().unwrap_or("DEV");
    let file = arguments.machine.as_deref().unwrap_or(Path::new("machine.toml"));
    Err(Failure::Failed(Some(format!(
        "{what}\n  help: write it: cargo sim settings --port {port} --machine {}; or omit --machine: the board's own is then used",
        file.display()
    ))))
}

/// Runs the job; of a job of many faces one after the other on the same board, which comes home in between, until one fails.
pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let jobs = job_file::jobs_of(&arguments.job)?;
    let several = jobs.len() > 1;
    let is_for_one = arguments.trace.is_some()
        || arguments.script.is_some()
        || arguments.resume
        || arguments.store.is_some();
    if several && is_for_one {
        return Err(Failure::input(
            format!(
                "the job has {} faces, --trace, --script, --resume and --store are for one",
                jobs.len()
            ),
            format!("name the face: {}", jobs[0].display()),
        ));
    }
    let mut bench = bench(arguments)?;
    let (profile, origin, stands) = (bench.profile, bench.origin, bench.stands);
    let stops = stops(&jobs, |path| {
        home::load(path, profile.as_ref(), origin, stands).ok()
    })?;
    let (mut values, mut end) = run_all(&jobs, &stops, |path, stop| {
        run_job(arguments, (path, stop), several, &mut bench)
    });
    if let Some((peer, _)) = &mut bench.connected {
        end = match end {
            Ok(()) => passed_unless(models_failure(peer, arguments.json)),
            Err(failure) => Err(with_trouble(failure, peer)),
        };
    }
    if several {
        print_all(arguments, &jobs, &values, end.is_ok());
    } else if let (true, Some(value)) = (arguments.json, values.pop().filter(|value| !value.is_null())) {
        say!("{value}");
    }
    end
}

/// Fails with this failure, if there is one.
fn passed_unless(failure: Option<String>) -> Result<()> {
    failure.map_or(Ok(()), |failure| Err(Failure::Failed(Some(failure))))
}

/// Runs faces one after the other until one fails. Returns what came of those that ran, and the end; of several faces, a refused one has an object with
/// its error.
fn run_all(
    jobs: &[PathBuf],
    stops: &[Stop],
    mut run: impl FnMut(&Path, Stop) -> Result<Ran>,
) -> (Vec<Value>, Result<()>) {
    let mut values = Vec::new();
    for (path, stop) in jobs.iter().zip(stops) {
        let end = match run(path, *stop) {
            Ok(ran) => {
                values.push(ran.value);
                passed_unless(ran.failure)
            }
            Err(refused) => {
                if jobs.len() > 1 {
                    let mut value = error_json::of_failure(&refused).unwrap_or_default();
                    value["job"] = path.display().to_string().into();
                    values.push(value);
                }
                Err(refused)
            }
        };
        if end.is_err() {
            return (values, end);
        }
    }
    (values, Ok(()))
}

/// All faces together.
fn print_all(arguments: &Arguments, jobs: &[PathBuf], values: &[Value], passed: bool) {
    if arguments.json {
        say!("{}", json!({ "jobs": values, "passed": passed }));
        return;
    }
    let sum = |key: &str| values.iter().filter_map(|value| value[key].as_f64()).sum::<f64>();
    say!(
        "{} of {} faces ran, {:.2} min, {} samples compared",
        values.iter().filter(|value| value["error"].is_null()).count(),
        jobs.len(),
        sum("machining_time_s") / S_PER_MIN,
        sum("compared_samples")
    );
}

/// What came of a job.
struct Ran {
    /// Null for a script, which prints for itself.
    value: Value,
    failure: Option<String>,
}

fn run_job(
    arguments: &Arguments,
    (path, stop): (&Path, Stop),
    several: bool,
    bench: &mut Bench,
) -> Result<Ran> {
    let (mut job, mut prepared) = home::load(path, bench.profile.as_ref(), bench.origin, bench.stands)?;
    stop.apply(&mut job, &mut prepared);
    if let (true, Some((_, session))) = (arguments.resume, &mut bench.connected) {
        prepared.start = resume::start(session, &prepared)?;
    }
    travel::check(&job)?;
    if let Some(name) = &arguments.store {
        return store(arguments, path, (&job, &prepared), name, bench);
    }
    let folder = report_folder(arguments, path, several);
    let directory = wanted_outputs(arguments, &job, folder.as_deref())?;
    if let Some(script) = &arguments.script {
        return run_script(arguments, (&job, &prepared), script, bench);
    }
    let here = timed(&job, &prepared)?;
    let is_step_rate = |at: &&FaultAt| at.fault.kind == FaultKind::StepRate;
    if let Some(fault) = here.fault.as_ref().filter(is_step_rate) {
        return Err(Failure::Failed(Some(fault.sentence_of(&job))));
    }
    let (profile, origin) = (bench.profile, bench.origin);
    let session = loaded_board(arguments, (&job, &prepared), bench)?;
    order_spindle(&job, profile.as_ref(), session)?;
    let reference = Reference {
        job: &job,
        prepared: &prepared,
        run: &here,
    };
    let run = if arguments.trace.is_some() {
        by_sample(arguments, &reference, session)?
    } else {
        by_digest(arguments, &reference, session)?
    };
    let (findings, sketch) = surveyed(&job, &prepared, &here, None, directory.is_some())?;
    let failure = run.failure(&here, &job);
    let mut remarks = remarks(&here, &findings);
    if let Some(failure) = failure.as_ref().filter(|_| here.fault.is_none()) {
        remarks.failures.insert(0, failure.clone());
    }
    let page = report(&job, directory, sketch.as_ref(), &findings, &remarks)?;
    let outcome = Outcome {
        kind: Kind::Surface,
        job: &job,
        segments: prepared.patches(),
        bytes: prepared.bytes(),
        findings: &findings,
        digest: run.status.digest,
        samples_per_second: here.samples_per_second,
        fault: here.fault,
    };
    let board = session.capabilities().description.board.as_str();
    let mut value = json_of(&outcome, &run, board);
    if several {
        value["job"] = path.display().to_string().into();
    }
    if !arguments.json {
        say!("{} on {board}", path.display());
        print_begin(arguments, &prepared, origin);
        outcome.print(page.as_deref());
        print_board(arguments, &prepared, &run);
    }
    Ok(Ran { value, failure })
}

/// The folder of a face's report: of several faces one in that of the report.
fn report_folder(arguments: &Arguments, path: &Path, several: bool) -> Option<PathBuf> {
    arguments.report.as_ref().map(|folder| match several {
        true => folder.join(path.file_name().unwrap_or(path.as_os_str())),
        false => folder.clone(),
    })
}

/// Checks before the run that its files can be written, and that the target can run the job.
fn wanted_outputs<'a>(
    arguments: &Arguments,
    job: &Job,
    folder: Option<&'a Path>,
) -> Result<Option<WantedReport<'a>>> {
    if let Some(script) = &arguments.script {
        output_file::note_input(script);
    }
    if let Some(path) = &arguments.trace {
        output_file::check(path, arguments.force)?;
    }
    let directory = WantedReport::new(folder, arguments.force)?;
    if arguments.fast && job.machine.heartbeat_action == HeartbeatAction::Hold {
        return Err(Failure::input(
            "the emulated chip's time runs faster than this computer can send heartbeats, and the job has host_gone = \"hold\"",
            "omit --fast, or set host_gone = \"finish\"",
        ));
    }
    Ok(directory)
}

/// Runs the job with the operator commands of a script, in lockstep.
fn run_script(
    arguments: &Arguments,
    (job, prepared): (&Job, &Prepared),
    script: &Path,
    bench: &mut Bench,
) -> Result<Ran> {
    let scripted = scripted::play(job, prepared, script, None)?;
    let session = loaded_board(arguments, (job, prepared), bench)?;
    scripted.run(job, session, arguments.json)?;
    Ok(Ran {
        value: Value::Null,
        failure: None,
    })
}

/// The board, made ready, with the job loaded.
fn loaded_board<'b>(
    arguments: &Arguments,
    (job, prepared): (&Job, &Prepared),
    bench: &'b mut Bench,
) -> Result<&'b mut Session> {
    let has_run = std::mem::replace(&mut bench.has_run, true);
    let session = session_of(arguments, bench)?;
    check_period(job, session)?;
    make_ready(arguments, (job, prepared), has_run, session)?;
    let bar = progress(prepared.words.len() as u64, "uploading");
    drive::upload(session, prepared, |words| bar.set_position(words as u64))?;
    bar.finish_and_clear();
    Ok(session)
}

/// Where the job lies and begins, if it is not where its file says.
fn print_begin(arguments: &Arguments, prepared: &Prepared, origin: Option<PositionNm>) {
    if let (Some(number), Some(origin)) = (arguments.work, origin) {
        say!(
            "  origin       work offset {number}, at {} mm of the machine",
            origin.words()
        );
    }
    if arguments.resume {
        say!("  resumed      {}", resume::words(prepared.start));
    }
}

/// What the board and the line did, and the result of the comparison.
fn print_board(arguments: &Arguments, prepared: &Prepared, run: &BoardRun) {
    let (speed, missed) = (run.ticks_per_second.round(), run.status.deadline_misses);
    say!("  board        {speed} ticks per second, {missed} missed");
    if arguments.target.port.is_none() && arguments.home.is_none() {
        let position = home::of(prepared).words();
        say!("  home         declared at {position} mm: a simulated board has no axes");
    }
    print_line(run);
}

/// Stores the job on the board.
fn store(
    arguments: &Arguments,
    path: &Path,
    (job, prepared): (&Job, &Prepared),
    name: &JobName,
    bench: &mut Bench,
) -> Result<Ran> {
    let profile = bench.profile;
    let begins_anywhere = super::read_job(path, profile.as_ref())?.machine.home_mm.is_none();
    let session = session_of(arguments, bench)?;
    check_period(job, session)?;
    drive::upload(session, prepared, |_| {})?;
    order_spindle(job, profile.as_ref(), session)?;
    session.command(&Request::StoreJob {
        name: name.clone(),
        begins_anywhere,
    })?;
    let value = json!({ "stored": name.as_str(), "bytes": prepared.bytes() });
    if !arguments.json {
        say!(
            "{} is stored as {name}, {} bytes",
            path.display(),
            prepared.bytes()
        );
    }
    Ok(Ran { value, failure: None })
}

/// Gives the board the job's spindle and coolant, if it switches them.
fn order_spindle(job: &Job, profile: Option<&MachineProfile>, session: &mut Session) -> Result<()> {
    if job.machine.spindle.is_some() && profile.is_some_and(|profile| profile.spindle.is_some()) {
        session.command(&Request::Spindle(profile::spindle_order(job.machine.spindle)))?;
    }
    Ok(())
}

/// The session with the board: begun with the first job. A simulated board takes the profile.
fn session_of<'b>(arguments: &Arguments, bench: &'b mut Bench) -> Result<&'b mut Session> {
    match &mut bench.connected {
        Some((_, session)) => Ok(session),
        empty => {
            let (_, session) = empty.insert(connect(arguments)?);
            if let Some(profile) = &bench.profile {
                let profile = Some(profile::for_board(profile));
                session.command(&Request::SetProfile(profile))?;
            }
            Ok(session)
        }
    }
}

/// What the line did to the run, and the result of the comparison.
fn print_line(run: &BoardRun) {
    if run.losses != LineLosses::default() {
        let LineLosses { repeated, lost } = run.losses;
        say!("  line         {repeated} lost events were sent again, {lost} were not");
    }
    if run.missing > 0 && run.is_complete() {
        let missing = run.missing;
        say!(
            "  trace        {missing} samples did not come: the simulation's, which the digest proves to be the same"
        );
    }
    if run.status.safety.link_timed_out {
        say!("  host         heartbeat timeout during the run: see docs/operating.md, When the host is gone");
    }
    match (run.commanded, run.first_difference) {
        (true, _) => say!("  compared     nothing: the run had operator commands or a feed override"),
        (false, None) => compared(run, "bit for bit the same"),
        (false, Some(_)) => compared(run, "NOT the same"),
    }
}

fn compared(run: &BoardRun, verdict: &str) {
    say!(
        "  compared     {} samples with the simulation: {verdict}",
        run.compared
    );
}

/// The JSON keys of `simulate`, and those of the board.
fn json_of(outcome: &Outcome<'_>, run: &BoardRun, board: &str) -> Value {
    let mut keys = outcome.json();
    let mut put = |key: &str, value| keys.insert(key.to_owned(), value);
    let compared = if run.commanded { 0 } else { run.compared };
    put("compared_samples", json!(compared));
    put("first_difference", json!(run.first_difference));
    put("commanded", json!(run.commanded));
    put("deadline_misses", json!(run.status.deadline_misses));
    put("tick_cycles_max", json!(run.status.tick_cycles_max));
    put("ticks_per_second", json!(run.ticks_per_second));
    put("samples_lost", json!(run.status.samples_lost));
    put("events_repeated", json!(run.losses.repeated));
    put("events_lost", json!(run.losses.lost));
    put("samples_missing", json!(run.missing));
    put("board", json!(board));
    Value::Object(keys)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A later face that is refused ends the run, and keeps what came of the faces before it.
    #[test]
    fn faces_that_ran_are_kept() {
        let jobs = ["a", "b", "c"].map(PathBuf::from);
        let stops = [Stop::default(); 3];
        let mut begun = Vec::new();
        let (values, end) = run_all(&jobs, &stops, |path, _| {
            begun.push(path.to_owned());
            match path.to_str() {
                Some("a") => Ok(Ran {
                    value: json!({ "samples": 7 }),
                    failure: None,
                }),
                _ => Err(Failure::input("beyond the travel", "move it")),
            }
        });
        assert!(matches!(end, Err(Failure::Input(_))), "{end:?}");
        assert_eq!(begun, jobs[..2]);
        assert_eq!(values[0]["samples"], 7);
        assert_eq!(
            (&values[1]["job"], &values[1]["error"]["message"]),
            (&"b".into(), &"beyond the travel".into())
        );
        // The error of a single job is the command's.
        let (values, end) = run_all(&jobs[..1], &stops, |_, _| Err(Failure::Failed(None)));
        assert!(values.is_empty() && end.is_err());
    }
}
