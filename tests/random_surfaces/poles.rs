//! Surfaces with poles: boundaries that are points.

use job::{Along, Pattern, Side, SurfaceSpec};
use machine::Machine;
use machine::prepare::prepare;

use super::{job, run};

/// A fan with a pole on each of the four boundaries, passes along u and v, `zig` and `zigzag`, without and with weights.
#[test]
fn poles() {
    // A cubic Bezier patch, t towards the pole and s around it: all control points at t = 1 coincide, and the surface is smooth there.
    let pole_at = |t: usize, s: usize| -> [f64; 3] {
        let (angle, reach) = (0.3 + 0.35 * s as f64, [30.0, 20.0, 10.0, 0.0][t]);
        [reach * angle.cos(), reach * angle.sin(), [-6.0, 1.5, 4.0, 4.0][t]]
    };
    for weights in [false, true] {
        for (pole_on_u, at_end) in [(true, false), (true, true), (false, false), (false, true)] {
            let weight = |t: usize, s: usize| {
                if weights {
                    1.0 + 0.15 * (t as f64 - 1.5) * (s as f64 - 1.0)
                } else {
                    1.0
                }
            };
            let pole = |i: usize, j: usize| {
                let (t, s) = if pole_on_u { (i, j) } else { (j, i) };
                let t = if at_end { t } else { 3 - t };
                let [x, y, z] = pole_at(t, s);
                [x + 50.0, y - 20.0, z, weight(t, s)]
            };
            let knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
            let nurbs = job::NurbsSpec {
                degree: [3, 3],
                knots_u: knots.clone(),
                knots_v: knots,
                poles_mm: (0..4).map(|i| (0..4).map(|j| pole(i, j)).collect()).collect(),
                rational: weights,
            };
            for along in [Along::U, Along::V] {
                for pattern in [Pattern::Zig, Pattern::Zigzag] {
                    let mut job = job(SurfaceSpec::Nurbs(nurbs.clone()), along, pattern);
                    job.side = Side::Up;
                    job.scallop_mm = 0.05;
                    let name = format!(
                        "weights {weights}, on u {pole_on_u}, at end {at_end}, {along:?}, {pattern:?}"
                    );
                    let ran = run(&job, u64::MAX);
                    assert_eq!(ran.fault, None, "{name} after {:?}", ran.place);
                    assert!(
                        ran.position_nm <= 10.0,
                        "{name}: CL off by {} nm",
                        ran.position_nm
                    );
                    assert!(ran.ripple_pct <= 0.001, "{name}: ripple {} %", ran.ripple_pct);
                    assert!(ran.interval <= 1e-4, "{name}: interval off by {}", ran.interval);
                    assert_eq!(ran.off_boundary, 0, "{name}");
                    assert!(ran.samples > 1000, "{name}");
                }
            }
        }
    }
}

