//! S(u, v) and its derivatives, directly from the job's numbers.

use super::derivatives::Derivatives;
use super::nurbs::Nurbs;
use glam::DVec3;
use job::{Along, SurfaceSpec};

/// A surface, evaluated on its closed [`domain`](Surface::domain).
#[derive(Clone, Debug)]
pub struct Surface {
    shape: Shape,
    domain: [[f64; 2]; 2],
}

#[derive(Clone, Debug)]
enum Shape {
    Revolved { radius: [f64; 4], height: [f64; 4] },
    Ruled { rails: [[[f64; 4]; 3]; 2] },
    Bicubic { coefficients: [[[f64; 4]; 4]; 3] },
    Nurbs(Nurbs),
}

impl Surface {
    /// The surface that a job describes.
    #[must_use]
    pub fn new(spec: &SurfaceSpec) -> Self {
        let shape = match spec {
            SurfaceSpec::Revolved {
                radius_mm, height_mm, ..
            } => Shape::Revolved {
                radius: *radius_mm,
                height: *height_mm,
            },
            SurfaceSpec::Ruled {
                rail0_mm, rail1_mm, ..
            } => Shape::Ruled {
                rails: [*rail0_mm, *rail1_mm],
            },
            SurfaceSpec::Bicubic { coefficients_mm, .. } => Shape::Bicubic {
                coefficients: *coefficients_mm,
            },
            SurfaceSpec::Nurbs(nurbs) => Shape::Nurbs(Nurbs::new(nurbs)),
        };
        Self {
            shape,
            domain: spec.domain(),
        }
    }

    /// Ranges of u and v.
    #[must_use]
    pub fn domain(&self) -> [[f64; 2]; 2] {
        self.domain
    }

    /// Parameters between which the surface is smooth along u or v: the ends of the range and the knots between them,
    /// ascending.
    #[must_use]
    pub fn breaks(&self, along: Along) -> Vec<f64> {
        match &self.shape {
            Shape::Nurbs(nurbs) => nurbs.breaks(along),
            _ => self.range(along).to_vec(),
        }
    }

    /// Range of one parameter.
    pub(super) fn range(&self, along: Along) -> [f64; 2] {
        match along {
            Along::U => self.domain[0],
            Along::V => self.domain[1],
        }
    }

    /// S and its derivatives at (u, v). At a knot: those of the span above it (at the end of the range, below it).
    #[must_use]
    pub fn at(&self, u: f64, v: f64) -> Derivatives {
        match &self.shape {
            Shape::Revolved { radius, height } => revolved(radius, height, u, v),
            Shape::Ruled { rails } => ruled(rails, u, v),
            Shape::Bicubic { coefficients } => bicubic(coefficients, u, v),
            Shape::Nurbs(nurbs) => nurbs.at(u, v),
        }
    }

    /// First derivative along one parameter: as in [`Surface::at`], at lower cost.
    pub(super) fn tangent(&self, u: f64, v: f64, along: Along) -> DVec3 {
        if let Shape::Nurbs(nurbs) = &self.shape {
            return nurbs.tangent(u, v, along);
        }
        let at = self.at(u, v);
        match along {
            Along::U => at.u,
            Along::V => at.v,
        }
    }
}

/// A cubic (highest power first), its first and its second derivative.
fn cubic(c: &[f64; 4], t: f64) -> [f64; 3] {
    [
        ((c[0] * t + c[1]) * t + c[2]) * t + c[3],
        (3.0 * c[0] * t + 2.0 * c[1]) * t + c[2],
        6.0 * c[0] * t + 2.0 * c[1],
    ]
}

/// `(R cos v, R sin v, Z)`.
fn revolved(radius: &[f64; 4], height: &[f64; 4], u: f64, v: f64) -> Derivatives {
    let (r, z) = (cubic(radius, u), cubic(height, u));
    let (sin, cos) = v.sin_cos();
    Derivatives {
        point: DVec3::new(r[0] * cos, r[0] * sin, z[0]),
        u: DVec3::new(r[1] * cos, r[1] * sin, z[1]),
        v: DVec3::new(-r[0] * sin, r[0] * cos, 0.0),
        uu: DVec3::new(r[2] * cos, r[2] * sin, z[2]),
        uv: DVec3::new(-r[1] * sin, r[1] * cos, 0.0),
        vv: DVec3::new(-r[0] * cos, -r[0] * sin, 0.0),
    }
}

/// `(1 - v) rail0(u) + v rail1(u)`.
fn ruled(rails: &[[[f64; 4]; 3]; 2], u: f64, v: f64) -> Derivatives {
    let rails = rails
        .each_ref()
        .map(|[x, y, z]| [cubic(x, u), cubic(y, u), cubic(z, u)]);
    let rail = |index: usize, order: usize| {
        let [x, y, z] = rails[index];
        DVec3::new(x[order], y[order], z[order])
    };
    let between = |order: usize| rail(0, order) * (1.0 - v) + rail(1, order) * v;
    Derivatives {
        point: between(0),
        u: between(1),
        v: rail(1, 0) - rail(0, 0),
        uu: between(2),
        uv: rail(1, 1) - rail(0, 1),
        vv: DVec3::ZERO,
    }
}

/// `sum c[k][i][j] u^(3-i) v^(3-j)`.
fn bicubic(coefficients: &[[[f64; 4]; 4]; 3], u: f64, v: f64) -> Derivatives {
    let mut at = Derivatives::default();
    for (k, rows) in coefficients.iter().enumerate() {
        let in_v: [[f64; 3]; 4] = std::array::from_fn(|i| cubic(&rows[i], v));
        let in_u = |order: usize| {
            cubic(
                &[in_v[0][order], in_v[1][order], in_v[2][order], in_v[3][order]],
                u,
            )
        };
        [at.point[k], at.u[k], at.uu[k]] = in_u(0);
        [at.v[k], at.uv[k], _] = in_u(1);
        [at.vv[k], _, _] = in_u(2);
    }
    at
}
