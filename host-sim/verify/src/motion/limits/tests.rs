//! Figures of motions that are known in closed form.

use super::*;
use job::AxisLimits;

fn machine(velocity: f64, acceleration: f64, jerk: f64) -> MachineSpec {
    MachineSpec {
        limits: Some(AxisLimits {
            velocity_mm_s: [velocity; 3],
            acceleration_mm_s2: [acceleration; 3],
            jerk_mm_s3: [jerk; 3],
        }),
        ..MachineSpec::default()
    }
}

fn nm(mm: f64) -> i32 {
    (mm * 1e6).round() as i32
}

fn near(ours: f64, exact: f64, by: f64) {
    assert!((ours - exact).abs() <= by, "{ours} for {exact}");
}

/// Piecewise constant jerk: duration, s, and jerk, mm/s^3.
type Profile = Vec<(f64, f64)>;

/// From rest to a speed and back to rest at these peaks.
fn to_and_fro(speed: f64, acceleration: f64, jerk: f64) -> Profile {
    let rise = (acceleration / jerk).min((speed / jerk).sqrt());
    let hold = (speed / (jerk * rise) - rise).max(0.0);
    let ramp = |sign: f64| [(rise, sign * jerk), (hold, 0.0), (rise, -sign * jerk)];
    let cruise = [(0.05, 0.0)];
    [&ramp(1.0)[..], &cruise, &ramp(-1.0)].concat()
}

/// Position at a time, with a step of the acceleration and of the velocity at a time of their own.
fn position(profile: &[(f64, f64)], steps: [f64; 2], step_at: f64, t: f64) -> f64 {
    let (mut x, mut v, mut a, mut at) = (0.0, 0.0, 0.0, 0.0);
    for (duration, jerk) in profile {
        let d = (t - at).clamp(0.0, *duration);
        x += v * d + a * d * d / 2.0 + jerk * d * d * d / 6.0;
        v += a * d + jerk * d * d / 2.0;
        a += jerk * d;
        at += duration;
    }
    x += v * (t - at).max(0.0);
    let since = (t - step_at).max(0.0);
    x + steps[0] * since * since / 2.0 + steps[1] * since
}

/// The peaks of a motion on x. `noise`: error of each position, nm, by its tick.
fn peaks_of(
    machine: &MachineSpec,
    position: impl Fn(f64) -> f64,
    end_s: f64,
    noise: impl Fn(u32) -> f64,
) -> Peaks {
    let mut meter = PeakMeter::new(machine);
    meter.start_at_rest([0; 3]);
    let ticks = (end_s / machine.period_s()) as u32;
    for tick in 1..=ticks {
        let x = 1e6 * position(f64::from(tick) * machine.period_s()) + noise(tick);
        meter.add(tick.into(), [x.round() as i32, 0, 0]);
    }
    meter.peaks()
}

/// The worst case of 9.5 nm for a difference of order 3: alternating. And random.
fn noises(seed: u64) -> [Box<dyn Fn(u32) -> f64>; 3] {
    let random = move |tick: u32| {
        let mut bits = seed ^ u64::from(tick).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        bits ^= bits >> 29;
        bits = bits.wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits ^= bits >> 32;
        (bits % 19_001) as f64 / 1000.0 - 9.5
    };
    [
        Box::new(|_| 0.0),
        Box::new(|tick| if tick % 2 == 0 { 9.5 } else { -9.5 }),
        Box::new(random),
    ]
}

/// Jerk limits of ordinary machines, at ordinary accelerations and feeds, at three periods.
fn cases() -> Vec<(MachineSpec, [f64; 3])> {
    let mut cases = Vec::new();
    for jerk in [1000.0, 2000.0, 5000.0, 20_000.0, 80_000.0] {
        for acceleration in [300.0, 1000.0, 3000.0] {
            for period_us in [250.0, 1000.0, 2000.0] {
                let spec = MachineSpec {
                    period_us,
                    ..machine(100.0, acceleration, jerk)
                };
                cases.push((spec, [100.0, acceleration, jerk]));
            }
        }
    }
    cases
}

