//! A cubic profile turned about z, for passes along the profile and for passes around the axis.
//!
//! Record, [`REVOLVED_WORDS`] words: the shift; four coefficients of the radius and four of the height in powers of the
//! centred profile parameter, units of 2^-shift nm, the height relative to its origin; the height's origin, nm; the start
//! angle in turns (units of 2^-32, wrapping); the angle's extent in turns (units of 2^-31, above 0, at most 2^31).

use super::polynomial::unit_mm;
use super::range::{BAD_PATCH, SHIFT_MAX, bound};
use super::{Contact, PassLine, PathSpeed};
use crate::arith::{angle, centred_to_f32, count_to_f32, cubic, mul_q30, quadratic, sin_cos, sqrt, to_f32};
use crate::fault::{Fault, FaultKind, Result};
use crate::vec3::Vec3;

/// Words of a revolved surface.
pub const REVOLVED_WORDS: usize = 12;

/// 2^-30, the unit of sine and cosine.
const SINE_UNIT: f32 = 1.0 / 1_073_741_824.0;
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

    /// Whether the board takes the surface: nothing can overflow, and the extent is in range.
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
                // 4: the radius turns by sine and cosine, and the rounding of both.
                let worst = bound(&[c0, c1, c2, c3]).max(bound(&[c1, 2 * c2, 3 * c3, 0]));
                worst < i64::from(i32::MAX) - 4
            });
        if good { Ok(()) } else { BAD_PATCH }
    }
}

/// Units by which a radius may fall below 0: the rounding of a profile that ends on the axis.
const AXIS_UNITS: i32 = 4;

/// The profile at one parameter, per unit of the (travelled) parameter.
#[derive(Clone, Copy, Debug)]
struct ProfilePoint {
    radius_units: i32,
    height_units: i32,
    radius_mm: f32,
    /// First, second and third derivatives of radius and height, mm.
    first: [f32; 2],
    second: [f32; 2],
    third: [f32; 2],
}

/// A polynomial profile, maybe travelled backwards.
#[derive(Clone, Copy, Debug)]
struct Profile {
    scale: f32,
    radius: [i32; 4],
    height: [i32; 4],
}

impl Profile {
    fn new(record: &RevolvedRecord, reversed: bool) -> Self {
        use super::polynomial::turn;
        Self {
            scale: unit_mm(record.shift),
            radius: turn(record.radius, reversed),
            height: turn(record.height, reversed),
        }
    }

    #[inline(always)]
    fn at(&self, w: i32) -> ProfilePoint {
        use super::polynomial::derivative;
        let float = centred_to_f32(w);
        let both = [&self.radius, &self.height];
        let first = both.map(|c| to_f32(quadratic(&derivative(c), w)) * self.scale);
        let second = both.map(|c| {
            let [_, _, c2, c3] = c.map(to_f32);
            (2.0 * c2 + 6.0 * c3 * float) * self.scale
        });
        let third = both.map(|c| {
            let [_, _, _, c3] = c.map(to_f32);
            6.0 * c3 * self.scale
        });
        let [radius_units, height_units] = both.map(|c| cubic(c, w));
        let near_axis =
            radius_units.wrapping_add(AXIS_UNITS).cast_unsigned() <= 2 * AXIS_UNITS.cast_unsigned();
        let radius_units = if near_axis { 0 } else { radius_units };
        ProfilePoint {
            radius_units,
            height_units,
            radius_mm: to_f32(radius_units) * self.scale,
            first,
            second,
            third,
        }
    }
}

fn plane_dot([a0, a1]: [f32; 2], [b0, b1]: [f32; 2]) -> f32 {
    a0 * b0 + a1 * b1
}

/// A pass along the profile, at a fixed angle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProfilePass {
    pub(crate) height_origin_nm: i32,
    pub(crate) shift: u8,
    profile: Profile,
    cos: i32,
    sin: i32,
    cos_float: f32,
    sin_float: f32,
    /// Extent of the angle, rad per side.
    extent_rad: f32,
    tool_sign: f32,
}

impl ProfilePass {
    /// The profile at the pass's angle.
    pub(crate) fn collapse(words: &[i32; REVOLVED_WORDS], at: &PassLine, side_fraction: u64) -> Self {
        let record = RevolvedRecord::from_words(words);
        let (sin, cos) = sin_cos(angle(record.start, record.extent, side_fraction));
        Self {
            height_origin_nm: record.height_origin_nm,
            shift: record.shift,
            profile: Profile::new(&record, at.reversed),
            cos,
            sin,
            cos_float: to_f32(cos) * SINE_UNIT,
            sin_float: to_f32(sin) * SINE_UNIT,
            extent_rad: count_to_f32(record.extent) * RADIANS_PER_EXTENT,
            tool_sign: super::polynomial::travel_sign(at),
        }
    }

