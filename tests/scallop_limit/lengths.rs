//! Length of all passes of constant scallop height against straight ones at the first-order interval (Lo): surfaces whose passes spread or
//! converge, sample jobs, random bicubic surfaces.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;

use job::{AxisLimits, Job, NurbsSpec, Pattern, Side, Spacing, Start, SurfaceSpec};

use super::shapes::Random;

/// Feed of all jobs: lengths do not depend on it, the time of the test does.
const FEED_MM_MIN: f64 = 3000.0;

/// A surface with the greatest ratio of the lengths, from the better start.
struct Case {
    name: String,
    job: Job,
    most: f64,
}

fn sample(name: &str) -> Job {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let mut job = job_file::load(&path).unwrap();
    (job.machine.limits, job.feed_mm_min) = (None, FEED_MM_MIN);
    job
}

/// A job on a surface, with the tool above it.
fn on(spec: NurbsSpec, radius_mm: f64, scallop_mm: f64) -> Job {
    let mut job = sample("freeform");
    job.surface = SurfaceSpec::Nurbs(spec);
    (job.radius_mm, job.scallop_mm, job.side) = (radius_mm, scallop_mm, Side::Up);
    job
}

/// Poles of an arc of quadratic pieces of the same angle, (cosine, sine, weight).
fn arc([from, to]: [f64; 2], pieces: u32) -> Vec<[f64; 3]> {
    let half = 0.5 * (to - from) / f64::from(pieces);
    let pole = |k: u32| {
        let angle = from + half * f64::from(k);
        let weight = if k % 2 == 1 { half.cos() } else { 1.0 };
        [angle.cos() / weight, angle.sin() / weight, weight]
    };
    (0..=2 * pieces).map(pole).collect()
}

/// The upper side of a torus, 140 degrees of its section: passes across, so that they spread outwards.
fn torus() -> Job {
    let (middle, radius) = (30.0, 15.0);
    let around = arc([0.0, FRAC_PI_2], 1);
    let poles = arc([PI / 9.0, 8.0 * PI / 9.0], 2).into_iter().map(|[c, s, w]| {
        let distance = middle + radius * c;
        around
            .iter()
            .map(|[x, y, v]| [distance * x, distance * y, radius * s, w * v])
            .collect()
    });
    let spec = NurbsSpec {
        degree: [2, 2],
        knots_u: vec![0.0, 0.0, 0.0, 0.5, 0.5, 1.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0],
        poles_mm: poles.collect(),
        rational: true,
    };
    on(spec, 5.0, 0.005)
}

/// A twisted fan, 20 mm wide at one end and 80 mm at the other.
fn fan() -> Job {
    let spec = NurbsSpec {
        degree: [1, 1],
        knots_u: vec![0.0, 0.0, 1.0, 1.0],
        knots_v: vec![0.0, 0.0, 1.0, 1.0],
        poles_mm: vec![
            vec![[0.0, -10.0, 0.0, 1.0], [0.0, 10.0, 6.0, 1.0]],
            vec![[80.0, -40.0, 4.0, 1.0], [80.0, 40.0, -8.0, 1.0]],
        ],
        rational: false,
    };
    on(spec, 5.0, 0.005)
}

/// A seeded bicubic surface of 6 to 11 poles each way: tapered, sheared, in waves.
fn bicubic(seed: u64) -> Job {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_97f4_a7c1));
    let [n, m] = [0; 2].map(|_| random.within(6.0, 11.99) as usize);
    let [depth, width] = [0; 2].map(|_| random.within(40.0, 70.0));
    let (taper, shear) = (random.within(0.4, 1.6), random.within(-15.0, 15.0));
    let height = random.within(8.0, 18.0);
    let waves: [[f64; 4]; 4] = [0; 4].map(|_| [0; 4].map(|_| random.within(-1.0, 1.0)));
    let knots = |poles: usize| -> Vec<f64> {
        let inner = (0..=poles - 3).map(|k| k as f64 / (poles - 3) as f64);
        [0.0; 3].into_iter().chain(inner).chain([1.0; 3]).collect()
    };
    let (knots_u, knots_v) = (knots(n), knots(m));
    let greville = |knots: &[f64], k: usize| knots[k + 1..k + 4].iter().sum::<f64>() / 3.0;
    let pole = |x: f64, y: f64| {
        let mut z = 0.0;
        for (i, row) in waves.iter().enumerate() {
            for (j, wave) in row.iter().enumerate() {
                let (a, b) = (i as f64, j as f64);
                z += wave * (PI * a * x).cos() * (PI * b * y).cos() / (1.0 + a * a + b * b);
            }
        }
        let spread = 1.0 + (taper - 1.0) * x;
        [depth * x, (y - 0.5) * width * spread + shear * x, height * z, 1.0]
    };
    let row = |i: usize| {
        (0..m)
            .map(|j| pole(greville(&knots_u, i), greville(&knots_v, j)))
            .collect()
    };
    let poles_mm = (0..n).map(row).collect();
    let spec = NurbsSpec {
        degree: [3, 3],
        knots_u: knots_u.clone(),
        knots_v: knots_v.clone(),
        poles_mm,
        rational: false,
    };
    let scallop_mm = random.within(0.005, 0.02);
    // The largest ball that fits, within 6 %: the metric of the steps varies most.
    let mut job = on(spec, 25.0, scallop_mm);
    while length(&job, Spacing::FirstOrder).is_none() {
        job.radius_mm *= 0.94;
    }
    job
}

