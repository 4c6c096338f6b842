//! The machine around a board, as the board keeps it beyond a power cut.

use interp_core::{AxisLimits, steps::StepConfig};
use serde::{Deserialize, Serialize};

use crate::{
    frame,
    manual::Homing,
    records::StepSettings,
    safety::{Configuration, DoorContact},
    spindle::SpindleSettings,
};

/// Longest encoding of a [`Profile`], bytes: every varint at its maximum length.
pub const PROFILE_BYTES_MAX: usize = 190;

/// Greatest axis limit that a profile may have, in mm and seconds: far above any machine, and within `f32` whatever is computed of it.
const LIMIT_MAX: f32 = 1e9;

/// The machine around a board: its drives, the greatest limits of its axes, its travel and its supervision. Kept by the board; a job may lower its limits,
/// but not exceed them. Axes in the order x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// Steps, directions and pulse times.
    pub steps: StepSettings,
    /// Greatest velocity, mm/s.
    pub velocity_mm_s: [f32; 3],
    /// Greatest acceleration, mm/s^2.
    pub acceleration_mm_s2: [f32; 3],
    /// Greatest jerk, mm/s^3.
    pub jerk_mm_s3: [f32; 3],
    /// Least and greatest position, nm; none where the travel is not limited.
    pub travel_nm: Option<[[i32; 2]; 3]>,
    /// Homing and link timeout.
    pub configuration: Configuration,
    /// Homing by the limit switches; none where a position is declared.
    pub homing: Option<Homing>,
    /// The probe is tripped where its input is not asserted: a contact that closes when it touches.
    pub probe_inverted: bool,
    /// The spindle, if there is one.
    pub spindle: Option<SpindleSettings>,
    /// Axes whose step pulses have the level opposite to the one in the board's table, one bit each.
    pub step_inverted: u8,
    /// Axes whose drives are enabled by the level opposite to the one in the board's table, one bit each.
    pub enable_inverted: u8,
    /// The safety door.
    pub door: DoorContact,
}

/// A value of a profile that a job may not exceed. The codes on the wire count from 0 in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ProfileLimit {
    /// 0: velocity, mm/s.
    Velocity,
    /// 1: acceleration, mm/s^2.
    Acceleration,
    /// 2: jerk, mm/s^3.
    Jerk,
    /// 3: travel, mm.
    Travel,
    /// 4: steps, directions and pulse times, which are the drives' and no job's.
    Steps,
    /// 5: a machine that has to be homed.
    Homing,
}

impl ProfileLimit {
    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity, mm/s",
            Self::Acceleration => "acceleration, mm/s^2",
            Self::Jerk => "jerk, mm/s^3",
            Self::Travel => "travel, mm",
            Self::Steps => "steps, directions and pulse times",
            Self::Homing => "homing",
        }
    }
}

/// What of a job exceeds a profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Excess {
    /// The value.
    pub limit: ProfileLimit,
    /// The axis, from 0.
    pub axis: u8,
    /// The profile's value.
    pub most: f32,
    /// The job's.
    pub wanted: f32,
}

impl Excess {
    /// A value without an axis and without numbers.
    #[must_use]
    pub const fn of(limit: ProfileLimit) -> Self {
        Self {
            limit,
            axis: 0,
            most: 0.0,
            wanted: 0.0,
        }
    }
}

/// Nanometres in millimetres, for a message.
#[allow(clippy::cast_precision_loss, reason = "a value to be read by a person")]
fn mm(nm: i32) -> f32 {
    nm as f32 * 1e-6
}

impl Profile {
    /// Digest of every value, never 0: host and board compare by it.
    #[must_use]
    pub fn digest(&self) -> u32 {
        let mut bytes = [0; PROFILE_BYTES_MAX];
        frame::crc32(self.write(&mut bytes)).max(1)
    }

