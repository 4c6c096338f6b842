//! `log`: what a board says, by a debug probe.

use std::fs::File;
use std::path::PathBuf;

use clap::Args;

use super::flash::{Bars, Place, load, program};
use super::out::{complain, say};
use super::{Failure, Result};
use crate::probe::{Event, Line, Program, Request};

/// Follows a board's log by a debug probe, until Ctrl-C. The board is not reset, and never waits for its reader.
///
/// Each line has the board's time since its start (s), its level, and what happened. The chip's flash is compared with the image first:
/// another image's log cannot be read.
///
/// Example: cargo sim log --board skr-pro
/// Example: cargo sim log --board stm32f405 --json
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    #[command(flatten)]
    place: Place,
    /// Decodes a recorded log (defmt frames as they come out of RTT) instead, with the image of --image.
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
    let ran = program.run(&request, recorded, |event| match event {
        Event::Progress { work, done, total } => bars.show(*work, *done, *total),
        Event::Following => bars.end(),
        Event::Line(line) => print(line, arguments.json),
        Event::Lost => complain!("warning: some of the log was lost"),
        Event::Probe { .. } | Event::Done | Event::Failed(_) => {}
    });
    bars.end();
    Ok(ran?)
}

/// What is to be done for a recorded log. Any image will do, that of QEMU too.
fn decode(place: &Place, from: &PathBuf) -> Result<(Program, Request, Option<File>)> {
    let image = place.image()?;
    let recorded = File::open(from).map_err(|error| {
        Failure::input(
            format!("cannot read {}: {error}", from.display()),
            "name a file of recorded defmt frames",
        )
    })?;
    Ok((program()?, Request::Decode { image }, Some(recorded)))
}

/// What is to be done for a board's.
fn follow(place: &Place) -> Result<(Program, Request, Option<File>)> {
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
