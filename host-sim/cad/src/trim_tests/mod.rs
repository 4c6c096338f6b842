//! Trimmed regions against closed forms: holes, seams, poles, edges on the patch boundary, arcs; open and crossing loops.

mod poles;
mod sweeps;

use std::f64::consts::{PI, TAU};

use super::*;
use ::job::FaceParameters;
use glam::{DVec3, dvec3};

/// Precision of the polygons, mm.
const TOLERANCE_MM: f64 = 0.005;

fn face(surface: Surface, loops: Vec<Vec<Edge>>, sense: f64) -> Face {
    Face {
        number: 1,
        entity: "#1".to_owned(),
        name: None,
        colour: None,
        surface,
        boundary: Boundary::Loops(loops),
        sense,
        solid: true,
    }
}

/// An edge along a curve of parameters.
fn edge(surface: &Surface, place: impl Fn(f64) -> [f64; 2]) -> Edge {
    let at = |k: i32| place(f64::from(k) / 64.0);
    (0..=64)
        .map(at)
        .map(|[u, v]| surface.at_periodic(u, v).point)
        .collect()
}

fn straight(surface: &Surface, from: [f64; 2], to: [f64; 2]) -> Edge {
    edge(surface, |share| {
        [0, 1].map(|k| from[k] + share * (to[k] - from[k]))
    })
}

fn around(surface: &Surface, corners: &[[f64; 2]]) -> Vec<Edge> {
    let next = corners.iter().cycle().skip(1);
    corners
        .iter()
        .zip(next)
        .map(|(a, b)| straight(surface, *a, *b))
        .collect()
}

/// An ellipse of parameters; `turn` 1 anticlockwise.
fn ellipse(surface: &Surface, middle: [f64; 2], half: [f64; 2], turn: f64) -> Vec<Edge> {
    vec![edge(surface, |share| {
        let angle = turn * TAU * share;
        [
            middle[0] + half[0] * angle.cos(),
            middle[1] + half[1] * angle.sin(),
        ]
    })]
}

fn plane() -> Surface {
    Surface::Plane {
        origin: dvec3(1.0, 2.0, 3.0),
        x: DVec3::X,
        y: DVec3::Y,
    }
}

fn cylinder(radius: f64) -> Surface {
    Surface::Cylinder {
        origin: DVec3::ZERO,
        x: radius * DVec3::X,
        y: radius * DVec3::Y,
        z: DVec3::Z,
    }
}

fn sphere(radius: f64) -> Surface {
    Surface::Sphere {
        center: DVec3::ZERO,
        x: radius * DVec3::X,
        y: radius * DVec3::Y,
        z: radius * DVec3::Z,
    }
}

fn contains(polygons: &[Polygon], [u, v]: [f64; 2]) -> bool {
    let edges = polygons.iter().flat_map(|polygon| {
        let next = polygon.iter().cycle().skip(1);
        polygon.iter().zip(next)
    });
    let crossed = edges
        .filter(|([u0, v0], [u1, v1])| (*v0 <= v) != (*v1 <= v) && u < u0 + (v - v0) * (u1 - u0) / (v1 - v0));
    crossed.count() % 2 == 1
}

/// Area on the surface of the polygons, mm2, and whether all of their edges lie on the face's boundary within the tolerance.
fn area(surface: &Surface, outline: &Outline, polygons: &[Polygon]) -> f64 {
    const SIDE: usize = 400;
    let [[u0, u1], [v0, v1]] = outline.rectangle;
    let cell = (u1 - u0) * (v1 - v0) / (SIDE * SIDE) as f64;
    let places = (0..SIDE * SIDE).map(|k| {
        let share = |index: usize| (index as f64 + 0.5) / SIDE as f64;
        [u0 + share(k / SIDE) * (u1 - u0), v0 + share(k % SIDE) * (v1 - v0)]
    });
    let inside = places.filter(|place| contains(polygons, *place));
    let on = crate::surface::Periodic::new(surface);
    inside
        .map(|[u, v]| {
            let at = on.at(u, v);
            at.u.cross(at.v).length() * cell
        })
        .sum()
}

fn traced(face: &Face) -> (Outline, Vec<Polygon>) {
    let outline = outline(face).unwrap();
    let polygons = trim(face, &outline, None, TOLERANCE_MM).unwrap();
    for place in polygons.iter().flatten() {
        for k in 0..2 {
            let [low, high] = outline.rectangle[k];
            assert!(
                (low..=high).contains(&place[k]),
                "{place:?} in {:?}",
                outline.rectangle
            );
        }
    }
    (outline, polygons)
}

