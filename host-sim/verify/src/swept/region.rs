//! Heights of the material in a drawn region, place by place: a ridge is measured only where a gap between two passes is away from the region's boundary all across, which is
//! nowhere in a strip that is narrower than a step-over.
//!
//! Places lie on lines of constant path parameter. On each the highest place between two lower ones is searched, so a crest is not missed between places; then the
//! highest of all are followed in both parameters. Along the crests the spacing of the lines remains: no bound is stated for it, as for a gap's ridge.

use rayon::prelude::*;

use super::Progress;
use super::field::{FieldPoint, Heights};
use super::findings::ASKED_SHARE;
use super::ridge::{Gap, GapRidge, MISSED_RADII};
use super::tree::PathTree;
use job::{Along, Job};
use oracle::Oracle;

/// Lines of constant path parameter a step-over, and places on them a step-over, where the surface is fastest.
const LINES_A_STEP_OVER: f64 = 6.0;
const PLACES_A_STEP_OVER: f64 = 12.0;
/// Below so many lines or places a step-over, what lies between them may be missed.
const FEW_A_STEP_OVER: f64 = 4.0;
/// Least and largest number of lines, and of places on a line.
const COUNT: [f64; 2] = [48.0, 16_384.0];
/// Largest number of places.
const PLACES_MAX: f64 = 1.5e6;
/// Lines of the grid on which the speed of the parameters is taken.
const SPEED_LINES: u32 = 24;
/// A local maximum is searched where it is above this share of the limit.
const SEARCHED_SHARE: f64 = 0.5;
/// Share by which a place may be above the limit: how far it is from the boundary is taken by the metric at the place, and a place beyond half a step-over by 0.5 % of it is 1 % higher.
const SERVED_SLACK: f64 = super::ERROR_SHARE_MAX;
/// Height beside the boundary, in limits, that is worth a warning: on a slanted boundary it is about four, in a strip without a pass more.
const USUAL: f64 = 6.0;
/// Steps of the golden section: 1e-5 of the spacing of places.
const GOLDEN_STEPS: u32 = 24;
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// Heights in a region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RegionHeights {
    /// Area of the region, mm2.
    pub area_mm2: f64,
    /// Share of it that passes serve: at least half a step-over from the region's boundary within the surface.
    pub served_share: f64,
    /// Share of it in gaps whose ridge is measured.
    pub ridges_share: f64,
    /// The highest place that passes serve; `None` if they serve none.
    pub highest: Option<FieldPoint>,
    /// The highest place nearer to the boundary, if there is one.
    pub highest_beside: Option<FieldPoint>,
    /// Share of the region that is nearer to the boundary and above the permitted height.
    pub above_share: f64,
    /// Number of places.
    pub places: usize,
    /// Lines a step-over, or places a step-over on them where those are fewer, where the surface is fastest.
    pub places_a_step_over: f64,
}

impl RegionHeights {
    /// The reason against a job whose limit is exceeded by more than the error, mm.
    pub(super) fn failure(&self, job: &Job, limit_mm: f64, error_mm: f64) -> Option<String> {
        let FieldPoint {
            height_mm,
            uv: [u, v],
            ..
        } = self.highest?;
        (height_mm - error_mm > limit_mm * (1.0 + SERVED_SLACK)).then(|| {
            if height_mm >= MISSED_RADII * job.radius_mm {
                return format!("no ball reaches the material at u = {u:.6}, v = {v:.6}, half a step-over or more within the region");
            }
            format!(
                "in the region the material is {height_mm:.6} mm high at u = {u:.6}, v = {v:.6}, half a step-over or more from its boundary, where the limit is {} mm \
                 (measured within {error_mm:.1e} mm): ask for scallop_mm = {:.3e}",
                job.scallop_mm,
                ASKED_SHARE * job.scallop_mm * limit_mm / height_mm
            )
        })
    }

