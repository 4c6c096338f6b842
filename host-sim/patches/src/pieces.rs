//! Exact bicubic pieces of a surface over any rectangle of its parameters.

use interp_core::encode::{Bicubic, substitute};

use job::{NurbsSpec, SurfaceSpec};

/// A piece: wx, wy, wz, w as cubics of parameters from -1/2 to 1/2, `[i][j]` of `u^i v^j`.
pub type Piece = [Bicubic; 4];

/// A surface that has bicubic pieces.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one a job")]
pub enum Source {
    /// Polynomial in power form, lowest first, `[i][j]` of `u^i v^j`.
    Powers {
        /// `[i][j]` multiplies `u^i v^j`, mm, of x, y and z.
        coefficients: [Bicubic; 3],
        /// Ranges of u and v, ascending.
        ranges: [[f64; 2]; 2],
    },
    /// B-spline.
    Spline(NurbsSpec),
}

impl Source {
    /// The source of any surface except a revolved one.
    pub fn new(surface: &SurfaceSpec) -> Self {
        match surface {
            SurfaceSpec::Ruled {
                rail0_mm,
                rail1_mm,
                u,
                v,
            } => {
                let mut coefficients = [[[0.0; 4]; 4]; 3];
                for (axis, (rail0, rail1)) in coefficients.iter_mut().zip(rail0_mm.iter().zip(rail1_mm)) {
                    for (power, row) in axis.iter_mut().enumerate() {
                        let (c0, c1) = (rail0[3 - power], rail1[3 - power]);
                        *row = [c0, c1 - c0, 0.0, 0.0];
                    }
                }
                Self::Powers {
                    coefficients,
                    ranges: [*u, *v],
                }
            }
            SurfaceSpec::Bicubic {
                coefficients_mm,
                u,
                v,
            } => {
                let ascending = |axis: &Bicubic| {
                    let mut rows = *axis;
                    rows.reverse();
                    rows.map(|mut row| {
                        row.reverse();
                        row
                    })
                };
                Self::Powers {
                    coefficients: coefficients_mm.each_ref().map(ascending),
                    ranges: [*u, *v],
                }
            }
            SurfaceSpec::Nurbs(nurbs) => Self::Spline(nurbs.clone()),
            SurfaceSpec::Revolved { .. } => unreachable!("a revolved surface is stored as its profile"),
        }
    }

    /// Whether the weights of the pieces differ.
    #[must_use]
    pub fn rational(&self) -> bool {
        matches!(self, Self::Spline(nurbs) if nurbs.rational)
    }

    /// Parameters at which pieces must end, in u and in v.
    pub fn breaks(&self) -> [Vec<f64>; 2] {
        match self {
            Self::Powers { ranges, .. } => ranges.map(Vec::from),
            Self::Spline(nurbs) => {
                let [u, v] = nurbs.domain();
                [distinct(&nurbs.knots_u, u), distinct(&nurbs.knots_v, v)]
            }
        }
    }

    /// The piece over a rectangle that contains no break in its interior.
    pub fn piece(&self, u: [f64; 2], v: [f64; 2]) -> Piece {
        match self {
            Self::Powers { coefficients, .. } => {
                let [x, y, z] = coefficients.each_ref().map(|axis| substitute(axis, u, v));
                let mut one = [[0.0; 4]; 4];
                one[0][0] = 1.0;
                [x, y, z, one]
            }
            Self::Spline(nurbs) => spline_piece(nurbs, u, v),
        }
    }
}

/// The distinct knots within a domain, its ends included.
fn distinct(knots: &[f64], [start, end]: [f64; 2]) -> Vec<f64> {
    let mut breaks = vec![start];
    for &knot in knots {
        if knot > *breaks.last().unwrap_or(&start) && knot < end {
            breaks.push(knot);
        }
    }
    breaks.push(end);
    breaks
}

/// Homogeneous pole: wx, wy, wz, w.
type Pole = [f64; 4];

fn blend(a: Pole, b: Pole, t: f64) -> Pole {
    std::array::from_fn(|k| (1.0 - t) * a[k] + t * b[k])
}

/// Poles that have influence on one piece, of degree 3 at most: as many as the degree plus 1, then zeros.
type Acting = [Pole; 4];

/// The knot span that contains a range.
fn span(knots: &[f64], [start, end]: [f64; 2]) -> usize {
    let middle = 0.5 * (start + end);
    knots.partition_point(|knot| *knot <= middle) - 1
}

/// The polar form (blossom) of a B-spline's piece on a knot span, at these arguments. With k arguments at the end of a range within the span and the
/// others at its start, the value is the k-th Bezier pole of that range.
fn blossom(knots: &[f64], poles: &Acting, degree: usize, span: usize, arguments: &[f64]) -> Pole {
    let mut d = *poles;
    for (r, &t) in (1..=degree).zip(arguments) {
        for j in (r..=degree).rev() {
            let (low, high) = (knots[span - degree + j], knots[span + 1 + j - r]);
            d[j] = blend(d[j - 1], d[j], (t - low) / (high - low));
        }
    }
    d[degree]
}

