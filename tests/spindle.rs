//! Spindle and coolant: on from the start of a run to its end, at speed before the first motion, off whenever the run ends or the host is gone.

mod by_command;
mod contact;

use controller::in_process::Board;
use controller::spindle::output;
use integration_tests::{HELLO, Host, LIMITS, dome, upload};
use interp_core::{AxisLimits, RunStart, SpanParameter, State};
use protocol::message::{
    Activity, AtSpeed, Configuration, DoorContact, InputLines, LinkTimeoutAction, MotionStatus, PWM_STEPS,
    Reason, Reply, Request, SpindleOrder, SpindleSettings, Status, Turning,
};

const AT_SPEED: u32 = 300;
const MAX_RPM: u32 = 24_000;
const ORDER: SpindleOrder = SpindleOrder {
    turning: Turning::Counterclockwise,
    rpm: 12_000,
    coolant: true,
};
/// A half of the speed, counterclockwise, with coolant and drives.
const ON: u32 = output::DRIVES
    | output::SPINDLE
    | output::COUNTERCLOCKWISE
    | output::COOLANT
    | (PWM_STEPS / 2) << output::DUTY_SHIFT;

struct Desk {
    host: Host,
    board: Board<64>,
    halts: u32,
}

impl Desk {
    /// A board with a spindle and a job within limits that uses it, ready to start.
    fn ready() -> Self {
        let mut desk = Self {
            host: Host::default(),
            board: Board::new(),
            halts: 0,
        };
        desk.board.receive(&desk.host.next(&HELLO));
        desk.board.take_sent();
        let mut profile = super::manual::profile();
        profile.travel_nm = None;
        profile.homing = None;
        profile.spindle = Some(SpindleSettings {
            max_rpm: MAX_RPM,
            at_speed_ticks: AT_SPEED,
            stops_at_pause: true,
            at_speed: AtSpeed::ByTime,
        });
        desk.ask(&Request::SetProfile(Some(profile))).unwrap();
        desk.load();
        desk.ask(&Request::Drives { on: true }).unwrap();
        let home_nm = LIMITS.home_nm;
        desk.ask(&Request::SetHome { home_nm }).unwrap();
        desk.ask(&Request::Spindle(ORDER)).unwrap();
        desk
    }

    fn load(&mut self) {
        let (mut header, words) = dome();
        header.axes = Some(AxisLimits {
            velocity_mm_s: [100.0, 100.0, 50.0],
            acceleration_mm_s2: [1000.0, 1000.0, 500.0],
            jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
            ..LIMITS
        });
        for request in upload(header, &words) {
            self.ask(&request).unwrap();
        }
    }

    /// A run is held after this many periods without a host.
    fn hold_after(&mut self, link_timeout_ticks: u32) {
        let hold = Configuration {
            on_link_timeout: LinkTimeoutAction::Hold,
            link_timeout_ticks,
            ..Configuration::DEFAULT
        };
        self.ask(&Request::Configure(hold)).unwrap();
    }

    fn ticks(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.board.tick();
        }
        let sent = self.board.take_sent();
        let halted = |reply: &&Reply| matches!(reply, Reply::Halted(_));
        self.halts += self.host.read(&sent).iter().filter(halted).count() as u32;
    }

    fn answer(&mut self, request: &Request) -> Reply {
        self.ticks(0);
        self.board.receive(&self.host.next(request));
        let sent = self.board.take_sent();
        let reply = self.host.read(&sent).pop().unwrap();
        self.ticks(1);
        reply
    }

    fn ask(&mut self, request: &Request) -> Result<(), Reason> {
        match self.answer(request) {
            Reply::Ack { .. } => Ok(()),
            Reply::Nak { reason, .. } => Err(reason),
            other => panic!("{other:?}"),
        }
    }

    fn status(&mut self) -> Status {
        self.board.status()
    }

    fn motion(&mut self) -> MotionStatus {
        self.board.real_time().motion()
    }

    fn outputs(&mut self) -> u32 {
        self.board.real_time().outputs()
    }

    fn running(mut self) -> Self {
        self.ask(&Request::Start).unwrap();
        self.ticks(AT_SPEED + 100);
        assert!(self.status().state.is_under_way());
        assert_eq!(self.outputs(), ON);
        self
    }
}

