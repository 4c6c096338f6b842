//! Reach against closed forms.

use super::*;
use crate::Verdict;
use crate::swept::Progress;
use job::{Block, Fixture, HolderPart, NurbsSpec, Side, SurfaceSpec};

/// A depth is searched to 1 % and 1 um; a wall of the stock begins 1 um beside what the ball clears.
fn near(found: f64, exact: f64) -> bool {
    (found - exact).abs() <= 0.01 * exact.abs() + 2e-3
}

fn job(surface: SurfaceSpec, side: Side, radius_mm: f64) -> Job {
    let mut job = job_file::parse("torus.toml", include_str!("../../../../jobs/torus.toml")).unwrap();
    job.surface = surface;
    job.side = side;
    job.radius_mm = radius_mm;
    job
}

/// The rectangle with the corner `a` and the sides `u` and `v`.
fn plane(a: DVec3, u: DVec3, v: DVec3) -> SurfaceSpec {
    let rail = |from: DVec3| std::array::from_fn(|k| [0.0, 0.0, u[k], from[k]]);
    SurfaceSpec::Ruled {
        rail0_mm: rail(a),
        rail1_mm: rail(a + v),
        u: [0.0, 1.0],
        v: [0.0, 1.0],
    }
}

/// A motion through these places, in contact on the stretches whose second place says so, with samples 0.05 mm apart.
fn motion(places: &[(DVec3, bool)]) -> Motion {
    let mut motion = Motion::default();
    for pair in places.windows(2) {
        let [(from, _), (to, in_contact)] = [pair[0], pair[1]];
        let count = (from.distance(to) / 0.05).ceil().max(1.0);
        for k in 0..count as usize {
            let place = from.lerp(to, k as f64 / count);
            motion.add(
                (place * 1e6).to_array().map(|nm| nm.round() as i32),
                in_contact,
                false,
            );
        }
    }
    motion
}

/// A contact of every sample of a motion, at these offsets from the centre.
fn contacts(motion: &Motion, offset: impl Fn(DVec3) -> DVec3) -> ContactSide {
    let mut side = ContactSide::default();
    for sample in 0..motion.samples() {
        let centre = motion.centre(sample);
        let at = ContactPlace {
            sample,
            pass: 0,
            uv: [0.0; 2],
            place_mm: centre + offset(centre),
        };
        side.add(at, centre);
    }
    side
}

fn reach(job: &Job, motion: &Motion) -> ReachResult {
    let oracle = Oracle::new(job).unwrap();
    let contact = contacts(motion, |_| -DVec3::Z);
    measure(job, &oracle, motion, &contact, &() as &dyn Progress)
}

fn find(result: &ReachResult, part: ToolPart, obstacle: Obstacle) -> ReachFinding {
    let own = |finding: &&ReachFinding| (finding.part, finding.obstacle) == (part, obstacle);
    *result.findings.iter().find(own).unwrap()
}

/// A sphere of radius 20 between the latitudes of -45 and 45 degrees, a quarter around, exact.
fn sphere() -> SurfaceSpec {
    let half = 0.5_f64.sqrt();
    let (radius, out) = (20.0, 20.0 / half);
    let profile = [
        (20.0 * half, -20.0 * half, 1.0),
        (out, 0.0, half),
        (20.0 * half, 20.0 * half, 1.0),
    ];
    let around = [(1.0, 0.0, 1.0), (1.0, 1.0, half), (0.0, 1.0, 1.0)];
    let _ = radius;
    SurfaceSpec::Nurbs(NurbsSpec {
        degree: [2, 2],
        knots_u: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        poles_mm: around
            .iter()
            .map(|(x, y, w)| {
                profile
                    .iter()
                    .map(|(r, z, v)| [r * x, r * y, *z, w * v])
                    .collect()
            })
            .collect(),
        rational: true,
    })
}

