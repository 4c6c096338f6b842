//! Commands of an operator to a board: drives, home, hold and resume, override.

use std::time::Duration;

use protocol::message::{
    Configuration, JobName, OVERRIDE_NORMAL_PERCENT, PauseCause, Request, SafetyStatus, SpindleOrder, Status,
    Turning,
};

use super::session::{Event, RemoteError, Session};

/// Frames of the host per heartbeat timeout.
const KEEP_ALIVES: u32 = 4;

/// Interval of status requests during a run with an operator, without a heartbeat timeout.
const ASKED: Duration = Duration::from_secs(2);

/// A command is taken up with the next period; a serial line is no faster than that, QEMU's socket may be.
const TAKEN_UP: Duration = Duration::from_millis(2);

/// Setup of a board before a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setup {
    /// Configuration of the machine.
    pub configuration: Configuration,
    /// Position of the axes to declare as home, nm; `None`: not declared.
    pub home_nm: Option<[i32; 3]>,
}

impl Setup {
    /// A board without axes: for any job they are at its home.
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

    /// A board with its axes at this position, nm.
    #[must_use]
    pub const fn homed(configuration: Configuration, home_nm: [i32; 3]) -> Self {
        Self {
            configuration,
            home_nm: Some(home_nm),
        }
    }
}

/// Configures a board, enables its drives, and declares home if requested.
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

/// Source of commands during a run on the board's own clock.
pub trait Operator {
    /// The operator's next command, if there is one.
    fn wish(&mut self) -> Option<Request>;

    /// Whether an operator who could resume a held run is still present.
    fn is_there(&self) -> bool;

    /// Whether the run obeys the feed override; a job without limits does not.
    fn obeys_override(&self) -> bool {
        true
    }

    /// The run begins to be followed; `status`: the board's state then.
    fn begins(&mut self, status: &Status) {
        let _ = status;
    }

    /// The board has paused the run by itself, for this reason.
    fn paused(&mut self, cause: &'static str) {
        let _ = cause;
    }

    /// The outcome of a command: the board's state after it, or the refusal.
    fn replied(&mut self, request: &Request, came: Result<Status, RemoteError>);
}

/// Follows a run, and forwards the commands of its operator.
pub(super) struct Following<'a> {
    operator: Option<&'a mut dyn Operator>,
    /// A command changed the run: its samples differ from those of an undisturbed run.
    pub(super) commanded: bool,
    /// The feed override is 0.
    no_feed: bool,
    /// Cause of the board's own pause that the operator was last informed of.
    paused: PauseCause,
}

impl<'a> Following<'a> {
    /// Follows a run that has just been started, on the board's own clock if there is an operator.
    pub(super) fn new(
        session: &mut Session,
        operator: Option<&'a mut dyn Operator>,
    ) -> Result<Self, RemoteError> {
        session.set_patient(false);
        let mut following = Self {
            operator,
            commanded: false,
            no_feed: false,
            paused: PauseCause::None,
        };
        if let Some(operator) = &mut following.operator {
            let status = session.status()?;
            following.commanded = status.safety.feed_override != OVERRIDE_NORMAL_PERCENT;
            following.no_feed = status.safety.feed_override == 0;
            let every = session.keep_alive().unwrap_or(ASKED);
            session.set_keep_alive(Some(every));
            operator.begins(&status);
        }
        Ok(following)
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
                    if let Ok(status) = &came {
                        self.no_feed = status.safety.feed_override == 0;
                    }
                    operator.replied(&request, came);
                }
                continue;
            }
            session.set_patient(operator.is_there());
            if self.no_feed && operator.obeys_override() && !operator.is_there() {
                return Err(RemoteError::NoFeed);
            }
            if let Some(event) = session.poll()? {
                return Ok(event);
            }
            if session.paused() != std::mem::replace(&mut self.paused, session.paused())
                && self.paused != PauseCause::None
            {
                self.commanded = true;
                operator.paused(cause(self.paused));
            }
        }
    }
}

/// Why a board pauses a run by itself, and what to do.
#[must_use]
pub const fn cause(cause: PauseCause) -> &'static str {
    match cause {
        PauseCause::None => "by the operator",
        PauseCause::Door => "the safety door was opened; close it, and resume",
        PauseCause::BelowSpeed => {
            "the spindle fell below its speed, and is off; look for the cause, and resume"
        }
    }
}

/// Follows the run that is under way on a board, or whose start waits for the spindle, to its end, whoever started it: keeps its heartbeat, and forwards the commands of the operator. `each` is called
/// with its events, the end excepted. Returns the last status, at once where no run is under way.
///
/// # Errors
/// The line breaks; the run stands still, held or by an override of 0, and no operator is left who could change that.
pub fn follow(
    session: &mut Session,
    operator: &mut dyn Operator,
    mut each: impl FnMut(&Event),
) -> Result<Status, RemoteError> {
    keep_alive(session)?;
    // Before the status: what waits now may be under way then.
    let spins_up = session.spins_up()?;
    let status = session.begin_run()?;
    if !spins_up && !status.state.is_under_way() {
        return Ok(status);
    }
    let mut following = Following::new(session, Some(operator))?;
    loop {
        match following.event(session)? {
            // In lockstep the ticks of a `Run` may be used up before the end of the run.
            Event::Halted(status) if !status.state.is_under_way() => return Ok(status),
            event => each(&event),
        }
    }
}

/// Sends heartbeats from the session while it waits for events on the board's own clock.
pub(super) fn keep_alive(session: &mut Session) -> Result<(), RemoteError> {
    let ticks = session.status()?.safety.configuration.link_timeout_ticks;
    let period_us = session.capabilities().description.period_us;
    let patience = Duration::from_micros(u64::from(ticks) * u64::from(period_us));
    session.set_keep_alive((ticks > 0).then(|| patience / KEEP_ALIVES));
    Ok(())
}

/// Starts a job that the board keeps, to be followed in this session.
///
/// # Errors
/// The line breaks, or the board refuses to start it.
pub fn start_stored(session: &mut Session, name: &JobName, resumes: bool) -> Result<(), RemoteError> {
    keep_alive(session)?;
    session.begin_run()?;
    session.command(&Request::StartJob {
        name: name.clone(),
        resumes,
    })?;
    std::thread::sleep(TAKEN_UP);
    Ok(())
}

/// Does it, and says how it is going then.
///
/// # Errors
/// The line breaks, or the board refuses.
pub fn act(session: &mut Session, request: &Request) -> Result<Status, RemoteError> {
    if *request != Request::Status {
        session.command(request)?;
        std::thread::sleep(TAKEN_UP);
    }
    session.status()
}

/// Spindle and coolant in words.
#[must_use]
pub fn spindle_words(order: SpindleOrder) -> String {
    let coolant = if order.coolant { "on" } else { "off" };
    let rpm = order.rpm;
    match order.turning {
        Turning::Off => format!("spindle off, coolant {coolant}"),
        Turning::Clockwise => format!("spindle clockwise at {rpm} 1/min, coolant {coolant}"),
        Turning::Counterclockwise => format!("spindle counterclockwise at {rpm} 1/min, coolant {coolant}"),
    }
}

/// The safety state in sentences, asserted inputs first.
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
    if safety.spindle != SpindleOrder::OFF {
        said.push(spindle_words(safety.spindle));
    }
    if safety.pause != PauseCause::None {
        said.push(format!("paused: {}", cause(safety.pause)));
    }
    if safety.link_timed_out {
        said.push("the host was gone during the run".to_owned());
    }
    said.push(format!("last reset: {}", safety.reset.name()));
    said
}
