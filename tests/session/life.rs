//! Which bytes the board takes for a sign of life of the host.

use integration_tests::frame;
use interp_core::sample::State;
use protocol::{
    PROTOCOL_VERSION,
    frame::{FRAME_MAX, write_reply},
    message::{Reply, Request},
};

use super::{Line, unreadable};

/// A host is alive by the requests that are answered, executed or refused; noise, damaged and foreign frames are no host.
#[test]
fn only_a_request_is_a_sign_of_life() {
    let mut line = Line::open().in_state(State::Running);
    assert_eq!(line.mock.heard, 1);
    let mut damaged = frame(2, &Request::Status);
    damaged[3] ^= 0x10;
    // The board's own answer, as by a bridge between its two lines.
    let echo = write_reply(&Reply::Ack { number: 4 }, &mut [0; FRAME_MAX])
        .unwrap()
        .to_vec();
    for bytes in [
        vec![0x55; 700],
        vec![0; 50],
        damaged,
        unreadable(),
        frame(3, &Request::Status),
        frame(0, &Request::Status),
        echo,
        b"hold\n\0resume\n\0".to_vec(),
    ] {
        line.give(&bytes);
        line.give(&[0]);
        assert_eq!(line.mock.heard, 1, "{bytes:?}");
    }
    let request = frame(2, &Request::Status);
    line.give(&request);
    line.give(&request);
    assert_eq!(line.mock.heard, 3);
    // Refused because the run is under way.
    line.give(&frame(3, &Request::Start));
    assert_eq!(line.mock.heard, 4);

    // Requests of a host of another version, or without a session, are no signs of life either.
    let mut line = Line::default();
    line.give(&frame(1, &Request::Status));
    let other = Request::Hello {
        version: PROTOCOL_VERSION + 1,
        session: 1,
    };
    line.give(&frame(1, &other));
    line.give(&frame(2, &Request::Status));
    assert_eq!(line.mock.heard, 0);
}