/// Along a circle of latitude below the equator the shank is in the sphere: most at its equator, by (S + r) (1 - cos).
#[test]
fn a_sphere_below_its_equator() {
    let mut job = job(sphere(), Side::Plus, 4.0);
    let outside = {
        let oracle = Oracle::new(&job).unwrap();
        let at = oracle.surface.at(0.5, 0.5);
        oracle.normal(&at, 0.5, 0.5).unwrap().dot(at.point)
    };
    if outside < 0.0 {
        job.side = Side::Minus;
    }
    let oracle = Oracle::new(&job).unwrap();
    for (latitude, touches) in [(-20.0_f64, true), (-2.0, true), (0.0, false), (20.0, false)] {
        let (sin, cos) = latitude.to_radians().sin_cos();
        let mut motion = Motion::default();
        for k in 0..=900 {
            let (s, c) = (f64::from(k) * 0.1_f64).to_radians().sin_cos();
            let place = DVec3::new(24.0 * cos * c, 24.0 * cos * s, 24.0 * sin);
            motion.add((place * 1e6).to_array().map(|nm| nm.round() as i32), true, false);
        }
        let contact = contacts(&motion, |centre| -centre / 6.0);
        let found = measure(&job, &oracle, &motion, &contact, &());
        assert!((contact.height_max_mm + 4.0 * sin).abs() < 1e-5);
        let shank = find(&found, ToolPart::Shank, Obstacle::Surface);
        let exact = 24.0 * (1.0 - cos);
        if touches {
            assert_eq!(contact.verdict(), Verdict::Violated);
            assert_eq!(contact.above_equator, 901);
            assert!(
                near(shank.depth_mm, exact),
                "{latitude}: {shank:?}, exact {exact}"
            );
            assert!(
                shank.depth_mm <= exact + 1e-3 && shank.bound_mm >= exact - 1e-3,
                "{shank:?}"
            );
            assert!(shank.place_mm.z.abs() < 0.5, "{shank:?}");
            assert_eq!(shank.verdict(), Verdict::Violated);
            // Half of it looks down; it is less than a quarter of a sphere, so a turn helps.
            assert!((found.facing.down_share - 0.5).abs() <= found.facing.error_share);
            assert!(
                found.failures.iter().any(|text| text.contains("rotate_deg")),
                "{:?}",
                found.failures
            );
        } else {
            assert_eq!(
                (contact.verdict(), shank.verdict()),
                (Verdict::Met, Verdict::Met),
                "{latitude}: {shank:?}"
            );
        }
    }
}

/// An overhanging plane: the tool at its lower edge, the upper edge over its ball.
#[test]
fn an_overhang() {
    let lean = 10.0_f64.to_radians();
    let (sin, cos) = lean.sin_cos();
    let up = DVec3::new(sin, 0.0, cos);
    let job = job(plane(DVec3::ZERO, DVec3::Y * 30.0, up * 12.0), Side::Plus, 5.0);
    let normal = DVec3::new(cos, 0.0, -sin);
    let path = motion(&[(normal * 5.0, false), (normal * 5.0 + DVec3::Y * 30.0, true)]);
    let found = reach(&job, &path);
    let shank = find(&found, ToolPart::Shank, Obstacle::Surface);
    let exact = 5.0 - (5.0 * cos - 12.0 * sin).abs();
    assert!(near(shank.depth_mm, exact), "{shank:?}, exact {exact}");
    // The depth is within 1 % and 1 um, so the place is within that over the sine.
    assert!((shank.place_mm.z - 12.0 * cos).abs() < 0.2);
}

/// A shank beside a wall, at known distances.
#[test]
fn a_wall_beside_a_shank() {
    let mut job = job(
        plane(DVec3::ZERO, DVec3::Y * 30.0, DVec3::Z * 40.0),
        Side::Plus,
        3.0,
    );
    job.body.shank_mm = Some(8.0);
    job.body.neck_mm = Some(9.0);
    for (off, depth, verdict) in [
        (3.5, 0.5, Verdict::Violated),
        (3.99, 0.01, Verdict::Violated),
        (4.0, 0.0, Verdict::Met),
        (4.01, 0.0, Verdict::Met),
        (9.0, 0.0, Verdict::Met),
    ] {
        let path = motion(&[
            (DVec3::new(off, 0.0, 5.0), false),
            (DVec3::new(off, 30.0, 5.0), true),
        ]);
        let found = reach(&job, &path);
        let shank = find(&found, ToolPart::Shank, Obstacle::Surface);
        assert_eq!(shank.verdict(), verdict, "{off}: {shank:?}");
        if verdict == Verdict::Violated {
            assert!(near(shank.depth_mm, depth), "{off}: {shank:?}");
        }
        // The ball and the neck are a millimetre slimmer.
        let neck = find(&found, ToolPart::Neck, Obstacle::Surface);
        assert_eq!(neck.verdict(), Verdict::Met);
    }
    // Above the wall's upper edge there is nothing to touch.
    job.body.neck_mm = Some(42.0);
    let path = motion(&[
        (DVec3::new(3.5, 0.0, 5.0), false),
        (DVec3::new(3.5, 30.0, 5.0), true),
    ]);
    let shank = find(&reach(&job, &path), ToolPart::Shank, Obstacle::Surface);
    assert_eq!(shank.verdict(), Verdict::Met, "{shank:?}");
}

