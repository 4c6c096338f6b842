//! A surface as exact bicubic pieces and as records of the core, its bounding box, and its placement on the machine.

pub mod pieces;
pub mod placement;
pub mod records;
