//! A request and its reply as frames: numbers, time-outs, retransmission. Events among the replies are queued.

use std::io;
use std::time::{Duration, Instant};

use protocol::frame::{DELIMITER, FRAME_MAX, write_request};
use protocol::message::{JogWay, Reason, Reply, Request, next_number, read_reply};

use super::{Event, RemoteError, Session};

/// Longest time-out of a reply, after which the request is sent again. A reply takes 0.2 ms in QEMU and a few ms over a serial line; a board that
/// checks a job, or a QEMU that shares its processor, may take longer.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(1500);

/// Periods of a board after which the first request outside a run is repeated: a quarter of those after which the board ends a motion and switches a spindle off.
const ANSWER_PERIODS: u32 = 250;

/// Time after which a jog is given up that lasts for as long as its key is held: about the repetition of a key.
const KEY_TIMEOUT: Duration = Duration::from_millis(150);

/// During a run the time-out of a reply is the board's heartbeat timeout divided by this, so that a lost frame is repeated well before the heartbeat timeout.
const KEEP_ALIVE_SHARE: u32 = 4;
/// Least time-out of a reply: a USB-serial adapter may delay a frame by almost as long.
const ANSWER_TIMEOUT_MIN: Duration = Duration::from_millis(40);

/// Time-out of the reply to a part of a job. Its frame is the longest, so it is the first to suffer on a bad line; it takes 3 ms on a serial line, and the board a few more
/// for a row of a streamed job.
const CHUNK_TIMEOUT: Duration = Duration::from_millis(200);

/// Time after which a request to a board is given up.
const GIVE_UP: Duration = Duration::from_secs(6);

/// Time after which a request to a process is given up, and time-out of the events of its run.
pub(super) const PROCESS_SILENCE_TIMEOUT: Duration = Duration::from_secs(780);

impl Session {
    /// Sends a request, repeatedly if necessary, and waits for the reply with its number.
    pub(super) fn ask(&mut self, request: &Request) -> Result<Reply, RemoteError> {
        let given_up = std::mem::take(&mut self.gave_up).then(|| next_number(self.number));
        let reply = self.exchange(request)?;
        match (given_up, &reply) {
            // The request that was given up had arrived.
            (
                Some(number),
                Reply::Nak {
                    reason: Reason::OutOfOrder { expected },
                    ..
                },
            ) if *expected == next_number(number) => {
                self.number = number;
                self.exchange(request)
            }
            _ => Ok(reply),
        }
    }

    fn exchange(&mut self, request: &Request) -> Result<Reply, RemoteError> {
        let number = next_number(self.number);
        let mut buffer = [0; FRAME_MAX];
        let frame = write_request(number, request, &mut buffer).map_err(|_| {
            io::Error::new(
                io::ErrorKind::InvalidInput,
                "the request does not fit into a frame",
            )
        })?;
        self.asked = Instant::now();
        let is_process = self.stream.is_process();
        let by_key = matches!(
            request,
            Request::Jog {
                way: JogWay::Towards { .. },
                ..
            }
        );
        let (give_up, silent) = if is_process {
            (PROCESS_SILENCE_TIMEOUT, "a request was repeated for 13 minutes")
        } else if by_key {
            (KEY_TIMEOUT, "the jog was lost on the line, and is not repeated")
        } else {
            (GIVE_UP, "a request was repeated for 6 s")
        };
        let mut timeout = self.answer_timeout().min(give_up);
        let is_chunk = matches!(request, Request::JobChunk { .. });
        if is_chunk {
            timeout = timeout.min(CHUNK_TIMEOUT);
        }
        // A job is checked, and flash is written, outside a run.
        let grows = is_process || (self.keep_alive.is_none() && !is_chunk);
        self.tries = 0;
        while self.asked.elapsed() < give_up {
            self.tries += 1;
            self.is_damaged = false;
            self.stream.write_all(frame)?;
            self.stream.flush()?;
            let deadline = Instant::now() + timeout;
            if grows {
                timeout *= 2;
            }
            while Instant::now() < deadline {
                match self.next_reply()? {
                    Some(reply) => match answered(&reply) {
                        Some(answered) if answered == number => {
                            if !matches!(&reply, Reply::Nak { reason, .. } if !reason.uses_number()) {
                                self.number = number;
                            }
                            return Ok(reply);
                        }
                        // A frame was damaged in transmission: repeat at once.
                        Some(0) => break,
                        _ => {}
                    },
                    // Perhaps the answer: the board sends it again for the same bytes.
                    None if self.is_damaged => break,
                    None => self.read_some()?,
                }
            }
            if by_key {
                // Of a frame that has arrived without its end this makes a damaged one, which does nothing.
                self.stream.write_all(&[!DELIMITER])?;
            }
            self.stream.write_all(&[DELIMITER])?;
        }
        self.gave_up = by_key;
        Err(RemoteError::Silent(silent))
    }

