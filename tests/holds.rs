//! How long a hold takes, and a controlled stop after a fault: to rest, at random times of sample jobs, at several feeds.

use integration_tests::sequences::{loaded, period};
use interp_core::{Command, Fault, FaultKind, Inputs, State};
use job::{AxisLimits, Job, Pattern};
use machine::Machine;
use machine::prepare::prepare;

use crate::pass_times::limited;

/// A linear congruential generator.
struct Random(u64);

impl Random {
    fn below(&mut self, most: u32) -> u32 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        u32::try_from((self.0 >> 33) % u64::from(most)).unwrap()
    }
}

/// Periods from each hold to rest: on passes, and in links.
struct Holds {
    on_pass: Vec<u32>,
    in_link: Vec<u32>,
}

fn job_of(name: &str, feed_mm_min: f64, pattern: Pattern, overrun_mm: f64) -> Job {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let mut job = limited(job_file::load(&path).unwrap(), feed_mm_min / 60.0);
    job.machine.limits = Some(AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
    });
    job.pattern = pattern;
    job.overrun_mm = overrun_mm;
    job
}

fn holds(name: &str, feed_mm_min: f64, pattern: Pattern, overrun_mm: f64, count: usize) -> Holds {
    let job = job_of(name, feed_mm_min, pattern, overrun_mm);
    let mut machine = Machine::load(&prepare(&job).unwrap()).unwrap();
    let mut random = Random(0x1234_5678_9abc_def1 ^ feed_mm_min.to_bits());
    let mut holds = Holds {
        on_pass: Vec::new(),
        in_link: Vec::new(),
    };
    let mut command = Some(Command::Start);
    while holds.on_pass.len() + holds.in_link.len() < count {
        // Until the next hold, at the plan's own pace or shortly after a resume.
        let wait = 150 + random.below(1500);
        let first = *machine.tick(command);
        let (mut at, mut stands) = (first.state, true);
        for _ in 0..wait {
            if !at.is_under_way() {
                machine.tick(Command::Start);
            }
            let sample = machine.tick(Inputs::default());
            at = sample.state;
            stands &= sample.cl_nm == first.cl_nm;
        }
        // A hold of a machine that stands would take no time.
        assert!(!stands || wait < RESUMES, "{name} {feed_mm_min}: does not resume");
        let mut sample = *machine.tick(Command::Hold);
        let mut periods = 1;
        while sample.state == State::Holding {
            periods += 1;
            sample = *machine.tick(Inputs::default());
            assert!(periods < 20_000, "{name} {feed_mm_min}: stalls");
        }
        match at {
            State::Running => holds.on_pass.push(periods),
            _ => holds.in_link.push(periods),
        }
        command = Some(Command::Resume);
    }
    holds
}

/// The value at share `part` of a sorted list; 0 of an empty list.
fn quantile(sorted: &[u32], part: f64) -> u32 {
    #[allow(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "small counts"
    )]
    let index = (sorted.len().saturating_sub(1) as f64 * part) as usize;
    sorted.get(index).copied().unwrap_or(0)
}

/// Holds of some jobs at these feeds, mm/min: with rests, with turns, and with hops between the passes. Prints and returns all on passes and all in
/// links, sorted.
fn all_holds(jobs: &[(&str, &[f64])], count: usize) -> [Vec<u32>; 2] {
    let mut all = [Vec::new(), Vec::new()];
    for (name, feeds) in jobs {
        for feed in *feeds {
            for (pattern, overrun) in [
                (Pattern::Zigzag, 0.0),
                (Pattern::Zigzag, 2.0),
                (Pattern::Zig, 0.0),
            ] {
                let Holds { on_pass, in_link } = holds(name, *feed, pattern, overrun, count);
                for (all, mut list) in all.iter_mut().zip([on_pass, in_link]) {
                    list.sort_unstable();
                    println!(
                        "{name} {feed} {pattern:?} {overrun}: {} holds, {} {} {} ms",
                        list.len(),
                        quantile(&list, 0.5),
                        quantile(&list, 0.9),
                        quantile(&list, 1.0)
                    );
                    all.extend(list);
                }
            }
        }
    }
    for (all, name) in all.iter_mut().zip(["on passes", "in links"]) {
        all.sort_unstable();
        let late = all.iter().filter(|periods| **periods > WORST).count();
        println!(
            "{} {name}: half {}, nine of ten {}, worst {} ms; {late} above {WORST} ms",
            all.len(),
            quantile(all, 0.5),
            quantile(all, 0.9),
            quantile(all, 1.0)
        );
    }
    all
}

/// Longest time from a hold to standstill of nine in ten holds, periods of 1 ms.
const NINE_OF_TEN: u32 = 250;
/// Longest time from a hold to standstill of all holds, periods of 1 ms.
const WORST: u32 = 400;
/// Longest time, in periods, until a resumed run moves, or a started one, whose first pass has to be planned.
const RESUMES: u32 = 1200;

