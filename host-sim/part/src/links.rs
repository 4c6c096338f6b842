//! Links between the intervals of a region: only as high as the tool needs over the part, or over the surface itself where no part is known.
//!
//! A link over the part rises at the end of a pass, crosses at one height, and comes down at the start of the next. Where the tool stands on both it is clear, and no part of it is taken
//! to be thinner than the ball or a part below it, so it is clear above both, but for overhangs beside a thin part on the way up. So the crossing decides: the least height at which the whole tool is clear along it is bisected.
//!
//! Past a wall that bulges towards the tool neither the straight way is clear nor any that is not above the wall. There a link goes around: straight to a place beside the middle of both
//! ends and somewhat above, and straight from there, at the feed. Of all ways that are clear the one that takes least time is taken.

use std::convert::Infallible;

use glam::DVec3;
use job::{AxisLimits, Job};
use oracle::Surface;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::body::Part;
use crate::faces::{cached, part_of};
use crate::tool::Tool;
use job_file::FaceError;

/// Number of the method by which links are made: cached links of another method are not used.
const METHOD: u32 = 4;
/// Least height of a crossing above both ends of a link, mm.
const LIFT_MM: f64 = 0.3;
/// Precision of the height of a crossing, mm.
const HEIGHT_MM: f64 = 0.25;
/// Shortest step between checked places of a way, mm: where the tool is next to the part. Between two such places the ball is deeper by a ten thousandth.
const STEP_MM: f64 = 0.05;
/// Longest step between checked places of a way, mm.
const STRIDE_MM: f64 = 2.0;
/// Longest straight link, in step-overs of a plane.
const STRAIGHT_STEPS: f64 = 2.5;
/// Depth to which a link may enter the part, as a share of the depth that the job permits.
const DEPTH_SHARE: f64 = 0.5;
/// Depth to which a link may enter the surface of a job without a part, mm.
const DEPTH_MM: f64 = 0.001;

/// Unit of a detour, mm: that of the machine's words.
const UNIT_MM: f64 = 16_384e-6;
/// Greatest detour to a side, units.
const ASIDE_MAX: f64 = 2047.0;
/// Greatest detour upwards, units.
const RISE_MAX: f64 = 4095.0;
/// Detours to a side that are tried, as shares of the length of the way.
const ASIDES: [f64; 9] = [0.0, 0.1, -0.1, 0.25, -0.25, 0.5, -0.5, 1.0, -1.0];
/// Detours upwards that are tried, as shares of the length of the way.
const RISES: [f64; 4] = [0.0, 0.1, 0.3, 1.0];
/// Least length of a way for these shares, mm.
const DETOUR_MM: f64 = 1.0;
/// Least time that a detour must save, s.
const SAVED_S: f64 = 0.05;

/// How a link goes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Way {
    /// Straight to the next pass, at the feed.
    Straight,
    /// By a place beside the middle of both ends, at the feed: to the left of the way and upwards, in the units of the machine's words.
    Around {
        /// To the left.
        aside: i16,
        /// Upwards.
        rise: u16,
    },
    /// At this height of the ball's centre, mm.
    Across(f64),
}

/// The ball's centre at the start and at the end of each pass of a job, nm: from the cache beside the job, by a digest of `key`, else from `make`.
pub fn passes(job: &Job, key: &[u8], make: impl FnOnce() -> Vec<[[i32; 3]; 2]>) -> Vec<[[i32; 3]; 2]> {
    let Ok(passes) = cached(job, "passes", &[key], None, || Ok::<_, Infallible>(make()));
    passes
}

/// The least height at which the tool of a job crosses the part between two places of the ball's centre, mm, at most the safe height; the safe height where no part is known.
///
/// # Errors
/// The part's file cannot be read.
pub fn crossing(job: &Job, safe_mm: f64, ends: [DVec3; 2]) -> Result<f64, FaceError> {
    let Some(of) = job.origin.part() else {
        return Ok(safe_mm);
    };
    let part = part_of(job, of)?;
    Ok(Crossings::new(&part, &Tool::of(job), of.tolerance_mm, safe_mm).height(ends))
}

/// The ways of the links of a job: from the cache beside the job, by a digest of `key`, the tool, the limits and the part's file, else computed from `ends`, the ball's
/// centre at both ends of each link, mm. No height is above the safe height.
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
        let clear = Links::over(part, job, depth, safe_mm);
        Ok(ends.par_iter().map(|ends| clear.way(*ends)).collect())
    })
}

/// A tool over a part: the heights at which it crosses clear of the part.
struct Crossings<'a> {
    part: &'a Part,
    tool: Tool,
    /// How deep the tool may enter, mm.
    depth: f64,
    safe_mm: f64,
}

struct Links<'a> {
    crossings: Crossings<'a>,
    /// The longest straight link, mm.
    straight_mm: f64,
    /// The job knows the part, so that a way may stay low.
    may_stay_low: bool,
    times: Times,
}

/// The machine's limits, for the times of ways.
#[derive(Clone, Copy, Debug)]
pub struct Times {
    feed_mm_s: f64,
    limits: AxisLimits,
}

impl Times {
    /// Times of ways at this feed, within these limits.
    #[must_use]
    pub const fn new(feed_mm_s: f64, limits: AxisLimits) -> Self {
        Self { feed_mm_s, limits }
    }

