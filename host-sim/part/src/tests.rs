//! Parts with closed forms: a boss on a plate, a wall, a groove, a shank, and the distance of faces from points.

mod creases;

use std::f64::consts::{PI, TAU};

use cad::{Boundary, Edge, Face, Placement, Surface};
use glam::{DVec3, dvec3};
use job::{HolderPart, NurbsSpec, SurfaceSpec, ToolBody};

use super::*;

fn face(number: usize, surface: Surface, loops: Vec<Vec<Edge>>, sense: f64) -> Face {
    Face {
        number,
        entity: format!("#{number}"),
        name: None,
        colour: None,
        surface,
        boundary: Boundary::Loops(loops),
        sense,
        solid: true,
    }
}

fn line(a: DVec3, b: DVec3) -> Edge {
    (0..=4).map(|k| a.lerp(b, f64::from(k) / 4.0)).collect()
}

fn polygon(corners: &[DVec3]) -> Vec<Edge> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| line(*a, *b)).collect()
}

fn circle(radius: f64, z: f64, turn: f64) -> Vec<Edge> {
    let at = |k: i32| {
        let angle = turn * TAU * f64::from(k) / 256.0;
        dvec3(radius * angle.cos(), radius * angle.sin(), z)
    };
    vec![(0..=256).map(at).collect()]
}

fn plane(z: f64) -> Surface {
    Surface::Plane {
        origin: dvec3(0.0, 0.0, z),
        x: DVec3::X,
        y: DVec3::Y,
    }
}

/// The side of a round boss of this radius between two heights.
fn boss(number: usize, radius: f64, z: [f64; 2]) -> Face {
    let side = Surface::Cylinder {
        origin: DVec3::ZERO,
        x: radius * DVec3::X,
        y: radius * DVec3::Y,
        z: DVec3::Z,
    };
    face(
        number,
        side,
        vec![circle(radius, z[0], 1.0), circle(radius, z[1], -1.0)],
        1.0,
    )
}

/// A plate of 60 x 60 mm with a boss in its middle: plate, side, top.
fn plate(radius: f64, height: f64) -> Vec<Face> {
    let corners = [
        dvec3(-30.0, -30.0, 0.0),
        dvec3(30.0, -30.0, 0.0),
        dvec3(30.0, 30.0, 0.0),
        dvec3(-30.0, 30.0, 0.0),
    ];
    vec![
        face(
            1,
            plane(0.0),
            vec![polygon(&corners), circle(radius, 0.0, -1.0)],
            1.0,
        ),
        boss(2, radius, [0.0, height]),
        face(3, plane(height), vec![circle(radius, height, 1.0)], 1.0),
    ]
}

/// A plane as the surface of a job, from `low` to `high` in x and y.
fn flat(low: f64, high: f64, height: impl Fn(f64, f64) -> f64) -> oracle::Surface {
    let pole = |x: f64, y: f64| [x, y, height(x, y), 1.0];
    oracle::Surface::new(&SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 1],
        knots_u: vec![low, low, high, high],
        knots_v: vec![low, low, high, high],
        poles_mm: vec![
            vec![pole(low, low), pole(low, high)],
            vec![pole(high, low), pole(high, high)],
        ],
        rational: false,
    }))
}

fn region(faces: &[Face], surface: &oracle::Surface, trimmed: &[Vec<[f64; 2]>], tool: &Tool) -> Made {
    let part = Part::new(faces);
    assert_eq!(part.missing, []);
    Request {
        surface,
        trimmed,
        face: &faces[0],
        placement: &Placement::IDENTITY,
        sign: 1.0,
        tool,
        scallop_mm: 0.01,
        steepest_deg: 85.0,
        touch_mm: 0.002,
        part: Some((&part, Some(0))),
    }
    .make()
}

/// The trimmed plate in (u, v) = (x, y).
fn trimmed(radius: f64) -> Vec<Vec<[f64; 2]>> {
    let hole = (0..720).map(|k| {
        let angle = f64::from(k) / 720.0 * TAU;
        [radius * angle.cos(), radius * angle.sin()]
    });
    vec![
        vec![[-30.0, -30.0], [30.0, -30.0], [30.0, 30.0], [-30.0, 30.0]],
        hole.collect(),
    ]
}

