//! Bounding volume hierarchy over all segments of the tool path: queries reach any part of it, not only the neighbouring passes.

use super::height::Ray;
use super::track::{ToolPath, across};
use glam::DVec3;

/// Steps between samples per leaf: few enough for tight boxes, enough for a small tree.
const SEGMENT_STEPS: usize = 16;
/// Depth of a tree over 2^31 segments, plus one: bounds the traversal stack.
const DEPTH_MAX: usize = 33;

/// Consecutive samples of one pass, ends included.
#[derive(Clone, Copy, Debug)]
struct Segment {
    pass: u32,
    from: u32,
    to: u32,
    /// Centres at its ends, mm.
    ends: [DVec3; 2],
    /// Upper bound of the distance of the samples from the straight line between the ends, mm.
    off_mm: f64,
}

#[derive(Clone, Copy, Debug)]
struct BoundingBox {
    low: DVec3,
    high: DVec3,
}

impl BoundingBox {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    fn with(mut self, point: DVec3) -> Self {
        self.low = self.low.min(point);
        self.high = self.high.max(point);
        self
    }

    fn middle(&self) -> DVec3 {
        (self.low + self.high) * 0.5
    }

    /// Least scalar product of the box's points with a vector.
    fn least_along(&self, along: DVec3) -> f64 {
        (self.low * along).min(self.high * along).element_sum()
    }

    /// Squared distance of a point from the box.
    fn squared(&self, point: DVec3) -> f64 {
        let off = (self.low - point).max(point - self.high).max(DVec3::ZERO);
        off.length_squared()
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: BoundingBox,
    /// A leaf's segment, or the second child; the first child follows its parent.
    next: u32,
    leaf: bool,
}

/// The tool path of a run, for queries by location.
#[derive(Debug)]
pub(super) struct PathTree<'a> {
    track: &'a ToolPath,
    radius: f64,
    segments: Vec<Segment>,
    nodes: Vec<Node>,
}

/// Index of a sample: pass, and index in the pass.
pub(super) type SampleIndex = (u32, u32);

/// Parameters of a depth query at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthQuery {
    /// Radius around the point for which the bound must hold, mm.
    pub(super) around_mm: f64,
    /// Largest magnitude of the normal curvature around the point, 1/mm.
    pub(super) curvature: f64,
    /// Depths below this are irrelevant, mm.
    pub(super) floor_mm: f64,
    /// Least depth that counts as a gouge, mm: deeper balls are never excluded.
    pub(super) gouge_mm: f64,
    /// Path and side parameters of the contacts that are excluded from the bound.
    pub(super) excluded: [[f64; 2]; 2],
}

/// Depth of the balls at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct BallDepth {
    /// Radius minus the distance of the nearest centre, mm; at least 0.
    pub(super) depth_mm: f64,
    /// The sample at the nearest centre, or before it; `None` where the depth is 0.
    pub(super) by: Option<SampleIndex>,
    /// Upper bound of the depth around the point, mm, at least the floor; excluded balls do not count.
    pub(super) bound_mm: f64,
}

