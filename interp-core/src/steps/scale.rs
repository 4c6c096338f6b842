//! Exact conversion of nanometres to steps.
//!
//! With `n/d` steps a nanometre (reduced), a position x is kept as `steps d + remainder = x n + d/2`: the steps are x n/d
//! rounded to the nearest, and the remainder is the progress towards the next step. Only integer differences are added, so the
//! sum is exact after any number of steps.

use super::HOLD_NM;

/// Nanometres per millimetre.
const NM_PER_MM: u64 = crate::math::number::NM_PER_MM as u64;

/// Maximum nanometres per step, the inverse of the minimum steps per millimetre.
const STEP_NM_MAX: u64 = 1_000_000_000;

/// Bits of the reciprocal: with a travel of 33 bits the product fits an i64.
const RECIPROCAL_BITS: u32 = 31;

/// Corrections of a quotient: its estimate has an error of at most two, and the remainder adds at most one in either direction.
const CORRECTIONS: usize = 4;

/// Steps per nanometre of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Numerator.
    pub(super) n: i64,
    /// Denominator, even; at least `2 n`, below 2^53.
    pub(super) d: i64,
    /// `floor(2^shift n / d)`, of [`RECIPROCAL_BITS`] bits.
    reciprocal: i64,
    shift: u32,
    /// [`HOLD_NM`] in units of the remainder.
    pub(super) hold: i64,
    /// Numerator and denominator as floats, for pulse times, for which 24 bits suffice.
    pub(super) n_f32: f32,
    pub(super) d_f32: f32,
}

impl Scale {
    /// The scale of this number of steps in this number of millimetres; none outside 1/1000 to 500 000 steps per millimetre.
    pub(super) fn new(steps: u32, mm: u32) -> Option<Self> {
        let (n, d) = (u64::from(steps), u64::from(mm) * NM_PER_MM);
        if n == 0 || 2 * n > d || n * STEP_NM_MAX < d {
            return None;
        }
        let divisor = greatest_common_divisor(n, d);
        let (n, d) = (n.checked_div(divisor)?, d.checked_div(divisor)?);
        // Half of the denominator is the midpoint between two steps, so it has to be even.
        let (n, d) = if d % 2 == 0 { (n, d) } else { (2 * n, 2 * d) };
        // Long division, bit by bit, until the quotient has RECIPROCAL_BITS bits.
        let (mut reciprocal, mut shift, mut rest) = (0_u64, 0, n);
        while reciprocal >> (RECIPROCAL_BITS - 1) == 0 && shift < u64::BITS - 1 {
            rest *= 2;
            reciprocal *= 2;
            if rest >= d {
                rest -= d;
                reciprocal += 1;
            }
            shift += 1;
        }
        #[allow(clippy::cast_precision_loss, reason = "24 bits are what a time needs")]
        let (n_f32, d_f32) = (n as f32, d as f32);
        Some(Self {
            n: n.cast_signed(),
            d: d.cast_signed(),
            reciprocal: reciprocal.cast_signed(),
            shift,
            hold: (u64::from(HOLD_NM) * n).min(d / 4).cast_signed(),
            n_f32,
            d_f32,
        })
    }

    /// Steps over a travel of less than 2^32 nm from this remainder, and the new remainder.
    #[inline(always)]
    pub(super) fn divide(&self, remainder: i64, travel_nm: i64) -> (i64, i64) {
        let mut quotient = travel_nm.wrapping_mul(self.reciprocal) >> self.shift;
        // Both products may wrap; their difference is small, so the wrapped difference is exact.
        let total = remainder.wrapping_add(travel_nm.wrapping_mul(self.n));
        let mut rest = total.wrapping_sub(quotient.wrapping_mul(self.d));
        for _ in 0..CORRECTIONS {
            if rest < 0 {
                rest += self.d;
                quotient -= 1;
            } else if rest >= self.d {
                rest -= self.d;
                quotient += 1;
            } else {
                break;
            }
        }
        (quotient, rest)
    }
}

/// Euclid's algorithm; at most 75 divisions, because every two of them halve a number below 2^52.
fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a.checked_rem(b).unwrap_or(0));
    }
    a
}
