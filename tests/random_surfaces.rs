//! Random surfaces, also nearly degenerate ones: every sample is within its bounds, or a justified fault stopped the run.

use interp_core::{Fault, FaultKind};
use job::{Along, Job, Pattern, Side, Spacing, SurfaceSpec};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use verify::survey::Survey;

/// Result of a run: the fault with its position, and the worst figures.
struct Ran {
    fault: Option<Fault>,
    position_nm: f64,
    ripple_pct: f64,
    interval: f64,
    off_boundary: u32,
    samples: u64,
    place: [f64; 2],
    /// The last pass runs against the direction of its path parameter.
    backwards: bool,
    /// Parameters of the sample next to the fault, along the pass or across.
    neighbour: Option<[f64; 2]>,
}

/// Runs at least a given number of samples, to the end of the pass, because the survey needs the sample after a pass's last step.
fn run(job: &Job, most: u64) -> Ran {
    let oracle = Oracle::new(job).unwrap();
    let prepared = prepare(job).unwrap();
    let mut survey = Survey::new(&oracle, None);
    let mut machine = Machine::load(&prepared).unwrap();
    let mut samples = 0;
    let (mut first, mut last, mut cut) = (None, None, false);
    let result = machine.run(|sample| {
        let here = (sample.pass, prepared.parameters(sample.path, sample.side));
        let begins = last.is_none_or(|(pass, _)| pass != sample.pass);
        if begins {
            first = Some(here);
        }
        last = Some(here);
        samples += 1;
        cut = samples >= most && begins;
        survey
            .add(&inspect::plain(&prepared, sample), &mut |_, _| ())
            .is_ok()
            && !cut
    });
    let (pass, path, side) = machine.place();
    let across = last.is_some_and(|(last, _)| last != pass) && job.pattern == Pattern::Zig;
    let neighbour = if across { first } else { last }.map(|(_, parameters)| parameters);
    let report = survey
        .finish(result.is_ok() && !cut, &mut |_, _| ())
        .unwrap()
        .report;
    Ran {
        fault: result.err(),
        position_nm: report.position_nm.max,
        ripple_pct: report.ripple_pct.max,
        interval: report.interval.max,
        // In a truncated run the last pass has no end on the boundary.
        off_boundary: if result.is_ok() && !cut {
            report.off_boundary
        } else {
            0
        },
        samples,
        place: prepared.parameters(path, side),
        backwards: job.pattern == Pattern::Zigzag && pass % 2 == 1,
        neighbour,
    }
}

fn job(surface: SurfaceSpec, along: Along, pattern: Pattern) -> Job {
    Job {
        surface,
        radius_mm: 3.0,
        body: job::ToolBody::default(),
        setup: job::Setup::default(),
        region: None,
        feed_mm_min: 600.0,
        scallop_mm: 0.5,
        along,
        side: Side::Plus,
        pattern,
        spacing: Spacing::Exact,
        chord_mm: 0.005,
        overrun_mm: 0.0,
        machine: Default::default(),
        origin: Default::default(),
    }
}

/// A plane of 20 mm x 20 mm, with random cubics of amplitude `bump` mm added to every coordinate.
fn bumpy(random: &[f64], bump: f64) -> SurfaceSpec {
    let mut coefficients_mm = [[[0.0; 4]; 4]; 3];
    for (c, random) in coefficients_mm.iter_mut().flatten().flatten().zip(random) {
        *c = bump * random;
    }
    coefficients_mm[0][2][3] += 20.0;
    coefficients_mm[1][3][2] += 20.0;
    SurfaceSpec::Bicubic {
        coefficients_mm,
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    }
}

/// A bumpy patch of this number, along u or v, in passes with half a millimetre of scallop height.
pub(crate) fn bumpy_job(seed: usize) -> Job {
    // A linear congruential generator: the same surfaces on each machine.
    let mut state = 0x9e37_79b9_7f4a_7c15_u64 ^ (seed as u64).wrapping_mul(0xd134_2543_de82_ef95);
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        #[allow(clippy::cast_precision_loss, reason = "32 bits")]
        let unit = (state >> 32) as f64 / 2_f64.powi(31) - 1.0;
        unit
    };
    let coefficients: Vec<f64> = (0..48).map(|_| random()).collect();
    let along = if random() > 0.0 { Along::U } else { Along::V };
    job(
        bumpy(&coefficients, 10_f64.powf(0.8 * random())),
        along,
        Pattern::Zigzag,
    )
}

