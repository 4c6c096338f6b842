//! The oracle against closed forms and finite differences, and the verifier against samples with known faults.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

use super::*;
use glam::DVec3;
use job::{Along, Job, MachineSpec, NurbsSpec, Origin, Pattern, Side, Spacing, SurfaceSpec};

/// A job on a surface with a ball of 5 mm and a scallop of 0.005 mm.
fn job(surface: SurfaceSpec, along: Along, side: Side) -> Job {
    Job {
        surface,
        radius_mm: 5.0,
        body: job::ToolBody::default(),
        setup: job::Setup::default(),
        region: None,
        feed_mm_min: 600.0,
        scallop_mm: 0.005,
        along,
        side,
        pattern: Pattern::Zig,
        spacing: Spacing::Exact,
        chord_mm: 0.005,
        overrun_mm: 0.0,
        machine: MachineSpec::default(),
        origin: Origin::default(),
    }
}

fn oracle(surface: SurfaceSpec, along: Along, side: Side) -> Oracle {
    Oracle::new(&job(surface, along, side)).unwrap()
}

fn sample_job(name: &str) -> Job {
    let text = match name {
        "sphere_cap" => include_str!("../../../jobs/sphere_cap.toml"),
        "torus" => include_str!("../../../jobs/torus.toml"),
        "plate" => include_str!("../../../jobs/plate.toml"),
        "freeform" => include_str!("../../../jobs/freeform.toml"),
        other => panic!("no sample job {other}"),
    };
    job_file::parse(name, text).unwrap()
}

fn close(ours: f64, exact: f64, tolerance: f64) {
    assert!(
        (ours - exact).abs() <= tolerance,
        "{ours} should be {exact} within {tolerance:e}"
    );
}

fn all_close(ours: DVec3, exact: DVec3, tolerance: f64) {
    for (ours, exact) in ours.to_array().into_iter().zip(exact.to_array()) {
        close(ours, exact, tolerance);
    }
}

/// Points of a grid over the domain, ends included.
fn grid(surface: &Surface, steps: u32) -> Vec<(f64, f64)> {
    let [[u0, u1], [v0, v1]] = surface.domain();
    let at = |low: f64, high: f64, k: u32| low + (high - low) * f64::from(k) / f64::from(steps);
    (0..=steps)
        .flat_map(|i| (0..=steps).map(move |j| (at(u0, u1, i), at(v0, v1, j))))
        .collect()
}

/// A rational surface with non-uniform knots, unclamped in v, and pseudo-random poles of a fixed seed.
fn rough_nurbs(degree: [usize; 2]) -> SurfaceSpec {
    let mut state = 12_345_u32;
    let mut random = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1_u32 << 24)
    };
    let poles = [6, 7];
    let mut knots = [Vec::new(), Vec::new()];
    for (direction, knots) in knots.iter_mut().enumerate() {
        let mut knot = 0.0;
        for index in 0..=poles[direction] + degree[direction] {
            let clamped = direction == 0 && (index <= degree[0] && index > 0 || index > poles[0]);
            knot += if clamped { 0.0 } else { 0.3 + random() };
            knots.push(knot);
        }
    }
    let [knots_u, knots_v] = knots;
    let mut pole = |i: usize, j: usize| {
        [
            10.0 * i as f64 + 3.0 * random(),
            8.0 * j as f64 + 3.0 * random(),
            9.0 * random(),
            0.5 + random(),
        ]
    };
    let poles_mm = (0..poles[0])
        .map(|i| (0..poles[1]).map(|j| pole(i, j)).collect())
        .collect();
    SurfaceSpec::Nurbs(NurbsSpec {
        degree,
        knots_u,
        knots_v,
        poles_mm,
        rational: true,
    })
}

#[test]
fn plane_has_zero_curvature() {
    let rail = |y: f64| [[0.0, 0.0, 30.0, 5.0], [0.0, 0.0, 0.0, y], [0.0, 0.0, 0.0, 2.0]];
    let surface = SurfaceSpec::Ruled {
        rail0_mm: rail(0.0),
        rail1_mm: rail(20.0),
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    };
    let oracle = oracle(surface, Along::U, Side::Up);
    let contact = oracle.contact(0.3, 0.6).unwrap();
    assert_eq!(contact.normal, DVec3::Z);
    assert_eq!((contact.curvature_path, contact.curvature_side), (0.0, 0.0));
    close(contact.interval, (8.0 * 5.0 * 0.005_f64).sqrt() / 20.0, 1e-16);
    close(oracle.arc_length(0.1, 0.9, 0.6), 24.0, 1e-14);
}

