//! The region of a job in f64: its intervals on a line of constant side parameter, and how far a place is from its boundary.
//!
//! Independent of the machine's integers: it knows only that these round places to 2^-21 of a patch, or finer.

use super::contact::Oracle;
use super::smooth::SmoothParameter;
use super::verify::START_SHARE;
use job::{Along, Region, Spacing, Start};

/// A place of the machine, as a share of the longest span between two knots: the machine's patches are those or shorter.
const PLACE_SHARE: f64 = 1.0 / 2_097_152.0;
/// A place of curved passes on the side parameter, as a share of all of it: theirs ends a few of these before the surface does.
const SIDE_SHARE: f64 = 8.0 / 268_435_456.0;
/// Distance from the boundary within which an end of a pass is on it, in places: the rounding of the vertices, of the line, and of the crossing.
const NEAR_PLACES: f64 = 3.0;
/// Length of an interval that is a pass in any case, as a share of a plane's step-over: the machine leaves out those below 0.1 where the path parameter is fastest,
/// which it knows from a grid of points, and shorter ones elsewhere.
const CERTAIN_SHARE: f64 = 0.102;
/// Points at which the length of an interval is taken.
const LENGTH_POINTS: u32 = 16;

/// The region's edges and its places.
#[derive(Clone, Debug)]
pub struct RegionEdges {
    /// Ends of each edge: path and side parameter.
    edges: Vec<[[f64; 2]; 2]>,
    /// A place along the path and along the side parameter.
    place: [f64; 2],
}

impl RegionEdges {
    /// `is_curved`: the passes are curves; their places on the side parameter are shares of the whole.
    pub(super) fn new(region: &Region, along: Along, breaks: [Vec<f64>; 2], is_curved: bool) -> Self {
        let swapped = |[u, v]: [f64; 2]| match along {
            Along::U => [u, v],
            Along::V => [v, u],
        };
        let longest = |breaks: &[f64]| {
            let widths = breaks.windows(2).map(|ends| ends[1] - ends[0]);
            widths.fold(0.0, f64::max) * PLACE_SHARE
        };
        let mut place = breaks.each_ref().map(|breaks| longest(breaks));
        if let ([_, sides], true) = (&breaks, is_curved) {
            let whole = sides.last().unwrap_or(&0.0) - sides.first().unwrap_or(&0.0);
            place[1] = place[1].max(SIDE_SHARE * whole);
        }
        Self {
            edges: region.edges().map(|edge| edge.map(swapped)).collect(),
            place,
        }
    }

    /// Crossings of a line, ascending; a line through a vertex crosses the edges above it.
    fn crossings(&self, side: f64) -> Vec<f64> {
        let mut crossings: Vec<f64> = self
            .edges
            .iter()
            .filter(|[from, to]| (from[1] <= side) != (to[1] <= side))
            .map(|[from, to]| from[0] + (side - from[1]) / (to[1] - from[1]) * (to[0] - from[0]))
            .collect();
        crossings.sort_by(f64::total_cmp);
        crossings
    }

    /// Whether a place on (path, side) lies inside, by the even-odd rule.
    fn contains(&self, [path, side]: [f64; 2]) -> bool {
        let crossed = |[from, to]: &&[[f64; 2]; 2]| {
            (from[1] <= side) != (to[1] <= side)
                && from[0] + (side - from[1]) / (to[1] - from[1]) * (to[0] - from[0]) <= path
        };
        self.edges.iter().filter(crossed).count() % 2 == 1
    }

