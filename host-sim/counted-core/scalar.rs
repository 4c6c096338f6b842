//! The scalar of the sample path that counts: an f32 whose additions, multiplications and divisions are counted as they are
//! written in the source, a thread's in one tally. It stands in for `interp-core/src/scalar.rs`.
//!
//! Counted is what is executed. So a product with a [`ONE`] and a difference to a [`ZERO`], which the compiler knows and leaves out,
//! do not count: patches without a weight pass through the same source as those with one. Comparisons, changes of sign and moves
//! are no operations, as in the paper's table. Integers are counted by the functions of `arith`, see [`note`].

use core::cmp::Ordering;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub};
use std::cell::Cell;

/// Operations of a thread since it began. Differences of two are what counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Additions and subtractions, of floats and of integers.
    pub add: u32,
    /// Multiplications.
    pub multiply: u32,
    /// Divisions.
    pub divide: u32,
    /// Square roots.
    pub square_root: u32,
    /// Sines and cosines. Their polynomials' operations are counted too.
    pub sine: u32,
    /// Reciprocal square roots: each does without a root and a division. Their Newton steps' operations are counted too.
    pub inverse_root: u32,
    /// Conversions between integer and float.
    pub convert: u32,
    /// Shifts by a fixed number of bits.
    pub shift: u32,
}

std::thread_local! {
    static TALLY: Cell<Tally> = const { Cell::new(Tally {
        add: 0,
        multiply: 0,
        divide: 0,
        square_root: 0,
        sine: 0,
        inverse_root: 0,
        convert: 0,
        shift: 0,
    }) };
}

/// What this thread has counted so far; each count wraps.
#[must_use]
pub fn tally() -> Tally {
    TALLY.get()
}

impl Tally {
    /// What has been counted since an earlier tally.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Self {
        Self {
            add: self.add.wrapping_sub(earlier.add),
            multiply: self.multiply.wrapping_sub(earlier.multiply),
            divide: self.divide.wrapping_sub(earlier.divide),
            square_root: self.square_root.wrapping_sub(earlier.square_root),
            sine: self.sine.wrapping_sub(earlier.sine),
            inverse_root: self.inverse_root.wrapping_sub(earlier.inverse_root),
            convert: self.convert.wrapping_sub(earlier.convert),
            shift: self.shift.wrapping_sub(earlier.shift),
        }
    }

    const fn of(&mut self, operation: Operation) -> &mut u32 {
        match operation {
            Operation::Add => &mut self.add,
            Operation::Multiply => &mut self.multiply,
            Operation::Divide => &mut self.divide,
            Operation::SquareRoot => &mut self.square_root,
            Operation::Sine => &mut self.sine,
            Operation::InverseRoot => &mut self.inverse_root,
            Operation::Convert => &mut self.convert,
            Operation::Shift => &mut self.shift,
        }
    }
}

/// An operation; subtractions are additions.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Operation {
    Add,
    Multiply,
    Divide,
    SquareRoot,
    Sine,
    InverseRoot,
    Convert,
    Shift,
}

/// Counts operations that no type counts.
pub(crate) fn note<const N: usize>(operations: [Operation; N]) {
    let mut tally = TALLY.get();
    for operation in operations {
        let count = tally.of(operation);
        *count = count.wrapping_add(1);
    }
    TALLY.set(tally);
}

/// An f32, and whether the compiler knows it.
#[derive(Clone, Copy, Default)]
pub(crate) struct Real {
    value: f32,
    known: bool,
}

/// 0 where that is known when the crate is compiled: what is taken off is left out then.
pub(crate) const ZERO: Real = Real {
    value: 0.0,
    known: true,
};
/// 1 where that is known when the crate is compiled: a product with it is left out then.
pub(crate) const ONE: Real = Real {
    value: 1.0,
    known: true,
};

/// An f32 as a scalar.
pub(crate) const fn real(value: f32) -> Real {
    Real { value, known: false }
}

/// A scalar as an f32.
pub(crate) const fn float(value: Real) -> f32 {
    value.value
}

impl Real {
    pub(crate) const NAN: Self = real(f32::NAN);

    pub(crate) const fn from_bits(bits: u32) -> Self {
        real(f32::from_bits(bits))
    }

    pub(crate) const fn to_bits(self) -> u32 {
        self.value.to_bits()
    }

    pub(crate) const fn abs(self) -> Self {
        real(self.value.abs())
    }

    /// Known to be this value.
    fn is_known(self, value: f32) -> bool {
        self.known && self.value == value
    }
}

impl Add for Real {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        note([Operation::Add]);
        real(self.value + other.value)
    }
}

