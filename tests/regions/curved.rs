//! Passes of constant scallop height within regions.

use inspect::BOUNDS;
use job::{Job, Region, Spacing, Start};
use machine::Machine;
use machine::prepare::prepare;
use verify::swept::{ERROR_SHARE_MAX, Requirements, height_field, measure};

use super::{load, random_job, seeds};
use crate::swept::{Followed, follow};

/// Every sample by the oracle, whose clipping is its own; the crests between neighbouring passes, and the height at places all over the region that are served by passes:
/// no part of it is left out.
#[test]
fn random_regions() {
    let (mut passes, mut prepared_jobs, mut parted) = (0, 0, 0);
    let seeds = seeds(12);
    let count = seeds.end - seeds.start;
    for seed in seeds {
        let job = random_job(seed, true);
        let about = format!(
            "seed {seed}: {:?} {:?} {:?} {:?}, {} loops",
            job.machine.has_limits(),
            job.along,
            job.pattern,
            job.spacing,
            job.region.as_ref().unwrap().loops.len()
        );
        let job = match machine::direction::choose(job) {
            Ok((job, _)) => job,
            Err(error) => {
                let is_known = ["holds no pass", "is a single point"]
                    .iter()
                    .any(|reason| error.to_string().replace("\n  │", "").contains(reason));
                assert!(is_known, "{about}: {error}");
                continue;
            }
        };
        prepared_jobs += 1;
        parted += usize::from(job.region.as_ref().is_some_and(|region| !region.cells.is_empty()));
        let followed = follow(&job);
        let failures = followed.findings.report.failures(&BOUNDS);
        assert!(failures.is_empty(), "{about}: {failures:?}");
        passes += followed.findings.passes;
        assert_finished(&job, &followed, &about);
    }
    println!("{passes} passes, {prepared_jobs} jobs, {parted} of them in cells");
    assert!(
        count < 20 || passes > 300 && prepared_jobs > 12 && parted > 1,
        "{passes} {prepared_jobs} {parted}"
    );
}

/// The crests between neighbouring passes, and the height at all places that are served by passes.
fn assert_finished(job: &Job, followed: &Followed, about: &str) {
    let requirements = Requirements::default();
    let swept = measure(job, &followed.oracle, &followed.track, true, &requirements, &());
    let is_small = |failure: &&String| !failure.contains("fewer than two whole passes");
    let failures: Vec<_> = swept.failures.iter().filter(is_small).collect();
    assert!(failures.is_empty(), "{about}: {failures:?}");
    let (field, _) = height_field(&followed.oracle, &followed.track, &());
    let most = (1.0 + ERROR_SHARE_MAX) * job.scallop_mm;
    assert!(field.highest.height_mm <= most, "{about}: {:?}", field.highest);
}

/// Regions in cells, two of which touched where neither had its first or its last line: 2 to 196 % above the scallop limit.
#[test]
fn where_cells_touch_a_pass_lies() {
    for (seed, start) in [
        (107, Start::Edge),
        (58, Start::Middle),
        (264, Start::Middle),
        (287, Start::Middle),
    ] {
        let mut job = random_job(seed, true);
        job.spacing = Spacing::Constant(start);
        let (job, _) = machine::direction::choose(job).unwrap();
        assert!(job.region.as_ref().is_some_and(|region| region.cells.len() > 2));
        assert_finished(&job, &follow(&job), &format!("seed {seed}, {start:?}"));
    }
}

/// A region that is the whole surface has the passes of the whole surface, but for the rounding of the lines.
#[test]
fn the_whole_surface_as_a_region() {
    for (name, start) in [
        ("freeform", Start::Edge),
        ("torus", Start::Edge),
        ("freeform", Start::Middle),
        ("torus", Start::Middle),
    ] {
        let mut job = load(name);
        (job.spacing, job.scallop_mm) = (Spacing::Constant(start), 0.05);
        job.machine.limits = None;
        let without = follow(&job);
        let [[u0, u1], [v0, v1]] = job.surface.domain();
        job.region = Some(Region::new(vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]]));
        let with = follow(&job);
        assert_eq!(with.findings.passes, without.findings.passes, "{name}");
        let lengths = [&with, &without].map(|followed| followed.findings.report.cc_length_mm);
        assert!(
            (lengths[0] / lengths[1] - 1.0).abs() < 1e-4,
            "{name}: {lengths:?}"
        );
    }
}

/// The ball does not fit the surface beyond the region: fronts are made all the same.
#[test]
fn a_surface_that_does_not_fit_beyond_the_region() {
    let mut job = channel();
    let whole = prepare(&job).unwrap();
    let ran = Machine::load(&whole).and_then(|mut machine| machine.run(|_| true));
    assert!(ran.is_err());
    job.region = Some(Region::new(vec![vec![
        [0.0, 0.1],
        [0.45, 0.1],
        [0.5, 0.5],
        [0.45, 0.9],
        [0.0, 0.9],
    ]]));
    let followed = follow(&job);
    let failures = followed.findings.report.failures(&BOUNDS);
    assert!(failures.is_empty(), "{failures:?}");
    let requirements = Requirements::default();
    let swept = measure(&job, &followed.oracle, &followed.track, true, &requirements, &());
    let most = (1.0 + ERROR_SHARE_MAX) * job.scallop_mm;
    assert!(
        swept.scallop_max.height_mm <= most && swept.gouge.is_none(),
        "{:?} {:?}",
        swept.scallop_max,
        swept.gouge
    );
    assert!(followed.findings.passes > 10);
}

/// A channel whose section is an arc of 120 degrees, of 12 mm radius at u = 0 and of 4 mm at u = 1, and a ball of 6 mm.
fn channel() -> Job {
    let row = |x: f64, radius: f64| {
        let (y, z) = (radius * 0.75_f64.sqrt(), 0.5 * radius);
        // The middle pole lies on the tangents of both ends.
        vec![[x, -y, -z, 1.0], [x, 0.0, -2.0 * radius, 0.5], [x, y, -z, 1.0]]
    };
    let mut job = load("torus");
    job.surface = job::SurfaceSpec::Nurbs(job::NurbsSpec {
        degree: [1, 2],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        poles_mm: vec![row(0.0, 12.0), row(60.0, 4.0)],
        rational: true,
    });
    job.machine.limits = None;
    (job.radius_mm, job.scallop_mm, job.feed_mm_min) = (6.0, 0.05, 600.0);
    (job.spacing, job.along) = (Spacing::Constant(Start::Edge), job::Along::U);
    job
}
