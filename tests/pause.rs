//! A pause leaves the surface and comes back to the same sample; a run that begins at a pass has the passes of the whole run from there on.

use interp_core::{Command, Inputs, RunStart, Sample, SpanParameter, State};
use job::{AxisLimits, Job, Pattern, Spacing};
use machine::Machine;
use machine::prepare::prepare;

use crate::pass_times::limited;

/// A sample job within limits.
pub(crate) fn sample_job(name: &str, pattern: Pattern, overrun_mm: f64, spacing: Option<Spacing>) -> Job {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let mut job = limited(job_file::load(&path).unwrap(), 50.0);
    job.machine.limits = Some(AxisLimits {
        velocity_mm_s: [100.0, 100.0, 50.0],
        acceleration_mm_s2: [1000.0, 1000.0, 500.0],
        jerk_mm_s3: [20_000.0, 20_000.0, 10_000.0],
    });
    job.pattern = pattern;
    job.overrun_mm = overrun_mm;
    job.spacing = spacing.unwrap_or(job.spacing);
    job
}

/// Jobs with rests, turns and hops between the passes, a region, and passes of constant scallop height.
fn jobs() -> Vec<(String, Job)> {
    let mut jobs = Vec::new();
    for (pattern, overrun_mm) in [
        (Pattern::Zigzag, 0.0),
        (Pattern::Zigzag, 2.0),
        (Pattern::Zig, 0.0),
    ] {
        let job = sample_job("torus", pattern, overrun_mm, None);
        jobs.push((format!("torus {pattern:?} {overrun_mm}"), job));
    }
    jobs.push((
        "region".to_owned(),
        sample_job("region", Pattern::Zigzag, 0.0, None),
    ));
    let constant = sample_job(
        "freeform",
        Pattern::Zigzag,
        0.0,
        Some(Spacing::Constant(job::Start::Edge)),
    );
    jobs.push(("constant".to_owned(), constant));
    jobs
}

const fn at_pass(pass: u32) -> RunStart {
    RunStart {
        pass,
        path: SpanParameter::NONE,
    }
}

/// Samples of a run that begins here.
fn run_from(job: &Job, start: RunStart) -> (Vec<Sample>, AxisLimits) {
    let mut prepared = prepare(job).unwrap();
    prepared.start = start;
    let mut machine = Machine::load(&prepared).unwrap();
    let mut samples = Vec::new();
    machine
        .run(|sample| {
            samples.push(*sample);
            true
        })
        .unwrap();
    assert_eq!(machine.state(), State::Finished);
    (samples, job.machine.limits.unwrap())
}

/// First and last sample of each pass on the surface.
fn ends(samples: &[Sample]) -> Vec<[Sample; 2]> {
    let mut ends: Vec<[Sample; 2]> = Vec::new();
    for sample in samples.iter().filter(|sample| sample.state == State::Running) {
        match ends.last_mut() {
            Some(pass) if pass[0].pass == sample.pass => pass[1] = *sample,
            _ => ends.push([*sample; 2]),
        }
    }
    ends
}

fn distance_nm(a: [i32; 3], b: [i32; 3]) -> f64 {
    let square = |(a, b): (i32, i32)| f64::from(a.wrapping_sub(b)).powi(2);
    a.into_iter().zip(b).map(square).sum::<f64>().sqrt()
}

