//! A session between host and board, step by step, with a machine that records its calls: each invalid frame or request
//! has a defined answer and no effect.

mod events;
mod life;
mod safety;

use controller::{link::Link, machine::Instruction};
use integration_tests::{Call, HELLO, Host, MAKE_READY, Mock, SAFE, frame, upload};
use interp_core::{job::Header, sample::State, steps::StepConfig};
use protocol::{
    PROTOCOL_VERSION,
    digest::job_digest,
    message::{Clock, Configuration, FaultReport, InputLines, Reason, Reply, Report, Request, Status, Words},
};

/// Both ends of a line, with a mock machine.
#[derive(Default)]
struct Line {
    host: Host,
    link: Link,
    mock: Mock,
}

impl Line {
    /// An open session.
    fn open() -> Self {
        let mut line = Self::default();
        line.mock.status.safety = SAFE;
        assert!(matches!(line.ask(&HELLO), Reply::Capabilities(_)));
        line
    }

    /// The board's answer to these bytes.
    fn give(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut sent = Vec::new();
        for byte in bytes {
            self.link
                .receive(*byte, &mut self.mock, &mut |bytes| sent.extend_from_slice(bytes));
        }
        sent
    }

    /// The single answer to a frame.
    fn answer(&mut self, frame: &[u8]) -> Reply {
        let sent = self.give(frame);
        let mut replies = self.host.read(&sent);
        assert_eq!(replies.len(), 1);
        replies.remove(0)
    }

    /// The answer to the next request.
    fn ask(&mut self, request: &Request) -> Reply {
        let frame = self.host.next(request);
        self.answer(&frame)
    }

    /// The reason why the next request is refused. The request must not reach the machine, but it is a sign of life if the number is used up.
    fn refused(&mut self, request: &Request) -> Reason {
        let before = self.mock.clone();
        let answer = self.ask(request);
        let heard =
            before.heard + u32::from(matches!(answer, Reply::Nak { reason, .. } if reason.uses_number()));
        assert_eq!(self.mock, Mock { heard, ..before });
        let Reply::Nak { number, reason } = answer else {
            panic!("{request:?}: {answer:?}")
        };
        assert_eq!(number, self.host.number);
        reason
    }

    fn accepted(&mut self, request: &Request) {
        let answer = self.ask(request);
        assert_eq!(
            answer,
            Reply::Ack {
                number: self.host.number
            },
            "{request:?}"
        );
    }

    fn in_state(mut self, state: State) -> Self {
        self.mock.status.state = state;
        self
    }
}

fn chunk(offset: u32, words: &[i32]) -> Request {
    Request::JobChunk {
        offset,
        words: Words::new(words).unwrap(),
    }
}

fn begin(words: &[i32]) -> Request {
    let count = u32::try_from(words.len()).unwrap();
    Request::JobBegin {
        header: Header::default(),
        words: count,
        digest: job_digest(words),
    }
}

/// One request of each kind except `Hello`.
fn others() -> Vec<Request> {
    let mut requests = upload(Header::default(), &[1; 30]);
    requests.extend([
        Request::Start,
        Request::Hold,
        Request::Resume,
        Request::Abort,
        Request::Status,
    ]);
    requests.extend([
        Request::Clock(Clock::Free),
        Request::Run { ticks: 1 },
        Request::Report(Report::Samples),
        Request::Configure(Configuration::DEFAULT),
        Request::Acknowledge,
        Request::Override { percent: 50 },
        Request::Stop,
        Request::Simulate {
            lines: InputLines::NONE,
        },
        Request::Repeat { event: 1, count: 1 },
    ]);
    requests.extend(MAKE_READY);
    requests
}

#[test]
fn nothing_is_done_before_hello() {
    for request in others() {
        assert_eq!(Line::default().refused(&request), Reason::SayHello);
    }
}

#[test]
fn another_version_is_told_both() {
    let mut line = Line::default();
    let Reply::Capabilities(capabilities) = line.ask(&Request::Hello {
        version: PROTOCOL_VERSION + 1,
        session: 1,
    }) else {
        panic!("no capabilities");
    };
    assert_eq!(
        (capabilities.version, capabilities.session),
        (PROTOCOL_VERSION, 1)
    );
    for request in others() {
        assert_eq!(
            line.refused(&request),
            Reason::Version {
                host: PROTOCOL_VERSION + 1,
                board: PROTOCOL_VERSION
            }
        );
    }
    assert!(!line.link.is_open());
}

#[test]
fn a_request_again_is_answered_again_and_done_once() {
    let mut line = Line::open().in_state(State::Ready);
    for request in others() {
        let frame = line.host.next(&request);
        let first = line.give(&frame);
        let (machine, again) = (line.mock.clone(), line.give(&frame));
        assert_eq!(first, again, "{request:?}");
        let heard = machine.heard + 1;
        assert_eq!(line.mock, Mock { heard, ..machine }, "{request:?}");
        line.host.read(&first);
    }
}