/// Least and greatest distance from the z axis of the loop around it.
fn around(made: &Made) -> [f64; 2] {
    let hole = made
        .loops
        .iter()
        .find(|points| points.iter().all(|[x, y]| x.hypot(*y) < 29.0));
    let radii = hole
        .expect("a loop around the boss")
        .iter()
        .map(|[x, y]| x.hypot(*y));
    radii.fold([f64::INFINITY, 0.0], |[low, high], r| [low.min(r), high.max(r)])
}

/// Loops are pulled in by 10 um, have 10 um more for fewer vertices, and the tool may enter by 1 um.
fn is_just_outside(found: [f64; 2], wanted: f64) {
    assert!(
        found[0] > wanted && found[1] < wanted + 0.03,
        "{found:?}, not just above {wanted}"
    );
}

#[test]
fn a_region_ends_beside_a_boss_by_the_balls_radius() {
    let surface = flat(-31.0, 31.0, |_, _| 0.0);
    for (radius, boss) in [(3.0, 8.0), (6.0, 5.0)] {
        let tool = Tool::new(radius, &ToolBody::default());
        let made = region(&plate(boss, 12.0), &surface, &trimmed(boss), &tool);
        is_just_outside(around(&made), boss + radius);
        // The plate's outer boundary is free: half a step-over is added.
        let most = made.loops.iter().flatten().map(|[x, _]| *x).fold(0.0, f64::max);
        let grown = 30.0 + GROWTH * (8.0 * radius * 0.01_f64).sqrt();
        assert!((most - grown.min(31.0)).abs() < 0.03, "{most}, {grown}");
        let reachable = 3600.0 - PI * (boss + radius).powi(2);
        assert!(
            (made.reachable_mm2 / reachable - 1.0).abs() < 0.01,
            "{}",
            made.reachable_mm2
        );
        assert!(made.inside_mm2 > 0.995 * made.reachable_mm2);
        assert_eq!(made.unreachable_mm2.len(), 1);
        assert_eq!(made.unreachable_mm2[0].0, Reason::Ball);
    }
}

/// A pin that the ball enters by more than it may within a tenth of a millimetre only: wherever it is in the grid, the region leaves it out.
#[test]
fn a_region_leaves_out_what_is_between_the_places_of_its_grid() {
    let tool = Tool::new(4.0, &ToolBody::default());
    for case in 0..24_i32 {
        let [x, y] = [0.754_877, 0.569_840].map(|part: f64| (part * f64::from(case)).fract() * 0.2);
        let surface = flat(-10.0, 10.0, |_, _| 0.0);
        let outer = [[-9.0 + x, -9.0 + y], [9.0, -9.0 + y], [9.0, 9.0], [-9.0 + x, 9.0]];
        let corners = outer.map(|[x, y]| dvec3(x, y, 0.0));
        let pin = [
            face(
                1,
                plane(0.0),
                vec![polygon(&corners), circle(0.01, 0.0, -1.0)],
                1.0,
            ),
            boss(2, 0.01, [0.0, 0.0021]),
            face(3, plane(0.0021), vec![circle(0.01, 0.0021, 1.0)], 1.0),
        ];
        let made = region(&pin, &surface, &[outer.to_vec()], &tool);
        let inside = crate::inside::Inside::new(&made.loops);
        assert!(!inside.contains([0.02, 0.0]), "case {case}");
        assert!(
            inside.contains([0.2, 0.0]) && inside.contains([0.0, -0.2]),
            "case {case}"
        );
    }
}