    /// Distance of a place on (path, side) from the boundary, in the machine's places.
    fn places_away(&self, at: [f64; 2]) -> f64 {
        let scaled = |point: &[f64; 2]| [0, 1].map(|k| (point[k] - at[k]) / self.place[k]);
        let distance = |[from, to]: &[[f64; 2]; 2]| {
            let (a, b) = (scaled(from), scaled(to));
            let way = [b[0] - a[0], b[1] - a[1]];
            let length = way[0] * way[0] + way[1] * way[1];
            let share = if length > 0.0 {
                (-(a[0] * way[0] + a[1] * way[1]) / length).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (a[0] + share * way[0]).hypot(a[1] + share * way[1])
        };
        self.edges.iter().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// Whether a place is on the boundary, but for the machine's rounding.
    pub(super) fn is_on(&self, path: f64, side: f64) -> bool {
        self.places_away([path, side]) <= NEAR_PLACES
    }

    /// A few places along the side parameter.
    pub(super) fn near_side(&self) -> f64 {
        NEAR_PLACES * self.place[1]
    }

    /// Least and greatest path parameter (`axis` 0) or side parameter (1).
    fn extent(&self, axis: usize) -> [f64; 2] {
        let places = self.edges.iter().flatten().map(|point| point[axis]);
        places.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], at| {
            [least.min(at), most.max(at)]
        })
    }

    /// Intervals of a line, ascending.
    fn intervals(&self, side: f64) -> Vec<[f64; 2]> {
        // The line on the upper boundary is the one below it.
        let [least, most] = self.extent(1);
        // A line on the lower boundary may be rounded to a place below it.
        let side = if side < least && least - side <= self.near_side() {
            least
        } else {
            side
        };
        let side = side.min(most - 1e-3 * self.place[1]);
        let mut intervals: Vec<[f64; 2]> = Vec::new();
        for pair in self.crossings(side).as_chunks::<2>().0 {
            match intervals.last_mut() {
                Some([_, end]) if pair[0] - *end <= 0.0 => *end = pair[1],
                _ => intervals.push(*pair),
            }
        }
        intervals
    }

    /// Side parameters of the vertices.
    fn sides(&self) -> Vec<f64> {
        let mut sides: Vec<f64> = self.edges.iter().map(|[from, _]| from[1]).collect();
        sides.sort_by(f64::total_cmp);
        sides.dedup();
        sides
    }
}

impl Oracle {
    /// An oracle for one cell of the region alone; for the whole surface where the region has no cell of this index.
    pub(super) fn of_cell(&self, index: usize) -> Self {
        Self {
            region: self.cells.get(index).cloned(),
            cells: Vec::new(),
            ..self.clone()
        }
    }

    /// Whether a pass that starts here is on the first line with an interval, or from the middle on the line there.
    pub(super) fn is_first_line(&self, [path, side]: [f64; 2]) -> bool {
        let [first, _] = self.pass_range();
        let is_on = |region: &RegionEdges| region.is_on(path, side);
        let is_line = if self.starts_in_middle() {
            self.is_middle_line(side)
        } else {
            self.is_empty_between(first, side)
        };
        self.region.as_ref().is_none_or(is_on) && is_line
    }

    fn starts_in_middle(&self) -> bool {
        self.spacing == Spacing::Constant(Start::Middle)
    }

    /// Whether a line is in the middle between the first and the last one, or the next one above it with an interval. Where the region is so narrow that a pass
    /// is not certain, the first and the last line, and so the middle, are known between bounds only.
    fn is_middle_line(&self, side: f64) -> bool {
        let Some([first, last]) = self.outer_lines() else {
            return false;
        };
        let [least, most] = self.pass_range();
        let smooth = SmoothParameter::new(self, self.across());
        let middle = |from: f64, to: f64| smooth.own(0.5 * (smooth.of(from) + smooth.of(to))).0;
        let [low, high] = self.side_range();
        let near = START_SHARE * (high - low);
        side >= middle(least, last) - near && self.is_empty_between(middle(first, most) + near, side)
    }

    /// The first and the last line with an interval, if there is one.
    fn outer_lines(&self) -> Option<[f64; 2]> {
        let [least, _] = self.pass_range();
        Some([self.next_line(least)?, self.last_line()])
    }