/// The oracle's largest product of ball radius and curvature, and its least sine between S_u and S_v, near a point.
fn near(job: &Job, [u, v]: [f64; 2]) -> (f64, f64) {
    let oracle = Oracle::new(job).unwrap();
    let (mut fit, mut sine) = (f64::NEG_INFINITY, f64::INFINITY);
    for i in -10..=10 {
        for j in -10..=10 {
            let at = |x: f64, k: i32| (x + f64::from(k) * 2e-3).clamp(0.0, 1.0);
            let (u, v) = (at(u, i), at(v, j));
            if let Ok(contact) = oracle.contact(u, v) {
                fit = fit.max(contact.fit(job.radius_mm));
            } else {
                sine = 0.0;
            }
            let d = oracle.surface.at(u, v);
            let (e, f, g) = (d.u.length_squared(), d.u.dot(d.v), d.v.length_squared());
            sine = sine.min(((e * g - f * f).max(0.0) / (e * g)).sqrt());
        }
    }
    (fit, sine)
}

/// Whether the normal turns by about 120 degrees or more between the fault and the sample next to it.
fn turns(job: &Job, ran: &Ran) -> bool {
    let oracle = Oracle::new(job).unwrap();
    let normal = |[u, v]: [f64; 2]| oracle.contact(u, v).map(|contact| contact.normal);
    match (normal(ran.place), ran.neighbour.map(normal)) {
        (Ok(a), Some(Ok(b))) => a.dot(b) < -0.499,
        _ => false,
    }
}

/// The second-order series of the parameter step at the fault, from the oracle's derivatives: its correction relative to the first-order
/// step, and the relative error of the arc that it covers in one period.
fn series(job: &Job, ran: &Ran) -> (f64, f64) {
    let oracle = Oracle::new(job).unwrap();
    let [u, v] = ran.place;
    let d = oracle.surface.at(u, v);
    let (a, a2, path, side) = match job.along {
        Along::U => (d.u, d.uu, u, v),
        Along::V => (d.v, d.vv, v, u),
    };
    let way = if ran.backwards { -1.0 } else { 1.0 };
    let room = if ran.backwards { path } else { 1.0 - path };
    let arc_mm = job.feed_mm_min / 60.0 * 1e-3;
    let first = arc_mm / a.length();
    let bend = way * first * a.dot(a2) / a.length_squared();
    let added = bend * (bend - 1.0) / 2.0;
    let step = (first * (1.0 + added)).min(room);
    let covered_mm = way * oracle.arc_of_step(path, way * step, side);
    (added, covered_mm / arc_mm - 1.0)
}

fn justified(job: &Job, ran: &Ran) -> Result<(), TestCaseError> {
    let Some(fault) = ran.fault else { return Ok(()) };
    let place = ran.place;
    let (fit, sine) = near(job, place);
    match fault.kind {
        FaultKind::BallDoesNotFit => {
            prop_assert!(fault.value > 0.999_9, "value {}", fault.value);
            prop_assert!(fit > 0.99, "{fault:?}, but r k is {fit} around {place:?}");
        }
        FaultKind::DegenerateSurface => {
            prop_assert!(
                sine < 2e-3 || turns(job, ran),
                "{fault:?}, but the sine is {sine} around {place:?}"
            );
        }
        FaultKind::ParameterBackwards => {
            // The core's limits: a correction of more than 1/2, or an error of 1/16 of the step by the change of the speed.
            let (added, missed) = series(job, ran);
            prop_assert!(
                added.abs() > 0.499 || missed.abs() > 0.02,
                "{fault:?}, but the series adds {added} and misses by {missed} at {place:?}"
            );
            if added.abs() > 0.501 {
                prop_assert!(
                    (f64::from(fault.value) / added - 1.0).abs() < 0.01,
                    "{fault:?} for {added}"
                );
            }
        }
        _ => prop_assert!(false, "{fault:?} around {place:?}"),
    }
    Ok(())
}

