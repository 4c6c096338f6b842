//! `operate`: sends operator commands to a board, between runs or to a run that has lost its host.

use clap::{Args, Parser, Subcommand};
use interp_core::Command;
use protocol::message::{Activity, OVERRIDE_MAX_PERCENT, Request, Status};
use serde_json::json;

use super::out::{say, to_stderr};
use super::{Failure, Result, attach, axes, home, numbers, run, spindle, stored};
use machine::remote::operate::{act, sentences};

/// Switches a board's drives, homes and jogs its axes, touches off, holds, resumes or stops its run, follows it, and prints its state.
///
/// Example: cargo sim operate --port /dev/ttyUSB0 status
/// Example: cargo sim operate --port /dev/ttyUSB0 home
/// Example: cargo sim operate --port /dev/ttyUSB0 jog x+10 y-5
/// Example: cargo sim operate --port /dev/ttyUSB0 spindle 12000
/// Example: cargo sim operate --port /dev/ttyUSB0 touch z-30 --work 1 --plate 15 --radius 3
/// Example: cargo sim operate --port /dev/ttyUSB0 attach
/// Example: cargo sim operate --port /dev/ttyUSB0 start left
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The board's serial port.
    #[arg(long, value_name = "DEV", global = true)]
    port: Option<String>,
    /// Prints one JSON object instead of text.
    #[arg(long, global = true)]
    pub(super) json: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Clone, Debug, Subcommand)]
enum Action {
    /// Follows the run to its end, keeps its heartbeat, and takes operator commands from standard input.
    Attach,
    #[command(flatten)]
    Axes(axes::Action),
    #[command(flatten)]
    Stored(stored::Action),
    #[command(flatten)]
    Command(OperatorCommand),
}

#[derive(Clone, Debug, Subcommand)]
enum OperatorCommand {
    /// Prints the state of the board.
    Status,
    /// Feed hold: decelerates along the path to standstill.
    Hold,
    /// Continues a held run. If the board holds a run whose host is gone (`host_gone = "hold"`), the command then follows it to its end.
    Resume,
    /// Decelerates, leaves the surface and is held there, with the spindle off; `resume` comes back to the same place.
    Pause,
    /// Decelerates, retracts and ends the run; the job stays loaded.
    Stop,
    /// Decelerates and ends the run in place; acknowledges its fault.
    Abort,
    /// Sets the feed override.
    Override {
        /// Percent of the programmed feed, 0 to 200.
        #[arg(value_parser = clap::value_parser!(u8).range(0..=i64::from(OVERRIDE_MAX_PERCENT)))]
        percent: u8,
    },
    /// Switches the drives on.
    On,
    /// Switches the drives off: the axes can be moved by hand, and home is lost.
    Off,
    /// Homes the axes by their switches, in the order of the profile; with a position: declares it. The drives must be on.
    Home {
        /// Declares that the axes stand here, mm: X,Y,Z.
        #[arg(value_parser = home::position, allow_hyphen_values = true)]
        position_mm: Option<home::PositionNm>,
        /// Homes these axes only, such as `z` or `xy`.
        #[arg(long, value_parser = axes::axes, conflicts_with = "position_mm")]
        axes: Option<u8>,
    },
    /// Jogs axes by distances in a straight line, such as x+10, or x+10 y-5 (mm).
    Jog {
        /// Axes and distances, mm. Without: by keys, for as long as they are held.
        #[arg(value_parser = axes::distance, num_args = 0..=3)]
        by: Vec<axes::Distance>,
        /// Speed along the line, mm/s; the profile's velocities bound it.
        #[arg(long, default_value_t = axes::JOG_MM_S, value_parser = numbers::speed, allow_negative_numbers = true)]
        speed: f32,
    },
    /// Turns the spindle outside a run, for as long as this command runs: spindle 12000, spindle off.
    Spindle(spindle::Turn),
    /// Switches the coolant: in a run for the rest of it, outside for as long as this command runs.
    Coolant {
        /// on or off.
        #[arg(value_parser = spindle::switch, action = clap::ArgAction::Set)]
        on: bool,
    },
    /// Moves an axis until the probe trips, at most by a distance, such as z-30 (mm).
    Probe {
        /// Axis and greatest distance, mm.
        #[arg(value_parser = axes::distance, allow_hyphen_values = true)]
        by: axes::Distance,
        /// Speed, mm/s.
        #[arg(long, default_value_t = axes::PROBE_MM_S, value_parser = numbers::speed, allow_negative_numbers = true)]
        speed: f32,
    },
    /// Acknowledges a released emergency stop or drive fault.
    Acknowledge,
}