/// 40 pieces of a plane, one 20 mm long, the others 0.5 mm, at knots one apart: a pin on the long one is left out wherever it is in the grid.
#[test]
fn a_region_leaves_out_a_pin_on_a_long_piece_among_short_ones() {
    let tool = Tool::new(4.0, &ToolBody::default());
    let long = 4_u8;
    let mut profile = vec![[0.0, 0.0]];
    for piece in 0..40 {
        profile.push([
            profile[piece][0] + if piece == usize::from(long) { 20.0 } else { 0.5 },
            0.0,
        ]);
    }
    let inner = (0..=40).map(f64::from);
    let knots: Vec<f64> = [0.0].into_iter().chain(inner).chain([40.0]).collect();
    let (_, surface) = extruded(1, &knots, &profile);
    let length = profile[40][0];
    let outer = [[0.0, -10.0], [length, -10.0], [length, 10.0], [0.0, 10.0]];
    for case in 0..4_i32 {
        let at = dvec3(5.0 + 3.7 * f64::from(case), 0.3 * f64::from(case), 0.0);
        let ring = |z: f64, turn: f64| -> Vec<Edge> {
            let ring = circle(0.01, z, turn);
            vec![ring[0].iter().map(|point| *point + at).collect()]
        };
        let corners = outer.map(|[x, y]| dvec3(x, y, 0.0));
        let side = Surface::Cylinder {
            origin: at,
            x: 0.01 * DVec3::X,
            y: 0.01 * DVec3::Y,
            z: DVec3::Z,
        };
        let pin = [
            face(1, plane(0.0), vec![polygon(&corners), ring(0.0, -1.0)], 1.0),
            face(2, side, vec![ring(0.0, 1.0), ring(0.0021, -1.0)], 1.0),
            face(3, plane(0.0021), vec![ring(0.0021, 1.0)], 1.0),
        ];
        // Parameters of the surface: v is 0 to 1 across, u a knot for each piece.
        let u = |x: f64| f64::from(long) + (x - 2.0) / 20.0;
        let place = |x: f64, y: f64| [u(x), (y + 10.0) / 20.0];
        let trimmed = vec![vec![[0.0, 0.0], [40.0, 0.0], [40.0, 1.0], [0.0, 1.0]]];
        let made = region(&pin, &surface, &trimmed, &tool);
        let inside = crate::inside::Inside::new(&made.loops);
        assert!(!inside.contains(place(at.x + 0.02, at.y)), "case {case}");
        assert!(
            inside.contains(place(at.x + 0.2, at.y)) && inside.contains(place(at.x, at.y - 0.2)),
            "case {case}"
        );
    }
}

/// A boss lower than the ball's centre is touched by the ball's flank: at the height h at the distance sqrt(r^2 - (r - h)^2).
#[test]
fn a_low_boss_is_passed_by_the_balls_flank() {
    let surface = flat(-31.0, 31.0, |_, _| 0.0);
    let tool = Tool::new(6.0, &ToolBody::default());
    let made = region(&plate(8.0, 1.0), &surface, &trimmed(8.0), &tool);
    is_just_outside(around(&made), 8.0 + (36.0_f64 - 25.0).sqrt());
}

#[test]
fn a_shank_and_a_holder_keep_away_from_what_is_higher() {
    let surface = flat(-31.0, 31.0, |_, _| 0.0);
    let wide = ToolBody {
        shank_mm: Some(14.0),
        neck_mm: Some(5.0),
        ..ToolBody::default()
    };
    // Above the ball's centre, but below the shank; then above where it begins.
    for (height, reach, why) in [(4.5, 3.0, Reason::Ball), (9.0, 7.0, Reason::Shank)] {
        let made = region(
            &plate(8.0, height),
            &surface,
            &trimmed(8.0),
            &Tool::new(3.0, &wide),
        );
        is_just_outside(around(&made), 8.0 + reach);
        assert!(made.unreachable_mm2.iter().any(|(reason, _)| *reason == why));
    }
    let held = ToolBody {
        length_mm: Some(20.0),
        holder: vec![HolderPart {
            diameter_mm: [30.0, 30.0],
            length_mm: 10.0,
        }],
        ..ToolBody::default()
    };
    for (height, reach) in [(19.0, 3.0), (21.0, 15.0)] {
        let made = region(
            &plate(8.0, height),
            &surface,
            &trimmed(8.0),
            &Tool::new(3.0, &held),
        );
        is_just_outside(around(&made), 8.0 + reach);
    }
}

