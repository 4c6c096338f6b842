//! The section `[machine]` of a job and of a machine's profile, with every default applied.

use job::{
    AXES, AxisLimits, HEARTBEAT_TIMEOUT_RANGE_MS, HeartbeatAction, JobError, MachineProfile, MachineSpec,
    PERIOD_DEFAULT_US, PERIOD_RANGE_US,
};

use crate::section::Section;
use crate::{homing, spindle, steps};

/// Largest clearance and plunge, mm.
pub const HEIGHT_MAX_MM: f64 = 1000.0;

/// Ranges of the limits that the core takes: mm/s, mm/s^2, mm/s^3.
const LIMIT_RANGES: [[f64; 2]; 3] = [[1e-3, 1e5], [1e-2, 1e7], [1e-1, 1e9]];
/// Expected value of a key with three limits, for messages.
const LIMITS: &str = "three numbers above 0, one each for x, y and z, e.g. [100, 100, 50]";

/// Keys of a job and of a machine's profile alike.
const COMMON: [&str; 7] = [
    "velocity_max_mm_s",
    "acceleration_max_mm_s2",
    "jerk_max_mm_s3",
    "travel_mm",
    "homing_required",
    "host_gone",
    "host_gone_ms",
];
/// Keys of a machine's profile alone.
const OF_PROFILES: [&str; 2] = ["step_inverted", "enable_inverted"];
/// Keys of a job alone.
const OF_JOBS: [&str; 5] = ["period_us", "home_mm", "safe_z_mm", "clearance_mm", "plunge_mm"];

/// A machine's profile: the sections `[machine]`, `[home]`, `[probe]`, `[door]` and `[spindle]` of its file.
pub(super) fn read_profile(document: &Section<'_>) -> Result<MachineProfile, JobError> {
    let machine = &document.section("machine")?;
    let of_jobs = OF_JOBS.map(|key| (key, "it is a job's"));
    machine.only(&[&COMMON[..], &OF_PROFILES, &steps::KEYS].concat(), &of_jobs)?;
    let [step, enable] = OF_PROFILES;
    let mut read = MachineSpec::default();
    read_supervision(machine, &mut read)?;
    let limits = read_limits(machine)?.unwrap_or(AxisLimits::DEFAULT);
    let travel_mm = read_travel(machine)?;
    let homing = document
        .optional_section("home")?
        .map(|home| homing::read(&home, &limits, travel_mm))
        .transpose()?;
    let probe = document.optional_section("probe")?;
    let spindle = document.optional_section("spindle")?;
    let door = document.optional_section("door")?;
    Ok(MachineProfile {
        limits,
        travel_mm,
        step_inverted: steps::read_inverted(machine, step)?,
        enable_inverted: steps::read_inverted(machine, enable)?,
        homing,
        spindle: spindle.map(|spindle| spindle::read_drive(&spindle)).transpose()?,
        probe_closes: probe.map_or(Ok(false), |probe| homing::read_probe(&probe))?,
        door: door.map(|door| homing::read_door(&door)).transpose()?,
        homing_required: read.homing_required,
        heartbeat_action: read.heartbeat_action,
        heartbeat_timeout_ms: read.heartbeat_timeout_ms,
        step_output: steps::read(machine, PERIOD_DEFAULT_US)?.ok_or_else(|| {
            machine.error(
                steps::KEYS[0],
                "`steps_per_mm` is missing",
                "add steps_per_mm = [x, y, z], the motor steps for each millimetre",
            )
        })?,
    })
}

/// The limits of the axes, if any of them is given.
fn read_limits(machine: &Section<'_>) -> Result<Option<AxisLimits>, JobError> {
    let mut given = [None; 3];
    for ((key, [least, most]), given) in COMMON.iter().zip(LIMIT_RANGES).zip(&mut given) {
        *given = machine.positive_axes(key, LIMITS)?;
        let outside = given
            .iter()
            .flatten()
            .find(|value| !(least..=most).contains(value));
        if let Some(value) = outside {
            let what = format!("`{key}` must be {least} to {most}, not {value}");
            return Err(machine.error(key, what, format!("give {LIMITS}")));
        }
    }
    let [velocity, acceleration, jerk] = given;
    Ok(AxisLimits::of_given(velocity, acceleration, jerk))
}

/// The optional section `[machine]` of a job, on a machine with this profile.
pub(super) fn read_on(
    machine: Option<&Section<'_>>,
    profile: Option<&MachineProfile>,
) -> Result<MachineSpec, JobError> {
    let Some(machine) = machine else {
        return Ok(profile.map_or_else(MachineSpec::default, MachineProfile::spec));
    };
    let mut spec = read(machine)?;
    if let Some(profile) = profile {
        within(machine, &mut spec, profile)?;
    }
    Ok(spec)
}

