//! The messages and their encoding.
//!
//! # Bytes
//!
//! The payload of a frame is written by [postcard](https://postcard.jamesmunns.com/wire-format): fields one after the
//! other, no names, no gaps.
//!
//! | type | bytes |
//! |---|---|
//! | `u8` | 1 |
//! | `u16`, `u32` | varint: seven bits a byte, low ones first, top bit set on all but the last; at most 3 and 5 bytes |
//! | `i32` | zigzag (0, -1, 1, -2 .. become 0, 1, 2, 3 ..), then varint |
//! | `f32` | 4, IEEE 754 bits, low byte first |
//! | digest, fraction | 8, low byte first |
//! | word of a job | 4, low byte first |
//! | enumeration | 1: the code given where the type is defined |
//! | option | 0, or 1 and the value |
//! | list, text | varint of the number of elements (bytes), then these |
//!
//! # Host to board
//!
//! Payload: number of the request (`u16`), code (1 byte), fields.
//!
//! | code | message | fields | answer on success |
//! |---|---|---|---|
//! | 0 | `Hello` | version `u16`, session `u32` | `Capabilities` |
//! | 1 | `JobBegin` | header, words `u32`, digest | `Ack` |
//! | 2 | `JobChunk` | offset `u32`, words | `Ack` |
//! | 3 | `JobEnd` | | `Ack` once the job is checked: the machine is ready |
//! | 4 | `Start` | | `Ack`, taken up with the next period |
//! | 5 | `Hold` | | as `Start` |
//! | 6 | `Resume` | | as `Start` |
//! | 7 | `Abort` | | as `Start` |
//! | 8 | `Status` | | `Status` |
//! | 9 | `Clock` | 0 free, 1 lockstep | `Ack` |
//! | 10 | `Run` | ticks `u32` | `Ack`, and `Halted` when the ticks are used up |
//! | 11 | `Report` | 0 digests, 1 samples | `Ack` |
//! | 12 | `StepConfig` | the fields of [`StepSettings`] | `Ack`; refused while a run is under way; in force until the next `JobBegin`; those of the profile only, where the board has one |
//! | 13 | `Configure` | the fields of [`Configuration`] | `Ack`, and it holds |
//! | 14 | `Drives` | 0 off, 1 on | as `Configure` |
//! | 15 | `SetHome` | three positions in nm, `i32` each | as `Configure` |
//! | 16 | `Acknowledge` | | as `Configure` |
//! | 17 | `Override` | percent `u8` | as `Start` |
//! | 18 | `Stop` | | as `Start` |
//! | 19 | `Simulate` | inputs `u16` | `Ack`, by a board without pins only |
//! | 20 | `Repeat` | event `u32`, count `u8` | these events again, then `Ack` |
//! | 21 | `Profile` | | `Profile` |
//! | 22 | `SetProfile` | option of the fields of [`Profile`] | `Ack`, and it holds, also after a power cut |
//! | 23 | `Jog` | way ([`JogWay`]; a direction is three bytes), speed (mm/s, `f32`) | as `Configure`; a continuous one stops along its ramp when it is not repeated |
//! | 24 | `Home` | axes (a byte, one bit each) | as `Configure` |
//! | 25 | `Probe` | axis (a byte), distance (nm, `i32`), speed (mm/s, `f32`) | as `Configure` |
//! | 26 | `Motion` | | `Motion` |
//! | 27 | `Offsets` | | `Offsets` |
//! | 28 | `SetOffsets` | the fields of [`Offsets`] | `Ack`, and it holds, also after a power cut |
//! | 29 | `Spindle` | turning (a byte: 0 off, 1 clockwise, 2 counterclockwise), speed (1/min, `u32`), coolant (a byte) | as `Configure`; for the runs of the loaded job |
//! | 30 | `Pause` | | as `Start` |
//! | 31 | `StartAt` | pass `u32`, path parameter of the place on it (span 65535: its start) | as `Start`; a job with axis limits that is not streamed |
//! | 32 | `Journal` | | `Journal` |
//! | 33 | `Turn` | turning (as in `Spindle`), speed (1/min, `u32`) | as `Configure`; off where the host is not heard for a second |
//! | 34 | `Coolant` | 0 off, 1 on | as `Turn` |
//! | 35 | `StoreJob` | name (text), 1 where its runs begin where the axes stand | `Ack`: the loaded job is kept, also after a power cut |
//! | 36 | `DeleteJob` | name | `Ack` |
//! | 37 | `StoredJob` | number of the stored job, from 0, `u8` | `StoredJob` |
//! | 38 | `StartJob` | name, 1 to go on where the last run of it was cut short | `Ack`: it is loaded, and starts as by `Start` |
//!
//! Header: kind, pattern, spacing, tool side (a byte each), spans along path and side (`u16`), ball radius (mm), feed (mm/s),
//! scallop height (mm), period (s) (`f32`), edges of its regions, words of its links (`u16` each), window of a streamed job (rows, `u16`; 0 for another one),
//! number of its strips (`u16`); then 0, or 1 and the axes' limits: velocity (mm/s), acceleration (mm/s^2), jerk (mm/s^3) (three `f32` each), chord error
//! (mm, `f32`), travel (least and most of each axis), home (nm, three `i32` each), end (option of three `i32`, nm), its height (nm, `i32`), plunge (mm,
//! `f32`), safe height (nm, `i32`), overrun (mm, `f32`).
//!
//! # Board to host
//!
//! Payload: code (1 byte), fields. Codes 4, 5, 6 and 10 are unsolicited events; the others answer a request and carry its number.
//!
//! | code | message | fields |
//! |---|---|---|
//! | 0 | `Capabilities` | number, version `u16`, session `u32`, then the fields of [`Description`] |
//! | 1 | `Ack` | number |
//! | 2 | `Nak` | number, [`Reason`] (its code and fields) |
//! | 3 | `Status` | number, the fields of [`Status`] |
//! | 4 | `Samples` | event `u32`, list of samples (tick, state, pass, path and side parameter, feed, CC and CL, interval) |
//! | 5 | `PassDigest` | event `u32`, the fields of [`PassDigest`] |
//! | 6 | `Halted` | the fields of [`Status`], with the event in `events` |
//! | 7 | `Profile` | number, option of the fields of [`Profile`] |
//! | 8 | `Motion` | number, the fields of [`MotionStatus`] |
//! | 9 | `Offsets` | number, the fields of [`Offsets`] |
//! | 10 | `Room` | event `u32`, words up to which there is room `u32` |
//! | 11 | `Journal` | number, option of the fields of [`Journal`] |
//! | 12 | `StoredJob` | number, option of the fields of [`StoredJobInfo`] (none beyond the last), words of the longest job for which there is room `u32` |
//!
//! A parameter is its span (`u16`) and fraction. `Halted` comes when the ticks of a `Run` are used up, or when a run ends
//! (finished, faulted, aborted), whichever is first.
//!
//! # Lost events
//!
//! Each event has a number: 1, 2, .. from the session's `Hello` on, without a gap. The board keeps the latest events in some kilobytes and sends
//! them again for `Repeat`, with the numbers and bytes that they had. A host sees a loss by the next event's number, or by `events` of a status, which is
//! the number of the last event before it. The board counts each `Halted` in `halts`, so a status tells the end of a run whose `Halted` was
//! lost, and its digest covers the whole run.
//!
//! # Streamed jobs
//!
//! A job whose header has a window ([`interp_core::job::stream`]) may have more words than the store. `JobEnd` then follows when the first rows are sent, as many as the
//! window has, or all; and after it further chunks, also while the job runs, up to the word that `room` of the status or the last `Room` event reported. Each row is
//! checked when it is complete: its digest, then its records. `room` and `received` of the status only grow, so no loss of an event matters, and a host that connects
//! anew goes on at `received`. A start after the first rows were overwritten is refused: the job has to be loaded again.
//!
//! # Compatibility
//!
//! Frame, number, `Hello` and `Capabilities` keep their bytes in every version; fields that a later version adds to these two
//! are appended, and an earlier version skips them. So two ends of any versions can report their versions to each other.
//!
//! # Numbers
//!
//! Requests count 1, 2, .. 65535, 1, ..; see [`next_number`]. `Hello` may have any number, and the count continues from
//! there. One request at a time: the host waits for the answer, or sends the same bytes again. [`Reason::uses_number`] defines
//! which answers consume a number.

