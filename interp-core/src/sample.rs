//! The output of one period: the [`Sample`] and the machine's [`State`].

use crate::math::arith::sqrt;

/// State of the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// No job is loaded.
    #[default]
    Idle = 0,
    /// A job is loaded and checked; no run has begun.
    Ready = 1,
    /// The tool moves along its path.
    Running = 2,
    /// Decelerating for a feed hold.
    Holding = 3,
    /// Feed hold: at standstill on the path, to be resumed.
    Held = 4,
    /// Decelerating for a stop, an abort or a fault.
    Stopping = 5,
    /// The job's last sample was emitted.
    Finished = 6,
    /// Stopped by a fault; the position is kept.
    Faulted = 7,
    /// The tool moves between passes, to the first or from the last, or waits there; only for a job with axis limits.
    Linking = 8,
}

impl State {
    /// Every state, in order of its code.
    pub const ALL: [Self; 9] = [
        Self::Idle,
        Self::Ready,
        Self::Running,
        Self::Holding,
        Self::Held,
        Self::Stopping,
        Self::Finished,
        Self::Faulted,
        Self::Linking,
    ];

    /// The state with this code.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|state| *state as u8 == code)
    }

    /// Whether a run is under way: moving, or in a feed hold.
    #[must_use]
    pub const fn is_under_way(self) -> bool {
        matches!(
            self,
            Self::Running | Self::Linking | Self::Holding | Self::Held | Self::Stopping
        )
    }

    /// The state's name in traces and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Ready => "ready",
            Self::Running => "running",
            Self::Holding => "holding",
            Self::Held => "held",
            Self::Stopping => "stopping",
            Self::Finished => "finished",
            Self::Faulted => "faulted",
            Self::Linking => "link",
        }
    }
}

/// A surface parameter: the span of the grid, and the fraction within the span.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct SpanParameter {
    /// Span of the grid, from 0, in the surface's own direction.
    pub span: u16,
    /// Fraction of the span in units of 2^-64; `u64::MAX` is the end of the span exactly.
    pub fraction: u64,
}

impl SpanParameter {
    /// No parameter: the tool is off the passes.
    pub const NONE: Self = Self {
        span: u16::MAX,
        fraction: 0,
    };
}

/// Where a run begins: the start of a pass, or a place on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunStart {
    /// The pass, from 0.
    pub pass: u32,
    /// Path parameter of the place; [`SpanParameter::NONE`]: the start of the pass.
    pub path: SpanParameter,
}

impl RunStart {
    /// The start of the job.
    pub const FIRST: Self = Self {
        pass: 0,
        path: SpanParameter::NONE,
    };

    /// Whether it is the start of the job.
    #[must_use]
    pub fn is_first(self) -> bool {
        self == Self::FIRST
    }

    /// The place within the pass, if it is one.
    #[must_use]
    pub fn within(self) -> Option<SpanParameter> {
        (self.path != SpanParameter::NONE).then_some(self.path)
    }
}

impl Default for RunStart {
    fn default() -> Self {
        Self::FIRST
    }
}

/// One period's result. Positions are integers; host and board compute bit-identical samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Periods since the start of the run; the first sample has tick 0.
    pub tick: u32,
    /// State in which the sample was computed.
    pub state: State,
    /// Pass, from 0.
    pub pass: u32,
    /// Path parameter.
    pub path: SpanParameter,
    /// Side parameter: constant on a pass, unless the passes are of constant scallop height.
    pub side: SpanParameter,
    /// Commanded feed of the cutter contact along the surface, mm/s; in [`State::Linking`] the speed of the ball's centre. Without axis limits it stays the programmed one at a
    /// standstill.
    pub feed_mm_s: f32,
    /// Cutter contact, nm; in [`State::Linking`] the ball's centre.
    pub cc_nm: [i32; 3],
    /// Cutter location (ball centre), nm: the axes' commanded position.
    pub cl_nm: [i32; 3],
    /// Inverse square interval `1 / interval^2`: square of the passes per unit of the side parameter that the scallop limit requires at this sample
    /// alone. The maximum over a pass sets the path interval; see [`Self::interval`].
    pub inv_interval_sq: f32,
}

impl Sample {
    /// The sample before the first period.
    pub(crate) const START: Self = Self {
        tick: 0,
        state: State::Idle,
        pass: 0,
        path: SpanParameter { span: 0, fraction: 0 },
        side: SpanParameter { span: 0, fraction: 0 },
        feed_mm_s: 0.0,
        cc_nm: [0; 3],
        cl_nm: [0; 3],
        inv_interval_sq: 0.0,
    };

    /// Path interval that this sample allows, in units of the side parameter; infinite where the scallop limit does not bound the interval.
    #[must_use]
    pub fn interval(&self) -> f32 {
        interval_of(self.inv_interval_sq)
    }
}

/// Path interval from an inverse square interval, in units of the side parameter; infinite where that is not positive.
#[must_use]
pub(crate) fn interval_of(inv_interval_sq: f32) -> f32 {
    if inv_interval_sq > 0.0 {
        1.0 / sqrt(inv_interval_sq)
    } else {
        f32::INFINITY
    }
}
