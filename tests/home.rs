//! Start of a run: the axes must be at the job's home. On a whole board with step outputs.

use controller::{in_process::Board, safety::DEBOUNCE_TICKS};
use integration_tests::{HELLO, Host, LIMITS, MAKE_READY, dome, upload};
use interp_core::{AxisLimits, Header, State, StepConfig};
use protocol::message::{
    Activity, Configuration, InputLines, JogWay, Reason, Reply, Report, Request, Status,
};

const WORDS: usize = 64;
/// Above the highest position of the ball centre on the dome, 25 mm.
const SAFE_Z_NM: i32 = 30_000_000;
const HOME_NM: [i32; 3] = [-10_000_000, 2_500_000, SAFE_Z_NM];
const ELSEWHERE_NM: [i32; 3] = [1_000_000, 0, SAFE_Z_NM];

/// The dome in about nine passes, on a machine with limits.
fn within_limits(home_nm: [i32; 3]) -> (Header, Vec<i32>) {
    let (mut header, words) = dome();
    header.feed_mm_s = 60.0;
    header.axes = Some(AxisLimits {
        acceleration_mm_s2: [2000.0; 3],
        jerk_mm_s3: [50_000.0; 3],
        home_nm,
        safe_z_nm: SAFE_Z_NM,
        ..LIMITS
    });
    (header, words)
}

/// Host and board.
struct Desk {
    host: Host,
    board: Board<WORDS>,
    /// Cutter locations of the run so far.
    path: Vec<[i32; 3]>,
    /// The board's report of the end of the run.
    halted: Option<Status>,
}

impl Desk {
    /// Opens a session with a board that has just been switched on.
    fn new() -> Self {
        let mut desk = Self {
            host: Host::default(),
            board: Board::new(),
            path: Vec::new(),
            halted: None,
        };
        let steps = StepConfig::DEFAULT.check().unwrap();
        desk.board.real_time().set_step_pins(steps, [9, 11, 13]);
        desk.board.receive(&desk.host.next(&HELLO));
        desk.collect();
        desk.ask(Request::Report(Report::Samples)).unwrap();
        desk.ticks(1);
        desk
    }

    /// Switches the drives on, and declares the position of the axes.
    fn homed(home_nm: [i32; 3]) -> Self {
        let mut desk = Self::new();
        desk.ask(Request::Drives { on: true }).unwrap();
        desk.ask(Request::SetHome { home_nm }).unwrap();
        desk
    }

    fn collect(&mut self) -> Option<Result<(), Reason>> {
        let mut answer = None;
        for reply in self.host.read(&self.board.take_sent()) {
            match reply {
                Reply::Samples { samples, .. } => {
                    self.path.extend(samples.iter().map(|record| record.0.cl_nm));
                }
                Reply::Halted(status) => self.halted = Some(status),
                Reply::Ack { .. } => answer = Some(Ok(())),
                Reply::Nak { reason, .. } => answer = Some(Err(reason)),
                _ => {}
            }
        }
        answer
    }

    fn ask(&mut self, request: Request) -> Result<(), Reason> {
        let frame = self.host.next(&request);
        self.board.receive(&frame);
        self.collect().unwrap()
    }

    fn load(&mut self, (header, words): (Header, Vec<i32>)) {
        for request in upload(header, &words) {
            self.ask(request).unwrap();
        }
    }

    fn steps(&mut self) -> [i32; 3] {
        self.board.real_time().steps().unwrap().position()
    }

    /// Runs a number of ticks. No axis makes more steps in a tick than its maximum velocity allows, 40 per millisecond.
    fn ticks(&mut self, ticks: u32) {
        for _ in 0..ticks {
            let before = self.steps();
            self.board.tick();
            for (before, after) in before.into_iter().zip(self.steps()) {
                assert!(
                    (after - before).abs() <= 41,
                    "{before} to {after} steps in a tick"
                );
            }
            self.collect();
        }
    }

    fn start(&mut self) -> Result<(), Reason> {
        (self.halted, self.path) = (None, Vec::new());
        self.ask(Request::Start)
    }

    /// Starts a run and waits for its end.
    fn run(&mut self) -> Status {
        self.start().unwrap();
        loop {
            self.ticks(1);
            if let Some(status) = self.halted {
                return status;
            }
        }
    }

    /// Starts a run and waits until it is on the second pass.
    fn running(&mut self) {
        self.start().unwrap();
        while self.board.status().pass < 1 || self.board.status().state != State::Running {
            self.ticks(1);
        }
        self.ticks(200);
        assert_eq!(self.board.status().state, State::Running);
    }

    /// Waits for standstill.
    fn stopped(&mut self, state: State) -> [i32; 3] {
        while self.board.status().state.is_under_way() {
            self.ticks(1);
        }
        assert_eq!(self.board.status().state, state);
        // The steps of the last periods are not emitted yet.
        self.ticks(2);
        self.board.real_time().last().cl_nm
    }

