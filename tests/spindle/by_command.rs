//! Spindle and coolant by command, outside a run and while a start waits.

use controller::spindle::output;
use interp_core::State;
use protocol::message::{InputLines, PWM_STEPS, Reason, Request, SpindleOrder, Turning};

use super::{AT_SPEED, Desk, MAX_RPM, ON, with_contact};

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

/// A spindle that a command has switched on is the run's from its start on: the host is missed after the profile's time, and not after a second.
#[test]
fn a_spindle_by_command_does_not_shorten_the_link_timeout_of_the_run_after_it() {
    let mut desk = Desk::ready();
    desk.hold_after(3_000);
    desk.ask(&Request::Spindle(SpindleOrder::OFF)).unwrap();
    desk.ask(&Request::Turn {
        turning: Turning::Clockwise,
        rpm: 6_000,
    })
    .unwrap();
    desk.ask(&Request::Start).unwrap();
    desk.ticks(2_500);
    let status = desk.status();
    assert!(
        status.state.is_under_way() && !status.safety.link_timed_out,
        "{status:?}"
    );
    desk.ticks(1_000);
    assert!(desk.status().safety.link_timed_out);
}