#[test]
fn a_run_begins_when_the_spindle_is_at_speed() {
    let mut desk = Desk::ready();
    assert_eq!(desk.outputs(), output::DRIVES);
    desk.ask(&Request::Start).unwrap();
    assert_eq!(desk.outputs(), ON);
    assert_eq!(desk.motion().activity, Activity::SpinUp);
    desk.ticks(AT_SPEED - 2);
    assert_eq!(desk.status().state, State::Ready);
    assert_eq!(
        desk.ask(&Request::Spindle(SpindleOrder::OFF)),
        Err(Reason::Moving)
    );
    desk.ticks(2);
    assert_eq!(desk.status().state, State::Linking);
    assert_eq!((desk.outputs(), desk.motion().activity), (ON, Activity::Rest));
}

#[test]
fn every_end_of_a_run_switches_it_off() {
    for end in [Request::Stop, Request::Abort] {
        let mut desk = Desk::ready().running();
        desk.ask(&end).unwrap();
        desk.ticks(4000);
        assert_eq!(
            (desk.status().state, desk.outputs()),
            (State::Ready, output::DRIVES)
        );
    }
    for (lines, outputs) in [
        (InputLines::EMERGENCY_STOP, 0),
        (InputLines(1 << 10), 0),
        (InputLines::limit(0, true), output::DRIVES),
    ] {
        let mut desk = Desk::ready().running();
        desk.board.simulate(lines);
        desk.ticks(1500);
        assert_eq!((desk.status().state, desk.outputs()), (State::Faulted, outputs));
    }
}

#[test]
fn a_start_that_waits_can_be_taken_back() {
    let mut desk = Desk::ready();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(10);
    desk.ask(&Request::Stop).unwrap();
    desk.ticks(2);
    assert_eq!((desk.outputs(), desk.halts), (output::DRIVES, 1));
    desk.ticks(1000);
    assert_eq!(desk.status().state, State::Ready);
    // Neither does it turn when an input forbids the start meanwhile.
    desk.ask(&Request::Start).unwrap();
    desk.ticks(10);
    desk.board.simulate(InputLines::EMERGENCY_STOP);
    desk.ticks(2);
    assert_eq!(desk.outputs(), 0);
    desk.ticks(1000);
    assert_eq!((desk.outputs(), desk.status().state), (0, State::Ready));
}

/// Off by command while a start waits for it: the run does not begin without a spindle.
#[test]
fn a_spindle_switched_off_takes_back_the_start_that_waits_for_it() {
    let mut desk = Desk::ready();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(10);
    let off = Request::Turn {
        turning: Turning::Off,
        rpm: 0,
    };
    desk.ask(&off).unwrap();
    assert_eq!((desk.outputs(), desk.halts), (output::DRIVES, 1));
    desk.ticks(2 * AT_SPEED);
    assert_eq!((desk.status().state, desk.halts), (State::Ready, 1));
    assert_eq!(desk.outputs(), output::DRIVES);
}

/// A start at a pass that was taken back, or whose spindle was too slow: the next one begins with the first pass.
#[test]
fn a_start_that_never_began_leaves_no_place_to_the_next() {
    let at_pass = Request::StartAt(RunStart {
        pass: 3,
        path: SpanParameter::NONE,
    });
    let begins_at = |mut desk: Desk, start: &Request| {
        desk.board.simulate(InputLines::AT_SPEED);
        desk.ask(start).unwrap();
        for _ in 0..20_000 {
            desk.ticks(1);
            if desk.status().state == State::Running {
                return desk.status().pass;
            }
        }
        panic!("{:?}", desk.status());
    };
    assert_eq!(begins_at(Desk::ready(), &at_pass), 3);

    let mut desk = Desk::ready();
    desk.ask(&at_pass).unwrap();
    desk.ticks(10);
    desk.ask(&Request::Stop).unwrap();
    desk.ticks(2);
    assert_eq!(begins_at(desk, &Request::Start), 0);

    let mut desk = with_contact();
    desk.ask(&at_pass).unwrap();
    desk.ticks(AT_SPEED + 10);
    assert_eq!(desk.status().state, State::Faulted);
    desk.ask(&Request::Abort).unwrap();
    desk.ticks(2);
    assert_eq!(begins_at(desk, &Request::Start), 0);
}