#[test]
fn a_run_that_begins_at_a_pass_has_the_same_passes() {
    for (name, job) in jobs() {
        let (whole, _) = run_from(&job, RunStart::FIRST);
        let all = ends(&whole);
        let last = u32::try_from(all.len()).unwrap() - 1;
        for first in [1, last / 2, last] {
            let (part, _) = run_from(&job, at_pass(first));
            let rest = ends(&part);
            assert!(part.iter().all(|sample| sample.pass >= first), "{name} {first}");
            assert_eq!(rest.len(), all.len() - first as usize, "{name} {first}");
            // In a turn the first sample on a pass lies up to a period's way after its start.
            let most = if job.overrun_mm > 0.0 { 60_000.0 } else { 2.0 };
            for (rest, all) in rest.iter().zip(&all[first as usize..]) {
                for (rest, all) in rest.iter().zip(all) {
                    assert_eq!(rest.pass, all.pass, "{name} {first}");
                    let apart = distance_nm(rest.cl_nm, all.cl_nm);
                    assert!(
                        apart <= most,
                        "{name} {first}: pass {} is {apart} nm off",
                        all.pass
                    );
                    if !matches!(job.spacing, Spacing::Constant(_)) {
                        assert_eq!(rest.side, all.side, "{name} {first}");
                    }
                }
            }
        }
        // One that does not exist is a fault, and nothing moves.
        let mut prepared = prepare(&job).unwrap();
        prepared.start = at_pass(last + 1);
        let mut machine = Machine::load(&prepared).unwrap();
        let fault = machine.run(|_| true).unwrap_err();
        assert_eq!(fault.kind, interp_core::FaultKind::WrongState, "{name}");
    }
}

/// Distance of a place from the line between two samples, nm.
fn beside_nm(pair: &[Sample], at: [i32; 3]) -> f64 {
    let sub = |a: [i32; 3], b: [i32; 3]| [0, 1, 2].map(|axis| f64::from(a[axis]) - f64::from(b[axis]));
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (way, to) = (sub(pair[1].cl_nm, pair[0].cl_nm), sub(at, pair[0].cl_nm));
    let part = (dot(way, to) / dot(way, way).max(1.0)).clamp(0.0, 1.0);
    let rest = [0, 1, 2].map(|axis| to[axis] - part * way[axis]);
    dot(rest, rest).sqrt()
}

/// Greatest distance of places along a path from the polyline through its samples, nm. The line that is nearest to a place is looked for around that of the place
/// before, from this sample of the path on: another one could only be nearer.
fn deepest_nm<'s>(path: &[Sample], mut nearest: usize, places: impl Iterator<Item = &'s Sample>) -> f64 {
    const AROUND: usize = 8;
    let of_place = |place: &Sample| loop {
        let around = nearest.saturating_sub(AROUND)..(nearest + AROUND + 1).min(path.len() - 1);
        let (best, nm) = around
            .map(|line| (line, beside_nm(&path[line..line + 2], place.cl_nm)))
            .min_by(|(_, a), (_, b)| a.total_cmp(b))
            .unwrap();
        if best == nearest {
            break nm;
        }
        nearest = best;
    };
    places.map(of_place).fold(0.0, f64::max)
}

/// Arc of the contact before each sample of a pass, mm.
fn arcs_mm(pass: &[Sample]) -> Vec<f64> {
    let mut arcs = vec![0.0];
    for pair in pass.windows(2) {
        let last = *arcs.last().unwrap();
        arcs.push(last + distance_nm(pair[0].cc_nm, pair[1].cc_nm) * 1e-6);
    }
    arcs
}

