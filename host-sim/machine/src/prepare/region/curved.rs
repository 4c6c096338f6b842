//! The cells of curved passes. Each is cut off at its last line, so that no front continues beyond that line. With a start in the middle a cell is divided there, and its
//! lower part is machined backwards.

use interp_core::job::region::{Edge, FRONT_SIDE_BITS};
use job::Start;

use super::{Cell, first_line, intervals, sides};

/// Least distance of the last line from the end of the side parameter, units of the fronts: 6 nm in 100 mm, so that rounding takes no pass beyond the end.
const BEFORE_END: i32 = 16;

/// The cells of a part of a region with these lines, in order.
pub(super) fn cells(mut whole: Cell, start: Start, least: i32) -> Vec<Cell> {
    let [first, last] = whole.lines;
    whole.lines = [first, last.min((1 << FRONT_SIDE_BITS) - BEFORE_END).max(first)];
    if start == Start::Edge {
        return vec![upwards(whole.edges, whole.lines, least)];
    }
    let middle = middle_line(&whole, least);
    let [_, last] = whole.lines;
    let upper = upwards(cut_below(&whole.edges, middle), [middle, last], least);
    let first = first.max(BEFORE_END).min(middle);
    let lower = downwards(cut_above(&whole.edges, middle), [middle, first], least);
    let is_parted = lower.lines[0] > lower.lines[1];
    [upper].into_iter().chain(is_parted.then_some(lower)).collect()
}

/// The line in the middle between the first and the last one, or the next one above it that holds an interval.
fn middle_line(cell: &Cell, least: i32) -> i32 {
    let [first, last] = cell.lines;
    let middle = first + (last - first) / 2;
    let mut sides = sides(&cell.edges);
    sides.retain(|side| *side > middle && *side <= last);
    sides.insert(0, middle);
    first_line(&cell.edges, &sides, least).unwrap_or(first)
}

/// The part of these edges up to the last line.
fn upwards(edges: Vec<Edge>, [first, last]: [i32; 2], least: i32) -> Cell {
    cut_off(edges, [first, last], least, cut_above)
}

/// The part of these edges down to the last line.
fn downwards(edges: Vec<Edge>, [first, last]: [i32; 2], least: i32) -> Cell {
    cut_off(edges, [first, last], least, cut_below)
}

/// A cell that is cut off at its last line. Places are rounded anew where edges are cut, so the line may be too short by one: then it is nearer to the first.
fn cut_off(
    edges: Vec<Edge>,
    [first, mut last]: [i32; 2],
    least: i32,
    cut: impl Fn(&[Edge], i32) -> Vec<Edge>,
) -> Cell {
    let mut back = 1;
    loop {
        let edges = cut(&edges, last);
        if last == first || !intervals(&edges, last, least).is_empty() {
            let lines = [first, last];
            return Cell { edges, lines };
        }
        last = if first < last {
            (last - back).max(first)
        } else {
            (last + back).min(first)
        };
        back *= 2;
    }
}

/// The edges of the part on a line and below it.
fn cut_above(edges: &[Edge], line: i32) -> Vec<Edge> {
    // The line crosses edges that end above it.
    let end = line + 1;
    cut(
        edges,
        end,
        |edge| edge.side[0] <= end,
        |edge| [edge.path[0], edge.side[0]],
    )
}

/// The edges of the part on a line and above it.
fn cut_below(edges: &[Edge], line: i32) -> Vec<Edge> {
    cut(
        edges,
        line,
        |edge| edge.side[0] > line,
        |edge| [edge.path[1], edge.side[1]],
    )
}

/// The edges on one side of a line: whole ones, those that meet the line from there to the kept end, and along the line from each crossing to the next.
fn cut(
    edges: &[Edge],
    line: i32,
    is_kept: impl Fn(&Edge) -> bool,
    kept_end: impl Fn(&Edge) -> [i32; 2],
) -> Vec<Edge> {
    let mut crossings = Vec::new();
    let mut kept: Vec<Edge> = Vec::new();
    for edge in edges {
        if edge.meets(line) {
            let at = edge.crossing(line);
            crossings.push(at);
            kept.extend(Edge::for_fronts(kept_end(edge), [at, line]));
        } else if is_kept(edge) {
            kept.push(*edge);
        }
    }
    crossings.sort_unstable();
    for pair in crossings.as_chunks::<2>().0 {
        kept.extend(Edge::for_fronts([pair[0], line], [pair[1], line]));
    }
    kept.sort();
    kept
}
