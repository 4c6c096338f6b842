use super::*;

const ESTOP: InputLines = InputLines::EMERGENCY_STOP;
const X_PLUS: InputLines = InputLines(1 << 2);
const FAULT_Y: InputLines = InputLines(1 << 8);

/// A board on which a run may start.
fn ready() -> Safety {
    let mut safety = Safety::NEW;
    for order in [Order::Drives { on: true }, Order::SetHome { home_nm: [1, 2, 3] }] {
        assert_eq!(safety.obey(order, State::Ready), Ok(()));
    }
    assert_eq!(may_start(&safety.status), Ok(()));
    safety
}

/// One tick, as called by the real-time half.
fn tick(safety: &mut Safety, lines: InputLines, under_way: bool) -> Option<Stop> {
    if safety.is_unchanged(lines) {
        None
    } else {
        safety.watch(lines, under_way)
    }
}

fn unsafe_because(kind: FaultKind, lines: InputLines) -> Result<(), Reason> {
    let fault = Fault::new(kind, f32::from(lines.0));
    Err(Reason::Unsafe { fault: fault.into() })
}

/// Compared with separate counters, on random inputs that are steady for a while or bounce.
#[test]
fn every_input_is_debounced_by_itself() {
    let mut debounce = Debounce::NEW;
    let (mut steady, mut counts) = ([false; 16], [0_u32; 16]);
    let mut noise = 1_u64;
    let mut changes = 0;
    for _ in 0..100_000 {
        noise = noise.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        // The upper half of the bits changes rarely.
        let raw = (noise >> 33) as u16 & 0x00ff | (noise >> 41) as u16 & (noise >> 50) as u16 & 0xff00;
        debounce.push(raw);
        for bit in 0..16 {
            let differs = (raw >> bit) & 1 != u16::from(steady[bit]);
            counts[bit] = if differs { counts[bit] + 1 } else { 0 };
            if counts[bit] == DEBOUNCE_TICKS {
                steady[bit] = !steady[bit];
                counts[bit] = 0;
                changes += 1;
            }
            assert_eq!((debounce.steady >> bit) & 1 != 0, steady[bit], "bit {bit}");
        }
    }
    assert!(changes > 10_000);
}

#[test]
fn an_emergency_stop_of_one_tick_cuts_and_latches() {
    let mut safety = ready();
    let fault = Fault::new(FaultKind::EmergencyStop, 1.0);
    assert_eq!(tick(&mut safety, ESTOP, true), Some(Stop::Uncontrolled(fault)));
    assert!(!safety.drives_on() && safety.home_nm().is_none());
    let asserted = unsafe_because(FaultKind::EmergencyStop, ESTOP);
    // After the release the contact bounces.
    for _ in 1..DEBOUNCE_TICKS {
        assert_eq!(safety.obey(Order::Acknowledge, State::Faulted), asserted);
        tick(&mut safety, InputLines::NONE, false);
    }
    assert_eq!(safety.obey(Order::Acknowledge, State::Faulted), asserted);
    tick(&mut safety, InputLines::NONE, false);
    // Released and still latched.
    for order in [Order::Drives { on: true }, Order::SetHome { home_nm: [0; 3] }] {
        assert_eq!(safety.obey(order, State::Faulted), asserted);
    }
    assert_eq!(may_start(&safety.status), asserted);
    assert_eq!(safety.obey(Order::Acknowledge, State::Faulted), Ok(()));
    // Drives and home stay off until ordered.
    assert_eq!(may_start(&safety.status), Err(Reason::DrivesOff));
    assert_eq!(
        safety.obey(Order::SetHome { home_nm: [0; 3] }, State::Ready),
        Err(Reason::DrivesOff)
    );
    assert_eq!(safety.obey(Order::Drives { on: true }, State::Ready), Ok(()));
    assert_eq!(
        may_start(&safety.status),
        unsafe_because(FaultKind::NotHomed, InputLines::NONE)
    );
}

