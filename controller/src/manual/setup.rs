//! The part of the machine's profile for motion outside a job, inputs and outputs.

use interp_core::positioning::LineLimits;
use protocol::message::{AtSpeed, DoorContact, Homing, InputLines, Profile, Reason, SpindleSettings};

/// The part of the machine's profile for motion outside a job, inputs and outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    limits: LineLimits,
    /// Least and greatest coordinate of each axis, nm.
    travel_nm: Option<[[i32; 2]; 3]>,
    /// Digest of the settings of the drives.
    steps: u32,
    homing: Option<Homing>,
    /// Inputs whose level means the opposite of the one in the board's table.
    inverted: InputLines,
    /// Inputs that the machine does not have.
    ignored: InputLines,
    spindle: Option<SpindleSettings>,
    /// Axes whose step pulses have the opposite level, one bit each.
    step_inverted: u8,
    /// Axes whose drives are enabled by the opposite level, one bit each.
    enable_inverted: u8,
}

impl Setup {
    /// Of a profile, on a board with this period.
    #[must_use]
    pub fn new(profile: &Profile, period_s: f32) -> Self {
        let input = |is_set: bool, input: InputLines| if is_set { input } else { InputLines::NONE };
        let at_speed = profile
            .spindle
            .map_or(AtSpeed::ByTime, |spindle| spindle.at_speed);
        let inverted = input(profile.probe_inverted, InputLines::PROBE)
            .or(input(profile.door == DoorContact::NormallyOpen, InputLines::DOOR))
            .or(input(at_speed == AtSpeed::Opens, InputLines::AT_SPEED));
        let ignored = input(profile.door == DoorContact::None, InputLines::DOOR)
            .or(input(at_speed == AtSpeed::ByTime, InputLines::AT_SPEED));
        Self {
            limits: LineLimits {
                velocity_mm_s: profile.velocity_mm_s,
                acceleration_mm_s2: profile.acceleration_mm_s2,
                jerk_mm_s3: profile.jerk_mm_s3,
                period_s,
            },
            travel_nm: profile.travel_nm,
            steps: profile.steps.digest(),
            homing: profile.homing,
            inverted,
            ignored,
            spindle: profile.spindle,
            step_inverted: profile.step_inverted,
            enable_inverted: profile.enable_inverted,
        }
    }

    /// Whether a position stays the same under another profile: drives and homing are those of this one.
    pub(crate) fn has_coordinates_of(&self, other: &Self) -> bool {
        self.steps == other.steps && self.homing == other.homing
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

    /// Inputs whose level means the opposite of the one in the board's table.
    pub(crate) const fn inverted(&self) -> InputLines {
        self.inverted
    }

    /// Inputs that the machine does not have.
    pub(crate) const fn ignored(&self) -> InputLines {
        self.ignored
    }

    /// Whether the position survives drives that are off.
    pub(crate) fn home_survives_off(&self) -> bool {
        self.homing.is_some_and(|homing| homing.survives_off)
    }

    pub(super) const fn limits(&self) -> &LineLimits {
        &self.limits
    }

    pub(super) const fn homing(&self) -> Option<Homing> {
        self.homing
    }

    pub(super) fn travel(&self, axis: u8) -> Option<[i32; 2]> {
        self.travel_nm?.get(usize::from(axis)).copied()
    }

    /// A position that is within the travel of a homed axis.
    pub(super) fn within(&self, axis: u8, wanted: i64, from_nm: i32, is_homed: bool) -> Result<i32, Reason> {
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