/// Bezier poles of degree 3 over a range within a knot span from B-spline poles of degree 1 to 3: exact, by degree elevation.
fn bezier(knots: &[f64], poles: &Acting, degree: usize, span: usize, [start, end]: [f64; 2]) -> [Pole; 4] {
    let pole = |k: usize| {
        let arguments: [f64; 3] = std::array::from_fn(|i| if i + k < degree { start } else { end });
        blossom(knots, poles, degree, span, &arguments)
    };
    match degree {
        1 => {
            let (a, b) = (pole(0), pole(1));
            [a, blend(a, b, 1.0 / 3.0), blend(a, b, 2.0 / 3.0), b]
        }
        2 => {
            let (a, b, c) = (pole(0), pole(1), pole(2));
            [a, blend(a, b, 2.0 / 3.0), blend(b, c, 1.0 / 3.0), c]
        }
        _ => [pole(0), pole(1), pole(2), pole(3)],
    }
}

/// Converts Bernstein coefficients over a span to power form in a parameter from -1/2 to 1/2.
fn centred_powers([b0, b1, b2, b3]: [f64; 4]) -> [f64; 4] {
    [
        (b0 + 3.0 * (b1 + b2) + b3) / 8.0,
        0.75 * (b3 - b0 + b2 - b1),
        1.5 * (b0 - b1 - b2 + b3),
        b3 - b0 + 3.0 * (b1 - b2),
    ]
}

fn spline_piece(nurbs: &NurbsSpec, u: [f64; 2], v: [f64; 2]) -> Piece {
    let [p, q] = nurbs.degree;
    let homogeneous = |&[x, y, z, w]: &[f64; 4]| [w * x, w * y, w * z, w];
    let (span_u, span_v) = (span(&nurbs.knots_u, u), span(&nurbs.knots_v, v));
    // Of the poles that have influence: along v for every row, then along u for each of the four columns.
    let mut rows = [[[0.0; 4]; 4]; 4];
    for (row, poles) in rows.iter_mut().zip(&nurbs.poles_mm[span_u - p..=span_u]) {
        let mut acting = [[0.0; 4]; 4];
        for (to, pole) in acting.iter_mut().zip(&poles[span_v - q..=span_v]) {
            *to = homogeneous(pole);
        }
        *row = bezier(&nurbs.knots_v, &acting, q, span_v, v);
    }
    let columns: [[Pole; 4]; 4] = std::array::from_fn(|j| {
        let acting = rows.each_ref().map(|row| row[j]);
        bezier(&nurbs.knots_u, &acting, p, span_u, u)
    });
    std::array::from_fn(|k| {
        // [i][j] Bernstein, i along u; then powers in v, then in u.
        let in_v: [[f64; 4]; 4] =
            std::array::from_fn(|i| centred_powers(std::array::from_fn(|j| columns[j][i][k])));
        let in_u: [[f64; 4]; 4] =
            std::array::from_fn(|j| centred_powers(std::array::from_fn(|i| in_v[i][j])));
        std::array::from_fn(|i| std::array::from_fn(|j| in_u[j][i]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use oracle::Surface;

    fn value(c: &Bicubic, u: f64, v: f64) -> f64 {
        let cubic = |[c0, c1, c2, c3]: [f64; 4], t: f64| c0 + t * (c1 + t * (c2 + t * c3));
        cubic(c.map(|row| cubic(row, v)), u)
    }

    /// Pieces of B-splines of every degree pair, unclamped and with repeated knots, against the oracle's de Boor evaluation.
    #[test]
    fn pieces_are_the_surface() {
        for p in 1..=3_usize {
            for q in 1..=3_usize {
                let knots = |degree: usize| -> Vec<f64> {
                    let inner = [0.0, 0.3, 0.35, 1.0, 2.5, 2.5, 4.0];
                    let inner = if degree == 1 {
                        [0.0, 0.3, 0.35, 1.0, 2.5, 2.6, 4.0]
                    } else {
                        inner
                    };
                    let before = (1..=degree).rev().map(|k| -0.2 * k as f64);
                    before
                        .chain(inner)
                        .chain((1..=degree).map(|k| 4.0 + 0.7 * k as f64))
                        .collect()
                };
                let (knots_u, knots_v) = (knots(p), knots(q));
                let (n, m) = (knots_u.len() - p - 1, knots_v.len() - q - 1);
                let pole = |i: usize, j: usize| {
                    let (x, y) = (i as f64 * 7.0, j as f64 * 5.0);
                    [
                        x + (y * 0.3).sin(),
                        y,
                        4.0 * (x * 0.2).cos() * (y * 0.4).sin(),
                        1.0 + 0.3 * (x + 2.0 * y).sin(),
                    ]
                };
                let poles_mm = (0..n).map(|i| (0..m).map(|j| pole(i, j)).collect()).collect();
                let nurbs = NurbsSpec {
                    degree: [p, q],
                    knots_u,
                    knots_v,
                    poles_mm,
                    rational: true,
                };
                let surface = Surface::new(&SurfaceSpec::Nurbs(nurbs.clone()));
                let source = Source::Spline(nurbs);
                let [us, vs] = source.breaks();
                for u in us.windows(2) {
                    for v in vs.windows(2) {
                        // A part of the span, as after a split.
                        let (u, v) = ([u[0], 0.5 * (u[0] + u[1])], [v[0], v[1]]);
                        let piece = source.piece(u, v);
                        for (s, t) in [(-0.5, -0.5), (-0.1, 0.3), (0.5, 0.499), (0.2, -0.4)] {
                            let at = |[a, b]: [f64; 2], s: f64| a + (b - a) * (s + 0.5);
                            let want = surface.at(at(u, s), at(v, t)).point.to_array();
                            let w = value(&piece[3], s, t);
                            for k in 0..3 {
                                let got = value(&piece[k], s, t) / w;
                                assert!(
                                    (got - want[k]).abs() < 1e-11,
                                    "degree {p} {q}: {got} for {}",
                                    want[k]
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}