    /// The contact at a centred profile parameter. `S_path x S_side = R extent (-z' cos, -z' sin, R')`.
    #[inline(always)]
    pub(crate) fn contact(&self, w: i32) -> Result<Contact> {
        let point = self.profile.at(w);
        let [radius1, height1] = point.first;
        let e = plane_dot(point.first, point.first);
        if !(e > 0.0) || point.radius_units < 0 {
            return Err(Fault::new(FaultKind::DegenerateSurface, 0.0));
        }
        let speed = sqrt(e);
        let inverse = 1.0 / speed;
        let inverse_e = inverse * inverse;
        let signed = self.tool_sign * inverse;
        let (out, up) = (-height1 * signed, radius1 * signed);
        let lateral = point.radius_mm * self.extent_rad;
        Ok(Contact {
            position: [
                mul_q30(point.radius_units, self.cos),
                mul_q30(point.radius_units, self.sin),
                point.height_units,
            ],
            normal: Vec3::new(out * self.cos_float, out * self.sin_float, up),
            path: PathSpeed {
                speed,
                inverse,
                stretch: plane_dot(point.first, point.second) * inverse_e,
                stretch_change: (plane_dot(point.second, point.second) + plane_dot(point.first, point.third))
                    * inverse_e,
            },
            path_bend: plane_dot([out, up], point.second) * inverse_e,
            lateral_squared: lateral * lateral,
            lateral_bend: -lateral * self.extent_rad * out,
            twist_squared: 0.0,
        })
    }
}

/// A pass around the axis: a circle, on which only the angle changes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CirclePass {
    pub(crate) height_origin_nm: i32,
    pub(crate) shift: u8,
    start: u32,
    extent: u32,
    reversed: bool,
    radius_units: i32,
    height_units: i32,
    /// Normal, away from the axis and up.
    out: f32,
    up: f32,
    /// The contact without position and normal, which is the same all around.
    shape: Contact,
}

impl CirclePass {
    /// The circle at the pass's profile parameter. `S_path x S_side = R extent (z' cos, z' sin, -R')`.
    ///
    /// # Errors
    /// [`FaultKind::DegenerateSurface`] where the profile's derivative vanishes or its radius is negative.
    pub(crate) fn collapse(words: &[i32; REVOLVED_WORDS], at: &PassLine) -> Result<Self> {
        let record = RevolvedRecord::from_words(words);
        let point = Profile::new(&record, false).at(at.side);
        let e = plane_dot(point.first, point.first);
        if !(e > 0.0) || point.radius_units < 0 {
            return Err(Fault::new(FaultKind::DegenerateSurface, 0.0));
        }
        let [radius1, height1] = point.first;
        let signed = at.tool_sign / sqrt(e);
        let (out, up) = (height1 * signed, -radius1 * signed);
        let speed = point.radius_mm * count_to_f32(record.extent) * RADIANS_PER_EXTENT;
        let (inverse, path_bend) = if speed > 0.0 {
            (1.0 / speed, -out / point.radius_mm)
        } else {
            (0.0, 0.0)
        };
        Ok(Self {
            height_origin_nm: record.height_origin_nm,
            shift: record.shift,
            start: record.start,
            extent: record.extent,
            reversed: at.reversed,
            radius_units: point.radius_units,
            height_units: point.height_units,
            out,
            up,
            shape: Contact {
                path: PathSpeed {
                    speed,
                    inverse,
                    stretch: 0.0,
                    stretch_change: 0.0,
                },
                path_bend,
                lateral_squared: e,
                lateral_bend: plane_dot([out, up], point.second),
                ..Contact::default()
            },
        })
    }

    /// The whole pass is one point on the axis.
    pub(crate) fn is_point(&self) -> bool {
        self.radius_units == 0
    }

    /// The contact at a fraction of the pass.
    #[inline(always)]
    pub(crate) fn contact(&self, fraction: u64) -> Contact {
        let travelled = if self.reversed { !fraction } else { fraction };
        let (sin, cos) = sin_cos(angle(self.start, self.extent, travelled));
        let out = self.out * SINE_UNIT;
        Contact {
            position: [
                mul_q30(self.radius_units, cos),
                mul_q30(self.radius_units, sin),
                self.height_units,
            ],
            normal: Vec3::new(out * to_f32(cos), out * to_f32(sin), self.up),
            ..self.shape
        }
    }
}
