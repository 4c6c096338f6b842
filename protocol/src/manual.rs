//! Motion outside a job: jog, homing, probing, work offsets.

use serde::{Deserialize, Serialize};

use crate::{frame::crc32, safety::InputLines};

/// How far a jog goes, in a straight line of all axes that move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum JogWay {
    /// 0: by a distance.
    By {
        /// Distances of x, y, z, nm; negative towards minus.
        nm: [i32; 3],
    },
    /// 1: for as long as the request is repeated.
    Towards {
        /// The direction of x, y, z: below 0 towards minus, 0 none, above 0 towards plus; two or three axes move at 45 degrees.
        signs: [i8; 3],
    },
}

/// What the axes do outside a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Activity {
    /// 0: nothing.
    #[default]
    Rest,
    /// 1: a jog.
    Jog,
    /// 2: a move until the probe trips.
    Probe,
    /// 3: homing: fast towards the switch.
    Seek,
    /// 4: homing: off the switch.
    BackOff,
    /// 5: homing: slowly towards the switch; where it trips is the axis's home.
    Approach,
    /// 6: homing: off the switch, to rest.
    Clear,
    /// 7: a start, or a resume of the run that is held, that waits for the spindle.
    SpinUp,
}

impl Activity {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Jog => "jog",
            Self::Probe => "probe",
            Self::Seek => "home-seek",
            Self::BackOff => "home-back-off",
            Self::Approach => "home-approach",
            Self::Clear => "home-clear",
            Self::SpinUp => "spin-up",
        }
    }
}

/// How the last motion outside a job ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum MotionEnd {
    /// 0: there was none, or it is under way.
    #[default]
    None,
    /// 1: as it should.
    Done,
    /// 2: by the operator.
    Stopped,
    /// 3: the host did not repeat its request, or was not heard any more.
    HostGone,
    /// 4: by a limit switch.
    LimitSwitch,
    /// 5: the drives went off.
    DrivesOff,
    /// 6: the probe did not trip.
    NotTripped,
    /// 7: the contact did not stay closed: noise, or a contact that bounces.
    Bounces,
    /// 8: the switch was not found within the travel, or not again.
    NotFound,
    /// 9: the switch did not release.
    Stuck,
    /// 10: another switch tripped than the one that was looked for.
    WrongSwitch,
    /// 11: the safety door was opened.
    Door,
    /// 12: an axis was to make more steps than a period holds; none is lost.
    StepRate,
    /// 13: step pulses were not emitted in time; the position is lost.
    StepOutput,
}

impl MotionEnd {
    /// Every end, in order of its code.
    pub const ALL: [Self; 14] = [
        Self::None,
        Self::Done,
        Self::Stopped,
        Self::HostGone,
        Self::LimitSwitch,
        Self::DrivesOff,
        Self::NotTripped,
        Self::Bounces,
        Self::NotFound,
        Self::Stuck,
        Self::WrongSwitch,
        Self::Door,
        Self::StepRate,
        Self::StepOutput,
    ];

    /// Its name in JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Done => "done",
            Self::Stopped => "stopped",
            Self::HostGone => "host-gone",
            Self::LimitSwitch => "limit-switch",
            Self::DrivesOff => "drives-off",
            Self::NotTripped => "not-tripped",
            Self::Bounces => "bounces",
            Self::NotFound => "not-found",
            Self::Stuck => "stuck",
            Self::WrongSwitch => "wrong-switch",
            Self::Door => "door",
            Self::StepRate => "step-rate",
            Self::StepOutput => "step-output",
        }
    }
}

/// The axes outside a job: where they are, what they do, and what came of the last motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MotionStatus {
    /// What they do.
    pub activity: Activity,
    /// The axes of the present or last motion, one bit each.
    pub axes: u8,
    /// Commanded position, nm; in machine coordinates once homed.
    pub at_nm: [i32; 3],
    /// Axes whose position is known: homed by their switches, or declared, since the position was last lost; one bit each.
    pub homed_axes: u8,
    /// How the last motion ended.
    pub end: MotionEnd,
    /// The inputs that ended it.
    pub lines: InputLines,
    /// Where the axis was when probe or home switch tripped in the last probe move or approach, nm.
    pub tripped_nm: Option<i32>,
    /// Periods of the present or last motion.
    pub periods: u32,
    /// [`crate::digest::Digest`] of its positions: three words a period.
    #[serde(with = "postcard::fixint::le")]
    pub digest: u64,
}

/// Homing of the axes: each towards a limit switch at its end, in this order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Homing {
    /// The axes, from 0, in the order of homing; each once at most. [`NO_AXIS`] stands for those that have no switch.
    pub order: [u8; 3],
    /// Whether the switch is at the upper end of the axis.
    pub at_upper_end: [bool; 3],
    /// Machine coordinate at which the switch trips, nm.
    pub position_nm: [i32; 3],
    /// Speed of the search, mm/s.
    pub seek_mm_s: [f32; 3],
    /// Speed at which the switch's place is taken, mm/s.
    pub approach_mm_s: [f32; 3],
    /// Distance from the switch before the approach, and after homing, nm.
    pub back_off_nm: [i32; 3],
    /// The position stays valid while the drives are off: axes that hold by themselves.
    pub survives_off: bool,
}