impl Sub for Real {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        if other.is_known(0.0) {
            return self;
        }
        note([Operation::Add]);
        real(self.value - other.value)
    }
}

impl Mul for Real {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        if other.is_known(1.0) {
            return self;
        }
        if self.is_known(1.0) {
            return other;
        }
        note([Operation::Multiply]);
        real(self.value * other.value)
    }
}

impl Div for Real {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        note([Operation::Divide]);
        real(self.value / other.value)
    }
}

impl Neg for Real {
    type Output = Self;
    fn neg(self) -> Self {
        real(-self.value)
    }
}

impl AddAssign for Real {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

/// An operation with plain floats on either side: constants, and what comes from a job.
macro_rules! with_f32 {
    ($($trait:ident, $function:ident);*) => {$(
        impl $trait<f32> for Real {
            type Output = Self;
            fn $function(self, other: f32) -> Self {
                self.$function(real(other))
            }
        }

        impl $trait<Real> for f32 {
            type Output = Real;
            fn $function(self, other: Real) -> Real {
                real(self).$function(other)
            }
        }
    )*};
}

with_f32!(Add, add; Sub, sub; Mul, mul; Div, div);

impl PartialEq for Real {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl PartialOrd for Real {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl PartialEq<f32> for Real {
    fn eq(&self, other: &f32) -> bool {
        self.value == *other
    }
}

impl PartialOrd<f32> for Real {
    fn partial_cmp(&self, other: &f32) -> Option<Ordering> {
        self.value.partial_cmp(other)
    }
}

impl core::fmt::Debug for Real {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        self.value.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arith::{cubic, dot_hi, inverse_sqrt, jet, sin_cos, sqrt, tangent};
    use crate::vec3::Vec3;

    fn counted<T>(what: impl FnOnce() -> T) -> Tally {
        let before = tally();
        what();
        tally().since(before)
    }

    /// So many additions and multiplications, and nothing else.
    fn sums(add: u32, multiply: u32) -> Tally {
        Tally {
            add,
            multiply,
            ..Tally::default()
        }
    }

    #[test]
    fn vectors_by_hand() {
        let a = Vec3::new(real(1.0), real(2.0), real(3.0));
        let b = Vec3::new(real(-2.0), real(0.5), real(4.0));
        assert_eq!(counted(|| a.cross(b)), sums(3, 6));
        assert_eq!(counted(|| a.dot(b)), sums(2, 3));
        assert_eq!(counted(|| a + b), sums(3, 0));
        assert_eq!(counted(|| a * real(2.0)), sums(0, 3));
    }

    /// By Horner three multiplications and additions for a value; two additions more give the derivative's coefficients, one of
    /// them half the second derivative, and one multiplication and addition the derivative.
    #[test]
    fn fixed_point_by_hand() {
        let c = [1 << 20, 1 << 24, -(1 << 23), 1 << 22];
        assert_eq!(counted(|| cubic(&c, 1 << 28)), sums(3, 3));
        assert_eq!(counted(|| tangent(&c, 1 << 28)), sums(5, 4));
        assert_eq!(counted(|| jet(&c, 1 << 28)), sums(6, 4));
        assert_eq!(counted(|| dot_hi(&[1, 2, 3], &[4, 5, 6])), sums(2, 3));
        // Two polynomials of degree 5 in t^2, one times t; the octant takes two additions.
        let sine = counted(|| sin_cos(123_456_789));
        assert_eq!((sine.add, sine.multiply, sine.sine), (2 * 5 + 2, 2 * 5 + 2, 2));
    }

    /// Half the value; from the bits an estimate; three steps of three multiplications, the last with an addition more.
    #[test]
    fn inverse_root_by_hand() {
        let want = Tally {
            add: 1 + 3 + 1,
            multiply: 1 + 3 * 3,
            inverse_root: 1,
            shift: 1,
            ..Tally::default()
        };
        assert_eq!(counted(|| inverse_sqrt(real(2.0))), want);
    }

    #[test]
    fn roots_quotients_and_what_is_known() {
        let x = real(3.0);
        let root = counted(|| 1.0 / sqrt(x));
        assert_eq!((root.square_root, root.divide, root.inverse_root), (1, 1, 0));
        assert_eq!(counted(|| x * ONE * ONE - ZERO), Tally::default());
        assert_eq!(counted(|| ONE * ONE * x), Tally::default());
        assert_eq!(counted(|| 1.0 - x * real(1.0)), sums(1, 1));
        assert_eq!(counted(|| -x < x), Tally::default());
    }
}
