//! Compares pulses with ideal times in exact integers: the midpoints between steps on a straight line from sample to sample.

use super::*;
use std::vec::Vec;

/// Step pins of the axes; the other pins of the port must not change.
const PINS: [u8; 3] = [9, 11, 13];

/// Record of one axis's step pin.
#[derive(Clone, Default)]
struct Pin {
    high: bool,
    /// Slots of the last edges, counted from the start.
    rose: Option<u64>,
    /// Slot at whose beginning the direction last changed.
    turned: Option<u64>,
    level: bool,
    steps: i64,
    /// Slots of the rising edges in the last period.
    rises: Vec<u64>,
}

/// Model of a port that outputs the slots and asserts the drive's timing: pulse length, pause, set-up.
struct Port {
    steps: Steps,
    slots: [u32; BUFFER_WORDS],
    config: StepConfig,
    periods: u64,
    pins: [Pin; 3],
    /// Axes whose pulses are low, one bit each.
    low: u8,
}

impl Port {
    fn new(config: StepConfig) -> Self {
        Self::with_low(config, 0)
    }

    fn with_low(config: StepConfig, low: u8) -> Self {
        let mut steps = Steps::new(config.check().unwrap(), PINS);
        steps.set_low_pulses(low);
        Self {
            low,
            slots: [steps.rest(); BUFFER_WORDS],
            steps,
            config,
            periods: 0,
            pins: Default::default(),
        }
    }

    /// One period in which the axes move to this position.
    fn go(&mut self, cl_nm: [i32; 3]) -> Result<()> {
        let done = self.steps.step(cl_nm, &mut self.slots);
        let begin = self.periods * u64::from(SLOTS);
        for (axis, pin) in self.pins.iter_mut().enumerate() {
            let level = self.steps.directions() >> axis & 1 == 1;
            if level != pin.level {
                assert!(!pin.high, "the direction changes within a pulse");
                pin.level = level;
                pin.turned = Some(begin);
            }
            pin.rises.clear();
        }
        let rest = self.steps.rest();
        let pins = PINS.iter().fold(0, |bits, pin| bits | 1 << pin);
        for (slot, word) in (begin..).zip(&mut self.slots[..SLOTS as usize]) {
            // Each pin is either set or reset, and no other is touched.
            assert_eq!((*word >> 16, *word & 0xffff & !pins), (!*word & pins, 0));
            for (axis, pin) in self.pins.iter_mut().enumerate() {
                let is_pulse = *word >> PINS[axis] & 1 != u32::from(self.low >> axis & 1);
                pin.take(slot, is_pulse, axis, &self.config);
            }
            *word = rest;
        }
        self.periods += 1;
        let counted = self.pins.each_ref().map(|pin| pin.steps);
        assert_eq!(counted, self.steps.position().map(i64::from));
        done
    }

    /// Sets the position of the axes.
    fn place(&mut self, cl_nm: [i32; 3]) {
        self.steps.place(cl_nm);
        for (pin, position) in self.pins.iter_mut().zip(self.steps.position()) {
            pin.steps = position.into();
        }
    }

    /// Whether the axes are within half a step (plus the hysteresis) of a position, in exact integers.
    fn is_at(&self, cl_nm: [i32; 3]) -> bool {
        let each = self.steps.position().into_iter().zip(cl_nm).zip(self.config.axes);
        each.into_iter().all(|((sent, nm), axis)| {
            let (n, d) = (i128::from(axis.steps), i128::from(axis.mm) * 1_000_000);
            let off = 2 * (i128::from(sent) * d - i128::from(nm) * n);
            off.abs() <= d + (2 * n * i128::from(HOLD_NM)).min(d / 2)
        })
    }
}

impl Pin {
    fn take(&mut self, slot: u64, high: bool, axis: usize, config: &StepConfig) {
        let pulse = u64::from(config.pulse_slots);
        let since = self.rose.map(|rose| slot - rose);
        match (self.high, high) {
            (false, true) => {
                assert!(since.is_none_or(|since| since >= 2 * pulse), "{since:?}");
                let setup = self.turned.map(|turned| slot - turned);
                assert!(
                    setup.is_none_or(|setup| setup >= u64::from(TURN_SLOTS) + u64::from(config.setup_slots))
                );
                self.rose = Some(slot);
                self.rises.push(slot);
                let negative = self.level != config.axes[axis].inverted;
                self.steps += if negative { -1 } else { 1 };
            }
            (true, false) => assert_eq!(since, Some(pulse)),
            _ => {}
        }
        self.high = high;
    }
}

