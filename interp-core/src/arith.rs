//! Arithmetic of the sample path: fixed-point Horner steps, square root, sine, and the only conversions between
//! integers and floats. Nothing here panics; every result is the same on every machine.
//!
//! Fixed point: a parameter within a span is centred, `w = fraction - 1/2`, and held as an i32 in units of 2^-32, so
//! `-1/2 <= w < 1/2`. One Horner step `c + acc w` is then one `SMMLAR` of the Cortex-M4 (1 cycle, 31 bits), where f32
//! would take two cycles for 24 bits.
//!
//! This is the only file of the crate that may hold `unsafe`, and the only one where a cast may lose bits.
#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    reason = "the conversions that lose bits are gathered here, each with its range"
)]

/// 2^-32: turns a centred fixed-point parameter into a float.
const UNIT_32: f32 = 1.0 / 4_294_967_296.0;

/// The product's upper word: `a b / 2^32`, rounded to nearest, ties up.
#[inline(always)]
#[must_use]
pub(crate) const fn mul_hi(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << 31)) >> 32) as i32
}

/// `a b / 2^30`, rounded to nearest. The caller keeps the result within i32.
#[inline(always)]
#[must_use]
pub(crate) const fn mul_q30(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << 29)) >> 30) as i32
}

/// `c0 + c1 w + c2 w^2`, within 1 unit when no partial sum overflows.
#[inline(always)]
#[must_use]
pub(crate) const fn quadratic(c: &[i32; 3], w: i32) -> i32 {
    let [c0, c1, c2] = *c;
    c0.wrapping_add(mul_hi(c1.wrapping_add(mul_hi(c2, w)), w))
}

/// `c0 + c1 w + c2 w^2 + c3 w^3`, within 1 unit when no partial sum overflows.
#[inline(always)]
#[must_use]
pub(crate) const fn cubic(c: &[i32; 4], w: i32) -> i32 {
    let [c0, c1, c2, c3] = *c;
    c0.wrapping_add(mul_hi(quadratic(&[c1, c2, c3], w), w))
}

/// A centred parameter as a float in [-1/2, 1/2].
#[inline(always)]
#[must_use]
pub(crate) const fn centred_to_f32(w: i32) -> f32 {
    w as f32 * UNIT_32
}

/// An integer as the nearest float.
#[inline(always)]
#[must_use]
pub(crate) const fn to_f32(value: i32) -> f32 {
    value as f32
}

/// A count below 2^24 as a float, exactly; larger ones rounded.
#[inline(always)]
#[must_use]
pub(crate) const fn count_to_f32(value: u32) -> f32 {
    value as f32
}

/// A fraction in units of 2^-32 as the nearest float.
#[inline(always)]
#[must_use]
pub(crate) const fn fraction_32(value: u32) -> f32 {
    value as f32 * UNIT_32
}

/// Nearest integer, ties away from zero; saturates, NaN is 0.
#[inline(always)]
#[must_use]
pub(crate) fn round_to_i32(value: f32) -> i32 {
    (value + 0.5_f32.copysign(value)) as i32
}

/// The centred parameter (units of 2^-32) of a fraction (units of 2^-64).
#[inline(always)]
#[must_use]
pub(crate) const fn centred(fraction: u64) -> i32 {
    ((fraction >> 32) as u32 ^ 0x8000_0000) as i32
}

/// A step of a fraction in units of 2^-64; saturates at 0 and at 1 (NaN: 1). Steps below 2^-16 are rounded to 2^-48, below 2^-8
/// to 2^-40, larger ones to 2^-32: down to 2^-24 as fine as the float.
#[inline(always)]
#[must_use]
pub(crate) fn fraction_from_f32(step: f32) -> u64 {
    const FINE: f32 = 1.0 / 256.0;
    const FINEST: f32 = FINE * FINE;
    if step < FINEST {
        ((step * 281_474_976_710_656.0 + 0.5) as u32 as u64) << 16
    } else if step < FINE {
        ((step * 1_099_511_627_776.0 + 0.5) as u32 as u64) << 24
    } else if step < 1.0 {
        ((step * 4_294_967_296.0) as u32 as u64) << 32
    } else {
        u64::MAX
    }
}

