//! What an operator does in a run, from one script: on the machine in this process, on the board's logic behind a line, and on the firmware
//! in QEMU, with the same samples. Needs `qemu-system-arm`; builds the firmware.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::io::{self, Read, Write};

use controller::in_process::Board;
use host_sim::job_file::JobFile;
use host_sim::machine::Machine;
use host_sim::prepare::{Prepared, prepare};
use host_sim::remote::qemu::{self, Qemu};
use host_sim::remote::script::{Schedule, play as play_there};
use host_sim::remote::{Session, drive};
use host_sim::script::{Played, Script, play};
use interp_core::State;

/// A hold and a resume on the path, requests that the state does not allow, an abort, another run, and an abort while held.
const SCRIPT: &str = "tick 300: hold\ntick 301: hold\ntick 340: resume\ntick 700: resume\ntick 2500: abort\ntick 2510: hold\ntick 2600: start\n\
    tick 2999: hold\ntick 3000: resume\ntick 9000: hold\ntick 9100: abort\n";
/// Left held, one period after the resume.
const HELD: &str = "tick 20: hold\ntick 50: resume\ntick 51: hold\n";

fn torus() -> Prepared {
    let path = format!("{}/../jobs/torus.toml", env!("CARGO_MANIFEST_DIR"));
    prepare(&JobFile::load(path.as_ref()).unwrap()).unwrap()
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

/// The board's logic as a line: its time passes while the host reads.
struct Line {
    board: Box<Board>,
    waiting: Vec<u8>,
}

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

fn same(session: &mut Session, text: &str, state: State) {
    let (job, script) = (torus(), Script::parse("script", text).unwrap());
    let (played, schedule, _) = here(&job, &script);
    assert_eq!(played.state, state);
    drive::upload(session, &job, |_| {}).unwrap();
    let status = play_there(session, &script, &schedule).unwrap();
    assert_eq!(
        (status.digest, status.samples, status.state),
        (played.digest, played.samples, played.state)
    );
    assert_eq!(status.deadline_misses, 0);
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
    // Another run's samples do not count, those of the last do.
    let (again, schedule, _) = here(&job, &Script::parse("script", SCRIPT).unwrap());
    assert_eq!((again.state, again.samples), (State::Ready, 6399));
    assert_eq!(schedule.ends, [2500, 9100]);
}

#[test]
fn a_script_does_the_same_behind_a_line() {
    let board = Line {
        board: Box::new(Board::new()),
        waiting: Vec::new(),
    };
    let mut session = Session::open(Box::new(board), 1).unwrap();
    same(&mut session, SCRIPT, State::Ready);
    // What is held is given up before the next job is loaded.
    same(&mut session, HELD, State::Held);
}

#[test]
fn a_script_does_the_same_in_qemu() {
    let (_qemu, stream) = Qemu::start(&qemu::firmware().unwrap()).unwrap();
    let mut session = Session::open(stream, 1).unwrap();
    same(&mut session, SCRIPT, State::Ready);
    same(&mut session, HELD, State::Held);
}