impl OperatorCommand {
    /// For how long the spindle is to turn.
    const fn seconds(&self) -> Option<f64> {
        match self {
            Self::Spindle(turn) => turn.seconds,
            _ => None,
        }
    }

    /// The request on the line; none for a jog by keys.
    ///
    /// # Errors
    /// What is wrong with it.
    fn request(&self) -> std::result::Result<Option<Request>, String> {
        Ok(Some(match self {
            Self::Status => Request::Status,
            Self::Hold => Command::Hold.into(),
            Self::Resume => Command::Resume.into(),
            Self::Pause => Command::Pause.into(),
            Self::Stop => Command::Stop.into(),
            Self::Abort => Command::Abort.into(),
            Self::Override { percent } => Request::Override { percent: *percent },
            Self::On => Request::Drives { on: true },
            Self::Off => Request::Drives { on: false },
            Self::Home {
                position_mm: Some(position),
                ..
            } => Request::SetHome { home_nm: position.0 },
            Self::Home { axes, .. } => Request::Home {
                axes: axes.unwrap_or(0),
            },
            Self::Jog { by, .. } if by.is_empty() => return Ok(None),
            Self::Jog { by, speed } => axes::jog::by(by, *speed)?,
            Self::Spindle(turn) => turn.request(),
            Self::Coolant { on } => Request::Coolant { on: *on },
            Self::Probe { by, speed } => by.probe(*speed),
            Self::Acknowledge => Request::Acknowledge,
        }))
    }
}

#[derive(Debug, Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Line {
    #[command(subcommand)]
    command: OperatorCommand,
}

/// Parses a typed line; `None` for an empty one.
///
/// # Errors
/// What is wrong with them.
pub(super) fn typed(line: &str) -> std::result::Result<Option<Request>, String> {
    let words: Vec<_> = line.split_whitespace().collect();
    if words.is_empty() {
        return Ok(None);
    }
    match Line::try_parse_from(words) {
        Ok(line) => match line.command.request().map_err(|why| format!("error: {why}"))? {
            Some(request) => Ok(Some(request)),
            None => Err("error: a jog needs its distance here, such as jog x+10".to_owned()),
        },
        Err(error) => Err(error.to_string()),
    }
}

/// The state of a board in one line.
pub(super) fn sentence(status: &Status) -> String {
    let Status {
        state, pass, tick, ..
    } = status;
    format!("{}, pass {pass}, tick {tick}", state.name())
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let Some(port) = &arguments.port else {
        return Err(Failure::input(
            "no --port is given",
            "name the board's serial port: cargo sim operate --port /dev/ttyUSB0 status",
        ));
    };
    let command = match &arguments.action {
        Action::Attach => return attach::to_port(port, None, arguments.json),
        Action::Axes(action) => return axes::command(action, port, arguments.json),
        Action::Stored(action) => return stored::command(action, port, arguments.json),
        Action::Command(command) => command,
    };
    let mut session = run::open_port(port)?;
    let request = command
        .request()
        .map_err(|why| Failure::input(why, "cargo sim operate jog --help"))?;
    let Some(request) = request else {
        return axes::jog::by_keys(&mut session);
    };
    if axes::moves(&request) {
        return axes::go(&mut session, &request, arguments.json);
    }
    let status = act(&mut session, &request).map_err(Failure::from)?;
    if spindle::needs_a_host(&request, &status) {
        return spindle::keep(&mut session, command.seconds(), arguments.json);
    }
    let board = session.capabilities().description.board.clone();
    let stays = matches!(command, OperatorCommand::Resume) && attach::needs_a_host(&status);
    let motion = session.motion()?;
    if arguments.json {
        if !stays {
            let mut state = json_of(&status, &board);
            state["axes"] = axes::json_of(&motion);
            say!("{state}");
        }
    } else {
        print(&status, &board);
        if motion.activity == Activity::SpinUp {
            say!("  a start or resume waits for the spindle");
        }
        // All of them or none: the sentences say so.
        if axes::is_homed_in_part(&motion) {
            say!("  {}", axes::homed_words(&motion));
        }
        say!("  axes at {} mm", home::PositionNm(motion.at_nm).words());
    }
    if stays {
        to_stderr(format_args!(
            "this command keeps the heartbeat until the run ends: without it the board holds the run again"
        ));
        return attach::to_run(&mut session, port, arguments.json);
    }
    Ok(())
}

