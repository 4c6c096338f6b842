//! One script of operator commands gives the same samples on the core in this process, on the board's logic over a line, and on the firmware
//! in QEMU. Needs `qemu-system-arm`; builds the firmware.

use std::io::{self, Read, Write};

use controller::in_process::Board;
use interp_core::State;
use job::AxisLimits;
use job::Job;
use machine::Machine;
use machine::prepare::{Prepared, prepare};
use machine::remote::operate::{self, Setup};
use machine::remote::qemu::Qemu;
use machine::remote::script::{Schedule, play as play_there};
use machine::remote::{Session, Stream, drive};
use machine::script::{Played, Script, play};
use protocol::message::Configuration;

use crate::images;

/// A hold and a resume on the path, commands that the state does not allow, an abort, a second run, and an abort while held.
const SCRIPT: &str = "tick 300: hold\ntick 301: hold\ntick 340: resume\ntick 700: resume\ntick 2500: abort\ntick 2510: hold\ntick 2600: start\n\
    tick 2999: hold\ntick 3000: resume\ntick 9000: hold\ntick 9100: abort\n";
/// A second hold one period after the resume; the run stays held.
const HELD: &str = "tick 20: hold\ntick 50: resume\ntick 51: hold\n";

/// For a machine with limits, all commands in all phases: during the approach, on passes, on links, during deceleration; overrides from 0 to
/// 200 %; an abort on the surface and a start from there; a stop at the end.
const WITHIN_LIMITS: &str = "tick 40: hold\ntick 200: resume\ntick 900: override 200\ntick 1300: hold\ntick 1310: override 35\n\
    tick 1500: resume\ntick 2200: override 0\ntick 2600: override 120\ntick 3000: hold\ntick 3003: resume\ntick 3400: abort\n\
    tick 3600: start\ntick 3700: override 100\ntick 6000: hold\ntick 6400: stop\n";

/// Pauses on a pass, in its way up, taken back while the tool slows down, and stopped above the surface by the end of another one; the run finishes.
const PAUSED: &str = "tick 1300: pause\ntick 4000: resume\ntick 4700: pause\ntick 4703: resume\ntick 5400: override 60\ntick 5600: pause\n\
    tick 5800: hold\ntick 6100: resume\ntick 9000: override 100\ntick 9001: resume\n";

fn torus_file() -> Job {
    let path = format!("{}/../jobs/torus.toml", env!("CARGO_MANIFEST_DIR"));
    job_file::load(path.as_ref()).unwrap()
}

fn torus() -> Prepared {
    prepare(&torus_file()).unwrap()
}

fn torus_within_limits() -> Prepared {
    let mut job = torus_file();
    job.machine.limits = Some(AxisLimits {
        velocity_mm_s: [60.0, 60.0, 40.0],
        ..AxisLimits::DEFAULT
    });
    prepare(&job).unwrap()
}

fn here(job: &Prepared, script: &Script) -> (Played, Schedule, Vec<[i32; 3]>) {
    let (mut ends, mut path) = (Vec::new(), Vec::new());
    let mut machine = Machine::load(job).unwrap();
    let played = play(
        &mut machine,
        script,
        |sample, _, moves| path.extend(moves.then_some(sample.cl_nm)),
        |period| ends.push(period),
    );
    (played, Schedule::of(&played, ends), path)
}

/// The board's logic behind a line; its periods pass while the host reads.
struct Line {
    board: Box<Board>,
    waiting: Vec<u8>,
}

impl Stream for Line {}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        for _ in 0..2000 {
            self.board.tick();
        }
        self.waiting.extend(self.board.take_sent());
        if self.waiting.is_empty() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        let count = self.waiting.len().min(buffer.len());
        buffer[..count].copy_from_slice(&self.waiting[..count]);
        self.waiting.drain(..count);
        Ok(count)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.board.receive(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Runs a script there and here; returns the periods missed there.
fn same(session: &mut Session, job: &Prepared, text: &str, state: State) -> u32 {
    let script = Script::parse("script", text).unwrap();
    let (played, schedule, path) = here(job, &script);
    assert_eq!(played.state, state);
    assert!(path.len() > 20);
    let home_nm = job.header.axes.map_or([0; 3], |axes| axes.home_nm);
    let setup = Setup::homed(Configuration::DEFAULT, home_nm);
    operate::make_ready(session, &setup).unwrap();
    drive::upload(session, job, |_| {}).unwrap();
    let status = play_there(session, &script, &schedule).unwrap();
    assert_eq!(
        (status.digest, status.samples, status.state),
        (played.digest, played.samples, played.state)
    );
    status.deadline_misses
}

#[test]
fn a_run_held_and_resumed_is_the_run_without() {
    let job = torus();
    let (plain, _, whole) = here(&job, &Script::default());
    let text = "tick 300: hold\ntick 340: resume\ntick 341: hold\ntick 600: resume\n";
    let (paused, schedule, path) = here(&job, &Script::parse("script", text).unwrap());
    assert_eq!((plain.state, paused.state), (State::Finished, State::Finished));
    assert_eq!(path, whole);
    assert_eq!((paused.digest, paused.samples), (plain.digest, plain.samples));
    assert_eq!(paused.periods - plain.periods, 40 + 259);
    assert_eq!(schedule.ends, [paused.periods - 1]);
    // Digest and number of samples are those of the last run.
    let (again, schedule, _) = here(&job, &Script::parse("script", SCRIPT).unwrap());
    assert_eq!((again.state, again.samples), (State::Ready, 6399));
    assert_eq!(schedule.ends, [2500, 9100]);
}

/// Times at which a run comes to the safe height.
fn rises(job: &Prepared, script: &str) -> usize {
    let (.., path) = here(job, &Script::parse("script", script).unwrap());
    let safe_z_nm = job.header.axes.unwrap().safe_z_nm;
    path.windows(2)
        .filter(|two| two[0][2] < safe_z_nm && two[1][2] >= safe_z_nm)
        .count()
}

/// The script's pauses do leave the surface, twice.
#[test]
fn the_pauses_of_the_script_lift_the_tool() {
    let job = torus_within_limits();
    assert_eq!(rises(&job, PAUSED), rises(&job, "") + 2);
}

/// Runs the scripts one after the other on one board; returns the periods missed in each.
fn all_the_same(session: &mut Session) -> [u32; 5] {
    [
        same(session, &torus_within_limits(), PAUSED, State::Finished),
        same(session, &torus(), SCRIPT, State::Ready),
        same(session, &torus_within_limits(), WITHIN_LIMITS, State::Ready),
        same(session, &torus_within_limits(), "", State::Finished),
        same(session, &torus(), HELD, State::Held),
    ]
}

#[test]
fn a_script_does_the_same_behind_a_line() {
    let board = Line {
        board: Box::new(Board::new()),
        waiting: Vec::new(),
    };
    assert_eq!(
        all_the_same(&mut Session::open(Box::new(board), 1).unwrap()),
        [0; 5]
    );
}

#[test]
fn a_script_does_the_same_in_qemu() {
    let (_qemu, stream) = Qemu::start(images::for_qemu()).unwrap();
    assert_eq!(all_the_same(&mut Session::open(stream, 1).unwrap()), [0; 5]);
}
