//! The reasons of a `Nak`: why the board refused a request.

use core::fmt;

use interp_core::{NM_PER_MM, fault::FaultKind, sample::State};
use serde::{Deserialize, Serialize};

use crate::{
    codes,
    frame_error::FrameError,
    profile::{Excess, ProfileLimit},
    records::{Clock, FaultReport},
    version::VersionMismatch,
};

/// Why a request was refused. A refused request changes nothing, unless stated here. The codes on the wire count from 0 in this order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Reason {
    /// 0: a frame was damaged; repeat the unanswered request.
    BadFrame {
        /// The frame's error.
        error: FrameError,
    },
    /// 1: the frame was valid, but is not a message of this version.
    Unreadable,
    /// 2: no session is open; say `Hello` first.
    SayHello,
    /// 3: the host of this session speaks another version.
    Version {
        /// Version of the host.
        host: u16,
        /// Version of the board.
        board: u16,
    },
    /// 4: neither the next request nor the last one again.
    OutOfOrder {
        /// The number that the next request must have.
        expected: u16,
    },
    /// 5: not permitted in this state.
    WrongState {
        /// The state.
        #[serde(with = "codes::state")]
        state: State,
    },
    /// 6: `Run` without lockstep.
    WrongClock {
        /// Time base of the board.
        clock: Clock,
    },
    /// 7: the command queue is full, or it holds a command for the job that this request would replace, or a start waits that was checked by what this
    /// request would change; ask again, with a new number.
    Busy,
    /// 8: the core refuses the job. From `JobBegin` and `JobChunk` nothing has changed; from `JobEnd` the upload is aborted
    /// and the machine is idle.
    Job {
        /// The fault of the job.
        fault: FaultReport,
        /// The record of the surface data, where the fault concerns one.
        record: Option<u32>,
    },
    /// 9: more words than the store holds, or has room for now.
    TooLong {
        /// Capacity, words.
        limit: u32,
        /// Words asked for.
        wanted: u32,
    },
    /// 10: `JobChunk` or `JobEnd` without `JobBegin`.
    NoUpload,
    /// 11: not the next chunk.
    WrongOffset {
        /// Offset that the next chunk must have.
        expected: u32,
    },
    /// 12: `JobEnd` before all words were received; the upload may continue.
    Incomplete {
        /// Words announced.
        wanted: u32,
        /// Words received.
        received: u32,
    },
    /// 13: the words are not those announced; the upload is aborted, the machine is idle.
    WrongDigest {
        /// Digest announced.
        #[serde(with = "postcard::fixint::le")]
        wanted: u64,
        /// Digest of the words received.
        #[serde(with = "postcard::fixint::le")]
        received: u64,
    },
    /// 14: refused because of inputs, latch or homing.
    Unsafe {
        /// The fault that would stop a run or prevents its start: `emergency-stop`, `limit-switch`,
        /// `drive-fault` with the inputs, `not-homed`.
        fault: FaultReport,
    },
    /// 15: the drives are off.
    DrivesOff,
    /// 16: a value beyond its range.
    OutOfRange {
        /// Maximum value.
        most: u32,
        /// Requested value.
        wanted: u32,
    },
    /// 17: not supported by this board.
    Unsupported,
    /// 18: a start while the axes are not at the job's home.
    NotAtHome {
        /// The job's home, nm.
        home_nm: [i32; 3],
        /// Position of the axes, nm; none after a job without axis limits, which leaves it unknown.
        stands_nm: Option<[i32; 3]>,
    },
    /// 19: the event asked for is not kept any more, or was not sent yet.
    EventGone {
        /// The earliest event that is kept; the number of the next one where none is.
        first: u32,
    },
    /// 20: a job, or a setting for it, exceeds the profile that the board keeps.
    BeyondProfile {
        /// What does.
        excess: Excess,
    },
    /// 21: a profile with a value out of range, or with a velocity at which an axis has more steps than a period holds.
    BadProfile,
    /// 22: the board cannot write its settings: they are as before.
    Storage,
    /// 23: the job was loaded under another profile, or placed by other offsets, and has to be loaded or stored again.
    OtherProfile,
    /// 24: a job without axis limits, on a board with drives: it would begin with a jump of the position and without a ramp.
    NoLimits,
    /// 25: the axes move outside a job.
    Moving,
    /// 26: the board keeps no profile, and so knows no limits to move an axis within.
    NoProfile,
    /// 27: a jog or probe move would leave the travel.
    BeyondTravel {
        /// The axis, from 0.
        axis: u8,
        /// The travel, nm.
        travel_nm: [i32; 2],
        /// The requested position, nm; at the end of the range where it is beyond that of an `i32`.
        wanted_nm: i32,
    },
    /// 28: the profile describes no homing by switches.
    NoHoming,
    /// 29: the probe is tripped before the probe move.
    ProbeTripped,
    /// 30: the profile describes no spindle.
    NoSpindle,
    /// 31: a start of a streamed job whose first rows were overwritten: it has to be loaded again.
    RowsGone,
    /// 32: a start at a pass, of a job without axis limits or of a streamed one.
    WholeOnly,
    /// 33: a probe move while the spindle turns.
    SpindleTurns,
    /// 34: a jog at a feed override of 0.
    NoFeed,
    /// 35: no job of this name is stored.
    NoStoredJob,
    /// 36: the flash has no room for the job.
    NoRoom {
        /// Words of the longest job for which there is room.
        words: u32,
    },
    /// 37: the last run was not one of this job, or came to its end.
    NothingToResume,
    /// 38: the speed of a jog or probe move is not a finite one above 0.
    BadSpeed {
        /// The requested speed, mm/s.
        mm_s: f32,
    },
}

