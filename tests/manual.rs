//! Motion outside a job: jog, homing and probing, on the board's own code with a model of the machine: carriages that follow the pulses, switches, a plate.

mod rig;

use integration_tests::PROFILE;
use protocol::message::{
    Activity, DoorContact, Homing, InputLines, JogWay, MotionEnd, NO_AXIS, Offsets, Profile, Reason, Request,
};

use rig::{Fault, Rig};

const MM: i32 = 1_000_000;
/// One step of an axis, nm.
const STEP_NM: i32 = 2_500;

/// Axes of 300, 200 and 80 mm, z homed at the top.
pub(crate) fn profile() -> Profile {
    Profile {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
        travel_nm: Some([[0, 300 * MM], [0, 200 * MM], [-80 * MM, 0]]),
        homing: Some(Homing {
            order: [2, 0, 1],
            at_upper_end: [false, false, true],
            position_nm: [-2 * MM, -2 * MM, 2 * MM],
            seek_mm_s: [40.0, 40.0, 20.0],
            approach_mm_s: [1.0; 3],
            back_off_nm: [3 * MM; 3],
            survives_off: false,
        }),
        ..PROFILE
    }
}

fn jog(way: JogWay) -> Request {
    Request::Jog {
        way,
        speed_mm_s: 1000.0,
    }
}

fn by(axis: usize, mm: i32) -> Request {
    let mut nm = [0; 3];
    nm[axis] = mm * MM;
    jog(JogWay::By { nm })
}

fn towards(signs: [i8; 3]) -> Request {
    jog(JogWay::Towards { signs })
}

const HOME: Request = Request::Home { axes: 0 };

#[test]
fn every_axis_finds_its_switch_wherever_it_stands() {
    for start_mm in [
        [120, 30, -40],
        [0, 0, 0],
        [299, 199, -79],
        [-2, -2, 2],
        [-3, 77, 3],
    ] {
        let mut rig = Rig::homable(start_mm.map(|mm| mm * MM));
        rig.ask(&HOME).unwrap();
        let motion = rig.until_rest();
        assert_eq!(
            (motion.end, motion.homed_axes),
            (MotionEnd::Done, 0b111),
            "{start_mm:?}"
        );
        assert!(rig.status().safety.homed);
        // Where the board believes the axes to be, they are: to a step, and what an axis moves in a period of the approach.
        let off = rig.stands_nm().into_iter().zip(motion.at_nm);
        for (axis, (really, believed)) in off.enumerate() {
            assert!(
                (really - believed).abs() <= STEP_NM + 1_000,
                "{axis}: {really}, {believed}"
            );
        }
        // Off the switches, so that a run can start: 3 mm from each.
        assert!(rig.status().safety.lines.is_none());
        assert_eq!(motion.at_nm, [MM, MM, -MM]);
    }
}

/// A machine without a switch of z: x and y are homed, the travel of x and y is a soft limit, the travel of z is not; a run is refused until z is declared.
#[test]
fn an_axis_without_a_switch_is_declared() {
    let mut rig = Rig::new([120 * MM, 30 * MM, -40 * MM]);
    let mut some = profile();
    some.homing = some.homing.map(|homing| Homing {
        order: [1, 0, NO_AXIS],
        ..homing
    });
    rig.ask(&Request::SetProfile(Some(some))).unwrap();
    rig.ask(&Request::Drives { on: true }).unwrap();
    rig.rest(10);
    assert_eq!(rig.ask(&Request::Home { axes: 0b100 }), Err(Reason::NoHoming));
    rig.ask(&HOME).unwrap();
    let motion = rig.until_rest();
    assert_eq!((motion.end, motion.homed_axes), (MotionEnd::Done, 0b011));
    assert!(!rig.status().safety.homed, "z is not known");
    assert_eq!(motion.at_nm, [MM, MM, 0], "z counts from where it stood");
    assert!(matches!(
        rig.ask(&by(0, -10)),
        Err(Reason::BeyondTravel { axis: 0, .. })
    ));
    // Its travel ends at 0.
    rig.ask(&by(2, 10)).unwrap();
    assert_eq!(rig.until_rest().at_nm, [MM, MM, 10 * MM]);
    let home_nm = [MM, MM, -20 * MM];
    rig.ask(&Request::SetHome { home_nm }).unwrap();
    rig.rest(10);
    assert!(rig.status().safety.homed);
    assert!(matches!(
        rig.ask(&by(2, 30)),
        Err(Reason::BeyondTravel { axis: 2, .. })
    ));
    // Homed anew, the declared axis keeps its place; off, all is lost.
    rig.ask(&HOME).unwrap();
    let motion = rig.until_rest();
    assert_eq!((motion.homed_axes, motion.at_nm), (0b111, home_nm));
    assert!(rig.status().safety.homed);
    rig.ask(&Request::Drives { on: false }).unwrap();
    rig.rest(10);
    assert!(!rig.status().safety.homed);
}

