//! The sides of a face of a plane: edges that go on along the same line or circle are one, and each is a curve on [0, 1].

use glam::DVec3;

use super::FOLLOWS_MM;
use super::plane::Plane;
use crate::Edge;
use crate::curve::Curve;
use crate::interpolation::between;
use crate::plane::circle;
use crate::spline::{Axis, SplineCurve};

/// An arc that turns farther meets the others in no quad, rad.
const TURN_MAX: f64 = 3.0;
/// Most spans of a cubic.
const SPANS_MAX: usize = 16;
/// Ends of edges that should meet are at most so far apart, mm.
const GAP_MM: f64 = 1e-3;

/// Four sides in the order of the loop, each from one corner to the next.
pub(super) struct Sides {
    pub(super) curves: [SplineCurve; 4],
    pub(super) corners: [DVec3; 4],
}

/// What an edge is.
#[derive(Clone, Copy)]
enum Kind {
    Line,
    Arc {
        centre: DVec3,
        radius: f64,
        /// About the plane's normal, rad.
        turn: f64,
    },
    Free,
}

/// An edge, or several that are one.
struct Side {
    points: Edge,
    kind: Kind,
}

/// The four sides of a loop; `None` if it has another number, or one cannot be followed.
pub(super) fn four(edges: &[Edge], plane: &Plane) -> Option<Sides> {
    let mut sides: Vec<Side> = Vec::new();
    for edge in edges {
        let side = Side {
            kind: kind(edge, plane.normal)?,
            points: edge.clone(),
        };
        match sides
            .last()
            .and_then(|before| joined(before, &side, plane.normal))
        {
            Some(both) => *sides.last_mut()? = both,
            None => sides.push(side),
        }
    }
    if sides.len() > 1
        && let Some(both) = joined(sides.last()?, sides.first()?, plane.normal)
    {
        sides[0] = both;
        sides.pop();
    }
    let sides: [Side; 4] = sides.try_into().ok()?;
    let start = |k: usize| sides[k % 4].points.first().copied();
    let end = |k: usize| sides[k % 4].points.last().copied();
    let mut corners = [DVec3::ZERO; 4];
    for (k, corner) in corners.iter_mut().enumerate() {
        let (before, after) = (end(k + 3)?, start(k)?);
        if before.distance(after) > GAP_MM {
            return None;
        }
        *corner = plane.nearest(0.5 * (before + after));
    }
    let mut curves = Vec::with_capacity(4);
    for (k, side) in sides.iter().enumerate() {
        curves.push(curve(side, [corners[k], corners[(k + 1) % 4]], plane)?);
    }
    Some(Sides {
        curves: curves.try_into().ok()?,
        corners,
    })
}

/// `None`: an edge without length.
fn kind(edge: &Edge, normal: DVec3) -> Option<Kind> {
    let (first, last) = (*edge.first()?, *edge.last()?);
    let along = (last - first).normalize_or_zero();
    if first.distance(last) <= 2.0 * GAP_MM {
        return None;
    }
    if edge
        .iter()
        .all(|p| (*p - first).cross(along).length() <= FOLLOWS_MM)
    {
        return Some(Kind::Line);
    }
    let Some(circle) = circle(edge, normal) else {
        return Some(Kind::Free);
    };
    let angle = |ends: &[DVec3]| {
        let [from, to] = [ends[0] - circle.centre, ends[1] - circle.centre];
        from.cross(to).dot(normal).atan2(from.dot(to))
    };
    Some(Kind::Arc {
        centre: circle.centre,
        radius: circle.radius,
        turn: edge.windows(2).map(angle).sum(),
    })
}

/// Two sides as one, if the second one goes on along the line or the circle of the first.
fn joined(before: &Side, after: &Side, normal: DVec3) -> Option<Side> {
    let points = || -> Edge { before.points.iter().chain(&after.points[1..]).copied().collect() };
    let goes_on = before.points.last()?.distance(*after.points.first()?) <= GAP_MM;
    match (before.kind, after.kind) {
        (Kind::Line, Kind::Line) if goes_on => {
            let points = points();
            let kind = kind(&points, normal)?;
            matches!(kind, Kind::Line).then_some(Side { points, kind })
        }
        (
            Kind::Arc { centre, radius, turn },
            Kind::Arc {
                centre: centre_after,
                radius: radius_after,
                turn: turn_after,
            },
        ) if goes_on => {
            let is_one = centre.distance(centre_after) <= GAP_MM
                && (radius - radius_after).abs() <= GAP_MM
                && turn.signum() == turn_after.signum();
            is_one.then(|| Side {
                points: points(),
                kind: Kind::Arc {
                    centre,
                    radius,
                    turn: turn + turn_after,
                },
            })
        }
        _ => None,
    }
}

/// The curve of a side between two corners; `None` if it does not follow the edge.
fn curve(side: &Side, [start, end]: [DVec3; 2], plane: &Plane) -> Option<SplineCurve> {
    let line = || SplineCurve {
        axis: bezier(1),
        poles: [start, end].map(|p| p.extend(1.0).to_array()).to_vec(),
    };
    match side.kind {
        Kind::Line => Some(line()),
        Kind::Arc { turn, .. } if turn.abs() > TURN_MAX => None,
        Kind::Arc { turn, .. } => Some(arc([start, end], turn, plane.normal)),
        Kind::Free => cubic(&side.points, [start, end], plane),
    }
}

fn bezier(degree: usize) -> Axis {
    Axis {
        degree,
        knots: [vec![0.0; degree + 1], vec![1.0; degree + 1]].concat(),
    }
}

