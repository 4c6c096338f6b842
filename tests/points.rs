//! Within axis limits the tool's centre never jumps: not at a boundary that is a point with more than one normal, and not at a knot where the tangent plane
//! jumps.

use integration_tests::sequences::{Core, loaded, period};
use interp_core::{Command, Fault, FaultKind, Inputs, State};
use job::{Along, AxisLimits, Job, NurbsSpec, Pattern, Side, Spacing, Start, SurfaceSpec};
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

fn sample_job(name: &str) -> Job {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    job_file::load(&path).unwrap()
}

/// A pass on a boundary that is a point: the tool stands there for some periods, on which every command ends at once, and a hold can be resumed.
#[test]
fn commands_on_a_pass_that_is_a_point() {
    for (pattern, spacing) in [
        (Pattern::Zig, Spacing::Exact),
        (Pattern::Zigzag, Spacing::Exact),
        (Pattern::Zigzag, Spacing::Constant(Start::Edge)),
    ] {
        let mut job = sample_job("sphere_cap");
        job.machine.limits = Some(AxisLimits::DEFAULT);
        (job.along, job.scallop_mm, job.pattern, job.spacing) = (Along::V, 0.05, pattern, spacing);
        let prepared = prepare(&job).unwrap();
        let mut core = loaded(&prepared.header, &prepared.words);
        let mut sample = period(&mut core, Command::Start);
        while sample.state != State::Running {
            sample = period(&mut core, None);
        }
        let mut periods = 0;
        while sample.state == State::Running && sample.pass == 0 {
            for command in [Command::Hold, Command::Pause, Command::Stop, Command::Abort] {
                let mut core = core.clone();
                let at = format!("{pattern:?} {spacing:?}: {command:?} in period {periods}");
                let rests = runs_until(&mut core, command, &[State::Held, State::Ready], 2000);
                assert!(rests, "{at}: {:?}", core.state());
                if matches!(command, Command::Hold | Command::Pause) {
                    assert!(
                        runs_until(&mut core, Command::Resume, &[State::Finished], 200_000),
                        "{at}"
                    );
                }
            }
            let mut stopped = core.clone();
            stopped.controlled_stop(Fault::new(FaultKind::DeadlineMissed, 1.0));
            assert!(
                runs_until(&mut stopped, None, &[State::Faulted], 2),
                "period {periods}"
            );
            sample = period(&mut core, None);
            periods += 1;
        }
        println!("{pattern:?} {spacing:?}: {periods} periods");
        assert!(periods > 0);
    }
}

/// Whether a core is in one of the states within so many periods of a command.
fn runs_until(core: &mut Core, command: impl Into<Inputs>, states: &[State], most: u32) -> bool {
    let mut sample = period(core, command);
    for _ in 0..most {
        if states.contains(&sample.state) {
            return true;
        }
        sample = period(core, None);
    }
    false
}

/// Where the surface does not face up a stop leaves the tool where it comes to rest, also on its way from one pass to the next: the material is above it.
#[test]
fn a_stop_below_an_overhang_stays() {
    // Passes over a third of a cylinder of 20 mm: from its top to 30 degrees below its side.
    let half = std::f64::consts::FRAC_PI_3;
    let arc = [0.0, half, 2.0 * half].map(|angle| {
        let weight = if angle == half { half.cos() } else { 1.0 };
        [20.0 * angle.sin() / weight, 20.0 * angle.cos() / weight, weight]
    });
    let poles_mm = arc.map(|[x, z, weight]| vec![[x, 0.0, z, weight], [x, 30.0, z, weight]]);
    let mut job = sample_job("sphere_cap");
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [2, 1],
        knots_u: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: poles_mm.to_vec(),
        rational: true,
    });
    job.machine.limits = Some(AxisLimits::DEFAULT);
    (job.side, job.pattern, job.scallop_mm) = (Side::Plus, Pattern::Zigzag, 0.2);
    let prepared = prepare(&job).unwrap();
    let mut core = loaded(&prepared.header, &prepared.words);
    let mut sample = period(&mut core, Command::Start);
    while sample.state != State::Running {
        sample = period(&mut core, None);
        assert!(sample.state != State::Faulted, "{:?}", core.fault());
    }
    while sample.pass == 0 && sample.state == State::Running {
        sample = period(&mut core, None);
    }
    let lowest = sample.cl_nm[2];
    let mut periods = 0;
    while sample.state == State::Linking {
        let mut stopped = core.clone();
        assert!(runs_until(
            &mut stopped,
            Command::Stop,
            &[State::Ready, State::Finished],
            2000
        ));
        let rise_nm = stopped.last().cl_nm[2] - lowest;
        assert!(rise_nm.abs() < 1000, "period {periods}: {rise_nm} nm");
        sample = period(&mut core, None);
        periods += 1;
    }
    assert!(periods > 10, "{periods} periods to the next pass");
}
