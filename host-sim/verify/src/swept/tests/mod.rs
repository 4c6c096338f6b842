//! Heights, gouges and travel against closed forms, on synthetic tool paths, without the core.

use std::f64::consts::FRAC_1_SQRT_2;

use super::*;
use glam::DVec3;
use job::{Along, MachineSpec, NurbsSpec, Origin, Pattern, Side, SurfaceSpec};
use oracle::PassSample;

use crate::Verdict;

mod gouges;

const RADIUS: f64 = 5.0;

fn job(surface: SurfaceSpec, along: Along, side: Side, scallop_mm: f64) -> Job {
    Job {
        surface,
        radius_mm: RADIUS,
        body: job::ToolBody::default(),
        setup: job::Setup::default(),
        region: None,
        feed_mm_min: 600.0,
        scallop_mm,
        along,
        side,
        pattern: Pattern::Zig,
        spacing: job::Spacing::Exact,
        chord_mm: 0.005,
        overrun_mm: 0.0,
        machine: MachineSpec::default(),
        origin: Origin::default(),
    }
}

/// A tool path on these passes, with `steps` samples on each, evenly spread over the parameter.
fn track(oracle: &Oracle, sides: &[f64], steps: u32) -> ToolPath {
    let [low, high] = oracle.path_range();
    let places: Vec<f64> = (0..=steps)
        .map(|k| low + (high - low) * f64::from(k) / f64::from(steps))
        .collect();
    let mut track = ToolPath::default();
    add_passes(&mut track, oracle, sides, &places);
    track
}

/// Adds passes with samples at these path parameters.
fn add_passes(track: &mut ToolPath, oracle: &Oracle, sides: &[f64], places: &[f64]) {
    let mut tick = 0;
    for (pass, side) in (0_u32..).zip(sides) {
        for (k, path) in places.iter().enumerate() {
            let (u, v) = oracle.swapped(*path, *side);
            let contact = oracle.contact(u, v).unwrap();
            let nm = |mm: DVec3| mm.to_array().map(|mm| (mm * 1e6).round() as i32);
            let sample = PassSample {
                tick,
                pass,
                u,
                v,
                cc_nm: nm(contact.cc_mm),
                cl_nm: nm(contact.cl_mm),
                feed_mm_s: 10.0,
                interval: 0.0,
                first_of_pass: k == 0,
                last_of_pass: k + 1 == places.len(),
            };
            track.add(&sample, oracle.along);
            tick += 1;
        }
    }
}

fn measured(job: &Job, sides: &[f64], steps: u32) -> SweptResult {
    let oracle = Oracle::new(job).unwrap();
    measure(
        job,
        &oracle,
        &track(&oracle, sides, steps),
        true,
        &Requirements::default(),
        &(),
    )
}

/// Asserts agreement within the error bound that the measurement states.
fn agrees(found: &SweptResult, exact: f64) {
    let off = (found.scallop_max.height_mm - exact).abs();
    assert!(
        off <= found.measurement_error_mm,
        "{} for {exact}: off by {off:e}, stated {:e}",
        found.scallop_max.height_mm,
        found.measurement_error_mm
    );
}

fn plane() -> SurfaceSpec {
    let rail = |y: f64| [[0.0, 0.0, 30.0, 5.0], [0.0, 0.0, 0.0, y], [0.0, 0.0, 0.0, 2.0]];
    SurfaceSpec::Ruled {
        rail0_mm: rail(0.0),
        rail1_mm: rail(20.0),
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    }
}

fn cylinder(radius: f64) -> SurfaceSpec {
    SurfaceSpec::Revolved {
        radius_mm: [0.0, 0.0, 0.0, radius],
        height_mm: [0.0, 0.0, 30.0, 0.0],
        u: [0.0, 1.0],
        v_rad: [0.0, 1.0],
    }
}

/// Two balls on a plane at distance d.
fn flat(d: f64) -> f64 {
    RADIUS - (RADIUS * RADIUS - 0.25 * d * d).sqrt()
}

