//! Shared parts of the tests across crates: the host's end of the line, a mock machine that records its calls, and a
//! small job.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

pub mod golden;
pub mod motion;
pub mod sequences;

use controller::{
    jobs::JobStore,
    machine::{Busy, Instruction, Machine, describe},
    ram_flash::RamFlash,
    safety::{Order, may_start},
    storage::StorageError,
};
use interp_core::{
    AxisLimits, RunStart, encode,
    fault::{Fault, FaultKind},
    job::{Header, stream::RecordCopy},
    steps::{CheckedSteps, StepConfig},
};
use protocol::{
    PROTOCOL_VERSION,
    digest::job_digest,
    frame::{Decoder, FRAME_MAX, write_request},
    message::{
        Configuration, Description, DoorContact, InputLines, Journal, MotionStatus, NO_NUMBER, Offsets,
        Profile, Reason, Reply, Request, SafetyStatus, Status, StepSettings, Words, next_number, read_reply,
    },
};

/// One frame of a request with this number.
pub fn frame(number: u16, request: &Request) -> Vec<u8> {
    write_request(number, request, &mut [0; FRAME_MAX])
        .unwrap()
        .to_vec()
}

/// The host's end of the line.
#[derive(Debug, Default)]
pub struct Host {
    /// Number of the last request.
    pub number: u16,
    decoder: Decoder,
}

impl Host {
    /// The frame of the next request.
    pub fn next(&mut self, request: &Request) -> Vec<u8> {
        self.number = next_number(self.number);
        frame(self.number, request)
    }

    /// Decodes the board's messages in these bytes; panics if one is invalid.
    pub fn read(&mut self, bytes: &[u8]) -> Vec<Reply> {
        let mut replies = Vec::new();
        for byte in bytes {
            if let Some(frame) = self.decoder.push(*byte) {
                replies.push(read_reply(frame.unwrap().payload).unwrap());
            }
        }
        replies
    }
}

/// A `Hello` of this version.
pub const HELLO: Request = Request::Hello {
    version: PROTOCOL_VERSION,
    session: 1,
};

/// The requests after which a board with no input asserted may start a run.
pub const MAKE_READY: [Request; 2] = [Request::Drives { on: true }, Request::SetHome { home_nm: [0; 3] }];

/// Axis limits, the same for all axes, without bounds of the travel; home and safe height are above the [`dome`].
pub const LIMITS: AxisLimits = AxisLimits {
    velocity_mm_s: [100.0; 3],
    acceleration_mm_s2: [1000.0; 3],
    jerk_mm_s3: [20_000.0; 3],
    chord_mm: 0.005,
    overrun_mm: 0.0,
    travel_nm: [[i32::MIN, i32::MAX]; 3],
    home_nm: [0, 0, 50_000_000],
    plunge_mm: 2.0,
    end_nm: None,
    end_height_nm: 0,
    safe_z_nm: 40_000_000,
};

/// A profile with the limits of [`LIMITS`]: of a machine without switches, door contact and spindle.
pub const PROFILE: Profile = Profile {
    steps: StepSettings::DEFAULT,
    velocity_mm_s: LIMITS.velocity_mm_s,
    acceleration_mm_s2: LIMITS.acceleration_mm_s2,
    jerk_mm_s3: LIMITS.jerk_mm_s3,
    travel_nm: None,
    configuration: Configuration::DEFAULT,
    homing: None,
    probe_inverted: false,
    step_inverted: 0,
    enable_inverted: 0,
    door: DoorContact::None,
    spindle: None,
};

/// The safety status after [`MAKE_READY`].
pub const SAFE: SafetyStatus = SafetyStatus {
    drives_on: true,
    homed: true,
    ..SafetyStatus::DEFAULT
};

