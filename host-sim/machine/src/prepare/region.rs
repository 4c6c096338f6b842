//! The region of a job as edges in the machine's store.
//!
//! Vertices are rounded to places of the path and the side parameter, 2^-21 of a span. The first and the last line are the first and the last that meet an interval
//! that is long enough, so the machine finds a pass on both. A cell that holds no pass is left out.
//!
//! For passes of constant scallop height a place on the side parameter is a share of all of it, edges of constant side are kept, and a cell is cut off at its last line, or
//! parted at its middle line ([`curved`]).

mod curved;

use interp_core::job::region::{
    CROSSINGS_MAX, Edge, FRACTION_BITS, FRONT_SIDE_BITS, REGION_SPANS_MAX, front_side_starts,
};
use job::{Along, Job, JobError, Region, Spacing};

use super::geometry::SurfaceEvaluator;
use super::{ParameterSpans, Prepared};

/// Shortest interval, as a share of the step-over of a plane.
const LEAST_SHARE: f64 = 0.1;
/// Points along and across each span at which the speed of the path parameter is taken.
const SPEEDS: u32 = 9;

/// Sizes of places that differ by less, relatively, are the same: the rounding of spans of some thousand places.
const SAME_SCALE: f64 = 1e-4;
/// Widths of spans that differ by less, relatively, are the same: over 1024 spans it adds up to less than a place.
const SAME_WIDTH: f64 = 1e-10;

const KEY: &str = "region.loops";

/// Adds the region's words; returns where its first pass starts, (u, v).
///
/// # Errors
/// The region has too many edges, meets a line too often, or holds no pass.
pub(super) fn add(job: &Job, region: &Region, prepared: &mut Prepared) -> Result<[f64; 2], JobError> {
    let no = |what: String, remedy: &str| Err(job.origin.error(KEY, what, remedy));
    if prepared.path.spans().max(prepared.side.spans()) > usize::from(REGION_SPANS_MAX) {
        return no(
            format!(
                "a surface with a region may have at most {REGION_SPANS_MAX} patches along each parameter"
            ),
            "use fewer knots, or cut the part into several jobs",
        );
    }
    let least = least(job, prepared);
    let sides = SidePlaces::new(job, prepared);
    let mut start = None;
    let mut records = Vec::new();
    for part in region.parts() {
        let edges = edges(job.along, &part, prepared, &sides);
        let (side, most) = most_met(&edges);
        if most > CROSSINGS_MAX {
            let name = match job.along {
                Along::U => "v",
                Along::V => "u",
            };
            return no(
                format!(
                    "a pass at {name} = {:.6} meets {most} edges of the region, more than {CROSSINGS_MAX}",
                    sides.parameter(side)
                ),
                "let the passes run along the other parameter, or cut the region into several jobs",
            );
        }
        let Some(lines) = lines(&edges, least) else {
            continue;
        };
        let whole = Cell { edges, lines };
        let cells = match job.spacing {
            Spacing::Constant(start) => curved::cells(whole, start, least),
            Spacing::Exact | Spacing::FirstOrder => vec![whole],
        };
        for Cell { edges, lines } in cells {
            let [first, last] = lines;
            let from = intervals(&edges, first, least)
                .first()
                .map_or(0, |[from, _]| *from);
            start.get_or_insert([parameter(&prepared.path, from), sides.parameter(first)]);
            let count = i32::try_from(edges.len()).unwrap_or(i32::MAX);
            records.push([count, first, last, least]);
            records.extend(edges.into_iter().map(Edge::to_words));
        }
    }
    let Some([path, side]) = start else {
        return no(
            "the region holds no pass: it is narrower than a tenth of the step-over everywhere".to_owned(),
            "draw a wider region",
        );
    };
    let Ok(edges) = u16::try_from(records.len()) else {
        return no(
            format!("the region has {} edges, more than {}", records.len(), u16::MAX),
            "simplify the loops, or cut the part into several jobs",
        );
    };
    prepared.header.edges = edges;
    prepared.words.extend(records.into_flattened());
    Ok(match job.along {
        Along::U => [path, side],
        Along::V => [side, path],
    })
}

/// A part of the region that is machined from a first line to a last one.
struct Cell {
    edges: Vec<Edge>,
    lines: [i32; 2],
}

