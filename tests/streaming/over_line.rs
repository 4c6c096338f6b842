//! Streamed jobs over the line to a board in this process, whose store is small. Its sampling periods pass while the host reads.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::{Arc, Mutex};

use controller::in_process::Board;
use interp_core::State;
use interp_core::job::stream::{head_words, row_words};
use machine::links::Link;
use machine::prepare::{Prepared, prepare, streamed};
use machine::remote::operate::{Setup, make_ready};
use machine::remote::session::{Event, Stream};
use machine::remote::{RemoteError, Session, drive};
use protocol::message::{Configuration, Reason, Request, Status};

use super::{CUTS, bumpy, expected, regions, turns};

/// Words of the board's store: room for five rows of the test's jobs.
const WORDS: usize = 1800;

/// The board, the ticks that pass while the host reads or sends a request, and the share of bytes that are dropped, one in this number.
#[derive(Clone, Copy, Debug)]
struct Line {
    ticks_a_read: usize,
    ticks_a_write: usize,
    drops_one_in: u64,
}

const GOOD: Line = Line {
    ticks_a_read: 40,
    ticks_a_write: 1,
    drops_one_in: 0,
};

struct Wire {
    board: Arc<Mutex<Box<Board<WORDS>>>>,
    sent: VecDeque<u8>,
    line: Line,
    random: u64,
}

impl Wire {
    /// The bytes that arrive.
    fn dropped(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut arrives = |_: &&u8| {
            self.random = self
                .random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            self.line.drops_one_in == 0 || !(self.random >> 33).is_multiple_of(self.line.drops_one_in)
        };
        bytes.iter().filter(|byte| arrives(byte)).copied().collect()
    }
}

impl Stream for Wire {}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let sent = {
            let mut board = self.board.lock().unwrap();
            (0..self.line.ticks_a_read).for_each(|_| board.tick());
            board.take_sent()
        };
        let sent = self.dropped(&sent);
        self.sent.extend(sent);
        if self.sent.is_empty() {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        self.sent.read(bytes)
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let arrived = self.dropped(bytes);
        let mut board = self.board.lock().unwrap();
        (0..self.line.ticks_a_write).for_each(|_| board.tick());
        board.receive(&arrived);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

struct Bench {
    job: Prepared,
    /// Of the first session.
    number: u32,
    board: Arc<Mutex<Box<Board<WORDS>>>>,
}

impl Bench {
    fn new((cut, machine): (&str, &str)) -> Self {
        let job = streamed(&prepare(&bumpy([6, 12], [2.5, 2.0], cut, machine)).unwrap(), 3);
        assert!(head_words(&job.header) + 5 * row_words(&job.header) <= WORDS);
        Self::of(job)
    }

    /// A region in cells, with links.
    fn of_region() -> Self {
        let mut job = prepare(&regions::in_cells(4, [3, 24], regions::with_hole(0.6))).unwrap();
        let links: Vec<Link> = (machine::links::between(&machine::links::passes(&job)).iter())
            .map(|[from, to]| Link::Across(from[2].max(to[2]) + 300_000))
            .collect();
        machine::links::add(&mut job, &links);
        let job = streamed(&job, 3);
        assert!(job.header.strips > 1 && job.header.links > 10);
        Self::of(job)
    }

    /// With turns between the rests that the window makes.
    fn with_turns() -> Self {
        let job = prepare(&turns::job([3, 24], [6.0, 2.0])).unwrap();
        Self::of(streamed(&job, 5))
    }

    fn of(job: Prepared) -> Self {
        assert!(head_words(&job.header) + job.least_rows * row_words(&job.header) <= WORDS);
        assert!(job.words.len() > 2 * WORDS);
        Self {
            job,
            number: 1,
            board: Arc::new(Mutex::new(Box::new(Board::new()))),
        }
    }

    fn session(&self, line: Line, number: u32) -> Session {
        let wire = Wire {
            board: self.board.clone(),
            sent: VecDeque::new(),
            line,
            random: u64::from(number),
        };
        Session::open(Box::new(wire), number).unwrap()
    }

    fn loaded(&self, line: Line) -> Session {
        let mut session = self.session(line, self.number);
        make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT)).unwrap();
        drive::upload(&mut session, &self.job, |_| {}).unwrap();
        session
    }

    /// Runs the job there, and compares it with the run of the whole job here.
    fn run(&self, line: Line, lockstep: bool) -> Status {
        let mut session = self.loaded(line);
        let wanted = expected(&self.job);
        let ran = drive::run_digests(&mut session, &wanted, lockstep, None, |_| {}).unwrap();
        assert_eq!(ran.status.state, State::Finished, "{:?}", ran.status);
        assert_eq!(ran.first_bad_index, None, "{ran:?}");
        assert_eq!(Some(ran.status.digest), wanted.last().map(|pass| pass.digest));
        ran.status
    }
}

/// On a free clock and in lockstep; with a host that is awake, and one that sleeps so long before each chunk that the run waits for every row.
#[test]
fn a_board_runs_a_job_that_is_larger_than_its_store() {
    let benches: [fn() -> Bench; 5] = [
        || Bench::new(CUTS[0]),
        || Bench::new(CUTS[3]),
        || Bench::new(CUTS[4]),
        Bench::of_region,
        Bench::with_turns,
    ];
    for new in benches {
        for lockstep in [false, true] {
            let bench = new();
            let status = bench.run(GOOD, lockstep);
            assert_eq!(status.stream.received as usize, bench.job.words.len());
            let sleeps = Line {
                ticks_a_write: 4000,
                ..GOOD
            };
            let status = new().run(sleeps, lockstep);
            assert!(status.stream.starved > 1000, "{:?}", status.stream);
        }
    }
}

