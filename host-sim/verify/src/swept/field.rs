//! Heights of the material over the whole surface, for a path that need not follow lines of the surface.
//!
//! The height at a point is the distance along the tool normal to the swept ball, as for a ridge; below zero a ball has cut into the surface.
//! It is evaluated in the middle of every cell of the grid, then the highest and the lowest places are searched in ever smaller steps. Ridges
//! between passes are sharp, so the search moves by both parameters and by each alone.

use rayon::prelude::*;

use super::Progress;
use super::grid::CellGrid;
use super::height::Ray;
use super::ridge::MISSED_RADII;
use super::track::ToolPath;
use super::tree::PathTree;
use glam::DVec3;
use job::Along;
use oracle::Oracle;

/// Number of places from which the highest point is searched, and as many for the lowest.
const STARTS: usize = 64;
/// Bisections of the step of such a search.
const HALVINGS: usize = 40;

/// A place of the field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldPoint {
    /// Height, mm; four radii where no ball reaches the point.
    pub height_mm: f64,
    /// Parameters.
    pub uv: [f64; 2],
    /// Point on the surface, mm.
    pub point_mm: DVec3,
}

impl FieldPoint {
    /// The higher of two places.
    pub(super) fn higher(self, other: Self) -> Self {
        if other.height_mm > self.height_mm {
            other
        } else {
            self
        }
    }
}

/// Heights over the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HeightField {
    /// The highest place found; `None`, as all others, where passes serve no point of the grid.
    pub highest: Option<FieldPoint>,
    /// The lowest of the whole surface: below zero a gouge.
    pub lowest: Option<FieldPoint>,
    /// Mean over the area, gouges counted as zero, mm.
    pub mean_mm: Option<f64>,
    /// Share of the area that no ball reaches.
    pub uncut_share: Option<f64>,
    /// Points of the grid.
    pub points: usize,
}

/// Largest number of points of the thinned field.
const THINNED_MAX: usize = 20_000;

/// Measures the heights that a path leaves where passes serve the surface; what it cuts on the whole surface. Also returns lines of the field, thinned, along the path parameter.
#[must_use]
pub fn height_field(
    oracle: &Oracle,
    path: &ToolPath,
    progress: &dyn Progress,
) -> (HeightField, Vec<Vec<FieldPoint>>) {
    let tree = PathTree::new(path, oracle.radius_mm);
    let grid = CellGrid::new(oracle);
    let missed = MISSED_RADII * oracle.radius_mm;
    let heights = Heights { oracle, tree: &tree };
    progress.begin("heights", grid.count() as u64);
    let cells: Vec<(FieldPoint, f64, bool)> = (0..grid.count())
        .into_par_iter()
        .filter_map(|index| {
            progress.done(1);
            let cell = grid.cell(index);
            let (u, v) = cell.middle();
            let (place, area) = heights.at([u, v])?;
            let area = area * (cell.u[1] - cell.u[0]) * (cell.v[1] - cell.v[0]);
            Some((place, area, oracle.is_served(u, v)))
        })
        .collect();
    let served = cells.iter().filter(|(.., is_served)| *is_served);
    let places: Vec<(FieldPoint, f64)> = served.map(|(place, area, _)| (*place, *area)).collect();
    let area: f64 = places.iter().map(|(_, area)| area).sum();
    let sum: f64 = places
        .iter()
        .map(|(place, area)| place.height_mm.clamp(0.0, missed) * area)
        .sum();
    let uncut: f64 = places
        .iter()
        .filter(|(place, _)| place.height_mm >= missed)
        .map(|(_, area)| area)
        .sum();
    let [du, dv] = [0, 1].map(|axis: usize| {
        let edges = &grid.edges[axis];
        edges.windows(2).map(|ends| ends[1] - ends[0]).fold(0.0, f64::max)
    });
    let starts = places.iter().map(|(place, _)| *place).collect();
    let anywhere = cells.iter().map(|(place, ..)| *place).collect();
    let field = HeightField {
        highest: heights.extreme(starts, 1.0, [du, dv]),
        lowest: heights.extreme(anywhere, -1.0, [du, dv]),
        mean_mm: (area > 0.0).then_some(sum / area),
        uncut_share: (area > 0.0).then_some(uncut.abs() / area),
        points: places.len(),
    };
    (field, heights.thinned(&grid))
}

