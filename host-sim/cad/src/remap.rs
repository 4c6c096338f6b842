//! From the parameters of a face's surface to those of its exact form: an arc's angle becomes the parameter of its rational quadratics. The two
//! agree at the ends of the spans; u and v map apart.

use super::curve::{Curve, arcs};
use super::surface::{Periodic, Surface};
use super::trim::Polygon;

/// Halvings of a polygon's edge.
const HALVINGS: u32 = 12;
/// Bisections of a parameter.
const BISECTIONS: usize = 60;

/// How one parameter maps.
enum Map<'s> {
    /// The parameter stays.
    Same,
    /// An angle, over arcs with these knots.
    Angle(Vec<f64>),
    /// The parameter of a hyperbola, by its height along its second axis.
    Height(&'s Curve, [f64; 2]),
}

impl Map<'_> {
    fn at(&self, t: f64) -> f64 {
        match self {
            Self::Same => t,
            Self::Angle(knots) => {
                let span = knots.partition_point(|knot| *knot <= t).clamp(1, knots.len() - 1);
                let (low, high) = (knots[span - 1], knots[span]);
                // The tangent of half the angle from the middle is linear in the parameter of a quadratic with equal end weights.
                let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
                middle + half * (0.5 * (t - middle)).tan() / (0.5 * half).tan()
            }
            Self::Height(curve, range) => {
                let Curve::Hyperbola { center, y, .. } = curve else {
                    return t;
                };
                let height = |p: glam::DVec3| (p - *center).dot(*y);
                let (spline, wanted) = (curve.spline(*range), height(curve.at(t)[0]));
                let [mut low, mut high] = *range;
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (low + high);
                    if height(spline.at(middle)[0]) < wanted {
                        low = middle;
                    } else {
                        high = middle;
                    }
                }
                0.5 * (low + high)
            }
        }
    }
}

fn angle<'s>(range: [f64; 2]) -> Map<'s> {
    let mut knots = arcs(range).0.knots;
    knots.dedup();
    Map::Angle(knots)
}

fn of_curve(curve: &Curve, range: [f64; 2]) -> Map<'_> {
    match curve {
        Curve::Ellipse { .. } => angle(range),
        Curve::Hyperbola { .. } => Map::Height(curve, range),
        _ => Map::Same,
    }
}

/// The map of both parameters.
pub(super) struct Remap<'s>([Map<'s>; 2]);

impl<'s> Remap<'s> {
    /// For the exact form over a rectangle; a surface without one keeps its parameters.
    pub(super) fn new(surface: &'s Surface, [u, v]: [[f64; 2]; 2]) -> Self {
        Self(match surface {
            Surface::Cylinder { .. } | Surface::Cone { .. } => [angle(u), Map::Same],
            Surface::Sphere { .. } | Surface::Torus { .. } => [angle(u), angle(v)],
            Surface::Revolution { profile, .. } => [angle(u), of_curve(profile, v)],
            Surface::Extrusion { profile, .. } => [of_curve(profile, u), Map::Same],
            _ => [Map::Same, Map::Same],
        })
    }

    /// A place.
    pub(super) fn at(&self, place: [f64; 2]) -> [f64; 2] {
        [self.0[0].at(place[0]), self.0[1].at(place[1])]
    }

    /// A polygon; its edges stay within the tolerance, mm.
    pub(super) fn polygon(&self, on: &Periodic<'_>, polygon: &Polygon, tolerance_mm: f64) -> Polygon {
        if let [Map::Same, Map::Same] = self.0 {
            return polygon.clone();
        }
        let mut out = Vec::with_capacity(2 * polygon.len());
        for (index, place) in polygon.iter().enumerate() {
            let next = polygon[(index + 1) % polygon.len()];
            out.push(self.at(*place));
            self.edge(on, [*place, next], tolerance_mm, HALVINGS, &mut out);
        }
        out
    }

    fn edge(
        &self,
        on: &Periodic<'_>,
        [a, b]: [[f64; 2]; 2],
        tolerance_mm: f64,
        left: u32,
        out: &mut Polygon,
    ) {
        let middle: [f64; 2] = std::array::from_fn(|k| 0.5 * (a[k] + b[k]));
        let (ends, exact) = ([self.at(a), self.at(b)], self.at(middle));
        let at = on.at(middle[0], middle[1]);
        let mut off_mm = 0.0_f64;
        for (k, speed) in [at.u.length(), at.v.length()].into_iter().enumerate() {
            off_mm = off_mm.max((exact[k] - 0.5 * (ends[0][k] + ends[1][k])).abs() * speed);
        }
        // Across arcs of several spans the middles may agree by symmetry.
        let wide = (0..2).any(|k| (a[k] - b[k]).abs() > 0.5 && matches!(self.0[k], Map::Angle(_)));
        let bent = a[0] != b[0] && a[1] != b[1];
        if left > 0 && bent && (off_mm > tolerance_mm || wide) {
            self.edge(on, [a, middle], tolerance_mm, left - 1, out);
            out.push(exact);
            self.edge(on, [middle, b], tolerance_mm, left - 1, out);
        }
    }
}