/// Two planes that rise to both sides of the y axis: the ball's contact ends where it touches both, at r tan(slope) along the flank.
#[test]
fn a_groove_is_reached_as_far_as_the_ball_fits() {
    let radius: f64 = 4.0;
    for degrees in [20.0_f64, 45.0, 60.0] {
        let slope = degrees.to_radians();
        let flank = |sign: f64| {
            let at = |x: f64, y: f64| dvec3(sign * x, y, x * slope.tan());
            let corners = [at(0.0, -10.0), at(20.0, -10.0), at(20.0, 10.0), at(0.0, 10.0)];
            let surface = Surface::Plane {
                origin: DVec3::ZERO,
                x: dvec3(sign, 0.0, slope.tan()),
                y: DVec3::Y,
            };
            face(
                if sign > 0.0 { 1 } else { 2 },
                surface,
                vec![polygon(&corners)],
                sign,
            )
        };
        let faces = [flank(1.0), flank(-1.0)];
        let surface = flat(-12.0, 22.0, |x, _| x * slope.tan());
        let trimmed = vec![vec![[0.0, -10.0], [20.0, -10.0], [20.0, 10.0], [0.0, 10.0]]];
        let made = region(
            &faces,
            &surface,
            &trimmed,
            &Tool::new(radius, &ToolBody::default()),
        );
        // Beside the ends of the groove the other flank is farther away.
        let inside = Inside::new(&made.loops);
        let holds = |x: f64| (-18..=18).all(|k| inside.contains([x, 0.5 * f64::from(k)]));
        let least = (0..40_000)
            .map(|k| 1e-4 * f64::from(k))
            .find(|x| holds(*x))
            .expect("the groove is reached");
        // The contact's distance from the edge along the flank is r tan(slope), in x r sin(slope).
        let wanted = radius * slope.sin();
        assert!(
            least > wanted && least < wanted + 0.03,
            "{degrees}: {least}, {wanted}"
        );
        let widest = made.radius_mm;
        assert!(widest.is_some_and(|widest| widest < radius), "{widest:?}");
    }
}

/// Distances of faces of each kind from points near them, by the cells, against the closed forms.
#[test]
fn distances_are_those_of_the_surfaces() {
    let part = Part::new(&plate(8.0, 12.0));
    let [cells, edges] = part.size();
    assert!(cells > 20 && edges > 500);
    let cases = [
        // Above the plate, beside the boss, above its top, beside its upper edge, beside the plate's corner.
        (dvec3(20.0, 5.0, 3.0), 3.0),
        (dvec3(11.0, 0.0, 6.0), 3.0),
        (dvec3(0.0, 9.0, 5.0), 1.0),
        (dvec3(1.0, 2.0, 14.0), 2.0),
        (dvec3(11.0, 0.0, 16.0), 5.0),
        (dvec3(33.0, 30.0, 4.0), 5.0),
        // Under the boss the plate has a hole: its edge, and the boss's side seen from within.
        (dvec3(0.0, 0.0, 1.0), 8.0),
        (dvec3(5.0, 0.0, -4.0), 5.0),
    ];
    for (point, wanted) in cases {
        let found = part
            .nearest(point, 20.0, None, false)
            .expect("near the part")
            .distance;
        assert!((found - wanted).abs() < 1e-3, "{point}: {found}, {wanted}");
        assert!(
            part.nearest(point, wanted + 0.002, None, true).is_some(),
            "{point}"
        );
        assert!(
            part.nearest(point, wanted - 0.002, None, true).is_none(),
            "{point}"
        );
    }
    for (point, z, wanted) in [
        (dvec3(11.0, 0.0, 0.0), [6.0, 1e9], 3.0),
        (dvec3(0.0, 20.0, 0.0), [6.0, 1e9], 12.0),
        (dvec3(3.0, 0.0, 0.0), [11.0, 1e9], 0.0),
        (dvec3(0.0, 40.0, 0.0), [-1.0, 1.0], 10.0),
    ] {
        let found = part
            .beside(point, z, 30.0, false)
            .expect("beside the part")
            .distance;
        assert!((found - wanted).abs() < 1e-3, "{point}: {found}, {wanted}");
    }
    assert!(
        part.beside(dvec3(11.0, 0.0, 0.0), [12.5, 1e9], 30.0, false)
            .is_none()
    );
}

