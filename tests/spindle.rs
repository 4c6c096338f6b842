//! Spindle and coolant: on from the start of a run to its end, at speed before the first motion, off whenever the run ends or the host is gone.

use controller::{in_process::Board, spindle::output};
use integration_tests::{HELLO, Host, dome, upload};
use interp_core::{AxisLimits, FaultKind, RunStart, SpanParameter, State};
use protocol::message::{
    Activity, AtSpeed, Configuration, DoorContact, InputLines, LinkTimeoutAction, MotionStatus, PWM_STEPS,
    PauseCause, Reason, Reply, Request, SpindleOrder, SpindleSettings, Status, Turning,
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
        let home_nm = [0, 0, 50_000_000];
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
            chord_mm: 0.005,
            overrun_mm: 0.0,
            travel_nm: [[i32::MIN, i32::MAX]; 3],
            home_nm: [0, 0, 50_000_000],
            plunge_mm: 2.0,
            end_nm: None,
            end_height_nm: 0,
            safe_z_nm: 40_000_000,
        });
        for request in upload(header, &words) {
            self.ask(&request).unwrap();
        }
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
    let hold = Configuration {
        on_link_timeout: LinkTimeoutAction::Hold,
        link_timeout_ticks: 1000,
        ..Configuration::DEFAULT
    };
    desk.ask(&Request::Configure(hold)).unwrap();
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

#[test]
fn a_start_waits_for_the_spindles_contact() {
    let mut desk = with_contact();
    desk.ask(&Request::Start).unwrap();
    // A report that comes at once is that of another speed.
    desk.board.simulate(InputLines::AT_SPEED);
    desk.ticks(50);
    assert_eq!((desk.status().state, desk.outputs()), (State::Ready, ON));
    desk.board.simulate(InputLines::NONE);
    desk.ticks(150);
    assert_eq!(
        (desk.status().state, desk.motion().activity),
        (State::Ready, Activity::SpinUp)
    );
    desk.board.simulate(InputLines::AT_SPEED);
    desk.ticks(5);
    assert_eq!(desk.status().state, State::Linking);
}

/// A contact that is silent: a fault with a name, before anything moves, and of a resume where the pause has left the tool.
#[test]
fn a_spindle_that_does_not_report_its_speed_is_a_fault() {
    let is_fault = |status: &Status| {
        let kind = status.fault.and_then(|fault| fault.kind());
        status.state == State::Faulted && kind == Some(FaultKind::SpindleSpeed)
    };
    let mut desk = with_contact();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(AT_SPEED - 10);
    assert_eq!(desk.status().state, State::Ready);
    desk.ticks(20);
    let status = desk.status();
    assert!(
        is_fault(&status) && status.samples == 0 && desk.halts == 1,
        "{status:?}"
    );
    assert_eq!(desk.outputs(), output::DRIVES);
    assert!(matches!(
        desk.ask(&Request::Start),
        Err(Reason::WrongState { .. })
    ));
    desk.ask(&Request::Abort).unwrap();
    desk.ticks(2);
    // With its report the same start succeeds.
    let mut desk = desk.turning();
    desk.ask(&Request::Pause).unwrap();
    desk.ticks(3000);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
    desk.board.simulate(InputLines::NONE);
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(AT_SPEED + 10);
    assert!(is_fault(&desk.status()) && desk.halts == 2);
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

/// Below its speed for 0.1 s in the cut: the tool leaves the surface, the spindle is off, and resume waits for its speed. A shorter dip does nothing.
#[test]
fn a_spindle_that_falls_below_its_speed_pauses_the_run() {
    let mut desk = with_contact().turning();
    desk.board.simulate(InputLines::NONE);
    desk.ticks(90);
    desk.board.simulate(InputLines::AT_SPEED);
    desk.ticks(90);
    assert_eq!((desk.status().state, desk.outputs()), (State::Running, ON));
    desk.board.simulate(InputLines::NONE);
    desk.ticks(110);
    assert_ne!(desk.status().state, State::Running);
    desk.ticks(3000);
    let status = desk.status();
    assert_eq!(
        (status.state, status.safety.pause),
        (State::Held, PauseCause::BelowSpeed)
    );
    assert_eq!(desk.outputs(), output::DRIVES);
    // It has left the surface: the dome's top is below.
    assert!(desk.motion_z() >= 40_000_000);
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(150);
    desk.board.simulate(InputLines::AT_SPEED);
    desk.until_over();
    assert_eq!(desk.status().safety.pause, PauseCause::None);
}

impl Desk {
    fn motion_z(&mut self) -> i32 {
        self.board.real_time().last().cl_nm[2]
    }
}

/// The door: the run pauses above the surface with the spindle off; nothing resumes or starts it while it is open; then it goes on to the same sample.
#[test]
fn an_open_door_pauses_the_run_and_lets_nothing_resume_it() {
    let whole = {
        let mut desk = with_contact().turning();
        desk.until_over()
    };
    let mut desk = with_contact().turning();
    desk.board.simulate(InputLines::AT_SPEED.or(InputLines::DOOR));
    desk.ticks(3000);
    let status = desk.status();
    assert_eq!(
        (status.state, status.safety.pause),
        (State::Held, PauseCause::Door)
    );
    assert_eq!(desk.outputs(), output::DRIVES);
    assert!(desk.motion_z() >= 40_000_000);
    let is_refused = |came: Result<(), Reason>| match came {
        Err(Reason::Unsafe { fault }) => fault.kind() == Some(FaultKind::DoorOpen),
        _ => false,
    };
    let refused = desk.ask(&Request::Resume);
    assert!(is_refused(refused));
    // Opened again while the spindle comes up to speed.
    desk.board.simulate(InputLines::NONE);
    desk.ticks(5);
    desk.ask(&Request::Resume).unwrap();
    desk.ticks(20);
    assert_eq!(desk.outputs(), ON);
    desk.board.simulate(InputLines::DOOR);
    desk.ticks(20);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Held, output::DRIVES)
    );
    desk.ticks(1000);
    assert_eq!(desk.status().state, State::Held);
    desk.board.simulate(InputLines::AT_SPEED);
    desk.ticks(5);
    desk.ask(&Request::Resume).unwrap();
    let paused = desk.until_over();
    assert_eq!(paused, whole, "the places of the run on the surface");
    // Neither does a run start.
    desk.board.simulate(InputLines::DOOR);
    desk.ticks(5);
    let refused = desk.ask(&Request::Start);
    assert!(is_refused(refused));
    let refused = desk.ask(&Request::Turn {
        turning: Turning::Clockwise,
        rpm: 1,
    });
    assert!(is_refused(refused));
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

