//! Jobs that are larger than the store: whatever the size of the ring of rows, and however late the rows come, the samples are those of a job that was there as a whole.

mod in_qemu;
mod over_line;
mod regions;
mod turns;

use interp_core::job::stream::{head_words, row_words};
use interp_core::{Command, Interpolator, Sample, State};
use job::Job;
use machine::Machine;
use machine::prepare::{Prepared, prepare, streamed};
use machine::remote::drive::Expected;
use protocol::digest::Digest;

const LIMITS: &str = "
[machine]
velocity_max_mm_s = [100, 100, 50]
acceleration_max_mm_s2 = [1000, 1000, 500]
jerk_max_mm_s3 = [20000, 20000, 10000]
clearance_mm = 1
plunge_mm = 0.5
";

/// A bumpy surface of `[along, across]` patches of this size, mm.
pub(crate) fn bumpy(patches: [usize; 2], size_mm: [f64; 2], cut: &str, machine: &str) -> Job {
    let knots = |spans: usize| {
        let inner = (0..=spans).map(|knot| knot.to_string());
        let start = vec!["0".to_owned(); 3];
        let end = vec![spans.to_string(); 3];
        [start, inner.collect(), end].concat().join(", ")
    };
    // Of a linear parametrisation, so that patches are equally large.
    let greville = |pole: usize, spans: usize| {
        let knot = |k: usize| (k.saturating_sub(3)).min(spans) as f64;
        (knot(pole + 1) + knot(pole + 2) + knot(pole + 3)) / 3.0
    };
    let [u, v] = patches;
    let row = |i: usize| {
        let poles = (0..v + 3).map(|j| {
            let (x, y) = (greville(i, u) * size_mm[0], greville(j, v) * size_mm[1]);
            let z = 0.6 * (0.35 * x).sin() * (0.4 * y + 0.1 * x).cos() + 0.01 * x * y / (1.0 + y);
            format!("[{x:.6}, {y:.6}, {z:.6}]")
        });
        format!("[{}]", poles.collect::<Vec<_>>().join(", "))
    };
    let poles = (0..u + 3).map(row).collect::<Vec<_>>().join(",\n");
    let text = format!(
        "[surface]\nkind = \"nurbs\"\ndegree = [3, 3]\nknots_u = [{}]\nknots_v = [{}]\npoles_mm = [{poles}]\n\n\
         [tool]\nkind = \"ball\"\nradius_mm = 2\n\n\
         [cut]\nfeed_mm_min = 2400\nalong = \"u\"\nside = \"up\"\n{cut}\n{machine}",
        knots(u),
        knots(v)
    );
    job_file::parse("bumpy.toml", &text).unwrap()
}

/// A core that is given a job while it runs.
struct Streamed<'a> {
    core: Interpolator<Vec<i32>>,
    words: &'a [i32],
    record: u32,
}

impl<'a> Streamed<'a> {
    fn new(job: &'a Prepared, capacity: usize) -> Self {
        let mut core = Interpolator::with_store(vec![0; capacity]);
        core.load_begin(&job.header, u32::try_from(job.words.len()).unwrap())
            .unwrap();
        Self {
            core,
            words: &job.words,
            record: 0,
        }
    }

    /// Sends at most `most` words, and checks the records that are complete. Returns whether any word could be sent.
    fn send(&mut self, most: usize) -> bool {
        let [received, limit] = self.core.load_room();
        let (from, to) = (received as usize, (limit as usize).min(received as usize + most));
        for (chunk, words) in self.words[from..to].chunks(50).enumerate() {
            let offset = u32::try_from(from + 50 * chunk).unwrap();
            self.core.load_words(offset, words).unwrap();
        }
        while self.core.load_check(self.record).is_ok() {
            self.record += 1;
        }
        to > from
    }