fn either<T: Clone + std::fmt::Debug + 'static>(a: T, b: T) -> impl Strategy<Value = T> {
    prop_oneof![Just(a), Just(b)]
}

/// The same 200 cases in each run; ISOFEED_CASES sets a number of new random cases.
fn campaign() -> ProptestConfig {
    let config = ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    match std::env::var("ISOFEED_CASES")
        .ok()
        .and_then(|cases| cases.parse().ok())
    {
        Some(cases) => ProptestConfig { cases, ..config },
        None => ProptestConfig {
            cases: 200,
            rng_seed: RngSeed::Fixed(1998),
            ..config
        },
    }
}

proptest! {
    #![proptest_config(campaign())]

    /// Amplitudes from a tenth of a millimetre to more than the size of the plane.
    #[test]
    fn bicubic_patches(
        random in prop::collection::vec(-1.0..1.0_f64, 48),
        scale in -1.0..1.4_f64,
        along in either(Along::U, Along::V),
        pattern in either(Pattern::Zig, Pattern::Zigzag),
        side in either(Side::Plus, Side::Minus),
    ) {
        let mut job = job(bumpy(&random, 10_f64.powf(scale)), along, pattern);
        job.side = side;
        let ran = run(&job, 40_000);
        justified(&job, &ran)?;
        // The error of the offset grows with the ball radius, and as S_u and S_v become parallel.
        prop_assert!(ran.fault.is_some() || ran.position_nm <= 10.0, "CL off by {} nm", ran.position_nm);
        prop_assert!(ran.fault.is_some() || ran.ripple_pct <= 0.001, "ripple {} %", ran.ripple_pct);
        prop_assert!(ran.fault.is_some() || ran.interval <= 1e-4, "interval off by {}", ran.interval);
        prop_assert_eq!(ran.off_boundary, 0);
    }

    /// A patch with a boundary that is nearly a point: the error of the normal grows as far as the bound permits, or a fault stops the
    /// run.
    #[test]
    fn nearly_collapsed_boundaries(shrink in -7.0..-0.5_f64, height in -6.0..6.0_f64, along in either(Along::U, Along::V)) {
        let width = 10_f64.powf(shrink);
        let mut c = [[[0.0; 4]; 4]; 3];
        // x = 20 u - 10 at v = 0, scaled by `width` at v = 1; y = 20 v; z = height v^2.
        c[0][2][3] = 20.0;
        c[0][3][3] = -10.0;
        c[0][2][2] = 20.0 * (width - 1.0);
        c[0][3][2] = -10.0 * (width - 1.0);
        c[1][3][2] = 20.0;
        c[2][3][1] = height;
        let surface = SurfaceSpec::Bicubic { coefficients_mm: c, u: [0.0, 1.0], v: [0.0, 1.0] };
        let mut job = job(surface, along, Pattern::Zig);
        job.scallop_mm = 0.05;
        let ran = run(&job, 200_000);
        justified(&job, &ran)?;
        let bound = 10.0 + 5e-4 / width.max(1e-7);
        prop_assert!(ran.position_nm <= bound, "CL off by {} nm where the boundary is {width} wide", ran.position_nm);
        prop_assert!(ran.samples > 100);
    }
}

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

