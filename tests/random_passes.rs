//! Passes on random surfaces on a machine with limits, against the best motion that the offline solver finds within the same limits.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use interp_core::{SpanParameter, State};
use job::{Along, AxisLimits, Job, NurbsSpec, Pattern, Side, SurfaceSpec};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;

use crate::pass_times::{Ran, compared_if_solved};
use crate::random_surfaces::bumpy_job;
use crate::unusual_motion::used;

/// The limits of `jobs/plate_machine.toml`.
const LIMITS: AxisLimits = AxisLimits {
    velocity_mm_s: [100.0, 100.0, 50.0],
    acceleration_mm_s2: [1000.0, 1000.0, 500.0],
    jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
};
/// Surfaces of each kind.
const SURFACES: usize = 24;
/// Passes that are compared: the first, which is planned at rest, and one that is planned while another runs.
const PASSES: [u32; 2] = [0, 3];
/// Ball radius as a share of the size of a patch.
const RADIUS: f64 = 0.04;
/// Scallop limit as a share of the ball radius.
const SCALLOP: f64 = 0.3;
/// A pass whose optimum is shorter than this waits for its planning (`README.md`, "Not supported"), s.
const PLANNED_S: f64 = 0.25;
/// The quotient that is asked of every pass.
const WANTED: f64 = 1.05;

pub(crate) const KINDS: [&str; 5] = ["bicubic", "C2 knots", "C1 knots", "taper", "pole"];

/// A linear congruential generator: the same surfaces on each machine.
pub(crate) struct Random(u64);

impl Random {
    /// A generator that has forgotten how much its seed is like another.
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Self(0x9e37_79b9_7f4a_7c15 ^ seed.wrapping_mul(0xd134_2543_de82_ef95));
        for _ in 0..4 {
            random.next();
        }
        random
    }

    /// From -1 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        #[allow(clippy::cast_precision_loss, reason = "32 bits")]
        let unit = (self.0 >> 32) as f64 / 2_f64.powi(31) - 1.0;
        unit
    }

    /// Between two values above 0, evenly by their ratio.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(0.5 + 0.5 * self.next())
    }
}

/// Knots of a cubic with breaks at even distances, each of this multiplicity.
fn knots(breaks: usize, multiplicity: usize) -> Vec<f64> {
    #[allow(clippy::cast_precision_loss, reason = "small counts")]
    let inner = (1..=breaks).flat_map(|k| vec![k as f64 / (breaks + 1) as f64; multiplicity]);
    let mut knots = vec![0.0; 4];
    knots.extend(inner);
    knots.extend([1.0; 4]);
    knots
}

/// Abscissae at which poles of equal distances give an even parametrisation.
fn greville(knots: &[f64]) -> Vec<f64> {
    (0..knots.len() - 4)
        .map(|k| (knots[k + 1] + knots[k + 2] + knots[k + 3]) / 3.0)
        .collect()
}

/// A surface of a kind, of this size, mm.
fn surface(kind: &str, size: f64, random: &mut Random) -> SurfaceSpec {
    if kind == "pole" {
        return fan(size, random);
    }
    let breaks = match kind {
        "bicubic" => [0; 2],
        _ => [(); 2].map(|()| random.between(1.0, 5.0) as usize),
    };
    let multiplicity = if kind == "C1 knots" { 2 } else { 1 };
    let [knots_u, knots_v] = breaks.map(|breaks| knots(breaks, multiplicity));
    let narrow = if kind == "taper" {
        random.between(0.3, 0.95)
    } else {
        0.0
    };
    let bump = size * random.between(0.01, 0.12);
    let shift = 0.02 * size;
    let rows = greville(&knots_u);
    let columns = greville(&knots_v);
    let poles_mm = rows
        .iter()
        .map(|u| {
            columns
                .iter()
                .map(|v| {
                    let width = 1.0 - narrow * v;
                    [
                        size * (u - 0.5) * width + shift * random.next(),
                        size * v + shift * random.next(),
                        bump * random.next(),
                        1.0,
                    ]
                })
                .collect()
        })
        .collect();
    SurfaceSpec::Nurbs(NurbsSpec {
        degree: [3, 3],
        knots_u,
        knots_v,
        poles_mm,
        rational: false,
    })
}

/// A fan around a pole at u = 1, smooth there.
fn fan(size: f64, random: &mut Random) -> SurfaceSpec {
    let step = random.between(0.15, 0.45);
    let fall = 0.2 * random.next();
    let poles_mm = (0..4)
        .map(|t: i32| {
            let reach = size * (1.0 - f64::from(t) / 3.0);
            let bump = if t == 0 { 0.1 * size * random.next() } else { 0.0 };
            (0..4)
                .map(|s: i32| {
                    let (sin, cos) = (step * f64::from(s)).sin_cos();
                    [reach * cos, reach * sin, bump + fall * reach, 1.0]
                })
                .collect()
        })
        .collect();
    SurfaceSpec::Nurbs(NurbsSpec {
        degree: [3, 3],
        knots_u: knots(0, 1),
        knots_v: knots(0, 1),
        poles_mm,
        rational: false,
    })
}

