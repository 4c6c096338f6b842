//! A cubic profile revolved about z, for passes along the profile and for passes around the axis.
//!
//! Record, [`REVOLVED_WORDS`] words: the shift; four coefficients of the radius and four of the height in powers of the
//! centred profile parameter, units of 2^-shift nm, the height relative to its origin; the height's origin, nm; the start
//! angle in turns (units of 2^-32, wrapping); the angle's extent in turns (units of 2^-31, above 0, at most 2^31).

use super::Ball;
use super::lines::turn_cubic;
use super::range::{BAD_PATCH, SHIFT_MAX, bound, fits_range};
use super::{Contact, Derivatives, IsoLine, Pass, PathSpeed};
use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{angle, centred, count_to_f32, inverse_sqrt, jet, mul_q31, sin_cos, to_f32};
use crate::math::vec3::Vec3;

/// Words of a revolved surface.
pub const REVOLVED_WORDS: usize = 12;

/// 2^-31, the unit of sine and cosine here.
const SINE_UNIT: f32 = 1.0 / 2_147_483_648.0;
/// Radians per 2^-31 turn.
const RADIANS_PER_EXTENT: f32 = core::f32::consts::TAU / 2_147_483_648.0;

/// A revolved surface, unpacked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RevolvedRecord {
    /// Units of the coefficients are 2^-shift nm; at most [`SHIFT_MAX`].
    pub shift: u8,
    /// Radius in powers of the centred profile parameter; not negative on the profile.
    pub radius: [i32; 4],
    /// Height above its origin in powers of the centred profile parameter.
    pub height: [i32; 4],
    /// Origin of the height, nm.
    pub height_origin_nm: i32,
    /// Angle at the start, turns in units of 2^-32.
    pub start: u32,
    /// Extent of the angle, turns in units of 2^-31; 1 to 2^31.
    pub extent: u32,
}

impl RevolvedRecord {
    /// The record's words.
    #[must_use]
    pub const fn to_words(&self) -> [i32; REVOLVED_WORDS] {
        let [r0, r1, r2, r3] = self.radius;
        let [z0, z1, z2, z3] = self.height;
        let angles = [self.start.cast_signed(), self.extent.cast_signed()];
        let [start, extent] = angles;
        [
            self.shift as i32,
            r0,
            r1,
            r2,
            r3,
            z0,
            z1,
            z2,
            z3,
            self.height_origin_nm,
            start,
            extent,
        ]
    }

    /// The record of these words.
    #[must_use]
    pub const fn from_words(words: &[i32; REVOLVED_WORDS]) -> Self {
        let [
            shift,
            r0,
            r1,
            r2,
            r3,
            z0,
            z1,
            z2,
            z3,
            height_origin_nm,
            start,
            extent,
        ] = *words;
        let [shift, ..] = shift.to_le_bytes();
        Self {
            shift: if shift > SHIFT_MAX { SHIFT_MAX } else { shift },
            radius: [r0, r1, r2, r3],
            height: [z0, z1, z2, z3],
            height_origin_nm,
            start: start.cast_unsigned(),
            extent: extent.cast_unsigned(),
        }
    }

    /// Checks that no evaluation can overflow, and that the extent is in range.
    ///
    /// # Errors
    /// [`FaultKind::BadPatch`].
    pub fn check(words: &[i32; REVOLVED_WORDS]) -> Result<()> {
        let record = Self::from_words(words);
        let [shift, ..] = *words;
        let good = (0..=i32::from(SHIFT_MAX)).contains(&shift)
            && (1..=1 << 31).contains(&record.extent)
            && [record.radius, record.height].into_iter().all(|c| {
                let [c0, c1, c2, c3] = c.map(i64::from);
                // Margin 4: the radius is multiplied by sine and cosine, each with its rounding.
                fits_range(4 + bound(&[c0, c1, c2, c3]).max(bound(&[c1, 2 * c2, 3 * c3, 0])))
            });
        if good { Ok(()) } else { BAD_PATCH }
    }
}

/// Maximum negative radius, units: the rounding of a profile that ends on the axis.
const AXIS_UNITS: i32 = 4;

/// Sine and cosine of an angle in turns (units of 2^-32), in units of 2^-31; 1 is represented as 1 - 2^-31.
#[inline(always)]
fn sin_cos_q31(turns: u32) -> [i32; 2] {
    let (sin, cos) = sin_cos(turns);
    [sin.saturating_add(sin), cos.saturating_add(cos)]
}

/// The profile at one parameter: radius and height, with their first derivative and half the second, per unit of the
/// (travelled) parameter.
#[derive(Clone, Copy, Debug)]
struct ProfilePoint {
    radius: [i32; 3],
    height: [i32; 3],
}

/// A polynomial profile, possibly with its parameter reversed.
#[derive(Clone, Copy, Debug, Default)]
struct ProfileCurve {
    radius: [i32; 4],
    height: [i32; 4],
}

impl ProfileCurve {
    fn new(record: &RevolvedRecord, reversed: bool) -> Self {
        Self {
            radius: turn_cubic(record.radius, reversed),
            height: turn_cubic(record.height, reversed),
        }
    }