#[test]
fn plane_leaves_the_ridge_of_two_circles() {
    let sides = [0.0, 0.01, 0.04, 0.1, 0.12, 1.0 / 6.0, 0.2, 0.21];
    for steps in [50, 3000] {
        let found = measured(&job(plane(), Along::U, Side::Up, 0.01), &sides, steps);
        agrees(&found, flat(0.06 * 20.0));
        assert_eq!(found.scallop_max.passes[0], 2);
        assert!((found.scallop_max.v - 0.07).abs() < 1e-5);
        assert!(found.measurement_error_mm < 4e-6, "{:?}", found.measurement_error);
        let gaps = sides.windows(2).map(|ends| 20.0 * (ends[1] - ends[0]));
        let mean = gaps.map(|d| d * flat(d)).sum::<f64>() / (20.0 * 0.21);
        assert!((found.scallop_mean_mm - mean).abs() < 4e-6);
        assert_eq!(found.gouge, None);
    }
}

#[test]
fn steep_ridges_are_exact_too() {
    // A step-over of 1.9 radii: the far pass's ball does not reach the near pass.
    let found = measured(&job(plane(), Along::U, Side::Up, 3.0), &[0.0, 0.475, 0.5], 500);
    agrees(&found, flat(9.5));
}

#[test]
fn unreached_points_are_reported_as_uncut() {
    let found = measured(&job(plane(), Along::U, Side::Up, 3.0), &[0.0, 0.6, 0.9], 100);
    assert!(
        found.failures.iter().any(|line| line.contains("reaches")),
        "{:?}",
        found.failures
    );
}

#[test]
fn cylinder_along_its_axis() {
    for radius in [12.0_f64, 20.0, 200.0] {
        let sides = [0.0, 0.6, 1.6, 2.0].map(|mm| mm / radius);
        for (side, sign) in [(Side::Plus, -1.0), (Side::Minus, 1.0)] {
            let found = measured(&job(cylinder(radius), Along::U, side, 0.01), &sides, 400);
            // Law of cosines: centres on the circle of R + sign r, at the angle of half a millimetre from the crest.
            let centre = radius + sign * RADIUS;
            let (sin, cos) = (0.5 / radius).sin_cos();
            let crest = centre * cos - sign * (RADIUS * RADIUS - (centre * sin).powi(2)).sqrt();
            agrees(&found, sign * (crest - radius));
            assert!(found.measurement_error_mm < 1e-4 * found.scallop_max.height_mm + 4e-6);
            assert_eq!((found.scallop_max.passes[0], found.gouge), (1, None));
        }
    }
}

#[test]
fn cylinder_around_its_axis() {
    for (side, sign) in [(Side::Plus, -1.0), (Side::Minus, 1.0)] {
        for steps in [20_u32, 100, 2000] {
            let found = measured(
                &job(cylinder(20.0), Along::V, side, 0.01),
                &[0.0, 0.02, 0.05, 0.06],
                steps,
            );
            agrees(&found, flat(0.9));
            // Far below the sagitta of 20 samples on the arc, 5 or 8 um: points are added between the samples.
            let half = 0.5 / f64::from(steps);
            let sagitta = (20.0 + sign * RADIUS) * (1.0 - half.cos());
            let stated = found.measurement_error.path_mm;
            assert!(stated <= 0.35 * sagitta + 3e-6, "{stated:e} for {sagitta:e}");
        }
    }
}

