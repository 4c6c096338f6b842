//! Resume after a power cut: at random ticks, as often as it takes, on a machine whose carriages follow the pulses. The path is complete in the end, and nothing
//! is cut twice but the passes that were cut short.

use std::collections::HashMap;

use controller::in_process::Board;
use integration_tests::{HELLO, Host, upload};
use interp_core::{State, steps::AxisSteps, steps::StepConfig};
use job::{Job, Pattern};
use machine::prepare::{Prepared, prepare};
use protocol::digest::job_digest;
use protocol::message::{
    Configuration, DoorContact, Journal, Profile, Reason, Reply, Request, Status, job_mark,
};

use crate::pause::sample_job;

/// Nanometres of a step.
const STEP_NM: i32 = 2_500;

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

fn profile(job: &Job) -> Profile {
    let limits = job.machine.limits.unwrap();
    let [velocity_mm_s, acceleration_mm_s2, jerk_mm_s3] =
        [limits.velocity_mm_s, limits.acceleration_mm_s2, limits.jerk_mm_s3]
            .map(|limits| limits.map(|limit| limit as f32));
    Profile {
        steps: steps().into(),
        velocity_mm_s,
        acceleration_mm_s2,
        jerk_mm_s3,
        travel_nm: None,
        configuration: Configuration::DEFAULT,
        homing: None,
        probe_inverted: false,
        spindle: None,
        step_inverted: 0,
        enable_inverted: 0,
        door: DoorContact::None,
    }
}

/// A board and its carriages.
struct Bench {
    host: Host,
    board: Box<Board>,
    /// The carriages at power-up, and after the last ticks: the pulses lag by two.
    start: [i32; 3],
    recent: [[i32; 3]; 3],
    /// Where they were in a run, and whether for certain on a pass: the samples lead by two periods.
    places: HashMap<[i32; 3], bool>,
    /// Samples on a pass since the last one that was not.
    running: u32,
    samples: u32,
}

impl Bench {
    fn new(mut board: Box<Board>, start: [i32; 3]) -> Self {
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
        };
        bench.board.receive(&bench.host.next(&HELLO));
        bench.board.take_sent();
        bench
    }

    /// The power fails: what was not put out yet never is.
    fn cut(self) -> Self {
        let mut next = Self::new(Box::new(self.board.power_cycle()), self.recent[0]);
        (next.places, next.samples) = (self.places, self.samples);
        next
    }

    fn answer(&mut self, request: &Request) -> Reply {
        self.board.receive(&self.host.next(request));
        let sent = self.board.take_sent();
        let reply = self.host.read(&sent).pop().unwrap();
        for _ in 0..4 {
            self.tick();
        }
        reply
    }

    fn ask(&mut self, request: &Request) {
        let reply = self.answer(request);
        assert!(matches!(reply, Reply::Ack { .. }), "{request:?}: {reply:?}");
    }

    fn journal(&mut self) -> Option<Journal> {
        match self.answer(&Request::Journal) {
            Reply::Journal { journal, .. } => journal,
            other => panic!("{other:?}"),
        }
    }

    /// One period; returns the status after it.
    fn tick(&mut self) -> Status {
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
        if status.state == State::Running {
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
    fn home(&mut self) -> [i32; 3] {
        self.ask(&Request::Drives { on: true });
        let home_nm = self.recent[2].map(|steps| steps * STEP_NM);
        self.ask(&Request::SetHome { home_nm });
        home_nm
    }

    /// Loads the job, which begins where the axes stand.
    fn load(&mut self, prepared: &Prepared, home_nm: [i32; 3]) {
        let mut header = prepared.header;
        header.axes.as_mut().unwrap().home_nm = home_nm;
        for request in upload(header, &prepared.words) {
            self.board.receive(&self.host.next(&request));
            let sent = self.board.take_sent();
            let reply = self.host.read(&sent).pop().unwrap();
            assert!(matches!(reply, Reply::Ack { .. }), "{request:?}: {reply:?}");
        }
    }

    /// Some periods after a run.
    fn rest(&mut self) {
        for _ in 0..10 {
            self.tick();
        }
    }

    /// Runs for this number of periods, or to the end.
    fn run(&mut self, periods: u32) -> State {
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
    let near = -2..=2;
    near.clone().any(|x| {
        near.clone().any(|y| {
            near.clone()
                .any(|z| places.contains_key(&[at[0] + x, at[1] + y, at[2] + z]))
        })
    })
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
        let start = prepared.header.axes.unwrap().home_nm.map(|nm| nm / STEP_NM);
        let begin = || {
            let mut bench = Bench::new(Box::new(Board::new()), start);
            bench.ask(&Request::SetProfile(Some(profile(&job))));
            assert_eq!(bench.journal(), None);
            let home_nm = bench.home();
            bench.load(&prepared, home_nm);
            bench.ask(&Request::Start);
            bench
        };
        let mut whole = begin();
        assert_eq!(whole.run(u32::MAX), State::Finished);
        whole.rest();
        assert!(whole.journal().unwrap().is_finished);

        let mut bench = begin();
        let (mut cuts, mut pass) = (0, 0);
        let mut again = 0;
        while cuts < 25 {
            let before = bench.samples;
            if bench.run(1_000 + random(&mut seed, whole.samples / 6)) == State::Finished {
                break;
            }
            cuts += 1;
            again += bench.samples - before;
            bench = bench.cut();
            let journal = bench.journal().unwrap();
            assert_eq!((journal.job, journal.is_finished), (mark, false), "{name}");
            assert!(journal.pass >= pass, "{name}: pass {} after {pass}", journal.pass);
            pass = journal.pass;
            let home_nm = bench.home();
            bench.load(&prepared, home_nm);
            bench.ask(&Request::StartAt { pass });
        }
        assert_eq!(bench.run(u32::MAX), State::Finished);
        bench.rest();
        assert!(bench.journal().unwrap().is_finished);
        assert!(cuts > 8, "{name}: {cuts}");
        let apart = |of: &Bench, from: &Bench| {
            let on_pass = of.places.iter().filter(|(_, is_on_pass)| **is_on_pass);
            on_pass.filter(|(at, _)| !is_near(&from.places, **at)).count()
        };
        assert_eq!(apart(&whole, &bench), 0, "{name}: places that are missing");
        assert_eq!(apart(&bench, &whole), 0, "{name}: places beside the path");
        // At most the pass that was cut short is cut again, each time.
        println!(
            "{name} {pattern:?} {overrun_mm}: {cuts} cuts, {again} samples before them, {} of {}",
            bench.samples, whole.samples
        );
    }
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
    let Reply::Nak { reason, .. } = bench.answer(&Request::StartAt { pass: 1 }) else {
        panic!("it starts");
    };
    assert_eq!(reason, Reason::WholeOnly);
    // And it is not journalled.
    bench.ask(&Request::Start);
    bench.run(u32::MAX);
    bench.rest();
    assert_eq!(bench.journal(), None);
}