/// Beside the apex of a cone, which is at the lower end of v, all distances are those of the flank.
#[test]
fn distances_beside_an_apex_are_those_of_the_flank() {
    let (apex, base, height) = (dvec3(25.0, 25.0, 8.0), 0.8, 8.0);
    let cone = Surface::Cone {
        origin: apex,
        x: DVec3::X,
        y: -DVec3::Y,
        z: -DVec3::Z,
        radius: 0.0,
        slope: base / height,
    };
    let rim: Edge = circle(base, 0.0, -1.0)
        .concat()
        .iter()
        .map(|at| *at + dvec3(25.0, 25.0, 0.0))
        .collect();
    let tip = dvec3(25.0, 25.0, 8.0);
    for sense in [1.0, -1.0] {
        let part = Part::new(&[face(1, cone.clone(), vec![vec![rim.clone()]], sense)]);
        assert_eq!(part.missing, []);
        let mut far = Vec::new();
        for turn in 1..24 {
            let angle = TAU * f64::from(turn) / 24.0;
            let out = dvec3(angle.cos(), angle.sin(), 0.0);
            let along = (base * out - height * DVec3::Z).normalize();
            let away = (height * out + base * DVec3::Z).normalize();
            for foot in [0.02, 0.05, 0.1, 0.2, 0.3, 0.5] {
                let point = tip + foot * along + 0.45 * away;
                let found = part.nearest(point, 3.0, None, false).expect("near the cone");
                far.push((found.distance - 0.45).abs());
            }
        }
        let worst = far.iter().copied().fold(0.0, f64::max);
        assert!(worst < 1e-3, "{worst} mm");
    }
}

/// Passes one step-over apart on a plane leave the scallop height between them.
#[test]
fn what_is_left_between_passes_is_the_scallop() {
    let (radius, step): (f64, f64) = (3.0, 0.6);
    let pass = |y: f64| [dvec3(-10.0, y, radius), dvec3(10.0, y, radius)];
    let passes = Passes::new((0..20).map(|k| pass(step * f64::from(k))).collect());
    let scallop = radius - (radius * radius - 0.25 * step * step).sqrt();
    for (y, wanted) in [
        (2.5 * step, scallop),
        (3.0 * step, 0.0),
        (19.0 * step + 0.3, scallop),
    ] {
        let height = passes.height(dvec3(0.3, y, 0.0), DVec3::Z, radius);
        assert!((height - wanted).abs() < 1e-9, "{y}: {height}, {wanted}");
    }
    assert!(
        passes
            .height(dvec3(0.0, 30.0, 0.0), DVec3::Z, radius)
            .is_infinite()
    );
}

/// A surface of a file that has no edges, and the same as the surface of a job; straight along v, from y = -10 to 10 mm, by poles of a profile in x and z.
fn extruded(degree: usize, knots: &[f64], profile: &[[f64; 2]]) -> (Face, oracle::Surface) {
    let knots_v = vec![0.0, 0.0, 1.0, 1.0];
    let poles = |weight: f64| -> Vec<Vec<[f64; 4]>> {
        let row = |[x, z]: &[f64; 2]| [-10.0, 10.0].map(|y| [*x, y, *z, weight]).to_vec();
        profile.iter().map(row).collect()
    };
    let spline = cad::SplineSurface {
        axes: [
            cad::Axis {
                degree,
                knots: knots.to_vec(),
            },
            cad::Axis {
                degree: 1,
                knots: knots_v.clone(),
            },
        ],
        poles: poles(1.0),
    };
    let surface = oracle::Surface::new(&SurfaceSpec::Nurbs(NurbsSpec {
        degree: [degree, 1],
        knots_u: knots.to_vec(),
        knots_v,
        poles_mm: poles(1.0),
        rational: false,
    }));
    let face = Face {
        boundary: Boundary::Natural,
        ..face(1, Surface::Spline(spline), Vec::new(), 1.0)
    };
    (face, surface)
}

#[test]
fn a_surface_without_edges_is_there_to_its_sides() {
    let (face, _) = extruded(1, &[0.0, 0.0, 1.0, 1.0], &[[0.0, 0.0], [20.0, 0.0]]);
    let part = Part::new(&[face]);
    for x in [0.0, 7.0, 20.0] {
        for y in [-10.0, 3.0, 10.0] {
            let place = dvec3(x, y, 0.0);
            // Away from the surface: above it, and beyond the sides and corners that the place is on.
            let away = dvec3(x - 10.0, 10.0 * y.trunc(), 0.0).normalize() + DVec3::Z;
            let point = place + 2.0 * away.normalize();
            let nearest = dvec3(point.x.clamp(0.0, 20.0), point.y.clamp(-10.0, 10.0), 0.0);
            let found = part.nearest(point, 5.0, None, false).expect("it is there");
            assert!(
                (found.distance - point.distance(nearest)).abs() < 1e-6,
                "{place}: {found:?}"
            );
        }
    }
}

