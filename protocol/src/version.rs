//! The version of this protocol, and the error where the two ends' versions differ.

use core::fmt;

/// Version of the messages in [`crate::message`]. It is incremented with every incompatible change; the
/// frame, `Hello` and `Capabilities` never change.
pub const PROTOCOL_VERSION: u16 = 9;

/// Host and board have different versions; no other message can be decoded.
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
