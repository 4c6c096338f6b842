//! `operate`: sends operator commands to a board, between runs or to a run that has lost its host.

use clap::{Args, Parser, Subcommand};
use interp_core::Command;
use protocol::message::{OVERRIDE_MAX_PERCENT, Request, Status};
use serde_json::json;

use super::out::{say, to_stderr};
use super::{Failure, Result, attach, home, run};
use machine::remote::operate::{act, sentences};

/// Switches a board's drives, declares its home, holds, resumes or stops its run, follows it, and prints its state.
///
/// Example: cargo sim operate --port /dev/ttyUSB0 status
/// Example: cargo sim operate --port /dev/ttyUSB0 home 0,0,50
/// Example: cargo sim operate --port /dev/ttyUSB0 attach
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
    /// Declares the position of the axes; the drives must be on.
    Home {
        /// Position of the ball centre, mm: X,Y,Z.
        #[arg(value_parser = home::position, allow_hyphen_values = true)]
        position_mm: home::PositionNm,
    },
    /// Acknowledges a released emergency stop or drive fault.
    Acknowledge,
}

impl OperatorCommand {
    /// The request on the line.
    fn request(&self) -> Request {
        match self {
            Self::Status => Request::Status,
            Self::Hold => Command::Hold.into(),
            Self::Resume => Command::Resume.into(),
            Self::Stop => Command::Stop.into(),
            Self::Abort => Command::Abort.into(),
            Self::Override { percent } => Request::Override { percent: *percent },
            Self::On => Request::Drives { on: true },
            Self::Off => Request::Drives { on: false },
            Self::Home { position_mm } => Request::SetHome {
                home_nm: position_mm.0,
            },
            Self::Acknowledge => Request::Acknowledge,
        }
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
        Ok(line) => Ok(Some(line.command.request())),
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
        Action::Attach => return attach::to_port(port, arguments.json),
        Action::Command(command) => command,
    };
    let mut session = run::open_port(port)?;
    let status = act(&mut session, &command.request()).map_err(Failure::from)?;
    let board = session.capabilities().description.board.clone();
    let stays = matches!(command, OperatorCommand::Resume) && attach::needs_a_host(&status);
    if arguments.json {
        if !stays {
            say!("{}", json_of(&status, &board));
        }
    } else {
        print(&status, &board);
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
        assert_eq!(typed(" "), Ok(None));
        for wrong in ["overide 50", "override 201", "hold on", "override"] {
            assert!(
                typed(wrong).is_err_and(|why| why.starts_with("error: ")),
                "{wrong}"
            );
        }
    }
}
