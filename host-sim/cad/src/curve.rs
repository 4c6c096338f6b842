//! Curves of CAD files, and their exact conversion to rational B-splines.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

use super::placement::Placement;
use super::spline::{Axis, Pole, SplineCurve};

/// Seeds per piece of a curve in the search of a nearest point.
const SEEDS: usize = 12;
/// Newton iterations from the best seed.
const STEPS: usize = 30;
/// Largest number of local minima that are tried.
const TRIED: usize = 4;
/// Squared distance of a point that is on the curve, mm2: no other minimum is tried.
const ON_CURVE_MM2: f64 = 1e-8;
/// Tolerance of an arc's angle above a multiple of 90 degrees, rad, for rounding in files: it adds no further arc.
const ANGLE_SLACK_RAD: f64 = 1e-9;

/// Squared distance of a curve's point (given with its derivatives), and half its first two derivatives.
type Gap<'g> = dyn Fn(&[DVec3; 3]) -> (f64, f64, f64) + 'g;

/// A curve, its parameter as in STEP (ISO 10303-42). Lengths in mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Curve {
    /// `origin + t direction`.
    Line {
        /// Point at 0.
        origin: DVec3,
        /// Derivative.
        direction: DVec3,
    },
    /// `center + cos t x + sin t y`: a circle or an ellipse.
    Ellipse {
        /// Centre.
        center: DVec3,
        /// Radius vector at 0.
        x: DVec3,
        /// Radius vector at 90 degrees.
        y: DVec3,
    },
    /// `vertex + t² x + t y`.
    Parabola {
        /// Vertex.
        vertex: DVec3,
        /// Along its axis.
        x: DVec3,
        /// Along its vertex' tangent.
        y: DVec3,
    },
    /// `center + cosh t x + sinh t y`.
    Hyperbola {
        /// Centre.
        center: DVec3,
        /// To its vertex.
        x: DVec3,
        /// Along its vertex' tangent.
        y: DVec3,
    },
    /// A B-spline.
    Spline(SplineCurve),
}

impl Curve {
    /// The curve, transformed by a placement.
    #[must_use]
    pub fn placed(&self, by: &Placement) -> Self {
        match self {
            Self::Line { origin, direction } => Self::Line {
                origin: by.point(*origin),
                direction: by.vector(*direction),
            },
            Self::Ellipse { center, x, y } => Self::Ellipse {
                center: by.point(*center),
                x: by.vector(*x),
                y: by.vector(*y),
            },
            Self::Parabola { vertex, x, y } => Self::Parabola {
                vertex: by.point(*vertex),
                x: by.vector(*x),
                y: by.vector(*y),
            },
            Self::Hyperbola { center, x, y } => Self::Hyperbola {
                center: by.point(*center),
                x: by.vector(*x),
                y: by.vector(*y),
            },
            Self::Spline(spline) => Self::Spline(spline.placed(by)),
        }
    }

    /// Point, first and second derivative.
    #[must_use]
    pub fn at(&self, t: f64) -> [DVec3; 3] {
        let conic = |c: DVec3, x: DVec3, y: DVec3, a: [f64; 3], b: [f64; 3]| {
            let term = |k: usize| x * a[k] + y * b[k];
            [c + term(0), term(1), term(2)]
        };
        match self {
            Self::Line { origin, direction } => [*origin + *direction * t, *direction, DVec3::ZERO],
            Self::Ellipse { center, x, y } => {
                let (sin, cos) = t.sin_cos();
                conic(*center, *x, *y, [cos, -sin, -cos], [sin, cos, -sin])
            }
            Self::Parabola { vertex, x, y } => conic(*vertex, *x, *y, [t * t, 2.0 * t, 2.0], [t, 1.0, 0.0]),
            Self::Hyperbola { center, x, y } => {
                let (sinh, cosh) = (t.sinh(), t.cosh());
                conic(*center, *x, *y, [cosh, sinh, cosh], [sinh, cosh, sinh])
            }
            Self::Spline(spline) => spline.at(t),
        }
    }