    /// Presses and releases the emergency stop, and recovers from it up to, but not including, the declaration of home.
    fn emergency_stop(&mut self) {
        self.board.simulate(InputLines::EMERGENCY_STOP);
        self.ticks(1);
        self.board.simulate(InputLines::NONE);
        self.ticks(DEBOUNCE_TICKS);
        self.ask(Request::Acknowledge).unwrap();
        self.ask(Request::Abort).unwrap();
        self.ask(Request::Drives { on: true }).unwrap();
        self.ticks(1);
        self.stopped(State::Ready);
    }
}

/// A position in steps at the default 400 steps per millimetre; it must be a whole number of steps.
fn in_steps(place_nm: [i32; 3]) -> [i32; 3] {
    place_nm.map(|nm| {
        assert_eq!(nm % 2500, 0);
        nm / 2500
    })
}

fn elsewhere(home_nm: [i32; 3], stands_nm: Option<[i32; 3]>) -> Result<(), Reason> {
    Err(Reason::NotAtHome { home_nm, stands_nm })
}

#[test]
fn a_home_is_where_the_pulses_count_from() {
    let mut desk = Desk::homed(HOME_NM);
    assert_eq!(desk.steps(), in_steps(HOME_NM));
    assert_eq!(desk.board.real_time().steps().unwrap().target_nm(), HOME_NM);
    // A change of the steps per millimetre keeps the position.
    let mut config = StepConfig::DEFAULT;
    config.axes[2].steps = 200;
    desk.ask(Request::StepConfig(config.into())).unwrap();
    let [x, y, z] = in_steps(HOME_NM);
    assert_eq!(desk.steps(), [x, y, z / 2]);
    desk.ask(Request::SetHome {
        home_nm: ELSEWHERE_NM,
    })
    .unwrap();
    let [x, y, z] = in_steps(ELSEWHERE_NM);
    assert_eq!(desk.steps(), [x, y, z / 2]);
}

#[test]
fn a_job_that_begins_elsewhere_is_refused() {
    let mut desk = Desk::homed([0; 3]);
    desk.load(within_limits(HOME_NM));
    assert_eq!(desk.start(), elsewhere(HOME_NM, Some([0; 3])));
    desk.ticks(100);
    assert_eq!((desk.board.status().state, desk.steps()), (State::Ready, [0; 3]));
    // A difference of 1 nm is refused too, because the path is exact.
    let near = [HOME_NM[0], HOME_NM[1] + 1, HOME_NM[2]];
    desk.ask(Request::SetHome { home_nm: near }).unwrap();
    assert_eq!(desk.start(), elsewhere(HOME_NM, Some(near)));
    desk.ask(Request::SetHome { home_nm: HOME_NM }).unwrap();
    assert_eq!(desk.run().state, State::Finished);
    assert_eq!(
        (desk.path.first(), desk.path.last()),
        (Some(&HOME_NM), Some(&HOME_NM))
    );
    desk.ticks(2);
    assert_eq!(desk.steps(), in_steps(HOME_NM));
    // The axes now stand at this home, and any job with the same home starts.
    desk.load(within_limits(HOME_NM));
    assert_eq!(desk.run().state, State::Finished);
    desk.load(within_limits(ELSEWHERE_NM));
    assert_eq!(desk.start(), elsewhere(ELSEWHERE_NM, Some(HOME_NM)));
}

/// If another home is declared between the acknowledgement of a start and its period, no run begins.
#[test]
fn a_start_that_waits_does_not_meet_another_home() {
    let mut desk = Desk::homed(HOME_NM);
    desk.load(within_limits(HOME_NM));
    desk.start().unwrap();
    desk.ask(Request::SetHome {
        home_nm: ELSEWHERE_NM,
    })
    .unwrap();
    desk.ticks(50);
    let halted = desk.halted.unwrap();
    assert_eq!((halted.state, halted.samples), (State::Ready, 0));
    assert_eq!(desk.steps(), in_steps(ELSEWHERE_NM));
}

#[test]
fn a_run_that_was_given_up_begins_again_where_the_axes_stand() {
    let mut desk = Desk::homed(HOME_NM);
    desk.load(within_limits(HOME_NM));
    desk.running();
    desk.ask(Request::Abort).unwrap();
    let at = desk.stopped(State::Ready);
    assert_ne!(at, HOME_NM);
    desk.running();
    assert_eq!(desk.path.first(), Some(&at));
    desk.ask(Request::Abort).unwrap();
    let at = desk.stopped(State::Ready);
    // A job that is loaded again is a new job, and requires its home.
    desk.load(within_limits(HOME_NM));
    assert_eq!(desk.start(), elsewhere(HOME_NM, Some(at)));
    desk.load(within_limits(at));
    assert_eq!(desk.run().state, State::Finished);
    assert_eq!((desk.path.first(), desk.path.last()), (Some(&at), Some(&at)));
}

