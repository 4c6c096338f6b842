//! A grid of cells over the surface that resolves the features of a cubic surface between two knots.

use rayon::prelude::*;

use glam::DVec3;
use job::Along;
use oracle::{Derivatives, Oracle};

/// Least number of cells per side of a span: a cubic has no feature narrower than a twelfth of its span.
const SPAN_CELLS: usize = 12;
/// Largest side of a cell, as a share of the ball's radius.
const CELL_SHARE: f64 = 1.0 / 24.0;
/// Number of lines on which a span's length is measured.
const LENGTH_LINES: usize = 5;
/// Largest number of cells of the grid: larger cells are split later where needed.
const CELLS_MAX: usize = 400_000;
/// `|S_u x S_v|` below this share of `|S_u| |S_v|` counts as degenerate: the core's threshold.
const SINE_MIN: f64 = 1e-3;
/// A first derivative shorter than this share of the other one (each times its range) is too close to a pole: the curvature would
/// be a quotient of rounding errors.
const POLE_SHARE: f64 = 1e-5;

/// Curvature at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LocalCurvature {
    /// Least and largest principal curvature towards the tool, 1/mm.
    pub(crate) principal: [f64; 2],
    /// Upper bound of the change of u, and of v, per millimetre on the surface.
    pub(crate) per_mm: [f64; 2],
}

/// Tool normal and curvature; `None` where the derivatives do not span a plane, and close to a pole.
pub(crate) fn local_curvature(at: &Derivatives, oracle: &Oracle) -> Option<(DVec3, LocalCurvature)> {
    let (speed_u, speed_v) = (at.u.length(), at.v.length());
    let [[u0, u1], [v0, v1]] = oracle.surface.domain();
    let reach = (speed_u * (u1 - u0), speed_v * (v1 - v0));
    if reach.0.min(reach.1) <= POLE_SHARE * reach.0.max(reach.1) {
        return None;
    }
    let product = at.u.cross(at.v);
    let area = product.length();
    if area.is_nan() || area <= SINE_MIN * speed_u * speed_v || area <= 0.0 {
        return None;
    }
    let normal = product * (oracle.normal_sign / area);
    let curvature = LocalCurvature {
        principal: at.principal_curvatures(normal),
        per_mm: [speed_v / area, speed_u / area],
    };
    Some((normal, curvature))
}

/// The grid: cell edges along u and v, and the curvature at each cell's centre.
#[derive(Debug)]
pub(crate) struct CellGrid {
    pub(crate) edges: [Vec<f64>; 2],
    /// v fastest; `None` in degenerate cells.
    pub(crate) curvatures: Vec<Option<LocalCurvature>>,
}

/// Part of the surface between two values of each parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell {
    pub(crate) u: [f64; 2],
    pub(crate) v: [f64; 2],
}

impl Cell {
    pub(crate) fn middle(&self) -> (f64, f64) {
        (0.5 * (self.u[0] + self.u[1]), 0.5 * (self.v[0] + self.v[1]))
    }

    /// The four quarters of the cell.
    pub(crate) fn quarters(&self) -> [Self; 4] {
        let (u, v) = self.middle();
        let (us, vs) = ([[self.u[0], u], [u, self.u[1]]], [[self.v[0], v], [v, self.v[1]]]);
        std::array::from_fn(|k| Self {
            u: us[k / 2],
            v: vs[k % 2],
        })
    }
}

