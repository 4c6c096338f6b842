//! Jobs that a board keeps: stored, started by name or by the start button without a host, resumed after a power cut; under the conditions of any other start.

use interp_core::State;
use job::Pattern;
use machine::prepare::prepare;
use protocol::digest::job_digest;
use protocol::message::{
    AtSpeed, InputLines, JobName, LinkTimeoutAction, Offsets, Reason, Reply, Request, SpindleOrder,
    SpindleSettings, StoredJobInfo, Turning, job_mark,
};

use crate::pause::sample_job;
use crate::resume::{Bench, STEP_NM, profile};

fn name(text: &str) -> JobName {
    JobName::try_from(text).unwrap()
}

/// A homed board that keeps the torus as "left", and has been switched off since.
fn bench() -> (Bench, job::Job) {
    let job = sample_job("torus", Pattern::Zigzag, 0.0, None);
    let mut bench = Bench::loaded(&prepare(&job).unwrap(), profile(&job));
    bench.store();
    (bench.cut(false), job)
}

fn stored(bench: &mut Bench, index: u8) -> (Option<StoredJobInfo>, u32) {
    match bench.answer(&Request::StoredJob { index }) {
        Reply::StoredJob { job, room, .. } => (job, room),
        other => panic!("{other:?}"),
    }
}

fn refused(bench: &mut Bench, request: &Request) -> Reason {
    match bench.answer(request) {
        Reply::Nak { reason, .. } => reason,
        other => panic!("{request:?}: {other:?}"),
    }
}

fn start(text: &str, resumes: bool) -> Request {
    Request::StartJob {
        name: name(text),
        resumes,
    }
}

/// The digest of a run of the job that a host gives the board, from where the axes stand.
fn digest_of(job: &job::Job, start: [i32; 3]) -> u64 {
    let mut bench = Bench::loaded_at(start, &prepare(job).unwrap(), profile(job));
    bench.ask(&Request::Start);
    assert_eq!(bench.run(u32::MAX), State::Finished);
    bench.board.status().digest
}

#[test]
fn a_stored_job_runs_as_a_hosts_does() {
    let (mut bench, job) = bench();
    let prepared = prepare(&job).unwrap();
    let (found, room) = stored(&mut bench, 0);
    let found = found.unwrap();
    assert_eq!(
        (found.name.as_str(), found.words as usize),
        ("left", prepared.words.len())
    );
    assert_eq!(
        found.mark,
        job_mark(&prepared.header, job_digest(&prepared.words))
    );
    assert!(room > 0);
    assert_eq!(stored(&mut bench, 1).0, None);
    // Neither drives nor home.
    assert_eq!(refused(&mut bench, &start("left", false)), Reason::DrivesOff);
    bench.ask(&Request::Drives { on: true });
    assert!(matches!(
        refused(&mut bench, &start("left", false)),
        Reason::Unsafe { .. }
    ));
    assert_eq!(refused(&mut bench, &start("right", false)), Reason::NoStoredJob);
    assert_eq!(refused(&mut bench, &start("left", true)), Reason::NothingToResume);
    let home_nm = bench.home();
    bench.ask(&start("left", false));
    // Nothing is changed during a run.
    bench.run(100);
    let state = bench.board.status().state;
    let delete = Request::DeleteJob { name: name("left") };
    assert_eq!(refused(&mut bench, &delete), Reason::WrongState { state });
    assert_eq!(bench.run(u32::MAX), State::Finished);
    let digest = bench.board.status().digest;
    assert_eq!(digest, digest_of(&job, home_nm.map(|nm| nm / STEP_NM)));
    bench.rest();
    bench.ask(&delete);
    assert_eq!(refused(&mut bench, &delete), Reason::NoStoredJob);
    assert_eq!(stored(&mut bench, 0).0, None);
}

#[test]
fn a_stored_job_is_resumed_after_a_power_cut() {
    let (mut bench, job) = bench();
    bench.home();
    bench.ask(&start("left", false));
    // Until it is well on the second pass.
    while bench.trail.iter().filter(|sample| sample.pass == 1).count() < 500 {
        bench.tick();
    }
    bench = bench.cut(true);
    let journal = bench.journal().unwrap();
    assert!(journal.start().within().is_some(), "{journal:?}");
    bench.home();
    bench.ask(&start("left", true));
    assert_eq!(bench.run(u32::MAX), State::Finished);
    bench.rest();
    let first = bench
        .trail
        .iter()
        .find(|sample| sample.state == State::Running)
        .unwrap();
    assert_eq!((first.pass, first.path), (journal.pass, journal.path));
    // Whole, beside the last moments before the cut.
    let mut whole = Bench::loaded_at(bench.start, &prepare(&job).unwrap(), profile(&job));
    whole.ask(&Request::Start);
    assert_eq!(whole.run(u32::MAX), State::Finished);
    assert_eq!(whole.missing_in(&bench), 0);
}

/// Presses the button, for as long as a finger does.
fn press(bench: &mut Bench) {
    bench.board.simulate(InputLines::START);
    ticks(bench, 100);
    bench.board.simulate(InputLines::NONE);
    ticks(bench, 30);
}

fn ticks(bench: &mut Bench, count: u32) {
    for _ in 0..count {
        bench.tick();
    }
}