/// Evaluates heights.
#[derive(Clone, Copy)]
pub(super) struct Heights<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) tree: &'a PathTree<'a>,
}

impl Heights<'_> {
    /// The height at a place, and |S_u x S_v| there; `None` where the surface has no normal.
    pub(super) fn at(&self, [u, v]: [f64; 2]) -> Option<(FieldPoint, f64)> {
        let at = self.oracle.surface.at(u, v);
        let ray = Ray {
            from: at.point,
            along: self.oracle.normal(&at, u, v).ok()?,
        };
        let place = FieldPoint {
            height_mm: self.tree.entry(&ray, MISSED_RADII * self.oracle.radius_mm),
            uv: [u, v],
            point_mm: at.point,
        };
        Some((place, at.u.cross(at.v).length()))
    }

    /// The same where passes serve the place: beside a region's boundary the last ball stands at the end of a pass.
    pub(super) fn served(&self, uv: [f64; 2]) -> Option<(FieldPoint, f64)> {
        let [u, v] = uv;
        self.oracle.is_served(u, v).then(|| self.at(uv)).flatten()
    }

    /// The highest place that passes serve (`sign` 1), or the lowest of all (-1), from the best of these, if there are any; `steps`: first steps of the search in u and v.
    pub(super) fn extreme(
        &self,
        mut starts: Vec<FieldPoint>,
        sign: f64,
        steps: [f64; 2],
    ) -> Option<FieldPoint> {
        starts.sort_by(|a, b| (sign * b.height_mm).total_cmp(&(sign * a.height_mm)));
        let searched = starts
            .par_iter()
            .take(STARTS)
            .map(|start| self.climb(*start, sign, steps));
        let best = |a: FieldPoint, b: FieldPoint| {
            if sign * b.height_mm > sign * a.height_mm {
                b
            } else {
                a
            }
        };
        searched.reduce_with(best)
    }

    /// Lines of the field along the path parameter, through the middles of evenly spread cells.
    fn thinned(&self, grid: &CellGrid) -> Vec<Vec<FieldPoint>> {
        let [rows, columns] = grid.shape();
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_precision_loss,
            clippy::cast_sign_loss,
            reason = "small and positive"
        )]
        let step = ((rows * columns) as f64 / THINNED_MAX as f64)
            .sqrt()
            .ceil()
            .max(1.0) as usize;
        let middles = |axis: usize| -> Vec<f64> {
            let edges = grid.edges[axis].windows(2).step_by(step);
            edges.map(|ends| 0.5 * (ends[0] + ends[1])).collect()
        };
        let (along_path, beside) = match self.oracle.along {
            Along::U => (middles(0), middles(1)),
            Along::V => (middles(1), middles(0)),
        };
        let place = |path: f64, side: f64| {
            let (u, v) = self.oracle.swapped(path, side);
            self.served([u, v]).map(|(place, _)| place)
        };
        beside
            .par_iter()
            .map(|side| along_path.iter().filter_map(|path| place(*path, *side)).collect())
            .collect()
    }

    /// Pattern search from a place with bisected steps, within the surface.
    fn climb(&self, start: FieldPoint, sign: f64, [mut du, mut dv]: [f64; 2]) -> FieldPoint {
        let [[u0, u1], [v0, v1]] = self.oracle.surface.domain();
        let mut best = start;
        for _ in 0..HALVINGS {
            let mut moved = false;
            for (i, j) in [
                (1, 0),
                (-1, 0),
                (0, 1),
                (0, -1),
                (1, 1),
                (1, -1),
                (-1, 1),
                (-1, -1),
            ] {
                let u = (best.uv[0] + f64::from(i) * du).clamp(u0, u1);
                let v = (best.uv[1] + f64::from(j) * dv).clamp(v0, v1);
                let there = if sign > 0.0 {
                    self.served([u, v])
                } else {
                    self.at([u, v])
                };
                if let Some((place, _)) = there
                    && sign * place.height_mm > sign * best.height_mm
                {
                    (best, moved) = (place, true);
                }
            }
            if !moved {
                (du, dv) = (0.5 * du, 0.5 * dv);
            }
        }
        best
    }
}
