//! Gouge: where a ball at any position of its path is below the surface.
//!
//! The depth at a surface point P is r - d, with d the distance of P from the path of the centre. The largest depth is found by branch and
//! bound: a cell is closed when its bound (see `PathTree::depth`) is below the largest depth found, or below the least depth of a gouge.
//!
//! At its own contact a ball touches the surface, so its depth is 0 there, and no bound falls below 0. Contacts near
//! a cell are therefore excluded from its bound where the ball fits the curvature in the neighbourhood: with a = 1 - r k, k the largest
//! curvature there, a ball with its contact at distance x stays `a x^2 / (2 r)` above the point. (The contacts themselves are
//! checked sample by sample: `oracle/verify.rs`.) The depth at the cells' centres includes these balls.

use rayon::prelude::*;

use super::grid::{Cell, CellGrid, LocalCurvature, local_curvature};
use super::height::Ray;
use super::tree::{BallDepth, DepthQuery, PathTree, SampleIndex};
use glam::DVec3;
use job::Along;
use oracle::{Oracle, OracleError};

/// Largest number of splits of a cell.
const SPLITS_MAX: usize = 14;
/// Largest number of cells evaluated: a number for any surface, more for one that is large beside the ball, whose cells are a share of its radius.
const CELLS_MAX: usize = 3_000_000;
const CELLS_PER_SQUARE_RADIUS: f64 = 600.0;
const CELLS_CAP: usize = 24_000_000;
/// Largest number of cells evaluated together, which bounds the memory.
const BATCH_CELLS: usize = 1_500_000;
/// Relative tolerance of the deepest gouge.
const DEPTH_SHARE: f64 = 1e-3;
/// Margin on the window that the curvature requires (see `reach`).
const WINDOW_MARGIN: f64 = 1.15;
/// For a below this no contact is excluded: the ball hardly fits, or not at all.
const FIT_MARGIN_MIN: f64 = 0.02;
/// Largest number of enlargements of a window.
const WINDOW_STEPS_MAX: usize = 8;
/// Empty ranges.
const EMPTY: [[f64; 2]; 2] = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
/// Cells per side evaluated for the curvature around a cell.
const CELLS_PER_SIDE: usize = 12;

/// The deepest point found.
#[derive(Clone, Copy, Debug)]
pub(super) struct DeepestPoint {
    pub(super) depth_mm: f64,
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) point_mm: DVec3,
    pub(super) by: SampleIndex,
}

/// Result of the search.
#[derive(Clone, Copy, Debug)]
pub(super) struct GougeSearchResult {
    pub(super) deepest: Option<DeepestPoint>,
    /// Upper bound of the depth at every point, mm.
    pub(super) bound_mm: f64,
    pub(super) cells: usize,
    /// Whether the search ended because it had evaluated its largest number of cells.
    pub(super) exhausted: bool,
}

/// Cells that are evaluated together.
struct Batch {
    cells: Vec<Cell>,
    splits: usize,
    /// Bound of the cells that they are parts of, mm.
    bound_mm: f64,
}

pub(super) struct GougeSearch<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) tree: &'a PathTree<'a>,
    pub(super) grid: &'a CellGrid,
    /// Least depth that counts as a gouge, mm.
    pub(super) floor_mm: f64,
}

/// Takes the batch with the largest bound.
fn take_highest(batches: &mut Vec<Batch>) -> Option<Batch> {
    let highest = (0..batches.len()).max_by(|a, b| batches[*a].bound_mm.total_cmp(&batches[*b].bound_mm))?;
    Some(batches.swap_remove(highest))
}

#[derive(Clone, Copy, Debug)]
struct CellDepth {
    cell: Cell,
    depth: BallDepth,
    point_mm: DVec3,
}

