//! One session with a board: numbered requests with their replies, and events in between.

use std::io::{self, Read, Write};
use std::time::{Duration, Instant};

use protocol::frame::{DELIMITER, Decoder, FRAME_MAX, write_request};
use protocol::message::{
    Capabilities, Clock, Journal, MotionStatus, Offsets, PauseCause, Profile, Reason, Reply, Request, Status,
    StoredJobInfo, next_number, read_reply,
};
use protocol::version::{PROTOCOL_VERSION, VersionMismatch};

use interp_core::{RunStart, State};

use super::events::Received;
pub use super::events::{Event, LineLosses};
use super::feed::Feed;

/// Time-out of a reply, after which the request is sent again. A reply takes 0.2 ms in QEMU and a few ms over a serial line; a board that
/// checks a job, or a QEMU that shares its processor, may take longer.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(1500);

/// The same while a board's patience runs: a share of the time between two frames that it wants to hear, so that one lost frame leaves it well
/// within its patience. Not below what a USB-serial adapter may keep a frame back.
const KEEP_ALIVE_SHARE: u32 = 4;
const ANSWER_TIMEOUT_MIN: Duration = Duration::from_millis(40);

/// The same of a part of a job, whose frame is the longest and so the first to suffer on a bad line: it takes 3 ms on a serial line, and the board a few more for a row
/// of a streamed job.
const CHUNK_TIMEOUT: Duration = Duration::from_millis(200);

/// Frames of a part of a job after which the next parts are shorter.
const TRIES_MANY: u32 = 3;

/// Time after which a request is given up.
const GIVE_UP: Duration = Duration::from_secs(6);

/// Time-out of the events of a run.
const SILENCE_TIMEOUT: Duration = Duration::from_secs(20);

/// The same of a process.
const PROCESS_SILENCE_TIMEOUT: Duration = Duration::from_secs(780);

/// Silence in a run after which the status is requested: it tells an end whose event was lost. A process loses nothing, but may be slow.
const LOOK: Duration = Duration::from_secs(1);
const PROCESS_LOOK: Duration = Duration::from_secs(3);

/// Requests for the same missing event, before it is given up: each is repeated until it is answered, so only the event itself was lost again.
const REPEATS_MAX: u32 = 8;

/// Pause before each read of events: QEMU hands its serial line's bytes over one by one, and a reader that is woken by each
/// takes the processor from it.
const GATHER: Duration = Duration::from_millis(1);

/// A line to a board. Reading returns [`io::ErrorKind::TimedOut`] or [`io::ErrorKind::WouldBlock`] after some
/// milliseconds without a byte.
pub trait Stream: Read + Write + Send {
    /// Whether the other end is a process of this machine: its end ends the line, so that it is waited for as long as it lives.
    fn is_process(&self) -> bool {
        false
    }
}

