//! Arithmetic of the sample path: fixed-point Horner steps, square root, sine, and the only conversions between
//! integers and floats. No function panics; every result is bit-identical on every target.
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
pub(crate) fn mul_hi(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << 31)) >> 32) as i32
}

/// `a b / 2^31`, error at most 2 units; the result is even.
#[inline(always)]
#[must_use]
pub(crate) fn mul_q31(a: i32, b: i32) -> i32 {
    mul_hi(a, b) << 1
}

/// `a b / 2^30`, error at most 4 units; the result is a multiple of 4.
#[inline(always)]
#[must_use]
pub(crate) fn mul_q30(a: i32, b: i32) -> i32 {
    mul_hi(a, b) << 2
}

/// `a + b`. The caller guarantees that it does not overflow.
#[inline(always)]
#[must_use]
pub(crate) fn add(a: i32, b: i32) -> i32 {
    a.wrapping_add(b)
}

/// `a - b`. The caller guarantees that it does not overflow.
#[inline(always)]
#[must_use]
pub(crate) fn subtract(a: i32, b: i32) -> i32 {
    a.wrapping_sub(b)
}

/// `a / 4`, rounded down.
#[inline(always)]
#[must_use]
pub(crate) fn quarter_of(value: i32) -> i32 {
    value >> 2
}

/// `c0 + c1 w + c2 w^2`, error at most 1 unit when no partial sum overflows.
#[inline(always)]
#[must_use]
pub(crate) fn quadratic(c: &[i32; 3], w: i32) -> i32 {
    let [c0, c1, c2] = *c;
    add(c0, mul_hi(add(c1, mul_hi(c2, w)), w))
}

/// `c0 + c1 w + c2 w^2 + c3 w^3`, error at most 1 unit when no partial sum overflows.
#[inline(always)]
#[must_use]
pub(crate) fn cubic(c: &[i32; 4], w: i32) -> i32 {
    let [c0, c1, c2, c3] = *c;
    add(c0, mul_hi(quadratic(&[c1, c2, c3], w), w))
}

/// A cubic's value, first derivative and half its second derivative, from one set of coefficients: the partial sums are shared.
/// Error at most 3 units when no partial sum overflows.
#[inline(always)]
#[must_use]
pub(crate) fn jet(c: &[i32; 4], w: i32) -> [i32; 3] {
    let [c0, c1, c2, c3] = *c;
    let t3 = mul_hi(c3, w);
    let t2 = add(c2, t3);
    let t1 = add(c1, mul_hi(t2, w));
    let d2 = add(t2, t3);
    [add(c0, mul_hi(t1, w)), add(t1, mul_hi(d2, w)), add(d2, t3)]
}

/// A cubic's value and first derivative: [`jet`] without the second derivative.
#[inline(always)]
#[must_use]
pub(crate) fn tangent(c: &[i32; 4], w: i32) -> [i32; 2] {
    let [c0, c1, c2, c3] = *c;
    let t3 = mul_hi(c3, w);
    let t2 = add(c2, t3);
    let t1 = add(c1, mul_hi(t2, w));
    let d2 = add(t2, t3);
    [add(c0, mul_hi(t1, w)), add(t1, mul_hi(d2, w))]
}

/// The upper word of a scalar product, `a . b / 2^32`, error at most 2 units.
#[inline(always)]
#[must_use]
pub(crate) fn dot_hi(a: &[i32; 3], b: &[i32; 3]) -> i32 {
    let ([a0, a1, a2], [b0, b1, b2]) = (*a, *b);
    add(add(mul_hi(a0, b0), mul_hi(a1, b1)), mul_hi(a2, b2))
}

/// A scalar product in units of 2^32, each product at most 2^61, to single precision: where [`dot_hi`] loses what `1 - r k` consists of.
#[inline(always)]
#[must_use]
pub(crate) fn dot_float(a: &[i32; 3], b: &[i32; 3]) -> f32 {
    let ([a0, a1, a2], [b0, b1, b2]) = (*a, *b);
    let sum = add_product(add_product(a0 as i64 * b0 as i64, a1, b1), a2, b2);
    to_f32((sum >> 32) as i32) + sum as u32 as f32 * UNIT_32
}

/// `sum + a b` in 64 bits: one `SMLAL` (1 cycle). The caller guarantees that it does not overflow.
#[inline(always)]
#[must_use]
pub(crate) fn add_product(sum: i64, a: i32, b: i32) -> i64 {
    sum.wrapping_add(a as i64 * b as i64)
}

/// `a b / 2^by`, rounded down; `by` is between 1 and 31. On two words, because a shift of 64 bits by a variable takes twice as long.
#[inline(always)]
#[must_use]
pub(crate) fn product_shifted(a: i32, b: i32, by: u32) -> i64 {
    let product = a as i64 * b as i64;
    let (high, low) = ((product >> 32) as i32, product as u32);
    let low = low.wrapping_shr(by) | (high as u32).wrapping_shl(32 - by);
    (high.wrapping_shr(by) as i64) << 32 | low as i64
}

