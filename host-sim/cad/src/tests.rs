//! Tests of the geometry against closed forms: restriction, exact forms, point inversion, outlines.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::exact::exact;
use super::fit::Knots;
use super::*;
use glam::{DVec3, dvec3};

/// A rational, unclamped B-spline surface of given degrees with non-uniform knots, one of them double.
fn wavy(p: usize, q: usize) -> SplineSurface {
    let axis = |degree: usize| {
        let inner = if degree > 1 {
            vec![0.0, 0.3, 0.35, 1.0, 1.0, 2.5]
        } else {
            vec![0.0, 0.3, 0.35, 1.0, 2.5]
        };
        let before = (1..=degree).rev().map(|k| -0.2 * k as f64);
        let after = (1..=degree).map(|k| 2.5 + 0.7 * k as f64);
        Axis {
            degree,
            knots: before.chain(inner).chain(after).collect(),
        }
    };
    let axes = [axis(p), axis(q)];
    let pole = |i: usize, j: usize| {
        let (x, y) = (7.0 * i as f64, 5.0 * j as f64);
        let w = 1.0 + 0.3 * (x + 2.0 * y).sin();
        [
            x + (0.3 * y).sin(),
            y,
            4.0 * (0.2 * x).cos() * (0.4 * y).sin(),
            1.0,
        ]
        .map(|c| c * w)
    };
    SplineSurface {
        poles: (0..axes[0].poles())
            .map(|i| (0..axes[1].poles()).map(|j| pole(i, j)).collect())
            .collect(),
        axes,
    }
}

fn near(a: DVec3, b: DVec3, most: f64, what: &str) {
    let gap = a.distance(b);
    assert!(gap <= most, "{what}: {gap} mm between {a:?} and {b:?}");
}

#[test]
fn a_cut_is_the_same_surface() {
    for p in 1..=7 {
        for q in [1, 3, 5] {
            let whole = wavy(p, q);
            let part = whole.cut([[0.31, 2.2], [0.0, 1.0]]);
            assert_eq!(part.domain(), [[0.31, 2.2], [0.0, 1.0]]);
            for axis in &part.axes {
                let ends = [axis.domain()[0], axis.domain()[1]];
                assert!(
                    ends.iter().all(|end| axis.multiplicity(*end) == axis.degree + 1),
                    "clamped"
                );
            }
            for (u, v) in [
                (0.31, 0.0),
                (0.35, 0.34),
                (0.9, 0.3),
                (1.0, 0.7),
                (1.7, 0.99),
                (2.2, 1.0),
            ] {
                near(whole.at(u, v).point, part.at(u, v).point, 1e-11, "cut");
            }
        }
    }
}

#[test]
fn derivatives_are_those_of_the_points() {
    let surface = wavy(5, 4);
    let step = 1e-5;
    for (u, v) in [(0.1, 0.2), (0.5, 0.7), (1.8, 2.1)] {
        let at = surface.at(u, v);
        let slope = |a: DVec3, b: DVec3| (a - b) * (0.5 / step);
        let (right, left) = (surface.at(u + step, v), surface.at(u - step, v));
        let (above, below) = (surface.at(u, v + step), surface.at(u, v - step));
        near(at.u, slope(right.point, left.point), 1e-5, "S_u");
        near(at.v, slope(above.point, below.point), 1e-5, "S_v");
        near(at.uu, slope(right.u, left.u), 1e-4, "S_uu");
        near(at.uv, slope(above.u, below.u), 1e-4, "S_uv");
        near(at.vv, slope(above.v, below.v), 1e-4, "S_vv");
    }
}

