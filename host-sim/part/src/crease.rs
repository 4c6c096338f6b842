//! Creases: knots at which the tangent plane of a surface jumps, and with it the ball's centre. A pass over one is refused where the jump is faster than
//! an axis may be, and a step to the next pass that goes over one is too long or too short. So a region is cut there.

use glam::DVec3;
use job::Along;
use oracle::{Derivatives, Surface};

/// Largest jump of the ball's centre over which a pass may go, mm: twice of it over the third power of a period of 1 ms is all of the default
/// jerk limit of the z axis, half of that of x and y. Jumps of files that are smooth but for rounding are below 1 nm.
const JUMP_MAX_MM: f64 = 5e-6;
/// Where the surface is evaluated below a knot, as a share of the range.
const BELOW: f64 = 1e-9;
/// Places at which each span of a knot line is looked at.
const PLACES: usize = 4;
/// Most spans of a knot line that are looked at.
const SPANS_MAX: usize = 256;
/// Sine of the angle between the derivatives by u and v below which a place has no normal.
const SKEW_MIN: f64 = 1e-6;
/// A derivative, as a share of the longest along the knot line, below which it is rounding.
const LENGTH_MIN: f64 = 1e-6;

/// A range of a parameter and which of its ends are at a crease.
pub(crate) type Strip = ([f64; 2], [bool; 2]);

/// The ranges of a parameter within a rectangle between the creases that a ball of this radius meets.
pub(crate) fn strips(surface: &Surface, along: Along, rectangle: [[f64; 2]; 2], radius: f64) -> Vec<Strip> {
    let k = usize::from(along == Along::V);
    let [low, high] = rectangle[k];
    let below = |knot: f64| (knot - BELOW * (high - low)).min(knot.next_down());
    let knots = surface.breaks(along);
    let creases = knots
        .iter()
        .filter(|knot| **knot < high && below(**knot) > low)
        .filter(|knot| {
            jump(surface, along, [below(**knot), **knot], rectangle[1 - k]) * radius > JUMP_MAX_MM
        });
    let mut strips = Vec::new();
    let (mut from, mut is_cut) = (low, false);
    for knot in creases {
        strips.push(([from, below(*knot)], [is_cut, true]));
        // At the knot itself the surface is that above it.
        (from, is_cut) = (*knot, true);
    }
    strips.push(([from, high], [is_cut, false]));
    strips
}

/// The largest distance of the unit normals below and above a knot, along its line.
fn jump(surface: &Surface, along: Along, sides: [f64; 2], across: [f64; 2]) -> f64 {
    let other = match along {
        Along::U => Along::V,
        Along::V => Along::U,
    };
    let mut ends: Vec<f64> = surface.breaks(other);
    ends.retain(|knot| (across[0]..across[1]).contains(knot) && *knot > across[0]);
    let every = ends.len().div_ceil(SPANS_MAX).max(1);
    let ends: Vec<f64> = std::iter::once(across[0])
        .chain(ends.into_iter().step_by(every))
        .chain([across[1]])
        .collect();
    let places = ends.windows(2).flat_map(|span| {
        (0..=PLACES).map(|place| {
            // The last place is below the knot at the end.
            let share = (place as f64 / PLACES as f64).min(1.0 - BELOW);
            span[0] + (span[1] - span[0]) * share
        })
    });
    let frames: Vec<[Derivatives; 2]> = places
        .map(|place| {
            sides.map(|at| match along {
                Along::U => surface.at(at, place),
                Along::V => surface.at(place, at),
            })
        })
        .collect();
    let longest = frames.iter().flatten().fold([0.0_f64; 2], |[u, v], at| {
        [u.max(at.u.length()), v.max(at.v.length())]
    });
    frames
        .iter()
        .filter_map(|sides| {
            let [below, above] = sides.each_ref().map(|at| normal(at, longest));
            Some(below?.distance(above?))
        })
        .fold(0.0, f64::max)
}

/// The unit normal, where there is one: at a pole the derivative along the side that is a point is rounding.
fn normal(at: &Derivatives, longest: [f64; 2]) -> Option<DVec3> {
    let (cross, lengths) = (at.u.cross(at.v), [at.u.length(), at.v.length()]);
    let is_regular = (0..2).all(|k| lengths[k] > LENGTH_MIN * longest[k])
        && cross.length() > SKEW_MIN * lengths[0] * lengths[1];
    is_regular.then(|| cross.normalize())
}
