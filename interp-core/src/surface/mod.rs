//! Surfaces: from stored words to a `Contact`, the differential geometry at one point of a pass.
//!
//! On a pass the side parameter is fixed. A surface kind therefore has two parts:
//!
//! * `collapse`, once per pass and patch: reduces the patch at this side parameter to a few cubics in the path parameter;
//! * `local`, once per sample: evaluates the cubics at a path parameter into a `Local`, whose `contact` is common to all kinds.
//!
//! Positions are fixed point, relative to the patch's own origin, in units of 2^-shift nm, and so are all derivatives (31 bits
//! instead of 24, one cycle per Horner step instead of two). First derivatives are converted to f32 for lengths and the normal. The
//! normal times the ball's radius is an integer vector, used for the cutter location; its products with the
//! second derivatives are r times the second fundamental form. Both parameters are centred, -1/2 to 1/2 over a span.
//!
//! Along a curve of both parameters (`curve::CurvePass`) a patch is not collapsed once, because the side parameter changes with each sample.
//!
//! **Poles.** Where a boundary collapses into a point, one first derivative vanishes along it. A flag of the patch marks the boundary,
//! and `collapse` divides that derivative by its root exactly (synthetic division of the polynomial): `A = a Ã`, `B = b B̃`
//! with scalars a (fixed on a pass) and b (linear along it) that carry the zero. The normal is computed from `Ã x B̃`, as accurate
//! at the pole as elsewhere, and no quotient has a or b as divisor unless it is known to be non-zero.

mod ball;
mod curve;
mod grid;
mod lines;
mod pole;
mod polynomial;
mod range;
mod rational;
mod revolved;
mod side_curve;

pub use polynomial::{POLYNOMIAL_WORDS, PolynomialRecord};
pub use range::{Edges, SHIFT_MAX};
pub use rational::{RATIONAL_WORDS, RationalRecord};
pub use revolved::{REVOLVED_WORDS, RevolvedRecord};

pub(crate) use ball::{Ball, OffsetUnits};
pub(crate) use curve::{AnyCurve, CurvePass, RecordKind};
pub(crate) use grid::{GridKind, GridPass};
pub(crate) use pole::PolePass;
pub(crate) use polynomial::{ExtrudedPass, PolynomialPass, RuledPass};
pub(crate) use rational::RationalPass;
pub(crate) use revolved::{CirclePass, ProfilePass};
pub(crate) use side_curve::SideCurve;

use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{dot_float, fraction_32, inverse_sqrt, sqrt};
use crate::math::vec3::Vec3;

/// Least sine between the two first derivatives (after any flagged zero is divided out) at which a normal is computed.
/// At 1e-3 the f32 cross product still gives the normal to 1e-4 rad; below, [`FaultKind::DegenerateSurface`].
pub const SINE_MIN: f32 = 1e-3;

/// Curvature of the parametrisation, times the ball's radius, above which the derivative of the ball's centre is not computed: it is that of a place near a pole.
const NEAR_POLE: f32 = 1024.0;

/// Square of the tangent of the angle whose sine is [`SINE_MIN`].
const TANGENT_MIN_SQUARED: f32 = SINE_MIN * SINE_MIN / (1.0 - SINE_MIN * SINE_MIN);

/// Side parameter and direction of a pass: the arguments of `collapse` besides the patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IsoLine {
    /// Side parameter within its span, units of 2^-64.
    pub(crate) fraction: u64,
    /// Side parameter centred on its span, fixed point.
    pub(crate) side: i32,
    /// The pass runs against the path parameter.
    pub(crate) reversed: bool,
}

/// The surface and the ball on it at one point of a pass, as used by the stages. "Per path" and "per side" mean per span fraction;
/// g is the factor that a surface kind scales its derivatives by (1, or a quarter of the weight of a rational patch).
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

/// The path parametrisation at a point, sufficient for a step along the path.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PathSpeed {
    /// 1/|A|, path per unit.
    pub(crate) inv_speed: f32,
    /// A . A' / |A|^2: relative change of the speed, per path.
    pub(crate) log_speed_derivative: f32,
}

impl PathSpeed {
    /// Placeholder before the first point.
    pub(crate) const STILL: Self = Self {
        inv_speed: 0.0,
        log_speed_derivative: 0.0,
    };

    /// From g Ã, half its derivative, the difference of its logarithmic speed derivative from that of S, and g/a.
    #[inline(always)]
    fn new(path: &[i32; 3], path2: &[i32; 3], excess: f32, gauge: f32) -> Self {
        let speed = Vec3::of(*path);
        let inverse = inverse_sqrt(speed.dot(speed));
        Self {
            inv_speed: inverse * gauge,
            log_speed_derivative: log_speed_derivative(speed, path2, inverse * inverse, excess),
        }
    }

    /// `self`, where the speed is not zero.
    ///
    /// # Errors
    /// [`FaultKind::DegenerateSurface`] where the speed is zero.
    pub(crate) fn checked(self) -> Result<Self> {
        if self.inv_speed > 0.0 && self.inv_speed < f32::INFINITY {
            Ok(self)
        } else {
            Err(Fault::new(FaultKind::DegenerateSurface, 0.0))
        }
    }
}

