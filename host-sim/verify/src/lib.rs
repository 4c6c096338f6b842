//! Measures and judges what a machine emitted, by the oracle alone: nothing here depends on the core or on what was prepared for it.
//!
//! ```text
//! samples ──survey──► errors, feed ripple, schedule      speeds   contact and centre
//!    │                                                   trace    every sample as CSV
//!    ├──────swept───► scallop height, gouges
//!    └──────motion──► use of the axes' limits, time against the optimum
//! ```
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "tests convert freely"
    )
)]

pub mod motion;
mod sample;
pub mod speeds;
pub mod survey;
pub mod swept;
pub mod trace;

pub use sample::Sample;