/// Whether a reply is the answer to a damaged frame, a `Nak` without a number.
pub fn is_bad_frame(reply: &Reply) -> bool {
    use protocol::message::Reason;
    matches!(
        reply,
        Reply::Nak {
            number: NO_NUMBER,
            reason: Reason::BadFrame { .. }
        }
    )
}

/// The requests that upload a job.
pub fn upload(header: Header, words: &[i32]) -> Vec<Request> {
    let count = u32::try_from(words.len()).unwrap();
    let mut requests = vec![Request::JobBegin {
        header,
        words: count,
        digest: job_digest(words),
    }];
    let mut offset = 0;
    for chunk in words.chunks(20) {
        requests.push(Request::JobChunk {
            offset,
            words: Words::new(chunk).unwrap(),
        });
        offset += u32::try_from(chunk.len()).unwrap();
    }
    requests.push(Request::JobEnd);
    requests
}

/// A shallow dome of 80 mm x 60 mm in about ten coarse passes: 54 words, some 900 samples.
pub fn dome() -> (Header, Vec<i32>) {
    scaled_dome(1.0)
}

/// The dome scaled by a factor; ball radius and scallop height limit are not scaled.
#[must_use]
pub fn scaled_dome(scale: f64) -> (Header, Vec<i32>) {
    let mut c = [[[0.0; 4]; 4]; 3];
    (c[0][0][0], c[0][1][0]) = (-40.0, 80.0);
    (c[1][0][0], c[1][0][1]) = (-30.0, 60.0);
    (c[2][0][0], c[2][1][0], c[2][2][0], c[2][0][1], c[2][0][2]) = (-5.0, 64.0, -64.0, 36.0, -36.0);
    let c = c.map(|axis| encode::substitute(&axis, [0.0, 1.0], [0.0, 1.0]));
    let c = c.map(|axis| axis.map(|row| row.map(|value| scale * value)));
    let header = Header {
        path_spans: 1,
        side_spans: 1,
        ball_radius_mm: 5.0,
        feed_mm_s: 1000.0,
        scallop_mm: 1.0,
        period_s: 0.001,
        links: 0,
        window: 0,
        strips: 0,
        axes: None,
        ..Header::default()
    };
    let one = encode::width(1.0).unwrap();
    let mut words = vec![one, one];
    words.extend(encode::polynomial(&c, Default::default()).unwrap().to_words());
    (header, words)
}

/// A call of a [`Mock`].
#[derive(Clone, Debug, PartialEq)]
pub enum Call {
    /// `load_begin` with this number of words.
    Begin(u32),
    /// `load_words`.
    Words(u32, Vec<i32>),
    /// `load_check`.
    Check(u32),
    /// `load_finish`.
    Finish,
    /// `set_steps`.
    Steps(CheckedSteps),
    /// `send`.
    Send(Instruction),
    /// `order`.
    Order(Order),
    /// `simulate`.
    Simulate(InputLines),
}

/// A machine that only records its calls.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mock {
    /// The status that it reports.
    pub status: Status,
    /// The recorded calls.
    pub calls: Vec<Call>,
    /// Whether its queue is full.
    pub busy: bool,
    /// Number of records of its job.
    pub records: u32,
    /// The record that its check refuses.
    pub bad: Option<u32>,
    /// The reason for which it refuses orders.
    pub unsafe_because: Option<Reason>,
    /// Whether its inputs are simulated, because it has no pins.
    pub simulated: bool,
    /// Number of signs of life of the host.
    pub heard: u32,
    /// The kept profile.
    pub profile: Option<Profile>,
    /// The kept work offsets.
    pub offsets: Offsets,
    /// The kept journal.
    pub journal: Option<Journal>,
    /// A job store without room for any job.
    pub jobs: JobStore<RamFlash<0>>,
}

impl Machine for Mock {
    fn description(&mut self) -> Description {
        describe([1, 2, 3], "mock", 1000, 1000)
    }

    fn status(&mut self) -> Status {
        self.status
    }

