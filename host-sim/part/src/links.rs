//! Links between the intervals of a region: only as high as the tool needs over the part, or over the surface itself where no part is known.
//!
//! A link rises at the end of a pass, crosses at one height, and comes down at the start of the next. Where the tool stands on both it is clear, and no part of it is taken
//! to be thinner than the ball, so it is clear above both. So the crossing decides: the least height at which the whole tool is clear along it is bisected.

use glam::DVec3;
use job::Job;
use oracle::Surface;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::body::Part;
use crate::faces::{cached, part_of};
use crate::tool::Tool;
use job_file::FaceError;

/// The method by which links are made: others in a cache are not used.
const METHOD: u32 = 1;
/// The crossing is at least so much above both ends, mm.
const LIFT_MM: f64 = 0.3;
/// Precision of the height of a crossing, mm.
const HEIGHT_MM: f64 = 0.25;
/// Steps of a way that are looked at where the tool is next to the part, and the longest ones, mm. Between two places the ball is deeper by a ten thousandth.
const STEP_MM: f64 = 0.05;
const STRIDE_MM: f64 = 2.0;
/// A straight link is at most so long, in step-overs of a plane.
const STRAIGHT_STEPS: f64 = 2.5;
/// How deep the tool may enter, mm, as a share of what the job permits, and where no part says it: that of a region.
const DEPTH_SHARE: f64 = 0.5;
const DEPTH_MM: f64 = 0.001;

/// How a link goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Way {
    /// Straight to the next pass, at the feed.
    Straight,
    /// At this height of the ball's centre, mm.
    Across(f64),
}

/// The ways of the links of a job with these ends, the ball's centre in mm; `ends` is called where they are not kept beside the job, by a digest of all that they
/// depend on: of `key` among it. No height is above the safe height.
///
/// # Errors
/// The part's file cannot be read.
pub fn ways(
    job: &Job,
    key: &[u8],
    safe_mm: f64,
    ends: impl FnOnce() -> Vec<[DVec3; 2]>,
) -> Result<Vec<Way>, FaceError> {
    let of_part = job.origin.part();
    let tool = Tool::of(job);
    let rules = format!("{METHOD} {tool:?} {} {safe_mm} {of_part:?}", job.scallop_mm);
    let files = of_part.map(|of| of.path.as_path());
    cached(job, "links", &[key, rules.as_bytes()], files, || {
        let ends = ends();
        if ends.is_empty() {
            return Ok(Vec::new());
        }
        let placed;
        let alone;
        let (part, depth) = match of_part {
            Some(of) => {
                placed = part_of(job, of)?;
                (&*placed, DEPTH_SHARE * of.tolerance_mm)
            }
            None => {
                alone = Part::of_surface(&Surface::new(&job.surface));
                (&alone, DEPTH_MM)
            }
        };
        let clear = Links {
            part,
            tool: tool.wide(),
            depth,
            safe_mm,
            straight_mm: of_part.map_or(0.0, |_| {
                STRAIGHT_STEPS * (8.0 * job.radius_mm * job.scallop_mm).sqrt()
            }),
        };
        Ok(ends.par_iter().map(|ends| clear.way(*ends)).collect())
    })
}

struct Links<'a> {
    part: &'a Part,
    tool: Tool,
    /// How deep the tool may enter, mm.
    depth: f64,
    safe_mm: f64,
    /// The longest straight link, mm.
    straight_mm: f64,
}

impl Links<'_> {
    fn way(&self, [from, to]: [DVec3; 2]) -> Way {
        if from.distance(to) <= self.straight_mm && self.is_clear([from, to], STEP_MM) {
            return Way::Straight;
        }
        let at = |z: f64| [from, to].map(|end| DVec3::new(end.x, end.y, z));
        let is_clear = |z: f64| self.is_clear(at(z), STRIDE_MM);
        let least = from.z.max(to.z) + LIFT_MM;
        if least >= self.safe_mm {
            return Way::Across(self.safe_mm);
        }
        if is_clear(least) {
            return Way::Across(least);
        }
        let (mut low, mut high) = (least, self.safe_mm);
        while high - low > HEIGHT_MM {
            let middle = 0.5 * (low + high);
            if is_clear(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        Way::Across(high)
    }

    /// Whether the tool is clear of the part all along a straight way. The distance changes by no more than the tool moves; sideways only, that of what is above the ball.
    fn is_clear(&self, [from, to]: [DVec3; 2], stride: f64) -> bool {
        let length = from.distance(to);
        let mut at = 0.0;
        loop {
            let share = if length > 0.0 { at / length } else { 0.0 };
            let room = self.room(from.lerp(to, share), stride);
            if room < 0.0 {
                return false;
            }
            if at >= length {
                return true;
            }
            at = (at + room.max(STEP_MM)).min(length);
        }
    }

    /// How far the tool may move before it can touch, mm; at most `most`, negative where it touches.
    fn room(&self, centre: DVec3, most: f64) -> f64 {
        let touches = self.tool.radius - self.depth;
        let ball = self.part.nearest(centre, touches + most, None, false);
        let mut room = ball.map_or(most, |near| near.distance - touches);
        for column in &self.tool.columns {
            if room < 0.0 {
                break;
            }
            let touches = column.radius - self.depth;
            let z = column.z.map(|z| centre.z + z);
            let near = self.part.beside(centre, z, touches + room, false);
            room = near.map_or(room, |near| room.min(near.distance - touches));
        }
        room
    }
}