#[test]
fn a_contact_that_bounces_for_some_milliseconds_is_where_it_first_closed() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    rig.fault = Fault::Bounce { ticks: 8 };
    rig.ask(&HOME).unwrap();
    let motion = rig.until_rest();
    assert_eq!(motion.end, MotionEnd::Done);
    assert_eq!(motion.at_nm, [MM, MM, -MM]);
    let off = rig.stands_nm()[0] - motion.at_nm[0];
    assert!(off.abs() <= STEP_NM + 1_000, "{off}");
}

/// Each defect of a switch is found, and named with the input.
#[test]
fn switches_that_stick_bounce_or_are_wired_the_wrong_way_are_named() {
    let x = |is_upper| InputLines::limit(0, is_upper);
    let cases = [
        (Fault::Stuck(x(false)), MotionEnd::Stuck, x(false)),
        (Fault::Never(x(false)), MotionEnd::NotFound, x(false)),
        // The plugs of an axis, and of two axes, are swapped.
        (Fault::Swapped(x(false), x(true)), MotionEnd::WrongSwitch, x(true)),
        (
            Fault::Swapped(x(false), InputLines::limit(1, false)),
            MotionEnd::WrongSwitch,
            InputLines::limit(1, false),
        ),
        // Switches that close when they are pressed.
        (Fault::Opposite, MotionEnd::WrongSwitch, InputLines::LIMITS),
        (Fault::Bounce { ticks: 200 }, MotionEnd::Bounces, x(false)),
        // The motor turns the other way: the axis finds its other end.
        (Fault::Reversed(0), MotionEnd::WrongSwitch, x(true)),
    ];
    for (fault, end, lines) in cases {
        let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
        rig.fault = fault;
        rig.rest(20);
        rig.ask(&Request::Home { axes: 1 }).unwrap();
        let motion = rig.until_rest();
        assert_eq!(motion.end, end, "{fault:?}");
        assert!(motion.lines.has(lines), "{fault:?}: {:?}", motion.lines);
        assert!(!rig.status().safety.homed);
    }
}

#[test]
fn a_jog_goes_its_distance_within_the_travel() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    // Before homing there is no travel: the axes go where the operator sees them go.
    rig.ask(&by(0, -10)).unwrap();
    assert_eq!(rig.until_rest().end, MotionEnd::Done);
    assert!((rig.stands_nm()[0] - 90 * MM).abs() <= STEP_NM);
    rig.ask(&HOME).unwrap();
    rig.until_rest();
    let before = rig.stands_nm();
    rig.ask(&by(1, 50)).unwrap();
    assert_eq!(rig.ask(&by(0, 1)), Err(Reason::Moving));
    assert_eq!(rig.ask(&Request::Drives { on: false }), Err(Reason::Moving));
    let motion = rig.until_rest();
    assert_eq!((motion.end, motion.activity), (MotionEnd::Done, Activity::Rest));
    assert!((rig.stands_nm()[1] - before[1] - 50 * MM).abs() <= STEP_NM);
    let refused = rig.ask(&by(2, 20)).unwrap_err();
    assert!(
        matches!(refused, Reason::BeyondTravel { axis: 2, .. }),
        "{refused}"
    );
    let probe = Request::Probe {
        axis: 3,
        nm: 1,
        speed_mm_s: 1.0,
    };
    assert!(matches!(rig.ask(&probe), Err(Reason::OutOfRange { .. })));
    // Stopped by the operator: along the ramp, and the position stays known.
    rig.ask(&by(0, 250)).unwrap();
    rig.rest(500);
    rig.ask(&Request::Hold).unwrap();
    let motion = rig.until_rest();
    assert_eq!(motion.end, MotionEnd::Stopped);
    assert!((rig.stands_nm()[0] - motion.at_nm[0]).abs() <= STEP_NM + 1_000);
    assert!(
        motion.at_nm[0] > 30 * MM && motion.at_nm[0] < 100 * MM,
        "{motion:?}"
    );
}

