//! A session with the host: its version, the numbers of its requests, and their answers.

mod jobs;
mod journalled;
mod kept;
mod last;
mod requests;

use interp_core::steps::StepConfig;
use protocol::{
    frame::{DELIMITER, FRAME_MAX, Frame, write_reply},
    message::{
        Capabilities, Clock, Reason, Reply, Request, SpindleOrder, Status, StepSettings, next_number,
        read_request,
    },
    version::PROTOCOL_VERSION,
};

use self::{jobs::Button, kept::own_steps, last::Last};
use crate::{history::History, journal::Journalling, machine::Machine, upload::Upload};

/// State of the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Peer {
    Nobody,
    /// The host sent `Hello` with another version.
    Stranger {
        version: u16,
    },
    /// The host sent `Hello` with this version.
    Host {
        session: u32,
    },
}

#[derive(Debug)]
pub(crate) struct Session {
    peer: Peer,
    last: Last,
    upload: Option<Upload>,
    /// The clock after the commands sent so far; the status shows it one tick later.
    clock: Clock,
    /// A start, hold, resume, stop or abort was sent, and may still be queued.
    commanded: bool,
    frames_bad: u32,
    events: History,
    /// Settings of the drives in force; none before the first job: the board's own.
    steps: Option<StepConfig>,
    /// Digest of the profile that the board keeps.
    profile: u32,
    /// The job was loaded under another profile.
    is_outdated: bool,
    /// [`protocol::message::job_mark`] of the job whose runs are journalled; none where the loaded one's are not.
    job: Option<u64>,
    journalling: Journalling,
    /// Spindle and coolant of the loaded job.
    spindle: SpindleOrder,
    button: Button,
}

impl Session {
    pub(crate) const fn new() -> Self {
        Self {
            peer: Peer::Nobody,
            last: Last::new(),
            upload: None,
            clock: Clock::Free,
            commanded: false,
            frames_bad: 0,
            events: History::new(),
            steps: None,
            profile: 0,
            is_outdated: false,
            job: None,
            journalling: Journalling::NONE,
            spindle: SpindleOrder::OFF,
            button: Button::NONE,
        }
    }

    pub(crate) const fn is_open(&self) -> bool {
        matches!(self.peer, Peer::Host { .. })
    }

    pub(crate) const fn count_bad_frame(&mut self) {
        self.frames_bad = self.frames_bad.saturating_add(1);
    }

    /// The status of an answer: with the link's counters, and the settings of the drives.
    #[inline(never)]
    fn complete_with_steps(&mut self, machine: &mut impl Machine) -> Status {
        let config = self.steps.unwrap_or_else(|| own_steps(machine));
        self.steps = Some(config);
        self.complete(machine.status())
    }

    /// The machine's status with the link's own counters.
    fn complete(&self, status: Status) -> Status {
        let steps = self.steps.map_or(0, |config| StepSettings::from(config).digest());
        Status {
            steps,
            profile: self.profile,
            frames_bad: self.frames_bad,
            events: self.events.last(),
            ..status
        }
    }

    /// Writes the next event, made with its number, and keeps it. Without a session it is dropped.
    pub(crate) fn event(&mut self, make: impl FnOnce(u32) -> Reply, out: &mut impl FnMut(&[u8])) {
        if !self.is_open() {
            return;
        }
        let mut buffer = [0; FRAME_MAX];
        if let Ok(frame) = write_reply(&make(self.events.next()), &mut buffer) {
            self.events.push(frame);
            out(frame);
        }
    }

    /// Writes the end of a run, or that its ticks are used up.
    #[inline(never)]
    pub(crate) fn halted(&mut self, status: &Status, out: &mut impl FnMut(&[u8])) {
        let status = self.complete(*status);
        self.event(|events| Reply::Halted(Status { events, ..status }), out);
    }

    /// Answers a frame. Returns whether the frame is a sign of life: a request that was carried out or refused on its merits, now or when it was first sent. Noise, frames of
    /// another session and requests out of order are no signs of life.
    #[inline(never)]
    pub(crate) fn frame(
        &mut self,
        frame: Frame<'_>,
        machine: &mut impl Machine,
        out: &mut impl FnMut(&[u8]),
    ) -> bool {
        let read = read_request(frame.payload);
        let number = match &read {
            Ok((number, _)) => *number,
            Err(unreadable) => unreadable.number,
        };
        if let Ok((_, Request::Hello { version, session })) = read {
            self.hello(number, version, session);
            send_capabilities(number, session, machine, out);
            return self.is_open();
        }
        if self.last.is(number, &frame) {
            out(&self.last.answer);
            return true;
        }
        if let Some(reason) = self.refusal(number) {
            refuse(number, reason, out);
            return false;
        }
        if let Ok((_, request)) = &read {
            let answer = self.answer(number, request, machine, out);
            self.last.set(number, &frame, &answer);
            self.button.runs_alone = false;
            out(&self.last.answer);
            true
        } else {
            refuse(number, Reason::Unreadable, out);
            false
        }
    }

    /// Opens a session, unless it is open already: then this `Hello` is a retransmission, and changes nothing.
    #[inline(never)]
    fn hello(&mut self, number: u16, version: u16, session: u32) {
        let peer = if version == PROTOCOL_VERSION {
            Peer::Host { session }
        } else {
            Peer::Stranger { version }
        };
        if peer != self.peer {
            self.peer = peer;
            // A streamed job is under way, or may be: the next session goes on with it.
            self.upload = self.upload.filter(Upload::is_streamed);
            self.events.clear();
            self.last = Last {
                number,
                ..Last::new()
            };
        }
    }

    /// The reason to refuse a request by its number, if any.
    fn refusal(&self, number: u16) -> Option<Reason> {
        match self.peer {
            Peer::Nobody => Some(Reason::SayHello),
            Peer::Stranger { version } => Some(Reason::Version {
                host: version,
                board: PROTOCOL_VERSION,
            }),
            Peer::Host { .. } => {
                let expected = next_number(self.last.number);
                (number != expected).then_some(Reason::OutOfOrder { expected })
            }
        }
    }
}

/// Writes what the board is. Apart from [`Session::frame`], like the refusal, so that its stack is not a part of every request's.
#[inline(never)]
fn send_capabilities(number: u16, session: u32, machine: &mut impl Machine, out: &mut impl FnMut(&[u8])) {
    out(&[DELIMITER]);
    send(
        &Reply::Capabilities(Capabilities {
            number,
            version: PROTOCOL_VERSION,
            session,
            description: machine.description(),
        }),
        out,
    );
}

#[inline(never)]
fn refuse(number: u16, reason: Reason, out: &mut impl FnMut(&[u8])) {
    send(&Reply::Nak { number, reason }, out);
}

/// Writes one reply as a frame. Every message fits into [`FRAME_MAX`], as a test of the protocol checks.
pub(crate) fn send(reply: &Reply, out: &mut impl FnMut(&[u8])) {
    let mut buffer = [0; FRAME_MAX];
    if let Ok(frame) = write_reply(reply, &mut buffer) {
        out(frame);
    }
}
