//! Lower bound and motion against closed forms.

use super::point::LineLimits;
use super::*;
use glam::DVec3;
use job::AxisLimits;

const PERIOD_S: f64 = 1e-3;

/// A straight pass along a direction.
fn line(length: f64, direction: DVec3) -> PassPath<'static> {
    PassPath::new(&[0.0, 1.0], move |t| CurvePoint {
        cl_mm: direction * length * t,
        cl_velocity: direction * length,
        cc_speed: length,
    })
}

/// The contact moves on a circle of this radius, the centre on one of `ratio` times the radius.
fn circle(radius: f64, ratio: f64, turns: f64) -> PassPath<'static> {
    let angle = turns * std::f64::consts::TAU;
    PassPath::new(&[0.0, angle], move |t| {
        let (sin, cos) = t.sin_cos();
        let centre = ratio * radius;
        CurvePoint {
            cl_mm: DVec3::new(centre * cos, centre * sin, 0.0),
            cl_velocity: DVec3::new(-centre * sin, centre * cos, 0.0),
            cc_speed: radius,
        }
    })
}

fn found(path: &PassPath<'_>, feed: f64, limits: &AxisLimits) -> Optimum {
    let found = optimum(path, feed, limits, PERIOD_S, [PassEnd::Rest; 2]).unwrap();
    assert!(found.uses.iter().all(|use_| *use_ <= 1.0 + 1e-9), "{found:?}");
    assert!(found.lower_bound_s <= found.feasible_s, "{found:?}");
    found
}

#[test]
fn straight_passes_agree_with_the_closed_form() {
    let usual = AxisLimits::DEFAULT;
    let mut worst = 0.0_f64;
    let (along_x, slanted) = (DVec3::X, DVec3::new(0.6, 0.0, 0.8));
    for (length, feed, direction) in [
        (1.0, 10.0, along_x),
        (10.0, 30.0, slanted),
        (60.0, 200.0, along_x),
        (200.0, 50.0, slanted),
        (0.2, 50.0, slanted),
    ] {
        let found = found(&line(length, direction), feed, &usual);
        let gain = |limit: [f64; 3]| {
            (0..3).fold(f64::INFINITY, |least, k| {
                least.min(limit[k] / f64::abs(direction[k]))
            })
        };
        let exact = LineLimits {
            velocity: gain(usual.velocity_mm_s).min(feed),
            acceleration: gain(usual.acceleration_mm_s2),
            jerk: gain(usual.jerk_mm_s3),
        }
        .rest_to_rest_s(length);
        worst = worst.max((found.feasible_s / exact - 1.0).abs());
        assert!(found.lower_bound_s <= exact * (1.0 + 1e-9));
        if direction[2] == 0.0 {
            assert!(found.lower_bound_s >= 0.995 * exact, "{found:?} {exact}");
        }
    }
    assert!(worst <= 0.005, "{worst}");
}

/// The axes are slower than the feed, as far as 18 times: the motion is the one of a feed that they reach.
#[test]
fn feeds_above_the_velocity_limits_change_nothing() {
    for (length, velocity, acceleration, jerk) in [
        (6.0, 3.6, 625.0, 71_284.0),
        (2.0, 2.0, 1000.0, 20_000.0),
        (3.0, 10.0, 200.0, 1000.0),
    ] {
        let limits = AxisLimits {
            velocity_mm_s: [velocity; 3],
            acceleration_mm_s2: [acceleration; 3],
            jerk_mm_s3: [jerk; 3],
        };
        let exact = LineLimits {
            velocity,
            acceleration,
            jerk,
        }
        .rest_to_rest_s(length);
        let path = line(length, DVec3::X);
        for feed in [velocity, 18.4 * velocity] {
            let time = found(&path, feed, &limits).feasible_s;
            assert!((time / exact - 1.0).abs() <= 0.002, "{feed}: {time} for {exact}");
        }
    }
}

