//! Faces on sweeps of closed B-splines: around the sweep, across its seam, beside it.

use super::*;
use crate::curve::Curve;
use crate::spline::{Axis, SplineCurve};
use crate::sweeps::with_seam;

/// Smooth but at its seam, where it has a corner as those of many files have.
fn closed(poles: [[f64; 2]; 6], lift: f64) -> SplineCurve {
    let weights = [1.0, 0.8, 1.0, 1.3, 1.0, 1.0];
    let pole = |([x, z], w): ([f64; 2], f64)| [x * w, 0.0, (z + lift) * w, w];
    SplineCurve {
        axis: Axis {
            degree: 3,
            knots: vec![0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0],
        },
        poles: poles.into_iter().zip(weights).map(pole).collect(),
    }
}

const DROP: [[f64; 2]; 6] = [
    [10.0, 0.0],
    [10.0, 10.0],
    [-10.0, 10.0],
    [-10.0, -10.0],
    [10.0, -10.0],
    [10.0, 0.0],
];

/// A loop of lines of an open sweep, as files have it: the face is to its left.
fn swept(surface: &Surface, loops: Vec<Vec<Edge>>, sense: f64) -> Face {
    let mut face = face(surface.clone(), loops, sense);
    with_seam(&mut face);
    assert!(
        matches!(face.surface, Surface::Spline(_)),
        "{:?}",
        face.surface.kind()
    );
    face
}

/// Integral over a range of the parameter, which may go on across the seam.
fn integral(range: [f64; 2], value: impl Fn(f64) -> f64) -> f64 {
    let steps = 20_000;
    let width = (range[1] - range[0]) / f64::from(steps);
    (0..steps)
        .map(|k| value((range[0] + (f64::from(k) + 0.5) * width).rem_euclid(3.0)) * width)
        .sum()
}

#[test]
fn extrusions_of_closed_splines() {
    let profile = closed(DROP, 0.0);
    // Oblique, so that the profile has no one height along it.
    let direction = dvec3(0.3, 2.0, 0.4);
    let surface = Surface::Extrusion {
        profile: Curve::Spline(profile.clone()),
        range: None,
        direction,
    };
    let speed = |t: f64| profile.at(t)[1].cross(direction).length();
    let whole = 20.0 * integral([0.0, 3.0], speed);
    let ring = |v: f64, turn: f64| {
        vec![edge(&surface, |share| {
            [
                if turn > 0.0 {
                    3.0 * share
                } else {
                    3.0 - 3.0 * share
                },
                v,
            ]
        })]
    };
    // A belt, with its seam and without.
    let seam = |from: f64, to: f64| straight(&surface, [0.0, from], [0.0, to]);
    let with = vec![
        [
            ring(0.0, 1.0),
            vec![seam(0.0, 20.0)],
            ring(20.0, -1.0),
            vec![seam(20.0, 0.0)],
        ]
        .concat(),
    ];
    is_area(&swept(&surface, with, 1.0), whole);
    let without = vec![ring(0.0, 1.0), ring(20.0, -1.0)];
    let belt = swept(&surface, without.clone(), 1.0);
    is_area(&belt, whole);
    assert!(outline(&belt).unwrap().trimmed.is_none());
    // The other way round it is inside out.
    let turned = without.iter().map(|edges| poles::backwards(edges)).collect();
    is_area(&swept(&surface, turned, -1.0), whole);
    // A hole in it, away from the seam.
    let hole = ellipse(&surface, [1.5, 10.0], [0.2, 3.0], -1.0);
    let holed = swept(&surface, [without, vec![hole]].concat(), 1.0);
    let missing = integral([1.3, 1.7], |t| {
        speed(t) * 6.0 * (1.0 - ((t - 1.5) / 0.2).powi(2)).max(0.0).sqrt()
    });
    is_area(&holed, whole - missing);
    // Rectangles that end at the seam, and one across it.
    for range in [[0.0, 1.0], [2.0, 3.0], [0.4, 2.6]] {
        let corners = [[range[0], 1.0], [range[1], 1.0], [range[1], 6.0], [range[0], 6.0]];
        let part = swept(&surface, vec![around(&surface, &corners)], 1.0);
        is_area(&part, 5.0 * integral(range, speed));
    }
    let at = |u: f64, v: f64| surface.at(u.rem_euclid(3.0), v).point;
    let line = |from: [f64; 2], to: [f64; 2]| -> Edge {
        (0..=64)
            .map(|k| {
                let share = f64::from(k) / 64.0;
                at(
                    from[0] + share * (to[0] - from[0]),
                    from[1] + share * (to[1] - from[1]),
                )
            })
            .collect()
    };
    let across = vec![vec![
        line([2.5, 1.0], [3.5, 1.0]),
        line([3.5, 1.0], [3.5, 6.0]),
        line([3.5, 6.0], [2.5, 6.0]),
        line([2.5, 6.0], [2.5, 1.0]),
    ]];
    let part = swept(&surface, across, 1.0);
    is_area(&part, 5.0 * integral([2.5, 3.5], speed));
}

#[test]
fn revolutions_of_closed_splines() {
    let profile = closed(DROP.map(|[x, z]| [0.4 * x + 12.0, 0.4 * z]), 3.0);
    let surface = Surface::Revolution {
        profile: Curve::Spline(profile.clone()),
        range: [0.0, 3.0],
        origin: DVec3::ZERO,
        axis: DVec3::Z,
    };
    let speed = |t: f64| profile.at(t)[1].length() * profile.at(t)[0].x;
    for [start, end] in [[0.3, 1.8], [-1.0, 2.5]] {
        let ring = |u: f64, turn: f64| {
            vec![edge(&surface, |share| {
                [
                    u,
                    if turn > 0.0 {
                        3.0 * share
                    } else {
                        3.0 - 3.0 * share
                    },
                ]
            })]
        };
        let part = swept(&surface, vec![ring(end, 1.0), ring(start, -1.0)], 1.0);
        is_area(&part, (end - start) * integral([0.0, 3.0], speed));
    }
    // A rectangle on its upper side.
    let corners = [[0.2, 0.7], [2.0, 0.7], [2.0, 1.4], [0.2, 1.4]];
    let part = swept(&surface, vec![around(&surface, &corners)], 1.0);
    is_area(&part, 1.8 * integral([0.7, 1.4], speed));
}

/// What is open, or closes elsewhere, stays as it is.
#[test]
fn other_sweeps_stay() {
    let [mut open, part] = [closed(DROP, 0.0), closed(DROP, 0.0)];
    open.poles[5][0] += 1e-3;
    for (profile, range) in [(open, None), (part, Some([0.0, 2.0]))] {
        let surface = Surface::Extrusion {
            profile: Curve::Spline(profile),
            range,
            direction: DVec3::Y,
        };
        let corners = [[0.2, 0.0], [1.8, 0.0], [1.8, 5.0], [0.2, 5.0]];
        let mut face = face(surface.clone(), vec![around(&surface, &corners)], 1.0);
        with_seam(&mut face);
        assert_eq!(face.surface, surface);
    }
}
