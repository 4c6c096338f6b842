//! Exact conversion of surfaces over a rectangle to B-splines: elementary surfaces to rational quadratics, B-splines by
//! knot insertion.

use super::curve::{Curve, arcs};
use super::spline::{Axis, Pole, SplineCurve, SplineSurface};
use super::surface::Surface;
use glam::DVec3;

/// Joints this close to each other or to the ends, as a share of the range, are one: they differ by rounding, and no tool sees a span of
/// that width.
const JOINT_SLACK: f64 = 1e-9;

/// Homogeneous profile point, `w` times: the point on the axis, and the radial part.
fn lifted(on_axis: DVec3, beside: DVec3, w: f64) -> Pole {
    (on_axis * w + beside).extend(w).to_array()
}

/// Degree 1 over a range.
fn linear(range: [f64; 2]) -> Axis {
    Axis {
        degree: 1,
        knots: vec![range[0], range[0], range[1], range[1]],
    }
}

/// The surface over a rectangle of its parameters, which may cross the seam of a closed surface; `None` without an exact
/// form.
#[must_use]
pub(super) fn exact(surface: &Surface, [u, v]: [[f64; 2]; 2]) -> Option<SplineSurface> {
    match surface {
        Surface::Plane { origin, x, y } => {
            let pole = |a: f64, b: f64| lifted(*origin + (*x * a + *y * b), DVec3::ZERO, 1.0);
            Some(SplineSurface {
                axes: [linear(u), linear(v)],
                poles: u.map(|a| v.map(|b| pole(a, b)).to_vec()).to_vec(),
            })
        }
        Surface::Cylinder { origin, x, y, z } => Some(turned(
            u,
            [*x, *y],
            &linear(v),
            &v.map(|b| (*origin + *z * b, 1.0, 1.0)),
        )),
        Surface::Cone {
            origin,
            x,
            y,
            z,
            radius,
            slope,
        } => {
            let at = |b: f64| (*origin + *z * b, radius + slope * b, 1.0);
            Some(turned(u, [*x, *y], &linear(v), &v.map(at)))
        }
        Surface::Sphere { center, x, y, z } => {
            let (axis, poles) = arcs(v);
            let profile: Vec<_> = poles
                .iter()
                .map(|[cos, sin, w]| (*center + *z * (sin / w), cos / w, *w))
                .collect();
            Some(turned(u, [*x, *y], &axis, &profile))
        }
        Surface::Torus {
            center,
            x,
            y,
            z,
            major,
            minor,
        } => {
            let (axis, poles) = arcs(v);
            let profile: Vec<_> = poles
                .iter()
                .map(|[cos, sin, w]| (*center + *z * (minor * sin / w), major + minor * cos / w, *w))
                .collect();
            Some(turned(u, [*x, *y], &axis, &profile))
        }
        Surface::Revolution {
            profile,
            origin,
            axis,
            ..
        } => Some(revolved(&profile.spline(v), *origin, *axis, u)),
        Surface::Extrusion {
            profile, direction, ..
        } => {
            let curve = profile.spline(u);
            let row = |pole: &Pole| {
                let [x, y, z, w] = *pole;
                let moved = |b: f64| DVec3::new(x, y, z) + *direction * (b * w);
                v.map(|b| moved(b).extend(w).to_array()).to_vec()
            };
            Some(SplineSurface {
                poles: curve.poles.iter().map(row).collect(),
                axes: [curve.axis, linear(v)],
            })
        }
        Surface::Ruled { first, second } => {
            let fits = first.axis == second.axis && !first.rational() && !second.rational();
            fits.then(|| SplineSurface {
                axes: [first.axis.clone(), linear([0.0, 1.0])],
                poles: first
                    .poles
                    .iter()
                    .zip(&second.poles)
                    .map(|(a, b)| vec![unit(*a), unit(*b)])
                    .collect(),
            })
            .map(|whole| whole.cut([u, v]))
        }
        Surface::Spline(spline) => Some(part(spline, [u, v])),
        Surface::Offset { .. } => None,
    }
}

/// A pole of a polynomial curve with the weight 1.
fn unit(p: Pole) -> Pole {
    [p[0] / p[3], p[1] / p[3], p[2] / p[3], 1.0]
}

/// A surface of revolution of a profile (point on the axis, radius, weight for each pole) in the frame `x`, `y`.
fn turned(u: [f64; 2], [x, y]: [DVec3; 2], axis: &Axis, profile: &[(DVec3, f64, f64)]) -> SplineSurface {
    let (around, circle) = arcs(u);
    let row = |[cos, sin, w]: &[f64; 3]| {
        let out = x * *cos + y * *sin;
        let pole = |(on_axis, radius, weight): &(DVec3, f64, f64)| {
            lifted(*on_axis, out * (radius * weight), w * weight)
        };
        profile.iter().map(pole).collect::<Vec<_>>()
    };
    SplineSurface {
        poles: circle.iter().map(row).collect(),
        axes: [around, axis.clone()],
    }
}