impl Reason {
    /// The code on the wire, as in the variants' documentation.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Self::BadFrame { .. } => 0,
            Self::Unreadable => 1,
            Self::SayHello => 2,
            Self::Version { .. } => 3,
            Self::OutOfOrder { .. } => 4,
            Self::WrongState { .. } => 5,
            Self::WrongClock { .. } => 6,
            Self::Busy => 7,
            Self::Job { .. } => 8,
            Self::TooLong { .. } => 9,
            Self::NoUpload => 10,
            Self::WrongOffset { .. } => 11,
            Self::Incomplete { .. } => 12,
            Self::WrongDigest { .. } => 13,
            Self::Unsafe { .. } => 14,
            Self::DrivesOff => 15,
            Self::OutOfRange { .. } => 16,
            Self::Unsupported => 17,
            Self::NotAtHome { .. } => 18,
            Self::EventGone { .. } => 19,
            Self::BeyondProfile { .. } => 20,
            Self::BadProfile => 21,
            Self::Storage => 22,
            Self::OtherProfile => 23,
            Self::NoLimits => 24,
            Self::Moving => 25,
            Self::NoProfile => 26,
            Self::BeyondTravel { .. } => 27,
            Self::NoHoming => 28,
            Self::ProbeTripped => 29,
            Self::NoSpindle => 30,
            Self::RowsGone => 31,
            Self::WholeOnly => 32,
            Self::SpindleTurns => 33,
            Self::NoFeed => 34,
            Self::NoStoredJob => 35,
            Self::NoRoom { .. } => 36,
            Self::NothingToResume => 37,
            Self::BadSpeed { .. } => 38,
        }
    }

    /// Whether the request counts as answered, so that the next one needs the next number. Otherwise the board ignores
    /// the request.
    #[must_use]
    pub const fn uses_number(self) -> bool {
        !matches!(
            self,
            Self::BadFrame { .. }
                | Self::Unreadable
                | Self::SayHello
                | Self::Version { .. }
                | Self::OutOfOrder { .. }
        )
    }
}

/// The fault that prevents the request, and the inputs in its value.
fn unsafe_because(fault: FaultReport, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
    let name = fault.kind().map_or("unknown fault", FaultKind::name);
    write!(formatter, "not safe: {name} (code {})", fault.code)?;
    for input in fault.lines().names() {
        write!(formatter, ", {input}")?;
    }
    Ok(())
}

/// Positions in millimetres, with nanometre resolution.
struct Mm<const N: usize>([i32; N]);

impl<const N: usize> fmt::Display for Mm<N> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (axis, nm) in self.0.into_iter().enumerate() {
            let separator = if axis == 0 { "" } else { ", " };
            let sign = if nm < 0 { "-" } else { "" };
            let (mm, rest) = (nm.unsigned_abs() / NM_PER_MM, nm.unsigned_abs() % NM_PER_MM);
            write!(formatter, "{separator}{sign}{mm}.{rest:06}")?;
        }
        Ok(())
    }
}

/// The required and the actual position of the axes.
fn not_at_home(
    home_nm: [i32; 3],
    stands_nm: Option<[i32; 3]>,
    formatter: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    write!(formatter, "the job begins at {} mm, ", Mm(home_nm))?;
    match stands_nm {
        Some(at_nm) => write!(formatter, "the axes stand at {} mm", Mm(at_nm)),
        None => write!(
            formatter,
            "and nobody knows where the axes stand since a run without limits"
        ),
    }
}

/// The position that is outside the travel.
fn beyond_travel(
    axis: u8,
    [least, most]: [i32; 2],
    wanted_nm: i32,
    formatter: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    let axis = ["x", "y", "z"].get(usize::from(axis)).copied().unwrap_or("?");
    write!(
        formatter,
        "{axis} = {} mm is outside its travel of {} to {} mm",
        Mm([wanted_nm]),
        Mm([least]),
        Mm([most])
    )
}

