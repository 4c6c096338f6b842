//! Comparisons and conversions for bounds, compiled to single instructions without a library call. A library call takes 20 to 60 cycles, and a tick of
//! the feed planner has dozens.

/// Minimum and maximum, one comparison and one conditional move each.
pub(crate) trait Bounded {
    /// The minimum of `self` and the limit; the limit where `self` is a NaN.
    fn at_most(self, limit: Self) -> Self;
    /// The maximum of `self` and the limit; the limit where `self` is a NaN.
    fn at_least(self, limit: Self) -> Self;
}

impl Bounded for f32 {
    #[inline(always)]
    fn at_most(self, limit: Self) -> Self {
        if self < limit { self } else { limit }
    }

    #[inline(always)]
    fn at_least(self, limit: Self) -> Self {
        if self > limit { self } else { limit }
    }
}

/// Nanometres in a millimetre.
pub const NM_PER_MM: u32 = 1_000_000;

/// [`NM_PER_MM`] as a float, exact.
#[allow(clippy::cast_precision_loss, reason = "below 2^24")]
pub(crate) const NM_PER_MM_F32: f32 = NM_PER_MM as f32;

/// Millimetres in a nanometre.
pub(crate) const MM_PER_NM: f32 = 1.0 / NM_PER_MM_F32;

/// Nanometres in mm, rounded to 24 bits.
#[allow(
    clippy::cast_precision_loss,
    reason = "the last digits count below 2^24 nm only"
)]
pub(crate) fn nm_to_mm(nm: i32) -> f32 {
    nm as f32 * MM_PER_NM
}

/// 2^32.
const HIGH: f32 = 4_294_967_296.0;

/// An integer, as of units of 2^-10 nm, as a float: rounded to 24 bits, sufficient for a bound.
#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    reason = "halves of 32 bits; 24 bits are enough for a bound"
)]
#[inline(always)]
pub(crate) const fn to_f32(units: i64) -> f32 {
    let size = units.unsigned_abs();
    let size = (size >> 32) as u32 as f32 * HIGH + size as u32 as f32;
    if units < 0 { -size } else { size }
}

/// The integer part of a number; 0 where it is not positive.
#[allow(
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "halves of 32 bits; the casts saturate, and a NaN becomes 0"
)]
#[inline(always)]
pub(crate) const fn integer_part(value: f32) -> i64 {
    let high = (value * (1.0 / HIGH)) as u32;
    let low = (value - high as f32 * HIGH) as u32;
    (high as i64) << 32 | low as i64
}

/// Cube root of a positive number, relative error below 1e-5: an estimate from the exponent and two steps of Halley's method; 0 for other values.
pub(crate) fn cube_root(value: f32) -> f32 {
    if !(value > 0.0) {
        return 0.0;
    }
    let mut x = f32::from_bits(value.to_bits() / 3 + 0x2a51_4067);
    for _ in 0..2 {
        let cube = x * x * x;
        x *= (cube + 2.0 * value) / (2.0 * cube + value);
    }
    x
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Compared with Rust's `as` conversions.
        #[test]
        fn conversions_are_those_of_the_language(value: i64, bits in 1_u32..63, fraction in 0.0_f32..1e6) {
            let value = value >> bits;
            let (ours, exact) = (f64::from(to_f32(value)), value as f64);
            prop_assert!((ours - exact).abs() <= exact.abs() * 1.2e-7);
            let float = value.unsigned_abs() as f32;
            prop_assert_eq!(integer_part(float), float as i64);
            prop_assert_eq!(integer_part(fraction), fraction as i64);
        }
    }

    #[test]
    fn conversions_at_the_ends() {
        assert_eq!((to_f32(0), to_f32(-1), to_f32(-5)), (0.0, -1.0, -5.0));
        assert_eq!(
            (integer_part(-3.0), integer_part(f32::NAN), integer_part(0.7)),
            (0, 0, 0)
        );
    }

    #[test]
    fn bounds_take_the_limit_for_a_nan() {
        assert_eq!((1.0_f32.at_most(2.0), 3.0_f32.at_most(2.0)), (1.0, 2.0));
        assert_eq!((1.0_f32.at_least(2.0), 3.0_f32.at_least(2.0)), (2.0, 3.0));
        assert_eq!((f32::NAN.at_most(2.0), f32::NAN.at_least(2.0)), (2.0, 2.0));
    }
}