#[test]
fn cylinder_has_one_curvature() {
    let surface = SurfaceSpec::Revolved {
        radius_mm: [0.0, 0.0, 0.0, 20.0],
        height_mm: [0.0, 0.0, 50.0, 0.0],
        u: [0.0, 1.0],
        v_rad: [0.0, 2.0],
    };
    for (side, sign) in [(Side::Plus, -1.0), (Side::Minus, 1.0)] {
        let oracle = oracle(surface.clone(), Along::V, side);
        let contact = oracle.contact(0.4, 1.2).unwrap();
        // S_u x S_v points towards the axis.
        all_close(
            contact.normal,
            DVec3::new(sign * 1.2_f64.cos(), sign * 1.2_f64.sin(), 0.0),
            1e-15,
        );
        close(contact.curvature_path, -sign / 20.0, 1e-16);
        close(contact.curvature_side, 0.0, 1e-16);
        close(oracle.arc_length(0.1, 1.9, 0.4), 36.0, 1e-13);
    }
}

#[test]
fn a_wall_has_no_upper_side() {
    let wall = SurfaceSpec::Revolved {
        radius_mm: [0.0, 0.0, 0.0, 20.0],
        height_mm: [0.0, 0.0, 50.0, 0.0],
        u: [0.0, 1.0],
        v_rad: [0.0, 2.0],
    };
    assert_eq!(
        Oracle::new(&job(wall, Along::U, Side::Up)).err(),
        Some(OracleError::NoUpperSide)
    );
}

#[test]
fn sphere_is_a_sphere_up_to_its_pole() {
    let job = sample_job("sphere_cap");
    for along in [Along::U, Along::V] {
        let oracle = Oracle::new(&Job { along, ..job.clone() }).unwrap();
        for (u, v) in grid(&oracle.surface, 16) {
            let contact = oracle.contact(u, v).unwrap();
            let radial = contact.cc_mm / 25.0;
            all_close(contact.normal, radial, 1e-14);
            all_close(contact.cl_mm, radial * 30.0, 1e-13);
            // Near the pole the f64 value of S_v, at the pole the extrapolation.
            let tolerance = if u == 0.0 { 1e-8 } else { 1e-12 };
            for curvature in [contact.curvature_path, contact.curvature_side]
                .into_iter()
                .chain(contact.principal)
            {
                close(curvature, -1.0 / 25.0, tolerance);
            }
        }
    }
    let oracle = Oracle::new(&job).unwrap();
    close(oracle.arc_length(0.0, 1.0, 0.3), 25.0 * FRAC_PI_3, 1e-12);
    assert_eq!(oracle.contact(0.0, 0.3).unwrap().interval, f64::INFINITY);
    let across = Oracle::new(&Job {
        along: Along::V,
        ..job
    })
    .unwrap();
    close(
        across.arc_length(0.0, 1.0, 1.0),
        25.0 * FRAC_PI_3.sin() * FRAC_PI_2,
        1e-12,
    );
    close(across.arc_length(0.0, 1.0, 0.0), 0.0, 1e-13);
    // At the pole itself a pass is a point; the next one is a step-over away, at |S_u| mm per unit.
    let at_pole = across.contact(0.0, 0.3).unwrap();
    close(
        at_pole.interval * (0.2_f64 / 1.2).sqrt().recip() * oracle.contact(0.0, 0.3).unwrap().path_speed,
        1.0,
        1e-6,
    );
}

