//! The whole part: cells and edges of all faces, and the distance of the part from a ball's centre or a tool's axis.

use cad::{Face, Periodic, outline, polylines, trim};
use glam::DVec3;
use job::Along;
use oracle::Surface;
use rayon::prelude::*;

use crate::cell::{Cell, FromLine, FromPoint};
use crate::inside::Inside;
use crate::tree::{Block, Tree};
use crate::triangle::{edge_beside, edge_nearest};

/// Largest distance of a cell's two triangles from the surface, mm. Distances below it are computed from the cell's quadratic.
const DEVIATION_MM: f64 = 0.01;
/// Largest distance of a cell's quadratic from the surface, mm, at the places where it is checked: between its nine points.
const MODEL_MM: f64 = 2e-4;
/// Largest distance of an edge's chords from the edge, mm.
const EDGE_MM: f64 = 5e-4;
/// Precision of a trimmed region's polygons, mm.
const TRIM_MM: f64 = 1e-3;
/// Longest side of a cell, mm: the box of a larger cell would be mostly empty.
const SIZE_MM: f64 = 10.0;
/// Most halvings of a face; a surface that needs more is not smooth there.
const HALVINGS: u32 = 28;

/// A face of a part.
#[derive(Clone, Debug)]
pub struct PartFace {
    /// The face as read, placed.
    pub face: Face,
    /// Its trimmed region in the parameters of its surface.
    pub inside: Inside,
    /// Ranges of u and v around it.
    pub rectangle: [[f64; 2]; 2],
}

/// A face that is not known well enough to keep a tool away from it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// Its number in the file.
    pub number: usize,
    /// Why.
    pub why: String,
}

/// All faces of a part.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// The faces that are known.
    pub faces: Vec<PartFace>,
    /// The faces that are not known.
    pub missing: Vec<Missing>,
    /// Number of faces of the file that have no surface here.
    pub left_out: usize,
    cells: Vec<Cell>,
    cell_tree: Tree,
    edges: Vec<([DVec3; 2], u32)>,
    edge_tree: Tree,
    /// Trimmed region of a surface that is no face of a file: all of the surface.
    whole: Inside,
}

/// The place of a part that is nearest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Distance, mm.
    pub distance: f64,
    /// Index of the face in [`Part::faces`].
    pub face: usize,
}

/// What does not count: places of a face near the contact with it.
#[derive(Clone, Copy, Debug)]
pub struct OwnContact {
    /// Index of the face.
    pub face: usize,
    /// The contact.
    pub place: DVec3,
    /// How far around it.
    pub radius: f64,
}

impl Part {
    /// From the faces of a file, all cores.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "fewer than 2^32 faces")]
    pub fn new(faces: &[Face]) -> Self {
        let known: Vec<_> = faces
            .par_iter()
            .map(|face| {
                let known = || -> Result<PartFace, String> {
                    let outline = outline(face)?;
                    let polygons = trim(face, &outline, None, TRIM_MM)?;
                    Ok(PartFace {
                        face: face.clone(),
                        inside: Inside::new(&polygons),
                        rectangle: outline.rectangle,
                    })
                };
                known().map_err(|why| Missing {
                    number: face.number,
                    why,
                })
            })
            .collect();
        let mut part = Self::default();
        for face in known {
            match face {
                Ok(face) => part.faces.push(face),
                Err(missing) => part.missing.push(missing),
            }
        }
        let cut: Vec<(Vec<Cell>, Vec<[DVec3; 2]>)> = part
            .faces
            .par_iter()
            .enumerate()
            .map(|(index, face)| {
                let lines = polylines(&face.face, EDGE_MM);
                let edges = lines
                    .iter()
                    .flat_map(|line| line.windows(2).map(|ends| [ends[0], ends[1]]));
                (cells(index as u32, face), edges.collect())
            })
            .collect();
        for (index, (cells, edges)) in (0..).zip(cut) {
            part.cells.extend(cells);
            part.edges.extend(edges.into_iter().map(|ends| (ends, index)));
        }
        part.plant();
        part
    }

    /// Of one surface, all of it, that is no face of a file.
    #[must_use]
    pub fn of_surface(surface: &Surface) -> Self {
        let at = |u: f64, v: f64| surface.at(u, v).point;
        let mut part = Self::default();
        let breaks = [Along::U, Along::V].map(|along| surface.breaks(along));
        part.cells = cells_between(0, None, &at, &breaks);
        part.plant();
        part
    }

