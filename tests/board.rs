//! A whole board in this process, with a real job: the line reports exactly the samples of the interpolator, and no
//! disturbance on the line changes them.

mod disorder;
mod planning;
mod steps;

use controller::{
    in_process::Board,
    machine::{Event, Events, Instruction},
    realtime::{RealTime, TickInput},
    safety::Order,
};
use integration_tests::{HELLO, Host, MAKE_READY, dome, upload};
use interp_core::{
    fault::{Fault, FaultKind},
    interpolator::Interpolator,
    sample::{Sample, State},
};
use protocol::{
    digest::Digest,
    message::{Clock, PassDigest, Reason, Reply, Report, Request, Status},
};

const WORDS: usize = 64;

/// The samples that the core alone makes of the dome: all of them, or those of a run that a missed tick stops after a given
/// number of samples.
fn samples_of_dome(missed_after: Option<usize>) -> Vec<Sample> {
    let (header, words) = dome();
    let mut core = Interpolator::<[i32; WORDS]>::new();
    core.load_begin(&header, u32::try_from(words.len()).unwrap())
        .unwrap();
    core.load_words(0, &words).unwrap();
    core.load_check(0).unwrap();
    core.load_finish().unwrap();
    let mut samples = vec![*core.tick(interp_core::Command::Start)];
    while matches!(core.state(), State::Running | State::Stopping) {
        if missed_after == Some(samples.len()) {
            core.controlled_stop(Fault::new(FaultKind::DeadlineMissed, 1.0));
        }
        core.plan();
        samples.push(*core.tick(None));
    }
    samples.pop();
    samples
}

/// All samples of an undisturbed run.
fn reference() -> Vec<Sample> {
    let samples = samples_of_dome(None);
    assert!((500..2000).contains(&samples.len()), "{} samples", samples.len());
    assert!(samples.iter().all(|sample| sample.state == State::Running));
    samples
}

fn digest(samples: &[Sample]) -> u64 {
    let mut digest = Digest::new();
    samples.iter().for_each(|sample| digest.sample(sample));
    digest.value()
}

/// Host and board, with the board's reports by kind.
#[derive(Default)]
struct Desk {
    host: Host,
    board: Board<WORDS>,
    samples: Vec<Sample>,
    passes: Vec<PassDigest>,
    halts: Vec<Status>,
}

impl Desk {
    /// A board in session with the dome loaded, on the given clock, with the given reports.
    fn loaded(clock: Clock, report: Report) -> Self {
        let mut desk = Self::default();
        assert!(matches!(desk.ask(&HELLO), Reply::Capabilities(_)));
        let (header, words) = dome();
        for request in upload(header, &words) {
            desk.accepted(&request);
        }
        desk.accepted(&Request::Clock(clock));
        desk.accepted(&Request::Report(report));
        for request in MAKE_READY {
            desk.accepted(&request);
        }
        desk.ticks(3);
        desk
    }

    /// Sorts the board's messages by kind; returns the answers to requests.
    fn collect(&mut self) -> Vec<Reply> {
        let sent = self.board.take_sent();
        let mut answers = Vec::new();
        for reply in self.host.read(&sent) {
            match reply {
                Reply::Samples { samples, .. } => {
                    self.samples.extend(samples.iter().map(|record| record.0));
                }
                Reply::PassDigest { pass, .. } => self.passes.push(pass),
                Reply::Halted(status) => self.halts.push(status),
                answer => answers.push(answer),
            }
        }
        answers
    }

    fn ask(&mut self, request: &Request) -> Reply {
        let frame = self.host.next(request);
        self.board.receive(&frame);
        let mut answers = self.collect();
        assert_eq!(answers.len(), 1, "{request:?}");
        answers.remove(0)
    }

    fn accepted(&mut self, request: &Request) {
        assert_eq!(
            self.ask(request),
            Reply::Ack {
                number: self.host.number
            },
            "{request:?}"
        );
    }

    fn ticks(&mut self, ticks: usize) {
        for _ in 0..ticks {
            self.board.tick();
        }
        assert_eq!(self.collect(), []);
    }

    /// Grants a number of ticks and runs until the board reports `Halted`.
    fn run(&mut self, ticks: u32) -> Status {
        self.accepted(&Request::Run { ticks });
        let before = self.halts.len();
        while self.halts.len() == before {
            self.ticks(1);
        }
        *self.halts.last().unwrap()
    }
}

/// A status without what the link fills in and what counts over several runs.
const fn of_the_run(status: Status) -> Status {
    Status {
        halts: 0,
        events: 0,
        steps: 0,
        ..status
    }
}