/// Patches smaller than the ball, whose radius in the patch's fine units exceeds i32.
#[test]
fn patches_smaller_than_the_ball() {
    for size in [1.0, 2.0, 5.0, 8.0, 15.0] {
        for radius_mm in [4.0, 6.0, 10.0, 50.0] {
            let mut c = [[[0.0; 4]; 4]; 3];
            (c[0][2][3], c[1][3][2]) = (size, size);
            (c[2][1][3], c[2][2][3], c[2][3][2]) = (-0.08 * size, 0.08 * size, -2e-4 * size);
            let surface = SurfaceSpec::Bicubic {
                coefficients_mm: c,
                u: [0.0, 1.0],
                v: [0.0, 1.0],
            };
            let mut job = job(surface, Along::U, Pattern::Zig);
            (job.radius_mm, job.scallop_mm) = (radius_mm, 1e-3);
            let ran = run(&job, u64::MAX);
            let bound = 1.0 + 2.5e-7 * radius_mm * 1e6;
            assert_eq!(ran.fault, None, "{size} mm, ball {radius_mm}");
            assert!(
                ran.position_nm <= bound,
                "{size} mm, ball {radius_mm}: CL off by {} nm",
                ran.position_nm
            );
        }
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

/// If the parametric speed changes by a large fraction within a period, the run faults or keeps the feed.
#[test]
fn uneven_parametrisations_keep_the_feed_or_fault() {
    // x = a u + b u^2/2 + c u^3/3, and the arc of one period.
    for (a, b, c, arc) in [
        (0.019_147, 0.221_538_9, 3.513_668_9, 0.020_080_0),
        (0.011_214_9, -0.114_487_4, 1.899_846_6, 0.012_100_8),
    ] {
        let mut coefficients_mm = [[[0.0; 4]; 4]; 3];
        (
            coefficients_mm[0][2][3],
            coefficients_mm[0][1][3],
            coefficients_mm[0][0][3],
        ) = (a, b / 2.0, c / 3.0);
        coefficients_mm[1][3][2] = 1.0;
        let surface = SurfaceSpec::Bicubic {
            coefficients_mm,
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        };
        let mut job = job(surface, Along::U, Pattern::Zig);
        (job.radius_mm, job.scallop_mm, job.feed_mm_min) = (0.5, 0.01, arc * 60_000.0);
        let ran = run(&job, u64::MAX);
        assert!(
            ran.fault
                .is_some_and(|fault| fault.kind == FaultKind::ParameterBackwards)
                || ran.ripple_pct <= 0.001,
            "{}",
            ran.ripple_pct
        );
    }
}

/// A sharp ridge on which the path nearly reverses: |S_u| falls to a few per cent and S_u turns by 180 degrees within some steps, always at
/// right angles to S_v. The surface is regular there, and any ball fits on the convex side.
#[test]
fn ridge_on_which_the_path_all_but_stands() {
    let ridge = |breadth: f64| {
        let mut c = [[[0.0; 4]; 4]; 3];
        (c[0][1][3], c[0][2][3], c[1][3][2], c[2][2][3]) = (20.0, -20.0, 20.0, breadth);
        let surface = SurfaceSpec::Bicubic {
            coefficients_mm: c,
            u: [0.0, 1.0],
            v: [0.0, 1.0],
        };
        job(surface, Along::U, Pattern::Zig)
    };
    for breadth in [0.1, 0.2, 0.3, 0.5] {
        let job = ridge(breadth);
        let ran = run(&job, u64::MAX);
        let kind = ran.fault.map(|fault| fault.kind);
        assert_eq!(kind, Some(FaultKind::ParameterBackwards), "{breadth}");
        assert!((ran.place[0] - 0.5).abs() < 0.03, "{breadth}: {:?}", ran.place);
        justified(&job, &ran).unwrap();
    }
    for breadth in [0.8, 1.5, 2.6, 3.0, 8.0] {
        let ran = run(&ridge(breadth), u64::MAX);
        assert_eq!(ran.fault, None, "{breadth}");
        assert!(ran.ripple_pct <= 0.001, "{breadth}: ripple {} %", ran.ripple_pct);
    }
}

/// Two patches along a straight line, the first with constant parametric speed, the second with 30 + 900 w^2: at the second sample on the
/// second patch the derivative of the speed's slope cannot be estimated from the sample before.
#[test]
fn steps_after_a_boundary_between_speeds() {
    let x = [0.0, 3.333, 6.666, 9.999, 19.999, 29.999, 339.999];
    let nurbs = job::NurbsSpec {
        degree: [3, 1],
        knots_u: vec![0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: x
            .iter()
            .map(|x| vec![[*x, 0.0, 0.0, 1.0], [*x, 5.0, 0.0, 1.0]])
            .collect(),
        rational: false,
    };
    let mut job = job(SurfaceSpec::Nurbs(nurbs), Along::U, Pattern::Zig);
    for feed_mm_s in [99.0, 100.0, 103.0] {
        job.feed_mm_min = 60.0 * feed_mm_s;
        let ran = run(&job, u64::MAX);
        assert_eq!(ran.fault, None);
        assert!(
            ran.ripple_pct <= 0.001,
            "{feed_mm_s}: ripple {} %",
            ran.ripple_pct
        );
    }
}