/// A case: size 5 to 60 mm, feed 10 to 100 mm/s.
fn case(kind: &str, seed: usize) -> Job {
    let mut random = Random::new(seed as u64);
    let size = random.between(5.0, 60.0);
    sized(kind, seed, size, &mut random)
}

/// A case of this size, mm.
pub(crate) fn case_of_size(kind: &str, seed: usize, size: f64) -> Job {
    sized(kind, seed, size, &mut Random::new(seed as u64))
}

fn sized(kind: &str, seed: usize, size: f64, random: &mut Random) -> Job {
    let mut job = bumpy_job(seed);
    job.surface = surface(kind, size, random);
    job.side = Side::Up;
    job.pattern = Pattern::Zigzag;
    job.along = if random.next() > 0.0 { Along::U } else { Along::V };
    job.radius_mm = RADIUS * size;
    job.scallop_mm = SCALLOP * job.radius_mm;
    job.chord_mm = 0.005_f64.min(0.4 * job.radius_mm);
    job.feed_mm_min = 60.0 * random.between(10.0, 100.0);
    job
}

/// The compared passes; `None` where the ball does not fit, or the surface has no upper side.
fn passes(job: &Job) -> Option<Vec<Ran>> {
    let prepared = prepare(job).ok()?;
    let last = PASSES[PASSES.len() - 1];
    let mut samples = std::collections::BTreeMap::<u32, (SpanParameter, u32)>::new();
    Machine::load(&prepared)
        .ok()?
        .run(|sample| {
            if sample.state == State::Running {
                samples.entry(sample.pass).or_insert((sample.side, 0)).1 += 1;
            }
            sample.pass <= last
        })
        .ok()?;
    let chosen = PASSES.iter().filter_map(|pass| samples.get(pass));
    let chosen = chosen.filter(|(_, count)| *count > 1).map(|(side, count)| {
        let [u, v] = prepared.parameters(SpanParameter::default(), *side);
        let side = if job.along == Along::U { v } else { u };
        Ran::new(side, f64::from(count - 1) * job.machine.period_s())
    });
    Some(chosen.collect())
}

/// A compared pass.
struct Compared {
    kind: usize,
    looser: bool,
    best_s: f64,
    over_best: f64,
    over_bound: f64,
    what: String,
}

/// The passes of one surface within both limits; `None` where the surface cannot be cut with the ball.
fn compare(kind: usize, seed: usize, unsolved: &AtomicUsize) -> Option<Vec<Compared>> {
    let mut job = case(KINDS[kind], seed);
    let oracle = Oracle::new(&job).ok()?;
    let mut all = Vec::new();
    for looser in [false, true] {
        let times = |limit: [f64; 3]| limit.map(|limit| if looser { 3.0 * limit } else { limit });
        job.machine.limits = Some(AxisLimits {
            velocity_mm_s: times(LIMITS.velocity_mm_s),
            acceleration_mm_s2: times(LIMITS.acceleration_mm_s2),
            jerk_mm_s3: times(LIMITS.jerk_mm_s3),
        });
        for ran in passes(&job)? {
            let Some([over_best, over_bound]) = compared_if_solved(&job, &oracle, &ran) else {
                unsolved.fetch_add(1, Ordering::Relaxed);
                continue;
            };
            all.push(Compared {
                kind,
                looser,
                best_s: ran.time_s() / over_best,
                over_best,
                over_bound,
                what: format!(
                    "{} {seed}, r = {:.2} mm, {:.0} mm/min",
                    KINDS[kind], job.radius_mm, job.feed_mm_min
                ),
            });
        }
    }
    Some(all)
}

/// Where the curvature jumps at knots, so does the centre's speed: the tool rests there, within the limits, and does not crawl. Passes took 7.5 times the
/// optimum in the mean, and 52 times at worst.
#[test]
fn knots_where_the_curvature_jumps_are_passed_at_a_rest() {
    let kind = KINDS.iter().position(|name| *name == "C1 knots").unwrap();
    let mut measured = 0;
    for seed in [kind, kind + 5, kind + 10, kind + 15] {
        let mut job = case(KINDS[kind], seed);
        job.machine.limits = Some(LIMITS);
        if prepare(&job).is_err() || passes(&job).is_none() {
            continue;
        }
        let used = used(&job);
        let [velocity, acceleration, jerk] = used.shares;
        println!(
            "{seed}: {:?}, stand {}, feed {}",
            used.shares, used.stand, used.feed
        );
        assert!(
            velocity <= 1.001 && acceleration <= 1.0 && jerk <= 1.02,
            "{seed}: {:?}",
            used.shares
        );
        assert!(used.feed <= 1.00001, "{seed}: {}", used.feed);
        for one in compare(kind, seed, &AtomicUsize::new(0)).unwrap() {
            assert!(one.over_best < 1.13, "{}: {}", one.what, one.over_best);
            measured += 1;
        }
    }
    assert!(measured >= 6, "{measured} passes");
}

