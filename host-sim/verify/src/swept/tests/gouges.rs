//! Gouges against closed forms.

use job::PartSource;

use super::*;

/// Flanks at 45 degrees, 28.28 mm long: a ball on one flank, at s from the bottom, enters the other one by r - s.
#[test]
fn ball_on_one_flank_gouges_the_other() {
    let valley = extruded(1, &[[-20.0, 20.0], [0.0, 0.0], [20.0, 20.0]]);
    let job = job(valley, Along::V, Side::Up, 0.01);
    let flank = 800.0_f64.sqrt();
    // Passes at 8, 6, 1.3 mm from the bottom, and at 2, 7 on the other side.
    let sides = [-8.0, -6.0, -1.3, 2.0, 7.0].map(|s| 0.5 + 0.5 * s / flank);
    let oracle = Oracle::new(&job).unwrap();
    let found = measure(
        &job,
        &oracle,
        &track(&oracle, &sides, 800),
        true,
        &Requirements::default(),
        &(),
    );
    let gouge = found.gouge.unwrap();
    let exact = RADIUS - 1.3;
    assert!((gouge.depth_mm / exact - 1.0).abs() < 1e-3, "{gouge:?}");
    // Under the centre, at r along the other flank.
    let foot = RADIUS * FRAC_1_SQRT_2;
    assert!(
        gouge.point_mm.distance(DVec3::new(foot, gouge.point_mm.y, foot)) < 0.3,
        "{gouge:?}"
    );
    assert_eq!((gouge.pass, gouge.local), (2, false));
    let samples = &oracle_sample(&found, &oracle, &sides);
    assert!(samples.distance(gouge.point_mm) < RADIUS);
    assert_eq!(
        found.failures.iter().filter(|line| line.contains("cuts")).count(),
        1
    );
}

/// The ball's centre at the gouging tick, recomputed.
fn oracle_sample(found: &SweptResult, oracle: &Oracle, sides: &[f64]) -> DVec3 {
    let track = track(oracle, sides, 800);
    let tick = found.gouge.unwrap().tick;
    let pass = track.passes.iter().rfind(|pass| pass.first_tick <= tick).unwrap();
    pass.centre((tick - pass.first_tick) as usize)
}

/// A concave cylinder of smaller radius than the ball: from every contact the ball interferes most with the far edge.
#[test]
fn ball_in_a_small_concave_radius_is_a_local_gouge() {
    let job = job(cylinder(4.0), Along::U, Side::Plus, 0.01);
    let found = measured(&job, &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0], 300);
    let gouge = found.gouge.unwrap();
    // Seen from the axis, the centre is 1 mm opposite to the contact; the other edge is 1 rad away.
    let distance = (16.0 + 1.0 + 8.0 * 1.0_f64.cos()).sqrt();
    assert!(
        (gouge.depth_mm / (RADIUS - distance) - 1.0).abs() < 2e-3,
        "{gouge:?}"
    );
    assert!(gouge.local && (gouge.v < 0.02 || gouge.v > 0.98));
    let concave = found.shape.concave_radius.unwrap();
    assert!((concave.radius_mm - 4.0).abs() < 1e-9);
    assert!(found.warnings.iter().any(|line| line.contains("does not fit")));
}

