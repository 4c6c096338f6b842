//! A surface as exact bicubic pieces, its bounding box, and its placement on the machine.

pub mod pieces;
pub mod placement;
