//! A region cut at every vertex: pieces between two edges and two levels of the side parameter, and which of them touch.

use job::{Along, Region};

/// A closed polygon of (u, v).
pub(super) type Polygon = Vec<[f64; 2]>;

/// A piece. Ends of its edges: [lower, upper] path parameter.
struct Piece {
    slab: usize,
    /// Numbers of its edges, and where they are at the levels.
    edges: [usize; 2],
    left: [f64; 2],
    right: [f64; 2],
    arc: usize,
}

/// The pieces of a region, numbered by slabs, and along each.
pub(super) struct Pieces {
    /// Side parameters of the vertices; a slab is between two of them.
    levels: Vec<f64>,
    pieces: Vec<Piece>,
    /// Pieces that touch, the lower first.
    touching: Vec<[usize; 2]>,
    arcs: usize,
}

impl Pieces {
    pub(super) fn new(region: &Region, along: Along) -> Self {
        let swapped = |[u, v]: [f64; 2]| match along {
            Along::U => [u, v],
            Along::V => [v, u],
        };
        // From the lower end upwards; none of constant side.
        let mut edges: Vec<[[f64; 2]; 2]> = region
            .edges()
            .map(|ends| ends.map(swapped))
            .filter(|[from, to]| from[1] != to[1])
            .map(|[from, to]| if from[1] < to[1] { [from, to] } else { [to, from] })
            .collect();
        edges.sort_by(|a, b| a[0][1].total_cmp(&b[0][1]));
        let mut levels: Vec<f64> = edges.iter().flatten().map(|place| place[1]).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let mut found = Self {
            levels,
            pieces: Vec::new(),
            touching: Vec::new(),
            arcs: 0,
        };
        let mut active: Vec<usize> = Vec::new();
        let mut next = 0;
        let mut below = 0..0;
        for slab in 0..found.levels.len().saturating_sub(1) {
            let [low, high] = [found.levels[slab], found.levels[slab + 1]];
            active.retain(|index| edges[*index][1][1] >= high);
            while next < edges.len() && edges[next][0][1] <= low {
                active.push(next);
                next += 1;
            }
            let at = |index: usize, side: f64| {
                let [from, to] = edges[index];
                if side == from[1] {
                    from[0]
                } else if side == to[1] {
                    to[0]
                } else {
                    from[0] + (side - from[1]) / (to[1] - from[1]) * (to[0] - from[0])
                }
            };
            let middle = 0.5 * (low + high);
            active.sort_by(|a, b| at(*a, middle).total_cmp(&at(*b, middle)));
            let first = found.pieces.len();
            for pair in active.as_chunks::<2>().0 {
                let [left, right] = pair.map(|index| [at(index, low), at(index, high)]);
                found.pieces.push(Piece {
                    slab,
                    edges: *pair,
                    left,
                    right,
                    arc: 0,
                });
            }
            let here = first..found.pieces.len();
            found.touch(below, here.clone());
            below = here;
        }
        found.number_arcs();
        found
    }

    /// Notes which pieces of two slabs touch.
    fn touch(&mut self, below: std::ops::Range<usize>, above: std::ops::Range<usize>) {
        for lower in below {
            for upper in above.clone() {
                if self.contact_width(lower, upper) > 0.0 {
                    self.touching.push([lower, upper]);
                }
            }
        }
    }

    fn number_arcs(&mut self) {
        let mut neighbours = vec![[0_usize; 2]; self.pieces.len()];
        for [lower, upper] in &self.touching {
            neighbours[*lower][1] += 1;
            neighbours[*upper][0] += 1;
        }
        let mut below: Vec<Option<usize>> = vec![None; self.pieces.len()];
        for [lower, upper] in &self.touching {
            if neighbours[*lower][1] == 1 && neighbours[*upper][0] == 1 {
                below[*upper] = Some(*lower);
            }
        }
        for (index, below) in below.into_iter().enumerate() {
            self.pieces[index].arc = match below {
                Some(lower) => self.pieces[lower].arc,
                None => {
                    self.arcs += 1;
                    self.arcs - 1
                }
            };
        }
    }

    pub(super) const fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Most pieces of a slab.
    pub(super) fn most_on_a_line(&self) -> usize {
        let slabs = self.pieces.chunk_by(|a, b| a.slab == b.slab);
        slabs.map(<[Piece]>::len).max().unwrap_or(0)
    }

    pub(super) fn slab(&self, index: usize) -> usize {
        self.pieces[index].slab
    }