    /// How long an answer may take before the request is sent again.
    fn answer_timeout(&self) -> Duration {
        let period_us = self.capabilities.description.period_us;
        let timeout = match self.keep_alive {
            Some(every) => every / KEEP_ALIVE_SHARE,
            // Before its hello, and of a process, which has no axes.
            None if period_us == 0 || self.stream.is_process() => ANSWER_TIMEOUT,
            None => Duration::from_micros(period_us.into()) * ANSWER_PERIODS,
        };
        timeout.clamp(ANSWER_TIMEOUT_MIN, ANSWER_TIMEOUT)
    }

    /// Reads the available bytes, or waits a moment.
    pub(super) fn read_some(&mut self) -> Result<(), RemoteError> {
        let mut bytes = [0; 16_384];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(RemoteError::Line(io::ErrorKind::UnexpectedEof.into())),
            Ok(count) => {
                self.input.extend_from_slice(&bytes[..count]);
                Ok(())
            }
            Err(error) => match error.kind() {
                io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted => Ok(()),
                _ => Err(error.into()),
            },
        }
    }

    /// The next reply among the bytes read; events before it are queued. Damaged frames are skipped: the request
    /// is repeated.
    pub(super) fn next_reply(&mut self) -> Result<Option<Reply>, RemoteError> {
        let input = std::mem::take(&mut self.input);
        for (index, &byte) in input.iter().enumerate() {
            let frame = match self.decoder.push(byte) {
                None => continue,
                Some(Err(_)) => {
                    self.is_damaged = true;
                    continue;
                }
                Some(Ok(frame)) => frame,
            };
            let Ok(reply) = read_reply(frame.payload) else {
                continue;
            };
            match reply {
                Reply::Samples { event, samples } => {
                    let samples = samples.iter().map(|record| Event::Sample(record.0));
                    self.events.take(event, samples.collect());
                }
                Reply::PassDigest { event, pass } => self.events.take(event, vec![Event::Pass(pass)]),
                Reply::Room { event, room } => {
                    self.has_room(room);
                    self.events.take(event, Vec::new());
                }
                Reply::Halted(status) => self.events.take(status.events, vec![Event::Halted(status)]),
                answer => {
                    self.input = input[index + 1..].to_vec();
                    return Ok(Some(answer));
                }
            }
        }
        Ok(None)
    }
}

/// Number of the request that a reply answers.
fn answered(reply: &Reply) -> Option<u16> {
    match reply {
        Reply::Capabilities(capabilities) => Some(capabilities.number),
        Reply::Ack { number }
        | Reply::Nak { number, .. }
        | Reply::Status { number, .. }
        | Reply::Profile { number, .. }
        | Reply::Motion { number, .. }
        | Reply::Offsets { number, .. }
        | Reply::Journal { number, .. }
        | Reply::StoredJob { number, .. } => Some(*number),
        Reply::Samples { .. } | Reply::PassDigest { .. } | Reply::Room { .. } | Reply::Halted(_) => None,
    }
}
