//! Turns beyond the boundary between the passes of zigzag jobs (`overrun_mm`), on the core itself.

use interp_core::{Command, Header, Inputs, Interpolator, Sample, State};
use job::{AxisLimits, Job};
use machine::prepare::{Prepared, prepare};
use oracle::Oracle;
use std::collections::VecDeque;

/// Periods over which differences are taken for the jerk: noise of a nanometre is much of it over one.
const BASE: usize = 4;

/// A sample job with turns that overrun by so much, at this feed.
fn job_of(name: &str, feed_mm_min: f64, overrun_mm: f64) -> (Job, Prepared) {
    let jobs = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../jobs");
    let mut job = job_file::load(&jobs.join(format!("{name}.toml"))).unwrap();
    job.pattern = job::Pattern::Zigzag;
    job.feed_mm_min = feed_mm_min;
    job.overrun_mm = overrun_mm;
    job.machine.limits = Some(AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
    });
    let prepared = prepare(&job).unwrap();
    (job, prepared)
}

fn machine_of(prepared: &Prepared) -> Box<Interpolator> {
    let mut core: Box<Interpolator> = Box::new(Interpolator::new());
    core.load_begin(&prepared.header, u32::try_from(prepared.words.len()).unwrap())
        .unwrap();
    core.load_words(0, &prepared.words).unwrap();
    for record in 0..core.load_records() {
        core.load_check(record).unwrap();
    }
    core.load_finish().unwrap();
    core
}

fn period(core: &mut Interpolator, inputs: impl Into<Inputs>) -> Sample {
    let sample = *core.tick(inputs);
    core.plan();
    sample
}

/// Greatest uses of velocity, acceleration and jerk.
struct Limits<'a> {
    header: &'a Header,
    last: VecDeque<[i32; 3]>,
    worst: [f64; 3],
}

impl<'a> Limits<'a> {
    fn new(header: &'a Header) -> Self {
        Self {
            header,
            last: VecDeque::new(),
            worst: [0.0; 3],
        }
    }

    fn add(&mut self, sample: &Sample) {
        self.last.push_front(sample.cl_nm);
        self.last.truncate(3 * BASE + 1);
        let axes = self.header.axes.as_ref().unwrap();
        let period_s = f64::from(self.header.period_s);
        for axis in 0..3 {
            let at = |back: usize| f64::from(self.last.get(back).or(self.last.back()).unwrap()[axis]);
            let base_s = BASE as f64 * period_s;
            // Rounding of the positions: half a nanometre each.
            let of = |nm: f64, rounding: f64, s: f64| (nm.abs() - rounding).max(0.0) * 1e-6 / s;
            let jerk = at(0) - 3.0 * at(BASE) + 3.0 * at(2 * BASE) - at(3 * BASE);
            let uses = [
                of(at(0) - at(1), 1.0, period_s) / f64::from(axes.velocity_mm_s[axis]),
                of(at(0) - 2.0 * at(1) + at(2), 2.0, period_s.powi(2))
                    / f64::from(axes.acceleration_mm_s2[axis]),
                of(jerk, 4.0, base_s.powi(3)) / f64::from(axes.jerk_mm_s3[axis]),
            ];
            for (worst, used) in self.worst.iter_mut().zip(uses) {
                *worst = worst.max(used);
            }
        }
    }

    fn check(&self, what: &str) {
        let [velocity, acceleration, jerk] = self.worst;
        assert!(
            velocity <= 1.0005 && acceleration <= 1.0 && jerk <= 1.02,
            "{what}: {:?} of the limits",
            self.worst
        );
    }
}

/// All samples of a run.
fn run(prepared: &Prepared, what: &str) -> Vec<Sample> {
    let mut core = machine_of(prepared);
    let mut limits = Limits::new(&prepared.header);
    let mut samples = Vec::new();
    let mut sample = period(&mut core, Command::Start);
    while sample.state.is_under_way() {
        limits.add(&sample);
        samples.push(sample);
        sample = period(&mut core, None);
    }
    assert_eq!((sample.state, core.fault()), (State::Finished, None), "{what}");
    limits.check(what);
    samples
}

/// Periods from the first contact to the last.
fn contact(samples: &[Sample]) -> usize {
    let on = |sample: &Sample| sample.state == State::Running;
    let first = samples.iter().position(on).unwrap();
    samples.iter().rposition(on).unwrap() - first
}

/// Samples of turns: between passes, not on the way from and to home.
fn turns(samples: &[Sample]) -> Vec<&Sample> {
    let on = |sample: &Sample| sample.state == State::Running;
    let first = samples.iter().position(on).unwrap();
    let last = samples.iter().rposition(on).unwrap();
    samples[first..last]
        .iter()
        .filter(|sample| sample.state == State::Linking)
        .collect()
}

/// With turns a job takes less time, holds every limit, does not stand between its passes, overruns by no more than it may, and cuts nothing that is
/// part of the surface.
#[test]
fn turns_take_less_time_and_gouge_nothing() {
    for (name, feed_mm_min, overrun_mm) in [
        ("torus", 3600.0, 2.0),
        ("plate_machine", 6000.0, 2.0),
        ("torus", 3600.0, 0.4),
    ] {
        let what = format!("{name} {feed_mm_min} {overrun_mm}");
        let (job, prepared) = job_of(name, feed_mm_min, overrun_mm);
        let samples = run(&prepared, &what);
        let (_, rests) = job_of(name, feed_mm_min, 0.0);
        let rested = run(&rests, &what);
        let passes = |samples: &[Sample]| samples.iter().map(|sample| sample.pass).max().unwrap();
        assert_eq!(passes(&samples), passes(&rested), "{what}");
        let saved = contact(&rested) - contact(&samples);
        assert!(
            saved > 20 * passes(&samples) as usize,
            "{what}: {saved} periods saved"
        );
        check_turns(&job, &turns(&samples), overrun_mm, &what);
    }
}

