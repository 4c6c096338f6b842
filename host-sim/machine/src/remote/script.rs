//! A script on a board in lockstep: its commands in exactly the periods that they have on the machine in this process.

use interp_core::Command;
use protocol::message::{Clock, Reason, Report, Request, Status};

use super::session::{Event, RemoteError, Session};
use crate::script::{Inputs, Played, Script};

/// When things happen, as the machine in this process found it.
#[derive(Clone, Debug)]
pub struct Schedule {
    /// Periods with which a run is over: there the board lets time stand still.
    pub ends: Vec<u32>,
    /// Periods altogether.
    pub periods: u32,
}

impl Schedule {
    /// That of a script that was played here; `ends` as it was told.
    #[must_use]
    pub fn of(played: &Played, ends: Vec<u32>) -> Self {
        Self {
            ends,
            periods: played.periods,
        }
    }

    /// Periods before which the board has to stand still, ascending, to the last.
    fn stops(&self, script: &Script) -> Vec<u32> {
        let mut stops: Vec<u32> = script
            .steps()
            .iter()
            .map(|step| step.0)
            .chain(self.ends.iter().map(|end| end + 1))
            .chain([0, self.periods])
            .filter(|stop| *stop <= self.periods)
            .collect();
        stops.sort_unstable();
        stops.dedup();
        stops
    }
}

/// What is sent before a period passes.
fn sent(inputs: Inputs, begins: bool) -> impl Iterator<Item = Request> {
    let action = inputs
        .action
        .or(begins.then_some(Command::Start))
        .map(Request::from);
    let percent = inputs
        .override_percent
        .map(|percent| Request::Override { percent });
    percent.into_iter().chain(action)
}

/// Plays a script on a board with the job loaded, and returns its status at the end.
///
/// # Errors
/// The line breaks, or the board refuses. What the state does not allow is refused too, and ignored, as in this process.
pub fn play(session: &mut Session, script: &Script, schedule: &Schedule) -> Result<Status, RemoteError> {
    session.command(&Request::Clock(Clock::Lockstep))?;
    session.command(&Request::Report(Report::Digests))?;
    let mut now = 0;
    for stop in schedule.stops(script) {
        if stop > now {
            session.command(&Request::Run { ticks: stop - now })?;
            while !matches!(session.event()?, Event::Halted(_)) {}
            now = stop;
        }
        if stop == schedule.periods {
            break;
        }
        for request in sent(script.at(stop), stop == 0) {
            match session.command(&request) {
                Err(RemoteError::Refused {
                    reason: Reason::WrongState { .. },
                    ..
                }) => {}
                other => other?,
            }
        }
    }
    session.status()
}