/// The place of a fraction (units of 2^-64) on one of 2^bits even parts, units of 2^-31; at most 31 bits.
#[inline(always)]
#[must_use]
pub(crate) fn place_on_part(fraction: u64, bits: u32) -> i32 {
    let (high, low) = ((fraction >> 32) as u32, fraction as u32);
    let place = high.wrapping_shl(bits) | (low >> 1).wrapping_shr(31 - bits);
    (place >> 1) as i32
}

/// A fraction in units of 2^-32: 0 below, and the greatest from 1 on.
#[inline(always)]
#[must_use]
pub(crate) fn saturated_32(value: i64) -> u32 {
    match (value >> 32) as i32 {
        0 => value as u32,
        high if high < 0 => 0,
        _ => u32::MAX,
    }
}

/// A value in units of 2^-30, rounded down to an integer, and an overflow check: the upper two bits of the second result are zero if the integer fits.
#[inline(always)]
#[must_use]
pub(crate) fn whole_q30(value: i64) -> (i32, u32) {
    let high = (value >> 32) as u32;
    ((value >> 30) as i32, high ^ high << 1)
}

/// A value in units of 2^-30 as a float.
#[must_use]
pub(crate) const fn q30_to_f32(value: i64) -> f32 {
    value as f32 * (4.0 * UNIT_32)
}

/// A centred parameter as a float in [-1/2, 1/2].
#[inline(always)]
#[must_use]
pub(crate) fn centred_to_f32(w: i32) -> f32 {
    to_f32(w) * UNIT_32
}

/// An integer as the nearest float.
#[inline(always)]
#[must_use]
pub(crate) fn to_f32(value: i32) -> f32 {
    value as f32
}

/// A count as a float: exact below 2^24, rounded above.
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

/// Truncates towards zero; saturates, NaN is 0. One instruction; rounding to nearest takes four.
#[inline(always)]
#[must_use]
pub(crate) fn truncated(value: f32) -> i32 {
    value as i32
}

/// Normalises a value from 1 to 2^30: the value times 2^n within [2^29, 2^30), and n.
#[must_use]
pub(crate) fn to_top(value: f32) -> (f32, u8) {
    let exponent = (156 - (value.to_bits() >> 23 & 0xff) as i32).clamp(0, 29);
    (value * power_of_two(exponent), exponent as u8)
}

/// `2^exponent` for -126 to 127.
#[inline(always)]
#[must_use]
pub(crate) const fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

/// The centred parameter (units of 2^-32) of a fraction (units of 2^-64).
#[inline(always)]
#[must_use]
pub(crate) const fn centred(fraction: u64) -> i32 {
    ((fraction >> 32) as u32 ^ 0x8000_0000) as i32
}

/// The fraction of a patch plus a step; none beyond the patch's end.
#[inline(always)]
#[must_use]
pub(crate) fn advanced(fraction: u64, step: u64) -> Option<u64> {
    fraction.checked_add(step)
}

/// A step as a fraction in units of 2^-64, exact; none unless 2^-32 <= `step` < 2^-8 (none for a NaN). Seven cycles and a branch.
#[inline(always)]
#[must_use]
pub(crate) fn small_step(step: f32) -> Option<u64> {
    const LEAST: u32 = 0x2f80_0000;
    const BEYOND: u32 = 0x3b80_0000;
    let bits = step.to_bits();
    if bits.wrapping_sub(LEAST) >= BEYOND - LEAST {
        return None;
    }
    // The mantissa at the top of a word, and the number of its bits in the upper half: 1 to 24.
    let mantissa = bits << 8 | 0x8000_0000;
    let up = (bits >> 23) - 94;
    let (low, high) = (mantissa.wrapping_shl(up), mantissa.wrapping_shr(32 - up));
    Some((high as u64) << 32 | low as u64)
}

/// A step as a fraction in units of 2^-64, rounded down; saturates at 0 and at 1 (NaN: 1).
#[must_use]
pub(crate) fn fraction_from_f32(step: f32) -> u64 {
    if step <= 0.0 {
        return 0;
    }
    // Not `>=`, so that a NaN saturates.
    if !(step < 1.0) {
        return u64::MAX;
    }
    let bits = step.to_bits();
    let mantissa = u64::from(bits & 0x007f_ffff | 0x0080_0000);
    let exponent = bits >> 23;
    if exponent >= 86 {
        mantissa << (exponent - 86).min(63)
    } else {
        mantissa >> (86 - exponent).min(63)
    }
}

/// A fraction (units of 2^-64) as the nearest float.
#[inline]
#[must_use]
pub(crate) fn fraction_to_f32(fraction: u64) -> f32 {
    (fraction as f32) * (UNIT_32 * UNIT_32)
}

/// `a b / 2^BITS`, rounded to nearest, ties up.
#[inline(always)]
fn rounded<const BITS: u32>(a: i32, b: i32) -> i32 {
    ((a as i64 * b as i64 + (1 << (BITS - 1))) >> BITS) as i32
}