/// One surface of each kind in a rotated and translated frame, with a rectangle of parameters.
fn kinds() -> Vec<(Surface, [[f64; 2]; 2])> {
    let (x, y, z) = (dvec3(0.6, 0.8, 0.0), DVec3::Z, dvec3(0.8, -0.6, 0.0));
    let origin = dvec3(100.0, -20.0, 7.0);
    let profile = Curve::Ellipse {
        center: dvec3(130.0, -20.0, 7.0),
        x: 5.0 * DVec3::X,
        y: 3.0 * DVec3::Z,
    };
    vec![
        (Surface::Plane { origin, x, y }, [[-3.0, 9.0], [2.0, 4.0]]),
        (
            Surface::Cylinder {
                origin,
                x: x * 9.0,
                y: y * 9.0,
                z,
            },
            [[0.4, 5.9], [-3.0, 8.0]],
        ),
        (
            Surface::Cone {
                origin,
                x,
                y,
                z,
                radius: 4.0,
                slope: 0.5,
            },
            [[-1.0, 0.5], [-8.0, 3.0]],
        ),
        (
            Surface::Sphere {
                center: origin,
                x: x * 12.0,
                y: y * 12.0,
                z: z * 12.0,
            },
            [[0.0, TAU], [-FRAC_PI_2, 1.1]],
        ),
        (
            Surface::Torus {
                center: origin,
                x,
                y,
                z,
                major: 20.0,
                minor: 6.0,
            },
            [[1.0, 2.2], [0.3, 6.0]],
        ),
        (
            Surface::Revolution {
                profile: profile.clone(),
                range: [0.0, TAU],
                origin,
                axis: DVec3::Z,
            },
            [[0.2, 3.3], [0.5, 4.0]],
        ),
        (
            Surface::Extrusion {
                profile,
                range: Some([0.0, TAU]),
                direction: dvec3(1.0, 2.0, 0.5),
            },
            [[0.5, 4.0], [-2.0, 6.0]],
        ),
        (Surface::Spline(wavy(3, 2)), [[0.31, 2.2], [0.1, 1.9]]),
    ]
}

/// The exact form lies on the surface everywhere, and covers the rectangle to its corners.
#[test]
fn exact_forms_are_exact() {
    for (surface, rectangle) in kinds() {
        let form = exact(&surface, rectangle).unwrap();
        let [[u0, u1], [v0, v1]] = rectangle;
        assert_eq!(form.domain(), rectangle);
        for i in 0..=20 {
            for j in 0..=20 {
                let (u, v) = (
                    u0 + (u1 - u0) * f64::from(i) / 20.0,
                    v0 + (v1 - v0) * f64::from(j) / 20.0,
                );
                let point = form.at(u, v).point;
                let (place, distance) = surface.invert(point, Some([u, v]));
                assert!(
                    distance < 1e-10,
                    "{}: {distance} mm off at {u}, {v}",
                    surface.kind()
                );
                near(surface.at(place[0], place[1]).point, point, 1e-10, surface.kind());
            }
        }
        for (u, v) in [(u0, v0), (u1, v0), (u0, v1), (u1, v1)] {
            near(form.at(u, v).point, surface.at(u, v).point, 1e-10, surface.kind());
        }
    }
}