/// The sample job's cap of 25 mm: meridians from its pole down to 60 degrees.
#[test]
fn sphere_by_meridians() {
    let text = include_str!("../../../../../jobs/sphere_cap.toml");
    let job = job_file::parse("sphere_cap", text).unwrap();
    let oracle = Oracle::new(&job).unwrap();
    let sides: Vec<f64> = (0..=60).map(|k| f64::from(k) / 60.0).collect();
    let found = measure(
        &job,
        &oracle,
        &track(&oracle, &sides, 2000),
        true,
        &Requirements::default(),
        &(),
    );
    let azimuth = |v: f64| {
        let point = oracle.surface.at(1.0, v).point;
        point.y.atan2(point.x)
    };
    // Ball centres on great circles of R + r: the crest is at the angle `g` from both, sin g = sin 60 sin(half the azimuth difference).
    let height = |ends: &[f64]| {
        let half = 0.5 * (azimuth(ends[1]) - azimuth(ends[0]));
        let sin = 60.0_f64.to_radians().sin() * half.sin();
        let centre = 25.0 + job.radius_mm;
        centre * (1.0 - sin * sin).sqrt() - (job.radius_mm.powi(2) - (centre * sin).powi(2)).sqrt() - 25.0
    };
    agrees(&found, sides.windows(2).map(height).fold(0.0, f64::max));
    assert!((found.scallop_max.u - 1.0).abs() < 1e-9);
    assert!(found.scallop_max.height_mm > 0.005 && found.measurement_error_mm < 1e-5);
    assert_eq!(found.shape.poles, ["u = 0"]);
    assert_eq!((found.gouge, found.shape.degenerate), (None, None));
}

/// The same cap by circles around its pole, the first of which is the pole itself. Between circles the crest is half-way.
#[test]
fn sphere_by_circles_around_its_pole() {
    let text = include_str!("../../../../../jobs/sphere_cap.toml");
    for (sides, steps, coarse) in [
        (&[0.0, 0.04, 0.09, 0.13][..], 400, false),
        (&[0.0, 0.04, 0.09, 0.13], 24, false),
        // A circle of which the samples show next to nothing.
        (&[0.0, 0.04, 0.09, 0.13], 3, true),
    ] {
        let mut job = job_file::parse("sphere_cap", text).unwrap();
        (job.along, job.scallop_mm) = (Along::V, 0.05);
        let oracle = Oracle::new(&job).unwrap();
        let found = measure(
            &job,
            &oracle,
            &track(&oracle, sides, steps),
            true,
            &Requirements::default(),
            &(),
        );
        let angle = |u: f64| {
            let point = oracle.surface.at(u, 0.0).point;
            point.x.atan2(point.z)
        };
        let height = |ends: &[f64]| {
            let (sin, cos) = (0.5 * (angle(ends[1]) - angle(ends[0]))).sin_cos();
            let centre = 25.0 + job.radius_mm;
            centre * cos - (job.radius_mm.powi(2) - (centre * sin).powi(2)).sqrt() - 25.0
        };
        let exact = sides.windows(2).map(height).fold(0.0, f64::max);
        if coarse {
            assert_eq!(found.scallop_verdict, Verdict::Unknown, "{found:?}");
            let reported = &found.failures[0];
            assert!(
                reported.contains("not measured") && reported.contains("1 %"),
                "{reported}"
            );
            continue;
        }
        agrees(&found, exact);
        assert!(exact > 0.045 && exact < job.scallop_mm, "{exact}");
        assert!(
            found.measurement_error_mm < ERROR_SHARE_MAX * job.scallop_mm,
            "{steps}: {:?}",
            found.measurement_error
        );
        assert_eq!(
            (found.scallop_verdict, found.gouge_verdict),
            (Verdict::Met, Verdict::Met)
        );
    }
}

/// A ridge that is surely too high fails, however coarse the measurement; within the tolerance it is accepted.
#[test]
fn verdicts_count_the_error_and_the_tolerance() {
    let job = job(plane(), Along::U, Side::Up, 0.01);
    let oracle = Oracle::new(&job).unwrap();
    // 1.2 % above the limit.
    let width = 2.0 * (RADIUS * RADIUS - (RADIUS - 0.010_12_f64).powi(2)).sqrt() / 20.0;
    let path = track(&oracle, &[0.0, width, 1.5 * width], 300);
    for (tolerance, verdict) in [
        (0.0, Verdict::Violated),
        (0.01, Verdict::Violated),
        (0.015, Verdict::Met),
    ] {
        let requirements = Requirements {
            scallop_tolerance: tolerance,
            ..Requirements::default()
        };
        let found = measure(&job, &oracle, &path, true, &requirements, &());
        agrees(&found, 0.010_12);
        assert_eq!(found.scallop_verdict, verdict, "{tolerance}");
        assert_eq!(found.failures.is_empty(), verdict.is_met());
    }
}

