//! Resume after a power cut: at random ticks, as often as it takes, on a machine whose carriages follow the pulses. The path is complete in the end, and nothing
//! is cut twice but the last moments before a cut whose supply lasted for a record; else the pass that was cut short.

use std::collections::HashMap;

use controller::in_process::Board;
use integration_tests::{HELLO, Host, PROFILE, upload};
use interp_core::{RunStart, Sample, SpanParameter, State, steps::AxisSteps, steps::StepConfig};
use job::{Job, Pattern};
use machine::prepare::{Prepared, prepare};
use protocol::digest::job_digest;
use protocol::message::{
    InputLines, JobName, Journal, Offsets, Profile, Reason, Reply, Request, Status, job_mark,
};

use crate::pause::sample_job;

/// Nanometres of a step.
pub(crate) const STEP_NM: i32 = 2_500;

fn steps() -> StepConfig {
    let axis = AxisSteps {
        steps: 400,
        mm: 1,
        inverted: false,
    };
    StepConfig {
        axes: [axis; 3],
        pulse_slots: 1,
        setup_slots: 5,
    }
}

pub(crate) fn profile(job: &Job) -> Profile {
    let limits = job.machine.limits.unwrap();
    let [velocity_mm_s, acceleration_mm_s2, jerk_mm_s3] =
        [limits.velocity_mm_s, limits.acceleration_mm_s2, limits.jerk_mm_s3]
            .map(|limits| limits.map(|limit| limit as f32));
    Profile {
        steps: steps().into(),
        velocity_mm_s,
        acceleration_mm_s2,
        jerk_mm_s3,
        ..PROFILE
    }
}

/// A board and its carriages.
pub(crate) struct Bench {
    host: Host,
    pub(crate) board: Box<Board>,
    /// The carriages at power-up, and after the last ticks: the pulses lag by two.
    pub(crate) start: [i32; 3],
    recent: [[i32; 3]; 3],
    /// Where they were in a run, and whether for certain on a pass: the samples lead by two periods.
    places: HashMap<[i32; 3], bool>,
    /// Samples on a pass since the last one that was not.
    running: u32,
    samples: u32,
    /// The last sample, and all of those on passes.
    last: Sample,
    pub(crate) trail: Vec<Sample>,
}

impl Bench {
    pub(crate) fn new(mut board: Box<Board>, start: [i32; 3]) -> Self {
        // As the firmware does before the link's first byte.
        let steps = steps().check().unwrap();
        board.real_time().set_step_pins(steps, [0, 1, 2]);
        let mut bench = Self {
            host: Host::default(),
            board,
            start,
            recent: [start; 3],
            places: HashMap::new(),
            running: 0,
            samples: 0,
            last: Sample::default(),
            trail: Vec::new(),
        };
        bench.board.receive(&bench.host.next(&HELLO));
        bench.board.take_sent();
        bench
    }

    /// A board of a machine with this profile, at the home of the job, which is loaded.
    pub(crate) fn loaded(prepared: &Prepared, profile: Profile) -> Self {
        let start = prepared.header.axes.unwrap().home_nm.map(|nm| nm / STEP_NM);
        Self::loaded_at(start, prepared, profile)
    }

    /// As [`Self::loaded`], with the carriages here.
    pub(crate) fn loaded_at(start: [i32; 3], prepared: &Prepared, profile: Profile) -> Self {
        let mut bench = Self::new(Box::new(Board::new()), start);
        bench.ask(&Request::SetProfile(Some(profile)));
        let home_nm = bench.home();
        bench.load(prepared, home_nm);
        bench
    }

    /// Stores the loaded job as "left", to begin anywhere.
    pub(crate) fn store(&mut self) {
        self.ask(&Request::StoreJob {
            name: JobName::try_from("left").unwrap(),
            begins_anywhere: true,
        });
    }

    /// Cuts the power: pulses that are not emitted yet are lost.
    pub(crate) fn cut(self, slowly: bool) -> Self {
        let board = if slowly {
            self.board.power_cycle_slowly()
        } else {
            self.board.power_cycle()
        };
        let mut next = Self::new(Box::new(board), self.recent[0]);
        (next.places, next.samples, next.trail) = (self.places, self.samples, Vec::new());
        next
    }

