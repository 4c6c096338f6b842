//! Surfaces: from stored words to what the stages need at one point of a pass, a `Contact`.
//!
//! On a pass the side parameter is fixed. A surface kind therefore has two parts:
//!
//! * `collapse`, once a pass and patch: the patch at this side parameter becomes a handful of cubics in the path parameter;
//! * `local`, once a sample: the cubics at a path parameter become a `Local`, whose `contact` is the same for all kinds.
//!
//! Positions are fixed point, relative to the patch's own origin, in units of 2^-shift nm, and so are all derivatives (31 bits
//! instead of 24, one cycle a Horner step instead of two). First derivatives become f32 for lengths and the normal. The
//! normal times the ball's radius is an integer vector again, which the cutter location needs, and its products with the
//! second derivatives are r times the second fundamental form. Both parameters are centred, -1/2 to 1/2 over a span.
//!
//! **Poles.** Where a boundary collapses into a point, one first derivative vanishes along it. A patch says so by a flag,
//! and `collapse` divides that derivative by its root exactly (synthetic division of the polynomial): `A = a Ã`, `B = b B̃`
//! with scalars a (fixed on a pass) and b (linear along it) that carry the zero. The normal comes from `Ã x B̃`, as exact
//! at the pole as anywhere, and nothing is divided by a or b unless it is known not to vanish.

mod ball;
mod grid;
mod lines;
mod pole;
mod polynomial;
mod range;
mod rational;
mod revolved;

pub use polynomial::{POLYNOMIAL_WORDS, PolynomialRecord};
pub use range::{Edges, SHIFT_MAX};
pub use rational::{RATIONAL_WORDS, RationalRecord};
pub use revolved::{REVOLVED_WORDS, RevolvedRecord};

pub(crate) use ball::{Ball, OffsetUnits};
pub(crate) use grid::{GridKind, GridPass};
pub(crate) use pole::PolePass;
pub(crate) use polynomial::{ExtrudedPass, PolynomialPass, RuledPass};
pub(crate) use rational::RationalPass;
pub(crate) use revolved::{CirclePass, ProfilePass};

use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{dot_hi, fraction_32, inverse_sqrt, power_of_two, sqrt, to_f32};
use crate::math::vec3::Vec3;

/// Least sine between the two first derivatives (after any flagged zero is divided out) at which a normal is taken.
/// At 1e-3 the f32 cross product still gives the normal to 1e-4 rad; below, [`FaultKind::DegenerateSurface`].
pub const SINE_MIN: f32 = 1e-3;

/// Square of the tangent of the angle whose sine is [`SINE_MIN`].
const TANGENT_MIN_SQUARED: f32 = SINE_MIN * SINE_MIN / (1.0 - SINE_MIN * SINE_MIN);

/// Where a pass runs: everything `collapse` needs besides the patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassLine {
    /// Side parameter within its span, units of 2^-64.
    pub(crate) fraction: u64,
    /// The same, centred fixed point.
    pub(crate) side: i32,
    /// The pass runs against the path parameter.
    pub(crate) reversed: bool,
}

/// The surface and the ball on it at one point of a pass, as the stages want it. "Per path" and "per side" mean per span fraction;
/// g is the factor that a surface kind scales its derivatives by (1, or a part of the weight).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Contact {
    /// Cutter contact relative to the patch's origin, units of 2^-shift nm.
    pub(crate) position: [i32; 3],
    /// r N, towards the tool, in the ball's units.
    pub(crate) offset: [i32; 3],
    /// The parametrisation along the path.
    pub(crate) path: PathSpeed,
    /// 1 - r k, k the normal curvature along the path towards the tool.
    pub(crate) along: f32,
    /// 1 - r k across the path, times `lateral_squared`.
    pub(crate) across: f32,
    /// Square of the lateral speed |(N x t) . S_side|, (g units)^2 per side^2.
    pub(crate) lateral_squared: f32,
    /// 1 - r k along the side line, times the square of the side derivative's length, likewise.
    pub(crate) outwards: f32,
    /// Square of r times geodesic torsion times lateral speed, (g units)^2 per side^2.
    pub(crate) twist_squared: f32,
    /// |A|^2, (g units)^2.
    pub(crate) speed_squared: f32,
    /// 1/g^2.
    pub(crate) gauge: f32,
}

/// The path parametrisation at a place: what a step along the path needs.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathSpeed {
    /// 1/|A|, path per unit.
    pub(crate) inverse: f32,
    /// A . A' / |A|^2: relative change of the speed, per path.
    pub(crate) stretch: f32,
}

impl PathSpeed {
    /// Of no place.
    pub(crate) const STILL: Self = Self {
        inverse: 0.0,
        stretch: 0.0,
    };

    /// From g Ã, half of its derivative, the excess of its stretch, and g/a.
    #[inline(always)]
    fn new(path: &[i32; 3], path2: &[i32; 3], excess: f32, gauge: f32) -> Self {
        let speed = Vec3::of(*path);
        let inverse = inverse_sqrt(speed.dot(speed));
        Self {
            inverse: inverse * gauge,
            stretch: stretch(path, path2, inverse * inverse, excess),
        }
    }

