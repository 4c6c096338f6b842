//! A point of a surface with its derivatives, and what follows from them alone.

use glam::DVec3;

/// A homogeneous point `(w x, w y, w z, w)`, or a derivative of one.
pub(super) type Homogeneous = [f64; 4];

/// A point of a surface with its derivatives, mm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Derivatives {
    /// S.
    pub point: DVec3,
    /// S_u.
    pub u: DVec3,
    /// S_v.
    pub v: DVec3,
    /// S_uu.
    pub uu: DVec3,
    /// S_uv.
    pub uv: DVec3,
    /// S_vv.
    pub vv: DVec3,
}

impl Derivatives {
    /// Derivatives of `(x, y, z) / w` from a point of the homogeneous surface `(w x, w y, w z, w)` and its derivatives by u, v,
    /// uu, uv and vv (P&T A4.4). The weight must not be 0.
    #[must_use]
    pub fn from_homogeneous([s, s_u, s_v, s_uu, s_uv, s_vv]: [[f64; 4]; 6]) -> Self {
        let w = s[3];
        let point = xyz(&s) / w;
        let u = (xyz(&s_u) - s_u[3] * point) / w;
        let v = (xyz(&s_v) - s_v[3] * point) / w;
        Self {
            point,
            u,
            v,
            uu: (xyz(&s_uu) - 2.0 * s_u[3] * u - s_uu[3] * point) / w,
            uv: (xyz(&s_uv) - s_u[3] * v - s_v[3] * u - s_uv[3] * point) / w,
            vv: (xyz(&s_vv) - 2.0 * s_v[3] * v - s_vv[3] * point) / w,
        }
    }

    /// Principal curvatures, least and largest, 1/mm, by the fundamental forms: above 0 where the surface is concave towards
    /// `normal`, a unit normal. Not finite where S_u and S_v span no plane.
    #[must_use]
    pub fn principal_curvatures(&self, normal: DVec3) -> [f64; 2] {
        let area = self.u.cross(self.v).length();
        let (e, f, g) = (
            self.u.length_squared(),
            self.u.dot(self.v),
            self.v.length_squared(),
        );
        let (l, m, n) = (self.uu.dot(normal), self.uv.dot(normal), self.vv.dot(normal));
        let mean = 0.5 * (e * n - 2.0 * f * m + g * l) / (area * area);
        let gauss = (l * n - m * m) / (area * area);
        let spread = (mean * mean - gauss).max(0.0).sqrt();
        [mean - spread, mean + spread]
    }
}

/// The first three of the four coordinates.
pub(super) fn xyz(a: &Homogeneous) -> DVec3 {
    DVec3::new(a[0], a[1], a[2])
}