    pub(crate) fn answer(&mut self, request: &Request) -> Reply {
        self.board.receive(&self.host.next(request));
        let sent = self.board.take_sent();
        let reply = self.host.read(&sent).pop().unwrap();
        for _ in 0..4 {
            self.tick();
        }
        reply
    }

    pub(crate) fn ask(&mut self, request: &Request) {
        let reply = self.answer(request);
        assert!(matches!(reply, Reply::Ack { .. }), "{request:?}: {reply:?}");
    }

    pub(crate) fn journal(&mut self) -> Option<Journal> {
        match self.answer(&Request::Journal) {
            Reply::Journal { journal, .. } => journal,
            other => panic!("{other:?}"),
        }
    }

    /// One period; returns the status after it.
    pub(crate) fn tick(&mut self) -> Status {
        let before = self.recent[0];
        self.board.tick();
        self.board.take_sent();
        let done = self.board.carriages();
        let [_, second, third] = self.recent;
        self.recent = [
            second,
            third,
            core::array::from_fn(|axis| self.start[axis] + done[axis]),
        ];
        let status = self.board.status();
        self.last = *self.board.real_time().last();
        if status.state == State::Running {
            self.trail.push(self.last);
            self.samples += 1;
            self.running += 1;
        } else {
            self.running = 0;
        }
        if status.state.is_under_way() {
            self.mark(before, self.recent[0], self.running > 3);
        }
        status
    }

    /// Notes each place from one to another.
    fn mark(&mut self, from: [i32; 3], to: [i32; 3], is_on_pass: bool) {
        let parts = (0..3)
            .map(|axis| (to[axis] - from[axis]).abs())
            .max()
            .unwrap()
            .max(1);
        for part in 0..=parts {
            let at = core::array::from_fn(|axis| from[axis] + (to[axis] - from[axis]) * part / parts);
            *self.places.entry(at).or_insert(false) |= is_on_pass;
        }
    }

    /// Drives on, and homed where the carriages stand: as homing by switches would.
    pub(crate) fn home(&mut self) -> [i32; 3] {
        self.ask(&Request::Drives { on: true });
        let home_nm = self.recent[2].map(|steps| steps * STEP_NM);
        self.ask(&Request::SetHome { home_nm });
        home_nm
    }

    /// Loads the job, which begins where the axes stand.
    pub(crate) fn load(&mut self, prepared: &Prepared, home_nm: [i32; 3]) {
        let mut header = prepared.header;
        header.axes.as_mut().unwrap().home_nm = home_nm;
        for request in upload(header, &prepared.words) {
            self.board.receive(&self.host.next(&request));
            let sent = self.board.take_sent();
            let reply = self.host.read(&sent).pop().unwrap();
            assert!(matches!(reply, Reply::Ack { .. }), "{request:?}: {reply:?}");
        }
    }

    /// Places on passes here at which another's carriages never were.
    pub(crate) fn missing_in(&self, other: &Self) -> usize {
        let on_pass = self.places.iter().filter(|(_, is_on_pass)| **is_on_pass);
        on_pass.filter(|(at, _)| !is_near(&other.places, **at)).count()
    }

    /// Some periods after a run.
    pub(crate) fn rest(&mut self) {
        for _ in 0..10 {
            self.tick();
        }
    }

    /// Runs for this number of periods, or to the end.
    pub(crate) fn run(&mut self, periods: u32) -> State {
        for _ in 0..periods {
            let state = self.tick().state;
            if !state.is_under_way() && state != State::Ready {
                return state;
            }
        }
        self.board.status().state
    }
}

fn random(seed: &mut u64, below: u32) -> u32 {
    *seed = seed
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    u32::try_from((*seed >> 33) % u64::from(below)).unwrap()
}

/// Whether one of these places is within two steps on each axis.
fn is_near(places: &HashMap<[i32; 3], bool>, at: [i32; 3]) -> bool {
    // The nearest first: most are the same place.
    const NEAR: [i32; 5] = [0, -1, 1, -2, 2];
    NEAR.iter().any(|x| {
        NEAR.iter().any(|y| {
            NEAR.iter()
                .any(|z| places.contains_key(&[at[0] + x, at[1] + y, at[2] + z]))
        })
    })
}

