//! Waits for the events of a run. Bounds how long the board may be silent, requests missing events again, and finds the end whose event was lost.

use std::time::{Duration, Instant};

use protocol::message::{Activity, Clock, PauseCause, Reason, Reply, Request, Status};

use interp_core::State;

use crate::remote::operate;

use super::exchange::PROCESS_SILENCE_TIMEOUT;
use super::{Event, LineLosses, RemoteError, Session};

/// Time-out of the events of a run.
pub(super) const SILENCE_TIMEOUT: Duration = Duration::from_secs(20);

/// Silence in a run after which the status is requested: it tells an end whose event was lost. A process loses nothing, but may be slow.
const LOOK: Duration = Duration::from_secs(1);
const PROCESS_LOOK: Duration = Duration::from_secs(3);

/// Requests for the same missing event, before it is given up: each is repeated until it is answered, so only the event itself was lost again.
const REPEATS_MAX: u32 = 8;

/// Pause before each read of events: QEMU hands its serial line's bytes over one by one, and a reader that is woken by each
/// takes the processor from it.
const GATHER: Duration = Duration::from_millis(1);

impl Session {
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

    /// Whether to request the status: for the heartbeat, after some silence, or because the last one reported an end.
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
        let stands = state == State::Held || !state.is_under_way();
        if stands && self.spins_up()? {
            self.heard = Instant::now();
            return Ok(());
        }
        // In lockstep the host itself lets time pass, held or not. The second status: what waited may have begun since the first.
        let is_left = state == State::Held && status.clock == Clock::Free && !self.patient;
        if is_left && self.status()?.state == State::Held {
            return Err(match status.safety.pause {
                PauseCause::None => RemoteError::Held,
                cause => RemoteError::Paused(operate::cause(cause)),
            });
        }
        if state.is_under_way() {
            self.heard = Instant::now();
        }
        Ok(())
    }

    /// Whether a start or resume waits for the spindle; the state does not tell it.
    ///
    /// # Errors
    /// As [`Self::command`].
    pub fn spins_up(&mut self) -> Result<bool, RemoteError> {
        Ok(self.motion()?.activity == Activity::SpinUp)
    }
}
