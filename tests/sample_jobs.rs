//! Every sample of every sample job against the independent oracle, and the figures that the README states.
#![allow(clippy::unwrap_used, reason = "a test may fail by panic")]

use std::path::PathBuf;

use inspect::BOUNDS;
use job::Job;
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use verify::survey::{Survey, SurveyResult};

/// Jobs with their number of passes: the paper's, the golden table's, and for the others the oracle's dense scan.
const PASSES: [(&str, u32); 11] = [
    ("far_plate", 18),
    ("freeform", 135),
    ("plate", 164),
    ("plate_machine", 53),
    ("plate_v", 146),
    ("revolved", 319),
    ("revolved_v", 110),
    ("ruled_printed", 132),
    ("ruled_reconstructed", 132),
    ("sphere_cap", 85),
    ("torus", 24),
];

fn jobs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../jobs")
}

fn load(name: &str) -> Job {
    job_file::load(&jobs().join(format!("{name}.toml"))).unwrap()
}

fn survey(job: &Job) -> SurveyResult {
    let oracle = Oracle::new(job).unwrap();
    let prepared = prepare(job).unwrap();
    let mut survey = Survey::new(&oracle, None, None);
    Machine::load(&prepared)
        .unwrap()
        .run(|sample| survey.add(&inspect::plain(&prepared, sample)).is_ok())
        .unwrap();
    survey.finish(true).unwrap()
}

#[test]
fn every_job_is_listed() {
    let mut names: Vec<_> = std::fs::read_dir(jobs())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        // Beside the jobs there are a folder of CAD files and what an operator does.
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    assert_eq!(names, PASSES.map(|(name, _)| name));
}

#[test]
fn every_sample_of_every_job() {
    for (name, passes) in PASSES {
        let job = load(name);
        let findings = survey(&job);
        assert_eq!(findings.passes, passes, "{name}");
        let failures = findings.report.failures(&BOUNDS);
        assert!(failures.is_empty(), "{name}: {failures:?}");
        // The aim, beyond the bound.
        let worst = findings.report.position_nm.max;
        assert!(worst <= 5.0, "{name}: CL off by {worst} nm");
        let scanned = Oracle::new(&job).unwrap().schedule().unwrap().len();
        assert_eq!(scanned, passes as usize, "{name}: passes of a dense scan");
    }
}

/// 10 mm/s and 1 mm/s, near the origin and 300 mm from it.
#[test]
fn feed_ripple() {
    for name in ["plate", "far_plate", "freeform", "torus", "ruled_printed"] {
        for feed_mm_min in [600.0, 60.0] {
            let mut job = load(name);
            job.feed_mm_min = feed_mm_min;
            // As many passes as at 1 mm/s take about half a million samples.
            job.scallop_mm = if feed_mm_min < 100.0 { 1.0 } else { 0.1 };
            let findings = survey(&job);
            let ripple = findings.report.ripple_pct.max;
            assert!(
                findings.samples > 10_000 && ripple <= 0.001,
                "{name} at {feed_mm_min} mm/min: ripple {ripple} %"
            );
        }
    }
}
