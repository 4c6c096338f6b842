//! `log`: reads the log of a board by a debug probe.

use std::fs::File;
use std::path::PathBuf;

use clap::Args;

use super::flash::{Bars, BoardArguments, load, program};
use super::out::{complain, say};
use super::{Failure, Result};
use crate::probe::{Event, Line, Program, Request};

/// Follows a board's log by a debug probe until Ctrl-C. The board is not reset, and never blocks on the log.
///
/// Each line has the time since the board's start (s), the level and the message. The flash of the chip is compared with the image first:
/// the log can be decoded only with the image that writes it.
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
    let (program, request, recorded) = match &arguments.from {
        Some(from) => decode(place, from)?,
        None => follow(place)?,
    };
    let mut bars = Bars::new();
    let outcome = program.run(&request, recorded, |event| match event {
        Event::Progress { work, done, total } => bars.show(*work, *done, *total),
        Event::Following => bars.end(),
        Event::Line(line) => print(line, arguments.json),
        Event::Lost => complain!("warning: some of the log was lost"),
        Event::Probe { .. } | Event::Done | Event::Failed(_) => {}
    });
    bars.end();
    Ok(outcome?)
}

/// The request for a recorded log. Every image is accepted, that of QEMU too.
fn decode(place: &BoardArguments, from: &PathBuf) -> Result<(Program, Request, Option<File>)> {
    let image = place.image()?;
    let recorded = File::open(from).map_err(|error| {
        Failure::input(
            format!("cannot read {}: {error}", from.display()),
            "name a file of recorded defmt frames",
        )
    })?;
    Ok((program()?, Request::Decode { image }, Some(recorded)))
}

/// The request for the log of a board.
fn follow(place: &BoardArguments) -> Result<(Program, Request, Option<File>)> {
    if place.image.is_some() {
        load(&place.image()?, place.board())?;
    }
    let program = program()?;
    place.find(&program)?;
    let image = place.image()?;
    load(&image, place.board())?;
    Ok((program, Request::Log(place.target(&image)), None))
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