#[test]
fn a_continuous_jog_ends_with_its_repetition_and_at_the_travels_end() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    rig.ask(&HOME).unwrap();
    rig.until_rest();
    // Kept going for a second, at 30 repetitions a second.
    for _ in 0..30 {
        rig.ask(&towards([1, 0, 0])).unwrap();
        rig.rest(32);
    }
    let motion = rig.until_rest();
    assert_eq!(motion.end, MotionEnd::HostGone);
    assert!(
        motion.at_nm[0] > 90 * MM && motion.at_nm[0] < 140 * MM,
        "{motion:?}"
    );
    // Held: to the end of the travel, exactly.
    for _ in 0..200 {
        match rig.ask(&towards([1, 0, 0])) {
            Ok(()) => rig.rest(32),
            Err(other) => panic!("{other}"),
        }
        if rig.motion().at_nm[0] == 300 * MM {
            break;
        }
    }
    assert_eq!(rig.until_rest().at_nm[0], 300 * MM);
}

#[test]
fn a_limit_switch_stops_a_jog_and_lets_it_go_back() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    rig.ask(&by(0, -200)).unwrap();
    let motion = rig.until_rest();
    let switch = InputLines::limit(0, false);
    assert_eq!((motion.end, motion.lines), (MotionEnd::LimitSwitch, switch));
    // Along the ramp: 100 mm/s at 1000 mm/s^2 and 20000 mm/s^3.
    assert!(
        (rig.stands_nm()[0] + 2 * MM).abs() < 9 * MM,
        "{:?}",
        rig.stands_nm()
    );
    assert!(matches!(rig.ask(&by(0, -1)), Err(Reason::Unsafe { .. })));
    rig.ask(&by(0, 20)).unwrap();
    assert_eq!(rig.until_rest().end, MotionEnd::Done);
    assert!(rig.status().safety.lines.is_none());
}

#[test]
fn the_emergency_stop_ends_it_at_once() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    rig.ask(&HOME).unwrap();
    rig.until_rest();
    rig.ask(&by(0, 100)).unwrap();
    rig.rest(300);
    rig.pressed = InputLines::EMERGENCY_STOP;
    rig.rest(1);
    let motion = rig.motion();
    assert_eq!(
        (motion.activity, motion.end),
        (Activity::Rest, MotionEnd::DrivesOff)
    );
    assert!(!rig.status().safety.homed && !rig.status().safety.drives_on);
    assert_eq!(motion.homed_axes, 0);
}

/// The position at the touch is latched in the tick, and the axis stops along its ramp.
#[test]
fn a_probe_move_latches_where_the_plate_was_touched() {
    for speed_mm_s in [0.5, 2.0, 10.0] {
        let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
        rig.ask(&HOME).unwrap();
        rig.until_rest();
        let probe = Request::Probe {
            axis: 2,
            nm: -60 * MM,
            speed_mm_s,
        };
        rig.ask(&probe).unwrap();
        let motion = rig.until_rest_within(200_000);
        assert_eq!(motion.end, MotionEnd::Done);
        let tripped = motion.tripped_nm.unwrap();
        // The plate lies at -47.1 mm. The input is read once a period.
        let a_period = (speed_mm_s * 1000.0) as i32;
        assert!(
            (rig::PLATE_NM - tripped).abs() <= 2 * a_period + 2 * STEP_NM,
            "{tripped} at {speed_mm_s}"
        );
        assert!(motion.at_nm[2] <= tripped && motion.at_nm[2] > tripped - MM);
        let short = Request::Probe {
            axis: 2,
            nm: -MM,
            speed_mm_s,
        };
        assert_eq!(rig.ask(&short), Err(Reason::ProbeTripped));
        rig.ask(&by(2, 5)).unwrap();
        rig.until_rest();
        rig.ask(&short).unwrap();
        let motion = rig.until_rest_within(20_000);
        assert_eq!((motion.end, motion.tripped_nm), (MotionEnd::NotTripped, None));
    }
}

/// A NaN would pass every bound but the profile's velocity; at 0 or less the move would take days.
#[test]
fn only_a_finite_speed_above_0_is_one() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    let before = rig.motion();
    let probe = |speed_mm_s| Request::Probe {
        axis: 2,
        nm: -10 * MM,
        speed_mm_s,
    };
    let jog = |speed_mm_s| Request::Jog {
        way: JogWay::By { nm: [MM, 0, 0] },
        speed_mm_s,
    };
    for mm_s in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, -2.0] {
        for request in [probe(mm_s), jog(mm_s)] {
            let refused = rig.ask(&request);
            assert!(
                matches!(refused, Err(Reason::BadSpeed { mm_s: reported }) if reported.to_bits() == mm_s.to_bits()),
                "{request:?}: {refused:?}"
            );
        }
    }
    assert_eq!(rig.motion(), before);
    rig.ask(&jog(2.0)).unwrap();
    assert_eq!(rig.until_rest().end, MotionEnd::Done);
}

