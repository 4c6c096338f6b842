//! A 64-bit digest of many samples, so that one comparison checks that they are bit-identical.
//!
//! FNV-1a over 32-bit words instead of bytes, about seven cycles per word on a Cortex-M4:
//!
//! ```text
//! h(0)     = 0xcbf29ce484222325
//! h(n + 1) = (h(n) xor word(n)) * 0x00000100000001b3   mod 2^64, the word zero-extended
//! ```
//!
//! Every step is a bijection of `h`, so a single differing word always changes the digest. The digest does not protect against deliberate changes.

use core::hint::black_box;

use interp_core::sample::Sample;

/// Running digest; see the module's documentation for its definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(u64);

impl Digest {
    /// The digest of no words.
    pub const EMPTY: u64 = 0xcbf2_9ce4_8422_2325;

    /// Low half of the prime; its high half is 2^8.
    const PRIME_LOW: u32 = 0x1b3;

    /// The digest of no words.
    #[must_use]
    pub const fn new() -> Self {
        Self(Self::EMPTY)
    }

    /// The digest of the words so far.
    #[must_use]
    pub const fn value(self) -> u64 {
        self.0
    }

    /// Adds one word.
    #[inline]
    pub const fn word(&mut self, word: u32) {
        self.word_and(word, 0);
    }

    /// Adds one word; `zero` is added to it. Computed in halves, which takes four instructions: exclusive or, product, shifted add, and
    /// the long product that accumulates.
    #[inline]
    const fn word_and(&mut self, word: u32, zero: u32) {
        let bottom = low(self.0) ^ word;
        let top = low(self.0 >> 32)
            .wrapping_mul(Self::PRIME_LOW)
            .wrapping_add(bottom << 8);
        let product = bottom as u64 * Self::PRIME_LOW as u64;
        self.0 = product.wrapping_add((top as u64) << 32 | zero as u64);
    }

    /// Adds the data words of a job, in order.
    pub fn words(&mut self, words: &[i32]) {
        for word in words {
            self.word(word.cast_unsigned());
        }
    }

    /// Adds every field of a sample as 17 words: tick, state code, pass, path span, low and high half of the path
    /// fraction, the side's span, low and high half, feed (f32 bits), CC x y z (nm), CL x y z (nm), inverse square interval (f32 bits).
    #[inline]
    pub fn sample(&mut self, sample: &Sample) {
        // Left unconstrained, LLVM schedules all low halves first and spills registers. An opaque zero keeps each word's two halves
        // together: 111 instructions, not 164.
        let zero = black_box(0);
        let mut digest = *self;
        let mut feed = |word| digest.word_and(word, zero);
        feed(sample.tick);
        feed(u32::from(sample.state as u8));
        feed(sample.pass);
        for place in [&sample.path, &sample.side] {
            feed(u32::from(place.span));
            feed(low(place.fraction));
            feed(low(place.fraction >> 32));
        }
        feed(sample.feed_mm_s.to_bits());
        for [x, y, z] in [&sample.cc_nm, &sample.cl_nm] {
            feed(x.cast_unsigned());
            feed(y.cast_unsigned());
            feed(z.cast_unsigned());
        }
        feed(sample.inv_interval_sq.to_bits());
        *self = digest;
    }
}

impl Default for Digest {
    fn default() -> Self {
        Self::new()
    }
}

/// The low 32 bits.
const fn low(value: u64) -> u32 {
    (value & 0xffff_ffff) as u32
}

/// Digest of all data words of a job, as `JobBegin` carries it.
#[must_use]
pub fn job_digest(words: &[i32]) -> u64 {
    let mut digest = Digest::new();
    digest.words(words);
    digest.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use interp_core::sample::{SpanParameter, State};

    #[test]
    fn follows_its_definition() {
        // Computed with arbitrary-precision integers: ((basis ^ 1) * prime % 2^64 ^ 0x80000000) * prime % 2^64.
        assert_eq!(Digest::new().value(), 0xcbf2_9ce4_8422_2325);
        assert_eq!(job_digest(&[1]), 0xaf63_bc4c_8601_b62c);
        assert_eq!(job_digest(&[1, i32::MIN]), 0x082f_212e_34e8_8cc4);
    }

    #[test]
    fn a_sample_is_seventeen_words_in_the_order_documented() {
        let sample = Sample {
            tick: 1,
            state: State::Running,
            pass: 3,
            path: SpanParameter {
                span: 4,
                fraction: 6 << 32 | 5,
            },
            side: SpanParameter {
                span: 7,
                fraction: 9 << 32 | 8,
            },
            feed_mm_s: f32::from_bits(10),
            cc_nm: [11, 12, 13],
            cl_nm: [14, 15, 16],
            inv_interval_sq: f32::from_bits(17),
        };
        let mut digest = Digest::new();
        digest.sample(&sample);
        assert_eq!(
            digest.value(),
            job_digest(&[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17])
        );
    }
}