/// Checks number, samples and digest of each pass against the samples.
fn check_passes(passes: &[PassDigest], samples: &[Sample]) {
    let mut rest = samples;
    for (pass, number) in passes.iter().zip(0..) {
        let (own, others) = rest.split_at(usize::try_from(pass.samples).unwrap());
        assert!(own.iter().all(|sample| sample.pass == number), "pass {number}");
        assert_eq!((pass.pass, pass.first_tick), (number, own[0].tick));
        let so_far = samples.len() - others.len();
        assert_eq!(pass.digest, digest(&samples[..so_far]), "pass {number}");
        rest = others;
    }
    assert!(rest.is_empty());
}

#[test]
fn every_sample_comes_over_the_line_as_the_core_made_it() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    desk.accepted(&Request::Start);
    let status = desk.run(1_000_000);
    let samples = reference();
    assert_eq!(desk.samples, samples);
    check_passes(&desk.passes, &samples);
    assert_eq!((status.state, status.credit), (State::Finished, 0));
    assert_eq!(
        (status.digest, status.samples),
        (digest(&samples), u32::try_from(samples.len()).unwrap())
    );
    assert_eq!(
        Reply::Status {
            number: desk.host.number + 1,
            status
        },
        desk.ask(&Request::Status)
    );
}

#[test]
fn a_free_clock_gives_the_same_digest_as_lockstep_in_small_steps() {
    let samples = reference();
    let mut desk = Desk::loaded(Clock::Free, Report::Digests);
    desk.accepted(&Request::Start);
    desk.ticks(samples.len() + 10);
    assert_eq!(desk.halts.len(), 1);
    assert!(desk.samples.is_empty());
    check_passes(&desk.passes, &samples);
    let free = desk.halts[0];

    let mut desk = Desk::loaded(Clock::Lockstep, Report::Digests);
    desk.accepted(&Request::Start);
    while desk.run(7).state != State::Finished {}
    let lockstep = *desk.halts.last().unwrap();
    assert_eq!(
        of_the_run(free),
        Status {
            clock: Clock::Free,
            ..of_the_run(lockstep)
        }
    );
    assert_eq!(free.digest, digest(&samples));
}

#[test]
fn a_second_run_is_like_the_first() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Digests);
    desk.accepted(&Request::Start);
    let first = desk.run(1_000_000);
    desk.accepted(&Request::Start);
    let second = desk.run(1_000_000);
    assert_eq!(of_the_run(second), of_the_run(first));
    assert_eq!((first.halts, second.halts), (1, 2));
    assert_eq!(second.events, 2 * first.events);
}

#[test]
fn time_stands_still_in_lockstep_without_credit() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    desk.accepted(&Request::Start);
    desk.ticks(100);
    assert!(desk.samples.is_empty() && desk.halts.is_empty());
    let status = desk.run(25);
    assert_eq!(
        (status.state, status.tick, status.samples),
        (State::Running, 24, 25)
    );
    desk.ticks(100);
    assert_eq!(desk.samples, reference()[..25]);
    // A `Run` of 0 ticks is used up immediately.
    assert_eq!(of_the_run(desk.run(0)), of_the_run(status));
}

#[test]
fn hold_and_resume_lose_no_sample() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    desk.accepted(&Request::Start);
    desk.run(100);
    desk.accepted(&Request::Hold);
    assert_eq!(desk.run(50).state, State::Held);
    assert_eq!(
        desk.ask(&Request::Start),
        Reply::Nak {
            number: desk.host.number,
            reason: Reason::WrongState { state: State::Held }
        }
    );
    desk.accepted(&Request::Resume);
    let status = desk.run(1_000_000);
    assert_eq!(status.digest, digest(&reference()));
    assert_eq!(desk.samples, reference());
}

#[test]
fn an_abort_ends_the_run_and_keeps_the_job() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    desk.accepted(&Request::Start);
    desk.run(100);
    desk.accepted(&Request::Abort);
    // A later command does not replace a queued abort.
    desk.accepted(&Request::Hold);
    let status = desk.run(100);
    assert_eq!(
        (status.state, status.samples, status.credit),
        (State::Ready, 100, 0)
    );
    check_passes(&desk.passes, &desk.samples);
    desk.accepted(&Request::Start);
    assert_eq!(desk.run(1_000_000).digest, digest(&reference()));
}