/// The samples of a whole run on its passes, with the arc of the contact before each within its pass, mm.
struct Whole(Vec<(Sample, f64)>);

impl Whole {
    fn new(trail: &[Sample]) -> Self {
        let mut samples: Vec<(Sample, f64)> = Vec::new();
        for sample in trail {
            let arc = match samples.last() {
                Some((last, arc)) if last.pass == sample.pass => arc + apart_mm(last.cc_nm, sample.cc_nm),
                _ => 0.0,
            };
            samples.push((*sample, arc));
        }
        Self(samples)
    }

    /// The arc at a place, to a sample, mm; that of the end of the pass before where it is the start of one.
    fn arc(&self, pass: u32, path: SpanParameter) -> f64 {
        let on_pass = self.0.iter().filter(|(sample, _)| sample.pass == pass);
        let key = |path: SpanParameter| f64::from(path.span) + path.fraction as f64 / 2f64.powi(64);
        let apart = |(sample, _): &&(Sample, f64)| (key(sample.path) - key(path)).abs();
        on_pass
            .min_by(|a, b| apart(a).total_cmp(&apart(b)))
            .map_or(0.0, |(_, arc)| *arc)
    }

    fn length(&self, pass: u32) -> f64 {
        let on_pass = self.0.iter().rfind(|(sample, _)| sample.pass == pass);
        on_pass.map_or(0.0, |(_, arc)| *arc)
    }

    /// What is machined again after a cut at this sample and a resume here, mm.
    fn again_mm(&self, cut: &Sample, resumed: RunStart) -> f64 {
        let arc = |pass, path| self.arc(pass, path);
        let at_cut = match cut.path {
            // Off the passes: after the last one.
            SpanParameter::NONE => return self.length(resumed.pass) - arc(resumed.pass, resumed.path),
            path => arc(cut.pass, path),
        };
        match resumed.within() {
            None if resumed.pass == cut.pass => at_cut,
            None => at_cut + self.length(resumed.pass),
            Some(path) if resumed.pass == cut.pass => at_cut - arc(resumed.pass, path),
            Some(path) => at_cut + self.length(resumed.pass) - arc(resumed.pass, path),
        }
    }
}

fn apart_mm(a: [i32; 3], b: [i32; 3]) -> f64 {
    let square = |(a, b): (i32, i32)| (f64::from(a) - f64::from(b)).powi(2);
    a.into_iter().zip(b).map(square).sum::<f64>().sqrt() * 1e-6
}

/// What is machined again after a cut whose supply lasted for a record: the way of 150 periods, of the periods until the board is at it again, and the last half millimetre
/// of a pass, whose places are not noted.
fn again_max_mm(job: &Job) -> f64 {
    job.feed_mm_s() * 0.155 + 0.55
}

/// Longest way machined again, mm, after cuts with and without time for a record.
#[derive(Debug, Default)]
struct Again {
    with_mm: f64,
    without_mm: f64,
}