/// A mirrored and scaled copy of a surface has the mirrored and scaled points at the same parameters.
#[test]
fn placements_move_points() {
    let by = Placement {
        rows: [
            [0.0, -2.0, 0.0, 5.0],
            [-2.0, 0.0, 0.0, -7.0],
            [0.0, 0.0, 2.0, 1.0],
        ],
    };
    assert!(by.mirrors());
    assert_eq!(by.similarity(), Some(2.0));
    for (surface, [[u0, u1], [v0, v1]]) in kinds() {
        let offset = Surface::Offset {
            base: Box::new(surface.clone()),
            distance: 0.3,
        };
        for surface in [surface, offset] {
            let placed = surface.placed(&by).unwrap();
            for share in [0.1, 0.45, 0.8] {
                let (u, v) = (u0 + share * (u1 - u0), v1 + share * (v0 - v1));
                near(
                    placed.at(u, v).point,
                    by.point(surface.at(u, v).point),
                    1e-9,
                    surface.kind(),
                );
            }
        }
    }
    let squeezed = Placement {
        rows: [[1.0, 0.0, 0.0, 0.0], [0.0, 0.5, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
    };
    assert_eq!(squeezed.similarity(), None);
}

fn face(surface: Surface, loops: Vec<Vec<Edge>>, sense: f64) -> Face {
    Face {
        number: 1,
        name: None,
        colour: None,
        entity: "#1".to_owned(),
        surface,
        boundary: Boundary::Loops(loops),
        sense,
        solid: true,
    }
}

/// Points on the straight line between two parameter points of a surface.
fn edge(surface: &Surface, from: [f64; 2], to: [f64; 2]) -> Edge {
    (0..=16)
        .map(|k| f64::from(k) / 16.0)
        .map(|share| {
            surface
                .at(
                    from[0] + share * (to[0] - from[0]),
                    from[1] + share * (to[1] - from[1]),
                )
                .point
        })
        .collect()
}

fn around(surface: &Surface, corners: &[[f64; 2]]) -> Vec<Edge> {
    let next = corners.iter().cycle().skip(1);
    corners
        .iter()
        .zip(next)
        .map(|(a, b)| edge(surface, *a, *b))
        .collect()
}

fn close(a: [[f64; 2]; 2], b: [[f64; 2]; 2]) -> bool {
    a.iter()
        .flatten()
        .zip(b.iter().flatten())
        .all(|(a, b)| (a - b).abs() < 1e-9)
}

#[test]
fn rectangles_are_found() {
    for (surface, [u, v]) in kinds() {
        // Without poles, and less than a full turn.
        let v = [v[0] + 0.2 * (v[1] - v[0]), v[1]];
        let u = [u[0], u[0] + 0.8 * (u[1] - u[0])];
        let corners = [[u[0], v[0]], [u[1], v[0]], [u[1], v[1]], [u[0], v[1]]];
        let found = outline(&face(surface.clone(), vec![around(&surface, &corners)], 1.0)).unwrap();
        assert_eq!(found.trimmed, None, "{}", surface.kind());
        let turns = ((found.rectangle[0][0] - u[0]) / TAU).round()
            * if surface.periods()[0].is_some() { TAU } else { 0.0 };
        let moved = [u.map(|u| u + turns), v];
        assert!(
            close(found.rectangle, moved),
            "{}: {:?} for {moved:?}",
            surface.kind(),
            found.rectangle
        );
    }
}

#[test]
fn what_is_no_rectangle_is_trimmed() {
    let plane = || Surface::Plane {
        origin: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
    };
    let trimmed = |loops: Vec<Vec<Edge>>| outline(&face(plane(), loops, 1.0)).unwrap();
    let square = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]];
    let corner = [
        [0.0, 0.0],
        [9.0, 0.0],
        [9.0, 4.0],
        [4.0, 4.0],
        [4.0, 9.0],
        [0.0, 9.0],
    ];
    let slanted = [[0.0, 0.0], [9.0, 0.0], [8.0, 9.0], [0.0, 9.0]];
    let hole = [[2.0, 2.0], [2.0, 5.0], [5.0, 5.0], [5.0, 2.0]];
    assert_eq!(trimmed(vec![around(&plane(), &square)]).trimmed, None);
    for loops in [
        vec![around(&plane(), &corner)],
        vec![around(&plane(), &slanted)],
        vec![around(&plane(), &square), around(&plane(), &hole)],
    ] {
        let found = trimmed(loops);
        assert!(found.trimmed.is_some());
        assert!(
            close(found.rectangle, [[0.0, 9.0], [0.0, 9.0]]),
            "{:?}",
            found.rectangle
        );
    }
}

/// An eighth of a sphere with the pole as third corner; the loop starts there or elsewhere.
#[test]
fn a_corner_may_be_a_pole() {
    let sphere = Surface::Sphere {
        center: DVec3::ZERO,
        x: 10.0 * DVec3::X,
        y: 10.0 * DVec3::Y,
        z: 10.0 * DVec3::Z,
    };
    let edges = [
        edge(&sphere, [0.3, 0.1], [1.2, 0.1]),
        edge(&sphere, [1.2, 0.1], [1.2, FRAC_PI_2]),
        edge(&sphere, [0.3, FRAC_PI_2], [0.3, 0.1]),
    ];
    for start in 0..3 {
        let mut edges = edges.to_vec();
        edges.rotate_left(start);
        let found = outline(&face(sphere.clone(), vec![edges], 1.0)).unwrap();
        assert_eq!(found.trimmed, None, "begun with edge {start}");
        assert!(
            close(found.rectangle, [[0.3, 1.2], [0.1, FRAC_PI_2]]),
            "{:?}",
            found.rectangle
        );
    }
}

