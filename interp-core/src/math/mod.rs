//! Arithmetic with bit-identical results on every target.

pub(crate) mod arith;
pub(crate) mod number;
pub(crate) mod vec3;