    /// The region's boundary as lines of (u, v), `parts` points an edge; none where the job has none.
    #[must_use]
    pub fn region_outline(&self, parts: u32) -> Vec<Vec<[f64; 2]>> {
        let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
        let mut last = None;
        for [from, to] in self.region.iter().flat_map(|region| &region.edges) {
            let at = |k: u32| {
                let share = f64::from(k) / f64::from(parts);
                let (u, v) = self.swapped(
                    from[0] + share * (to[0] - from[0]),
                    from[1] + share * (to[1] - from[1]),
                );
                [u, v]
            };
            match lines.last_mut() {
                Some(line) if last == Some(*from) => line.extend((1..=parts).map(at)),
                _ => lines.push((0..=parts).map(at).collect()),
            }
            last = Some(*to);
        }
        lines
    }

    /// Ranges of the path parameter and of the side parameter between which the region lies, within those of the surface; these where the job has none.
    #[must_use]
    pub fn region_extent(&self) -> [[f64; 2]; 2] {
        let ranges = [self.path_range(), self.side_range()];
        let Some(region) = &self.region else {
            return ranges;
        };
        std::array::from_fn(|axis| {
            let [low, high] = ranges[axis];
            let extent = region.extent(axis);
            extent.map(|at| at.clamp(low, high))
        })
    }

    /// Whether (u, v) is in the region; everything is where the job has none.
    #[must_use]
    pub fn is_in_region(&self, u: f64, v: f64) -> bool {
        let Some(region) = &self.region else {
            return true;
        };
        let (path, side) = self.swapped(u, v);
        region.contains([path, side])
    }

    /// Whether (u, v) is in the region and at least this far from those parts of its boundary that are not the surface's, mm: by the metric there, along the path
    /// parameter and along the side parameter.
    #[must_use]
    pub fn is_deep_in_region(&self, u: f64, v: f64, depth_mm: f64) -> bool {
        let Some(region) = &self.region else {
            return true;
        };
        if !self.is_in_region(u, v) {
            return false;
        }
        let at = self.surface.at(u, v);
        let (path, side) = self.swapped(u, v);
        let (a, b) = match self.along {
            Along::U => (at.u, at.v),
            Along::V => (at.v, at.u),
        };
        let boundaries = [self.path_range(), self.side_range()];
        let is_cut = |edge: &[[f64; 2]; 2]| {
            let [from, to] = edge;
            !(0..2).any(|k| from[k] == to[k] && boundaries[k].contains(&from[k]))
        };
        let distance = |[from, to]: &[[f64; 2]; 2]| {
            let mm = |point: &[f64; 2]| a * (point[0] - path) + b * (point[1] - side);
            let (from, to) = (mm(from), mm(to));
            let way = to - from;
            let share = if way.length_squared() > 0.0 {
                (-from.dot(way) / way.length_squared()).clamp(0.0, 1.0)
            } else {
                0.0
            };
            (from + share * way).length()
        };
        region
            .edges
            .iter()
            .filter(|edge| is_cut(edge))
            .all(|edge| distance(edge) >= depth_mm)
    }

    /// Whether (u, v) is so deep in the region that a pass serves it: half of the step-over, of a curved pass of that in the direction in which it is greatest.
    /// Everything is where the job has none.
    #[must_use]
    pub fn is_served(&self, u: f64, v: f64) -> bool {
        if self.region.is_none() {
            return true;
        }
        let depth_mm = self.contact(u, v).map_or(f64::INFINITY, |contact| {
            if self.spacing.is_constant() {
                let room = 1.0 - contact.fit(self.radius_mm);
                (8.0 * self.radius_mm * self.scallop_mm / room.max(0.0)).sqrt()
            } else {
                contact.step_over_mm
            }
        });
        self.is_deep_in_region(u, v, 0.5 * depth_mm)
    }

    /// Whether a place of a curved pass is in a cell of the region, or on its boundary but for the machine's rounding.
    pub(super) fn is_on_pass(&self, path: f64, side: f64) -> bool {
        let mut cells = self.cells.iter();
        self.region.is_none() || cells.any(|region| region.contains([path, side]) || region.is_on(path, side))
    }