#[test]
fn a_hold_stands_within_four_tenths_of_a_second() {
    let all = all_holds(
        &[
            ("freeform", &[3600.0, 6000.0]),
            ("torus", &[6000.0]),
            ("sphere_cap", &[1200.0, 6000.0]),
        ],
        150,
    );
    for list in &all {
        assert!(quantile(list, 0.9) <= NINE_OF_TEN && quantile(list, 1.0) <= WORST);
    }
}

/// Some ten thousand holds, in minutes; ISOFEED_HOLDS sets the number of each job, feed and pattern:
/// `cargo test --release -p integration-tests holds -- --ignored --nocapture`.
#[test]
#[ignore = "a campaign of minutes"]
fn holds_of_many_jobs() {
    let count = std::env::var("ISOFEED_HOLDS").map_or(300, |count| count.parse().unwrap());
    let [on_pass, in_link] = all_holds(
        &[
            ("freeform", &[1800.0, 3600.0, 6000.0]),
            ("plate_v", &[3600.0, 6000.0]),
            ("torus", &[3600.0, 6000.0]),
            ("sphere_cap", &[1200.0, 6000.0]),
            ("ruled_printed", &[3600.0, 6000.0]),
            ("revolved", &[6000.0]),
        ],
        count,
    );
    for list in [on_pass, in_link] {
        assert!(quantile(&list, 0.9) <= NINE_OF_TEN && quantile(&list, 1.0) <= WORST);
    }
}

/// Periods within which a controlled stop after a fault stands, wherever it begins: on a pass, on a link, in a turn.
const STOPPED: u32 = 300;

/// Periods of controlled stops after a fault at random places of a job, on passes and in links.
fn stops(name: &str, feed_mm_min: f64, pattern: Pattern, overrun_mm: f64, count: usize) -> Holds {
    let prepared = prepare(&job_of(name, feed_mm_min, pattern, overrun_mm)).unwrap();
    let mut core = loaded(&prepared.header, &prepared.words);
    let mut random = Random(feed_mm_min.to_bits());
    let mut stops = Holds {
        on_pass: Vec::new(),
        in_link: Vec::new(),
    };
    let mut sample = period(&mut core, Command::Start);
    while stops.on_pass.len() + stops.in_link.len() < count {
        for _ in 0..1 + random.below(300) {
            let command = (!sample.state.is_under_way()).then_some(Command::Start);
            sample = period(&mut core, command);
        }
        let mut stopped = core.clone();
        stopped.controlled_stop(Fault::new(FaultKind::DeadlineMissed, 1.0));
        let mut periods = 0;
        while stopped.state() == State::Stopping {
            period(&mut stopped, None);
            periods += 1;
            assert!(periods < 20_000, "{name} {feed_mm_min}: stalls");
        }
        match sample.state {
            State::Running => stops.on_pass.push(periods),
            _ => stops.in_link.push(periods),
        }
    }
    stops
}

/// A controlled stop after a fault, for which the axes may use 1.1 of their acceleration and 1.5 of their jerk limits.
#[test]
fn a_fault_stops_within_three_tenths_of_a_second() {
    for (name, feed_mm_min, pattern, overrun_mm) in [
        ("freeform", 3600.0, Pattern::Zigzag, 0.0),
        ("freeform", 6000.0, Pattern::Zig, 0.0),
        ("torus", 6000.0, Pattern::Zigzag, 2.0),
        ("ruled_printed", 6000.0, Pattern::Zigzag, 2.0),
        ("sphere_cap", 6000.0, Pattern::Zig, 0.0),
    ] {
        let Holds { on_pass, in_link } = stops(name, feed_mm_min, pattern, overrun_mm, 200);
        for (mut list, at) in [(on_pass, "on passes"), (in_link, "in links")] {
            list.sort_unstable();
            let [half, most, worst] = [0.5, 0.9, 1.0].map(|part| quantile(&list, part));
            println!(
                "{name} {feed_mm_min} {pattern:?} {overrun_mm}: {} stops {at}, {half} {most} {worst} ms",
                list.len()
            );
            assert!(worst <= STOPPED, "{worst}");
        }
    }
}

/// Before a turn the tool cannot go on until the next pass is planned: that planning comes before the search for a pace, with which it stood for 1.3 s and more at
/// each of these feeds, after one of a thousand resumes.
#[test]
fn each_of_a_thousand_resumes_moves() {
    for feed in [5900.0, 5940.0, 6040.0, 6060.0] {
        let Holds { on_pass, in_link } = holds("freeform", feed, Pattern::Zigzag, 2.0, 1000);
        assert_eq!(on_pass.len() + in_link.len(), 1000);
    }
}