#[test]
fn the_start_button_needs_no_host() {
    let (mut bench, job) = bench();
    // Pressed from the power-up on, it starts nothing.
    bench.board.simulate(InputLines::START);
    let home_nm = bench.home();
    ticks(&mut bench, 200);
    assert_eq!(bench.board.status().state, State::Idle);
    bench.board.simulate(InputLines::NONE);
    ticks(&mut bench, 100);
    press(&mut bench);
    assert!(bench.board.status().state.is_under_way());
    // A host that is gone holds a run after a tenth of a second, but nobody is missed here.
    bench.run(2_000);
    assert!(!bench.board.status().safety.link_timed_out);
    // Held, it goes on.
    bench.ask(&Request::Hold);
    while bench.board.status().state != State::Held {
        bench.tick();
    }
    press(&mut bench);
    assert_eq!(bench.run(u32::MAX), State::Finished);
    bench.rest();
    assert!(bench.journal().unwrap().is_finished);
    // And once more, from where the axes came back to.
    press(&mut bench);
    assert_eq!(bench.run(u32::MAX), State::Finished);
    assert_eq!(
        bench.board.status().digest,
        digest_of(&job, home_nm.map(|nm| nm / STEP_NM))
    );
    // Without home it does not.
    bench = bench.cut(false);
    ticks(&mut bench, 100);
    press(&mut bench);
    assert_eq!(bench.board.status().state, State::Idle);
    assert_eq!(bench.board.status().samples, 0);
}

/// A stored job that may not start leaves the loaded one as it is.
#[test]
fn a_stored_job_that_may_not_start_does_not_replace_the_loaded_one() {
    let (mut bench, job) = bench();
    let prepared = prepare(&job).unwrap();
    let mut home_nm = bench.home();
    bench.load(&prepared, home_nm);
    bench.ask(&Request::StoreJob {
        name: name("elsewhere"),
        begins_anywhere: false,
    });
    home_nm[2] += 1_000_000;
    bench.ask(&Request::SetHome { home_nm });
    bench.load(&prepared, home_nm);
    let refusals = |reason: &Reason| matches!(reason, Reason::NotAtHome { .. });
    assert!(refusals(&refused(&mut bench, &start("elsewhere", false))));
    bench.ask(&Request::Drives { on: false });
    for text in ["elsewhere", "left"] {
        assert_eq!(refused(&mut bench, &start(text, false)), Reason::DrivesOff);
    }
    let (header, _) = bench.board.real_time().loaded().unwrap();
    assert_eq!(header.axes.unwrap().home_nm, home_nm);
    bench.ask(&Request::Drives { on: true });
    bench.ask(&Request::SetHome { home_nm });
    bench.ask(&Request::Start);
    bench.run(100);
    assert!(bench.board.status().state.is_under_way());
}

/// Nobody is missed either where the start waits for the spindle.
#[test]
fn the_start_button_needs_no_host_while_the_spindle_comes_up_to_speed() {
    let job = sample_job("torus", Pattern::Zigzag, 0.0, None);
    let mut profile = profile(&job);
    profile.configuration.on_link_timeout = LinkTimeoutAction::Hold;
    profile.configuration.link_timeout_ticks = 100;
    profile.spindle = Some(SpindleSettings {
        max_rpm: 24_000,
        at_speed_ticks: 1_000,
        stops_at_pause: true,
        at_speed: AtSpeed::ByTime,
    });
    let mut bench = Bench::loaded(&prepare(&job).unwrap(), profile);
    bench.ask(&Request::Spindle(SpindleOrder {
        turning: Turning::Clockwise,
        rpm: 12_000,
        coolant: false,
    }));
    bench.store();
    ticks(&mut bench, 100);
    press(&mut bench);
    ticks(&mut bench, 500);
    assert_eq!(bench.board.status().state, State::Ready, "the start waits");
    ticks(&mut bench, 1_000);
    let status = bench.board.status();
    assert!(
        status.state.is_under_way() && !status.safety.link_timed_out,
        "{status:?}"
    );
    assert_ne!(status.state, State::Held);
    assert_eq!(bench.run(u32::MAX), State::Finished);
}

/// A stored job was placed by the offsets that the board kept then: with others, a tool of another length for instance, it is refused, and one that was loaded before them is
/// not stored any more.
#[test]
fn a_stored_job_does_not_start_with_other_offsets() {
    let (mut bench, job) = bench();
    let home_nm = bench.home();
    let longer = Offsets {
        tool_nm: 12_000_000,
        ..Offsets::NONE
    };
    bench.ask(&Request::SetOffsets(longer));
    for resumes in [false, true] {
        assert!(matches!(
            refused(&mut bench, &start("left", resumes)),
            Reason::OtherProfile | Reason::NothingToResume
        ));
    }
    assert_eq!(refused(&mut bench, &start("left", false)), Reason::OtherProfile);
    press(&mut bench);
    assert_eq!(bench.board.status().samples, 0);
    // The same offsets as when it was stored.
    bench.ask(&Request::SetOffsets(Offsets::NONE));
    bench.ask(&start("left", false));
    bench.run(100);
    assert!(bench.board.status().state.is_under_way());
    bench.ask(&Request::Abort);
    while bench.board.status().state != State::Ready {
        bench.tick();
    }
    // Loaded before the offsets.
    bench.load(&prepare(&job).unwrap(), home_nm);
    bench.ask(&Request::SetOffsets(longer));
    let store = Request::StoreJob {
        name: name("right"),
        begins_anywhere: true,
    };
    assert_eq!(refused(&mut bench, &store), Reason::OtherProfile);
    bench.load(&prepare(&job).unwrap(), home_nm);
    bench.ask(&store);
    let home_nm = bench.home();
    bench.load(&prepare(&job).unwrap(), home_nm);
    bench.ask(&start("right", false));
}
