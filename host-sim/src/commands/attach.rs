//! `attach`: follows a run on a board that another command started, keeps its heartbeat, and takes what is typed.

use std::path::{Path, PathBuf};

use clap::Args;
use interp_core::{Fault, State};
use protocol::message::{LinkTimeoutAction, Status};

use super::operate::{json_of, print};
use super::out::{say, to_stderr};
use super::typed::{Console, WORDS};
use super::{Failure, Result, load, run, spinner};
use job::{HeartbeatAction, MachineSpec};
use machine::remote::drive;
use machine::remote::operate::follow;
use machine::remote::session::Event;
use machine::remote::{RemoteError, Session};

/// Follows a run on a board to its end: keeps the heartbeat, and takes operator commands, typed with Enter: hold, pause, resume, stop, abort,
/// override 50, status. For a run whose `run` command has ended, or whose line broke. The run is not compared.
///
/// Example: cargo sim attach --port /dev/ttyUSB0
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The board's serial port.
    #[arg(long, value_name = "DEV")]
    port: String,
    /// The job that runs, if it is larger than the board's store: the words that it still needs are sent. As `run` was given it, without --work.
    #[arg(long, value_name = "JOB")]
    job: Option<PathBuf>,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    to_port(&arguments.port, arguments.job.as_deref(), arguments.json)
}

/// Attaches to the board at this port.
pub(super) fn to_port(port: &str, job: Option<&Path>, as_json: bool) -> Result<()> {
    let job = job.map(load).transpose()?;
    let mut session = run::open_port(port)?;
    let spins_up = session.spins_up()?;
    let status = session.status()?;
    if !spins_up && !status.state.is_under_way() {
        let board = session.capabilities().description.board.clone();
        if as_json {
            say!("{}", json_of(&status, &board));
        } else {
            print(&status, &board);
            say!("  no run is under way");
        }
        return Ok(());
    }
    if !as_json {
        let board = session.capabilities().description.board.clone();
        print(&status, &board);
    }
    if let Some((_, prepared)) = &job {
        drive::resume_upload(&mut session, prepared)?;
    }
    to_run(&mut session, port, as_json)
}

/// Follows the run that is under way to its end.
pub(super) fn to_run(session: &mut Session, port: &str, as_json: bool) -> Result<()> {
    let bar = spinner("following the run");
    if !as_json {
        bar.suspend(|| to_stderr(format_args!("type a command and Enter: {WORDS}")));
    }
    let mut console = Console::new(bar.clone(), None);
    let ended = follow(session, &mut console, |event| {
        if let Event::Pass(pass) = event {
            bar.set_message(format!("following the run: pass {} is over", pass.pass));
        }
    });
    bar.finish_and_clear();
    let status = ended.map_err(|error| unreachable_run(error, port, None))?;
    let board = session.capabilities().description.board.clone();
    if as_json {
        say!("{}", json_of(&status, &board));
    } else {
        print(&status, &board);
        say!("  {} samples, digest {:016x}", status.samples, status.digest);
    }
    match (status.state, status.fault) {
        (State::Finished | State::Ready | State::Idle, None) => Ok(()),
        (_, Some(fault)) => Err(Failure::Failed(Some(fault.kind().map_or_else(
            || format!("the run ended with the unknown fault {}", fault.code),
            |kind| {
                let (what, remedy) = explain::fault(Fault::new(kind, fault.value));
                format!("{what}\n  help: {remedy}")
            },
        )))),
        (state, None) => Err(Failure::Failed(Some(format!("the board ended {}", state.name())))),
    }
}

/// The failure of a command that no longer follows a run which is still on the board: what the board does now, and how to reach it. `machine` is that of the
/// job, if it is known.
pub(super) fn unreachable_run(error: RemoteError, port: &str, machine: Option<&MachineSpec>) -> Failure {
    let reach = format!("cargo sim operate --port {port} attach");
    let what = match &error {
        RemoteError::Held | RemoteError::Paused(_) | RemoteError::NoFeed => {
            return Failure::Failed(Some(format!(
                "{error}\n  help: {reach}, and type resume, override 100 or stop"
            )));
        }
        RemoteError::Line(_) | RemoteError::Silent(_) => match machine {
            Some(machine) if machine.heartbeat_action == HeartbeatAction::Hold => format!(
                "the board holds the run {} ms after the last message (host_gone = \"hold\")",
                machine.heartbeat_timeout_ms
            ),
            Some(_) => "the run goes on on the board to its end (host_gone = \"finish\")".to_owned(),
            None => "the run goes on on the board, or is held by its heartbeat timeout".to_owned(),
        },
        _ => return error.into(),
    };
    Failure::Failed(Some(format!(
        "{error}\n  {what}, if the board still has power\n  help: {reach}, once the line is there again: it follows the run, keeps its heartbeat and takes commands"
    )))
}

/// Whether a run that is resumed is held again as soon as nobody is heard.
pub(super) fn needs_a_host(status: &Status) -> bool {
    let configuration = status.safety.configuration;
    configuration.on_link_timeout == LinkTimeoutAction::Hold
        && configuration.link_timeout_ticks > 0
        && status.state.is_under_way()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(error: RemoteError, action: Option<HeartbeatAction>) -> String {
        let machine = action.map(|heartbeat_action| MachineSpec {
            heartbeat_action,
            ..MachineSpec::default()
        });
        match unreachable_run(error, "/dev/ttyX", machine.as_ref()) {
            Failure::Failed(Some(text)) => text,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_broken_line_tells_what_the_board_does_and_how_to_reach_it() {
        let broken = || RemoteError::Line(std::io::ErrorKind::UnexpectedEof.into());
        for (action, what) in [
            (Some(HeartbeatAction::Finish), "goes on on the board to its end"),
            (Some(HeartbeatAction::Hold), "holds the run"),
            (None, "or is held"),
        ] {
            let text = text(broken(), action);
            assert!(text.contains(what), "{text}");
            assert!(text.contains("operate --port /dev/ttyX attach"), "{text}");
        }
        let held = text(RemoteError::Held, None);
        assert!(held.contains("attach") && held.contains("resume"), "{held}");
        let refused = RemoteError::Refused {
            request: "to start",
            reason: protocol::message::Reason::DrivesOff,
        };
        assert!(!text(refused, None).contains("attach"));
    }
}