/// On a face of a part the ball may be as deep as the part's tolerance says; deeper by more than the error bound is a gouge, and so is any depth
/// without a part.
#[test]
fn gouge_of_a_part_is_held_to_its_tolerance() {
    let mut job = job(cylinder(4.0), Along::U, Side::Plus, 0.01);
    // From one edge of an arc 0.08 mm wide, a ball that is too large for it by 1 mm enters the other by 0.16 um.
    let half = 0.02_f64;
    let SurfaceSpec::Revolved { v_rad, .. } = &mut job.surface else {
        unreachable!()
    };
    *v_rad = [0.0, half];
    let distance = (16.0 + 1.0 + 8.0 * half.cos()).sqrt();
    let exact = RADIUS - distance;
    assert!(exact > 1e-4 && exact < 2e-3, "{exact}");
    let part = |tolerance_mm| PartSource {
        path: "part.step".into(),
        tolerance_mm,
        steepest_deg: 85.0,
    };
    for (part, verdict) in [
        (None, Verdict::Violated),
        (Some(part(0.9 * exact)), Verdict::Violated),
        (Some(part(exact - 0.5 * POSITION_MM)), Verdict::Met),
        (Some(part(1.1 * exact)), Verdict::Met),
    ] {
        job.origin.set_part(part);
        let found = measured(&job, &[0.0, 0.25 * half, 0.5 * half, half], 300);
        assert!(
            (found.gouge_max_mm() / exact - 1.0).abs() < 2e-3,
            "{:?}",
            found.gouge
        );
        assert_eq!(
            found.gouge_verdict, verdict,
            "exact {exact}, bound {}, floor {}, {} cells",
            found.gouge_bound_mm, found.gouge_floor_mm, found.cells
        );
        let cuts = found.failures.iter().filter(|line| line.contains("cuts")).count();
        assert_eq!(cuts, usize::from(verdict == Verdict::Violated));
    }
}

/// A slow run about a convex cylinder, from rest to rest: what is stored of its samples gouges nothing, at any feed that it was programmed for.
#[test]
fn left_out_samples_are_no_gouge() {
    let job = job(cylinder(10.0), Along::V, Side::Minus, 0.13);
    let oracle = Oracle::new(&job).unwrap();
    let (step, ramp) = (1e-4, 60_i32);
    let exact = flat(0.05 * 30.0);
    // The step grows from 0 to its full size and falls to 0 again.
    let mut places = vec![0.0];
    while places[places.len() - 1] < 1.0 {
        let (at, k) = (places[places.len() - 1], places.len());
        let rise = (k as f64 / f64::from(ramp)).min(1.0).powi(2);
        let fall = ((1.0 - at) / (step * f64::from(ramp)) + 0.01).min(1.0);
        places.push((at + step * rise * fall).min(1.0));
    }
    for spacing_nm in [0.0, 2e3, 2e4, 1.1e5, 1e6] {
        let mut track = ToolPath::with_spacing(spacing_nm, job.scallop_mm);
        add_passes(&mut track, &oracle, &[0.0, 0.02, 0.07, 0.1], &places);
        let found = measure(&job, &oracle, &track, true, &Requirements::default(), &());
        assert_eq!(found.gouge, None, "{spacing_nm} nm");
        assert_eq!(found.gouge_verdict, Verdict::Met, "{spacing_nm} nm");
        agrees(&found, exact);
    }
}

/// A surface of thousands of squares of the ball's radius has more cells than one of some hundreds; gouges were not measured, for the reason that "the ball hardly fits".
#[test]
fn a_small_ball_on_a_large_plane_is_measured() {
    const SIDE_MM: f64 = 7.5;
    let rail = |y: f64| [[0.0, 0.0, SIDE_MM, 0.0], [0.0, 0.0, 0.0, y], [0.0; 4]];
    let surface = SurfaceSpec::Ruled {
        rail0_mm: rail(0.0),
        rail1_mm: rail(SIDE_MM),
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    };
    let mut job = job(surface, Along::U, Side::Plus, 0.005);
    job.radius_mm = 0.1;
    let sides: Vec<f64> = (0..=125).map(|k| f64::from(k) / 125.0).collect();
    let mut found = measured(&job, &sides, 100);
    assert_eq!(found.gouge_verdict, Verdict::Met);
    assert!(found.cells > 1_500_000, "{}", found.cells);
    // The sentence names the size of the surface where that is the cause.
    found.gouge_cells_exhausted = true;
    let reported = found.searching_remedy(&job);
    assert!(
        reported.contains("too large for a ball of 0.1 mm") && !reported.contains("hardly fits"),
        "{reported}"
    );
}
