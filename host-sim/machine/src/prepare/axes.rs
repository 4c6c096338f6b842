//! The axis limits of a job, in the core's form.

use glam::DVec3;
use interp_core::AxisLimits;
use job::{Job, JobError};
use patches::placement::extent_mm;

use super::geometry;

const NM_PER_MM: f64 = 1e6;

/// Limits, travel and home of the axes; `None` for a job without limits. `start`: (u, v) at the start of the first pass.
///
/// # Errors
/// A place outside the travel, with the key that names it.
pub(super) fn axes(job: &Job, tool_sign: f64, start: [f64; 2]) -> Result<Option<AxisLimits>, JobError> {
    let machine = &job.machine;
    let Some(limits) = machine.limits else {
        return Ok(None);
    };
    let [_, _, [_, own_top]] = extent_mm(&job.surface);
    let top = machine.part_top_mm.map_or(own_top, |top| top.max(own_top));
    let safe_z_mm = machine
        .safe_z_mm
        .unwrap_or(top + job.radius_mm + machine.clearance_mm);
    let home_mm = match machine.home_mm {
        Some(home_mm) => home_mm,
        // Above the start of the first pass, where the surface has a normal.
        None => {
            let DVec3 { x, y, .. } = geometry::centre_mm(job, tool_sign, start).unwrap_or_default();
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
        let [low, high] = z.map(|nm| f64::from(nm) * 1e-6);
        let what =
            format!("the safe height, z = {safe_z_mm:.3} mm, is outside the travel of z, {low} to {high} mm");
        return Err(job.origin.error(
            if machine.safe_z_mm.is_some() {
                "machine.safe_z_mm"
            } else {
                "machine.travel_mm"
            },
            what,
            "place the part where it lies in the machine: --work N after touch-off, or --origin X,Y,Z, or [placement]; or give a lower `safe_z_mm` above the whole part",
        ));
    }
    for ((axis, place), [least, most]) in ["x", "y", "z"].iter().zip(home_nm).zip(travel_nm) {
        if !(least..=most).contains(&place) {
            let what = format!("the run's first position is outside the travel of {axis}");
            return Err(job.origin.error(
                if machine.home_mm.is_some() {
                    "machine.home_mm"
                } else {
                    "machine.travel_mm"
                },
                what,
                "give `home_mm` within `travel_mm`, or place the part where it lies in the machine: --work N after touch-off, or --origin X,Y,Z, or [placement]",
            ));
        }
    }
    #[allow(clippy::cast_possible_truncation, reason = "the machine's own precision")]
    let to_f32 = |values: [f64; 3]| values.map(|value| value as f32);
    #[allow(clippy::cast_possible_truncation, reason = "the machine's own precision")]
    Ok(Some(AxisLimits {
        velocity_mm_s: to_f32(limits.velocity_mm_s),
        acceleration_mm_s2: to_f32(limits.acceleration_mm_s2),
        jerk_mm_s3: to_f32(limits.jerk_mm_s3),
        chord_mm: job.chord_mm as f32,
        travel_nm,
        home_nm,
        end_nm: None,
        end_height_nm: safe_z_nm,
        plunge_mm: machine.plunge_mm as f32,
        safe_z_nm,
        overrun_mm: job.overrun_mm as f32,
    }))
}

/// The nearest nanometre in the core's range.
#[allow(clippy::cast_possible_truncation, reason = "the cast saturates")]
fn nanometres(mm: f64) -> i32 {
    (mm * NM_PER_MM).round() as i32
}
