//! The proof: every centre of a motion against the whole part by exact distance, and what the passes leave on the reachable part of the face.

use glam::DVec3;
use rayon::prelude::*;

use crate::body::Part;
use crate::clear::Clearance;
use crate::tool::{Reason, Tool};
use crate::tree::{Block, Tree};
use crate::triangle::edge_nearest;

/// Error of a distance, mm: smaller depths are not reported.
pub(crate) const DISTANCE_ERROR_MM: f64 = 5e-4;
/// Distance between checked places of a motion, mm.
const STEP_MM: f64 = 0.1;
/// Number of places of the face at which the height of the remaining material is measured.
pub const LEFTOVER_SIDE: usize = 150;
/// Share by which the remaining material may exceed the scallop limit where passes end.
pub const LEFTOVER_SHARE: f64 = 0.03;

/// The deepest place of the tool in the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deepest {
    /// Depth, mm.
    pub depth_mm: f64,
    /// The part of the tool: [`Reason::Ball`], [`Reason::Shank`] or [`Reason::Holder`].
    pub part: Reason,
    /// The ball's centre.
    pub centre_mm: DVec3,
    /// Index of that centre among the given ones.
    pub index: usize,
    /// Number of the face in the file.
    pub face: usize,
}

/// The deepest place of the tool, of all centres; `None` where it is nowhere deeper than half a micrometre.
#[must_use]
pub fn deepest(part: &Part, tool: &Tool, centres: &[DVec3]) -> Option<Deepest> {
    let found = centres.par_iter().enumerate().filter_map(|(index, centre)| {
        let mut worst: Option<Deepest> = None;
        let mut note = |part: Reason, depth_mm: f64, face: usize| {
            if worst.is_none_or(|worst| depth_mm > worst.depth_mm) {
                worst = Some(Deepest {
                    depth_mm,
                    part,
                    centre_mm: *centre,
                    index,
                    face,
                });
            }
        };
        let number = |face: usize| part.faces[face].face.number;
        if let Some(near) = part.nearest(*centre, tool.radius - DISTANCE_ERROR_MM, None, false) {
            note(Reason::Ball, tool.radius - near.distance, number(near.face));
        }
        for column in &tool.columns {
            let z = column.z.map(|z| centre.z + z);
            if let Some(near) = part.beside(*centre, z, column.radius - DISTANCE_ERROR_MM, false) {
                note(column.part, column.radius - near.distance, number(near.face));
            }
        }
        worst
    });
    found.max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm).then(b.index.cmp(&a.index)))
}

/// Places along a way, close enough that checking each one checks the way.
#[must_use]
pub fn along(way: &[DVec3], radius_mm: f64) -> Vec<DVec3> {
    // Between two places a ball enters an edge deeper by step^2 / (8 r) than at them.
    let step_mm = STEP_MM.min((8.0 * radius_mm * DISTANCE_ERROR_MM).sqrt());
    let mut places: Vec<DVec3> = way.first().copied().into_iter().collect();
    for ends in way.windows(2) {
        let steps = (ends[0].distance(ends[1]) / step_mm).ceil().max(1.0);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few thousand"
        )]
        let count = steps.min(1e5) as usize;
        places.extend((1..=count).map(|k| ends[0].lerp(ends[1], k as f64 / count as f64)));
    }
    places
}

/// What the passes leave on the face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Leftover {
    /// The area that the tool reaches, mm2.
    pub reachable_mm2: f64,
    /// Part of that area on which the remaining material is within the scallop limit, with [`LEFTOVER_SHARE`] more, mm2.
    pub within_mm2: f64,
    /// Highest place, mm, and where it is.
    pub highest_mm: f64,
    /// Its u and v.
    pub uv: [f64; 2],
    /// The place.
    pub place_mm: DVec3,
}

/// The passes: pieces of the way of the ball's centre.
pub struct Passes {
    pieces: Vec<[DVec3; 2]>,
    tree: Tree,
}

impl Passes {
    /// From its pieces.
    #[must_use]
    pub fn new(pieces: Vec<[DVec3; 2]>) -> Self {
        let blocks: Vec<Block> = pieces.iter().map(|ends| Block::around(*ends)).collect();
        Self {
            tree: Tree::new(&blocks),
            pieces,
        }
    }

    /// Height of what is left above a place along its normal, mm; infinite where no ball comes near.
    #[must_use]
    pub fn height(&self, place: DVec3, normal: DVec3, radius: f64) -> f64 {
        let mut least = f64::INFINITY;
        let mut bound = 1.5 * radius;
        self.tree.nearest(
            &mut bound,
            |block| block.distance_squared(place),
            |index, bound| {
                let (distance, centre) = edge_nearest(place, self.pieces[index]);
                if distance >= *bound {
                    return;
                }
                // The normal enters the ball around the nearest centre at this height.
                let from = centre - place;
                let along = from.dot(normal);
                let square = along * along - (distance * distance - radius * radius);
                if square >= 0.0 {
                    least = least.min((along - square.sqrt()).max(0.0));
                }
                // Centres farther than the radius and what is left cannot lower it; one step of slack for the slant.
                *bound = bound.min(distance + 0.2 * radius);
            },
        );
        least
    }
}

/// What the passes leave on a face: at places with their areas, all of the trimmed face.
#[must_use]
pub fn leftover(
    clearance: &Clearance<'_>,
    places: &[([f64; 2], f64)],
    passes: &Passes,
    limit_mm: f64,
) -> Leftover {
    let heights: Vec<Option<(f64, DVec3)>> = places
        .par_iter()
        .map(|(uv, _)| {
            clearance.check(*uv).ok()?;
            let place = clearance.place(*uv);
            Some((
                passes.height(place.point, place.normal, clearance.tool.radius),
                place.point,
            ))
        })
        .collect();
    let mut found = Leftover::default();
    for ((uv, area), height) in places.iter().zip(heights) {
        let Some((height, place_mm)) = height else {
            continue;
        };
        found.reachable_mm2 += area;
        if height <= (1.0 + LEFTOVER_SHARE) * limit_mm {
            found.within_mm2 += area;
        }
        if height > found.highest_mm {
            (found.highest_mm, found.uv, found.place_mm) = (height, *uv, place_mm);
        }
    }
    found
}