#[test]
fn a_board_without_a_profile_moves_nothing() {
    let mut rig = Rig::new([0; 3]);
    rig.ask(&Request::Drives { on: true }).unwrap();
    assert_eq!(rig.ask(&by(0, 1)), Err(Reason::NoProfile));
    let mut without = profile();
    without.homing = None;
    rig.ask(&Request::SetProfile(Some(without))).unwrap();
    assert_eq!(rig.ask(&HOME), Err(Reason::NoHoming));
    rig.ask(&Request::Drives { on: false }).unwrap();
    assert_eq!(rig.ask(&by(0, 1)), Err(Reason::DrivesOff));
}

#[test]
fn a_home_survives_off_only_if_told_so() {
    for survives in [false, true] {
        let mut rig = Rig::new([100 * MM, 100 * MM, -30 * MM]);
        let mut given = profile();
        given.homing = given.homing.map(|homing| Homing {
            survives_off: survives,
            ..homing
        });
        rig.ask(&Request::SetProfile(Some(given))).unwrap();
        rig.ask(&Request::Drives { on: true }).unwrap();
        rig.ask(&HOME).unwrap();
        let at = rig.until_rest().at_nm;
        rig.ask(&Request::Drives { on: false }).unwrap();
        rig.rest(10);
        assert_eq!(rig.status().safety.homed, survives);
        rig.ask(&Request::Drives { on: true }).unwrap();
        assert_eq!(rig.motion().at_nm, at);
        rig.ask(&by(0, 10)).unwrap();
        assert_eq!(rig.until_rest().at_nm[0], at[0] + 10 * MM);
        assert_eq!(rig.status().safety.homed, survives);
    }
}

#[test]
fn offsets_are_kept_through_a_power_cut() {
    let mut rig = Rig::homable([0; 3]);
    assert_eq!(rig.offsets(), Offsets::NONE);
    let offsets = Offsets {
        work_nm: [[1, 2, 3], [-4, 5, -6], [7, 8, i32::MIN]],
        tool_nm: -12_345,
    };
    rig.ask(&Request::SetOffsets(offsets)).unwrap();
    let mut rig = rig.power_cycle();
    assert_eq!(rig.offsets(), offsets);
    assert_eq!(offsets.origin_nm(1), Some([-4, 5, -12_351]));
}

/// Two axes at once: a straight line to a step, and each axis within its own limits.
#[test]
fn a_jog_of_two_axes_is_a_straight_line() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    rig.ask(&HOME).unwrap();
    let [x, y, z] = rig.until_rest().at_nm;
    let nm = [90 * MM, 30 * MM, -15 * MM];
    rig.ask(&jog(JogWay::By { nm })).unwrap();
    let mut before = [[x, y, z]; 3];
    loop {
        rig.rest(1);
        let motion = rig.motion();
        let at = motion.at_nm;
        let way = [at[0] - x, at[1] - y, at[2] - z];
        assert!(
            (way[0] - 3 * way[1]).abs() <= 6 && (way[1] + 2 * way[2]).abs() <= 4,
            "{way:?}"
        );
        for (axis, (most, jerk)) in [(100.0, 20_000.0), (100.0, 20_000.0), (50.0, 10_000.0)]
            .into_iter()
            .enumerate()
        {
            // A request takes a period of its own, so positions are two periods apart.
            let speed = f64::from(at[axis] - before[2][axis]).abs() / 2.0 * 1e-3;
            assert!(speed <= most + 0.01, "{speed} mm/s");
            let third = at[axis] - 3 * before[2][axis] + 3 * before[1][axis] - before[0][axis];
            assert!(f64::from(third).abs() / 8.0 <= jerk * 1e-3 + 8.0, "{third}");
        }
        before = [before[1], before[2], at];
        if motion.activity == Activity::Rest {
            assert_eq!((motion.end, motion.axes), (MotionEnd::Done, 0b111));
            break;
        }
    }
    rig.rest(5);
    for (axis, (really, by)) in rig.stands_nm().into_iter().zip(nm).enumerate() {
        let from = [x, y, z][axis];
        assert!((really - from - by).abs() <= STEP_NM + 1_000, "{axis}");
    }
}

