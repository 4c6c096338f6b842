use super::*;
use crate::{
    manual::{Motion, Setup},
    safety::Order,
};
use interp_core::{
    encode,
    job::{AxisLimits, Header},
    steps::StepConfig,
};
use protocol::message::{
    Activity, Configuration, DoorContact, JogWay, MotionEnd, MotionStatus, PassDigest, Profile,
};
use std::vec::Vec;

pub(super) const HOME_NM: [i32; 3] = [-2_500, 5_000, 20_000_000];
pub(super) const DRIVES_ON: Order = Order::Drives { on: true };

/// A plate of 10 mm x 10 mm, level at the origin; with limits, from this home.
pub(super) fn with_plate(home_nm: Option<[i32; 3]>) -> RealTime<[i32; 64]> {
    let mut c = [[[0.0; 4]; 4]; 3];
    (c[0][1][0], c[1][0][1]) = (10.0, 10.0);
    let c = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
    let one = encode::width(1.0).unwrap();
    let patch = encode::polynomial(&c, Default::default()).unwrap();
    let axes = home_nm.map(|home_nm| AxisLimits {
        velocity_mm_s: [100.0; 3],
        acceleration_mm_s2: [1000.0; 3],
        jerk_mm_s3: [20_000.0; 3],
        chord_mm: 0.005,
        overrun_mm: 0.0,
        travel_nm: [[i32::MIN, i32::MAX]; 3],
        home_nm,
        plunge_mm: 1.0,
        end_nm: None,
        end_height_nm: 0,
        safe_z_nm: 20_000_000,
    });
    let header = Header {
        path_spans: 1,
        side_spans: 1,
        ball_radius_mm: 5.0,
        feed_mm_s: 10.0,
        scallop_mm: 0.1,
        period_s: 0.001,
        axes,
        ..Header::default()
    };
    let mut half = RealTime::new();
    let words: Vec<i32> = [one, one].into_iter().chain(patch.to_words()).collect();
    half.load_begin(&header, u32::try_from(words.len()).unwrap())
        .unwrap();
    half.load_words(0, &words).unwrap();
    half.load_check(0).unwrap();
    half.load_finish().unwrap();
    half.set_step_pins(StepConfig::DEFAULT.check().unwrap(), [0, 1, 2]);
    half
}

pub(super) fn order(half: &mut RealTime<[i32; 64]>, order: Order) {
    half.order(order).unwrap();
}

/// A queue with places for this number of events.
struct Queue {
    places: usize,
    events: Vec<Event>,
}

impl Events for Queue {
    fn has_room(&self) -> bool {
        self.places >= Self::TICK_MAX
    }

    fn put(&mut self, event: Event) -> bool {
        let is_kept = self.places > 0;
        if is_kept {
            self.places -= 1;
            self.events.push(event);
        }
        is_kept
    }
}

/// One period, with the pulses of its sample and its planning.
fn tick(half: &mut RealTime<[i32; 64]>, events: &mut impl Events) {
    half.tick(TickInput::default(), events);
    let mut slots = [half.steps().unwrap().rest(); BUFFER_WORDS];
    half.pulses(&mut slots);
    half.plan();
}

/// Axes with this scale, homed at the origin, on a jog of x by 50 mm at 100 mm/s; with pulses of 5 slots, of which a period holds 100.
fn jogging(steps_per_mm: u32) -> RealTime<[i32; 64]> {
    let mut steps = StepConfig::DEFAULT;
    steps.pulse_slots = 5;
    for axis in &mut steps.axes {
        axis.steps = steps_per_mm;
    }
    let profile = Profile {
        steps: steps.into(),
        velocity_mm_s: [100.0; 3],
        acceleration_mm_s2: [1000.0; 3],
        jerk_mm_s3: [20_000.0; 3],
        travel_nm: None,
        configuration: Configuration::DEFAULT,
        homing: None,
        probe_inverted: false,
        spindle: None,
        step_inverted: 0,
        enable_inverted: 0,
        door: DoorContact::None,
    };
    let mut half = with_plate(None);
    half.set_steps(&steps.check().unwrap()).unwrap();
    order(&mut half, Order::SetUp(Some(Setup::new(&profile, 0.001))));
    order(&mut half, DRIVES_ON);
    order(&mut half, Order::SetHome { home_nm: [0; 3] });
    let way = JogWay::By {
        nm: [50_000_000, 0, 0],
    };
    let jog = Motion::Jog {
        way,
        speed_mm_s: 100.0,
    };
    order(&mut half, Order::Move(jog));
    half
}