/// Prints the state of a board.
pub(super) fn print(status: &Status, board: &str) {
    say!("{board}: {}", sentence(status));
    if let Some(kind) = status.fault.and_then(|fault| fault.kind()) {
        say!("  fault {} ({})", kind.code(), kind.name());
    }
    for sentence in sentences(&status.safety) {
        say!("  {sentence}");
    }
}

/// The state of a board.
pub(super) fn json_of(status: &Status, board: &str) -> serde_json::Value {
    let safety = &status.safety;
    json!({
        "board": board,
        "state": status.state.name(),
        "pass": status.pass,
        "tick": status.tick,
        "samples": status.samples,
        "digest": format!("{:016x}", status.digest),
        "fault": status.fault.map(|fault| fault.code),
        "inputs": safety.lines.names().collect::<Vec<_>>(),
        "latched": safety.latched.names().collect::<Vec<_>>(),
        "drives_on": safety.drives_on,
        "homed": safety.homed,
        "homing_required": safety.configuration.homing_required,
        "host_gone": safety.link_timed_out,
        "feed_override_pct": safety.feed_override,
        "last_reset": safety.reset.name(),
        "spindle": spindle::json_of(safety.spindle),
        "pause": safety.pause.name(),
        "deadline_misses": status.deadline_misses,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_what_the_command_would_be() {
        assert_eq!(
            typed("  override 50 "),
            Ok(Some(Request::Override { percent: 50 }))
        );
        assert_eq!(typed("hold"), Ok(Some(Request::Hold)));
        assert_eq!(typed("home"), Ok(Some(Request::Home { axes: 0 })));
        let declared = Request::SetHome {
            home_nm: [0, 0, -1_500_000],
        };
        assert_eq!(typed("home 0,0,-1.5"), Ok(Some(declared)));
        let jog = Request::Jog {
            way: protocol::message::JogWay::By {
                nm: [10_000_000, 0, -500_000],
            },
            speed_mm_s: 3.0,
        };
        assert_eq!(typed("jog z-0.5 x+10 --speed 3"), Ok(Some(jog)));
        let turn = Request::Turn {
            turning: protocol::message::Turning::Counterclockwise,
            rpm: 12_000,
        };
        assert_eq!(typed("spindle 12000 --ccw"), Ok(Some(turn)));
        assert_eq!(typed("coolant on"), Ok(Some(Request::Coolant { on: true })));
        assert_eq!(typed(" "), Ok(None));
        for wrong in [
            "overide 50",
            "override 201",
            "hold on",
            "override",
            "jog",
            "jog w+1",
            "jog x+1e9",
            "jog x+1 x+2",
            "jog x+1 --speed nan",
            "jog x+1 --speed inf",
            "jog x+1 --speed 0",
            "jog x+1 --speed -3",
            "probe z-1 --speed nan",
            "probe z-1 --speed 0",
            "spindle fast",
            "spindle -1",
            "spindle 1000 --for 1e20",
            "spindle 1000 --for nan",
            "coolant 1",
        ] {
            assert!(
                typed(wrong).is_err_and(|why| why.starts_with("error: ")),
                "{wrong}"
            );
        }
    }
}
