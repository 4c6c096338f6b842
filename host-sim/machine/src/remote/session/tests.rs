use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::sync::{Arc, Mutex};

use interp_core::State;
use protocol::frame::{FRAME_MAX, write_reply};
use protocol::message::{Activity, Clock, Description, JogWay, MotionStatus, Reason, Status, read_request};

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
    /// Bytes that are lost on their way to the board.
    loses: usize,
    /// Number of the last request that was carried out.
    number: u16,
    /// Its payload, and its answer.
    payload: Vec<u8>,
    answer: Vec<u8>,
    /// Jogs that were begun.
    jogs: u32,
}

impl Fake {
    fn receive(&mut self, byte: u8) {
        if self.loses > 0 {
            self.loses -= 1;
            return;
        }
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
            Request::Jog { .. } => {
                self.jogs += 1;
                Reply::Ack { number }
            }
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

/// Outside a run a request that was lost is repeated well within the second after which the board ends a motion or switches a spindle off.
#[test]
fn a_request_that_was_lost_is_repeated_before_the_host_counts_as_gone() {
    let (mut session, fake) = open(State::Ready, Activity::Rest);
    fake.lock().unwrap().loses = usize::MAX;
    let loser = fake.clone();
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        loser.lock().unwrap().loses = 0;
    });
    let begin = Instant::now();
    session.command(&Request::Home { axes: 0 }).unwrap();
    let took = begin.elapsed();
    assert!(took < Duration::from_millis(600), "{took:?}");
}

/// A jog for as long as a key is held is given up where it gets lost, whole or in part: it does not begin when the key was released long ago. The session goes on.
#[test]
fn a_jog_by_key_that_was_lost_is_given_up() {
    let jog = Request::Jog {
        way: JogWay::Towards { signs: [1, 0, 0] },
        speed_mm_s: 1.0,
    };
    let length = protocol::frame::write_request(2, &jog, &mut [0; FRAME_MAX])
        .unwrap()
        .len();
    for lost_from in [0, length - 1] {
        let (mut session, fake) = open(State::Ready, Activity::Rest);
        // The line is dead from this byte on, for longer than a key's repetition.
        let dead = Arc::new(Mutex::new(lost_from));
        session.stream = Box::new(Dies(session.stream, dead.clone()));
        let begin = Instant::now();
        assert!(session.command(&jog).is_err());
        assert!(begin.elapsed() < Duration::from_millis(250));
        *dead.lock().unwrap() = usize::MAX;
        session.motion().unwrap();
        assert_eq!(fake.lock().unwrap().jogs, 0, "{lost_from}");
        session.command(&jog).unwrap();
        assert_eq!(fake.lock().unwrap().jogs, 1);
    }
    // Where only its answer was lost, the board expects the next number.
    let (mut session, fake) = open(State::Ready, Activity::Rest);
    session.stream = Box::new(Deaf(session.stream, Instant::now() + Duration::from_millis(180)));
    assert!(session.command(&jog).is_err());
    session.motion().unwrap();
    session.command(&jog).unwrap();
    assert_eq!(fake.lock().unwrap().jogs, 2);
}

/// A line that loses what the host sends after this number of bytes.
struct Dies(Box<dyn Stream>, Arc<Mutex<usize>>);

impl Stream for Dies {}

impl Read for Dies {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.0.read(bytes)
    }
}

impl Write for Dies {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut left = self.1.lock().unwrap();
        let count = bytes.len().min(*left);
        *left -= count;
        self.0.write_all(&bytes[..count])?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A line that loses what the board sends until some time.
struct Deaf(Box<dyn Stream>, Instant);

impl Stream for Deaf {}

impl Read for Deaf {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.0.read(bytes)?;
        if Instant::now() < self.1 {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        Ok(count)
    }
}

impl Write for Deaf {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
