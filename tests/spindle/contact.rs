//! A machine whose spindle reports its speed by a contact, and that has a door.

use controller::spindle::output;
use interp_core::{FaultKind, State};
use protocol::message::{Activity, InputLines, PauseCause, Reason, Request, Status, Turning};

use super::{AT_SPEED, ON, with_contact};

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

/// A resume while the tool slows down for a spindle that fell below its speed is refused: the pause goes on.
#[test]
fn a_spindle_below_its_speed_is_not_resumed_while_the_tool_slows_down() {
    let mut desk = with_contact().turning();
    desk.board.simulate(InputLines::NONE);
    while desk.status().safety.pause == PauseCause::None {
        desk.ticks(1);
    }
    desk.ticks(1);
    let state = State::Holding;
    assert_eq!(desk.status().state, state);
    assert_eq!(desk.ask(&Request::Resume), Err(Reason::WrongState { state }));
    desk.ticks(3000);
    let status = desk.status();
    assert_eq!(
        (status.state, status.safety.pause, desk.outputs()),
        (State::Held, PauseCause::BelowSpeed, output::DRIVES)
    );
    assert!(desk.motion_z() >= 40_000_000);
}
