//! The firmware in QEMU against the core on the host: every sample of the sample jobs (`whole_jobs`; in `./check` of a quarter of their passes), and the report of a difference.
//! Needs `qemu-system-arm`; builds the firmware.

use interp_core::{FaultKind, Sample, State};
use job::{Spacing, Start};
use machine::Machine;
use machine::links::Link;
use machine::prepare::{Prepared, prepare};
use machine::remote::drive::{self, Expected};
use machine::remote::operate::{self, Setup};
use machine::remote::qemu::Qemu;
use machine::remote::session::Event;
use machine::remote::{RemoteError, Session};
use protocol::digest::Digest;
use protocol::message::{
    Clock, Configuration, InputLines, LinkTimeoutAction, Reason, Report, Request, Status,
};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::images;

fn board() -> (Qemu, Session) {
    let (qemu, stream) = Qemu::start(images::for_qemu()).unwrap();
    let mut session = Session::open(stream, 1).unwrap();
    operate::make_ready(&mut session, &Setup::simulated(Configuration::DEFAULT)).unwrap();
    (qemu, session)
}

fn job(name: &str) -> Prepared {
    let path = format!("{}/../jobs/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    prepare(&job_file::load(path.as_ref()).unwrap()).unwrap()
}

/// Passes and digest of all samples as the host computes them.
fn here(job: &Prepared) -> (Vec<Expected>, u64) {
    let mut passes: Vec<Expected> = Vec::new();
    let mut digest = Digest::new();
    Machine::load(job)
        .unwrap()
        .run(|sample| {
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
        })
        .unwrap();
    (passes, digest.value())
}

/// A sample job with about a quarter of its passes.
fn coarse(name: &str) -> Prepared {
    let mut job = job_file::load(&programs::sample_job(name)).unwrap();
    job.scallop_mm *= 16.0;
    prepare(&job).unwrap()
}

/// The torus in a quarter of its passes: a job before or after others, on the same board.
fn coarse_torus() -> (&'static str, Prepared) {
    ("coarse torus", coarse("torus"))
}

/// Runs these jobs, in a quarter of their passes, one after the other on one board, without a restart, and compares the digests.
fn compare(names: &[&str]) {
    let jobs: Vec<(&str, Prepared)> = names.iter().map(|name| (*name, coarse(name))).collect();
    compare_prepared(&jobs);
}

fn compare_prepared(jobs: &[(&str, Prepared)]) {
    // Before QEMU starts, which takes a processor while it waits.
    let jobs: Vec<_> = jobs.iter().map(|(name, job)| (name, job, here(job))).collect();
    let (_qemu, mut session) = board();
    for (name, job, (passes, digest)) in jobs {
        drive::upload(&mut session, job, |_| {}).unwrap();
        let start = Instant::now();
        let compared = drive::run_digests(&mut session, &passes, true, None, |_| {}).unwrap();
        let samples: u64 = passes.iter().map(|pass| u64::from(pass.samples)).sum();
        println!(
            "{name}: {:.0} ticks a second",
            samples as f64 / start.elapsed().as_secs_f64()
        );
        assert_eq!(compared.first_bad_index, None, "{name}");
        assert_eq!(
            (compared.samples, compared.status.digest),
            (samples, digest),
            "{name}"
        );
        assert_eq!(compared.status.state, State::Finished, "{name}");
        assert_eq!(
            (compared.status.deadline_misses, compared.status.samples_lost),
            (0, 0),
            "{name}"
        );
    }
}

// Groups of similar duration, to load all processors; each runs jobs of different kinds on one board.

#[test]
fn revolved_along_u() {
    compare(&["torus", "revolved"]);
}

#[test]
fn revolved_along_v_and_nurbs() {
    compare(&["revolved_v", "freeform"]);
}

#[test]
fn ruled() {
    compare(&["ruled_printed", "sphere_cap", "ruled_reconstructed"]);
}

#[test]
fn bicubic() {
    let far_plate = {
        let mut job = job_file::load(&programs::sample_job("far_plate")).unwrap();
        // Its step-over is large already.
        job.scallop_mm *= 4.0;
        prepare(&job).unwrap()
    };
    compare_prepared(&[
        ("coarse far_plate", far_plate),
        ("coarse plate", coarse("plate")),
        ("coarse plate_v", coarse("plate_v")),
    ]);
}

/// The jobs of those, in all of their passes.
#[test]
#[ignore = "two minutes"]
fn whole_jobs() {
    let names = [
        "torus",
        "revolved",
        "revolved_v",
        "freeform",
        "ruled_printed",
        "sphere_cap",
        "ruled_reconstructed",
        "far_plate",
        "plate",
        "plate_v",
        "plate_machine",
    ];
    let jobs: Vec<(&str, Prepared)> = names.iter().map(|name| (*name, job(name))).collect();
    compare_prepared(&jobs);
}

/// Curved passes, whose stations lie in the store after the job.
#[test]
fn constant_scallop_height() {
    let constant = |name: &str, start| {
        let path = format!("{}/../jobs/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let mut job = job_file::load(path.as_ref()).unwrap();
        (job.spacing, job.scallop_mm) = (Spacing::Constant(start), 0.05);
        prepare(&job).unwrap()
    };
    let around_pole = {
        let path = format!("{}/../jobs/sphere_cap.toml", env!("CARGO_MANIFEST_DIR"));
        let mut job = job_file::load(path.as_ref()).unwrap();
        job.spacing = Spacing::Constant(Start::Middle);
        (job.along, job.scallop_mm) = (job::Along::V, 0.05);
        prepare(&job).unwrap()
    };
    compare_prepared(&[
        ("sphere_cap around its pole", around_pole),
        ("freeform", constant("freeform", Start::Edge)),
        ("sphere_cap", constant("sphere_cap", Start::Middle)),
        coarse_torus(),
    ]);
}

/// Passes clipped to a region, without axis limits and with them, straight and curved.
#[test]
fn region() {
    let with_limits = {
        let path = format!("{}/../jobs/region.toml", env!("CARGO_MANIFEST_DIR"));
        let mut job = job_file::load(path.as_ref()).unwrap();
        job.scallop_mm = 0.2;
        job.machine.limits = Some(job::AxisLimits::DEFAULT);
        prepare(&job).unwrap()
    };
    // Links of every kind, some of which begin before their pass is planned.
    let mut with_links = with_limits.clone();
    let links: Vec<Link> = (machine::links::between(&machine::links::passes(&with_limits))
        .iter()
        .zip(0..))
    .map(|([from, to], index)| match index % 3 {
        0 => Link::Straight,
        1 => Link::Across(from[2].max(to[2]) + 300_000),
        _ => Link::Across(i32::MIN + 1),
    })
    .collect();
    machine::links::add(&mut with_links, &links);
    assert!(with_links.header.links > 10);
    let curved = job("fan_region");
    let from_middle = {
        let path = format!("{}/../jobs/fan_region.toml", env!("CARGO_MANIFEST_DIR"));
        let mut job = job_file::load(path.as_ref()).unwrap();
        (job.spacing, job.scallop_mm) = (Spacing::Constant(Start::Middle), 0.1);
        let (job, prepared) = machine::direction::choose(job).unwrap();
        assert!(job.region.is_some_and(|region| region.cells.len() > 1));
        prepared
    };
    let mut curved_with_links = curved.clone();
    machine::links::add(&mut curved_with_links, &links);
    compare_prepared(&[
        ("region", job("region")),
        ("region with limits", with_limits),
        ("region with links", with_links),
        ("fan_region", curved),
        ("fan_region with links", curved_with_links),
        ("fan_region from the middle, in cells", from_middle),
        coarse_torus(),
    ]);
}

/// A job that is larger than the board's store, after one that is not: its rows are sent while it runs.
#[test]
fn streamed_rows() {
    let streamed = job("streamed");
    assert!(streamed.header.window > 0);
    compare_prepared(&[
        coarse_torus(),
        ("streamed", streamed),
        ("streamed_region", job("streamed_region")),
    ]);
}

/// A job with axis limits, before and after one without.
#[test]
fn with_limits() {
    compare_prepared(&[
        ("coarse plate_machine", coarse("plate_machine")),
        coarse_torus(),
        ("fan", coarse("fan")),
    ]);
}

/// The board's job differs in one coefficient, by 40 of its units: the report names the pass and the tick of the first
/// different sample, which are those found by running both jobs on the host.
#[test]
fn the_first_difference_is_named() {
    let ours = job("torus");
    let mut theirs = ours.clone();
    // The height at the middle of the last patch, which later passes reach.
    let coefficient = theirs.words.len() - 2 * 16;
    theirs.words[coefficient] += 40;
    let samples = |job: &Prepared| {
        let mut samples: Vec<Sample> = Vec::new();
        Machine::load(job)
            .unwrap()
            .run(|sample| {
                samples.push(*sample);
                true
            })
            .unwrap();
        samples
    };
    let (mine, other) = (samples(&ours), samples(&theirs));
    let tick = drive::first_difference(&mine, &other).unwrap();
    assert!(tick > 10_000, "a difference at tick {tick} would test little");

    let (passes, _) = here(&ours);
    let (_qemu, mut session) = board();
    drive::upload(&mut session, &theirs, |_| {}).unwrap();
    let compared = drive::run_digests(&mut session, &passes, true, None, |_| {}).unwrap();
    let pass = compared.first_bad_index.unwrap();
    assert_eq!(pass, mine[tick as usize].pass);
    let first = passes[pass as usize].first_tick;
    let there = drive::samples_between(&mut session, first, passes[pass as usize].samples).unwrap();
    assert_eq!(
        drive::first_difference(&mine[first as usize..][..there.len()], &there),
        Some(tick)
    );
}

/// A fault on the board equals that on the host, at the same position; after its acknowledgement the board accepts commands.
#[test]
fn a_fault_is_the_same_fault() {
    let mut job = job("torus");
    job.header.ball_radius_mm = 8.5;
    let mut last = None;
    let mut machine = Machine::load(&job).unwrap();
    let fault = machine
        .run(|sample| {
            last = Some(*sample);
            true
        })
        .unwrap_err();
    assert_eq!((fault.kind, last), (FaultKind::BallDoesNotFit, None));
    let (_qemu, mut session) = board();
    drive::upload(&mut session, &job, |_| {}).unwrap();
    let (status, _) =
        drive::run_samples(&mut session, true, None, |_| panic!("no sample before the fault")).unwrap();
    let report = status.fault.unwrap();
    assert_eq!(
        (report.code, report.value.to_bits()),
        (fault.kind.code(), fault.value.to_bits())
    );
    assert_eq!((status.pass, status.path, status.side), machine.place());
    assert_eq!(status.state, State::Faulted);
    session.command(&Request::Abort).unwrap();
    session.command(&Request::Run { ticks: 1 }).unwrap();
}

/// A job that is too large is refused with the limit, and any job is refused during a run; the run continues unchanged.
#[test]
fn refusals_change_nothing() {
    let job = job("freeform");
    let (passes, digest) = here(&job);
    let (_qemu, mut session) = board();
    let description = session.capabilities().description.clone();
    assert!(description.patches_max_polynomial >= 200);
    let mut large = job.header;
    (large.path_spans, large.side_spans) = (64, 64);
    let words = 64 * 64 * 52 + 128;
    let begin = Request::JobBegin {
        header: large,
        words,
        digest: 0,
    };
    match session.command(&begin) {
        Err(RemoteError::Refused {
            reason: Reason::TooLong { limit, wanted },
            ..
        }) => {
            assert_eq!((limit, wanted), (description.store_words, words));
        }
        other => panic!("{other:?}"),
    }
    drive::upload(&mut session, &job, |_| {}).unwrap();
    session.command(&Request::Clock(Clock::Lockstep)).unwrap();
    session.command(&Request::Report(Report::Digests)).unwrap();
    session.command(&Request::Start).unwrap();
    session.command(&Request::Run { ticks: 1000 }).unwrap();
    while session.status().unwrap().credit > 0 {}
    match session.command(&Request::JobBegin {
        header: job.header,
        words: 1,
        digest: 0,
    }) {
        Err(RemoteError::Refused {
            reason: Reason::WrongState { state },
            ..
        }) => assert_eq!(state, State::Running),
        other => panic!("{other:?}"),
    }
    assert!(session.command(&Request::Start).is_err());
    session.command(&Request::Hold).unwrap();
    session.command(&Request::Run { ticks: 100 }).unwrap();
    while session.status().unwrap().credit > 0 {}
    assert_eq!(session.status().unwrap().state, State::Held);
    session.command(&Request::Resume).unwrap();
    session.command(&Request::Run { ticks: u32::MAX }).unwrap();
    let samples: u32 = passes.iter().map(|pass| pass.samples).sum();
    let status = loop {
        let status = session.status().unwrap();
        if status.state == State::Finished {
            break status;
        }
        std::thread::sleep(Duration::from_millis(50));
    };
    assert_eq!((status.samples, status.digest), (samples, digest));
}

/// The status of the board's next `Halted`.
fn halted(session: &mut Session) -> Status {
    loop {
        if let Event::Halted(status) = session.event().unwrap() {
            return status;
        }
    }
}

/// The emergency stop, on simulated pins: it passes through the firmware's drivers, acts in the next tick, and is cleared step by step.
#[test]
fn an_emergency_stop_ends_the_run_on_the_board() {
    let job = job("sphere_cap");
    let (_qemu, mut session) = board();
    let setup = Setup::homed(Configuration::DEFAULT, [0; 3]);
    operate::make_ready(&mut session, &setup).unwrap();
    drive::upload(&mut session, &job, |_| {}).unwrap();
    session.command(&Request::Clock(Clock::Lockstep)).unwrap();
    session.command(&Request::Start).unwrap();
    session.command(&Request::Run { ticks: 500 }).unwrap();
    assert_eq!(halted(&mut session).samples, 500);
    let lines = InputLines::EMERGENCY_STOP;
    session.command(&Request::Simulate { lines }).unwrap();
    let stopped = halted(&mut session);
    assert_eq!((stopped.state, stopped.samples), (State::Faulted, 500));
    let fault = stopped.fault.unwrap();
    assert_eq!(
        (fault.kind(), fault.lines()),
        (Some(FaultKind::EmergencyStop), lines)
    );
    assert!(!stopped.safety.drives_on && !stopped.safety.homed);
    let refused = |done| {
        matches!(
            done,
            Err(RemoteError::Refused {
                reason: Reason::Unsafe { .. },
                ..
            })
        )
    };
    assert!(refused(session.command(&Request::Acknowledge)));
    let lines = InputLines::NONE;
    session.command(&Request::Simulate { lines }).unwrap();
    // The stop can be acknowledged some periods after its release; until then the drives stay off.
    while !session.status().unwrap().safety.lines.is_none() {}
    assert!(refused(operate::make_ready(&mut session, &setup)));
    session.command(&Request::Acknowledge).unwrap();
    operate::make_ready(&mut session, &setup).unwrap();
    session.command(&Request::Abort).unwrap();
    session.command(&Request::Run { ticks: 1 }).unwrap();
    assert_eq!(halted(&mut session).state, State::Ready);
    session.command(&Request::Start).unwrap();
    session.command(&Request::Run { ticks: 500 }).unwrap();
    let again = halted(&mut session);
    assert_eq!((again.samples, again.digest), (500, stopped.digest));
}

/// On the free clock, the run is held after two seconds of board time without a request, and is then resumed. `tests/safety.rs`
/// checks that it resumes exactly; here the samples up to each standstill are compared with the host's.
#[test]
fn a_run_whose_host_is_gone_is_held_on_the_board() {
    let job = job("sphere_cap");
    let (_qemu, mut session) = board();
    let configuration = Configuration {
        on_link_timeout: LinkTimeoutAction::Hold,
        link_timeout_ticks: 2000,
        ..Configuration::DEFAULT
    };
    operate::make_ready(&mut session, &Setup::simulated(configuration)).unwrap();
    drive::upload(&mut session, &job, |_| {}).unwrap();
    session.command(&Request::Clock(Clock::Free)).unwrap();
    session.command(&Request::Start).unwrap();
    let mut before = 0;
    for _ in 0..2 {
        // Two seconds of board time take about 40 ms on an idle host.
        let status = loop {
            std::thread::sleep(Duration::from_millis(500));
            let status = session.status().unwrap();
            if status.state != State::Running {
                break status;
            }
        };
        assert_eq!((status.state, status.fault), (State::Held, None));
        assert!(status.safety.link_timed_out && status.samples > before);
        let mut digest = Digest::new();
        Machine::load(&job)
            .unwrap()
            .run(|sample| {
                digest.sample(sample);
                sample.tick + 1 < status.samples
            })
            .unwrap();
        assert_eq!(status.digest, digest.value(), "after {}", status.samples);
        before = status.samples;
        session.command(&Request::Resume).unwrap();
    }
}

/// Sends a signal to QEMU.
fn signal(qemu: &Qemu, name: &str) {
    let sent = Command::new("kill")
        .args([format!("-{name}"), qemu.process_id().to_string()])
        .status();
    assert!(sent.unwrap().success());
}

/// Sends these requests, suspends QEMU for some seconds, and calls `during` with the session meanwhile.
fn stopped_for<T>(seconds: u64, requests: &[Request], during: impl FnOnce(&mut Session) -> T) -> T {
    let (qemu, mut session) = board();
    drive::upload(&mut session, &job("torus"), |_| {}).unwrap();
    session.command(&Request::Clock(Clock::Lockstep)).unwrap();
    session.command(&Request::Start).unwrap();
    for request in requests {
        session.command(request).unwrap();
    }
    std::thread::scope(|scope| {
        signal(&qemu, "STOP");
        scope.spawn(|| {
            std::thread::sleep(Duration::from_secs(seconds));
            signal(&qemu, "CONT");
        });
        during(&mut session)
    })
}

/// The host waits for an answer of QEMU for 8 s, because a busy machine may give it no processor time; for a board on a serial line the
/// timeout is 6 s.
#[test]
fn an_answer_of_a_process_is_waited_for() {
    let status = stopped_for(8, &[], |session| session.status().unwrap());
    assert_eq!((status.samples, status.fault), (0, None));
}

/// The host waits for an event of a run in QEMU for 30 s; for a board on a serial line the timeout is 20 s.
#[test]
#[ignore = "stands still for half a minute"]
fn an_event_of_a_process_is_waited_for() {
    let begun = Instant::now();
    let status = stopped_for(30, &[Request::Run { ticks: u32::MAX }], halted);
    assert_eq!(status.state, State::Finished);
    assert!(
        begun.elapsed() >= Duration::from_secs(30),
        "it was over before it was stopped"
    );
}

/// If QEMU ends, the host reports it without waiting for a timeout.
#[test]
fn a_process_that_ends_is_told_at_once() {
    let (qemu, mut session) = board();
    signal(&qemu, "KILL");
    let begun = Instant::now();
    assert!(matches!(session.status(), Err(RemoteError::Line(_))));
    assert!(begun.elapsed() < Duration::from_secs(60));
}
