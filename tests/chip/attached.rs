//! A host that is gone, and another one that takes its run over: in real time, because the heartbeat is.

use std::time::Duration;

use boards::{SKR_PRO, STM32F405};

use super::emulated::{Emulated, Job, begin_sim, sim, sim_typed};

/// Some seconds of passes; held half a second after the last message.
fn job() -> Job {
    let limits = "velocity_max_mm_s = [20, 20, 10]\nacceleration_max_mm_s2 = [100, 100, 50]\njerk_max_mm_s3 = [1000, 1000, 500]";
    let host = "host_gone = \"hold\"\nhost_gone_ms = 500";
    Job::square(15.0, 600.0, &format!("{limits}\n{host}\n"))
}

fn operate(emulated: &Emulated, words: &[&str], typed: &str) -> (bool, String) {
    let port = emulated.port();
    sim_typed([&["operate", "--port", &port], words].concat(), typed)
}

/// The status of the board once it is held. Each request for it is a sign of life, so the pauses between them grow: a busy machine executes the image
/// slower than in real time.
fn when_held(emulated: &Emulated) -> String {
    let mut pause = Duration::from_secs(3);
    loop {
        std::thread::sleep(pause);
        let status = emulated.status();
        if status.contains(": held") {
            return status;
        }
        assert!(pause < Duration::from_secs(200), "{status}");
        pause *= 2;
    }
}

/// Starts the job by `run`, and kills that command after its first pass.
fn begun_and_left(emulated: &Emulated) {
    let (job, port) = (job(), emulated.port());
    let mut host = begin_sim([
        "run",
        job.path.to_str().unwrap(),
        "--port",
        &port,
        "--home",
        "0,0,60",
    ]);
    std::thread::sleep(Duration::from_secs(4));
    assert!(host.try_wait().unwrap().is_none(), "the run is over too early");
    host.kill().unwrap();
    host.wait().unwrap();
}

/// The board holds the run; `attach` finds it held and goes on to its end, at half the feed.
#[test]
fn a_run_whose_host_was_killed_is_attached_and_goes_on() {
    let emulated = Emulated::in_real_time(&STM32F405);
    begun_and_left(&emulated);
    let held = when_held(&emulated);
    assert!(held.contains("the host was gone during the run"), "{held}");
    let (done, said) = operate(&emulated, &["attach"], "status\noverride 150\nresume\n");
    assert!(done, "{said}");
    for part in [
        "held",
        "feed override 150 %",
        "finished, pass 4",
        "samples, digest",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // Without a run there is nothing to follow.
    let (done, said) = sim(["attach", "--port", &emulated.port()]);
    assert!(done && said.contains("no run is under way"), "{said}");
    let ended = emulated.end();
    ended.no_complaint();
    ended.no_byte_lost();
}

/// `operate resume` stays until the end, because the board would hold the run again; while held, `attach` without an operator says what to do.
#[test]
fn a_resumed_run_is_not_held_again() {
    let emulated = Emulated::in_real_time(&SKR_PRO);
    begun_and_left(&emulated);
    when_held(&emulated);
    let (done, said) = emulated.run(&job().path, "0,0,60");
    assert!(
        !done && said.contains("a run is under way") && said.contains("attach"),
        "{said}"
    );
    let (done, said) = operate(&emulated, &["attach"], "");
    assert!(
        !done && said.contains("the run is held") && said.contains("attach"),
        "{said}"
    );
    let (done, said) = operate(&emulated, &["resume"], "");
    assert!(done && said.contains("finished"), "{said}");
    emulated.end().no_complaint();
}

/// With an override of 0 nothing would move: `run` says so, and does not wait where nobody can change it.
#[test]
fn an_override_of_0_is_told_at_once() {
    let emulated = Emulated::start(&STM32F405, &[]);
    assert!(operate(&emulated, &["override", "0"], "").0);
    let (done, said) = emulated.run(&Job::slow_square().path, "0,0,60");
    assert!(!done, "{said}");
    for part in [
        "the feed override is 0 %: the tool does not move",
        "nobody is there",
        "attach",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    emulated.end().no_complaint();
}
