//! What can go wrong between the host and the board.

use std::io;

use protocol::message::Reason;
use protocol::version::VersionMismatch;

/// Errors between the host and the board.
#[derive(Debug, thiserror::Error)]
pub enum RemoteError {
    /// The line broke.
    #[error("the line to the board broke: {0}")]
    Line(#[from] io::Error),
    /// No reply.
    #[error("the board does not answer ({0})")]
    Silent(&'static str),
    /// The two ends speak different versions.
    #[error("{0}")]
    Version(VersionMismatch),
    /// The run stands still while the host waits for its end.
    #[error("the run is held: the board took this host for gone, or another one held it")]
    Held,
    /// The board has paused the run by itself, and nobody is there to resume it.
    #[error("the run is paused: {0}")]
    Paused(&'static str),
    /// The board drives its axes by other settings than the job's.
    #[error("the board reports other steps per millimetre, directions or pulse times than the job's")]
    OtherSteps,
    /// The feed override is 0 and nobody is there to change it.
    #[error("the feed override is 0 %, so the tool does not move, and nobody is there to change it")]
    NoFeed,
    /// The board refused a request.
    #[error("the board refused {request}: {reason}")]
    Refused {
        /// Name of the request.
        request: &'static str,
        /// The board's reason.
        reason: Reason,
    },
}
