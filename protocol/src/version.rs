//! The version of this protocol, and what to say where two ends differ in it.

use core::fmt;

/// Version of the messages in [`crate::message`]. It counts up with every change that the other end would notice; the
/// frame, `Hello` and `Capabilities` never change.
pub const PROTOCOL_VERSION: u16 = 4;

/// Host and board speak different versions; no other message is understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VersionMismatch {
    /// Version of the host.
    pub host: u16,
    /// Version of the board.
    pub board: u16,
}

impl fmt::Display for VersionMismatch {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { host, board } = self;
        write!(
            formatter,
            "the host speaks protocol version {host}, the board version {board}"
        )
    }
}

impl core::error::Error for VersionMismatch {}