/// Pseudo-random numbers (xorshift64*).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) % end
    }

    /// At least 1, log-uniform.
    fn magnitude(&mut self, bits: u64) -> i64 {
        let order = self.below(bits);
        1 + self.below(1 << order) as i64
    }

    fn within(&mut self, most: i64) -> i64 {
        self.below(2 * most as u64 + 1) as i64 - most
    }
}

fn config(ratios: [(u32, u32); 3], pulse_slots: u8, setup_slots: u16) -> StepConfig {
    StepConfig {
        axes: ratios.map(|(steps, mm)| AxisSteps {
            steps,
            mm,
            inverted: steps % 2 == 1,
        }),
        pulse_slots,
        setup_slots,
    }
}

/// Maximum distance of an axis's pulses from their ideal times in this period, thousandths of a slot.
fn unevenness(port: &Port, axis: usize, from: i32, to: i32, before: i64) -> i128 {
    let (n, d) = (
        i128::from(port.config.axes[axis].steps),
        i128::from(port.config.axes[axis].mm) * 1_000_000,
    );
    let (x0, x1) = (2 * n * i128::from(from), 2 * n * i128::from(to));
    let way = if x1 < x0 { -1 } else { 1 };
    let rises = port.pins[axis].rises.iter().zip(0..);
    let off = rises.map(|(rose, index): (&u64, i128)| {
        // The midpoint between this step and the next, and the time at which the line crosses it; all values doubled.
        let middle = (2 * (i128::from(before) + way * index) + way) * d;
        let rose = 1000 * i128::from(rose - (port.periods - 1) * u64::from(SLOTS)) + 500;
        (rose - 1000 * i128::from(SLOTS) * (middle - x0) / (x1 - x0)).abs()
    });
    off.max().unwrap_or(0)
}

/// Half a slot, the quantisation error, plus f32 rounding.
const UNEVENNESS_MAX: i128 = 502;

#[test]
fn pulses_lie_where_the_line_crosses() {
    // Steps per millimetre, and speeds in nm per period: from one step in 400 periods to 499 per period.
    let ratios = [(400, 1), (3200, 5), (16_000, 127)];
    let mut random = Random(7);
    for round in 0..60 {
        let most = [1_248_000, 779_000, 3_960_000];
        let mut speed = [0_i64; 3];
        let mut port = Port::new(config(ratios, 1, 0));
        let mut at = [-900_000_000, -900_000_000, -900_000_000_i32];
        port.place(at);
        // The first period sets the direction; its pulses are distributed.
        at = at.map(|at| at + 10_000);
        port.go(at).unwrap();
        for period in 0..80 {
            for (speed, most) in speed.iter_mut().zip(most) {
                *speed = match round % 3 {
                    // constant velocity, slow or fast
                    0 if period == 0 => random.magnitude(19),
                    0 => *speed,
                    // accelerating
                    1 => (*speed + random.below(40_000) as i64).min(most),
                    // arbitrary
                    _ => random.below(most as u64) as i64,
                };
            }
            let to = [0, 1, 2].map(|axis| at[axis] + speed[axis] as i32);
            let before = port.steps.position();
            port.go(to).unwrap();
            assert!(port.is_at(to));
            for axis in 0..3 {
                let off = unevenness(&port, axis, at[axis], to[axis], before[axis].into());
                assert!(
                    off <= UNEVENNESS_MAX,
                    "{off} round {round} period {period} axis {axis}"
                );
            }
            at = to;
        }
    }
}

#[test]
fn slow_pulses_are_even_from_period_to_period() {
    // 2500 nm per step at 7 nm per period: one step in 357 periods.
    for way in [1, -1] {
        let mut port = Port::new(config([(400, 1); 3], 1, 0));
        let mut rises = Vec::new();
        for period in 1..8000 {
            port.go([7 * way * period, 0, 0]).unwrap();
            rises.extend_from_slice(&port.pins[0].rises);
        }
        assert!(rises.len() > 20);
        for pair in rises.windows(2).skip(1) {
            let distance = 1000 * 2500 * u64::from(SLOTS) / 7;
            assert!((1000 * (pair[1] - pair[0])).abs_diff(distance) <= 1002);
        }
    }
}

#[test]
fn three_axes_at_the_highest_rates() {
    for steps in [400, 499, 500] {
        let mut port = Port::new(StepConfig {
            setup_slots: 0,
            ..StepConfig::DEFAULT
        });
        port.go([2833, 2833, -2833]).unwrap();
        for period in 1..300 {
            let at = period * steps * 2500 + 2833;
            port.go([at, at, -at]).unwrap();
            assert!(port.pins.iter().all(|pin| pin.rises.len() == steps as usize));
        }
    }
}

