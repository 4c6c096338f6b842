//! Errors of a frame: apart from `frame`, because a `Nak` carries one.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Errors of a frame. The codes on the wire count from 0 in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameError {
    /// 0: longer than [`FRAME_MAX`](crate::frame::FRAME_MAX).
    TooLong,
    /// 1: too short to hold a checksum.
    TooShort,
    /// 2: not COBS.
    Stuffing,
    /// 3: the checksum is wrong.
    Checksum,
}

impl fmt::Display for FrameError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::TooLong => "it is too long",
            Self::TooShort => "it is too short",
            Self::Stuffing => "its byte stuffing is broken",
            Self::Checksum => "its checksum is wrong",
        })
    }
}
