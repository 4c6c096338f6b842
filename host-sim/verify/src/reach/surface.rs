//! The surface as an obstacle.

use glam::DVec3;
use oracle::Oracle;
use rayon::prelude::*;

use super::search::{Obstacle, Spot};
use crate::swept::grid::{Cell, CellGrid, local_curvature};

/// Cells per side of a block, with which the search begins.
const BLOCK: usize = 8;
/// Cells per side evaluated for the curvature around a cell.
const CELLS_PER_SIDE: usize = 4;

/// The surface in cells, which are evaluated once.
pub(super) struct SurfaceObstacle<'a> {
    oracle: &'a Oracle,
    grid: CellGrid,
    /// Middle, extent and normal of each cell of the grid.
    spots: Vec<Spot>,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum SurfaceCell {
    /// Cells of the grid: first along u and v, and number.
    Block([usize; 2], [usize; 2]),
    /// A cell of the grid, by its index.
    Whole(usize),
    /// A part of one.
    Part(Cell),
}

impl<'a> SurfaceObstacle<'a> {
    pub(super) fn new(oracle: &'a Oracle) -> Self {
        let grid = CellGrid::new(oracle);
        let columns = grid.edges[1].len();
        let nodes: Vec<DVec3> = (0..grid.edges[0].len() * columns)
            .into_par_iter()
            .map(|index| {
                let (u, v) = (grid.edges[0][index / columns], grid.edges[1][index % columns]);
                oracle.surface.at(u, v).point
            })
            .collect();
        let spots = (0..grid.count())
            .into_par_iter()
            .map(|index| {
                let (row, column) = (index / (columns - 1), index % (columns - 1));
                let first = row * columns + column;
                let corners = [first, first + 1, first + columns, first + columns + 1];
                spot(
                    oracle,
                    &grid,
                    grid.cell(index),
                    corners.map(|corner| nodes[corner]),
                )
            })
            .collect();
        Self { oracle, grid, spots }
    }

    /// Parameters of a cell's middle.
    pub(super) fn parameters(&self, cell: &SurfaceCell) -> [f64; 2] {
        let (u, v) = match cell {
            SurfaceCell::Block(first, _) => self.grid.cell(self.index(*first)).middle(),
            SurfaceCell::Whole(index) => self.grid.cell(*index).middle(),
            SurfaceCell::Part(cell) => cell.middle(),
        };
        [u, v]
    }

    fn index(&self, [row, column]: [usize; 2]) -> usize {
        row * self.grid.shape()[1] + column
    }

    fn indices(&self, first: [usize; 2], count: [usize; 2]) -> impl Iterator<Item = usize> + '_ {
        (0..count[0] * count[1]).map(move |k| self.index([first[0] + k / count[1], first[1] + k % count[1]]))
    }
}

/// A cell's middle and extent; `corners`: its corners, mm.
fn spot(oracle: &Oracle, grid: &CellGrid, cell: Cell, corners: [DVec3; 4]) -> Spot {
    let (u, v) = cell.middle();
    let at = oracle.surface.at(u, v);
    let around_mm = corners
        .into_iter()
        .map(|corner| corner.distance(at.point))
        .fold(0.0, f64::max);
    let own = local_curvature(&at, oracle);
    let [low, high] = grid.principal([cell.u, cell.v], CELLS_PER_SIDE);
    let around = low.abs().max(high.abs());
    let curvature = own.as_ref().map_or(0.0, |(_, own)| {
        let [low, high] = own.principal;
        low.abs().max(high.abs())
    });
    Spot {
        place: at.point,
        up_to: at.point.z,
        around_mm,
        normal: own.map(|(normal, _)| normal),
        curvature: if around.is_finite() {
            curvature.max(around)
        } else {
            curvature
        },
        counts: true,
    }
}

impl Obstacle for SurfaceObstacle<'_> {
    type Cell = SurfaceCell;

    fn start(&self) -> Vec<SurfaceCell> {
        let [rows, columns] = self.grid.shape();
        let count = |first: usize, of: usize| BLOCK.min(of - first);
        (0..rows)
            .step_by(BLOCK)
            .flat_map(|row| (0..columns).step_by(BLOCK).map(move |column| [row, column]))
            .map(|first| SurfaceCell::Block(first, [count(first[0], rows), count(first[1], columns)]))
            .collect()
    }

    fn spot(&self, cell: &SurfaceCell) -> Option<Spot> {
        Some(match cell {
            SurfaceCell::Whole(index) => self.spots[*index],
            SurfaceCell::Block(first, count) => {
                let middle = self.spots[self.index([first[0] + count[0] / 2, first[1] + count[1] / 2])];
                let around_mm = self
                    .indices(*first, *count)
                    .map(|index| &self.spots[index])
                    .map(|spot| spot.place.distance(middle.place) + spot.around_mm)
                    .fold(0.0, f64::max);
                Spot {
                    around_mm,
                    normal: None,
                    ..middle
                }
            }
            SurfaceCell::Part(cell) => {
                let corner = |u: usize, v: usize| self.oracle.surface.at(cell.u[u], cell.v[v]).point;
                let corners = [corner(0, 0), corner(0, 1), corner(1, 0), corner(1, 1)];
                spot(self.oracle, &self.grid, *cell, corners)
            }
        })
    }

    fn split(&self, cell: &SurfaceCell, into: &mut Vec<SurfaceCell>) {
        match cell {
            SurfaceCell::Block(first, count) => {
                into.extend(self.indices(*first, *count).map(SurfaceCell::Whole));
            }
            SurfaceCell::Whole(index) => {
                into.extend(self.grid.cell(*index).quarters().map(SurfaceCell::Part));
            }
            SurfaceCell::Part(cell) => into.extend(cell.quarters().map(SurfaceCell::Part)),
        }
    }
}
