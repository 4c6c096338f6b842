//! `operate`: what an operator asks of a board between runs, or of a run whose host went away.

use clap::{Args, Parser, Subcommand};
use interp_core::Command;
use protocol::message::{OVERRIDE_MAX_PERCENT, Request, Status};
use serde_json::json;

use super::out::say;
use super::{Failure, Result, home, run};
use machine::remote::operate::{act, sentences};

/// Switches a board's drives, declares its home, holds, resumes or stops its run, and says how it is.
///
/// Example: cargo sim operate --port /dev/ttyUSB0 status
/// Example: cargo sim operate --port /dev/ttyUSB0 home 0,0,50
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The board's serial port.
    #[arg(long, value_name = "DEV")]
    port: String,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
    #[command(subcommand)]
    wanted: Wanted,
}

#[derive(Clone, Debug, Subcommand)]
enum Wanted {
    /// How the board is; nothing changes.
    Status,
    /// The run stands on its path.
    Hold,
    /// The run goes on.
    Resume,
    /// The run stops and is given up; the job stays loaded.
    Stop,
    /// The run is given up; or its fault is acknowledged.
    Abort,
    /// The feed as a share of the programmed one.
    Override {
        /// 0 to 200 percent.
        #[arg(value_parser = clap::value_parser!(u8).range(0..=i64::from(OVERRIDE_MAX_PERCENT)))]
        percent: u8,
    },
    /// The drives on.
    On,
    /// The drives off: the axes can be moved by hand, and the home is lost.
    Off,
    /// The axes stand here, with the drives on.
    Home {
        /// Their places, mm: X,Y,Z.
        #[arg(value_parser = home::place, allow_hyphen_values = true)]
        place_mm: home::PlaceNm,
    },
    /// Emergency stop and drive fault are acknowledged, once they are released.
    Acknowledge,
}

impl Wanted {
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
            Self::Home { place_mm } => Request::SetHome { home_nm: place_mm.0 },
            Self::Acknowledge => Request::Acknowledge,
        }
    }
}

#[derive(Debug, Parser)]
#[command(no_binary_name = true, disable_help_flag = true)]
struct Line {
    #[command(subcommand)]
    wanted: Wanted,
}

/// What the typed words of a line ask for; none of an empty line.
///
/// # Errors
/// What is wrong with them.
pub(super) fn typed(line: &str) -> std::result::Result<Option<Request>, String> {
    let words: Vec<_> = line.split_whitespace().collect();
    if words.is_empty() {
        return Ok(None);
    }
    match Line::try_parse_from(words) {
        Ok(line) => Ok(Some(line.wanted.request())),
        Err(error) => Err(error.to_string()),
    }
}

/// How a board is, in a line.
pub(super) fn sentence(status: &Status) -> String {
    let Status {
        state, pass, tick, ..
    } = status;
    format!("{}, pass {pass}, tick {tick}", state.name())
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let mut session = run::open_port(&arguments.port)?;
    let status = act(&mut session, &arguments.wanted.request()).map_err(Failure::from)?;
    let board = session.capabilities().description.board.as_str();
    if arguments.json {
        say!("{}", json_of(&status, board));
        return Ok(());
    }
    say!("{board}: {}", sentence(&status));
    if let Some(kind) = status.fault.and_then(|fault| fault.kind()) {
        say!("  fault {} ({})", kind.code(), kind.name());
    }
    for sentence in sentences(&status.safety) {
        say!("  {sentence}");
    }
    Ok(())
}

fn json_of(status: &Status, board: &str) -> serde_json::Value {
    let safety = &status.safety;
    json!({
        "board": board,
        "state": status.state.name(),
        "pass": status.pass,
        "tick": status.tick,
        "fault": status.fault.map(|fault| fault.code),
        "inputs": safety.lines.names().collect::<Vec<_>>(),
        "latched": safety.latched.names().collect::<Vec<_>>(),
        "drives_on": safety.drives_on,
        "homed": safety.homed,
        "homing_required": safety.configuration.homing_required,
        "host_gone": safety.host_gone,
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