#[test]
fn too_many_steps_are_a_fault_and_none_is_lost() {
    let mut port = Port::new(StepConfig::DEFAULT);
    let at = [501 * 2500, -12 * 2500, 7 * 2500];
    let fault = port.go(at).unwrap_err();
    assert_eq!(fault, Fault::new(FaultKind::StepRate, 501.0));
    assert!(!port.is_at(at));
    port.go(at).unwrap();
    assert!(port.is_at(at));
    // From one end of the travel to the other, with up to and beyond the maximum steps per period.
    let far = [i32::MAX, 0, 0];
    port.place([i32::MIN, 0, 0]);
    let steps = 2 * 2_147_483_648_u64 / 2500;
    let mut faults = 0;
    for _ in 0..=steps / 500 + 1 {
        faults += u32::from(port.go(far).is_err());
    }
    assert!(port.is_at(far) && faults > 3000);
}

#[test]
fn turning_keeps_count_setup_and_pauses_at_every_speed() {
    for (pulse, setup) in [(1, 20), (1, 0), (3, 50), (24, 480), (5, 3)] {
        let mut port = Port::new(config([(400, 1), (640, 3), (399, 1)], pulse, setup));
        let most = 500 / i32::from(pulse);
        let room = (1000 - 16 - i32::from(setup)) / (2 * i32::from(pulse));
        for steps in 1..=most {
            let to = [steps * 2500, steps * 2500 + 77, -steps * 2500];
            let done = port.go(to);
            let back = port.go([0; 3]);
            // Steps displaced by the set-up time are carried over; a reversal in every period at full speed exceeds the limit.
            if 2 * steps <= room {
                assert!(done.is_ok() && back.is_ok(), "{steps} at {pulse}, {setup}");
            }
            for _ in 0..6 {
                let _ = port.go([0; 3]);
            }
            assert!(port.is_at([0; 3]), "{steps} at {pulse}, {setup}");
        }
    }
}

/// Random walk with random settings; returns the number of steps.
fn walk(random: &mut Random, periods: u32) -> u64 {
    let ratio = |random: &mut Random| match random.below(4) {
        0 => (400, 1),
        1 => (1 + random.below(5000) as u32, 1 + random.below(100) as u32),
        2 => (4_294_967_291, 8590 + random.below(1 << 31) as u32),
        _ => (1 + random.below(400_000) as u32, 1),
    };
    let ratios = [ratio(random), ratio(random), ratio(random)];
    let config = config(ratios, 1 + random.below(24) as u8, random.below(481) as u16);
    let Ok(checked) = config.check() else { return 0 };
    let mut port = Port::with_low(config, random.below(8) as u8);
    let mut at = [0, 1, 2].map(|_| random.within(1_000_000_000) as i32);
    port.place(at);
    let most_nm = ratios.map(|(steps, mm)| {
        let most = u128::from(checked.steps_max()) * u128::from(mm) * 1_000_000 / u128::from(steps);
        most.clamp(1, 5_000_000) as u64
    });
    let begin: Vec<i64> = port.pins.iter().map(|pin| pin.steps).collect();
    let mut made = 0;
    for _ in 0..periods {
        let before: Vec<i64> = port.pins.iter().map(|pin| pin.steps).collect();
        for (at, most) in at.iter_mut().zip(most_nm) {
            let reach = random.magnitude(most.ilog2() as u64 + 2).min(most as i64);
            let to = i64::from(*at) + random.within(reach);
            *at = to.clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        }
        let _ = port.go(at);
        let moved = port
            .pins
            .iter()
            .zip(before)
            .map(|(pin, before)| pin.steps.abs_diff(before));
        made += moved.sum::<u64>();
    }
    // Steps carried over are output.
    for _ in 0..2000 {
        if port.is_at(at) {
            break;
        }
        let _ = port.go(at);
    }
    assert!(port.is_at(at), "{begin:?}, {ratios:?}");
    made
}

#[test]
fn random_walks_lose_no_step() {
    let mut random = Random(0x1234_5678);
    let made: u64 = (0..300).map(|_| walk(&mut random, 60)).sum();
    assert!(made > 100_000, "{made}");
}

#[test]
#[ignore = "a minute; run it after a change here"]
fn random_walks_lose_no_step_long() {
    let mut random = Random(0x8765_4321);
    let made: u64 = (0..20_000).map(|_| walk(&mut random, 200)).sum();
    assert!(made > 10_000_000, "{made}");
}

