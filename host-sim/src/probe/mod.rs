//! Access to the chip of a board by a debug probe: writes the firmware into flash, reads the log.
//!
//! ```text
//! cargo sim flash, log ──Request──► program.rs ──► host-sim/debug-probe (probe-rs, defmt-decoder) ──USB──► probe ──SWD──► chip
//!        ▲      │                       │
//!        │   image.rs: fits, right board?
//!        └──────────────Event───────────┘
//! ```
//!
//! The debug-probe program is separate, because probe-rs with its chip descriptions is as large as the rest of the tool; it is built on
//! first use. It returns a [`Problem`] on failure; the texts for it are in `words.rs`.

pub mod event;
pub mod image;
mod program;
#[cfg(test)]
mod tests;
mod words;

pub use event::{Event, Line, Problem, Request, Target, Work};
pub use image::Image;
pub use program::{ProbeError, Program};
pub use words::{remedy, sentence};
