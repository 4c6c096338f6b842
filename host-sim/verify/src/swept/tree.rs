//! All pieces of the tool path in a tree of boxes, so that any part of it can be asked about, not only the passes next door.

use super::height::Ray;
use super::track::{Track, across};
use oracle::vector::{Vector, add, dot, length, scale, subtract};

/// Steps between samples in a leaf: few enough for tight boxes, enough to keep the tree small.
const PIECE_STEPS: usize = 16;
/// Depth of a tree over 2^31 pieces, and one more: the bound of the walk's stack.
const DEPTH_MAX: usize = 33;

/// A run of samples of one pass, ends included.
#[derive(Clone, Copy, Debug)]
struct Piece {
    pass: u32,
    from: u32,
    to: u32,
    /// Centres at its ends, mm.
    ends: [Vector; 2],
    /// No sample is farther than this from the straight line between them, mm.
    off_mm: f64,
}

#[derive(Clone, Copy, Debug)]
struct Boxed {
    low: Vector,
    high: Vector,
}

impl Boxed {
    const EMPTY: Self = Self {
        low: [f64::INFINITY; 3],
        high: [f64::NEG_INFINITY; 3],
    };

    fn with(mut self, point: Vector) -> Self {
        for (k, at) in point.iter().enumerate() {
            self.low[k] = self.low[k].min(*at);
            self.high[k] = self.high[k].max(*at);
        }
        self
    }

    fn middle(&self) -> Vector {
        scale(add(self.low, self.high), 0.5)
    }

    /// Least of the products of its points with a vector.
    fn least_along(&self, along: Vector) -> f64 {
        (0..3)
            .map(|k| (self.low[k] * along[k]).min(self.high[k] * along[k]))
            .sum()
    }

    /// Squared distance of a point from the box.
    fn squared(&self, point: Vector) -> f64 {
        let mut sum = 0.0;
        for (k, at) in point.iter().enumerate() {
            let off = (self.low[k] - at).max(at - self.high[k]).max(0.0);
            sum += off * off;
        }
        sum
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Boxed,
    /// A leaf's piece, or the second child; the first one follows its parent.
    next: u32,
    leaf: bool,
}

/// The tool path of a run, to be asked where it comes near something.
#[derive(Debug)]
pub(super) struct Tree<'a> {
    track: &'a Track,
    radius: f64,
    pieces: Vec<Piece>,
    nodes: Vec<Node>,
}

/// A sample: pass and index in it.
pub(super) type Cut = (u32, u32);

/// Which balls a place is asked about, and what about them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// How far around the place the answer is to hold, mm.
    pub(super) around_mm: f64,
    /// Largest normal curvature around the place, either way, 1/mm.
    pub(super) bend: f64,
    /// Depths below this do not matter, mm.
    pub(super) floor_mm: f64,
    /// What counts as a gouge, mm: no ball that goes deeper is left out.
    pub(super) gouge_mm: f64,
    /// Path and side parameters of the contacts that are left out of the bound.
    pub(super) but: [[f64; 2]; 2],
}

/// How deep the balls go into a place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Depth {
    /// Radius less distance of the nearest centre, mm, if above 0; else 0.
    pub(super) depth_mm: f64,
    /// The sample at whose centre, or between which and the next, that is.
    pub(super) by: Option<Cut>,
    /// What the depth may reach around the place, mm, at least the floor; balls that are left out do not count.
    pub(super) bound_mm: f64,
}

