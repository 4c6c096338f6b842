//! Parameters of a plane that suit the face on it. Those of the file are arbitrary; any others are as exact.
//!
//! A ring or a sector of one has the angle about its centre and the radius: its passes are circles. Any other face has straight lines along most of its straight edges: passes follow them
//! and end square to them, where nothing is left between their ends.

use glam::DVec3;

use super::curve::Curve;
use super::outline::outline;
use super::spline::{Axis, SplineCurve};
use super::surface::Surface;
use super::{Boundary, Edge, Face, Outline};

/// Tolerance of an edge on a line or on a circle, mm: that of an edge on an iso-parametric line.
const FOLLOWS_MM: f64 = 1e-3;
/// Edges whose directions differ by less are parallel, rad.
const PARALLEL_RAD: f64 = 1e-4;
/// Least radius of the parameters, as a share of the face's inner radius: the surface around the face must not reach the centre, where the circles end.
const INNER_SHARE: f64 = 0.05;
/// Greatest radius of the parameters beyond the face's outer radius, in outer radii.
const OUTER: f64 = 2.0;

/// A circle.
#[derive(Clone, Copy)]
pub(super) struct Circle {
    pub(super) centre: DVec3,
    pub(super) radius: f64,
}

/// The face of a plane with parameters that suit it, and its outline with those; `None` where those of the file do.
pub(super) fn suited(face: &Face, now: &Outline) -> Option<(Face, Outline)> {
    let Surface::Plane { origin, x, y } = &face.surface else {
        return None;
    };
    let Boundary::Loops(loops) = &face.boundary else {
        return None;
    };
    if now.trimmed.is_none() || now.unknown {
        return None;
    }
    let with = |surface: Surface| {
        let face = Face {
            surface,
            ..face.clone()
        };
        let outline = outline(&face).ok()?;
        Some((face, outline))
    };
    let whole = |found: &(Face, Outline)| found.1.trimmed.is_none();
    let normal = x.cross(*y).normalize();
    let turned = direction(loops, normal).and_then(|along| {
        let is_turned = along
            .cross(x.normalize())
            .length()
            .min(along.cross(y.normalize()).length())
            > PARALLEL_RAD;
        let surface = Surface::Plane {
            origin: *origin,
            x: along * x.length(),
            y: normal.cross(along) * y.length(),
        };
        is_turned.then(|| with(surface)).flatten()
    });
    if turned.as_ref().is_some_and(whole) {
        return turned;
    }
    let ring = polar(loops, normal).and_then(with).filter(whole);
    ring.or(turned)
}

/// The direction of most straight edges, by their length; at right angles to it is the same.
fn direction(loops: &[Vec<Edge>], normal: DVec3) -> Option<DVec3> {
    let mut kinds: Vec<(DVec3, f64)> = Vec::new();
    for edge in loops.iter().flatten() {
        let (first, last) = (*edge.first()?, *edge.last()?);
        let chord = last - first;
        let (along, length) = (chord.normalize_or_zero(), chord.length());
        let is_straight = edge
            .iter()
            .all(|p| (*p - first).cross(along).length() <= FOLLOWS_MM);
        if length <= 2.0 * FOLLOWS_MM || !is_straight {
            continue;
        }
        let is_of = |of: &DVec3| along.cross(*of).length().min(along.dot(*of).abs()) <= PARALLEL_RAD;
        match kinds.iter_mut().find(|(of, _)| is_of(of)) {
            Some((_, sum)) => *sum += length,
            None => kinds.push((along, length)),
        }
    }
    let (along, _) = kinds.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((along - normal * along.dot(normal)).normalize())
}

