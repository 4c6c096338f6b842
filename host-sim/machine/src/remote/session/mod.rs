//! One session with a board: numbered requests with their replies, and events in between.
//!
//! ```text
//! mod.rs        opens a session; settings of its owner
//! requests.rs   the requests, each with its reply
//! waiting.rs    waits for the events of a run: silence, missing events, an end whose event was lost
//! streaming.rs  the words of a streamed job, sent while it runs
//! exchange.rs   a request and its reply as frames: numbers, time-outs, retransmission
//! error.rs      failures between the host and the board
//! ```

mod error;
mod exchange;
mod requests;
mod streaming;
mod waiting;

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use protocol::frame::{DELIMITER, Decoder};
use protocol::message::{Capabilities, PauseCause, Reply, Request};
use protocol::version::PROTOCOL_VERSION;

use interp_core::RunStart;

pub use error::RemoteError;

use super::events::Received;
pub use super::events::{Event, LineLosses};
use super::feed::Feed;

/// A line to a board. Reading returns [`std::io::ErrorKind::TimedOut`] or [`std::io::ErrorKind::WouldBlock`] after some
/// milliseconds without a byte.
pub trait Stream: Read + Write + Send {
    /// Whether the other end is a process on this computer. Its end closes the line, so a session waits for it as long as it lives.
    fn is_process(&self) -> bool {
        false
    }
}

/// An open session.
pub struct Session {
    stream: Box<dyn Stream>,
    decoder: Decoder,
    number: u16,
    events: Received,
    /// A status reported an end whose event had not come.
    ending: Option<u32>,
    /// Requests so far for the event that is missing.
    repeats: u32,
    input: Vec<u8>,
    capabilities: Capabilities,
    keep_alive: Option<Duration>,
    /// Whether silence is no reason to request the status.
    quiet: bool,
    /// Whether to wait for a run that stands still.
    patient: bool,
    asked: Instant,
    /// Time of the last event of the run.
    heard: Instant,
    /// The streamed job that is loaded or runs.
    feed: Option<Feed>,
    /// Frames of the last request.
    tries: u32,
    /// A damaged frame came since the last one.
    is_damaged: bool,
    /// The last request was given up: it may have arrived, or not.
    gave_up: bool,
    /// Where the runs of the loaded job begin.
    start: RunStart,
    /// Why the board had paused by itself in the last status.
    paused: PauseCause,
}

impl Session {
    /// Opens a session with a hello, and checks that both ends use the same version.
    ///
    /// # Errors
    /// The line breaks, there is no reply, or the versions differ.
    pub fn open(stream: Box<dyn Stream>, number: u32) -> Result<Self, RemoteError> {
        let mut session = Self {
            stream,
            decoder: Decoder::new(),
            number: 0,
            events: Received::new(),
            ending: None,
            repeats: 0,
            input: Vec::new(),
            capabilities: Capabilities::default(),
            keep_alive: None,
            quiet: false,
            patient: false,
            asked: Instant::now(),
            heard: Instant::now(),
            feed: None,
            tries: 0,
            is_damaged: false,
            gave_up: false,
            start: RunStart::FIRST,
            paused: PauseCause::None,
        };
        // Terminates a partial frame left by noise or by an earlier host.
        session.stream.write_all(&[DELIMITER])?;
        let hello = Request::Hello {
            version: PROTOCOL_VERSION,
            session: number,
        };
        match session.ask(&hello)? {
            Reply::Capabilities(capabilities) => {
                capabilities.check_version().map_err(RemoteError::Version)?;
                session.capabilities = capabilities;
                // From here on events are numbered from 1; those before were for another session.
                session.events = Received::new();
                session.begin_run()?;
                Ok(session)
            }
            _ => Err(RemoteError::Silent(
                "it did not answer hello with its capabilities",
            )),
        }
    }

    /// The board's capabilities.
    #[must_use]
    pub fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    /// Requests the status at least this often while [`Self::event`] waits. Restarts the time-out of events.
    pub fn set_keep_alive(&mut self, every: Option<Duration>) {
        self.keep_alive = every;
        self.heard = Instant::now();
    }

    /// Interval of these requests.
    #[must_use]
    pub fn keep_alive(&self) -> Option<Duration> {
        self.keep_alive
    }

    /// Why the board had paused the run by itself, by its last status.
    #[must_use]
    pub const fn paused(&self) -> PauseCause {
        self.paused
    }

    /// Whether [`Self::event`] requests no status however long no event comes: then nothing but the run takes the board's time.
    pub fn set_quiet(&mut self, quiet: bool) {
        self.quiet = quiet;
    }

    /// Whether [`Self::event`] waits for a run that stands still, because an operator can resume it.
    pub fn set_patient(&mut self, patient: bool) {
        self.patient = patient;
    }

    /// The pass with which the runs of the loaded job begin.
    pub(in crate::remote) const fn set_start(&mut self, start: RunStart) {
        self.start = start;
    }

    pub(in crate::remote) const fn start(&self) -> RunStart {
        self.start
    }
}

#[cfg(test)]
mod tests;
