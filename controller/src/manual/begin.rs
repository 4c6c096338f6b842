//! Begins a motion: checks the request, and plans its first move.

use interp_core::positioning::Line;
use protocol::{
    digest::Digest,
    message::{Activity, InputLines, JogWay, MotionEnd, MotionStatus, Reason},
};

use super::{
    ALL_AXES, DEAD_MAN_TICKS, DOOR_MM_S, HEARD_TICKS, Manual, Motion, ProbeMove, contact::Contact,
    homing::Homing, setup::Setup,
};

/// State of the board outside [`Manual`] that decides whether a motion may begin, and how fast it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowed {
    /// The debounced inputs.
    pub(crate) lines: InputLines,
    /// Every axis is homed.
    pub(crate) is_homed: bool,
    /// Feed override, percent.
    pub(crate) feed_override: u8,
    /// The spindle is switched on.
    pub(crate) spindle_turns: bool,
}

impl Manual {
    /// Begins a motion, or stops the present one.
    ///
    /// # Errors
    /// The reason of the refusal; nothing has changed.
    pub(crate) fn begin(&mut self, motion: Motion, allowed: &Allowed) -> Result<(), Reason> {
        let lines = allowed.lines;
        if motion == Motion::Stop {
            self.stop(MotionEnd::Stopped);
            return Ok(());
        }
        if let Motion::Jog { way, .. } = motion
            && self.is_active()
            && self.repeated == Some(way)
            && self.ending.is_none()
        {
            self.alive = DEAD_MAN_TICKS;
            return Ok(());
        }
        if self.is_active() {
            return Err(Reason::Moving);
        }
        motion.check_speed()?;
        let setup = self.setup.ok_or(Reason::NoProfile)?;
        let known = if allowed.is_homed {
            ALL_AXES
        } else {
            self.status.homed_axes
        };
        match motion {
            Motion::Jog { way, speed_mm_s } => {
                if allowed.feed_override == 0 {
                    return Err(Reason::NoFeed);
                }
                let speed_mm_s = speed_mm_s * f32::from(allowed.feed_override) * 0.01;
                self.begin_jog(&setup, way, speed_mm_s, lines, known)
            }
            Motion::Probe(_) if allowed.spindle_turns => Err(Reason::SpindleTurns),
            Motion::Probe(probe) => self.begin_probe(&setup, probe, lines, known),
            Motion::Home { axes } => {
                let profile = setup.homing().ok_or(Reason::NoHoming)?;
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
        way: JogWay,
        speed_mm_s: f32,
        lines: InputLines,
        known: u8,
    ) -> Result<(), Reason> {
        let from_nm = self.status.at_nm;
        let to_nm = match way {
            JogWay::By { nm } => goal_of(setup, from_nm, nm, known)?,
            JogWay::Towards { signs } => end_of(setup, from_nm, signs, known),
        };
        unhindered(from_nm, to_nm, lines)?;
        let is_repeated = matches!(way, JogWay::Towards { .. });
        self.repeated = is_repeated.then_some(way);
        self.lead(setup, Activity::Jog, to_nm, speed_mm_s, lines);
        if is_repeated {
            self.alive = DEAD_MAN_TICKS;
        }
        Ok(())
    }

    fn begin_probe(
        &mut self,
        setup: &Setup,
        probe: ProbeMove,
        lines: InputLines,
        known: u8,
    ) -> Result<(), Reason> {
        let ProbeMove { axis, nm, speed_mm_s } = probe;
        let mut by_nm = [0; 3];
        let Some(by) = by_nm.get_mut(usize::from(axis)) else {
            return Err(Reason::OutOfRange {
                most: 2,
                wanted: axis.into(),
            });
        };
        *by = nm;
        let from_nm = self.status.at_nm;
        let to_nm = goal_of(setup, from_nm, by_nm, known)?;
        unhindered(from_nm, to_nm, lines)?;
        if lines.has(InputLines::PROBE) {
            return Err(Reason::ProbeTripped);
        }
        self.repeated = None;
        self.lead(setup, Activity::Probe, to_nm, speed_mm_s, lines);
        Ok(())
    }

    /// Begins a move of a motion.
    pub(super) fn lead(
        &mut self,
        setup: &Setup,
        activity: Activity,
        to_nm: [i32; 3],
        speed_mm_s: f32,
        lines: InputLines,
    ) {
        let most = if lines.has(InputLines::DOOR) {
            DOOR_MM_S
        } else {
            f32::MAX
        };
        self.line = Line::new(
            self.status.at_nm,
            to_nm,
            setup.limits(),
            if speed_mm_s < most { speed_mm_s } else { most },
        );
        self.axis = self.line.leading_axis();
        self.before_nm = [self.axis_nm(self.axis); 2];
        self.contact = Contact::NONE;
        self.rested = 0;
        self.at_start = lines.and(InputLines::LIMITS.or(InputLines::DOOR));
        self.alive = HEARD_TICKS;
        self.ending = None;
        self.digest = Digest::new();
        self.status = MotionStatus {
            activity,
            axes: self.line.axes(),
            end: MotionEnd::None,
            lines: InputLines::NONE,
            tripped_nm: None,
            periods: 0,
            digest: 0,
            ..self.status
        };
    }
}

/// The goal of a move by distances; `known`: the axes whose travel holds.
fn goal_of(setup: &Setup, from_nm: [i32; 3], by_nm: [i32; 3], known: u8) -> Result<[i32; 3], Reason> {
    let mut to_nm = from_nm;
    for (axis, (to, by)) in (0..).zip(to_nm.iter_mut().zip(by_nm)) {
        if by != 0 {
            *to = setup.within(axis, i64::from(*to) + i64::from(by), *to, known >> axis & 1 != 0)?;
        }
    }
    Ok(to_nm)
}

/// The goal of a continuous jog: as far as all of its axes can go the same way. Those that are at their end stay.
fn end_of(setup: &Setup, from_nm: [i32; 3], signs: [i8; 3], known: u8) -> [i32; 3] {
    let mut rooms = [0_i64; 3];
    for (axis, (room, (from, sign))) in (0..).zip(rooms.iter_mut().zip(from_nm.into_iter().zip(signs))) {
        // Without a home as far as the coordinate goes.
        let [least, most] = match setup.travel(axis) {
            Some(travel) if known >> axis & 1 != 0 => travel,
            _ => [i32::MIN, i32::MAX],
        };
        *room = match sign.signum() {
            1 => i64::from(most) - i64::from(from),
            -1 => i64::from(from) - i64::from(least),
            _ => 0,
        };
    }
    let least = rooms.into_iter().filter(|room| *room > 0).min().unwrap_or(0);
    let mut to_nm = from_nm;
    for (to, (room, sign)) in to_nm.iter_mut().zip(rooms.into_iter().zip(signs)) {
        if room > 0 {
            *to = i32::try_from(i64::from(*to) + least * i64::from(sign.signum())).unwrap_or(*to);
        }
    }
    to_nm
}

/// Refuses a move towards an asserted limit switch.
fn unhindered(from_nm: [i32; 3], to_nm: [i32; 3], lines: InputLines) -> Result<(), Reason> {
    let mut towards = InputLines::NONE;
    for (axis, (from, to)) in (0..).zip(from_nm.into_iter().zip(to_nm)) {
        if to != from {
            towards = towards.or(InputLines::limit(axis, to > from));
        }
    }
    if !lines.has(towards) {
        return Ok(());
    }
    let lines = lines.and(towards);
    let fault = interp_core::Fault::new(interp_core::FaultKind::LimitSwitch, f32::from(lines.0));
    Err(Reason::Unsafe { fault: fault.into() })
}