/// A surface of revolution of a curve.
fn revolved(profile: &SplineCurve, origin: DVec3, axis: DVec3, u: [f64; 2]) -> SplineSurface {
    let (around, circle) = arcs(u);
    let row = |[cos, sin, w]: &[f64; 3]| {
        profile
            .poles
            .iter()
            .map(|pole| {
                let [x, y, z, weight] = *pole;
                let from = DVec3::new(x, y, z) / weight - origin;
                let along = axis * from.dot(axis);
                let (out, side) = (from - along, axis.cross(from));
                let beside = (out * *cos + side * *sin) * weight;
                lifted(origin + along, beside, w * weight)
            })
            .collect::<Vec<_>>()
    };
    SplineSurface {
        poles: circle.iter().map(row).collect(),
        axes: [around, profile.axis.clone()],
    }
}

/// A part of a B-spline surface; it may cross the seam of a closed surface.
fn part(spline: &SplineSurface, [u, v]: [[f64; 2]; 2]) -> SplineSurface {
    let [[u0, u1], [v0, v1]] = spline.domain();
    let across_u = pieces(u, [u0, u1]);
    let across_v = pieces(v, [v0, v1]);
    let mut rows: Option<SplineSurface> = None;
    for (range_u, shift_u) in &across_u {
        let mut row: Option<SplineSurface> = None;
        for (range_v, shift_v) in &across_v {
            let mut piece = spline.cut([*range_u, *range_v]);
            for (axis, shift) in piece.axes.iter_mut().zip([shift_u, shift_v]) {
                axis.knots.iter_mut().for_each(|knot| *knot += shift);
            }
            row = Some(match row {
                Some(before) => transposed(&joined(&transposed(&before), &transposed(&piece))),
                None => piece,
            });
        }
        if let Some(row) = row {
            rows = Some(match rows {
                Some(before) => joined(&before, &row),
                None => row,
            });
        }
    }
    rows.unwrap_or_else(|| spline.clone())
}

/// Splits a range that may exceed the domain into parts within it, each with its shift by periods.
fn pieces(range: [f64; 2], [start, end]: [f64; 2]) -> Vec<([f64; 2], f64)> {
    let period = end - start;
    let mut parts = Vec::new();
    let turns = ((range[0] - start) / period + 1e-12).floor();
    for turn in 0..3 {
        let shift = (turns + f64::from(turn)) * period;
        let part = [(range[0] - shift).max(start), (range[1] - shift).min(end)];
        if part[1] - part[0] > 1e-12 * period {
            parts.push((part, shift));
        }
    }
    parts
}

fn transposed(spline: &SplineSurface) -> SplineSurface {
    let [u, v] = spline.axes.clone();
    SplineSurface {
        axes: [v, u],
        poles: super::spline::transposed(&spline.poles),
    }
}

/// Joins two clamped surfaces in u that share a boundary, which becomes a knot of multiplicity degree (C0).
fn joined(before: &SplineSurface, after: &SplineSurface) -> SplineSurface {
    let degree = before.axes[0].degree;
    let mut knots = before.axes[0].knots[..before.axes[0].knots.len() - 1].to_vec();
    knots.extend_from_slice(&after.axes[0].knots[degree + 1..]);
    let mut poles = before.poles.clone();
    poles.extend_from_slice(&after.poles[1..]);
    SplineSurface {
        axes: [Axis { degree, knots }, before.axes[1].clone()],
        poles,
    }
}

/// Breaks of a curve and the order of continuity at each, which a fit must preserve.
pub(super) fn joints(surface: &Surface, direction: usize, range: [f64; 2]) -> Vec<(f64, usize)> {
    let of = |axis: &Axis, shift: f64| -> Vec<(f64, usize)> {
        let breaks = axis.breaks();
        breaks
            .iter()
            .map(|knot| {
                (
                    *knot + shift,
                    axis.degree.saturating_sub(axis.multiplicity(*knot)),
                )
            })
            .collect()
    };
    let of_curve = |curve: &Curve| match curve {
        Curve::Spline(spline) => of(&spline.axis, 0.0),
        _ => Vec::new(),
    };
    let mut all = match (surface, direction) {
        (Surface::Spline(spline), _) => {
            let axis = &spline.axes[direction];
            let [start, end] = axis.domain();
            // A closed surface is periodic across its seam.
            let mut all = of(axis, 0.0);
            all.extend(of(axis, end - start));
            all.extend(of(axis, start - end));
            all
        }
        (Surface::Extrusion { profile, .. }, 0) | (Surface::Revolution { profile, .. }, 1) => {
            of_curve(profile)
        }
        (Surface::Ruled { first, second }, 0) => [of(&first.axis, 0.0), of(&second.axis, 0.0)].concat(),
        (Surface::Offset { base, .. }, _) => joints(base, direction, range)
            .into_iter()
            .map(|(t, order)| (t, order.saturating_sub(1)))
            .collect(),
        _ => Vec::new(),
    };
    let slack = JOINT_SLACK * (range[1] - range[0]);
    all.retain(|(t, _)| *t > range[0] + slack && *t < range[1] - slack);
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.dedup_by(|b, a| {
        let one = b.0 - a.0 <= slack;
        if one {
            a.1 = a.1.min(b.1);
        }
        one
    });
    all
}
