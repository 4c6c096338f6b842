//! An estimate of the passes of a face along each parameter: their time, and the share of the face that they leave where the region ends.
//!
//! Where nothing is in the way a region is larger than its face, so passes may end anywhere. Where something is, they end on its boundary: one that is slanted to them keeps
//! a strip that is higher than the limit, between the ends of passes. Across the boundary nothing is left, so the direction decides.

use job::{Along, Region};
use machine::PASS_S;
use part::LEFTOVER_SHARE;

/// Greatest number of lines of an estimate, and parts of an interval.
const LINES_MAX: usize = 4000;
const PARTS: u32 = 8;
/// Shortest interval, in step-overs, as in jobs.
const LEAST_STEPS: f64 = 0.1;
/// Greatest height of a place that is finished, in scallop limits, as `verify` counts it.
const HIGHER: f64 = 1.0 + LEFTOVER_SHARE;
/// Lines on either side of a place that may serve it.
const BESIDE: usize = 3;
/// Share of the area that may be left for the faster direction.
const LEFT_SHARE: f64 = 0.005;

/// Estimates the passes of a face.
#[derive(Clone, Copy)]
pub(crate) struct PassEstimator<'a> {
    pub(crate) surface: &'a oracle::Surface,
    pub(crate) region: &'a Region,
    pub(crate) step_over_mm: f64,
    pub(crate) feed_mm_s: f64,
    /// Every other pass goes back.
    pub(crate) is_zigzag: bool,
    /// Places of the face, each with its area.
    pub(crate) places: &'a [([f64; 2], f64)],
}

/// The passes of a face along a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassEstimate {
    /// The parameter.
    pub along: Along,
    /// Their time, s.
    pub time_s: f64,
    /// Share of the face's area that they leave above the scallop limit.
    pub left_share: f64,
    /// (u, v) at the start of the first and at the end of the last one; `None` without passes.
    pub ends: Option<[[f64; 2]; 2]>,
}

impl PassEstimate {
    /// Whether these passes are better than others: less time, of those that leave little, else less that is left.
    #[must_use]
    pub fn is_better_than(&self, other: &Self) -> bool {
        match [self, other].map(|estimate| estimate.left_share <= LEFT_SHARE) {
            [true, true] => self.time_s < other.time_s,
            [false, false] => self.left_share < other.left_share,
            [is_better, _] => is_better,
        }
    }
}

/// A line of constant side parameter, and its intervals.
struct Line {
    side: f64,
    intervals: Vec<[f64; 2]>,
}

/// `[path, side]` of (u, v), and back.
const fn swapped(along: Along, [u, v]: [f64; 2]) -> [f64; 2] {
    match along {
        Along::U => [u, v],
        Along::V => [v, u],
    }
}

/// Ranges of `[path, side]`.
const fn swapped_ranges(along: Along, [u, v]: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    match along {
        Along::U => [u, v],
        Along::V => [v, u],
    }
}

impl PassEstimator<'_> {
    /// The direction that takes less time, of those that leave little; else the one that leaves less.
    pub(crate) fn best(&self) -> PassEstimate {
        let [u, v] = [Along::U, Along::V].map(|along| self.along(along));
        if v.is_better_than(&u) { v } else { u }
    }

    /// Length of the derivative along a pass, and of that across it the whole and what is at right angles.
    fn speeds(&self, along: Along, path: f64, side: f64) -> [f64; 3] {
        let [u, v] = swapped(along, [path, side]);
        let at = self.surface.at(u, v);
        let [path, side] = match along {
            Along::U => [at.u, at.v],
            Along::V => [at.v, at.u],
        };
        let [speed, whole] = [path.length(), side.length()];
        let across = if speed > 0.0 {
            path.cross(side).length() / speed
        } else {
            whole
        };
        [speed, whole, across]
    }

    /// How much a step across is where a pass ends on the surface's boundary, which may be slanted: the crest there lies between the end of one pass and the foot on the other.
    fn across_end(&self, along: Along, path: f64, side: f64) -> f64 {
        let [_, whole, across] = self.speeds(along, path, side);
        2.0 * across * whole / (across + whole).max(f64::MIN_POSITIVE)
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
        let [_, across, _] = self.speeds(along, path, side);
        let [_, sides] = swapped_ranges(along, self.surface.domain());
        let [low, high] = self.region.trimmed_lines(along, self.step_over_mm, across, sides);
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

    /// A line, the longest derivative across it, and its time.
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
                let [speed, _, across] = self.speeds(along, from + share * (to - from), side);
                length_mm += speed * (to - from) / f64::from(PARTS);
                widest = widest.max(across);
            }
            for end in [*from, *to] {
                if ends
                    .iter()
                    .any(|of| (of - end).abs() <= 1e-6 * (ends[1] - ends[0]))
                {
                    widest = widest.max(self.across_end(along, end, side));
                }
            }
            if length_mm >= LEAST_STEPS * self.step_over_mm {
                time_s += length_mm / self.feed_mm_s + PASS_S;
                intervals.push([*from, *to]);
            }
        }
        (Line { side, intervals }, widest, time_s)
    }

    /// Share of the places that are too far from every pass.
    fn left_share(&self, along: Along, lines: &[Line]) -> f64 {
        let within_mm = 0.5 * self.step_over_mm * HIGHER.sqrt();
        let (mut all, mut left) = (0.0, 0.0);
        for (place, area) in self.places {
            let [path, side] = swapped(along, *place);
            let [speed, _, across] = self.speeds(along, path, side);
            let above = lines.partition_point(|line| line.side < side);
            let near = &lines[above.saturating_sub(BESIDE)..(above + BESIDE).min(lines.len())];
            let is_served = near.iter().any(|line| {
                let beside_mm = (line.side - side) * across;
                line.intervals.iter().any(|[from, to]| {
                    let beyond_mm = (from - path).max(path - to).max(0.0) * speed;
                    beside_mm.hypot(beyond_mm) <= within_mm
                })
            });
            all += area;
            if !is_served {
                left += area;
            }
        }
        if all > 0.0 { left / all } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::{LEFT_SHARE, PassEstimator};
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
            u.left_share > LEFT_SHARE && v.left_share < 0.001,
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
