//! Surfaces: from stored words to what the stages need at one point of a pass, a `Contact`.
//!
//! On a pass the side parameter is fixed. A surface kind therefore has two parts, both in one file:
//!
//! * `collapse`, once a pass and patch: the patch at this side parameter becomes a handful of cubics in the path parameter;
//! * `contact`, once a sample: the cubics at a path parameter become the `Contact`.
//!
//! Positions are fixed point, relative to the patch's own origin, in units of 2^-shift nm; first derivatives are evaluated
//! in fixed point too (31 bits instead of 24) and then become f32, like everything after them. Both parameters are
//! centred, -1/2 to 1/2 over a span.
//!
//! **Poles.** Where a boundary collapses into a point, one first derivative vanishes along it. A patch says so by a flag,
//! and `collapse` divides that derivative by its root exactly (synthetic division of the polynomial): `A = a Ã`, `B = b B̃`
//! with scalars a (fixed on a pass) and b (linear along it) that carry the zero. The normal comes from `Ã x B̃`, as exact
//! at the pole as anywhere, and nothing is divided by a or b unless it is known not to vanish.

mod polynomial;
mod range;
mod rational;
mod revolved;

pub use polynomial::{POLYNOMIAL_WORDS, PolynomialRecord};
pub use range::{Edges, SHIFT_MAX};
pub use rational::{RATIONAL_WORDS, RationalRecord};
pub use revolved::{REVOLVED_WORDS, RevolvedRecord};

pub(crate) use polynomial::PolynomialPass;
pub(crate) use rational::RationalPass;
pub(crate) use revolved::{CirclePass, ProfilePass};

use crate::arith::{fraction_32, sqrt};
use crate::fault::{Fault, FaultKind, Result};
use crate::vec3::Vec3;

/// Least sine between the two first derivatives (after any flagged zero is divided out) at which a normal is taken.
/// At 1e-3 the f32 cross product still gives the normal to 1e-4 rad; below, [`FaultKind::DegenerateSurface`].
pub const SINE_MIN: f32 = 1e-3;

/// Where a pass runs: everything `collapse` needs besides the patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassLine {
    /// Side parameter within its span, centred fixed point.
    pub(crate) side: i32,
    /// The pass runs against the path parameter.
    pub(crate) reversed: bool,
    /// +1 or -1: side of `S_path x S_side` (of the surface's own directions) that the tool is on.
    pub(crate) tool_sign: f32,
}

/// The surface at one point of a pass, as the stages want it. "Per path" and "per side" mean per span fraction.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contact {
    /// Cutter contact relative to the patch's origin, units of 2^-shift nm.
    pub(crate) position: [i32; 3],
    /// Unit normal towards the tool.
    pub(crate) normal: Vec3,
    /// The parametrisation along the path.
    pub(crate) path: PathSpeed,
    /// Normal curvature along the path towards the tool, 1/mm.
    pub(crate) path_bend: f32,
    /// Square of the lateral speed |(N x t) . S_side|, mm^2 per side^2.
    pub(crate) lateral_squared: f32,
    /// Normal curvature across the path towards the tool times `lateral_squared`, mm per side^2.
    pub(crate) lateral_bend: f32,
    /// Square of geodesic torsion times lateral speed, 1 per side^2.
    pub(crate) twist_squared: f32,
}

/// Speed of the path parametrisation and how it changes: what a step along the path needs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathSpeed {
    /// |A|, mm per path.
    pub(crate) speed: f32,
    /// 1/|A|.
    pub(crate) inverse: f32,
    /// A . A' / |A|^2: relative change of the speed, per path.
    pub(crate) stretch: f32,
    /// (A' . A' + A . A'') / |A|^2, per path^2.
    pub(crate) stretch_change: f32,
}

/// The factor a of A = a Ã, and its reciprocal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathFactor {
    pub(crate) factor: f32,
    pub(crate) inverse: f32,
}

impl PathFactor {
    /// The factor of a patch with these collapsed boundaries, on this pass.
    pub(crate) fn of(edges: Edges, at: &PassLine) -> Self {
        match edges.side_root() {
            None => Self {
                factor: 1.0,
                inverse: 1.0,
            },
            Some(root) => {
                let factor = fraction_32(root.factor(at.side));
                Self {
                    factor,
                    inverse: if factor > 0.0 { 1.0 / factor } else { 0.0 },
                }
            }
        }
    }
}

/// First derivatives with their zeros divided out, and what else the curvatures need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Derivatives {
    /// Ã, so that A = a Ã.
    pub(crate) path: Vec3,
    /// Derivative of Ã along the path.
    pub(crate) path2: Vec3,
    /// Second derivative of Ã along the path.
    pub(crate) path3: Vec3,
    /// B̃, so that B = b B̃.
    pub(crate) side: Vec3,
    /// Mixed derivative of S, up to tangential parts.
    pub(crate) mixed: Vec3,
    /// Second side derivative of S over b, up to tangential parts.
    pub(crate) side2: Vec3,
    /// a and 1/a: fixed on a pass; both 0 where the whole pass is a pole.
    pub(crate) path_factor: PathFactor,
    /// b: 0 at a pole at the pass's end.
    pub(crate) side_factor: f32,
    /// Sign on `path x side` that gives the tool's side.
    pub(crate) tool_sign: f32,
}

impl Derivatives {
    /// The contact's differential geometry (Lo 1998, eqns 9 to 11). With E, F, G, L, M, N the fundamental forms, W^2 = EG -
    /// F^2 and d = B - (F/E) A: lateral speed^2 = |d|^2 = W^2/E, II(d, d) = N - 2 M F/E + L (F/E)^2, II(t, d) = (M - L F/E)/sqrt E.
    #[inline(always)]
    pub(crate) fn contact(&self, position: [i32; 3]) -> Result<Contact> {
        let PathFactor {
            factor: a,
            inverse: inverse_a,
        } = self.path_factor;
        let b = self.side_factor;
        let cross = self.path.cross(self.side);
        let e = self.path.dot(self.path);
        let f = self.path.dot(self.side);
        let g = self.side.dot(self.side);
        let area_squared = cross.dot(cross);
        let eg = e * g;
        // Not `<=`: a NaN must not pass.
        if !(area_squared > SINE_MIN * SINE_MIN * eg) {
            let sine = if eg > 0.0 { sqrt(area_squared / eg) } else { 0.0 };
            return Err(Fault::new(FaultKind::DegenerateSurface, sine));
        }
        let normal = cross * (self.tool_sign / sqrt(area_squared));
        let speed = sqrt(e);
        let inverse = 1.0 / speed;
        let inverse_e = inverse * inverse;

        let slant = b * f * inverse_e;
        let l = normal.dot(self.path2);
        let m = normal.dot(self.mixed);
        let n = b * normal.dot(self.side2);
        let shear = m - slant * l;
        let twist = shear * inverse * inverse_a;
        Ok(Contact {
            position,
            normal,
            path: PathSpeed {
                speed: a * speed,
                inverse: inverse * inverse_a,
                stretch: self.path.dot(self.path2) * inverse_e,
                stretch_change: (self.path2.dot(self.path2) + self.path.dot(self.path3)) * inverse_e,
            },
            path_bend: l * inverse_e * inverse_a,
            // On a pole every side line leaves in its own direction, and its own speed counts.
            lateral_squared: b * b * if a > 0.0 { area_squared * inverse_e } else { g },
            lateral_bend: n - (m + shear) * slant * inverse_a,
            twist_squared: twist * twist,
        })
    }
}
