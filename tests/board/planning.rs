//! The planning of a period, a task below the tick: what a late one does to a run, and that the run is the same whenever it is in time.

use controller::in_process::Board;
use integration_tests::{HELLO, LIMITS, dome, upload};
use interp_core::{Command, FaultKind, Interpolator, Pattern, State};
use protocol::{
    digest::Digest,
    message::{Clock, Reply, Report, Request, Status},
};

use super::{Desk, WORDS};

/// Longest controlled stop, periods: v/a + a/J is 90 ms, and as much again on slopes.
const STOP_PERIODS: u32 = 200;

/// The dome within limits, at home.
fn limited() -> (interp_core::Header, Vec<i32>) {
    let (mut header, words) = dome();
    header.pattern = Pattern::Zigzag;
    header.feed_mm_s = 40.0;
    header.axes = Some(LIMITS);
    (header, words)
}

/// Digest and number of the samples of a run of the core, the planning after each tick.
fn undisturbed() -> (u64, u32) {
    let (header, words) = limited();
    let mut core = Interpolator::<[i32; WORDS]>::new();
    core.load_begin(&header, u32::try_from(words.len()).unwrap())
        .unwrap();
    core.load_words(0, &words).unwrap();
    core.load_check(0).unwrap();
    core.load_finish().unwrap();
    let (mut digest, mut samples) = (Digest::new(), 0);
    core.tick(Command::Start);
    while core.state().is_under_way() {
        digest.sample(core.last());
        samples += 1;
        core.plan();
        core.tick(None);
    }
    assert_eq!((core.state(), core.fault()), (State::Finished, None));
    (digest.value(), samples)
}

fn started(clock: Clock) -> Desk {
    let mut desk = Desk {
        board: Board::new(),
        ..Desk::default()
    };
    assert!(matches!(desk.ask(&HELLO), Reply::Capabilities(_)));
    let (header, words) = limited();
    for request in upload(header, &words) {
        desk.accepted(&request);
    }
    let home_nm = header.axes.unwrap().home_nm;
    for request in [
        Request::Clock(clock),
        Request::Report(Report::Digests),
        Request::Drives { on: true },
        Request::SetHome { home_nm },
    ] {
        desk.accepted(&request);
    }
    desk.ticks(3);
    desk.accepted(&Request::Start);
    desk
}

/// Ticks until the run is over.
fn to_the_end(desk: &mut Desk) -> Status {
    while desk.halts.is_empty() {
        desk.ticks(1);
    }
    desk.halts[0]
}

#[test]
fn in_time_the_board_makes_the_samples_of_the_core() {
    let (digest, samples) = undisturbed();
    let status = to_the_end(&mut started(Clock::Free));
    assert_eq!((status.state, status.deadline_misses), (State::Finished, 0));
    assert_eq!((status.digest, status.samples), (digest, samples));

    // In lockstep the next period waits for the planning, however late: here for three ticks of the timer in each period.
    let mut desk = started(Clock::Lockstep);
    desk.accepted(&Request::Run { ticks: u32::MAX });
    while desk.halts.is_empty() {
        desk.board.tick_without_planning(0, 0);
        if desk.board.real_time().has_to_plan() {
            let before = desk.board.status();
            for _ in 0..3 {
                desk.board.tick_without_planning(0, 0);
            }
            assert_eq!(desk.board.status(), before, "a period before the planning");
            desk.board.real_time().plan();
            desk.board.real_time().planning_was_late();
        }
        assert_eq!(desk.collect(), []);
    }
    let status = desk.halts[0];
    assert_eq!((status.state, status.deadline_misses), (State::Finished, 0));
    assert_eq!((status.digest, status.samples), (digest, samples));
}

/// A run on a free clock up to a period on the first pass that has something to plan, the tool in motion.
fn on_a_pass_with_planning_due() -> Desk {
    let mut desk = started(Clock::Free);
    let mut periods = 0;
    loop {
        desk.board.tick_without_planning(0, 0);
        periods += u32::from(desk.board.status().state == State::Running);
        if periods == 20 {
            assert!(desk.board.real_time().has_to_plan());
            return desk;
        }
        desk.board.real_time().plan();
    }
}

#[test]
fn a_late_planning_stops_the_run_along_its_path() {
    for completes in [false, true] {
        let mut desk = on_a_pass_with_planning_due();
        if completes {
            // The next sample is due before its end.
            desk.board.real_time().plan();
            desk.board.real_time().planning_was_late();
        }
        let before = desk.board.status();
        assert_eq!((before.fault, before.deadline_misses), (None, 0));
        desk.board.tick_without_planning(0, 0);
        let at_once = desk.board.status();
        assert_eq!((at_once.state, at_once.deadline_misses), (State::Stopping, 1));
        desk.board.real_time().plan();
        let fault = at_once.fault.unwrap();
        assert_eq!(
            (fault.kind(), fault.value),
            (Some(FaultKind::DeadlineMissed), 1.0)
        );
        let over = to_the_end(&mut desk);
        assert_eq!((over.state, over.deadline_misses), (State::Faulted, 1));
        let periods = over.samples - before.samples;
        assert!((1..STOP_PERIODS).contains(&periods), "{periods} periods");
    }
}

/// Where there is nothing to plan, no planning is missed: after the look-ahead of a pass, and on a machine that has no run.
/// While the tool is held, and after the run, once what comes next is prepared. On a pass there is something to plan in every period.
#[test]
fn without_anything_to_plan_none_is_missed() {
    let mut desk = on_a_pass_with_planning_due();
    desk.board.real_time().plan();
    desk.accepted(&Request::Hold);
    while desk.board.status().state != State::Held {
        desk.ticks(1);
    }
    stands_without_planning(&mut desk, State::Held);
    desk.accepted(&Request::Resume);
    to_the_end(&mut desk);
    stands_without_planning(&mut desk, State::Finished);
}

/// Plans until nothing is left, and goes on without planning.
fn stands_without_planning(desk: &mut Desk, state: State) {
    const PERIODS_MAX: u32 = 5000;
    let mut periods = 0;
    loop {
        desk.board.tick_without_planning(0, 0);
        if !desk.board.real_time().has_to_plan() {
            break;
        }
        desk.board.real_time().plan();
        assert!(periods < PERIODS_MAX, "planning does not end");
        periods += 1;
    }
    for _ in 0..20 {
        desk.board.tick_without_planning(0, 0);
    }
    let status = desk.board.status();
    assert_eq!((status.state, status.fault), (state, None));
    assert_eq!(status.deadline_misses, 0);
}
