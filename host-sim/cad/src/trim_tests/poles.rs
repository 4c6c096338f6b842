//! Faces whose loops run around a closed surface, or through a point where a line of parameters is one point.

use std::f64::consts::FRAC_PI_2;

use super::*;
use crate::curve::Curve;

/// Edges the other way round.
pub(super) fn backwards(edges: &[Edge]) -> Vec<Edge> {
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
    let center = dvec3(1.0, -2.0, 3.0);
    let (major, minor) = (8.25_f64, 20.0_f64);
    let torus = Surface::Torus {
        center,
        x: DVec3::X,
        y: DVec3::Y,
        z: DVec3::Z,
        major,
        minor,
    };
    caps_of_a_spindle(&torus, [major, minor]);
    // The same surface as that of a circle turned around the axis, which it crosses.
    let turned = Surface::Revolution {
        profile: Curve::Ellipse {
            center: center + DVec3::X * major,
            x: DVec3::X * minor,
            y: DVec3::Z * minor,
        },
        range: [0.0, TAU],
        origin: center - DVec3::Z,
        axis: DVec3::Z,
    };
    caps_of_a_spindle(&turned, [major, minor]);
}

fn caps_of_a_spindle(surface: &Surface, [major, minor]: [f64; 2]) {
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
            edge(surface, |share| {
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
        let window = ellipse(surface, middle, [0.3, 0.06], -1.0);
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
    let window = ellipse(surface, [2.0, PI], [0.3, 0.1], -1.0);
    let missing = PI * (0.3 * (minor - major)) * (0.1 * minor);
    is_area(
        &face(surface.clone(), vec![window], 1.0),
        between([first, TAU - first]) - missing,
    );
}