    /// Range of the parameter; `None` if unbounded.
    #[must_use]
    pub fn domain(&self) -> Option<[f64; 2]> {
        match self {
            Self::Ellipse { .. } => Some([0.0, TAU]),
            Self::Spline(spline) => Some(spline.axis.domain()),
            _ => None,
        }
    }

    /// Period of the parameter of a closed curve.
    #[must_use]
    pub fn period(&self) -> Option<f64> {
        matches!(self, Self::Ellipse { .. }).then_some(TAU)
    }

    /// The part over a range as a B-spline on the same range. The point set is exact; the parametrisation is exact only at the
    /// ends of the spans.
    #[must_use]
    pub fn spline(&self, range: [f64; 2]) -> SplineCurve {
        let lifted = |p: DVec3, w: f64| (p * w).extend(w).to_array();
        let bezier = |degree: usize, poles: Vec<Pole>| SplineCurve {
            axis: Axis {
                degree,
                knots: [vec![range[0]; degree + 1], vec![range[1]; degree + 1]].concat(),
            },
            poles,
        };
        let point = |t: f64| self.at(t)[0];
        match self {
            Self::Line { .. } => bezier(1, range.map(|t| lifted(point(t), 1.0)).to_vec()),
            Self::Parabola { vertex, x, y } => {
                let [a, b] = range;
                let middle = *vertex + (*x * (a * b) + *y * (0.5 * (a + b)));
                bezier(
                    2,
                    vec![lifted(point(a), 1.0), lifted(middle, 1.0), lifted(point(b), 1.0)],
                )
            }
            Self::Hyperbola { center, x, y } => {
                let [a, b] = range;
                let (middle, weight) = (0.5 * (a + b), (0.5 * (b - a)).cosh());
                let offset = *x * middle.cosh() + *y * middle.sinh();
                let control = *center + offset * (1.0 / weight);
                bezier(
                    2,
                    vec![
                        lifted(point(a), 1.0),
                        lifted(control, weight),
                        lifted(point(b), 1.0),
                    ],
                )
            }
            Self::Ellipse { center, x, y } => {
                let (axis, arcs) = arcs(range);
                let pole = |[cos, sin, w]: &[f64; 3]| lifted(*center + (*x * (cos / w) + *y * (sin / w)), *w);
                SplineCurve {
                    axis,
                    poles: arcs.iter().map(pole).collect(),
                }
            }
            Self::Spline(spline) => spline.cut(range),
        }
    }

    /// Parameter of the point that minimises `gap`, a function of the curve's point and its derivatives that returns the squared
    /// distance and half its derivatives by the parameter.
    fn least(&self, range: [f64; 2], pieces: &[f64], gap: &Gap<'_>) -> f64 {
        let place = |piece: &[f64], k: usize| piece[0] + (piece[1] - piece[0]) * k as f64 / SEEDS as f64;
        let seeds: Vec<(f64, f64)> = pieces
            .windows(2)
            .flat_map(|piece| (0..=SEEDS).map(move |k| place(piece, k)))
            .map(|t| (gap(&self.at(t)).0, t))
            .collect();
        let distance = |index: usize| seeds.get(index).map_or(f64::INFINITY, |seed| seed.0);
        let mut lowest: Vec<usize> = (0..seeds.len())
            .filter(|k| seeds[*k].0 <= distance(k.wrapping_sub(1)) && seeds[*k].0 <= distance(k + 1))
            .collect();
        lowest.sort_by(|a, b| distance(*a).total_cmp(&distance(*b)));
        let mut best = (f64::INFINITY, range[0]);
        for index in lowest.into_iter().take(TRIED) {
            let mut found = self.newton(seeds[index], range, gap);
            // On either side of the seed, because a profile turned around an axis that it crosses is folded there.
            for beside in [index.saturating_sub(1), (index + 1).min(seeds.len() - 1)] {
                if found.0 > ON_CURVE_MM2 {
                    let start = self.golden([seeds[index].1, seeds[beside].1], gap);
                    let other = self.newton(start, range, gap);
                    found = if other.0 < found.0 { other } else { found };
                }
            }
            best = if found.0 < best.0 { found } else { best };
            if best.0 <= ON_CURVE_MM2 {
                break;
            }
        }
        best.1
    }