/// A plane whose side lines are oblique to its passes: at the passes' ends the ridge is higher than in the middle, because the foot of
/// a point near one end is beyond the pass. There one ball's path and the other's end are at the same distance: d / (1 + cos) from a pass.
#[test]
fn oblique_ends_leave_higher_ridges() {
    let slant = 60.0_f64.to_radians();
    let rail = |x: f64, y: f64| [[0.0, 0.0, 30.0, x], [0.0, 0.0, 0.0, y], [0.0; 4]];
    let surface = SurfaceSpec::Ruled {
        rail0_mm: rail(0.0, 0.0),
        rail1_mm: rail(20.0 * slant.tan(), 20.0),
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    };
    let found = measured(&job(surface, Along::U, Side::Up, 0.02), &[0.0, 0.03, 0.06], 1000);
    agrees(&found, flat(2.0 * 0.6 / (1.0 + slant.cos())));
    assert!(found.scallop_max.u == 0.0 || found.scallop_max.u == 1.0);
    assert!(found.scallop_max.height_mm > 1.7 * flat(0.6));
}

/// A profile in x and z, extruded along y by 40 mm; u along the profile.
fn extruded(degree: usize, profile: &[[f64; 2]]) -> SurfaceSpec {
    let spans = profile.len() - degree;
    let mut knots_u = vec![0.0; degree];
    knots_u.extend((0..=spans).map(|k| k as f64 / spans as f64));
    knots_u.extend(vec![1.0; degree]);
    SurfaceSpec::Nurbs(NurbsSpec {
        degree: [degree, 1],
        knots_u,
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: profile
            .iter()
            .map(|[x, z]| vec![[*x, 0.0, *z, 1.0], [*x, 40.0, *z, 1.0]])
            .collect(),
        rational: false,
    })
}