    #[inline(always)]
    fn at(&self, w: i32) -> ProfilePoint {
        let [radius, radius1, radius2] = jet(&self.radius, w);
        let near_axis = radius.wrapping_add(AXIS_UNITS).cast_unsigned() <= 2 * AXIS_UNITS.cast_unsigned();
        ProfilePoint {
            radius: [if near_axis { 0 } else { radius }, radius1, radius2],
            height: jet(&self.height, w),
        }
    }
}

impl ProfilePoint {
    /// First derivatives of radius and height, and the square of their length.
    #[inline(always)]
    fn tangent(&self) -> ([f32; 2], f32) {
        let ([_, radius1, _], [_, height1, _]) = (self.radius, self.height);
        let tangent = [to_f32(radius1), to_f32(height1)];
        (tangent, plane_dot(tangent, tangent))
    }

    /// Second derivatives.
    #[inline(always)]
    fn bend(&self) -> [f32; 2] {
        let ([_, _, radius2], [_, _, height2]) = (self.radius, self.height);
        [2.0 * to_f32(radius2), 2.0 * to_f32(height2)]
    }
}

#[inline(always)]
fn plane_dot([a0, a1]: [f32; 2], [b0, b1]: [f32; 2]) -> f32 {
    a0 * b0 + a1 * b1
}

#[cold]
#[inline(never)]
fn degenerate() -> Fault {
    Fault::new(FaultKind::DegenerateSurface, 0.0)
}

/// A pass along the profile, at a fixed angle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ProfilePass {
    profile: ProfileCurve,
    sin: i32,
    cos: i32,
    sin_float: f32,
    cos_float: f32,
    /// Extent of the angle, rad per side.
    extent_rad: f32,
    /// Ball radius in units, signed by the tool side.
    radius: f32,
}

impl ProfilePass {
    /// The profile at the pass's angle, for a ball of this radius in units.
    pub(crate) fn collapse(&mut self, words: &[i32; REVOLVED_WORDS], at: &IsoLine, radius: f32) {
        let record = RevolvedRecord::from_words(words);
        let [sin, cos] = sin_cos_q31(angle(record.start, record.extent, at.fraction));
        *self = Self {
            profile: ProfileCurve::new(&record, at.reversed),
            sin,
            cos,
            sin_float: to_f32(sin) * SINE_UNIT,
            cos_float: to_f32(cos) * SINE_UNIT,
            extent_rad: count_to_f32(record.extent) * RADIANS_PER_EXTENT,
            radius,
        };
    }

    /// The parametrisation at a fraction of the profile.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let point = self.profile.at(centred(fraction));
        let (tangent, e) = point.tangent();
        let inverse = inverse_sqrt(e);
        PathSpeed {
            inv_speed: inverse,
            log_speed_derivative: plane_dot(tangent, point.bend()) * (inverse * inverse),
        }
    }
}

impl ProfilePass {
    /// Derivatives at a fraction of the profile.
    pub(crate) fn derivatives(&self, fraction: u64) -> Derivatives {
        let point = self.profile.at(centred(fraction));
        let ([radius, ..], (tangent, _)) = (point.radius, point.tangent());
        let turned = Turned {
            sin: self.sin_float,
            cos: self.cos_float,
            radius: to_f32(radius),
            tangent,
            bend: point.bend(),
        };
        let [profile, angle, profile2, mixed, angle2] = turned.derivatives(self.extent_rad);
        Derivatives {
            path: profile,
            side: angle,
            path2: profile2,
            mixed,
            side2: angle2,
        }
    }
}

/// A point of a profile turned about the axis.
struct Turned {
    sin: f32,
    cos: f32,
    radius: f32,
    /// First and second derivatives of radius and height.
    tangent: [f32; 2],
    bend: [f32; 2],
}

impl Turned {
    /// By the profile's parameter and the angle's fraction: first, first, second, mixed, second.
    fn derivatives(&self, extent_rad: f32) -> [Vec3; 5] {
        let Self { sin, cos, radius, .. } = *self;
        let ([radius1, height1], [radius2, height2]) = (self.tangent, self.bend);
        let turned = |out: f32, up: f32| Vec3::new(out * cos, out * sin, up);
        let around = |speed: f32| Vec3::new(-speed * sin, speed * cos, 0.0);
        [
            turned(radius1, height1),
            around(radius * extent_rad),
            turned(radius2, height2),
            around(radius1 * extent_rad),
            turned(-radius * extent_rad * extent_rad, 0.0),
        ]
    }
}

