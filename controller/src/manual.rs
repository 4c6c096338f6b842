//! Motion outside a job: jog, probe move, homing. Each is a straight [`Line`] within the limits of the machine's profile; a jog may move several axes, the others move one.
//!
//! ```text
//!  Order ──► begin.rs                       checks, and the plan of the first move; under the lock, between two ticks
//!  tick  ──► Manual::tick                   one position a period, like a sample's, to the step output
//!              │ inputs                     raw ones latch where the axis was (contact.rs); debounced ones confirm
//!              └─► follow.rs                when a move has come to rest: what came of it, and of a homing (homing.rs) the next move
//! ```
//!
//! **Stops.** Limit switch, safety door, dead man, faults of the steps and operator stop along the ramp of the move. Emergency stop and drive fault end it at once, because the drives are off.
//! **Door.** While it is open, motion is no faster than [`DOOR_MM_S`].
//! **Dead man.** A continuous jog stops when its request is not repeated for [`DEAD_MAN_TICKS`], every other motion when the host is not heard for [`HEARD_TICKS`].
//! **Latch.** Pulses lag by one period, and inputs are read at a period's start: the axes are then where the sample before the last one has placed them.
//! **Cost.** Nothing while a run is under way.

mod begin;
mod contact;
mod follow;
mod homing;
mod setup;

use interp_core::positioning::Line;
use protocol::{
    digest::Digest,
    message::{Activity, InputLines, JogWay, MotionEnd, MotionStatus, Reason},
};

use self::{contact::Contact, homing::Homing};

pub(crate) use self::begin::Allowed;
pub use self::setup::Setup;

/// Ticks without a repetition after which a continuous jog stops: several of a terminal's key repeat, at 1 ms.
pub const DEAD_MAN_TICKS: u32 = 250;

/// Ticks without a sign of life of the host after which other motion stops, at 1 ms.
pub const HEARD_TICKS: u32 = 1_000;

/// Ticks of rest between two moves, for inputs to settle: the two periods of the output, the debouncing and what filters the inputs have.
const SETTLE_TICKS: u32 = 40;

/// Greatest speed while the safety door is open, mm/s: the 2 m/min of setting up (ISO 16090-1).
pub const DOOR_MM_S: f32 = 33.0;

/// A move towards a probe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeMove {
    /// The axis, from 0.
    pub axis: u8,
    /// Greatest distance, nm.
    pub nm: i32,
    /// Speed, mm/s.
    pub speed_mm_s: f32,
}

/// A jog, probe move or homing that the host requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// See `Request::Jog`.
    Jog {
        /// How far.
        way: JogWay,
        /// Speed, mm/s.
        speed_mm_s: f32,
    },
    /// See `Request::Probe`.
    Probe(ProbeMove),
    /// See `Request::Home`.
    Home {
        /// One bit an axis; none: all.
        axes: u8,
    },
    /// Along the ramp.
    Stop,
}

impl Motion {
    /// Refuses a speed that is not a finite one above 0: compared with a bound, a NaN would pass as any speed.
    fn check_speed(self) -> Result<(), Reason> {
        let (Self::Jog { speed_mm_s, .. } | Self::Probe(ProbeMove { speed_mm_s, .. })) = self else {
            return Ok(());
        };
        if speed_mm_s.is_finite() && speed_mm_s > 0.0 {
            Ok(())
        } else {
            Err(Reason::BadSpeed { mm_s: speed_mm_s })
        }
    }
}

/// What a tick of the motion changes for the rest of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    /// Nothing.
    None,
    /// An axis has another coordinate where it stands: its home was found.
    Placed,
    /// Every axis is homed by its switch, or declared.
    Homed,
}

/// The motion outside a job, and its state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Manual {
    setup: Option<Setup>,
    status: MotionStatus,
    digest: Digest,
    line: Line,
    /// The leading axis of the move, which is the one of a contact.
    axis: u8,
    /// Its two positions before the present one, nm, the older one first.
    before_nm: [i32; 2],
    /// The present motion is a continuous jog this way.
    repeated: Option<JogWay>,
    /// Ticks until the motion stops.
    alive: u32,
    /// Ticks of rest so far.
    rested: u32,
    /// Limit switches and door that were asserted at the start: those that do not stop the motion.
    at_start: InputLines,
    contact: Contact,
    homing: Homing,
    /// Why it ends, once it has come to rest.
    ending: Option<MotionEnd>,
    /// The position has to be emitted in this period.
    pub(crate) emits: bool,
}

impl Manual {
    pub(crate) const NEW: Self = Self {
        setup: None,
        status: MotionStatus {
            activity: Activity::Rest,
            axes: 0,
            at_nm: [0; 3],
            homed_axes: 0,
            end: MotionEnd::None,
            lines: InputLines::NONE,
            tripped_nm: None,
            periods: 0,
            digest: Digest::EMPTY,
        },
        digest: Digest::new(),
        line: Line::rest([0; 3]),
        axis: 0,
        before_nm: [0; 2],
        repeated: None,
        alive: 0,
        rested: 0,
        at_start: InputLines::NONE,
        contact: Contact::NONE,
        homing: Homing::NONE,
        ending: None,
        emits: false,
    };

