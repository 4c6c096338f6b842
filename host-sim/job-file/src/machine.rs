//! The section `[machine]`: the machine, with every default applied.

use job::{AxisLimits, HEARTBEAT_TIMEOUT_RANGE_MS, HeartbeatAction, JobError, MachineSpec, PERIOD_RANGE_US};

use crate::section::Section;
use crate::steps;

/// Largest clearance and plunge, mm.
const HEIGHT_MAX_MM: f64 = 1000.0;

/// The optional section `[machine]`.
pub(super) fn read(machine: &Section<'_>) -> Result<MachineSpec, JobError> {
    const AXES: &str = "three numbers above 0, one each for x, y and z, e.g. [100, 100, 50]";
    machine.only(
        &[
            "period_us",
            "velocity_max_mm_s",
            "acceleration_max_mm_s2",
            "jerk_max_mm_s3",
            "travel_mm",
            "home_mm",
            "safe_z_mm",
            "clearance_mm",
            "plunge_mm",
            "homing_required",
            "host_gone",
            "host_gone_ms",
            steps::KEYS[0],
            steps::KEYS[1],
            steps::KEYS[2],
            steps::KEYS[3],
        ],
        &[],
    )?;
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
    read.limits = AxisLimits::of_given(
        machine.positive_axes("velocity_max_mm_s", AXES)?,
        machine.positive_axes("acceleration_max_mm_s2", AXES)?,
        machine.positive_axes("jerk_max_mm_s3", AXES)?,
    );
    read.step_output = steps::read(machine, read.period_us)?;
    if machine.has("travel_mm") {
        let travel: [[f64; 2]; 3] = machine.matrix("travel_mm")?;
        for (range, axis) in travel.iter().zip(["x", "y", "z"]) {
            if range[0] >= range[1] {
                let what = format!(
                    "the travel of {axis} must ascend, not run from {} to {}",
                    range[0], range[1]
                );
                return Err(machine.error("travel_mm", what, "give [least, most] for each axis, in mm"));
            }
        }
        read.travel_mm = Some(travel);
    }
    if machine.has("home_mm") {
        read.home_mm = Some(machine.numbers("home_mm")?);
    }
    if machine.has("safe_z_mm") {
        read.safe_z_mm = Some(machine.number("safe_z_mm")?);
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