/// Around an edge of 0.2 mm the centre moves 16 times as fast as the contact, and its speed steps by these shares from span to span: the tool has to rest at
/// the steps, and no motion was found where the first programme was linearised at a higher speed.
#[test]
fn passes_rest_at_steps_of_the_derivatives() {
    let limits = AxisLimits::DEFAULT;
    for speeds in [
        &[1.0, 0.95, 1.05, 1.0, 0.97][..],
        &[1.0, 0.9, 1.1, 0.95],
        &[1.0, 1.0, 1.1, 1.0],
    ] {
        let breaks: Vec<f64> = (0..=speeds.len()).map(|k| 0.24 * k as f64).collect();
        let path = PassPath::new(&breaks, |t| {
            let span = breaks.partition_point(|at| *at <= t).clamp(1, speeds.len()) - 1;
            let before: f64 = speeds[..span].iter().sum();
            let (sin, cos) = (0.24 * before + speeds[span] * (t - breaks[span])).sin_cos();
            CurvePoint {
                cl_mm: 3.2 * DVec3::new(sin, 0.0, cos),
                cl_velocity: 3.2 * speeds[span] * DVec3::new(cos, 0.0, -sin),
                cc_speed: 0.2,
            }
        });
        let found = found(&path, 60.0, &limits);
        assert!(found.feasible_s < 0.7, "{speeds:?}: {found:?}");
    }
}

/// Around a circle the speed is the least of the feed, sqrt(A R) and cbrt(J R^2).
#[test]
fn circles_run_at_their_limit_speed() {
    for (radius, ratio, feed, limits) in [
        (
            20.0,
            1.0,
            200.0,
            AxisLimits {
                velocity_mm_s: [500.0; 3],
                acceleration_mm_s2: [500.0; 3],
                jerk_mm_s3: [1e6; 3],
            },
        ),
        (
            20.0,
            0.5,
            200.0,
            AxisLimits {
                velocity_mm_s: [500.0; 3],
                acceleration_mm_s2: [5000.0; 3],
                jerk_mm_s3: [20_000.0; 3],
            },
        ),
    ] {
        let [one, two] = [1.0, 2.0].map(|turns| found(&circle(radius, ratio, turns), feed, &limits));
        let centre: f64 = ratio * radius;
        let cap = (500.0_f64)
            .min((limits.acceleration_mm_s2[0] * centre).sqrt())
            .min((limits.jerk_mm_s3[0] * centre * centre).cbrt());
        let exact = std::f64::consts::TAU * radius / (cap / ratio).min(feed);
        // One more turn, at constant speed. The corners of the axis limits allow slightly more than the axes.
        let turn = two.feasible_s - one.feasible_s;
        assert!(turn <= 1.002 * exact && turn >= 0.85 * exact, "{turn} {exact}");
    }
}

/// From rest, or to rest, with the other end free: jerk and acceleration at their limits, and at the feed what is left of the way.
#[test]
fn free_ends_agree_with_the_closed_form() {
    let usual = AxisLimits::DEFAULT;
    for (length, feed) in [(1.0, 90.0), (6.0, 90.0), (40.0, 90.0), (20.0, 10.0)] {
        let line = line(length, DVec3::X);
        let limits = LineLimits {
            velocity: feed,
            acceleration: usual.acceleration_mm_s2[0],
            jerk: usual.jerk_mm_s3[0],
        };
        let ramp = limits.ramp_s(feed);
        let exact = if 0.5 * feed * ramp > length {
            limits.reach_s(length)
        } else {
            ramp + (length - 0.5 * feed * ramp) / feed
        };
        for (ends, exact) in [
            ([PassEnd::Rest, PassEnd::Free], exact),
            ([PassEnd::Free, PassEnd::Rest], exact),
            ([PassEnd::Free; 2], length / feed),
        ] {
            let (found, profile) = optimum_profile(&line, feed, &usual, PERIOD_S, ends).unwrap();
            assert!(found.uses.iter().all(|use_| *use_ <= 1.0 + 1e-9), "{found:?}");
            assert!(
                found.lower_bound_s <= found.feasible_s * (1.0 + 1e-9),
                "{found:?}"
            );
            // A ramp takes about a period more: its samples are differences, too.
            assert!(
                (found.feasible_s - exact).abs() <= 1.5 * PERIOD_S,
                "{length} {feed} {ends:?}: {found:?}, exactly {exact}"
            );
            // Where the motion is not at the feed, the jerk or the acceleration of x binds: no other axis moves.
            let others = profile.iter().filter(|point| {
                ![Binding::Feed, Binding::Acceleration(0), Binding::Jerk(0)].contains(&point.binding)
            });
            assert_eq!(others.count(), 0, "{length} {feed} {ends:?}");
        }
    }
}

