//! Checks of the surface itself: tightest concave radius, poles and points without a normal.

use rayon::prelude::*;

use super::grid::{CellGrid, local_curvature};
use glam::DVec3;
use oracle::Oracle;

/// Bisections of the step around the cell with the largest curvature.
const REFINEMENTS: usize = 40;
/// Curvatures below this count as flat, 1/mm: concave radii above one kilometre.
const FLAT: f64 = 1e-6;
/// Points evaluated on each boundary.
const BOUNDARY_POINTS: usize = 64;
/// A boundary whose points all coincide within this distance is a pole, mm: the threshold of the core's data.
const POINT_MM: f64 = 1e-9;

/// The tightest concave radius of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConcaveRadius {
    /// Radius of curvature towards the tool, mm: the least of all directions.
    pub radius_mm: f64,
    /// Parameter u.
    pub u: f64,
    /// Parameter v.
    pub v: f64,
    /// Point, mm.
    pub point_mm: DVec3,
}

/// Properties of the surface that limit the ball.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceCheck {
    /// The tightest concave radius; `None` where the surface is nowhere concave towards the tool.
    pub concave_radius: Option<ConcaveRadius>,
    /// Boundaries that degenerate to a point, e.g. `u = 0`.
    pub poles: Vec<String>,
    /// Other points (u, v) where S_u and S_v span no plane: their number among those evaluated, and the first.
    pub degenerate: Option<(usize, [f64; 2])>,
}

impl SurfaceCheck {
    pub(super) fn new(oracle: &Oracle, grid: &CellGrid) -> Self {
        let mut degenerate: Vec<[f64; 2]> = (0..grid.count())
            .filter(|index| grid.curvatures[*index].is_none())
            .map(|index| grid.cell(index).middle().into())
            .filter(|[u, v]: &[f64; 2]| oracle.is_in_region(*u, *v))
            .collect();
        let mut poles = Vec::new();
        for (name, line) in boundaries(oracle) {
            let places: Vec<DVec3> = line
                .iter()
                .map(|[u, v]| oracle.surface.at(*u, *v).point)
                .collect();
            if places.iter().all(|place| place.distance(places[0]) <= POINT_MM) {
                poles.push(name);
            } else {
                // The ends may be at a pole of another boundary.
                let inside = &line[1..line.len() - 1];
                let spans =
                    |[u, v]: &&[f64; 2]| local_curvature(&oracle.surface.at(*u, *v), oracle).is_none();
                let is_inside = |[u, v]: &&[f64; 2]| oracle.is_in_region(*u, *v);
                degenerate.extend(inside.iter().filter(spans).filter(is_inside));
            }
        }
        Self {
            concave_radius: concave_radius(oracle, grid),
            poles,
            degenerate: degenerate.first().map(|first| (degenerate.len(), *first)),
        }
    }
}

/// The four boundaries: name, and points on each.
fn boundaries(oracle: &Oracle) -> Vec<(String, Vec<[f64; 2]>)> {
    let [[u0, u1], [v0, v1]] = oracle.surface.domain();
    #[allow(clippy::cast_precision_loss, reason = "small")]
    let part = |low: f64, high: f64, k: usize| low + (high - low) * k as f64 / BOUNDARY_POINTS as f64;
    let looks = 0..=BOUNDARY_POINTS;
    let of_u = |u: f64| {
        (
            format!("u = {u}"),
            looks.clone().map(|k| [u, part(v0, v1, k)]).collect(),
        )
    };
    let of_v = |v: f64| {
        (
            format!("v = {v}"),
            looks.clone().map(|k| [part(u0, u1, k), v]).collect(),
        )
    };
    vec![of_u(u0), of_u(u1), of_v(v0), of_v(v1)]
}

/// The tightest concave radius: the cell with the largest curvature, then a pattern search with bisected steps.
fn concave_radius(oracle: &Oracle, grid: &CellGrid) -> Option<ConcaveRadius> {
    let curvature = |u: f64, v: f64| {
        if !oracle.is_in_region(u, v) {
            return f64::NEG_INFINITY;
        }
        local_curvature(&oracle.surface.at(u, v), oracle)
            .map_or(f64::NEG_INFINITY, |(_, curvature)| curvature.principal[1])
    };
    // Corners as well as cell centres: the largest curvature is often on a boundary.
    let (index, _) = (0..grid.count())
        .into_par_iter()
        .map(|index| {
            let cell = grid.cell(index);
            let corners = cell.u.into_iter().flat_map(|u| cell.v.map(|v| curvature(u, v)));
            let (u, v) = cell.middle();
            let inside = grid.curvatures[index].filter(|_| oracle.is_in_region(u, v));
            let middle = inside.map_or(f64::NEG_INFINITY, |curvature| curvature.principal[1]);
            (index, corners.fold(middle, f64::max))
        })
        .reduce(
            || (usize::MAX, f64::NEG_INFINITY),
            |a, b| {
                if b.1 > a.1 || (b.1 == a.1 && b.0 < a.0) {
                    b
                } else {
                    a
                }
            },
        );
    if index >= grid.count() {
        return None;
    }
    let cell = grid.cell(index);
    let [[u0, u1], [v0, v1]] = oracle.surface.domain();
    let (mut u, mut v) = cell.middle();
    let (mut step_u, mut step_v) = (0.5 * (cell.u[1] - cell.u[0]), 0.5 * (cell.v[1] - cell.v[0]));
    let mut most = curvature(u, v);
    for _ in 0..REFINEMENTS {
        let around = [-1.0, 0.0, 1.0].map(|i| [-1.0, 0.0, 1.0].map(|j| (i, j)));
        let (at_u, at_v) = (u, v);
        for (i, j) in around.into_iter().flatten() {
            let (next_u, next_v) = (
                (at_u + i * step_u).clamp(u0, u1),
                (at_v + j * step_v).clamp(v0, v1),
            );
            let there = curvature(next_u, next_v);
            if there > most {
                (u, v, most) = (next_u, next_v, there);
            }
        }
        if (u, v) == (at_u, at_v) {
            step_u *= 0.5;
            step_v *= 0.5;
        }
    }
    (most > FLAT).then(|| ConcaveRadius {
        radius_mm: 1.0 / most,
        u,
        v,
        point_mm: oracle.surface.at(u, v).point,
    })
}
