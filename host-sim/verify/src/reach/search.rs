//! The deepest place of an obstacle in a part of the tool, by branch and bound over cells of the obstacle.
//!
//! With p a place of the obstacle and c a position of the ball's centre, the depth of p in a convex part of the tool is a concave function of
//! p - c, and changes by at most the distance. So around p it is below its tangent plane: over a cell of radius R on a surface with the normal N
//! and the largest curvature k it grows by at most R times the gradient's part across N, and by R^2 k / 2 along N. Each face of the part (bottom,
//! top, side) gives such a bound; their least holds. A wall beside the shank is closed by the side alone, with cells of sqrt(2 r floor).
//!
//! For the ball the cell is within a disc of radius R and half the height R^2 k / 2 along N. Its distance from the centre is convex along a chord.

use std::cell::Cell;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::body::{Solid, ToolPart, ball_depth};
use super::path::{Bounds, Chord, PathTree};

/// Largest number of splits of a cell.
const SPLITS_MAX: usize = 20;
/// Largest number of cells evaluated for one part.
const CELLS_MAX: usize = 2_000_000;
/// Precision of the greatest depth, as a share, added to [`DEPTH_MM`].
const DEPTH_SHARE: f64 = 0.01;
/// Precision of the greatest depth, mm.
const DEPTH_MM: f64 = 1e-3;
/// Precision of a clearance, as a share.
const CLEARANCE_SHARE: f64 = 0.02;

/// Steps of the golden section along a chord: to 1e-7 of its length.
const GOLDEN_STEPS: usize = 34;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// What is searched for: a solid, or the ball.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    /// A ball with this radius, mm.
    Ball(f64),
    /// A part above it.
    Solid(Solid),
}

impl Shape {
    /// Largest radius, mm.
    pub(super) fn widest(&self) -> f64 {
        match self {
            Self::Ball(radius) => *radius,
            Self::Solid(solid) => solid.radius[0].max(solid.radius[1]),
        }
    }

    pub(super) fn part(&self) -> ToolPart {
        match self {
            Self::Ball(_) => ToolPart::Ball,
            Self::Solid(solid) => solid.part,
        }
    }

    /// Depth of a vertical line, as [`Solid::depth`].
    pub(super) fn depth(&self, rho: f64, z: [f64; 2]) -> f64 {
        match self {
            Self::Ball(radius) => ball_depth(*radius, rho, z),
            Self::Solid(solid) => solid.depth(rho, z),
        }
    }
}

/// A cell of an obstacle: its middle, and how far it extends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spot {
    /// The middle, mm; the obstacle reaches from its z to `up_to`.
    pub(super) place: DVec3,
    pub(super) up_to: f64,
    /// Largest distance of the cell's places from the middle, mm.
    pub(super) around_mm: f64,
    /// Unit normal; `None` where there is none, or where it differs much within the cell.
    pub(super) normal: Option<DVec3>,
    /// Largest magnitude of the curvature, 1/mm.
    pub(super) curvature: f64,
    /// Whether the middle belongs to the obstacle; else only a part around it may.
    pub(super) counts: bool,
}

/// An obstacle, in cells that can be split.
pub(super) trait Obstacle: Sync {
    type Cell: Copy + Send + Sync;
    fn start(&self) -> Vec<Self::Cell>;
    /// `None`: nothing of the cell belongs to the obstacle.
    fn spot(&self, cell: &Self::Cell) -> Option<Spot>;
    fn split(&self, cell: &Self::Cell, into: &mut Vec<Self::Cell>);
}

/// The deepest place found.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deepest<C> {
    pub(super) depth_mm: f64,
    pub(super) place: DVec3,
    pub(super) cell: C,
    /// Sample of the tool.
    pub(super) sample: usize,
    pub(super) centre: DVec3,
}

/// Result of a search.
#[derive(Clone, Copy, Debug)]
pub(super) struct Searched<C> {
    pub(super) deepest: Option<Deepest<C>>,
    /// Upper bound of the depth everywhere, mm.
    pub(super) bound_mm: f64,
}

/// A query around one place.
struct Query<'a> {
    shape: &'a Shape,
    spot: Spot,
    /// Share of the vertical, and of a horizontal direction, across the normal.
    vertical: f64,
    /// Growth along the normal, mm.
    second: f64,
}