/// The centre of each sample stays as far from the surface as its radius, and within the overrun of the boundary.
fn check_turns(job: &Job, turns: &[&Sample], overrun_mm: f64, what: &str) {
    let oracle = Oracle::new(job).unwrap();
    let [low, high] = oracle.path_range();
    let [first, last] = oracle.side_range();
    const ROWS: usize = 60;
    const COLUMNS: usize = 400;
    let share = |index: usize, count: usize| index as f64 / count as f64;
    // The strips of the surface next to its boundaries, and the boundaries of the offset surface.
    let (mut strip, mut rim) = (Vec::new(), Vec::new());
    for column in 0..=COLUMNS {
        let side = first + (last - first) * share(column, COLUMNS);
        for row in 0..=ROWS {
            for from_end in [false, true] {
                let by = 0.1 * (high - low) * share(row, ROWS);
                let path = if from_end { high - by } else { low + by };
                let (u, v) = oracle.swapped(path, side);
                let contact = oracle.contact(u, v).unwrap();
                strip.push(contact.cc_mm);
                if row == 0 {
                    rim.push(contact.cl_mm);
                }
            }
        }
    }
    let mut beyond_most = 0.0_f64;
    for sample in turns.iter().step_by(7) {
        let centre = glam::DVec3::from(sample.cl_nm.map(f64::from)) * 1e-6;
        let nearest = |points: &[glam::DVec3]| {
            points
                .iter()
                .map(|point| point.distance_squared(centre))
                .fold(f64::INFINITY, f64::min)
                .sqrt()
        };
        let apart = nearest(&strip);
        assert!(
            apart > job.radius_mm - 2e-3,
            "{what}: {apart} mm from the surface"
        );
        beyond_most = beyond_most.max(nearest(&rim));
    }
    // The distance from the nearest point of the grid on the rim is longer by at most the grid.
    assert!(
        beyond_most <= overrun_mm + 0.3,
        "{what}: {beyond_most} mm beyond the boundary"
    );
    assert!(
        beyond_most > 0.5 * overrun_mm.min(0.4),
        "{what}: {beyond_most} mm"
    );
}

/// Hold, resume and override in any period, also in turns: every limit is held, and every run comes to its end.
#[test]
fn commands_in_turns_hold_the_limits() {
    let (_, prepared) = job_of("torus", 6000.0, 2.0);
    let mut in_turns = 0;
    for seed in 1..=10_u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut random = |below: u64| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 20) % below
        };
        let mut core = machine_of(&prepared);
        let mut limits = Limits::new(&prepared.header);
        let mut sample = period(&mut core, Command::Start);
        let (mut left, mut feed_override) = (random(300), 100);
        for _ in 0..1_000_000 {
            if !sample.state.is_under_way() {
                break;
            }
            limits.add(&sample);
            let mut command = None;
            if left == 0 {
                let most = if random(2) == 0 { 60 } else { 900 };
                left = random(most);
                in_turns += u32::from(sample.state == State::Linking);
                match random(10) {
                    0..=3 => command = Some(Command::Hold),
                    4..=6 => command = Some(Command::Resume),
                    _ => feed_override = u8::try_from(random(201)).unwrap(),
                }
            }
            // Neither a hold nor an override of 0 lasts for ever.
            if sample.state == State::Held && random(100) == 0 {
                command = Some(Command::Resume);
            }
            if feed_override == 0 && random(100) == 0 {
                feed_override = 100;
            }
            left = left.saturating_sub(1);
            sample = period(
                &mut core,
                Inputs {
                    command,
                    feed_override,
                },
            );
        }
        assert_eq!(
            (sample.state, core.fault()),
            (State::Finished, None),
            "seed {seed}"
        );
        limits.check(&format!("seed {seed}"));
    }
    assert!(in_turns > 20, "{in_turns} commands in turns");
}

/// A stop in a turn ends within the limits at the safe height.
#[test]
fn a_stop_in_a_turn_retracts() {
    let (_, prepared) = job_of("torus", 3600.0, 2.0);
    let safe_z_nm = prepared.header.axes.unwrap().safe_z_nm;
    for wait in [0, 20, 45, 70] {
        let mut core = machine_of(&prepared);
        let mut limits = Limits::new(&prepared.header);
        let mut sample = period(&mut core, Command::Start);
        let mut since = None;
        for n in 0..100_000 {
            limits.add(&sample);
            if since.is_none() && sample.pass == 1 && sample.state == State::Linking {
                since = Some(n);
            }
            let command = since.filter(|since| n == since + wait).map(|_| Command::Stop);
            sample = period(&mut core, command);
            if !sample.state.is_under_way() {
                break;
            }
        }
        assert_eq!(sample.state, State::Ready, "{wait}");
        assert_eq!(sample.cl_nm[2], safe_z_nm, "{wait}");
        limits.check(&format!("stop after {wait}"));
    }
}