#[test]
fn a_run_is_complete_after_power_cuts_at_random_ticks() {
    let mut seed = 5;
    for (name, pattern, overrun_mm) in [
        ("torus", Pattern::Zigzag, 0.0),
        ("torus", Pattern::Zigzag, 2.0),
        ("region", Pattern::Zig, 0.0),
    ] {
        let job = sample_job(name, pattern, overrun_mm, None);
        let prepared = prepare(&job).unwrap();
        let mark = job_mark(&prepared.header, job_digest(&prepared.words));
        let begin = || {
            let mut bench = Bench::loaded(&prepared, profile(&job));
            assert_eq!(bench.journal(), None);
            bench.ask(&Request::Start);
            bench
        };
        let mut whole = begin();
        assert_eq!(whole.run(u32::MAX), State::Finished);
        whole.rest();
        assert!(whole.journal().unwrap().is_finished);
        let on_passes = Whole::new(&whole.trail);

        let mut bench = begin();
        let mut again = Again::default();
        let (mut cuts, mut within) = (0, 0);
        let mut place = RunStart::FIRST;
        while cuts < 40 {
            let periods = 500 + random(&mut seed, whole.samples / 8);
            if bench.run(periods) == State::Finished {
                break;
            }
            cuts += 1;
            let (last, was_on_pass) = (bench.last, bench.running > 0);
            let slowly = random(&mut seed, 4) > 0;
            bench = bench.cut(slowly);
            let journal = bench.journal().unwrap();
            assert_eq!((journal.job, journal.is_finished), (mark, false), "{name}");
            let next = journal.start();
            assert!(next.pass >= place.pass, "{name}: {next:?} after {place:?}");
            within += u32::from(next.within().is_some());
            place = next;
            if was_on_pass {
                let mm = on_passes.again_mm(&last, next);
                assert!(mm >= 0.0, "{name}: {mm} mm are left out, {next:?} after {last:?}");
                if slowly {
                    // One pass at most where the cut came before the first place on it was old enough.
                    assert!(
                        mm <= again_max_mm(&job),
                        "{name}: {mm} mm again, {next:?}, {last:?}"
                    );
                    again.with_mm = again.with_mm.max(mm);
                } else {
                    again.without_mm = again.without_mm.max(mm);
                }
            }
            let home_nm = bench.home();
            bench.load(&prepared, home_nm);
            bench.ask(&Request::StartAt(next));
        }
        assert_eq!(bench.run(u32::MAX), State::Finished);
        bench.rest();
        assert!(bench.journal().unwrap().is_finished);
        assert!(cuts > 8 && within > 3, "{name}: {cuts} cuts, {within} within");
        assert_eq!(whole.missing_in(&bench), 0, "{name}: places that are missing");
        assert_eq!(bench.missing_in(&whole), 0, "{name}: places beside the path");
        println!(
            "{name} {pattern:?} {overrun_mm}: {cuts} cuts, {within} resumed within a pass, {again:?}, {} samples on passes of {}",
            bench.samples, whole.samples
        );
    }
}

/// A journalled place counts only for the job and the profile that ran.
#[test]
fn a_place_is_of_the_job_and_the_profile_that_ran() {
    let jobs = [Pattern::Zigzag, Pattern::Zig].map(|pattern| sample_job("torus", pattern, 0.0, None));
    let prepared = [&jobs[0], &jobs[1]].map(|job| prepare(job).unwrap());
    let begin = || {
        let mut bench = Bench::loaded(&prepared[0], profile(&jobs[0]));
        let home_nm = bench.start.map(|steps| steps * STEP_NM);
        bench.ask(&Request::Start);
        while bench.trail.iter().filter(|sample| sample.pass == 1).count() < 500 {
            bench.tick();
        }
        bench.ask(&Request::Abort);
        while bench.board.status().state != State::Ready {
            bench.tick();
        }
        bench.rest();
        (bench, home_nm)
    };
    let check = |mut bench: Bench, wanted: Option<Journal>| {
        assert!(wanted.unwrap().start().within().is_some());
        for _ in 0..300 {
            bench.tick();
        }
        for slowly in [true, false] {
            bench = bench.cut(slowly);
            assert_eq!(bench.journal(), wanted);
        }
    };
    let (mut bench, home_nm) = begin();
    let journal = bench.journal();
    bench.load(&prepared[1], home_nm);
    check(bench, journal);
    let (mut bench, _) = begin();
    let journal = bench.journal();
    let mut other = profile(&jobs[0]);
    other.velocity_mm_s[0] += 1.0;
    bench.ask(&Request::SetProfile(Some(other)));
    check(bench, journal);
}