/// A fraction (units of 2^-64) as the nearest float.
#[inline]
#[must_use]
pub(crate) const fn fraction_to_f32(fraction: u64) -> f32 {
    fraction as f32 * (UNIT_32 * UNIT_32)
}

/// `1 / w` in units of 2^-29 for a weight `w` in units of 2^-30 within [1/2, 2), from its float reciprocal; one Newton
/// step brings the 24 bits to 28, relative error below 2^-28.
#[inline(always)]
#[must_use]
pub(crate) const fn reciprocal_q29(weight_q30: i32, reciprocal: f32) -> i32 {
    let first = (reciprocal * 536_870_912.0) as i32;
    let error_q31 = (((1_i64 << 59) - first as i64 * weight_q30 as i64) >> 28) as i32;
    first.wrapping_add(((first as i64 * error_q31 as i64 + (1 << 30)) >> 31) as i32)
}

/// `a b / 2^29`, rounded to nearest: a numerator times a reciprocal of [`reciprocal_q29`].
#[inline(always)]
#[must_use]
pub(crate) const fn mul_q29(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << 28)) >> 29) as i32
}

/// An angle within a range: `start + extent fraction`, turns in units of 2^-32 (wrapping), the extent in units of 2^-31.
#[inline(always)]
#[must_use]
pub(crate) const fn angle(start: u32, extent_q31: u32, fraction: u64) -> u32 {
    start.wrapping_add((((fraction >> 32) * extent_q31 as u64 + (1 << 30)) >> 31) as u32)
}

/// Square root, correctly rounded; NaN below zero.
#[inline(always)]
#[must_use]
#[cfg(target_arch = "arm")]
#[allow(unsafe_code, reason = "the hardware square root has no stable intrinsic")]
pub(crate) fn sqrt(value: f32) -> f32 {
    let mut bits = value.to_bits();
    // SAFETY: vsqrt.f32 reads and writes s0 alone, which is declared clobbered; no memory and no flags are touched.
    // FPSCR's sticky exception bits may change, which nothing reads.
    unsafe {
        core::arch::asm!(
            "vmov s0, {0}",
            "vsqrt.f32 s0, s0",
            "vmov {0}, s0",
            inlateout(reg) bits,
            out("s0") _,
            options(pure, nomem, nostack, preserves_flags),
        );
    }
    f32::from_bits(bits)
}

/// Square root, correctly rounded; NaN below zero.
#[inline(always)]
#[must_use]
#[cfg(not(target_arch = "arm"))]
pub(crate) fn sqrt(value: f32) -> f32 {
    libm::sqrtf(value)
}

/// Taylor coefficients of sin(pi/4 t)/t in z = t^2/4, units of 2^-31. Truncation below 1e-11.
const SINE: [i32; 6] = [
    1_686_629_713,
    -693_598_668,
    85_569_306,
    -5_026_995,
    172_272,
    -3_864,
];
/// Taylor coefficients of cos(pi/4 t) in z = t^2/4, units of 2^-30. Truncation below 2e-10.
const COSINE: [i32; 6] = [
    1_073_741_824,
    -1_324_675_879,
    272_375_560,
    -22_401_992,
    987_048,
    -27_060,
];

/// Horner steps of a polynomial of degree 5.
#[inline(always)]
const fn quintic(c: &[i32; 6], z: i32) -> i32 {
    let [c0, c1, c2, c3, c4, c5] = *c;
    let low = cubic(&[c2, c3, c4, c5], z);
    quadratic(&[c0, c1, low], z)
}

