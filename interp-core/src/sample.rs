//! What one period yields: the [`Sample`], and the running machine's [`State`].

use crate::math::arith::sqrt;

/// State of the running machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// No job is loaded.
    #[default]
    Idle = 0,
    /// A job is loaded and checked; nothing moves yet.
    Ready = 1,
    /// The tool moves along its path.
    Running = 2,
    /// Slowing down for a hold.
    Holding = 3,
    /// Standing on the path, to be resumed.
    Held = 4,
    /// Slowing down for an abort or a fault.
    Stopping = 5,
    /// The job's last sample is out.
    Finished = 6,
    /// Stopped by a fault; the position is kept.
    Faulted = 7,
    /// The tool moves between passes, to the first or from the last, or waits there; only on a machine with limits.
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

    /// Whether a run is under way: moving, or standing on its path to be resumed.
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

/// A place along one parameter of a surface: which span of the grid, and how far through it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Span of the grid, from 0, in the surface's own direction.
    pub span: u16,
    /// Fraction of the span in units of 2^-64; `u64::MAX` stands for its end exactly.
    pub fraction: u64,
}

impl Place {
    /// No place: the tool is off the passes.
    pub const NONE: Self = Self {
        span: u16::MAX,
        fraction: 0,
    };
}

/// One period's result. Positions are exact integers; what host and board compute is the same to the last bit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Periods since the start of the run; the first sample has tick 0.
    pub tick: u32,
    /// State that produced the sample.
    pub state: State,
    /// Pass, from 0.
    pub pass: u32,
    /// Where on the path parameter.
    pub path: Place,
    /// Where on the side parameter (fixed on a pass).
    pub side: Place,
    /// Commanded feed of the cutter contact along the surface, mm/s.
    pub feed_mm_s: f32,
    /// Cutter contact, nm.
    pub cc_nm: [i32; 3],
    /// Cutter location (ball centre), nm: what the axes are told.
    pub cl_nm: [i32; 3],
    /// `1 / interval^2`: square of the passes that the scallop limit asks for per unit of the side parameter, by this sample
    /// alone. The greatest of a pass decides; see [`Self::interval`].
    pub density: f32,
}

impl Sample {
    /// Before anything has moved.
    pub(crate) const START: Self = Self {
        tick: 0,
        state: State::Idle,
        pass: 0,
        path: Place { span: 0, fraction: 0 },
        side: Place { span: 0, fraction: 0 },
        feed_mm_s: 0.0,
        cc_nm: [0; 3],
        cl_nm: [0; 3],
        density: 0.0,
    };

    /// Candidate of the path interval at this sample, in units of the side parameter; infinite where it sets no limit.
    #[must_use]
    pub fn interval(&self) -> f32 {
        interval_of(self.density)
    }
}

/// The path interval of an inverse square of it, in units of the side parameter; infinite where nothing sets a limit.
#[must_use]
pub(crate) fn interval_of(inv_interval_sq: f32) -> f32 {
    if inv_interval_sq > 0.0 {
        1.0 / sqrt(inv_interval_sq)
    } else {
        f32::INFINITY
    }
}
