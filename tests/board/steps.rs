//! The steps of a run, and step settings sent over the line.

use integration_tests::{dome, upload};
use interp_core::{
    fault::FaultKind,
    sample::State,
    steps::{AxisSteps, StepConfig},
};
use protocol::message::{Clock, Reason, Reply, Report, Request, StepSettings};

use super::Desk;

/// Settings with this number of steps per millimetre of x; y and z by default.
fn steps_of_x(steps: u32) -> StepConfig {
    let mut config = StepConfig::DEFAULT;
    config.axes[0] = AxisSteps {
        steps,
        mm: 1,
        inverted: false,
    };
    config
}

/// The axes end at the last sample's position, rounded to the steps per millimetre that the host has set.
#[test]
fn the_axes_make_the_steps_of_the_run() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    let checked = StepConfig::DEFAULT.check().unwrap();
    desk.board.real_time().set_step_pins(checked, [9, 11, 13]);
    desk.accepted(&Request::StepConfig(steps_of_x(99).into()));
    desk.accepted(&Request::Start);
    assert_eq!(desk.run(u32::MAX).state, State::Finished);
    desk.ticks(2);
    let last = desk.samples.last().unwrap().cl_nm;
    let steps = desk.board.real_time().steps().unwrap().position();
    for ((nm, steps), per_mm) in last.into_iter().zip(steps).zip([99, 400, 400]) {
        let off = i64::from(steps) * 1_000_000 - i64::from(nm) * per_mm;
        assert!(
            2 * off.abs() <= 1_000_000 + 8 * per_mm,
            "{steps} steps at {nm} nm"
        );
    }
}

/// 0.8 mm per period at 1000 steps per millimetre are 800 steps, more than a period holds: the run stops along its path, and the
/// remaining steps are emitted in the following periods.
#[test]
fn too_many_steps_stop_the_run_along_its_path() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Samples);
    let fine = steps_of_x(1000);
    desk.board
        .real_time()
        .set_step_pins(fine.check().unwrap(), [9, 11, 13]);
    desk.accepted(&Request::Start);
    let status = desk.run(u32::MAX);
    let fault = status.fault.unwrap();
    assert_eq!(
        (status.state, fault.kind()),
        (State::Faulted, Some(FaultKind::StepRate))
    );
    assert!((600.0..850.0).contains(&fault.value), "{}", fault.value);
    let stopped = desk
        .samples
        .iter()
        .filter(|sample| sample.state == State::Stopping)
        .count();
    assert!((20..=40).contains(&stopped), "{stopped} samples of stopping");
    desk.ticks(40);
    let nm = i64::from(desk.samples.last().unwrap().cl_nm[0]);
    let steps = i64::from(desk.board.real_time().steps().unwrap().position()[0]);
    assert!((steps * 1000 - nm).abs() <= 504, "{steps} steps at {nm} nm");
}

/// Settings out of range are refused, and during a run all settings are.
#[test]
fn steps_are_checked_and_not_changed_under_a_run() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Digests);
    let refusal = |reply| match reply {
        Reply::Nak { reason, .. } => reason,
        other => panic!("{other:?}"),
    };
    let reason = refusal(desk.ask(&Request::StepConfig(steps_of_x(500_001).into())));
    let Reason::Job { fault, record } = reason else {
        panic!("{reason:?}");
    };
    assert_eq!(
        (fault.kind(), fault.value, record),
        (Some(FaultKind::BadHeader), 500_001.0, Some(0))
    );
    desk.accepted(&Request::Start);
    desk.run(5);
    let reason = refusal(desk.ask(&Request::StepConfig(steps_of_x(400).into())));
    assert_eq!(
        reason,
        Reason::WrongState {
            state: State::Running
        }
    );
}

/// A job has the settings of its own drives, or the board's: not those of the job before it. The status tells which are in force.
#[test]
fn no_job_inherits_the_steps_of_the_one_before() {
    let mut desk = Desk::loaded(Clock::Lockstep, Report::Digests);
    let own = StepConfig::DEFAULT;
    let checked = own.check().unwrap();
    desk.board.real_time().set_step_pins(checked, [9, 11, 13]);
    let (mut inverted, mut pulse) = (own, own);
    inverted.axes[2].inverted = true;
    pulse.pulse_slots = 3;
    for other in [steps_of_x(100), inverted, pulse] {
        desk.accepted(&Request::StepConfig(other.into()));
        let in_force = |desk: &mut Desk, config: StepConfig| {
            let settings = *desk.board.real_time().steps().unwrap().settings();
            assert_eq!(settings, config.check().unwrap());
            let Reply::Status { status, .. } = desk.ask(&Request::Status) else {
                panic!("no status")
            };
            assert_eq!(status.steps, StepSettings::from(config).digest());
        };
        in_force(&mut desk, other);
        assert_ne!(
            StepSettings::from(other).digest(),
            StepSettings::from(own).digest()
        );
        let (header, words) = dome();
        for request in upload(header, &words) {
            desk.accepted(&request);
        }
        in_force(&mut desk, own);
    }
}