/// The factors of A = a Ã and B = b B̃.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors {
    /// a and 1/a, constant on a pass; both 0 where the whole pass is a pole.
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

/// First derivatives with their zeros divided out, and the second derivatives for the curvatures. Derivatives are scaled by g; those of
/// second order are exact up to tangential components.
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
    /// Logarithmic speed derivative of Ã less that of S, because g varies.
    pub(crate) excess: f32,
}

/// First and second derivatives at a point, units per span fraction.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Derivatives {
    pub(crate) path: Vec3,
    pub(crate) side: Vec3,
    pub(crate) path2: Vec3,
    pub(crate) mixed: Vec3,
    pub(crate) side2: Vec3,
}

impl Derivatives {
    /// Derivative of the ball's centre by the contact's arc along a curve of this slope, `offset` from the contact to the centre: with t the direction of the path and e
    /// across it, (1 - r k) t - r w e, k the normal curvature along the path and w the geodesic torsion. None near a pole, where these are quotients of small numbers. Tangential components of
    /// the second derivatives do not matter.
    fn centre_direction(&self, slope: f32, offset: Vec3) -> Option<Vec3> {
        let tangent = self.path + self.side * slope;
        let inverse = inverse_sqrt(tangent.dot(tangent));
        let along = tangent * inverse;
        let across = offset.cross(along);
        let across = across * inverse_sqrt(across.dot(across));
        let path = offset.dot(self.path2 + self.mixed * slope);
        let side = offset.dot(self.mixed + self.side2 * slope);
        let curvature = (path + side * slope) * (inverse * inverse);
        // By the derivative that is more across the path.
        let sine_squared = |by: Vec3| by.dot(across) * by.dot(across) / by.dot(by);
        let (by, form, change) = if sine_squared(self.path) > sine_squared(self.side) {
            (self.path, path, self.path2 + self.mixed * slope)
        } else {
            (self.side, side, self.mixed + self.side2 * slope)
        };
        let per_beside = inverse / by.dot(across);
        let twist = (form - by.dot(tangent) * curvature) * per_beside;
        // The offset is known to a share of its length.
        let size = change.dot(change) * offset.dot(offset) * (per_beside * per_beside);
        let is_known = size < NEAR_POLE * NEAR_POLE;
        is_known.then(|| along * (1.0 - curvature) - across * twist)
    }
}

/// `A . A' / |A|^2` from g A, half of g A' and 1/|g A|^2. In single precision: of a patch much narrower than long, both have few of the 32 bits.
#[inline(always)]
fn log_speed_derivative(path: Vec3, path2: &[i32; 3], inverse_e: f32, excess: f32) -> f32 {
    path.dot(Vec3::of(*path2)) * (2.0 * inverse_e) - excess
}

impl Local {
    /// The derivatives of S, those of second order up to tangential components.
    fn bends(&self, factors: &Factors) -> Derivatives {
        self.derivatives(factors, [0.0; 2])
    }

    /// The derivatives of S; `log_weight`: relative change of the weight along the path and across it.
    fn derivatives(&self, factors: &Factors, [along, across]: [f32; 2]) -> Derivatives {
        let Factors { path: a, side: b, .. } = *factors;
        let scaled = |vector: [i32; 3], factor: f32| Vec3::of(vector) * (factor / self.g);
        let (path, side) = (scaled(self.path, a), scaled(self.side, b));
        Derivatives {
            path,
            side,
            path2: scaled(self.path2, 2.0 * a) - path * (2.0 * along),
            mixed: scaled(self.mixed, 1.0) - side * along - path * across,
            side2: scaled(self.side2, 2.0 * b) - side * (2.0 * across),
        }
    }

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
        // Not `<=`, so that a NaN is rejected.
        if !(area_squared > TANGENT_MIN_SQUARED * (f * f)) {
            return Err(degenerate(area_squared, f));
        }
        let inverse_area = inverse_sqrt(area_squared);
        let offset = ball.offset(cross, inverse_area);
        let inverse = inverse_sqrt(e);
        let inverse_e = inverse * inverse;

