//! Solids that are inside out are turned, others stay as they are.

use super::*;
use crate::orientation::turn_outwards;

/// A face between corners in the order of the material on the left, seen from where the normal points.
fn flat(corners: [DVec3; 4]) -> Face {
    let [origin, along, _, across] = corners;
    let plane = Surface::Plane {
        origin,
        x: (along - origin).normalize(),
        y: (across - origin).normalize(),
    };
    let next = corners.iter().cycle().skip(1);
    let edges = corners.iter().zip(next).map(|(a, b)| vec![*a, *b]).collect();
    face(plane, vec![edges], 1.0)
}

/// The six faces of a box around the origin, with outward normals.
fn block(size: DVec3) -> Vec<Face> {
    let corner = |x: f64, y: f64, z: f64| 0.5 * size * dvec3(x, y, z);
    let side = |turn: fn(f64, f64, f64) -> [f64; 3]| {
        [1.0, -1.0].map(|end| {
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let at = |[a, b]: [f64; 2]| {
                let [x, y, z] = turn(a * end, b, end);
                corner(x, y, z)
            };
            flat(corners.map(at))
        })
    };
    [
        side(|a, b, end| [a, b, end]),
        side(|a, b, end| [end, a, b]),
        side(|a, b, end| [b, end, a]),
    ]
    .concat()
}

/// The same with inward normals.
fn turned(faces: &[Face]) -> Vec<Face> {
    let mut faces = faces.to_vec();
    for face in &mut faces {
        face.sense = -face.sense;
        if let Boundary::Loops(loops) = &mut face.boundary {
            for edges in loops {
                edges.reverse();
                edges.iter_mut().for_each(|edge| edge.reverse());
            }
        }
    }
    faces
}

/// What becomes of these shells of a solid.
fn oriented(shells: &[Vec<Face>]) -> Vec<Face> {
    let mut faces = shells.concat();
    let mut first = 0;
    let indices = shells.iter().map(|shell| {
        first += shell.len();
        (first - shell.len()..first).collect()
    });
    let solid = Solid {
        shells: indices.collect(),
        copies: Vec::new(),
    };
    turn_outwards(&mut faces, &[solid]);
    faces
}

/// A disk of radius 5 at a height, its normal up or down.
fn disk(height: f64, up: f64) -> Face {
    let plane = Surface::Plane {
        origin: dvec3(0.0, 0.0, height),
        x: DVec3::X,
        y: up * DVec3::Y,
    };
    let point = |k: i32| {
        let (sin, cos) = (up * TAU * f64::from(k) / 64.0).sin_cos();
        dvec3(5.0 * cos, 5.0 * sin, height)
    };
    face(plane, vec![vec![(0..=64).map(point).collect()]], 1.0)
}

/// A wall of radius 5 between two heights, with a seam.
fn wall(low: f64, high: f64) -> Face {
    let cylinder = Surface::Cylinder {
        origin: DVec3::ZERO,
        x: 5.0 * DVec3::X,
        y: 5.0 * DVec3::Y,
        z: DVec3::Z,
    };
    let edges = around(&cylinder, &[[0.0, low], [TAU, low], [TAU, high], [0.0, high]]);
    face(cylinder, vec![edges], 1.0)
}

/// Whole surfaces without edges.
fn whole(surface: Surface) -> Face {
    Face {
        boundary: Boundary::Natural,
        ..face(surface, Vec::new(), 1.0)
    }
}

fn closed_shells() -> Vec<Vec<Face>> {
    let rod = vec![wall(-3.0, 8.0), disk(8.0, 1.0), disk(-3.0, -1.0)];
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let center = dvec3(900.0, 300.0, -50.0);
    let ball = Surface::Sphere {
        center,
        x: 4.0 * x,
        y: 4.0 * y,
        z: 4.0 * z,
    };
    let ring = Surface::Torus {
        center,
        x,
        y,
        z,
        major: 20.0,
        minor: 3.0,
    };
    vec![
        block(dvec3(30.0, 20.0, 10.0)),
        block(dvec3(1000.0, 1000.0, 0.5)),
        rod,
        vec![whole(ball)],
        vec![whole(ring)],
    ]
}

#[test]
fn a_solid_inside_out_is_turned() {
    for shell in closed_shells() {
        let kind = shell[0].surface.kind();
        assert_eq!(oriented(std::slice::from_ref(&shell)), shell, "{kind}");
        assert_eq!(oriented(&[turned(&shell)]), shell, "{kind}");
    }
}

/// A box that lacks a face, or of whose faces one points the other way, or that encloses nothing.
#[test]
fn what_is_not_closed_stays() {
    let whole = turned(&block(dvec3(30.0, 20.0, 10.0)));
    let open = whole[1..].to_vec();
    assert_eq!(oriented(std::slice::from_ref(&open)), open);
    let mixed = [turned(&whole[..1]), whole[1..].to_vec()].concat();
    assert_eq!(oriented(std::slice::from_ref(&mixed)), mixed);
    let empty = turned(&block(dvec3(30.0, 20.0, 1e-6)));
    assert_eq!(oriented(std::slice::from_ref(&empty)), empty);
    let mut unknown = whole;
    unknown[2].boundary = Boundary::Unknown("it is lost".to_owned());
    assert_eq!(oriented(std::slice::from_ref(&unknown)), unknown);
}

/// The normals of a void point into it, out of the material. It is turned with the shell around it, whichever comes first.
#[test]
fn a_void_stays_one() {
    let outer = block(dvec3(30.0, 20.0, 10.0));
    let void = turned(&block(dvec3(20.0, 10.0, 5.0)));
    for shells in [[outer.clone(), void.clone()], [void, outer]] {
        assert_eq!(oriented(&shells), shells.concat());
        let inside_out = [turned(&shells[0]), turned(&shells[1])];
        assert_eq!(oriented(&inside_out), shells.concat());
    }
}

/// Copies of a solid in an assembly are turned with it.
#[test]
fn copies_are_turned_with_the_solid() {
    let shell = block(dvec3(30.0, 20.0, 10.0));
    let mut faces = [turned(&shell), turned(&shell)].concat();
    let solid = Solid {
        shells: vec![(0..6).collect()],
        copies: (6..12).collect(),
    };
    turn_outwards(&mut faces, &[solid]);
    assert_eq!(faces, [shell.clone(), shell].concat());
}

/// A hole in a face does not count: a frame of four boxes' worth of material.
#[test]
fn holes_do_not_count() {
    let mut shell = block(dvec3(30.0, 20.0, 10.0));
    let mut hole = turned(&block(dvec3(28.0, 18.0, 10.0)));
    // The top and the bottom of the frame.
    for k in 0..2 {
        let Boundary::Loops(loops) = &hole[k].boundary else {
            unreachable!()
        };
        let inner = loops.clone();
        if let Boundary::Loops(loops) = &mut shell[k].boundary {
            loops.extend(inner);
        }
    }
    shell.extend(hole.split_off(2));
    assert_eq!(oriented(std::slice::from_ref(&shell)), shell);
    assert_eq!(oriented(&[turned(&shell)]), shell);
}