/// A slope under the holder: the rim of its face is the nearest, or the deepest.
#[test]
fn a_slope_under_a_holder() {
    let slope = 40.0_f64.to_radians();
    let (sin, cos) = slope.sin_cos();
    let up = DVec3::new(cos, 0.0, sin);
    let spec = plane(-100.0 * up - DVec3::Y * 40.0, DVec3::Y * 80.0, up * 200.0);
    let mut job = job(spec, Side::Up, 3.0);
    let centre = DVec3::new(-sin, 0.0, cos) * 3.0;
    let path = motion(&[(centre - DVec3::Y * 5.0, false), (centre + DVec3::Y * 5.0, true)]);
    for (length, diameter) in [(40.0, 30.0), (25.0, 60.0), (25.0, 40.0), (60.0, 120.0)] {
        job.body.length_mm = Some(length);
        job.body.holder = vec![HolderPart {
            diameter_mm: [diameter; 2],
            length_mm: 50.0,
        }];
        let found = reach(&job, &path);
        let holder = find(&found, ToolPart::Holder(1), Obstacle::Surface);
        // Distance of the rim's point uphill from the plane; the ball's centre is 3 mm from it.
        let gap = 3.0 + (length - 3.0) * cos - 0.5 * diameter * sin;
        if gap > 0.0 {
            let clearance = holder.clearance_mm().unwrap();
            assert!(
                clearance <= gap && clearance > 0.96 * gap - 2e-3,
                "{holder:?}, exact {gap}"
            );
            assert_eq!(holder.verdict(), Verdict::Met);
        } else {
            // As deep from the side as from below.
            let exact = -gap / (sin + cos);
            assert!(near(holder.depth_mm, exact), "{holder:?}, exact {exact}");
            assert_eq!(holder.verdict(), Verdict::Violated);
        }
    }
    // A cone that widens with the slope is nearer than its face's rim: its side is along the slope.
    job.body.holder = vec![HolderPart {
        diameter_mm: [10.0, 10.0 + 2.0 * 30.0 / slope.tan()],
        length_mm: 30.0,
    }];
    job.body.length_mm = Some(30.0);
    let holder = find(&reach(&job, &path), ToolPart::Holder(1), Obstacle::Surface);
    let gap = 3.0 + 27.0 * cos - 5.0 * sin;
    let clearance = holder.clearance_mm().unwrap();
    assert!(
        clearance <= gap && clearance > 0.96 * gap,
        "{holder:?}, exact {gap}"
    );
}

/// A floor of 40 x 40 mm, 20 mm deep in its stock.
fn pocket() -> (Job, Motion) {
    let mut job = job(
        plane(DVec3::ZERO, DVec3::X * 40.0, DVec3::Y * 40.0),
        Side::Up,
        3.0,
    );
    job.setup.stock = Some(Block {
        low_mm: [-10.0, -10.0, -15.0],
        high_mm: [50.0, 50.0, 20.0],
    });
    let mut places = vec![
        (DVec3::new(0.0, 0.0, 30.0), false),
        (DVec3::new(0.0, 0.0, 3.0), false),
    ];
    for k in 0..=20 {
        let y = 2.0 * f64::from(k);
        let ends = if k % 2 == 0 { [0.0, 40.0] } else { [40.0, 0.0] };
        places.extend(ends.map(|x| (DVec3::new(x, y, 3.0), true)));
    }
    (job, motion(&places))
}

/// The pocket is as wide as the ball goes; a shank that is 2 mm wider touches its walls by 2 mm.
#[test]
fn a_wide_shank_in_a_pocket() {
    let (mut job, path) = pocket();
    let plain = reach(&job, &path);
    assert_eq!(plain.verdict(), Verdict::Met, "{:?}", plain.findings);
    job.body.shank_mm = Some(10.0);
    job.body.neck_mm = Some(12.0);
    let shank = find(&reach(&job, &path), ToolPart::Shank, Obstacle::Stock);
    assert!(near(shank.depth_mm, 2.0), "{shank:?}");
    assert_eq!(shank.verdict(), Verdict::Violated);
    // A neck that is longer than the pocket is deep.
    job.body.neck_mm = Some(20.5);
    let shank = find(&reach(&job, &path), ToolPart::Shank, Obstacle::Stock);
    assert_eq!(shank.verdict(), Verdict::Met, "{shank:?}");
    job.body.neck_mm = Some(19.5);
    let shank = find(&reach(&job, &path), ToolPart::Shank, Obstacle::Stock);
    assert!(near(shank.depth_mm, 0.5), "{shank:?}");
}