#[test]
fn a_thousand_million_steps_are_exact() {
    // Sums of travels over far more than 10^9 steps, compared with x n / d in 128 bits.
    let mut random = Random(99);
    for (steps, mm) in [
        (500_000, 1),
        (499_999, 1),
        (4_294_967_291, 8590),
        (16_000, 127),
        (1, 1000),
    ] {
        let scale = Scale::new(steps, mm).unwrap();
        let exact = |nm: i64| {
            let (n, d) = (i128::from(steps), i128::from(mm) * 1_000_000);
            (2 * i128::from(nm) * n + d).div_euclid(2 * d)
        };
        let (mut nm, mut sum, mut way) = (0_i64, 0_i128, 0_u128);
        let mut rest = scale.d / 2;
        for _ in 0..20_000 {
            let to = random.within(i32::MAX.into());
            let made;
            (made, rest) = scale.divide(rest, to - nm);
            (nm, sum, way) = (to, sum + i128::from(made), way + u128::from(made.unsigned_abs()));
            assert_eq!(sum, exact(nm), "{steps}/{mm} at {nm}");
            assert!((0..scale.d).contains(&rest));
        }
        assert!(mm == 1000 || way > 1_000_000_000);
    }
}

#[test]
fn pulses_of_a_long_way_are_exact() {
    long_way(10_000_000);
}

#[test]
#[ignore = "10^9 pulses on three axes; run it after a change here"]
fn pulses_of_a_very_long_way_are_exact() {
    long_way(1_000_000_000);
}

/// Reciprocating motion near the maximum rate, n pulses per axis.
fn long_way(pulses: u64) {
    let mut port = Port::new(config([(16_000, 127), (3200, 7), (500_000, 3)], 1, 20));
    let (mut at, mut made) = ([0_i32; 3], 0_u64);
    let most = [3_900_000, 1_080_000, 2_990];
    let mut way = 1;
    let mut random = Random(5);
    while made < pulses {
        for (at, most) in at.iter_mut().zip(most) {
            *at += way * (most - random.below(most as u64 / 50) as i32);
        }
        port.go(at).unwrap();
        made += port.pins[2].rises.len() as u64;
        if at[0].abs() > 2_000_000_000 {
            port.go(at).unwrap();
            way = -way;
        }
    }
    port.go(at).unwrap();
    assert!(port.is_at(at));
}

#[test]
fn trembling_where_two_steps_meet_makes_no_steps() {
    // 1250 nm is the midpoint between steps 0 and 1.
    let mut port = Port::new(StepConfig::DEFAULT);
    let mut rises = [0; 3];
    for nm in [0, 1249, 1250, 1249, 1251, 1247, 1250, 1247, 1253] {
        port.go([nm, -nm, nm]).unwrap();
        for (rises, pin) in rises.iter_mut().zip(&port.pins) {
            *rises += pin.rises.len();
        }
    }
    assert_eq!(rises, [1; 3]);
    assert_eq!(port.steps.position(), [1, -1, 1]);
    // Beyond the hysteresis the axis steps back, and the hysteresis then applies in the other direction.
    port.go([1245, 0, 0]).unwrap();
    port.go([1245, 0, 0]).unwrap();
    assert_eq!(port.pins[0].steps, 0);
    for nm in [1250, 1253, 1249] {
        port.go([nm, 0, 0]).unwrap();
        assert_eq!(port.pins[0].steps, 0);
    }
    port.go([1254, 0, 0]).unwrap();
    port.go([1254, 0, 0]).unwrap();
    assert_eq!(port.pins[0].steps, 1);
}

#[test]
fn settings_out_of_range_are_refused() {
    let good = StepConfig::DEFAULT;
    assert!(good.check().is_ok());
    let with = |steps, mm| {
        let mut config = good;
        config.axes[1] = AxisSteps {
            steps,
            mm,
            inverted: false,
        };
        config.check().map(|checked| checked.steps_max())
    };
    assert_eq!(with(500_000, 1), Ok(500));
    assert_eq!(with(1, 1000), Ok(500));
    for (steps, mm) in [
        (0, 1),
        (1, 0),
        (500_001, 1),
        (1, 1001),
        (u32::MAX, 1),
        (1, u32::MAX),
    ] {
        assert_eq!(
            with(steps, mm),
            Err(StepConfigError::StepsPerMm { axis: 1, steps, mm })
        );
    }
    for pulse_slots in [0, 25, 255] {
        let config = StepConfig { pulse_slots, ..good };
        assert_eq!(config.check(), Err(StepConfigError::PulseSlots(pulse_slots)));
    }
    let config = StepConfig {
        setup_slots: 481,
        ..good
    };
    assert_eq!(config.check(), Err(StepConfigError::SetupSlots(481)));
}

#[test]
fn new_settings_keep_the_position() {
    let mut port = Port::new(StepConfig::DEFAULT);
    port.go([25_000, 0, 0]).unwrap();
    assert_eq!(port.steps.position()[0], 10);
    let finer = config([(800, 1); 3], 1, 20);
    port.steps.configure(finer.check().unwrap());
    assert_eq!(port.steps.position()[0], 20);
}
