//! Parameters between the four edges of a face, so that passes follow them and end on them, and nothing is clipped. The surface stays the face's own, exactly; its edges are followed
//! within the tolerance of an edge on an iso-parametric line.
//!
//! ```text
//! plane, or a B-spline in one          sides.rs: four sides, each a line, an arc or a cubic ──► Coons patch (a straight quad: bilinear)
//! cylinder, cone, extrusion, ruled     graphs.rs: two edges across the rulings, between two rulings or all around ──► ruled between them
//! ```
//!
//! On other surfaces such parameters have a degree above 3, or do not exist as polynomials.

mod graphs;
mod plane;
mod sides;

use super::outline::outline;
use super::spline::SplineSurface;
use super::surface::Surface;
use super::{Boundary, Face, Outline};

/// Distance of a curve from the edge that it follows, mm: less than half of an edge's on an iso-parametric line.
const FOLLOWS_MM: f64 = 4e-4;
/// Least sine of the angle between the derivatives: closer together, the normal loses digits and steps of passes shrink.
const SINE_MIN: f64 = 0.25;
/// Least derivative, as a share of the longest one: a side with a smaller derivative is nearly a point.
const SLOWEST: f64 = 0.02;
/// Places along each parameter of a patch at which the derivatives are checked.
const LOOKS: u32 = 6;

/// The face with parameters between its four edges, and its outline with those, which is the whole rectangle; `None` where it has none.
pub(super) fn along_edges(face: &Face, now: &Outline) -> Option<(Face, Outline)> {
    let Boundary::Loops(loops) = &face.boundary else {
        return None;
    };
    if now.trimmed.is_none() || now.unknown {
        return None;
    }
    let surface = plane::of(&face.surface)
        .and_then(|plane| plane.between(loops))
        .or_else(|| graphs::between(face, loops, now))?;
    let face = Face {
        surface: Surface::Spline(surface),
        ..face.clone()
    };
    let outline = outline(&face).ok()?;
    outline.trimmed.is_none().then_some((face, outline))
}

/// Whether the parameters are far from being degenerate everywhere.
fn is_regular(surface: &SplineSurface) -> bool {
    let [us, vs] = surface.axes.each_ref().map(|axis| axis.breaks());
    let places = |breaks: &[f64]| -> Vec<f64> {
        let of_span = |ends: &[f64]| {
            let [low, high] = [ends[0], ends[1]];
            (0..=LOOKS)
                .map(move |k| low + (high - low) * f64::from(k) / f64::from(LOOKS))
                .collect::<Vec<_>>()
        };
        breaks.windows(2).flat_map(of_span).collect()
    };
    let (us, vs) = (places(&us), places(&vs));
    let (mut least, mut most, mut sine) = ([f64::INFINITY; 2], [0.0_f64; 2], f64::INFINITY);
    // The normal turns by less than a right angle from place to place: folded over, it turns back.
    let normal = |u: f64, v: f64| {
        let at = surface.at(u, v);
        at.u.cross(at.v)
    };
    let mut beside = normal(us[0], vs[0]);
    for u in &us {
        beside = if beside.dot(normal(*u, vs[0])) > 0.0 {
            normal(*u, vs[0])
        } else {
            return false;
        };
        for v in &vs {
            let at = surface.at(*u, *v);
            let lengths = [at.u.length(), at.v.length()];
            for k in 0..2 {
                least[k] = least[k].min(lengths[k]);
                most[k] = most[k].max(lengths[k]);
            }
            let cross = at.u.cross(at.v);
            let share = cross.length() / (lengths[0] * lengths[1]);
            sine = sine.min(if cross.dot(beside) > 0.0 { share } else { -share });
        }
    }
    sine >= SINE_MIN && (0..2).all(|k| least[k] >= SLOWEST * most[k])
}

#[cfg(test)]
mod tests;
