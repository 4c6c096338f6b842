//! Duration of passes on a machine with limits, against the best motion that an offline solver finds within the same limits. Straight passes
//! are compared with the closed form, which is itself tested against Ruckig.

use std::collections::BTreeMap;
use std::path::Path;

use interp_core::{SpanParameter, State};
use job::AxisLimits;
use job::{Along, Job, Pattern};
use machine::Machine;
use machine::prepare::prepare;
use oracle::Oracle;
use verify::motion::point::LineLimits;
use verify::motion::{PassEnd, PassPath, optimum};

/// A machine with equal limits on all axes, except for a lower velocity of z: the machine of `docs/figures.md`.
const LIMITS: AxisLimits = AxisLimits {
    velocity_mm_s: [100.0, 100.0, 50.0],
    acceleration_mm_s2: [1000.0; 3],
    jerk_mm_s3: [20_000.0; 3],
};
/// Maximum duration of a pass over that of the best motion known.
const ABOVE: f64 = 1.05;
/// Maximum duration of a straight pass over the exact time, half of it for the jerk that a plan leaves to a hold, and periods added because each part
/// of a pass takes a whole number of them.
const ABOVE_STRAIGHT: f64 = 1.03;
const WHOLE_PERIODS: f64 = 3.0;

fn on_machine(name: &str, times: f64) -> Job {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let job = job_file::load(&path).unwrap();
    let feed_mm_s = times * job.feed_mm_s();
    limited(job, feed_mm_s)
}

pub(crate) fn limited(mut job: Job, feed_mm_s: f64) -> Job {
    job.feed_mm_min = 60.0 * feed_mm_s;
    job.machine.limits = Some(LIMITS);
    job
}

/// A pass as the core ran it.
#[derive(Clone, Copy)]
pub(crate) struct Ran {
    side: f64,
    /// Time from the first sample to the last, s.
    time_s: f64,
}

impl Ran {
    /// A pass at this side parameter that took so long.
    pub(crate) fn new(side: f64, time_s: f64) -> Self {
        Self { side, time_s }
    }

    pub(crate) fn time_s(&self) -> f64 {
        self.time_s
    }
}

/// Runs a job until the end of its pass `last`.
pub(crate) fn run(job: &Job, last: u32) -> BTreeMap<u32, Ran> {
    let prepared = prepare(job).unwrap();
    let mut passes = BTreeMap::<u32, (SpanParameter, u32)>::new();
    let mut machine = Machine::load(&prepared).unwrap();
    machine
        .run(|sample| {
            if sample.state == State::Running {
                passes.entry(sample.pass).or_insert((sample.side, 0)).1 += 1;
            }
            sample.pass <= last
        })
        .unwrap();
    let ran = |(pass, (side, samples)): (u32, (SpanParameter, u32))| {
        let [u, v] = prepared.parameters(SpanParameter::default(), side);
        let ran = Ran {
            side: if job.along == Along::U { v } else { u },
            time_s: f64::from(samples - 1) * job.machine.period_s(),
        };
        (pass, ran)
    };
    passes
        .into_iter()
        .filter(|(pass, _)| *pass <= last)
        .map(ran)
        .collect()
}

/// Time of a pass over that of the best motion known, and over the lower bound for any motion.
pub(crate) fn compared(job: &Job, oracle: &Oracle, ran: &Ran) -> [f64; 2] {
    compared_if_solved(job, oracle, ran).unwrap()
}

/// As [`compared`]; `None` where the solver finds no motion.
pub(crate) fn compared_if_solved(job: &Job, oracle: &Oracle, ran: &Ran) -> Option<[f64; 2]> {
    let path = PassPath::of_pass(oracle, ran.side).unwrap();
    let rests = [PassEnd::Rest; 2];
    let limits = job.machine.limits.unwrap();
    let best = optimum(&path, job.feed_mm_s(), &limits, job.machine.period_s(), rests).ok()?;
    // The reference motion keeps the limits, and is not below the lower bound.
    assert!(best.uses.iter().all(|used| *used <= 1.0 + 1e-9), "{best:?}");
    assert!(best.lower_bound_s <= best.feasible_s, "{best:?}");
    Some([best.feasible_s, best.lower_bound_s].map(|best| ran.time_s / best))
}

