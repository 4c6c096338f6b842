//! A surface as exact bicubic pieces, its bounding box, and its placement on the machine.
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

pub mod pieces;
pub mod placement;
