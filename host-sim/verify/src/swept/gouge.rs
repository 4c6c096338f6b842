//! Gouge: where a ball, wherever on its path, goes below the surface.
//!
//! A surface point P is cut by r - d, d its distance from the path of the centre. The largest of that is found by splitting cells:
//! a cell whose bound (see `Tree::depth`) stays below what has been found, or below what counts as a gouge at all, is done.
//!
//! Beside its own contact a ball touches the surface, so its depth is 0 there, and no bound falls below it. Contacts near
//! a cell are therefore left out of its bound, as far as the ball fits the curvature all around: with a = 1 - r k, k the largest
//! curvature there, a ball whose contact is x away stays `a x^2 / (2 r)` above a point. (That they are where they belong
//! is checked sample by sample: `oracle/verify.rs`.) Their depth in the cells' middles counts nevertheless.

use rayon::prelude::*;

use super::grid::{Bend, Cell, Grid, bend};
use super::height::Ray;
use super::tree::{Cut, Depth, Reach, Tree};
use job::Along;
use oracle::vector::{length, subtract};
use oracle::{Oracle, OracleError};

/// Times that a cell is split at most.
const SPLITS_MAX: usize = 14;
/// Cells that are asked about at most.
const CELLS_MAX: usize = 1_500_000;
/// A gouge is deep enough known within this share of itself.
const DEPTH_SHARE: f64 = 1e-3;
/// Room left over what the curvature asks for (see `reach`).
const BESIDE: f64 = 1.15;
/// Where a is below this no contact is left out: the ball hardly fits, or not at all.
const FITS_MIN: f64 = 0.02;
/// Times that such a window is widened at most.
const WINDOWS: usize = 8;
/// Ranges that hold nothing.
const NOWHERE: [[f64; 2]; 2] = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
/// Cells a side that are looked at for the curvature around a cell.
const LOOKS: usize = 12;

/// The deepest place found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deepest {
    pub(super) depth_mm: f64,
    pub(super) u: f64,
    pub(super) v: f64,
    pub(super) place_mm: [f64; 3],
    pub(super) by: Cut,
}

/// What the search came to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub(super) deepest: Option<Deepest>,
    /// No place is cut deeper than this, mm.
    pub(super) bound_mm: f64,
    pub(super) cells: usize,
}

pub(super) struct Searcher<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) tree: &'a Tree<'a>,
    pub(super) grid: &'a Grid,
    /// What counts as a gouge, mm.
    pub(super) floor_mm: f64,
}

#[derive(Clone, Copy, Debug)]
struct Looked {
    cell: Cell,
    depth: Depth,
    place_mm: [f64; 3],
}

