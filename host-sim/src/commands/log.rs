//! `log`: reads the log of a board by a debug probe.

use std::fs::File;
use std::path::PathBuf;

use clap::Args;

use super::flash::{Bars, BoardArguments, program};
use super::out::{complain, say};
use super::{Failure, Result};
use crate::probe::{Event, Line, ProbeError, Program, Request};

/// Follows a board's log by a debug probe until Ctrl-C. The board is not reset, and never blocks on the log.
///
/// Each line has the time since the board's start (s), the level and the message. The flash of the chip is compared with the image first:
/// the log can be decoded only with the image that writes it. Where a board has a loader of its own, that is the image for a probe or the one for a card.
///
/// Example: cargo sim log --board skr-pro
/// Example: cargo sim log --board stm32f405 --json
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(flatten)]
    place: BoardArguments,
    /// Decodes a recorded log (defmt frames read from RTT) with the image of --image instead.
    #[arg(long, value_name = "FILE", requires = "image", conflicts_with_all = ["probe", "chip"])]
    from: Option<PathBuf>,
    /// Prints one JSON object a line, with `time`, `level`, `message` and `place`, instead of text.
    #[arg(long)]
    pub(super) json: bool,
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    let place = &arguments.place;
    match &arguments.from {
        Some(from) => decode(place, from, arguments.json),
        None => follow(place, arguments.json),
    }
}

/// Prints the log until it ends.
fn read(
    program: &Program,
    request: &Request,
    recorded: Option<File>,
    as_json: bool,
) -> std::result::Result<(), ProbeError> {
    let mut bars = Bars::new();
    let outcome = program.run(request, recorded, |event| match event {
        Event::Progress { work, done, total } => bars.show(*work, *done, *total),
        Event::Following => bars.end(),
        Event::Line(line) => print(line, as_json),
        Event::Lost => complain!("warning: some of the log was lost"),
        Event::Probe { .. } | Event::Done | Event::Failed(_) => {}
    });
    bars.end();
    outcome
}

/// Decodes a recorded log. Every image is accepted, that of QEMU too.
fn decode(place: &BoardArguments, from: &PathBuf, as_json: bool) -> Result<()> {
    let image = place.image()?;
    let recorded = File::open(from).map_err(|error| {
        Failure::input(
            format!("cannot read {}: {error}", from.display()),
            "name a file of recorded defmt frames",
        )
    })?;
    Ok(read(
        &program()?,
        &Request::Decode { image },
        Some(recorded),
        as_json,
    )?)
}

/// Follows the log of a board.
fn follow(place: &BoardArguments, as_json: bool) -> Result<()> {
    place.check_image_in_chip()?;
    let program = program()?;
    place.find(&program)?;
    place.with_image_in_chip(|target| read(&program, &Request::Log(target), None, as_json))?;
    Ok(())
}

fn print(line: &Line, as_json: bool) {
    if as_json {
        say!("{}", serde_json::json!(line));
        return;
    }
    let time = line.time.as_deref().unwrap_or("");
    let level = line.level.as_deref().unwrap_or("").to_uppercase();
    say!("{time:>14} {level:<5} {}", line.message);
}
