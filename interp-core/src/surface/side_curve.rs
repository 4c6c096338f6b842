//! The side parameter along a pass on a curve, as a cubic of the path parameter.

use crate::math::arith::{place_on_part, power_of_two, product_shifted, quadratic, saturated_32, to_f32};

/// 2^-31, the unit of a place on the part.
const WITHIN: f32 = power_of_two(-31);
/// Bits of a side parameter below those of the curve's coefficients.
const FINE_BITS: u32 = 12;
/// Bits of a coefficient: the sums of one, half of one and a quarter of one are below 2^31.
const COEFFICIENT_BITS: u32 = 30;

/// The side parameter, a fraction of its span, as a function of the path parameter on one of 2^bits even parts of the path span.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SideCurve {
    bits: u8,
    /// Right shift of a sum of the coefficients times the place on the part, to units of the fraction.
    shift: u8,
    /// Coefficients by the place on the part, so that a sum is [`quadratic`].
    coefficients: [i32; 3],
    /// The fraction at the start of the part, units of 2^-32. Out of the span where the curve crosses its boundary.
    start: i64,
    /// Derivatives of the fraction by that of the path: polynomials of the place on the part, units of 2^-31.
    slope: [f32; 3],
    bend: [f32; 2],
}

/// A point of the curve: the side parameter as a fraction of its span, units of 2^-32, and its derivatives by the path's fraction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SidePoint {
    pub(super) side: u32,
    pub(super) slope: f32,
    /// Half the second derivative.
    pub(super) half_bend: f32,
}

impl SidePoint {
    /// On a line of constant side parameter.
    pub(super) const ON_LINE: Self = Self {
        side: 0,
        slope: 0.0,
        half_bend: 0.0,
    };
}

impl SideCurve {
    pub(super) const NONE: Self = Self {
        bits: 0,
        shift: 31,
        coefficients: [0; 3],
        start: 0,
        slope: [0.0; 3],
        bend: [0.0; 2],
    };

    /// From the value at the start, units of 2^-12 and whole; coefficients, units of 2^-shift, shift at most 12; the span's width, units.
    pub(crate) fn new(start: i64, coefficients: [i32; 3], shift: u8, bits: u8, width: i32) -> Self {
        let width = width.max(2).cast_unsigned();
        let log = 31 - width.leading_zeros();
        // 2^(31 + log) / width, between 2^30 and 2^31.
        let factor = (1_u64 << (31 + log)).checked_div(u64::from(width)).unwrap_or(0);
        let share = |value: i64, more: u32| value.wrapping_mul(factor.cast_signed()) >> (log - 1 + more);
        let [first, second, third] = coefficients.map(|value| share(i64::from(value), u32::from(shift)));
        let doubled = [first, second << 1, third << 2];
        let size = doubled.iter().fold(0, |size, value| size | value.unsigned_abs());
        let up = (64 - size.leading_zeros())
            .saturating_sub(COEFFICIENT_BITS)
            .min(30);
        let part = power_of_two(i32::from(bits));
        let unit = part * power_of_two(-i32::from(shift)) / to_f32(width.cast_signed());
        let [first, second, third] = coefficients.map(|value| to_f32(value) * unit);
        Self {
            bits,
            shift: u8::try_from(31 - up).unwrap_or(1),
            coefficients: doubled.map(|value| i32::try_from(value >> up).unwrap_or(0)),
            start: share(start >> FINE_BITS, 0),
            slope: [first, 2.0 * second * WITHIN, 3.0 * third * (WITHIN * WITHIN)],
            bend: [second * part, 3.0 * third * (part * WITHIN)],
        }
    }

    /// The third derivative of the fraction by that of the path.
    pub(super) fn third(&self) -> f32 {
        let [_, half] = self.bend;
        half * power_of_two(32 + i32::from(self.bits))
    }

    /// The point at a fraction of the path span.
    #[inline(always)]
    pub(super) fn point(&self, path: u64) -> SidePoint {
        let at = place_on_part(path, self.bits.into());
        let sum = quadratic(&self.coefficients, at);
        let rise = product_shifted(sum, at, self.shift.into());
        let t = to_f32(at);
        let ([s0, s1, s2], [b0, b1]) = (self.slope, self.bend);
        SidePoint {
            side: saturated_32(self.start.wrapping_add(rise)),
            slope: s0 + t * (s1 + t * s2),
            half_bend: b0 + t * b1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The fraction and its derivatives are those of the cubic in f64, to 4e-9 and to the rounding of f32, wherever on the part; beyond the span it is its end.
    #[test]
    fn points_of_the_cubic() {
        let coefficients = [[90_000_000, -40_000_000, 25_000_000], [-3_000, 2_000, 40_000]];
        for (coefficients, shift, start, bits, width) in [
            (coefficients[0], 3, 5_000_000_i64, 6, 90_000_001),
            (coefficients[1], 0, 70_000, 4, 100_000),
            (coefficients[1], 12, 4_000_000, 1, 268_435_456),
        ] {
            let curve = SideCurve::new(start << FINE_BITS, coefficients, shift, bits, width);
            let scale = 2_f64.powi(-i32::from(shift)) / f64::from(width);
            let [c1, c2, c3] = coefficients.map(|value| f64::from(value) * scale);
            let parts = 2_f64.powi(i32::from(bits));
            for step in 0..1000_u64 {
                let path = step * 0x0041_8937_4bc0_0000;
                let t = (path as f64 / 2_f64.powi(64) * parts).fract();
                let want = start as f64 / f64::from(width) + t * (c1 + t * (c2 + t * c3));
                let point = curve.point(path);
                let got = f64::from(point.side) / 2_f64.powi(32);
                assert!((got - want.clamp(0.0, 1.0)).abs() < 4e-9, "{got} for {want}");
                let (slope, bend) = (parts * (c1 + t * (2.0 * c2 + t * 3.0 * c3)), c2 + t * 3.0 * c3);
                let size = parts * (c1.abs() + c2.abs() + c3.abs());
                assert!((f64::from(point.slope) - slope).abs() < 1e-6 * size);
                assert!((f64::from(point.half_bend) - bend * parts * parts).abs() < 1e-6 * size * parts);
            }
        }
        let beyond = SideCurve::new(-1 << FINE_BITS, [0; 3], 0, 3, 1000);
        assert_eq!(beyond.point(0).side, 0);
        let beyond = SideCurve::new(1001 << FINE_BITS, [0; 3], 0, 3, 1000);
        assert_eq!(beyond.point(0).side, u32::MAX);
    }
}
