//! Messages between `cargo sim` and the debug-probe program (`host-sim/debug-probe`): one request as the argument of the program,
//! events as lines of JSON on its standard output. The program compiles this file too.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// A request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    /// Looks for a probe; answered with [`Event::Probe`] or a failure.
    Find {
        /// The probe, as `VID:PID` or `VID:PID:SERIAL`; `None`: the only one.
        probe: Option<String>,
    },
    /// Writes an image, verifies it, and starts it.
    Flash(Target),
    /// Compares an image with the flash; writes nothing and does not interrupt the firmware.
    Compare(Target),
    /// Follows the log of a running image until the process is ended.
    Log(Target),
    /// Decodes a recorded log from standard input.
    Decode {
        /// The image that wrote it.
        image: PathBuf,
    },
}

/// An image and the chip that it is for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Target {
    /// The probe, as in [`Request::Find`].
    pub probe: Option<String>,
    /// The chip, by probe-rs's name.
    pub chip: String,
    /// Identifier of the chip (`DEV_ID`).
    pub device_id: u16,
    /// The firmware's ELF file.
    pub image: PathBuf,
}

/// An event.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// A probe was found.
    Probe {
        /// Its name and selector.
        name: String,
    },
    /// Progress of the work.
    Progress {
        /// The work.
        work: Work,
        /// Bytes done.
        done: u64,
        /// Bytes in all.
        total: u64,
    },
    /// The log reader has started; the following events are the log.
    Following,
    /// A line of the log.
    Line(Line),
    /// A part of the log was lost or could not be decoded.
    Lost,
    /// The request is complete.
    Done,
    /// The request failed.
    Failed(Problem),
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Line {
    /// Time since the start of the board, as in the log.
    pub time: Option<String>,
    /// `error`, `warn`, `info`, `debug` or `trace`.
    pub level: Option<String>,
    /// The message.
    pub message: String,
    /// Source file and line.
    pub place: Option<(String, u64)>,
}

/// Work with a progress bar.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    /// Erasing flash.
    Erase,
    /// Writing flash.
    Write,
    /// Comparing flash.
    Compare,
}

/// Reason of a failure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Problem {
    /// The selector of the probe is invalid.
    BadSelector(String),
    /// No probe, or not the requested one.
    NoProbe,
    /// Several probes; their names.
    SeveralProbes(Vec<String>),
    /// The user has no permission to open the probe.
    NotAllowed(String),
    /// The probe cannot be opened.
    NotOpened(String),
    /// probe-rs knows no such chip.
    UnknownChip(String),
    /// No chip answers.
    NoChip(String),
    /// Another chip answers, with this `DEV_ID`.
    OtherChip(u16),
    /// The image does not fit the flash.
    TooLarge {
        /// Size of the flash, bytes.
        flash_bytes: u32,
        /// Size of the image, bytes.
        image_bytes: u32,
    },
    /// Erasing, writing or comparing failed.
    NotWritten(String),
    /// Flash differs from the image, first at this address.
    Differs(u32),
    /// The image cannot be read, or has no log.
    BadImage(String),
    /// The firmware in the chip has not initialised its log.
    NoLog(String),
    /// The connection to the chip or the probe was lost.
    Gone(String),
}
