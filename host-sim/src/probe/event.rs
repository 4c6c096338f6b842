//! What `cargo sim` and the program that talks to debug probes say to each other: one request as the program's argument, events as
//! lines of JSON on its standard output. The program (`host-sim/debug-probe`) compiles this very file.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// What is to be done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Request {
    /// Is there a probe? Answered with [`Event::Probe`] or a failure.
    Find {
        /// Which probe, as `VID:PID` or `VID:PID:SERIAL`; without it the only one.
        probe: Option<String>,
    },
    /// Writes an image, compares what was written, and starts it.
    Flash(Target),
    /// Compares an image with what is in flash; writes nothing, and the program goes on running.
    Compare(Target),
    /// Follows the log of a running image, until it is ended.
    Log(Target),
    /// Decodes a recorded log from standard input.
    Decode {
        /// The image that wrote it.
        image: PathBuf,
    },
}

/// An image and where it belongs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Target {
    /// Which probe, as in [`Request::Find`].
    pub probe: Option<String>,
    /// The chip, by probe-rs's name.
    pub chip: String,
    /// What the chip says it is (`DEV_ID`).
    pub device_id: u16,
    /// The firmware's ELF file.
    pub image: PathBuf,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Event {
    /// A probe was found.
    Probe {
        /// Its name and selector.
        name: String,
    },
    /// So much of the work is done.
    Progress {
        /// Which work.
        work: Work,
        /// Bytes done.
        done: u64,
        /// Bytes in all.
        total: u64,
    },
    /// The log's reader is at work: what comes is the log.
    Following,
    /// A line of the log.
    Line(Line),
    /// Something of the log was lost, or is not the log.
    Lost,
    /// All done.
    Done,
    /// It cannot be done.
    Failed(Problem),
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Line {
    /// The board's time since its start, as it writes it.
    pub time: Option<String>,
    /// `error`, `warn`, `info`, `debug` or `trace`.
    pub level: Option<String>,
    /// What it says.
    pub message: String,
    /// File and line that say it.
    pub place: Option<(String, u64)>,
}

/// Work that takes a while.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Work {
    /// Erasing flash.
    Erase,
    /// Writing it.
    Write,
    /// Comparing it.
    Compare,
}

/// Why it cannot be done.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Problem {
    /// The probe is named by no selector.
    BadSelector(String),
    /// No probe, or not the one that was asked for.
    NoProbe,
    /// There are several: these.
    SeveralProbes(Vec<String>),
    /// There is one, and the system does not let us have it.
    NotAllowed(String),
    /// It cannot be opened.
    NotOpened(String),
    /// probe-rs knows no such chip.
    UnknownChip(String),
    /// No chip answers.
    NoChip(String),
    /// Another chip answers, with this `DEV_ID`.
    OtherChip(u16),
    /// The chip has so much flash, bytes, and the image wants more.
    TooLarge {
        /// What there is.
        flash_bytes: u32,
        /// What is wanted.
        image_bytes: u32,
    },
    /// Erasing, writing or comparing failed.
    NotWritten(String),
    /// Flash differs from the image, first at this address.
    Differs(u32),
    /// The image cannot be read, or has no log.
    BadImage(String),
    /// The program in the chip has set up no log.
    NoLog(String),
    /// The chip or the probe went away.
    Gone(String),
}
