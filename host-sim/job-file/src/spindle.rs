//! The section `[spindle]`: of a job, and of a machine's profile.

use job::{JobError, MachineProfile, Spindle, SpindleDrive};

use crate::homing::contact;
use crate::section::Section;

/// Largest spindle speed, 1/min.
const RPM_MAX: f64 = 1e6;
/// Longest time from switching the spindle on to its speed, ms.
const AT_SPEED_MAX_MS: f64 = 60_000.0;

/// Key of the contact that reports the speed.
const AT_SPEED: &str = "at_speed_contact";

fn rpm(section: &Section<'_>, key: &str) -> Result<u32, JobError> {
    let value = section.number_within(key, 0.0, RPM_MAX, "a speed in turns a minute, e.g. 12000")?;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 to RPM_MAX"
    )]
    let rpm = value.round() as u32;
    Ok(rpm)
}

/// Reads that of a job, for a machine with this profile.
pub(super) fn read(section: &Section<'_>, profile: Option<&MachineProfile>) -> Result<Spindle, JobError> {
    section.only(&["rpm", "direction", "coolant"], &[])?;
    let spindle = Spindle {
        rpm: rpm(section, "rpm")?,
        counterclockwise: section.has("direction")
            && section.choice("direction", &[("cw", false), ("ccw", true)])?,
        coolant: section.has("coolant") && section.switch("coolant")?,
    };
    if let Some(profile) = profile {
        let Some(drive) = profile.spindle else {
            let remedy = "remove it, or add [spindle] with max_rpm to the profile";
            return Err(section.error("rpm", "the machine's profile has no spindle", remedy));
        };
        if spindle.rpm > drive.max_rpm {
            let what = format!(
                "`rpm` exceeds the machine's profile: {}, {} there",
                spindle.rpm, drive.max_rpm
            );
            return Err(section.error("rpm", what, "lower it"));
        }
    }
    Ok(spindle)
}

/// Reads that of a profile.
pub(super) fn read_drive(section: &Section<'_>) -> Result<SpindleDrive, JobError> {
    section.only(&["max_rpm", "at_speed_ms", "stops_at_pause", AT_SPEED], &[])?;
    let at_speed_ms = if section.has("at_speed_ms") {
        let value = section.number("at_speed_ms")?;
        if !(0.0..=AT_SPEED_MAX_MS).contains(&value) {
            let what = format!("`at_speed_ms` must be 0 to {AT_SPEED_MAX_MS}, not {value}");
            return Err(section.error(
                "at_speed_ms",
                what,
                "give the time that the spindle needs, e.g. 3000",
            ));
        }
        value
    } else {
        job::AT_SPEED_DEFAULT_MS
    };
    Ok(SpindleDrive {
        max_rpm: rpm(section, "max_rpm")?.max(1),
        at_speed_ms,
        stops_at_pause: !section.has("stops_at_pause") || section.switch("stops_at_pause")?,
        at_speed: section
            .has(AT_SPEED)
            .then(|| contact(section, AT_SPEED))
            .transpose()?,
    })
}
