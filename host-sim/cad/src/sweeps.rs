//! Extrusions and revolutions. Those of a closed B-spline become B-spline surfaces, which have a seam: the boundary of a face may run across it, or around the sweep.

use std::f64::consts::TAU;

use super::curve::Curve;
use super::exact::exact;
use super::spline::SplineCurve;
use super::surface::Surface;
use super::{Boundary, Edge, Face};
use glam::DVec3;

/// Largest distance between the ends of a closed curve, as a share of its size, as between those of a closed surface.
const CLOSED: f64 = 1e-9;
/// By what share of its height an extrusion is made higher than the points of its boundary at each end: its edges may bulge between them.
const HIGHER: f64 = 0.1;
/// Places of a piece of a profile between which it crosses its axis once at most.
const CROSSING_PLACES: u32 = 32;
/// Bisections of a piece.
const CROSSING_STEPS: u32 = 60;
/// Distance from the axis that is none, as a share of the largest.
const ON_AXIS: f64 = 1e-9;

/// Gives the surface of a face a seam, if it is swept from a closed B-spline.
pub(super) fn with_seam(face: &mut Face) {
    if let Boundary::Loops(loops) = &face.boundary
        && let Some(surface) = as_spline(&face.surface, loops)
    {
        face.surface = surface;
    }
}

fn as_spline(surface: &Surface, loops: &[Vec<Edge>]) -> Option<Surface> {
    match surface {
        Surface::Extrusion {
            profile: Curve::Spline(profile),
            range,
            direction,
        } if is_closed(profile, range.unwrap_or(profile.axis.domain())) => {
            // The height of a point of the boundary, less that of the profile's point below it, which is between those of its poles.
            let of_points = loops
                .iter()
                .flatten()
                .flatten()
                .map(|point| point.dot(*direction));
            let of_poles = profile
                .poles
                .iter()
                .map(|[x, y, z, w]| (direction.x * x + direction.y * y + direction.z * z) / w);
            let [low, high] = bounds(of_points);
            let [least, most] = bounds(of_poles);
            let square = direction.length_squared();
            let [low, high] = [(low - most) / square, (high - least) / square];
            let more = HIGHER * (high - low);
            exact(surface, [profile.axis.domain(), [low - more, high + more]]).map(Surface::Spline)
        }
        Surface::Revolution {
            profile: Curve::Spline(profile),
            range,
            ..
        } if is_closed(profile, *range) => exact(surface, [[0.0, TAU], *range]).map(Surface::Spline),
        Surface::Offset { base, distance } => as_spline(base, loops).map(|base| Surface::Offset {
            base: Box::new(base),
            distance: *distance,
        }),
        _ => None,
    }
}

/// Whether a range is a whole closed curve.
fn is_closed(profile: &SplineCurve, range: [f64; 2]) -> bool {
    let [start, middle, end] = [range[0], 0.5 * (range[0] + range[1]), range[1]].map(|t| profile.at(t)[0]);
    let size = start.distance(middle).max(1.0);
    range == profile.axis.domain() && start.distance(end) <= CLOSED * size
}

/// Parameters at which a profile crosses the axis that it is turned around, ascending.
pub(super) fn axis_crossings(profile: &Curve, range: [f64; 2], origin: DVec3, axis: DVec3) -> Vec<f64> {
    let radial = |t: f64| (profile.at(t)[0] - origin).reject_from(axis);
    let mut pieces = vec![range[0]];
    if let Curve::Spline(spline) = profile {
        let breaks = spline.axis.breaks().into_iter();
        pieces.extend(breaks.filter(|knot| *knot > range[0] && *knot < range[1]));
    }
    pieces.push(range[1]);
    let places: Vec<f64> = pieces
        .windows(2)
        .flat_map(|piece| {
            let [start, end] = [piece[0], piece[1]];
            (0..CROSSING_PLACES)
                .map(move |k| start + (end - start) * f64::from(k) / f64::from(CROSSING_PLACES))
        })
        .chain([range[1]])
        .collect();
    let farthest = places
        .iter()
        .map(|t| radial(*t))
        .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    let Some(out) = farthest.map(DVec3::normalize_or_zero) else {
        return Vec::new();
    };
    let most = farthest.map_or(0.0, DVec3::length);
    let is_out = |t: f64| radial(t).dot(out) > 0.0;
    let crosses = |pair: &&[f64]| is_out(pair[0]) != is_out(pair[1]);
    let crossing = |pair: &[f64]| {
        let [mut low, mut high] = [pair[0], pair[1]];
        let begins_out = is_out(low);
        for _ in 0..CROSSING_STEPS {
            let middle = 0.5 * (low + high);
            if is_out(middle) == begins_out {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    };
    let crossings = places.windows(2).filter(crosses).map(crossing);
    // A profile that is not in a plane with the axis goes past it.
    crossings
        .filter(|t| radial(*t).length() <= ON_AXIS * most)
        .collect()
}

fn bounds(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}
