//! Arithmetic that gives the same bits on every machine.

pub(crate) mod arith;
pub(crate) mod number;
pub(crate) mod vec3;