/// The arc between two points that turns by this angle about a normal.
fn arc([start, end]: [DVec3; 2], turn: f64, normal: DVec3) -> SplineCurve {
    let (middle, chord) = (0.5 * (start + end), end - start);
    let centre = middle + normal.cross(chord) * (0.5 / (0.5 * turn).tan());
    let x = start - centre;
    let circle = Curve::Ellipse {
        center: centre,
        x,
        y: normal.cross(x) * turn.signum(),
    };
    let mut spline = circle.spline([0.0, turn.abs()]);
    spline.axis.knots.iter_mut().for_each(|knot| *knot /= turn.abs());
    spline
}

/// The cubic B-spline through places of an edge, its parameter that of the edge, with as few spans as follow it.
fn cubic(points: &Edge, ends: [DVec3; 2], plane: &Plane) -> Option<SplineCurve> {
    let intervals = points.len().checked_sub(1).filter(|count| *count >= 4)?;
    let at = |t: f64| {
        let place = t.clamp(0.0, 1.0) * intervals as f64;
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "at most the number of points"
        )]
        let index = (place as usize).min(intervals - 1);
        plane.nearest(between(points, index, place - index as f64))
    };
    let mut spans = 1;
    while spans <= SPANS_MAX {
        let step = 1.0 / spans as f64;
        let mut places: Vec<DVec3> = (0..=spans).map(|k| at(k as f64 * step)).collect();
        (places[0], places[spans]) = (ends[0], ends[1]);
        let slope = |from: f64, to: f64| (at(to) - at(from)) / (to - from);
        let near = 0.01 / intervals as f64;
        // At an end the cubic goes on beyond it.
        let slopes = [
            2.0 * slope(0.0, near) - slope(0.0, 2.0 * near),
            2.0 * slope(1.0, 1.0 - near) - slope(1.0, 1.0 - 2.0 * near),
        ];
        let spline = clamped(&places, slopes, [0.0, 1.0]);
        let looks = 4 * intervals;
        let off = (0..=looks).map(|k| {
            let t = k as f64 / looks as f64;
            spline.at(t)[0].distance(at(t))
        });
        if off.fold(0.0, f64::max) <= FOLLOWS_MM {
            return Some(spline);
        }
        spans *= 2;
    }
    None
}

/// The C2 cubic B-spline through places at equal steps of a range, with these derivatives at its ends (P&T 9.2.3), as a curve with its knots once.
pub(super) fn clamped(places: &[DVec3], slopes: [DVec3; 2], [low, high]: [f64; 2]) -> SplineCurve {
    let spans = places.len() - 1;
    let step = (high - low) / spans as f64;
    // Slopes at all places: those of neighbours, four times the own one, are three times the difference quotient.
    let mut slope = vec![DVec3::ZERO; spans + 1];
    (slope[0], slope[spans]) = (slopes[0], slopes[1]);
    let mut share = vec![0.0; spans + 1];
    for k in 1..spans {
        let pivot = 4.0 - share[k - 1];
        share[k] = 1.0 / pivot;
        slope[k] = ((places[k + 1] - places[k - 1]) * (3.0 / step) - slope[k - 1]) / pivot;
    }
    for k in (1..spans).rev() {
        let after = slope[k + 1];
        slope[k] -= after * share[k];
    }
    // Of a C2 spline with single knots at equal steps the pole beside a place is the blossom of its two or three knots.
    let knot = |k: usize| if k == spans { high } else { low + step * k as f64 };
    let mut knots = vec![low; 4];
    knots.extend((1..spans).map(knot));
    knots.extend([high; 4]);
    let bend = |k: usize| {
        // Second derivative at place k, of the piece after it, or before the last.
        let (a, b) = if k < spans { (k, k + 1) } else { (k - 1, k) };
        let quotient = (places[b] - places[a]) / step;
        if k < spans {
            (6.0 * quotient - 4.0 * slope[a] - 2.0 * slope[b]) / step
        } else {
            (4.0 * slope[b] + 2.0 * slope[a] - 6.0 * quotient) / step
        }
    };
    let third = |k: usize| (bend(k + 1) - bend(k)) / step;
    // Pole with the knots t1, t2, t3 (de Boor): p + p' (s1) / 3 + p'' s2 / 6 + p''' s3 / 6 with the elementary symmetric functions of t - place.
    let pole = |index: usize| {
        let three = &knots[index + 1..index + 4];
        let k = index.saturating_sub(2).min(spans - 1);
        let d: Vec<f64> = three.iter().map(|t| t - knot(k)).collect();
        let first = d[0] + d[1] + d[2];
        let second = d[0] * d[1] + d[1] * d[2] + d[2] * d[0];
        let product = d[0] * d[1] * d[2];
        places[k] + slope[k] * (first / 3.0) + bend(k) * (second / 6.0) + third(k) * (product / 6.0)
    };
    SplineCurve {
        poles: (0..spans + 3)
            .map(|index| pole(index).extend(1.0).to_array())
            .collect(),
        axis: Axis { degree: 3, knots },
    }
}

/// Two curves on the same range with the same degree and knots.
pub(super) fn compatible([a, b]: [SplineCurve; 2]) -> [SplineCurve; 2] {
    let degree = a.axis.degree.max(b.axis.degree);
    let [mut a, mut b] = [a.raised(degree), b.raised(degree)];
    a.take_knots(&b.axis);
    b.take_knots(&a.axis);
    [a, b]
}