    /// The same where there is a speed.
    ///
    /// # Errors
    /// [`FaultKind::DegenerateSurface`] where it vanishes.
    pub(crate) fn checked(self) -> Result<Self> {
        if self.inverse > 0.0 && self.inverse < f32::INFINITY {
            Ok(self)
        } else {
            Err(Fault::new(FaultKind::DegenerateSurface, 0.0))
        }
    }
}

/// The factors of A = a Ã and B = b B̃.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors {
    /// a and 1/a: fixed on a pass; both 0 where the whole pass is a pole.
    pub(crate) path: f32,
    pub(crate) inverse_path: f32,
    /// b: 0 at a pole at the pass's end.
    pub(crate) side: f32,
}

impl Factors {
    /// Away from poles.
    pub(crate) const ONE: Self = Self {
        path: 1.0,
        inverse_path: 1.0,
        side: 1.0,
    };
}

/// First derivatives with their zeros divided out, and what else the curvatures need. Derivatives are times g; those of
/// second order up to tangential parts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Local {
    /// Relative to the patch's origin, units of 2^-shift nm.
    pub(crate) position: [i32; 3],
    /// Ã, so that A = a Ã.
    pub(crate) path: [i32; 3],
    /// B̃, so that B = b B̃.
    pub(crate) side: [i32; 3],
    /// Half the derivative of Ã along the path.
    pub(crate) path2: [i32; 3],
    /// Mixed derivative of S.
    pub(crate) mixed: [i32; 3],
    /// Half the second side derivative of S over b.
    pub(crate) side2: [i32; 3],
    /// g.
    pub(crate) g: f32,
    /// 1/g.
    pub(crate) inverse_g: f32,
    /// What the stretch of Ã has more than that of S, because g varies.
    pub(crate) excess: f32,
}

/// `A . A' / |A|^2` from g A, half of g A' and 1/|g A|^2.
#[inline(always)]
fn stretch(path: &[i32; 3], path2: &[i32; 3], inverse_e: f32, excess: f32) -> f32 {
    const PRODUCT: f32 = power_of_two(33);
    to_f32(dot_hi(path, path2)) * (inverse_e * PRODUCT) - excess
}

impl Local {
    /// The contact's differential geometry (Lo 1998, eqns 9 to 11). With E, F, G, L, M, N the fundamental forms, W^2 = EG -
    /// F^2 and d = B - (F/E) A: lateral speed^2 = |d|^2 = W^2/E, II(d, d) = N - 2 M F/E + L (F/E)^2, II(t, d) = (M - L F/E)/sqrt E.
    ///
    /// Where the mixed or the second side derivative is known to vanish, `MIXED` and `SIDE2` leave their products out.
    #[inline(always)]
    pub(crate) fn contact<const MIXED: bool, const SIDE2: bool>(
        &self,
        ball: &Ball,
        factors: &Factors,
    ) -> Result<Contact> {
        let Factors {
            path: a,
            inverse_path: inverse_a,
            side: b,
        } = *factors;
        let (path, side) = (Vec3::of(self.path), Vec3::of(self.side));
        let cross = path.cross(side);
        let e = path.dot(path);
        let f = path.dot(side);
        let area_squared = cross.dot(cross);
        // Not `<=`: a NaN must not pass.
        if !(area_squared > TANGENT_MIN_SQUARED * (f * f)) {
            return Err(degenerate(area_squared, f));
        }
        let inverse_area = inverse_sqrt(area_squared);
        let offset = ball.offset(cross, inverse_area);
        let inverse = inverse_sqrt(e);
        let inverse_e = inverse * inverse;

        let product = ball.product() * self.g;
        let slant = b * f * inverse_e;
        let l = to_f32(dot_hi(&offset, &self.path2)) * product;
        let (shear, shear_sum) = if MIXED {
            let m = to_f32(dot_hi(&offset, &self.mixed)) * (0.5 * product);
            let shear = m - slant * l;
            (shear, m + shear)
        } else {
            let shear = -slant * l;
            (shear, shear)
        };
        let twist = shear * inverse * inverse_a;
        let sheared = shear_sum * slant * inverse_a;
        // On a pole every side line leaves in its own direction, and its own speed counts.
        let lateral_squared = if a > 0.0 {
            b * b * (area_squared * inverse_e)
        } else {
            b * b * side.dot(side)
        };
        let (across, n) = if SIDE2 {
            let n = b * (to_f32(dot_hi(&offset, &self.side2)) * product);
            (lateral_squared - (n - sheared), n)
        } else {
            (lateral_squared + sheared, 0.0)
        };
        // Wanted at the ends of passes only: nothing of it is left in the sample path.
        let Vec3 { x, y, z } = side;
        let outwards = b * b * (x * x + y * y + z * z) - n;
        Ok(Contact {
            position: self.position,
            offset,
            path: PathSpeed {
                inverse: inverse * inverse_a * self.g,
                stretch: stretch(&self.path, &self.path2, inverse_e, self.excess),
            },
            along: 1.0 - l * inverse_e * inverse_a,
            lateral_squared,
            across,
            outwards,
            twist_squared: twist * twist,
            speed_squared: a * a * e,
            gauge: self.inverse_g * self.inverse_g,
        })
    }
}

