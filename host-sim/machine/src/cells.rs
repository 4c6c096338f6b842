//! The cells of a region: parts that are machined one after the other, so that the tool need not cross a hole or a tall feature on every line, and no line meets more
//! edges than the core keeps.
//!
//! ```text
//! loops ──slabs between vertices──► pieces ──one above the other──► arcs ──merged where that takes less time──► cells, in order
//! ```
//!
//! A piece lies between two edges and two levels of the side parameter. Pieces that are each the other's only neighbour are an arc: a line meets it once. Two cells that
//! touch are merged while the links over what parts them take less time than a link to the second one and its first pass, which the last one of the other has done already
//! (boustrophedon decomposition; H. Choset, "Coverage of known spaces", 2000). Where two cells touch, one of them has its first or its last line there: otherwise no pass
//! would be on that line, and the passes on both sides of it could be nearly two step-overs apart.

mod pieces;

use std::collections::BTreeMap;

use glam::DVec3;
use interp_core::job::region::CROSSINGS_MAX;
use job::{Along, Job, Region};

use crate::prepare::SurfaceEvaluator;
use pieces::{Pieces, Polygon};

/// Time of a link that crosses something, apart from its length, s: up, across and down within the default limits.
const LINK_S: f64 = 0.5;
/// Time of a pass apart from its length, s.
pub const PASS_S: f64 = 0.15;
/// More arcs are merged by the number of crossings alone.
const INTERVALS_MAX: usize = CROSSINGS_MAX / 2;

/// Gives the region of a job its cells, by the direction of its passes. Without axis limits there are no links: only what the core cannot keep is parted.
pub(crate) fn choose(job: &mut Job) {
    let Some(region) = &job.region else {
        return;
    };
    let pieces = Pieces::new(region, job.along);
    let cells = match &job.machine.limits {
        None if pieces.most_on_a_line() <= INTERVALS_MAX => Vec::new(),
        limits => {
            let speed = limits.as_ref().map_or(f64::INFINITY, |limits| {
                limits.velocity_mm_s[0].min(limits.velocity_mm_s[1])
            });
            let costs = Costs {
                surface: SurfaceEvaluator::new(&job.surface),
                along: job.along,
                step_mm: job.plane_step_over_mm(),
                feed_mm_s: job.feed_mm_s(),
                link_s: if limits.is_some() { LINK_S } else { 0.0 },
                speed_mm_s: speed,
            };
            costs.cells(&pieces)
        }
    };
    let cells = without_slivers(job, region, cells);
    let vertices = cells.iter().flatten().map(Vec::len).sum::<usize>();
    if let Some(region) = &mut job.region {
        region.cells = if vertices > Region::VERTICES_MAX {
            Vec::new()
        } else {
            cells
        };
    }
}

/// The cells of a region that is made from a face, without ends on which the first or the last line would be a sliver.
fn without_slivers(job: &Job, region: &Region, cells: Vec<Vec<Polygon>>) -> Vec<Vec<Polygon>> {
    if job.origin.reach().is_none() {
        return cells;
    }
    let surface = SurfaceEvaluator::new(&job.surface);
    let step_mm = job.plane_step_over_mm();
    let [u, v] = job.surface.domain();
    let sides = if job.along == Along::U { v } else { u };
    let mut is_cut = false;
    let whole = cells.is_empty().then(|| region.loops.clone());
    let trimmed: Vec<Vec<Polygon>> = whole
        .into_iter()
        .chain(cells.clone())
        .map(|loops| {
            let cell = Region::new(loops);
            let [[u0, u1], [v0, v1]] = cell.extent();
            let frame = surface.at(0.5 * (u0 + u1), 0.5 * (v0 + v1));
            let (across_mm, ends) = match job.along {
                Along::U => (frame.v.length(), [v0, v1]),
                Along::V => (frame.u.length(), [u0, u1]),
            };
            let lines = cell.trimmed_lines(job.along, step_mm, across_mm, sides);
            if lines == ends {
                return cell.loops;
            }
            is_cut = true;
            cell.between(job.along, lines).loops
        })
        .collect();
    if is_cut { trimmed } else { cells }
}