use interp_core::{RunStart, command::Command, job::Header};
use serde::{Deserialize, Serialize};

pub use crate::journal::{JOURNAL_BYTES, Journal, job_mark};
pub use crate::manual::{
    Activity, Homing, JogWay, MotionEnd, MotionStatus, NO_AXIS, OFFSETS_BYTES_MAX, Offsets, WORK_OFFSETS,
};
pub use crate::profile::{Excess, PROFILE_BYTES_MAX, Profile, ProfileLimit};
pub use crate::reason::Reason;
pub use crate::records::{
    BOARD_NAME_MAX, Batch, CHUNK_WORDS_MAX, Clock, Description, FaultReport, PassDigest, Report, SAMPLES_MAX,
    SampleRecord, Status, StepSettings, StreamStatus, Words,
};
pub use crate::safety::{
    Configuration, DoorContact, InputLines, LinkTimeoutAction, OVERRIDE_MAX_PERCENT, OVERRIDE_NORMAL_PERCENT,
    PauseCause, ResetCause, SafetyStatus,
};
pub use crate::spindle::{AtSpeed, PWM_STEPS, SpindleOrder, SpindleSettings, Turning};
pub use crate::stored::{JOB_NAME_MAX, JobName, STORED_JOB_BYTES_MAX, StoredJob, StoredJobInfo};
use crate::{
    codes,
    records::HeaderFields,
    version::{PROTOCOL_VERSION, VersionMismatch},
};