fn is_area(face: &Face, wanted: f64) -> Vec<Polygon> {
    let (outline, polygons) = traced(face);
    let found = area(&face.surface, &outline, &polygons);
    assert!(
        (found / wanted - 1.0).abs() < 3e-3,
        "{}: {found}, {wanted}",
        face.surface.kind()
    );
    polygons
}

#[test]
fn holes_are_left_out_and_arcs_are_followed() {
    let plane = plane();
    let corners = [[0.0, 0.0], [40.0, 0.0], [40.0, 30.0], [0.0, 30.0]];
    let loops = vec![
        around(&plane, &corners),
        ellipse(&plane, [12.0, 15.0], [6.0, 6.0], -1.0),
        ellipse(&plane, [28.0, 15.0], [5.0, 8.0], -1.0),
    ];
    let face = face(plane, loops, 1.0);
    let polygons = is_area(&face, 1200.0 - PI * 36.0 - PI * 40.0);
    assert_eq!(polygons.len(), 3);
    assert_eq!(
        polygons[0].len(),
        4,
        "straight edges have no vertices between their ends"
    );
    let circle = polygons
        .iter()
        .find(|polygon| polygon.iter().all(|[u, _]| *u < 19.0))
        .unwrap();
    assert!(circle.len() < 140, "{}", circle.len());
    // Vertices and the middles of the edges between them.
    let next = circle.iter().cycle().skip(1);
    for (a, b) in circle.iter().zip(next) {
        for share in [0.0, 0.5] {
            let place = [0, 1].map(|k| a[k] + share * (b[k] - a[k]));
            let off = (place[0] - 12.0).hypot(place[1] - 15.0) - 6.0;
            assert!(off.abs() <= TOLERANCE_MM, "{off}");
        }
    }
}

#[test]
fn regions_cross_the_seam() {
    let surface = cylinder(10.0);
    // A patch that is cut slantwise, over the seam.
    let corners = [[-0.5, 0.0], [0.8, 2.0], [0.8, 12.0], [-0.5, 9.0]];
    let patch = face(surface.clone(), vec![around(&surface, &corners)], 1.0);
    is_area(&patch, 13.0 * 0.5 * (9.0 + 10.0));
    // A whole belt with a window over the seam, and one that ends in a wave.
    let ring = |v: f64, turn: f64| vec![edge(&surface, |share| [0.7 + turn * TAU * share, v])];
    let window = ellipse(&surface, [0.0, 5.0], [0.3, 2.0], -1.0);
    let belt = face(
        surface.clone(),
        vec![ring(0.0, 1.0), ring(10.0, -1.0), window],
        1.0,
    );
    is_area(&belt, TAU * 100.0 - PI * 3.0 * 2.0);
    let wave = vec![edge(&surface, |share| {
        let u = 0.3 - TAU * share;
        [u, 10.0 + 2.0 * (3.0 * u).sin()]
    })];
    let waved = face(surface.clone(), vec![ring(0.0, 1.0), wave], 1.0);
    is_area(&waved, TAU * 100.0);
    // The seam itself among the edges, there and back.
    let seamed: Vec<Edge> = [
        edge(&surface, |share| [TAU * share, 0.0]),
        straight(&surface, [TAU, 0.0], [TAU, 10.0]),
        edge(&surface, |share| [TAU * (1.0 - share), 10.0]),
        straight(&surface, [0.0, 10.0], [0.0, 0.0]),
    ]
    .to_vec();
    let window = ellipse(&surface, [3.0, 5.0], [0.3, 2.0], -1.0);
    is_area(
        &face(surface.clone(), vec![seamed, window], 1.0),
        TAU * 100.0 - PI * 3.0 * 2.0,
    );
}

/// A surface that closes without being known to close: its boundary goes there and back, and encloses nothing. That is an error, not a face without a place.
#[test]
fn a_polygon_without_area_is_an_error() {
    use crate::curve::Curve;
    use crate::spline::{Axis, SplineCurve};
    let poles = [
        [10.0, 0.0],
        [10.0, 10.0],
        [-10.0, 10.0],
        [-10.0, -10.0],
        [10.0, -10.0],
        [10.0, 0.0],
    ];
    let profile = Curve::Spline(SplineCurve {
        axis: Axis {
            degree: 3,
            knots: vec![0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0],
        },
        poles: poles.map(|[x, y]| [x, y, 0.0, 1.0]).to_vec(),
    });
    let surface = Surface::Extrusion {
        profile,
        range: Some([0.0, 3.0]),
        direction: DVec3::Z,
    };
    let corners = [[0.0, 0.0], [3.0, 0.0], [3.0, 40.0], [0.0, 40.0]];
    let face = face(surface.clone(), vec![around(&surface, &corners)], 1.0);
    match outline(&face) {
        Err(_) => {}
        Ok(found) => match trim(&face, &found, None, TOLERANCE_MM) {
            Err(error) => assert!(error.what.contains("no area"), "{}", error.what),
            // Known to be closed: the whole of it.
            Ok(polygons) => assert!(contains(&polygons, [1.5, 20.0])),
        },
    }
}