#[test]
fn a_status_again_is_the_old_one() {
    let mut line = Line::open();
    let frame = line.host.next(&Request::Status);
    let first = line.give(&frame);
    line.mock.status.tick = 99;
    assert_eq!(line.give(&frame), first);
    assert!(matches!(
        line.ask(&Request::Status),
        Reply::Status {
            status: Status { tick: 99, .. },
            ..
        }
    ));
}

#[test]
fn a_frame_out_of_order_is_told_the_number_expected() {
    let mut line = Line::open().in_state(State::Ready);
    line.accepted(&Request::Report(Report::Samples));
    let before = line.mock.clone();
    // An earlier number, the number after the next, the last number with another request, the reserved 0, the maximum.
    for number in [1, 4, 2, 0, u16::MAX] {
        let answer = line.answer(&frame(number, &Request::Start));
        assert_eq!(
            answer,
            Reply::Nak {
                number,
                reason: Reason::OutOfOrder { expected: 3 }
            }
        );
        assert_eq!(line.mock, before);
    }
    line.accepted(&Request::Start);
}

#[test]
fn numbers_go_round() {
    let mut line = Line::default();
    line.host.number = u16::MAX - 2;
    assert!(matches!(line.ask(&HELLO), Reply::Capabilities(_)));
    line.accepted(&Request::Report(Report::Samples));
    assert_eq!(line.host.number, u16::MAX);
    line.accepted(&Request::Report(Report::Samples));
    assert_eq!(line.host.number, 1);
}

#[test]
fn hello_again_changes_nothing_and_a_new_session_restarts_the_numbers() {
    let words = [7; 30];
    let mut line = Line::open();
    let hello = frame(1, &HELLO);
    let [begin, first, second, end] = &upload(Header::default(), &words)[..] else {
        panic!("chunks")
    };
    line.accepted(begin);
    line.accepted(first);
    assert!(matches!(line.answer(&hello), Reply::Capabilities(_)));
    line.accepted(second);
    line.accepted(end);

    line.accepted(begin);
    line.host = Host::default();
    let other = Request::Hello {
        version: PROTOCOL_VERSION,
        session: 2,
    };
    assert!(matches!(line.ask(&other), Reply::Capabilities(_)));
    assert_eq!(line.host.number, 1);
    assert_eq!(line.refused(first), Reason::NoUpload);
}

/// The frame of a `Start` with the number 2 and an additional field. No byte of it is 0, so it is one block of COBS.
fn unreadable() -> Vec<u8> {
    let mut payload = vec![2, 4, 1];
    payload.extend(crc(&payload));
    let mut bytes = vec![u8::try_from(payload.len() + 1).unwrap()];
    bytes.extend(&payload);
    bytes.push(0);
    bytes
}

#[test]
fn an_unreadable_request_uses_no_number() {
    let mut line = Line::open();
    assert_eq!(
        line.answer(&unreadable()),
        Reply::Nak {
            number: 2,
            reason: Reason::Unreadable
        }
    );
    line.accepted(&Request::Report(Report::Digests));
}

/// CRC-32/ISO-HDLC by its bitwise definition.
fn crc(bytes: &[u8]) -> [u8; 4] {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
        }
    }
    (!crc).to_le_bytes()
}

#[test]
fn a_job_arrives_word_for_word_and_is_checked() {
    let words: Vec<i32> = (-15..15).collect();
    let mut line = Line::open();
    line.mock.records = 2;
    for request in upload(Header::default(), &words) {
        line.accepted(&request);
    }
    let calls = [
        Call::Begin(30),
        Call::Steps(StepConfig::DEFAULT.check().unwrap()),
        Call::Words(0, words[..20].to_vec()),
        Call::Words(20, words[20..].to_vec()),
        Call::Check(0),
        Call::Check(1),
        Call::Finish,
    ];
    assert_eq!(line.mock.calls, calls);
}

#[test]
fn no_job_is_exchanged_under_a_run() {
    for state in [State::Running, State::Holding, State::Held, State::Stopping] {
        let mut line = Line::open().in_state(state);
        assert_eq!(line.refused(&begin(&[1, 2])), Reason::WrongState { state });
        assert_eq!(line.refused(&chunk(0, &[1])), Reason::NoUpload);
        assert_eq!(line.refused(&Request::JobEnd), Reason::NoUpload);
    }
}

#[test]
fn a_missing_chunk_is_asked_for() {
    let words = [3; 50];
    let mut line = Line::open();
    line.accepted(&begin(&words));
    line.accepted(&chunk(0, &words[..20]));
    assert_eq!(
        line.refused(&chunk(30, &words[30..])),
        Reason::WrongOffset { expected: 20 }
    );
    assert_eq!(
        line.refused(&chunk(0, &words[..20])),
        Reason::WrongOffset { expected: 20 }
    );
    assert_eq!(
        line.refused(&Request::JobEnd),
        Reason::Incomplete {
            wanted: 50,
            received: 20
        }
    );
    line.accepted(&chunk(20, &words[20..]));
    line.accepted(&Request::JobEnd);
}

