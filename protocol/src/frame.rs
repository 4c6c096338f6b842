//! Frames: message transport over a line that may lose, insert and corrupt bytes.
//!
//! ```text
//! payload | CRC-32 of the payload, low byte first    -> COBS -> 0x00
//! ```
//!
//! [COBS](https://doi.org/10.1109/90.769765) removes every zero byte from the frame, so that a zero only ever ends a
//! frame: the receiver resynchronises at each zero. The CRC-32 is that of Ethernet and zip
//! (CRC-32/ISO-HDLC). A zero before the first frame of a session, and before every retransmission, ends any partial frame due to
//! noise; empty frames are ignored.

use crc::{CRC_32_ISO_HDLC, Crc};
use postcard::ser_flavors::{Cobs, Slice, crc::CrcModifier};
use serde::Serialize;

pub use crate::frame_error::FrameError;
use crate::message::{Numbered, Reply, Request};

/// Maximum payload, bytes: a `Samples` message with every varint at its maximum length.
pub const PAYLOAD_MAX: usize = 293;

/// Bytes of the checksum.
const CRC_BYTES: usize = 4;

/// Maximum frame, bytes, with its delimiter: COBS adds one byte, and one more for every 254.
pub const FRAME_MAX: usize = cobs::max_encoding_length(PAYLOAD_MAX + CRC_BYTES) + 1;

/// Delimiter at the end of a frame.
pub const DELIMITER: u8 = 0;

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The CRC-32 of frames (ISO HDLC) of any bytes.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// A message that does not fit into a frame (or into the buffer offered).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoRoom;

/// Writes a request with its number as one frame, delimiter included. [`FRAME_MAX`] bytes are enough for every message.
///
/// # Errors
/// [`NoRoom`] if the buffer is too small; no message needs more than [`FRAME_MAX`] bytes.
pub fn write_request<'a>(number: u16, request: &Request, buffer: &'a mut [u8]) -> Result<&'a [u8], NoRoom> {
    write(&Numbered { number, request }, buffer)
}

/// Writes a reply or an event as one frame, delimiter included. [`FRAME_MAX`] bytes are enough for every message.
///
/// # Errors
/// [`NoRoom`] if the buffer is too small; no message needs more than [`FRAME_MAX`] bytes.
pub fn write_reply<'a>(reply: &Reply, buffer: &'a mut [u8]) -> Result<&'a [u8], NoRoom> {
    write(reply, buffer)
}

fn write<'a, T: Serialize>(message: &T, buffer: &'a mut [u8]) -> Result<&'a [u8], NoRoom> {
    let stuffed = Cobs::try_new(Slice::new(buffer)).map_err(|_| NoRoom)?;
    let checked = CrcModifier::new(stuffed, CRC.digest());
    let frame = postcard::serialize_with_flavor(message, checked).map_err(|_| NoRoom)?;
    Ok(frame)
}

/// A received frame without errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The message.
    pub payload: &'a [u8],
    /// Its checksum; with the length it identifies a retransmitted frame.
    pub crc: u32,
}

/// Assembles frames from bytes. Accepts any input; a damaged frame does not affect the frame after its delimiter.
#[derive(Debug)]
pub struct Decoder {
    buffer: [u8; FRAME_MAX],
    /// Bytes of the frame so far; above the buffer's length where it was too long.
    length: usize,
}