/// Belts and caps without a seam edge, as written by some kernels: circles alone, whose direction defines the side.
#[test]
fn circles_alone_bound_belts_and_caps() {
    let radius = 10.0;
    let sphere = || Surface::Sphere {
        center: DVec3::ZERO,
        x: radius * DVec3::X,
        y: radius * DVec3::Y,
        z: radius * DVec3::Z,
    };
    let circle = |v: f64, turn: f64| {
        vec![
            edge(&sphere(), [0.0, v], [0.5 * turn * TAU, v]),
            edge(&sphere(), [0.5 * turn * TAU, v], [turn * TAU, v]),
        ]
    };
    let belt = outline(&face(sphere(), vec![circle(-0.3, 1.0), circle(0.6, -1.0)], 1.0)).unwrap();
    assert_eq!(belt.trimmed, None);
    assert!(
        close(belt.rectangle, [[0.0, TAU], [-0.3, 0.6]]),
        "{:?}",
        belt.rectangle
    );
    for (turn, sense, v) in [
        (1.0, 1.0, [0.6, FRAC_PI_2]),
        (-1.0, 1.0, [-FRAC_PI_2, 0.6]),
        (1.0, -1.0, [-FRAC_PI_2, 0.6]),
    ] {
        let cap = outline(&face(sphere(), vec![circle(0.6, turn)], sense)).unwrap();
        assert_eq!(cap.trimmed, None);
        assert!(
            close([[0.0, 0.0], cap.rectangle[1]], [[0.0, 0.0], v]),
            "{:?}",
            cap.rectangle
        );
        assert!((cap.rectangle[0][1] - cap.rectangle[0][0] - TAU).abs() < 1e-9);
    }
    let cylinder = Surface::Cylinder {
        origin: DVec3::ZERO,
        x: radius * DVec3::X,
        y: radius * DVec3::Y,
        z: DVec3::Z,
    };
    let ring = vec![
        edge(&cylinder, [0.0, 3.0], [PI, 3.0]),
        edge(&cylinder, [PI, 3.0], [TAU, 3.0]),
    ];
    let unbounded = outline(&face(cylinder, vec![ring], 1.0)).unwrap_err();
    assert!(unbounded.contains("unbounded"), "{unbounded}");
}

/// Least concave radii of a torus and a sphere, both sides, against closed forms.
#[test]
fn concave_radii_are_measured() {
    for (surface, rectangle) in kinds() {
        let want = match surface.kind() {
            // S_u x S_v points outwards; the inside of the cylinder, the sphere and the tube is concave.
            "cylinder" => Some([None, Some(9.0)]),
            "sphere" => Some([None, Some(12.0)]),
            // The outside of the torus is concave around its hole, with the least radius on the inner equator.
            "torus" => Some([Some(14.0), Some(6.0)]),
            "plane" => Some([None, None]),
            _ => None,
        };
        let Some(want) = want else { continue };
        let made = machinable(
            "",
            &Face {
                name: None,
                colour: None,
                boundary: Boundary::Natural,
                ..rectangular(&surface, rectangle)
            },
            &Options::default(),
        );
        let made = made.unwrap_or_else(|error| panic!("{}: {error}", surface.kind()));
        let measures = measure(&made.spec());
        for (side, (got, want)) in measures.concave_mm.iter().zip(want).enumerate() {
            match (got, want) {
                (None, None) => {}
                (Some(got), Some(want)) => {
                    assert!(
                        (got / want - 1.0).abs() < 1e-3,
                        "{}, side {side}: {got}",
                        surface.kind()
                    );
                }
                other => panic!("{}, side {side}: {other:?}", surface.kind()),
            }
        }
    }
}

/// A face whose surface is the part of another one over a rectangle.
fn rectangular(surface: &Surface, rectangle: [[f64; 2]; 2]) -> Face {
    let part = exact(surface, rectangle).unwrap();
    assert!(part.at(rectangle[0][0], rectangle[1][0]).point.is_finite());
    face(Surface::Spline(part), Vec::new(), 1.0)
}