/// A traverse through what is left of the stock.
#[test]
fn a_link_through_the_stock() {
    let (job, _) = pocket();
    let place = |x: f64, z: f64| DVec3::new(x, 20.0, z);
    for (safe_z, depth) in [(22.0, 1.0), (22.9, 0.1), (23.1, 0.0)] {
        let path = motion(&[
            (place(10.0, safe_z), false),
            (place(10.0, 3.0), false),
            (place(30.0, 3.0), true),
            (place(30.0, safe_z), false),
            (place(70.0, safe_z), false),
        ]);
        let ball = find(&reach(&job, &path), ToolPart::Ball, Obstacle::Stock);
        if depth > 0.0 {
            assert!(near(ball.depth_mm, depth), "{safe_z}: {ball:?}");
            assert!(ball.place_mm.x > 33.0, "{ball:?}");
        } else {
            assert_eq!(ball.verdict(), Verdict::Met, "{safe_z}: {ball:?}");
        }
    }
}

/// Boxes at known distances from ball, shank and holder.
#[test]
fn fixtures() {
    let (mut job, path) = pocket();
    job.setup.stock = None;
    job.body.length_mm = Some(30.0);
    job.body.holder = vec![HolderPart {
        diameter_mm: [20.0; 2],
        length_mm: 50.0,
    }];
    let block = |low_mm, high_mm| Fixture {
        name: "clamp".to_owned(),
        block: Block { low_mm, high_mm },
    };
    job.setup.fixtures = vec![
        // Beside the last pass, lower than the holder: 4.5 mm from the axis, 1.5 from ball and shank.
        block([10.0, 44.5, -5.0], [20.0, 60.0, 20.0]),
        // Under the holder's rim: 10 mm around the axis, its face at z = 30.
        block([-20.0, 0.0, -5.0], [-8.0, 40.0, 30.4]),
        // Touches the ball by 0.2 mm.
        block([0.0, -9.0, -5.0], [10.0, -2.8, 8.0]),
    ];
    let found = reach(&job, &path);
    for (part, index, exact) in [
        (ToolPart::Ball, 0, -1.5),
        (ToolPart::Shank, 0, -1.5),
        (ToolPart::Holder(1), 0, -10.0),
        (ToolPart::Holder(1), 1, 0.4),
        (ToolPart::Shank, 1, -5.0),
        (ToolPart::Ball, 2, 0.2),
        (ToolPart::Shank, 2, 0.2),
    ] {
        let finding = find(&found, part, Obstacle::Fixture(index));
        assert!(
            (finding.depth_mm - exact).abs() < 3e-4,
            "{finding:?}, exact {exact}"
        );
        let expected = if exact > 0.0 {
            Verdict::Violated
        } else {
            Verdict::Met
        };
        assert_eq!(finding.verdict(), expected);
    }
    assert_eq!(found.failures.len(), 3, "{:?}", found.failures);
    assert!(
        found
            .failures
            .iter()
            .all(|text| text.contains("fixture clamp") && text.contains("tick"))
    );
}

/// A search that may not look further says so.
#[test]
fn what_is_not_measured_is_not_met() {
    let finding = ReachFinding {
        part: ToolPart::Shank,
        obstacle: Obstacle::Surface,
        depth_mm: 0.001,
        bound_mm: 0.01,
        place_mm: DVec3::ZERO,
        centre_mm: DVec3::ZERO,
        sample: 0,
        uv: None,
    };
    assert_eq!(finding.verdict(), Verdict::Unknown);
}