#[test]
fn torus_is_a_torus() {
    let oracle = Oracle::new(&sample_job("torus")).unwrap();
    for (u, v) in grid(&oracle.surface, 20) {
        let contact = oracle.contact(u, v).unwrap();
        let [x, y, z] = contact.cc_mm.to_array();
        let from_axis = x.hypot(y);
        close((from_axis - 40.0).hypot(z), 8.0, 1e-13);
        // The ball's centre lies on the circle of radius 3 around the tube's centre.
        let [x, y, z] = contact.cl_mm.to_array();
        close((x.hypot(y) - 40.0).hypot(z), 3.0, 1e-12);
        close(contact.curvature_side, 1.0 / 8.0, 1e-12);
        close(
            contact.curvature_path,
            (from_axis - 40.0) / (8.0 * from_axis),
            1e-13,
        );
        close(contact.fit(5.0), 0.625, 1e-12);
    }
    let inner = 40.0 - 8.0 * (PI / 6.0).cos();
    close(oracle.arc_length(0.0, 1.0, 0.0), inner * FRAC_PI_2, 1e-12);
    let tight = Oracle {
        radius_mm: 8.5,
        ..oracle
    };
    assert!(
        matches!(tight.schedule(), Err(OracleError::BallDoesNotFit { fit, .. }) if (fit - 8.5 / 8.0).abs() < 1e-9)
    );
    assert!(tight.contact(0.5, 0.5).unwrap().interval.is_nan());
}

#[test]
fn derivatives_agree_with_differences() {
    // Central differences with step h have an error of h^2 f''' / 6 plus rounding / h: least near 1e-5 of a span.
    const STEP: f64 = 1e-5;
    let plate = sample_job("plate").surface;
    let nurbs = [[1, 1], [2, 1], [2, 3], [3, 2], [3, 3]].map(rough_nurbs);
    for spec in nurbs.into_iter().chain([plate]) {
        let surface = Surface::new(&spec);
        for (u, v) in grid(&surface, 7).into_iter().map(|(u, v)| (u + 0.01, v + 0.013)) {
            let [[_, u1], [_, v1]] = surface.domain();
            if u + STEP >= u1 || v + STEP >= v1 {
                continue;
            }
            let at = surface.at(u, v);
            let difference = |plus: DVec3, minus: DVec3| (plus - minus) / (2.0 * STEP);
            let (left, right) = (surface.at(u - STEP, v), surface.at(u + STEP, v));
            let (below, above) = (surface.at(u, v - STEP), surface.at(u, v + STEP));
            let agree = |exact: DVec3, plus: DVec3, minus: DVec3| {
                let size = exact.abs().max_element().max(1.0);
                all_close(exact, difference(plus, minus), 1e-6 * size);
            };
            agree(at.u, right.point, left.point);
            agree(at.v, above.point, below.point);
            agree(at.uu, right.u, left.u);
            agree(at.uv, above.u, below.u);
            agree(at.vv, above.v, below.v);
            all_close(surface.tangent(u, v, Along::U), at.u, 1e-12);
            all_close(surface.tangent(u, v, Along::V), at.v, 1e-12);
        }
    }
}

#[test]
fn principal_curvatures_do_not_depend_on_the_pass() {
    let job = sample_job("freeform");
    let along = Oracle::new(&job).unwrap();
    let across = Oracle::new(&Job {
        along: Along::V,
        ..job
    })
    .unwrap();
    for (u, v) in grid(&along.surface, 25) {
        let (one, other) = (along.contact(u, v).unwrap(), across.contact(u, v).unwrap());
        close(one.principal[0], other.principal[0], 1e-14);
        close(one.principal[1], other.principal[1], 1e-14);
        // Euler: the mean over any two orthogonal directions is the mean curvature.
        close(
            one.curvature_path + one.curvature_side,
            one.principal[0] + one.principal[1],
            1e-15,
        );
    }
}

#[test]
fn arcs_add_up_and_small_ones_are_exact() {
    for name in ["freeform", "torus", "plate"] {
        let oracle = Oracle::new(&sample_job(name)).unwrap();
        let [start, end] = oracle.path_range();
        let side = 0.37;
        let whole = oracle.arc_length(start, end, side);
        let steps = 5_000;
        let place = |k: u32| start + (end - start) * f64::from(k) / f64::from(steps);
        let sum: f64 = (0..steps)
            .map(|k| oracle.arc_length(place(k), place(k + 1), side))
            .sum();
        close(sum / whole, 1.0, 1e-12);
        assert_eq!(oracle.arc_length(end, start, side), -whole);
        // A step of 1e-5 of the range against its series, speed and half the change of speed.
        let step = 1e-5 * (end - start);
        let (from, middle) = (place(1_234), place(1_234) + 0.5 * step);
        let contact = |path: f64| {
            oracle
                .contact(oracle.swapped(path, side).0, oracle.swapped(path, side).1)
                .unwrap()
        };
        close(
            oracle.arc_of_step(from, step, side) / (contact(middle).path_speed * step),
            1.0,
            1e-9,
        );
    }
}