impl<'a> Tree<'a> {
    pub(super) fn new(track: &'a Track, radius: f64) -> Self {
        let mut pieces = Vec::new();
        for (pass, samples) in (0_u32..).zip(&track.passes) {
            let last = samples.cl_nm.len() - 1;
            let mut from = 0;
            loop {
                let to = (from + PIECE_STEPS).min(last);
                let ends = [from, to].map(|k| samples.centre(k));
                let off_mm = (from..=to)
                    .map(|k| nearest(samples.centre(k), ends).1)
                    .fold(0.0, f64::max);
                #[allow(clippy::cast_possible_truncation, reason = "a tick is 32 bits")]
                pieces.push(Piece {
                    pass,
                    from: from as u32,
                    to: to as u32,
                    ends,
                    off_mm,
                });
                if to == last {
                    break;
                }
                from = to;
            }
        }
        let mut tree = Self {
            track,
            radius,
            pieces,
            nodes: Vec::new(),
        };
        let boxes: Vec<Boxed> = tree.pieces.iter().map(|piece| tree.bounds(piece)).collect();
        #[allow(
            clippy::cast_possible_truncation,
            reason = "fewer than ticks, which are 32 bits"
        )]
        let mut order: Vec<u32> = (0..tree.pieces.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * order.len());
        if !order.is_empty() {
            build(&mut nodes, &mut order, &boxes);
        }
        tree.nodes = nodes;
        tree
    }

    fn bounds(&self, piece: &Piece) -> Boxed {
        (piece.from..=piece.to).fold(Boxed::EMPTY, |bounds, k| bounds.with(self.centre(piece.pass, k)))
    }

    fn centre(&self, pass: u32, index: u32) -> Vector {
        self.track.passes[pass as usize].centre(index as usize)
    }

    /// Walks all leaves whose boxes pass `wanted`, those nearer to a point first.
    fn walk(&self, from: Vector, mut wanted: impl FnMut(&Boxed) -> bool, mut leaf: impl FnMut(&Piece)) {
        let mut stack = [0_u32; DEPTH_MAX];
        let mut depth = 1;
        if self.nodes.is_empty() {
            return;
        }
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index as usize];
            if !wanted(&node.bounds) {
                continue;
            }
            if node.leaf {
                leaf(&self.pieces[node.next as usize]);
            } else {
                let [near, far] = [index + 1, node.next];
                let squared = |index: u32| self.nodes[index as usize].bounds.squared(from);
                let swap = squared(far) < squared(near);
                stack[depth..depth + 2].copy_from_slice(&if swap { [near, far] } else { [far, near] });
                depth += 2;
            }
        }
    }

    /// Where the ray enters any ball, if that is below `height`; else `height`.
    pub(super) fn entry(&self, ray: &Ray, height: f64) -> f64 {
        use std::cell::Cell;
        let best = Cell::new(height);
        self.walk(
            ray.from,
            |bounds| {
                // A ball that is entered below `best`, and left above the surface, holds a point of the ray between.
                let half = 0.5 * best.get().max(0.0);
                let reach = self.radius + half;
                // And it is entered a radius below its centre at the lowest.
                let lowest = bounds.least_along(ray.along) - dot(ray.from, ray.along) - self.radius;
                lowest < best.get() && bounds.squared(ray.at(half)) <= reach * reach
            },
            |piece| {
                let half = 0.5 * best.get().max(0.0);
                if nearest(ray.at(half), piece.ends).1 > self.radius + half + piece.off_mm {
                    return;
                }
                let mut from = piece.ends[0];
                if piece.from == piece.to {
                    best.set(best.get().min(ray.entry([from; 2], self.radius)));
                }
                for k in piece.from..piece.to {
                    let to = self.centre(piece.pass, k + 1);
                    best.set(best.get().min(ray.entry([from, to], self.radius)));
                    from = to;
                }
            },
        );
        best.get()
    }

    /// How deep the balls go into a place, and what that may come to around it.
    ///
    /// The distance d from a straight piece of path is a convex function in space, so the depth f = r - d stays below its
    /// tangent plane: it grows by at most sin(a) along the tangent plane of the surface (a: the angle of the way to the nearest
    /// centre and the normal), and by 1 along the normal, by which the surface leaves that plane as its curvature says. So
    /// around P it stays below `f + around sin(a) + around^2 bend / 2`.
    pub(super) fn depth(&self, ray: &Ray, reach: &Reach) -> Depth {
        use std::cell::Cell;
        let second = 0.5 * reach.around_mm * reach.around_mm * reach.bend;
        let best: Cell<(f64, Option<Cut>)> = Cell::new((0.0, None));
        let bound = Cell::new(reach.floor_mm);
        self.walk(
            ray.from,
            |bounds| {
                let near = bounds.squared(ray.from).sqrt();
                let depth = self.radius - near;
                if depth > best.get().0 {
                    return true;
                }
                let middle = bounds.middle();
                let off = length(across(subtract(middle, ray.from), ray.along))
                    + length(subtract(bounds.high, middle));
                let sine = if off < near { off / near } else { 1.0 };
                depth + reach.around_mm * sine + second > bound.get()
            },
            |piece| {
                let samples = &self.track.passes[piece.pass as usize];
                let [path, side] = reach.but;
                let inside = |range: [f64; 2], at: f64| (range[0]..=range[1]).contains(&at);
                let beside = inside(side, samples.side);
                // The same bound for the straight line from end to end first, which no piece leaves by more than so much.
                let (off, distance) = nearest(ray.from, piece.ends);
                let depth = self.radius - distance + piece.off_mm;
                if depth <= best.get().0.max(reach.gouge_mm) {
                    let sine = (length(across(off, ray.along)) / distance).min(1.0);
                    let ends = [piece.from, piece.to];
                    let left_out = beside && ends.into_iter().all(|k| inside(path, samples.path[k as usize]));
                    if left_out || depth + reach.around_mm * sine + second <= bound.get() {
                        return;
                    }
                }
                let mut from = piece.ends[0];
                for k in piece.from..piece.to.max(piece.from + 1) {
                    let to = self.centre(piece.pass, (k + 1).min(piece.to));
                    let (off, distance) = nearest(ray.from, [from, to]);
                    from = to;
                    let depth = self.radius - distance;
                    if depth > best.get().0 {
                        best.set((depth, Some((piece.pass, k))));
                    }
                    if beside && depth <= reach.gouge_mm && inside(path, samples.path[k as usize]) {
                        continue;
                    }
                    let sine = (length(across(off, ray.along)) / distance).min(1.0);
                    let may = depth + reach.around_mm * sine + second;
                    bound.set(bound.get().max(may));
                }
            },
        );
        let (depth_mm, by) = best.get();
        Depth {
            depth_mm,
            by,
            bound_mm: bound.get(),
        }
    }
}