impl Searcher<'_> {
    /// The deepest gouge; `done` is called with the number of cells that were asked about.
    pub(super) fn search(&self, done: &(dyn Fn(u64) + Sync)) -> Search {
        let mut deepest: Option<Deepest> = None;
        let mut cells: Vec<Cell> = (0..self.grid.count()).map(|k| self.grid.cell(k)).collect();
        let mut asked = 0;
        let mut left = self.floor_mm;
        for round in 0..=SPLITS_MAX {
            asked += cells.len();
            let found = deepest.map_or(0.0, |deepest| deepest.depth_mm);
            let looked: Vec<Looked> = cells
                .par_iter()
                .filter_map(|cell| {
                    done(1);
                    self.look(*cell, self.enough(found)).ok()
                })
                .collect();
            for look in &looked {
                let (u, v) = look.cell.middle();
                if let Some(by) = look.depth.by
                    && look.depth.depth_mm > deepest.map_or(self.floor_mm, |deepest| deepest.depth_mm)
                {
                    deepest = Some(Deepest {
                        depth_mm: look.depth.depth_mm,
                        u,
                        v,
                        place_mm: look.place_mm,
                        by,
                    });
                }
            }
            let enough = self.enough(deepest.map_or(0.0, |deepest| deepest.depth_mm));
            let mut open: Vec<&Looked> = looked
                .iter()
                .filter(|look| look.depth.bound_mm > enough)
                .collect();
            let most = |open: &[&Looked]| open.iter().map(|look| look.depth.bound_mm).fold(enough, f64::max);
            left = most(&open);
            if open.is_empty() || round == SPLITS_MAX {
                break;
            }
            // With no room for all, the worst go on; what the others may hide is said.
            let room = (CELLS_MAX.saturating_sub(asked)) / 4;
            if open.len() > room {
                open.sort_by(|a, b| b.depth.bound_mm.total_cmp(&a.depth.bound_mm));
                left = most(&open[room..]);
                open.truncate(room);
                if open.is_empty() {
                    break;
                }
            }
            cells = open.iter().flat_map(|look| look.cell.quarters()).collect();
        }
        Search {
            deepest,
            bound_mm: left,
            cells: asked,
        }
    }

    /// A bound that is not worth a split.
    fn enough(&self, found_mm: f64) -> f64 {
        self.floor_mm.max(found_mm * (1.0 + DEPTH_SHARE))
    }

    fn look(&self, cell: Cell, floor_mm: f64) -> Result<Looked, OracleError> {
        let oracle = self.oracle;
        let (u, v) = cell.middle();
        let at = oracle.surface.at(u, v);
        let around_mm = cell
            .u
            .into_iter()
            .flat_map(|u| {
                cell.v
                    .map(|v| length(subtract(oracle.surface.at(u, v).point, at.point)))
            })
            .fold(0.0, f64::max);
        let (ray, reach) = match bend(&at, oracle) {
            Some((along, bend)) => {
                let ray = Ray {
                    from: at.point,
                    along,
                };
                (ray, self.reach(cell, around_mm, &bend, floor_mm))
            }
            None => {
                let ray = Ray {
                    from: at.point,
                    along: oracle.contact(u, v)?.normal,
                };
                let [low, high] = self.grid.principal([cell.u, cell.v], LOOKS);
                let bend = low.abs().max(high.abs());
                let reach = Reach {
                    around_mm,
                    bend: if bend.is_finite() { bend } else { 0.0 },
                    floor_mm,
                    gouge_mm: self.floor_mm,
                    but: NOWHERE,
                };
                (ray, reach)
            }
        };
        Ok(Looked {
            cell,
            depth: self.tree.depth(&ray, &reach),
            place_mm: at.point,
        })
    }

    /// What a cell's bound has to cover, and which contacts it may leave out.
    ///
    /// With b the largest curvature either way and R the cell's half-diagonal, the bound of a contact x away is
    /// `-a x^2 / (2 r) + R a x / r + R^2 b / 2`: not above 0 from `x = R (1 + sqrt(1 + r b / a))` on.
    fn reach(&self, cell: Cell, around_mm: f64, own: &Bend, floor_mm: f64) -> Reach {
        let radius = self.oracle.radius_mm;
        let (u, v) = cell.middle();
        let mut principal = own.principal;
        let mut but = NOWHERE;
        // The window depends on the curvature in it: both grow until they agree, or nothing is left out.
        for round in 0..WINDOWS {
            let fits = 1.0 - radius * principal[1];
            if fits < FITS_MIN || round + 1 == WINDOWS {
                but = NOWHERE;
                break;
            }
            let bend = principal[0].abs().max(principal[1].abs());
            let beside_mm = BESIDE * around_mm * (1.0 + (1.0 + radius * bend / fits).sqrt());
            let window = |at: f64, per_mm: f64| [at - beside_mm * per_mm, at + beside_mm * per_mm];
            but = [window(u, own.per_mm[0]), window(v, own.per_mm[1])];
            let around = self.grid.principal(but, LOOKS);
            let wider = [principal[0].min(around[0]), principal[1].max(around[1])];
            if wider == principal {
                break;
            }
            principal = wider;
        }
        if self.oracle.along == Along::V {
            but.reverse();
        }
        Reach {
            around_mm,
            bend: principal[0].abs().max(principal[1].abs()),
            floor_mm,
            gouge_mm: self.floor_mm,
            but,
        }
    }
}
