//! The ball on a patch: its radius in the patch's units, and the vector from cutter contact to cutter location.

use super::SHIFT_MAX;
use crate::math::arith::{power_of_two, to_f32, to_top, truncated};
use crate::math::number::NM_PER_MM_F32;
use crate::math::vec3::Vec3;

/// The ball on one patch, whose units are 2^-shift nm. Its offsets are in units of 2^-fine nm, the finest in which the radius is below
/// 2^30: the same on every patch of a job.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ball {
    /// r in the offsets' units; its sign orients `path x side` towards the tool.
    signed_radius: f32,
    /// Scale of the upper word of (offset . half second derivative): r k |.|^2, units^2, per count.
    product: f32,
}

/// The units of a ball's offset on a patch, as powers of two: those of the patch are 2^-shift nm, those of the offset 2^-fine nm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OffsetUnits {
    pub(crate) shift: u8,
    pub(crate) fine: u8,
    /// The radius, offset units.
    pub(crate) radius: f32,
}

impl OffsetUnits {
    /// For a ball of this radius, 1e-6 to 1000 mm, on a patch in units of 2^-shift nm.
    pub(crate) fn new(radius_mm: f32, shift: u8) -> Self {
        let (radius, fine) = to_top(radius_mm * NM_PER_MM_F32);
        Self {
            shift: shift.min(SHIFT_MAX),
            fine,
            radius,
        }
    }
}

impl Ball {
    /// Placeholder before the first patch.
    pub(crate) const NONE: Self = Self {
        signed_radius: 0.0,
        product: 0.0,
    };

    /// The ball with these units; `sign` orients `path x side` towards the tool.
    pub(crate) fn new(units: &OffsetUnits, sign: f32) -> Self {
        let change = i32::from(units.shift) - i32::from(units.fine);
        Self {
            signed_radius: sign * units.radius,
            product: power_of_two(33 + change),
        }
    }

    /// `r N` from a vector along the normal: `vector` times `inverse` is a unit vector. Error at most 1 unit.
    #[inline(always)]
    pub(crate) fn offset(&self, vector: Vec3, inverse: f32) -> [i32; 3] {
        let Vec3 { x, y, z } = vector * (self.signed_radius * inverse);
        [truncated(x), truncated(y), truncated(z)]
    }

    /// `r` times the second fundamental form, units^2, from the upper word of (offset . half a second derivative).
    #[inline(always)]
    pub(crate) const fn product(&self) -> f32 {
        self.product
    }

    /// An offset in the patch's units.
    pub(crate) fn in_patch_units(&self, offset: [i32; 3]) -> Vec3 {
        Vec3::of(offset) * (self.product * power_of_two(-33))
    }

    /// The unit normal of an offset.
    pub(crate) fn normal(&self, offset: [i32; 3]) -> [f32; 3] {
        let inverse = 1.0 / self.signed_radius.abs();
        offset.map(|x| to_f32(x) * inverse)
    }
}
