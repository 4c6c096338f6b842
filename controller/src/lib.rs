//! The hardware-independent logic of the board, so that the firmware and host tests run the same code.
//!
//! ```text
//!            idle, or a low-priority task          |        sample timer, one call a period; planning, one call after each
//!                                                  |
//!  bytes ──► Link ── Instruction ──────────────────┼──queue──► RealTime ──► Interpolator::tick, plan
//!             │ └──── load_.., status (lock) ──────┼─────────►    │
//!  bytes ◄── Link ◄── Event ───────────────────────┼──queue───────┘
//! ```
//!
//! [`realtime::RealTime`] owns the interpolator and decides, once per timer tick, whether a period passes; it keeps the
//! digests and counters of the run. [`link::Link`] keeps the session with the host: it reads frames, answers every
//! request, and writes events. The interface between them is [`machine::Machine`], which the firmware implements with short locks
//! and a queue, and the host with function calls (`in_process`, feature `std`).
#![no_std]
#![warn(clippy::indexing_slicing, clippy::panic, clippy::expect_used)]
#![cfg_attr(
    test,
    allow(
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
        reason = "a test may fail by panic"
    )
)]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod history;
#[cfg(any(test, feature = "std"))]
pub mod in_process;
pub mod jobs;
mod journal;
pub mod link;
pub mod machine;
pub mod manual;
pub mod ram_flash;
pub mod realtime;
pub mod safety;
mod session;
pub mod settings;
pub mod spindle;
pub mod step_output;
pub mod storage;
mod upload;
