//! When an override begins: the first period that differs from the run without it, at random places of passes.

use integration_tests::sequences::{Core, Random, loaded, period};
use interp_core::{Command, Inputs, State};
use job::{AxisLimits, Pattern};
use machine::prepare::prepare;

/// Longest delay of an override, periods.
const AT_ONCE: usize = 20;
/// Number of periods in which the beginning of an override is searched.
const FOLLOWED: usize = 300;
/// Share of the programmed feed from which the tool counts as moving at the feed.
const AT_FEED: f32 = 0.999;
/// Number of periods for which it must stay at the feed.
const STAYS: usize = 200;
/// Share of the feed that is rounding.
const ROUNDING: f32 = 1e-5;

/// When overrides began, periods.
#[derive(Default)]
struct Begins {
    /// Overrides below the last one.
    slower: Vec<usize>,
    /// Overrides above the last one, at places where the tool moves at the feed and stays so.
    at_feed: Vec<usize>,
    /// Overrides above the last one, at places where the axes limit the motion.
    at_limit: Vec<usize>,
}

/// The period in which a run differs from one without the override.
fn begins(core: &Core, percent: u8, feed_mm_s: f32) -> usize {
    let (mut with, mut without) = (core.clone(), core.clone());
    let most = feed_mm_s * 0.01 * f32::from(percent.max(100)) * (1.0 + ROUNDING);
    let mut found = FOLLOWED;
    for n in 0..FOLLOWED {
        let inputs = Inputs {
            command: None,
            feed_override: percent,
        };
        let sample = period(&mut with, inputs);
        assert!(
            sample.state != State::Running || sample.feed_mm_s <= most,
            "{} mm/s at {percent} %",
            sample.feed_mm_s
        );
        if found == FOLLOWED && sample.cl_nm != period(&mut without, None).cl_nm {
            found = n;
        }
    }
    found
}

/// Whether the undisturbed run stays at the programmed feed.
fn stays_at_feed(core: &Core, feed_mm_s: f32) -> bool {
    let mut core = core.clone();
    (0..STAYS).all(|_| {
        let sample = period(&mut core, None);
        sample.state == State::Running && sample.feed_mm_s >= AT_FEED * feed_mm_s
    })
}

/// Overrides at random places of a job.
fn overrides(all: &mut Begins, name: &str, feed_mm_min: f64, overrun_mm: f64, count: usize) {
    let jobs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
    let mut job = job_file::load(&jobs.join(format!("{name}.toml"))).unwrap();
    (job.feed_mm_min, job.pattern, job.overrun_mm) = (feed_mm_min, Pattern::Zigzag, overrun_mm);
    job.machine.limits = Some(AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
    });
    let prepared = prepare(&job).unwrap();
    let feed_mm_s = prepared.header.feed_mm_s;
    let mut core = loaded(&prepared.header, &prepared.words);
    let mut random = Random::new(feed_mm_min.to_bits());
    let mut sample = period(&mut core, Command::Start);
    let mut done = 0;
    while done < count {
        for _ in 0..1 + random.below(200) {
            let command = (!sample.state.is_under_way()).then_some(Command::Start);
            sample = period(&mut core, command);
        }
        if sample.state != State::Running {
            continue;
        }
        done += 1;
        let percent = [20, 50, 80, 120, 150, 200][random.below(6)];
        let period = begins(&core, percent, feed_mm_s);
        let list = if percent < 100 {
            &mut all.slower
        } else if stays_at_feed(&core, feed_mm_s) {
            &mut all.at_feed
        } else {
            &mut all.at_limit
        };
        list.push(period);
    }
}

/// Half, nine of ten, the last of a sorted list, and the share within [`AT_ONCE`].
fn figures(list: &mut [usize]) -> ([usize; 3], f64) {
    list.sort_unstable();
    let last = list.len() - 1;
    let at_once = list.iter().filter(|period| **period <= AT_ONCE).count();
    let share = at_once as f64 / list.len() as f64;
    ([list[last / 2], list[last * 9 / 10], list[last]], share)
}

/// Jobs, feeds and overruns.
const JOBS: [(&str, f64, f64); 6] = [
    ("freeform", 1800.0, 0.0),
    ("freeform", 3600.0, 0.0),
    ("plate_v", 1800.0, 2.0),
    ("plate_v", 3600.0, 0.0),
    ("torus", 1200.0, 2.0),
    ("sphere_cap", 1200.0, 0.0),
];

/// The figures of some overrides at random places.
fn measure(count: usize) -> [([usize; 3], f64); 3] {
    let mut all = Begins::default();
    for (name, feed_mm_min, overrun_mm) in JOBS {
        overrides(&mut all, name, feed_mm_min, overrun_mm, count);
    }
    let names = ["below", "above, at the feed", "above, elsewhere"];
    let lists = [&mut all.slower, &mut all.at_feed, &mut all.at_limit];
    let mut lists = lists.into_iter().zip(names);
    std::array::from_fn(|_| {
        let (list, name) = lists.next().unwrap();
        let (periods, share) = figures(list);
        println!(
            "{} {name}: {periods:?} ms, {share:.3} within {AT_ONCE} ms",
            list.len()
        );
        (periods, share)
    })
}

/// An override begins within 20 ms where the axes leave something.
#[test]
fn an_override_begins_at_once() {
    let [(_, below), (_, at_feed), _] = measure(100);
    assert!(below >= 0.9 && at_feed >= 0.9, "{below} {at_feed}");
}