/// A notch is one, however large the face.
#[test]
fn small_notches_are_no_rounding() {
    let plane = plane();
    for notch in [0.05, 0.5, 3.0] {
        let corners = [
            [0.0, 0.0],
            [400.0, 0.0],
            [400.0, 400.0],
            [notch, 400.0],
            [notch, 400.0 - notch],
            [0.0, 400.0 - notch],
        ];
        let face = face(plane.clone(), vec![around(&plane, &corners)], 1.0);
        let outline = outline(&face).unwrap();
        assert!(outline.trimmed.is_some(), "{notch}");
        let polygons = trim(&face, &outline, None, TOLERANCE_MM).unwrap();
        assert!(
            !contains(&polygons, [0.4 * notch, 400.0 - 0.4 * notch]),
            "{notch}"
        );
    }
}

/// A face whose edges lie on the boundary of its surface, with a corner cut off; in the parameters of the exact form, too.
#[test]
fn polygons_are_those_of_the_exact_form() {
    let surface = cylinder(10.0);
    let corners = [[0.0, 0.0], [2.5, 0.0], [2.5, 8.0], [1.0, 12.0], [0.0, 12.0]];
    let face = face(surface.clone(), vec![around(&surface, &corners)], 1.0);
    let options = Options {
        around_mm: 1.0,
        ..Options::default()
    };
    for options in [Options::default(), options] {
        let made = machinable("", &face, &options).unwrap();
        let spec = made.spec();
        let form = oracle::Surface::new(&spec);
        let polygons = made.trimmed.unwrap();
        let [[u0, u1], _] = spec.domain();
        assert_eq!(options.around_mm > 0.0, u0 < -0.09 && u1 > 2.59);
        // Every vertex, and the middle of every edge, is on the boundary in space.
        let mut corners_met = 0;
        for polygon in &polygons {
            let next = polygon.iter().cycle().skip(1);
            for (a, b) in polygon.iter().zip(next) {
                for share in [0.0, 0.3, 0.5] {
                    let place = [0, 1].map(|k| a[k] + share * (b[k] - a[k]));
                    let point = form.at(place[0], place[1]).point;
                    let (u, v) = (point.y.atan2(point.x), point.z);
                    let slope = ((u - 1.0) * 4.0 + (v - 12.0) * 1.5) / (4.0_f64 / 10.0).hypot(1.5);
                    let off = [10.0 * u, v, 10.0 * (u - 2.5), v - 12.0, slope]
                        .into_iter()
                        .map(f64::abs)
                        .fold(f64::INFINITY, f64::min);
                    assert!(off <= TOLERANCE_MM, "{off} at {u}, {v}");
                    if share == 0.0
                        && corners
                            .iter()
                            .any(|c| (c[0] - u).abs() < 1e-6 && (c[1] - v).abs() < 1e-6)
                    {
                        corners_met += 1;
                    }
                }
            }
        }
        assert_eq!(corners_met, 5);
    }
}

#[test]
fn open_and_crossing_loops_are_refused_with_the_gap() {
    let plane = plane();
    let mut open = around(&plane, &[[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]]);
    open.pop();
    open.push(straight(&plane, [0.0, 9.0], [0.0, 0.35]));
    let crossing = around(&plane, &[[0.0, 0.0], [9.0, 9.0], [9.0, 0.0], [0.0, 9.0]]);
    for (loops, words) in [(open, "open by 0.350 mm"), (crossing, "crosses itself by")] {
        let face = face(plane.clone(), vec![loops], 1.0);
        let found = outline(&face).unwrap();
        let error = trim(&face, &found, None, TOLERANCE_MM).unwrap_err();
        assert!(error.what.contains(words), "{}", error.what);
        let refused = machinable("part.step", &face, &Options::default()).unwrap_err();
        assert!(
            refused.what.contains(words) && refused.remedy.contains("--untrimmed"),
            "{refused}"
        );
    }
}
