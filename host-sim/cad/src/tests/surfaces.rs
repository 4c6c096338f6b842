//! Surfaces of every kind: the exact form as a B-spline, placement, least concave radii.

use std::f64::consts::PI;

use super::*;
use crate::exact::exact;

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

/// A face whose surface is the part of another one over a rectangle.
fn rectangular(surface: &Surface, rectangle: [[f64; 2]; 2]) -> Face {
    let part = exact(surface, rectangle).unwrap();
    assert!(part.at(rectangle[0][0], rectangle[1][0]).point.is_finite());
    face(Surface::Spline(part), Vec::new(), 1.0)
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

/// Places of both sheets of a torus whose tube is wider than its ring, between and beside the two points in which they meet; a horn torus, and a ring.
#[test]
fn places_on_a_torus_are_found() {
    for (major, minor) in [(8.25, 54.873_718_663_856), (5.0, 6.0), (6.0, 6.0), (20.0, 6.0)] {
        let torus = Surface::Torus {
            center: dvec3(100.0, -20.0, 7.0),
            x: dvec3(0.6, 0.8, 0.0),
            y: DVec3::Z,
            z: dvec3(0.8, -0.6, 0.0),
            major,
            minor,
        };
        for i in 0..40 {
            for j in 0..41 {
                let (u, v) = (0.157 * f64::from(i), 0.153 * f64::from(j));
                let point = torus.at(u, v).point;
                for near in [None, Some([u + 0.1, v - 0.1])] {
                    let (place, off_mm) = torus.invert(point, near);
                    assert!(
                        off_mm < 1e-9,
                        "{off_mm} mm off at {u}, {v} of radii {major}, {minor}"
                    );
                    for (found, wanted) in place.into_iter().zip([u, v]) {
                        let turns = if near.is_some() {
                            0.0
                        } else {
                            ((found - wanted) / TAU).round()
                        };
                        assert!(
                            (found - wanted - turns * TAU).abs() < 1e-9,
                            "{place:?} for {u}, {v} of radii {major}, {minor}"
                        );
                    }
                }
            }
        }
    }
}

/// A place on the flank of a thread is found without a guess, though other turns are next to it: 25 turns, 200 spans of a quadratic along the helix.
#[test]
fn places_on_a_thread_are_found() {
    let (spans, pitch) = (200, 1.0);
    let inner = (1..spans).map(f64::from);
    let knots: Vec<f64> = [0.0; 3]
        .into_iter()
        .chain(inner)
        .chain([f64::from(spans); 3])
        .collect();
    let helix = |pole: i32, radius: f64, z: f64| {
        let angle = 0.25 * PI * (f64::from(pole) - 0.5);
        let z = z + pitch * angle / TAU;
        [radius * angle.cos(), radius * angle.sin(), z, 1.0]
    };
    let poles = [(2.5, 0.0), (3.0, 0.4)]
        .map(|(radius, z)| (0..spans + 2).map(|pole| helix(pole, radius, z)).collect())
        .into();
    let flank = Axis {
        degree: 1,
        knots: vec![0.0, 0.0, 1.0, 1.0],
    };
    let axes = [flank, Axis { degree: 2, knots }];
    let thread = Surface::Spline(SplineSurface { poles, axes });
    for i in 0..=10 {
        for j in 0..=997 {
            let (u, v) = (f64::from(i) / 10.0, f64::from(spans * j) / 997.0);
            let point = thread.at(u, v).point;
            let ([found_u, found_v], off_mm) = thread.invert(point, None);
            assert!(off_mm < 1e-6, "{off_mm} mm off at {u}, {v}");
            near(thread.at(found_u, found_v).point, point, 1e-6, "the place found");
        }
    }
}