/// The fan of [`poles`], rotated, so that no term vanishes merely because a coordinate is 0.
fn turned_fan(pole_on_u: bool, weights: bool) -> SurfaceSpec {
    let turn = |[x, y, z]: [f64; 3]| {
        let (s, c) = 0.7_f64.sin_cos();
        let [x, y, z] = [x, c * y - s * z, s * y + c * z];
        let (s, c) = 0.6_f64.sin_cos();
        [c * x + s * z, y, c * z - s * x]
    };
    let pole = |i: usize, j: usize| {
        let (t, s) = if pole_on_u { (i, j) } else { (j, i) };
        let (angle, reach) = (0.3 + 0.35 * s as f64, [30.0, 20.0, 10.0, 0.0][t]);
        let [x, y, z] = turn([reach * angle.cos(), reach * angle.sin(), [-6.0, 1.5, 4.0, 4.0][t]]);
        let w = if weights {
            1.0 + 0.15 * (t as f64 - 1.5) * (s as f64 - 1.0)
        } else {
            1.0
        };
        [x, y, z, w]
    };
    let knots = vec![0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    SurfaceSpec::Nurbs(job::NurbsSpec {
        degree: [3, 3],
        knots_u: knots.clone(),
        knots_v: knots,
        poles_mm: (0..4).map(|i| (0..4).map(|j| pole(i, j)).collect()).collect(),
        rational: weights,
    })
}

/// Passes into a pole of the rotated fan, at several feeds and ball radii, without a false gouge fault.
#[test]
fn poles_askew() {
    for weights in [false, true] {
        for along in [Along::U, Along::V] {
            for (radius_mm, feed_mm_min) in [(4.0, 600.0), (20.0, 600.0), (4.0, 60.0), (20.0, 37.0)] {
                let mut job = job(turned_fan(true, weights), along, Pattern::Zig);
                (job.radius_mm, job.feed_mm_min) = (radius_mm, feed_mm_min);
                (job.side, job.scallop_mm) = (Side::Up, 2.0);
                let name = format!("weights {weights}, {along:?}, ball {radius_mm}, feed {feed_mm_min}");
                let ran = run(&job, u64::MAX);
                assert_eq!(ran.fault, None, "{name} at {:?}", ran.place);
                assert!(
                    ran.position_nm <= 10.0 * radius_mm.max(10.0) / 10.0,
                    "{name}: CL off by {} nm",
                    ran.position_nm
                );
            }
        }
    }
}

/// A rational patch of half a millimetre whose pole lies between two nanometres: its unit was 2^-4 nm and less, and the centre up to 14 nm off with a ball of 3 mm.
#[test]
fn small_poles_between_nanometres() {
    for pole_on_u in [true, false] {
        let SurfaceSpec::Nurbs(mut nurbs) = turned_fan(pole_on_u, true) else {
            panic!("a spline");
        };
        for [x, y, z, _] in nurbs.poles_mm.iter_mut().flatten() {
            for (axis, shift) in [(x, 34.400_000_482), (y, 15.000_000_337), (z, 2.399_824_343_7)] {
                *axis = 0.015 * *axis + shift;
            }
        }
        for along in [Along::U, Along::V] {
            let mut job = job(SurfaceSpec::Nurbs(nurbs.clone()), along, Pattern::Zigzag);
            (job.side, job.scallop_mm, job.feed_mm_min) = (Side::Up, 0.001, 60.0);
            job.radius_mm = 3.0;
            let ran = run(&job, u64::MAX);
            assert_eq!(ran.fault, None, "{along:?} at {:?}", ran.place);
            println!(
                "{pole_on_u} {along:?}: {} nm, interval {}",
                ran.position_nm, ran.interval
            );
            assert!(
                ran.position_nm <= 3.0,
                "{along:?}: CL off by {} nm",
                ran.position_nm
            );
        }
    }
}

/// The first interval beside a pole is that of the side line with the greatest speed.
#[test]
fn interval_beside_a_pole() {
    // S = v (2 + 18 u, 20 u, 0): the speed of the side lines is 2 to 28 mm.
    let mut c = [[[0.0; 4]; 4]; 3];
    (c[0][3][2], c[0][2][2], c[1][2][2]) = (2.0, 18.0, 20.0);
    let surface = SurfaceSpec::Bicubic {
        coefficients_mm: c,
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    };
    for pattern in [Pattern::Zig, Pattern::Zigzag] {
        let mut job = job(surface.clone(), Along::U, pattern);
        (job.radius_mm, job.scallop_mm) = (2.0, 0.01);
        let prepared = prepare(&job).unwrap();
        let mut second = None;
        Machine::load(&prepared)
            .unwrap()
            .run(|sample| {
                second = (sample.pass == 1).then_some(prepared.side.parameter(sample.side));
                second.is_none()
            })
            .unwrap();
        // On a plane a ball of radius r leaves at most h within sqrt(h (2 r - h)) of it. The pass before is the pole, and the next one a line from
        // v (2, 0) to v (20, 20): at least the distance along the longest side line, and no place between them is farther than that from both.
        let reach = (0.01_f64 * (2.0 * 2.0 - 0.01)).sqrt();
        let v = second.unwrap();
        assert!(v > 2.0 * reach / 20.0_f64.hypot(20.0) * (1.0 - 1e-5), "{v}");
        for (i, j) in
            (0..=100).flat_map(|i| (0..=100).map(move |j| (f64::from(i) / 100.0, f64::from(j) / 100.0)))
        {
            let (x, y) = (j * v * (2.0 + 18.0 * i), j * v * 20.0 * i);
            let along = (((x - 2.0 * v) * 18.0 + y * 20.0) / (724.0 * v)).clamp(0.0, 1.0);
            let to_line = (x - v * (2.0 + 18.0 * along)).hypot(y - v * 20.0 * along);
            assert!(x.hypot(y).min(to_line) <= reach, "{x} {y}: {to_line}");
        }
        assert_eq!(run(&job, u64::MAX).fault, None);
    }
}

/// Domes and cones that end on the axis, with passes along u and v, `zig` and `zigzag`.
#[test]
fn profiles_that_end_on_the_axis() {
    for k in 0..40 {
        let (a, b) = (20.0 + 0.377 * f64::from(k), 0.1 * f64::from(k % 7));
        // R = a u + b u^2, Z decreases; the axis is at u = 0.
        let surface = SurfaceSpec::Revolved {
            radius_mm: [0.0, b, a, 0.0],
            height_mm: [-1.001, -1.003 - b, -10.0, 0.0],
            u: [0.0, 1.0],
            v_rad: [0.1, 5.0],
        };
        for along in [Along::U, Along::V] {
            for pattern in [Pattern::Zig, Pattern::Zigzag] {
                let mut job = job(surface.clone(), along, pattern);
                (job.side, job.radius_mm, job.feed_mm_min) = (Side::Up, 2.0, 3000.0);
                // Passes along the profile are close together at the axis; a few are enough.
                let most = if along == Along::U { 20_000 } else { u64::MAX };
                let ran = run(&job, most);
                assert_eq!(ran.fault, None, "{k}, {along:?}, {pattern:?} at {:?}", ran.place);
                assert!(
                    ran.position_nm <= 10.0,
                    "{k}, {along:?}, {pattern:?}: {} nm",
                    ran.position_nm
                );
            }
        }
    }
}

/// A boundary with one span that is a point and one that is not is refused, with a message.
#[test]
fn boundary_that_is_a_point_in_part() {
    let pole = |x: f64, y: f64| [x, y, 0.0, 1.0];
    let nurbs = job::NurbsSpec {
        degree: [1, 1],
        knots_u: vec![0.0, 0.0, 1.0, 2.0, 2.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: vec![
            vec![pole(0.0, 0.0), pole(0.0, 10.0)],
            vec![pole(10.0, 0.0), pole(10.0, 10.0)],
            vec![pole(10.0, 0.0), pole(20.0, 10.0)],
        ],
        rational: false,
    };
    let error = prepare(&job(SurfaceSpec::Nurbs(nurbs), Along::U, Pattern::Zig)).unwrap_err();
    assert!(error.to_string().contains("not all of it"), "{error}");
}
