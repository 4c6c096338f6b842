//! What follows a move that has come to rest: the verdict on a contact, and the next move of a homing.

use protocol::message::{Activity, InputLines, MotionEnd};

use super::{ALL_AXES, Change, Manual, homing::Next};

impl Manual {
    /// What follows a move that has come to rest.
    pub(super) fn follow(&mut self, steady: InputLines) -> Change {
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
        let axis = self.homing.axis();
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
                self.status.homed_axes |= bit(axis);
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
        let mut to_nm = self.status.at_nm;
        if let Some(place) = to_nm.get_mut(usize::from(self.homing.axis())) {
            *place = to;
        }
        self.lead(&setup, activity, to_nm, speed_mm_s, lines);
    }

    /// Begins with the next axis of the homing, or ends it.
    pub(super) fn next_axis(&mut self, lines: InputLines) {
        let Some(axis) = self.homing.next_axis() else {
            return self.finish(MotionEnd::Done, InputLines::NONE);
        };
        self.status.axes = bit(axis);
        self.status.homed_axes &= !bit(axis);
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

/// The bit of an axis.
fn bit(axis: u8) -> u8 {
    1_u8.checked_shl(axis.into()).unwrap_or(0)
}
