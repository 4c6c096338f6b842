//! Motion outside a job: jog, probe move, homing. One axis moves at a time, by [`Move`], within the limits of the machine's profile.
//!
//! ```text
//!  Order ──► Manual::jog, probe, home       checks, and the plan of the first move; under the lock, between two ticks
//!  tick  ──► Manual::tick                   one position a period, like a sample's, to the step output
//!              │ inputs                     raw ones latch where the axis was; debounced ones confirm
//!              └─► Homing                   what follows when a move has come to rest
//! ```
//!
//! **Stops.** Limit switch, dead man and operator stop along the ramp of the move. Emergency stop and drive fault end it at once, because the drives are off.
//! **Dead man.** A continuous jog stops when its request is not repeated for [`DEAD_MAN_TICKS`], every other motion when the host is not heard for [`HEARD_TICKS`].
//! **Latch.** Pulses lag by one period, and inputs are read at a period's start: the axes are then where the sample before the last one has placed them.
//! **Cost.** Nothing while a run is under way.

mod homing;

use interp_core::positioning::{Move, MoveLimits};
use protocol::{
    digest::Digest,
    message::{
        Activity, Homing as HomingProfile, InputLines, JogWay, MotionEnd, MotionStatus, Profile, Reason,
        SpindleSettings,
    },
};

use self::homing::{Homing, Next};

/// Ticks without a repetition after which a continuous jog stops: several of a terminal's key repeat, at 1 ms.
pub const DEAD_MAN_TICKS: u32 = 250;

/// Ticks without a sign of life of the host after which other motion stops, at 1 ms.
pub const HEARD_TICKS: u32 = 1_000;

/// Ticks of rest between two moves, for inputs to settle: the two periods of the output, the debouncing and what filters the inputs have.
const SETTLE_TICKS: u32 = 40;

/// Ticks after the first contact within which a contact may bounce.
const BOUNCE_TICKS: u32 = 15;

/// The machine's profile, as far as motion outside a job needs it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    limits: [MoveLimits; 3],
    velocity_mm_s: [f32; 3],
    travel_nm: Option<[[i32; 2]; 3]>,
    homing: Option<HomingProfile>,
    period_s: f32,
    probe_inverted: bool,
    spindle: Option<SpindleSettings>,
    step_inverted: u8,
    enable_inverted: u8,
}

impl Setup {
    /// Of a profile, on a board with this period.
    #[must_use]
    pub fn new(profile: &Profile, period_s: f32) -> Self {
        let [x, y, z] = profile.velocity_mm_s;
        let [ax, ay, az] = profile.acceleration_mm_s2;
        let [jx, jy, jz] = profile.jerk_mm_s3;
        let limits = |v, a, j| MoveLimits::new(v, a, j, period_s);
        Self {
            limits: [limits(x, ax, jx), limits(y, ay, jy), limits(z, az, jz)],
            velocity_mm_s: profile.velocity_mm_s,
            travel_nm: profile.travel_nm,
            homing: profile.homing,
            period_s,
            probe_inverted: profile.probe_inverted,
            spindle: profile.spindle,
            step_inverted: profile.step_inverted,
            enable_inverted: profile.enable_inverted,
        }
    }

    /// Axes whose step pulses have the level opposite to the one in the board's table, one bit each.
    #[must_use]
    pub const fn step_inverted(&self) -> u8 {
        self.step_inverted
    }

    /// The levels of steps and enables, as in [`crate::spindle::output`].
    #[must_use]
    pub const fn levels(&self) -> u32 {
        use crate::spindle::output::{ENABLE_INVERTED_SHIFT, STEP_INVERTED_SHIFT};
        (self.step_inverted as u32) << STEP_INVERTED_SHIFT
            | (self.enable_inverted as u32) << ENABLE_INVERTED_SHIFT
    }

    pub(crate) const fn spindle(&self) -> Option<SpindleSettings> {
        self.spindle
    }

