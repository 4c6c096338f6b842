//! Jobs with a region: passes end at its boundary, none is left out, and the scallop height is within its limit between them.

mod commands;
mod curved;

use std::path::PathBuf;

use inspect::BOUNDS;
use interp_core::job::region::{CROSSINGS_MAX, EDGE_WORDS};
use job::{Along, AxisLimits, Job, MachineSpec, NurbsSpec, Pattern, Region, Side, Spacing, SurfaceSpec};
use machine::links::{self, Link};
use machine::prepare::{Prepared, prepare};
use verify::swept::{Requirements, measure};

use crate::scallop_limit::shapes::Random;
use crate::swept::follow;

fn load(name: &str) -> Job {
    let jobs = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../jobs");
    job_file::load(&jobs.join(format!("{name}.toml"))).unwrap()
}

/// A star-shaped loop around a place, as shares of the domain.
fn star(random: &mut Random, [u, v]: [f64; 2], reach: f64) -> Vec<[f64; 2]> {
    let corners = random.one_of(&[3, 4, 5, 8, 40]);
    (0..corners)
        .map(|k| {
            let (sin, cos) = (f64::from(k) / f64::from(corners) * std::f64::consts::TAU).sin_cos();
            let radius = reach * random.within(0.4, 1.0);
            [u + radius * cos, v + radius * sin]
        })
        .collect()
}

/// A random region: one or two loops, with holes, some cut off at the surface's boundaries or with corners on lines.
fn region(random: &mut Random, domain: [[f64; 2]; 2]) -> Region {
    let mut loops = Vec::new();
    let parts = random.one_of(&[1, 1, 2]);
    for part in 0..parts {
        let centre = if parts == 1 {
            [random.within(0.3, 0.7), random.within(0.3, 0.7)]
        } else {
            [0.25 + 0.5 * f64::from(part), random.within(0.25, 0.75)]
        };
        let reach = if parts == 1 { random.within(0.3, 0.9) } else { 0.22 };
        loops.push(star(random, centre, reach));
        if random.one_of(&[true, false]) {
            loops.push(star(random, centre, 0.3 * reach));
        }
    }
    let grid = random.one_of(&[0.0, 0.0, 8.0]);
    let placed = |share: f64, [low, high]: [f64; 2]| {
        let share = if grid > 0.0 {
            (share * grid).round() / grid
        } else {
            share
        };
        low + share.clamp(0.0, 1.0) * (high - low)
    };
    let [us, vs] = domain;
    for point in loops.iter_mut().flatten() {
        *point = [placed(point[0], us), placed(point[1], vs)];
    }
    Region::new(loops)
}

/// A random region on the surface of a sample job, with straight passes; or with passes of constant scallop height.
fn random_job(seed: u64, is_curved: bool) -> Job {
    let mut random = Random(seed);
    let (name, scallop_mm) = random.one_of(&[
        ("plate", 0.1),
        ("freeform", 0.05),
        ("torus", 0.05),
        ("revolved", 0.3),
        ("sphere_cap", 0.05),
        ("ruled_reconstructed", 0.05),
    ]);
    let mut job = load(name);
    job.scallop_mm = scallop_mm;
    job.feed_mm_min = 6000.0;
    job.machine = MachineSpec::default();
    if random.one_of(&[true, false]) {
        job.machine.limits = Some(AxisLimits::DEFAULT);
        job.side = Side::Up;
    }
    job.along = random.one_of(&[Along::U, Along::V]);
    job.pattern = random.one_of(&[Pattern::Zig, Pattern::Zigzag]);
    job.spacing = random.one_of(&[Spacing::Exact, Spacing::Exact, Spacing::FirstOrder]);
    if is_curved {
        let start = [job::Start::Edge, job::Start::Middle][usize::from(seed % 2 == 1)];
        (job.spacing, job.feed_mm_min) = (Spacing::Constant(start), 1800.0);
    }
    job.region = Some(region(&mut random, job.surface.domain()));
    job
}

/// `REGIONS` of them, from `REGIONS_FROM` on.
fn seeds(usual: u64) -> std::ops::Range<u64> {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).ok();
        given.and_then(|count| count.parse().ok()).unwrap_or(usual)
    };
    let first = number("REGIONS_FROM", 0);
    first..first + number("REGIONS", usual)
}

