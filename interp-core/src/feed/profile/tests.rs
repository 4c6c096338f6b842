use super::*;
use crate::feed::QUANTA_PER_MM;
use crate::feed::demand::Room;
use crate::feed::plan::Top;
use std::boxed::Box;
use std::vec::Vec;

const T: f64 = 1e-3;

fn plan(lengths: &[(f32, Room)], feed: f32) -> Box<Plan> {
    let top = Top {
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
                    let room = Room {
                        square: (v * v) as f32,
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
