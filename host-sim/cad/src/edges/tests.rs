//! Against closed forms: the surface that is machined is the face's own, its sides are the face's edges, and its area is the face's.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, dvec3};
use job::FaceParameters;
use oracle::Surface as Machined;

use crate::curve::Curve;
use crate::{Boundary, Edge, Face, Form, MachinableFace, Options, Surface, machinable};

fn face(surface: Surface, loops: Vec<Vec<Edge>>) -> Face {
    Face {
        number: 1,
        entity: "#1".to_owned(),
        name: None,
        colour: None,
        surface,
        boundary: Boundary::Loops(loops),
        sense: 1.0,
        solid: true,
    }
}

/// Points along a curve, dense enough for cubics between them.
fn edge(at: impl Fn(f64) -> DVec3) -> Edge {
    (0..=256).map(|k| at(f64::from(k) / 256.0)).collect()
}

fn line(a: DVec3, b: DVec3) -> Edge {
    edge(|t| a.lerp(b, t))
}

/// A plane in general position, and its point at two coordinates.
fn plane() -> (Surface, DVec3, impl Fn([f64; 2]) -> DVec3) {
    let normal = dvec3(0.2, -0.3, 0.9).normalize();
    let x = normal.cross(dvec3(0.4, 0.7, 0.1)).normalize();
    let (origin, y) = (dvec3(10.0, -20.0, 5.0), normal.cross(x));
    let surface = Surface::Plane { origin, x, y };
    (surface, normal, move |[a, b]: [f64; 2]| origin + x * a + y * b)
}

/// What is machined, after the checks: `off` is the distance of a point from the face's surface, `area` the area of the face.
fn check(face: &Face, off: impl Fn(DVec3) -> f64, area: f64) -> MachinableFace {
    let made = machinable("face.step", face, &Options::default()).unwrap();
    assert_eq!(
        (&made.form, &made.trimmed, made.by_edges),
        (&Form::Exact, &None, true)
    );
    let surface = Machined::new(&made.spec());
    let [[u0, u1], [v0, v1]] = made.spec().domain();
    let own = |point: DVec3| {
        let at = face.surface.invert(point, None).0;
        let at = face.surface.at(at[0], at[1]);
        at.u.cross(at.v).normalize()
    };
    let (mut sum, steps) = (0.0, 300);
    for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
        let share = |k: i32| (f64::from(k) + 0.5) / f64::from(steps);
        let at = surface.at(u0 + share(i) * (u1 - u0), v0 + share(j) * (v1 - v0));
        assert!(off(at.point) < 1e-9, "{}", off(at.point));
        let cross = at.u.cross(at.v);
        if (i + j) % 17 == 0 {
            assert!(cross.normalize().dot(own(at.point)) > 1.0 - 1e-9);
        }
        sum += cross.length() * (u1 - u0) * (v1 - v0) / f64::from(steps * steps);
    }
    assert!((sum - area).abs() < 3e-5 * area, "{sum} {area}");
    // Every side of the surface is on the boundary, within the tolerance of an edge.
    let Boundary::Loops(loops) = &face.boundary else {
        panic!()
    };
    let chords: Vec<[DVec3; 2]> = loops
        .iter()
        .flatten()
        .flat_map(|edge| edge.windows(2).map(|ends| [ends[0], ends[1]]))
        .collect();
    for k in 0..=50 {
        let share = f64::from(k) / 50.0;
        let (u, v) = (u0 + share * (u1 - u0), v0 + share * (v1 - v0));
        let sides = match face.surface.periods()[0] {
            Some(period) if (u1 - u0 - period).abs() < 1e-9 => vec![[u, v0], [u, v1]],
            _ => vec![[u, v0], [u, v1], [u0, v], [u1, v]],
        };
        for [u, v] in sides {
            let point = surface.at(u, v).point;
            let nearest = chords.iter().map(|[a, b]| {
                let along = *b - *a;
                let share = ((point - *a).dot(along) / along.length_squared()).clamp(0.0, 1.0);
                (*a + along * share).distance(point)
            });
            let nearest = nearest.fold(f64::INFINITY, f64::min);
            assert!(nearest < 2e-3, "{nearest}");
        }
    }
    made
}

/// The area of a polygon.
fn area(points: &[[f64; 2]]) -> f64 {
    let next = points.iter().cycle().skip(1);
    0.5 * points
        .iter()
        .zip(next)
        .map(|(a, b)| a[0] * b[1] - b[0] * a[1])
        .sum::<f64>()
}

#[test]
fn a_quad_is_bilinear() {
    let (surface, normal, at) = plane();
    let corners = [[0.0, 0.0], [12.0, 1.0], [10.0, 6.0], [1.0, 5.0]];
    let origin = at([0.0, 0.0]);
    let off = |p: DVec3| (p - origin).dot(normal).abs();
    // Either way around, and with an edge in two parts.
    for turned in [false, true] {
        let mut edges: Vec<Edge> = (0..4)
            .map(|k| line(at(corners[k]), at(corners[(k + 1) % 4])))
            .collect();
        let middle = at([6.0, 0.5]);
        edges.splice(0..1, [line(at(corners[0]), middle), line(middle, at(corners[1]))]);
        if turned {
            edges.reverse();
            edges.iter_mut().for_each(|edge| edge.reverse());
        }
        let made = check(&face(surface.clone(), vec![edges]), off, area(&corners));
        assert_eq!(made.nurbs.degree, [1, 1]);
    }
}

