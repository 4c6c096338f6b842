//! The structures that messages are made of, and their bytes.
//!
//! Field after field, in the order written here, without gaps. `u16`, `u32`, `i32` are varints, `f32` and the digests
//! have fixed width; see [`crate::message`] for the encoding.

use heapless::{String, Vec};
use interp_core::{
    fault::{Fault, FaultKind},
    job::{AxisLimits, Header, Pattern, Spacing, SurfaceKind, ToolSide},
    sample::{Sample, SpanParameter, State},
    steps::{AxisSteps, StepConfig},
};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser::SerializeSeq};

use crate::{
    codes,
    digest::Digest,
    safety::{InputLines, SafetyStatus},
};

/// Words a `JobChunk` may carry: 256 bytes, so that storing a chunk delays the sample timer by microseconds only.
pub const CHUNK_WORDS_MAX: usize = 64;

/// Samples a `Samples` message may carry. Four take about as many bytes as a full chunk.
pub const SAMPLES_MAX: usize = 4;

/// Longest name of a board, bytes.
pub const BOARD_NAME_MAX: usize = 24;

/// Time base of the board.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Clock {
    /// 0: every period of the sample timer is one step.
    #[default]
    Free,
    /// 1: periods pass only while ticks granted by `Run` are left.
    Lockstep,
}

/// Reports of a run to the host while it is under way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Report {
    /// 0: one `PassDigest` per pass.
    #[default]
    Digests,
    /// 1: a `PassDigest` per pass, and every sample.
    Samples,
}

/// Identity and capacities of the board: the machine's part of `Capabilities`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// Version of the firmware: major, minor, patch.
    pub firmware: [u16; 3],
    /// Display name of the board.
    pub board: String<BOARD_NAME_MAX>,
    /// Maximum data words of a job that is not streamed.
    pub store_words: u32,
    /// Maximum polynomial patches in these words, together with the span widths.
    pub patches_max_polynomial: u32,
    /// Maximum rational patches in these words.
    pub patches_max_rational: u32,
    /// Words a `JobChunk` may carry.
    pub chunk_words_max: u16,
    /// Period of the sample timer, microseconds.
    pub period_us: u32,
}

/// A fault on the wire. The code is kept as a number, because a newer board may have kinds unknown to the host.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FaultReport {
    /// Code of the [`FaultKind`].
    pub code: u8,
    /// The offending value; unit and meaning are given at each [`FaultKind`].
    pub value: f32,
}

impl FaultReport {
    /// The kind, where the code is known.
    #[must_use]
    pub fn kind(self) -> Option<FaultKind> {
        FaultKind::from_code(self.code)
    }

    /// The inputs in the value, where the kind is that of an input.
    #[must_use]
    pub fn lines(self) -> InputLines {
        match self.kind() {
            Some(
                FaultKind::EmergencyStop
                | FaultKind::LimitSwitch
                | FaultKind::DriveFault
                | FaultKind::DoorOpen,
            ) => {
                // Saturates, so that every value yields inputs.
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a set of bits, exact as f32"
                )]
                let bits = self.value as u16;
                InputLines(bits).and(InputLines::ALL)
            }
            _ => InputLines::NONE,
        }
    }
}

impl From<Fault> for FaultReport {
    fn from(fault: Fault) -> Self {
        Self {
            code: fault.kind.code(),
            value: fault.value,
        }
    }
}

/// Status of the board and its run. Counters restart with each run, except `frames_bad`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// State after the last step.
    #[serde(with = "codes::state")]
    pub state: State,
    /// The fault, while the state is faulted.
    pub fault: Option<FaultReport>,
    /// Time base of the board.
    pub clock: Clock,
    /// Remaining ticks of the last `Run`.
    pub credit: u32,
    /// Reports of a run to the host.
    pub report: Report,
    /// Tick of the last sample.
    pub tick: u32,
    /// Pass of the last sample; while faulted, of the fault.
    pub pass: u32,
    /// Path parameter of the last sample; while faulted, of the fault.
    #[serde(with = "codes::span_parameter")]
    pub path: SpanParameter,
    /// Side parameter of the last sample; while faulted, of the fault.
    #[serde(with = "codes::span_parameter")]
    pub side: SpanParameter,
    /// Samples of the run so far: those that the digest covers.
    pub samples: u32,
    /// Digest of the whole run so far.
    #[serde(with = "postcard::fixint::le")]
    pub digest: u64,
    /// Path interval after the last finished pass, in units of the side parameter.
    pub interval: f32,
    /// Ticks of the sample timer that were missed, and plannings that were not complete at the next one.
    pub deadline_misses: u32,
    /// Maximum CPU cycles of a tick; 0 where the board cannot measure.
    pub tick_cycles_max: u32,
    /// Samples (and other events) lost because the queue to the link was full.
    pub samples_lost: u32,
    /// Unreadable frames from the host since power-up.
    pub frames_bad: u32,
    /// `Halted` since power-up, modulo 2^32; of a `Halted` its own number.
    pub halts: u32,
    /// Number of the last event of this session; of a `Halted` its own.
    pub events: u32,
    /// Digest of the settings of the drives in force: [`StepSettings::digest`].
    pub steps: u32,
    /// Digest of the profile that the board keeps, [`crate::message::Profile::digest`]; 0 where it keeps none.
    pub profile: u32,
    /// Progress of the job's upload.
    pub stream: StreamStatus,
    /// Inputs, drives, home.
    pub safety: SafetyStatus,
}