#[test]
fn a_motion_at_its_limits_is_never_blamed() {
    for (seed, (spec, [velocity, acceleration, jerk])) in (1_u64..).zip(cases()) {
        let profile = to_and_fro(velocity, acceleration, jerk);
        let end: f64 = profile.iter().map(|(duration, _)| duration).sum();
        for noise in noises(seed) {
            let peaks = peaks_of(&spec, |t| position(&profile, [0.0; 2], 0.0, t), end + 0.1, noise);
            for (peak, (name, _)) in peaks.iter().zip(ORDERS) {
                let share = peak.share.unwrap();
                assert!(share <= 1.0 + 1e-9, "{name} {share} at {jerk} {acceleration}");
                assert_ne!(peak.verdict, Verdict::Violated);
            }
            // The velocity is reached for 50 ms, longer than every base.
            assert!(peaks[0].share.unwrap() > 0.99, "{:?}", peaks[0]);
            let reported = peaks[2].verdict == Verdict::Met;
            // The jerk has a verdict unless the acceleration's ramp is shorter than the base that the noise needs.
            assert!(
                reported || acceleration / jerk < 0.012,
                "{jerk} {acceleration} {peaks:?}"
            );
            assert!(peaks[2].uncertainty <= ERROR_SHARE || !reported);
        }
    }
}

#[test]
fn a_motion_above_its_limits_is_found() {
    for (seed, (spec, [velocity, acceleration, jerk])) in (1_u64..).zip(cases()) {
        for (order, by) in [(0, 1.03), (1, 1.08), (2, 1.15)] {
            let mut at = [velocity, acceleration, jerk];
            at[order] *= by;
            if order == 2 && acceleration / jerk < 0.02 {
                continue; // Too short for the jerk's base, see above.
            }
            if order == 1 && acceleration * acceleration / jerk > 0.9 * velocity {
                continue; // The acceleration is not reached.
            }
            let profile = to_and_fro(at[0], at[1], at[2]);
            let reached = profile[0].0 * profile[0].1;
            assert!(order != 1 || reached > acceleration, "{reached}");
            let end: f64 = profile.iter().map(|(duration, _)| duration).sum();
            for noise in noises(seed) {
                let peaks = peaks_of(&spec, |t| position(&profile, [0.0; 2], 0.0, t), end + 0.1, noise);
                assert_eq!(
                    peaks[order].verdict,
                    Verdict::Violated,
                    "{order}: {at:?} {peaks:?}"
                );
                let sentence = &failures(&peaks)[0];
                assert!(sentence.starts_with("x uses 1."), "{sentence}");
            }
        }
    }
}

/// Breaks without a ramp, in the middle of a motion within its limits.
#[test]
fn breaks_are_found_and_where_they_are() {
    for (seed, (spec, [velocity, acceleration, jerk])) in (1_u64..).zip(cases()) {
        let base_s = required_s(2, jerk).max(spec.period_s());
        if base_s > STEP_SHARE * acceleration / jerk {
            continue;
        }
        let profile = to_and_fro(0.6 * velocity, 0.5 * acceleration, 0.5 * jerk);
        let step_at = 0.0301;
        // A step of the acceleration that the judged base resolves (bases are up to 1.5 times the one required, in whole periods); a
        // step of the velocity that takes more than the acceleration limit within a period.
        let step = (2.0 * jerk * (1.5 * base_s + spec.period_s())).min(acceleration);
        let speed_step = 1.3 * acceleration * (1.5 * required_s(1, acceleration) + spec.period_s());
        for steps in [[step, 0.0], [0.0, speed_step]] {
            for noise in noises(seed) {
                let peaks = peaks_of(
                    &spec,
                    |t| position(&profile, steps, step_at, t),
                    step_at + 0.02,
                    noise,
                );
                let order = if steps[0] > 0.0 { 2 } else { 1 };
                assert_eq!(
                    peaks[order].verdict,
                    Verdict::Violated,
                    "{spec:?} {steps:?} {peaks:?}"
                );
                let found_s = peaks[order].ticks[0] as f64 * spec.period_s();
                assert!(found_s >= step_at && found_s <= step_at + 0.02, "{found_s}");
            }
        }
    }
}