#[cold]
#[inline(never)]
fn degenerate(area_squared: f32, f: f32) -> Fault {
    let eg = area_squared + f * f;
    let sine = if eg > 0.0 { sqrt(area_squared / eg) } else { 0.0 };
    Fault::new(FaultKind::DegenerateSurface, sine)
}

/// A surface on one pass. The variant is a job's.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "two live in the interpolator for ever; nothing is allocated"
)]
pub(crate) enum Surface {
    Grid(GridPass),
    Profile(ProfilePass),
    Circle(CirclePass),
}

/// A surface on one pass by what evaluates it.
pub(crate) enum AnyPass<'a> {
    Polynomial(PolynomialPass<'a>),
    Ruled(RuledPass<'a>),
    Extruded(ExtrudedPass<'a>),
    Rational(RationalPass<'a>),
    Pole(PolePass<'a>),
    Profile(&'a ProfilePass),
    Circle(&'a CirclePass),
}

/// What the sample path asks of a surface on a pass.
pub(crate) trait Pass {
    /// The contact at a fraction of the patch, in the direction of travel.
    ///
    /// # Errors
    /// [`FaultKind::DegenerateSurface`] where there is no normal.
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact>;
}

impl Pass for Surface {
    /// For a caller that has the time to find out what evaluates it.
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        match self.pass() {
            // To the bit the same, see there.
            AnyPass::Polynomial(PolynomialPass(pass))
            | AnyPass::Ruled(RuledPass(pass))
            | AnyPass::Extruded(ExtrudedPass(pass)) => PolynomialPass(pass).contact(fraction, ball),
            AnyPass::Rational(pass) => pass.contact(fraction, ball),
            AnyPass::Pole(pass) => pass.contact(fraction, ball),
            AnyPass::Profile(pass) => pass.contact(fraction, ball),
            AnyPass::Circle(pass) => pass.contact(fraction, ball),
        }
    }
}

impl Surface {
    /// What evaluates it.
    #[inline(always)]
    pub(crate) const fn pass(&self) -> AnyPass<'_> {
        match self {
            Self::Grid(pass) => match pass.kind {
                GridKind::Free => AnyPass::Polynomial(PolynomialPass(pass)),
                GridKind::Ruled => AnyPass::Ruled(RuledPass(pass)),
                GridKind::Extruded => AnyPass::Extruded(ExtrudedPass(pass)),
                GridKind::Rational => AnyPass::Rational(RationalPass(pass)),
                GridKind::Pole => AnyPass::Pole(PolePass(pass)),
            },
            Self::Profile(pass) => AnyPass::Profile(pass),
            Self::Circle(pass) => AnyPass::Circle(pass),
        }
    }

    /// The pass is a single point.
    pub(crate) fn is_point(&self) -> bool {
        match self.pass() {
            AnyPass::Pole(pass) => pass.is_point(),
            AnyPass::Circle(pass) => pass.is_point(),
            _ => false,
        }
    }

    /// The parametrisation at a fraction of the patch, in the direction of travel.
    #[inline(never)]
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        match self.pass() {
            AnyPass::Polynomial(PolynomialPass(pass))
            | AnyPass::Ruled(RuledPass(pass))
            | AnyPass::Extruded(ExtrudedPass(pass)) => PolynomialPass(pass).path_at(fraction),
            AnyPass::Rational(pass) => pass.path_at(fraction),
            AnyPass::Pole(pass) => pass.path_at(fraction),
            AnyPass::Profile(pass) => pass.path_at(fraction),
            AnyPass::Circle(pass) => pass.path(),
        }
    }
}

/// A patch record's origin in nm, its shift, its collapsed boundaries and the blocks of its coordinates.
pub(crate) fn split_patch(words: &[i32]) -> ([i32; 3], u8, Edges, &[[i32; 16]]) {
    let ([x, y, z, head], blocks) = lines::split(words);
    let range::HeadWord { shift, edges } = range::HeadWord::from_word(head);
    ([x, y, z], shift, edges, blocks)
}

/// A revolved record's shift, and the origin of its height in nm.
pub(crate) fn split_revolved(words: &[i32; REVOLVED_WORDS]) -> (u8, i32) {
    let record = RevolvedRecord::from_words(words);
    (record.shift, record.height_origin_nm)
}

/// Factors of a patch with these collapsed boundaries, fixed on this pass: a and 1/a.
pub(crate) fn path_factor(edges: Edges, at: &PassLine) -> (f32, f32) {
    match edges.side_root() {
        None => (1.0, 1.0),
        Some(root) => {
            let factor = fraction_32(root.factor(at.side));
            let inverse = if factor > 0.0 { 1.0 / factor } else { 0.0 };
            (factor, inverse)
        }
    }
}