    /// What a user has to know of the measurement, and of the strip beside the region's boundary.
    pub(super) fn warnings(&self, job: &Job) -> impl Iterator<Item = String> {
        self.few_places().into_iter().chain(self.high_beside(job))
    }

    fn few_places(&self) -> Option<String> {
        (self.places_a_step_over < FEW_A_STEP_OVER).then(|| {
            format!(
                "the region is measured at {:.1} places a step-over: material between them may be higher; cut a smaller region, or ask for a larger scallop height",
                self.places_a_step_over
            )
        })
    }

    fn high_beside(&self, job: &Job) -> Option<String> {
        let FieldPoint {
            height_mm,
            uv: [u, v],
            ..
        } = self.highest_beside?;
        (height_mm > USUAL * job.scallop_mm).then(|| {
            let most = if height_mm >= MISSED_RADII * job.radius_mm {
                "no ball reaches some of it".to_owned()
            } else {
                format!("up to {height_mm:.4} mm")
            };
            format!(
                "{:.1} % of the region, nearer than half a step-over to its boundary, is left higher than the limit ({most}, at u = {u:.4}, v = {v:.4}): draw the region larger by half a \
                 step-over ({:.2} mm on a plane) where nothing is in the way",
                100.0 * self.above_share,
                0.5 * job.plane_step_over_mm()
            )
        })
    }
}

/// What one line adds.
#[derive(Default)]
struct Line {
    area: f64,
    served: f64,
    in_ridges: f64,
    above: f64,
    places: usize,
    highest_beside: Option<FieldPoint>,
    highest: Vec<FieldPoint>,
}

/// The lines and the places on them, over the extent of the region.
struct Grid {
    path: [f64; 2],
    side: [f64; 2],
    lines: u32,
    places: u32,
    places_a_step_over: f64,
}

impl Grid {
    fn new(job: &Job, oracle: &Oracle) -> Self {
        let [path, side] = oracle.region_extent();
        let at = |[low, high]: [f64; 2], k: u32| {
            low + (high - low) * (f64::from(k) + 0.5) / f64::from(SPEED_LINES)
        };
        // Most step-overs along and across all of it.
        let mut most = [0.0_f64; 2];
        for (i, k) in (0..SPEED_LINES).flat_map(|i| (0..SPEED_LINES).map(move |k| (i, k))) {
            let (u, v) = oracle.swapped(at(path, i), at(side, k));
            let surface = oracle.surface.at(u, v);
            let by_curvature_mm = oracle
                .contact(u, v)
                .map_or(f64::NAN, |contact| contact.step_over_mm);
            let step_over_mm = by_curvature_mm.min(job.plane_step_over_mm());
            let (along, across) = match oracle.along {
                Along::U => (surface.u, surface.v),
                Along::V => (surface.v, surface.u),
            };
            most[0] = most[0].max(along.length() / step_over_mm);
            most[1] = most[1].max(across.length() / step_over_mm);
        }
        let step_overs = [most[0] * (path[1] - path[0]), most[1] * (side[1] - side[0])];
        let wanted = [
            step_overs[0] * LINES_A_STEP_OVER,
            step_overs[1] * PLACES_A_STEP_OVER,
        ];
        let room = (PLACES_MAX / (wanted[0] * wanted[1])).sqrt().min(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let [lines, places] = wanted.map(|count| (count * room).ceil().clamp(COUNT[0], COUNT[1]) as u32);
        Self {
            path,
            side,
            lines,
            places,
            places_a_step_over: (f64::from(lines) / step_overs[0]).min(f64::from(places) / step_overs[1]),
        }
    }

    /// Path parameter of a line.
    fn line(&self, k: u32) -> f64 {
        self.path[0] + (self.path[1] - self.path[0]) * (f64::from(k) + 0.5) / f64::from(self.lines)
    }

    /// Side parameter of a place.
    fn place(&self, k: u32) -> f64 {
        self.side[0] + self.spacing() * (f64::from(k) + 0.5)
    }

    /// Of places on a line.
    fn spacing(&self) -> f64 {
        (self.side[1] - self.side[0]) / f64::from(self.places)
    }

    /// Rectangle of the parameters for which a place stands.
    fn share(&self) -> f64 {
        self.spacing() * (self.path[1] - self.path[0]) / f64::from(self.lines)
    }
}

/// The measurement.
pub(super) struct RegionSearch<'a> {
    pub(super) job: &'a Job,
    pub(super) oracle: &'a Oracle,
    pub(super) tree: &'a PathTree<'a>,
    pub(super) gaps: &'a [Gap<'a>],
    pub(super) ridges: &'a [GapRidge],
    /// Permitted height, mm.
    pub(super) limit_mm: f64,
}