    /// Time of a move from rest to rest, s.
    fn of(length: f64, [velocity, acceleration, jerk]: [f64; 3]) -> f64 {
        let by_jerk = (32.0 * length / jerk).cbrt();
        let ramps = velocity / acceleration + acceleration / jerk;
        if length > velocity * ramps {
            length / velocity + ramps
        } else {
            by_jerk.max((4.0 * length / acceleration).sqrt())
        }
    }

    fn axis(&self, k: usize) -> [f64; 3] {
        self.limits.by_order().map(|limit| limit[k])
    }

    /// Up to a height, across, and down, s.
    #[must_use]
    pub fn across(&self, [from, to]: [DVec3; 2], height: f64) -> f64 {
        let beside = (to - from).truncate().length();
        let up = |z: f64| Self::of((height - z).max(0.0), self.axis(2));
        up(from.z) + Self::of(beside, self.axis(0)) + up(to.z)
    }

    /// Along a way of straight moves at the feed.
    fn at_feed(&self, way: &[DVec3]) -> f64 {
        let of = |ends: &[DVec3]| {
            let [velocity, acceleration, jerk] = self.axis(2);
            Self::of(
                ends[0].distance(ends[1]),
                [self.feed_mm_s.min(velocity), acceleration, jerk],
            )
        };
        way.windows(2).map(of).sum()
    }
}

impl<'a> Links<'a> {
    /// Over the part of a job, or over its surface.
    fn over(part: &'a Part, job: &Job, depth: f64, safe_mm: f64) -> Self {
        let of_part = job.origin.part();
        Self {
            crossings: Crossings {
                part,
                tool: Tool::of(job).wide(),
                depth,
                safe_mm,
            },
            may_stay_low: of_part.is_some(),
            times: Times::new(job.feed_mm_s(), job.machine.limits.unwrap_or(AxisLimits::DEFAULT)),
            straight_mm: of_part.map_or(0.0, |_| STRAIGHT_STEPS * job.plane_step_over_mm()),
        }
    }

    fn way(&self, ends: [DVec3; 2]) -> Way {
        let [from, to] = ends;
        if from.distance(to) <= self.straight_mm && self.crossings.is_clear([from, to], STEP_MM) {
            return Way::Straight;
        }
        let height = self.crossings.height(ends);
        let over = Way::Across(height);
        let around = self
            .may_stay_low
            .then(|| self.around(ends, self.times.across(ends, height)));
        around.flatten().unwrap_or(over)
    }

    /// The fastest way around that takes less time than another.
    fn around(&self, [from, to]: [DVec3; 2], than_s: f64) -> Option<Way> {
        let apart = to - from;
        let length = apart.length().max(DETOUR_MM);
        let left = DVec3::new(-apart.y, apart.x, 0.0).normalize_or_zero();
        let units = |share: f64, most: f64| (share * length / UNIT_MM).round().clamp(-most, most);
        let mut ways: Vec<(f64, [DVec3; 3], Way)> = Vec::new();
        for (aside, rise) in ASIDES.iter().flat_map(|aside| RISES.map(|rise| (*aside, rise))) {
            let [aside, rise] = [units(aside, ASIDE_MAX), units(rise, RISE_MAX)];
            let place = from.lerp(to, 0.5) + UNIT_MM * (aside * left + rise * DVec3::Z);
            let way = [from, place, to];
            let time_s = self.times.at_feed(&way);
            if time_s + SAVED_S < than_s && place.z <= self.crossings.safe_mm {
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "at most 12 bits"
                )]
                let [aside, rise] = [aside as i16, rise as i16];
                ways.push((
                    time_s,
                    way,
                    Way::Around {
                        aside,
                        rise: rise.unsigned_abs(),
                    },
                ));
            }
        }
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        let is_clear = |way: &[DVec3; 3]| {
            let [from, place, to] = *way;
            self.crossings.is_clear([from, place], STEP_MM) && self.crossings.is_clear([place, to], STEP_MM)
        };
        ways.into_iter()
            .find(|(_, way, _)| is_clear(way))
            .map(|(_, _, way)| way)
    }
}

impl<'a> Crossings<'a> {
    /// The tool may enter the part as deep as in the part's regions.
    fn new(part: &'a Part, tool: &Tool, tolerance_mm: f64, safe_mm: f64) -> Self {
        Self {
            part,
            tool: tool.wide(),
            depth: DEPTH_SHARE * tolerance_mm,
            safe_mm,
        }
    }

    /// The least height at which the tool crosses, mm, at most the safe height.
    fn height(&self, [from, to]: [DVec3; 2]) -> f64 {
        let at = |z: f64| [from, to].map(|end| DVec3::new(end.x, end.y, z));
        let is_clear = |z: f64| self.is_clear(at(z), STRIDE_MM);
        let least = from.z.max(to.z) + LIFT_MM;
        if least >= self.safe_mm {
            return self.safe_mm;
        }
        if is_clear(least) {
            return least;
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
        high
    }

    /// Whether the tool is clear of the part all along a straight way. The ball's distance from the part changes by no more than the tool moves; that of shank and holder by no
    /// more than the tool moves sideways.
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
