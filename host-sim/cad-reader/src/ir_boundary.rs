//! Boundaries of the model of `cadmpeg` as points along smooth edges.

use cadmpeg_ir::topology::{Coedge, Edge as SourceEdge, LoopBoundary, Sense};

use crate::ir_index::{Translation, entity};
use cad::{Boundary, Curve, Edge};
use glam::DVec3;

/// Least number of intervals along a boundary edge, equal in its parameter.
const EDGE_INTERVALS: usize = 16;
/// Largest number of intervals: then the edge is as exact as it gets.
const EDGE_INTERVALS_MAX: usize = 1024;
/// A cubic through four neighbouring points is this close to the edge between them, mm: whoever traces the edge interpolates so.
const CUBIC_MM: f64 = 1e-4;
/// Largest distance between the ends of an edge's curve and its vertices, mm; above it the edge is not supported.
const VERTEX_MM: f64 = 0.05;

impl Translation<'_> {
    /// A face's boundary.
    pub(crate) fn boundary<'i>(&self, loops: impl Iterator<Item = &'i str>) -> Boundary {
        let mut all = Vec::new();
        for id in loops {
            let Some(item) = self.loops.get(id).and_then(|index| self.source.loops.get(*index)) else {
                return Boundary::Unknown("a loop is missing".to_owned());
            };
            // A loop of one vertex is a degenerate boundary.
            let LoopBoundary::Ring(ring) = &item.boundary else {
                continue;
            };
            let mut edges = Vec::new();
            for id in ring.coedges() {
                let found = self
                    .coedges
                    .get(id.as_str())
                    .and_then(|index| self.source.coedges.get(*index));
                match found
                    .ok_or_else(|| "an edge is missing".to_owned())
                    .and_then(|use_| self.edge(use_))
                {
                    Ok(smooth) => edges.extend(smooth),
                    Err(why) => return Boundary::Unknown(why),
                }
            }
            if let Some(gap_mm) = gap_mm(&edges).filter(|gap_mm| gap_mm.is_nan() || *gap_mm > VERTEX_MM) {
                return Boundary::Unknown(format!("a loop has a gap of {gap_mm:.3} mm"));
            }
            if !edges.is_empty() {
                all.push(edges);
            }
        }
        if all.is_empty() {
            Boundary::Natural
        } else {
            Boundary::Loops(all)
        }
    }

    /// The smooth parts of an edge, as points in the direction of its use; empty for a degenerate edge.
    fn edge(&self, coedge: &Coedge) -> Result<Vec<Edge>, String> {
        let edge = self
            .edges
            .get(coedge.edge.as_str())
            .and_then(|index| self.source.edges.get(*index))
            .ok_or("an edge is missing")?;
        let Some(curve) = edge.carrier.curve() else {
            // At a degenerate point an edge has no curve; where there should be one, the reader gave none either.
            return if edge.start == edge.end {
                Ok(Vec::new())
            } else {
                Err(format!("edge {} has no curve in space", entity(edge.id.as_str())))
            };
        };
        let curve = self.curve(curve.as_str())?;
        let mut parts = self.along(edge, &curve)?;
        if coedge.sense == Sense::Reversed {
            parts.reverse();
            parts.iter_mut().for_each(|points| points.reverse());
        }
        Ok(parts)
    }

    fn along(&self, edge: &SourceEdge, curve: &Curve) -> Result<Vec<Edge>, String> {
        let ends = [&edge.start, &edge.end].map(|id| self.vertices.get(id.as_str()).copied());
        let [Some(start), Some(end)] = ends else {
            return Err(format!("edge {} has no ends", entity(edge.id.as_str())));
        };
        if let Curve::Line { .. } = curve {
            // A line is defined by its ends.
            return Ok(vec![evenly(EDGE_INTERVALS, |share| {
                start + (end - start) * share
            })]);
        }
        let given = edge.carrier.param_range().map(|range| range.get());
        let closed = edge.start == edge.end || start.distance(end) < 1e-9;
        let range = match (given, curve) {
            (Some(range), _) => range,
            (None, Curve::Ellipse { center, x, y }) => {
                let angle = |p: DVec3| {
                    let from = p - *center;
                    (from.dot(*y) / y.length_squared()).atan2(from.dot(*x) / x.length_squared())
                };
                let first = angle(start);
                let turn = (angle(end) - first).rem_euclid(std::f64::consts::TAU);
                let turn = if closed || turn == 0.0 {
                    std::f64::consts::TAU
                } else {
                    turn
                };
                [first, first + turn]
            }
            (None, Curve::Parabola { vertex: from, y, .. }) => {
                [start, end].map(|p| (p - *from).dot(*y) / y.length_squared())
            }
            (None, Curve::Hyperbola { center: from, y, .. }) => {
                [start, end].map(|p| ((p - *from).dot(*y) / y.length_squared()).asinh())
            }
            (None, _) => curve.domain().ok_or("an edge has no range")?,
        };
        let mut ends = vec![range[0]];
        if let Curve::Spline(spline) = curve {
            // Some programs write a whole boundary as one curve: it is split at its corners.
            let corner = |knot: &f64| spline.axis.multiplicity(*knot) >= spline.axis.degree;
            let inside = |knot: &f64| *knot > range[0] && *knot < range[1];
            ends.extend(
                spline
                    .axis
                    .breaks()
                    .into_iter()
                    .filter(|knot| inside(knot) && corner(knot)),
            );
        }
        ends.push(range[1]);
        let parts: Vec<Edge> = ends
            .windows(2)
            .map(|part| {
                let point = |share: f64| curve.at(part[0] + (part[1] - part[0]) * share)[0];
                let mut intervals = intervals(curve, [part[0], part[1]]);
                let mut points = evenly(intervals, point);
                while intervals < EDGE_INTERVALS_MAX {
                    let finer = evenly(2 * intervals, point);
                    if cad::interpolation_error_mm(&points, &finer) <= CUBIC_MM {
                        break;
                    }
                    (intervals, points) = (2 * intervals, finer);
                }
                points
            })
            .collect();
        let [first, last] = [curve.at(range[0])[0], curve.at(range[1])[0]];
        let missed = first.distance(start).max(last.distance(end));
        if missed.is_nan() || missed > VERTEX_MM {
            return Err(format!("edge {} misses its ends", entity(edge.id.as_str())));
        }
        Ok(parts)
    }
}