/// Ideal samples of a job: steps of f T along the surface by Newton's method, positions rounded to nanometres.
fn ideal_samples(oracle: &Oracle, feed_mm_s: f64) -> Vec<PassSample> {
    let [start, end] = oracle.path_range();
    let mut samples: Vec<PassSample> = Vec::new();
    let mut side = oracle.side_range()[0];
    for pass in 0.. {
        let backwards = oracle.pattern == Pattern::Zigzag && pass % 2 == 1;
        let (from, to) = if backwards { (end, start) } else { (start, end) };
        let sign = if backwards { -1.0 } else { 1.0 };
        let (mut path, mut least) = (from, f64::INFINITY);
        loop {
            let (u, v) = oracle.swapped(path, side);
            let contact = oracle.contact(u, v).unwrap();
            least = least.min(contact.interval);
            samples.push(PassSample {
                tick: samples.len() as u64,
                pass,
                u,
                v,
                cc_nm: contact.cc_mm.to_array().map(|mm| (mm * 1e6).round() as i32),
                cl_nm: contact.cl_mm.to_array().map(|mm| (mm * 1e6).round() as i32),
                feed_mm_s,
                interval: contact.interval,
                first_of_pass: path == from,
                last_of_pass: path == to,
            });
            if path == to {
                break;
            }
            let arc = feed_mm_s * oracle.period_s;
            let mut next = path + sign * arc / contact.path_speed;
            for _ in 0..if next.is_finite() { 3 } else { 0 } {
                next += sign * (arc - sign * oracle.arc_length(path, next, side)) / contact.path_speed;
            }
            path = if (next - to) * sign >= 0.0 || !next.is_finite() {
                to
            } else {
                next
            };
        }
        if side == oracle.side_range()[1] {
            return samples;
        }
        side = (side + least).min(oracle.side_range()[1]);
    }
    samples
}

fn report_of(oracle: &Oracle, samples: &[PassSample]) -> AccuracyReport {
    let mut verifier = Verifier::new(oracle);
    for sample in samples {
        verifier.add(sample);
    }
    verifier.finish()
}

/// A short job: coarse scallop, 40 mm/s.
fn short_job(name: &str, pattern: Pattern) -> (Oracle, Vec<PassSample>) {
    let job = Job {
        scallop_mm: 0.2,
        pattern,
        spacing: Spacing::FirstOrder,
        ..sample_job(name)
    };
    let oracle = Oracle::new(&job).unwrap();
    let samples = ideal_samples(&oracle, 40.0);
    (oracle, samples)
}

#[test]
fn ideal_samples_pass() {
    for name in ["freeform", "torus", "sphere_cap", "plate"] {
        for pattern in [Pattern::Zig, Pattern::Zigzag] {
            let (oracle, samples) = short_job(name, pattern);
            let report = report_of(&oracle, &samples);
            assert_eq!(
                report.failures(&AccuracyBounds::default()),
                Vec::<String>::new(),
                "{name}"
            );
            assert!(
                report.position_nm.max <= 0.87 && report.position_nm.rms() > 0.4,
                "{:?}",
                report.position_nm
            );
            assert!(
                report.normal_rad.max <= report.normal_floor_rad,
                "{:?}",
                report.normal_rad
            );
            assert!(report.ripple_pct.max < 1e-8, "{:?}", report.ripple_pct);
            assert_eq!(report.interval.max, 0.0);
            assert!(report.side_step.max < 1e-9, "{:?}", report.side_step);
            close(report.scallop_mm.max, 0.2, 1e-9);
            assert!(report.scallop_mean_mm() < 0.2 && report.scallop_mean_mm() > 0.02);
            let schedule = oracle.schedule().unwrap();
            assert_eq!(report.passes as usize, schedule.len());
            let [start, end] = oracle.path_range();
            let length: f64 = schedule
                .iter()
                .map(|pass| oracle.arc_length(start, end, pass.side))
                .sum();
            close(report.cc_length_mm / length, 1.0, 1e-4);
        }
    }
}

