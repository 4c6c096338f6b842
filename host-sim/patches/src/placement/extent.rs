//! The bounding box of a surface along x, y and z, by branch and bound.

use interp_core::encode::{Bicubic, substitute};

use job::SurfaceSpec;

use crate::pieces::Source;

/// Tolerance of the bounding box, mm: 1 nm, the core's resolution.
pub const EXTENT_TOLERANCE_MM: f64 = 1e-6;
/// Largest number of cells evaluated for one side of the box; the box is then used as it is. A side that touches along a whole
/// ridge takes about ten thousand.
const CELLS_MAX: usize = 100_000;
/// Rounding of a coordinate, as a share of the largest coefficient: the search stops below it.
const ROUNDING: f64 = 1e-14;

/// A rational patch of one coordinate, numerator and weight, over parameters from -1/2 to 1/2.
type CoordinatePatch = (Bicubic, Bicubic);

/// Minimum and maximum of x, y and z of a surface, mm, within [`EXTENT_TOLERANCE_MM`].
#[must_use]
pub fn extent_mm(surface: &SurfaceSpec) -> [[f64; 2]; 3] {
    let spline;
    let surface = match surface {
        SurfaceSpec::Revolved {
            radius_mm,
            height_mm,
            u,
            v_rad,
        } => {
            spline = SurfaceSpec::Nurbs(super::arcs::revolved(radius_mm, height_mm, *u, *v_rad));
            &spline
        }
        other => other,
    };
    let source = Source::new(surface);
    let [us, vs] = source.breaks();
    let mut pieces = Vec::new();
    for u in us.windows(2) {
        for v in vs.windows(2) {
            pieces.push(source.piece([u[0], u[1]], [v[0], v[1]]));
        }
    }
    std::array::from_fn(|axis| {
        let of_sign = |sign: f64| {
            let cells = pieces
                .iter()
                .map(|piece| (piece[axis].map(|row| row.map(|c| sign * c)), piece[3]));
            most(cells.collect())
        };
        [-of_sign(-1.0), of_sign(1.0)]
    })
}

fn value(c: &Bicubic, u: f64, v: f64) -> f64 {
    let cubic = |[c0, c1, c2, c3]: [f64; 4], t: f64| c0 + t * (c1 + t * (c2 + t * c3));
    cubic(c.map(|row| cubic(row, v)), u)
}

/// The greatest value at the cell's corners and middle.
fn probe((numerator, weight): &CoordinatePatch) -> f64 {
    [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5), (0.0, 0.0)]
        .into_iter()
        .map(|(u, v)| value(numerator, u, v) / value(weight, u, v))
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Whether no value in the cell exceeds `bound`: `numerator - bound weight` is at most 0, by its Bernstein coefficients.
fn below((numerator, weight): &CoordinatePatch, bound: f64) -> bool {
    let mut most = 0.0;
    for (i, (row, weights)) in numerator.iter().zip(weight).enumerate() {
        for (j, (c, w)) in row.iter().zip(weights).enumerate() {
            let c = c - bound * w;
            most += match i + j {
                0 => c,
                power => c.abs() * [1.0, 0.5, 0.25, 0.125, 0.0625, 0.031_25, 0.015_625][power],
            };
        }
    }
    most <= 0.0
}

/// The greatest value over all cells, to [`EXTENT_TOLERANCE_MM`].
fn most(cells: Vec<CoordinatePatch>) -> f64 {
    let largest = cells
        .iter()
        .flat_map(|(numerator, _)| numerator.iter().flatten())
        .fold(0.0_f64, |largest, c| largest.max(c.abs()));
    let tolerance = EXTENT_TOLERANCE_MM.max(ROUNDING * largest);
    let mut best = cells.iter().map(probe).fold(f64::NEG_INFINITY, f64::max);
    let mut open = std::collections::VecDeque::from(cells);
    for _ in 0..CELLS_MAX {
        let Some(cell) = open.pop_front() else { break };
        if below(&cell, best + tolerance) {
            continue;
        }
        for u in [[-0.5, 0.0], [0.0, 0.5]] {
            for v in [[-0.5, 0.0], [0.0, 0.5]] {
                let part = (substitute(&cell.0, u, v), substitute(&cell.1, u, v));
                best = best.max(probe(&part));
                open.push_back(part);
            }
        }
    }
    best
}
