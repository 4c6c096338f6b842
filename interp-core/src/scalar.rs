//! The scalar of the sample path, f32, under a name of its own: `host-sim/counted-core` compiles this crate with a file in this
//! one's place whose [`Real`] counts its operations. What comes from a job or goes into a sample is a plain f32.

/// What the sample path computes with.
pub(crate) type Real = f32;

/// 0 where that is known when the crate is compiled: what is taken off is left out then.
pub(crate) const ZERO: Real = 0.0;
/// 1 where that is known when the crate is compiled: a product with it is left out then.
pub(crate) const ONE: Real = 1.0;

/// An f32 as a scalar.
#[inline(always)]
pub(crate) const fn real(value: f32) -> Real {
    value
}

/// A scalar as an f32.
#[inline(always)]
pub(crate) const fn float(value: Real) -> f32 {
    value
}

/// What a function of [`crate::arith`] does that its types do not count.
#[derive(Clone, Copy)]
pub(crate) enum Operation {
    Add,
    Multiply,
    /// By a fixed number of bits.
    Shift,
    /// Between integer and float.
    Convert,
    SquareRoot,
    /// A sine or a cosine, besides the operations that make it.
    Sine,
    /// A reciprocal root, besides the operations that make it.
    InverseRoot,
}

/// Counts operations; here, nothing.
#[inline(always)]
pub(crate) const fn note<const N: usize>(_: [Operation; N]) {}