/// A closed tube of degree 5 about the z axis: periodic knots, uneven, of a period that is no round number.
fn rough() -> SplineSurface {
    // No smooth surface comes near its poles.
    let knots = (0..3).map(|_| 0.0);
    let inner = (0..=20).map(f64::from);
    let axis = Axis {
        degree: 3,
        knots: knots.chain(inner).chain((0..3).map(|_| 20.0)).collect(),
    };
    let pole = |i: usize, j: usize| {
        let (x, y) = (5.0 * i as f64, 5.0 * j as f64);
        [x, y, 2.0 * (2.1 * x).sin() * (1.7 * y).cos(), 1.0]
    };
    let poles = (0..axis.poles()).map(|i| (0..axis.poles()).map(|j| pole(i, j)).collect());
    SplineSurface {
        poles: poles.collect(),
        axes: [axis.clone(), axis],
    }
}

/// A face of 400 patches that no fit makes fewer: it is taken as it is, and streamed.
#[test]
fn a_face_that_is_larger_than_the_store_is_streamed() {
    let surface = Surface::Spline(rough());
    let boundary = around(&surface, &[[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]]);
    let face = face(surface, vec![boundary], 1.0);
    let made = machinable("rough", &face, &Options::default()).unwrap();
    assert_eq!((made.form.clone(), made.patches), (Form::Exact, 400));
    assert!(machine::prepare::patch_count(&made.spec()).is_err());
}

fn tube() -> SplineSurface {
    let spans = [0.7, 1.1, 0.9, 1.3, 0.8, 1.0, 1.2, 0.6].map(|width| width * PI / 10.0);
    let period: f64 = spans.iter().sum();
    let knot = |index: i32| {
        let turns = index.div_euclid(8);
        let within = usize::try_from(index.rem_euclid(8)).unwrap();
        f64::from(turns) * period + spans[..within].iter().sum::<f64>()
    };
    let knots: Vec<f64> = (-5..=13).map(knot).collect();
    let pole = |i: usize, z: f64| {
        let angle = TAU * (i % 8) as f64 / 8.0;
        [
            30.0 * angle.cos(),
            22.0 * angle.sin(),
            z + 3.0 * (2.0 * angle).sin(),
            1.0,
        ]
    };
    SplineSurface {
        poles: (0..13).map(|i| vec![pole(i, 0.0), pole(i, 25.0)]).collect(),
        axes: [
            Axis { degree: 5, knots },
            Axis {
                degree: 1,
                knots: vec![0.0, 0.0, 1.0, 1.0],
            },
        ],
    }
}

/// Beyond the seam a closed B-spline goes on at its beginning; its last polynomial does not.
#[test]
fn a_fit_over_the_seam_follows_the_surface() {
    let spline = tube();
    let [[start, end], _] = spline.domain();
    let period = end - start;
    let surface = Surface::Spline(spline.clone());
    assert_eq!(surface.periods()[0], Some(period), "closed");
    let offset = Surface::Offset {
        base: Box::new(surface.clone()),
        distance: 2.0,
    };
    for (surface, widest) in [(&surface, 1.0), (&offset, 0.9)] {
        for first in [0.6, 0.999, 1e-9] {
            let range = [start + first * period, start + (first + widest) * period];
            let (fitted, said) =
                super::fit::fit(surface, [range, [0.0, 1.0]], 1e-3, Knots::OfSurface).unwrap();
            assert!(said.max_mm <= 1e-3, "{said:?}");
            for k in 0..=400 {
                let u = range[0] + (range[1] - range[0]) * f64::from(k) / 400.0;
                let within = if u > end { u - period } else { u };
                let gap = fitted.at(u, 0.3).point.distance(surface.at(within, 0.3).point);
                assert!(gap <= 1.1e-3, "{gap} mm off at {u}, from {range:?}");
            }
        }
    }
}

