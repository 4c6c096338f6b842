//! What a job says of the machine's axes, as the core takes it.

use interp_core::AxisLimits;

use crate::job_file::{JobFile, JobFileError, Machine};
use crate::oracle::Oracle;
use crate::placement::extent_mm;

/// Limits of a machine that names some of them, x, y and z: a small stiff mill with steppers.
const VELOCITY_DEFAULT_MM_S: [f64; 3] = [100.0, 100.0, 50.0];
const ACCELERATION_DEFAULT_MM_S2: [f64; 3] = [1000.0, 1000.0, 500.0];
const JERK_DEFAULT_MM_S3: [f64; 3] = [20_000.0, 20_000.0, 10_000.0];

/// How far the safe height is above the highest place of the tool's centre, mm, where the job does not say.
const CLEARANCE_DEFAULT_MM: f64 = 5.0;
/// The last part of the way down that is gone at the feed, mm.
const PLUNGE_DEFAULT_MM: f64 = 2.0;

const NM_PER_MM: f64 = 1e6;

/// Whether a job names a limit, so that it runs from standstill to standstill.
#[must_use]
pub const fn has_limits(machine: &Machine) -> bool {
    machine.velocity_max_mm_s.is_some()
        || machine.acceleration_max_mm_s2.is_some()
        || machine.jerk_max_mm_s3.is_some()
}

/// What the axes can do, of a job that names a limit.
///
/// # Errors
/// A place outside the travel, with the key that names it.
pub(super) fn axes(job: &JobFile, oracle: &Oracle) -> Result<Option<AxisLimits>, JobFileError> {
    let machine = &job.machine;
    if !has_limits(machine) {
        return Ok(None);
    }
    let [_, _, [_, top]] = extent_mm(&job.surface);
    let safe_z_mm = machine
        .safe_z_mm
        .unwrap_or(top + job.radius_mm + machine.clearance_mm.unwrap_or(CLEARANCE_DEFAULT_MM));
    let home_mm = match machine.home_mm {
        Some(home_mm) => home_mm,
        // Above the start, where there is one.
        None => {
            let [path, _] = oracle.path_range();
            let [side, _] = oracle.side_range();
            let (u, v) = oracle.swapped(path, side);
            let [x, y, _] = oracle.contact(u, v).map_or([0.0; 3], |contact| contact.cl_mm);
            [x, y, safe_z_mm]
        }
    };
    let travel_nm = match machine.travel_mm {
        Some(travel_mm) => travel_mm.map(|range| range.map(nanometres)),
        None => [[i32::MIN, i32::MAX]; 3],
    };
    let (home_nm, safe_z_nm) = (home_mm.map(nanometres), nanometres(safe_z_mm));
    let [_, _, z] = travel_nm;
    if !(z[0]..=z[1]).contains(&safe_z_nm) {
        let what = format!("the safe height, z = {safe_z_mm:.3} mm, is outside the travel of z");
        return Err(job.origin.error(
            if machine.safe_z_mm.is_some() {
                "machine.safe_z_mm"
            } else {
                "machine.travel_mm"
            },
            what,
            "move the part down with [placement], or give a lower `safe_z_mm` that is still above all of it",
        ));
    }
    for ((axis, place), [least, most]) in ["x", "y", "z"].iter().zip(home_nm).zip(travel_nm) {
        if !(least..=most).contains(&place) {
            let what = format!("the run's first place is outside the travel of {axis}");
            return Err(job.origin.error(
                if machine.home_mm.is_some() {
                    "machine.home_mm"
                } else {
                    "machine.travel_mm"
                },
                what,
                "give `home_mm` within `travel_mm`, or move the part with [placement]",
            ));
        }
    }
    #[allow(clippy::cast_possible_truncation, reason = "the machine's own precision")]
    let to_f32 = |values: [f64; 3]| values.map(|value| value as f32);
    #[allow(clippy::cast_possible_truncation, reason = "the machine's own precision")]
    Ok(Some(AxisLimits {
        velocity_mm_s: to_f32(machine.velocity_max_mm_s.unwrap_or(VELOCITY_DEFAULT_MM_S)),
        acceleration_mm_s2: to_f32(
            machine
                .acceleration_max_mm_s2
                .unwrap_or(ACCELERATION_DEFAULT_MM_S2),
        ),
        jerk_mm_s3: to_f32(machine.jerk_max_mm_s3.unwrap_or(JERK_DEFAULT_MM_S3)),
        chord_mm: job.chord_mm as f32,
        travel_nm,
        home_nm,
        plunge_mm: machine.plunge_mm.unwrap_or(PLUNGE_DEFAULT_MM) as f32,
        safe_z_nm,
    }))
}

/// The nearest whole nanometre that the machine can express.
#[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
fn nanometres(mm: f64) -> i32 {
    (mm * NM_PER_MM).round() as i32
}
