//! Runs a job on the core and verifies the run: the one pipeline for commands and tests.
//!
//! ```text
//! Job ──time_run───► digests, fault     the core alone
//!     ──survey_run─► errors, speeds     every sample against the oracle
//!     ──verify_run─► scallop, gouges, limits, optimum, and pass or fail
//! ```

pub mod comparison;
mod curved;
mod error;
mod fault;
mod run;
mod sample;
mod verification;

pub use curved::{CurvedFigures, PathFigures, curved_figures, path_and_crests, path_figures};
pub use error::InspectError;
pub use fault::FaultAt;
pub use run::{PassDigest, TimedRun, centres_of_run, load_error, oracle, survey_run, time_run};
pub use sample::{is_on_pass, plain};
pub use verification::{BOUNDS, Requirements, RunMeasurements, Verification, verify_run};