#[test]
fn every_fault_is_found() {
    type Fault = (&'static str, fn(&mut Vec<PassSample>));
    let faults: [Fault; 10] = [
        ("position", |samples| samples[500].cl_nm[1] += 20),
        ("contact", |samples| samples[500].cc_nm[1] += 20),
        ("normal", |samples| {
            samples[500].cl_nm = samples[500].cl_nm.map(|x| x + 15)
        }),
        ("ripple", |samples| samples[500].feed_mm_s *= 1.001),
        ("ripple", |samples| {
            samples.remove(500);
        }),
        ("interval", |samples| samples[500].interval *= 1.01),
        ("boundaries", |samples| samples[0].u += 1e-9),
        ("astray", |samples| samples.swap(500, 501)),
        ("on the boundary", |samples| {
            let last = samples.last().unwrap().pass;
            samples.retain(|sample| sample.pass < last);
        }),
        ("complete", |samples| samples.truncate(samples.len() - 3)),
    ];
    let (oracle, ideal) = short_job("freeform", Pattern::Zig);
    for (word, inject) in faults {
        let mut samples = ideal.clone();
        inject(&mut samples);
        let failures = report_of(&oracle, &samples).failures(&AccuracyBounds::default());
        let word = if word == "astray" { "off their pass" } else { word };
        assert!(
            failures.iter().any(|failure| failure.contains(word)),
            "{word}: {failures:?}"
        );
    }
}

#[test]
fn a_pass_at_a_wrong_side_parameter_is_found() {
    let (oracle, mut samples) = short_job("plate", Pattern::Zig);
    samples
        .iter_mut()
        .filter(|sample| sample.pass == 5)
        .for_each(|sample| sample.v += 1e-5);
    let report = report_of(&oracle, &samples);
    assert!(report.side_step.max > 1e-4, "{:?}", report.side_step);
    // The positions do not agree with the side parameter of the pass either.
    assert_eq!(report.side_step.at.pass, 5);
    assert!(report.position_nm.max > 100.0);
}

#[test]
fn a_pass_on_the_pole_is_a_point() {
    let job = Job {
        scallop_mm: 0.2,
        along: Along::V,
        ..sample_job("sphere_cap")
    };
    let oracle = Oracle::new(&job).unwrap();
    let samples = ideal_samples(&oracle, 40.0);
    assert_eq!(samples[0].cc_nm, samples[1].cc_nm);
    assert!(samples[0].first_of_pass && samples[1].last_of_pass);
    assert_eq!(
        report_of(&oracle, &samples).failures(&AccuracyBounds::default()),
        Vec::<String>::new()
    );
}

/// A plane joined to a parabola, z = (t - 1)^2 at x = 10 t: level at the joint, with a curvature of 0.02 beyond.
#[test]
fn centre_changes_its_speed_where_the_curvature_does() {
    let heights = [0.0, 0.0, 0.0, 1.0];
    let row = |(x, z): (f64, f64)| [0.0, 10.0].map(|y| [x, y, z, 1.0]).to_vec();
    let spec = NurbsSpec {
        degree: [2, 1],
        knots_u: vec![0.0, 0.0, 0.0, 1.0, 2.0, 2.0, 2.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: [0.0, 5.0, 15.0, 20.0].into_iter().zip(heights).map(row).collect(),
        rational: false,
    };
    let along = oracle(SurfaceSpec::Nurbs(spec.clone()), Along::U, Side::Up);
    // 1 - r k, with a ball of 5 mm.
    close(along.ratio_step(0.5).unwrap(), 0.1, 1e-8);
    let across = oracle(SurfaceSpec::Nurbs(spec), Along::V, Side::Up);
    assert_eq!(across.ratio_step(1.0).unwrap(), 0.0, "no break on the pass");
}
