//! Inputs, drives, home and the heartbeat timeout, on a whole board with a real job, and in random sequences.

mod rules;

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::{Arc, Mutex};

use controller::{in_process::Board, safety::DEBOUNCE_TICKS};
use integration_tests::{dome, upload};
use interp_core::{
    fault::{Fault, FaultKind},
    sample::State,
};
use machine::remote::operate::{Operator, Setup, act, follow, make_ready};
use machine::remote::session::{Event, Stream};
use machine::remote::{RemoteError, Session, drive};
use protocol::message::{Clock, Configuration, InputLines, LinkTimeoutAction, Reason, Request, Status};

const WORDS: usize = 64;
const ESTOP: InputLines = InputLines::EMERGENCY_STOP;
const X_PLUS: InputLines = InputLines(1 << 2);
const FAULT: InputLines = InputLines(1 << 10);

/// A line to a board in this process. Each read runs some periods.
struct Wire {
    board: Arc<Mutex<Board<WORDS>>>,
    sent: VecDeque<u8>,
}

/// Periods per read; the host reads about once per millisecond.
const TICKS_A_READ: usize = 2;

impl Stream for Wire {}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut board = self.board.lock().unwrap();
        (0..TICKS_A_READ).for_each(|_| board.tick());
        self.sent.extend(board.take_sent());
        if self.sent.is_empty() {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        self.sent.read(bytes)
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.board.lock().unwrap().receive(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Host and board.
struct Desk {
    board: Arc<Mutex<Board<WORDS>>>,
    session: Session,
}

impl Desk {
    /// Opens a session with this configuration, and loads the dome.
    fn loaded(setup: &Setup) -> Self {
        let board = Arc::new(Mutex::new(Board::new()));
        let mut desk = Self {
            session: Session::open(wire(&board), 1).unwrap(),
            board,
        };
        make_ready(&mut desk.session, setup).unwrap();
        let (header, words) = dome();
        for request in upload(header, &words) {
            desk.session.command(&request).unwrap();
        }
        desk
    }

    fn ready() -> Self {
        Self::loaded(&Setup::homed(Configuration::DEFAULT, [0; 3]))
    }

    fn tick(&self, ticks: u32) -> Status {
        let mut board = self.board.lock().unwrap();
        (0..ticks).for_each(|_| board.tick());
        board.status()
    }

    fn ask(&mut self, request: Request) -> Result<(), Reason> {
        match self.session.command(&request) {
            Err(RemoteError::Refused { reason, .. }) => Err(reason),
            done => {
                done.unwrap();
                Ok(())
            }
        }
    }

    /// Starts a run, and lets some periods pass without a request.
    fn running(&mut self) -> Status {
        self.ask(Request::Start).unwrap();
        let status = self.tick(50);
        assert_eq!(status.state, State::Running);
        status
    }

    /// Simulates inputs from the next period on. The line is not used, because its answer would take periods.
    fn assert_inputs(&self, lines: InputLines) {
        self.board.lock().unwrap().simulate(lines);
    }

    /// The status that the board reports at the end of the run.
    fn halted(&mut self) -> Status {
        loop {
            if let Event::Halted(status) = self.session.event().unwrap() {
                return status;
            }
        }
    }
}

fn wire(board: &Arc<Mutex<Board<WORDS>>>) -> Box<Wire> {
    Box::new(Wire {
        board: board.clone(),
        sent: VecDeque::new(),
    })
}

fn because(kind: FaultKind, lines: InputLines) -> Reason {
    let fault = Fault::new(kind, lines.0.into());
    Reason::Unsafe { fault: fault.into() }
}

/// Digest and number of the samples of an undisturbed run.
fn undisturbed() -> (u64, u32) {
    let mut desk = Desk::ready();
    desk.ask(Request::Start).unwrap();
    let status = desk.halted();
    assert_eq!(status.state, State::Finished);
    (status.digest, status.samples)
}

#[test]
fn an_emergency_stop_ends_the_run_in_its_tick_and_is_undone_step_by_step() {
    let mut desk = Desk::ready();
    let running = desk.running();
    desk.assert_inputs(ESTOP);
    let stopped = desk.tick(1);
    // No further sample is emitted.
    assert_eq!(
        (stopped.state, stopped.samples, stopped.digest),
        (State::Faulted, running.samples, running.digest)
    );
    let fault = stopped.fault.unwrap();
    assert_eq!(
        (fault.kind(), fault.lines()),
        (Some(FaultKind::EmergencyStop), ESTOP)
    );
    assert!(!stopped.safety.drives_on && !stopped.safety.homed);
    assert!(!desk.board.lock().unwrap().real_time().drives_on());
    assert_eq!(desk.halted().fault, Some(fault));

    let pressed = because(FaultKind::EmergencyStop, ESTOP);
    assert_eq!(desk.ask(Request::Acknowledge), Err(pressed));
    desk.ask(Request::Abort).unwrap();
    desk.tick(1);
    assert_eq!(desk.ask(Request::Start), Err(pressed));
    desk.assert_inputs(InputLines::NONE);
    desk.tick(DEBOUNCE_TICKS);
    assert_eq!(desk.ask(Request::Drives { on: true }), Err(pressed));
    assert_eq!(desk.ask(Request::Start), Err(pressed));
    desk.ask(Request::Acknowledge).unwrap();
    assert_eq!(desk.ask(Request::Start), Err(Reason::DrivesOff));
    let home = Request::SetHome { home_nm: [0; 3] };
    assert_eq!(desk.ask(home.clone()), Err(Reason::DrivesOff));
    desk.ask(Request::Drives { on: true }).unwrap();
    assert_eq!(
        desk.ask(Request::Start),
        Err(because(FaultKind::NotHomed, InputLines::NONE))
    );
    desk.ask(home).unwrap();
    desk.ask(Request::Start).unwrap();
    let whole = desk.halted();
    assert_eq!((whole.digest, whole.samples), undisturbed());
}

#[test]
fn a_drive_fault_cuts_and_a_limit_switch_stops_along_the_path() {
    for (lines, kind, samples, homed) in [
        (FAULT, FaultKind::DriveFault, 0, false),
        (X_PLUS, FaultKind::LimitSwitch, 31, true),
    ] {
        let mut desk = Desk::ready();
        let running = desk.running();
        desk.assert_inputs(lines);
        let steady = desk.tick(DEBOUNCE_TICKS - 1);
        assert_eq!(steady.state, State::Running);
        desk.tick(1);
        let halted = desk.halted();
        assert_eq!(halted.samples - running.samples, DEBOUNCE_TICKS - 1 + samples);
        let fault = halted.fault.unwrap();
        assert_eq!((fault.kind(), fault.lines()), (Some(kind), lines));
        assert_eq!((halted.safety.homed, halted.safety.drives_on), (homed, homed));
        desk.ask(Request::Abort).unwrap();
        desk.tick(1);
        assert_eq!(desk.ask(Request::Start), Err(because(kind, lines)));
        desk.assert_inputs(InputLines::NONE);
        desk.tick(DEBOUNCE_TICKS);
        assert_eq!(desk.ask(Request::Start).is_ok(), homed);
    }
}

/// In lockstep no period passes without credit, but the inputs are still read.
#[test]
fn an_emergency_stop_is_told_in_lockstep_without_a_period() {
    for held in [false, true] {
        let mut desk = Desk::ready();
        desk.ask(Request::Clock(Clock::Lockstep)).unwrap();
        desk.ask(Request::Start).unwrap();
        desk.ask(Request::Run { ticks: 40 }).unwrap();
        let mut before = desk.halted();
        if held {
            desk.ask(Request::Hold).unwrap();
            desk.ask(Request::Run { ticks: 1 }).unwrap();
            before = desk.halted();
        }
        let state = if held { State::Held } else { State::Running };
        assert_eq!(before.state, state);
        desk.assert_inputs(ESTOP);
        let halted = desk.halted();
        assert_eq!((halted.state, halted.samples), (State::Faulted, before.samples));
        assert_eq!(halted.fault.unwrap().kind(), Some(FaultKind::EmergencyStop));
    }
}

#[test]
fn a_host_that_is_gone_finds_its_run_held_and_goes_on_exactly() {
    let configuration = |on_link_timeout| Configuration {
        homing_required: true,
        on_link_timeout,
        link_timeout_ticks: 100,
    };
    let mut desk = Desk::loaded(&Setup::homed(configuration(LinkTimeoutAction::Hold), [0; 3]));
    desk.running();
    let gone = desk.tick(100);
    assert_eq!(gone.state, State::Held);
    assert!(gone.safety.link_timed_out && gone.fault.is_none() && gone.samples <= 100);
    assert_eq!(desk.tick(1000).samples, gone.samples);
    // Another session, as after a restart of the host.
    desk.session = Session::open(wire(&desk.board), 2).unwrap();
    assert!(
        act(&mut desk.session, &Request::Status)
            .unwrap()
            .safety
            .link_timed_out
    );
    assert_eq!(
        act(&mut desk.session, &Request::Resume).unwrap().state,
        State::Running
    );
    while desk.tick(10).state == State::Running {
        desk.session.status().unwrap();
    }
    let over = desk.tick(0);
    assert_eq!(over.state, State::Finished);
    assert_eq!((over.digest, over.samples), undisturbed());

    let mut desk = Desk::loaded(&Setup::homed(configuration(LinkTimeoutAction::Finish), [0; 3]));
    desk.running();
    let over = desk.tick(2000);
    assert_eq!((over.state, over.safety.link_timed_out), (State::Finished, true));
    assert_eq!((over.digest, over.samples), undisturbed());
    // The next run begins with the host connected.
    assert!(!desk.running().safety.link_timed_out);

    // In lockstep there is no link timeout.
    let mut desk = Desk::loaded(&Setup::homed(configuration(LinkTimeoutAction::Hold), [0; 3]));
    desk.ask(Request::Clock(Clock::Lockstep)).unwrap();
    desk.ask(Request::Start).unwrap();
    desk.ask(Request::Run { ticks: 500 }).unwrap();
    let status = desk.tick(500);
    assert_eq!(
        (status.state, status.safety.link_timed_out),
        (State::Running, false)
    );
}

#[test]
fn without_homing_a_run_starts_unhomed() {
    let mut setup = Setup::default();
    let not_homed = because(FaultKind::NotHomed, InputLines::NONE);
    assert_eq!(Desk::loaded(&setup).ask(Request::Start), Err(not_homed));
    setup.configuration.homing_required = false;
    assert_eq!(Desk::loaded(&setup).ask(Request::Start), Ok(()));
}

#[test]
fn an_operator_is_told_what_he_did() {
    let mut desk = Desk::ready();
    let mut done = |request: Request| act(&mut desk.session, &request).unwrap();
    assert_eq!(done(Request::Override { percent: 150 }).safety.feed_override, 150);
    assert_eq!(done(Request::Override { percent: 0 }).safety.feed_override, 0);
    let off = done(Request::Drives { on: false }).safety;
    assert!(!off.drives_on && !off.homed);
    assert!(done(Request::Drives { on: true }).safety.drives_on);
    assert!(done(Request::SetHome { home_nm: [1, -2, 3] }).safety.homed);
    assert_eq!(desk.board.lock().unwrap().real_time().home_nm(), Some([1, -2, 3]));
    desk.running();
    assert_eq!(act(&mut desk.session, &Request::Hold).unwrap().state, State::Held);
    let off = act(&mut desk.session, &Request::Drives { on: false });
    assert!(matches!(
        off,
        Err(RemoteError::Refused {
            reason: Reason::WrongState { .. },
            ..
        })
    ));
    assert_eq!(
        act(&mut desk.session, &Request::Stop).unwrap().state,
        State::Ready
    );
}

/// While the host waits for a long pass on the free clock, its heartbeat prevents the timeout; if the run is held, the host reports it.
#[test]
fn a_host_that_waits_is_not_gone() {
    let mut setup = Setup::homed(Configuration::DEFAULT, [0; 3]);
    (
        setup.configuration.on_link_timeout,
        setup.configuration.link_timeout_ticks,
    ) = (LinkTimeoutAction::Hold, 400);
    let mut desk = Desk::loaded(&setup);
    let (digest, samples) = undisturbed();
    let compared = drive::run_digests(&mut desk.session, &[], false, None, |_| {}).unwrap();
    assert_eq!(
        (
            compared.status.digest,
            compared.status.samples,
            compared.status.safety.link_timed_out
        ),
        (digest, samples, false)
    );
    desk.running();
    desk.tick(1000);
    desk.session.set_keep_alive(Some(std::time::Duration::ZERO));
    // The passes before the standstill come first.
    let mut events = std::iter::repeat_with(|| desk.session.event());
    let last = events.find(|event| !matches!(event, Ok(Event::Pass(_))));
    assert!(matches!(last, Some(Err(RemoteError::Held))), "{last:?}");
}

/// A run that is held because its host was gone goes on when another host follows it and resumes it, to its end and without another hold: that host keeps
/// the heartbeat. One that only resumes it, and leaves, finds it held again.
#[test]
fn a_held_run_is_followed_to_its_end() {
    let mut setup = Setup::homed(Configuration::DEFAULT, [0; 3]);
    (
        setup.configuration.on_link_timeout,
        setup.configuration.link_timeout_ticks,
    ) = (LinkTimeoutAction::Hold, 400);
    let mut desk = Desk::loaded(&setup);
    desk.running();
    assert_eq!(desk.tick(450).state, State::Held);
    desk.session = Session::open(wire(&desk.board), 2).unwrap();
    desk.ask(Request::Resume).unwrap();
    let held = desk.tick(450);
    assert_eq!((held.state, held.fault), (State::Held, None));
    assert!(held.samples < undisturbed().1);

    desk.session = Session::open(wire(&desk.board), 3).unwrap();
    let mut operator = Scripted {
        wishes: vec![Request::Status, Request::Resume].into_iter(),
        stays: false,
        came: Vec::new(),
    };
    let mut passes = 0;
    let ended = follow(&mut desk.session, &mut operator, |event| {
        passes += u32::from(matches!(event, Event::Pass(_)));
    });
    let ended = ended.unwrap();
    assert_eq!(operator.came, [Ok(State::Held), Ok(State::Running)]);
    assert_eq!(
        (ended.state, ended.digest, ended.samples),
        (State::Finished, undisturbed().0, undisturbed().1)
    );
    assert!(passes > 3 && ended.safety.link_timed_out);

    // Nothing is under way any more, so there is nothing to follow.
    let again = follow(&mut desk.session, &mut operator, |_| panic!("no event")).unwrap();
    assert_eq!(again.state, State::Finished);
}

/// Who follows a held run and can no longer resume it does not wait; nor does he where the override is 0 and nobody can change it.
#[test]
fn a_run_that_stands_still_is_not_waited_for_without_an_operator() {
    let nobody = || Scripted {
        wishes: Vec::new().into_iter(),
        stays: false,
        came: Vec::new(),
    };
    let mut desk = Desk::ready();
    desk.running();
    desk.ask(Request::Hold).unwrap();
    assert_eq!(desk.tick(50).state, State::Held);
    desk.session.set_keep_alive(Some(std::time::Duration::ZERO));
    let left = follow(&mut desk.session, &mut nobody(), |_| {});
    assert!(matches!(left, Err(RemoteError::Held)), "{left:?}");

    let mut desk = Desk::ready();
    desk.ask(Request::Override { percent: 0 }).unwrap();
    let left = drive::run_digests(&mut desk.session, &[], false, Some(&mut nobody()), |_| {});
    assert!(matches!(left, Err(RemoteError::NoFeed)), "{left:?}");
    // A run with an operator is waited for, and he can set it again.
    let mut desk = Desk::ready();
    desk.ask(Request::Override { percent: 0 }).unwrap();
    let mut operator = Scripted {
        wishes: vec![Request::Override { percent: 100 }].into_iter(),
        ..nobody()
    };
    let ended = drive::run_digests(&mut desk.session, &[], false, Some(&mut operator), |_| {}).unwrap();
    assert_eq!((ended.status.state, ended.commanded), (State::Finished, true));
}

/// Issues the given requests one after the other, and records the results.
struct Scripted {
    wishes: std::vec::IntoIter<Request>,
    /// Whether the operator stays connected.
    stays: bool,
    came: Vec<Result<State, String>>,
}

impl Operator for Scripted {
    fn wish(&mut self) -> Option<Request> {
        self.wishes.next()
    }

    fn is_there(&self) -> bool {
        self.stays
    }

    fn replied(&mut self, _: &Request, came: Result<Status, RemoteError>) {
        self.came
            .push(came.map(|status| status.state).map_err(|error| error.to_string()));
    }
}

#[test]
fn an_operator_commands_a_run_that_is_followed() {
    let run = |wishes: Vec<Request>| {
        let mut desk = Desk::ready();
        let mut operator = Scripted {
            wishes: wishes.into_iter(),
            stays: true,
            came: Vec::new(),
        };
        let compared =
            drive::run_digests(&mut desk.session, &[], false, Some(&mut operator), |_| {}).unwrap();
        (compared, operator.came)
    };
    // While the run is held, the host waits; a job without limits then continues with the next sample.
    let (compared, came) = run(vec![
        Request::Hold,
        Request::Status,
        Request::Drives { on: false },
        Request::Resume,
    ]);
    let refusal = "the board refused to switch the drives off";
    assert!(
        matches!(&came[..], [Ok(State::Held), Ok(State::Held), Err(why), Ok(State::Running)] if why.starts_with(refusal)),
        "{came:?}"
    );
    let status = compared.status;
    assert_eq!((status.state, compared.commanded), (State::Finished, true));
    assert_eq!((status.digest, status.samples), undisturbed());

    let (compared, came) = run(vec![Request::Stop]);
    assert_eq!(came, [Ok(State::Ready)]);
    assert_eq!((compared.status.state, compared.commanded), (State::Ready, true));
    assert!(compared.status.samples < undisturbed().1);
    // A status request is no command, so the passes are compared; the run has more passes than the empty list expected.
    let (compared, _) = run(vec![Request::Status]);
    assert_eq!((compared.commanded, compared.first_bad_index), (false, Some(0)));

    // If the operator holds the run and disconnects, the host does not wait for its end.
    let mut desk = Desk::ready();
    let mut operator = Scripted {
        wishes: vec![Request::Hold].into_iter(),
        stays: false,
        came: Vec::new(),
    };
    let left = drive::run_digests(&mut desk.session, &[], false, Some(&mut operator), |_| {});
    assert!(matches!(left, Err(RemoteError::Held)), "{left:?}");
}