/// The time that links and passes take.
struct Costs {
    surface: SurfaceEvaluator,
    along: Along,
    step_mm: f64,
    feed_mm_s: f64,
    link_s: f64,
    speed_mm_s: f64,
}

/// Pieces that are machined line by line, in order of slabs and along them.
#[derive(Clone, Default)]
struct Cell {
    pieces: Vec<usize>,
    crossings_s: f64,
}

/// A piece by its size: lines in it, and mm for each unit of the path parameter.
#[derive(Clone, Copy)]
struct Size {
    lines: f64,
    path_mm: f64,
}

impl Costs {
    fn at(&self, [path, side]: [f64; 2]) -> (DVec3, [f64; 2]) {
        let frame = match self.along {
            Along::U => self.surface.at(path, side),
            Along::V => self.surface.at(side, path),
        };
        let (u, v) = (frame.u.length(), frame.v.length());
        let lengths = match self.along {
            Along::U => [u, v],
            Along::V => [v, u],
        };
        (frame.point, lengths)
    }

    /// The cells of a region, in order; none where it is one.
    fn cells(&self, pieces: &Pieces) -> Vec<Vec<Polygon>> {
        let sizes: Vec<Size> = (0..pieces.len())
            .map(|index| {
                let (_, [path_mm, side_mm]) = self.at(pieces.middle(index));
                Size {
                    lines: pieces.height(index) * side_mm / self.step_mm,
                    path_mm,
                }
            })
            .collect();
        let cells = self.merged(pieces, &sizes);
        if cells.len() < 2 {
            return Vec::new();
        }
        let ordered = self.ordered(pieces, cells);
        ordered
            .iter()
            .map(|cell| pieces.polygons(&cell.pieces, self.along))
            .collect()
    }

    /// Merges cells that touch, the two first that save most.
    fn merged(&self, pieces: &Pieces, sizes: &[Size]) -> Vec<Cell> {
        let mut cells: Vec<Option<Cell>> = pieces
            .arcs()
            .into_iter()
            .map(|pieces| {
                Some(Cell {
                    pieces,
                    crossings_s: 0.0,
                })
            })
            .collect();
        // Pairs of cells that touch, with the time of the pass that both would make.
        let mut touching: BTreeMap<[usize; 2], f64> = BTreeMap::new();
        let mut borders = Borders::new(pieces);
        for (arcs, [below, above]) in pieces.contacts() {
            let width = pieces.contact_width(below, above);
            *touching.entry(arcs).or_insert(PASS_S) += width * sizes[below].path_mm / self.feed_mm_s;
        }
        let mut gains: BTreeMap<[usize; 2], Option<(f64, Cell)>> = BTreeMap::new();
        loop {
            for (pair, pass_s) in &touching {
                gains.entry(*pair).or_insert_with(|| {
                    let [a, b] = pair.map(|index| cells[index].clone().unwrap_or_default());
                    let both = self.both(pieces, sizes, &a, &b)?;
                    let more = both.crossings_s - a.crossings_s - b.crossings_s;
                    Some((self.link_s + pass_s - more, both))
                });
            }
            let best = gains
                .iter()
                .filter_map(|(pair, gain)| Some((*pair, gain.as_ref()?)))
                .filter(|(pair, (gain, _))| *gain > 0.0 && borders.keep_lines(*pair, &cells))
                .max_by(|a, b| a.1.0.total_cmp(&b.1.0));
            let Some(([a, b], (_, both))) = best else {
                break;
            };
            cells[a] = Some(both.clone());
            cells[b] = None;
            borders.merge([a, b]);
            gains.retain(|pair, _| !pair.contains(&a) && !pair.contains(&b));
            let moved: Vec<([usize; 2], f64)> = touching
                .iter()
                .filter(|(pair, _)| pair.contains(&b))
                .map(|(pair, pass_s)| (*pair, *pass_s))
                .collect();
            for (pair, pass_s) in moved {
                touching.remove(&pair);
                let other = if pair[0] == b { pair[1] } else { pair[0] };
                if other != a {
                    *touching.entry([a.min(other), a.max(other)]).or_insert(0.0) += pass_s;
                }
            }
        }
        cells.into_iter().flatten().collect()
    }

