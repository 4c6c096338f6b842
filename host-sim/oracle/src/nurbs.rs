//! Rational and polynomial B-spline surfaces by their basis functions (P&T A2.1, A2.3, A3.6, A4.4).

use super::derivatives::{Derivatives, Homogeneous, xyz};
use glam::DVec3;
use job::{Along, NurbsSpec};

/// Poles with influence at a point, in one direction: degree 3 plus one.
const ORDER: usize = 4;

/// Basis functions of one span: `[function][derivative]`, 0 beyond the degree.
type Basis = [[f64; 3]; ORDER];

/// A B-spline surface in the form used for evaluation.
#[derive(Clone, Debug)]
pub(super) struct Nurbs {
    directions: [Direction; 2],
    /// Homogeneous poles, v fastest.
    poles: Vec<Homogeneous>,
    rational: bool,
}

#[derive(Clone, Debug)]
struct Direction {
    degree: usize,
    knots: Vec<f64>,
    poles: usize,
}

impl Nurbs {
    pub(super) fn new(spec: &NurbsSpec) -> Self {
        let columns = spec.poles_mm.first().map_or(0, Vec::len);
        let homogeneous = |p: &[f64; 4]| [p[0] * p[3], p[1] * p[3], p[2] * p[3], p[3]];
        Self {
            directions: [
                Direction {
                    degree: spec.degree[0],
                    knots: spec.knots_u.clone(),
                    poles: spec.poles_mm.len(),
                },
                Direction {
                    degree: spec.degree[1],
                    knots: spec.knots_v.clone(),
                    poles: columns,
                },
            ],
            poles: spec.poles_mm.iter().flatten().map(homogeneous).collect(),
            rational: spec.rational,
        }
    }

    /// The ends of the domain and the distinct knots between them.
    pub(super) fn breaks(&self, along: Along) -> Vec<f64> {
        let direction = &self.directions[usize::from(along == Along::V)];
        let mut breaks = direction.knots[direction.degree..=direction.poles].to_vec();
        breaks.dedup();
        breaks
    }

    /// S and its derivatives.
    pub(super) fn at(&self, u: f64, v: f64) -> Derivatives {
        let (first_u, basis_u) = self.directions[0].basis(u);
        let (first_v, basis_v) = self.directions[1].basis(v);
        let [mut s, mut s_u, mut s_v, mut s_uu, mut s_uv, mut s_vv] = [[0.0; 4]; 6];
        for (row, in_u) in self.rows(first_u, first_v).zip(&basis_u) {
            let [mut row_0, mut row_v, mut row_vv] = [[0.0; 4]; 3];
            for (pole, in_v) in row.iter().zip(&basis_v) {
                accumulate(&mut row_0, in_v[0], pole);
                accumulate(&mut row_v, in_v[1], pole);
                accumulate(&mut row_vv, in_v[2], pole);
            }
            accumulate(&mut s, in_u[0], &row_0);
            accumulate(&mut s_u, in_u[1], &row_0);
            accumulate(&mut s_uu, in_u[2], &row_0);
            accumulate(&mut s_v, in_u[0], &row_v);
            accumulate(&mut s_uv, in_u[1], &row_v);
            accumulate(&mut s_vv, in_u[0], &row_vv);
        }
        if self.rational {
            return Derivatives::from_homogeneous([s, s_u, s_v, s_uu, s_uv, s_vv]);
        }
        Derivatives {
            point: xyz(&s),
            u: xyz(&s_u),
            v: xyz(&s_v),
            uu: xyz(&s_uu),
            uv: xyz(&s_uv),
            vv: xyz(&s_vv),
        }
    }