/// Progress of a job's upload, which for a streamed job goes on while it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StreamStatus {
    /// Data words received: the next chunk's offset.
    pub received: u32,
    /// Data words up to which the store has room now.
    pub room: u32,
    /// Periods in which the run waited for words, not counted as ticks.
    pub starved: u32,
}

impl Default for Status {
    fn default() -> Self {
        Self {
            state: State::Idle,
            fault: None,
            clock: Clock::Free,
            credit: 0,
            report: Report::Digests,
            tick: 0,
            pass: 0,
            path: SpanParameter::default(),
            side: SpanParameter::default(),
            samples: 0,
            digest: crate::digest::Digest::EMPTY,
            interval: 0.0,
            deadline_misses: 0,
            tick_cycles_max: 0,
            samples_lost: 0,
            frames_bad: 0,
            halts: 0,
            events: 0,
            steps: 0,
            profile: 0,
            stream: StreamStatus::default(),
            safety: SafetyStatus::DEFAULT,
        }
    }
}

/// One finished or aborted pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PassDigest {
    /// Pass, from 0.
    pub pass: u32,
    /// Tick of its first sample.
    pub first_tick: u32,
    /// Its samples.
    pub samples: u32,
    /// Digest of the whole run up to the pass's end: the first pass with a different digest is the first that differs.
    #[serde(with = "postcard::fixint::le")]
    pub digest: u64,
    /// Path interval that followed from it, in units of the side parameter; that of the previous pass where this one was
    /// aborted.
    pub interval: f32,
}

/// Serde mirror of [`Sample`]; does not compile if the core's structure gains a field.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Sample")]
struct SampleFields {
    tick: u32,
    #[serde(with = "codes::state")]
    state: State,
    pass: u32,
    #[serde(with = "codes::span_parameter")]
    path: SpanParameter,
    #[serde(with = "codes::span_parameter")]
    side: SpanParameter,
    feed_mm_s: f32,
    cc_nm: [i32; 3],
    cl_nm: [i32; 3],
    inv_interval_sq: f32,
}

/// A [`Sample`] on the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SampleRecord(#[serde(with = "SampleFields")] pub Sample);

/// Up to [`SAMPLES_MAX`] samples, the oldest first: their number, then each.
pub type Batch = Vec<SampleRecord, SAMPLES_MAX>;

/// Serde mirror of [`Header`]; does not compile if the core's structure gains a field.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Header")]
pub(crate) struct HeaderFields {
    #[serde(with = "codes::surface_kind")]
    kind: SurfaceKind,
    #[serde(with = "codes::pattern")]
    pattern: Pattern,
    #[serde(with = "codes::spacing")]
    spacing: Spacing,
    #[serde(with = "codes::tool_side")]
    tool_side: ToolSide,
    path_spans: u16,
    side_spans: u16,
    ball_radius_mm: f32,
    feed_mm_s: f32,
    scallop_mm: f32,
    period_s: f32,
    edges: u16,
    links: u16,
    window: u16,
    strips: u16,
    #[serde(with = "axes")]
    axes: Option<AxisLimits>,
}

/// Serde mirror of [`AxisLimits`]; does not compile if the core's structure gains a field.
#[derive(Serialize, Deserialize)]
#[serde(remote = "AxisLimits")]
struct AxisLimitsFields {
    velocity_mm_s: [f32; 3],
    acceleration_mm_s2: [f32; 3],
    jerk_mm_s3: [f32; 3],
    chord_mm: f32,
    travel_nm: [[i32; 2]; 3],
    home_nm: [i32; 3],
    end_nm: Option<[i32; 3]>,
    end_height_nm: i32,
    plunge_mm: f32,
    safe_z_nm: i32,
    overrun_mm: f32,
}