/// A second run needs the words again, and gets them; without them the start is refused.
#[test]
fn a_second_run_begins_with_an_upload() {
    let bench = Bench::new(CUTS[3]);
    bench.run(GOOD, true);
    let mut session = bench.session(GOOD, 2);
    let refused = session.command(&Request::Start).unwrap_err();
    assert!(
        matches!(
            refused,
            RemoteError::Refused {
                reason: Reason::RowsGone,
                ..
            }
        ),
        "{refused}"
    );
    bench.run(GOOD, true);
}

/// Faces of a part on one board, of which some are streamed: with a region, with turns, as a whole.
#[test]
fn faces_one_after_the_other() {
    let small = prepare(&bumpy([3, 4], [2.5, 2.0], CUTS[4].0, CUTS[4].1)).unwrap();
    assert!(small.header.window == 0 && small.words.len() < WORDS);
    let board = Arc::new(Mutex::new(Box::new(Board::new())));
    let streamed = [Bench::of_region(), Bench::with_turns()].map(|bench| bench.job);
    let [region, turns] = &streamed;
    for (job, number) in [&small, region, turns, &small, region].into_iter().zip(1..) {
        let bench = Bench {
            number,
            job: job.clone(),
            board: board.clone(),
        };
        bench.run(GOOD, true);
    }
}

/// One byte in a hundred is dropped, both ways.
#[test]
fn dropped_bytes_change_nothing() {
    let line = Line {
        drops_one_in: 100,
        ..GOOD
    };
    for bench in [Bench::new(CUTS[4]), Bench::of_region(), Bench::with_turns()] {
        let status = bench.run(line, true);
        assert!(status.frames_bad > 100, "{}", status.frames_bad);
    }
}

/// The host goes away in the middle of the run, which then waits; another one goes on where the board received the last word.
#[test]
fn another_host_goes_on_with_the_stream() {
    let plain = [1, 3, 6].map(|away_after| (away_after, Bench::new(CUTS[4])));
    let of_region = [1, 9, 20, 31].map(|away_after| (away_after, Bench::of_region()));
    let turned = [1, 14, 30].map(|away_after| (away_after, Bench::with_turns()));
    for (away_after, bench) in plain.into_iter().chain(of_region).chain(turned) {
        let wanted = expected(&bench.job);
        let mut session = bench.loaded(GOOD);
        session.command(&Request::Start).unwrap();
        let mut passes = 0;
        while passes < away_after {
            passes += u32::from(matches!(session.event().unwrap(), Event::Pass(_)));
        }
        drop(session);
        // It runs as far as it can.
        (0..100_000).for_each(|_| bench.board.lock().unwrap().tick());
        let waits = bench.board.lock().unwrap().status();
        assert!(
            waits.state.is_under_way() && waits.stream.starved > 1000,
            "{waits:?}"
        );
        let mut session = bench.session(GOOD, 2);
        drive::resume_upload(&mut session, &bench.job).unwrap();
        let status = loop {
            if let Event::Halted(status) = session.event().unwrap() {
                break status;
            }
        };
        assert_eq!(status.state, State::Finished, "{:?}", status.fault);
        assert_eq!(Some(status.digest), wanted.last().map(|pass| pass.digest));
    }
}

/// A row that is not the host's own is refused, and the run stops with a fault where it would need it, at rest.
#[test]
fn a_bad_row_stops_the_run_before_it() {
    for is_patch_bad in [false, true] {
        let mut bench = Bench::new(CUTS[4]);
        let good = bench.job.clone();
        let row = row_words(&bench.job.header);
        let at = head_words(&bench.job.header) + 8 * row + 7;
        let (rows, head) = (bench.job.words.len(), head_words(&bench.job.header));
        if is_patch_bad {
            bench.job.words[at] = i32::MAX;
            // The digests are right.
            let mut plain = bench.job.clone();
            plain.header.window = 0;
            plain.words = bench.job.words[..head].to_vec();
            for row in bench.job.words[head..rows].chunks(row) {
                plain.words.extend(&row[..row.len() - 2]);
            }
            bench.job = streamed(&plain, 3);
        } else {
            bench.job.words[at] ^= 1;
        }
        let mut session = bench.loaded(GOOD);
        let refused = drive::run_digests(&mut session, &expected(&good), true, None, |_| {}).unwrap_err();
        let RemoteError::Refused { reason, .. } = refused else {
            panic!("{refused}");
        };
        let fits = match reason {
            Reason::Job { record, .. } => is_patch_bad && record == Some(8 * 6),
            Reason::WrongDigest { .. } => !is_patch_bad,
            _ => false,
        };
        assert!(fits, "{reason}");
        (0..1_000_000).for_each(|_| bench.board.lock().unwrap().tick());
        let status = bench.board.lock().unwrap().status();
        assert_eq!(status.state, State::Faulted);
        assert_eq!(
            status.fault.unwrap().kind(),
            Some(interp_core::FaultKind::BadPatch)
        );
        assert!(status.side.span < 8, "{:?}", status.side);
    }
}