/// A surface of more pieces than the store holds, smooth but for the jumps of its second derivative, takes few patches.
#[test]
fn knots_that_the_tolerance_does_not_need_are_left_out() {
    const PIECES: u32 = 400;
    let step = 60.0 / f64::from(PIECES);
    let wave = |k: u32| {
        let x = f64::from(k) * step;
        ([x, 2.0 * (0.2 * x).sin()], [1.0, 0.4 * (0.2 * x).cos()])
    };
    let mut profile: Vec<[f64; 2]> = Vec::new();
    for k in 0..=PIECES {
        let (at, slope) = wave(k);
        // Cubic pieces through points of the wave with its slopes: C1.
        let beside = |by: f64| [0, 1].map(|axis| at[axis] + by * step / 3.0 * slope[axis]);
        let poles = match k {
            0 => vec![at, beside(1.0)],
            PIECES => vec![beside(-1.0), at],
            _ => vec![beside(-1.0), beside(1.0)],
        };
        profile.extend(poles);
    }
    let mut knots = vec![0.0; 4];
    knots.extend((1..PIECES).flat_map(|k| [f64::from(k); 2]));
    knots.extend(vec![f64::from(PIECES); 4]);
    let surface = Surface::Spline(SplineSurface {
        axes: [
            Axis { degree: 3, knots },
            Axis {
                degree: 1,
                knots: vec![0.0, 0.0, 1.0, 1.0],
            },
        ],
        poles: profile
            .iter()
            .map(|[x, z]| [0.0, 20.0].map(|y| [*x, y, *z, 1.0]).to_vec())
            .collect(),
    });
    let ranges = [[0.0, f64::from(PIECES)], [0.0, 1.0]];
    assert!(super::fit::fit(&surface, ranges, 1e-3, Knots::OfSurface).is_err());
    let (fitted, said) = super::fit::fit(&surface, ranges, 1e-3, Knots::Fewest).unwrap();
    assert!(
        fitted.patches() < 40 && said.max_mm <= 1e-3,
        "{} {said:?}",
        fitted.patches()
    );
    let corners = [
        [ranges[0][0], 0.0],
        [ranges[0][1], 0.0],
        [ranges[0][1], 1.0],
        [ranges[0][0], 1.0],
    ];
    let face = face(surface.clone(), vec![around(&surface, &corners)], 1.0);
    let made = machinable("wave", &face, &Options::default()).unwrap();
    assert_eq!(made.patches, fitted.patches());
}

/// Ends of a range that differ from a knot by rounding make no joint.
#[test]
fn knots_at_the_ends_are_no_joints() {
    let surface = Surface::Spline(tube());
    let knots: Vec<f64> = super::exact::joints(&surface, 0, [-10.0, 10.0])
        .iter()
        .map(|(knot, _)| *knot)
        .collect();
    let next = |t: f64, ulps: i64| f64::from_bits(t.to_bits().wrapping_add_signed(ulps));
    let inner: Vec<f64> = knots.into_iter().filter(|knot| *knot > 0.1).take(7).collect();
    for pair in inner.windows(3) {
        for (before, after) in [(0, 0), (-1, 1), (1, -1), (-3, 2), (5, -4)] {
            let range = [next(pair[0], before), next(pair[2], after)];
            let joints = super::exact::joints(&surface, 0, range);
            assert_eq!(joints.len(), 1, "{range:?}: {joints:?}");
            assert_eq!(joints[0].1, 4);
            let (fitted, said) =
                super::fit::fit(&surface, [range, [0.0, 1.0]], 1e-3, Knots::OfSurface).unwrap();
            assert!(
                said.max_mm <= 1e-3 && fitted.patches() < 40,
                "{} patches",
                fitted.patches()
            );
        }
    }
}

/// A face that ends on a knot, as the file's digits say, has no patch of a few nanometres there.
#[test]
fn an_outline_ends_on_the_knot() {
    let surface = Surface::Spline(wavy(3, 3));
    for (off, exact) in [(1e-9, true), (-2e-8, true), (1e-2, false)] {
        let (u, v) = ([0.35 + off, 2.2], [0.0, 1.0 - off]);
        let corners = [[u[0], v[0]], [u[1], v[0]], [u[1], v[1]], [u[0], v[1]]];
        let outline = outline(&face(surface.clone(), vec![around(&surface, &corners)], 1.0)).unwrap();
        assert_eq!(outline.trimmed, None);
        assert_eq!(
            outline.rectangle[0][0] == 0.35,
            exact,
            "{off}: {:?}",
            outline.rectangle
        );
        assert_eq!(
            outline.rectangle[1][1] == 1.0,
            exact,
            "{off}: {:?}",
            outline.rectangle
        );
        let ends = outline
            .rectangle
            .iter()
            .flatten()
            .zip([u, v].iter().flatten().copied().collect::<Vec<_>>());
        assert!(
            ends.into_iter().all(|(a, b)| (a - b).abs() < 1e-7),
            "{:?}",
            outline.rectangle
        );
    }
}