#[test]
fn arcs_and_cubics_of_a_plane_are_followed() {
    let (surface, normal, at) = plane();
    let origin = at([0.0, 0.0]);
    let off = |p: DVec3| (p - origin).dot(normal).abs();
    // A circle of radius 20 through two corners bulges by its segment.
    let half = (5.0_f64 / 20.0).asin();
    let arc = edge(|t| {
        let angle = half * (2.0 * t - 1.0);
        at([5.0 + 20.0 * angle.sin(), 20.0 * half.cos() - 20.0 * angle.cos()])
    });
    let segment = 200.0 * (2.0 * half - (2.0 * half).sin());
    let corners = [[0.0, 0.0], [10.0, 0.0], [11.0, 5.0], [0.0, 6.0]].map(&at);
    let edges = vec![
        arc,
        line(corners[1], corners[2]),
        line(corners[2], corners[3]),
        line(corners[3], corners[0]),
    ];
    let straight = area(&[[0.0, 0.0], [10.0, 0.0], [11.0, 5.0], [0.0, 6.0]]);
    let made = check(&face(surface.clone(), vec![edges]), off, straight + segment);
    assert!(made.nurbs.rational && made.patches == 1);
    // All four curved: a sine over each side of a square.
    let wave = |a: [f64; 2], b: [f64; 2], by: f64| {
        let way = [b[0] - a[0], b[1] - a[1]];
        edge(|t| {
            let out = by * (PI * t).sin() / 10.0;
            at([a[0] + t * way[0] + out * way[1], a[1] + t * way[1] - out * way[0]])
        })
    };
    let square = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
    let edges = (0..4)
        .map(|k| wave(square[k], square[(k + 1) % 4], [0.6, -0.4, 1.0, 0.2][k]))
        .collect();
    let bulge = (0.6 - 0.4 + 1.0 + 0.2) * 10.0 * 2.0 / PI;
    let made = check(&face(surface, vec![edges]), off, 100.0 + bulge);
    assert!(!made.nurbs.rational && made.patches <= 64, "{}", made.patches);
}

/// A cylinder between two slanted planes, over a part of a turn and all around.
#[test]
fn plane_sections_of_a_cylinder_are_followed() {
    let surface = Surface::Cylinder {
        origin: dvec3(1.0, 2.0, 3.0),
        x: DVec3::X * 5.0,
        y: DVec3::Y * 5.0,
        z: DVec3::Z,
    };
    let off = |p: DVec3| ((p - dvec3(1.0, 2.0, 0.0)).truncate().length() - 5.0).abs();
    let at = |u: f64, v: f64| surface.at(u, v).point;
    let (low, high) = (
        |u: f64| 0.3 * u.cos(),
        |u: f64| 6.0 + 1.5 * u.sin() - 0.5 * u.cos(),
    );
    let [u0, u1] = [0.4, 2.9];
    let edges = vec![
        edge(|t| at(u0 + t * (u1 - u0), low(u0 + t * (u1 - u0)))),
        edge(|t| at(u1, low(u1) + t * (high(u1) - low(u1)))),
        edge(|t| at(u1 + t * (u0 - u1), high(u1 + t * (u0 - u1)))),
        edge(|t| at(u0, high(u0) + t * (low(u0) - high(u0)))),
    ];
    let whole = 5.0
        * (6.0 * (u1 - u0)
            - 1.5 * (u1.cos() - u0.cos())
            - 0.5 * (u1.sin() - u0.sin())
            - 0.3 * (u1.sin() - u0.sin()));
    check(&face(surface.clone(), vec![edges]), off, whole);
    let rings = vec![
        vec![edge(|t| at(1.0 + TAU * t, low(1.0 + TAU * t)))],
        vec![edge(|t| at(2.0 - TAU * t, high(2.0 - TAU * t)))],
    ];
    check(&face(surface.clone(), rings), off, 5.0 * 6.0 * TAU);
    // An edge that no plane makes.
    let wavy = |u: f64| 5.0 + 0.4 * (3.0 * u).sin();
    let edges = vec![
        edge(|t| at(u0 + t * (u1 - u0), 0.0)),
        edge(|t| at(u1, t * wavy(u1))),
        edge(|t| at(u1 + t * (u0 - u1), wavy(u1 + t * (u0 - u1)))),
        edge(|t| at(u0, wavy(u0) * (1.0 - t))),
    ];
    let whole = 5.0 * (5.0 * (u1 - u0) - 0.4 / 3.0 * ((3.0 * u1).cos() - (3.0 * u0).cos()));
    check(&face(surface, vec![edges]), off, whole);
}

