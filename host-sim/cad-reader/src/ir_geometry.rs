//! Conversion of surfaces and curves of `cadmpeg`, with checks of degrees, knots, weights and coordinates.

use cadmpeg_ir::geometry::nurbs::{NurbsCurve, NurbsPoleGrid, NurbsPoles3, NurbsSurface, WeightedPole3};
use cadmpeg_ir::geometry::{SolvedCurveGeometry, SolvedSurfaceGeometry};
use cadmpeg_ir::math::{Point3, Vector3};
use cadmpeg_ir::transform::Transform;
use cadmpeg_ir::units::OrthonormalFrame3;

use cad::{Axis, DEGREE_MAX, Pole, SplineCurve, SplineSurface};
use cad::{Curve, Placement, Surface};
use glam::DVec3;

/// Nesting depth of derived surfaces (offsets of offsets).
pub(crate) const SURFACE_DEPTH_MAX: usize = 8;
/// Largest coordinate, mm: 1 km.
const FAR_MM: f64 = 1e6;

pub(crate) fn point(p: Point3) -> DVec3 {
    DVec3::new(p.x, p.y, p.z)
}

pub(crate) fn vector(p: &Vector3) -> DVec3 {
    DVec3::new(p.x, p.y, p.z)
}

/// Axes of a frame: reference direction, second direction, axis.
fn frame(frame: &OrthonormalFrame3) -> [DVec3; 3] {
    [frame.reference(), &frame.binormal(), frame.axis()].map(|unit| vector(unit.as_raw()))
}

pub(crate) fn placement(transform: &Transform) -> Placement {
    Placement {
        rows: transform.affine_rows(),
    }
}

pub(crate) fn solved_surface(solved: &SolvedSurfaceGeometry, depth: usize) -> Result<Surface, String> {
    if depth > SURFACE_DEPTH_MAX {
        return Err("its placement is nested too deep".to_owned());
    }
    let surface = match solved {
        SolvedSurfaceGeometry::Plane(plane) => {
            let [x, y, _] = frame(plane.frame());
            Surface::Plane {
                origin: point(plane.origin().get()),
                x,
                y,
            }
        }
        SolvedSurfaceGeometry::Cylinder(cylinder) => {
            let [x, y, z] = frame(cylinder.frame());
            let radius = cylinder.radius().get();
            Surface::Cylinder {
                origin: point(cylinder.origin().get()),
                x: x * radius,
                y: y * radius,
                z,
            }
        }
        SolvedSurfaceGeometry::Cone(cone) => {
            let [x, y, z] = frame(cone.frame());
            Surface::Cone {
                origin: point(cone.origin().get()),
                x,
                y: y * cone.ratio().get(),
                z,
                radius: cone.radius().get(),
                slope: cone.half_angle().get().tan(),
            }
        }
        SolvedSurfaceGeometry::Sphere(sphere) => {
            let radius = sphere.radius().get();
            let [x, y, z] = frame(sphere.frame()).map(|unit| unit * radius);
            Surface::Sphere {
                center: point(sphere.center().get()),
                x,
                y,
                z,
            }
        }
        SolvedSurfaceGeometry::Torus(torus) => {
            let [x, y, z] = frame(torus.frame());
            Surface::Torus {
                center: point(torus.center().get()),
                x,
                y,
                z,
                major: torus.major_radius().get(),
                minor: torus.minor_radius().get(),
            }
        }
        SolvedSurfaceGeometry::Nurbs(nurbs) => Surface::Spline(spline_surface(nurbs)?),
        SolvedSurfaceGeometry::Transformed(placed) => solved_surface(placed.basis(), depth + 1)?
            .placed(&placement(placed.transform()))
            .ok_or("its placement distorts it")?,
        SolvedSurfaceGeometry::Polygonal(_) => return Err("it is a mesh".to_owned()),
        SolvedSurfaceGeometry::Unknown { .. } => return Err("it is of a kind that is not read".to_owned()),
    };
    let [u, v] = surface.domain().map(|range| range.map_or(0.0, |r| r[0]));
    let at = surface.at(u, v).point;
    if !at.is_finite() || at.abs().max_element() > FAR_MM {
        return Err("it lies farther than a kilometre from the origin".to_owned());
    }
    Ok(surface)
}

fn lifted(p: DVec3, w: f64) -> Pole {
    (p * w).extend(w).to_array()
}