/// Angle and radius about the common centre of the curved edges, if they are arcs of two circles.
fn polar(loops: &[Vec<Edge>], normal: DVec3) -> Option<Surface> {
    let mut circles: Vec<Circle> = Vec::new();
    for edges in loops {
        // A circle may be parted anywhere; its parts have the same centre.
        for edge in edges {
            let (first, last) = (*edge.first()?, *edge.last()?);
            let along = (last - first).normalize_or_zero();
            let is_straight = along != DVec3::ZERO
                && edge
                    .iter()
                    .all(|p| (*p - first).cross(along).length() <= FOLLOWS_MM);
            if !is_straight {
                circles.push(circle(edge, normal)?);
            }
        }
    }
    let centre = circles.first()?.centre;
    let is_common = circles
        .iter()
        .all(|circle| circle.centre.distance(centre) <= FOLLOWS_MM);
    let radii = || circles.iter().map(|circle| circle.radius);
    let (inner, outer) = (radii().fold(f64::INFINITY, f64::min), radii().fold(0.0, f64::max));
    if !is_common || outer - inner <= 2.0 * FOLLOWS_MM {
        return None;
    }
    // The angle begins at the start of an edge, so that an arc's ends are those of the angle's range.
    let start = loops.first()?.first()?.first()?;
    let out = (*start - centre).normalize_or_zero();
    let range = [INNER_SHARE * inner, outer + OUTER * outer];
    let poles = range.map(|radius| (centre + out * radius).extend(1.0).to_array());
    let profile = Curve::Spline(SplineCurve {
        axis: Axis {
            degree: 1,
            knots: vec![range[0], range[0], range[1], range[1]],
        },
        poles: poles.to_vec(),
    });
    // S_u x S_v is against the axis of the angle.
    Some(Surface::Revolution {
        profile,
        range,
        origin: centre,
        axis: -normal,
    })
}

