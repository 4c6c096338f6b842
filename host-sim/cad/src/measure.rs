//! Measures of a surface: bounding box, least concave radius on either side, mean normal.

use glam::DVec3;
use job::Along;
use job::SurfaceSpec;
use oracle::{Derivatives, Surface};

/// Points per side of each patch at which a surface is evaluated.
const PLACES: usize = 8;
/// Largest number of points per side of the whole surface.
const PLACES_MAX: usize = 240;
/// Refinements around the point of largest curvature, each on a grid a third as wide.
const ROUNDS: usize = 12;
/// `|S_u x S_v|` below this share of `|S_u| |S_v|`: degenerate, no curvature.
const SINE_MIN: f64 = 1e-6;
/// A derivative below this share of the other one, each times its range: too near a degenerate point, where rounding grows as
/// its inverse.
const POLE_SHARE: f64 = 1e-3;
/// Curvature below which a side counts as not concave, 1/mm: a radius of 1 km.
const FLAT: f64 = 1e-6;

/// Measures of a surface. The plus side is the one to which `S_u x S_v` points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Corners of the bounding box, mm.
    pub corners_mm: [[f64; 3]; 2],
    /// Least concave radius on the plus and on the minus side, mm; `None` on a side that is not concave.
    pub concave_mm: [Option<f64>; 2],
    /// Mean normal: integral of `S_u x S_v` over the area; length 1 for a plane.
    pub facing: [f64; 3],
    /// Area, mm².
    pub area_mm2: f64,
}

impl Measures {
    /// Centre of the bounding box, mm.
    #[must_use]
    pub fn centre_mm(&self) -> [f64; 3] {
        std::array::from_fn(|k| 0.5 * (self.corners_mm[0][k] + self.corners_mm[1][k]))
    }

    /// Extent in x, y and z, mm.
    #[must_use]
    pub fn size_mm(&self) -> [f64; 3] {
        std::array::from_fn(|k| self.corners_mm[1][k] - self.corners_mm[0][k])
    }
}

/// Principal curvatures on the plus side, least and largest, 1/mm; `ranges` are the lengths of the parameters' ranges.
fn principal(at: &Derivatives, ranges: [f64; 2]) -> Option<[f64; 2]> {
    let normal = at.u.cross(at.v);
    let area = normal.length();
    let reach = [at.u.length() * ranges[0], at.v.length() * ranges[1]];
    if reach[0].min(reach[1]) <= POLE_SHARE * reach[0].max(reach[1]) {
        return None;
    }
    if area.is_nan() || area <= SINE_MIN * at.u.length() * at.v.length() {
        return None;
    }
    Some(at.principal_curvatures(normal / area))
}

/// Measures a surface on a dense grid.
#[must_use]
pub fn measure(spec: &SurfaceSpec) -> Measures {
    let surface = Surface::new(spec);
    let places = |along: Along| -> Vec<f64> {
        let breaks = surface.breaks(along);
        let spans = breaks.len() - 1;
        let each = (PLACES_MAX / spans).clamp(1, PLACES);
        let mut places: Vec<f64> = breaks
            .windows(2)
            .flat_map(|span| (0..each).map(move |i| span[0] + (span[1] - span[0]) * i as f64 / each as f64))
            .collect();
        places.push(breaks[spans]);
        places
    };
    let (us, vs) = (places(Along::U), places(Along::V));
    let ranges = surface.domain().map(|range| range[1] - range[0]);
    let mut corners_mm = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let mut tightest = [(0.0, [us[0], vs[0]]); 2];
    let (mut facing, mut whole) = (DVec3::ZERO, 0.0);
    let (weights_u, weights_v) = (weights(&us), weights(&vs));
    for (&u, weight_u) in us.iter().zip(&weights_u) {
        for (&v, weight_v) in vs.iter().zip(&weights_v) {
            let at = surface.at(u, v);
            let [least, most] = corners_mm;
            corners_mm = [least.min(at.point), most.max(at.point)];
            let area = at.u.cross(at.v) * (weight_u * weight_v);
            facing += area;
            whole += area.length();
            if let Some([least, most]) = principal(&at, ranges) {
                for (side, curvature) in [(0, most), (1, -least)] {
                    if curvature > tightest[side].0 {
                        tightest[side] = (curvature, [u, v]);
                    }
                }
            }
        }
    }
    let widths = [width(&us), width(&vs)];
    let concave_mm = [0, 1].map(|side| {
        let curvature = sharpened(&surface, side, tightest[side], widths);
        (curvature > FLAT).then(|| 1.0 / curvature)
    });
    Measures {
        corners_mm: corners_mm.map(|corner| corner.to_array()),
        concave_mm,
        area_mm2: whole,
        facing: (if whole > 0.0 { facing / whole } else { facing }).to_array(),
    }
}

/// Weights of the points in an integral: Simpson's rule, for points of which each two intervals are as wide as each other; else the trapezoid rule.
fn weights(places: &[f64]) -> Vec<f64> {
    let mut weights = vec![0.0; places.len()];
    let mut at = 0;
    while at + 1 < places.len() {
        let first = places[at + 1] - places[at];
        let second = places.get(at + 2).map(|next| next - places[at + 1]);
        if second.is_some_and(|second| (second - first).abs() <= 1e-9 * first) {
            for (offset, share) in [1.0, 4.0, 1.0].into_iter().enumerate() {
                weights[at + offset] += share * first / 3.0;
            }
            at += 2;
        } else {
            weights[at] += 0.5 * first;
            weights[at + 1] += 0.5 * first;
            at += 1;
        }
    }
    weights
}

/// Largest distance between adjacent points.
fn width(places: &[f64]) -> f64 {
    places
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .fold(0.0, f64::max)
}

/// The largest curvature near the point found on the coarse grid.
fn sharpened(surface: &Surface, side: usize, found: (f64, [f64; 2]), mut widths: [f64; 2]) -> f64 {
    let (mut best, mut place) = found;
    let domain = surface.domain();
    let ranges = domain.map(|range| range[1] - range[0]);
    for _ in 0..ROUNDS {
        let center = place;
        for i in -3..=3_i32 {
            for j in -3..=3_i32 {
                let at: [f64; 2] = std::array::from_fn(|k| {
                    let step = f64::from(if k == 0 { i } else { j }) / 3.0;
                    (center[k] + step * widths[k]).clamp(domain[k][0], domain[k][1])
                });
                if let Some([least, most]) = principal(&surface.at(at[0], at[1]), ranges) {
                    let curvature = if side == 0 { most } else { -least };
                    if curvature > best {
                        (best, place) = (curvature, at);
                    }
                }
            }
        }
        widths = widths.map(|width| width / 3.0);
    }
    best
}