/// Degree and knots, if they fit the poles.
fn axis(degree: u32, knots: &[f64], poles: usize) -> Result<Axis, String> {
    let degree = usize::try_from(degree).unwrap_or(usize::MAX);
    if !(1..=DEGREE_MAX).contains(&degree) {
        return Err(format!("its degree is {degree}; 1 to {DEGREE_MAX} are read"));
    }
    if poles <= degree || knots.len() != poles + degree + 1 {
        return Err("its knots do not fit its poles".to_owned());
    }
    let axis = Axis {
        degree,
        knots: knots.to_vec(),
    };
    let [start, end] = axis.domain();
    if axis.knots.iter().any(|knot| !knot.is_finite()) || axis.knots.windows(2).any(|pair| pair[0] > pair[1])
    {
        return Err("its knots descend or are not finite".to_owned());
    }
    if start >= end {
        return Err("its range of parameters is empty".to_owned());
    }
    let inside = axis.knots.iter().filter(|knot| **knot > start && **knot < end);
    if inside.clone().any(|knot| axis.multiplicity(*knot) > degree) {
        return Err("it is discontinuous at a knot of too high multiplicity".to_owned());
    }
    Ok(axis)
}

fn weighted(poles: &[Pole]) -> Result<(), String> {
    if poles.iter().any(|pole| pole[3].is_nan() || pole[3] <= 0.0) {
        return Err("a weight is not above 0".to_owned());
    }
    let far = |pole: &Pole| {
        pole[..3]
            .iter()
            .any(|x| !x.is_finite() || (x / pole[3]).abs() > FAR_MM)
    };
    if poles.iter().any(far) {
        return Err("a pole lies farther than a kilometre from the origin".to_owned());
    }
    Ok(())
}

fn spline_surface(nurbs: &NurbsSurface) -> Result<SplineSurface, String> {
    let poles: Vec<Vec<Pole>> = match nurbs.pole_grid() {
        NurbsPoleGrid::Polynomial { rows } => rows
            .iter()
            .map(|row| row.iter().map(|pole| lifted(point(pole.get()), 1.0)).collect())
            .collect(),
        NurbsPoleGrid::Rational { rows } => rows
            .iter()
            .map(|row| {
                let pole = |pole: &WeightedPole3<_>| lifted(finite(&pole.point), pole.weight.get());
                row.iter().map(pole).collect()
            })
            .collect(),
    };
    let columns = poles.first().map_or(0, Vec::len);
    for row in &poles {
        weighted(row)?;
    }
    Ok(SplineSurface {
        axes: [
            axis(nurbs.u_degree(), nurbs.u_knots().as_slice(), poles.len())?,
            axis(nurbs.v_degree(), nurbs.v_knots().as_slice(), columns)?,
        ],
        poles,
    })
}

fn finite(p: &cadmpeg_ir::features::FinitePoint3) -> DVec3 {
    point(p.get())
}

fn spline_curve(nurbs: &NurbsCurve) -> Option<SplineCurve> {
    let poles: Vec<Pole> = match nurbs.pole_rows() {
        NurbsPoles3::Polynomial { points } => points.iter().map(|pole| lifted(finite(pole), 1.0)).collect(),
        NurbsPoles3::Rational { points } => points
            .iter()
            .map(|pole| lifted(finite(&pole.point), pole.weight.get()))
            .collect(),
    };
    weighted(&poles).ok()?;
    Some(SplineCurve {
        axis: axis(nurbs.degree(), nurbs.knots().as_slice(), poles.len()).ok()?,
        poles,
    })
}

pub(crate) fn solved_curve(solved: &SolvedCurveGeometry) -> Option<Curve> {
    Some(match solved {
        SolvedCurveGeometry::Line(line) => Curve::Line {
            origin: point(line.origin().get()),
            direction: vector(line.direction().as_raw()),
        },
        SolvedCurveGeometry::Circle(circle) => {
            let [x, y, _] = frame(circle.frame()).map(|unit| unit * circle.radius().get());
            Curve::Ellipse {
                center: point(circle.center().get()),
                x,
                y,
            }
        }
        SolvedCurveGeometry::Ellipse(ellipse) => {
            let [x, y, _] = frame(ellipse.frame());
            Curve::Ellipse {
                center: point(ellipse.center().get()),
                x: x * ellipse.major_radius().get(),
                y: y * ellipse.minor_radius().get(),
            }
        }
        SolvedCurveGeometry::Parabola(parabola) => {
            let [x, y, _] = frame(parabola.frame()).map(|unit| unit * parabola.focal_distance().get());
            Curve::Parabola {
                vertex: point(parabola.vertex().get()),
                x,
                y: y * 2.0,
            }
        }
        SolvedCurveGeometry::Hyperbola(hyperbola) => {
            let [x, y, _] = frame(hyperbola.frame());
            Curve::Hyperbola {
                center: point(hyperbola.center().get()),
                x: x * hyperbola.major_radius().get(),
                y: y * hyperbola.minor_radius().get(),
            }
        }
        SolvedCurveGeometry::Nurbs(nurbs) => Curve::Spline(spline_curve(nurbs)?),
        SolvedCurveGeometry::Transformed(placed) => {
            solved_curve(placed.basis())?.placed(&placement(placed.transform()))
        }
        _ => return None,
    })
}