/// Knots that the optimum passes at 0.7 of the feed and more: the tool rested there, which took 1.13 to 1.24 times the optimum.
#[test]
fn knots_that_can_be_passed_at_speed_are_no_rests() {
    for (name, seed) in [("taper", 3), ("C2 knots", 11), ("C2 knots", 16)] {
        let kind = KINDS.iter().position(|kind| *kind == name).unwrap();
        let all = compare(kind, seed, &AtomicUsize::new(0)).unwrap();
        assert_eq!(all.len(), 4, "{name} {seed}");
        for one in all {
            assert!(one.over_best < 1.052, "{}: {}", one.what, one.over_best);
        }
    }
}

/// The tool waits for the plan of the first pass off the surface, so that has all the nodes and steps that it is worth: it took 1.24 times the optimum.
#[test]
fn the_first_pass_is_planned_as_well_as_can_be() {
    let kind = KINDS.iter().position(|kind| *kind == "C1 knots").unwrap();
    let all = compare(kind, 42, &AtomicUsize::new(0)).unwrap();
    assert_eq!(all.len(), 4);
    for one in all {
        assert!(one.over_best < 1.06, "{}: {}", one.what, one.over_best);
    }
}

/// 120 surfaces of five kinds, 5 to 60 mm, at 10 to 100 mm/s, within the limits of `jobs/plate_machine.toml` and three times as much. Prints
/// each pass and the table of `docs/figures.md`, in a quarter of an hour; ISOFEED_CASES sets another number of surfaces of each
/// kind, ISOFEED_FIRST leaves out those before it:
/// `cargo test -p integration-tests random_passes -- --ignored --nocapture`.
#[test]
#[ignore = "a campaign of minutes"]
fn passes_on_random_surfaces_against_the_optimum() {
    let number =
        |name: &str, usual: usize| std::env::var(name).map_or(usual, |number| number.parse().unwrap());
    let surfaces = number("ISOFEED_CASES", SURFACES);
    let found = Mutex::new(Vec::<Compared>::new());
    let refused = AtomicUsize::new(0);
    let unsolved = AtomicUsize::new(0);
    let next = AtomicUsize::new(number("ISOFEED_FIRST", 0));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    if index >= KINDS.len() * surfaces {
                        break;
                    }
                    // A surface on which the ball does not fit makes way for another one.
                    for round in 0..20 {
                        if let Some(all) = compare(index % KINDS.len(), index + 1000 * round, &unsolved) {
                            for one in &all {
                                println!(
                                    "{:.4} of {:.3} s: {}, 3 x: {}",
                                    one.over_best, one.best_s, one.what, one.looser
                                );
                            }
                            found.lock().unwrap().extend(all);
                            break;
                        }
                        refused.fetch_add(1, Ordering::Relaxed);
                    }
                }
            });
        }
    });
    let found = found.into_inner().unwrap();
    let row = |name: &str, chosen: &[&Compared]| {
        #[allow(clippy::cast_precision_loss, reason = "small counts")]
        let mean = chosen.iter().map(|one| one.over_best).sum::<f64>() / chosen.len() as f64;
        let above = chosen.iter().filter(|one| one.over_best > WANTED).count();
        if let Some(worst) = chosen.iter().max_by(|a, b| a.over_best.total_cmp(&b.over_best)) {
            println!(
                "{name:<28}{:>5} passes, mean {mean:.4}, worst {:.4} ({}, {:.3} s), {above} above {WANTED}",
                chosen.len(),
                worst.over_best,
                worst.what,
                worst.best_s
            );
        }
    };
    println!(
        "{} surfaces refused, {} passes without an optimum, {} compared",
        refused.load(Ordering::Relaxed),
        unsolved.load(Ordering::Relaxed),
        found.len()
    );
    for looser in [false, true] {
        for (kind, name) in KINDS.iter().enumerate() {
            let own = |one: &&Compared| one.kind == kind && one.looser == looser && one.best_s >= PLANNED_S;
            let own: Vec<&Compared> = found.iter().filter(own).collect();
            row(&format!("{name}{}", if looser { ", 3 x" } else { "" }), &own);
        }
        let short = |one: &&Compared| one.looser == looser && one.best_s < PLANNED_S;
        let short: Vec<&Compared> = found.iter().filter(short).collect();
        row(
            &format!("below {PLANNED_S} s, all{}", if looser { ", 3 x" } else { "" }),
            &short,
        );
        let long = |one: &&Compared| one.looser == looser && one.best_s >= PLANNED_S;
        let long: Vec<&Compared> = found.iter().filter(long).collect();
        row(
            &format!("others, all{}", if looser { ", 3 x" } else { "" }),
            &long,
        );
    }
    for one in &found {
        assert!(
            one.over_bound >= 1.0 - 1e-3,
            "{}: faster than can be, {}",
            one.what,
            one.over_bound
        );
    }
}