/// Number of a `Nak` to an unreadable request.
pub const NO_NUMBER: u16 = 0;

/// The number of the request after this one.
#[must_use]
pub const fn next_number(number: u16) -> u16 {
    if number == u16::MAX { 1 } else { number + 1 }
}

/// Host to board.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(
    clippy::large_enum_variant,
    reason = "without an allocator a chunk can only be carried in place"
)]
pub enum Request {
    /// Opens a session. A session's number differs from that of the one before; the same one again is a retransmission.
    Hello {
        /// Version of the host.
        version: u16,
        /// Number of the session, any.
        session: u32,
    },
    /// Begins a job's upload; the job before is dropped, and the drives have the board's own settings again. Refused while a run is under way.
    JobBegin {
        /// All but the surface's data.
        #[serde(with = "HeaderFields")]
        header: Header,
        /// Data words that follow.
        words: u32,
        /// [`crate::digest::job_digest`] of the data words.
        #[serde(with = "postcard::fixint::le")]
        digest: u64,
    },
    /// The next data words, in order.
    JobChunk {
        /// Index of the first word.
        offset: u32,
        /// The words.
        words: Words,
    },
    /// All words were sent: check them and make the machine ready.
    JobEnd,
    /// Run the job from its beginning.
    Start,
    /// Feed hold: decelerate along the path and stop.
    Hold,
    /// Resume after a hold.
    Resume,
    /// Abort the run; the job stays loaded.
    Abort,
    /// Asks for the status.
    Status,
    /// Time base of the board. Refused while a run is under way.
    Clock(Clock),
    /// Lockstep: execute this number of further periods.
    Run {
        /// Periods, added to those left of the last `Run`.
        ticks: u32,
    },
    /// Reports of a run to the host.
    Report(Report),
    /// Settings of the axes' drives for the loaded job. Refused while a run is under way.
    StepConfig(StepSettings),
    /// Description of the machine around the board. Refused while a run is under way.
    Configure(Configuration),
    /// Drives on or off. On is refused while emergency stop or drive fault are asserted or latched; off while a run is
    /// under way, and clears the home.
    Drives {
        /// Whether to switch the drives on.
        on: bool,
    },
    /// Declares the position of the axes. Refused while a run is under way, or while the drives are off, because axes without drives may move.
    SetHome {
        /// Position, nm.
        home_nm: [i32; 3],
    },
    /// Clears the latch of emergency stop and drive fault. Refused while one of them is asserted. The drives stay off and the
    /// machine stays not homed.
    Acknowledge,
    /// Feed override, percent of the programmed feed; in force from the next period until the next `Override`.
    Override {
        /// Percent, at most [`OVERRIDE_MAX_PERCENT`].
        percent: u8,
    },
    /// Decelerate along the path, and abort the run; the job stays loaded.
    Stop,
    /// The inputs of a board that has no pins for them, as in QEMU; refused by others.
    Simulate {
        /// Inputs that are asserted from the next period on.
        lines: InputLines,
    },
    /// Asks for events of this session again.
    Repeat {
        /// Number of the first.
        event: u32,
        /// How many; fewer where the last one comes before.
        count: u8,
    },
    /// Asks for the profile that the board keeps.
    Profile,
    /// Keeps a profile beyond a power cut; none: forgets it. In force at once; the job has to be loaded again. Refused while a run is under way.
    SetProfile(Option<Profile>),
    /// Moves axes outside a job along a straight line, within the profile's limits, and within their travel once homed. Another one the same way keeps a continuous
    /// jog going. `Hold`, `Pause`, `Stop` and `Abort` end it along its ramp.
    Jog {
        /// How far.
        way: JogWay,
        /// Speed along the line, mm/s; the profile's velocities bound it, and the feed override at its begin applies.
        speed_mm_s: f32,
    },
    /// Homes axes by their switches, in the profile's order. Ends along the ramp when the host is not heard any more.
    Home {
        /// One bit each; none: all.
        axes: u8,
    },
    /// Moves an axis until the probe trips, at most by a distance.
    Probe {
        /// The axis, from 0.
        axis: u8,
        /// Greatest distance, nm; negative towards minus.
        nm: i32,
        /// Speed, mm/s.
        speed_mm_s: f32,
    },
    /// Asks for the axes' position and motion outside a job.
    Motion,
    /// Asks for work offsets and tool length.
    Offsets,
    /// Keeps work offsets and tool length beyond a power cut; the job has to be loaded again. Refused while a run is under way.
    SetOffsets(Offsets),
    /// Spindle and coolant of the loaded job: on from the start of each run to its end. Refused while a run is under way.
    Spindle(SpindleOrder),
    /// Hold, and leave the surface; `Resume` comes back to the same place.
    Pause,
    /// Run the job from a pass, or a place on it, as a run of the whole job would have it. Jobs with axis limits only.
    StartAt(#[serde(with = "codes::run_start")] RunStart),
    /// Asks for the run that was under way last, also before a power cut.
    Journal,
    /// Switches the spindle outside a run; off where the host is not heard for a second, and at the next start, which has the job's own.
    Turn {
        /// How it turns.
        turning: Turning,
        /// Speed, 1/min.
        rpm: u32,
    },
    /// Switches the coolant, in a run for the rest of it, outside as `Turn`.
    Coolant {
        /// Whether to switch it on.
        on: bool,
    },
    /// Keeps the loaded job beyond a power cut, in place of one of that name. Refused while a run is under way.
    StoreJob {
        /// Name of the stored job.
        name: JobName,
        /// Runs begin where the axes stand, not at the job's home.
        begins_anywhere: bool,
    },
    /// Deletes a stored job. Refused while a run is under way.
    DeleteJob {
        /// Its name.
        name: JobName,
    },
    /// Asks for a stored job.
    StoredJob {
        /// Number of the job, from 0.
        index: u8,
    },
    /// Loads a stored job, and starts it. The loaded job is replaced, also where the stored one is refused then: with words that are not those that were stored (`WrongDigest`), that
    /// the core refuses (`Job`), a spindle beyond the profile (`OutOfRange`), or a full queue of commands (`Busy`).
    StartJob {
        /// Its name.
        name: JobName,
        /// Go on where the last run of the job was cut short.
        resumes: bool,
    },
}

impl From<Command> for Request {
    fn from(command: Command) -> Self {
        match command {
            Command::Start => Self::Start,
            Command::Hold => Self::Hold,
            Command::Resume => Self::Resume,
            Command::Abort => Self::Abort,
            Command::Stop => Self::Stop,
            Command::Pause => Self::Pause,
        }
    }
}

impl Request {
    /// The operator's command that the request carries, if it carries one: the inverse of `Request::from`.
    #[must_use]
    pub const fn command(&self) -> Option<Command> {
        Some(match self {
            Self::Start => Command::Start,
            Self::Hold => Command::Hold,
            Self::Resume => Command::Resume,
            Self::Abort => Command::Abort,
            Self::Stop => Command::Stop,
            Self::Pause => Command::Pause,
            _ => return None,
        })
    }
}

/// The answer to `Hello`: identity and capacities of the board.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Capabilities {
    /// Number of the `Hello` that this answers.
    pub number: u16,
    /// Version of the board.
    pub version: u16,
    /// Session of the `Hello`.
    pub session: u32,
    /// Identity and capacities of the board.
    pub description: Description,
}

