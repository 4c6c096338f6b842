use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::{Arc, Mutex};

use interp_core::State;
use protocol::frame::{FRAME_MAX, write_reply};
use protocol::message::{Activity, Clock, Description, MotionStatus, Reason, Status, read_request};

use super::waiting::SILENCE_TIMEOUT;
use super::*;
use crate::remote::operate::{self, Operator};

/// A board that answers requests, in a state that the test sets.
#[derive(Default)]
struct Fake {
    decoder: Option<Decoder>,
    ready: VecDeque<u8>,
    state: State,
    activity: Activity,
    /// Number of the last request that was carried out.
    number: u16,
    /// Its payload, and its answer.
    payload: Vec<u8>,
    answer: Vec<u8>,
}

impl Fake {
    fn receive(&mut self, byte: u8) {
        let decoder = self.decoder.get_or_insert_with(Decoder::new);
        let (number, request, payload) = match decoder.push(byte) {
            None => return,
            Some(Ok(frame)) => match read_request(frame.payload) {
                Ok((number, request)) => (number, request, frame.payload.to_vec()),
                Err(_) => return,
            },
            Some(Err(_)) => {
                let reason = Reason::BadFrame {
                    error: protocol::frame::FrameError::Checksum,
                };
                return self.send(&Reply::Nak { number: 0, reason });
            }
        };
        if payload == self.payload {
            let answer = self.answer.clone();
            return self.ready.extend(answer);
        }
        let expected = protocol::message::next_number(self.number);
        if self.number != 0 && number != expected {
            let reason = Reason::OutOfOrder { expected };
            return self.send(&Reply::Nak { number, reason });
        }
        (self.number, self.payload) = (number, payload);
        let reply = match request {
            Request::Hello { session, .. } => Reply::Capabilities(Capabilities {
                number,
                session,
                version: PROTOCOL_VERSION,
                description: Description {
                    period_us: 1000,
                    ..Description::default()
                },
            }),
            Request::Status => Reply::Status {
                number,
                status: Status {
                    state: self.state,
                    clock: Clock::Free,
                    ..Status::default()
                },
            },
            Request::Motion => Reply::Motion {
                number,
                motion: MotionStatus {
                    activity: self.activity,
                    ..MotionStatus::default()
                },
            },
            _ => Reply::Ack { number },
        };
        let from = self.ready.len();
        self.send(&reply);
        self.answer = self.ready.iter().skip(from).copied().collect();
    }

    fn send(&mut self, reply: &Reply) {
        self.ready
            .extend(write_reply(reply, &mut [0; FRAME_MAX]).unwrap().iter());
    }
}

struct Wire(Arc<Mutex<Fake>>);

impl Stream for Wire {}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let mut fake = self.0.lock().unwrap();
        if fake.ready.is_empty() {
            drop(fake);
            std::thread::sleep(Duration::from_millis(1));
            return Err(io::ErrorKind::WouldBlock.into());
        }
        fake.ready.read(bytes)
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut fake = self.0.lock().unwrap();
        bytes.iter().for_each(|byte| fake.receive(*byte));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn open(state: State, activity: Activity) -> (Session, Arc<Mutex<Fake>>) {
    let fake = Arc::new(Mutex::new(Fake {
        state,
        activity,
        ..Fake::default()
    }));
    let session = Session::open(Box::new(Wire(fake.clone())), 1).unwrap();
    (session, fake)
}

/// Nobody who could resume a run.
#[derive(Default)]
struct Nobody {
    begun: u32,
}

impl Operator for Nobody {
    fn wish(&mut self) -> Option<Request> {
        None
    }

    fn is_there(&self) -> bool {
        false
    }

    fn begins(&mut self, _: &Status) {
        self.begun += 1;
    }

    fn replied(&mut self, _: &Request, _: Result<Status, RemoteError>) {}
}

/// The board in a state for some time, then held.
fn follow(state: State, activity: Activity) -> (Result<Status, RemoteError>, u32, Duration) {
    let (mut session, fake) = open(state, activity);
    session.set_keep_alive(Some(Duration::from_millis(1)));
    let mut nobody = Nobody::default();
    let begin = Instant::now();
    let ends = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(2_500));
        let mut fake = fake.lock().unwrap();
        (fake.state, fake.activity) = (State::Held, Activity::Rest);
    });
    let ended = operate::follow(&mut session, &mut nobody, |_| {});
    let took = begin.elapsed();
    ends.join().unwrap();
    (ended, nobody.begun, took)
}

/// A start that waits for the spindle is followed, and a resume that waits for it is no run that stands still.
#[test]
fn a_run_that_waits_for_its_spindle_is_under_way() {
    for state in [State::Ready, State::Held] {
        let (ended, begun, took) = follow(state, Activity::SpinUp);
        assert!(matches!(ended, Err(RemoteError::Held)), "{ended:?}");
        assert!(begun == 1 && took > Duration::from_secs(2), "{begun}, {took:?}");
    }
    let (ended, begun, _) = follow(State::Ready, Activity::Rest);
    assert_eq!((ended.unwrap().state, begun), (State::Ready, 0));
}

/// However long the spindle takes, a board that answers is not silent.
#[test]
fn a_start_that_waits_longer_than_the_silence_of_a_run_is_waited_for() {
    for (activity, is_silent) in [(Activity::SpinUp, false), (Activity::Rest, true)] {
        let (mut session, _fake) = open(State::Ready, activity);
        session.set_keep_alive(Some(Duration::from_millis(20)));
        let almost = SILENCE_TIMEOUT.saturating_sub(Duration::from_millis(150));
        session.heard = Instant::now().checked_sub(almost).unwrap();
        let until = Instant::now() + Duration::from_millis(300);
        let mut is_heard = Ok(());
        while is_heard.is_ok() && Instant::now() < until {
            is_heard = session.poll().map(drop);
        }
        assert_eq!(is_heard.is_err(), is_silent, "{is_heard:?}");
    }
}