/// The circle of an edge.
pub(super) fn circle(edge: &Edge, normal: DVec3) -> Option<Circle> {
    let at = |share: usize| edge.get(share * (edge.len() - 1) / 6).copied();
    // Three places that are not near each other, on a whole circle too.
    let (a, b, c) = (at(0)?, at(2)?, at(4)?);
    let (ab, ac) = (b - a, c - a);
    let twice_area = ab.cross(ac).dot(normal);
    let centre = a + (ab.length_squared() * ac - ac.length_squared() * ab).cross(normal) / (2.0 * twice_area);
    let radius = centre.distance(a);
    let is_on = |p: &DVec3| (p.distance(centre) - radius).abs() <= FOLLOWS_MM;
    (radius.is_finite() && edge.iter().all(is_on)).then_some(Circle { centre, radius })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Form, Options, machinable};
    use oracle::Surface as Machined;
    use std::f64::consts::{PI, TAU};

    /// A plane in general position, its own axes 0.3 rad beside those of the shapes on it.
    fn axes() -> [DVec3; 4] {
        let normal = DVec3::new(0.2, -0.3, 0.9).normalize();
        let x = normal.cross(DVec3::new(0.4, 0.7, 0.1)).normalize();
        [DVec3::new(10.0, -20.0, 5.0), x, normal.cross(x), normal]
    }

    fn point([a, b]: [f64; 2]) -> DVec3 {
        let [origin, x, y, _] = axes();
        origin + x * a + y * b
    }

    fn face(loops: Vec<Vec<Edge>>) -> Face {
        let [origin, x, y, _] = axes();
        let (sin, cos) = 0.3_f64.sin_cos();
        Face {
            number: 1,
            entity: "#1".to_owned(),
            name: None,
            colour: None,
            surface: Surface::Plane {
                origin: origin - x,
                x: x * cos + y * sin,
                y: y * cos - x * sin,
            },
            boundary: Boundary::Loops(loops),
            sense: 1.0,
            solid: true,
        }
    }

    fn line(a: [f64; 2], b: [f64; 2]) -> Edge {
        let at = |share: f64| point([a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])]);
        vec![at(0.0), at(0.5), at(1.0)]
    }

    fn arc([a, b]: [f64; 2], radius: f64, [from, to]: [f64; 2]) -> Edge {
        let at = |k: u32| from + f64::from(k) / 64.0 * (to - from);
        (0..=64)
            .map(|k| point([a + radius * at(k).cos(), b + radius * at(k).sin()]))
            .collect()
    }

    /// The surface that is machined lies in the plane, its normal and the face's are the same, and the area is that of the face: the boundary is where it was.
    fn check(face: &Face, area: f64) -> [[f64; 2]; 2] {
        let made = machinable("plane.step", face, &Options::default()).unwrap();
        assert_eq!((&made.form, &made.trimmed), (&Form::Exact, &None));
        let surface = Machined::new(&made.spec());
        let [[u0, u1], [v0, v1]] = made.spec().domain();
        let [origin, _, _, normal] = axes();
        let (mut sum, steps) = (0.0, 400);
        for i in 0..steps {
            for j in 0..steps {
                let share = |k: i32| (f64::from(k) + 0.5) / f64::from(steps);
                let at = surface.at(u0 + share(i) * (u1 - u0), v0 + share(j) * (v1 - v0));
                let cross = at.u.cross(at.v);
                assert!((at.point - origin).dot(normal).abs() < 1e-12);
                assert!(cross.normalize().dot(normal) > 1.0 - 1e-12);
                sum += cross.length() * (u1 - u0) * (v1 - v0) / f64::from(steps * steps);
            }
        }
        assert!((sum - area).abs() < 1e-5 * area, "{sum} {area}");
        // The face's own boundary is that of the rectangle.
        let Boundary::Loops(loops) = &face.boundary else {
            panic!()
        };
        for p in loops.iter().flatten().flatten() {
            let on_side = (0..=2000).map(|k| f64::from(k) / 2000.0).flat_map(|share| {
                let (u, v) = (u0 + share * (u1 - u0), v0 + share * (v1 - v0));
                [[u, v0], [u, v1], [u0, v], [u1, v]]
            });
            let nearest = on_side
                .map(|[u, v]| surface.at(u, v).point.distance(*p))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.02, "{nearest}");
        }
        [[u0, u1], [v0, v1]]
    }

    #[test]
    fn a_turned_rectangle_is_whole() {
        let corners = [[0.0, 0.0], [12.0, 0.0], [12.0, 5.0], [0.0, 5.0]];
        let edges = (0..4).map(|k| line(corners[k], corners[(k + 1) % 4])).collect();
        check(&face(vec![edges]), 60.0);
    }

    #[test]
    fn a_ring_is_whole_in_angle_and_radius() {
        let outer = arc([3.0, 4.0], 8.0, [0.0, TAU]);
        let inner = arc([3.0, 4.0], 5.0, [1.0, 1.0 - TAU]);
        check(&face(vec![vec![outer], vec![inner]]), PI * 39.0);
        // The same in two arcs each, and with a hole first.
        let halves = |radius: f64, from: f64, by: f64| {
            vec![
                arc([3.0, 4.0], radius, [from, from + by]),
                arc([3.0, 4.0], radius, [from + by, from + 2.0 * by]),
            ]
        };
        check(
            &face(vec![halves(5.0, 0.5, -PI), halves(8.0, 2.0, PI)]),
            PI * 39.0,
        );
    }

    #[test]
    fn a_sector_of_a_ring_is_whole() {
        let at = |radius: f64, angle: f64| [3.0 + radius * angle.cos(), 4.0 + radius * angle.sin()];
        let (from, to) = (0.4, 2.1);
        let edges = vec![
            arc([3.0, 4.0], 8.0, [from, to]),
            line(at(8.0, to), at(5.0, to)),
            arc([3.0, 4.0], 5.0, [to, from]),
            line(at(5.0, from), at(8.0, from)),
        ];
        let [_, [v0, v1]] = check(&face(vec![edges]), 0.5 * 1.7 * 39.0);
        assert!((v0 - 5.0).abs() < 1e-6 && (v1 - 8.0).abs() < 1e-6, "{v0} {v1}");
    }

    /// What is neither is turned along its longest edges, and stays trimmed.
    #[test]
    fn another_face_is_turned_to_its_edges() {
        let corners = [[0.0, 0.0], [12.0, 0.0], [10.0, 4.0], [8.0, 5.0], [0.0, 5.0]];
        let edges = (0..5).map(|k| line(corners[k], corners[(k + 1) % 5])).collect();
        let made = machinable("plane.step", &face(vec![edges]), &Options::default()).unwrap();
        assert!(made.trimmed.is_some());
        let [[u0, u1], [v0, v1]] = made.outline.rectangle;
        assert!((u1 - u0 - 12.0).abs() < 1e-6 && (v1 - v0 - 5.0).abs() < 1e-6);
        let untrimmed = Options {
            untrimmed: true,
            ..Options::default()
        };
        let edges = (0..5).map(|k| line(corners[k], corners[(k + 1) % 5])).collect();
        let made = machinable("plane.step", &face(vec![edges]), &untrimmed).unwrap();
        let [[u0, u1], _] = made.outline.rectangle;
        assert!((u1 - u0 - 12.0 * 0.3_f64.cos()).abs() < 1e-6);
    }
}