/// First passes of some sample jobs, at the programmed feed and at multiples that the axes cannot reach everywhere.
#[test]
fn passes_take_a_tenth_more_than_the_best_at_most() {
    let mut off = String::new();
    for (name, times) in [
        ("plate", 1.0),
        ("plate", 3.0),
        ("plate_v", 1.0),
        ("freeform", 1.0),
        ("sphere_cap", 3.0),
        ("torus", 6.0),
    ] {
        let job = on_machine(name, times);
        let oracle = Oracle::new(&job).unwrap();
        let [over_best, over_bound] = compared(&job, &oracle, &run(&job, 0)[&0]);
        println!("{name}, {times} x feed: {over_best:.4} of the best, {over_bound:.4} of the bound");
        if over_best > ABOVE {
            off += &format!("{name}, {times} x feed: {over_best}\n");
        }
        assert!(
            over_bound >= 1.0 - 1e-3,
            "{name}: faster than can be, {over_bound}"
        );
    }
    assert!(off.is_empty(), "{off}");
}

/// Time of a straight pass of this length in x and y on the machine above, s: the core's, and the exact one.
fn straight(length_mm: f64, feed_mm_s: f64) -> [f64; 2] {
    let scale = length_mm / 80.0_f64.hypot(20.0);
    let text = include_str!("../jobs/ruled_reconstructed.toml").replace("along = \"u\"", "along = \"v\"");
    let text = format!("{text}\n[placement]\nscale = {scale}\n");
    let job = limited(job_file::parse("straight", &text).unwrap(), feed_mm_s);
    // The pass goes from (20, y, z) to (100, y - 20, z), times the scale.
    let slope = 80.0 / 80.0_f64.hypot(20.0);
    let exact = LineLimits {
        velocity: (LIMITS.velocity_mm_s[0] / slope).min(feed_mm_s),
        acceleration: LIMITS.acceleration_mm_s2[0] / slope,
        jerk: LIMITS.jerk_mm_s3[0] / slope,
    };
    [run(&job, 0)[&0].time_s, exact.rest_to_rest_s(length_mm)]
}

/// Passes along the straight lines of a ruled surface, of several lengths and feeds.
#[test]
fn straight_passes_take_the_time_of_the_exact_solution() {
    const LENGTHS_MM: [f64; 6] = [1.0, 3.0, 10.0, 30.0, 82.0, 300.0];
    const FEEDS_MM_S: [f64; 6] = [1.0, 10.0, 30.0, 60.0, 100.0, 200.0];
    let mut off = String::new();
    for length_mm in LENGTHS_MM {
        for feed_mm_s in FEEDS_MM_S {
            let [took, exact] = straight(length_mm, feed_mm_s);
            let over = (took - WHOLE_PERIODS * 1e-3) / exact;
            println!("{length_mm} mm, {feed_mm_s} mm/s: {took:.4} s, exactly {exact:.4} s, {over:.4}");
            if over > ABOVE_STRAIGHT || took < exact - 1e-3 {
                off += &format!("{length_mm} mm, {feed_mm_s} mm/s: {took} s, exactly {exact} s\n");
            }
        }
    }
    assert!(off.is_empty(), "{off}");
}

/// Seven passes of each sample job, at the programmed feed, where the bound applies, and at three times that feed, where closely spaced knots
/// cost more time (`docs/figures.md` has the values). Prints the table from which these figures are, in some minutes:
/// `cargo test --release -p integration-tests pass_times -- --ignored --nocapture`.
#[test]
#[ignore = "a campaign of minutes"]
fn seven_passes_of_every_job() {
    let mut worst = 0.0_f64;
    println!(
        "{:<22}{:>6}{:>9}{:>14}{:>14}{:>14}",
        "job", "feed", "passes", "best, most", "best, mean", "bound, most"
    );
    for name in [
        "plate",
        "plate_v",
        "freeform",
        "torus",
        "sphere_cap",
        "ruled_printed",
        "ruled_reconstructed",
        "revolved_v",
        "revolved",
        "far_plate",
    ] {
        for times in [1.0, 3.0] {
            let mut job = on_machine(name, times);
            job.pattern = Pattern::Zigzag;
            let oracle = Oracle::new(&job).unwrap();
            let passes = run(&job, u32::MAX);
            let last = passes.len() - 1;
            let chosen = (0..7).map(|k| &passes[&u32::try_from(last * k / 6).unwrap()]);
            let all: Vec<[f64; 2]> = chosen.map(|ran| compared(&job, &oracle, ran)).collect();
            let most = |k: usize| all.iter().map(|over| over[k]).fold(0.0, f64::max);
            #[allow(clippy::cast_precision_loss, reason = "small counts")]
            let mean = all.iter().map(|over| over[0]).sum::<f64>() / all.len() as f64;
            let [best, bound] = [most(0), most(1)];
            println!(
                "{name:<22}{times:>6}{:>9}{best:>14.4}{mean:>14.4}{bound:>14.4}",
                passes.len()
            );
            if times == 1.0 {
                worst = worst.max(best);
            }
        }
    }
    assert!(worst <= ABOVE, "{worst}");
}
