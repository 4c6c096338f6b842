//! The serial line: whatever comes, the board neither panics nor answers what the host cannot read, and understands the next sound frame.

use ::protocol::frame::{Decoder, FRAME_MAX, PAYLOAD_MAX, write_reply, write_request};
use ::protocol::message::{Reply, Request};
use controller::in_process::Board;
use crc::{CRC_32_ISO_HDLC, Crc};

static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Words of the board's store: few, so that a board is made at once.
const STORE_WORDS: usize = 256;
/// Ticks after each piece of input.
const TICKS: usize = 3;

/// A payload as a sound frame.
fn framed(payload: &[u8]) -> Vec<u8> {
    let mut plain = payload.to_vec();
    plain.extend(CRC.checksum(payload).to_le_bytes());
    let mut frame = vec![0; cobs::max_encoding_length(plain.len())];
    let length = cobs::encode(&plain, &mut frame);
    frame.truncate(length);
    frame.push(0);
    frame
}

/// What was read is written and read again the same.
fn round_trip(payload: &[u8]) {
    let mut buffer = [0; FRAME_MAX];
    if let Ok((number, request)) = ::protocol::message::read_request(payload) {
        let bytes =
            write_request(number, &request, &mut buffer).expect("a request that was read fits into a frame");
        let mut decoder = Decoder::new();
        let read = bytes.iter().find_map(|byte| match decoder.push(*byte)? {
            Ok(frame) => {
                Some(::protocol::message::read_request(frame.payload).expect("a frame that was written"))
            }
            Err(error) => panic!("a frame that was written: {error:?}"),
        });
        // Not a number differs from itself, so the texts are compared.
        assert_eq!(format!("{read:?}"), format!("{:?}", Some((number, request))));
    }
    if let Ok(reply) = ::protocol::message::read_reply(payload) {
        let mut buffer = [0; FRAME_MAX];
        write_reply(&reply, &mut buffer).expect("a reply that was read fits into a frame");
    }
}

/// All frames in a board's answer, which the host has to understand.
fn replies(bytes: &[u8]) -> Vec<Reply> {
    let mut decoder = Decoder::new();
    let mut replies = Vec::new();
    for byte in bytes {
        if let Some(frame) = decoder.push(*byte) {
            let frame = frame.expect("the board sends sound frames");
            replies.push(
                ::protocol::message::read_reply(frame.payload).expect("the host reads what the board sends"),
            );
        }
    }
    replies
}

/// Bytes as they come over the line: the first byte says whether the rest are bytes, or payloads that are framed, each after its length.
///
/// # Panics
/// A promise is broken.
pub fn protocol(data: &[u8]) {
    let Some((kind, mut rest)) = data.split_first() else {
        return;
    };
    let mut board: Board<STORE_WORDS> = Board::new();
    let mut feed = |bytes: &[u8]| {
        board.receive(bytes);
        (0..TICKS).for_each(|_| board.tick());
        replies(&board.take_sent());
    };
    if kind % 2 == 0 {
        round_trip(rest);
        feed(rest);
    } else {
        while let Some((length, more)) = rest.split_first() {
            let (payload, after) = more.split_at(usize::from(*length).min(more.len()).min(PAYLOAD_MAX));
            round_trip(payload);
            feed(&framed(payload));
            rest = after;
        }
    }
    // The end of whatever frame is open, then a greeting.
    let mut buffer = [0; FRAME_MAX];
    let hello = Request::Hello {
        version: ::protocol::PROTOCOL_VERSION,
        session: 7,
    };
    let hello = write_request(1, &hello, &mut buffer).expect("a greeting fits");
    board.receive(&[&[0], hello].concat());
    assert!(!replies(&board.take_sent()).is_empty(), "a greeting is answered");
}
