//! A board's chip by a debug probe: the firmware into its flash, its log out of it.
//!
//! ```text
//! cargo sim flash, log ──Request──► program.rs ──► host-sim/debug-probe (probe-rs, defmt-decoder) ──USB──► probe ──SWD──► chip
//!        ▲      │                       │
//!        │   image.rs: fits, right board?
//!        └──────────────Event───────────┘
//! ```
//!
//! What talks to the probe is a program of its own, because probe-rs with the descriptions of all its chips is as large as the rest of
//! the tool: it is built when it is first wanted. All that can go wrong comes back as a [`Problem`]; what people are told about it is here.

pub mod event;
pub mod image;
mod program;
#[cfg(test)]
mod tests;
mod words;

pub use event::{Event, Line, Problem, Request, Target, Work};
pub use image::Image;
pub use program::{NotRun, Program};
pub use words::{remedy, sentence};
