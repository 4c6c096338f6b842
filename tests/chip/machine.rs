//! Home, jog, touch-off and a placed job with the tool's own commands: the flashed image, with a machine around it. In real time, because the host keeps a
//! motion going.

use boards::{Board, SKR_PRO, STM32F405};
use controller::in_process::Board as Local;
use protocol::message::{JogWay, Request};

use super::emulated::{Emulated, sim};

/// Travel of 60 x 50 x 30 mm; switches 1 mm beyond; a plate at -21.3 mm.
pub(super) const MACHINE: &str = "lower=-1,-1,-31;upper=61,51,1;plate=-21.3;start=9,7,-4";

pub(super) const PROFILE: &str = "[machine]
velocity_max_mm_s = [60.0, 60.0, 30.0]
acceleration_max_mm_s2 = [1000.0, 1000.0, 500.0]
jerk_max_mm_s3 = [20000.0, 20000.0, 10000.0]
travel_mm = [[0.0, 60.0], [0.0, 50.0], [-30.0, 0.0]]
steps_per_mm = [400, 400, 400]
pulse_us = 2.0
direction_setup_us = 5.0
direction_inverted = [false, false, false]
homing_required = true
host_gone = \"finish\"
host_gone_ms = 1000.0

[home]
order = \"zxy\"
at_upper_end = [false, false, true]
position_mm = [-1.0, -1.0, 1.0]
seek_mm_s = [20.0, 20.0, 15.0]
approach_mm_s = [2.0, 2.0, 2.0]
back_off_mm = [2.0, 2.0, 2.0]
survives_off = false

[spindle]
max_rpm = 24000
at_speed_ms = 200.0
";

/// A board with the profile and its drives on.
struct Bench {
    emulated: Emulated,
    folder: tempfile::TempDir,
}

impl Bench {
    fn new(board: &'static Board, defects: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let emulated = Emulated::with_machine(board, &format!("{MACHINE};{defects}"));
        let bench = Self { emulated, folder };
        let profile = bench.file("machine.toml", PROFILE);
        let (is_done, said) = sim([
            "settings",
            "--port",
            &bench.emulated.port(),
            "--machine",
            &profile,
        ]);
        assert!(is_done && said.contains(PROFILE), "{said}");
        bench.operate(&["on"]);
        bench
    }

    fn file(&self, name: &str, text: &str) -> String {
        let path = self.folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    }

    fn tried(&self, words: &[&str]) -> (bool, String) {
        let port = self.emulated.port();
        sim([&["operate", "--port", &port], words].concat())
    }

    fn operate(&self, words: &[&str]) -> String {
        let (is_done, said) = self.tried(words);
        assert!(is_done, "{words:?}: {said}");
        said
    }

    fn json(&self, words: &[&str]) -> serde_json::Value {
        let said = self.operate(&[&["--json"], words].concat());
        serde_json::from_str(&said).unwrap_or_else(|error| panic!("{error}: {said}"))
    }
}

/// The digest of the same jog in this process, from the same position.
fn local_digest(at_nm: [i32; 3], nm: [i32; 3]) -> String {
    let profile = job_file::parse_profile("machine.toml", PROFILE).unwrap();
    let mut board = Local::<64>::new();
    let mut host = integration_tests::Host::default();
    board.receive(&host.next(&integration_tests::HELLO));
    for request in [
        Request::SetProfile(Some(machine::profile::for_board(&profile))),
        Request::Drives { on: true },
        Request::SetHome { home_nm: at_nm },
        Request::Jog {
            way: JogWay::By { nm },
            speed_mm_s: 1000.0,
        },
    ] {
        board.receive(&host.next(&request));
    }
    (0..900).for_each(|_| board.tick());
    format!("{:016x}", board.real_time().motion().digest)
}