#[test]
fn a_run_held_because_the_host_is_gone_stands_without_it() {
    let mut desk = Desk::ready();
    desk.hold_after(1000);
    let mut desk = desk.running();
    desk.ticks(2500);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
    desk.ask(&Request::Resume).unwrap();
    assert_eq!(desk.outputs(), ON);
    desk.ticks(AT_SPEED - 2);
    assert_eq!(desk.status().state, State::Held);
    desk.ticks(3);
    assert!(matches!(desk.status().state, State::Running | State::Linking));
    // The operator's own hold leaves it on.
    desk.ask(&Request::Hold).unwrap();
    desk.ticks(800);
    assert_eq!((desk.status().state, desk.outputs()), (State::Held, ON));
}

/// A resume that is sent again while the spindle comes up to speed waits for the rest of the time.
#[test]
fn a_resume_that_is_sent_twice_waits_for_the_spindle() {
    let mut desk = Desk::ready().running();
    desk.ask(&Request::Pause).unwrap();
    desk.ticks(3000);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
    for _ in 0..3 {
        desk.ask(&Request::Resume).unwrap();
        desk.ticks(AT_SPEED / 4);
        assert_eq!((desk.status().state, desk.outputs()), (State::Held, ON));
    }
    desk.ticks(AT_SPEED / 4);
    assert!(matches!(desk.status().state, State::Running | State::Linking));
}

#[test]
fn an_order_is_for_one_job_and_within_the_profile() {
    let mut desk = Desk::ready();
    let fast = SpindleOrder {
        rpm: MAX_RPM + 1,
        ..ORDER
    };
    assert!(matches!(
        desk.ask(&Request::Spindle(fast)),
        Err(Reason::OutOfRange { .. })
    ));
    desk.load();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(2);
    assert_eq!(
        (desk.outputs(), desk.status().state),
        (output::DRIVES, State::Linking)
    );
    desk.ask(&Request::Abort).unwrap();
    desk.ticks(500);
    let without = super::manual::profile();
    desk.ask(&Request::SetProfile(Some(without))).unwrap();
    assert_eq!(desk.ask(&Request::Spindle(ORDER)), Err(Reason::NoSpindle));
}

/// A machine whose spindle reports its speed by a contact, and that has a door.
fn with_contact() -> Desk {
    let mut desk = Desk::ready();
    let mut profile = super::manual::profile();
    profile.travel_nm = None;
    profile.homing = None;
    profile.door = DoorContact::NormallyClosed;
    profile.spindle = Some(SpindleSettings {
        max_rpm: MAX_RPM,
        at_speed_ticks: AT_SPEED,
        stops_at_pause: true,
        at_speed: AtSpeed::Closes,
    });
    desk.ask(&Request::SetProfile(Some(profile))).unwrap();
    desk.load();
    desk.ask(&Request::Spindle(ORDER)).unwrap();
    desk
}

impl Desk {
    /// Starts, with a spindle that reports its speed, and runs until a pass is under way.
    fn turning(mut self) -> Self {
        self.board.simulate(InputLines::AT_SPEED);
        self.ask(&Request::Start).unwrap();
        for _ in 0..100 {
            self.ticks(50);
            if self.status().state == State::Running {
                break;
            }
        }
        self.ticks(100);
        assert_eq!((self.status().state, self.outputs()), (State::Running, ON));
        self
    }
}

impl Desk {
    fn motion_z(&mut self) -> i32 {
        self.board.real_time().last().cl_nm[2]
    }
}

impl Desk {
    /// Goes on to the end of the run: where its last pass ended, and the number of passes.
    fn until_over(&mut self) -> (u32, [i32; 3]) {
        let mut last = (0, [0; 3]);
        for _ in 0..400_000 {
            self.board.tick();
            let sample = *self.board.real_time().last();
            if sample.state == State::Running {
                last = (sample.pass, sample.cl_nm);
            }
            if !sample.state.is_under_way() && sample.state == State::Finished {
                self.ticks(1);
                return last;
            }
        }
        panic!("{:?}", self.status());
    }
}

