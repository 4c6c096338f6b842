//! Trimmed regions against closed forms: holes, seams, poles, edges on the patch boundary, arcs; open and crossing loops.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

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
    inside
        .map(|[u, v]| {
            let at = surface.at(u, v);
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

#[test]
fn poles_are_enclosed() {
    let surface = sphere(10.0);
    // A cap whose rim is tilted: its area is that of the cap of the same height.
    let axis = dvec3(0.3, 0.2, 1.0).normalize();
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let (height, rim) = (6.0, 8.0);
    let at = |k: i32, turn: f64| {
        let angle = turn * TAU * f64::from(k) / 256.0;
        axis * height + (x * angle.cos() + y * angle.sin()) * rim
    };
    for (turn, sense) in [(1.0, 1.0), (-1.0, -1.0)] {
        let rim: Edge = (0..=256).map(|k| at(k, turn)).collect();
        is_area(
            &face(surface.clone(), vec![vec![rim]], sense),
            TAU * 10.0 * (10.0 - height),
        );
        let rim: Edge = (0..=256).map(|k| at(k, -turn)).collect();
        is_area(
            &face(surface.clone(), vec![vec![rim]], sense),
            TAU * 10.0 * (10.0 + height),
        );
    }
    // An octant: two of its edges end at the pole.
    let octant = [
        straight(&surface, [0.0, 0.0], [FRAC_PI_2, 0.0]),
        straight(&surface, [FRAC_PI_2, 0.0], [FRAC_PI_2, FRAC_PI_2]),
        straight(&surface, [0.0, FRAC_PI_2], [0.0, 0.0]),
    ];
    is_area(
        &face(surface.clone(), vec![octant.to_vec()], 1.0),
        4.0 * PI * 100.0 / 8.0,
    );
    // A whole sphere, of which only a window is missing.
    let window = ellipse(&surface, [2.0, 0.3], [0.2, 0.2], -1.0);
    let (outline, polygons) = traced(&face(surface.clone(), vec![window], 1.0));
    let missing = 4.0 * PI * 100.0 - area(&surface, &outline, &polygons);
    assert!(
        (missing / (PI * 4.0 * 0.3_f64.cos()) - 1.0).abs() < 0.02,
        "{missing}"
    );
}

/// Edges the other way round.
fn backwards(edges: &[Edge]) -> Vec<Edge> {
    let turned = |edge: &Edge| edge.iter().rev().copied().collect();
    edges.iter().rev().map(turned).collect()
}

/// Both directions of the loop with the sense that belongs to it, and every edge as the first one.
fn is_area_of_loop(surface: &Surface, edges: &[Edge], wanted: f64) {
    for first in 0..edges.len() {
        let mut edges = edges.to_vec();
        edges.rotate_left(first);
        is_area(&face(surface.clone(), vec![edges.clone()], 1.0), wanted);
        is_area(&face(surface.clone(), vec![backwards(&edges)], -1.0), wanted);
    }
}

/// Sectors whose loops run through a pole, at which the angle is undefined: those of half a turn and more were taken for the whole surface of revolution.
#[test]
fn sectors_end_at_a_pole() {
    let cone = Surface::Cone {
        origin: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
        radius: 6.0,
        slope: -0.75,
    };
    let (sphere, apex, slant) = (sphere(10.0), 8.0, 10.0);
    for angle in [0.5, FRAC_PI_2, PI, 3.3, 1.5 * PI, 6.0] {
        for start in [0.0, -2.5] {
            let end = start + angle;
            let sector = |surface: &Surface, [rim, pole]: [f64; 2]| {
                vec![
                    straight(surface, [start, rim], [end, rim]),
                    straight(surface, [end, rim], [end, pole]),
                    straight(surface, [start, pole], [start, rim]),
                ]
            };
            // Both nappes of the cone; the rim of the second is above its apex.
            is_area_of_loop(&cone, &sector(&cone, [0.0, apex]), 0.5 * angle * 6.0 * slant);
            let above = backwards(&sector(&cone, [2.0 * apex, apex]));
            is_area_of_loop(&cone, &above, 0.5 * angle * 6.0 * slant);
            let cap = angle * 100.0 * (1.0 - 0.4_f64.sin());
            is_area_of_loop(&sphere, &sector(&sphere, [0.4, FRAC_PI_2]), cap);
            is_area_of_loop(&sphere, &backwards(&sector(&sphere, [-0.4, -FRAC_PI_2])), cap);
            // From pole to pole.
            let lune = [
                straight(&sphere, [start, FRAC_PI_2], [start, -FRAC_PI_2]),
                straight(&sphere, [end, -FRAC_PI_2], [end, FRAC_PI_2]),
            ];
            is_area_of_loop(&sphere, &lune, 2.0 * angle * 100.0);
            // A loop of one pole that is the wrong way round has one inside all the same.
            is_area(
                &face(cone.clone(), vec![sector(&cone, [0.0, apex])], -1.0),
                0.5 * angle * 6.0 * slant,
            );
            // A rim that is no line of the surface.
            let wave = edge(&cone, |share| {
                let u = start + share * angle;
                [u, 1.0 + (TAU * share).sin()]
            });
            let [_, rise, fall] = <[Edge; 3]>::try_from(sector(&cone, [1.0, apex])).unwrap();
            let steps = 20_000;
            let strip = |k: i32| {
                let v = 1.0 + (TAU * (f64::from(k) + 0.5) / f64::from(steps)).sin();
                0.5 * angle * (6.0 - 0.75 * v) * slant * (apex - v) / apex / f64::from(steps)
            };
            is_area_of_loop(&cone, &[wave, rise, fall], (0..steps).map(strip).sum());
        }
    }
}

/// Elbows of a tube whose rings have no seam between them, and sectors of a ring: of half a turn and more, too, the face is between the ring that has it above and the next one.
#[test]
fn elbows_of_more_than_half_a_turn() {
    let (major, minor) = (20.0, 5.0);
    let torus = Surface::Torus {
        center: DVec3::ZERO,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
        major,
        minor,
    };
    let ring = |k: usize, at: f64, turn: f64| {
        let place = move |t: f64| if k == 0 { [t, at] } else { [at, t] };
        vec![edge(&torus, move |share| place(0.3 + turn * TAU * share))]
    };
    for angle in [1.0, 3.0, PI, 3.3, 4.5, 6.0] {
        for start in [0.0, 2.0, -1.0, 5.0] {
            let end = start + angle;
            // Along the ring; the tube's circles are in v.
            let elbow = angle * TAU * major * minor;
            // Around the tube; its circles are in u.
            let strip = TAU * minor * (major * angle + minor * (end.sin() - start.sin()));
            for (k, turn, wanted) in [(1, -1.0, elbow), (0, 1.0, strip)] {
                for (sense, turn) in [(1.0, turn), (-1.0, -turn)] {
                    let [lower, upper] = [ring(k, start, turn), ring(k, end, -turn)];
                    is_area(
                        &face(torus.clone(), vec![lower.clone(), upper.clone()], sense),
                        wanted,
                    );
                    is_area(&face(torus.clone(), vec![upper, lower], sense), wanted);
                }
            }
        }
    }
    // With a window.
    let window = ellipse(&torus, [4.0, 1.0], [0.2, 0.3], -1.0);
    let missing = PI * 0.2 * 0.3 * minor * (major + minor * 1.0_f64.cos());
    let loops = vec![ring(1, 0.0, -1.0), ring(1, 4.5, 1.0), window];
    is_area(
        &face(torus.clone(), loops, 1.0),
        4.5 * TAU * major * minor - missing,
    );
}

/// Two rows of poles that coincide make a parameter slow, not undefined: the face goes to its side.
#[test]
fn a_slow_parameter_is_no_pole() {
    use crate::spline::{Axis, SplineSurface};
    let axis = |degree: usize| Axis {
        degree,
        knots: [vec![0.0; degree + 1], vec![1.0; degree + 1]].concat(),
    };
    let row = |x: f64| vec![[x, 0.0, 0.0, 1.0], [x, 30.0, 0.0, 1.0]];
    let surface = Surface::Spline(SplineSurface {
        axes: [axis(3), axis(1)],
        poles: [0.0, 0.0, 50.0, 100.0].map(row).to_vec(),
    });
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let found = outline(&face(surface.clone(), vec![around(&surface, &corners)], 1.0)).unwrap();
    assert_eq!(found.trimmed, None);
    for [low, high] in found.rectangle {
        assert!(
            low.abs() < 1e-3 && (high - 1.0).abs() < 1e-3,
            "{:?}",
            found.rectangle
        );
    }
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

/// A plane through the axis cuts a cap in one edge, on which the pole is a point among others or between two.
#[test]
fn edges_run_through_a_pole() {
    let sphere = sphere(10.0);
    let cap = PI * 100.0 * (1.0 - 0.4_f64.sin());
    for start in [0.0, 1.0, -2.5, 3.0] {
        let rim = straight(&sphere, [start, 0.4], [start + PI, 0.4]);
        let away = FRAC_PI_2 - 0.4;
        for count in [64, 65, 31] {
            let over: Edge = (0..=count)
                .map(|k| {
                    let along = away * (1.0 - 2.0 * f64::from(k) / f64::from(count));
                    let u = start + if along > 0.0 { PI } else { 0.0 };
                    sphere.at_periodic(u, FRAC_PI_2 - along.abs()).point
                })
                .collect();
            is_area_of_loop(&sphere, &[rim.clone(), over], cap);
        }
    }
}

/// A torus with a tube that is wider than its ring meets its axis at two points, which part it into an outer and an inner sheet: a cap of either ends in one
/// of them.
#[test]
fn points_of_a_spindle_torus_are_enclosed() {
    let (major, minor) = (8.25_f64, 20.0_f64);
    let surface = Surface::Torus {
        center: dvec3(1.0, -2.0, 3.0),
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
        major,
        minor,
    };
    let first = (-major / minor).acos();
    // Area of a turn between two circles around the axis.
    let between = |[low, high]: [f64; 2]| {
        (TAU * minor * (major * (high - low) + minor * (high.sin() - low.sin()))).abs()
    };
    // Both ends of the inner sheet and one of the outer: a circle, and the point that it ends in. The last one is found below the seam.
    for (circle, point) in [
        (first + 0.4, first),
        (first - 0.4, first),
        (TAU - first - 0.4, TAU - first),
    ] {
        let turn = if point > circle { 1.0 } else { -1.0 };
        let rim = |wave: f64| {
            edge(&surface, |share| {
                let u = turn * TAU * share;
                [u, circle + wave * (3.0 * u).sin()]
            })
        };
        let range = [circle.min(point), circle.max(point)];
        let whole = outline(&face(surface.clone(), vec![vec![rim(0.0)]], 1.0)).unwrap();
        assert_eq!(whole.trimmed, None);
        let found = whole.rectangle[1];
        assert!(
            (0..2).all(|k| (found[k] - range[k]).abs() < 1e-9),
            "{found:?} for {range:?}"
        );
        // Its rim waved, and a window in it.
        let middle = [2.0, 0.5 * (circle + point)];
        let window = ellipse(&surface, middle, [0.3, 0.06], -1.0);
        let cap = face(surface.clone(), vec![vec![rim(0.1)], window], 1.0);
        let out = major + minor * middle[1].cos();
        let wave = {
            let steps = 20_000;
            let at = |k: i32| {
                let u = TAU * (f64::from(k) + 0.5) / f64::from(steps);
                between([circle + 0.1 * (3.0 * u).sin(), point]) / f64::from(steps)
            };
            (0..steps).map(at).sum::<f64>()
        };
        is_area(&cap, wave - PI * (0.3 * out.abs()) * (0.06 * minor));
        // More of the surface around it ends at the point, too.
        let options = Options {
            around_mm: 3.0,
            parameters: FaceParameters::Surface,
            ..Options::default()
        };
        let made = machinable("", &cap, &options).unwrap();
        let domain = made.nurbs.domain()[1];
        let end = if point > circle { domain[1] } else { domain[0] };
        assert!((end - point).abs() < 1e-9, "{domain:?} to {point}");
    }
    // The inner sheet without a window.
    let window = ellipse(&surface, [2.0, PI], [0.3, 0.1], -1.0);
    let missing = PI * (0.3 * (minor - major)) * (0.1 * minor);
    is_area(
        &face(surface.clone(), vec![window], 1.0),
        between([first, TAU - first]) - missing,
    );
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