    /// Squared distance and parameter after Newton's method, or those of the start where it is nearer.
    fn newton(&self, start: (f64, f64), range: [f64; 2], gap: &Gap<'_>) -> (f64, f64) {
        let mut t = start.1;
        for _ in 0..STEPS {
            let (_, slope, curvature) = gap(&self.at(t));
            let next = (t - slope / curvature).clamp(range[0], range[1]);
            if !next.is_finite() || (next - t).abs() <= 1e-15 * (range[1] - range[0]) {
                break;
            }
            t = next;
        }
        let found = (gap(&self.at(t)).0, t);
        if found.0 <= start.0 { found } else { start }
    }

    /// Squared distance and parameter after a golden section between two parameters.
    fn golden(&self, [mut low, mut high]: [f64; 2], gap: &Gap<'_>) -> (f64, f64) {
        const SHARE: f64 = 0.618_033_988_749_894_8;
        let value = |t: f64| gap(&self.at(t)).0;
        for _ in 0..STEPS {
            let [left, right] = [high - SHARE * (high - low), low + SHARE * (high - low)];
            if value(left) < value(right) {
                high = right;
            } else {
                low = left;
            }
        }
        let middle = 0.5 * (low + high);
        (value(middle), middle)
    }

    /// Parameter within `range` of the point whose distance to `to` is least, both mapped by `map` (linear).
    pub(super) fn nearest(&self, range: [f64; 2], to: DVec3, map: &dyn Fn(DVec3) -> DVec3) -> f64 {
        let pieces = match self {
            Self::Spline(spline) => spline.axis.breaks(),
            _ => range.to_vec(),
        };
        let to = map(to);
        self.least(range, &pieces, &|[point, first, _]| {
            let gap = map(*point) - to;
            let first = map(*first);
            (gap.length_squared(), gap.dot(first), first.length_squared())
        })
    }

    /// Parameter within `range` at which the distance from an axis and the height along it are nearest to those of `to`.
    pub(super) fn nearest_meridian(&self, range: [f64; 2], to: DVec3, origin: DVec3, axis: DVec3) -> f64 {
        let pieces = match self {
            Self::Spline(spline) => spline.axis.breaks(),
            _ => range.to_vec(),
        };
        let meridian = |p: DVec3| {
            let from = p - origin;
            let height = from.dot(axis);
            ((from - axis * height).length(), height)
        };
        let (radius, height) = meridian(to);
        self.least(range, &pieces, &|[point, first, _]| {
            let (r, z) = meridian(*point);
            let out = *point - origin - axis * z;
            let (dr, dz) = (if r > 0.0 { out.dot(*first) / r } else { 0.0 }, first.dot(axis));
            let gap = [r - radius, z - height];
            (
                gap[0] * gap[0] + gap[1] * gap[1],
                gap[0] * dr + gap[1] * dz,
                dr * dr + dz * dz,
            )
        })
    }
}

/// Arcs of at most 90 degrees over a range of angles: the knots, and poles `[w cos, w sin, w]` of the unit circle.
#[must_use]
pub(super) fn arcs([start, end]: [f64; 2]) -> (Axis, Vec<[f64; 3]>) {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small whole number"
    )]
    let count = (((end - start) - ANGLE_SLACK_RAD) / FRAC_PI_2).ceil().max(1.0) as usize;
    let angle = |k: usize| {
        if k == count {
            end
        } else {
            start + (end - start) * k as f64 / count as f64
        }
    };
    let half = 0.5 * (end - start) / count as f64;
    let mut knots = vec![start; 3];
    let mut poles = vec![[start.cos(), start.sin(), 1.0]];
    for k in 0..count {
        let (low, high) = (angle(k), angle(k + 1));
        let middle = 0.5 * (low + high);
        // The intersection of the tangents, at 1 / cos(half) from the centre, with the weight cos(half).
        poles.push([middle.cos(), middle.sin(), half.cos()]);
        poles.push([high.cos(), high.sin(), 1.0]);
        knots.extend([high; 2]);
    }
    knots.push(end);
    (Axis { degree: 2, knots }, poles)
}
