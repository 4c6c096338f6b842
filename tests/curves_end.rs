//! Passes of constant scallop height within axis limits: every job ends, also where its passes are short parts of a front beside the last boundary.

use std::path::Path;

use job::{AxisLimits, Job, Pattern, Spacing, Start};
use machine::Machine;
use machine::prepare::prepare;

/// The limits of `jobs/plate_machine.toml`.
const LIMITS: AxisLimits = AxisLimits {
    velocity_mm_s: [100.0, 100.0, 50.0],
    acceleration_mm_s2: [1000.0, 1000.0, 500.0],
    jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
};
/// Greatest time of a pass with the link to the next: a multiple of that of a pass of this length at the feed, mm, and more for rests, link and
/// planning, s.
const PASS_TIMES: f64 = 6.0;
const PASS_MM: f64 = 130.0;
const PASS_MORE_S: f64 = 6.0;

fn curved(name: &str, start: Start, pattern: Pattern, feed_mm_min: f64) -> Job {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let mut job = job_file::load(&path).unwrap();
    job.machine.limits = Some(LIMITS);
    (job.pattern, job.spacing, job.feed_mm_min) = (pattern, Spacing::Constant(start), feed_mm_min);
    job
}

/// Runs the job until its end; a pass that takes far too long ends it with a message. Returns passes and time, s.
fn run(job: &Job, scallop_mm: f64) -> Result<(u32, f64), String> {
    let mut job = job.clone();
    job.scallop_mm = scallop_mm;
    let mut machine = Machine::load(&prepare(&job).map_err(|error| error.to_string())?)
        .map_err(|fault| format!("{fault:?}"))?;
    let period = job.machine.period_s();
    let most = PASS_TIMES * PASS_MM / job.feed_mm_s() + PASS_MORE_S;
    let (mut pass, mut from, mut tick) = (0, 0, 0);
    let mut is_stuck = false;
    machine
        .run(|sample| {
            if sample.pass != pass {
                (pass, from) = (sample.pass, sample.tick);
            }
            tick = sample.tick;
            is_stuck = f64::from(tick - from) * period > most;
            !is_stuck
        })
        .map_err(|fault| format!("{fault:?} at {:?}", machine.place()))?;
    if is_stuck {
        return Err(format!("pass {pass} does not end at {:?}", machine.place()));
    }
    Ok((pass + 1, f64::from(tick) * period))
}

/// The sample surfaces, and a scallop height that keeps the job short, mm; the finer one is that of the job.
const SURFACES: [(&str, f64); 9] = [
    ("sphere_cap", 0.02),
    ("plate", 0.05),
    ("torus", 0.05),
    ("freeform", 0.1),
    ("ruled_printed", 0.05),
    ("ruled_reconstructed", 0.05),
    ("revolved", 0.05),
    ("plate_v", 0.05),
    ("revolved_v", 0.05),
];

fn end(is_fine: bool) {
    let mut failed = String::new();
    for (name, coarse) in SURFACES {
        for start in [Start::Edge, Start::Middle] {
            for pattern in [Pattern::Zig, Pattern::Zigzag] {
                for feed in [1200.0, 3600.0] {
                    let job = curved(name, start, pattern, feed);
                    let scallop = if is_fine { job.scallop_mm } else { coarse };
                    match run(&job, scallop) {
                        Ok((passes, time)) => {
                            println!("{name} {start:?} {pattern:?} {feed}: {passes} passes, {time:.0} s");
                        }
                        Err(error) => failed += &format!("{name} {start:?} {pattern:?} {feed}: {error}\n"),
                    }
                }
            }
        }
    }
    assert!(failed.is_empty(), "{failed}");
}

#[test]
fn curved_jobs_within_limits_end() {
    end(false);
}

#[test]
#[ignore = "most of a minute"]
fn curved_jobs_within_limits_end_at_their_own_scallop_height() {
    end(true);
}

/// What the verifier has against a run.
fn failures(name: &str, start: Start, scallop_mm: f64) -> Vec<String> {
    let mut job = curved(name, start, Pattern::Zigzag, 3600.0);
    job.scallop_mm = scallop_mm;
    let prepared = prepare(&job).unwrap();
    let timed = inspect::time_run(&job, &prepared, &()).unwrap();
    let requirements = inspect::Requirements::default();
    let found = inspect::verify_run(&job, &prepared, &timed, None, &requirements, &()).unwrap();
    found.failures
}

/// The last passes of the cap are parts of a front of 0.2 mm, then the whole boundary: every sample and the scallop height are as exact as elsewhere.
/// Without a correction of the progress before the end, the last step was up to 0.25 um too long or too short, and the jerk 1.7 of its limit.
#[test]
fn short_parts_before_the_boundary_are_exact() {
    for start in [Start::Edge, Start::Middle] {
        for scallop_mm in [0.02, 0.05] {
            let failures = failures("sphere_cap", start, scallop_mm);
            assert!(failures.is_empty(), "{start:?}, {scallop_mm} mm: {failures:?}");
        }
    }
}

#[test]
fn small_job_passes_the_verifier() {
    for start in [Start::Edge, Start::Middle] {
        let failures = failures("torus", start, 0.05);
        assert!(failures.is_empty(), "{start:?}: {failures:?}");
    }
}