/// The ball between passes, in contact as in a step-over, or below the surface.
#[test]
fn the_ball_between_passes() {
    let ball = |job: &Job, motion: &Motion| find(&reach(job, motion), ToolPart::Ball, Obstacle::Surface);
    // A plane: a step-over in contact, and one that dips.
    let job_of_plane = job(
        plane(DVec3::ZERO, DVec3::X * 40.0, DVec3::Y * 30.0),
        Side::Plus,
        4.0,
    );
    for (dip, verdict) in [
        (0.0, Verdict::Met),
        (1e-3, Verdict::Met),
        (4e-3, Verdict::Violated),
        (0.7, Verdict::Violated),
        (5.0, Verdict::Violated),
    ] {
        let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, 4.0 + z);
        let mut motion = motion(&[
            (at(3.0, 5.0, 0.0), true),
            (at(37.0, 5.0, 0.0), true),
            (at(35.0, 6.3, -dip), false),
            (at(37.0, 7.0, 0.0), false),
            (at(3.0, 7.0, 0.0), true),
        ]);
        for joined in [false, true] {
            let found = ball(&job_of_plane, &motion);
            assert_eq!(found.verdict(), verdict, "{dip}: {found:?}");
            if verdict == Verdict::Violated {
                // At most the radius: where the centre is on the surface.
                let exact = dip.min(4.0);
                assert!(near(found.depth_mm, exact), "{dip}: {found:?}");
                assert!(found.bound_mm >= exact - 1e-3);
                let lowest = at(35.0, 6.3, -dip);
                assert!(dip > 4.0 || found.centre_mm.distance(lowest) < 0.1, "{found:?}");
            }
            // A turn that counts as in contact still counts as between passes.
            if !joined {
                motion.join([true].into_iter());
            }
        }
    }
    // Along a chord from contact to contact over a sphere: (S + r) (1 - cos).
    let mut job_of_sphere = job(sphere(), Side::Plus, 4.0);
    let oracle = Oracle::new(&job_of_sphere).unwrap();
    let at = oracle.surface.at(0.5, 0.5);
    if oracle.normal(&at, 0.5, 0.5).unwrap().dot(at.point) < 0.0 {
        job_of_sphere.side = Side::Minus;
    }
    for half in [0.4_f64, 3.0, 10.0] {
        let at = |degrees: f64| {
            let (sin, cos) = (45.0 + degrees).to_radians().sin_cos();
            DVec3::new(cos, sin, 0.3).normalize() * 24.0
        };
        let found = ball(&job_of_sphere, &motion(&[(at(-half), false), (at(half), false)]));
        let exact = 24.0 - 0.5 * (at(-half) + at(half)).length();
        assert!(near(found.depth_mm, exact), "{half}: {exact}, {found:?}");
        let violated = exact > TOUCH_MM;
        assert_eq!(found.verdict() == Verdict::Violated, violated, "{half}");
    }
    // No links, no row.
    let motion = motion(&[
        (DVec3::new(3.0, 5.0, 4.0), true),
        (DVec3::new(30.0, 5.0, 4.0), true),
    ]);
    let found = reach(&job_of_plane, &motion);
    let balls = found
        .findings
        .iter()
        .filter(|finding| finding.part == ToolPart::Ball);
    assert_eq!(balls.filter(|finding| finding.sample > 0).count(), 0);
}

/// On a bent patch, links through places near the surface: the depth is that of the nearest of very many places of it.
#[test]
fn the_ball_between_passes_against_dense_places() {
    let job = job_file::parse("plate.toml", include_str!("../../../../jobs/plate.toml")).unwrap();
    let oracle = Oracle::new(&job).unwrap();
    let steps = 500_u32;
    let share = |k: u32| f64::from(k) / f64::from(steps);
    let places: Vec<DVec3> = (0..=steps)
        .flat_map(|i| (0..=steps).map(move |j| (i, j)))
        .map(|(i, j)| oracle.surface.at(share(i), share(j)).point)
        .collect();
    let mut state = 7_u64;
    let mut random = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut violated = 0;
    for _ in 0..12 {
        let mut corner = || {
            let at = oracle.contact(random(), random()).unwrap();
            (at.cl_mm + at.normal * (0.5 * random() - 0.1), false)
        };
        let from = corner();
        let to = corner();
        // Short, so that the ends decide as often as the middle.
        let to = (from.0.lerp(to.0, 0.2), false);
        let motion = motion(&[from, to]);
        let found = find(&reach(&job, &motion), ToolPart::Ball, Obstacle::Surface);
        let way = to.0 - from.0;
        let nearest = places.iter().map(|place| {
            let along = ((*place - from.0).dot(way) / way.length_squared()).clamp(0.0, 1.0);
            (from.0 + way * along).distance(*place)
        });
        let dense = job.radius_mm - nearest.fold(f64::INFINITY, f64::min);
        assert!(found.bound_mm >= dense - 1e-3, "{dense}, {found:?}");
        if dense > 0.01 {
            violated += 1;
            // Between the places, 0.2 mm apart, the surface comes nearer by up to 0.1^2 / 2 r.
            assert!(
                found.depth_mm > 0.985 * dense - 2e-3 && found.depth_mm < dense + 4e-3,
                "{dense}, {found:?}"
            );
            assert_eq!(found.verdict(), Verdict::Violated);
        } else if dense < -0.01 {
            assert_eq!(found.verdict(), Verdict::Met, "{dense}, {found:?}");
        }
    }
    assert!((3..12).contains(&violated), "{violated}");
}