/// `1 / w` in units of 2^-29 for a weight `w` in units of 2^-30 within [1/2, 2), from its float reciprocal; one Newton
/// step refines 24 bits to 28, relative error below 2^-28.
#[inline(always)]
#[must_use]
pub(crate) fn reciprocal_q29(weight_q30: i32, reciprocal: f32) -> i32 {
    let first = truncated(reciprocal * 536_870_912.0);
    let error_q31 = (((1_i64 << 59) - first as i64 * weight_q30 as i64) >> 28) as i32;
    add(first, rounded::<31>(first, error_q31))
}

/// `a b / 2^29`, rounded to nearest: a numerator times a reciprocal of [`reciprocal_q29`].
#[inline(always)]
#[must_use]
pub(crate) fn mul_q29(a: i32, b: i32) -> i32 {
    rounded::<29>(a, b)
}

/// An angle within a range: `start + extent fraction`, turns in units of 2^-32 (wrapping), the extent in units of 2^-31.
#[inline(always)]
#[must_use]
pub(crate) fn angle(start: u32, extent_q31: u32, fraction: u64) -> u32 {
    start.wrapping_add((((fraction >> 32) * extent_q31 as u64 + (1 << 30)) >> 31) as u32)
}

/// Square root, correctly rounded; NaN below zero. Uses the FPU where the target guarantees one (hard-float ABI).
#[inline(always)]
#[must_use]
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
#[allow(unsafe_code, reason = "the hardware square root has no stable intrinsic")]
pub(crate) fn sqrt(value: f32) -> f32 {
    let mut bits = value.to_bits();
    // SAFETY: vsqrt.f32 reads and writes only s0, which is declared clobbered; it accesses no memory and no flags.
    // FPSCR's sticky exception bits may change; they are never read.
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

/// Square root, correctly rounded; NaN below zero. In software or by the target's own instruction: IEEE 754 defines the result exactly, so the
/// bits equal those of the FPU.
#[inline(always)]
#[must_use]
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
pub(crate) fn sqrt(value: f32) -> f32 {
    libm::sqrtf(value)
}

/// `1 / sqrt(value)` for values from 2^-125, within 1.5 ulp: an initial estimate from the bits (3.4 %), two Newton
/// steps, and a third that adds the residual. 19 cycles on a Cortex-M4F; `vsqrt` and `vdiv` take 32.
///
/// Error bound, with u = 2^-24: the second iterate y has the relative error e, |e| < 4.8e-6. `half y` and its product with y have relative
/// rounding errors of at most u each and are close to 1/2; the difference from 1/2 is exact. So the residual's error is at most u, and that of
/// the correction u y, at most 1 ulp of the result (1 ulp is u y to 2 u y). The addition rounds by 0.5 ulp.
/// The remaining terms, 3/2 e^2 of the series and |e| u of the last product, are below 0.001 ulp. The maximum over all mantissas is
/// 1.22 ulp. Below 2^-125 `half` loses its last bit (2.2 ulp).
#[inline(always)]
#[must_use]
pub(crate) fn inverse_sqrt(value: f32) -> f32 {
    let half = 0.5 * value;
    let estimate = f32::from_bits(0x5f37_59df - (value.to_bits() >> 1));
    let first = estimate * (1.5 - half * estimate * estimate);
    let second = first * (1.5 - half * first * first);
    second + second * (0.5 - half * second * second)
}

/// Forces these values to be computed here. Left unconstrained, LLVM delays a part of the computation to where each value is used, and its intermediate results do not fit
/// into the registers of a Cortex-M.
#[inline(always)]
#[must_use]
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
#[allow(unsafe_code, reason = "a fence for values has no stable intrinsic")]
pub(crate) fn computed(values: [i32; 6], more: f32) -> ([i32; 6], f32) {
    let ([mut a, mut b, mut c, mut d, mut e, mut f], mut more) = (values, more.to_bits());
    // SAFETY: no instruction; the registers keep their values.
    unsafe {
        core::arch::asm!(
            "/* {0} {1} {2} {3} {4} {5} {6} */",
            inout(reg) a,
            inout(reg) b,
            inout(reg) c,
            inout(reg) d,
            inout(reg) e,
            inout(reg) f,
            inout(reg) more,
            options(nomem, nostack, preserves_flags),
        );
    }
    ([a, b, c, d, e, f], f32::from_bits(more))
}

/// Values that are computed here.
#[inline(always)]
#[must_use]
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf")))]
pub(crate) const fn computed(values: [i32; 6], more: f32) -> ([i32; 6], f32) {
    (values, more)
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
fn quintic(c: &[i32; 6], z: i32) -> i32 {
    let [c0, c1, c2, c3, c4, c5] = *c;
    let low = cubic(&[c2, c3, c4, c5], z);
    quadratic(&[c0, c1, low], z)
}

/// Sine and cosine of an angle in turns (units of 2^-32), in units of 2^-30. Absolute error at most 3e-9 (3e-8 for
/// a correctly rounded f32): 0.3 nm at 100 mm from the axis.
#[inline]
#[must_use]
pub(crate) fn sin_cos(turns: u32) -> (i32, i32) {
    let quarter = turns.wrapping_add(1 << 29) >> 30;
    // t in [-1, 1) is eighths of a turn, units of 2^-31.
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
mod tests;