/// Sine and cosine of an angle in turns (units of 2^-32), in units of 2^-30. Absolute error at most 3e-9, against 3e-8 of
/// a correctly rounded f32: at 100 mm from the axis 0.3 nm.
#[inline]
#[must_use]
pub(crate) const fn sin_cos(turns: u32) -> (i32, i32) {
    let quarter = turns.wrapping_add(1 << 29) >> 30;
    // t in [-1, 1): eighths of a turn, units of 2^-31.
    let t = (turns.wrapping_sub(quarter << 30) << 2) as i32;
    let z = ((t as i64 * t as i64) >> 32) as i32;
    let sine = mul_hi(t, quintic(&SINE, z));
    let cosine = quintic(&COSINE, z);
    match quarter & 3 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_4, TAU};

    #[test]
    fn sine_table_is_the_taylor_series() {
        let (mut sine, mut cosine) = (FRAC_PI_4, 1.0);
        for n in 0..6 {
            let k = n as f64;
            let scale = 4_f64.powi(n as i32);
            assert_eq!(f64::from(SINE[n]), (sine * scale * 2_f64.powi(31)).round());
            assert_eq!(f64::from(COSINE[n]), (cosine * scale * 2_f64.powi(30)).round());
            sine *= -FRAC_PI_4 * FRAC_PI_4 / ((2.0 * k + 2.0) * (2.0 * k + 3.0));
            cosine *= -FRAC_PI_4 * FRAC_PI_4 / ((2.0 * k + 1.0) * (2.0 * k + 2.0));
        }
    }

    #[test]
    fn sine_error_over_the_whole_turn() {
        let mut worst: f64 = 0.0;
        let mut turns = 0_u32;
        for _ in 0..2_000_000 {
            turns = turns.wrapping_add(2_654_435_769);
            let angle = f64::from(turns) / 4_294_967_296.0 * TAU;
            let (s, c) = sin_cos(turns);
            worst = worst.max((f64::from(s) / 2_f64.powi(30) - angle.sin()).abs());
            worst = worst.max((f64::from(c) / 2_f64.powi(30) - angle.cos()).abs());
        }
        for eighth in 0..8_u32 {
            for near in [-1_i32, 0, 1] {
                let turns = (eighth << 29).wrapping_add(near as u32);
                let angle = f64::from(turns) / 4_294_967_296.0 * TAU;
                let (s, c) = sin_cos(turns);
                worst = worst.max((f64::from(s) / 2_f64.powi(30) - angle.sin()).abs());
                worst = worst.max((f64::from(c) / 2_f64.powi(30) - angle.cos()).abs());
            }
        }
        assert!(worst < 3e-9, "worst error {worst:e}");
    }

    #[test]
    fn reciprocal_is_good_to_28_bits() {
        for step in 0..200_000_u32 {
            let weight = 536_870_912 + (u64::from(step) * 1_610_612_735 / 200_000) as i32;
            let exact = 2_f64.powi(59) / f64::from(weight);
            let float = 1.0 / (weight as f32 / 1_073_741_824.0);
            let got = f64::from(reciprocal_q29(weight, float));
            assert!(
                (got / exact - 1.0).abs() < 2_f64.powi(-28),
                "weight {weight}: {got} for {exact}"
            );
        }
    }

    #[test]
    fn steps_of_a_fraction() {
        for step in [
            1e-9_f32, 1e-6, 1.5e-5, 1.6e-5, 1e-3, 0.003_9, 0.003_91, 0.3, 0.999,
        ] {
            let got = fraction_from_f32(step) as f64 / 2_f64.powi(64);
            assert!(
                (got - f64::from(step)).abs() <= (f64::from(step) * 6e-8).max(2_f64.powi(-49)),
                "{step}: {got}"
            );
        }
        assert_eq!(fraction_from_f32(1.0), u64::MAX);
        assert_eq!(fraction_from_f32(f32::INFINITY), u64::MAX);
        assert_eq!(fraction_from_f32(f32::NAN), u64::MAX);
        assert_eq!(fraction_from_f32(-1.0), 0);
        assert_eq!(centred(0), i32::MIN);
        assert_eq!(centred(u64::MAX), i32::MAX);
    }
}