/// An option of the axes' limits: 0, or 1 and the fields.
mod axes {
    use super::{AxisLimits, AxisLimitsFields, Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    struct Record(#[serde(with = "AxisLimitsFields")] AxisLimits);

    pub(super) fn serialize<S: Serializer>(
        axes: &Option<AxisLimits>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        axes.map(Record).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<AxisLimits>, D::Error> {
        let record = Option::<Record>::deserialize(deserializer)?;
        Ok(record.map(|Record(axes)| axes))
    }
}

/// Settings of the axes' drives: for each axis the steps (`u32`), the millimetres for these steps (`u32`), and whether its direction is inverted
/// (a byte, 0 or 1); then the pulse length (`u8`) and the direction set-up time (`u16`), slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepSettings {
    axes: [(u32, u32, bool); 3],
    pulse_slots: u8,
    setup_slots: u16,
}

impl StepSettings {
    /// [`StepConfig::DEFAULT`].
    pub const DEFAULT: Self = {
        let StepConfig {
            axes: [x, y, z],
            pulse_slots,
            setup_slots,
        } = StepConfig::DEFAULT;
        Self {
            axes: [
                (x.steps, x.mm, x.inverted),
                (y.steps, y.mm, y.inverted),
                (z.steps, z.mm, z.inverted),
            ],
            pulse_slots,
            setup_slots,
        }
    };

    /// Digest of every value, by which host and board compare the settings in force: the [`Digest`] of three words for each axis and two for the times,
    /// its halves combined by exclusive or.
    #[must_use]
    pub const fn digest(&self) -> u32 {
        let mut digest = Digest::new();
        let mut axes: &[(u32, u32, bool)] = &self.axes;
        while let [(steps, mm, inverted), rest @ ..] = axes {
            digest.word(*steps);
            digest.word(*mm);
            digest.word(*inverted as u32);
            axes = rest;
        }
        digest.word(self.pulse_slots as u32);
        digest.word(self.setup_slots as u32);
        let value = digest.value();
        ((value >> 32) ^ (value & 0xffff_ffff)) as u32
    }
}

impl From<StepConfig> for StepSettings {
    fn from(config: StepConfig) -> Self {
        Self {
            axes: config.axes.map(|axis| (axis.steps, axis.mm, axis.inverted)),
            pulse_slots: config.pulse_slots,
            setup_slots: config.setup_slots,
        }
    }
}

impl From<StepSettings> for StepConfig {
    fn from(settings: StepSettings) -> Self {
        Self {
            axes: settings
                .axes
                .map(|(steps, mm, inverted)| AxisSteps { steps, mm, inverted }),
            pulse_slots: settings.pulse_slots,
            setup_slots: settings.setup_slots,
        }
    }
}

/// Up to [`CHUNK_WORDS_MAX`] data words: their number, then four bytes each, low byte first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Words(Vec<i32, CHUNK_WORDS_MAX>);

impl Words {
    /// A chunk of these words; none if they exceed [`CHUNK_WORDS_MAX`].
    #[must_use]
    pub fn new(words: &[i32]) -> Option<Self> {
        Vec::from_slice(words).ok().map(Self)
    }

    /// The words.
    #[must_use]
    pub fn as_slice(&self) -> &[i32] {
        &self.0
    }
}

impl Serialize for Words {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut sequence = serializer.serialize_seq(Some(self.0.len()))?;
        for word in &self.0 {
            sequence.serialize_element(&word.to_le_bytes())?;
        }
        sequence.end()
    }
}

impl<'de> Deserialize<'de> for Words {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;

        impl<'de> de::Visitor<'de> for Visitor {
            type Value = Words;

            fn expecting(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(formatter, "at most {CHUNK_WORDS_MAX} words")
            }

            fn visit_seq<A: de::SeqAccess<'de>>(self, mut sequence: A) -> Result<Words, A::Error> {
                let mut words = Vec::new();
                while let Some(bytes) = sequence.next_element::<[u8; 4]>()? {
                    if words.push(i32::from_le_bytes(bytes)).is_err() {
                        return Err(de::Error::custom("too many words"));
                    }
                }
                Ok(Words(words))
            }
        }

        deserializer.deserialize_seq(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digest::job_digest;

    #[test]
    fn settings_have_the_digest_of_their_words() {
        let mut config = StepConfig::DEFAULT;
        (config.axes[1].mm, config.axes[2].inverted) = (7, true);
        (config.pulse_slots, config.setup_slots) = (3, 258);
        let value = job_digest(&[400, 1, 0, 400, 7, 0, 400, 1, 1, 3, 258]);
        let [low, high] = [value & 0xffff_ffff, value >> 32];
        assert_eq!(u64::from(StepSettings::from(config).digest()), low ^ high);
    }
}
