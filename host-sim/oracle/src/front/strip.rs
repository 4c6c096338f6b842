//! The surface over path share and side share, with the quadratic forms of a step.

use super::super::contact::{Oracle, OracleError};
use glam::DVec3;

/// A pole is approached to this share of the range: S_v is about this share of its size elsewhere.
const POLE_GAP: f64 = 1e-6;

/// The surface from a start line to an end line: path share x and side share y, 0 to 1 each.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strip<'a> {
    pub(super) oracle: &'a Oracle,
    pub(super) path: [f64; 2],
    /// Side parameter of the start line and of the end line.
    pub(super) side: [f64; 2],
}

/// First fundamental form, and I - r II, at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Forms {
    /// S, mm; N.
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    /// S_x, S_y, S_xx, S_xy, S_yy, mm.
    pub(super) x: DVec3,
    pub(super) y: DVec3,
    pub(super) second: [DVec3; 3],
    pub(super) e: f64,
    pub(super) f: f64,
    pub(super) g: f64,
    pub(super) a: f64,
    pub(super) b: f64,
    pub(super) c: f64,
    /// a c - b^2.
    pub(super) det: f64,
    /// sqrt(E G - F^2).
    pub(super) area: f64,
}

impl Strip<'_> {
    pub(super) fn parameters(&self, x: f64, y: f64) -> (f64, f64) {
        let between = |[from, to]: [f64; 2], share: f64| from * (1.0 - share) + to * share;
        self.oracle.swapped(between(self.path, x), between(self.side, y))
    }

    pub(super) fn breaks(&self) -> Vec<f64> {
        let [low, high] = self.path;
        let breaks = self.oracle.surface.breaks(self.oracle.along);
        breaks.iter().map(|at| (at - low) / (high - low)).collect()
    }

    /// The forms; beyond the end line those on it.
    pub(super) fn forms(&self, x: f64, y: f64) -> Result<Forms, OracleError> {
        let forms = self.forms_at(x, y)?;
        if forms.g > 1e-18 * forms.e && forms.e > 1e-18 * forms.g {
            return Ok(forms);
        }
        let inside = |share: f64| share.clamp(POLE_GAP, 1.0 - POLE_GAP);
        self.forms_at(inside(x), inside(y))
    }

    fn forms_at(&self, x: f64, y: f64) -> Result<Forms, OracleError> {
        let (u, v) = self.parameters(x, y.clamp(0.0, 1.0));
        let at = self.oracle.surface.at(u, v);
        let normal = self.oracle.normal(&at, u, v)?;
        let (lx, ly) = (self.path[1] - self.path[0], self.side[1] - self.side[0]);
        let ((sx, sxx), (sy, syy)) = match self.oracle.along {
            job::Along::U => ((at.u, at.uu), (at.v, at.vv)),
            job::Along::V => ((at.v, at.vv), (at.u, at.uu)),
        };
        let (sx, sy) = (sx * lx, sy * ly);
        let second = [sxx * lx * lx, at.uv * lx * ly, syy * ly * ly];
        let (e, f, g) = (sx.length_squared(), sx.dot(sy), sy.length_squared());
        let r = self.oracle.radius_mm;
        let [a, b, c] = [0, 1, 2].map(|k| [e, f, g][k] - r * second[k].dot(normal));
        Ok(Forms {
            point: at.point,
            normal,
            x: sx,
            y: sy,
            second,
            e,
            f,
            g,
            a,
            b,
            c,
            det: a * c - b * b,
            area: (e * g - f * f).max(0.0).sqrt(),
        })
    }
}

impl Forms {
    /// Whether the ball fits.
    pub(super) fn fits(&self) -> bool {
        self.a >= 0.0 && self.c >= 0.0 && self.det >= 0.0
    }

    /// Square of the distance of a step (dx, dy), in steps.
    pub(super) fn density(&self, dx: f64, dy: f64, radius: f64, height: f64) -> f64 {
        let m = self.a * dx * dx + 2.0 * self.b * dx * dy + self.c * dy * dy;
        let i = self.e * dx * dx + 2.0 * self.f * dx * dy + self.g * dy * dy;
        let k = (m / i - 1.0) / radius;
        m * (1.0 + height * k) / (8.0 * radius * height * (1.0 - height / (2.0 * radius)))
    }

    /// The greater dy at which the squared distance of (dx, dy) is `scale`; `None` where dx alone is farther.
    pub(super) fn side_step(&self, dx: f64, scale: f64, radius: f64, height: f64) -> Option<f64> {
        let mut square = scale * 8.0 * radius * height * (1.0 - height / (2.0 * radius));
        let mut dy = f64::NAN;
        for _ in 0..2 {
            let root = square * self.c - self.det * dx * dx;
            if root.is_nan() || root < 0.0 {
                return None;
            }
            dy = (root.sqrt() - self.b * dx) / self.c;
            square *= scale / self.density(dx, dy, radius, height);
        }
        Some(dy)
    }

    /// dx of a step at right angles (in I - r II) to a pass of slope p.
    pub(super) fn shift(&self, p: f64, scale: f64, radius: f64, height: f64) -> f64 {
        let (dx, dy) = (-(self.b + self.c * p), self.a + self.b * p);
        dx * (scale / self.density(dx, dy, radius, height)).sqrt()
    }

    /// |S_x + p S_y|^2.
    pub(super) fn speed_squared(&self, p: f64) -> f64 {
        self.e + 2.0 * self.f * p + self.g * p * p
    }
}
