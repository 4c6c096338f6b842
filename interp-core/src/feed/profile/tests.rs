use super::*;
use crate::feed::QUANTA_PER_MM;
use crate::feed::demand::PathLimits;
use crate::feed::plan::FeedLimits;
use std::boxed::Box;
use std::vec::Vec;

const T: f64 = 1e-3;

fn plan(lengths: &[(f32, PathLimits)], feed: f32) -> Box<Plan> {
    let top = FeedLimits {
        speed: 2.0 * feed,
        usual: feed,
        period_s: T as f32,
    };
    let mut plan = Box::new(Plan::NONE);
    plan.begin();
    for (length, room) in lengths {
        plan.add(*length, room, 0, &top);
    }
    plan.settle(&top);
    while !plan.work(1) {}
    plan
}

fn run(plan: &Plan, feed: f32, mut each: impl FnMut(usize, f64)) -> usize {
    let mut profile = Profile::START;
    profile.begin(plan.window);
    let wanted = feed * T as f32 * QUANTA_PER_MM;
    for tick in 0..1_000_000 {
        let moved = profile.tick(plan, wanted);
        each(tick, f64::from(moved) / f64::from(QUANTA_PER_MM));
        if profile.is_done(plan) {
            assert_eq!(profile.place(), plan.end);
            return tick;
        }
    }
    panic!("never there: {} of {}", profile.place(), plan.end);
}

/// Time of the fastest way from rest to rest.
fn optimum(s: f64, v: f64, a: f64, j: f64) -> f64 {
    let peak = |v: f64| {
        if v * j < a * a {
            2.0 * (v / j).sqrt()
        } else {
            v / a + a / j
        }
    };
    // A ramp to v and back covers v times its time.
    if v * peak(v) <= s {
        return s / v + peak(v);
    }
    let (mut low, mut high) = (0.0, v);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if middle * peak(middle) <= s {
            low = middle
        } else {
            high = middle
        }
    }
    2.0 * peak(low)
}

/// Straight paths take the optimum's time and two per cent, and three periods, whatever limits them; no limit is exceeded.
#[test]
fn straight_paths_take_the_optimal_time() {
    let mut worst = 0.0_f64;
    for s in [0.01, 0.1, 0.3, 1.0, 5.0, 30.0, 200.0] {
        for v in [1.0, 10.0, 50.0, 150.0] {
            for a in [200.0, 1000.0, 5000.0] {
                for j in [5e3, 2e4, 2e5] {
                    let room = PathLimits {
                        max_speed_sqr: (v * v) as f32,
                        accel: a as f32,
                        jerk: j as f32,
                        taken: 0.0,
                    };
                    let plan = plan(&[(s as f32, room)], v as f32);
                    let mut steps = Vec::new();
                    let ticks = run(&plan, v as f32, |_, step| steps.push(step));
                    let best = optimum(s, v, a, j);
                    let took = ticks as f64 * T;
                    worst = worst.max((took - 3.0 * T) / best);
                    assert!(
                        took <= 1.02 * best + 3.0 * T,
                        "{s} mm, {v} {a} {j}: {took} for {best}, mean of {}",
                        plan.window
                    );
                    let mut before = (0.0, 0.0);
                    for step in steps {
                        let speed = step / T;
                        let accel = (speed - before.0) / T;
                        let jerk = (accel - before.1) / T;
                        assert!(speed <= v * 1.001, "{speed}");
                        assert!(accel.abs() <= a * 1.001 + 0.01, "{accel} of {a}");
                        assert!(jerk.abs() <= j * 1.001 + 10.0, "{s} {v} {a} {j}: {jerk} of {j}");
                        before = (speed, accel);
                    }
                }
            }
        }
    }
    std::println!("worst {worst}");
}

/// Speeds wanted on and off at any time, on legs whose last part is slow, too: the jerk of the mean is kept in each period, but for what
/// creeping may take and the least step.
#[test]
fn no_wanted_speed_breaks_the_jerk() {
    let room = |v: f32, a: f32, j: f32| PathLimits {
        max_speed_sqr: v * v,
        accel: a,
        jerk: j,
        taken: 0.0,
    };
    let plans = [
        plan(
            &[(30.0, room(100.0, 1000.0, 20e3)), (2.0, room(40.0, 1000.0, 20e3))],
            100.0,
        ),
        plan(
            &[(12.0, room(50.0, 500.0, 10e3)), (2.0, room(10.0, 500.0, 10e3))],
            50.0,
        ),
        plan(
            &[(3.0, room(50.0, 500.0, 10e3)), (0.5, room(10.0, 500.0, 10e3))],
            50.0,
        ),
        plan(&[(5.0, room(50.0, 900.0, 10e3))], 50.0),
    ];
    let mut seed = 1_u64;
    let mut random = |below: u64| {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) % below
    };
    for turn in 0..4000 {
        let plan = &plans[turn % 4];
        let limit = f64::from(plan.swing) / f64::from(plan.window);
        let most =
            limit * f64::from(1.0 + CREEP_SHARE) + f64::from(STEP_LEAST) / f64::from(plan.window) + 4.0;
        let mut profile = Profile::START;
        profile.begin(plan.window);
        let (mut left, mut share) = (0, 0.0);
        let (mut last, mut before) = (0, 0);
        for tick in 0..20_000 {
            if left == 0 {
                left = 1 + [random(4), random(60), random(300)][random(3) as usize];
                let shares = [0.0, 0.0, 0.1, 0.4, 1.0, 0.02 * random(50) as f32];
                share = shares[random(6) as usize];
                if tick > 3000 {
                    share = 1.0;
                }
            }
            left -= 1;
            let moved = i64::from(profile.tick(plan, share * 50.0 * T as f32 * QUANTA_PER_MM));
            let jerk = (moved - 2 * last + before).abs() as f64;
            assert!(
                jerk <= most,
                "{turn}, period {tick}: {} of the jerk",
                jerk / limit
            );
            (before, last) = (last, moved);
            if profile.is_done(plan) {
                break;
            }
        }
        assert!(profile.is_done(plan), "{turn}");
    }
}
