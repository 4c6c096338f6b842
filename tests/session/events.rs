//! Events have numbers, and are sent again while the board keeps them.

use protocol::{
    PROTOCOL_VERSION,
    message::{PassDigest, Reason, Reply, Request},
};

use super::Line;

/// Events are numbered from 1 in each session and sent again byte for byte, as long as they are kept.
#[test]
fn an_event_again_is_the_same_event() {
    let mut line = Line::open();
    let mut sent = Vec::new();
    let pass = |line: &mut Line, pass| {
        let pass = PassDigest {
            pass,
            ..PassDigest::default()
        };
        let mut bytes = Vec::new();
        line.link.pass(&pass, &mut |frame| bytes.extend_from_slice(frame));
        bytes
    };
    for number in 0..300 {
        sent.push(pass(&mut line, number));
    }
    let Reply::PassDigest { event: 300, .. } = line.host.read(&sent[299])[..][0] else {
        panic!("not numbered from 1")
    };
    let Reply::Status { status, .. } = line.ask(&Request::Status) else {
        panic!("no status")
    };
    assert_eq!(status.events, 300);
    let Reason::EventGone { first } = line.refused(&Request::Repeat { event: 1, count: 1 }) else {
        panic!("not gone")
    };
    // About a hundred passes are kept.
    assert!((150..250).contains(&first), "{first}");
    assert_eq!(
        line.refused(&Request::Repeat { event: 301, count: 1 }),
        Reason::EventGone { first }
    );
    for event in [first, 299] {
        let request = line.host.next(&Request::Repeat { event, count: 2 });
        let again = line.give(&request);
        let index = event as usize - 1;
        assert!(again.starts_with(&sent[index..index + 2].concat()), "{event}");
        let ack = Reply::Ack {
            number: line.host.number,
        };
        assert_eq!(line.host.read(&again).last(), Some(&ack));
        // The same request again is only acknowledged again.
        let again = line.give(&request);
        assert_eq!(line.host.read(&again), [ack]);
    }
    let other = Request::Hello {
        version: PROTOCOL_VERSION,
        session: 2,
    };
    assert!(matches!(line.ask(&other), Reply::Capabilities(_)));
    assert_eq!(
        line.refused(&Request::Repeat {
            event: first,
            count: 1
        }),
        Reason::EventGone { first: 1 }
    );
    let first = pass(&mut line, 0);
    assert!(matches!(
        line.host.read(&first)[..],
        [Reply::PassDigest { event: 1, .. }]
    ));
}