impl Pass for ProfilePass {
    /// `S_path x S_side = R extent (-z' cos, -z' sin, R')`.
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let point = self.profile.at(centred(fraction));
        let ([radius, ..], [height, ..]) = (point.radius, point.height);
        let (tangent, e) = point.tangent();
        if !(e > 0.0) || radius < 0 {
            return Err(degenerate());
        }
        let bend = point.bend();
        let inverse = inverse_sqrt(e);
        let inverse_e = inverse * inverse;
        let [radius1, height1] = tangent;
        let lateral = to_f32(radius) * self.extent_rad;
        // r times the unit normal, away from the axis and up.
        let length = self.radius * inverse;
        let (out, up) = (-height1 * length, radius1 * length);
        let across = lateral * (lateral + self.extent_rad * out);
        Ok(Contact {
            position: [mul_q31(radius, self.cos), mul_q31(radius, self.sin), height],
            offset: ball.offset(
                Vec3::new(-height1 * self.cos_float, -height1 * self.sin_float, radius1),
                inverse,
            ),
            path: PathSpeed {
                inv_speed: inverse,
                log_speed_derivative: plane_dot(tangent, bend) * inverse_e,
            },
            along: 1.0 - plane_dot([out, up], bend) * inverse_e,
            lateral_squared: lateral * lateral,
            across,
            outwards: across,
            twist_squared: 0.0,
            speed_squared: e,
            gauge: 1.0,
        })
    }
}

/// A pass around the axis: a circle, on which only the angle changes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CirclePass {
    start: u32,
    extent: u32,
    reversed: bool,
    radius: i32,
    height: i32,
    /// Normal, away from the axis and up.
    out: f32,
    up: f32,
    /// First and second derivatives of the profile's radius and height.
    tangent: [f32; 2],
    bend: [f32; 2],
    /// The contact without position and offset, constant around the axis.
    shape: Contact,
}

impl CirclePass {
    /// The circle at the pass's profile parameter, for a ball of this radius in units; `side` is the sign of the tool's side.
    /// `S_path x S_side = R extent (z' cos, z' sin, -R')`.
    ///
    /// # Errors
    /// [`FaultKind::DegenerateSurface`] where the profile's derivative vanishes or its radius is negative.
    pub(crate) fn collapse(
        &mut self,
        words: &[i32; REVOLVED_WORDS],
        at: &IsoLine,
        radius: f32,
    ) -> Result<()> {
        let record = RevolvedRecord::from_words(words);
        let point = ProfileCurve::new(&record, false).at(at.side);
        let ([circle, ..], [height, ..]) = (point.radius, point.height);
        let ([radius1, height1], e) = point.tangent();
        if !(e > 0.0) || circle < 0 {
            return Err(degenerate());
        }
        let inverse = inverse_sqrt(e);
        let (out, up) = (height1 * inverse, -radius1 * inverse);
        let circle_float = to_f32(circle);
        let speed = circle_float * count_to_f32(record.extent) * RADIANS_PER_EXTENT;
        // The ball's sign follows the tool side, not the direction of travel: the normal of a circle does not depend on it.
        let (inverse_speed, bend) = if speed > 0.0 {
            (1.0 / speed, -out * radius / circle_float)
        } else {
            (0.0, 0.0)
        };
        let across = e - radius * plane_dot([out, up], point.bend());
        *self = Self {
            start: record.start,
            extent: record.extent,
            reversed: at.reversed,
            radius: circle,
            height,
            out,
            up,
            tangent: [radius1, height1],
            bend: point.bend(),
            shape: Contact {
                path: PathSpeed {
                    inv_speed: inverse_speed,
                    log_speed_derivative: 0.0,
                },
                along: 1.0 - bend,
                lateral_squared: e,
                across,
                outwards: across,
                speed_squared: speed * speed,
                gauge: 1.0,
                ..Contact::default()
            },
        };
        Ok(())
    }

    /// Whether the whole pass is one point on the axis.
    pub(crate) fn is_point(&self) -> bool {
        self.radius == 0
    }

    /// Derivatives at a fraction of the angle.
    pub(crate) fn derivatives(&self, fraction: u64) -> Derivatives {
        let travelled = if self.reversed { !fraction } else { fraction };
        let [sin, cos] = sin_cos_q31(angle(self.start, self.extent, travelled));
        let turned = Turned {
            sin: to_f32(sin) * SINE_UNIT,
            cos: to_f32(cos) * SINE_UNIT,
            radius: to_f32(self.radius),
            tangent: self.tangent,
            bend: self.bend,
        };
        let extent_rad = count_to_f32(self.extent) * RADIANS_PER_EXTENT;
        let [profile, angle, profile2, mixed, angle2] = turned.derivatives(extent_rad);
        let sign = if self.reversed { -1.0 } else { 1.0 };
        Derivatives {
            path: angle * sign,
            side: profile,
            path2: angle2,
            mixed: mixed * sign,
            side2: profile2,
        }
    }

    /// The parametrisation, constant around the axis.
    pub(crate) const fn path(&self) -> PathSpeed {
        self.shape.path
    }
}

impl Pass for CirclePass {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let travelled = if self.reversed { !fraction } else { fraction };
        let [sin, cos] = sin_cos_q31(angle(self.start, self.extent, travelled));
        let out = self.out * SINE_UNIT;
        Ok(Contact {
            position: [mul_q31(self.radius, cos), mul_q31(self.radius, sin), self.height],
            offset: ball.offset(Vec3::new(out * to_f32(cos), out * to_f32(sin), self.up), 1.0),
            ..self.shape
        })
    }
}