/// Intervals of a part of an edge to begin with: two for each span of a spline, of which one may have a feature that the others do not show; they are compared with twice as many.
fn intervals(curve: &Curve, [start, end]: [f64; 2]) -> usize {
    let Curve::Spline(spline) = curve else {
        return EDGE_INTERVALS;
    };
    let mut ends = spline.axis.breaks();
    ends.retain(|knot| *knot > start && *knot < end);
    ends.insert(0, start);
    ends.push(end);
    let shortest = ends
        .windows(2)
        .map(|span| span[1] - span[0])
        .fold(end - start, f64::min);
    let mut intervals = EDGE_INTERVALS;
    while intervals < EDGE_INTERVALS_MAX && (intervals as f64) * shortest < 2.0 * (end - start) {
        intervals *= 2;
    }
    intervals
}

/// Points at equal steps of the share of an edge, its ends included.
fn evenly(intervals: usize, point: impl Fn(f64) -> DVec3) -> Edge {
    (0..=intervals)
        .map(|k| point(k as f64 / intervals as f64))
        .collect()
}

/// Largest distance between the end of an edge and the beginning of the next, mm.
fn gap_mm(edges: &[Edge]) -> Option<f64> {
    let next = edges.iter().cycle().skip(1);
    let gaps = edges
        .iter()
        .zip(next)
        .map(|(edge, next)| match (edge.last(), next.first()) {
            (Some(end), Some(start)) => end.distance(*start),
            _ => f64::NAN,
        });
    gaps.reduce(|most, gap| if gap > most || gap.is_nan() { gap } else { most })
}

#[cfg(test)]
mod tests {
    use super::*;
    use cad::{Axis, SplineCurve};

    /// An edge of many spans has points in each of them.
    #[test]
    fn every_span_of_an_edge_has_points() {
        for spans in [1_u32, 7, 40, 200] {
            let mut knots = vec![0.0; 3];
            knots.extend((0..=spans).map(f64::from));
            knots.extend([f64::from(spans); 3]);
            let count = spans as usize + 3;
            let curve = Curve::Spline(SplineCurve {
                axis: Axis { degree: 3, knots },
                poles: vec![[0.0, 0.0, 0.0, 1.0]; count],
            });
            let found = intervals(&curve, [0.0, f64::from(spans)]);
            assert!(
                found >= 2 * spans as usize && (EDGE_INTERVALS..=EDGE_INTERVALS_MAX).contains(&found),
                "{found} of {spans}"
            );
        }
    }
}
