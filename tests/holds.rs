//! How long a hold takes: from the command to rest, at random times of sample jobs, at several feeds.

use interp_core::{Command, Inputs, State};
use job::{AxisLimits, Pattern};
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

fn holds(name: &str, feed_mm_min: f64, pattern: Pattern, overrun_mm: f64, count: usize) -> Holds {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let mut job = limited(job_file::load(&path).unwrap(), feed_mm_min / 60.0);
    job.machine.limits = Some(AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
    });
    job.pattern = pattern;
    job.overrun_mm = overrun_mm;
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
        let mut at = machine.tick(command).state;
        for _ in 0..wait {
            if !at.is_under_way() {
                machine.tick(Command::Start);
            }
            at = machine.tick(Inputs::default()).state;
        }
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

#[test]
#[ignore = "campaign"]
fn holds_stand_soon() {
    let count = std::env::var("ISOFEED_HOLDS").map_or(150, |count| count.parse().unwrap());
    let mut all = Vec::new();
    for (name, feeds) in [
        ("freeform", &[1800.0, 3600.0, 6000.0][..]),
        ("plate_v", &[3600.0, 6000.0]),
        ("torus", &[3600.0, 6000.0]),
        ("sphere_cap", &[1200.0, 6000.0]),
        ("ruled_printed", &[3600.0, 6000.0]),
        ("revolved", &[6000.0]),
    ] {
        for feed in feeds {
            for (pattern, overrun) in [
                (Pattern::Zigzag, 0.0),
                (Pattern::Zigzag, 2.0),
                (Pattern::Zig, 0.0),
            ] {
                let Holds {
                    mut on_pass,
                    mut in_link,
                } = holds(name, *feed, pattern, overrun, count);
                on_pass.sort_unstable();
                in_link.sort_unstable();
                let at = |list: &Vec<u32>, part: f64| {
                    list.get((list.len().saturating_sub(1) as f64 * part) as usize)
                        .copied()
                        .unwrap_or(0)
                };
                println!(
                    "{name:<14} {feed:>5} {pattern:?} {overrun}: pass {} {:>4} {:>4} {:>4} ms, link {} {:>4} {:>4} {:>4} ms",
                    on_pass.len(),
                    at(&on_pass, 0.5),
                    at(&on_pass, 0.9),
                    at(&on_pass, 1.0),
                    in_link.len(),
                    at(&in_link, 0.5),
                    at(&in_link, 0.9),
                    at(&in_link, 1.0),
                );
                all.extend(on_pass);
            }
        }
    }
    all.sort_unstable();
    let at = |part: f64| all[((all.len() - 1) as f64 * part) as usize];
    println!("{} holds: {} {} {} ms", all.len(), at(0.5), at(0.9), at(1.0));
}