        let product = ball.product() * self.g;
        let slant = b * f * inverse_e;
        let l = dot_float(&offset, &self.path2) * product;
        let (shear, shear_sum) = if MIXED {
            let m = dot_float(&offset, &self.mixed) * (0.5 * product);
            let shear = m - slant * l;
            (shear, m + shear)
        } else {
            let shear = -slant * l;
            (shear, shear)
        };
        let twist = shear * inverse * inverse_a;
        let sheared = shear_sum * slant * inverse_a;
        // On a pole every side line has its own direction, and its own speed determines the interval.
        let lateral_squared = if a > 0.0 {
            b * b * (area_squared * inverse_e)
        } else {
            b * b * side.dot(side)
        };
        let (across, n) = if SIDE2 {
            let n = b * (dot_float(&offset, &self.side2) * product);
            (lateral_squared - (n - sheared), n)
        } else {
            (lateral_squared + sheared, 0.0)
        };
        // Used only at the ends of passes: the compiler removes it from the sample path.
        let Vec3 { x, y, z } = side;
        let outwards = b * b * (x * x + y * y + z * z) - n;
        Ok(Contact {
            position: self.position,
            offset,
            path: PathSpeed {
                inv_speed: inverse * inverse_a * self.g,
                log_speed_derivative: log_speed_derivative(path, &self.path2, inverse_e, self.excess),
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

/// A surface on one pass. All patches of a job have the same variant.
#[derive(Clone, Copy, Debug)]
#[allow(
    clippy::large_enum_variant,
    reason = "two live in the interpolator for ever; nothing is allocated"
)]
pub(crate) enum Surface {
    Grid(GridPass),
    Profile(ProfilePass),
    Circle(CirclePass),
    Curve(CurvePass),
}

/// A surface on one pass, by its kind.
pub(crate) enum AnyPass<'a> {
    Polynomial(PolynomialPass<'a>),
    Ruled(RuledPass<'a>),
    Extruded(ExtrudedPass<'a>),
    Rational(RationalPass<'a>),
    Pole(PolePass<'a>),
    Profile(&'a ProfilePass),
    Circle(&'a CirclePass),
    Curve(&'a CurvePass),
}

/// The sample path's interface to a surface on a pass.
pub(crate) trait Pass {
    /// The contact at a fraction of the patch, in the direction of travel.
    ///
    /// # Errors
    /// [`FaultKind::DegenerateSurface`] where the normal is undefined.
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact>;
}

impl Pass for Surface {
    /// Dispatches at run time: for callers outside the sample path.
    #[inline(never)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        match self {
            Self::Curve(pass) => pass.contact(fraction, ball),
            _ => self.contact_on_line(fraction, ball),
        }
    }
}

impl Surface {
    /// [`Pass::contact`] on a line of constant side parameter, for callers that are never on a curve.
    ///
    /// # Errors
    /// As [`Pass::contact`].
    #[inline(never)]
    pub(crate) fn contact_on_line(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        match self.pass() {
            // Bit-identical to the specialised evaluations, see the tests in polynomial.rs.
            AnyPass::Polynomial(PolynomialPass(pass))
            | AnyPass::Ruled(RuledPass(pass))
            | AnyPass::Extruded(ExtrudedPass(pass)) => PolynomialPass(pass).contact(fraction, ball),
            AnyPass::Rational(pass) => pass.contact(fraction, ball),
            AnyPass::Pole(pass) => pass.contact(fraction, ball),
            AnyPass::Profile(pass) => pass.contact(fraction, ball),
            AnyPass::Circle(pass) => pass.contact(fraction, ball),
            AnyPass::Curve(_) => Err(degenerate(0.0, 0.0)),
        }
    }

    /// The contact, and the derivative of the ball's centre by the contact's arc, in the direction of travel; none near a pole.
    ///
    /// # Errors
    /// As [`Pass::contact`].
    #[inline(never)]
    pub(crate) fn contact_and_direction(
        &self,
        fraction: u64,
        ball: &Ball,
    ) -> Result<(Contact, Option<Vec3>)> {
        let (contact, by) = match self.pass() {
            AnyPass::Polynomial(PolynomialPass(pass))
            | AnyPass::Ruled(RuledPass(pass))
            | AnyPass::Extruded(ExtrudedPass(pass)) => {
                let local = PolynomialPass(pass).local(fraction);
                (
                    local.contact::<true, true>(ball, &Factors::ONE)?,
                    local.bends(&Factors::ONE),
                )
            }
            AnyPass::Rational(pass) => {
                let local = pass.local(fraction);
                (
                    local.contact::<true, true>(ball, &Factors::ONE)?,
                    local.bends(&Factors::ONE),
                )
            }
            AnyPass::Pole(pass) => {
                let (local, factors) = pass.local_at(fraction);
                (
                    local.contact::<true, true>(ball, &factors)?,
                    local.bends(&factors),
                )
            }
            AnyPass::Profile(pass) => (pass.contact(fraction, ball)?, pass.derivatives(fraction)),
            AnyPass::Circle(pass) => (pass.contact(fraction, ball)?, pass.derivatives(fraction)),
            AnyPass::Curve(pass) => return pass.contact_and_direction(fraction, ball),
        };
        let direction = by.centre_direction(0.0, ball.in_patch_units(contact.offset));
        Ok((contact, direction))
    }

    /// The pass by its kind.
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
            Self::Curve(pass) => AnyPass::Curve(pass),
        }
    }

    /// Whether the pass degenerates to a point.
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
            AnyPass::Curve(pass) => pass.path_at(fraction),
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
pub(crate) fn path_factor(edges: Edges, at: &IsoLine) -> (f32, f32) {
    match edges.side_root() {
        None => (1.0, 1.0),
        Some(root) => {
            let factor = fraction_32(root.factor(at.side));
            let inverse = if factor > 0.0 { 1.0 / factor } else { 0.0 };
            (factor, inverse)
        }
    }
}

#[cfg(test)]
mod tests;
