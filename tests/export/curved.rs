//! Exported passes of constant scallop height.

use approach::export::{Dialect, ExportError, export};
use approach::gcode::FeedMode;
use approach::{Kind, job_passes, side_curves};
use glam::DVec3;
use job::{Job, Pattern, Spacing, Start};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;

use super::{check, job, of_curve, of_linear, only_mean, options};
use crate::scallop_limit::shapes::{Random, SHAPES, Shape, random_job};

/// The sample surfaces with passes of constant scallop height from one start.
fn curved_jobs(start: Start) -> Vec<(String, Job)> {
    let names = [
        ("sphere_cap", 0.02),
        ("freeform", 0.1),
        ("torus", 0.02),
        ("fan", 0.05),
        ("revolved", 0.5),
        ("revolved_v", 0.5),
        ("ruled_printed", 0.5),
        ("ruled_reconstructed", 0.5),
        ("plate", 0.05),
        ("plate_v", 0.05),
    ];
    let curved = |(name, scallop_mm): (&str, f64)| {
        let mut job = job(name, scallop_mm);
        (job.spacing, job.pattern) = (Spacing::Constant(start), Pattern::Zigzag);
        (format!("{name} {start:?}"), job)
    };
    names.map(curved).to_vec()
}

/// Lines and arcs of curved passes, partial ones among them, hold the same tolerances.
#[test]
fn curved_passes_hold_the_tolerances() {
    // Lines of each job from its edge, arcs from its middle, and the other way about for every second job.
    let jobs = curved_jobs(Start::Edge)
        .into_iter()
        .zip(curved_jobs(Start::Middle));
    for (index, ((name, edge), (_, middle))) in jobs.enumerate() {
        println!("{name}");
        let [one, other] = if index % 2 == 0 {
            [&edge, &middle]
        } else {
            [&middle, &edge]
        };
        let line = options(Dialect::Grbl, Kind::Linear, FeedMode::G93);
        check(one, &line, &of_linear(one));
        let arcs = options(Dialect::Linuxcnc, Kind::Curve, FeedMode::G94);
        check(other, &arcs, &of_curve(other));
    }
}

/// Exported curved passes of random difficult surfaces keep the tolerances, where the core machines the surface and it faces up.
#[test]
fn curved_passes_of_random_surfaces_hold_the_tolerances() {
    let mut checked = 0;
    for seed in 0..number("ISOFEED_CASES", 28) {
        let shape = SHAPES[seed as usize % SHAPES.len()];
        let mut job = random_job(shape, &mut Random(seed.wrapping_mul(0x1234_5678_9abc_def1)));
        job.machine.limits = None;
        let start = [Start::Edge, Start::Middle][seed as usize / SHAPES.len() % 2];
        (job.spacing, job.chord_mm) = (Spacing::Constant(start), 0.005);
        let runs = prepare(&job)
            .is_ok_and(|prepared| Machine::load(&prepared).is_ok_and(|mut core| core.run(|_| true).is_ok()));
        let line = options(Dialect::Linuxcnc, Kind::Linear, FeedMode::G94);
        if !runs || matches!(export(&job, &line, &|| ()), Err(ExportError::FacesDown { .. })) {
            continue;
        }
        println!("{checked} checked: {shape:?} {seed} {start:?}");
        check(&job, &line, &only_mean(&job));
        let arcs = options(Dialect::Linuxcnc, Kind::Curve, FeedMode::G94);
        // Where the curvature jumps, the centre's path has a corner: arcs are refused, on straight passes too.
        if shape != Shape::Jumps {
            check(&job, &arcs, &of_curve(&job));
        }
        checked += 1;
    }
    println!("{checked} surfaces");
    assert!(checked >= 8, "{checked} surfaces");
}

fn number(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |cases| cases.parse().unwrap())
}

/// The exported curves are the core's: its samples at the job's own feed, which is higher than that of the curves' points, are on them.
#[test]
fn curves_are_those_of_the_core() {
    /// Rounding of an emitted contact, and of the curve's parameters, nm.
    const OFF_NM: f64 = 10.0;
    for start in [Start::Edge, Start::Middle] {
        for (name, mut job) in curved_jobs(start) {
            (job.machine.limits, job.feed_mm_min) = (None, 4321.0);
            let oracle = Oracle::new(&job).unwrap();
            let curves = side_curves(&job).unwrap();
            let passes = job_passes(&oracle, &curves).unwrap();
            let prepared = prepare(&job).unwrap();
            let mut off_nm = 0.0_f64;
            let mut last = 0;
            Machine::load(&prepared)
                .unwrap()
                .run(|sample| {
                    let Some([u, v]) = inspect::plain(&prepared, sample).parameters else {
                        return true;
                    };
                    let at = passes[sample.pass as usize].at(oracle.swapped(u, v).0).unwrap();
                    let emitted = DVec3::from(sample.cl_nm.map(f64::from));
                    off_nm = off_nm.max(emitted.distance(at.contact.cl_mm * 1e6));
                    last = sample.pass as usize;
                    true
                })
                .unwrap();
            println!("{name}: {off_nm:.1} nm");
            assert!(off_nm <= OFF_NM, "{name}: {off_nm} nm");
            assert_eq!(last + 1, passes.len(), "{name}");
        }
    }
}
