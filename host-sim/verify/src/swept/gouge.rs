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
/// Largest number of cells evaluated.
const CELLS_MAX: usize = 1_500_000;
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
}

pub(super) struct GougeSearch<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) tree: &'a PathTree<'a>,
    pub(super) grid: &'a CellGrid,
    /// Least depth that counts as a gouge, mm.
    pub(super) floor_mm: f64,
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
        let mut deepest: Option<DeepestPoint> = None;
        let mut cells: Vec<Cell> = (0..self.grid.count()).map(|k| self.grid.cell(k)).collect();
        let mut evaluations = 0;
        let mut left = self.floor_mm;
        for round in 0..=SPLITS_MAX {
            evaluations += cells.len();
            let found = deepest.map_or(0.0, |deepest| deepest.depth_mm);
            let evaluated: Vec<CellDepth> = cells
                .par_iter()
                .filter_map(|cell| {
                    done(1);
                    self.evaluate(*cell, self.closing_bound(found)).ok()
                })
                .collect();
            for cell_depth in &evaluated {
                let (u, v) = cell_depth.cell.middle();
                if let Some(by) = cell_depth.depth.by
                    && cell_depth.depth.depth_mm > deepest.map_or(self.floor_mm, |deepest| deepest.depth_mm)
                {
                    deepest = Some(DeepestPoint {
                        depth_mm: cell_depth.depth.depth_mm,
                        u,
                        v,
                        point_mm: cell_depth.point_mm,
                        by,
                    });
                }
            }
            let closing_bound = self.closing_bound(deepest.map_or(0.0, |deepest| deepest.depth_mm));
            let mut open: Vec<&CellDepth> = evaluated
                .iter()
                .filter(|cell_depth| cell_depth.depth.bound_mm > closing_bound)
                .collect();
            let most = |open: &[&CellDepth]| {
                open.iter()
                    .map(|cell_depth| cell_depth.depth.bound_mm)
                    .fold(closing_bound, f64::max)
            };
            left = most(&open);
            if open.is_empty() || round == SPLITS_MAX {
                break;
            }
            // If the budget does not suffice for all cells, those with the largest bounds are split; the bound of the others is reported.
            let room = (CELLS_MAX.saturating_sub(evaluations)) / 4;
            if open.len() > room {
                open.sort_by(|a, b| b.depth.bound_mm.total_cmp(&a.depth.bound_mm));
                left = most(&open[room..]);
                open.truncate(room);
                if open.is_empty() {
                    break;
                }
            }
            cells = open
                .iter()
                .flat_map(|cell_depth| cell_depth.cell.quarters())
                .collect();
        }
        GougeSearchResult {
            deepest,
            bound_mm: left,
            cells: evaluations,
        }
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