/// The surfaces with what their passes may add up to.
fn cases() -> Vec<Case> {
    let case = |name: &str, job: Job, most: f64| Case {
        name: name.to_owned(),
        job,
        most,
    };
    let mut cases = vec![
        case("bell of Example 1", sample("revolved"), 0.66),
        case("quarter of a sphere", sample("sphere_cap"), 0.59),
        case("torus", torus(), 0.71),
        case("fan 4:1", fan(), 0.65),
        case("freeform", sample("freeform"), 0.90),
    ];
    // A ball that barely fits: from a start that is chosen badly they may be longer than straight ones, from the better one not.
    cases.extend(SEEDS.map(|seed| case(&format!("bicubic {seed}"), bicubic(seed), 1.0)));
    cases
}

const SEEDS: [u64; 10] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10];
/// Greatest mean of the bicubic surfaces.
const MEAN_MOST: f64 = 0.90;

/// Length of all passes with this spacing, mm; none where the ball does not fit.
fn length(job: &Job, spacing: Spacing) -> Option<f64> {
    let mut job = job.clone();
    job.spacing = spacing;
    let prepared = machine::prepare::prepare(&job).unwrap();
    let figures = inspect::path_figures(&job, &prepared).ok()?;
    Some(figures.length_mm)
}

/// Lengths of straight passes at the first-order interval, and of curved ones from the edge and from the middle, mm.
fn lengths(job: &Job) -> [Option<f64>; 3] {
    [
        Spacing::FirstOrder,
        Spacing::Constant(Start::Edge),
        Spacing::Constant(Start::Middle),
    ]
    .map(|spacing| length(job, spacing))
}

/// The table of docs/figures.md.
#[test]
fn shorter_than_straight_passes() {
    let (mut sum, mut failed) = (0.0, String::new());
    for Case { name, job, most } in cases() {
        let [straight, edge, middle] = lengths(&job).map(Option::unwrap);
        let [edge, middle] = [edge, middle].map(|length| length / straight);
        println!("{name}: {straight:.0} mm, from the edge {edge:.3}, from the middle {middle:.3}");
        let better = edge.min(middle);
        if better > most {
            failed += &format!("{name}: {better:.4}, {most} at most\n");
        }
        if name.starts_with("bicubic") {
            sum += better;
        }
    }
    let mean = sum / SEEDS.len() as f64;
    println!("mean of the bicubic surfaces {mean:.3}");
    assert!(failed.is_empty() && mean <= MEAN_MOST, "{failed}mean {mean:.4}");
}

/// Whole jobs at 3600 mm/min within the usual axis limits: the better start takes no more than this share of the time of straight passes. On the torus passes are as many, and as fast within a
/// thousandth.
#[test]
fn no_slower_than_straight_passes() {
    for (name, most) in [("sphere_cap", 0.85), ("torus", 1.001), ("plate", 0.99)] {
        let time = |spacing: Spacing| {
            let mut job = sample(name);
            (job.machine.limits, job.feed_mm_min) = (Some(AxisLimits::DEFAULT), 3600.0);
            (job.pattern, job.spacing) = (Pattern::Zigzag, spacing);
            let prepared = machine::prepare::prepare(&job).unwrap();
            inspect::path_figures(&job, &prepared).unwrap().time_s
        };
        let straight = time(Spacing::Exact);
        let [edge, middle] =
            [Start::Edge, Start::Middle].map(|start| time(Spacing::Constant(start)) / straight);
        println!("{name}: {straight:.1} s, from the edge {edge:.3}, from the middle {middle:.3}");
        assert!(edge.min(middle) <= most, "{name}: {edge}, {middle}");
    }
}