impl Decoder {
    /// A decoder at the beginning of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            buffer: [0; FRAME_MAX],
            length: 0,
        }
    }

    /// Accepts the next byte; at the end of a frame, returns the frame or its error.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<'_>, FrameError>> {
        if byte != DELIMITER {
            if let Some(place) = self.buffer.get_mut(self.length) {
                *place = byte;
            }
            // A length of one more than the buffer marks a frame that is too long, until the delimiter.
            self.length = (self.length + 1).min(FRAME_MAX);
            return None;
        }
        let length = core::mem::take(&mut self.length);
        (length > 0).then(|| self.frame(length))
    }

    /// Removes the stuffing of `length` bytes and checks the checksum.
    fn frame(&mut self, length: usize) -> Result<Frame<'_>, FrameError> {
        // The last byte of the buffer is for the delimiter, which is not stored.
        if length >= FRAME_MAX {
            return Err(FrameError::TooLong);
        }
        let stuffed = self.buffer.get_mut(..length).ok_or(FrameError::TooLong)?;
        let length = cobs::decode_in_place(stuffed).map_err(|_| FrameError::Stuffing)?;
        let plain = self.buffer.get(..length).ok_or(FrameError::Stuffing)?;
        let (payload, crc) = plain
            .split_last_chunk::<CRC_BYTES>()
            .ok_or(FrameError::TooShort)?;
        let crc = u32::from_le_bytes(*crc);
        if crc == CRC.checksum(payload) {
            Ok(Frame { payload, crc })
        } else {
            Err(FrameError::Checksum)
        }
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Clock, SAMPLES_MAX, SampleRecord, Words};
    use interp_core::sample::{Sample, SpanParameter, State};

    fn decode<'a>(decoder: &'a mut Decoder, bytes: &[u8]) -> Option<Result<Frame<'a>, FrameError>> {
        let (last, before) = bytes.split_last()?;
        for byte in before {
            assert!(decoder.push(*byte).is_none());
        }
        decoder.push(*last)
    }

    #[test]
    fn the_checksum_is_the_catalogues() {
        assert_eq!(CRC.checksum(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn the_longest_messages_fit() {
        let place = SpanParameter {
            span: u16::MAX,
            fraction: u64::MAX,
        };
        let sample = Sample {
            tick: u32::MAX,
            state: State::Running,
            pass: u32::MAX,
            path: place,
            side: place,
            feed_mm_s: f32::MAX,
            cc_nm: [i32::MIN; 3],
            cl_nm: [i32::MIN; 3],
            inv_interval_sq: f32::MAX,
        };
        let samples = Reply::Samples {
            event: u32::MAX,
            samples: [SampleRecord(sample); SAMPLES_MAX].into_iter().collect(),
        };
        let mut buffer = [0; FRAME_MAX];
        let length = write_reply(&samples, &mut buffer).unwrap().len();
        assert!(
            length <= FRAME_MAX && length > FRAME_MAX - 8,
            "{length} of {FRAME_MAX}"
        );
        let words = Words::new(&[i32::MIN; 64]).unwrap();
        let chunk = Request::JobChunk {
            offset: u32::MAX,
            words,
        };
        assert!(write_request(u16::MAX, &chunk, &mut buffer).is_ok());
    }

    #[test]
    fn too_small_a_buffer_is_an_error() {
        for length in 0..9 {
            assert_eq!(
                write_request(1, &Request::Clock(Clock::Free), &mut [0; 9][..length]),
                Err(NoRoom),
                "{length}"
            );
        }
        assert!(write_request(1, &Request::Clock(Clock::Free), &mut [0; 9]).is_ok());
    }

    #[test]
    fn empty_frames_are_passed_over() {
        let mut decoder = Decoder::new();
        for _ in 0..3 {
            assert_eq!(decoder.push(DELIMITER), None);
        }
    }

    #[test]
    fn a_frame_of_the_longest_length_is_not_too_long() {
        let mut decoder = Decoder::new();
        let mut plain = [0x55; PAYLOAD_MAX + CRC_BYTES];
        let crc = CRC.checksum(&plain[..PAYLOAD_MAX]);
        plain[PAYLOAD_MAX..].copy_from_slice(&crc.to_le_bytes());
        let mut stuffed = [0; FRAME_MAX];
        let length = cobs::encode(&plain, &mut stuffed);
        assert_eq!(length, FRAME_MAX - 1);
        let frame = decode(&mut decoder, &stuffed).unwrap().unwrap();
        assert_eq!((frame.payload.len(), frame.crc), (PAYLOAD_MAX, crc));
    }

    #[test]
    fn too_long_a_frame_is_one_error_and_the_next_is_read() {
        let mut decoder = Decoder::new();
        for surplus in [0, 1, 2, 300, 70_000] {
            for _ in 0..FRAME_MAX + surplus {
                assert_eq!(decoder.push(1), None);
            }
            assert_eq!(decoder.push(DELIMITER), Some(Err(FrameError::TooLong)));
            let mut buffer = [0; FRAME_MAX];
            let bytes = write_request(5, &Request::Start, &mut buffer).unwrap();
            assert_eq!(decode(&mut decoder, bytes).unwrap().unwrap().payload, [5, 4]);
        }
    }

    #[test]
    fn each_damage_has_its_name() {
        let mut decoder = Decoder::new();
        assert_eq!(
            decode(&mut decoder, &[3, 1, 1, 0]),
            Some(Err(FrameError::TooShort))
        );
        assert_eq!(
            decode(&mut decoder, &[9, 1, 1, 0]),
            Some(Err(FrameError::Stuffing))
        );
        assert_eq!(
            decode(&mut decoder, &[6, 1, 1, 1, 1, 1, 0]),
            Some(Err(FrameError::Checksum))
        );
    }
}
