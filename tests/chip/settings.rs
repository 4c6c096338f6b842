//! The machine profile in the chip's flash: written by the image's own driver, with a supply that fails.

use std::time::Duration;

use boards::SKR_PRO;
use machine::profile;
use machine::remote::{RemoteError, Session, port};
use protocol::message::{Profile, Request};

use super::emulated::{Emulated, sim};

/// Words written between two failures of the supply: not a multiple of a record's, so that each failure is at another place of it.
const BETWEEN_CUTS: u64 = 61;
/// Failures of the supply.
const CUTS: u32 = 10;

fn with_speed(speed: u32) -> Profile {
    let text = format!(
        "[machine]\nvelocity_max_mm_s = [{speed}, 100, 50]\nsteps_per_mm = [400, 78.74, \"3200/7\"]\ntravel_mm = [[0, 300], [0, 200], [-80, 0]]\n"
    );
    profile::for_board(&job_file::parse_profile("machine.toml", &text).unwrap())
}

/// A session with the board, once it has started.
pub(super) fn session(emulated: &Emulated, number: u32) -> Session {
    for _ in 0..50 {
        match Session::open(port::open(&emulated.port()).unwrap(), number) {
            Ok(session) => return session,
            Err(_) => std::thread::sleep(Duration::from_millis(20)),
        }
    }
    panic!("the board does not answer");
}

#[test]
fn a_supply_that_fails_while_the_flash_is_written_loses_no_profile() {
    let emulated = Emulated::start(&SKR_PRO, &["--cut-flash-every", &BETWEEN_CUTS.to_string()]);
    let mut kept = None;
    let mut failures = 0;
    let mut link = session(&emulated, 1);
    for change in 1.. {
        let wanted = with_speed(change);
        match link.command(&Request::SetProfile(Some(wanted))) {
            Ok(()) => assert_eq!(link.profile().unwrap(), Some(wanted)),
            Err(RemoteError::Refused { .. } | RemoteError::Silent(_)) => {
                failures += 1;
                // One program at a time has the port.
                drop(link);
                link = session(&emulated, change + 1);
                let found = link.profile().unwrap();
                assert!(found == kept || found == Some(wanted), "{found:?}, not {kept:?}");
                // It is in force from the power-up on.
                let status = link.status().unwrap();
                assert_eq!(status.profile, found.map_or(0, |profile| profile.digest()));
            }
            Err(other) => panic!("{other}"),
        }
        kept = link.profile().unwrap();
        if failures >= CUTS {
            break;
        }
    }
    drop(link);
    let ended = emulated.end();
    ended.no_complaint();
    let cuts = ended.report["events"].as_array().unwrap().iter();
    let cuts = cuts.filter(|event| event["what"] == "power cut").count();
    assert!(cuts >= CUTS as usize, "{}", ended.report["events"]);
    assert!(ended.number("resets") >= CUTS.into());
}

/// The profile by the command line: written, read back, used by a job that says nothing of the machine, and refused where it is exceeded.
#[test]
fn a_job_runs_on_the_boards_own_profile() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let machine = "[machine]\nvelocity_max_mm_s = [20.0, 20.0, 10.0]\nacceleration_max_mm_s2 = [100.0, 100.0, 50.0]\njerk_max_mm_s3 = [1000.0, 1000.0, 500.0]\nsteps_per_mm = [400, 400, 400]\npulse_us = 3.0\ndirection_setup_us = 20.0\ndirection_inverted = [false, true, false]\nhoming_required = true\nhost_gone = \"finish\"\nhost_gone_ms = 1000.0\n";
    std::fs::write(path("machine.toml"), machine).unwrap();
    let job = "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, 5, 0], [0, 0, 0, 0], [0, 0, 0, 50]]\nrail1_mm = [[0, 0, 5, 0], [0, 0, 0, 2], [0, 0, 0, 50]]\n[tool]\nkind = \"ball\"\nradius_mm = 5\n[cut]\nfeed_mm_min = 600\nscallop_mm = 0.05\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n";
    std::fs::write(path("job.toml"), job).unwrap();
    let greedy = format!("{job}[machine]\njerk_max_mm_s3 = [1000, 1001, 500]\n");
    std::fs::write(path("greedy.toml"), greedy).unwrap();
    let emulated = Emulated::start(&SKR_PRO, &[]);
    let port = emulated.port();
    let refused = sim(["run", &path("job.toml"), "--port", &port, "--home", "0,0,60"]);
    assert!(!refused.0 && refused.1.contains("R24"), "{}", refused.1);
    let written = sim(["settings", "--port", &port, "--machine", &path("machine.toml")]);
    assert!(written.0 && written.1.contains(machine), "{}", written.1);
    let ran = sim(["run", &path("job.toml"), "--port", &port, "--home", "0,0,60"]);
    assert!(ran.0 && ran.1.contains("bit for bit the same"), "{}", ran.1);
    let (is_done, said) = sim(["run", &path("greedy.toml"), "--port", &port, "--home", "0,0,60"]);
    assert!(!is_done && said.contains("1001 on y, 1000 there"), "{said}");
    std::fs::write(
        path("other.toml"),
        machine.replace("400, 400, 400", "400, 400, 800"),
    )
    .unwrap();
    let other = path("other.toml");
    let (is_done, said) = sim([
        "run",
        &path("job.toml"),
        "--port",
        &port,
        "--home",
        "0,0,60",
        "--machine",
        &other,
    ]);
    assert!(
        !is_done && said.contains("keeps another machine profile"),
        "{said}"
    );
    emulated.end().no_complaint();
}