impl Capabilities {
    /// Checks that the board has this end's protocol version.
    ///
    /// # Errors
    /// The versions, where they differ.
    pub const fn check_version(&self) -> Result<(), VersionMismatch> {
        if self.version == PROTOCOL_VERSION {
            Ok(())
        } else {
            Err(VersionMismatch {
                host: PROTOCOL_VERSION,
                board: self.version,
            })
        }
    }
}

/// Board to host: answers to requests, and events.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[allow(
    clippy::large_enum_variant,
    reason = "without an allocator samples can only be carried in place"
)]
pub enum Reply {
    /// Answer to `Hello`, whatever the host's version.
    Capabilities(Capabilities),
    /// Executed, or queued where it takes effect with the next period.
    Ack {
        /// Number of the request.
        number: u16,
    },
    /// Refused; nothing changed, unless stated at the reason or the request.
    Nak {
        /// Number of the request; [`NO_NUMBER`] where it could not be read.
        number: u16,
        /// Why.
        reason: Reason,
    },
    /// Answer to `Status`.
    Status {
        /// Number of the request.
        number: u16,
        /// The status.
        status: Status,
    },
    /// Samples of the run, in order.
    Samples {
        /// Number of the event.
        event: u32,
        /// The samples.
        samples: Batch,
    },
    /// A pass is over.
    PassDigest {
        /// Number of the event.
        event: u32,
        /// The pass.
        pass: PassDigest,
    },
    /// The ticks of a `Run` are used up, or the run is over. The number of the event is the status's `events`.
    Halted(Status),
    /// Answer to `Profile`.
    Profile {
        /// Number of the request.
        number: u16,
        /// The profile; none where the board keeps none.
        profile: Option<Profile>,
    },
    /// Answer to `Motion`.
    Motion {
        /// Number of the request.
        number: u16,
        /// The axes outside a job.
        motion: MotionStatus,
    },
    /// Answer to `Offsets`.
    Offsets {
        /// Number of the request.
        number: u16,
        /// Work offsets and tool length.
        offsets: Offsets,
    },
    /// A streamed job: there is room for further words.
    Room {
        /// Number of the event.
        event: u32,
        /// Words up to which there is room.
        room: u32,
    },
    /// Answer to `Journal`.
    Journal {
        /// Number of the request.
        number: u16,
        /// The last run; none where the board has journalled none.
        journal: Option<Journal>,
    },
    /// Answer to `StoredJob`.
    StoredJob {
        /// Number of the request.
        number: u16,
        /// The job; none where there are fewer.
        job: Option<StoredJobInfo>,
        /// Words of the longest job for which there is room.
        room: u32,
    },
}