/// Errors between the host and the board.
#[derive(Debug, thiserror::Error)]
pub enum RemoteError {
    /// The line broke.
    #[error("the line to the board broke: {0}")]
    Line(#[from] io::Error),
    /// No reply.
    #[error("the board does not answer ({0})")]
    Silent(&'static str),
    /// The two ends speak different versions.
    #[error("{0}")]
    Version(VersionMismatch),
    /// The run stands still while the host waits for its end.
    #[error("the run is held: the board took this host for gone, or another one held it")]
    Held,
    /// The board has paused the run by itself, and nobody is there to resume it.
    #[error("the run is paused: {0}")]
    Paused(&'static str),
    /// The board drives its axes by other settings than the job's.
    #[error("the board reports other steps per millimetre, directions or pulse times than the job's")]
    OtherSteps,
    /// The feed override is 0 and nobody is there to change it.
    #[error("the feed override is 0 %, so the tool does not move, and nobody is there to change it")]
    NoFeed,
    /// The board refused a request.
    #[error("the board refused {request}: {reason}")]
    Refused {
        /// Name of the request.
        request: &'static str,
        /// The board's reason.
        reason: Reason,
    },
}

/// An open session.
pub struct Session {
    stream: Box<dyn Stream>,
    decoder: Decoder,
    number: u16,
    events: Received,
    /// A status told an end whose event had not come.
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
    /// Where the runs of the loaded job begin.
    start: RunStart,
    /// Why the board had paused by itself in the last status.
    paused: PauseCause,
}

fn name(request: &Request) -> &'static str {
    match request {
        Request::Hello { .. } => "hello",
        Request::JobBegin { .. } => "the job",
        Request::JobChunk { .. } => "a part of the job",
        Request::JobEnd => "the job",
        Request::Start => "to start",
        Request::Hold => "to hold",
        Request::Resume => "to resume",
        Request::Abort => "to abort",
        Request::Status => "its status",
        Request::Clock(_) => "the clock",
        Request::Run { .. } => "to run",
        Request::Report(_) => "the kind of report",
        Request::Configure(_) => "its configuration",
        Request::Drives { on: true } => "to switch the drives on",
        Request::Drives { on: false } => "to switch the drives off",
        Request::SetHome { .. } => "the home",
        Request::Acknowledge => "to acknowledge",
        Request::Override { .. } => "the feed override",
        Request::Stop => "to stop",
        Request::Simulate { .. } => "simulated inputs",
        Request::StepConfig(_) => "the steps of the axes",
        Request::Repeat { .. } => "lost events",
        Request::Profile | Request::SetProfile(_) => "the machine's profile",
        Request::Jog { .. } => "the jog",
        Request::Home { .. } => "homing",
        Request::Probe { .. } => "the probe move",
        Request::Motion => "the position of the axes",
        Request::Spindle(_) => "spindle and coolant",
        Request::Turn { .. } => "the spindle",
        Request::Coolant { .. } => "the coolant",
        Request::Pause => "the pause",
        Request::StartAt(_) => "the start at a pass",
        Request::Journal => "the journal",
        Request::StoreJob { .. } => "to store the job",
        Request::DeleteJob { .. } => "to delete a stored job",
        Request::StoredJob { .. } => "the stored jobs",
        Request::StartJob { .. } => "to start a stored job",
        Request::Offsets | Request::SetOffsets(_) => "the work offsets",
    }
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

    /// Sends a request that is acknowledged.
    ///
    /// # Errors
    /// The line breaks, there is no reply, or the board refuses.
    pub fn command(&mut self, request: &Request) -> Result<(), RemoteError> {
        loop {
            match self.ask(request)? {
                Reply::Nak {
                    reason: Reason::Busy, ..
                } => std::thread::sleep(Duration::from_millis(2)),
                Reply::Nak { reason, .. } => {
                    return Err(RemoteError::Refused {
                        request: name(request),
                        reason,
                    });
                }
                _ => return Ok(()),
            }
        }
    }

    /// Requests the status.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn status(&mut self) -> Result<Status, RemoteError> {
        match self.ask(&Request::Status)? {
            Reply::Status { status, .. } => {
                self.events.announce(status.events);
                self.has_room(status.stream.room);
                self.paused = status.safety.pause;
                Ok(status)
            }
            Reply::Nak { reason, .. } => Err(RemoteError::Refused {
                request: "its status",
                reason,
            }),
            _ => Err(RemoteError::Silent("it did not answer with its status")),
        }
    }

    /// Requests the profile that the board keeps.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn profile(&mut self) -> Result<Option<Profile>, RemoteError> {
        match self.ask(&Request::Profile)? {
            Reply::Profile { profile, .. } => Ok(profile),
            Reply::Nak { reason, .. } => Err(RemoteError::Refused {
                request: name(&Request::Profile),
                reason,
            }),
            _ => Err(RemoteError::Silent("it did not answer with its profile")),
        }
    }