    /// Runs it to its end; `late` is the number of starved ticks before anything is sent, none for words all the time.
    fn run(&mut self, late: Option<u32>) -> Outcome {
        while self.send(1000) {}
        self.core.load_finish().unwrap();
        let mut outcome = Outcome::default();
        let mut digest = Digest::new();
        let mut command = Some(Command::Start);
        let (mut waits, mut waits_after) = (0, None);
        loop {
            let sample = *self.core.tick(command.take());
            let is_starved = self.core.is_starved();
            self.core.plan();
            if !matches!(sample.state, State::Running | State::Linking) {
                break;
            }
            if is_starved {
                // Never in the cut: at rest within limits, else between two passes.
                let is_at_rest = outcome.last.feed_mm_s == 0.0;
                assert!(is_at_rest || !self.core.has_limits(), "{:?}", outcome.last);
                waits_after = Some(outcome.last.pass).filter(|_| !self.core.has_limits());
                outcome.starved += 1;
                waits += 1;
                assert!(waits < 10_000, "it waits for ever: {:?}", self.core.load_room());
            } else {
                waits = 0;
                assert!(waits_after.take().is_none_or(|pass| sample.pass == pass + 1));
                digest.sample(&sample);
                outcome.samples += 1;
                outcome.last = sample;
            }
            match late {
                None => _ = self.send(40),
                Some(late) if waits >= late => while self.send(1000) {},
                Some(_) => {}
            }
        }
        outcome.digest = digest.value();
        assert_eq!(self.core.fault(), None, "{:?}", self.core.surface_position());
        assert_eq!(self.core.state(), State::Finished);
        outcome
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Outcome {
    digest: u64,
    samples: u32,
    starved: u32,
    last: Sample,
}

/// The samples of the job, stored as a whole.
fn whole(job: &Prepared) -> Outcome {
    let mut core = Interpolator::with_store(vec![0; job.words.len()]);
    let words = u32::try_from(job.words.len()).unwrap();
    core.load_begin(&job.header, words).unwrap();
    core.load_words(0, &job.words).unwrap();
    for record in 0..core.load_records() {
        core.load_check(record).unwrap();
    }
    core.load_finish().unwrap();
    let mut outcome = Outcome::default();
    let mut digest = Digest::new();
    let mut command = Some(Command::Start);
    loop {
        let sample = *core.tick(command.take());
        core.plan();
        assert!(!core.is_starved());
        if !matches!(sample.state, State::Running | State::Linking) {
            break;
        }
        digest.sample(&sample);
        outcome.samples += 1;
        outcome.last = sample;
    }
    outcome.digest = digest.value();
    assert_eq!(core.state(), State::Finished, "{:?}", core.fault());
    outcome
}

/// Words of the store for a number of rows.
fn room(job: &Prepared, rows: usize) -> usize {
    head_words(&job.header) + rows * row_words(&job.header)
}

const CUTS: [(&str, &str); 6] = [
    ("scallop_mm = 0.02\npattern = \"zig\"", ""),
    ("scallop_mm = 0.02\npattern = \"zigzag\"", ""),
    (
        "scallop_mm = 0.02\npattern = \"zig\"\nspacing = \"first-order\"",
        "",
    ),
    ("scallop_mm = 0.02\npattern = \"zig\"", LIMITS),
    ("scallop_mm = 0.02\npattern = \"zigzag\"", LIMITS),
    (
        "scallop_mm = 0.02\npattern = \"zigzag\"\nspacing = \"first-order\"",
        LIMITS,
    ),
];

/// Rows of 2 mm and intervals of about 0.5 mm: the window does not change the passes, so the run is that of the job that is no stream, too.
#[test]
fn a_streamed_run_is_the_whole_one() {
    for (cut, machine) in CUTS {
        let job = prepare(&bumpy([5, 9], [3.0, 2.0], cut, machine)).unwrap();
        assert_eq!(job.header.window, 0);
        let wanted = whole(&job);
        let job = streamed(&job, 3);
        assert_eq!(whole(&job), wanted, "{cut}, all rows");
        for rows in [3, 4, 6] {
            for late in [None, Some(1), Some(7)] {
                let mut streamed = Streamed::new(&job, room(&job, rows));
                let outcome = streamed.run(late);
                println!("{cut} {rows} rows, late {late:?}: {} starved", outcome.starved);
                assert!(late.is_none() || outcome.starved > 0);
                assert_eq!(
                    Outcome {
                        starved: 0,
                        ..outcome
                    },
                    wanted,
                    "{cut}, {rows} rows, late {late:?}"
                );
            }
        }
    }
}

/// Rows of half an interval: the window cuts intervals short, in the same way whatever the ring.
#[test]
fn narrow_rows() {
    for (cut, machine) in CUTS {
        for window in [3, 4, 7] {
            let job = prepare(&bumpy([3, 40], [5.0, 0.2], cut, machine)).unwrap();
            let job = streamed(&job, window);
            let wanted = whole(&job);
            for rows in [usize::from(window), usize::from(window) + 2] {
                for late in [None, Some(3)] {
                    let outcome = Streamed::new(&job, room(&job, rows)).run(late);
                    assert_eq!(
                        Outcome {
                            starved: 0,
                            ..outcome
                        },
                        wanted,
                        "{cut}, window {window}, {rows} rows, late {late:?}"
                    );
                }
            }
        }
    }
}

/// Passes of the job as a whole, as the host computes them.
fn expected(job: &Prepared) -> Vec<Expected> {
    let mut passes: Vec<Expected> = Vec::new();
    let mut digest = Digest::new();
    let each = |sample: &Sample| {
        if passes.len() <= sample.pass as usize {
            passes.push(Expected {
                first_tick: sample.tick,
                samples: 0,
                digest: 0,
            });
        }
        digest.sample(sample);
        let pass = passes.last_mut().unwrap();
        pass.samples += 1;
        pass.digest = digest.value();
        true
    };
    Machine::load(job).unwrap().run(each).unwrap();
    passes
}

/// Rows of an interval or two: where the tool does not go along the boundary to the next pass, three rows are enough for the passes of the whole job.
#[test]
fn rows_of_an_interval() {
    for (cut, machine) in &CUTS[..4] {
        let job = prepare(&bumpy([4, 24], [4.0, 0.6], cut, machine)).unwrap();
        let wanted = whole(&job);
        let job = streamed(&job, 3);
        for late in [None, Some(2)] {
            let outcome = Streamed::new(&job, room(&job, 3)).run(late);
            assert_eq!(
                Outcome {
                    starved: 0,
                    ..outcome
                },
                wanted,
                "{cut}, late {late:?}"
            );
        }
    }
}