    /// The encoding: as on the wire. Empty where `bytes` is shorter than [`PROFILE_BYTES_MAX`] and it does not fit.
    pub fn write<'b>(&self, bytes: &'b mut [u8]) -> &'b [u8] {
        postcard::to_slice(self, bytes).map_or(&[], |written| &*written)
    }

    /// The profile of an encoding, if it is one with valid values and nothing after it.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Option<Self> {
        match postcard::take_from_bytes::<Self>(bytes) {
            Ok((profile, [])) if profile.is_valid() => Some(profile),
            _ => None,
        }
    }

    /// Whether every value is within its range: limits above 0, travel ascending, steps as [`StepConfig::check`] wants them.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let limits = [self.velocity_mm_s, self.acceleration_mm_s2, self.jerk_mm_s3];
        let is_limit = |limit: &f32| *limit > 0.0 && *limit <= LIMIT_MAX;
        let ascends = |travel: [[i32; 2]; 3]| travel.iter().all(|[least, most]| least < most);
        limits.iter().flatten().all(is_limit)
            && self.travel_nm.is_none_or(ascends)
            && StepConfig::from(self.steps).check().is_ok()
            && self.spindle.is_none_or(|spindle| spindle.max_rpm > 0)
            && self.step_inverted | self.enable_inverted <= 0b111
            // The search for a switch ends with the travel.
            && self
                .homing
                .is_none_or(|homing| self.travel_nm.is_some() && homing.is_valid(self.velocity_mm_s))
    }

    /// Whether a period of this length, s, holds the steps of each axis at its greatest velocity. Half a step is left for positions in whole nanometres.
    #[must_use]
    pub fn has_room_for_steps(&self, period_s: f32) -> bool {
        let config = StepConfig::from(self.steps);
        let Ok(checked) = config.check() else {
            return false;
        };
        #[allow(
            clippy::cast_precision_loss,
            reason = "steps_max is at most 500; a ratio needs no last digit"
        )]
        let (steps_max, scale) = (
            checked.steps_max() as f32,
            config.axes.map(|axis| axis.steps as f32 / axis.mm as f32),
        );
        let steps = |(velocity_mm_s, scale)| velocity_mm_s * scale * period_s;
        self.velocity_mm_s
            .into_iter()
            .zip(scale)
            .all(|axis| steps(axis) + 0.5 < steps_max)
    }

    /// The first limit that a job's axes exceed, if any.
    #[must_use]
    pub fn exceeded_by(&self, axes: &AxisLimits) -> Option<Excess> {
        let limits = [
            (ProfileLimit::Velocity, self.velocity_mm_s, axes.velocity_mm_s),
            (
                ProfileLimit::Acceleration,
                self.acceleration_mm_s2,
                axes.acceleration_mm_s2,
            ),
            (ProfileLimit::Jerk, self.jerk_mm_s3, axes.jerk_mm_s3),
        ];
        for (limit, most, wanted) in limits {
            for (axis, (most, wanted)) in (0..).zip(most.into_iter().zip(wanted)) {
                if wanted > most {
                    return Some(Excess {
                        limit,
                        axis,
                        most,
                        wanted,
                    });
                }
            }
        }
        for (axis, (range, wanted)) in (0..).zip(self.travel_nm?.into_iter().zip(axes.travel_nm)) {
            let ([least, most], [from, to]) = (range, wanted);
            let (most, wanted) = if from < least {
                (least, from)
            } else if to > most {
                (most, to)
            } else {
                continue;
            };
            return Some(Excess {
                limit: ProfileLimit::Travel,
                axis,
                most: mm(most),
                wanted: mm(wanted),
            });
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use interp_core::steps::AxisSteps;

    const PROFILE: Profile = Profile {
        steps: StepSettings::DEFAULT,
        velocity_mm_s: [100.0, 80.0, 50.0],
        acceleration_mm_s2: [1000.0; 3],
        jerk_mm_s3: [20_000.0; 3],
        travel_nm: Some([[-1_000_000, 300_000_000], [0, 200_000_000], [-100_000_000, 0]]),
        configuration: Configuration::DEFAULT,
        homing: None,
        probe_inverted: false,
        spindle: None,
        step_inverted: 0,
        enable_inverted: 0,
        door: DoorContact::NormallyClosed,
    };

    fn axes() -> AxisLimits {
        AxisLimits {
            velocity_mm_s: PROFILE.velocity_mm_s,
            acceleration_mm_s2: PROFILE.acceleration_mm_s2,
            jerk_mm_s3: PROFILE.jerk_mm_s3,
            chord_mm: 0.005,
            overrun_mm: 0.0,
            travel_nm: PROFILE.travel_nm.unwrap(),
            home_nm: [0; 3],
            plunge_mm: 1.0,
            end_nm: None,
            end_height_nm: 0,
            safe_z_nm: 0,
        }
    }

    #[test]
    fn a_job_may_lower_each_limit_and_exceed_none() {
        assert_eq!(PROFILE.exceeded_by(&axes()), None);
        let mut lower = axes();
        (lower.velocity_mm_s[1], lower.travel_nm[2]) = (1.0, [-1, 0]);
        assert_eq!(PROFILE.exceeded_by(&lower), None);
        type Change = fn(&mut AxisLimits);
        let changes: [(Change, ProfileLimit, u8); 5] = [
            (|axes| axes.velocity_mm_s[1] = 80.001, ProfileLimit::Velocity, 1),
            (
                |axes| axes.acceleration_mm_s2[0] = 1001.0,
                ProfileLimit::Acceleration,
                0,
            ),
            (|axes| axes.jerk_mm_s3[2] = 20_001.0, ProfileLimit::Jerk, 2),
            (|axes| axes.travel_nm[0][0] -= 1, ProfileLimit::Travel, 0),
            (|axes| axes.travel_nm[2][1] += 1, ProfileLimit::Travel, 2),
        ];
        for (change, limit, axis) in changes {
            let mut axes = axes();
            change(&mut axes);
            let excess = PROFILE.exceeded_by(&axes).unwrap();
            assert_eq!((excess.limit, excess.axis), (limit, axis));
        }
        let anywhere = Profile {
            travel_nm: None,
            ..PROFILE
        };
        let mut axes = axes();
        axes.travel_nm = [[i32::MIN, i32::MAX]; 3];
        assert_eq!(anywhere.exceeded_by(&axes), None);
        assert!(PROFILE.exceeded_by(&axes).is_some());
    }

    #[test]
    fn an_encoding_is_read_back_and_nothing_else_is() {
        let mut buffer = [0; PROFILE_BYTES_MAX];
        let bytes = PROFILE.write(&mut buffer);
        assert_eq!(Profile::read(bytes), Some(PROFILE));
        assert_eq!(Profile::read(&bytes[..bytes.len() - 1]), None);
        assert_eq!(Profile::read(&[]), None);
        for wrong in [
            Profile {
                velocity_mm_s: [0.0, 1.0, 1.0],
                ..PROFILE
            },
            Profile {
                jerk_mm_s3: [f32::NAN; 3],
                ..PROFILE
            },
            Profile {
                travel_nm: Some([[1, 1]; 3]),
                ..PROFILE
            },
            Profile {
                step_inverted: 0b1000,
                ..PROFILE
            },
        ] {
            let mut buffer = [0; PROFILE_BYTES_MAX];
            assert_eq!(Profile::read(wrong.write(&mut buffer)), None);
            assert_ne!(wrong.digest(), PROFILE.digest());
        }
    }

    #[test]
    fn the_longest_profile_fits() {
        let axis = AxisSteps {
            steps: u32::MAX,
            mm: u32::MAX,
            inverted: true,
        };
        let longest = Profile {
            steps: StepConfig {
                axes: [axis; 3],
                pulse_slots: u8::MAX,
                setup_slots: u16::MAX,
            }
            .into(),
            travel_nm: Some([[i32::MIN, i32::MAX]; 3]),
            configuration: Configuration {
                link_timeout_ticks: u32::MAX,
                ..Configuration::DEFAULT
            },
            homing: Some(Homing {
                order: [2, 1, 0],
                at_upper_end: [true; 3],
                position_nm: [i32::MIN; 3],
                seek_mm_s: [1.0; 3],
                approach_mm_s: [1.0; 3],
                back_off_nm: [i32::MAX; 3],
                survives_off: true,
            }),
            spindle: Some(SpindleSettings {
                max_rpm: u32::MAX,
                at_speed_ticks: u32::MAX,
                stops_at_pause: true,
                at_speed: crate::spindle::AtSpeed::Closes,
            }),
            ..PROFILE
        };
        let mut buffer = [0; PROFILE_BYTES_MAX];
        assert_eq!(longest.write(&mut buffer).len(), PROFILE_BYTES_MAX);
    }
}
