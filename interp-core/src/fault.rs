//! Faults: why a run stops or a job is refused, each with a stable code and a value.

/// Why a run stopped or a job was refused. The code of a kind never changes; new kinds get new codes.
///
/// `repr(u32)`: the compiler copies a `Result` with a byte-sized discriminant byte by byte, one with a word in words.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum FaultKind {
    /// A principal curvature towards the tool is too large for the ball (local gouge).
    /// Value: the surface's principal curvature towards the tool times the ball radius (at least 0.99999 where the ball does not fit).
    BallDoesNotFit = 1,
    /// `S_u x S_v` is too small to compute a normal, or changed its sign between two samples, so that the tool would change
    /// sides; or, with axis limits, the tangent plane jumps at a knot so far that an axis would be faster than its limit.
    /// Value: `|S_u x S_v| / (|S_u| |S_v|)`, the sine between them; 0 where it went through zero, and where the tangent plane jumps.
    DegenerateSurface = 2,
    /// The path parameter's increment for one period is not positive.
    /// Value: ratio of the increment's second- and third-order terms to its first-order term (-1 or less: backwards).
    ParameterBackwards = 3,
    /// A cutter location does not fit an i32 of nanometres (±2.147 m). Value: the coordinate in metres.
    OutOfRange = 4,
    /// The job has more data than the store holds. Value: words asked for.
    TooManyPatches = 5,
    /// One period's arc is longer than a whole patch, or a straight pass within axis limits would creep over one. Value: the part of the arc beyond the patch, or its length, mm.
    PatchTooShort = 6,
    /// The path interval is too small to advance the side parameter. Value: the interval as a fraction of a patch.
    IntervalTooSmall = 7,
    /// A header value is not finite or out of its range. Value: the value.
    BadHeader = 8,
    /// A patch's coefficients exceed the range in which its polynomials cannot overflow, its weights vary more than
    /// 4 : 1, or a boundary flagged as a pole does not collapse; or edges of the region are not in order, outside of the surface, not closed, or too many on
    /// one line. Value: the record's index: patches, then portions of eight edges; the pass where there are too many on a line.
    BadPatch = 9,
    /// The job's data are incomplete, a record was not checked, or their length is not the one that the header implies. Value: the wrong number of words or offset.
    BadLength = 10,
    /// A request that does not fit the state, for instance loading while a job runs. Value: the state's code; of a run that was to begin at a place on no pass, that pass.
    WrongState = 11,
    /// A tick of the sample timer was missed. Value: ticks missed.
    DeadlineMissed = 12,
    /// A tick exceeded the board's cycle budget. Value: processor cycles of the tick.
    TickOverBudget = 13,
    /// An axis would leave its travel. Value: mm outside.
    SoftLimit = 14,
    /// The tool cannot link two passes through the air: the surface does not face up where a pass begins or ends, or it rises above the safe
    /// height. Value: mm above the safe height; 0 where the surface does not face up.
    LinkBlocked = 15,
    /// The emergency stop was pressed: the drives are off, the machine is not homed. Value: the inputs asserted, as bits.
    EmergencyStop = 16,
    /// A limit switch was reached. Value: the limit switches asserted, as bits.
    LimitSwitch = 17,
    /// A drive reports a fault: the drives are off, the machine is not homed. Value: the drive faults asserted, as bits.
    DriveFault = 18,
    // 19 was that of a link timeout, which is no fault; no new kind takes it.
    /// A start while the machine is not homed. Value: 0.
    NotHomed = 20,
    /// An axis has more steps in a period than the step output can emit. Value: the commanded steps.
    StepRate = 21,
    /// The step pulses were not output in time, or the step timer or its DMA has stopped.
    /// Value: slots of the period that had elapsed when the direction was set too late; otherwise 0.
    StepOutput = 22,
    /// The spindle did not report its speed in time. Value: the speed ordered, 1/min.
    SpindleSpeed = 23,
    /// A start or resume while the safety door is open. Value: the input, as a bit.
    DoorOpen = 24,
}

impl FaultKind {
    /// Every kind, in order of its code.
    pub const ALL: [Self; 23] = [
        Self::BallDoesNotFit,
        Self::DegenerateSurface,
        Self::ParameterBackwards,
        Self::OutOfRange,
        Self::TooManyPatches,
        Self::PatchTooShort,
        Self::IntervalTooSmall,
        Self::BadHeader,
        Self::BadPatch,
        Self::BadLength,
        Self::WrongState,
        Self::DeadlineMissed,
        Self::TickOverBudget,
        Self::SoftLimit,
        Self::LinkBlocked,
        Self::EmergencyStop,
        Self::LimitSwitch,
        Self::DriveFault,
        Self::NotHomed,
        Self::StepRate,
        Self::StepOutput,
        Self::SpindleSpeed,
        Self::DoorOpen,
    ];

    /// The stable code.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The kind with this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }

    /// The kind's name in scripts and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::BallDoesNotFit => "ball-does-not-fit",
            Self::DegenerateSurface => "degenerate-surface",
            Self::ParameterBackwards => "parameter-backwards",
            Self::OutOfRange => "out-of-range",
            Self::TooManyPatches => "too-many-patches",
            Self::PatchTooShort => "patch-too-short",
            Self::IntervalTooSmall => "interval-too-small",
            Self::BadHeader => "bad-header",
            Self::BadPatch => "bad-patch",
            Self::BadLength => "bad-length",
            Self::WrongState => "wrong-state",
            Self::DeadlineMissed => "deadline-missed",
            Self::TickOverBudget => "tick-over-budget",
            Self::SoftLimit => "soft-limit",
            Self::LinkBlocked => "link-blocked",
            Self::EmergencyStop => "emergency-stop",
            Self::LimitSwitch => "limit-switch",
            Self::DriveFault => "drive-fault",
            Self::NotHomed => "not-homed",
            Self::StepRate => "step-rate",
            Self::StepOutput => "step-output",
            Self::SpindleSpeed => "spindle-speed",
            Self::DoorOpen => "door-open",
        }
    }
}

/// A fault: its kind, and a value that quantifies it (meaning per [`FaultKind`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// The offending value; unit and meaning are given at each [`FaultKind`].
    pub value: f32,
}

impl Fault {
    /// A fault of this kind with its value.
    #[must_use]
    pub const fn new(kind: FaultKind, value: f32) -> Self {
        Self { kind, value }
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} ({})", self.kind.name(), self.value)
    }
}

impl core::error::Error for Fault {}

/// Result of a function of this crate that can fail with a [`Fault`].
pub type Result<T> = core::result::Result<T, Fault>;
