//! Within axis limits the tool's centre never jumps: not at a boundary that is a point with more than one normal, and not at a knot where the tangent plane
//! jumps.

use interp_core::FaultKind;
use job::{AxisLimits, Job, Pattern, Spacing, Start};
use machine::Machine;
use machine::prepare::prepare;

use crate::scallop_limit::shapes::{Random, Shape, random_job};

/// Greatest use of a velocity: rounding of the differences of positions.
const VELOCITY_MOST: f64 = 1.0005;
const SEEDS: u64 = 140;

/// Greatest use of an axis' velocity by the move of one period.
fn velocity_used(job: &Job, from: [i32; 3], to: [i32; 3]) -> f64 {
    let limits = job.machine.limits.unwrap().velocity_mm_s;
    let used = |axis: usize| {
        let apart_mm = (f64::from(to[axis]) - f64::from(from[axis])).abs() * 1e-6;
        apart_mm / (limits[axis] * job.machine.period_s())
    };
    used(0).max(used(1)).max(used(2))
}

#[test]
fn the_centre_never_jumps() {
    let (mut ended, mut at_creases) = (0, 0);
    for seed in 0..SEEDS {
        let mut random = Random(seed.wrapping_mul(0x1234_5678_9abc_def1));
        let mut job = random_job(Shape::Pole, &mut random);
        job.machine.limits = Some(AxisLimits::DEFAULT);
        (job.scallop_mm, job.feed_mm_min) = (0.05, 3000.0);
        job.pattern = [Pattern::Zig, Pattern::Zigzag][seed as usize % 2];
        job.spacing = match seed / 2 % 3 {
            0 => Spacing::Exact,
            1 => Spacing::Constant(Start::Edge),
            _ => Spacing::Constant(Start::Middle),
        };
        let Ok(prepared) = prepare(&job) else { continue };
        let Ok(mut machine) = Machine::load(&prepared) else {
            continue;
        };
        let (mut last, mut used) = (None, 0.0_f64);
        let outcome = machine.run(|sample| {
            used = used.max(last.map_or(0.0, |last| velocity_used(&job, last, sample.cl_nm)));
            last = Some(sample.cl_nm);
            true
        });
        assert!(used <= VELOCITY_MOST, "{seed}: {used} of the velocity");
        match outcome {
            Ok(_) => ended += 1,
            Err(fault) if fault.kind == FaultKind::DegenerateSurface && fault.value == 0.0 => at_creases += 1,
            Err(_) => {}
        }
    }
    println!("{ended} runs ended, {at_creases} stopped before a crease");
    assert!(
        ended > 40 && at_creases > 3,
        "{ended} ended, {at_creases} stopped"
    );
}
