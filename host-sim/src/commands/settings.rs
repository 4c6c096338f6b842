//! `settings`: the machine profile that a board keeps, read and written.

use std::path::PathBuf;

use clap::Args;
use protocol::message::{Profile, Request};
use serde_json::json;

use super::out::say;
use super::output_file::OutputFile;
use super::{Failure, Result, cannot_write, read_profile, run};
use machine::profile;

/// Reads the machine profile that a board keeps, or writes one: steps and directions, the greatest limits of the axes, travel, homing, heartbeat. It survives
/// power cuts. A job may lower its limits, but not exceed them, and need not say anything of the machine.
///
/// Example: cargo sim settings --port /dev/ttyUSB0
/// Example: cargo sim settings --port /dev/ttyUSB0 --machine machine.toml
/// Example: cargo sim settings --port /dev/ttyUSB0 --output machine.toml
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// The board's serial port.
    #[arg(long, value_name = "DEV")]
    port: String,
    /// Writes this machine profile (TOML) to the board.
    #[arg(long, value_name = "FILE")]
    machine: Option<PathBuf>,
    /// Removes the profile from the board.
    #[arg(long, conflicts_with = "machine")]
    forget: bool,
    /// Writes the board's profile into this file instead of standard output.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Overwrites an existing file of --output.
    #[arg(long)]
    force: bool,
    /// Prints one JSON object instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let wanted = read_profile(arguments.machine.as_ref())?;
    let output = arguments
        .output
        .as_ref()
        .map(|path| OutputFile::begin(path, arguments.force))
        .transpose()?;
    let mut session = run::open_port(&arguments.port)?;
    if arguments.forget || wanted.is_some() {
        session.command(&Request::SetProfile(wanted.as_ref().map(profile::for_board)))?;
    }
    // Whatever was written is read back.
    let kept = session.profile()?;
    let text = kept.as_ref().map(|kept| profile::text(&profile::of_board(kept)));
    if let (Some(output), Some(path), Some(text)) = (output, &arguments.output, &text) {
        std::io::Write::write_all(&mut output.file()?, text.as_bytes())
            .map_err(|error| cannot_write(path, &error))?;
        output.finish()?;
    }
    let board = session.capabilities().description.board.as_str();
    if arguments.json {
        let digest = kept.as_ref().map(Profile::digest);
        say!("{}", json!({ "board": board, "profile": text, "digest": digest }));
    } else if arguments.output.is_none() {
        match text {
            Some(text) => say!("# machine profile of {board}\n{}", text.trim_end()),
            None => say!("{board} keeps no machine profile"),
        }
    } else if text.is_none() {
        return Err(Failure::Failed(Some(format!(
            "{board} keeps no machine profile, so there is nothing to write into a file\n  help: write one to the board: cargo sim settings --port {} --machine machine.toml",
            arguments.port
        ))));
    }
    Ok(())
}