    /// Requests position and motion of the axes outside a job.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn motion(&mut self) -> Result<MotionStatus, RemoteError> {
        match self.ask(&Request::Motion)? {
            Reply::Motion { motion, .. } => Ok(motion),
            Reply::Nak { reason, .. } => Err(RemoteError::Refused {
                request: name(&Request::Motion),
                reason,
            }),
            _ => Err(RemoteError::Silent("it did not answer with its position")),
        }
    }

    /// Requests work offsets and tool length.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn offsets(&mut self) -> Result<Offsets, RemoteError> {
        match self.ask(&Request::Offsets)? {
            Reply::Offsets { offsets, .. } => Ok(offsets),
            Reply::Nak { reason, .. } => Err(RemoteError::Refused {
                request: name(&Request::Offsets),
                reason,
            }),
            _ => Err(RemoteError::Silent("it did not answer with its work offsets")),
        }
    }

    /// Requests how far the last run came.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn journal(&mut self) -> Result<Option<Journal>, RemoteError> {
        match self.ask(&Request::Journal)? {
            Reply::Journal { journal, .. } => Ok(journal),
            Reply::Nak { reason, .. } => Err(RemoteError::Refused {
                request: name(&Request::Journal),
                reason,
            }),
            _ => Err(RemoteError::Silent("it did not answer with its journal")),
        }
    }

    /// The jobs that the board keeps, and the words of the longest for which there is room.
    ///
    /// # Errors
    /// The line breaks.
    pub fn stored_jobs(&mut self) -> Result<(Vec<StoredJobInfo>, u32), RemoteError> {
        let mut jobs = Vec::new();
        loop {
            let index = u8::try_from(jobs.len()).unwrap_or(u8::MAX);
            match self.ask(&Request::StoredJob { index })? {
                Reply::StoredJob { job: Some(job), .. } if index < u8::MAX => jobs.push(job),
                Reply::StoredJob { room, .. } => return Ok((jobs, room)),
                _ => return Err(RemoteError::Silent("it did not answer with its jobs")),
            }
        }
    }

    /// The pass with which the runs of the loaded job begin.
    pub(super) const fn set_start(&mut self, start: RunStart) {
        self.start = start;
    }

    pub(super) const fn start(&self) -> RunStart {
        self.start
    }

    /// The job whose words are sent while it runs, or none.
    pub(super) fn set_feed(&mut self, feed: Option<Feed>) {
        self.feed = feed;
    }

    /// The streamed job, if the last one was.
    pub(super) fn streamed(&self) -> Option<&crate::prepare::Prepared> {
        self.feed.as_ref().map(|feed| &feed.job)
    }

    fn has_room(&mut self, room: u32) {
        if let Some(feed) = &mut self.feed {
            feed.has_room(room);
        }
    }

    /// Whether words of a streamed job are left.
    pub(super) fn has_words(&self) -> bool {
        self.feed.as_ref().is_some_and(|feed| !feed.is_over())
    }

    /// Sends the next words of a streamed job, if there is room for any; false where there is none.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub(super) fn feed_board(&mut self) -> Result<bool, RemoteError> {
        let most = self.capabilities.description.chunk_words_max;
        let Some((chunk, sent)) = self.feed.as_ref().and_then(|feed| feed.next(most)) else {
            return Ok(false);
        };
        let reply = self.ask(&chunk)?;
        let is_bad = self.tries > TRIES_MANY;
        let Some(feed) = &mut self.feed else {
            return Ok(false);
        };
        feed.adapt(is_bad);
        match reply {
            Reply::Nak {
                reason: Reason::TooLong { limit, .. },
                ..
            } => feed.has_no_room(limit),
            Reply::Nak {
                reason: Reason::WrongOffset { expected },
                ..
            } => feed.has(expected),
            Reply::Nak { reason, .. } => {
                self.feed = None;
                return Err(RemoteError::Refused {
                    request: name(&chunk),
                    reason,
                });
            }
            _ => feed.has(sent),
        }
        Ok(true)
    }

    /// Drops the events so far: [`Self::event`] is then about what follows. Returns the board's status.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn begin_run(&mut self) -> Result<Status, RemoteError> {
        let status = self.status()?;
        self.events.ends_are_over(status.halts);
        self.events.drop_ready();
        self.ending = None;
        Ok(status)
    }

    /// What the line lost of the events of this session.
    #[must_use]
    pub const fn losses(&self) -> LineLosses {
        self.events.losses()
    }

    /// Waits for the next event.
    ///
    /// # Errors
    /// The line breaks, or no event arrives within the time-out.
    pub fn event(&mut self) -> Result<Event, RemoteError> {
        self.heard = Instant::now();
        loop {
            if let Some(event) = self.poll()? {
                return Ok(event);
            }
        }
    }

    /// The next event, if one arrives within some milliseconds.
    ///
    /// # Errors
    /// The line breaks, or no event arrived within the time-out.
    pub fn poll(&mut self) -> Result<Option<Event>, RemoteError> {
        if self.feed_board()? {
            return Ok(None);
        }
        // What was read after the last answer. An answer here belongs to a request that has been answered already.
        while self.next_reply()?.is_some() {}
        if let Some(event) = self.events.pop() {
            self.heard = Instant::now();
            if matches!(event, Event::Halted(_)) {
                self.ending = None;
            }
            return Ok(Some(event));
        }
        if let Some((event, count)) = self.events.missing() {
            self.ask_again(event, count)?;
            return Ok(None);
        }
        if self.is_look_due() {
            self.look_after()?;
            return Ok(None);
        }
        std::thread::sleep(GATHER);
        self.read_some()?;
        let grew = !self.input.is_empty();
        let (timeout, silent) = if self.stream.is_process() {
            (PROCESS_SILENCE_TIMEOUT, "no word of the run for 13 minutes")
        } else {
            (SILENCE_TIMEOUT, "no word of the run for 20 s")
        };
        if grew {
            self.heard = Instant::now();
        } else if self.heard.elapsed() > timeout {
            return Err(RemoteError::Silent(silent));
        }
        Ok(None)
    }

    /// Whether to request the status: for the heartbeat, after some silence, or because the last one told an end.
    fn is_look_due(&self) -> bool {
        let look = if self.stream.is_process() {
            PROCESS_LOOK
        } else {
            LOOK
        };
        let since = self.asked.elapsed();
        self.ending.is_some()
            || self.keep_alive.is_some_and(|every| since >= every)
            || ((!self.quiet || self.has_words()) && since >= look && self.heard.elapsed() >= look)
    }

    /// Requests missing events again, or gives them up.
    fn ask_again(&mut self, event: u32, count: u8) -> Result<(), RemoteError> {
        match self.ask(&Request::Repeat { event, count })? {
            Reply::Nak {
                reason: Reason::EventGone { first },
                ..
            } => self.events.give_up(first),
            Reply::Nak { reason, .. } => {
                return Err(RemoteError::Refused {
                    request: "lost events",
                    reason,
                });
            }
            _ if self.events.next() > event => {
                self.events
                    .count_repeated((self.events.next() - event).min(count.into()));
                self.repeats = 0;
            }
            _ => {
                self.repeats += 1;
                if self.repeats >= REPEATS_MAX {
                    self.repeats = 0;
                    self.events.give_up(event + 1);
                }
            }
        }
        Ok(())
    }

    /// Requests the status of the run; while the run continues, a board without events is not silent. An end that it tells takes the place of its event, if a
    /// second status tells it and still no event came: the board sends what waits in its queue before it reads the next request.
    fn look_after(&mut self) -> Result<(), RemoteError> {
        let status = self.status()?;
        let state = status.state;
        if !self.events.is_empty() || self.events.missing().is_some() {
            return Ok(());
        }
        if self.events.tells_an_end(status.halts) {
            if self.ending.replace(status.halts) == Some(status.halts) {
                self.events.end(status);
            }
            return Ok(());
        }
        // In lockstep the host itself lets time pass, held or not.
        if state == State::Held && status.clock == Clock::Free && !self.patient {
            return Err(match status.safety.pause {
                PauseCause::None => RemoteError::Held,
                cause => RemoteError::Paused(super::operate::cause(cause)),
            });
        }
        if state.is_under_way() {
            self.heard = Instant::now();
        }
        Ok(())
    }

    /// Sends a request, repeatedly if necessary, and waits for the reply with its number.
    fn ask(&mut self, request: &Request) -> Result<Reply, RemoteError> {
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
        let (give_up, silent) = if is_process {
            (PROCESS_SILENCE_TIMEOUT, "a request was repeated for 13 minutes")
        } else {
            (GIVE_UP, "a request was repeated for 6 s")
        };
        let mut timeout = self.answer_timeout();
        if matches!(request, Request::JobChunk { .. }) {
            timeout = timeout.min(CHUNK_TIMEOUT);
        }
        self.tries = 0;
        while self.asked.elapsed() < give_up {
            self.tries += 1;
            self.is_damaged = false;
            self.stream.write_all(frame)?;
            self.stream.flush()?;
            let deadline = Instant::now() + timeout;
            if is_process {
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
            self.stream.write_all(&[DELIMITER])?;
        }
        Err(RemoteError::Silent(silent))
    }

    /// How long an answer may take before the request is sent again.
    fn answer_timeout(&self) -> Duration {
        self.keep_alive.map_or(ANSWER_TIMEOUT, |every| {
            (every / KEEP_ALIVE_SHARE).clamp(ANSWER_TIMEOUT_MIN, ANSWER_TIMEOUT)
        })
    }

    /// Reads the available bytes, or waits a moment.
    fn read_some(&mut self) -> Result<(), RemoteError> {
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
    fn next_reply(&mut self) -> Result<Option<Reply>, RemoteError> {
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