#[test]
fn a_job_in_the_middle_of_a_run_changes_nothing() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    desk.accepted(&Request::Start);
    let before = desk.run(100);
    let (header, words) = dome();
    for request in upload(header, &words) {
        assert!(matches!(desk.ask(&request), Reply::Nak { .. }));
    }
    assert_eq!(of_the_run(desk.board.status()), of_the_run(before));
    assert_eq!(desk.run(1_000_000).digest, digest(&reference()));
}

#[test]
fn a_job_begun_withdraws_a_start_that_waits() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    desk.accepted(&Request::Start);
    let (header, words) = dome();
    let requests = upload(header, &words);
    // The start is still in the queue: it would start the other job.
    assert_eq!(
        desk.ask(&requests[0]),
        Reply::Nak {
            number: desk.host.number,
            reason: Reason::Busy
        }
    );
    // The start is dropped; in lockstep without credit no period passes.
    desk.ticks(1);
    for request in &requests {
        desk.accepted(request);
    }
    assert_eq!(desk.run(10).state, State::Ready);
}

#[test]
fn a_missed_tick_trips_a_free_run_and_is_only_counted_in_lockstep() {
    let mut desk = Desk::loaded(Clock::Free, Report::Samples);
    desk.board.tick_with(3, 0);
    desk.accepted(&Request::Start);
    desk.ticks(50);
    desk.board.tick_with(2, 4321);
    desk.ticks(40);
    desk.collect();
    while desk.halts.is_empty() {
        desk.ticks(1);
    }
    let status = desk.halts[0];
    // The feed falls by 1/32 with each of 31 samples along the path.
    assert_eq!((status.state, status.samples), (State::Faulted, 50 + 31));
    assert_eq!((status.deadline_misses, status.tick_cycles_max), (2, 4321));
    let fault = status.fault.unwrap();
    assert_eq!(
        (fault.kind(), fault.value),
        (Some(FaultKind::DeadlineMissed), 2.0)
    );
    assert_eq!(desk.passes.last().map(|pass| pass.samples), Some(status.samples));

    let mut desk = Desk::loaded(Clock::Lockstep, Report::Digests);
    desk.accepted(&Request::Start);
    desk.run(50);
    desk.board.tick_with(2, 0);
    let status = desk.run(1_000_000);
    assert_eq!((status.state, status.deadline_misses), (State::Finished, 2));
    assert_eq!(status.digest, digest(&reference()));
}

/// The event queue to the link, with or without room.
#[derive(Default)]
struct Way {
    full: bool,
    events: Vec<Event>,
}

impl Events for Way {
    fn has_room(&self) -> bool {
        !self.full
    }

    fn put(&mut self, event: Event) -> bool {
        self.events.push(event);
        !self.full
    }
}

/// The real-time half with the dome, in lockstep, reporting samples, with a start in its queue.
fn half_in_lockstep() -> RealTime<[i32; WORDS]> {
    let (header, words) = dome();
    let mut half = RealTime::<[i32; WORDS]>::new();
    half.load_begin(&header, 54).unwrap();
    half.load_words(0, &words).unwrap();
    half.load_check(0).unwrap();
    half.load_finish().unwrap();
    half.order(Order::Drives { on: true }).unwrap();
    half.order(Order::SetHome { home_nm: [0; 3] }).unwrap();
    for command in [
        Instruction::Report(Report::Samples),
        Instruction::Clock(Clock::Lockstep),
        Instruction::Command(interp_core::Command::Start),
    ] {
        half.obey(command, &mut Way::default());
    }
    half
}

#[test]
fn in_lockstep_commands_and_halts_come_on_top_of_no_period() {
    let mut half = half_in_lockstep();
    let obey = |half: &mut RealTime<[i32; WORDS]>, command| {
        let mut way = Way::default();
        half.obey(command, &mut way);
        half.tick(TickInput::default(), &mut way);
        half.plan();
        way.events
    };
    let tick = |half: &mut RealTime<[i32; WORDS]>| {
        let mut way = Way::default();
        half.tick(TickInput::default(), &mut way);
        half.plan();
        way.events
    };
    assert_eq!(obey(&mut half, Instruction::Run { ticks: 2 }), []);
    assert_eq!(tick(&mut half), [Event::Sample(reference()[0])]);
    assert_eq!(obey(&mut half, Instruction::Report(Report::Samples)), []);
    assert_eq!(tick(&mut half), [Event::Sample(reference()[1])]);
    assert!(matches!(tick(&mut half)[..], [Event::Halted(status)] if status.credit == 0));
    assert_eq!(tick(&mut half), []);
    // A pending `Halted` is reported before further credit is used, and before the clock changes.
    assert_eq!(obey(&mut half, Instruction::Run { ticks: 1 }), []);
    assert_eq!(tick(&mut half), [Event::Sample(reference()[2])]);
    assert_eq!(obey(&mut half, Instruction::Run { ticks: 1 }), []);
    assert!(matches!(tick(&mut half)[..], [Event::Halted(status)] if status.credit == 1));
    assert_eq!(tick(&mut half), [Event::Sample(reference()[3])]);
    let reported = obey(&mut half, Instruction::Clock(Clock::Free));
    assert!(matches!(reported[..], [Event::Halted(_), Event::Sample(sample)] if sample == reference()[4]));
}

