//! Curves of CAD files, and their exact conversion to rational B-splines.

use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

use super::placement::Placement;
use super::spline::{Axis, Pole, SplineCurve};
use oracle::vector::{Vector, add, dot, length, scale, subtract};

/// Seeds per piece of a curve in the search of a nearest point.
const SEEDS: usize = 12;
/// Newton iterations from the best seed.
const STEPS: usize = 30;
/// Tolerance of an arc's angle above a multiple of 90 degrees, rad, for rounding in files: it adds no further arc.
const ANGLE_SLACK_RAD: f64 = 1e-9;

/// Squared distance of a curve's point (given with its derivatives), and half its first two derivatives.
type Gap<'g> = dyn Fn(&[Vector; 3]) -> (f64, f64, f64) + 'g;

/// A curve, its parameter as in STEP (ISO 10303-42). Lengths in mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Curve {
    /// `origin + t direction`.
    Line {
        /// Point at 0.
        origin: Vector,
        /// Derivative.
        direction: Vector,
    },
    /// `center + cos t x + sin t y`: a circle or an ellipse.
    Ellipse {
        /// Centre.
        center: Vector,
        /// Radius vector at 0.
        x: Vector,
        /// Radius vector at 90 degrees.
        y: Vector,
    },
    /// `vertex + t² x + t y`.
    Parabola {
        /// Vertex.
        vertex: Vector,
        /// Along its axis.
        x: Vector,
        /// Along its vertex' tangent.
        y: Vector,
    },
    /// `center + cosh t x + sinh t y`.
    Hyperbola {
        /// Centre.
        center: Vector,
        /// To its vertex.
        x: Vector,
        /// Along its vertex' tangent.
        y: Vector,
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
            Self::Spline(spline) => Self::Spline(SplineCurve {
                axis: spline.axis.clone(),
                poles: spline.poles.iter().map(|pole| by.pole(*pole)).collect(),
            }),
        }
    }

    /// Point, first and second derivative.
    #[must_use]
    pub fn at(&self, t: f64) -> [Vector; 3] {
        let conic = |c: Vector, x: Vector, y: Vector, a: [f64; 3], b: [f64; 3]| {
            let term = |k: usize| add(scale(x, a[k]), scale(y, b[k]));
            [add(c, term(0)), term(1), term(2)]
        };
        match self {
            Self::Line { origin, direction } => [add(*origin, scale(*direction, t)), *direction, [0.0; 3]],
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
        let lifted = |p: Vector, w: f64| [p[0] * w, p[1] * w, p[2] * w, w];
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
                let middle = add(*vertex, add(scale(*x, a * b), scale(*y, 0.5 * (a + b))));
                bezier(
                    2,
                    vec![lifted(point(a), 1.0), lifted(middle, 1.0), lifted(point(b), 1.0)],
                )
            }
            Self::Hyperbola { center, x, y } => {
                let [a, b] = range;
                let (middle, weight) = (0.5 * (a + b), (0.5 * (b - a)).cosh());
                let offset = add(scale(*x, middle.cosh()), scale(*y, middle.sinh()));
                let control = add(*center, scale(offset, 1.0 / weight));
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
                let pole = |[cos, sin, w]: &[f64; 3]| {
                    lifted(add(*center, add(scale(*x, cos / w), scale(*y, sin / w))), *w)
                };
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
        let mut best = (f64::INFINITY, range[0]);
        for piece in pieces.windows(2) {
            for k in 0..=SEEDS {
                let t = piece[0] + (piece[1] - piece[0]) * k as f64 / SEEDS as f64;
                let distance = gap(&self.at(t)).0;
                if distance < best.0 {
                    best = (distance, t);
                }
            }
        }
        let mut t = best.1;
        for _ in 0..STEPS {
            let (_, slope, curvature) = gap(&self.at(t));
            let next = (t - slope / curvature).clamp(range[0], range[1]);
            if !next.is_finite() || (next - t).abs() <= 1e-15 * (range[1] - range[0]) {
                break;
            }
            t = next;
        }
        if gap(&self.at(t)).0 <= best.0 { t } else { best.1 }
    }

    /// Parameter within `range` of the point whose distance to `to` is least, both mapped by `map` (linear).
    pub(super) fn nearest(&self, range: [f64; 2], to: Vector, map: &dyn Fn(Vector) -> Vector) -> f64 {
        let pieces = match self {
            Self::Spline(spline) => spline.axis.breaks(),
            _ => range.to_vec(),
        };
        let to = map(to);
        self.least(range, &pieces, &|[point, first, _]| {
            let gap = subtract(map(*point), to);
            let first = map(*first);
            (dot(gap, gap), dot(gap, first), dot(first, first))
        })
    }

    /// Parameter within `range` at which the distance from an axis and the height along it are nearest to those of `to`.
    pub(super) fn nearest_meridian(&self, range: [f64; 2], to: Vector, origin: Vector, axis: Vector) -> f64 {
        let pieces = match self {
            Self::Spline(spline) => spline.axis.breaks(),
            _ => range.to_vec(),
        };
        let meridian = |p: Vector| {
            let from = subtract(p, origin);
            let height = dot(from, axis);
            (length(subtract(from, scale(axis, height))), height)
        };
        let (radius, height) = meridian(to);
        self.least(range, &pieces, &|[point, first, _]| {
            let (r, z) = meridian(*point);
            let out = subtract(subtract(*point, origin), scale(axis, z));
            let (dr, dz) = (
                if r > 0.0 { dot(out, *first) / r } else { 0.0 },
                dot(*first, axis),
            );
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