impl Query<'_> {
    fn new<'a>(shape: &'a Shape, spot: Spot) -> Query<'a> {
        let second = spot
            .normal
            .map_or(0.0, |_| 0.5 * spot.around_mm * spot.around_mm * spot.curvature);
        Query {
            shape,
            vertical: spot
                .normal
                .map_or(1.0, |normal| (1.0 - normal.z * normal.z).max(0.0).sqrt()),
            second,
            spot,
        }
    }

    /// Part of a horizontal vector across the normal.
    fn across(&self, off: DVec2) -> f64 {
        let off = off.extend(0.0);
        match self.spot.normal {
            Some(normal) => (off - normal * off.dot(normal)).length(),
            None => off.length(),
        }
    }

    /// Upper bound of the depth around the place for centres at the distance `rho`, seen from above, with the obstacle at heights from `z[0]` to
    /// `z[1]` above them; `sideways`: largest part across the normal of the horizontal direction from them.
    fn bound(&self, rho: f64, z: [f64; 2], sideways: f64) -> f64 {
        let around = self.spot.around_mm;
        let lipschitz = self.shape.depth(rho, z) + around;
        let tangent = match self.shape {
            Shape::Ball(_) => return lipschitz,
            Shape::Solid(solid) => {
                let [sine, cosine] = solid.slope();
                let widest = solid.radius_at(z[0]).max(solid.radius_at(z[1]));
                let side = (widest - rho) * cosine
                    + around * (sideways * cosine + self.vertical * sine.abs()).min(1.0);
                let upright = around * self.vertical;
                side.min(z[1] - solid.z[0] + upright)
                    .min(solid.z[1] - z[0] + upright)
                    + self.second
            }
        };
        lipschitz.min(tangent)
    }

    fn heights(&self, low: f64, high: f64) -> [f64; 2] {
        [self.spot.place.z - high, self.spot.up_to - low]
    }

    fn bound_of_box(&self, bounds: &Bounds) -> f64 {
        let rho = bounds.across(self.spot.place);
        let sideways = if rho > 0.0 {
            let middle = (bounds.low + bounds.high).truncate() * 0.5;
            let half = (bounds.high - bounds.low).truncate().length() * 0.5;
            ((self.across(middle - self.spot.place.truncate()) + half) / rho).min(1.0)
        } else {
            1.0
        };
        // The direction changes over the cell's own extent only by what the tangent plane covers.
        self.bound(rho, self.heights(bounds.low.z, bounds.high.z), sideways)
    }

    /// [`Self::chord`] for a ball of this radius and a place of a surface with this normal.
    fn ball_chord(&self, radius: f64, normal: DVec3, chord: &Chord) -> (f64, f64, f64) {
        let (place, around) = (self.spot.place, self.spot.around_mm);
        let share = chord.nearest_in_space(place);
        let depth = radius - chord.at(share).distance(place);
        if depth + around <= 0.0 {
            return (depth + around, depth, share);
        }
        let distance = |share: f64| {
            let off = chord.at(share) - place;
            let along = off.dot(normal);
            let beside = (off - normal * along).length();
            (beside - around)
                .max(0.0)
                .hypot((along.abs() - self.second).max(0.0))
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..GOLDEN_STEPS {
            let reach = GOLDEN * (high - low);
            if distance(high - reach) <= distance(low + reach) {
                high = low + reach;
            } else {
                low = high - reach;
            }
        }
        // The distance changes by at most as much as the centre moves.
        let rest = (high - low) * chord.ends[0].distance(chord.ends[1]);
        let bound = radius - distance(0.5 * (low + high)) + rest;
        (bound.min(depth + around), depth, share)
    }

    /// Upper bound around the place for a chord, and the depth at its nearest point or its ends, with the share of the way.
    fn chord(&self, chord: &Chord) -> (f64, f64, f64) {
        if let (Shape::Ball(radius), Some(normal)) = (self.shape, self.spot.normal)
            && self.spot.up_to <= self.spot.place.z
        {
            return self.ball_chord(*radius, normal, chord);
        }
        let place = self.spot.place;
        let share = chord.nearest(place);
        let off = (chord.at(share) - place).truncate();
        let rho = off.length();
        let [a, b] = chord.ends.map(|end| end.z);
        let around = self.spot.around_mm;
        let sideways = if rho > 0.0 {
            (self.across(off) / rho).min(1.0)
        } else {
            1.0
        };
        // Elsewhere on the chord the direction is another, but the distance is larger.
        let upright = chord.ends[0].truncate() == chord.ends[1].truncate();
        let turned = if upright {
            0.0
        } else {
            (around.hypot(rho) - rho).min(around)
        };
        let bound = self.bound(rho, self.heights(a.min(b), a.max(b)), sideways) + turned;
        let depth = |share: f64| {
            let centre = chord.at(share);
            let rho = (centre - place).truncate().length();
            self.shape
                .depth(rho, [place.z - centre.z, self.spot.up_to - centre.z])
        };
        let mut best = (depth(share), share);
        for end in [0.0, 1.0] {
            let there = depth(end);
            if there > best.0 {
                best = (there, end);
            }
        }
        let lipschitz = self.shape.depth(rho, self.heights(a.min(b), a.max(b))) + around;
        (bound.min(lipschitz), best.0, best.1)
    }
}