impl RegionSearch<'_> {
    pub(super) fn search(&self, progress: &dyn Progress) -> RegionHeights {
        let heights = Heights {
            oracle: self.oracle,
            tree: self.tree,
        };
        let grid = Grid::new(self.job, self.oracle);
        progress.begin("region", u64::from(grid.lines));
        let lines: Vec<Line> = (0..grid.lines)
            .into_par_iter()
            .map(|k| {
                let line = self.line(&heights, &grid, grid.line(k));
                progress.done(1);
                line
            })
            .collect();
        let sum = |of: &dyn Fn(&Line) -> f64| -> f64 { lines.iter().map(of).sum() };
        let area = sum(&|line| line.area);
        let share = |part: f64| if area > 0.0 { part / area } else { 0.0 };
        let starts = lines.iter().flat_map(|line| &line.highest).copied().collect();
        let steps = [
            (grid.path[1] - grid.path[0]) / f64::from(grid.lines),
            grid.spacing(),
        ];
        let (du, dv) = self.oracle.swapped(steps[0], steps[1]);
        let besides = lines.iter().filter_map(|line| line.highest_beside);
        RegionHeights {
            area_mm2: area * grid.share(),
            served_share: share(sum(&|line| line.served)),
            ridges_share: share(sum(&|line| line.in_ridges)),
            highest: heights.extreme(starts, 1.0, [du, dv]),
            highest_beside: besides.reduce(FieldPoint::higher),
            above_share: share(sum(&|line| line.above)),
            places: lines.iter().map(|line| line.places).sum(),
            places_a_step_over: grid.places_a_step_over,
        }
    }

    fn line(&self, heights: &Heights<'_>, grid: &Grid, path: f64) -> Line {
        let mut line = Line::default();
        let of_gaps = self.gaps_at(path);
        // Height of each served place, by its number.
        let mut served: Vec<(u32, FieldPoint)> = Vec::new();
        for k in 0..grid.places {
            let side = grid.place(k);
            let (u, v) = self.oracle.swapped(path, side);
            if !self.oracle.is_in_region(u, v) {
                continue;
            }
            let Some((place, area)) = heights.at([u, v]) else {
                continue;
            };
            line.places += 1;
            line.area += area;
            if is_within(&of_gaps, side) {
                line.in_ridges += area;
            }
            if self.oracle.is_served(u, v) {
                line.served += area;
                served.push((k, place));
            } else {
                let before = line.highest_beside.unwrap_or(place);
                line.highest_beside = Some(before.higher(place));
                if place.height_mm > self.limit_mm {
                    line.above += area;
                }
            }
        }
        let height = |index: Option<usize>, number: u32| {
            let neighbour = index.and_then(|index| served.get(index));
            neighbour
                .filter(|(k, _)| k.abs_diff(number) == 1)
                .map_or(f64::NEG_INFINITY, |(_, place)| place.height_mm)
        };
        for (index, (number, place)) in served.iter().enumerate() {
            let beside = height(index.checked_sub(1), *number).max(height(Some(index + 1), *number));
            if place.height_mm < beside || place.height_mm < SEARCHED_SHARE * self.job.scallop_mm {
                continue;
            }
            let middle = grid.place(*number);
            let value = |side: f64| {
                let (u, v) = self.oracle.swapped(path, side);
                heights
                    .served([u, v])
                    .map_or(f64::NEG_INFINITY, |(place, _)| place.height_mm)
            };
            let side = maximum(value, [middle - grid.spacing(), middle + grid.spacing()]);
            let (u, v) = self.oracle.swapped(path, side);
            let found = heights
                .served([u, v])
                .map_or(*place, |(found, _)| found.higher(*place));
            line.highest.push(found);
        }
        line
    }

    /// Ranges of the side parameter of the gaps that are measured at a path parameter, ascending.
    fn gaps_at(&self, path: f64) -> Vec<[f64; 2]> {
        let of_gap = |(gap, ridge): (&Gap<'_>, &GapRidge)| {
            let (first, last) = (ridge.crests.first()?.path, ridge.crests.last()?.path);
            (first..=last).contains(&path).then(|| {
                let [from, to] = [0.0, 1.0].map(|share| gap.side(path, share));
                [from.min(to), from.max(to)]
            })
        };
        let mut ranges: Vec<[f64; 2]> = self.gaps.iter().zip(self.ridges).filter_map(of_gap).collect();
        ranges.sort_by(|a, b| a[0].total_cmp(&b[0]));
        ranges
    }
}

