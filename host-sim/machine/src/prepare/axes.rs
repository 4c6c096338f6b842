//! The axis limits of a job, in the core's form.

use glam::DVec3;
use interp_core::AxisLimits;
use job::{AXES, Job, JobError, units};
use patches::placement::extent_mm;

use super::geometry;

/// z of the ball's centre on traverses, mm: the job's own, or its clearance above the highest point of the surface and of the whole part.
#[must_use]
pub fn safe_z_mm(job: &Job) -> f64 {
    let machine = &job.machine;
    let [_, _, [_, own_top]] = extent_mm(&job.surface);
    let top = machine.part_top_mm.map_or(own_top, |top| top.max(own_top));
    machine
        .safe_z_mm
        .unwrap_or(top + job.radius_mm + machine.clearance_mm)
}

/// Limits, travel and home of the axes; `None` for a job without limits. `start`: (u, v) at the start of the first pass.
///
/// # Errors
/// A position outside the machine's range or outside the travel, with the key that names it.
pub(super) fn axes(job: &Job, tool_sign: f64, start: [f64; 2]) -> Result<Option<AxisLimits>, JobError> {
    let machine = &job.machine;
    let Some(limits) = machine.limits else {
        return Ok(None);
    };
    let safe_z_mm = safe_z_mm(job);
    let home_mm = match machine.home_mm {
        Some(home_mm) => home_mm,
        // Above the start of the first pass, where the surface has a normal.
        None => {
            let DVec3 { x, y, .. } = geometry::centre_mm(job, tool_sign, start).unwrap_or_default();
            [x, y, safe_z_mm]
        }
    };
    let travel_nm = match machine.travel_mm {
        Some(travel_mm) => {
            let [x, y, z] = travel_mm.map(|range| nanometres(job, "machine.travel_mm", range));
            [x?, y?, z?]
        }
        None => [[i32::MIN, i32::MAX]; 3],
    };
    let safe_key = if machine.safe_z_mm.is_some() {
        "machine.safe_z_mm"
    } else {
        "machine.clearance_mm"
    };
    let [safe_z_nm] = nanometres(job, safe_key, [safe_z_mm])?;
    let home_nm = nanometres(job, "machine.home_mm", home_mm)?;
    let [_, _, z] = travel_nm;
    if !(z[0]..=z[1]).contains(&safe_z_nm) {
        let [low, high] = z.map(units::millimetres);
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
    for ((axis, place), [least, most]) in AXES.iter().zip(home_nm).zip(travel_nm) {
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

/// The nearest nanometres of positions.
///
/// # Errors
/// A position outside the machine's range, at `key`.
fn nanometres<const N: usize>(job: &Job, key: &str, mm: [f64; N]) -> Result<[i32; N], JobError> {
    let mut nm = [0; N];
    for (nm, mm) in nm.iter_mut().zip(mm) {
        *nm = units::nanometres(mm).ok_or_else(|| {
            let what = match key {
                // The clearance is but a part of it.
                "machine.clearance_mm" => "the safe height",
                "machine.safe_z_mm" => "`safe_z_mm`",
                "machine.home_mm" => "`home_mm`",
                _ => "`travel_mm`",
            };
            job.origin.error(
                key,
                format!("{what} reaches {mm:.3} mm; {}", units::POSITION_RANGE),
                "give a length within that range, or place the part nearer to the origin in [placement]",
            )
        })?;
    }
    Ok(nm)
}

#[cfg(test)]
mod tests {
    use job::{AxisLimits, MachineSpec, units};

    use crate::prepare::prepare;

    /// A position that 32 bits of nanometres do not hold is an error at its key, whoever made the job.
    #[test]
    fn positions_outside_the_range_are_errors() {
        let mut job = job_file::parse("job.toml", include_str!("../../../../jobs/torus.toml")).unwrap();
        job.machine.limits = Some(AxisLimits::DEFAULT);
        assert!(prepare(&job).is_ok());
        let check = |what: &str, change: &dyn Fn(&mut MachineSpec)| {
            let mut job = job.clone();
            change(&mut job.machine);
            let error = prepare(&job).unwrap_err();
            let expected = format!("{what} mm; {}", units::POSITION_RANGE);
            assert_eq!(error.what(), expected);
        };
        check("`home_mm` reaches 3000.000", &|machine| {
            machine.home_mm = Some([3000.0, 0.0, 10.0]);
        });
        check("`home_mm` reaches NaN", &|machine| {
            machine.home_mm = Some([0.0, f64::NAN, 10.0]);
        });
        check("`safe_z_mm` reaches 2147.484", &|machine| {
            machine.safe_z_mm = Some(2147.484);
        });
        check("the safe height reaches 2155.000", &|machine| {
            (machine.part_top_mm, machine.clearance_mm) = (Some(2155.0 - job.radius_mm - 5.0), 5.0);
        });
        check("`travel_mm` reaches -5000.000", &|machine| {
            machine.travel_mm = Some([[-5000.0, 0.0]; 3]);
        });
    }
}
