//! The optional section `[region]`: the part of the surface that is machined.

use job::{JobError, Region, SurfaceSpec};

use crate::section::{Section, Value};

/// Distance by which a vertex may lie outside the surface's range, as a share of the range: rounding of a decimal.
const RANGE_TOLERANCE: f64 = 1e-9;
/// Double area of a triangle of three points, as a share of the product of the ranges, below which they count as one line.
const LINE_TOLERANCE: f64 = 1e-12;

const EXAMPLE: &str =
    "write loops = [[[u, v], [u, v], [u, v]], ...]: the vertices of a polygon, then those of its holes";

/// An edge, with the number of its loop and of the vertex where it begins.
#[derive(Clone, Copy)]
struct Edge {
    of: usize,
    index: usize,
    ends: [[f64; 2]; 2],
}

/// Reads the section, for a surface.
pub(super) fn read(section: &Section<'_>, surface: &SurfaceSpec) -> Result<Region, JobError> {
    section.only(&["loops"], &[])?;
    let domain = surface.domain();
    let list = section.value("loops")?;
    let values = list.list("loop")?;
    if values.is_empty() {
        return Err(list.error("must have at least one loop", EXAMPLE));
    }
    let mut loops = Vec::new();
    let mut places = Vec::new();
    let mut count = 0;
    for value in &values {
        let (points, vertices) = read_loop(value, domain)?;
        count += points.len();
        if count > Region::VERTICES_MAX {
            return Err(list.error(
                &format!("has more than {} vertices", Region::VERTICES_MAX),
                "simplify the loops: a vertex each few micrometres is more than the machine needs",
            ));
        }
        loops.push(points);
        places.push(vertices);
    }
    if let Some([first, second]) = crossing(&loops, domain) {
        let [u, v] = meeting(first.ends, second.ends);
        let what = if first.of == second.of {
            format!(
                "crosses itself: its edge from here meets the one from vertex {} at u = {u:.6}, v = {v:.6}",
                second.index + 1
            )
        } else {
            format!(
                "crosses another loop: its edge from here meets loop {} at u = {u:.6}, v = {v:.6}",
                second.of + 1
            )
        };
        return Err(places[first.of][first.index].error(
            &what,
            "put the vertices in their order around the region; loops may lie inside one another or touch, but not cross",
        ));
    }
    Ok(Region::new(loops))
}

/// The vertices of a loop, without repetitions, and where they are written.
fn read_loop<'v, 't>(
    value: &Value<'v, 't>,
    domain: [[f64; 2]; 2],
) -> Result<(Vec<[f64; 2]>, Vec<Value<'v, 't>>), JobError> {
    let mut points: Vec<[f64; 2]> = Vec::new();
    let mut places = Vec::new();
    for vertex in value.list("vertex")? {
        let mut point: [f64; 2] = vertex.numbers()?;
        for (name, (value, [low, high])) in ["u", "v"].iter().zip(point.iter_mut().zip(domain)) {
            let off = RANGE_TOLERANCE * (high - low);
            if !(low - off..=high + off).contains(value) {
                return Err(vertex.error(
                    &format!("lies outside the surface: {name} = {value}, but its range is {low} to {high}"),
                    "end the loop at the surface's boundary",
                ));
            }
            *value = value.clamp(low, high);
        }
        if points.last() != Some(&point) {
            points.push(point);
            places.push(vertex);
        }
    }
    // A loop that is closed by its first vertex once more.
    if points.len() > 1 && points.first() == points.last() {
        points.pop();
        places.pop();
    }
    if points.len() < 3 {
        return Err(value.error(
            &format!("must have at least 3 different vertices, not {}", points.len()),
            EXAMPLE,
        ));
    }
    Ok((points, places))
}

/// Two edges that cross.
fn crossing(loops: &[Vec<[f64; 2]>], domain: [[f64; 2]; 2]) -> Option<[Edge; 2]> {
    let mut edges: Vec<Edge> = Vec::new();
    for (of, points) in loops.iter().enumerate() {
        let next = points.iter().cycle().skip(1);
        let ends = points.iter().zip(next).map(|(from, to)| [*from, *to]);
        edges.extend(ends.enumerate().map(|(index, ends)| Edge { of, index, ends }));
    }
    let least = |edge: &Edge| edge.ends[0][0].min(edge.ends[1][0]);
    let most = |edge: &Edge| edge.ends[0][0].max(edge.ends[1][0]);
    edges.sort_by(|a, b| least(a).total_cmp(&least(b)));
    let [[u0, u1], [v0, v1]] = domain;
    let line = LINE_TOLERANCE * (u1 - u0) * (v1 - v0);
    for (k, first) in edges.iter().enumerate() {
        let reached = edges
            .iter()
            .skip(k + 1)
            .take_while(|other| least(other) < most(first));
        for second in reached {
            if cross(first.ends, second.ends, line) {
                let mut pair = [*first, *second];
                pair.sort_by_key(|edge| (edge.of, edge.index));
                return Some(pair);
            }
        }
    }
    None
}

/// Twice the area of a triangle.
fn area([a, b]: [[f64; 2]; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether two edges cross at a point inside both.
fn cross(first: [[f64; 2]; 2], second: [[f64; 2]; 2], line: f64) -> bool {
    let sides = |edge: [[f64; 2]; 2], points: [[f64; 2]; 2]| {
        let [a, b] = points.map(|point| area(edge, point));
        a.abs() > line && b.abs() > line && (a > 0.0) != (b > 0.0)
    };
    sides(first, second) && sides(second, first)
}

/// Where two edges that cross meet.
fn meeting([a, b]: [[f64; 2]; 2], second: [[f64; 2]; 2]) -> [f64; 2] {
    let (from, to) = (area(second, a), area(second, b));
    let share = from / (from - to);
    std::array::from_fn(|k| a[k] + share * (b[k] - a[k]))
}