/// Beside an edge with a fillet into which the ball does not fit, it fits at each contact, and touches both flanks at r tan(half of the angle) from the edge.
#[test]
fn a_ball_keeps_away_from_a_bend_of_its_own_face() {
    let (radius, angle, blend): (f64, f64, f64) = (4.0, 10.0_f64.to_radians(), 0.05);
    let along = |by: f64| {
        if by < 0.0 {
            [by, 0.0]
        } else {
            [by * angle.cos(), by * angle.sin()]
        }
    };
    let (line, bend) = ([-10.0, -7.0, -3.0], [-1.0 / 3.0, 1.0 / 3.0]);
    let mut profile: Vec<[f64; 2]> = line.iter().map(|by| along(*by)).collect();
    profile.push(along(-blend));
    profile.extend(bend.iter().map(|share| along(share * blend)));
    profile.push(along(blend));
    profile.extend(line.iter().rev().map(|by| along(-by)));
    let knots = [
        0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0, 3.0,
    ];
    let (face, surface) = extruded(3, &knots, &profile);
    let trimmed = vec![vec![[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]]];
    let made = region(
        &[face],
        &surface,
        &trimmed,
        &Tool::new(radius, &ToolBody::default()),
    );
    assert_eq!(made.loops.len(), 2);
    let from_edge = |place: &[f64; 2]| {
        let point = surface.at(place[0], place[1]).point;
        point.x.hypot(point.z)
    };
    let wanted = radius * (0.5 * angle).tan();
    for ring in &made.loops {
        let least = ring.iter().map(from_edge).fold(f64::INFINITY, f64::min);
        // Short of the flanks' contacts by the inset of 10 um, and by what a depth of 1 um allows.
        assert!((least - wanted).abs() < 0.025, "{least}, {wanted}");
    }
}

/// x = 20 u^3: the board's normal is not known where u is small, and the region ends 10 um before that, in space.
#[test]
fn a_side_at_which_a_derivative_vanishes_is_left_out() {
    let knots = [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0];
    let (face, surface) = extruded(3, &knots, &[[0.0; 2], [0.0; 2], [0.0; 2], [20.0, 0.0]]);
    let trimmed = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]];
    let made = region(&[face], &surface, &trimmed, &Tool::new(3.0, &ToolBody::default()));
    assert_eq!(made.loops.len(), 1);
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for [u, v] in &made.loops[0] {
        let x = surface.at(*u, *v).point.x;
        (least, most) = (least.min(x), most.max(x));
    }
    assert!((0.01..0.03).contains(&least), "{least} mm from the side");
    assert_eq!(most, 20.0);
    assert!(
        made.unreachable_mm2
            .iter()
            .all(|(why, area)| *why == Reason::Degenerate && *area < 0.1)
    );
}

/// A face that narrows to less than two insets: no polygon goes beyond its sides.
#[test]
fn where_a_face_is_narrow_its_region_ends() {
    let surface = flat(-31.0, 31.0, |_, _| 0.0);
    let narrow = [
        dvec3(0.0, 0.0, 0.0),
        dvec3(20.0, -0.03, 0.0),
        dvec3(20.0, 0.03, 0.0),
    ];
    let flat_face = face(1, plane(0.0), vec![polygon(&narrow)], 1.0);
    let trimmed = vec![narrow.iter().map(|corner| [corner.x, corner.y]).collect()];
    let made = Request {
        surface: &surface,
        trimmed: &trimmed,
        face: &flat_face,
        placement: &Placement::IDENTITY,
        sign: 1.0,
        tool: &Tool::new(3.0, &ToolBody::default()),
        scallop_mm: 0.01,
        steepest_deg: 85.0,
        touch_mm: 0.002,
        part: None,
    }
    .make();
    assert!(!made.loops.is_empty());
    let inside = Inside::new(&trimmed);
    for place in made.loops.iter().flatten() {
        assert!(inside.contains(*place), "{place:?}");
    }
}
