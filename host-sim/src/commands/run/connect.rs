//! The board, QEMU or chip emulator that a run is for, and the session with it.

use std::io::ErrorKind;

use super::super::flash::board_of;
use super::super::out::say;
use super::super::{Failure, Result, spinner};
use super::Arguments;
use machine::remote::chip::{self, Chip};
use machine::remote::qemu::{self, Qemu};
use machine::remote::{RemoteError, Session, port};

/// A session number; it only has to differ from that of the previous session.
fn session_number() -> u32 {
    std::time::SystemTime::now()
        .duration_since(std::time::UNIX_EPOCH)
        .map_or(1, |now| now.subsec_nanos() ^ std::process::id().rotate_left(16))
}

/// Opens a session with the board at this serial port.
pub(in super::super) fn open_port(name: &str) -> Result<Session> {
    let stream = port::open(name).map_err(|error| {
        let (why, remedy) = match error {
            RemoteError::Line(cause) if cause.kind() == ErrorKind::ResourceBusy => (
                cause.to_string(),
                "type the command there, or end that program",
            ),
            RemoteError::Line(cause) => (
                format!("cannot open it as a serial port: {cause}"),
                "name the board's serial port, such as /dev/ttyUSB0; without permission: add yourself to the group of the port (`ls -l`), mostly dialout",
            ),
            other => (other.to_string(), "name the board's serial port, such as /dev/ttyUSB0"),
        };
        Failure::input(format!("{name}: {why}"), remedy)
    })?;
    Ok(Session::open(stream, session_number())?)
}

/// The process at the other end of the line, if this command started one. It ends when this is dropped.
pub(super) enum Peer {
    Board,
    Qemu(#[expect(dead_code, reason = "ended when it is dropped")] Qemu),
    Chip(Chip),
}

/// A session, with the process at its other end.
pub(super) type Connected = (Peer, Session);

/// Starts a board's image on models of its chip.
fn connect_chip(name: &str, fast: bool) -> Result<Connected> {
    let bar = spinner("building the firmware and the chip emulator");
    let built = chip::image(board_of(name)).and_then(|image| Ok((chip::program()?, image)));
    bar.finish_and_clear();
    let (program, image) = built?;
    let (chip, stream) = Chip::start(&program, &image, fast)?;
    let mut peer = Peer::Chip(chip);
    let session =
        Session::open(stream, session_number()).map_err(|error| with_trouble(error.into(), &mut peer))?;
    Ok((peer, session))
}

/// A failure at the line, with what the chip emulator has to say about it: the line breaks where the emulator ends. Ends it.
pub(super) fn with_trouble(failure: Failure, peer: &mut Peer) -> Failure {
    let (Failure::Failed(said), Peer::Chip(chip)) = (&failure, peer) else {
        return failure;
    };
    match (said, chip.trouble()) {
        (_, None) => failure,
        (None, trouble) => Failure::Failed(trouble),
        (Some(said), Some(trouble)) => Failure::Failed(Some(format!("{said}\n  chip emulator: {trouble}"))),
    }
}

/// Complaints of the models of a chip, and lost bytes; ends the emulator.
pub(super) fn models_failure(peer: &mut Peer, as_json: bool) -> Option<String> {
    let Peer::Chip(chip) = peer else { return None };
    let Some(said) = chip.end() else {
        let why = chip
            .trouble()
            .map_or_else(String::new, |trouble| format!(": {trouble}"));
        return Some(format!("the chip emulator ended without a report{why}"));
    };
    if !as_json {
        say!(
            "  models       {} complaints, {} bytes lost, longest wait of a byte {} cycles",
            said.complaints.len(),
            said.bytes_lost,
            said.byte_wait_max_cycles
        );
    }
    if let Some(first) = said.complaints.first() {
        return Some(format!("the models of the chip complain: {first}"));
    }
    (said.bytes_lost > 0).then(|| format!("{} bytes were lost on the way into the chip", said.bytes_lost))
}

/// Opens a session with a board, QEMU or an emulated chip.
pub(super) fn connect(arguments: &Arguments) -> Result<Connected> {
    if let Some(name) = &arguments.target.port {
        return Ok((Peer::Board, open_port(name)?));
    }
    if let Some(name) = &arguments.target.chip {
        return connect_chip(name, arguments.fast);
    }
    let image = match &arguments.firmware {
        Some(image) if !image.exists() => {
            return Err(Failure::input(
                format!("there is no {}", image.display()),
                programs::image_remedy(programs::Part::QemuImage),
            ));
        }
        Some(image) => image.clone(),
        None => {
            let bar = spinner("building the firmware");
            let image = qemu::firmware();
            bar.finish_and_clear();
            image?
        }
    };
    let (qemu, stream) = Qemu::start(&image)?;
    Ok((Peer::Qemu(qemu), Session::open(stream, session_number())?))
}