/// The edges in order, without those of constant side. Places are fractions of spans, so an edge is parted where it crosses a knot between spans of
/// different width: it is straight on both sides, but not over both.
fn edges(along: Along, region: &Region, prepared: &Prepared, sides: &SidePlaces<'_>) -> Vec<Edge> {
    let swapped = |[u, v]: [f64; 2]| match along {
        Along::U => [u, v],
        Along::V => [v, u],
    };
    let axes = [&prepared.path, &prepared.side];
    let mut knots = axes.map(bends);
    knots[1].extend(sides.bends());
    let at = |[path, side]: [f64; 2]| [place(axes[0], path), sides.place(side)];
    let mut edges = Vec::new();
    for [from, to] in region.edges() {
        let (from, to) = (swapped(from), swapped(to));
        let mut shares: Vec<f64> = (0..2)
            .flat_map(|k| {
                knots[k]
                    .iter()
                    .map(move |knot| (knot - from[k]) / (to[k] - from[k]))
            })
            .filter(|share| *share > 0.0 && *share < 1.0)
            .collect();
        shares.sort_by(f64::total_cmp);
        let middle = shares
            .iter()
            .map(|share| [0, 1].map(|k| from[k] + share * (to[k] - from[k])));
        let vertices: Vec<[i32; 2]> = [from].into_iter().chain(middle).chain([to]).map(at).collect();
        edges.extend(
            vertices
                .windows(2)
                .filter_map(|ends| sides.edge(ends[0], ends[1])),
        );
    }
    edges.sort();
    edges
}

/// The places of the side parameter: of lines in spans, or of curved passes as shares of the whole.
struct SidePlaces<'a> {
    axis: &'a ParameterSpans,
    /// Ends of the spans of a job of curved passes.
    ends: Option<Vec<i32>>,
}

impl<'a> SidePlaces<'a> {
    fn new(job: &Job, prepared: &'a Prepared) -> Self {
        let axis = &prepared.side;
        let ends = job.spacing.is_constant().then(|| {
            let widths = prepared.words[..axis.spans()].iter();
            let widths: Vec<f32> = widths.map(|word| f32::from_bits(word.cast_unsigned())).collect();
            front_side_starts(&widths).chain([1 << FRONT_SIDE_BITS]).collect()
        });
        Self { axis, ends }
    }

    /// The place of a parameter, the nearest one.
    #[allow(clippy::cast_possible_truncation, reason = "within the ends of a span")]
    fn place(&self, at: f64) -> i32 {
        let Some(ends) = &self.ends else {
            return place(self.axis, at);
        };
        let breaks = &self.axis.breaks;
        let span = breaks
            .partition_point(|start| *start <= at)
            .clamp(1, self.axis.spans())
            - 1;
        let share = ((at - breaks[span]) / (breaks[span + 1] - breaks[span])).clamp(0.0, 1.0);
        ends[span] + (share * f64::from(ends[span + 1] - ends[span])).round() as i32
    }

    /// The parameter of a place.
    fn parameter(&self, place: i32) -> f64 {
        let Some(ends) = &self.ends else {
            return parameter(self.axis, place);
        };
        let breaks = &self.axis.breaks;
        let span = ends
            .partition_point(|start| *start <= place)
            .clamp(1, self.axis.spans())
            - 1;
        let share = f64::from(place - ends[span]) / f64::from(ends[span + 1] - ends[span]);
        breaks[span] + share * (breaks[span + 1] - breaks[span])
    }

    /// The knots of curved passes at which a place changes its size, for a smooth parametrisation.
    fn bends(&self) -> Vec<f64> {
        let Some(ends) = &self.ends else {
            return Vec::new();
        };
        let scales = ends.windows(2).zip(self.axis.breaks.windows(2));
        let scales: Vec<f64> = scales
            .map(|(ends, breaks)| f64::from(ends[1] - ends[0]) / (breaks[1] - breaks[0]))
            .collect();
        let knots = scales.windows(2).zip(&self.axis.breaks[1..]);
        knots
            .filter(|(scales, _)| (scales[0] - scales[1]).abs() > SAME_SCALE * scales[0])
            .map(|(_, knot)| *knot)
            .collect()
    }

    fn edge(&self, a: [i32; 2], b: [i32; 2]) -> Option<Edge> {
        match self.ends {
            Some(_) => Edge::for_fronts(a, b),
            None => Edge::between(a, b),
        }
    }
}

/// The knots between spans of different width.
fn bends(axis: &ParameterSpans) -> Vec<f64> {
    let differ = |ends: &&[f64]| {
        let [before, after] = [ends[1] - ends[0], ends[2] - ends[1]];
        (before - after).abs() > SAME_WIDTH * before.max(after)
    };
    axis.breaks
        .windows(3)
        .filter(differ)
        .map(|ends| ends[1])
        .collect()
}

