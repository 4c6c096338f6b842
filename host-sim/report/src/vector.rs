//! Vectors as arrays: those of the oracle, and functions for the picture.

pub(super) use oracle::vector::{Vector, cross, dot, length, subtract};

pub(super) fn add_scaled(a: Vector, b: Vector, factor: f64) -> Vector {
    [a[0] + b[0] * factor, a[1] + b[1] * factor, a[2] + b[2] * factor]
}

/// The unit vector; zero for the zero vector.
pub(super) fn unit(a: Vector) -> Vector {
    let length = length(a);
    if length > 0.0 { a.map(|x| x / length) } else { a }
}
