//! A board in this process. Its sampling periods pass while the host reads.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use controller::in_process::Board;
use interp_core::{Sample, State};
use machine::remote::Session;
use machine::remote::drive;
use machine::remote::operate::{Setup, make_ready};
use machine::remote::session::{LineLosses, Stream};
use protocol::message::Configuration;

use super::{Bench, Loses, Lossy, Noise, dome, dome_with_limits};

const WORDS: usize = 64;

/// Periods per read: less than the board keeps of the samples.
const TICKS_A_READ: usize = 40;

/// A line to a board in this process.
struct Wire {
    board: Box<Board<WORDS>>,
    sent: VecDeque<u8>,
}

impl Stream for Wire {}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        (0..TICKS_A_READ).for_each(|_| self.board.tick());
        self.sent.extend(self.board.take_sent());
        if self.sent.is_empty() {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        self.sent.read(bytes)
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.board.receive(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A session with the job loaded, over a line that loses events.
fn session(bench: &Bench, loses: Loses) -> Session {
    loaded(bench, Lossy::new(wire(), loses))
}

fn wire() -> Box<Wire> {
    Box::new(Wire {
        board: Box::new(Board::new()),
        sent: VecDeque::new(),
    })
}

fn loaded(bench: &Bench, line: Lossy) -> Session {
    let mut session = Session::open(Box::new(line), 1).unwrap();
    let home_nm = bench.prepared.header.axes.map_or([0; 3], |axes| axes.home_nm);
    make_ready(&mut session, &Setup::homed(Configuration::DEFAULT, home_nm)).unwrap();
    drive::upload(&mut session, &bench.prepared, |_| {}).unwrap();
    session
}

/// Number of events of an undisturbed run by digest.
fn events(bench: &Bench, lockstep: bool) -> u32 {
    let run = bench.by_digest(&mut session(bench, Box::new(|_, _| false)), lockstep);
    bench.assert_same(&run, "without a loss");
    assert_eq!(run.losses, LineLosses::default());
    run.status.events
}

/// Each single event is lost, once, and however often it is sent.
#[test]
fn any_lost_event_of_a_run_by_digest_leaves_it_the_same() {
    let bench = dome();
    for lockstep in [false, true] {
        let events = events(&bench, lockstep);
        // Passes, and the end.
        assert_eq!(events as usize, bench.run.passes.len() + 1);
        for lost in 1..=events {
            let once = Box::new(move |event, before| event == lost && before == 0);
            let run = bench.by_digest(&mut session(&bench, once), lockstep);
            bench.assert_same(&run, &format!("event {lost} lost once"));
            assert_eq!(run.losses, LineLosses { repeated: 1, lost: 0 }, "event {lost}");
            assert_eq!(run.compared, bench.run.samples);

            let always = Box::new(move |event, _| event == lost);
            let run = bench.by_digest(&mut session(&bench, always), lockstep);
            bench.assert_same(&run, &format!("event {lost} lost"));
            assert_eq!(run.losses, LineLosses { repeated: 0, lost: 1 }, "event {lost}");
            assert_eq!(run.compared, bench.run.samples);
        }
    }
}

/// Events lost in a row, at every place, once or for good; all of them at last.
#[test]
fn any_burst_of_lost_events_leaves_a_run_the_same() {
    let bench = dome();
    let events = events(&bench, false);
    for length in [2, 5, events] {
        for first in 1..=events - length + 1 {
            for times in [1, u32::MAX] {
                let burst = Box::new(move |event: u32, before| {
                    (first..first + length).contains(&event) && before < times
                });
                let run = bench.by_digest(&mut session(&bench, burst), false);
                bench.assert_same(&run, &format!("{length} events from {first} on, {times} times"));
                assert_eq!(run.compared, bench.run.samples);
            }
        }
    }
}

/// A run within limits, with links and planning, gives the same samples whichever event is lost.
#[test]
fn a_run_within_limits_stays_the_same() {
    let bench = dome_with_limits();
    let events = events(&bench, false);
    for lost in [1, 2, events / 2, events - 1, events] {
        let once = Box::new(move |event, before| event == lost && before == 0);
        let run = bench.by_digest(&mut session(&bench, once), false);
        bench.assert_same(&run, &format!("event {lost} lost"));
    }
}

/// The samples of the trace are the core's, each once and in order.
fn assert_trace(bench: &Bench, trace: &[Sample], what: &str) {
    let samples = bench.samples();
    assert_eq!(trace.len(), samples.len(), "{what}");
    assert_eq!(drive::first_difference(&samples, trace), None, "{what}");
}

/// Each frame of samples, each pass and the end is lost once, and comes again; so do short bursts.
#[test]
fn lost_samples_come_again() {
    let bench = dome();
    let whole = |loses: Loses, what: &str| {
        let (run, trace) = bench.by_sample(&mut session(&bench, loses), false);
        bench.assert_same(&run, what);
        assert_trace(&bench, &trace, what);
        run
    };
    let events = whole(Box::new(|_, _| false), "without a loss").status.events;
    assert!(events > 200, "{events}");
    for lost in 1..=events {
        let run = whole(
            Box::new(move |event, before| event == lost && before == 0),
            &format!("event {lost}"),
        );
        assert_eq!(
            (run.missing, run.losses.lost, run.losses.repeated),
            (0, 0, 1),
            "event {lost}"
        );
    }
    for first in (1..events).step_by(17) {
        let burst = move |event, before| (first..first + 4).contains(&event) && before == 0;
        let run = whole(Box::new(burst), &format!("4 events from {first} on"));
        assert_eq!((run.missing, run.losses.lost), (0, 0), "4 events from {first} on");
    }
}

/// What the board does not keep any more is proven by the digest, and completed.
#[test]
fn samples_that_never_come_are_proven_by_the_digest() {
    let bench = dome();
    for (first, length) in [(1, 1), (1, 60), (77, 3), (100, 100), (150, 1000), (1, 1000)] {
        let what = format!("{length} events from {first} on");
        let burst = move |event, _| (first..first + length).contains(&event);
        let (run, trace) = bench.by_sample(&mut session(&bench, Box::new(burst)), false);
        bench.assert_same(&run, &what);
        assert_trace(&bench, &trace, &what);
        assert!(run.missing > 0 && run.losses.lost > 0, "{what}: {run:?}");
        assert_eq!(run.compared + run.missing, bench.run.samples, "{what}");
    }
}

/// One byte in some hundred is damaged, in either direction: requests, answers and events, in any combination.
#[test]
fn a_noisy_line_leaves_a_run_the_same() {
    let bench = dome();
    let mut losses = LineLosses::default();
    for seed in 1..=6 {
        let is_on = Arc::new(AtomicBool::new(false));
        let noise = Noise {
            is_on: is_on.clone(),
            one_in: 400,
            random: seed,
        };
        let mut session = loaded(&bench, Lossy::with_noise(wire(), noise));
        is_on.store(true, Ordering::Relaxed);
        let what = format!("seed {seed}");
        let run = if seed % 2 == 0 {
            bench.by_digest(&mut session, seed % 4 == 0)
        } else {
            let (run, trace) = bench.by_sample(&mut session, seed % 4 == 1);
            assert_trace(&bench, &trace, &what);
            run
        };
        bench.assert_same(&run, &what);
        losses.repeated += run.losses.repeated;
        losses.lost += run.losses.lost;
    }
    // Frames of samples are so long that about half of them are damaged; some come again before the board drops them.
    assert!(losses.repeated > 5 && losses.lost > 5, "{losses:?}");
}

/// A run that differs is found to differ, whatever is lost: by digest and sample by sample.
#[test]
fn a_difference_is_found_whatever_is_lost() {
    let ours = dome();
    let mut theirs = dome();
    // The height at the middle of the surface.
    let coefficient = theirs.prepared.words.len() - 16;
    theirs.prepared.words[coefficient] += 40;
    let mut other = Vec::new();
    machine::Machine::load(&theirs.prepared)
        .unwrap()
        .run(|sample| {
            other.push(*sample);
            true
        })
        .unwrap();
    let tick = drive::first_difference(&ours.samples(), &other).unwrap();
    let lost: [fn(u32, u32) -> bool; 4] = [
        |_, _| false,
        |event, _| event % 3 == 0,
        |event, before| event % 2 == 0 && before == 0,
        |_, _| true,
    ];
    for loses in lost {
        let run = ours.by_digest(&mut session(&theirs, Box::new(loses)), false);
        assert!(run.first_difference.is_some(), "{run:?}");
        let (run, trace) = ours.by_sample(&mut session(&theirs, Box::new(loses)), false);
        let found = run.first_difference.unwrap();
        assert!(run.failure(&ours.run, &ours.job).is_some());
        if run.missing == 0 {
            assert_eq!((found, trace.len()), (u64::from(tick), other.len()));
        } else {
            // Nothing proves the samples that did not come, so there is no trace.
            assert!(!run.is_complete() && trace.is_empty());
        }
    }
}

/// An end that a status reported is not reported again by its event, nor is an earlier one: runs follow each other on one session.
#[test]
fn one_run_after_the_other_has_its_own_end() {
    let bench = dome();
    let per_run = events(&bench, false);
    let loses = move |event: u32, _| event.is_multiple_of(per_run) && event / per_run % 2 == 1;
    let mut session = session(&bench, Box::new(loses));
    for run in 0..4 {
        let ended = bench.by_digest(&mut session, run % 2 == 1);
        bench.assert_same(&ended, &format!("run {run}"));
        assert_eq!(ended.status.state, State::Finished);
        assert_eq!(ended.status.events, (run + 1) * per_run);
    }
}
