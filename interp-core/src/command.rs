//! The commands of an operator, the same from the command line over the line protocol to the core, and what the core is given in a period.

use crate::sample::State;

/// Greatest feed override, percent.
pub const OVERRIDE_MAX_PERCENT: u8 = 200;

/// The feed as programmed, percent.
pub const OVERRIDE_NORMAL_PERCENT: u8 = 100;

/// Greatest feed override as a factor of the programmed feed.
pub(crate) const OVERRIDE_MAX: f32 = OVERRIDE_MAX_PERCENT as f32 / 100.0;

/// A command of the operator or the host, executed with the next tick. A command that the state does not allow is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Command {
    /// Ready or finished: run the job from its beginning.
    Start = 1,
    /// Running: feed hold, stand on the path.
    Hold = 2,
    /// Held: continue.
    Resume = 3,
    /// Running or held: give the run up; faulted: acknowledge the fault. The position is kept, the job stays loaded (ready). On a machine with
    /// limits the tool slows down along its path first.
    Abort = 4,
    /// Running or held: give the run up, and leave the surface: with limits, the tool slows down along its path and retracts to the safe
    /// height, which is a link like any other; without, as an abort.
    Stop = 5,
    /// Running or held: hold, and leave the surface: with limits, the tool slows down along its path and retracts to the safe height, a link like
    /// any other, where it is held. The next resume brings it back to the same place, and the run continues. Without limits, as a hold.
    Pause = 6,
}

impl Command {
    /// Every command.
    pub const ALL: [Self; 6] = [
        Self::Start,
        Self::Hold,
        Self::Resume,
        Self::Abort,
        Self::Stop,
        Self::Pause,
    ];

    /// The command's name in scripts and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Hold => "hold",
            Self::Resume => "resume",
            Self::Abort => "abort",
            Self::Stop => "stop",
            Self::Pause => "pause",
        }
    }

    /// The command with this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|command| command.name() == name)
    }

    /// Whether a machine in this state executes the command.
    #[must_use]
    pub const fn is_allowed(self, state: State) -> bool {
        match self {
            Self::Start => matches!(state, State::Ready | State::Finished),
            Self::Hold => matches!(state, State::Running | State::Linking),
            Self::Resume => matches!(state, State::Held | State::Holding),
            Self::Abort => matches!(state, State::Faulted) || Self::Stop.is_allowed(state),
            Self::Stop | Self::Pause => matches!(
                state,
                State::Running | State::Linking | State::Holding | State::Held
            ),
        }
    }
}

/// The operator's inputs of one period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// A new command.
    pub command: Option<Command>,
    /// Feed override, percent, 0 to [`OVERRIDE_MAX_PERCENT`]; more counts as that. Only on a machine with limits. Up to 100 % it also scales links and retract: at 0 % nothing
    /// moves, and a stop does not end.
    pub feed_override: u8,
}

impl Inputs {
    /// The override as a factor of the programmed feed.
    pub(crate) fn feed_factor(self) -> f32 {
        f32::from(self.feed_override.min(OVERRIDE_MAX_PERCENT)) * 0.01
    }
}

impl Default for Inputs {
    /// No command, at the programmed feed.
    fn default() -> Self {
        Self {
            command: None,
            feed_override: OVERRIDE_NORMAL_PERCENT,
        }
    }
}

impl From<Option<Command>> for Inputs {
    /// At the programmed feed.
    fn from(command: Option<Command>) -> Self {
        Self {
            command,
            ..Self::default()
        }
    }
}

impl From<Command> for Inputs {
    /// At the programmed feed.
    fn from(command: Command) -> Self {
        Self::from(Some(command))
    }
}