/// A supply that falls some time after the end of a run leaves the record of that end: the drives may have let go before the board noticed it.
#[test]
fn a_supply_that_falls_after_a_run_leaves_the_place_of_its_end() {
    let job = sample_job("torus", Pattern::Zigzag, 0.0, None);
    let prepared = prepare(&job).unwrap();
    for after in [0, 60, 120, 300] {
        let mut bench = Bench::loaded(&prepared, profile(&job));
        bench.ask(&Request::Start);
        while bench.trail.iter().filter(|sample| sample.pass == 1).count() < 500 {
            bench.tick();
        }
        bench.board.simulate(InputLines::EMERGENCY_STOP);
        bench.rest();
        assert_eq!(bench.board.status().state, State::Faulted);
        let journal = bench.journal();
        assert!(journal.unwrap().start().within().is_some());
        for _ in 0..after {
            bench.tick();
        }
        assert_eq!(
            bench.cut(true).journal(),
            journal,
            "{after} periods after the run"
        );
    }
}

/// With a full journal a run is not noted: a place of an earlier one is none of it, and the new workpiece is not resumed after passes that it never saw.
#[test]
fn a_run_that_a_full_journal_cannot_note_is_not_resumed_at_an_earlier_ones_place() {
    let job = sample_job("torus", Pattern::Zigzag, 0.0, None);
    let prepared = prepare(&job).unwrap();
    let mut bench = Bench::loaded(&prepared, profile(&job));
    bench.store();
    let until_pass = |bench: &mut Bench, pass| {
        bench.trail.clear();
        bench.ask(&Request::Start);
        while bench.trail.iter().filter(|sample| sample.pass == pass).count() < 500 {
            bench.tick();
        }
    };
    let abort = |bench: &mut Bench| {
        bench.ask(&Request::Abort);
        while bench.board.status().state != State::Ready {
            bench.tick();
        }
        bench.rest();
    };
    until_pass(&mut bench, 3);
    abort(&mut bench);
    assert_eq!(bench.journal().unwrap().pass, 3);
    let full = |bench: &mut Bench| {
        for tool_nm in 0..2_000 {
            let offsets = Offsets {
                tool_nm,
                ..Offsets::NONE
            };
            match bench.answer(&Request::SetOffsets(offsets)) {
                Reply::Ack { .. } => {}
                Reply::Nak { reason, .. } => return assert_eq!(reason, Reason::Storage),
                other => panic!("{other:?}"),
            }
        }
        panic!("never full");
    };
    full(&mut bench);
    let stands_nm = bench.board.real_time().motion().at_nm;
    bench.load(&prepared, stands_nm);
    // The first place is over; the one after it is not noted either, nor that of a supply that falls.
    for pass in [1, 2] {
        until_pass(&mut bench, pass);
        if pass == 1 {
            abort(&mut bench);
        }
        let journal = bench.journal().unwrap();
        assert!(journal.is_finished, "{journal:?}");
    }
    let mut bench = bench.cut(true);
    bench.home();
    let name = JobName::try_from("left").unwrap();
    let resume = Request::StartJob { name, resumes: true };
    let Reply::Nak { reason, .. } = bench.answer(&resume) else {
        panic!("{:?}", bench.board.status());
    };
    assert_eq!(reason, Reason::NothingToResume);
    // Switched on anew, the board journals again. The job was stored with other offsets.
    bench.ask(&Request::SetOffsets(Offsets::NONE));
    let name = JobName::try_from("left").unwrap();
    bench.ask(&Request::StartJob { name, resumes: false });
    bench.run(1_000);
    let journal = bench.journal().unwrap();
    assert!(!journal.is_finished && journal.pass == 0, "{journal:?}");
}

#[test]
fn only_a_job_within_limits_begins_at_a_pass() {
    let (header, words) = integration_tests::dome();
    let mut bench = Bench::new(Box::new(Board::new()), [0; 3]);
    bench.ask(&Request::Drives { on: true });
    bench.ask(&Request::SetHome { home_nm: [0; 3] });
    for request in upload(header, &words) {
        bench.ask(&request);
    }
    let Reply::Nak { reason, .. } = bench.answer(&Request::StartAt(RunStart {
        pass: 1,
        path: SpanParameter::NONE,
    })) else {
        panic!("it starts");
    };
    assert_eq!(reason, Reason::WholeOnly);
    // And it is not journalled.
    bench.ask(&Request::Start);
    bench.run(u32::MAX);
    bench.rest();
    assert_eq!(bench.journal(), None);
}
