//! A script on the machine in this process.

use interp_core::{Command, Fault, Sample, State};
use protocol::digest::Digest;

use super::Script;
use crate::Machine;

/// What a scripted run came to. Samples and digest are those of the last run that was begun, as on the board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Played {
    /// Digest of the samples in which the tool moved.
    pub digest: u64,
    /// Their number.
    pub samples: u32,
    /// Periods that passed from the first start to the end of it all.
    pub periods: u32,
    /// State at the end: held where the script leaves it so.
    pub state: State,
    /// The fault that the machine is in at the end.
    pub fault: Option<Fault>,
}

/// Plays a script from the machine's start until nothing is left to do: the run is over, or held, and the script too. `each` gets the
/// sample of every period, and whether the tool moves in it, which is what counts; `ended` each period with which a run is over.
pub fn play(
    machine: &mut Machine,
    script: &Script,
    mut each: impl FnMut(&Sample, u32, bool),
    mut ended: impl FnMut(u32),
) -> Played {
    let last_step = script.steps().last().map_or(0, |step| step.0);
    let mut digest = Digest::new();
    let (mut samples, mut period) = (0, 0);
    let mut was_under_way = false;
    let mut feed_override = super::OVERRIDE_NORMAL_PERCENT;
    loop {
        let inputs = script.at(period);
        let command = inputs.action.or((period == 0).then_some(Command::Start));
        feed_override = inputs.override_percent.unwrap_or(feed_override);
        let begins = command == Some(Command::Start) && Command::Start.is_allowed(machine.state());
        let sample = machine.tick(interp_core::Inputs {
            command,
            feed_override,
        });
        let state = sample.state;
        if begins {
            (digest, samples) = (Digest::new(), 0);
        }
        let moves = state.is_under_way() && state != State::Held;
        if moves {
            digest.sample(sample);
            samples += 1;
        }
        each(sample, period, moves);
        if (was_under_way || begins) && !state.is_under_way() {
            ended(period);
        }
        was_under_way = state.is_under_way();
        period += 1;
        let waits = !was_under_way || state == State::Held;
        if waits && period > last_step {
            return Played {
                digest: digest.value(),
                samples,
                periods: period,
                state,
                fault: machine.fault(),
            };
        }
    }
}
