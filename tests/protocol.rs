//! The messages and their frames: every message encoded and decoded, golden bytes that detect a change of the format, and
//! damaged frames.

mod any_message;
mod damaged_frames;
mod examples;

use std::fmt::Write as _;

use integration_tests::frame;
use proptest::prelude::*;
use protocol::{
    frame::{Decoder, FRAME_MAX, write_reply},
    message::{Reply, read_reply, read_request},
};

use any_message::{any_reply, any_request};
use examples::{reasons, replies, requests};

fn reply_frame(reply: &Reply) -> Vec<u8> {
    write_reply(reply, &mut [0; FRAME_MAX]).unwrap().to_vec()
}

/// The payload of the single frame in these bytes.
fn payload(bytes: &[u8]) -> Vec<u8> {
    let mut decoder = Decoder::new();
    let mut found = Vec::new();
    for byte in bytes {
        if let Some(frame) = decoder.push(*byte) {
            found.push(frame.unwrap().payload.to_vec());
        }
    }
    assert_eq!(found.len(), 1);
    found.remove(0)
}

#[test]
fn the_bytes_are_those_in_the_golden_file() {
    let mut text = String::from(
        "One example of each message: what it is, its payload, its frame (hexadecimal). BLESS=1 writes this file anew;\n\
         a change of it is a change of the protocol's version.\n",
    );
    let mut add = |name: String, frame: Vec<u8>| {
        let hex = |bytes: &[u8]| {
            bytes
                .iter()
                .map(|byte| format!(" {byte:02x}"))
                .collect::<String>()
        };
        writeln!(
            text,
            "\n{name}\n payload{}\n frame  {}",
            hex(&payload(&frame)),
            hex(&frame)
        )
        .unwrap();
    };
    for (number, request) in (1..).zip(requests()) {
        add(
            format!("host, number {number}: {request:?}"),
            frame(number, &request),
        );
    }
    for reply in replies() {
        add(format!("board: {reply:?}"), reply_frame(&reply));
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/golden/protocol.txt");
    if std::env::var_os("BLESS").is_some_and(|value| value == "1") {
        std::fs::write(path, &text).unwrap();
    }
    let golden = std::fs::read_to_string(path).unwrap();
    assert!(
        golden == text,
        "the protocol's bytes differ from {path}; see `BLESS=1` there. Now:\n{text}"
    );
}

#[test]
fn the_examples_go_there_and_back() {
    for (number, request) in (1..).zip(requests()) {
        assert_eq!(
            read_request(&payload(&frame(number, &request))),
            Ok((number, request))
        );
    }
    for reply in replies() {
        assert_eq!(read_reply(&payload(&reply_frame(&reply))), Ok(reply));
    }
}

#[test]
fn every_reason_is_a_sentence_with_its_values() {
    let texts: Vec<_> = reasons().iter().map(ToString::to_string).collect();
    assert_eq!(
        texts[3],
        "the host speaks protocol version 2, the board version 1"
    );
    assert_eq!(
        texts[8],
        "the board refuses the job: bad-patch (code 9), value 1.5, record 7"
    );
    assert_eq!(texts[12], "128 of 300 words arrived");
    assert_eq!(
        texts[14],
        "not safe: limit-switch (code 17), limit switch x-, limit switch y-"
    );
    assert_eq!(texts[16], "201 is more than 200");
    assert_eq!(
        texts[21],
        "beyond the machine's profile: jerk, mm/s^3: 10001 on z, the profile has 10000"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn every_request_goes_there_and_back(number: u16, request in any_request()) {
        prop_assert_eq!(read_request(&payload(&frame(number, &request))), Ok((number, request)));
    }

    #[test]
    fn every_reply_goes_there_and_back(reply in any_reply()) {
        prop_assert_eq!(read_reply(&payload(&reply_frame(&reply))), Ok(reply));
    }

    #[test]
    fn any_bytes_are_read_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = read_request(&bytes);
        let _ = read_reply(&bytes);
        let mut decoder = Decoder::new();
        for byte in bytes {
            if let Some(Ok(frame)) = decoder.push(byte) {
                let _ = read_request(frame.payload);
            }
        }
    }

    /// A payload of random bytes is either an error or a request that encodes and decodes to the same request.
    #[test]
    fn a_payload_with_any_bytes_is_a_message_or_none(bytes in prop::collection::vec(any::<u8>(), 0..60), code in 0_u8..24) {
        let mut bytes = bytes;
        bytes.splice(0..0, [2, code]);
        if let Ok((number, request)) = read_request(&bytes) {
            let again = payload(&frame(number, &request));
            let (number_again, request_again) = read_request(&again).unwrap();
            prop_assert_eq!(number, number_again);
            prop_assert_eq!(format!("{request:?}"), format!("{request_again:?}"));
        }
    }
}