/// A payload with a correct CRC that is not a message of this version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unreadable {
    /// Number of the request; [`NO_NUMBER`] where the number is missing too, or for a reply.
    pub number: u16,
}

/// A request with its number: the payload of a frame to the board.
#[derive(Serialize)]
pub(crate) struct Numbered<'a> {
    pub(crate) number: u16,
    pub(crate) request: &'a Request,
}

/// Reads the payload of a frame from the host. Never panics.
///
/// # Errors
/// [`Unreadable`] for an unknown code, a value out of range, or bytes missing or left over.
// Its stack is for the reading alone, not for what the caller does with the request.
#[inline(never)]
pub fn read_request(payload: &[u8]) -> Result<(u16, Request), Unreadable> {
    let (number, rest) =
        postcard::take_from_bytes::<u16>(payload).map_err(|_| Unreadable { number: NO_NUMBER })?;
    match postcard::take_from_bytes::<Request>(rest) {
        Ok((request @ Request::Hello { .. }, _)) => Ok((number, request)),
        Ok((request, [])) => Ok((number, request)),
        _ => Err(Unreadable { number }),
    }
}

/// Reads the payload of a frame from the board. Never panics.
///
/// # Errors
/// [`Unreadable`] for an unknown code, a value out of range, or bytes missing or left over.
pub fn read_reply(payload: &[u8]) -> Result<Reply, Unreadable> {
    match postcard::take_from_bytes::<Reply>(payload) {
        Ok((reply @ Reply::Capabilities(_), _)) => Ok(reply),
        Ok((reply, [])) => Ok(reply),
        _ => Err(Unreadable { number: NO_NUMBER }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_the_same_on_both_sides() {
        for command in Command::ALL {
            assert_eq!(Request::from(command).command(), Some(command));
        }
        assert_eq!(Request::Status.command(), None);
    }

    #[test]
    fn numbers_skip_the_one_that_means_none() {
        assert_eq!(next_number(NO_NUMBER), 1);
        assert_eq!(next_number(1), 2);
        assert_eq!(next_number(u16::MAX), 1);
    }

    #[test]
    fn a_later_versions_hello_and_capabilities_are_read() {
        // number 1, code 0, version 300, session 7, then what only version 300 knows
        let hello = [1, 0, 0xac, 0x02, 7, 0xde, 0xad];
        assert_eq!(
            read_request(&hello),
            Ok((
                1,
                Request::Hello {
                    version: 300,
                    session: 7
                }
            ))
        );
        // code 0, number 1, version 300, session 7, firmware 1.2.3, board "b", five figures, then the unknown
        let capabilities = [
            0, 1, 0xac, 0x02, 7, 1, 2, 3, 1, b'b', 10, 2, 1, 64, 100, 0xde, 0xad,
        ];
        let Ok(Reply::Capabilities(capabilities)) = read_reply(&capabilities) else {
            panic!("not read");
        };
        assert_eq!(capabilities.description.period_us, 100);
        assert_eq!(
            capabilities.check_version(),
            Err(VersionMismatch {
                host: PROTOCOL_VERSION,
                board: 300
            })
        );
    }

    #[test]
    fn what_is_no_message_keeps_its_number() {
        assert_eq!(read_request(&[]), Err(Unreadable { number: NO_NUMBER }));
        assert_eq!(read_request(&[9]), Err(Unreadable { number: 9 }));
        // an unknown code, a missing field, a byte left over, an unknown clock
        for payload in [&[9, 23][..], &[9, 10], &[9, 4, 0], &[9, 9, 2]] {
            assert_eq!(
                read_request(payload),
                Err(Unreadable { number: 9 }),
                "{payload:?}"
            );
        }
    }

    #[test]
    fn codes_out_of_range_are_no_header() {
        let good = [1, 1, 0, 0, 0, 0, 1, 1];
        let rest = [0; 4 * 4 + 1 + 1 + 1 + 1 + 1 + 1 + 8];
        for (place, code) in [(2, 4), (3, 2), (4, 6), (5, 2)] {
            let mut payload = [0; 8 + 30];
            payload[..8].copy_from_slice(&good);
            payload[8..].copy_from_slice(&rest);
            assert!(read_request(&payload).is_ok());
            payload[place] = code;
            assert_eq!(read_request(&payload), Err(Unreadable { number: 1 }));
        }
    }
}
