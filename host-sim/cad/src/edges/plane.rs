//! A face of a plane between four sides: the Coons patch, in homogeneous coordinates, so that arcs stay arcs. Every place of it is a combination of places of the sides, in the plane.

use glam::DVec3;

use super::sides::{Sides, four};
use super::{is_regular, sides};
use crate::Edge;
use crate::spline::{Axis, Pole, SplineCurve, SplineSurface, transposed};
use crate::surface::Surface;

/// Distance of a B-spline's poles from the plane that it is, mm.
const FLAT_MM: f64 = 1e-7;

/// A plane.
pub(super) struct Plane {
    pub(super) origin: DVec3,
    /// Unit, along `S_u x S_v`.
    pub(super) normal: DVec3,
}

/// The plane that a surface is.
pub(super) fn of(surface: &Surface) -> Option<Plane> {
    match surface {
        Surface::Plane { origin, x, y } => Some(Plane {
            origin: *origin,
            normal: x.cross(*y).normalize(),
        }),
        Surface::Spline(spline) => {
            let [[u0, u1], [v0, v1]] = spline.domain();
            let at = spline.at(0.5 * (u0 + u1), 0.5 * (v0 + v1));
            let plane = Plane {
                origin: at.point,
                normal: at.u.cross(at.v).normalize(),
            };
            let is_on = |pole: &Pole| {
                let [x, y, z, w] = *pole;
                ((DVec3::new(x, y, z) / w - plane.origin).dot(plane.normal)).abs() <= FLAT_MM
            };
            spline.poles.iter().flatten().all(is_on).then_some(plane)
        }
        _ => None,
    }
}

impl Plane {
    /// The patch between the four sides of a face.
    pub(super) fn between(&self, loops: &[Vec<Edge>]) -> Option<SplineSurface> {
        let [edges] = loops else {
            return None;
        };
        let Sides { curves, corners } = four(edges, self)?;
        let [bottom, right, top, left] = curves;
        let [bottom, top] = sides::compatible([bottom, top.reversed()]);
        let [left, right] = sides::compatible([left.reversed(), right]);
        let patch = coons([&bottom, &top], [&left, &right], corners);
        let domain = patch.domain().map(|[low, high]| 0.5 * (low + high));
        let at = patch.at(domain[0], domain[1]);
        let patch = if at.u.cross(at.v).dot(self.normal) > 0.0 {
            patch
        } else {
            let [u, v] = patch.axes;
            SplineSurface {
                axes: [v, u],
                poles: transposed(&patch.poles),
            }
        };
        is_regular(&patch).then_some(patch)
    }

    /// The nearest point of the plane.
    pub(super) fn nearest(&self, point: DVec3) -> DVec3 {
        point - self.normal * (point - self.origin).dot(self.normal)
    }
}

/// Averages of knots at which the poles of the function `t` are (Greville abscissae).
fn averages(axis: &Axis) -> Vec<f64> {
    let mean = |k: usize| axis.knots[k + 1..=k + axis.degree].iter().sum::<f64>() / axis.degree as f64;
    (0..axis.poles()).map(mean).collect()
}

/// Ruled between `along` (at v = 0, 1), and between `across` (at u = 0, 1), less what both have: the bilinear patch of the corners (0, 0), (1, 0), (1, 1), (0, 1).
fn coons(along: [&SplineCurve; 2], across: [&SplineCurve; 2], corners: [DVec3; 4]) -> SplineSurface {
    let [us, vs] = [along[0], across[0]].map(|curve| averages(&curve.axis));
    let corners = corners.map(|corner| corner.extend(1.0).to_array());
    let pole = |i: usize, j: usize| -> Pole {
        let (u, v) = (us[i], vs[j]);
        std::array::from_fn(|k| {
            let of_along = (1.0 - v) * along[0].poles[i][k] + v * along[1].poles[i][k];
            let of_across = (1.0 - u) * across[0].poles[j][k] + u * across[1].poles[j][k];
            let [a, b, c, d] = corners.map(|corner| corner[k]);
            let of_both = (1.0 - v) * ((1.0 - u) * a + u * b) + v * ((1.0 - u) * d + u * c);
            of_along + of_across - of_both
        })
    };
    SplineSurface {
        axes: [along[0].axis.clone(), across[0].axis.clone()],
        poles: (0..us.len())
            .map(|i| (0..vs.len()).map(|j| pole(i, j)).collect())
            .collect(),
    }
}
