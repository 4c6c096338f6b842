//! Runs a job on the core and judges the run: the one pipeline that the commands and the tests use.
//!
//! ```text
//! Job ──timed──► digests, fault        the core alone
//!     ──surveyed──► errors, speeds     every sample against the oracle
//!     ──verified──► scallop, gouges, limits, optimum, and the verdict
//!     ──comparison──► a board's run against the core's
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

pub mod comparison;
mod error;
mod fault;
mod pass_time;
mod run;
mod sample;
mod verification;

pub use error::InspectError;
pub use fault::FaultAt;
pub use pass_time::{PassTime, pass_times};
pub use run::{PassDigest, TimedRun, oracle, refused, surveyed, timed};
pub use sample::{is_on_pass, plain};
pub use verification::{BOUNDS, Measured, Verification, verified};
