//! Errors of an inspection.

use job::JobError;
use oracle::OracleError;

/// Reason for which a run cannot be inspected.
#[derive(Debug, thiserror::Error)]
pub enum InspectError {
    /// The core refuses the job.
    #[error(transparent)]
    Refused(#[from] JobError),
    /// The oracle has no result for the job.
    #[error("{0}")]
    NoOracle(#[from] OracleError),
    /// The trace cannot be written.
    #[error("{0}")]
    Trace(#[from] std::io::Error),
}