#[test]
fn too_many_words_are_refused() {
    let mut line = Line::open();
    let header = Header::default();
    let too_long = Request::JobBegin {
        header,
        words: 1001,
        digest: 0,
    };
    assert_eq!(
        line.refused(&too_long),
        Reason::TooLong {
            limit: 1000,
            wanted: 1001
        }
    );
    line.accepted(&begin(&[1, 2, 3]));
    assert_eq!(
        line.refused(&chunk(0, &[1, 2, 3, 4])),
        Reason::TooLong { limit: 3, wanted: 4 }
    );
    line.accepted(&chunk(0, &[1, 2, 3]));
    assert_eq!(
        line.refused(&chunk(3, &[4])),
        Reason::TooLong { limit: 3, wanted: 4 }
    );
    line.accepted(&Request::JobEnd);
}

#[test]
fn other_words_than_announced_are_refused_and_the_upload_is_over() {
    let mut line = Line::open();
    line.accepted(&begin(&[1, 2, 3]));
    line.accepted(&chunk(0, &[1, 2, 4]));
    let reason = Reason::WrongDigest {
        wanted: job_digest(&[1, 2, 3]),
        received: job_digest(&[1, 2, 4]),
    };
    assert_eq!(line.refused(&Request::JobEnd), reason);
    assert_eq!(line.refused(&Request::JobEnd), Reason::NoUpload);
}

#[test]
fn a_bad_record_is_named_and_the_upload_is_over() {
    let mut line = Line::open();
    (line.mock.records, line.mock.bad) = (5, Some(3));
    line.accepted(&begin(&[1]));
    line.accepted(&chunk(0, &[1]));
    let reason = Reason::Job {
        fault: FaultReport { code: 9, value: 0.5 },
        record: Some(3),
    };
    assert_eq!(
        line.ask(&Request::JobEnd),
        Reply::Nak {
            number: line.host.number,
            reason
        }
    );
    assert_eq!(line.mock.calls.last(), Some(&Call::Check(3)));
    assert_eq!(line.refused(&Request::JobEnd), Reason::NoUpload);
}

#[test]
fn commands_go_where_the_state_allows_them() {
    use interp_core::Command as Wish;
    let table = [
        (Request::Start, Wish::Start, &[State::Ready, State::Finished][..]),
        (Request::Hold, Wish::Hold, &[State::Running, State::Linking]),
        (Request::Resume, Wish::Resume, &[State::Held, State::Holding]),
        (
            Request::Abort,
            Wish::Abort,
            &[
                State::Running,
                State::Linking,
                State::Holding,
                State::Held,
                State::Faulted,
            ],
        ),
        (
            Request::Stop,
            Wish::Stop,
            &[State::Running, State::Linking, State::Holding, State::Held],
        ),
    ];
    for (request, wish, allowed) in table {
        for state in State::ALL {
            let mut line = Line::open().in_state(state);
            if allowed.contains(&state) {
                line.accepted(&request);
                assert_eq!(line.mock.calls, [Call::Send(Instruction::Command(wish))]);
            } else {
                assert_eq!(
                    line.refused(&request),
                    Reason::WrongState { state },
                    "{request:?}"
                );
            }
        }
    }
}

#[test]
fn a_full_queue_is_said_and_does_not_stick() {
    let mut line = Line::open().in_state(State::Ready);
    line.mock.busy = true;
    assert_eq!(line.refused(&Request::Start), Reason::Busy);
    assert_eq!(line.refused(&Request::Clock(Clock::Lockstep)), Reason::Busy);
    line.mock.busy = false;
    // The refused change of the clock has no effect.
    assert_eq!(
        line.refused(&Request::Run { ticks: 1 }),
        Reason::WrongClock { clock: Clock::Free }
    );
    line.accepted(&Request::Start);
}

#[test]
fn time_is_given_in_lockstep_only_and_the_clock_set_at_rest_only() {
    let mut line = Line::open();
    assert_eq!(
        line.refused(&Request::Run { ticks: 5 }),
        Reason::WrongClock { clock: Clock::Free }
    );
    line.accepted(&Request::Clock(Clock::Lockstep));
    line.accepted(&Request::Run { ticks: 5 });
    let calls = [Instruction::Clock(Clock::Lockstep), Instruction::Run { ticks: 5 }].map(Call::Send);
    assert_eq!(line.mock.calls, calls);
    let mut line = line.in_state(State::Held);
    assert_eq!(
        line.refused(&Request::Clock(Clock::Free)),
        Reason::WrongState { state: State::Held }
    );
}
