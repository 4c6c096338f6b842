//! An estimate of the passes of a face along each parameter: their time, and the share of the face that they leave above the scallop limit at the region's boundary.
//!
//! Without an obstacle a region is larger than its face, and the ends of passes lie outside the face. At an obstacle the region ends on the face. Passes that meet this
//! boundary at a slant leave a strip above the limit between their ends; passes across it leave none. So the direction of the passes decides what is left.

use job::{Along, Region};
use machine::PASS_S;
use part::LEFTOVER_SHARE;

/// Greatest number of lines of an estimate.
const LINES_MAX: usize = 4000;
/// Parts of an interval for the sum of its length.
const PARTS: u32 = 8;
/// Shortest interval, in step-overs: jobs leave out shorter ones.
const INTERVAL_MIN_STEPS: f64 = 0.1;
/// Greatest height of a finished place, in scallop limits: the bound of `verify`.
const FINISHED_HEIGHT: f64 = 1.0 + LEFTOVER_SHARE;
/// Lines on either side of a place whose passes may finish it.
const LINES_BESIDE: usize = 3;
/// Greatest share of the area that a direction may leave to be chosen for its time.
const LEFT_SHARE_MAX: f64 = 0.005;

/// Estimates the passes of a face.
#[derive(Clone, Copy)]
pub(crate) struct PassEstimator<'a> {
    pub(crate) surface: &'a oracle::Surface,
    pub(crate) region: &'a Region,
    pub(crate) step_over_mm: f64,
    pub(crate) feed_mm_s: f64,
    /// Every other pass goes back.
    pub(crate) is_zigzag: bool,
    /// Places (u, v) of the face, each with its area, mm2.
    pub(crate) places: &'a [([f64; 2], f64)],
}

/// The passes of a face along a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassEstimate {
    /// The path parameter.
    pub along: Along,
    /// Time of the passes, s.
    pub time_s: f64,
    /// Share of the face's area above the scallop limit after the passes.
    pub left_share: f64,
    /// (u, v) at the start of the first pass and at the end of the last one; `None` without passes.
    pub ends: Option<[[f64; 2]; 2]>,
}

impl PassEstimate {
    /// Whether these passes are better than others: by their time if both leave at most 0.5 % (`LEFT_SHARE_MAX`), else by the share that they leave.
    #[must_use]
    pub fn is_better_than(&self, other: &Self) -> bool {
        match [self, other].map(|estimate| estimate.left_share <= LEFT_SHARE_MAX) {
            [true, true] => self.time_s < other.time_s,
            [false, false] => self.left_share < other.left_share,
            [is_better, _] => is_better,
        }
    }
}

/// A line of constant side parameter, and its intervals of the path parameter.
struct Line {
    side: f64,
    intervals: Vec<[f64; 2]>,
}

/// Lengths of the surface's derivatives at a place, mm per unit of the parameter.
struct DerivativeLengths {
    /// By the path parameter.
    path: f64,
    /// By the side parameter.
    side: f64,
    /// The component of the latter at right angles to the pass.
    across: f64,
}

/// `[path, side]` of (u, v), and (u, v) of `[path, side]`.
const fn swapped(along: Along, [u, v]: [f64; 2]) -> [f64; 2] {
    match along {
        Along::U => [u, v],
        Along::V => [v, u],
    }
}

/// Ranges of `[path, side]` from those of (u, v).
const fn swapped_ranges(along: Along, [u, v]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    match along {
        Along::U => [u, v],
        Along::V => [v, u],
    }
}