    /// The trees.
    fn plant(&mut self) {
        let blocks: Vec<Block> = self.cells.iter().map(Cell::block).collect();
        self.cell_tree = Tree::new(&blocks);
        let blocks: Vec<Block> = self.edges.iter().map(|(ends, _)| Block::around(*ends)).collect();
        self.edge_tree = Tree::new(&blocks);
    }

    /// The trimmed region of a face.
    fn inside(&self, face: usize) -> &Inside {
        self.faces.get(face).map_or(&self.whole, |face| &face.inside)
    }

    /// The edges of a face.
    pub(crate) fn edges_of(&self, face: usize) -> Vec<[DVec3; 2]> {
        let own = self.edges.iter().filter(|(_, of)| *of as usize == face);
        own.map(|(ends, _)| *ends).collect()
    }

    /// Number of cells and of edges.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.cells.len(), self.edges.len()]
    }

    /// Points of it, no farther from each other than a step along a cell; of a cell that the trimmed region ends in, those within.
    pub(crate) fn points(&self, step: f64, each: &mut dyn FnMut(DVec3)) {
        for cell in &self.cells {
            let inside = self.inside(cell.face as usize);
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "at least 0; the cast saturates"
            )]
            let [along, across] = cell.sizes().map(|size| (size / step) as usize + 1);
            for (i, j) in (0..=along).flat_map(|i| (0..=across).map(move |j| (i, j))) {
                let share = [i as f64 / along as f64, j as f64 / across as f64];
                let uv = std::array::from_fn(|k| cell.uv[k][0] + share[k] * (cell.uv[k][1] - cell.uv[k][0]));
                if !cell.is_cut || inside.contains(uv) {
                    each(cell.at(share));
                }
            }
        }
        self.edges
            .iter()
            .for_each(|(ends, _)| ends.iter().for_each(|end| each(*end)));
    }

    /// The box around it.
    #[must_use]
    pub fn block(&self) -> Block {
        self.cell_tree.block()
    }

    /// Index of the face with this number in the file.
    #[must_use]
    pub fn index(&self, number: usize) -> Option<usize> {
        self.faces.iter().position(|face| face.face.number == number)
    }

    /// The place nearest to a point, if nearer than `below`; with `any`, any place that is. Within 1 um.
    #[must_use]
    pub fn nearest(&self, point: DVec3, below: f64, own: Option<&OwnContact>, any: bool) -> Option<Near> {
        let mut found: Option<Near> = None;
        let mut bound = below;
        let from = |block: &Block| block.distance_squared(point);
        self.edge_tree.nearest(&mut bound, from, |index, bound| {
            if any && found.is_some() {
                return;
            }
            let (ends, face) = self.edges[index];
            let (distance, place) = edge_nearest(point, ends);
            let face = face as usize;
            let is_own = own.is_some_and(|own| own.face == face && own.place.distance(place) < own.radius);
            if distance < *bound && !is_own {
                *bound = if any { 0.0 } else { distance };
                found = Some(Near { distance, face });
            }
        });
        if any && found.is_some() {
            return found;
        }
        self.cell_tree.nearest(&mut bound, from, |index, bound| {
            if any && found.is_some() {
                return;
            }
            let cell = &self.cells[index];
            if cell.is_beyond(point, *bound) {
                return;
            }
            let face = cell.face as usize;
            let skip = own
                .filter(|own| own.face == face)
                .map(|own| (own.place, own.radius));
            let measure = FromPoint { point, skip };
            if cell.lower(&measure, self.inside(face), bound, any).is_some() {
                found = Some(Near {
                    distance: *bound,
                    face,
                });
            }
        });
        found
    }

    /// The place between two heights that is nearest to the vertical line through a point, if nearer than `below`; with `any`, any place that is.
    #[must_use]
    pub fn beside(&self, point: DVec3, z: [f64; 2], below: f64, any: bool) -> Option<Near> {
        let mut found: Option<Near> = None;
        let mut bound = below;
        let from = |block: &Block| block.beside_squared(point, z);
        self.edge_tree.nearest(&mut bound, from, |index, bound| {
            if any && found.is_some() {
                return;
            }
            let (ends, face) = self.edges[index];
            if let Some(distance) = edge_beside(point, ends, z).filter(|distance| *distance < *bound) {
                *bound = distance;
                found = Some(Near {
                    distance,
                    face: face as usize,
                });
            }
        });
        if any && found.is_some() {
            return found;
        }
        let measure = FromLine { point, z };
        self.cell_tree.nearest(&mut bound, from, |index, bound| {
            if any && found.is_some() {
                return;
            }
            let cell = &self.cells[index];
            if cell.is_beside(point, z[0], *bound) {
                return;
            }
            let face = cell.face as usize;
            if cell.lower(&measure, self.inside(face), bound, any).is_some() {
                found = Some(Near {
                    distance: *bound,
                    face,
                });
            }
        });
        found
    }
}