    /// Whether a curved pass may begin or end here: on the boundary of a cell, or at a line that passes go to, beyond which only slivers are left.
    pub(super) fn is_end(&self, path: f64, side: f64, outer: &[Option<[f64; 2]>]) -> bool {
        let is_beyond = |lines: &[f64; 2]| self.is_at_last(side, *lines);
        self.cells.iter().zip(outer).any(|(cell, lines)| {
            cell.is_on(path, side) || (lines.as_ref().is_some_and(is_beyond) && cell.contains([path, side]))
        })
    }

    /// Whether a place is at the last line, or beyond it; from the middle at the first one, too.
    fn is_at_last(&self, side: f64, [first, last]: [f64; 2]) -> bool {
        let near = self.near_side();
        side >= last - near || (self.starts_in_middle() && side <= first + near)
    }

    /// Whether the last pass of a cell may be here: on the last line, or from the middle on the first one.
    pub(super) fn is_last_of_cell(&self, side: f64, [first, last]: [f64; 2]) -> bool {
        let near = self.near_side();
        if self.starts_in_middle() {
            side <= first + near
        } else {
            side >= last - near
        }
    }

    /// The first and the last line of each cell; none where that holds no pass.
    pub(super) fn outer_lines_of_cells(&self) -> Vec<Option<[f64; 2]>> {
        let cells = (0..self.cells.len()).map(|index| self.of_cell(index));
        cells
            .map(|cell| {
                let [first, last] = cell.pass_range();
                let is_empty = cell.is_empty_between(first, last);
                cell.outer_lines().filter(|_| !is_empty)
            })
            .collect()
    }

    /// Intervals of a line that lie in the region, ascending; the whole line where the job has none.
    #[must_use]
    pub fn intervals(&self, side: f64) -> Vec<[f64; 2]> {
        match &self.region {
            Some(region) => region.intervals(side),
            None => vec![self.path_range()],
        }
    }

    /// Whether two passes, each given by its side parameter and its range of the path parameter, lie in one cell of the region that also covers a place between them within the
    /// range `from` to `to`.
    #[must_use]
    pub fn are_in_one_cell(&self, passes: [(f64, [f64; 2]); 2], [from, to]: [f64; 2]) -> bool {
        let [(near, _), (far, _)] = passes;
        let is_between = |[start, end]: &[f64; 2]| *start < to && from < *end;
        self.cells.iter().any(|cell| {
            let [_, most] = cell.extent(1);
            let holds = |(side, [from, to]): &(f64, [f64; 2])| {
                // But for the rounding of its ends.
                let is_of_pass =
                    |[start, end]: &[f64; 2]| to.min(*end) - from.max(*start) >= 0.99 * (to - from);
                *side <= most + cell.near_side() && cell.intervals(*side).iter().any(is_of_pass)
            };
            passes.iter().all(holds) && cell.intervals(0.5 * (near + far)).iter().any(is_between)
        })
    }

    /// Length of an interval, mm.
    fn interval_mm(&self, [from, to]: [f64; 2], side: f64) -> f64 {
        let at = |k: u32| {
            let path = from + (to - from) * f64::from(k) / f64::from(LENGTH_POINTS);
            let (u, v) = self.swapped(path, side);
            self.surface.at(u, v).point
        };
        (0..LENGTH_POINTS).map(|k| at(k).distance(at(k + 1))).sum()
    }

    /// Intervals that are passes whatever the parametrisation.
    pub(super) fn certain_intervals(&self, side: f64) -> Vec<[f64; 2]> {
        // Without a region a line has one, also where it is a point.
        let Some(region) = &self.region else {
            return self.intervals(side);
        };
        let least_mm = CERTAIN_SHARE * (8.0 * self.radius_mm * self.scallop_mm).sqrt();
        let rounding = NEAR_PLACES * region.place[0];
        let is_long = |interval: &[f64; 2]| {
            let length = interval[1] - interval[0];
            self.interval_mm(*interval, side) * (1.0 - rounding / length) > least_mm
        };
        let mut intervals = self.intervals(side);
        intervals.retain(is_long);
        intervals
    }

