//! The arithmetic against double precision.

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

/// The portable square root against the host's FPU, over every binade and at both ends of the range. The FPU of the
/// Cortex-M4F is compared by `tests/qemu.rs`, through the bits of every sample.
#[test]
fn portable_square_root_has_the_bits_of_the_fpu() {
    let random = (0..4_000_000_u32).map(|n| n.wrapping_mul(2_654_435_769) >> 1);
    let ends = [
        0,
        1,
        2,
        0x007f_ffff,
        0x0080_0000,
        0x7f7f_ffff,
        0x7f80_0000,
        0x8000_0000,
    ];
    for bits in random.chain(ends) {
        let value = f32::from_bits(bits);
        let (portable, fpu) = (libm::sqrtf(value), std::primitive::f32::sqrt(value));
        assert!(
            portable.to_bits() == fpu.to_bits() || portable.is_nan() && fpu.is_nan(),
            "{value:e}: {portable:e}, {fpu:e}"
        );
    }
}

/// The products of a target without DSP instructions, from 16-bit halves, are bit-identical.
#[test]
fn products_need_no_dsp_instructions() {
    let by_halves = |a: i32, b: i32| {
        let (a1, b1) = (i64::from(a >> 16), i64::from(b >> 16));
        let (a0, b0) = (i64::from(a & 0xffff), i64::from(b & 0xffff));
        let middle = a1 * b0 + a0 * b1;
        let whole = ((a1 * b1) << 32) + (middle << 16) + a0 * b0;
        ((whole + (1 << 31)) >> 32) as i32
    };
    let mut state = 1_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state.cast_signed()
    };
    for _ in 0..1_000_000 {
        let (a, b) = (next(), next());
        assert_eq!(mul_hi(a, b), by_halves(a, b), "{a} {b}");
    }
    for (a, b) in [
        (i32::MIN, i32::MIN),
        (i32::MIN, i32::MAX),
        (i32::MAX, i32::MAX),
        (-1, 1),
    ] {
        assert_eq!(mul_hi(a, b), by_halves(a, b), "{a} {b}");
    }
}

#[test]
fn inverse_root_over_two_octaves_and_the_range() {
    let mut worst: f64 = 0.0;
    let octaves = (0..2_u32 << 23).step_by(7).map(|k| 0x3f80_0000 + k);
    let range = (0x0080_0000..0x7f80_0000_u32).step_by(104_729);
    for value in octaves.chain(range).map(f32::from_bits) {
        let want = 1.0 / f64::from(value).sqrt();
        let ulp = f64::from(f32::from_bits((want as f32).to_bits() + 1)) - f64::from(want as f32);
        worst = worst.max((f64::from(inverse_sqrt(value)) - want).abs() / ulp);
    }
    std::println!("inverse root: {worst} ulp");
    assert!(worst < 1.5, "{worst} ulp");
}

#[test]
fn a_scalar_product_has_the_digits_of_single_precision() {
    let a = [1_000_000_007, -900_000_011, 3];
    for b in [
        [31_000_000, 34_000_000, 5],
        [2_000_000_000, -7, 11],
        [-1, 1, 1],
        [0; 3],
    ] {
        let exact: i64 = a.iter().zip(&b).map(|(a, b)| i64::from(*a) * i64::from(*b)).sum();
        let exact = exact as f64 / 2_f64.powi(32);
        let off = (f64::from(dot_float(&a, &b)) - exact).abs();
        assert!(off <= 2e-7 * exact.abs(), "{b:?}: {off} of {exact}");
    }
}

#[test]
fn jets_are_the_derivatives() {
    let c = [123_456_789, -98_765_432, 55_555_555, -44_444_444];
    for w in [i32::MIN, -1_234_567_890, 0, 987_654_321, i32::MAX] {
        let x = f64::from(w) / 2_f64.powi(32);
        let [c0, c1, c2, c3] = c.map(f64::from);
        let want = [
            c0 + x * (c1 + x * (c2 + x * c3)),
            c1 + x * (2.0 * c2 + x * 3.0 * c3),
            c2 + 3.0 * c3 * x,
        ];
        for (got, want) in jet(&c, w).into_iter().zip(want) {
            assert!((f64::from(got) - want).abs() < 3.0, "{w}: {got} for {want}");
        }
    }
}

#[test]
fn values_to_the_top() {
    for value in [1.0_f32, 1.5, 3e6, 1e7, 5e8, 536_870_912.0, 1e9] {
        let (top, exponent) = to_top(value);
        assert!((536_870_912.0..1_073_741_824.0).contains(&top), "{value}");
        assert_eq!(top, value * 2_f32.powi(exponent.into()));
    }
}

#[test]
fn whole_numbers_of_q30() {
    for nm in [i64::from(i32::MIN), -5_000, -1, 0, 7, i64::from(i32::MAX)] {
        for part in [0, 1, (1 << 30) - 1] {
            let (whole, excess) = whole_q30((nm << 30) + part);
            assert_eq!((i64::from(whole), excess >> 30), (nm, 0));
        }
    }
    for value in [
        i64::from(i32::MAX) + 1,
        i64::from(i32::MIN) - 1,
        1 << 32,
        -(1 << 32),
    ] {
        assert_ne!(whole_q30(value << 30).1 >> 30, 0, "{value}");
    }
}

#[test]
fn powers_of_two() {
    for exponent in -126..=127 {
        assert_eq!(f64::from(power_of_two(exponent)), 2_f64.powi(exponent));
    }
}

#[test]
fn steps_of_a_fraction() {
    for step in [
        1e-9_f32, 1e-6, 1.5e-5, 1.6e-5, 1e-3, 0.003_9, 0.003_91, 0.3, 0.999,
    ] {
        assert_eq!(fraction_from_f32(step) as f64 / 2_f64.powi(64), f64::from(step));
    }
    for bits in (0x2f00_0000..0x3c00_0000_u32).step_by(9973) {
        let step = f32::from_bits(bits);
        let small = small_step(step);
        assert_eq!(small.is_some(), (2_f32.powi(-32)..2_f32.powi(-8)).contains(&step));
        assert!(small.is_none_or(|small| small == fraction_from_f32(step)));
    }
    assert_eq!(
        small_step(f32::NAN).or(small_step(-1e-3)).or(small_step(0.0)),
        None
    );
    assert_eq!(fraction_from_f32(1.0), u64::MAX);
    assert_eq!(fraction_from_f32(f32::INFINITY), u64::MAX);
    assert_eq!(fraction_from_f32(f32::NAN), u64::MAX);
    assert_eq!(fraction_from_f32(-1.0), 0);
    assert_eq!(centred(0), i32::MIN);
    assert_eq!(centred(u64::MAX), i32::MAX);
}