#[test]
fn a_run_that_begins_within_a_pass_goes_on_along_it() {
    let mut random = Random(11);
    for (name, job) in jobs() {
        let (whole, limits) = run_from(&job, RunStart::FIRST);
        let all = ends(&whole);
        // Of each pass that is tried, a place anywhere but at its ends.
        for _ in 0..12 {
            let number = u32::try_from(random.below(all.len())).unwrap();
            let on_pass = |sample: &&Sample| sample.pass == number && sample.state == State::Running;
            let pass: Vec<Sample> = whole.iter().filter(on_pass).copied().collect();
            let arcs = arcs_mm(&pass);
            let length = *arcs.last().unwrap();
            let candidates: Vec<usize> = (0..pass.len())
                .filter(|at| arcs[*at] > 0.5 && length - arcs[*at] > 0.5)
                .collect();
            if candidates.is_empty() {
                continue;
            }
            let at = candidates[random.below(candidates.len())];
            let start = RunStart {
                pass: number,
                path: pass[at].path,
            };
            let name = format!("{name}: pass {number}, {:.2} of {length:.2} mm", arcs[at]);
            let (part, _) = run_from(&job, start);
            check_limits(&name, &part, &limits);
            let rest: Vec<Sample> = part.iter().filter(on_pass).copied().collect();
            // To the sample.
            let first = Sample {
                tick: pass[at].tick,
                feed_mm_s: pass[at].feed_mm_s,
                ..rest[0]
            };
            assert_eq!(first, pass[at], "{name}");
            // In front of a turn the last sample on a pass lies up to a period's way before its end, and with a rest there the others come closer to it.
            let end = pass[pass.len() - 1].cl_nm;
            let is_after =
                |sample: &&Sample| job.overrun_mm == 0.0 || distance_nm(sample.cl_nm, end) > 60_000.0;
            let deepest = deepest_nm(&pass, at, rest.iter().filter(is_after));
            // The samples of the whole are joined by chords here: their height, and rounding.
            let chord = |three: &[Sample]| {
                let bent = [0, 1, 2].map(|axis| {
                    let at = |n: usize| f64::from(three[n].cl_nm[axis]);
                    at(0) - 2.0 * at(1) + at(2)
                });
                bent.iter().map(|bent| bent * bent).sum::<f64>().sqrt() / 8.0
            };
            let most = 3.0 + pass.windows(3).map(chord).fold(0.0, f64::max);
            assert!(deepest < most, "{name}: {deepest} nm beside the pass, {most}");
            let got = ends(&part);
            let want = &all[number as usize..];
            assert_eq!(got.len(), want.len(), "{name}");
            let most = if job.overrun_mm > 0.0 { 60_000.0 } else { 2.0 };
            for (got, want) in got.iter().zip(want) {
                let from = usize::from(got[0].pass == number);
                for (got, want) in got.iter().zip(want).skip(from) {
                    let apart = distance_nm(got.cl_nm, want.cl_nm);
                    assert!(apart <= most, "{name}: pass {}, {apart} nm", want.pass);
                    if !matches!(job.spacing, Spacing::Constant(_)) {
                        assert_eq!(got.side, want.side, "{name}");
                    }
                }
            }
        }
        // A place beside the pass is a fault, and nothing moves.
        let mut prepared = prepare(&job).unwrap();
        prepared.start.path = SpanParameter {
            span: u16::MAX - 1,
            fraction: 0,
        };
        let mut machine = Machine::load(&prepared).unwrap();
        let fault = machine.run(|_| true).unwrap_err();
        assert_eq!(fault.kind, interp_core::FaultKind::WrongState, "{name}");
    }
}

/// A place less than a nanometre before the end of a pass is that end: the run begins with the next pass. The planning of the rest had no end.
#[test]
fn a_run_that_begins_at_the_end_of_a_pass_begins_with_the_next() {
    for (name, job) in jobs() {
        let (whole, _) = run_from(&job, at_pass(1));
        let on_pass = |sample: &&Sample| sample.pass == 1 && sample.state == State::Running;
        let pass: Vec<Sample> = whole.iter().filter(on_pass).copied().collect();
        let [start, near_end] = [pass[0].path, pass[pass.len() - 2].path];
        let is_back = (near_end.span, near_end.fraction) < (start.span, start.fraction);
        let path = SpanParameter {
            span: near_end.span,
            fraction: if is_back { 1 } else { u64::MAX - 1 },
        };
        let (samples, _) = run_from(&job, RunStart { pass: 1, path });
        let from_next = ends(&run_from(&job, at_pass(2)).0);
        let got = ends(&samples);
        assert_eq!(got.len(), from_next.len(), "{name}");
        for (got, want) in got.iter().zip(&from_next) {
            assert_eq!(
                (got[0].pass, got[0].cl_nm),
                (want[0].pass, want[0].cl_nm),
                "{name}"
            );
        }
    }
}

/// A linear congruential generator.
struct Random(u64);

impl Random {
    fn below(&mut self, most: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(self.0 >> 33).unwrap() % most
    }
}