impl CellGrid {
    pub(crate) fn new(oracle: &Oracle) -> Self {
        let spans = [Along::U, Along::V].map(|along| span_lengths(oracle, along));
        let cells = |share: f64| {
            spans.each_ref().map(|lengths| {
                let count =
                    |length: &f64| ((length / (share * oracle.radius_mm)).ceil() as usize).max(SPAN_CELLS);
                lengths.iter().map(count).collect::<Vec<usize>>()
            })
        };
        let mut share = CELL_SHARE;
        let mut counts = cells(share);
        // Doubling the cells divides their number by four; ends at the least number of cells per span.
        for _ in 0..32 {
            let total: usize = counts.iter().map(|counts| counts.iter().sum::<usize>()).product();
            if total <= CELLS_MAX {
                break;
            }
            share *= 1.5;
            counts = cells(share);
        }
        let edges = [(Along::U, &counts[0]), (Along::V, &counts[1])].map(|(along, counts)| {
            let breaks = oracle.surface.breaks(along);
            let mut edges = vec![breaks[0]];
            for (span, count) in breaks.windows(2).zip(counts) {
                edges.extend((1..*count).map(|k| {
                    #[allow(clippy::cast_precision_loss, reason = "small")]
                    let share = k as f64 / *count as f64;
                    span[0] + (span[1] - span[0]) * share
                }));
                edges.push(span[1]);
            }
            edges
        });
        let mut grid = Self {
            edges,
            curvatures: Vec::new(),
        };
        grid.curvatures = (0..grid.count())
            .into_par_iter()
            .map(|index| {
                let (u, v) = grid.cell(index).middle();
                local_curvature(&oracle.surface.at(u, v), oracle).map(|(_, curvature)| curvature)
            })
            .collect();
        grid
    }

    /// Cells along u and along v.
    pub(crate) fn shape(&self) -> [usize; 2] {
        self.edges.each_ref().map(|edges| edges.len() - 1)
    }

    pub(crate) fn count(&self) -> usize {
        let [rows, columns] = self.shape();
        rows * columns
    }

    pub(crate) fn cell(&self, index: usize) -> Cell {
        let columns = self.shape()[1];
        let (i, j) = (index / columns, index % columns);
        Cell {
            u: [self.edges[0][i], self.edges[0][i + 1]],
            v: [self.edges[1][j], self.edges[1][j + 1]],
        }
    }

    /// Least and largest principal curvature in the cells that intersect a range of parameters; evaluates at most `looks` cells per side,
    /// evenly spread.
    pub(crate) fn principal(&self, ranges: [[f64; 2]; 2], looks: usize) -> [f64; 2] {
        let columns = self.shape()[1];
        let [(i0, i1, i_step), (j0, j1, j_step)] = [0, 1].map(|axis: usize| {
            let edges = &self.edges[axis];
            let last = edges.len() - 2;
            let index = |at: f64| edges.partition_point(|edge| *edge <= at).clamp(1, last + 1) - 1;
            let (first, end) = (index(ranges[axis][0]), index(ranges[axis][1]));
            (first, end, ((end - first) / looks).max(1))
        });
        let mut found = [f64::INFINITY, f64::NEG_INFINITY];
        for i in (i0..=i1).step_by(i_step) {
            for j in (j0..=j1).step_by(j_step) {
                if let Some(curvature) = &self.curvatures[i * columns + j] {
                    found = [
                        found[0].min(curvature.principal[0]),
                        found[1].max(curvature.principal[1]),
                    ];
                }
            }
        }
        found
    }
}

/// Length of each span along one parameter, mm: the longest of several lines.
fn span_lengths(oracle: &Oracle, along: Along) -> Vec<f64> {
    let breaks = oracle.surface.breaks(along);
    let [[u0, u1], [v0, v1]] = oracle.surface.domain();
    let across = match along {
        Along::U => [v0, v1],
        Along::V => [u0, u1],
    };
    #[allow(clippy::cast_precision_loss, reason = "small")]
    let part = |[low, high]: [f64; 2], k: usize, of: usize| low + (high - low) * k as f64 / of as f64;
    let length_on = |span: [f64; 2], line: f64| -> f64 {
        let point = |t: f64| match along {
            Along::U => oracle.surface.at(t, line).point,
            Along::V => oracle.surface.at(line, t).point,
        };
        (0..SPAN_CELLS)
            .map(|k| {
                let ends = [k, k + 1].map(|k| point(part(span, k, SPAN_CELLS)));
                ends[1].distance(ends[0])
            })
            .sum()
    };
    breaks
        .windows(2)
        .map(|span| {
            (0..=LENGTH_LINES)
                .map(|k| length_on([span[0], span[1]], part(across, k, LENGTH_LINES)))
                .fold(0.0, f64::max)
        })
        .collect()
}