/// The place of a parameter, the nearest one.
#[allow(
    clippy::cast_possible_truncation,
    reason = "spans and fractions are within their bits"
)]
fn place(axis: &ParameterSpans, at: f64) -> i32 {
    let breaks = &axis.breaks;
    let span = breaks
        .partition_point(|start| *start <= at)
        .clamp(1, breaks.len() - 1)
        - 1;
    let (start, end) = (breaks[span], breaks[span + 1]);
    let unit = f64::from(1 << FRACTION_BITS);
    ((span as f64 + ((at - start) / (end - start)).clamp(0.0, 1.0)) * unit).round() as i32
}

/// The parameter of a place.
fn parameter(axis: &ParameterSpans, place: i32) -> f64 {
    let span = usize::try_from(place >> FRACTION_BITS)
        .unwrap_or(0)
        .min(axis.spans() - 1);
    let (start, end) = (axis.breaks[span], axis.breaks[span + 1]);
    let within = f64::from(place) / f64::from(1 << FRACTION_BITS) - span as f64;
    start + (end - start) * within
}

/// The line that meets most edges, and how many.
fn most_met(edges: &[Edge]) -> (i32, usize) {
    let crossed = || edges.iter().filter(|edge| edge.side[0] < edge.side[1]);
    let mut ends: Vec<i32> = crossed().map(|edge| edge.side[1]).collect();
    ends.sort_unstable();
    let (mut ended, mut most) = (0, (0, 0));
    for (index, edge) in crossed().enumerate() {
        let [side, _] = edge.side;
        while ends[ended] <= side {
            ended += 1;
        }
        let met = index + 1 - ended;
        if met > most.1 {
            most = (side, met);
        }
    }
    most
}

/// Shortest interval: that is shorter than a tenth of the step-over wherever it lies.
#[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
fn least(job: &Job, prepared: &Prepared) -> i32 {
    let surface = SurfaceEvaluator::new(&job.surface);
    let at = |[start, end]: [f64; 2], k: u32| start + (end - start) * f64::from(k) / f64::from(SPEEDS - 1);
    let mut most_mm = 0.0_f64;
    for path in prepared.path.breaks.windows(2).map(|ends| [ends[0], ends[1]]) {
        for side in prepared.side.breaks.windows(2).map(|ends| [ends[0], ends[1]]) {
            for (i, j) in (0..SPEEDS).flat_map(|i| (0..SPEEDS).map(move |j| (i, j))) {
                let (path_at, side_at) = (at(path, i), at(side, j));
                let speed = match job.along {
                    Along::U => surface.at(path_at, side_at).u,
                    Along::V => surface.at(side_at, path_at).v,
                };
                most_mm = most_mm.max(speed.length() * (path[1] - path[0]));
            }
        }
    }
    let places = LEAST_SHARE * job.plane_step_over_mm() / most_mm * f64::from(1 << FRACTION_BITS);
    (places.floor() as i32).max(1)
}

/// Intervals of a line that are long enough; those that meet are one.
fn intervals(edges: &[Edge], side: i32, least: i32) -> Vec<[i32; 2]> {
    let mut crossings: Vec<i32> = edges
        .iter()
        .take_while(|edge| edge.side[0] <= side)
        .filter(|edge| edge.meets(side))
        .map(|edge| edge.crossing(side))
        .collect();
    crossings.sort_unstable();
    let mut intervals: Vec<[i32; 2]> = Vec::new();
    for pair in crossings.as_chunks::<2>().0 {
        match intervals.last_mut() {
            Some([_, end]) if *end == pair[0] => *end = pair[1],
            _ => intervals.push(*pair),
        }
    }
    intervals.retain(|[from, to]| to - from >= least);
    intervals
}

/// The first and the last line with an interval.
fn lines(edges: &[Edge], least: i32) -> Option<[i32; 2]> {
    let mut sides = sides(edges);
    let first = first_line(edges, &sides, least)?;
    sides.reverse();
    Some([first, first_line(edges, &sides, least)?])
}

/// The first line with an interval, in the order of these sides. Between two vertices an interval's length is linear, so it is greatest at one of them.
fn first_line(edges: &[Edge], sides: &[i32], least: i32) -> Option<i32> {
    let holds = |side: i32| !intervals(edges, side, least).is_empty();
    let first = sides.iter().position(|side| holds(*side))?;
    let mut with = sides[first];
    let mut without = match first.checked_sub(1) {
        Some(before) => sides[before],
        None => with,
    };
    while (with - without).abs() > 1 {
        let middle = without + (with - without) / 2;
        if holds(middle) {
            with = middle;
        } else {
            without = middle;
        }
    }
    Some(with)
}

/// The lines through vertices and those just before, ascending.
fn sides(edges: &[Edge]) -> Vec<i32> {
    let mut sides: Vec<i32> = edges
        .iter()
        .flat_map(|edge| [edge.side[0], edge.side[1] - 1, edge.side[1]])
        .collect();
    sides.sort_unstable();
    sides.dedup();
    sides
}
