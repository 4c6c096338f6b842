//! Drives, home, inputs and override in a session.

use controller::{machine::Instruction, safety::Order};
use integration_tests::{Call, SAFE};
use interp_core::{
    fault::{Fault, FaultKind},
    sample::State,
};
use protocol::message::{Configuration, InputLines, LinkTimeoutAction, Reason, Request, SafetyStatus};

use super::Line;

fn because(kind: FaultKind, value: f32) -> Reason {
    Reason::Unsafe {
        fault: Fault::new(kind, value).into(),
    }
}

/// A start is refused with the most severe reason; none of the reasons refuses a hold.
#[test]
fn a_start_that_is_not_safe_is_refused_with_the_reason() {
    let lenient = Configuration {
        homing_required: false,
        ..Configuration::DEFAULT
    };
    let lines = |bits| SafetyStatus {
        lines: InputLines(bits),
        ..SAFE
    };
    let table = [
        (SafetyStatus::DEFAULT, Reason::DrivesOff),
        (
            SafetyStatus { homed: false, ..SAFE },
            because(FaultKind::NotHomed, 0.0),
        ),
        (
            SafetyStatus {
                latched: InputLines::EMERGENCY_STOP,
                ..SAFE
            },
            because(FaultKind::EmergencyStop, 1.0),
        ),
        (lines(0x7ff), because(FaultKind::EmergencyStop, 1.0)),
        (lines(0x7fe), because(FaultKind::DriveFault, 1920.0)),
        (lines(0x00a), because(FaultKind::LimitSwitch, 10.0)),
        (
            SafetyStatus {
                configuration: lenient,
                ..SafetyStatus::DEFAULT
            },
            Reason::DrivesOff,
        ),
    ];
    for (safety, reason) in table {
        let mut line = Line::open().in_state(State::Ready);
        line.mock.status.safety = safety;
        assert_eq!(line.refused(&Request::Start), reason, "{safety:?}");
        line.in_state(State::Running).accepted(&Request::Hold);
    }
    let mut line = Line::open().in_state(State::Ready);
    line.mock.status.safety = SafetyStatus {
        homed: false,
        configuration: lenient,
        ..SAFE
    };
    line.accepted(&Request::Start);
}

/// Requests for drives and home reach the machine immediately, and the host gets the reason of a refusal.
#[test]
fn orders_go_to_the_machine_and_its_reasons_back() {
    let configuration = Configuration {
        homing_required: false,
        on_link_timeout: LinkTimeoutAction::Hold,
        link_timeout_ticks: 500,
    };
    let home_nm = [1, -2, i32::MAX];
    let table = [
        (Request::Configure(configuration), Order::Configure(configuration)),
        (Request::Drives { on: true }, Order::Drives { on: true }),
        (Request::Drives { on: false }, Order::Drives { on: false }),
        (Request::SetHome { home_nm }, Order::SetHome { home_nm }),
        (Request::Acknowledge, Order::Acknowledge),
    ];
    for (request, order) in table {
        let mut line = Line::open();
        line.accepted(&request);
        assert_eq!(line.mock.calls, [Call::Order(order)]);
        for reason in [Reason::DrivesOff, because(FaultKind::DriveFault, 128.0)] {
            line.mock.unsafe_because = Some(reason);
            assert_eq!(line.refused(&request), reason);
        }
    }
}

#[test]
fn an_override_has_its_range_and_inputs_are_simulated_only_without_pins() {
    for state in State::ALL {
        let mut line = Line::open().in_state(state);
        for percent in [0, 100, 200] {
            line.accepted(&Request::Override { percent });
            assert_eq!(
                line.mock.calls.last(),
                Some(&Call::Send(Instruction::Override { percent }))
            );
        }
        for percent in [201, 255] {
            let reason = Reason::OutOfRange {
                most: 200,
                wanted: percent.into(),
            };
            assert_eq!(line.refused(&Request::Override { percent }), reason);
        }
        let lines = InputLines(3);
        assert_eq!(line.refused(&Request::Simulate { lines }), Reason::Unsupported);
        line.mock.simulated = true;
        line.accepted(&Request::Simulate { lines });
        assert_eq!(line.mock.calls.last(), Some(&Call::Simulate(lines)));
    }
}
