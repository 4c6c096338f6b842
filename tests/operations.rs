//! Operations of a sample: the core that counts is the core, and what it counts.

use std::path::PathBuf;

use host_sim::budget::SURFACES;
use host_sim::job_file::JobFile;
use host_sim::operations::{self, Count, Operations};
use host_sim::prepare::{Prepared, prepare};
use interp_core::{Interpolator, Request, State};

fn jobs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../jobs")
}

fn prepared(path: &std::path::Path) -> Prepared {
    prepare(&JobFile::load(path).unwrap()).unwrap()
}

/// The plain core with a job.
fn plain(job: &Prepared) -> Box<Interpolator> {
    let mut core: Box<Interpolator> = Box::default();
    core.load_begin(&job.header, job.words.len() as u32).unwrap();
    core.load_words(0, &job.words).unwrap();
    for record in 0..core.load_records() {
        core.load_check(record).unwrap();
    }
    core.load_finish().unwrap();
    core
}

/// What counts computes the same: every sample of every job, to the last bit.
#[test]
fn counting_changes_no_bit() {
    let paths = std::fs::read_dir(jobs())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"));
    let mut jobs = 0;
    for path in paths {
        let mut job = prepared(&path);
        // What counts runs at the programmed feed.
        job.header.axes = None;
        let mut core = plain(&job);
        let mut request = Request::Start;
        operations::run(&job, |counted, _| {
            let sample = core.tick(request);
            request = Request::None;
            let places = [
                (counted.path.span, counted.path.fraction),
                (counted.side.span, counted.side.fraction),
            ];
            assert_eq!(
                (counted.tick, counted.pass, places, counted.cc_nm, counted.cl_nm),
                (
                    sample.tick,
                    sample.pass,
                    [sample.path, sample.side].map(|place| (place.span, place.fraction)),
                    sample.cc_nm,
                    sample.cl_nm
                ),
                "{}",
                path.display()
            );
            let bits = [sample.density, sample.feed_mm_s].map(f32::to_bits);
            assert_eq!([counted.density, counted.feed_mm_s].map(f32::to_bits), bits);
            true
        })
        .unwrap();
        assert_eq!(
            core.tick(Request::None).state,
            State::Finished,
            "{}",
            path.display()
        );
        jobs += 1;
    }
    assert_eq!(jobs, 11);
}

// Additions and multiplications by hand. First the stages that all kinds have: the step with the sum of the parameter, the fit, the
// location, the check for a fold, the density (of a surface that is known to have no weight).
const STEP: [u32; 2] = [5 + 1, 8];
const FIT: [u32; 2] = [1, 2];
const LOCATE: [u32; 2] = [6, 6];
const FOLD: [u32; 2] = [2, 3];
const DENSITY: [u32; 2] = [0, 1];

const CUBIC: [u32; 2] = [3, 3];
const TANGENT: [u32; 2] = [5, 4];
const JET: [u32; 2] = [6, 4];
const DOT: [u32; 2] = [2, 3];
const CROSS: [u32; 2] = [3, 6];
const INVERSE_ROOT: [u32; 2] = [5, 10];

fn total(parts: &[(u32, [u32; 2])]) -> [u32; 2] {
    let sum = |k: usize| parts.iter().map(|(times, part)| times * part[k]).sum();
    [sum(0), sum(1)]
}

/// A bicubic patch: three jets, tangents and cubics; then the forms.
fn bicubic() -> [u32; 2] {
    total(&[
        (3, JET),
        (3, TANGENT),
        (3, CUBIC),
        // A x B; E, F and its square; least sine.
        (1, CROSS),
        (3, DOT),
        (1, [0, 2]),
        // 1/W, r N, 1/|A|, 1/E, F/E.
        (2, INVERSE_ROOT),
        (1, [0, 1 + 3]),
        (1, [0, 1 + 1]),
        // L, M, N, A . A', each with its factor, M with a half besides, A . A' with 1/E.
        (4, DOT),
        (1, [0, 4 + 1 + 1]),
        // Shear, its sum, twist and its square, sheared, lateral^2, along, across.
        (1, [1 + 1 + 1 + 2, 1 + 1 + 1 + 1 + 1 + 1]),
        (1, STEP),
        (1, FIT),
        (1, LOCATE),
        (1, FOLD),
        (1, DENSITY),
    ])
}

/// A pass along the profile: radius and height, and what does not depend on the angle.
fn profile() -> [u32; 2] {
    total(&[
        (2, JET),
        // E; second derivatives; 1/|A|, 1/E; lateral speed and its square.
        (1, [1, 2 + 2]),
        (1, INVERSE_ROOT),
        (1, [0, 1 + 2]),
        // r N in the profile's plane; the circle; r N.
        (1, [0, 3]),
        (1, [0, 2]),
        (1, [0, 2 + 1 + 3]),
        // Stretch, along, across.
        (1, [1 + 2 + 1, 3 + 3 + 2]),
        (1, STEP),
        // There is no twist to take off.
        (1, [0, 2]),
        (1, LOCATE),
        (1, FOLD),
        (1, DENSITY),
    ])
}

/// A pass around the axis: the angle, sine and cosine, the circle, the offset; the weight is stored, as 1.
fn circle() -> [u32; 2] {
    const SIN_COS: [u32; 2] = [2 * 5 + 2, 2 * 5 + 2];
    total(&[
        (1, [1, 1]),
        (1, SIN_COS),
        // Both doubled.
        (1, [2, 0]),
        (1, [0, 2]),
        (1, [0, 1 + 2 + 3]),
        (1, STEP),
        (1, FIT),
        (1, LOCATE),
        (1, FOLD),
        (1, [0, 1]),
        (1, DENSITY),
    ])
}

fn of(sums: [u32; 2], divide: u32, sine: u32, rest: [u32; 3]) -> Count {
    let [add, multiply] = sums;
    let [inverse_root, convert, shift] = rest;
    Count {
        operations: Operations {
            add,
            multiply,
            divide,
            root: 0,
            sine,
        },
        inverse_root,
        convert,
        shift,
    }
}

/// The kinds of surface, and that all samples within a pass take the same.
#[test]
fn counts_of_each_kind() {
    let want = [
        of(profile(), 0, 0, [1, 9, 9]),
        of(circle(), 0, 2, [0, 6, 12]),
        of([58, 90], 0, 0, [2, 12, 8]),
        of(bicubic(), 0, 0, [2, 14, 8]),
        of(bicubic(), 0, 0, [2, 14, 8]),
        of([121, 161], 1, 0, [2, 17, 28]),
    ];
    for ((surface, job), want) in SURFACES.into_iter().zip(want) {
        let path = jobs().join(format!("{job}.toml"));
        let counted = operations::count(&prepared(&path), 200_000).unwrap();
        assert_eq!(counted.sample, want, "{surface}");
        assert_eq!(counted.others, 0, "{surface}");
        assert!(counted.samples > 140_000, "{surface}: {}", counted.samples);
    }
}

/// Each row of the paper's table has ours beside it, without its divisions and roots.
#[test]
fn rows_beside_the_papers() {
    let rows = operations::table_1().unwrap();
    let sums = rows.map(|row| [row.add, row.multiply]);
    assert_eq!(sums, [profile(), circle(), bicubic()]);
    for (ours, (surface, paper)) in rows.into_iter().zip(operations::PAPER) {
        assert_eq!(
            (ours.divide, ours.root, ours.sine),
            (0, 0, paper.sine),
            "{surface}"
        );
        assert_eq!(operations::of_paper(surface), Some(paper));
    }
    assert_eq!(operations::of_paper("ruled"), None);
}
