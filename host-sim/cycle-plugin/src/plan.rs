//! Input of the plugin: the image's code, the stage of each instruction, the tasks that are recorded.
//!
//! The plan contains the code because QEMU's function that reads code differs between versions.

/// First word of the file: `ISO` and a version.
const MAGIC: u32 = 0x4953_4f07;

/// Words of the header, before the code.
const HEAD_WORDS: usize = 6;

/// Number of stages.
pub const STAGES: usize = 11;

/// A stage of the sample task; the planning task is [`Stage::Feed`] and what it calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Stage {
    /// Step 2: the parameter's step for one period's arc.
    Step = 0,
    /// Step 2: the surface at the new parameter.
    Surface = 1,
    /// Step 3: fit of the ball, cutter location (offset).
    Offset = 2,
    /// Step 4: candidate of the path interval.
    Interval = 3,
    /// Change of patch: a patch is reduced to its curve at the pass's side parameter.
    PatchChange = 4,
    /// Change of pass: a pass begins or ends.
    PassChange = 5,
    /// The rest of the task.
    Rest = 6,
    /// Exception entry and exit.
    Exception = 7,
    /// Step pulses of the axes in the next period.
    Pulses = 8,
    /// The feed within the axis limits, look-ahead, links.
    Feed = 9,
    /// A sample is added to the run's digest: nonzero in exactly those ticks that yield a sample.
    Digest = 10,
}

impl Stage {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; STAGES] = [
        Self::Step,
        Self::Surface,
        Self::Offset,
        Self::Interval,
        Self::PatchChange,
        Self::PassChange,
        Self::Rest,
        Self::Exception,
        Self::Pulses,
        Self::Feed,
        Self::Digest,
    ];

    /// Name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Surface => "surface",
            Self::Offset => "offset",
            Self::Interval => "interval",
            Self::PatchChange => "patch change",
            Self::PassChange => "pass change",
            Self::Rest => "everything else",
            Self::Exception => "exception entry and exit",
            Self::Pulses => "pulses",
            Self::Feed => "feed",
            Self::Digest => "digest",
        }
    }

    /// Whether its callees are charged to it, whatever stage they have.
    #[must_use]
    pub const fn keeps_callees(self) -> bool {
        matches!(self, Self::PatchChange | Self::PassChange)
    }

    const fn from_byte(byte: u8) -> Option<Self> {
        if (byte as usize) < STAGES {
            Some(Self::ALL[byte as usize])
        } else {
            None
        }
    }
}

/// The plugin's plan.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// Address of the code, which begins with the vector table.
    pub base: u32,
    /// Exception number of the sample task: its interrupt number plus 16.
    pub exception: u32,
    /// Exception number of the planning task; 0 without one.
    pub planning: u32,
    /// End of the stack, which lies from 0x20000000 on.
    pub stack_end: u32,
    /// The code.
    pub code: Vec<u8>,
    /// Stage of the instruction at each halfword of the code; `None` for helpers, which are charged to their callers.
    pub stages: Vec<Option<Stage>>,
    /// Whether a function begins at each halfword of the code: a branch there is a tail call.
    pub starts: Vec<bool>,
}

const NO_STAGE: u8 = 0x7f;

/// Flag of a halfword where a function begins.
const START: u8 = 0x80;

impl Plan {
    /// The halfword at an index.
    #[must_use]
    pub fn halfword(&self, index: usize) -> u16 {
        let byte = |at: usize| self.code.get(at).copied().unwrap_or(0);
        u16::from_le_bytes([byte(2 * index), byte(2 * index + 1)])
    }

    /// A word of the vector table, without the Thumb bit.
    #[must_use]
    pub fn vector(&self, exception: u32) -> u32 {
        let index = 2 * exception as usize;
        (u32::from(self.halfword(index)) | u32::from(self.halfword(index + 1)) << 16) & !1
    }

    /// Encodes the plan for the plugin.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let length = u32::try_from(self.code.len()).unwrap_or(0);
        let head = [
            MAGIC,
            self.base,
            self.exception,
            self.planning,
            self.stack_end,
            length,
        ];
        let mut bytes: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
        bytes.extend_from_slice(&self.code);
        let starts = self.starts.iter().copied().chain(std::iter::repeat(false));
        bytes.extend(self.stages.iter().zip(starts).map(|(stage, starts)| {
            let start = if starts { START } else { 0 };
            start | stage.map_or(NO_STAGE, |stage| stage as u8)
        }));
        bytes
    }

    /// Decodes the bytes of [`Self::to_bytes`]; `None` if they are another format or version.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let (words, rest) = bytes.split_at_checked(4 * HEAD_WORDS)?;
        let mut words = words
            .chunks_exact(4)
            .map(|word| word.try_into().map_or(0, u32::from_le_bytes));
        if words.next() != Some(MAGIC) {
            return None;
        }
        let (base, exception) = (words.next()?, words.next()?);
        let (planning, stack_end) = (words.next()?, words.next()?);
        let (code, stages) = rest.split_at_checked(words.next()? as usize)?;
        Some(Self {
            base,
            exception,
            planning,
            stack_end,
            code: code.to_vec(),
            stages: stages
                .iter()
                .map(|byte| Stage::from_byte(*byte & !START))
                .collect(),
            starts: stages.iter().map(|byte| byte & START != 0).collect(),
        })
    }
}