/// In [`Homing::order`]: no axis.
pub const NO_AXIS: u8 = 3;

impl Homing {
    /// The axes that have a switch, one bit each.
    #[must_use]
    pub fn axes(&self) -> u8 {
        let bit = |axis: &u8| 1_u8.checked_shl(u32::from(*axis)).unwrap_or(0);
        self.order.iter().map(bit).fold(0, |axes, bit| axes | bit) & 0b111
    }

    /// Whether an axis comes, and none twice, speeds and distances are above 0, and speeds within the axes' velocities, mm/s.
    #[must_use]
    pub fn is_valid(&self, velocity_mm_s: [f32; 3]) -> bool {
        let is_known = |axis: &u8| *axis <= NO_AXIS;
        let named = self.order.iter().filter(|axis| **axis < NO_AXIS).count();
        let speeds = self.seek_mm_s.iter().zip(&self.approach_mm_s);
        self.order.iter().all(is_known)
            && named > 0
            && self.axes().count_ones() as usize == named
            && speeds
                .zip(&velocity_mm_s)
                .all(|((seek, approach), most)| *approach > 0.0 && approach <= seek && seek <= most)
            && self.back_off_nm.iter().all(|distance| *distance > 0)
    }
}

/// Number of work offsets.
pub const WORK_OFFSETS: usize = 3;

/// Longest encoding of [`Offsets`], bytes.
pub const OFFSETS_BYTES_MAX: usize = 5 * (3 * WORK_OFFSETS + 1);

/// Work offsets and tool length: a job's coordinates plus these are the machine's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Offsets {
    /// Machine coordinates of the origin of each work offset, nm, with the reference tool.
    pub work_nm: [[i32; 3]; WORK_OFFSETS],
    /// Length of the present tool above that of the reference tool, nm.
    pub tool_nm: i32,
}

impl Offsets {
    /// No offset.
    pub const NONE: Self = Self {
        work_nm: [[0; 3]; WORK_OFFSETS],
        tool_nm: 0,
    };

    /// Digest of every value, never that of blank flash.
    #[must_use]
    pub fn digest(&self) -> u32 {
        let mut bytes = [0; OFFSETS_BYTES_MAX];
        crc32(self.write(&mut bytes)).min(u32::MAX - 1)
    }

    /// Machine coordinates of the origin of work offset `index` (from 0) with the present tool, nm.
    #[must_use]
    pub fn origin_nm(&self, index: usize) -> Option<[i32; 3]> {
        let [x, y, z] = *self.work_nm.get(index)?;
        Some([x, y, z.saturating_add(self.tool_nm)])
    }

    /// The encoding: as on the wire. Empty where `bytes` is shorter than [`OFFSETS_BYTES_MAX`] and it does not fit.
    pub fn write<'b>(&self, bytes: &'b mut [u8]) -> &'b [u8] {
        postcard::to_slice(self, bytes).map_or(&[], |written| &*written)
    }

    /// The offsets of an encoding, if it is one with nothing after it.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        match postcard::take_from_bytes::<Self>(bytes) {
            Ok((offsets, [])) => Some(offsets),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_offsets_fit_and_are_read_back() {
        let longest = Offsets {
            work_nm: [[i32::MIN; 3]; WORK_OFFSETS],
            tool_nm: i32::MIN,
        };
        let mut bytes = [0; OFFSETS_BYTES_MAX];
        assert_eq!(longest.write(&mut bytes).len(), OFFSETS_BYTES_MAX);
        assert_eq!(Offsets::read(&bytes), Some(longest));
        assert_eq!(Offsets::read(&bytes[..OFFSETS_BYTES_MAX - 1]), None);
        assert_eq!(longest.origin_nm(2), Some([i32::MIN; 3]));
        assert_eq!(longest.origin_nm(3), None);
    }

    #[test]
    fn homing_takes_no_axis_twice() {
        let homing = Homing {
            order: [2, 0, 1],
            at_upper_end: [false, false, true],
            position_nm: [0; 3],
            seek_mm_s: [10.0; 3],
            approach_mm_s: [1.0; 3],
            back_off_nm: [1; 3],
            survives_off: false,
        };
        assert!(homing.is_valid([10.0; 3]) && !homing.is_valid([10.0, 9.0, 10.0]));
        for order in [[0, 1, 1], [0, 1, 4], [0, 1, 255], [3, 3, 3]] {
            assert!(!Homing { order, ..homing }.is_valid([10.0; 3]));
        }
        for (order, axes) in [([0, 1, 3], 0b011), ([2, 3, 3], 0b100)] {
            let some = Homing { order, ..homing };
            assert!(some.is_valid([10.0; 3]) && some.axes() == axes);
        }
        let slow = [1.0, f32::NAN, 1.0];
        assert!(
            !Homing {
                approach_mm_s: slow,
                ..homing
            }
            .is_valid([10.0; 3])
        );
    }
}