#[test]
fn where_no_base_can_it_says_so() {
    // The acceleration is reached within 1 ms: a base of 3 ms, as the jerk's 5 % require, sees nothing of it.
    let spec = machine(100.0, 100.0, 100_000.0);
    let shaken = |t: f64| 0.02 * (1.0 - (t * 60.0).cos());
    let peaks = peaks_of(&spec, shaken, 0.5, |tick| if tick % 2 == 0 { 9.0 } else { -9.0 });
    assert_eq!(peaks[2].verdict, Verdict::Unknown, "{peaks:?}");
    let reported = failures(&peaks).join("; ");
    assert!(
        reported.contains("cannot tell whether x keeps its jerk limit"),
        "{reported}"
    );
    // At rest nothing is above anything, whatever the base.
    assert_eq!(peaks_of(&spec, |_| 0.0, 0.5, |_| 0.0)[2].verdict, Verdict::Met);
    // A velocity step is a violation on any base.
    let broken = peaks_of(&spec, |t| 5.0 * (t - 0.1).max(0.0), 0.2, |_| 0.0);
    assert_eq!(broken[2].verdict, Verdict::Violated);
    assert_eq!(broken[1].verdict, Verdict::Violated);
}

#[test]
fn rest_has_no_peaks() {
    let mut gauge = PeakMeter::new(&machine(1.0, 1.0, 1.0));
    gauge.start_at_rest([5, 5, 5]);
    for tick in 0..100_u64 {
        let up = if tick % 2 == 0 { 9 } else { -9 };
        gauge.add(tick, [5 + up, 5, 5]);
    }
    gauge.end_at_rest();
    for peak in gauge.peaks() {
        assert_eq!(peak.share, Some(0.0));
    }
}

/// A step of velocity v is an acceleration of v / T and a jerk of v / T^2 in one period.
#[test]
fn a_start_without_a_ramp_counts_only_from_standstill() {
    let run = |from_standstill: bool| {
        let mut gauge = PeakMeter::new(&machine(20.0, 1000.0, 20_000.0));
        if from_standstill {
            gauge.start_at_rest([0; 3]);
        }
        for tick in 1..50_i32 {
            gauge.add(tick as u64, [0, 10_000 * tick, 0]);
        }
        gauge
    };
    let mut gauge = run(false);
    near(gauge.peaks()[0].share.unwrap(), 0.5, 1e-3);
    assert_eq!(gauge.peaks()[1].share, Some(0.0));
    // A stop from full speed.
    gauge.end_at_rest();
    near(gauge.peaks()[1].axes[1], 1e4 - 40.0, 1e-6);
    near(gauge.peaks()[2].axes[1], 1e7 - 80_000.0, 1e-3);
    assert_eq!(failures(&gauge.peaks()).len(), 2);
    let gauge = run(true);
    near(gauge.peaks()[2].share.unwrap(), (1e7 - 80_000.0) / 2e4, 1e-6);
    assert_eq!((gauge.peaks()[1].axis, gauge.peaks()[1].ticks[1]), (1, 1));
    let mut apart = run(false);
    apart.discontinuity();
    apart.add(60, [1_000_000, 0, 0]);
    apart.add(61, [1_010_000, 0, 0]);
    near(apart.peaks()[0].share.unwrap(), 0.5, 1e-3);
}

/// A circle of radius R at speed v: v, v^2 / R, v^3 / R^2 on each of its axes.
#[test]
fn a_circle_has_its_exact_peaks() {
    let (radius, speed) = (25.0, 90.0);
    let mut gauge = PeakMeter::new(&machine(100.0, 500.0, 4000.0));
    for tick in 0..4000_u32 {
        let angle = f64::from(tick) * 1e-3 * speed / radius;
        gauge.add(
            tick.into(),
            [0, nm(radius * angle.cos()), nm(radius * angle.sin())],
        );
    }
    let [velocity, acceleration, jerk] = gauge.peaks();
    near(velocity.axes[2], speed, 0.05);
    near(acceleration.axes[1], 324.0, 0.5);
    // 8 ms are the base of 4000 mm/s^3, 12 and 16 ms the next ones.
    near(jerk.axes[1], speed.powi(3) / radius.powi(2), 0.03 * 1166.0);
    assert!(failures(&gauge.peaks()).is_empty());
    assert!(velocity.axes[0] == 0.0 && velocity.share.unwrap() < 0.91);
}

#[test]
fn without_limits_peaks_have_no_share() {
    let mut gauge = PeakMeter::new(&MachineSpec::default());
    for tick in 0..10_i32 {
        gauge.add(tick as u64, [3000 * tick, -8000 * tick, 0]);
    }
    let velocity = gauge.peaks()[0];
    near(velocity.axes[1], 8.0, 0.021);
    assert_eq!((velocity.axis, velocity.share), (1, None));
    assert!(failures(&gauge.peaks()).is_empty());
}
