//! Talks to debug probes for `cargo sim flash` and `cargo sim log`: `debug-probe REQUEST` reads one request as JSON and writes events
//! to its standard output, one per line.
//!
//! A separate program, because probe-rs is as large as the rest of the tool, and only users with a board need it.
//!
//! ```text
//! main.rs ─► chip.rs     the probe, the chip, the content of its flash
//!         ─► flash.rs    writes an image into flash
//!         ─► log.rs      reads the log from RAM and decodes it
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
    reason = "a file of the library, of which only a part is used here"
)]
mod image;
mod log;

use std::io::{Write, stdout};
use std::process::ExitCode;

use event::{Event, Problem, Request};

/// Writes an event; exits if the reader has closed the output.
fn tell(event: &Event) {
    let written = serde_json::to_string(event)
        .map_err(std::io::Error::from)
        .and_then(|line| writeln!(stdout().lock(), "{line}"));
    if written.is_err() {
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
        eprintln!("usage: debug-probe REQUEST (called by `cargo sim flash` and `cargo sim log`)");
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