    /// Whether the probe's contact closes when it touches.
    pub(crate) fn probe_is_inverted(&self) -> bool {
        self.probe_inverted
    }

    /// Whether the position survives drives that are off.
    pub(crate) fn home_survives_off(&self) -> bool {
        self.homing.is_some_and(|homing| homing.survives_off)
    }

    fn limits(&self, axis: u8, speed_mm_s: f32) -> MoveLimits {
        let [x, y, z] = self.limits;
        let limits = match axis {
            0 => x,
            1 => y,
            _ => z,
        };
        limits.at_speed(speed_mm_s, self.period_s)
    }

    fn travel(&self, axis: u8) -> Option<[i32; 2]> {
        self.travel_nm?.get(usize::from(axis)).copied()
    }

    /// A position that is within the travel of a homed axis.
    fn within(&self, axis: u8, wanted: i64, from_nm: i32, is_homed: bool) -> Result<i32, Reason> {
        let wanted_nm = i32::try_from(wanted).unwrap_or(if wanted < 0 { i32::MIN } else { i32::MAX });
        let is_far = i64::from(wanted_nm) != wanted;
        let travel_nm = match self.travel(axis) {
            Some(travel) if is_homed => travel,
            _ => [i32::MIN, i32::MAX],
        };
        let [least, most] = travel_nm;
        // From outside, as at a switch, the way back is open.
        let is_outside =
            (wanted_nm < least && wanted_nm < from_nm) || (wanted_nm > most && wanted_nm > from_nm);
        if is_far || is_outside {
            return Err(Reason::BeyondTravel {
                axis,
                travel_nm,
                wanted_nm,
            });
        }
        Ok(wanted_nm)
    }
}

/// A jog, probe move or homing that is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// See `Request::Jog`.
    Jog {
        /// The axis, from 0.
        axis: u8,
        /// How far.
        way: JogWay,
        /// Speed, mm/s.
        speed_mm_s: f32,
    },
    /// See `Request::Probe`.
    Probe {
        /// The axis, from 0.
        axis: u8,
        /// Greatest distance, nm.
        nm: i32,
        /// Speed, mm/s.
        speed_mm_s: f32,
    },
    /// See `Request::Home`.
    Home {
        /// One bit an axis; none: all.
        axes: u8,
    },
    /// Along the ramp.
    Stop,
}

/// Where the axis was when its contact closed.
#[derive(Clone, Copy, Debug, Default)]
struct Contact {
    /// The position at the first raw contact.
    touched_nm: Option<i32>,
    /// Ticks since then, and the last of them at which the contact was open.
    ticks: u32,
    open_at: u32,
}

impl Contact {
    /// Another tick; `at_nm`: where the axis is.
    fn look(&mut self, is_closed: bool, at_nm: i32) {
        if self.touched_nm.is_some() {
            self.ticks = self.ticks.saturating_add(1);
            if !is_closed {
                self.open_at = self.ticks;
            }
        } else if is_closed {
            self.touched_nm = Some(at_nm);
        }
    }