    pub(super) fn arc(&self, index: usize) -> usize {
        self.pieces[index].arc
    }

    /// Path and side parameter of the middle.
    pub(super) fn middle(&self, index: usize) -> [f64; 2] {
        let piece = &self.pieces[index];
        let path = piece.left.iter().chain(&piece.right).sum::<f64>() / 4.0;
        [
            path,
            0.5 * (self.levels[piece.slab] + self.levels[piece.slab + 1]),
        ]
    }

    /// Along the side parameter.
    pub(super) fn height(&self, index: usize) -> f64 {
        let slab = self.pieces[index].slab;
        self.levels[slab + 1] - self.levels[slab]
    }

    /// From a piece to another one of its slab, on the path parameter.
    pub(super) fn gap(&self, left: usize, right: usize) -> f64 {
        let [left, right] = [self.pieces[left].right, self.pieces[right].left];
        0.5 * (right[0] + right[1] - left[0] - left[1])
    }

    /// How much of the level between them two pieces share, on the path parameter.
    pub(super) fn contact_width(&self, lower: usize, upper: usize) -> f64 {
        let (lower, upper) = (&self.pieces[lower], &self.pieces[upper]);
        lower.right[1].min(upper.right[0]) - lower.left[1].max(upper.left[0])
    }

    /// The pieces of each arc.
    pub(super) fn arcs(&self) -> Vec<Vec<usize>> {
        let mut arcs = vec![Vec::new(); self.arcs];
        for (index, piece) in self.pieces.iter().enumerate() {
            arcs[piece.arc].push(index);
        }
        arcs
    }

    /// Pieces of different arcs that touch, with the arcs, ascending.
    pub(super) fn contacts(&self) -> Vec<([usize; 2], [usize; 2])> {
        self.touching
            .iter()
            .filter_map(|pair| {
                let [a, b] = pair.map(|index| self.pieces[index].arc);
                (a != b).then_some(([a.min(b), a.max(b)], *pair))
            })
            .collect()
    }

    /// Both ends of the lowest line of these pieces, or of the highest one: path and side parameter.
    pub(super) fn ends(&self, pieces: &[usize], is_top: bool) -> [[f64; 2]; 2] {
        let slabs = pieces.iter().map(|index| self.slab(*index));
        let slab = if is_top { slabs.max() } else { slabs.min() }.unwrap_or(0);
        let k = usize::from(is_top);
        let here = pieces.iter().filter(|index| self.slab(**index) == slab);
        let [low, high] = here.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], index| {
            let piece = &self.pieces[*index];
            [low.min(piece.left[k]), high.max(piece.right[k])]
        });
        [low, high].map(|path| [path, self.levels[slab + k]])
    }

    /// The polygons of a cell, one for each arc in it: up along the right edges and down along the left ones, with the vertices of the region alone.
    pub(super) fn polygons(&self, pieces: &[usize], along: Along) -> Vec<Polygon> {
        let mut arcs: Vec<(usize, Vec<usize>)> = Vec::new();
        for index in pieces {
            let arc = self.pieces[*index].arc;
            match arcs.iter_mut().find(|(number, _)| *number == arc) {
                Some((_, of)) => of.push(*index),
                None => arcs.push((arc, vec![*index])),
            }
        }
        arcs.iter().map(|(_, of)| self.polygon(of, along)).collect()
    }

    fn polygon(&self, pieces: &[usize], along: Along) -> Polygon {
        let chain = |k: usize| -> Vec<[f64; 2]> {
            let mut places: Vec<[f64; 2]> = Vec::new();
            let mut last: Option<&Piece> = None;
            for index in pieces {
                let piece = &self.pieces[*index];
                let ends = [piece.left, piece.right][k];
                if last.is_none_or(|last| last.edges[k] != piece.edges[k]) {
                    if let Some(last) = last {
                        places.push([[last.left, last.right][k][1], self.levels[piece.slab]]);
                    }
                    places.push([ends[0], self.levels[piece.slab]]);
                }
                last = Some(piece);
            }
            if let Some(last) = last {
                places.push([[last.left, last.right][k][1], self.levels[last.slab + 1]]);
            }
            places
        };
        let (left, right) = (chain(0), chain(1));
        let mut polygon: Polygon = right.into_iter().chain(left.into_iter().rev()).collect();
        polygon.dedup();
        if polygon.first() == polygon.last() {
            polygon.pop();
        }
        if along == Along::V {
            polygon.iter_mut().for_each(|place| place.reverse());
        }
        polygon
    }
}