    /// Two cells as one; `None` where a line would meet it too often.
    fn both(&self, pieces: &Pieces, sizes: &[Size], a: &Cell, b: &Cell) -> Option<Cell> {
        let mut both = Cell {
            pieces: a.pieces.iter().chain(&b.pieces).copied().collect(),
            crossings_s: 0.0,
        };
        // Pieces are numbered by slabs, and along each.
        both.pieces.sort_unstable();
        let mut on_line = 1;
        for pair in both.pieces.windows(2) {
            let [left, right] = [pair[0], pair[1]];
            if pieces.slab(left) != pieces.slab(right) {
                on_line = 1;
                continue;
            }
            on_line += 1;
            if on_line > INTERVALS_MAX {
                return None;
            }
            let gap_mm = pieces.gap(left, right) * sizes[left].path_mm;
            both.crossings_s += sizes[left].lines * (self.link_s + gap_mm / self.speed_mm_s);
        }
        Some(both)
    }

    /// From the lowest one always to the nearest.
    fn ordered(&self, pieces: &Pieces, mut cells: Vec<Cell>) -> Vec<Cell> {
        let ends = |cell: &Cell, is_top: bool| -> Vec<DVec3> {
            let ends = pieces.ends(&cell.pieces, is_top);
            ends.map(|place| self.at(place).0).to_vec()
        };
        let mut ordered: Vec<Cell> = Vec::new();
        let mut from: Vec<DVec3> = Vec::new();
        while !cells.is_empty() {
            let distance = |cell: &Cell| {
                if from.is_empty() {
                    return cell.pieces.first().map_or(0.0, |index| *index as f64);
                }
                let starts = ends(cell, false);
                let distances = starts
                    .iter()
                    .flat_map(|start| from.iter().map(move |from| from.distance(*start)));
                distances.fold(f64::INFINITY, f64::min)
            };
            let nearest = (0..cells.len())
                .min_by(|a, b| distance(&cells[*a]).total_cmp(&distance(&cells[*b])))
                .unwrap_or(0);
            let cell = cells.remove(nearest);
            from = ends(&cell, true);
            ordered.push(cell);
        }
        ordered
    }
}

/// Where cells touch.
struct Borders<'a> {
    pieces: &'a Pieces,
    /// Pieces of different arcs, the lower first.
    contacts: Vec<[usize; 2]>,
    /// The cell of each arc.
    cells: Vec<usize>,
}

impl<'a> Borders<'a> {
    fn new(pieces: &'a Pieces) -> Self {
        Self {
            pieces,
            contacts: pieces.contacts().into_iter().map(|(_, pair)| pair).collect(),
            cells: (0..pieces.arcs().len()).collect(),
        }
    }

    /// Two cells are the first one of them.
    fn merge(&mut self, [a, b]: [usize; 2]) {
        self.cells
            .iter_mut()
            .filter(|cell| **cell == b)
            .for_each(|cell| *cell = a);
    }

    /// Whether, of two cells as one and each other cell that they touch, one still has its first or its last line where they do.
    fn keep_lines(&self, [a, b]: [usize; 2], cells: &[Option<Cell>]) -> bool {
        let slabs = |cell: usize| -> [usize; 2] {
            let of = cells[cell].as_ref().map_or(&[][..], |cell| &cell.pieces);
            let slab = |piece: Option<&usize>| piece.map_or(0, |piece| self.pieces.slab(*piece));
            [slab(of.first()), slab(of.last())]
        };
        let ([first_a, last_a], [first_b, last_b]) = (slabs(a), slabs(b));
        let both = [first_a.min(first_b), last_a.max(last_b)];
        let ends = |cell: usize| if cell == a { both } else { slabs(cell) };
        self.contacts.iter().all(|contact| {
            let own = contact.map(|piece| self.cells[self.pieces.arc(piece)]);
            let [lower, upper] = own.map(|cell| if cell == b { a } else { cell });
            let [below, above] = contact.map(|piece| self.pieces.slab(piece));
            lower == upper || (lower != a && upper != a) || ends(lower)[1] == below || ends(upper)[0] == above
        })
    }
}

#[cfg(test)]
mod tests;