impl<'a> PathTree<'a> {
    pub(super) fn new(track: &'a ToolPath, radius: f64) -> Self {
        let mut segments = Vec::new();
        for (pass, samples) in (0_u32..).zip(&track.passes) {
            let last = samples.cl_nm.len() - 1;
            let mut from = 0;
            loop {
                let to = (from + SEGMENT_STEPS).min(last);
                let ends = [from, to].map(|k| samples.centre(k));
                let off_mm = (from..=to)
                    .map(|k| nearest(samples.centre(k), ends).1)
                    .fold(0.0, f64::max);
                #[allow(clippy::cast_possible_truncation, reason = "a tick is 32 bits")]
                segments.push(Segment {
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
            segments,
            nodes: Vec::new(),
        };
        let boxes: Vec<BoundingBox> = tree.segments.iter().map(|segment| tree.bounds(segment)).collect();
        #[allow(
            clippy::cast_possible_truncation,
            reason = "fewer than ticks, which are 32 bits"
        )]
        let mut order: Vec<u32> = (0..tree.segments.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * order.len());
        if !order.is_empty() {
            build(&mut nodes, &mut order, &boxes);
        }
        tree.nodes = nodes;
        tree
    }

    fn bounds(&self, segment: &Segment) -> BoundingBox {
        (segment.from..=segment.to).fold(BoundingBox::EMPTY, |bounds, k| {
            bounds.with(self.centre(segment.pass, k))
        })
    }

    fn centre(&self, pass: u32, index: u32) -> DVec3 {
        self.track.passes[pass as usize].centre(index as usize)
    }

    /// Visits all leaves whose boxes satisfy `wanted`, in the order of their distance from a point.
    fn walk(
        &self,
        from: DVec3,
        mut wanted: impl FnMut(&BoundingBox) -> bool,
        mut leaf: impl FnMut(&Segment),
    ) {
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
                leaf(&self.segments[node.next as usize]);
            } else {
                let [near, far] = [index + 1, node.next];
                let squared = |index: u32| self.nodes[index as usize].bounds.squared(from);
                let swap = squared(far) < squared(near);
                stack[depth..depth + 2].copy_from_slice(&if swap { [near, far] } else { [far, near] });
                depth += 2;
            }
        }
    }

    /// Least height at which the ray enters a ball, if below `height`; else `height`.
    pub(super) fn entry(&self, ray: &Ray, height: f64) -> f64 {
        use std::cell::Cell;
        let best = Cell::new(height);
        self.walk(
            ray.from,
            |bounds| {
                // A ball entered below `best` and left above the surface contains a point of the ray between.
                let half = 0.5 * best.get().max(0.0);
                let reach = self.radius + half;
                // The entry is at most one radius below the ball's centre.
                let lowest = bounds.least_along(ray.along) - ray.from.dot(ray.along) - self.radius;
                lowest < best.get() && bounds.squared(ray.at(half)) <= reach * reach
            },
            |segment| {
                let half = 0.5 * best.get().max(0.0);
                if nearest(ray.at(half), segment.ends).1 > self.radius + half + segment.off_mm {
                    return;
                }
                let mut from = segment.ends[0];
                if segment.from == segment.to {
                    best.set(best.get().min(ray.entry([from; 2], self.radius)));
                }
                for k in segment.from..segment.to {
                    let to = self.centre(segment.pass, k + 1);
                    best.set(best.get().min(ray.entry([from, to], self.radius)));
                    from = to;
                }
            },
        );
        best.get()
    }

    /// Depth of the balls at a point, and its upper bound around the point.
    ///
    /// The distance d from a straight segment of the path is a convex function in space, so the depth f = r - d stays below its
    /// tangent plane: it grows by at most sin(a) along the tangent plane of the surface (a: angle between the vector to the nearest
    /// centre and the normal), and by 1 along the normal, along which the surface leaves that plane with its curvature. Around P
    /// it is therefore at most `f + around sin(a) + around^2 curvature / 2`.
    pub(super) fn depth(&self, ray: &Ray, reach: &DepthQuery) -> BallDepth {
        use std::cell::Cell;
        let second = 0.5 * reach.around_mm * reach.around_mm * reach.curvature;
        let best: Cell<(f64, Option<SampleIndex>)> = Cell::new((0.0, None));
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
                let off = across(middle - ray.from, ray.along).length() + bounds.high.distance(middle);
                let sine = if off < near { off / near } else { 1.0 };
                depth + reach.around_mm * sine + second > bound.get()
            },
            |segment| {
                let samples = &self.track.passes[segment.pass as usize];
                let [path, side] = reach.excluded;
                let inside = |range: [f64; 2], at: f64| (range[0]..=range[1]).contains(&at);
                let is_beside = |k: u32| {
                    inside(side, samples.side_of(k as usize)) && inside(path, samples.path[k as usize])
                };
                // First the same bound for the chord between the ends, with the segment's largest deviation from it.
                let (off, distance) = nearest(ray.from, segment.ends);
                let depth = self.radius - distance + segment.off_mm;
                if depth <= best.get().0.max(reach.gouge_mm) {
                    let sine = (across(off, ray.along).length() / distance).min(1.0);
                    // Along a straight pass the ends tell of all between them.
                    let left_out = if samples.sides.is_empty() {
                        is_beside(segment.from) && is_beside(segment.to)
                    } else {
                        (segment.from..=segment.to).all(is_beside)
                    };
                    if left_out || depth + reach.around_mm * sine + second <= bound.get() {
                        return;
                    }
                }
                let mut from = segment.ends[0];
                for k in segment.from..segment.to.max(segment.from + 1) {
                    let to = self.centre(segment.pass, (k + 1).min(segment.to));
                    let (off, distance) = nearest(ray.from, [from, to]);
                    from = to;
                    let depth = self.radius - distance;
                    if depth > best.get().0 {
                        best.set((depth, Some((segment.pass, k))));
                    }
                    if depth <= reach.gouge_mm && is_beside(k) {
                        continue;
                    }
                    let sine = (across(off, ray.along).length() / distance).min(1.0);
                    let may = depth + reach.around_mm * sine + second;
                    bound.set(bound.get().max(may));
                }
            },
        );
        let (depth_mm, by) = best.get();
        BallDepth {
            depth_mm,
            by,
            bound_mm: bound.get(),
        }
    }
}

/// Vector from a point to the nearest point of a line segment, and its length.
fn nearest(point: DVec3, [from, to]: [DVec3; 2]) -> (DVec3, f64) {
    let (axis, m) = (to - from, from - point);
    let squared = axis.length_squared();
    let share = if squared > 0.0 {
        (-m.dot(axis) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let off = m + axis * share;
    (off, off.length())
}

/// Builds the nodes over these segments, parents before children, split at the median of the longest side.
fn build(nodes: &mut Vec<Node>, order: &mut [u32], boxes: &[BoundingBox]) {
    let mut bounds = BoundingBox::EMPTY;
    let mut middles = BoundingBox::EMPTY;
    for segment in order.iter() {
        let segment = &boxes[*segment as usize];
        bounds = bounds.with(segment.low).with(segment.high);
        middles = middles.with(segment.middle());
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
    let sizes = middles.high - middles.low;
    let axis = (0..3).fold(0, |axis, k| if sizes[k] > sizes[axis] { k } else { axis });
    let half = order.len() / 2;
    let key = |segment: &u32| boxes[*segment as usize].middle()[axis];
    order.select_nth_unstable_by(half, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
    let (low, high) = order.split_at_mut(half);
    build(nodes, low, boxes);
    #[allow(clippy::cast_possible_truncation, reason = "twice the segments at most")]
    let second = nodes.len() as u32;
    build(nodes, high, boxes);
    nodes[index].next = second;
    nodes[index].leaf = false;
}
