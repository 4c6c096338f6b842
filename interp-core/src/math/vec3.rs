//! Three-component vectors with scalar and vector product.

use crate::math::arith::to_f32;
use crate::math::number::{MM_PER_NM, to_f32 as wide_to_f32};
use core::ops::{Add, Mul, Sub};

/// A vector in a patch's units, or a derivative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Vec3 {
    /// Along x.
    pub(crate) x: f32,
    /// Along y.
    pub(crate) y: f32,
    /// Along z.
    pub(crate) z: f32,
}

impl Vec3 {
    /// A vector from its components.
    #[inline(always)]
    #[must_use]
    pub(crate) const fn new(x: f32, y: f32, z: f32) -> Self {
        Self { x, y, z }
    }

    /// Integers as the nearest floats.
    #[inline(always)]
    #[must_use]
    pub(crate) fn of([x, y, z]: [i32; 3]) -> Self {
        Self::new(to_f32(x), to_f32(y), to_f32(z))
    }

    /// From one place to another, both in units of 2^-30 nm, mm.
    #[inline(always)]
    #[must_use]
    pub(crate) fn between_q30([x0, y0, z0]: &[i64; 3], [x, y, z]: &[i64; 3]) -> Self {
        const MM_PER_Q30: f32 = MM_PER_NM / 1_073_741_824.0;
        let mm = |from: &i64, to: &i64| wide_to_f32(to.wrapping_sub(*from)) * MM_PER_Q30;
        Self::new(mm(x0, x), mm(y0, y), mm(z0, z))
    }

    /// Scalar product.
    #[inline(always)]
    #[must_use]
    pub(crate) fn dot(self, other: Self) -> f32 {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    /// Vector product.
    #[inline(always)]
    #[must_use]
    pub(crate) fn cross(self, other: Self) -> Self {
        Self::new(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )
    }
}

impl Add for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl Sub for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Mul<f32> for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: f32) -> Self {
        Self::new(self.x * factor, self.y * factor, self.z * factor)
    }
}
