//! Tests of the geometry against closed forms, one module a subject; here are the surfaces and faces that they share.

mod aspect;
pub(crate) mod fits;
mod orientation;
mod outlines;
mod removal;
mod splines;
mod straight;
mod surfaces;

use std::f64::consts::{FRAC_PI_2, TAU};

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