/// Random regions on the surfaces of the sample jobs: every sample is checked by the oracle, whose clipping is its own.
#[test]
fn random_regions() {
    let seeds = seeds(12);
    let count = seeds.end - seeds.start;
    let (mut passes, mut prepared_jobs, mut parted) = (0, 0, 0);
    for seed in seeds {
        let job = random_job(seed, false);
        let about = format!(
            "seed {seed}: {:?} {:?} {:?} {:?}, {} loops",
            job.machine.has_limits(),
            job.along,
            job.pattern,
            job.spacing,
            job.region.as_ref().unwrap().loops.len()
        );
        // With the region's cells, where there are links.
        let job = match machine::direction::choose(job) {
            Ok((job, _)) => job,
            Err(error) => {
                assert!(error.to_string().contains("holds no pass"), "{about}: {error}");
                continue;
            }
        };
        prepared_jobs += 1;
        parted += usize::from(job.region.as_ref().is_some_and(|region| !region.cells.is_empty()));
        let followed = follow(&job);
        let report = &followed.findings.report;
        let failures = report.failures(&BOUNDS);
        assert!(failures.is_empty(), "{about}: {failures:?}");
        passes += followed.findings.passes;
        let scanned = followed.oracle.schedule().unwrap().len();
        let apart = scanned.abs_diff(followed.findings.passes as usize);
        // One line more has as many passes as intervals.
        let of_a_line = job.region.as_ref().map_or(0, |region| region.loops.len());
        assert!(
            apart <= of_a_line.max(2) + scanned / 30,
            "{about}: {} passes, {scanned} by the scan",
            followed.findings.passes
        );
        if job.spacing == Spacing::Exact {
            let requirements = Requirements::default();
            let swept = measure(&job, &followed.oracle, &followed.track, true, &requirements, &());
            // A small region has no two passes beside each other, away from its boundary.
            let is_small = |failure: &String| failure.contains("fewer than two whole passes");
            let failures: Vec<_> = swept
                .failures
                .iter()
                .filter(|failure| !is_small(failure))
                .collect();
            assert!(failures.is_empty(), "{about}: {failures:?}");
        }
    }
    assert!(
        count < 20 || passes > 400 && prepared_jobs > 15 && parted > 1,
        "{passes} {prepared_jobs} {parted}"
    );
}

/// A region that is the whole surface has the passes of the whole surface, but for the rounding of the lines.
#[test]
fn the_whole_surface_as_a_region() {
    for name in ["plate", "torus"] {
        let mut job = load(name);
        job.machine.limits = None;
        job.scallop_mm = 0.1;
        let without = follow(&job);
        let [[u0, u1], [v0, v1]] = job.surface.domain();
        job.region = Some(Region::new(vec![vec![[u0, v0], [u1, v0], [u1, v1], [u0, v1]]]));
        let with = follow(&job);
        assert_eq!(with.findings.passes, without.findings.passes, "{name}");
        for (one, other) in with.track.passes.iter().zip(&without.track.passes) {
            assert!(
                (one.side - other.side).abs() < 1e-4 * (v1 - v0).max(u1 - u0),
                "{name}"
            );
            assert_eq!(one.path.first(), other.path.first());
            assert_eq!(one.path.last(), other.path.last());
        }
        assert_eq!(
            with.track.passes.last().unwrap().side,
            without.track.passes.last().unwrap().side
        );
    }
}

/// What is refused, with the place and the reason.
#[test]
fn regions_that_the_machine_does_not_take() {
    let mut job = load("plate");
    let refused = |job: &Job| {
        let error = prepare(job).unwrap_err();
        assert!(!error.remedy().is_empty());
        error.what().to_owned()
    };
    let tooth = |at: f64| vec![[at, 0.1], [at + 0.01, 0.1], [at + 0.01, 0.9], [at, 0.9]];
    let comb = |teeth: usize| Region::new((0..teeth).map(|k| tooth(k as f64 / 40.0)).collect());
    job.region = Some(comb(CROSSINGS_MAX / 2));
    let prepared = prepare(&job).unwrap();
    assert_eq!(usize::from(prepared.header.edges), 1 + CROSSINGS_MAX);
    assert!(prepared.words.len() > EDGE_WORDS * CROSSINGS_MAX);
    job.region = Some(comb(CROSSINGS_MAX / 2 + 1));
    let most = CROSSINGS_MAX;
    let what = format!(
        "a pass at v = 0.100000 meets {} edges of the region, more than {most}",
        most + 2
    );
    assert_eq!(refused(&job), what);
    // Across the teeth there is no line with that many.
    job.along = Along::V;
    prepare(&job).unwrap();
    job.region = Some(Region::new(vec![vec![
        [0.1, 0.1],
        [0.1001, 0.1],
        [0.1001, 0.1001],
    ]]));
    assert!(refused(&job).starts_with("the region holds no pass"));
    job.region = Some(Region::new(vec![
        (0..4090)
            .map(|k| f64::from(k) / 4090.0 * std::f64::consts::TAU)
            .map(|at| [0.5 + 0.4 * at.cos(), 0.5 + 0.4 * at.sin()])
            .collect(),
    ]));
    assert!(
        refused(&job).starts_with("the surface and its region take 164"),
        "{}",
        refused(&job)
    );
}