/// A groove 0.8 mm wide between two passes 2 mm apart: no sample is in it, and the ball bridges it.
#[test]
fn groove_between_passes_stays_uncut() {
    let mut profile: Vec<[f64; 2]> = (0..=100).map(|k| [0.2 * f64::from(k), 0.0]).collect();
    profile[50][1] = -0.02;
    let mut job = job(extruded(3, &profile), Along::V, Side::Up, 0.055);
    job.radius_mm = 10.0;
    let oracle = Oracle::new(&job).unwrap();
    let bottom = oracle.surface.at(0.5, 0.0).point;
    assert!((bottom[0] - 10.0).abs() < 1e-9 && bottom[2] < -0.01);
    // Parameters of x = 1, 3, .. 19 by bisection; away from the ends x is linear in u.
    let at_x = |x: f64| {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if oracle.surface.at(middle, 0.0).point[0] < x {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    };
    let mut sides = vec![0.0];
    sides.extend((0..10).map(|k| at_x(1.0 + 2.0 * f64::from(k))));
    sides.push(1.0);
    let found = measure(
        &job,
        &oracle,
        &track(&oracle, &sides, 200),
        true,
        &Requirements::default(),
        &(),
    );
    let exact = -bottom[2] + 10.0 - (100.0_f64 - 1.0).sqrt();
    agrees(&found, exact);
    assert_eq!(found.scallop_max.passes[0], 5);
    assert_eq!(found.gouge, None);
    assert!(
        found.failures.iter().any(|line| line.contains("scallop")),
        "{:?}",
        found.failures
    );
    assert!(found.shape.concave_radius.unwrap().radius_mm < 10.0);
}

/// A third pass that is nearer than the two of the gap determines the height.
#[test]
fn other_passes_lower_a_ridge() {
    let job = job(plane(), Along::U, Side::Up, 0.5);
    let oracle = Oracle::new(&job).unwrap();
    let mut path = track(&oracle, &[0.0, 0.2, 0.4], 500);
    let before = measure(&job, &oracle, &path, true, &Requirements::default(), &());
    agrees(&before, flat(4.0));
    // Pass 2 is moved between the first two, regardless of its parameters.
    for centre in &mut path.passes[2].cl_nm {
        centre[1] = 2_000_000;
    }
    let after = measure(&job, &oracle, &path, true, &Requirements::default(), &());
    let gap_0 = |found: &SweptResult| {
        let heights = found.ridges[0]
            .points
            .iter()
            .map(|point| f64::from(point.height_mm));
        heights.fold(0.0, f64::max)
    };
    assert!((gap_0(&before) - flat(4.0)).abs() < 1e-5);
    assert!((gap_0(&after) - flat(2.0)).abs() < 1e-4, "{}", gap_0(&after));
}

#[test]
fn travel_is_compared_with_the_machine() {
    let mut job = job(plane(), Along::U, Side::Up, 0.5);
    // Centres: x 5 to 35, y 0 to 8, z 7.
    for (travel, beyond) in [
        ([[5.0, 35.0], [0.0, 8.0], [7.0, 8.0]], [[0.0; 2]; 3]),
        (
            [[6.0, 40.0], [0.0, 8.0], [0.0, 6.5]],
            [[1.0, 0.0], [0.0; 2], [0.0, 0.5]],
        ),
    ] {
        job.machine.travel_mm = Some(travel);
        let found = measured(&job, &[0.0, 0.2, 0.4], 300);
        for (ours, exact) in found.axes.beyond_mm.iter().flatten().zip(beyond.iter().flatten()) {
            assert!((ours - exact).abs() < 1e-9);
        }
        let sentences = found
            .failures
            .iter()
            .filter(|line| line.contains("travel_mm"))
            .count();
        assert_eq!(sentences, beyond.iter().filter(|ends| **ends != [0.0; 2]).count());
        assert_eq!(found.axes.within_travel(), sentences == 0);
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let text = include_str!("../../../../../jobs/torus.toml");
    let job = job_file::parse("torus", text).unwrap();
    let oracle = Oracle::new(&job).unwrap();
    let sides: Vec<f64> = (0..=12).map(|k| f64::from(k) / 12.0).collect();
    let track = track(&oracle, &sides, 1500);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| measure(&job, &oracle, &track, true, &Requirements::default(), &()))
    };
    let one = with(1);
    assert_eq!(one, with(2));
    assert_eq!(one, with(5));
    assert_eq!(one.ridges.len(), 12);
}

/// A stopped run leaves no ridge at its last pass; a run without two passes leaves none.
#[test]
fn incomplete_runs_are_reported() {
    let job = job(plane(), Along::U, Side::Up, 0.01);
    let oracle = Oracle::new(&job).unwrap();
    for (passes, gaps) in [(3, 1), (2, 0), (1, 0), (0, 0)] {
        let track = track(&oracle, &[0.0, 0.02, 0.04][..passes], 100);
        let found = measure(&job, &oracle, &track, false, &Requirements::default(), &());
        assert_eq!(found.ridges.len(), gaps);
        assert!(found.warnings.iter().any(|line| line.contains("not complete")));
    }
}

/// A plane 1 um beside its original: heights are those above the original, and the surface's own height keeps the limit.
#[test]
fn heights_are_measured_from_the_original() {
    let width = 2.0 * (RADIUS * RADIUS - (RADIUS - 0.0099_f64).powi(2)).sqrt() / 20.0;
    for (side, sign) in [(Side::Plus, 1.0), (Side::Minus, -1.0)] {
        let job = job(plane(), Along::U, side, 0.01);
        let oracle = Oracle::new(&job).unwrap();
        for (shift, tolerance_mm, scallop_mm, passes) in [
            (0.001, 0.001, 0.01, true),
            (-0.001, 0.001, 0.01, true),
            (0.0, 0.001, 0.0098, false),
            (-0.001, 0.0005, 0.01, false),
        ] {
            let job = Job {
                scallop_mm,
                ..job.clone()
            };
            let path = track(&oracle, &[0.0, width, 1.5 * width], 300);
            // Along S_u x S_v; the tool is on the side of `sign`.
            let offset_mm = |_: f64, _: f64| shift;
            let requirements = Requirements {
                original: Some(Original {
                    offset_mm: &offset_mm,
                    tolerance_mm,
                }),
                ..Requirements::default()
            };
            let found = measure(&job, &oracle, &path, true, &requirements, &());
            agrees(&found, 0.0099 - sign * shift);
            let original = found.original.unwrap();
            let above = if sign * shift > 0.0 {
                original.above_mm
            } else {
                original.below_mm
            };
            assert!((above - shift.abs()).abs() < 1e-12, "{original:?}");
            assert!((original.over_surface_mm - 0.0099).abs() < 3e-6);
            assert_eq!(found.failures.is_empty(), passes, "{shift} {:?}", found.failures);
        }
    }
}