/// Until the axes rest: how the motion ended.
fn until_rest(half: &mut RealTime<[i32; 64]>) -> MotionStatus {
    for _ in 0..2_000 {
        tick(half, &mut Vec::new());
        if half.motion().activity == Activity::Rest {
            return half.motion();
        }
    }
    panic!("{:?}", half.motion());
}

/// 128 steps in a period that holds 100: the axis would fall behind, and go on without a ramp after the motion is over.
#[test]
fn a_jog_with_more_steps_than_a_period_holds_stops_along_its_ramp() {
    for (steps_per_mm, end) in [(900, MotionEnd::Done), (1280, MotionEnd::StepRate)] {
        let mut half = jogging(steps_per_mm);
        let motion = until_rest(&mut half);
        assert_eq!(motion.end, end);
        let [x_nm, ..] = motion.at_nm;
        assert_eq!(x_nm == 50_000_000, end == MotionEnd::Done);
        // No step is lost, and none is left.
        let [steps, ..] = half.steps().unwrap().position();
        let off_nm = i64::from(steps) * 1_000_000 / i64::from(steps_per_mm) - i64::from(x_nm);
        assert!(off_nm.abs() <= 1_000, "{off_nm}");
        assert!(half.status().safety.homed);
    }
}

/// Pulses that were not emitted: the axes are not where the position says.
#[test]
fn pulses_that_are_not_emitted_end_a_jog_and_lose_the_position() {
    let mut half = jogging(400);
    for _ in 0..100 {
        tick(&mut half, &mut Vec::new());
    }
    half.controlled_stop(Fault::new(FaultKind::StepOutput, 0.0));
    assert!(!half.status().safety.homed);
    let motion = until_rest(&mut half);
    assert_eq!((motion.end, motion.homed_axes), (MotionEnd::StepOutput, 0));
    assert!(motion.at_nm[0] < 50_000_000);
    assert_eq!(half.interpolator.stands_nm(), None);
    assert!(!half.status().safety.homed);
}

/// A run of the plate, on its first pass.
fn running(clock: Clock) -> RealTime<[i32; 64]> {
    let mut half = with_plate(Some(HOME_NM));
    order(&mut half, DRIVES_ON);
    order(&mut half, Order::SetHome { home_nm: HOME_NM });
    let mut events = Vec::new();
    for instruction in [
        Instruction::Clock(clock),
        Instruction::Report(Report::Samples),
        Instruction::Command(Command::Start),
        Instruction::Run { ticks: 100_000 },
    ] {
        half.obey(instruction, &mut events);
        tick(&mut half, &mut events);
    }
    for _ in 0..20_000 {
        tick(&mut half, &mut events);
        if half.last().state == State::Running && half.last().tick > 0 {
            return half;
        }
    }
    panic!("{:?}", half.status());
}

/// What is reported of an abort where a tick finds this number of places.
fn aborted(clock: Clock, places: usize) -> (Vec<PassDigest>, usize) {
    let mut half = running(clock);
    let mut queue = Queue {
        places,
        events: Vec::new(),
    };
    half.obey(Instruction::Command(Command::Abort), &mut queue);
    for _ in 0..2_000 {
        queue.places = places;
        tick(&mut half, &mut queue);
    }
    assert_eq!(half.last().state, State::Ready);
    let passes = queue.events.iter().filter_map(|event| match event {
        Event::Pass(pass) => Some(*pass),
        _ => None,
    });
    let halts = queue
        .events
        .iter()
        .filter(|event| matches!(event, Event::Halted(_)));
    (passes.collect(), halts.count())
}

/// The journal takes a reported pass for complete until the end of its run is reported: a pass that was cut short is reported only with that end.
#[test]
fn a_pass_that_was_cut_short_is_reported_with_the_end_of_its_run_only() {
    for places in 0..8 {
        let (passes, halts) = aborted(Clock::Free, places);
        assert_eq!(halts, places.min(1), "{places}");
        assert!(passes.is_empty() || halts > 0, "{places}: {passes:?}");
        assert_eq!(passes.len(), usize::from(places >= Queue::TICK_MAX), "{places}");
    }
    // In lockstep none is lost, whatever else the tick reports.
    let (passes, halts) = aborted(Clock::Lockstep, Queue::TICK_MAX);
    assert_eq!((passes.len(), halts), (1, 1));
}