/// A start that waits for its spindle is over when an input forbids it: reported to the host, with the spindle off.
#[test]
fn a_start_that_an_input_forbids_meanwhile_is_over() {
    let mut desk = Desk::ready();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(10);
    desk.board.simulate(InputLines::limit(0, true));
    desk.ticks(10);
    assert_eq!((desk.outputs(), desk.halts), (output::DRIVES, 1));
    desk.board.simulate(InputLines::NONE);
    desk.ticks(AT_SPEED);
    assert_eq!(desk.status().state, State::Ready);
}

/// The host is lost while a run is held: a resume that waits for the spindle is dropped, and a spindle that the operator's hold has left on is off.
#[test]
fn a_held_run_whose_host_is_lost_stands_without_spindle() {
    let mut desk = Desk::ready();
    desk.hold_after(200);
    let mut desk = desk.running();
    desk.ask(&Request::Pause).unwrap();
    desk.ticks(3000);
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(150);
    assert_eq!((desk.status().state, desk.outputs()), (State::Held, ON));
    desk.ticks(2 * AT_SPEED);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
    assert!(desk.status().safety.link_timed_out);
    // With a host that stays the resume is carried out.
    desk.ask(&Request::Resume).unwrap();
    for _ in 0..4 {
        desk.ticks(100);
        desk.answer(&Request::Status);
    }
    assert!(matches!(desk.status().state, State::Running | State::Linking));

    let mut desk = Desk::ready();
    desk.hold_after(1000);
    let mut desk = desk.running();
    desk.ask(&Request::Hold).unwrap();
    desk.ticks(800);
    assert_eq!((desk.status().state, desk.outputs()), (State::Held, ON));
    desk.ticks(300);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
}

/// A hold takes back a resume that waits for the spindle; the axes' status tells that it waits.
#[test]
fn a_resume_that_waits_can_be_taken_back() {
    let mut desk = Desk::ready().running();
    desk.ask(&Request::Pause).unwrap();
    desk.ticks(3000);
    let held = Err(Reason::WrongState { state: State::Held });
    assert_eq!(desk.ask(&Request::Hold), held);
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(10);
    assert_eq!((desk.motion().activity, desk.outputs()), (Activity::SpinUp, ON));
    assert_eq!(desk.ask(&Request::Spindle(ORDER)), held);
    desk.ask(&Request::Hold).unwrap();
    desk.ticks(2 * AT_SPEED);
    let rests = (State::Held, Activity::Rest, output::DRIVES);
    assert_eq!(
        (desk.status().state, desk.motion().activity, desk.outputs()),
        rests
    );
    // A pause and a stop take it back, too.
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(10);
    desk.ask(&Request::Pause).unwrap();
    desk.ticks(2 * AT_SPEED);
    assert_eq!(
        (desk.status().state, desk.motion().activity, desk.outputs()),
        rests
    );
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(AT_SPEED + 2);
    assert!(matches!(desk.status().state, State::Running | State::Linking));
    desk.ask(&Request::Stop).unwrap();
    desk.ticks(4000);
    assert_eq!(desk.status().state, State::Ready);
}

/// A pause that is held on its way up: the spindle turns until the tool is above the surface, and not longer.
#[test]
fn a_pause_that_is_held_on_its_way_up_stops_the_spindle_at_its_end() {
    let mut desk = Desk::ready().running();
    for _ in 0..100 {
        desk.ticks(50);
        if desk.status().state == State::Running {
            break;
        }
    }
    desk.ticks(100);
    desk.ask(&Request::Pause).unwrap();
    while desk.status().state != State::Linking {
        desk.ticks(1);
    }
    desk.ticks(10);
    desk.ask(&Request::Hold).unwrap();
    desk.ticks(500);
    assert_eq!((desk.status().state, desk.outputs()), (State::Held, ON));
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(3000);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
    desk.ask(&Request::Resume).unwrap();
    assert_eq!(desk.outputs(), ON);
    desk.ticks(AT_SPEED + 2);
    assert!(matches!(desk.status().state, State::Running | State::Linking));
}
