//! From the boundary of a face to a rectangle of parameters: seams, poles, circles alone, ends on a knot, faces that are trimmed.

use std::f64::consts::PI;

use super::*;

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
