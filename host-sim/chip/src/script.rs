//! Scripted events: inputs that open and close, a processor that hangs or faults, a brown-out, a supply that falls.

use boards::{Axis, Board, Line, Role};

/// Kind of event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Event {
    /// An input becomes active or inactive.
    Input { role: Role, is_active: bool },
    /// A machine's spindle is held below its speed (true), or runs up again (false).
    Stall(bool),
    /// The processor stops executing.
    Hang,
    /// A hard fault at the program's present position.
    Fault,
    /// The supply falls below the brown-out threshold and recovers immediately.
    BrownOut,
    /// The supply falls and returns: the drives lose their power, after `lag_s` the supply reaches the voltage detector's level, and `holds_s` later the chip has no supply.
    Power { lag_s: f64, holds_s: f64 },
}

/// Time of an event, seconds or pulses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum When {
    /// This long after power-on.
    Start(f64),
    /// This long after the first step pulse.
    Motion(f64),
    /// At the step pulse of a machine's carriages with this number.
    Pulses(u64),
}

/// An event and its time, as on the command line: `500:x-max`, `motion+20:emergency-stop`, `motion+40:hang`, `900:drive-fault=closed`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) name: String,
    pub(crate) when: When,
    pub(crate) what: Event,
}

/// The name of an input on the command line.
pub(crate) fn input_of(role: Role) -> Option<&'static str> {
    Some(match role {
        Role::EmergencyStop => "emergency-stop",
        Role::DriveFault => "drive-fault",
        Role::Probe => "probe",
        Role::Door => "door",
        Role::AtSpeed => "at-speed",
        Role::Start => "start",
        Role::LimitMin(Axis::X) => "x-min",
        Role::LimitMin(Axis::Y) => "y-min",
        Role::LimitMin(Axis::Z) => "z-min",
        Role::LimitMax(Axis::X) => "x-max",
        Role::LimitMax(Axis::Y) => "y-max",
        Role::LimitMax(Axis::Z) => "z-max",
        _ => return None,
    })
}

/// The safety inputs of a board.
pub(crate) fn inputs(board: &Board) -> impl Iterator<Item = &Line> {
    board.lines.iter().filter(|line| input_of(line.role).is_some())
}

/// Reads an entry for this board.
pub(crate) fn entry(text: &str, board: &Board) -> Result<Entry, String> {
    let (when, what) = text
        .split_once(':')
        .ok_or("an event is TIME:WHAT, such as motion+20:emergency-stop")?;
    let when = match (when.strip_prefix("motion+"), when.strip_prefix("pulses+")) {
        (Some(after), _) => When::Motion(ms(after)? / 1e3),
        (_, Some(count)) => When::Pulses(
            count
                .parse()
                .map_err(|_| format!("{count}: not a number of pulses"))?,
        ),
        _ => When::Start(ms(when)? / 1e3),
    };
    Ok(Entry {
        name: what.to_owned(),
        when,
        what: event(what, board)?,
    })
}

fn ms(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| format!("{text}: not a time in ms"))
}

/// Reads what happens.
pub(crate) fn event(what: &str, board: &Board) -> Result<Event, String> {
    let (what, closed) = what
        .strip_suffix("=closed")
        .map_or((what, false), |name| (name, true));
    Ok(match what {
        "hang" => Event::Hang,
        "stall" => Event::Stall(!closed),
        "fault" => Event::Fault,
        "brown-out" => Event::BrownOut,
        power if power.starts_with("power=") => {
            let (lag, holds) = power
                .trim_start_matches("power=")
                .split_once(',')
                .ok_or_else(|| format!("{power}: power=MS,MS is expected"))?;
            Event::Power {
                lag_s: ms(lag)? / 1e3,
                holds_s: ms(holds)? / 1e3,
            }
        }
        input => {
            let line = inputs(board)
                .find(|line| input_of(line.role) == Some(input))
                .ok_or_else(|| {
                    format!("{input}: neither an input of the board nor stall, hang, fault, brown-out, power=MS,MS")
                })?;
            Event::Input {
                role: line.role,
                is_active: !closed,
            }
        }
    })
}
