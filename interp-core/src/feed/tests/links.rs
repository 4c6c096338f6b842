//! Links: the motion of the closed form, and a hold in it.

use std::vec::Vec;

use super::{PLACES, T, optimum};
use crate::feed::curve::{Curve, CurveLimits};
use crate::feed::pace::{Pace, Trajectory};
use crate::feed::profile::Profiles;

/// A hold at a time of a link, and a resume: greatest fractions of velocity, acceleration and jerk, by differences over `apart` periods; and the time of the hold, s.
fn held_link(curve: &Curve, machine: &CurveLimits, at: usize, apart: usize) -> ([f64; 3], f64) {
    let mut cursor = curve.start();
    let mut pace = Pace::REST;
    let mut profiles = Profiles::NONE;
    pace.begin(1.0, T as f32);
    let mut places = std::vec![0.0; 3 * apart];
    let mut rests = None;
    while !curve.is_over(&cursor) {
        let now = places.len();
        if now == at {
            pace.want(0.0, false);
        }
        if now > at && rests.is_none() && pace.is_at_rest() {
            rests = Some(now - at);
            pace.want(1.0, false);
        }
        curve.advance(&mut cursor, pace.tick(&mut profiles) * T as f32);
        places.push(cursor.moved_q10 as f64 / 1024e6);
        for _ in 0..PLACES {
            if pace.has_work() {
                pace.work(curve, &cursor, &mut profiles);
            }
        }
        assert!(now < 1_000_000, "stalls");
    }
    let end = *places.last().unwrap();
    places.extend(std::vec![end; 3 * apart]);
    let differences = |values: &[f64]| -> Vec<f64> {
        let pairs = values.iter().zip(&values[apart..]);
        pairs.map(|(from, to)| (to - from) / (apart as f64 * T)).collect()
    };
    let most = |values: &[f64], limit: f32| {
        values.iter().fold(0.0_f64, |most, x| most.max(x.abs())) / f64::from(limit)
    };
    let speeds = differences(&places);
    let accelerations = differences(&speeds);
    let jerks = differences(&accelerations);
    let used = [
        most(&speeds, machine.speed),
        most(&accelerations, machine.acceleration),
        most(&jerks, machine.jerk),
    ];
    (used, rests.unwrap_or(0) as f64 * T)
}

/// Of links on machines that reach their acceleration within milliseconds and their speed within seconds, too: a slot of a profile may be longer than the
/// change of the acceleration.
#[test]
fn holds_in_links_keep_the_limits() {
    // A time of seconds is rounded to 0.1 us, which is 6 % of 40 mm/s^2 over one period.
    for (speed, acceleration, jerk, apart) in [
        (80.0, 1000.0, 20_000.0, 2),
        (40.0, 40.0, 8_000.0, 4),
        (90.0, 90.0, 16_000.0, 4),
        (80.0, 160.0, 15_000.0, 4),
        (300.0, 200.0, 1e6, 8),
        (50.0, 5_000.0, 1e5, 2),
        (10.0, 5.0, 50.0, 24),
    ] {
        let machine = CurveLimits {
            speed,
            acceleration,
            jerk,
        };
        let mut worst = [0.0_f64; 3];
        let mut longest = 0.0_f64;
        for (length, slow, slow_speed) in [
            (0.4, 0.0, 0.0),
            (5.0, 0.0, 0.0),
            (40.0, 0.0, 0.0),
            (40.0, 2.0, 10.0),
            (400.0, 0.0, 0.0),
        ] {
            let curve = Curve::new(length, &machine, slow, slow_speed);
            let periods = f64::from(curve.duration()) / T;
            for share in 0..40 {
                let at = 3 * apart + (periods * f64::from(share) / 40.0) as usize;
                let (used, rests) = held_link(&curve, &machine, at, apart);
                longest = longest.max(rests);
                for (worst, used) in worst.iter_mut().zip(used) {
                    *worst = worst.max(used);
                }
            }
        }
        std::println!("{machine:?}: {worst:.4?}, {longest:.3} s");
        assert!(worst.iter().all(|used| *used <= 1.02), "{machine:?}: {worst:?}");
    }
}

/// Links: the time of the closed form within the share of the limits that they use, the length to the nanometre, and the slow end of a plunge.
#[test]
fn links_are_the_closed_form() {
    let machine = CurveLimits {
        speed: 80.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
    };
    for (length, slow, slow_speed) in [
        (0.01, 0.0, 0.0),
        (0.4, 0.0, 0.0),
        (5.0, 0.0, 0.0),
        (40.0, 0.0, 0.0),
        (700.0, 0.0, 0.0),
        (30.0, 2.0, 10.0),
        (3.0, 2.0, 10.0),
        (30.0, 2.0, 60.0),
    ] {
        let curve = Curve::new(length, &machine, slow, slow_speed);
        let mut cursor = curve.start();
        let mut places = std::vec![0.0; 3];
        while !curve.is_over(&cursor) {
            curve.advance(&mut cursor, T as f32);
            places.push(cursor.moved_q10 as f64 / 1024e6);
            assert!(places.len() < 100_000, "{length}");
        }
        let end = *places.last().unwrap();
        assert!(
            (end - f64::from(length)).abs() < 2e-6 + 1e-8 * f64::from(length),
            "{end} of {length}"
        );
        let periods = places.len() - 3;
        assert!(
            (periods as f64 * T - f64::from(curve.duration())).abs() <= T,
            "{length}"
        );
        if slow == 0.0 {
            let best = optimum(f64::from(length), 80.0, 980.0, 19_200.0);
            assert!(
                (f64::from(curve.duration()) / best - 1.0).abs() < 1e-3,
                "{length}"
            );
        }
        places.extend([end; 3]);
        let mut differences = places.clone();
        for bound in [80.0, 1000.0, 20_000.0] {
            differences = differences
                .windows(2)
                .map(|pair| (pair[1] - pair[0]) / T)
                .collect();
            let most = differences
                .iter()
                .fold(0.0_f64, |most, value| most.max(value.abs()));
            assert!(most <= 1.002 * bound, "{length}: {most} of {bound}");
        }
        if slow > 0.0 && slow_speed < 20.0 {
            for pair in places
                .windows(2)
                .filter(|pair| pair[0] >= f64::from(length - slow))
            {
                assert!(
                    (pair[1] - pair[0]) / T <= f64::from(slow_speed) * 1.0001,
                    "{length}"
                );
            }
        }
    }
}
