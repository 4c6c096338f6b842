//! What is requested of the board, each with its reply: commands, the status, what the board keeps.

use std::time::Duration;

use protocol::message::{
    Journal, MotionStatus, Offsets, Profile, Reason, Reply, Request, Status, StoredJobInfo,
};

use super::{RemoteError, Session};

pub(super) fn name(request: &Request) -> &'static str {
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
}
