//! The machine that runs a job, with every default applied.

/// Names of the axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];
/// Shortest and longest sampling period, µs: the core's limits.
pub const PERIOD_RANGE_US: [f64; 2] = [10.0, 100_000.0];
/// Default of the sampling period, µs: a common set-point period of servo drives.
pub const PERIOD_DEFAULT_US: f64 = 1000.0;
/// Shortest and longest heartbeat timeout, ms. The shortest allows for a host that shares its processor.
pub const HEARTBEAT_TIMEOUT_RANGE_MS: [f64; 2] = [100.0, 60_000.0];
/// Default of the heartbeat timeout, ms.
pub const HEARTBEAT_TIMEOUT_DEFAULT_MS: f64 = 1000.0;
/// Default of the distance from the highest point of the surface to the ball at the safe height, mm.
pub const CLEARANCE_DEFAULT_MM: f64 = 5.0;
/// Default of the length of the plunge at the feed, mm.
const PLUNGE_DEFAULT_MM: f64 = 2.0;

/// Limits of the axes x, y and z. All are above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisLimits {
    /// Velocity, mm/s.
    pub velocity_mm_s: [f64; 3],
    /// Acceleration, mm/s².
    pub acceleration_mm_s2: [f64; 3],
    /// Jerk, mm/s³.
    pub jerk_mm_s3: [f64; 3],
}

impl AxisLimits {
    /// Defaults: a small stiff mill with stepper motors. A job that gives only one or two kinds of limit takes the others from here.
    pub const DEFAULT: Self = Self {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
    };

    /// The limits of a job that gives any of `velocity_mm_s`, `acceleration_mm_s2` and `jerk_mm_s3`; `None` where it gives none of them:
    /// that job runs at constant feed from its first sample to its last.
    #[must_use]
    pub fn of_given(
        velocity_mm_s: Option<[f64; 3]>,
        acceleration_mm_s2: Option<[f64; 3]>,
        jerk_mm_s3: Option<[f64; 3]>,
    ) -> Option<Self> {
        if velocity_mm_s.is_none() && acceleration_mm_s2.is_none() && jerk_mm_s3.is_none() {
            return None;
        }
        Some(Self {
            velocity_mm_s: velocity_mm_s.unwrap_or(Self::DEFAULT.velocity_mm_s),
            acceleration_mm_s2: acceleration_mm_s2.unwrap_or(Self::DEFAULT.acceleration_mm_s2),
            jerk_mm_s3: jerk_mm_s3.unwrap_or(Self::DEFAULT.jerk_mm_s3),
        })
    }

    /// Velocity, acceleration and jerk limits, in this order.
    #[must_use]
    pub const fn by_order(&self) -> [[f64; 3]; 3] {
        [self.velocity_mm_s, self.acceleration_mm_s2, self.jerk_mm_s3]
    }
}

/// A positive ratio of two integers, stored exactly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ratio {
    /// Numerator.
    pub numerator: u32,
    /// Denominator, above 0.
    pub denominator: u32,
}

/// Requirements of the drives of the axes x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepOutput {
    /// Motor steps per millimetre, 1/1000 to 500000.
    pub steps_per_mm: [Ratio; 3],
    /// Whether the direction output is inverted.
    pub direction_inverted: [bool; 3],
    /// Duration of a step pulse, and least pause after it, µs.
    pub pulse_us: f64,
    /// Least time from a change of direction to the next pulse, µs.
    pub direction_setup_us: f64,
}

/// Reaction of a board to a heartbeat timeout during a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HeartbeatAction {
    /// Finishes the run.
    #[default]
    Finish,
    /// Holds the run along its path.
    Hold,
}

/// Homing of the axes x, y and z by a switch at one end of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homing {
    /// The axes, 0 to 2, in the order of homing.
    pub order: [u8; 3],
    /// Whether the switch is at the upper end.
    pub at_upper_end: [bool; 3],
    /// Machine coordinate at which the switch trips, mm.
    pub position_mm: [f64; 3],
    /// Speed of the search, mm/s.
    pub seek_mm_s: [f64; 3],
    /// Speed of the approach, mm/s.
    pub approach_mm_s: [f64; 3],
    /// Distance from the switch before the approach and after homing, mm.
    pub back_off_mm: [f64; 3],
    /// The position stays valid while the drives are off.
    pub survives_off: bool,
}

/// Spindle and coolant of a job: on from its start to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spindle {
    /// Speed, 1/min; 0: the spindle stands.
    pub rpm: u32,
    /// The spindle turns counterclockwise.
    pub counterclockwise: bool,
    /// Coolant.
    pub coolant: bool,
}

/// A contact of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contact {
    /// The contact opens when the reported event happens.
    NormallyClosed,
    /// The contact closes when the reported event happens.
    NormallyOpen,
}

/// Default of the time from switching a spindle on to the first motion, ms.
pub const AT_SPEED_DEFAULT_MS: f64 = 3000.0;