/// On a circle the acceleration binds, of the axis that points to the middle; on a straight way the axis with the least velocity.
#[test]
fn the_binding_limit_is_the_one_that_is_met() {
    let limits = AxisLimits {
        velocity_mm_s: [500.0, 500.0, 40.0],
        acceleration_mm_s2: [500.0; 3],
        jerk_mm_s3: [1e6; 3],
    };
    let free = [PassEnd::Free; 2];
    let radius: f64 = 20.0;
    let path = circle(radius, 1.0, 1.0);
    let (_, profile) = optimum_profile(&path, 400.0, &limits, PERIOD_S, free).unwrap();
    let inner = |point: &&SpeedPoint| point.arc_mm > 10.0 && point.arc_mm < path.length_mm() - 10.0;
    for point in profile.iter().filter(inner) {
        let (sin, cos) = (point.arc_mm / radius).sin_cos();
        assert!(point.share < 1.0 + 1e-9, "{point:?}");
        // Away from the diagonals the axis is certain.
        if (cos.abs() - sin.abs()).abs() > 0.6 {
            assert!(point.share > 0.95, "{point:?}");
            let inwards = usize::from(sin.abs() > cos.abs());
            assert_eq!(point.binding, Binding::Acceleration(inwards), "{point:?}");
        }
    }
    let slanted = line(60.0, DVec3::new(0.6, 0.0, 0.8));
    let (_, profile) = optimum_profile(&slanted, 400.0, &limits, PERIOD_S, free).unwrap();
    for point in &profile {
        assert_eq!(point.binding, Binding::Velocity(2), "{point:?}");
        assert!((point.speed_mm_s - 50.0).abs() < 0.05, "{point:?}");
    }
    let (_, profile) = optimum_profile(&slanted, 30.0, &limits, PERIOD_S, free).unwrap();
    assert!(profile.iter().all(|point| point.binding == Binding::Feed));
}

/// A quarter turn of small radius between two straight lines: the tool slows down in it.
#[test]
fn a_bend_is_slower_than_the_straight_lines() {
    let (side, radius) = (20.0, 0.5);
    let angle = std::f64::consts::FRAC_PI_2;
    let ends = [0.0, side, side + radius * angle, 2.0 * side + radius * angle];
    let bend = PassPath::new(&ends, move |s| {
        let (cl_mm, cl_velocity) = if s < ends[1] {
            (DVec3::X * s, DVec3::X)
        } else if s < ends[2] {
            let (sin, cos) = ((s - ends[1]) / radius).sin_cos();
            (
                DVec3::new(side + radius * sin, radius * (1.0 - cos), 0.0),
                DVec3::new(cos, sin, 0.0),
            )
        } else {
            (DVec3::new(side + radius, radius + s - ends[2], 0.0), DVec3::Y)
        };
        CurvePoint {
            cl_mm,
            cl_velocity,
            cc_speed: 1.0,
        }
    });
    let whole = found(&bend, 50.0, &AxisLimits::DEFAULT);
    let straight = LineLimits {
        velocity: 50.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
    };
    // Between passing the bend at the feed and stopping on both sides of it.
    let through = straight.rest_to_rest_s(2.0 * side + radius * angle);
    let stopping = 2.0 * straight.rest_to_rest_s(side)
        + found(&circle(radius, 1.0, 0.25), 50.0, &AxisLimits::DEFAULT).feasible_s;
    assert!(whole.feasible_s > through * 1.05, "{through} {whole:?}");
    assert!(whole.feasible_s < stopping, "{stopping} {whole:?}");
    assert!(whole.lower_bound_s >= through);
}

/// Where the centre's speed steps at a knot, one period has a jerk of the step over T^2: the tool nearly stops there.
#[test]
fn a_step_of_the_speed_is_crossed_slowly() {
    let ratio = 1.2;
    let kink = PassPath::new(&[0.0, 10.0, 20.0], move |s| {
        let gain = if s < 10.0 { 1.0 } else { ratio };
        CurvePoint {
            cl_mm: DVec3::X * if s < 10.0 { s } else { 10.0 + ratio * (s - 10.0) },
            cl_velocity: DVec3::X * gain,
            cc_speed: 1.0,
        }
    });
    let stepped = found(&kink, 20.0, &AxisLimits::DEFAULT);
    let straight = LineLimits {
        velocity: 20.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
    };
    assert!(
        stepped.feasible_s > straight.rest_to_rest_s(20.0) + 0.02,
        "{stepped:?}"
    );
    assert!(
        stepped.feasible_s < 2.02 * straight.rest_to_rest_s(10.0),
        "{stepped:?}"
    );
}