    const fn bounces(&self) -> bool {
        self.open_at > BOUNCE_TICKS
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
    step: Move,
    /// The two positions before the present one of the moved axis, the older one first.
    before_nm: [i32; 2],
    /// The present motion is a continuous jog this way.
    repeated: Option<JogWay>,
    /// Ticks until the motion stops.
    alive: u32,
    /// Ticks of rest so far.
    rested: u32,
    /// Limit switches that were asserted at the start: those that do not stop the motion.
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
            axis: 0,
            at_nm: [0; 3],
            homed_axes: 0,
            end: MotionEnd::None,
            lines: InputLines::NONE,
            tripped_nm: None,
            periods: 0,
            digest: Digest::EMPTY,
        },
        digest: Digest::new(),
        step: Move::rest(0),
        before_nm: [0; 2],
        repeated: None,
        alive: 0,
        rested: 0,
        at_start: InputLines::NONE,
        contact: Contact {
            touched_nm: None,
            ticks: 0,
            open_at: 0,
        },
        homing: Homing::NONE,
        ending: None,
        emits: false,
    };

    #[inline]
    pub(crate) fn is_active(&self) -> bool {
        self.status.activity != Activity::Rest
    }

    pub(crate) const fn at_nm(&self) -> [i32; 3] {
        self.status.at_nm
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

    /// Begins a motion; `lines`: the debounced inputs.
    pub(crate) fn begin(&mut self, motion: Motion, lines: InputLines, is_homed: bool) -> Result<(), Reason> {
        if motion == Motion::Stop {
            self.stop(MotionEnd::Stopped);
            return Ok(());
        }
        if let Motion::Jog { axis, way, .. } = motion
            && self.is_active()
            && self.repeated == Some(way)
            && self.status.axis == axis
            && self.ending.is_none()
        {
            self.alive = DEAD_MAN_TICKS;
            return Ok(());
        }
        if self.is_active() {
            return Err(Reason::Moving);
        }
        let setup = self.setup.ok_or(Reason::NoProfile)?;
        let is_known =
            |axis: u8| is_homed || self.status.homed_axes.checked_shr(axis.into()).unwrap_or(0) & 1 != 0;
        match motion {
            Motion::Jog {
                axis,
                way,
                speed_mm_s,
            } => self.begin_jog(&setup, axis, way, speed_mm_s, lines, is_known(axis)),
            Motion::Probe { axis, nm, speed_mm_s } => {
                self.begin_probe(&setup, axis, nm, speed_mm_s, lines, is_known(axis))
            }
            Motion::Home { axes } => {
                let profile = setup.homing.ok_or(Reason::NoHoming)?;
                if axes & ALL_AXES & !profile.axes() != 0 {
                    return Err(Reason::NoHoming);
                }
                self.homing = Homing::new(&profile, axes);
                self.repeated = None;
                self.next_axis(lines);
                Ok(())
            }
            Motion::Stop => Ok(()),
        }
    }

    fn begin_jog(
        &mut self,
        setup: &Setup,
        axis: u8,
        way: JogWay,
        speed_mm_s: f32,
        lines: InputLines,
        is_homed: bool,
    ) -> Result<(), Reason> {
        let from = self.checked_axis(axis)?;
        let far = |end: usize| match setup.travel(axis) {
            Some(travel) if is_homed => travel.get(end).copied().map_or(0, i64::from),
            // As far as the coordinate goes.
            _ => i64::from(if end == 0 { i32::MIN } else { i32::MAX }),
        };
        let (wanted, repeated) = match way {
            JogWay::By { nm } => (i64::from(from) + i64::from(nm), None),
            JogWay::Plus => (far(1).max(from.into()), Some(way)),
            JogWay::Minus => (far(0).min(from.into()), Some(way)),
        };
        let to = setup.within(axis, wanted, from, is_homed)?;
        let towards = InputLines::limit(axis, to > from);
        if lines.has(towards) {
            return Err(hindered(lines.and(towards)));
        }
        self.repeated = repeated;
        self.lead(setup, Activity::Jog, axis, to, speed_mm_s, lines);
        if repeated.is_some() {
            self.alive = DEAD_MAN_TICKS;
        }
        Ok(())
    }

    fn begin_probe(
        &mut self,
        setup: &Setup,
        axis: u8,
        nm: i32,
        speed_mm_s: f32,
        lines: InputLines,
        is_homed: bool,
    ) -> Result<(), Reason> {
        let from = self.checked_axis(axis)?;
        let to = setup.within(axis, i64::from(from) + i64::from(nm), from, is_homed)?;
        let towards = InputLines::limit(axis, to > from);
        if lines.has(towards) {
            return Err(hindered(lines.and(towards)));
        }
        if lines.has(InputLines::PROBE) {
            return Err(Reason::ProbeTripped);
        }
        self.repeated = None;
        self.lead(setup, Activity::Probe, axis, to, speed_mm_s, lines);
        Ok(())
    }

    fn checked_axis(&self, axis: u8) -> Result<i32, Reason> {
        let at = self.status.at_nm.get(usize::from(axis)).copied();
        at.ok_or(Reason::OutOfRange {
            most: 2,
            wanted: axis.into(),
        })
    }

    /// Begins a move of a motion.
    fn lead(
        &mut self,
        setup: &Setup,
        activity: Activity,
        axis: u8,
        to_nm: i32,
        speed_mm_s: f32,
        lines: InputLines,
    ) {
        let from = self.axis_nm(axis);
        self.step = Move::new(from, to_nm, &setup.limits(axis, speed_mm_s));
        self.before_nm = [from; 2];
        self.contact = Contact::default();
        self.rested = 0;
        self.at_start = lines.and(InputLines::LIMITS);
        self.alive = HEARD_TICKS;
        self.ending = None;
        self.digest = Digest::new();
        self.status = MotionStatus {
            activity,
            axis,
            at_nm: self.status.at_nm,
            homed_axes: self.status.homed_axes,
            end: MotionEnd::None,
            lines: InputLines::NONE,
            tripped_nm: None,
            periods: 0,
            digest: 0,
        };
    }

    /// Stops along the ramp, for this reason; the first one counts.
    fn stop(&mut self, why: MotionEnd) {
        if self.is_active() {
            self.step.stop();
            self.ending.get_or_insert(why);
        }
    }

    /// The drives are off: ends at once.
    #[cold]
    pub(crate) fn drives_are_off(&mut self, lines: InputLines) {
        if self.is_active() {
            self.step.abandon();
            self.finish(MotionEnd::DrivesOff, lines);
        }
    }

    fn finish(&mut self, end: MotionEnd, lines: InputLines) {
        self.status.activity = Activity::Rest;
        self.status.end = end;
        self.status.lines = lines;
        self.repeated = None;
    }

    /// The input that the present motion looks for.
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
        let axis = self.status.axis;
        if self.step.is_over() {
            self.before_nm = [before, self.step.at_nm()];
            self.rested += 1;
            return if self.rested >= SETTLE_TICKS {
                self.follow(steady)
            } else {
                Change::None
            };
        }
        let at = self.step.tick();
        self.before_nm = [before, self.axis_nm(axis)];
        if let Some(place) = self.status.at_nm.get_mut(usize::from(axis)) {
            *place = at;
        }
        self.status.periods = self.status.periods.wrapping_add(1);
        self.digest.word(at.cast_unsigned());
        self.emits = true;
        Change::None
    }

    /// Stops where an input is found, or one that should not be.
    fn stop_by_inputs(&mut self, wanted: InputLines, raw: InputLines, steady: InputLines) {
        let others = steady
            .and(InputLines::LIMITS)
            .without(self.at_start)
            .without(wanted);
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
        } else if found {
            self.step.stop();
        }
    }

    /// What follows a move that has come to rest.
    fn follow(&mut self, steady: InputLines) -> Change {
        if let Some(end) = self.ending {
            self.finish(end, self.status.lines);
            return Change::None;
        }
        match self.status.activity {
            Activity::Rest | Activity::SpinUp => {}
            Activity::Jog => self.finish(MotionEnd::Done, InputLines::NONE),
            Activity::Probe => {
                let end = self.judge_contact(steady, MotionEnd::NotTripped);
                self.finish(end, InputLines::PROBE);
            }
            Activity::Seek | Activity::BackOff | Activity::Approach | Activity::Clear => {
                return self.follow_homing(steady);
            }
        }
        Change::None
    }

    /// The end of a move towards a contact that has come to rest.
    fn judge_contact(&mut self, steady: InputLines, missed: MotionEnd) -> MotionEnd {
        let is_closed = steady.has(self.wanted());
        match self.contact.touched_nm {
            None => missed,
            Some(_) if !is_closed || self.contact.bounces() => MotionEnd::Bounces,
            Some(touched) => {
                self.status.tripped_nm = Some(touched);
                MotionEnd::Done
            }
        }
    }

    fn follow_homing(&mut self, steady: InputLines) -> Change {
        let axis = self.status.axis;
        let switch = self.homing.switch();
        let judged = match self.status.activity {
            Activity::Approach => self.judge_contact(steady, MotionEnd::NotFound),
            _ => MotionEnd::Done,
        };
        let tripped_nm = self.status.tripped_nm;
        let at = self.axis_nm(axis);
        let next = self
            .homing
            .after(self.status.activity, steady, judged, at, &self.contact);
        match next {
            Next::Fails(end) => self.finish(end, switch),
            Next::Moves(activity, nm, speed_mm_s) => self.lead_homing(activity, at, nm, speed_mm_s, steady),
            Next::Placed(position_nm) => {
                // Where it stands, beyond the place at which the switch has tripped.
                let beyond = at.wrapping_sub(tripped_nm.unwrap_or(at));
                if let Some(place) = self.status.at_nm.get_mut(usize::from(axis)) {
                    *place = position_nm.wrapping_add(beyond);
                }
                let at = self.axis_nm(axis);
                let (nm, speed_mm_s) = self.homing.clear();
                self.lead_homing(Activity::Clear, at, nm - i64::from(beyond), speed_mm_s, steady);
                self.status.tripped_nm = Some(position_nm);
                return Change::Placed;
            }
            Next::AxisDone => {
                self.status.homed_axes |= 1_u8.checked_shl(axis.into()).unwrap_or(0);
                self.next_axis(steady);
                if !self.is_active() && self.status.homed_axes == ALL_AXES {
                    return Change::Homed;
                }
            }
        }
        Change::None
    }

    /// Begins a move of the homing, by a distance.
    fn lead_homing(&mut self, activity: Activity, at: i32, nm: i64, speed_mm_s: f32, lines: InputLines) {
        let Some(setup) = self.setup else {
            return self.finish(MotionEnd::Stopped, InputLines::NONE);
        };
        let to = i64::from(at) + nm;
        let to = i32::try_from(to).unwrap_or(if nm < 0 { i32::MIN } else { i32::MAX });
        let axis = self.homing.axis();
        self.lead(&setup, activity, axis, to, speed_mm_s, lines);
    }

    /// Begins with the next axis of the homing, or ends it.
    fn next_axis(&mut self, lines: InputLines) {
        let Some(axis) = self.homing.next_axis() else {
            return self.finish(MotionEnd::Done, InputLines::NONE);
        };
        self.status.axis = axis;
        self.status.homed_axes &= !1_u8.checked_shl(axis.into()).unwrap_or(0);
        let travel = self.setup.and_then(|setup| setup.travel(axis)).unwrap_or([0; 2]);
        let at = self.axis_nm(axis);
        match self.homing.begin(travel, lines) {
            Next::Moves(activity, nm, speed_mm_s) => self.lead_homing(activity, at, nm, speed_mm_s, lines),
            _ => {
                let both = InputLines::limit(axis, false).or(InputLines::limit(axis, true));
                self.finish(MotionEnd::WrongSwitch, both.and(lines));
            }
        }
    }
}

/// A bit an axis.
const ALL_AXES: u8 = 0b111;

/// The refusal of a move towards an asserted limit switch.
fn hindered(lines: InputLines) -> Reason {
    let fault = interp_core::Fault::new(interp_core::FaultKind::LimitSwitch, f32::from(lines.0));
    Reason::Unsafe { fault: fault.into() }
}