#[test]
fn from_a_bare_board_to_a_placed_job() {
    let bench = Bench::new(&SKR_PRO, "bounce=6");
    let (is_done, said) = bench.tried(&["goto", "1,1,-1"]);
    assert!(!is_done && said.contains("not homed"), "{said}");
    let said = bench.operate(&["home"]);
    assert!(
        said.contains("homed") && said.contains("axes at 1, 1, -1 mm"),
        "{said}"
    );
    // Host and board, bit for bit.
    let jogged = bench.json(&["jog", "x+10"]);
    assert_eq!(jogged["at_mm"], serde_json::json!([11.0, 1.0, -1.0]));
    assert_eq!(
        jogged["digest"],
        local_digest([1_000_000, 1_000_000, -1_000_000], [10_000_000, 0, 0])
    );
    let (is_done, said) = bench.tried(&["jog", "x+60"]);
    assert!(
        !is_done && said.contains("outside its travel") && said.contains("R27"),
        "{said}"
    );
    // The part's top is the plate: touched by a ball of 3 mm.
    bench.operate(&["goto", "20,15,-15"]);
    let touched = bench.json(&["touch", "z-10", "--work", "2", "--radius", "3"]);
    let z = touched["work_mm"][1][2].as_f64().unwrap();
    assert!((z - (-21.3 - 3.0)).abs() < 0.006, "{z}");
    let zeroed = bench.json(&["zero", "xy", "--work", "2", "--at", "-1"]);
    assert_eq!(zeroed["work_mm"][1][0], 21.0);
    bench.operate(&["goto", "0,0,14", "--work", "2"]);
    let job = bench.file(
        "job.toml",
        "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, 6, 0], [0, 0, 0, 0], [0, 0, 0, 0]]\nrail1_mm = [[0, 0, 6, 0], [0, 0, 0, 2], [0, 0, 0, 0]]\n[tool]\nkind = \"ball\"\nradius_mm = 3\n[cut]\nfeed_mm_min = 900\nscallop_mm = 0.05\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n[spindle]\nrpm = 18000\ncoolant = true\n",
    );
    let port = bench.emulated.port();
    let (is_done, said) = sim(["run", &job, "--port", &port, "--work", "2"]);
    assert!(is_done && said.contains("bit for bit the same"), "{said}");
    assert!(said.contains("work offset 2"), "{said}");
    // Somewhere else on the machine the same job leaves the travel: reported before it starts.
    bench.operate(&["goto", "57,40,-5"]);
    bench.operate(&["zero", "xy", "--work", "3"]);
    bench.operate(&["zero", "z", "--work", "3", "--at", "14"]);
    let (is_done, said) = sim(["run", &job, "--port", &port, "--work", "3"]);
    assert!(!is_done && said.contains("leaves the travel"), "{said}");
    let at = bench.json(&["status"])["axes"]["at_mm"].clone();
    let ended = bench.emulated.end();
    ended.no_complaint();
    // The spindle turned during the run, at its speed, and stands now.
    let duty = |key: &str| ended.report[key].as_f64().unwrap();
    assert!((duty("spindle_duty_max") - 0.75).abs() < 1e-4);
    assert_eq!(duty("spindle_duty"), 0.0);
    for axis in 0..3 {
        let believed = at[axis].as_f64().unwrap();
        let really = ended.report["carriages_mm"][axis].as_f64().unwrap();
        assert!(
            (really - believed).abs() < 0.006,
            "{axis}: {believed}, really {really}"
        );
    }
}

/// What is wrong with a switch is said, with the input and what to do.
#[test]
fn defects_of_switches_are_named() {
    for (defect, axes, input, what) in [
        ("stuck=x-min", "x", "limit switch x-", "does not release"),
        ("never=y-min", "y", "limit switch y-", "was not found"),
        (
            "swap=x-min,x-max",
            "x",
            "limit switch x+",
            "is not the switch that was looked for",
        ),
        (
            "swap=x-min,y-min",
            "x",
            "limit switch y-",
            "is not the switch that was looked for",
        ),
        ("bounce=300", "z", "limit switch z+", "bounces"),
        (
            "reverse=y",
            "y",
            "limit switch y+",
            "is not the switch that was looked for",
        ),
    ] {
        let bench = Bench::new(&STM32F405, defect);
        let (is_done, said) = bench.tried(&["home", "--axes", axes]);
        assert!(
            !is_done && said.contains(input) && said.contains(what),
            "{defect}: {said}"
        );
        let status = bench.operate(&["status"]);
        assert!(status.contains("not homed"), "{status}");
        bench.emulated.end().no_complaint();
    }
}
