//! One segment of a composite cubic spline: the CL path between two points with its tangents there, and a cubic for the speed
//! along it; and the fit of both.

use super::nodes::Node;
use glam::DVec3;

/// Largest number of interior points of a segment in a fit.
const PLACES_MAX: usize = 40;
/// Iterations of least squares with reparametrisation to the nearest points of the curve.
const ROUNDS: usize = 12;
/// Iterations of Lawson's weights, which converge from least squares to minimax.
const LAWSON: usize = 16;

/// A cubic in Hermite form, t from 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cubic {
    /// Ends, mm.
    pub points_mm: [DVec3; 2],
    /// Derivatives at the ends, mm.
    pub derivatives_mm: [DVec3; 2],
    /// Speed of the centre, mm/s: coefficients of 1, t, t², t³.
    pub speed_mm_s: [f64; 4],
    /// Path parameters of the contact at the ends.
    pub path: [f64; 2],
}

impl Cubic {
    /// Coefficients of 1, t, t², t³.
    #[must_use]
    pub fn coefficients(&self) -> [DVec3; 4] {
        let [p, q] = self.points_mm;
        let [a, b] = self.derivatives_mm;
        let apart = q - p;
        let square = apart * 3.0 - (a * 2.0 + b);
        let cube = a + b - apart * 2.0;
        [p, a, square, cube]
    }

    /// The centre at t, mm.
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        let [c0, c1, c2, c3] = self.coefficients();
        c0 + (c1 + (c2 + c3 * t) * t) * t
    }

    /// Its derivative by t, mm.
    #[must_use]
    pub fn derivative(&self, t: f64) -> DVec3 {
        let [_, c1, c2, c3] = self.coefficients();
        c1 + (c2 * 2.0 + c3 * (3.0 * t)) * t
    }

    /// Commanded speed of the centre at t, mm/s.
    #[must_use]
    pub fn speed(&self, t: f64) -> f64 {
        let [v0, v1, v2, v3] = self.speed_mm_s;
        ((v3 * t + v2) * t + v1) * t + v0
    }
}

/// Errors of a fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    /// Of the path, mm.
    pub(super) path_mm: f64,
    /// Of the speed, mm/s.
    pub(super) speed_mm_s: f64,
}

/// Fits a cubic to consecutive points of a pass with the contact at the feed. `None` if the path reverses.
pub(super) fn fit(nodes: &[Node], feed_mm_s: f64) -> Option<(Cubic, Errors)> {
    let (first, last) = (nodes.first()?, nodes.last()?);
    let span = last.cl_length_mm - first.cl_length_mm;
    if nodes.len() < 2 || span <= 0.0 {
        return None;
    }
    let every = (nodes.len() - 2).div_ceil(PLACES_MAX).max(1);
    let inner: Vec<&Node> = nodes[1..nodes.len() - 1].iter().step_by(every).collect();
    let mut at: Vec<f64> = inner
        .iter()
        .map(|node| (node.cl_length_mm - first.cl_length_mm) / span)
        .collect();
    let mut cubic = Cubic {
        points_mm: [first.cl_mm(), last.cl_mm()],
        derivatives_mm: [first.tangent * span, last.tangent * span],
        speed_mm_s: [0.0; 4],
        path: [first.at.path, last.at.path],
    };
    for _ in 0..ROUNDS {
        let [a, b] = magnitudes(&cubic, [first.tangent, last.tangent], &inner, &at).unwrap_or([span; 2]);
        if a <= 0.0 || b <= 0.0 {
            return None;
        }
        cubic.derivatives_mm = [first.tangent * a, last.tangent * b];
        for (node, t) in inner.iter().zip(&mut at) {
            let velocity = cubic.derivative(*t);
            let squared = velocity.length_squared();
            if squared > 0.0 {
                *t = (*t + (node.cl_mm() - cubic.at(*t)).dot(velocity) / squared).clamp(0.0, 1.0);
            }
        }
    }
    let path_mm = inner
        .iter()
        .zip(&at)
        .map(|(node, t)| node.cl_mm().distance(cubic.at(*t)))
        .fold(0.0, f64::max);
    let speed = |node: &Node| feed_mm_s * node.at.ratio();
    let wanted: Vec<f64> = inner.iter().map(|node| speed(node)).collect();
    let (speed_mm_s, off) = fit_speed([speed(first), speed(last)], &at, &wanted);
    cubic.speed_mm_s = speed_mm_s;
    let errors = Errors {
        path_mm,
        speed_mm_s: off,
    };
    Some((cubic, errors))
}