/// A cell with the bound of its depth, and the deepest place found in it.
struct Evaluated<C> {
    cell: C,
    bound: f64,
    found: Option<Deepest<C>>,
}

fn evaluate<O: Obstacle>(
    obstacle: &O,
    tree: &PathTree,
    shape: &Shape,
    cell: O::Cell,
    floor: f64,
) -> Option<Evaluated<O::Cell>> {
    let spot = obstacle.spot(&cell)?;
    let query = Query::new(shape, spot);
    let most = Cell::new(floor);
    let best: Cell<(f64, Option<(Chord, f64)>)> = Cell::new((f64::NEG_INFINITY, None));
    tree.walk(
        |bounds| query.bound_of_box(bounds),
        || most.get(),
        |chord| {
            let (bound, depth, share) = query.chord(chord);
            if spot.counts && depth > best.get().0 {
                best.set((depth, Some((*chord, share))));
            }
            most.set(most.get().max(bound));
        },
    );
    let (depth_mm, by) = best.get();
    let found = by.map(|(chord, share)| Deepest {
        depth_mm,
        place: spot.place,
        cell,
        sample: chord.sample(share),
        centre: chord.at(share),
    });
    Some(Evaluated {
        cell,
        bound: most.get(),
        found,
    })
}

/// Searches the deepest place of an obstacle in a shape. Depths below `floor_mm` are not searched further; minus infinity: a clearance is.
pub(super) fn search<O: Obstacle>(
    obstacle: &O,
    tree: &PathTree,
    shape: &Shape,
    floor_mm: f64,
) -> Searched<O::Cell> {
    let mut deepest: Option<Deepest<O::Cell>> = None;
    let closing = |deepest: &Option<Deepest<O::Cell>>| {
        let found = deepest
            .as_ref()
            .map_or(f64::NEG_INFINITY, |deepest| deepest.depth_mm);
        let share = if found > 0.0 { DEPTH_SHARE } else { CLEARANCE_SHARE };
        floor_mm.max(found + found.abs() * share + DEPTH_MM)
    };
    let mut cells = obstacle.start();
    let (mut evaluations, mut left) = (0, f64::NEG_INFINITY);
    for round in 0..=SPLITS_MAX {
        evaluations += cells.len();
        let floor = closing(&deepest);
        let mut open: Vec<Evaluated<O::Cell>> = cells
            .par_iter()
            .filter_map(|cell| evaluate(obstacle, tree, shape, *cell, floor))
            .collect();
        for evaluated in &open {
            let most = deepest.as_ref().map_or(f64::NEG_INFINITY, |most| most.depth_mm);
            if let Some(found) = &evaluated.found
                && found.depth_mm > most
            {
                deepest = Some(*found);
            }
        }
        let closes = closing(&deepest);
        open.retain(|evaluated| evaluated.bound > closes);
        let room = CELLS_MAX.saturating_sub(evaluations) / 4;
        if open.len() > room || round == SPLITS_MAX {
            open.sort_by(|a, b| b.bound.total_cmp(&a.bound));
            let keep = if round == SPLITS_MAX { 0 } else { room };
            left = open.get(keep).map_or(left, |first| left.max(first.bound));
            open.truncate(keep);
        }
        cells.clear();
        for evaluated in &open {
            obstacle.split(&evaluated.cell, &mut cells);
        }
        if cells.is_empty() {
            break;
        }
    }
    Searched {
        bound_mm: left.max(closing(&deepest)),
        deepest,
    }
}