#[test]
fn a_full_output_stops_time_in_lockstep_only() {
    let mut half = half_in_lockstep();
    let start = Instruction::Command(interp_core::Command::Start);
    let mut way = Way::default();
    half.obey(Instruction::Run { ticks: 10 }, &mut way);
    let mut tick = |half: &mut RealTime<[i32; WORDS]>, full| {
        way.full = full;
        half.tick(TickInput::default(), &mut way);
        half.plan();
        core::mem::take(&mut way.events)
    };
    assert_eq!(tick(&mut half, true), []);
    assert_eq!(tick(&mut half, true), []);
    assert_eq!(half.status().credit, 10);
    assert_eq!(tick(&mut half, false), [Event::Sample(reference()[0])]);
    assert_eq!(tick(&mut half, true), []);
    assert_eq!(tick(&mut half, false), [Event::Sample(reference()[1])]);
    assert_eq!((half.status().credit, half.status().samples_lost), (8, 0));

    half.obey(
        Instruction::Command(interp_core::Command::Abort),
        &mut Way::default(),
    );
    while half.status().state.is_under_way() {
        half.tick(TickInput::default(), &mut Way::default());
        half.plan();
    }
    half.obey(Instruction::Clock(Clock::Free), &mut Way::default());
    half.obey(start, &mut Way::default());
    let mut way = Way {
        full: true,
        ..Way::default()
    };
    for _ in 0..3 {
        half.tick(TickInput::default(), &mut way);
        half.plan();
    }
    assert_eq!((half.status().samples, half.status().samples_lost), (3, 3));
}

#[test]
fn a_tick_over_its_budget_trips_a_run_that_moves_on_a_free_clock() {
    const BUDGET: u32 = 16_800;
    let mut desk = Desk::loaded(Clock::Free, Report::Digests);
    desk.board.real_time().set_tick_budget(BUDGET);
    // No run is under way yet: no fault.
    desk.board.tick_with(0, 2 * BUDGET);
    assert_eq!(desk.board.status().state, State::Ready);
    desk.accepted(&Request::Start);
    desk.ticks(50);
    // Ticks of exactly the budget are no fault, however many.
    desk.board.tick_with(0, BUDGET);
    desk.board.tick_with(0, BUDGET);
    assert_eq!(desk.board.status().state, State::Running);
    // While held, a tick over its budget is no fault, but it is recorded as the maximum.
    desk.accepted(&Request::Hold);
    while desk.board.status().state != State::Held {
        desk.ticks(1);
    }
    desk.board.tick_with(0, BUDGET + 9);
    assert_eq!(desk.board.status().fault, None);
    desk.accepted(&Request::Resume);
    desk.ticks(2);
    // Below the recorded maximum, but above the budget: a fault.
    let before = desk.board.status();
    assert_eq!(
        (before.state, before.tick_cycles_max),
        (State::Running, BUDGET + 9)
    );
    desk.board.tick_with(0, BUDGET + 1);
    while desk.halts.is_empty() {
        desk.ticks(1);
    }
    let status = desk.halts[0];
    let fault = status.fault.unwrap();
    assert_eq!(status.state, State::Faulted);
    assert_eq!(
        (fault.kind(), fault.value),
        (Some(FaultKind::TickOverBudget), 16_801.0)
    );
    assert_eq!((status.deadline_misses, status.tick_cycles_max), (0, BUDGET + 9));

    // In lockstep the budget is not enforced; the maximum is recorded.
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Digests);
    desk.board.real_time().set_tick_budget(BUDGET);
    desk.accepted(&Request::Start);
    desk.run(50);
    desk.board.tick_with(0, 2 * BUDGET);
    let status = desk.run(1_000_000);
    assert_eq!(
        (status.state, status.tick_cycles_max),
        (State::Finished, 2 * BUDGET)
    );
    assert_eq!(status.digest, digest(&reference()));
}