#[test]
fn a_drive_fault_cuts_and_a_limit_switch_trips_once_they_are_steady() {
    let cut = Stop::Uncontrolled(Fault::new(FaultKind::DriveFault, 256.0));
    let trip = Stop::Controlled(Fault::new(FaultKind::LimitSwitch, 4.0));
    for (lines, stop, latched) in [(FAULT_Y, cut, FAULT_Y), (X_PLUS, trip, InputLines::NONE)] {
        let mut safety = ready();
        for _ in 1..DEBOUNCE_TICKS {
            assert_eq!(tick(&mut safety, lines, true), None);
        }
        // Pulses shorter than the debounce time have no effect, in any number.
        assert_eq!(tick(&mut safety, InputLines::NONE, true), None);
        for _ in 1..DEBOUNCE_TICKS {
            assert_eq!(tick(&mut safety, lines, true), None);
        }
        assert_eq!(tick(&mut safety, lines, true), Some(stop));
        assert_eq!(safety.status.latched, latched);
        assert_eq!(safety.drives_on(), latched.is_none());
        assert_eq!(safety.home_nm().is_some(), latched.is_none());
        assert!(may_start(&safety.status).is_err());
        for _ in 0..DEBOUNCE_TICKS {
            tick(&mut safety, InputLines::NONE, false);
        }
        assert_eq!(may_start(&safety.status).is_ok(), latched.is_none());
    }
}

#[test]
fn drives_off_lose_the_home_and_no_order_is_taken_under_way() {
    let mut safety = ready();
    assert_eq!(safety.home_nm(), Some([1, 2, 3]));
    for state in State::ALL.into_iter().filter(|state| state.is_under_way()) {
        for order in [
            Order::Configure(Configuration::DEFAULT),
            Order::Drives { on: false },
            Order::Drives { on: true },
            Order::SetHome { home_nm: [0; 3] },
        ] {
            assert_eq!(safety.obey(order, state), Err(Reason::WrongState { state }));
        }
    }
    assert_eq!(safety.home_nm(), Some([1, 2, 3]));
    safety.obey(Order::Drives { on: false }, State::Ready).unwrap();
    safety.obey(Order::Drives { on: true }, State::Ready).unwrap();
    assert_eq!(safety.home_nm(), None);
}

/// Ticks until the link timeout requires a hold; `None` if not within the given number.
fn ticks_until_hold(safety: &mut Safety, clock: Clock, states: &[State]) -> Option<usize> {
    for (tick, &state) in states.iter().enumerate() {
        if !safety.is_unchanged(InputLines::NONE)
            && safety.check_link_timeout(clock, state, state == State::Running)
        {
            return Some(tick + 1);
        }
    }
    None
}

#[test]
fn a_host_that_is_gone_is_noticed_on_time_and_only_in_a_run_on_a_free_clock() {
    let patient = |on_link_timeout, link_timeout_ticks| {
        let mut safety = ready();
        let configuration = Configuration {
            homing_required: true,
            on_link_timeout,
            link_timeout_ticks,
        };
        safety
            .obey(Order::Configure(configuration), State::Ready)
            .unwrap();
        safety
    };
    let running = [State::Running; 100];
    let mut safety = patient(LinkTimeoutAction::Hold, 20);
    assert_eq!(ticks_until_hold(&mut safety, Clock::Free, &running[..19]), None);
    safety.heard(false);
    assert!(!safety.status.link_timed_out);
    assert_eq!(ticks_until_hold(&mut safety, Clock::Free, &running), Some(20));
    assert!(safety.status.link_timed_out);
    safety.begin_run();
    assert!(!safety.status.link_timed_out);
    // During a state transition the hold is repeated until the state accepts it.
    let mut way = [State::Holding; 100];
    way[50] = State::Running;
    let mut safety = patient(LinkTimeoutAction::Hold, 20);
    assert_eq!(ticks_until_hold(&mut safety, Clock::Free, &way), Some(51));

    let mut safety = patient(LinkTimeoutAction::Finish, 20);
    assert_eq!(ticks_until_hold(&mut safety, Clock::Free, &running), None);
    assert!(safety.status.link_timed_out);
    let mut safety = patient(LinkTimeoutAction::Hold, 0);
    assert_eq!(ticks_until_hold(&mut safety, Clock::Free, &running), None);
    assert!(!safety.status.link_timed_out);
    let mut safety = patient(LinkTimeoutAction::Hold, 20);
    assert_eq!(ticks_until_hold(&mut safety, Clock::Lockstep, &running), None);
    for state in [State::Idle, State::Ready, State::Finished, State::Faulted] {
        assert_eq!(ticks_until_hold(&mut safety, Clock::Free, &[state; 100]), None);
    }
    assert!(!safety.status.link_timed_out);
}
