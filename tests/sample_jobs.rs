//! Every sample job, run once: each sample against the independent oracle, scallop height and gouge of the whole path from the swept ball, and
//! the number of passes.

use std::path::PathBuf;

use inspect::BOUNDS;
use job::Job;
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use verify::survey::Survey;
use verify::swept::{Requirements, measure};

use crate::swept::{check_limit, follow};

fn jobs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../jobs")
}

fn load(name: &str) -> Job {
    job_file::load(&jobs().join(format!("{name}.toml"))).unwrap()
}

fn check(name: &str, passes: u32) {
    let job = load(name);
    let followed = follow(&job);
    let (findings, oracle) = (&followed.findings, &followed.oracle);
    assert_eq!(findings.passes, passes, "{name}");
    let failures = findings.report.failures(&BOUNDS);
    assert!(failures.is_empty(), "{name}: {failures:?}");
    // The aim, tighter than the bound of 10 nm.
    let worst = findings.report.position_nm.max;
    assert!(worst <= 5.0, "{name}: CL off by {worst} nm");
    if !job.spacing.is_constant() {
        let scanned = oracle.schedule().unwrap().len();
        assert_eq!(scanned, passes as usize, "{name}: passes of a dense scan");
    }
    check_limit(
        name,
        &job,
        &measure(&job, oracle, &followed.track, true, &Requirements::default(), &()),
    );
}

/// A test for each job, with its number of passes.
macro_rules! jobs {
    ($($name:ident: $passes:literal,)*) => {
        const NAMES: &[&str] = &[$(stringify!($name)),*];

        $(
            #[test]
            fn $name() {
                check(stringify!($name), $passes);
            }
        )*
    };
}

// Of regions that are not parted into cells. Numbers of passes from the paper, from the golden table, and for the other jobs from the oracle's dense scan, but for curved passes.
jobs! {
    fan: 87,
    fan_region: 101,
    far_plate: 18,
    freeform: 135,
    plate: 164,
    plate_machine: 53,
    plate_v: 146,
    region: 82,
    revolved: 319,
    revolved_v: 110,
    ruled_printed: 132,
    ruled_reconstructed: 132,
    sphere_cap: 85,
    streamed: 142,
    streamed_region: 89,
    torus: 24,
}

#[test]
fn every_job_is_listed() {
    let mut names: Vec<_> = std::fs::read_dir(jobs())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        // The folder also contains CAD files and an operator script.
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .map(|path| path.file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    names.sort();
    assert_eq!(names, NAMES);
}

/// 10 mm/s and 1 mm/s, near the origin and 300 mm from it.
mod feed_ripple {
    use super::{Machine, Oracle, Survey, load, prepare};

    fn check(name: &str) {
        for feed_mm_min in [600.0, 60.0] {
            let mut job = load(name);
            job.feed_mm_min = feed_mm_min;
            // Scallop height limits that result in at most about half a million samples.
            job.scallop_mm = if feed_mm_min < 100.0 { 1.0 } else { 0.1 };
            let oracle = Oracle::new(&job).unwrap();
            let prepared = prepare(&job).unwrap();
            let mut survey = Survey::new(&oracle, None);
            let mut machine = Machine::load(&prepared).unwrap();
            machine
                .run(|sample| {
                    survey
                        .add(&inspect::plain(&prepared, sample), &mut |_, _| ())
                        .is_ok()
                })
                .unwrap();
            let findings = survey.finish(true, &mut |_, _| ()).unwrap();
            let ripple = findings.report.ripple_pct.max;
            assert!(
                findings.samples > 10_000 && ripple <= 0.001,
                "{name} at {feed_mm_min} mm/min: ripple {ripple} %"
            );
        }
    }

    macro_rules! jobs {
        ($($name:ident)*) => {
            $(
                #[test]
                fn $name() {
                    check(stringify!($name));
                }
            )*
        };
    }

    jobs!(plate far_plate freeform torus ruled_printed);
}
