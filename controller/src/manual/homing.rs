//! Homing of one axis after the other: towards the switch, off it, slowly towards it again, off it to rest. What is found before and after each move is checked.
//!
//! | before, after | must be | otherwise |
//! |---|---|---|
//! | at the start | not both switches of the axis | wrong switch: an input that is not wired, or a broken wire |
//! | any move | no other limit switch trips | wrong switch: plugs swapped, or the direction is inverted |
//! | seek | the switch trips within the travel | not found |
//! | back off, clear | the switch is released | stuck, after some tries |
//! | approach | the switch trips within twice the way back | not found |
//! | approach | it stays tripped, at rest | bounces |

use protocol::message::{Activity, Homing as Profile, InputLines, MotionEnd};

use super::Contact;

/// The search for a switch ends this far beyond the travel, in eighths of the travel.
const BEYOND_EIGHTHS: i64 = 1;

/// Number of moves off a switch after which the switch counts as stuck.
const TRIES: u8 = 6;

/// Next step of a homing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Next {
    /// A move by this distance, nm, at this speed, mm/s.
    Moves(Activity, i64, f32),
    /// The switch is at this machine coordinate, nm.
    Placed(i32),
    /// The axis is homed.
    AxisDone,
    /// The homing has failed.
    Fails(MotionEnd),
}

/// The homing under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Homing {
    profile: Option<Profile>,
    /// Axes that are still to be homed, one bit each.
    left: u8,
    axis: u8,
    /// Length of the search, nm.
    search_nm: i64,
    tries: u8,
}

impl Homing {
    pub(super) const NONE: Self = Self {
        profile: None,
        left: 0,
        axis: 0,
        search_nm: 0,
        tries: 0,
    };

    /// Of these axes; none: all that have a switch.
    pub(super) fn new(profile: &Profile, axes: u8) -> Self {
        let wanted = if axes & super::ALL_AXES == 0 {
            super::ALL_AXES
        } else {
            axes
        };
        Self {
            profile: Some(*profile),
            left: wanted & profile.axes(),
            ..Self::NONE
        }
    }

    pub(super) const fn axis(&self) -> u8 {
        self.axis
    }

    /// The next axis in the profile's order.
    pub(super) fn next_axis(&mut self) -> Option<u8> {
        let order = self.profile?.order;
        let bit = |axis: u8| 1_u8.checked_shl(axis.into()).unwrap_or(0);
        let axis = order.into_iter().find(|axis| self.left & bit(*axis) != 0)?;
        self.left &= !bit(axis);
        self.axis = axis;
        self.tries = 0;
        Some(axis)
    }

    fn of<T: Copy>(&self, values: impl Fn(&Profile) -> [T; 3], none: T) -> T {
        let values = self.profile.as_ref().map(values);
        values
            .and_then(|values| values.get(usize::from(self.axis)).copied())
            .unwrap_or(none)
    }

    fn is_upper(&self) -> bool {
        self.of(|profile| profile.at_upper_end, false)
    }

    /// The switch that is looked for.
    pub(super) fn switch(&self) -> InputLines {
        InputLines::limit(self.axis, self.is_upper())
    }

    /// A distance towards the switch.
    fn towards(&self, nm: i64) -> i64 {
        if self.is_upper() { nm } else { -nm }
    }

    fn back_off_nm(&self) -> i64 {
        self.of(|profile| profile.back_off_nm, 1).into()
    }

    fn seek_mm_s(&self) -> f32 {
        self.of(|profile| profile.seek_mm_s, 1.0)
    }

    /// The first move of the axis, by what its switches say.
    pub(super) fn begin(&mut self, travel_nm: [i32; 2], lines: InputLines) -> Next {
        let [least, most] = travel_nm.map(i64::from);
        let length = most - least;
        self.search_nm = length + length * BEYOND_EIGHTHS / 8 + self.back_off_nm();
        let own = self.switch();
        let other = InputLines::limit(self.axis, !self.is_upper());
        if lines.has(own) && lines.has(other) {
            return Next::Fails(MotionEnd::WrongSwitch);
        }
        if lines.has(own) {
            return self.off(Activity::BackOff, 0);
        }
        self.seek()
    }

    fn seek(&self) -> Next {
        Next::Moves(Activity::Seek, self.towards(self.search_nm), self.seek_mm_s())
    }

    /// Off the switch by its distance and some more, nm.
    fn off(&self, activity: Activity, more_nm: i64) -> Next {
        Next::Moves(
            activity,
            -self.towards(self.back_off_nm() + more_nm),
            self.seek_mm_s(),
        )
    }

    /// The last move of an axis: back to where the switch is released.
    pub(super) fn clear(&mut self) -> (i64, f32) {
        self.tries = 0;
        (-self.towards(self.back_off_nm()), self.seek_mm_s())
    }

    /// What follows a move that has come to rest at `at_nm`. `judged`: the contact of an approach.
    pub(super) fn after(
        &mut self,
        activity: Activity,
        lines: InputLines,
        judged: MotionEnd,
        at_nm: i32,
        contact: &Contact,
    ) -> Next {
        let is_tripped = lines.has(self.switch());
        match activity {
            Activity::Seek if !is_tripped && contact.touched_nm.is_some() => Next::Fails(MotionEnd::Bounces),
            Activity::Seek if !is_tripped => Next::Fails(MotionEnd::NotFound),
            Activity::Seek => {
                // As far as it has run on, and the distance.
                let over = contact
                    .touched_nm
                    .map_or(0, |touched| (i64::from(at_nm) - i64::from(touched)).abs());
                self.off(Activity::BackOff, over)
            }
            Activity::BackOff | Activity::Clear if is_tripped => {
                self.tries += 1;
                if self.tries >= TRIES {
                    Next::Fails(MotionEnd::Stuck)
                } else {
                    self.off(activity, 0)
                }
            }
            Activity::BackOff => {
                let approach_mm_s = self.of(|profile| profile.approach_mm_s, 1.0);
                let tries = i64::from(self.tries) + 2;
                Next::Moves(
                    Activity::Approach,
                    self.towards(tries * self.back_off_nm()),
                    approach_mm_s,
                )
            }
            Activity::Approach if judged == MotionEnd::Done => {
                Next::Placed(self.of(|profile| profile.position_nm, 0))
            }
            Activity::Approach => Next::Fails(judged),
            _ => Next::AxisDone,
        }
    }
}