/// Held diagonally against the end of x: the line ends there, and the next key goes on along y alone.
#[test]
fn a_continuous_diagonal_ends_where_one_of_its_axes_ends() {
    let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
    rig.ask(&HOME).unwrap();
    rig.until_rest();
    rig.ask(&by(0, 289)).unwrap();
    rig.until_rest();
    let hold = |rig: &mut Rig| {
        for _ in 0..60 {
            rig.ask(&towards([1, 1, 0])).unwrap();
            rig.rest(32);
        }
        rig.until_rest().at_nm
    };
    let [x, y, _] = hold(&mut rig);
    assert_eq!(x, 300 * MM);
    assert!(y > 11 * MM, "{y}: to the end of x diagonally, then along y");
    // In another direction it does not count as the same jog.
    rig.ask(&towards([-1, 1, 0])).unwrap();
    assert_eq!(rig.ask(&towards([-1, -1, 0])), Err(Reason::Moving));
    assert_eq!(rig.until_rest().end, MotionEnd::HostGone);
}

#[test]
fn the_feed_override_holds_for_jogs() {
    let mut periods = [0; 2];
    for (periods, percent) in periods.iter_mut().zip([100, 25]) {
        let mut rig = Rig::homable([100 * MM, 100 * MM, -30 * MM]);
        rig.ask(&Request::Override { percent }).unwrap();
        rig.ask(&Request::Jog {
            way: JogWay::By { nm: [80 * MM, 0, 0] },
            speed_mm_s: 40.0,
        })
        .unwrap();
        *periods = rig.until_rest().periods;
        rig.ask(&Request::Override { percent: 0 }).unwrap();
        assert_eq!(rig.ask(&by(0, 1)), Err(Reason::NoFeed));
    }
    // 40 and 10 mm/s over 80 mm, and the ramps: 0.09 and 0.045 s.
    assert_eq!(periods.map(|periods| periods / 100), [20, 80], "{periods:?}");
}

/// A machine with a door.
fn with_door(contact: DoorContact) -> Rig {
    let mut rig = Rig::new([100 * MM, 100 * MM, -30 * MM]);
    let door = Profile {
        door: contact,
        ..profile()
    };
    rig.ask(&Request::SetProfile(Some(door))).unwrap();
    rig.ask(&Request::Drives { on: true }).unwrap();
    rig.rest(10);
    rig
}

#[test]
fn an_open_door_stops_a_jog_and_then_allows_a_slow_one() {
    let mut rig = with_door(DoorContact::NormallyClosed);
    rig.ask(&by(0, 150)).unwrap();
    rig.rest(500);
    rig.pressed = InputLines::DOOR;
    let motion = rig.until_rest();
    assert_eq!(motion.end, MotionEnd::Door);
    // Along its ramp: 100 mm/s at 1000 mm/s^2 take about 10 mm.
    let gone = motion.at_nm[0];
    assert!((40 * MM..70 * MM).contains(&gone), "{gone}");
    assert!(rig.status().safety.drives_on);
    rig.ask(&by(0, 66)).unwrap();
    let motion = rig.until_rest();
    assert_eq!(motion.end, MotionEnd::Done);
    // 33 mm/s.
    assert!((2_000..2_100).contains(&motion.periods), "{}", motion.periods);
    rig.pressed = InputLines::NONE;
    rig.rest(10);
    rig.ask(&by(0, -66)).unwrap();
    let motion = rig.until_rest();
    assert!(
        motion.end == MotionEnd::Done && motion.periods < 1_000,
        "{motion:?}"
    );
}

/// Without [door] in the profile the input is not read; the other contact means the opposite.
#[test]
fn the_doors_contact_is_that_of_the_profile() {
    for (contact, pressed, is_open) in [
        (DoorContact::None, InputLines::DOOR, false),
        (DoorContact::NormallyClosed, InputLines::DOOR, true),
        (DoorContact::NormallyClosed, InputLines::NONE, false),
        (DoorContact::NormallyOpen, InputLines::DOOR, false),
        (DoorContact::NormallyOpen, InputLines::NONE, true),
    ] {
        let mut rig = with_door(contact);
        rig.pressed = pressed;
        rig.rest(10);
        assert_eq!(
            rig.status().safety.lines.has(InputLines::DOOR),
            is_open,
            "{contact:?}"
        );
    }
}
