//! What an operator asks of a board: drives, home, hold and resume, override.

use std::time::Duration;

use protocol::message::{Configuration, Request, SafetyStatus, Status};

use super::session::{Event, RemoteError, Session};

/// Frames of the host within the time after which it would count as gone.
const KEEP_ALIVES: u32 = 4;

/// How often a run with an operator is asked for its status where no host counts as gone.
const ASKED: Duration = Duration::from_secs(2);

/// How a board is made ready for a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setup {
    /// What it is told of the machine.
    pub configuration: Configuration,
    /// Where its axes stand, nm, if that is to be declared.
    pub home_nm: Option<[i32; 3]>,
}

impl Setup {
    /// A board without axes: whatever job it gets, they stand at its home.
    #[must_use]
    pub const fn simulated(configuration: Configuration) -> Self {
        Self {
            configuration: Configuration {
                homing_required: false,
                ..configuration
            },
            home_nm: None,
        }
    }

    /// A board whose axes stand here, nm.
    #[must_use]
    pub const fn homed(configuration: Configuration, home_nm: [i32; 3]) -> Self {
        Self {
            configuration,
            home_nm: Some(home_nm),
        }
    }
}

/// Configures a board, switches its drives on, and declares home where that is wanted.
///
/// # Errors
/// The line breaks, or the board refuses: an input is asserted or latched, or a run is under way.
pub fn make_ready(session: &mut Session, setup: &Setup) -> Result<(), RemoteError> {
    session.command(&Request::Configure(setup.configuration))?;
    session.command(&Request::Drives { on: true })?;
    if let Some(home_nm) = setup.home_nm {
        session.command(&Request::SetHome { home_nm })?;
    }
    Ok(())
}

/// Who gives commands while a run on the board's own clock is followed.
pub trait Operator {
    /// What is wanted next, if anything is.
    fn wish(&mut self) -> Option<Request>;

    /// Whether there is still somebody, who could resume a run that is held.
    fn is_there(&self) -> bool;

    /// What came of it: how the board was then, or that it refused.
    fn told(&mut self, request: &Request, came: Result<Status, RemoteError>);
}

/// Follows a run, and hands on what its operator wants.
pub(super) struct Following<'a> {
    operator: Option<&'a mut dyn Operator>,
    /// The board was commanded, so that its samples are not those of a run that nobody touches.
    pub(super) commanded: bool,
}

impl<'a> Following<'a> {
    /// A run that has just been started, on the board's own clock where there is an operator.
    pub(super) fn new(
        session: &mut Session,
        operator: Option<&'a mut dyn Operator>,
    ) -> Result<Self, RemoteError> {
        let mut commanded = false;
        session.set_patient(false);
        if operator.is_some() {
            commanded = session.status()?.safety.feed_override != 100;
            let every = session.keep_alive().unwrap_or(ASKED);
            session.set_keep_alive(Some(every));
        }
        Ok(Self { operator, commanded })
    }

    /// The next event.
    pub(super) fn event(&mut self, session: &mut Session) -> Result<Event, RemoteError> {
        let Some(operator) = &mut self.operator else {
            return session.event();
        };
        loop {
            if let Some(request) = operator.wish() {
                let came = act(session, &request);
                if let Err(RemoteError::Line(_) | RemoteError::Silent(_)) = came {
                    came?;
                } else {
                    self.commanded |= came.is_ok() && request != Request::Status;
                    operator.told(&request, came);
                }
            }
            session.set_patient(operator.is_there());
            if let Some(event) = session.poll()? {
                return Ok(event);
            }
        }
    }
}

/// Lets the session keep a board from taking this host for gone, while it waits for events on the board's own clock.
pub(super) fn keep_alive(session: &mut Session) -> Result<(), RemoteError> {
    let ticks = session.status()?.safety.configuration.host_gone_ticks;
    let period_us = session.capabilities().description.period_us;
    let patience = Duration::from_micros(u64::from(ticks) * u64::from(period_us));
    session.set_keep_alive((ticks > 0).then(|| patience / KEEP_ALIVES));
    Ok(())
}

/// Does it, and says how it is going then.
///
/// # Errors
/// The line breaks, or the board refuses.
pub fn act(session: &mut Session, request: &Request) -> Result<Status, RemoteError> {
    if *request != Request::Status {
        session.command(request)?;
        // Taken up with the next period; a serial line is no faster than that, QEMU's socket may be.
        std::thread::sleep(Duration::from_millis(2));
    }
    session.status()
}

/// The safety state in sentences, what is asserted first.
#[must_use]
pub fn sentences(safety: &SafetyStatus) -> Vec<String> {
    let names = |lines: protocol::message::InputLines| lines.names().collect::<Vec<_>>().join(", ");
    let mut said = Vec::new();
    if !safety.lines.is_none() {
        said.push(format!("asserted: {}", names(safety.lines)));
    }
    if !safety.latched.is_none() {
        said.push(format!("to be acknowledged: {}", names(safety.latched)));
    }
    let drives = if safety.drives_on { "on" } else { "off" };
    let home = match (safety.homed, safety.configuration.homing_required) {
        (true, _) => "homed",
        (false, true) => "not homed",
        (false, false) => "not homed, and need not be",
    };
    said.push(format!("drives {drives}, {home}"));
    said.push(format!("feed override {} %", safety.feed_override));
    if safety.host_gone {
        said.push("the host was gone during the run".to_owned());
    }
    said.push(format!("last reset: {}", safety.reset.name()));
    said
}