#[test]
fn a_plane_section_of_a_cone_is_followed() {
    let surface = Surface::Cone {
        origin: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
        radius: 8.0,
        slope: -0.5,
    };
    let off = |p: DVec3| (p.truncate().length() - (8.0 - 0.5 * p.z)).abs();
    let at = |u: f64, v: f64| surface.at(u, v).point;
    // The plane z = 5 + 0.3 x.
    let high = |u: f64| (5.0 + 2.4 * u.cos()) / (1.0 + 0.15 * u.cos());
    let [u0, u1] = [-1.2, 1.9];
    let edges = vec![
        edge(|t| at(u0 + t * (u1 - u0), 1.0)),
        edge(|t| at(u1, 1.0 + t * (high(u1) - 1.0))),
        edge(|t| at(u1 + t * (u0 - u1), high(u1 + t * (u0 - u1)))),
        edge(|t| at(u0, high(u0) + t * (1.0 - high(u0)))),
    ];
    let steps = 200_000;
    let strip = |k: i32| {
        let u = u0 + (u1 - u0) * (f64::from(k) + 0.5) / f64::from(steps);
        // The integral of the radius over v, times the slant.
        let to = |v: f64| 8.0 * v - 0.25 * v * v;
        (to(high(u)) - to(1.0)) * 1.25_f64.sqrt() * (u1 - u0) / f64::from(steps)
    };
    check(&face(surface, vec![edges]), off, (0..steps).map(strip).sum());
}

#[test]
fn an_edge_of_an_extrusion_is_followed() {
    let profile = Curve::Parabola {
        vertex: DVec3::ZERO,
        x: DVec3::Z * 0.05,
        y: DVec3::X,
    };
    let surface = Surface::Extrusion {
        profile,
        range: Some([-6.0, 8.0]),
        direction: DVec3::Y,
    };
    let off = |p: DVec3| (p.z - 0.05 * p.x * p.x).abs();
    let at = |u: f64, v: f64| surface.at(u, v).point;
    let high = |u: f64| 4.0 + 0.02 * u * u - 0.01 * u * u * u;
    let edges = vec![
        line(at(-5.0, 0.0), at(-5.0, high(-5.0))),
        edge(|t| at(-5.0 + 11.0 * t, high(-5.0 + 11.0 * t))),
        line(at(6.0, high(6.0)), at(6.0, 0.0)),
        edge(|t| at(6.0 - 11.0 * t, 0.0)),
    ];
    let steps = 200_000;
    let strip = |k: i32| {
        let u = -5.0 + 11.0 * (f64::from(k) + 0.5) / f64::from(steps);
        high(u) * (1.0 + 0.01 * u * u).sqrt() * 11.0 / f64::from(steps)
    };
    check(&face(surface, vec![edges]), off, (0..steps).map(strip).sum());
}

/// With the surface's own parameters, and where no four edges meet at corners, a face stays trimmed.
#[test]
fn other_faces_stay_trimmed() {
    let (surface, _, at) = plane();
    let polygon = |corners: &[[f64; 2]]| {
        let count = corners.len();
        let edges = (0..count).map(|k| line(at(corners[k]), at(corners[(k + 1) % count])));
        face(surface.clone(), vec![edges.collect()])
    };
    let made = |face: &Face, parameters: FaceParameters| {
        let options = Options {
            parameters,
            ..Options::default()
        };
        machinable("face.step", face, &options).unwrap()
    };
    let quad = polygon(&[[0.0, 0.0], [12.0, 1.0], [10.0, 6.0], [1.0, 5.0]]);
    assert!(made(&quad, FaceParameters::Surface).trimmed.is_some());
    assert!(made(&quad, FaceParameters::Edges).trimmed.is_none());
    for corners in [
        vec![[0.0, 0.0], [12.0, 1.0], [5.0, 6.0]],
        vec![[0.0, 0.0], [12.0, 1.0], [13.0, 4.0], [10.0, 6.0], [1.0, 5.0]],
        // One that is not convex: lines between its edges would cross.
        vec![[0.0, 0.0], [12.0, 1.0], [4.0, 2.0], [1.0, 8.0]],
    ] {
        let made = made(&polygon(&corners), FaceParameters::Edges);
        assert!(made.trimmed.is_some() && !made.by_edges, "{corners:?}");
    }
    // A side that meets the next one without a corner.
    let edges = vec![
        line(at([0.0, 0.0]), at([10.0, 0.0])),
        edge(|t| {
            let angle = 0.5 * PI * t;
            at([10.0 + 3.0 * angle.sin(), 3.0 - 3.0 * angle.cos()])
        }),
        line(at([13.0, 3.0]), at([0.0, 8.0])),
        line(at([0.0, 8.0]), at([0.0, 0.0])),
    ];
    assert!(
        made(&face(surface.clone(), vec![edges]), FaceParameters::Edges)
            .trimmed
            .is_some()
    );
}