/// A machine in a run, this number of periods after its start.
fn begun(job: &Job, periods: usize) -> Machine {
    let mut machine = Machine::load(&prepare(job).unwrap()).unwrap();
    machine.tick(Command::Start);
    for _ in 1..periods {
        machine.tick(Inputs::default());
    }
    machine
}

/// Periods until the machine is held, with all samples, after this command.
fn until_held(machine: &mut Machine, command: Command, samples: &mut Vec<Sample>) {
    samples.push(*machine.tick(command));
    for _ in 0..60_000 {
        if machine.state() == State::Held {
            return;
        }
        samples.push(*machine.tick(Inputs::default()));
    }
    panic!("{command:?} does not come to rest: {:?}", machine.state());
}

/// The rest of a run.
fn rest(machine: &mut Machine, command: Command, samples: &mut Vec<Sample>) {
    samples.push(*machine.tick(command));
    while machine.state().is_under_way() {
        samples.push(*machine.tick(Inputs::default()));
        assert!(samples.len() < 1_000_000);
    }
    assert_eq!(machine.state(), State::Finished, "{:?}", machine.fault());
}

/// The positions of a run, without repetitions.
fn path(samples: &[Sample]) -> Vec<[i32; 3]> {
    let mut path: Vec<_> = samples.iter().map(|sample| sample.cl_nm).collect();
    path.dedup();
    path
}

/// Greatest use of each axis's velocity and acceleration by a run.
fn check_limits(name: &str, samples: &[Sample], limits: &AxisLimits) {
    for axis in 0..3 {
        let at = |n: usize| f64::from(samples[n].cl_nm[axis]) * 1e-6;
        for n in 2..samples.len() {
            let speed = (at(n) - at(n - 1)) / 1e-3;
            let acceleration = (at(n) - 2.0 * at(n - 1) + at(n - 2)) / 1e-6;
            assert!(
                speed.abs() <= 1.001 * limits.velocity_mm_s[axis]
                    && acceleration.abs() <= 1.01 * limits.acceleration_mm_s2[axis] + 4.0,
                "{name}: axis {axis} at sample {n}: {speed} mm/s, {acceleration} mm/s^2"
            );
        }
    }
}