/// Lengths of the end derivatives by least squares, at the current parameters of the points.
fn magnitudes(cubic: &Cubic, tangents: [DVec3; 2], inner: &[&Node], at: &[f64]) -> Option<[f64; 2]> {
    let [p, q] = cubic.points_mm;
    let (mut matrix, mut right) = ([0.0; 3], [0.0; 2]);
    for (node, t) in inner.iter().zip(at) {
        let s = 1.0 - t;
        let [begin, end] = [t * s * s, -t * t * s];
        let to_end = t * t * (3.0 - 2.0 * t);
        let rest = node.cl_mm() - (p * (1.0 - to_end) + q * to_end);
        let [a, b] = [tangents[0] * begin, tangents[1] * end];
        matrix = [
            matrix[0] + a.length_squared(),
            matrix[1] + a.dot(b),
            matrix[2] + b.length_squared(),
        ];
        right = [right[0] + a.dot(rest), right[1] + b.dot(rest)];
    }
    solve(matrix, right)
}

/// Solution of a symmetric system of two: `[m00, m01, m11]`.
fn solve([m00, m01, m11]: [f64; 3], [r0, r1]: [f64; 2]) -> Option<[f64; 2]> {
    let determinant = m00 * m11 - m01 * m01;
    (determinant > 1e-12 * m00 * m11).then(|| {
        [
            (r0 * m11 - r1 * m01) / determinant,
            (r1 * m00 - r0 * m01) / determinant,
        ]
    })
}

/// A cubic through the speeds at the ends, so that the speed is continuous, with minimal largest error between; and that error.
fn fit_speed([begin, end]: [f64; 2], at: &[f64], wanted: &[f64]) -> ([f64; 4], f64) {
    let line = |t: f64| begin + (end - begin) * t;
    let mut weights = vec![1.0; at.len()];
    let mut best = ([begin, end - begin, 0.0, 0.0], f64::INFINITY);
    for _ in 0..LAWSON {
        let (mut matrix, mut right) = ([0.0; 3], [0.0; 2]);
        for ((t, wanted), weight) in at.iter().zip(wanted).zip(&weights) {
            let bump = t * (1.0 - t);
            let (c, d, rest) = (bump, bump * t, wanted - line(*t));
            matrix = [
                matrix[0] + weight * c * c,
                matrix[1] + weight * c * d,
                matrix[2] + weight * d * d,
            ];
            right = [right[0] + weight * c * rest, right[1] + weight * d * rest];
        }
        let [c, d] = solve(matrix, right).unwrap_or_default();
        // (1 - t) t (c + d t), expanded.
        let speed = [begin, end - begin + c, d - c, -d];
        let off =
            |t: f64, wanted: f64| (((speed[3] * t + speed[2]) * t + speed[1]) * t + speed[0] - wanted).abs();
        let errors: Vec<f64> = at.iter().zip(wanted).map(|(t, w)| off(*t, *w)).collect();
        let most = errors.iter().copied().fold(0.0, f64::max);
        if most < best.1 {
            best = (speed, most);
        }
        let sum: f64 = weights.iter().zip(&errors).map(|(w, e)| w * e).sum();
        if sum <= 0.0 {
            break;
        }
        for (weight, error) in weights.iter_mut().zip(&errors) {
            *weight *= error / sum;
        }
    }
    if best.1.is_finite() { best } else { (best.0, 0.0) }
}