/// A tool path along the passes of a front, curved and partial.
fn track_of_front(oracle: &Oracle, fronts: &oracle::front::Fronts<'_>, spacing_mm: f64) -> ToolPath {
    let mut track = ToolPath::default();
    let mut tick = 0;
    for (pass, places) in (0_u32..).zip(fronts.places(spacing_mm).unwrap()) {
        for (k, (u, v)) in places.iter().enumerate() {
            let contact = oracle.contact(*u, *v).unwrap();
            let nm = |mm: DVec3| mm.to_array().map(|mm| (mm * 1e6).round() as i32);
            let sample = PassSample {
                tick,
                pass,
                u: *u,
                v: *v,
                cc_nm: nm(contact.cc_mm),
                cl_nm: nm(contact.cl_mm),
                feed_mm_s: 10.0,
                interval: 0.0,
                first_of_pass: k == 0,
                last_of_pass: k + 1 == places.len(),
            };
            track.add(&sample, oracle.along);
            tick += 1;
        }
    }
    track
}

/// Curved passes, many of which end at the last boundary: the greatest crest is that of another measurement (the ball at places on the passes, parabolas between
/// them), and a pass that is missing is found.
#[test]
fn curved_and_partial_passes() {
    use oracle::front::{FrontOptions, Fronts, StartLine};
    let pole = |x: f64, y: f64, z: f64| [x, y, z, 1.0];
    let fan = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 1],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: vec![
            vec![pole(0.0, -5.0, 0.0), pole(0.0, 5.0, 2.0)],
            vec![pole(30.0, -14.0, 1.0), pole(34.0, 18.0, -3.0)],
        ],
        rational: false,
    });
    let job = job(fan, Along::U, Side::Up, 0.02);
    for start in [StartLine::Edge, StartLine::Middle] {
        let mut job = job.clone();
        job.spacing = job::Spacing::Constant(match start {
            StartLine::Middle => job::Start::Middle,
            _ => job::Start::Edge,
        });
        let oracle = Oracle::new(&job).unwrap();
        let fronts = Fronts::new(&oracle, start, &FrontOptions::default()).unwrap();
        let segments = fronts.segments().unwrap();
        assert!(
            segments
                .iter()
                .flatten()
                .any(|segment| segment.ends != [0.0, 1.0])
        );
        let whole = track_of_front(&oracle, &fronts, 0.05);
        let found = measure(&job, &oracle, &whole, true, &Requirements::default(), &());
        let other = fronts.crests().unwrap();
        assert!(
            (found.scallop_max.height_mm - other.max_mm).abs()
                <= found.measurement_error_mm + 2e-3 * job.scallop_mm
        );
        assert!(
            found.gouge.is_none() && found.failures.is_empty(),
            "{:?}",
            found.failures
        );
        // The last pass, on the boundary, is the oracle's to check: `last_on_boundary`.
        for missing in [whole.passes.len() / 3, whole.passes.len() - 4] {
            let mut track = whole.clone();
            track.passes.remove(missing);
            let found = measure(&job, &oracle, &track, true, &Requirements::default(), &());
            assert!(
                found.scallop_max.height_mm > 2.0 * job.scallop_mm && !found.failures.is_empty(),
                "{missing}"
            );
        }
    }
}
