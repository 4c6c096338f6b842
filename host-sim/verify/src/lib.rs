//! Measures and checks emitted samples with the oracle alone: no dependency on the core or on the data prepared for it.
//!
//! ```text
//! samples ──survey──► errors, feed ripple, schedule      speeds   contact and centre
//!    │                                                   trace    every sample as CSV
//!    ├──────swept───► scallop height, gouges
//!    ├──────motion──► use of the axis limits, time against the optimum
//!    └──────reach───► side of the ball, shank and holder against surface, stock and fixtures
//! ```

pub mod judge;
pub mod motion;
pub mod reach;
mod sample;
pub mod speeds;
pub mod survey;
pub mod swept;
pub mod trace;
mod verdict;

pub use sample::EmittedSample;
pub use verdict::Verdict;