/// The cells of a face.
fn cells(index: u32, face: &PartFace) -> Vec<Cell> {
    let surface = &face.face.surface;
    let on = Periodic::new(surface);
    let breaks = |k: usize| -> Vec<f64> {
        let [low, high] = face.rectangle[k];
        let mut breaks = vec![low];
        breaks.extend(surface.joints(k, [low, high]));
        breaks.push(high);
        breaks
    };
    let at = |u: f64, v: f64| on.at(u, v).point;
    cells_between(index, Some(&face.inside), &at, &[breaks(0), breaks(1)])
}

/// The cells of a surface that is smooth between these parameters; without a trimmed region, of all of it.
fn cells_between(
    index: u32,
    inside: Option<&Inside>,
    at: &dyn Fn(f64, f64) -> DVec3,
    [us, vs]: &[Vec<f64>; 2],
) -> Vec<Cell> {
    let maker = Maker { index, inside, at };
    let edges: Vec<u32> = (0..)
        .take(inside.map_or(0, |inside| inside.edges().len()))
        .collect();
    let mut cells = Vec::new();
    for u in us.windows(2) {
        for v in vs.windows(2) {
            maker.cells([[u[0], u[1]], [v[0], v[1]]], &edges, HALVINGS, &mut cells);
        }
    }
    cells
}

struct Maker<'p> {
    index: u32,
    inside: Option<&'p Inside>,
    at: &'p dyn Fn(f64, f64) -> DVec3,
}

impl Maker<'_> {
    /// Adds the cells of a rectangle; `edges`: those of the trimmed region that may cross it.
    fn cells(&self, uv: [[f64; 2]; 2], edges: &[u32], left: u32, out: &mut Vec<Cell>) {
        let all = self.inside.map_or([].as_slice(), Inside::edges);
        let edges: Vec<u32> = edges
            .iter()
            .copied()
            .filter(|index| {
                let [a, b] = all[*index as usize];
                (0..2).all(|k| a[k].min(b[k]) <= uv[k][1] && a[k].max(b[k]) >= uv[k][0])
            })
            .collect();
        let middle = uv.map(|[low, high]| 0.5 * (low + high));
        let is_cut = !edges.is_empty();
        if !is_cut && self.inside.is_some_and(|inside| !inside.contains(middle)) {
            return;
        }
        let at = |s: f64, t: f64| {
            let [[u0, u1], [v0, v1]] = uv;
            (self.at)(u0 + s * (u1 - u0), v0 + t * (v1 - v0))
        };
        let points = std::array::from_fn(|i| std::array::from_fn(|j| at(0.5 * i as f64, 0.5 * j as f64)));
        let cell = Cell::new(self.index, uv, points, is_cut);
        let off = |s: f64, t: f64| cell.at([s, t]).distance(at(s, t));
        let off_u = off(0.25, 0.5).max(off(0.75, 0.5));
        let off_v = off(0.5, 0.25).max(off(0.5, 0.75));
        let off_both = off(0.25, 0.25).max(off(0.75, 0.75));
        let model = off_u.max(off_v).max(off_both);
        let sizes = cell.sizes();
        let is_large = sizes[0].max(sizes[1]) > SIZE_MM;
        if left == 0 || (cell.deviation <= DEVIATION_MM && model <= MODEL_MM && !is_large) {
            out.push(match self.inside.filter(|_| is_cut) {
                Some(inside) => cell.trimmed_by(inside, &edges),
                None => cell,
            });
            return;
        }
        let bends = cell.bends();
        let k = if model > MODEL_MM && (off_u - off_v).abs() > 0.1 * MODEL_MM {
            usize::from(off_v > off_u)
        } else if cell.deviation > DEVIATION_MM && (bends[0] - bends[1]).abs() > 0.1 * DEVIATION_MM {
            usize::from(bends[1] > bends[0])
        } else {
            usize::from(sizes[1] > sizes[0])
        };
        for part in [[uv[k][0], middle[k]], [middle[k], uv[k][1]]] {
            let mut uv = uv;
            uv[k] = part;
            self.cells(uv, &edges, left - 1, out);
        }
    }
}