/// The axes were moved by hand: the next run does not use the position at which the last one ended.
#[test]
fn after_an_emergency_stop_a_run_begins_where_home_is_declared() {
    let mut desk = Desk::homed(HOME_NM);
    desk.load(within_limits(HOME_NM));
    desk.running();
    desk.emergency_stop();
    desk.ask(Request::SetHome {
        home_nm: ELSEWHERE_NM,
    })
    .unwrap();
    assert_eq!(desk.start(), elsewhere(HOME_NM, Some(ELSEWHERE_NM)));
    desk.ask(Request::SetHome { home_nm: HOME_NM }).unwrap();
    assert_eq!(desk.run().state, State::Finished);
    assert_eq!(desk.path.first(), Some(&HOME_NM));
    desk.ticks(2);
    assert_eq!(desk.steps(), in_steps(HOME_NM));
}

/// With the drives off the axes may have been moved by hand.
#[test]
fn drives_off_forget_where_the_axes_stand() {
    let mut desk = Desk::homed(HOME_NM);
    desk.load(within_limits(HOME_NM));
    desk.running();
    desk.ask(Request::Abort).unwrap();
    desk.stopped(State::Ready);
    desk.ask(Request::Drives { on: false }).unwrap();
    desk.ask(Request::Drives { on: true }).unwrap();
    assert!(matches!(desk.start(), Err(Reason::Unsafe { .. })));
    desk.ask(Request::SetHome { home_nm: HOME_NM }).unwrap();
    desk.running();
    assert_eq!(desk.path.first(), Some(&HOME_NM));
}

#[test]
fn where_no_home_is_required_the_axes_count_as_standing_at_the_jobs() {
    let mut desk = Desk::new();
    let free = Configuration {
        homing_required: false,
        ..Configuration::DEFAULT
    };
    desk.ask(Request::Configure(free)).unwrap();
    desk.ask(Request::Drives { on: true }).unwrap();
    // In the period of the start the position becomes the job's home without a step.
    let begin = |desk: &mut Desk, home_nm| {
        desk.start().unwrap();
        desk.board.tick();
        assert_eq!(desk.steps(), in_steps(home_nm));
    };
    for home_nm in [HOME_NM, ELSEWHERE_NM] {
        desk.load(within_limits(home_nm));
        begin(&mut desk, home_nm);
        while desk.halted.is_none() {
            desk.ticks(1);
        }
        assert_eq!(
            (desk.path.first(), desk.path.last()),
            (Some(&home_nm), Some(&home_nm))
        );
    }
    // After an abort a run starts from the present position; after an emergency stop the position is unknown.
    desk.running();
    desk.ask(Request::Abort).unwrap();
    let at = desk.stopped(State::Ready);
    desk.running();
    assert_eq!(desk.path.first(), Some(&at));
    desk.emergency_stop();
    begin(&mut desk, ELSEWHERE_NM);
    desk.ask(Request::Abort).unwrap();
    desk.stopped(State::Ready);
    // A declared home is checked although none is required.
    desk.ask(Request::SetHome { home_nm: HOME_NM }).unwrap();
    assert_eq!(desk.start(), elsewhere(ELSEWHERE_NM, Some(HOME_NM)));
}

/// A jog after a run: the next jog, and the next run, begin where it has ended.
#[test]
fn where_no_home_is_required_a_jog_after_a_run_is_not_forgotten() {
    let mut desk = Desk::new();
    let mut profile = super::manual::profile();
    (profile.travel_nm, profile.homing) = (None, None);
    profile.configuration.homing_required = false;
    (
        profile.velocity_mm_s[2],
        profile.acceleration_mm_s2,
        profile.jerk_mm_s3,
    ) = (100.0, [2000.0; 3], [50_000.0; 3]);
    desk.ask(Request::SetProfile(Some(profile))).unwrap();
    desk.ask(Request::Drives { on: true }).unwrap();
    desk.load(within_limits(HOME_NM));
    desk.start().unwrap();
    desk.board.tick();
    while desk.halted.is_none() {
        desk.ticks(1);
    }
    let mut at = HOME_NM;
    for _ in 0..2 {
        let nm = [10_000_000, 0, 0];
        let way = JogWay::By { nm };
        desk.ask(Request::Jog {
            way,
            speed_mm_s: 100.0,
        })
        .unwrap();
        while desk.board.real_time().motion().activity != Activity::Rest {
            desk.ticks(1);
        }
        at[0] += nm[0];
        assert_eq!(desk.board.real_time().motion().at_nm, at);
        assert_eq!(desk.steps(), in_steps(at));
    }
    desk.running();
    assert_eq!(desk.path.first(), Some(&at));
}

/// A job without limits has no links between passes, so the position of the axes is unknown after it.
#[test]
fn after_a_job_without_limits_home_is_declared_anew() {
    let mut desk = Desk::new();
    for request in MAKE_READY {
        desk.ask(request).unwrap();
    }
    desk.load(dome());
    desk.start().unwrap();
    while desk.halted.is_none() {
        desk.board.tick();
        desk.collect();
    }
    // The same job runs again without a declaration.
    assert_eq!(desk.start(), Ok(()));
    desk.board.tick();
    desk.ask(Request::Abort).unwrap();
    desk.board.tick();
    desk.load(within_limits(HOME_NM));
    assert_eq!(desk.start(), elsewhere(HOME_NM, None));
    desk.ask(Request::SetHome { home_nm: HOME_NM }).unwrap();
    assert_eq!(desk.run().state, State::Finished);
}
