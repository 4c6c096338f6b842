//! Talks to debug probes for `cargo sim flash` and `cargo sim log`: `debug-probe REQUEST` reads one request as JSON and writes events
//! to its standard output, one a line.
//!
//! A program of its own, because probe-rs is as large as the rest of the tool together, and is wanted by those who have a board.
//!
//! ```text
//! main.rs ─► chip.rs     the probe, the chip behind it, what is in its flash
//!         ─► flash.rs    an image into flash
//!         ─► log.rs      the log out of RAM, decoded
//! ```

mod chip;
#[path = "../../src/probe/event.rs"]
#[allow(unreachable_pub, reason = "the library's file")]
mod event;
mod flash;
#[path = "../../src/probe/image.rs"]
#[allow(
    unreachable_pub,
    dead_code,
    reason = "the library's file, which does more than is wanted here"
)]
mod image;
mod log;

use std::io::{Write, stdout};
use std::process::ExitCode;

use event::{Event, Problem, Request};

/// Writes an event. Where nobody listens any more, there is nothing left to do.
fn tell(event: &Event) {
    let told = serde_json::to_string(event)
        .map_err(std::io::Error::from)
        .and_then(|line| writeln!(stdout().lock(), "{line}"));
    if told.is_err() {
        std::process::exit(1);
    }
}

fn obey(request: &Request) -> Result<(), Problem> {
    match request {
        Request::Find { probe } => chip::find(probe.as_deref()).map(drop),
        Request::Flash(target) => flash::write(target),
        Request::Compare(target) => flash::compare(target),
        Request::Log(target) => log::follow(target),
        Request::Decode { image } => log::decode(image, std::io::stdin().lock()),
    }
}

fn main() -> ExitCode {
    let request = std::env::args().nth(1);
    let Some(Ok(request)) = request.map(|text| serde_json::from_str(&text)) else {
        eprintln!("usage: debug-probe REQUEST (`cargo sim flash` and `cargo sim log` are what you want)");
        return ExitCode::from(2);
    };
    match obey(&request) {
        Ok(()) => {
            tell(&Event::Done);
            ExitCode::SUCCESS
        }
        Err(problem) => {
            tell(&Event::Failed(problem));
            ExitCode::FAILURE
        }
    }
}