/// From a point to the nearest one of a line between two others: the vector, and its length.
fn nearest(point: Vector, [from, to]: [Vector; 2]) -> (Vector, f64) {
    let (axis, m) = (subtract(to, from), subtract(from, point));
    let squared = dot(axis, axis);
    let share = if squared > 0.0 {
        (-dot(m, axis) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off = add(m, scale(axis, share));
    (off, length(off))
}

/// The nodes over these pieces, parents before their children, split at the middle of the longest side.
fn build(nodes: &mut Vec<Node>, order: &mut [u32], boxes: &[Boxed]) {
    let mut bounds = Boxed::EMPTY;
    let mut middles = Boxed::EMPTY;
    for piece in order.iter() {
        let piece = &boxes[*piece as usize];
        bounds = bounds.with(piece.low).with(piece.high);
        middles = middles.with(piece.middle());
    }
    let index = nodes.len();
    nodes.push(Node {
        bounds,
        next: order.first().copied().unwrap_or(0),
        leaf: true,
    });
    if order.len() <= 1 {
        return;
    }
    let sizes = subtract(middles.high, middles.low);
    let axis = (0..3).fold(0, |axis, k| if sizes[k] > sizes[axis] { k } else { axis });
    let half = order.len() / 2;
    let key = |piece: &u32| boxes[*piece as usize].middle()[axis];
    order.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(half);
    build(nodes, low, boxes);
    #[allow(clippy::cast_possible_truncation, reason = "twice the pieces at most")]
    let second = nodes.len() as u32;
    build(nodes, high, boxes);
    nodes[index].next = second;
    nodes[index].leaf = false;
}