/// Completes a job's machine by the profile, and refuses what exceeds it.
fn within(machine: &Section<'_>, spec: &mut MachineSpec, profile: &MachineProfile) -> Result<(), JobError> {
    const REMEDY: &str = "lower it, or remove it: the machine's profile then holds";
    let most = profile.limits.by_order();
    let mut limits = most;
    for ((key, limit), most) in COMMON.iter().zip(&mut limits).zip(most) {
        let Some(given) = machine.positive_axes(key, LIMITS)? else {
            continue;
        };
        for ((axis, given), most) in AXES.iter().zip(given).zip(most) {
            if given > most {
                let what = format!("`{key}` exceeds the machine's profile: {given} on {axis}, {most} there");
                return Err(machine.error(key, what, REMEDY));
            }
        }
        *limit = given;
    }
    let [velocity_mm_s, acceleration_mm_s2, jerk_mm_s3] = limits;
    spec.limits = Some(AxisLimits {
        velocity_mm_s,
        acceleration_mm_s2,
        jerk_mm_s3,
    });
    let ranges = spec.travel_mm.zip(profile.travel_mm);
    for (axis, ([from, to], [least, most])) in ranges
        .map(|(job, machine)| AXES.into_iter().zip(job.into_iter().zip(machine)))
        .into_iter()
        .flatten()
    {
        if from < least || to > most {
            let what = format!(
                "`travel_mm` exceeds the machine's profile: {from} to {to} on {axis}, {least} to {most} there"
            );
            return Err(machine.error("travel_mm", what, REMEDY));
        }
    }
    spec.travel_mm = spec.travel_mm.or(profile.travel_mm);
    if spec
        .step_output
        .is_some_and(|output| output != profile.step_output)
    {
        let what = "the steps of the axes are the machine's, and its profile has others";
        let remedy = "remove steps_per_mm, pulse_us, direction_setup_us and direction_inverted from the job";
        return Err(machine.error(steps::KEYS[0], what, remedy));
    }
    spec.step_output = Some(profile.step_output);
    if !machine.has("homing_required") {
        spec.homing_required = profile.homing_required;
    } else if profile.homing_required && !spec.homing_required {
        let what = "the machine has to be homed, as its profile says";
        return Err(machine.error("homing_required", what, "remove it"));
    }
    if !machine.has("host_gone") {
        spec.heartbeat_action = profile.heartbeat_action;
    }
    if !machine.has("host_gone_ms") {
        spec.heartbeat_timeout_ms = profile.heartbeat_timeout_ms;
    }
    Ok(())
}

/// The section `[machine]` of a job, without a profile.
fn read(machine: &Section<'_>) -> Result<MachineSpec, JobError> {
    let of_profiles = OF_PROFILES.map(|key| (key, "it is the machine profile's (docs/operating.md)"));
    machine.only(&[&COMMON[..], &OF_JOBS, &steps::KEYS].concat(), &of_profiles)?;
    let mut read = MachineSpec::default();
    if machine.has("period_us") {
        let [least, most] = PERIOD_RANGE_US;
        read.period_us = machine.number("period_us")?;
        if !(least..=most).contains(&read.period_us) {
            let what = format!("`period_us` must be {least} to {most}, not {}", read.period_us);
            return Err(machine.error(
                "period_us",
                what,
                "give the sampling period in microseconds, e.g. 1000",
            ));
        }
    }
    read.limits = read_limits(machine)?;
    read.step_output = steps::read(machine, read.period_us)?;
    read.travel_mm = read_travel(machine)?;
    if machine.has("home_mm") {
        read.home_mm = Some(machine.positions("home_mm")?);
    }
    if machine.has("safe_z_mm") {
        let safe_z_mm = machine.number("safe_z_mm")?;
        machine.check_positions("safe_z_mm", &[safe_z_mm])?;
        read.safe_z_mm = Some(safe_z_mm);
    }
    for (key, value) in [
        ("clearance_mm", &mut read.clearance_mm),
        ("plunge_mm", &mut read.plunge_mm),
    ] {
        if machine.has(key) {
            *value = machine.number_within(key, 0.0, HEIGHT_MAX_MM, "a height in mm, e.g. 2")?;
        }
    }
    read_supervision(machine, &mut read)?;
    Ok(read)
}

/// The travel of the axes, if it is given.
fn read_travel(machine: &Section<'_>) -> Result<Option<[[f64; 2]; 3]>, JobError> {
    if !machine.has("travel_mm") {
        return Ok(None);
    }
    let travel: [[f64; 2]; 3] = machine.matrix("travel_mm")?;
    machine.check_positions("travel_mm", travel.as_flattened())?;
    for (range, axis) in travel.iter().zip(AXES) {
        if range[0] >= range[1] {
            let what = format!(
                "the travel of {axis} must ascend, not run from {} to {}",
                range[0], range[1]
            );
            return Err(machine.error("travel_mm", what, "give [least, most] for each axis, in mm"));
        }
    }
    Ok(Some(travel))
}

/// The keys for homing and for the heartbeat timeout.
fn read_supervision(machine: &Section<'_>, read: &mut MachineSpec) -> Result<(), JobError> {
    if machine.has("homing_required") {
        read.homing_required = machine.switch("homing_required")?;
    }
    if machine.has("host_gone") {
        let choices = [
            ("finish", HeartbeatAction::Finish),
            ("hold", HeartbeatAction::Hold),
        ];
        read.heartbeat_action = machine.choice("host_gone", &choices)?;
    }
    if machine.has("host_gone_ms") {
        let [least, most] = HEARTBEAT_TIMEOUT_RANGE_MS;
        read.heartbeat_timeout_ms = machine.number("host_gone_ms")?;
        if !(least..=most).contains(&read.heartbeat_timeout_ms) {
            let what = format!(
                "`host_gone_ms` must be {least} to {most}, not {}",
                read.heartbeat_timeout_ms
            );
            let remedy = "give the heartbeat timeout in milliseconds, e.g. 1000";
            return Err(machine.error("host_gone_ms", what, remedy));
        }
    }
    Ok(())
}