    #[inline]
    pub(crate) fn is_active(&self) -> bool {
        self.status.activity != Activity::Rest
    }

    pub(crate) fn is_probing(&self) -> bool {
        self.status.activity == Activity::Probe
    }

    pub(crate) const fn at_nm(&self) -> [i32; 3] {
        self.status.at_nm
    }

    /// Whether the position of homed axes stays valid under this profile.
    pub(crate) fn keeps_position(&self, setup: Option<&Setup>) -> bool {
        let is_same = match (&self.setup, setup) {
            (Some(now), Some(next)) => next.has_coordinates_of(now),
            (now, next) => now.is_none() && next.is_none(),
        };
        is_same || self.status.homed_axes == 0
    }

    pub(crate) const fn set_up(&mut self, setup: Option<Setup>) {
        self.setup = setup;
    }

    /// The axes' position is this, by declaration or after a run.
    pub(crate) const fn place(&mut self, at_nm: [i32; 3]) {
        self.status.at_nm = at_nm;
    }

    /// The position of every axis was declared.
    pub(crate) const fn declared(&mut self) {
        self.status.homed_axes = ALL_AXES;
    }

    /// The position is lost: no axis is homed.
    pub(crate) const fn lose_home(&mut self) {
        self.status.homed_axes = 0;
    }

    pub(crate) const fn status(&self) -> MotionStatus {
        MotionStatus {
            digest: self.digest.value(),
            ..self.status
        }
    }

    /// A sign of life of the host.
    pub(crate) const fn heard(&mut self) {
        if self.repeated.is_none() {
            self.alive = HEARD_TICKS;
        }
    }

    fn axis_nm(&self, axis: u8) -> i32 {
        self.status.at_nm.get(usize::from(axis)).copied().unwrap_or(0)
    }

    /// Stops along the ramp, for this reason; the first one counts.
    pub(crate) fn stop(&mut self, why: MotionEnd) {
        if self.is_active() {
            self.line.stop();
            self.ending.get_or_insert(why);
        }
    }

    /// The drives are off: ends at once.
    #[cold]
    pub(crate) fn drives_are_off(&mut self, lines: InputLines) {
        if self.is_active() {
            self.line.abandon();
            self.finish(MotionEnd::DrivesOff, lines);
        }
    }

    fn finish(&mut self, end: MotionEnd, lines: InputLines) {
        self.status.activity = Activity::Rest;
        self.status.end = end;
        self.status.lines = lines;
        self.repeated = None;
    }

    /// The input towards which the present motion moves.
    fn wanted(&self) -> InputLines {
        match self.status.activity {
            Activity::Probe => InputLines::PROBE,
            Activity::Seek | Activity::BackOff | Activity::Approach | Activity::Clear => self.homing.switch(),
            Activity::Rest | Activity::Jog | Activity::SpinUp => InputLines::NONE,
        }
    }

    /// One period. `raw`: the inputs as read; `steady`: debounced.
    #[cold]
    #[inline(never)]
    pub(crate) fn tick(&mut self, raw: InputLines, steady: InputLines) -> Change {
        let wanted = self.wanted();
        let [older, before] = self.before_nm;
        self.contact.look(raw.has(wanted), older);
        self.alive = self.alive.saturating_sub(1);
        if self.alive == 0 {
            self.stop(MotionEnd::HostGone);
        }
        self.stop_by_inputs(wanted, raw, steady);
        if self.line.is_over() {
            self.before_nm = [before, self.axis_nm(self.axis)];
            self.rested += 1;
            return if self.rested >= SETTLE_TICKS {
                self.follow(steady)
            } else {
                Change::None
            };
        }
        self.before_nm = [before, self.axis_nm(self.axis)];
        self.status.at_nm = self.line.tick();
        self.status.periods = self.status.periods.wrapping_add(1);
        for at in self.status.at_nm {
            self.digest.word(at.cast_unsigned());
        }
        self.emits = true;
        Change::None
    }

    /// Stops where an input is found, or one that should not be.
    fn stop_by_inputs(&mut self, wanted: InputLines, raw: InputLines, steady: InputLines) {
        let others = steady
            .and(InputLines::LIMITS)
            .without(self.at_start)
            .without(wanted);
        let opened = steady.and(InputLines::DOOR).without(self.at_start);
        // A switch that was released can stop the motion again.
        self.at_start = self.at_start.and(steady);
        let found = match self.status.activity {
            Activity::Seek => steady.has(wanted),
            Activity::Probe | Activity::Approach => raw.has(wanted),
            _ => false,
        };
        if !others.is_none() {
            if self.ending.is_none() {
                self.status.lines = others;
            }
            self.stop(match self.status.activity {
                Activity::Jog | Activity::Probe => MotionEnd::LimitSwitch,
                _ => MotionEnd::WrongSwitch,
            });
        } else if !opened.is_none() {
            self.stop(MotionEnd::Door);
        } else if found {
            self.line.stop();
        }
    }
}

/// A bit an axis.
const ALL_AXES: u8 = 0b111;