impl PassEstimator<'_> {
    /// The better direction by [`PassEstimate::is_better_than`].
    pub(crate) fn best(&self) -> PassEstimate {
        let [u, v] = [Along::U, Along::V].map(|along| self.along(along));
        if v.is_better_than(&u) { v } else { u }
    }

    fn lengths(&self, along: Along, path: f64, side: f64) -> DerivativeLengths {
        let [u, v] = swapped(along, [path, side]);
        let at = self.surface.at(u, v);
        let [by_path, by_side] = match along {
            Along::U => [at.u, at.v],
            Along::V => [at.v, at.u],
        };
        let [path, side] = [by_path.length(), by_side.length()];
        let across = if path > 0.0 {
            by_path.cross(by_side).length() / path
        } else {
            side
        };
        DerivativeLengths { path, side, across }
    }

    /// Width of the gap per unit of the side parameter where a pass ends on the surface's boundary, which may be slanted: the crest there lies between the end of one pass
    /// and the foot on the other, so the width is the harmonic mean of the distances along the boundary and across the pass.
    fn across_end(&self, along: Along, path: f64, side: f64) -> f64 {
        let DerivativeLengths { side, across, .. } = self.lengths(along, path, side);
        2.0 * across * side / (across + side).max(f64::MIN_POSITIVE)
    }

    /// The passes along a parameter.
    pub(crate) fn along(&self, along: Along) -> PassEstimate {
        let edges: Vec<[[f64; 2]; 2]> = self
            .region
            .edges()
            .map(|ends| ends.map(|end| swapped(along, end)))
            .collect();
        let [u, v] = self.region.extent().map(|[low, high]| 0.5 * (low + high));
        let [path, side] = swapped(along, [u, v]);
        let side_length = self.lengths(along, path, side).side;
        let [_, sides] = swapped_ranges(along, self.surface.domain());
        let [low, high] = self
            .region
            .trimmed_lines(along, self.step_over_mm, side_length, sides);
        let least = (high - low) / LINES_MAX as f64;
        let (mut lines, mut time_s) = (Vec::new(), 0.0);
        let mut side = low;
        // The last line is on the region's end.
        let last = high - 1e-9 * (high - low);
        for _ in 0..=LINES_MAX {
            let (line, widest, line_s) = self.line(along, &edges, side);
            time_s += line_s;
            lines.push(line);
            if side >= last {
                break;
            }
            let step = if widest > 0.0 {
                self.step_over_mm / widest
            } else {
                (high - low) / 100.0
            };
            side = (side + step.max(least)).min(last);
        }
        PassEstimate {
            along,
            time_s,
            left_share: self.left_share(along, &lines),
            ends: self.ends(along, &lines),
        }
    }

    /// (u, v) at the start of the first pass and at the end of the last one.
    fn ends(&self, along: Along, lines: &[Line]) -> Option<[[f64; 2]; 2]> {
        let passes = || lines.iter().filter(|line| !line.intervals.is_empty());
        let (first, last) = (passes().next()?, passes().next_back()?);
        let [start, _] = first.intervals.first()?;
        let goes_back = self.is_zigzag && passes().count() % 2 == 0;
        let end = if goes_back {
            last.intervals.first()?[0]
        } else {
            last.intervals.last()?[1]
        };
        Some([[*start, first.side], [end, last.side]].map(|place| swapped(along, place)))
    }

    /// The line at a side parameter, the greatest width of the gap beside it per unit of the side parameter, mm, and the time of its passes, s.
    fn line(&self, along: Along, edges: &[[[f64; 2]; 2]], side: f64) -> (Line, f64, f64) {
        let met = |ends: &&[[f64; 2]; 2]| (ends[0][1] <= side) != (ends[1][1] <= side);
        let mut crossings: Vec<f64> = edges
            .iter()
            .filter(met)
            .map(|[a, b]| a[0] + (side - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
            .collect();
        crossings.sort_by(f64::total_cmp);
        let mut intervals = Vec::new();
        let [ends, _] = swapped_ranges(along, self.surface.domain());
        let (mut widest, mut time_s) = (0.0_f64, 0.0);
        for [from, to] in crossings.as_chunks::<2>().0 {
            let mut length_mm = 0.0;
            for part in 0..PARTS {
                let share = (f64::from(part) + 0.5) / f64::from(PARTS);
                let lengths = self.lengths(along, from + share * (to - from), side);
                length_mm += lengths.path * (to - from) / f64::from(PARTS);
                widest = widest.max(lengths.across);
            }
            for end in [*from, *to] {
                if ends
                    .iter()
                    .any(|of| (of - end).abs() <= 1e-6 * (ends[1] - ends[0]))
                {
                    widest = widest.max(self.across_end(along, end, side));
                }
            }
            if length_mm >= INTERVAL_MIN_STEPS * self.step_over_mm {
                time_s += length_mm / self.feed_mm_s + PASS_S;
                intervals.push([*from, *to]);
            }
        }
        (Line { side, intervals }, widest, time_s)
    }

    /// Share of the area of the places that no pass finishes: each is too far from every pass.
    fn left_share(&self, along: Along, lines: &[Line]) -> f64 {
        let within_mm = 0.5 * self.step_over_mm * FINISHED_HEIGHT.sqrt();
        let (mut all, mut left) = (0.0, 0.0);
        for (place, area) in self.places {
            let [path, side] = swapped(along, *place);
            let lengths = self.lengths(along, path, side);
            let above = lines.partition_point(|line| line.side < side);
            let near = &lines[above.saturating_sub(LINES_BESIDE)..(above + LINES_BESIDE).min(lines.len())];
            let is_finished = near.iter().any(|line| {
                let beside_mm = (line.side - side) * lengths.across;
                line.intervals.iter().any(|[from, to]| {
                    let beyond_mm = (from - path).max(path - to).max(0.0) * lengths.path;
                    beside_mm.hypot(beyond_mm) <= within_mm
                })
            });
            all += area;
            if !is_finished {
                left += area;
            }
        }
        if all > 0.0 { left / all } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::{LEFT_SHARE_MAX, PassEstimator};
    use job::{Along, Region};

    /// A plane of 20 mm x 10 mm whose region ends on a line that is slanted by 1 in 20 to u: passes along u take less time, but leave a strip there.
    #[test]
    fn passes_across_a_slanted_end_leave_nothing() {
        let text = "[surface]\nkind = \"nurbs\"\ndegree = [1, 1]\nknots_u = [0, 0, 20, 20]\nknots_v = [0, 0, 10, 10]\n\
            poles_mm = [[[0, 0, 0], [0, 10, 0]], [[20, 0, 0], [20, 10, 0]]]\n\
            [tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 1200\nscallop_mm = 0.01\nalong = \"u\"\nside = \"up\"\n";
        let job = job_file::parse("plane.toml", text).unwrap();
        let surface = oracle::Surface::new(&job.surface);
        let region = Region::new(vec![vec![[0.0, 0.0], [20.0, 0.0], [20.0, 6.0], [0.0, 5.0]]]);
        let places: Vec<([f64; 2], f64)> = (0..200)
            .flat_map(|i| (0..200).map(move |j| [0.1 * (f64::from(i) + 0.5), 0.05 * (f64::from(j) + 0.5)]))
            .filter(|[u, v]| *v < 5.0 + u / 20.0)
            .map(|place| (place, 0.005))
            .collect();
        let passes = PassEstimator {
            surface: &surface,
            region: &region,
            step_over_mm: 0.5,
            feed_mm_s: 20.0,
            is_zigzag: true,
            places: &places,
        };
        let [u, v] = [Along::U, Along::V].map(|along| passes.along(along));
        assert!(u.time_s < v.time_s, "{} {}", u.time_s, v.time_s);
        assert!(
            u.left_share > LEFT_SHARE_MAX && v.left_share < 0.001,
            "{} {}",
            u.left_share,
            v.left_share
        );
        assert_eq!(passes.best().along, Along::V);
        // Without the slanted end nothing is left, and the faster one is taken.
        let whole = Region::new(vec![vec![[0.0, 0.0], [20.0, 0.0], [20.0, 6.5], [0.0, 6.5]]]);
        let passes = PassEstimator {
            region: &whole,
            ..passes
        };
        assert_eq!(passes.best().along, Along::U);
    }
}