impl GougeSearch<'_> {
    /// Searches the deepest gouge; `done` is called with the number of cells evaluated.
    pub(super) fn search(&self, done: &(dyn Fn(u64) + Sync)) -> GougeSearchResult {
        let mut found = GougeSearchResult {
            deepest: None,
            bound_mm: self.floor_mm,
            cells: 0,
            exhausted: false,
        };
        let budget = self.budget();
        let mut batches = vec![Batch {
            cells: (0..self.grid.count()).map(|k| self.grid.cell(k)).collect(),
            splits: 0,
            bound_mm: self.oracle.radius_mm,
        }];
        while let Some(batch) = take_highest(&mut batches) {
            // If the budget does not suffice for all cells, those with the largest bounds have been split; the bound of the others is reported.
            if found.cells + batch.cells.len() > budget {
                found.exhausted = true;
                found.bound_mm = found.bound_mm.max(batch.bound_mm);
                continue;
            }
            found.cells += batch.cells.len();
            let mut open = self.evaluate_batch(&batch, &mut found, done);
            open.sort_by(|a, b| a.depth.bound_mm.total_cmp(&b.depth.bound_mm));
            if batch.splits == SPLITS_MAX {
                let most = open.last().map_or(0.0, |cell| cell.depth.bound_mm);
                found.bound_mm = found.bound_mm.max(most);
                continue;
            }
            batches.extend(
                open.chunks(self.batch_cells(budget - found.cells))
                    .map(|open| Batch {
                        cells: open.iter().flat_map(|cell| cell.cell.quarters()).collect(),
                        splits: batch.splits + 1,
                        bound_mm: open.last().map_or(0.0, |cell| cell.depth.bound_mm),
                    }),
            );
        }
        let depth_mm = found.deepest.map_or(0.0, |deepest| deepest.depth_mm);
        found.bound_mm = found.bound_mm.max(self.closing_bound(depth_mm));
        found
    }

    /// Number of open cells whose quarters make a batch: small enough for what is left of the budget.
    fn batch_cells(&self, left: usize) -> usize {
        (BATCH_CELLS.min(left / 8) / 4).max(1)
    }

    /// Largest number of cells evaluated.
    fn budget(&self) -> usize {
        let area = |index: usize| {
            let cell = self.grid.cell(index);
            let (u, v) = cell.middle();
            let at = self.oracle.surface.at(u, v);
            at.u.cross(at.v).length() * (cell.u[1] - cell.u[0]) * (cell.v[1] - cell.v[0])
        };
        let area_mm2: f64 = (0..self.grid.count()).map(area).sum();
        let radius = self.oracle.radius_mm;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let by_area = (CELLS_PER_SQUARE_RADIUS * area_mm2 / (radius * radius)) as usize;
        by_area.clamp(CELLS_MAX, CELLS_CAP)
    }

    /// Evaluates the cells of a batch, updates the deepest place, and returns the cells that have to be split.
    fn evaluate_batch(
        &self,
        batch: &Batch,
        found: &mut GougeSearchResult,
        done: &(dyn Fn(u64) + Sync),
    ) -> Vec<CellDepth> {
        let depth_mm = found.deepest.map_or(0.0, |deepest| deepest.depth_mm);
        let evaluated: Vec<CellDepth> = batch
            .cells
            .par_iter()
            .filter_map(|cell| {
                done(1);
                self.evaluate(*cell, self.closing_bound(depth_mm)).ok()
            })
            .collect();
        for cell_depth in &evaluated {
            let least = found.deepest.map_or(self.floor_mm, |deepest| deepest.depth_mm);
            if let Some(by) = cell_depth.depth.by
                && cell_depth.depth.depth_mm > least
            {
                let (u, v) = cell_depth.cell.middle();
                found.deepest = Some(DeepestPoint {
                    depth_mm: cell_depth.depth.depth_mm,
                    u,
                    v,
                    point_mm: cell_depth.point_mm,
                    by,
                });
            }
        }
        let closing_bound = self.closing_bound(found.deepest.map_or(0.0, |deepest| deepest.depth_mm));
        let mut open = evaluated;
        open.retain(|cell| cell.depth.bound_mm > closing_bound);
        open
    }

    /// Bound below which a cell is not split.
    fn closing_bound(&self, found_mm: f64) -> f64 {
        self.floor_mm.max(found_mm * (1.0 + DEPTH_SHARE))
    }

    fn evaluate(&self, cell: Cell, floor_mm: f64) -> Result<CellDepth, OracleError> {
        let oracle = self.oracle;
        let (u, v) = cell.middle();
        let at = oracle.surface.at(u, v);
        let around_mm = cell
            .u
            .into_iter()
            .flat_map(|u| cell.v.map(|v| oracle.surface.at(u, v).point.distance(at.point)))
            .fold(0.0, f64::max);
        let (ray, reach) = match local_curvature(&at, oracle) {
            Some((along, curvature)) => {
                let ray = Ray {
                    from: at.point,
                    along,
                };
                (ray, self.reach(cell, around_mm, &curvature, floor_mm))
            }
            None => {
                let ray = Ray {
                    from: at.point,
                    along: oracle.contact(u, v)?.normal,
                };
                let [low, high] = self.grid.principal([cell.u, cell.v], CELLS_PER_SIDE);
                let curvature = low.abs().max(high.abs());
                let reach = DepthQuery {
                    around_mm,
                    curvature: if curvature.is_finite() { curvature } else { 0.0 },
                    floor_mm,
                    gouge_mm: self.floor_mm,
                    excluded: EMPTY,
                };
                (ray, reach)
            }
        };
        Ok(CellDepth {
            cell,
            depth: self.tree.depth(&ray, &reach),
            point_mm: at.point,
        })
    }

    /// The radius that a cell's bound must cover, and the contacts that it may exclude.
    ///
    /// With b the largest curvature magnitude and R the cell's half-diagonal, the bound of a contact at distance x is
    /// `-a x^2 / (2 r) + R a x / r + R^2 b / 2`: not above 0 from `x = R (1 + sqrt(1 + r b / a))` on.
    fn reach(&self, cell: Cell, around_mm: f64, own: &LocalCurvature, floor_mm: f64) -> DepthQuery {
        let radius = self.oracle.radius_mm;
        let (u, v) = cell.middle();
        let mut principal = own.principal;
        let mut excluded = EMPTY;
        // The window depends on the curvature inside it: both are enlarged until they are consistent, or no contact is excluded.
        for round in 0..WINDOW_STEPS_MAX {
            let fits = 1.0 - radius * principal[1];
            if fits < FIT_MARGIN_MIN || round + 1 == WINDOW_STEPS_MAX {
                excluded = EMPTY;
                break;
            }
            let curvature = principal[0].abs().max(principal[1].abs());
            let beside_mm = WINDOW_MARGIN * around_mm * (1.0 + (1.0 + radius * curvature / fits).sqrt());
            let window = |at: f64, per_mm: f64| [at - beside_mm * per_mm, at + beside_mm * per_mm];
            excluded = [window(u, own.per_mm[0]), window(v, own.per_mm[1])];
            let around = self.grid.principal(excluded, CELLS_PER_SIDE);
            let wider = [principal[0].min(around[0]), principal[1].max(around[1])];
            if wider == principal {
                break;
            }
            principal = wider;
        }
        if self.oracle.along == Along::V {
            excluded.reverse();
        }
        DepthQuery {
            around_mm,
            curvature: principal[0].abs().max(principal[1].abs()),
            floor_mm,
            gouge_mm: self.floor_mm,
            excluded,
        }
    }
}