#[test]
fn a_pause_comes_back_to_the_same_sample() {
    let mut random = Random(7);
    for (name, job) in jobs() {
        let (whole, limits) = run_from(&job, RunStart::FIRST);
        let safe_z_nm = prepare(&job).unwrap().header.axes.unwrap().safe_z_nm;
        let places: Vec<usize> = (0..12).map(|_| 1 + random.below(whole.len() - 1)).collect();
        for place in places {
            let name = format!("{name} at {place}");
            // The same run with a hold.
            let mut held = begun(&job, place);
            let mut with_hold = Vec::new();
            until_held(&mut held, Command::Hold, &mut with_hold);
            let stood = *with_hold.last().unwrap();

            let mut paused = begun(&job, place);
            let mut with_pause = Vec::new();
            until_held(&mut paused, Command::Pause, &mut with_pause);
            if stood.cl_nm == whole[whole.len() - 1].cl_nm {
                // In the last moments of the way home it comes to rest there: nothing is left to leave.
                continue;
            }
            assert!(paused.is_lifted(), "{name}");
            let top = *with_pause.last().unwrap();
            let high = stood.cl_nm[2].max(safe_z_nm);
            assert_eq!(top.cl_nm, [stood.cl_nm[0], stood.cl_nm[1], high], "{name}");
            let away = with_pause.len();
            rest(&mut paused, Command::Resume, &mut with_pause);
            check_limits(&name, &with_pause, &limits);
            if stood.path == SpanParameter::NONE && stood.pass == 0 && stood.cc_nm == stood.cl_nm {
                // On the way to a pass: it leads there from above.
                continue;
            }
            let Some(back) = with_pause[away..]
                .iter()
                .position(|sample| sample.cl_nm == stood.cl_nm)
            else {
                // At the end of a pass it goes on to the next one.
                let mut of_pass = whole.iter().rev().filter(|sample| sample.pass == stood.pass);
                let end = of_pass.find(|sample| sample.state == State::Running);
                let is_end = end.is_some_and(|end| end.cl_nm == stood.cl_nm);
                assert!(
                    is_end || stood.cc_nm == stood.cl_nm,
                    "{name}: it does not come back"
                );
                continue;
            };
            let back = away + back;
            if stood.path != SpanParameter::NONE && with_pause[back].state == State::Running {
                let shown = Sample {
                    tick: stood.tick,
                    state: stood.state,
                    feed_mm_s: stood.feed_mm_s,
                    ..with_pause[back]
                };
                assert_eq!(shown, stood, "{name}");
            }
            // Held as long, the run goes on along the same samples.
            while with_hold.len() < back + 1 {
                with_hold.push(*held.tick(Inputs::default()));
            }
            let from = with_hold.len() - 1;
            rest(&mut held, Command::Resume, &mut with_hold);
            if with_hold[from + 1].state == State::Running {
                // At the start of a pass it moves in the period of the resume: where it stood is the pass's first place.
                with_hold[from].state = State::Running;
            }
            // The rest of the pass that it is on, sample by sample.
            let on_pass = |samples: &[Sample]| -> Vec<Sample> {
                let on = |sample: &&Sample| sample.pass == stood.pass && sample.state == State::Running;
                samples.iter().filter(on).copied().collect()
            };
            if stood.path != SpanParameter::NONE && job.overrun_mm == 0.0 {
                let same = path(&on_pass(&with_pause[back..])) == path(&on_pass(&with_hold[from..]));
                assert!(same, "{name}: the rest of the pass");
            }
            // The ways of the pause take planning from the passes after it, so these may be slower; they are the same.
            let (got, want) = (ends(&with_pause[back..]), ends(&with_hold[from..]));
            assert_eq!(got.len(), want.len(), "{name}: passes");
            // In a turn the first sample on a pass lies up to a period's way after its start.
            let most = if job.overrun_mm > 0.0 { 60_000.0 } else { 2.0 };
            for (got, want) in got.iter().zip(&want) {
                for (got, want) in got.iter().zip(want) {
                    let apart = distance_nm(got.cl_nm, want.cl_nm);
                    assert!(apart <= most, "{name}: pass {}, {apart} nm", want.pass);
                }
            }
        }
    }
}

#[test]
fn the_ways_of_a_pause_obey() {
    let job = sample_job("torus", Pattern::Zigzag, 0.0, None);
    let (whole, _) = run_from(&job, RunStart::FIRST);
    let at = whole.iter().position(|sample| sample.pass == 1).unwrap() + 300;
    for ends in [Command::Abort, Command::Stop, Command::Pause, Command::Resume] {
        // Held on its way up, and on its way back.
        for back in [false, true] {
            let name = format!("{ends:?} {back}");
            let mut machine = begun(&job, at);
            let mut samples = Vec::new();
            if back {
                until_held(&mut machine, Command::Pause, &mut samples);
                machine.tick(Command::Resume);
            } else {
                machine.tick(Command::Pause);
            }
            let mut moving = 0;
            while moving < 20 {
                moving += u32::from(machine.tick(Inputs::default()).state == State::Linking);
            }
            until_held(&mut machine, Command::Hold, &mut samples);
            assert!(!machine.is_lifted(), "{name}");
            machine.tick(ends);
            match ends {
                Command::Resume if back => {
                    while machine.state().is_under_way() {
                        machine.tick(Inputs::default());
                    }
                    assert_eq!(machine.state(), State::Finished, "{name}");
                }
                Command::Resume | Command::Pause => {
                    while machine.state() != State::Held {
                        machine.tick(Inputs::default());
                    }
                    assert!(machine.is_lifted(), "{name}");
                    rest(&mut machine, Command::Resume, &mut samples);
                }
                _ => {
                    while machine.state().is_under_way() {
                        machine.tick(Inputs::default());
                    }
                    assert_eq!(machine.state(), State::Ready, "{name}");
                }
            }
        }
    }
}
