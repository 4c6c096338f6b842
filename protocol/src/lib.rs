//! The protocol between host and board, layer by layer, from the wire up. `no_std`, no allocation, no panic on any
//! input; both ends use this code.
//!
//! # The line
//!
//! Eight-bit bytes, any of which may be lost, inserted or corrupted. The line preserves their order.
//!
//! # Frames: [`frame`]
//!
//! A payload of at most [`frame::PAYLOAD_MAX`] bytes, its CRC-32, both stuffed by COBS, ended by a zero byte. A frame
//! either arrives unchanged or is an error; damage does not extend beyond the next zero.
//!
//! # Messages: [`message`]
//!
//! | host to board | | board to host |
//! |---|---|---|
//! | `Hello` | → ← | `Capabilities` |
//! | `JobBegin`, `JobChunk` .., `JobEnd` | → ← | `Ack` or `Nak` each |
//! | `Clock`, `Report`, `StepConfig` | → ← | `Ack` or `Nak` |
//! | `Start`, `StartAt`, `StartJob`, `Hold`, `Pause`, `Resume`, `Stop`, `Abort`, `Override` | → ← | `Ack` or `Nak` |
//! | `Configure`, `Drives`, `SetHome`, `Acknowledge`, `SetProfile` | → ← | `Ack` or `Nak` |
//! | `Profile`, `Offsets`, `Motion`, `Journal`, `StoredJob` | → ← | the same |
//! | `Jog`, `Home`, `Probe`, `SetOffsets`, `Spindle`, `Turn`, `Coolant`, `Simulate` | → ← | `Ack` or `Nak` |
//! | `StoreJob`, `DeleteJob` | → ← | `Ack` or `Nak` |
//! | `Run` | → ← | `Ack` or `Nak`, later `Halted` |
//! | `Status` | → ← | `Status` |
//! | `Repeat` | → ← | events again, then `Ack`; or `Nak` |
//! | | ← | `Samples`, `PassDigest`, `Room`, `Halted` while a run goes on |
//!
//! The module's documentation has every message's bytes. One request is outstanding at a time; each has a number, and gets
//! one answer.
//!
//! # Replies and errors
//!
//! | the board receives | it answers | and |
//! |---|---|---|
//! | a damaged frame | `Nak` 0, [`message::Reason::BadFrame`] | counts it |
//! | a valid frame without a valid message | `Nak`, `Unreadable` | |
//! | anything before `Hello` | `Nak`, `SayHello` | |
//! | `Hello` of another version | `Capabilities`, whose version says so; then `Nak`, `Version` with both versions | closes the session |
//! | `Hello` of the same session again | `Capabilities` | |
//! | the last request again, byte for byte | the same answer again, byte for byte | |
//! | a number that is not the next | `Nak`, `OutOfOrder` with the one expected | |
//! | a job, clock or step settings while a run is under way | `Nak`, `WrongState` with the state | |
//! | a chunk that is not the next, or too many words | `Nak`, `WrongOffset`, `TooLong` | |
//! | a chunk of a streamed job with a row whose digest is wrong, or that the core refuses | `Nak`, `WrongDigest`, `Job` with fault, value, record | a run stops before that row |
//! | a chunk or `JobEnd` without `JobBegin` | `Nak`, `NoUpload` | |
//! | a command while the queue of commands is full | `Nak`, `Busy` | |
//! | profile, offsets, spindle or step settings while a start waits for its period, a clock while it is queued | `Nak`, `Busy` | |
//! | `Run` without lockstep | `Nak`, `WrongClock` with the clock | |
//! | what this board does not support | `Nak`, `Unsupported` | |
//! | `JobEnd` too early | `Nak`, `Incomplete` | the upload may go on |
//! | `JobEnd` with other words than announced | `Nak`, `WrongDigest` | the upload is over, no job is loaded |
//! | `JobEnd` of a job that the core refuses | `Nak`, `Job` with fault, value, record | the upload is over, no job is loaded |
//! | step settings that the core refuses | `Nak`, `Job` with fault, value, axis | |
//! | a command that the state does not allow | `Nak`, `WrongState` | |
//! | a start, or drives on, refused because of inputs, latch or homing | `Nak`, `Unsafe` with the fault | |
//! | a start, or a home, while the drives are off | `Nak`, `DrivesOff` | |
//! | a start while the axes do not stand at the job's home | `Nak`, `NotAtHome` with both positions | |
//! | a value beyond its range | `Nak`, `OutOfRange` with the range | |
//! | a job that exceeds the board's profile, or other steps than the profile's | `Nak`, `BeyondProfile` with the value | |
//! | a profile with an invalid value, or with more steps than a period holds | `Nak`, `BadProfile` | |
//! | a profile that cannot be kept | `Nak`, `Storage` | |
//! | a start of a job that was loaded under another profile, or placed (and perhaps stored) with other offsets | `Nak`, `OtherProfile` | |
//! | a start of a job without axis limits, on a board with drives that has to be homed | `Nak`, `NoLimits` | |
//! | a start, an order or settings while the axes move outside a job | `Nak`, `Moving` | |
//! | a jog, homing or probe move on a board without a profile | `Nak`, `NoProfile` | |
//! | a jog or probe move beyond the travel | `Nak`, `BeyondTravel` with the range | |
//! | homing without its section in the profile | `Nak`, `NoHoming` | |
//! | a probe move while the probe is tripped | `Nak`, `ProbeTripped` | |
//! | a probe move while the spindle turns | `Nak`, `SpindleTurns` | |
//! | a jog at a feed override of 0 | `Nak`, `NoFeed` | |
//! | a jog or probe move whose speed is not a finite one above 0 | `Nak`, `BadSpeed` with the speed | |
//! | a spindle on a machine without one | `Nak`, `NoSpindle` | |
//! | a start of a streamed job whose first rows were overwritten | `Nak`, `RowsGone` | |
//! | a start at a pass, of a job without axis limits or of a streamed one | `Nak`, `WholeOnly` | |
//! | an order about a stored job that there is not | `Nak`, `NoStoredJob` | |
//! | a job to be stored for which there is no room | `Nak`, `NoRoom` with the words that there is room for | |
//! | a start of a stored job where the last run was cut short, if it was another or none | `Nak`, `NothingToResume` | |
//! | a `Repeat` of an event that is not kept any more | `Nak`, `EventGone` with the first that is | |
//!
//! Where the last column is empty, nothing has changed. An event that the line damages is lost: the host sees it by the numbers of the
//! events around it or by a status, and asks for it again ([`message`]).
//!
//! A host counts as alive by requests that the board answers: the next one, or the last one again. Whatever is answered with `BadFrame`, `Unreadable`,
//! `SayHello`, `Version` or `OutOfOrder` does not count.
//!
//! # Digests: [`digest`]
//!
//! 64 bits that both ends compare instead of all samples of a pass or all words of a job.
//!
//! # Versions: [`version`]
//!
//! The frame, `Hello` and `Capabilities` are the same in all versions; everything else needs the same version.
#![no_std]
#![warn(clippy::indexing_slicing, clippy::panic, clippy::expect_used)]
#![cfg_attr(
    test,
    allow(
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used,
        reason = "a test may fail by panic"
    )
)]

mod codes;
pub mod digest;
pub mod frame;
mod frame_error;
mod journal;
mod manual;
pub mod message;
mod profile;
mod reason;
mod records;
pub mod safety;
mod spindle;
mod stored;
pub mod version;

pub use version::{PROTOCOL_VERSION, VersionMismatch};