    fn load_begin(&mut self, _: &Header, words: u32) -> Result<(), Fault> {
        self.calls.push(Call::Begin(words));
        Ok(())
    }

    fn load_words(&mut self, offset: u32, words: &[i32]) -> Result<(), Fault> {
        self.calls.push(Call::Words(offset, words.to_vec()));
        Ok(())
    }

    fn load_room(&mut self) -> [u32; 2] {
        [0; 2]
    }

    fn load_copy(&mut self, record: u32) -> Result<RecordCopy, Fault> {
        Err(Fault::new(FaultKind::BadLength, record as f32))
    }

    fn load_judged(&mut self, _: u32, checked: Result<(), Fault>) -> Result<(), Fault> {
        checked
    }

    fn load_records(&mut self) -> u32 {
        self.records
    }

    fn load_check(&mut self, record: u32) -> Result<(), Fault> {
        self.calls.push(Call::Check(record));
        if self.bad == Some(record) {
            Err(Fault::new(FaultKind::BadPatch, 0.5))
        } else {
            Ok(())
        }
    }

    fn load_finish(&mut self) -> Result<(), Fault> {
        self.calls.push(Call::Finish);
        Ok(())
    }

    fn profile(&self) -> Option<&Profile> {
        self.profile.as_ref()
    }

    fn keep_profile(&mut self, profile: Option<&Profile>) -> Result<(), StorageError> {
        self.profile = profile.copied();
        Ok(())
    }

    fn motion(&mut self) -> MotionStatus {
        MotionStatus::default()
    }

    fn offsets(&mut self) -> Offsets {
        self.offsets
    }

    fn keep_offsets(&mut self, offsets: &Offsets) -> Result<(), StorageError> {
        self.offsets = *offsets;
        Ok(())
    }

    fn journal(&mut self) -> Option<Journal> {
        self.journal
    }

    fn keep_journal(&mut self, journal: &Journal) -> Result<(), StorageError> {
        self.journal = Some(*journal);
        Ok(())
    }

    fn end_journal(&mut self) -> Result<(), StorageError> {
        Ok(())
    }

    fn prepare_journal(&mut self, _: Option<&Journal>) {}

    type JobFlash = RamFlash<0>;

    fn jobs(&mut self) -> &mut JobStore<RamFlash<0>> {
        &mut self.jobs
    }

    fn loaded(&mut self) -> Option<(Header, u32)> {
        None
    }

    fn loaded_words(&mut self, _: u32, _: &mut [i32]) -> usize {
        0
    }

    fn place(&mut self) -> Option<RunStart> {
        None
    }

    fn own_steps(&mut self) -> StepConfig {
        StepConfig::DEFAULT
    }

    fn set_steps(&mut self, checked: &CheckedSteps) -> Result<(), Fault> {
        self.calls.push(Call::Steps(*checked));
        Ok(())
    }

    fn send(&mut self, command: Instruction) -> Result<(), Busy> {
        if self.busy {
            return Err(Busy);
        }
        self.calls.push(Call::Send(command));
        Ok(())
    }

    fn order(&mut self, order: Order) -> Result<(), Reason> {
        if let Some(reason) = self.unsafe_because {
            return Err(reason);
        }
        self.calls.push(Call::Order(order));
        Ok(())
    }

    fn may_start(&mut self) -> Result<(), Reason> {
        may_start(&self.status.safety)
    }

    fn may_start_next(&mut self, _: Option<[i32; 3]>) -> Result<(), Reason> {
        self.may_start()
    }

    fn heard(&mut self) {
        self.heard += 1;
    }

    fn simulate(&mut self, lines: InputLines) -> bool {
        if self.simulated {
            self.calls.push(Call::Simulate(lines));
        }
        self.simulated
    }

    /// Always false, because instructions are executed immediately.
    fn instructions_wait(&mut self) -> bool {
        false
    }

    fn start_waits(&mut self) -> bool {
        false
    }
}