/// A first pass that ends at a slant edge of its region where its interval is narrowest: the lines beside it are placed anew until its end, and seen along all of
/// it by a second look. On a plane, 1 mm wide at one end and 18 mm at the other, wider from line to line.
#[test]
fn a_first_pass_that_is_narrowest_at_the_edge_of_its_region() {
    let row = |x: f64, width: f64| [0.0, 0.5, 1.3].map(|y| [x, width * y, 0.0, 1.0]).to_vec();
    let mut job = load("plate_machine");
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 2],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        poles_mm: vec![row(5.0, 1.0), row(60.0, 14.0)],
        rational: false,
    });
    (job.along, job.radius_mm, job.machine.travel_mm) = (Along::U, 3.0, None);
    job.machine.limits = Some(AxisLimits::DEFAULT);
    for step in 0..8 {
        let end = 0.6 + 0.04 * f64::from(step);
        job.region = Some(Region::new(vec![vec![
            [0.0, 0.0],
            [end, 0.0],
            [1.0, 0.2],
            [1.0, 0.4],
            [0.0, 0.4],
        ]]));
        let followed = follow(&job);
        let requirements = Requirements::default();
        let swept = measure(&job, &followed.oracle, &followed.track, true, &requirements, &());
        assert_eq!(swept.failures, Vec::<String>::new(), "{end}");
    }
}

/// The first pass of a part of the region that no step leads to: the last step of the part before it says nothing of the step from it. On a plane whose lines are farthest apart
/// halfway across, with a part at its edge and another one farther on: in a cell of its own, or in one whose lines meet both.
#[test]
fn a_part_of_a_region_begins_with_a_step_of_its_own() {
    let row = |x: f64| vec![[x, 0.0, 0.0, 1.0], [x, 4.0, 0.0, 0.4], [x, 8.0, 0.0, 1.0]];
    let mut job = load("plate_machine");
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 2],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        poles_mm: vec![row(5.0), row(60.0)],
        rational: true,
    });
    (job.along, job.radius_mm, job.machine.travel_mm) = (Along::U, 3.0, None);
    let part = |[left, right]: [f64; 2], [low, high]: [f64; 2]| {
        vec![[left, low], [right, low], [right, high], [left, high]]
    };
    for limits in [None, Some(AxisLimits::DEFAULT)] {
        for second in [[0.0, 0.3], [0.6, 0.9]] {
            for start in [0.3, 0.5, 0.6] {
                job.machine.limits = limits;
                job.region = Some(Region::new(vec![
                    part([0.0, 0.3], [0.0, 0.1]),
                    part(second, [start, 1.0]),
                ]));
                let followed = follow(&job);
                let requirements = Requirements::default();
                let swept = measure(&job, &followed.oracle, &followed.track, true, &requirements, &());
                let about = format!("{}, {second:?}, {start}", limits.is_some());
                assert_eq!(swept.failures, Vec::<String>::new(), "{about}");
            }
        }
    }
}

/// At the same parameter a pass may be ahead of its neighbour by more than a step-over, and half a step-over from the region's end is farther along it than it is wide.
#[test]
fn skew_passes_are_beside_each_other_where_both_are() {
    for degrees in [25.0_f64, 60.0, 155.0] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let pole = |along: f64, across: f64| [along + across * cos, across * sin, 0.0, 1.0];
        let mut job = load("plate_machine");
        job.surface = SurfaceSpec::Nurbs(NurbsSpec {
            degree: [1, 1],
            knots_u: vec![0.0, 0.0, 1.0, 1.0],
            knots_v: vec![0.0, 0.0, 1.0, 1.0],
            poles_mm: [30.0, 60.0]
                .map(|along| [5.0, 15.0].map(|across| pole(along, across)).to_vec())
                .to_vec(),
            rational: false,
        });
        (job.along, job.radius_mm, job.machine.travel_mm) = (Along::U, 3.0, None);
        job.machine.limits = Some(AxisLimits::DEFAULT);
        for [low, high] in [[0.6, 0.95], [0.95, 0.6], [0.8, 0.8]] {
            let corners = vec![[0.1, 0.0], [low, 0.0], [high, 1.0], [0.3, 1.0]];
            job.region = Some(Region::new(vec![corners]));
            let followed = follow(&job);
            let requirements = Requirements::default();
            let swept = measure(&job, &followed.oracle, &followed.track, true, &requirements, &());
            assert_eq!(swept.failures, Vec::<String>::new(), "{degrees}, {low}, {high}");
        }
    }
}