/// The spindle of a machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpindleDrive {
    /// Speed at the full output, 1/min.
    pub max_rpm: u32,
    /// Time from switching on to the first motion, ms; with a contact that reports the speed, the longest wait for that report, after which there is a fault.
    pub at_speed_ms: f64,
    /// The spindle is switched off while the tool is lifted for a pause.
    pub stops_at_pause: bool,
    /// The contact that reports that the spindle is at speed.
    pub at_speed: Option<Contact>,
}

/// A machine as its board keeps it: the greatest limits, the drives, the supervision. A job may lower the limits, but not exceed them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineProfile {
    /// Greatest limits of the axes.
    pub limits: AxisLimits,
    /// Travel of the axes, mm, `[min, max]`; `None`: not limited.
    pub travel_mm: Option<[[f64; 2]; 3]>,
    /// A board starts a run only after homing.
    pub homing_required: bool,
    /// Reaction to a heartbeat timeout, where a job gives none.
    pub heartbeat_action: HeartbeatAction,
    /// Heartbeat timeout, ms, where a job gives none.
    pub heartbeat_timeout_ms: f64,
    /// The drives.
    pub step_output: StepOutput,
    /// Axes whose step pulses have the level opposite to the one in the board's table.
    pub step_inverted: [bool; 3],
    /// Axes whose drives are enabled by the level opposite to the one in the board's table.
    pub enable_inverted: [bool; 3],
    /// Homing by switches. `None`: the position is declared.
    pub homing: Option<Homing>,
    /// The probe's contact closes when it touches.
    pub probe_closes: bool,
    /// The spindle.
    pub spindle: Option<SpindleDrive>,
    /// The contact of the safety door: it reports that the door is open.
    pub door: Option<Contact>,
}

impl MachineProfile {
    /// The machine of a job that gives nothing of its own.
    #[must_use]
    pub fn spec(&self) -> MachineSpec {
        MachineSpec {
            limits: Some(self.limits),
            travel_mm: self.travel_mm,
            homing_required: self.homing_required,
            heartbeat_action: self.heartbeat_action,
            heartbeat_timeout_ms: self.heartbeat_timeout_ms,
            step_output: Some(self.step_output),
            ..MachineSpec::default()
        }
    }
}

/// The machine that runs the job.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineSpec {
    /// Sampling period T, µs, in [`PERIOD_RANGE_US`].
    pub period_us: f64,
    /// Limits of the axes. `None`: the feed is constant from the first sample to the last, as in the paper.
    pub limits: Option<AxisLimits>,
    /// Travel of the axes (soft limits), mm, `[min, max]`.
    pub travel_mm: Option<[[f64; 2]; 3]>,
    /// Position of the tool centre before the run, mm. `None`: at the safe height above the first contact.
    pub home_mm: Option<[f64; 3]>,
    /// z of the tool centre at which the tool clears every obstacle, mm. `None`: from [`Self::clearance_mm`].
    pub safe_z_mm: Option<f64>,
    /// Distance from the highest point of the surface, and of [`Self::part_top_mm`], to the ball at the safe height, mm, where `safe_z_mm` is `None`.
    pub clearance_mm: f64,
    /// Highest point of the whole part, mm, where it is known: the safe height is above it, too.
    pub part_top_mm: Option<f64>,
    /// Length of the last part of the plunge, which runs at the feed, mm.
    pub plunge_mm: f64,
    /// A board starts a run only after homing.
    pub homing_required: bool,
    /// Reaction of a board to a heartbeat timeout.
    pub heartbeat_action: HeartbeatAction,
    /// Heartbeat timeout, ms, in [`HEARTBEAT_TIMEOUT_RANGE_MS`].
    pub heartbeat_timeout_ms: f64,
    /// Requirements of the drives. `None`: the board's own setting.
    pub step_output: Option<StepOutput>,
    /// Spindle and coolant of the job.
    pub spindle: Option<Spindle>,
}

impl Default for MachineSpec {
    fn default() -> Self {
        Self {
            period_us: PERIOD_DEFAULT_US,
            limits: None,
            travel_mm: None,
            home_mm: None,
            safe_z_mm: None,
            clearance_mm: CLEARANCE_DEFAULT_MM,
            part_top_mm: None,
            plunge_mm: PLUNGE_DEFAULT_MM,
            homing_required: true,
            heartbeat_action: HeartbeatAction::Finish,
            heartbeat_timeout_ms: HEARTBEAT_TIMEOUT_DEFAULT_MS,
            step_output: None,
            spindle: None,
        }
    }
}

impl MachineSpec {
    /// Sampling period T, s.
    #[must_use]
    pub fn period_s(&self) -> f64 {
        self.period_us * 1e-6
    }

    /// Time of a number of ticks, s.
    #[must_use]
    #[allow(clippy::cast_precision_loss, reason = "below 2^53")]
    pub fn time_s(&self, ticks: u64) -> f64 {
        ticks as f64 * self.period_s()
    }

    /// Whether the job runs within limits of the axes, from standstill to standstill.
    #[must_use]
    pub const fn has_limits(&self) -> bool {
        self.limits.is_some()
    }
}