/// What of a job exceeds the profile.
fn beyond_profile(excess: Excess, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
    let Excess {
        limit,
        axis,
        most,
        wanted,
    } = excess;
    write!(formatter, "beyond the machine's profile: {}", limit.name())?;
    match limit {
        ProfileLimit::Steps | ProfileLimit::Homing => Ok(()),
        _ => {
            let axis = usize::from(axis);
            let axis = ["x", "y", "z"].get(axis).copied().unwrap_or("?");
            write!(formatter, ": {wanted} on {axis}, the profile has {most}")
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::BadFrame { error } => write!(formatter, "the board received a damaged frame: {error}"),
            Self::Unreadable => write!(formatter, "the board cannot read this message"),
            Self::SayHello => write!(formatter, "no session is open"),
            Self::Version { host, board } => VersionMismatch { host, board }.fmt(formatter),
            Self::OutOfOrder { expected } => write!(formatter, "the board expected request {expected}"),
            Self::WrongState { state } => {
                write!(formatter, "not possible while the machine is {}", state.name())
            }
            Self::WrongClock { .. } => write!(formatter, "`Run` is possible in lockstep only"),
            Self::Busy => write!(formatter, "commands still wait for the next period"),
            Self::Job { fault, record } => {
                let name = fault.kind().map_or("unknown fault", |kind| kind.name());
                write!(
                    formatter,
                    "the board refuses the job: {name} (code {}), value {}",
                    fault.code, fault.value
                )?;
                record.map_or(Ok(()), |record| write!(formatter, ", record {record}"))
            }
            Self::TooLong { limit, wanted } => {
                write!(formatter, "{wanted} words do not fit into {limit}")
            }
            Self::NoUpload => write!(formatter, "no job is being uploaded"),
            Self::WrongOffset { expected } => {
                write!(formatter, "the next chunk must begin at word {expected}")
            }
            Self::Incomplete { wanted, received } => {
                write!(formatter, "{received} of {wanted} words arrived")
            }
            Self::WrongDigest { wanted, received } => {
                write!(
                    formatter,
                    "the words' digest is {received:016x}, announced was {wanted:016x}"
                )
            }
            Self::Unsafe { fault } => unsafe_because(fault, formatter),
            Self::DrivesOff => write!(formatter, "the drives are off"),
            Self::OutOfRange { most, wanted } => write!(formatter, "{wanted} is more than {most}"),
            Self::Unsupported => write!(formatter, "this board cannot do that"),
            Self::NotAtHome { home_nm, stands_nm } => not_at_home(home_nm, stands_nm, formatter),
            Self::EventGone { first } => write!(
                formatter,
                "the board keeps its events from number {first} on only"
            ),
            Self::BeyondProfile { excess } => beyond_profile(excess, formatter),
            Self::BadProfile => write!(
                formatter,
                "a value of the profile is out of range, or an axis is too fast for its steps"
            ),
            Self::Storage => write!(formatter, "the board cannot write its settings"),
            Self::OtherProfile => write!(
                formatter,
                "the job was loaded under another profile, or placed by other offsets"
            ),
            Self::NoLimits => write!(
                formatter,
                "the job has no axis limits, and the board has drives: they would jump to its first point"
            ),
            Self::Moving => write!(formatter, "the axes move outside a job"),
            Self::NoProfile => write!(
                formatter,
                "the board keeps no machine profile, so it knows no limits to move the axes within"
            ),
            Self::BeyondTravel {
                axis,
                travel_nm,
                wanted_nm,
            } => beyond_travel(axis, travel_nm, wanted_nm, formatter),
            Self::NoHoming => write!(formatter, "the machine's profile describes no homing by switches"),
            Self::NoSpindle => write!(formatter, "the machine's profile describes no spindle"),
            Self::ProbeTripped => write!(formatter, "the probe is tripped before it moves"),
            Self::RowsGone => write!(
                formatter,
                "the first part of the job was overwritten while it ran: load it again"
            ),
            Self::SpindleTurns => write!(formatter, "the spindle turns"),
            Self::NoFeed => write!(formatter, "the feed override is 0 %"),
            Self::WholeOnly => write!(
                formatter,
                "only a job with axis limits that fits into the board's store can begin at a pass"
            ),
            Self::NoStoredJob => write!(formatter, "the board keeps no job of this name"),
            Self::NoRoom { words } => write!(
                formatter,
                "the board's flash has room for a job of {words} words only"
            ),
            Self::NothingToResume => write!(
                formatter,
                "the last run was not one of this job, or came to its end"
            ),
            Self::BadSpeed { mm_s } => write!(formatter, "the speed must be above 0 mm/s, not {mm_s}"),
        }
    }
}