/// Lines one after the other are no neighbours where they are in two cells. The part that is left for later is narrower than both.
#[test]
fn a_cell_that_is_left_for_later_is_no_gap() {
    let row = |x: f64| vec![[x, 0.0, 0.0, 1.0], [x, 40.0, 0.0, 1.0]];
    let mut job = load("plate_machine");
    job.surface = SurfaceSpec::Nurbs(NurbsSpec {
        degree: [1, 1],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: vec![row(5.0), row(60.0)],
        rational: false,
    });
    (job.along, job.radius_mm, job.machine.travel_mm) = (Along::U, 3.0, None);
    let part = |left: f64, low: f64, high: f64| vec![[left, low], [0.6, low], [0.6, high], [left, high]];
    let drawn = vec![
        [0.2, 0.1],
        [0.6, 0.1],
        [0.6, 0.9],
        [0.2, 0.9],
        [0.2, 0.7],
        [0.4, 0.7],
        [0.4, 0.3],
        [0.2, 0.3],
    ];
    job.region = Some(Region {
        cells: vec![
            vec![part(0.2, 0.1, 0.3)],
            vec![part(0.2, 0.7, 0.9)],
            vec![part(0.4, 0.3, 0.7)],
        ],
        ..Region::new(vec![drawn])
    });
    let followed = follow(&job);
    let requirements = Requirements::default();
    let swept = measure(&job, &followed.oracle, &followed.track, true, &requirements, &());
    assert_eq!(swept.failures, Vec::<String>::new());
    assert_eq!(swept.ridges.len() + 3, followed.track.passes.len());
}

/// Links with heights of their own leave the passes as they are; each rises to its height, and no farther than a hop of its length gains by; within the limits, in less time.
#[test]
fn a_link_rises_to_its_height() {
    let mut job = load("region");
    (job.scallop_mm, job.machine.limits) = (0.1, Some(AxisLimits::DEFAULT));
    for pattern in [Pattern::Zig, Pattern::Zigzag] {
        job.pattern = pattern;
        let safe = prepare(&job).unwrap();
        let ends = links::between(&links::passes(&safe));
        let heights: Vec<i32> = ends
            .iter()
            .map(|[from, to]| from[2].max(to[2]) + 2_000_000)
            .collect();
        let mut low = safe.clone();
        let words: Vec<Link> = heights.iter().map(|height| Link::Across(*height)).collect();
        links::add(&mut low, &words);
        assert_eq!(usize::from(low.header.links), ends.len());
        assert_eq!(links::between(&links::passes(&low)), ends);
        let highest = highest(&low);
        let mut lowered = 0;
        for (pass, (height, [from, to])) in heights.iter().zip(&ends).enumerate() {
            let [x, y] = [0, 1].map(|k: usize| f64::from(to[k] - from[k]));
            let above = f64::from(highest[&(pass as u32)] - height);
            // Some are joined on the boundary, and do not rise.
            if highest[&(pass as u32)] > from[2].max(to[2]) + 1_000_000 {
                lowered += 1;
                assert!(above >= 0.0, "link {pass}: {above} nm below its height");
                assert!(
                    above <= 0.34 * x.hypot(y).max(1.0) + 1e6,
                    "link {pass}: {above} nm above its height"
                );
            }
        }
        assert!(lowered > 5, "{lowered}");
        // As high as they need to be.
        let mut low = safe.clone();
        part_program::add_links(&job, &mut low).unwrap();
        assert_eq!(usize::from(low.header.links), ends.len());
        let times = [&safe, &low].map(|prepared| {
            let timed = inspect::time_run(&job, prepared, &()).unwrap();
            let found = inspect::verify_run(
                &job,
                prepared,
                &timed,
                None,
                &inspect::Requirements::default(),
                &(),
            );
            let found = found.unwrap();
            assert!(found.failures.is_empty(), "{:?}", found.failures);
            found.measured.times.whole_s
        });
        assert!(times[1] < times[0], "{times:?}");
    }
}

/// Highest place of the ball's centre between a pass and the next, nm, by the number of the pass.
fn highest(prepared: &Prepared) -> std::collections::BTreeMap<u32, i32> {
    let mut highest = std::collections::BTreeMap::new();
    let (mut pass, mut began) = (0, false);
    let mut machine = machine::Machine::load(prepared).unwrap();
    machine
        .run(|sample| {
            if sample.state == interp_core::State::Running {
                (pass, began) = (sample.pass, true);
            } else if began {
                let most = highest.entry(pass).or_insert(i32::MIN);
                *most = (*most).max(sample.cl_nm[2]);
            }
            true
        })
        .unwrap();
    highest
}