/// By command outside a run: on with the drives alone, off without a host, with the drives, an open door, a load; and never in a run.
#[test]
fn a_spindle_by_command_is_on_for_as_long_as_the_host_is_heard() {
    let turn = Request::Turn {
        turning: Turning::Clockwise,
        rpm: 6_000,
    };
    let on = output::DRIVES | output::SPINDLE | (PWM_STEPS / 4) << output::DUTY_SHIFT;
    let mut desk = with_contact();
    desk.ask(&turn).unwrap();
    assert_eq!(desk.outputs(), on);
    for _ in 0..5 {
        desk.ticks(900);
        desk.answer(&Request::Status);
        assert_eq!(desk.outputs(), on);
    }
    desk.ask(&Request::Coolant { on: true }).unwrap();
    assert_eq!(desk.outputs(), on | output::COOLANT);
    let probe = Request::Probe {
        axis: 2,
        nm: -1000,
        speed_mm_s: 1.0,
    };
    assert_eq!(desk.ask(&probe), Err(Reason::SpindleTurns));
    desk.ticks(990);
    assert_eq!(desk.outputs(), on | output::COOLANT);
    desk.ticks(20);
    assert_eq!(
        desk.outputs(),
        output::DRIVES,
        "the host was not heard for a second"
    );
    for (lines, outputs) in [
        (InputLines::DOOR, output::DRIVES),
        (InputLines::EMERGENCY_STOP, 0),
    ] {
        let mut desk = with_contact();
        desk.ask(&turn).unwrap();
        desk.board.simulate(lines);
        desk.ticks(5);
        assert_eq!(desk.outputs(), outputs, "{lines:?}");
    }
    desk.ask(&turn).unwrap();
    desk.ask(&Request::Drives { on: false }).unwrap();
    assert_eq!(desk.outputs(), 0);
    assert_eq!(desk.ask(&turn), Err(Reason::DrivesOff));
    let fast = Request::Turn {
        turning: Turning::Clockwise,
        rpm: MAX_RPM + 1,
    };
    desk.ask(&Request::Drives { on: true }).unwrap();
    assert!(matches!(desk.ask(&fast), Err(Reason::OutOfRange { .. })));
    // In a run the spindle is the job's; the coolant is the operator's.
    let mut desk = with_contact().turning();
    assert!(matches!(desk.ask(&turn), Err(Reason::WrongState { .. })));
    desk.ask(&Request::Coolant { on: false }).unwrap();
    assert_eq!(desk.outputs(), ON & !output::COOLANT);
    desk.ask(&Request::Pause).unwrap();
    desk.ticks(3000);
    desk.ask(&Request::Resume).unwrap();
    assert_eq!(desk.outputs(), ON & !output::COOLANT, "for the rest of the run");
    desk.ticks(AT_SPEED);
    desk.ask(&Request::Abort).unwrap();
    desk.ticks(3000);
    assert_eq!(
        (desk.status().state, desk.outputs()),
        (State::Ready, output::DRIVES)
    );
    desk.ask(&Request::SetHome {
        home_nm: [0, 0, 50_000_000],
    })
    .unwrap();
    desk.ask(&Request::Start).unwrap();
    assert_eq!(desk.outputs(), ON, "the next run has the job's");
}

/// Switched off while a start waits, the coolant stays off in that run, and the run keeps its spindle although the host is gone.
#[test]
fn a_coolant_switched_while_a_start_waits_is_that_of_its_run() {
    let mut desk = Desk::ready();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(10);
    desk.ask(&Request::Coolant { on: false }).unwrap();
    desk.ticks(AT_SPEED + 2000);
    assert!(desk.status().state.is_under_way());
    assert_eq!(desk.outputs(), ON & !output::COOLANT);
    desk.ask(&Request::Abort).unwrap();
    desk.ticks(3000);
    desk.ask(&Request::Start).unwrap();
    assert_eq!(desk.outputs(), ON);
    desk.ask(&Request::Coolant { on: false }).unwrap();
    desk.ask(&Request::Stop).unwrap();
    desk.ticks(2);
    desk.ask(&Request::Start).unwrap();
    assert_eq!(desk.outputs(), ON, "the start that was taken back is over");
}

/// A start that waits for its spindle is over when an input forbids it: told to the host, with the spindle off.
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