    /// Whether a pass from one path parameter to another lies in the region and ends at its boundary, but for the machine's rounding.
    pub(super) fn is_interval(&self, ends: [f64; 2], side: f64) -> bool {
        let Some(region) = &self.region else {
            return true;
        };
        if !ends.iter().all(|end| region.is_on(*end, side)) {
            return false;
        }
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let middle = 0.5 * (low + high);
        // What is outside of the interval by f64 is a strip along the boundary.
        let is_at = |of: f64| {
            let intervals = self.intervals(of);
            let around = intervals
                .iter()
                .find(|[from, to]| (*from..=*to).contains(&middle));
            around.is_some_and(|[from, to]| {
                (*from <= low || region.is_on(0.5 * (from + low), side))
                    && (*to >= high || region.is_on(0.5 * (to + high), side))
            })
        };
        // Beside an edge of constant side parameter the machine's line may be rounded across it.
        let near = region.near_side();
        [0.0, near, -near].into_iter().any(|by| is_at(side + by))
    }

    /// Whether the passes of a line leave out no interval.
    pub(super) fn is_line_complete(&self, passes: &[[f64; 2]], side: f64) -> bool {
        self.region.is_none()
            || self.certain_intervals(side).iter().all(|[from, to]| {
                let middle = 0.5 * (from + to);
                passes
                    .iter()
                    .any(|[a, b]| (a.min(*b)..=a.max(*b)).contains(&middle))
            })
    }

    /// A few places of the machine along the side parameter.
    pub(super) fn near_side(&self) -> f64 {
        self.region.as_ref().map_or(0.0, RegionEdges::near_side)
    }

    /// Whether no line between two side parameters has an interval, apart from both of them.
    pub(super) fn is_empty_between(&self, from: f64, to: f64) -> bool {
        let Some(region) = &self.region else {
            return from >= to;
        };
        let off = region.near_side();
        let mut sides = vec![from + off, to - off];
        sides.extend(
            region
                .sides()
                .iter()
                .flat_map(|side| [side - off, *side, side + off]),
        );
        sides
            .iter()
            .filter(|side| (from + off..=to - off).contains(side))
            .all(|side| self.certain_intervals(*side).is_empty())
    }

    /// Side parameters between which the passes lie.
    #[must_use]
    pub fn pass_range(&self) -> [f64; 2] {
        self.region
            .as_ref()
            .map_or_else(|| self.side_range(), |region| region.extent(1))
    }

    /// The first line of the region at a side parameter or above it that has an interval.
    pub(super) fn next_line(&self, side: f64) -> Option<f64> {
        let Some(region) = &self.region else {
            return Some(side);
        };
        if !self.certain_intervals(side).is_empty() {
            return Some(side);
        }
        let [_, most] = self.pass_range();
        let mut below = side;
        for above in region.sides().into_iter().chain([most]) {
            let above = if above >= most { most } else { above };
            if above <= side {
                continue;
            }
            // Between two vertices an interval's length is linear.
            for end in [above - region.near_side(), above] {
                if end > below && !self.certain_intervals(end).is_empty() {
                    let (mut without, mut with) = (below, end);
                    for _ in 0..60 {
                        let middle = 0.5 * (without + with);
                        if self.certain_intervals(middle).is_empty() {
                            without = middle;
                        } else {
                            with = middle;
                        }
                    }
                    return Some(with);
                }
                below = below.max(end);
            }
        }
        None
    }

    /// The last line of the region that has an interval.
    pub(super) fn last_line(&self) -> f64 {
        let [first, most] = self.pass_range();
        let Some(region) = &self.region else {
            return most;
        };
        let mut above = most;
        for side in region.sides().into_iter().rev() {
            for end in [side, side - region.near_side()] {
                if !self.certain_intervals(end.min(most)).is_empty() {
                    let (mut without, mut with) = (above, end);
                    if without <= with {
                        return end;
                    }
                    for _ in 0..60 {
                        let middle = 0.5 * (without + with);
                        if self.certain_intervals(middle).is_empty() {
                            without = middle;
                        } else {
                            with = middle;
                        }
                    }
                    return with;
                }
                above = end;
            }
        }
        first
    }
}
