//! Damaged frames: truncated, with a flipped bit, too long, noise. Each is refused and changes nothing.

use controller::link::Link;
use integration_tests::{HELLO, Mock, frame, is_bad_frame};
use interp_core::steps::StepConfig;
use protocol::{
    frame::FRAME_MAX,
    message::{Reply, Request, Status, StepSettings},
};

use super::examples::requests;

/// A link in session that expects request 2, and its machine.
fn open_link() -> (Link, Mock) {
    let (mut link, mut mock) = (Link::new(), Mock::default());
    give(&mut link, &mut mock, &frame(1, &HELLO));
    (link, mock)
}

fn give(link: &mut Link, mock: &mut Mock, bytes: &[u8]) -> Vec<Reply> {
    let mut sent = Vec::new();
    for byte in bytes {
        link.receive(*byte, mock, &mut |bytes| sent.extend_from_slice(bytes));
    }
    integration_tests::Host::default().read(&sent)
}

/// A damaged frame is answered with an error, has no effect, and does not affect the request after it.
fn check_damage(damaged: &[u8], what: &str) {
    let (mut link, mut mock) = open_link();
    let replies = give(&mut link, &mut mock, damaged);
    assert!(
        !replies.is_empty() && replies.iter().all(is_bad_frame),
        "{what}: {replies:?}"
    );
    assert_eq!(
        mock,
        Mock {
            heard: 1,
            ..Mock::default()
        },
        "{what}"
    );
    let [Reply::Status { number: 2, status }] = give(&mut link, &mut mock, &frame(2, &Request::Status))[..]
    else {
        panic!("{what}: no status");
    };
    let bad = u32::try_from(replies.len()).unwrap();
    assert_eq!(
        status,
        Status {
            frames_bad: bad,
            steps: StepSettings::from(StepConfig::DEFAULT).digest(),
            ..Status::default()
        },
        "{what}"
    );
}

#[test]
fn a_truncated_frame_is_refused_and_changes_nothing() {
    for request in requests() {
        let whole = frame(2, &request);
        for length in 1..whole.len() - 1 {
            let mut part = whole[..length].to_vec();
            part.push(0);
            check_damage(&part, &format!("{length} bytes of {request:?}"));
        }
    }
}

#[test]
fn a_flipped_bit_is_refused_and_changes_nothing() {
    for request in requests() {
        let whole = frame(2, &request);
        for bit in 0..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            flipped.push(0);
            check_damage(&flipped, &format!("bit {bit} of {request:?}"));
        }
    }
}

#[test]
fn too_long_a_frame_is_refused_once() {
    for length in [FRAME_MAX, FRAME_MAX + 1, 2 * FRAME_MAX, 100_000] {
        let mut long = vec![1; length];
        long.push(0);
        check_damage(&long, &format!("{length} bytes"));
    }
}

#[test]
fn noise_before_the_first_frame_does_not_touch_it() {
    let (mut link, mut mock) = (Link::new(), Mock::default());
    let replies = give(&mut link, &mut mock, &[0xff, 0x00, 0x13, 0x37, 0x00]);
    assert!(replies.len() == 2 && replies.iter().all(is_bad_frame));
    let replies = give(&mut link, &mut mock, &frame(1, &HELLO));
    assert!(matches!(replies[..], [Reply::Capabilities(_)]));
}