    /// First derivative along one parameter.
    pub(super) fn tangent(&self, u: f64, v: f64, along: Along) -> DVec3 {
        let (first_u, basis_u) = self.directions[0].basis(u);
        let (first_v, basis_v) = self.directions[1].basis(v);
        let (order_u, order_v) = if along == Along::U { (1, 0) } else { (0, 1) };
        let [mut s, mut derivative] = [[0.0; 4]; 2];
        for (row, in_u) in self.rows(first_u, first_v).zip(&basis_u) {
            let [mut value, mut derived] = [[0.0; 4]; 2];
            for (pole, in_v) in row.iter().zip(&basis_v) {
                accumulate(&mut value, in_v[0], pole);
                accumulate(&mut derived, in_v[order_v], pole);
            }
            accumulate(&mut s, in_u[0], &value);
            accumulate(&mut derivative, in_u[order_u], &derived);
        }
        if !self.rational {
            return xyz(&derivative);
        }
        (xyz(&derivative) - derivative[3] * xyz(&s) / s[3]) / s[3]
    }

    /// The poles with influence in a span, row by row.
    fn rows(&self, first_u: usize, first_v: usize) -> impl Iterator<Item = &[Homogeneous]> {
        let columns = self.directions[1].poles;
        let rows = self
            .poles
            .chunks_exact(columns)
            .skip(first_u)
            .take(self.directions[0].degree + 1);
        rows.map(move |row| &row[first_v..=first_v + self.directions[1].degree])
    }
}

impl Direction {
    /// Index of the first pole with influence at `t`, and the basis functions with two derivatives.
    fn basis(&self, t: f64) -> (usize, Basis) {
        let span = self.span(t);
        (
            span - self.degree,
            basis_derivatives(&self.knots, self.degree, span, t),
        )
    }

    /// The span with `knots[span] <= t < knots[span + 1]`; at the end of the domain the last span that is not empty (P&T A2.1).
    fn span(&self, t: f64) -> usize {
        let inside = &self.knots[self.degree..=self.poles];
        let end = inside[inside.len() - 1];
        let above = if t < end {
            inside.partition_point(|knot| *knot <= t)
        } else {
            inside.partition_point(|knot| *knot < end)
        };
        self.degree + above.max(1) - 1
    }
}

/// Basis functions and their derivatives up to the second (P&T A2.2, eqn 2.9); derivatives above the degree are 0.
fn basis_derivatives(knots: &[f64], degree: usize, span: usize, t: f64) -> Basis {
    // functions[d][r]: function r of degree d; supports[d][r]: length of the support of function r of degree d - 1.
    let mut functions = [[0.0; ORDER]; ORDER];
    let mut supports = [[1.0; ORDER]; ORDER];
    functions[0][0] = 1.0;
    let (mut left, mut right) = ([0.0; ORDER], [0.0; ORDER]);
    for d in 1..=degree {
        left[d] = t - knots[span + 1 - d];
        right[d] = knots[span + d] - t;
        let mut saved = 0.0;
        for r in 0..d {
            supports[d][r] = right[r + 1] + left[d - r];
            let term = functions[d - 1][r] / supports[d][r];
            functions[d][r] = saved + right[r + 1] * term;
            saved = left[d - r] * term;
        }
        functions[d][d] = saved;
    }
    let first = differentiated(&functions[degree - 1], &supports, degree);
    let second = match degree {
        1 => [0.0; ORDER],
        _ => differentiated(
            &differentiated(&functions[degree - 2], &supports, degree - 1),
            &supports,
            degree,
        ),
    };
    std::array::from_fn(|r| [functions[degree][r], first[r], second[r]])
}

/// Derivatives of the functions of `degree` from the functions (or their derivatives) of the next lower degree.
fn differentiated(lower: &[f64; ORDER], supports: &[[f64; ORDER]; ORDER], degree: usize) -> [f64; ORDER] {
    let mut derivatives = [0.0; ORDER];
    for r in 0..degree {
        let share = degree as f64 * lower[r] / supports[degree][r];
        derivatives[r] -= share;
        derivatives[r + 1] += share;
    }
    derivatives
}

fn accumulate(sum: &mut Homogeneous, factor: f64, term: &Homogeneous) {
    for (sum, term) in sum.iter_mut().zip(term) {
        *sum += factor * term;
    }
}