/// Whether a side parameter is in one of these ranges, which are ascending and do not overlap.
fn is_within(ranges: &[[f64; 2]], side: f64) -> bool {
    let before = ranges.partition_point(|[low, _]| *low <= side);
    before
        .checked_sub(1)
        .is_some_and(|index| side <= ranges[index][1])
}

/// Where a function is greatest in a bracket, by golden section.
fn maximum(value: impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2]) -> f64 {
    let inner = |low: f64, high: f64| [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
    let [mut left, mut right] = inner(low, high);
    let (mut at_left, mut at_right) = (value(left), value(right));
    for _ in 0..GOLDEN_STEPS {
        if at_left > at_right {
            (high, right, at_right) = (right, left, at_left);
            left = inner(low, high)[0];
            at_left = value(left);
        } else {
            (low, left, at_left) = (left, right, at_right);
            right = inner(low, high)[1];
            at_right = value(right);
        }
    }
    if at_left > at_right { left } else { right }
}

#[cfg(test)]
mod tests {
    use super::*;
    use job::Region;

    /// The places of a small region of a large surface are all within its extent, so it is measured as densely as a surface of its size.
    #[test]
    fn places_are_spent_on_the_region() {
        let mut job = job_file::parse("plate.toml", include_str!("../../../../jobs/plate.toml")).unwrap();
        job.scallop_mm = 2e-5;
        let grid = |job: &Job| Grid::new(job, &Oracle::new(job).unwrap());
        let [[u0, u1], [v0, v1]] = job.surface.domain();
        let at = |u: f64, v: f64| [u0 + u * (u1 - u0), v0 + v * (v1 - v0)];
        let square = |from: f64, to: f64| {
            Region::new(vec![vec![at(from, from), at(to, from), at(to, to), at(from, to)]])
        };
        job.region = Some(square(0.0, 1.0));
        let whole = grid(&job);
        assert!(whole.places_a_step_over < 0.5 * FEW_A_STEP_OVER);
        job.region = Some(square(0.5, 0.54));
        let small = grid(&job);
        assert!(
            small.places_a_step_over >= FEW_A_STEP_OVER,
            "{}",
            small.places_a_step_over
        );
        let [low, high] = [at(0.5, 0.5), at(0.54, 0.54)];
        let (first, last) = (small.place(0), small.place(small.places - 1));
        let (path, side) = match job.along {
            Along::U => (0, 1),
            _ => (1, 0),
        };
        assert!(low[side] < first && last < high[side]);
        let (first, last) = (small.line(0), small.line(small.lines - 1));
        assert!(low[path] < first && last < high[path]);
    }
}
