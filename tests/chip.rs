//! The images for the boards, unchanged, on models of their chip (`host-sim/chip`): from the reset to the last pulse, with `cargo sim run` at the
//! other end of a pseudo-terminal. Needs Debian's `libunicorn2`; builds the images, the program that executes them and the tool.
//!
//! Time is the chip's: a machine that is busy makes these tests slower, and no figure in them other. `BLESS=1` writes the golden files anew.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use boards::{Axis, Board, Level, Line, Role, SKR_PRO, STM32F405};
use serde_json::Value;

/// The core's clock in a run, and right after a reset, cycles of a microsecond.
const CYCLES_US: u64 = 168;
const RESET_CYCLES_US: u64 = 16;
/// Cycles of a period, and of a byte on the line at 921 600 baud.
const PERIOD: u64 = 1_000 * CYCLES_US;
const BYTE: u64 = 1_820;
/// Time after a reset by which every output has to be at rest.
const REST_US: u64 = 100;

/// Built once: the emulator, the tool, an image for each board.
struct Built {
    chip: PathBuf,
    sim: PathBuf,
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn cargo(arguments: &[&str]) {
    let done = Command::new(env!("CARGO"))
        .args(arguments)
        .arg("--quiet")
        .current_dir(workspace())
        .status()
        .unwrap();
    assert!(done.success(), "cargo {arguments:?}");
}

fn built() -> &'static Built {
    static BUILT: OnceLock<Built> = OnceLock::new();
    BUILT.get_or_init(|| {
        // With a test: Cargo then chooses the same features as for `cargo test`, and what that has built is not built again.
        cargo(&[
            "build",
            "--bin",
            "chip",
            "--bin",
            "host-sim",
            "--test",
            "integration",
        ]);
        for board in [&STM32F405, &SKR_PRO] {
            cargo(&[board.build.0]);
        }
        let debug = workspace().join("target/debug");
        Built {
            chip: debug.join("chip"),
            sim: debug.join("host-sim"),
        }
    })
}

/// The tool with these arguments; standard input is empty. Returns whether it succeeded, and its output.
fn sim<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> (bool, String) {
    let output = Command::new(&built().sim)
        .args(arguments)
        .current_dir(workspace())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.success(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

/// A board's image at work, as fast as it goes.
struct Emulated {
    board: &'static Board,
    child: Child,
    folder: tempfile::TempDir,
}

/// Its remaining output.
struct Ended {
    board: &'static Board,
    report: Value,
    edges: Vec<Edge>,
}

/// A change of a port's outputs.
#[derive(Clone, Copy, Debug)]
struct Edge {
    at: u64,
    port: usize,
    levels: u16,
    outputs: u16,
}

impl Emulated {
    fn start(board: &'static Board, arguments: &[&str]) -> Self {
        Self::begin(board, arguments, false)
    }

    fn begin(board: &'static Board, arguments: &[&str], is_recorded: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let image = format!("target/{}/thumbv7em-none-eabihf/release/firmware", board.build.1);
        let mut command = Command::new(&built().chip);
        if is_recorded {
            command.arg("--edges").arg(folder.path().join("edges"));
        }
        let child = command
            .arg(workspace().join(image))
            .arg("--fast")
            .arg("--pty")
            .arg(folder.path().join("line"))
            .arg("--report")
            .arg(folder.path().join("report"))
            .args(arguments)
            .stdin(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut emulated = Self { board, child, folder };
        let deadline = Instant::now() + Duration::from_secs(600);
        while !emulated.folder.path().join("line").exists() {
            assert!(
                emulated.child.try_wait().unwrap().is_none(),
                "the program ended: is libunicorn2 installed?"
            );
            assert!(Instant::now() < deadline);
            std::thread::sleep(Duration::from_millis(2));
        }
        emulated
    }

    /// With a record of every change of the outputs.
    fn recorded(board: &'static Board, arguments: &[&str]) -> Self {
        Self::begin(board, arguments, true)
    }

    fn port(&self) -> String {
        self.folder.path().join("line").to_str().unwrap().to_owned()
    }

    /// `cargo sim run` through its line.
    fn run(&self, job: &Path, home: &str) -> (bool, String) {
        sim([
            "run",
            job.to_str().unwrap(),
            "--port",
            &self.port(),
            "--home",
            home,
        ])
    }

    fn status(&self) -> String {
        sim(["operate", "--port", &self.port(), "status"]).1
    }

    /// Ends it.
    fn end(mut self) -> Ended {
        drop(self.child.stdin.take());
        self.wait()
    }

    /// Waits for its end.
    fn wait(mut self) -> Ended {
        // `Child::wait` would close its input, which is its end.
        let status = loop {
            match self.child.try_wait().unwrap() {
                Some(status) => break status,
                None => std::thread::sleep(Duration::from_millis(5)),
            }
        };
        assert!(
            matches!(status.code(), Some(0 | 1)),
            "the program that executes images: {status}"
        );
        let report: Value =
            serde_json::from_slice(&std::fs::read(self.folder.path().join("report")).unwrap()).unwrap();
        let edges = std::fs::read(self.folder.path().join("edges"));
        let edges = edges.map(|bytes| bytes.chunks_exact(16).map(Edge::read).collect());
        Ended {
            board: self.board,
            report,
            edges: edges.unwrap_or_default(),
        }
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Edge {
    fn read(bytes: &[u8]) -> Self {
        let half = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        Self {
            at: u64::from_le_bytes(bytes[..8].try_into().unwrap()),
            port: bytes[8].into(),
            levels: half(10),
            outputs: half(12),
        }
    }
}

/// The changes of a line: cycle, level; None while it is no output.
fn changes(edges: &[Edge], line: &Line) -> Vec<(u64, Option<bool>)> {
    let bit = 1 << line.pin.number;
    let mut changes = vec![(0, None)];
    for edge in edges.iter().filter(|edge| edge.port == line.pin.port.index()) {
        let level = (edge.outputs & bit != 0).then_some(edge.levels & bit != 0);
        if changes.last().is_some_and(|last| last.1 != level) {
            changes.push((edge.at, level));
        }
    }
    changes
}

fn is_output(line: &Line) -> bool {
    !line.role.is_input() && line.role != Role::SerialTx
}

impl Ended {
    fn number(&self, key: &str) -> u64 {
        self.report[key]
            .as_u64()
            .unwrap_or_else(|| panic!("{key}: {}", self.report[key]))
    }

    /// Cycle of an event.
    fn event(&self, what: &str) -> u64 {
        let event = self.report["events"]
            .as_array()
            .unwrap()
            .iter()
            .find(|event| event["what"] == what);
        event.unwrap_or_else(|| panic!("no {what}: {}", self.report["events"]))["cycle"]
            .as_u64()
            .unwrap()
    }

    fn no_complaint(&self) {
        assert_eq!(
            self.number("complained"),
            0,
            "{}: {:#}",
            self.board.id,
            self.report["complaints"]
        );
    }

    /// No byte of the host was lost, and none was near it.
    fn no_byte_lost(&self) {
        assert_eq!(self.number("bytes_lost"), 0, "{:#}", self.report["notes"]);
        let wait = self.number("byte_wait_max_cycles");
        assert!(wait < BYTE / 2, "a byte waited {wait} cycles of {BYTE}");
    }

    fn changes(&self, line: &Line) -> Vec<(u64, Option<bool>)> {
        changes(&self.edges, line)
    }

    /// When the last of the outputs came to rest for good after a cycle; each had to be an output at its inactive level, or to be let go.
    fn rest_after(&self, from: u64, until: u64) -> u64 {
        let mut last = from;
        for line in self.board.lines.iter().filter(|line| is_output(line)) {
            let inactive = Some(line.active == Level::Low);
            let changes = self.changes(line);
            let at_end = changes.iter().rfind(|(at, _)| *at <= until).unwrap();
            assert_eq!(
                at_end.1, inactive,
                "{}: {} {}",
                self.board.id, line.role, line.pin
            );
            if at_end.0 >= from {
                last = last.max(at_end.0);
            }
        }
        last
    }

    /// The last rise of a step pin before a cycle.
    fn last_pulse(&self, until: u64) -> u64 {
        let rises = Axis::ALL.map(|axis| {
            let changes = self.changes(&self.board.axis(axis).step);
            changes
                .into_iter()
                .filter(|(at, level)| *level == Some(true) && *at < until)
                .map(|(at, _)| at)
                .max()
        });
        rises.into_iter().flatten().max().expect("there were pulses")
    }

    /// When the enable lines went to this state, all of them, after a cycle.
    fn drives(&self, on: bool, from: u64) -> Option<u64> {
        let mut last = 0;
        for axis in Axis::ALL {
            let line = self.board.axis(axis).enable;
            let wanted = Some(on == (line.active == Level::High));
            let change = self
                .changes(&line)
                .into_iter()
                .find(|(at, level)| *at >= from && *level == wanted)?;
            last = last.max(change.0);
        }
        Some(last)
    }
}

/// A job file in a folder of its own.
struct Job {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Job {
    fn new(text: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("job.toml");
        std::fs::write(&path, text).unwrap();
        Self {
            _folder: folder,
            path,
        }
    }

    /// A sample job that no host can be gone for: time here runs faster than the host's.
    fn sample(name: &str, changes: &[(&str, &str)]) -> Self {
        let mut text = std::fs::read_to_string(workspace().join("jobs").join(name))
            .unwrap()
            .replace("host_gone = \"hold\"", "host_gone = \"finish\"");
        for (from, to) in changes {
            assert!(text.contains(from), "{name}: {from}");
            text = text.replace(from, to);
        }
        Self::new(&text)
    }

    /// A level square in the air, as in the guide, with these lines for [machine].
    fn square(mm: f64, feed_mm_min: f64, machine: &str) -> Self {
        Self::new(&format!(
            "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, {mm}, 0], [0, 0, 0, 0], [0, 0, 0, 50]]\n\
             rail1_mm = [[0, 0, {mm}, 0], [0, 0, 0, {mm}], [0, 0, 0, 50]]\nu = [0, 1]\nv = [0, 1]\n\
             [tool]\nkind = \"ball\"\nradius_mm = 5\n\
             [cut]\nfeed_mm_min = {feed_mm_min}\nscallop_mm = 0.5\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n\
             [machine]\nhome_mm = [0, 0, 60]\n{machine}"
        ))
    }

    fn slow_square() -> Self {
        let limits = "velocity_max_mm_s = [20, 20, 10]\nacceleration_max_mm_s2 = [100, 100, 50]\njerk_max_mm_s3 = [1000, 1000, 500]";
        Self::square(
            20.0,
            600.0,
            &format!("{limits}\nsteps_per_mm = [400, 400, 400]\n"),
        )
    }
}

#[test]
fn the_images_boot_as_their_registers_say() {
    for board in [&STM32F405, &SKR_PRO] {
        let ended = Emulated::recorded(board, &["--ms", "80"]).wait();
        ended.no_complaint();
        assert_eq!(ended.report["hclk_hz"], 168e6);
        assert!(ended.number("periods") > 50 && ended.report["watchdog_gap_max_ms"].as_f64().unwrap() < 1.01);
        let rest = ended.rest_after(0, REST_US * RESET_CYCLES_US);
        assert!(rest > 0, "the outputs were set");
        let lines: Vec<_> = ended.report["registers"]
            .as_array()
            .unwrap()
            .iter()
            .map(|line| line.as_str().unwrap())
            .collect();
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("golden/chip_{}.txt", board.id));
        let text = lines.join("\n") + "\n";
        if std::env::var_os("BLESS").is_some() {
            std::fs::write(&golden, &text).unwrap();
        }
        assert_eq!(
            text,
            std::fs::read_to_string(&golden).unwrap(),
            "{}: BLESS=1 writes it",
            board.id
        );
    }
}

#[test]
fn without_a_crystal_everything_stays_at_rest() {
    let ended = Emulated::recorded(&SKR_PRO, &["--ms", "200", "--no-crystal"]).wait();
    ended.no_complaint();
    assert_eq!(
        (ended.report["hclk_hz"].as_f64(), ended.number("periods")),
        (Some(16e6), 0)
    );
    ended.rest_after(0, REST_US * RESET_CYCLES_US);
    let changed = ended
        .edges
        .iter()
        .filter(|edge| edge.at > REST_US * RESET_CYCLES_US)
        .count();
    assert_eq!(changed, 0);
}

/// A whole sample job over the line: every sample the same, no byte lost, no tick late.
fn whole(board: &'static Board, name: &str, home: &str, seed: &str) {
    let emulated = Emulated::start(board, &["--seed", seed]);
    let (done, said) = emulated.run(&Job::sample(name, &[]).path, home);
    let ended = emulated.end();
    assert!(
        done && said.contains("bit for bit the same"),
        "{said}\n{:#}",
        ended.report["notes"]
    );
    ended.no_complaint();
    ended.no_byte_lost();
    assert_eq!(ended.number("resets"), 0);
    let (tick, receive) = (&ended.report["tim2"], &ended.report["usart1"]);
    println!(
        "{}, {name}: {tick}; {receive}; {} cycles",
        board.id, ended.report["byte_wait_max_cycles"]
    );
    // Nothing but the receiver and a lock of the idle task holds a tick up.
    assert!(
        tick["latency_max_cycles"].as_u64().unwrap() < 10 * CYCLES_US,
        "{tick}"
    );
}

#[test]
fn torus_on_the_stm32f405() {
    whole(&STM32F405, "torus.toml", "0,0,60", "1");
}

#[test]
fn torus_on_the_skr_pro() {
    whole(&SKR_PRO, "torus.toml", "0,0,60", "2");
}

#[test]
fn plate_machine_on_the_stm32f405() {
    whole(&STM32F405, "plate_machine.toml", "40,30,40", "3");
}

#[test]
fn plate_machine_on_the_skr_pro() {
    whole(&SKR_PRO, "plate_machine.toml", "40,30,40", "4");
}

/// The operator's script in lockstep: on a coarser plate and four times as fast here, whole in `the_whole_script`.
#[test]
fn the_operators_script() {
    let job = Job::sample("plate_machine.toml", &[("scallop_mm = 0.05 ", "scallop_mm = 2 ")]);
    let text = std::fs::read_to_string(workspace().join("jobs/operator.txt")).unwrap();
    let faster: Vec<_> = text
        .lines()
        .map(
            |line| match line.strip_prefix("tick ").and_then(|rest| rest.split_once(':')) {
                Some((tick, action)) => format!("tick {}:{action}", tick.parse::<u32>().unwrap() / 4),
                None => line.to_owned(),
            },
        )
        .collect();
    let script = job.path.with_file_name("script.txt");
    std::fs::write(&script, faster.join("\n")).unwrap();
    scripted("stm32f405", &job, &script);
}

#[test]
#[ignore = "half a minute on each image"]
fn the_whole_script() {
    let job = Job::sample("plate_machine.toml", &[]);
    for board in ["stm32f405", "skr-pro"] {
        scripted(board, &job, &workspace().join("jobs/operator.txt"));
    }
}

fn scripted(board: &str, job: &Job, script: &Path) {
    let (done, said) = sim([
        "run",
        job.path.to_str().unwrap(),
        "--chip",
        board,
        "--fast",
        "--script",
        script.to_str().unwrap(),
    ]);
    assert!(done && said.contains("the same"), "{said}");
}

/// A pulse: its rise, its fall, and the level of the direction pin meanwhile.
struct Pulse {
    rise: u64,
    fall: u64,
    direction: bool,
}

fn pulses(ended: &Ended, axis: Axis) -> Vec<Pulse> {
    let lines = ended.board.axis(axis);
    let (steps, turns) = (ended.changes(&lines.step), ended.changes(&lines.direction));
    let mut turn = 0;
    let mut found = Vec::new();
    for pair in steps.windows(2).filter(|pair| pair[0].1 == Some(true)) {
        let (rise, fall) = (pair[0].0, pair[1].0);
        while turn + 1 < turns.len() && turns[turn + 1].0 <= rise {
            turn += 1;
        }
        let direction = turns[turn].1.expect("the direction pin is an output");
        assert!(
            turns.get(turn + 1).is_none_or(|next| next.0 >= fall),
            "{axis:?}: the direction changes within a pulse"
        );
        found.push(Pulse {
            rise,
            fall,
            direction,
        });
    }
    found
}

/// Samples of a job, nm.
fn samples(job: &Job) -> Vec<[i64; 3]> {
    let trace = job.path.with_file_name("trace.csv");
    let (done, said) = sim([
        "simulate",
        job.path.to_str().unwrap(),
        "--trace",
        trace.to_str().unwrap(),
    ]);
    assert!(done, "{said}");
    let text = std::fs::read_to_string(trace).unwrap();
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().unwrap().split(',').collect();
    let columns = ["cl_x_nm", "cl_y_nm", "cl_z_nm"]
        .map(|wanted| names.iter().position(|name| *name == wanted).unwrap());
    let row = |line: &str| {
        let cells: Vec<_> = line.split(',').collect();
        columns.map(|column| cells[column].parse().unwrap())
    };
    lines.map(row).collect()
}

/// Every pulse and direction edge of a run at up to 500 kHz against the samples: after each period, the steps taken are those of the sample; the
/// last ones to the step. Towards plus, a direction pin has the level that the board's table names, or the other where the job inverts it.
#[test]
fn pulses_are_the_samples_up_to_500_khz() {
    const STEPS_MM: [i64; 3] = [5000, 400, 640];
    const INVERTED: [bool; 3] = [false, true, false];
    const PULSE_US: u64 = 1;
    const SETUP_US: u64 = 5;
    let job = Job::square(
        40.0,
        6000.0,
        "velocity_max_mm_s = [100, 100, 50]\nacceleration_max_mm_s2 = [2000, 1000, 500]\njerk_max_mm_s3 = [100000, 20000, 10000]\n\
         steps_per_mm = [5000, 400, \"3200/5\"]\npulse_us = 1\ndirection_setup_us = 5\ndirection_inverted = [false, true, false]\n",
    );
    let samples = samples(&job);
    for board in [&STM32F405, &SKR_PRO] {
        let emulated = Emulated::recorded(board, &["--seed", "5"]);
        let (done, said) = emulated.run(&job.path, "0,0,60");
        let ended = emulated.end();
        assert!(done, "{said}");
        ended.no_complaint();
        ended.no_byte_lost();
        let of_axes = Axis::ALL.map(|axis| pulses(&ended, axis));
        let first = of_axes
            .iter()
            .filter_map(|pulses| Some(pulses.first()?.rise))
            .min()
            .unwrap();
        let begin = ended.number("slots_from_cycle");
        let mut shortest = u64::MAX;
        for (axis, pulses) in Axis::ALL.into_iter().zip(&of_axes) {
            let line = board.axis(axis);
            for pulse in pulses {
                assert!(
                    pulse.fall - pulse.rise >= PULSE_US * CYCLES_US,
                    "{axis:?}: a pulse of {} cycles",
                    pulse.fall - pulse.rise
                );
            }
            for pair in pulses.windows(2) {
                assert!(
                    pair[1].rise - pair[0].fall >= PULSE_US * CYCLES_US,
                    "{axis:?}: a pause"
                );
                shortest = shortest.min(pair[1].rise - pair[0].rise);
            }
            for (at, _) in ended
                .changes(&line.direction)
                .into_iter()
                .filter(|(at, _)| *at > begin)
            {
                let next = pulses.partition_point(|pulse| pulse.rise < at);
                assert!(
                    pulses
                        .get(next)
                        .is_none_or(|pulse| pulse.rise - at >= SETUP_US * CYCLES_US),
                    "{axis:?}: set-up"
                );
            }
        }
        assert_eq!(shortest, 2 * CYCLES_US, "500 kHz are reached");
        // A sample's steps go out in a period that is so many after the first pulse's; found by the first axis, held by all.
        let plus = |axis: Axis| (board.axis(axis).direction.active == Level::High) != INVERTED[axis as usize];
        // Position after each pulse.
        let positions = Axis::ALL.map(|axis| {
            let step = |pulse: &Pulse| if pulse.direction == plus(axis) { 1 } else { -1 };
            let steps = of_axes[axis as usize].iter().map(step);
            let sum = |position: &mut i64, step: i64| {
                *position += step;
                Some(*position)
            };
            steps.scan(0, sum).collect::<Vec<i64>>()
        });
        let taken = |axis: Axis, until: u64| -> i64 {
            let count = of_axes[axis as usize].partition_point(|pulse| pulse.rise < until);
            count
                .checked_sub(1)
                .map_or(0, |last| positions[axis as usize][last])
        };
        let steps_nm = |axis: Axis, tick: usize| {
            (samples[tick][axis as usize] - samples[0][axis as usize]) * STEPS_MM[axis as usize]
        };
        let first_period = (first - begin) / PERIOD;
        let first_moved = (0..samples.len())
            .find(|tick| {
                Axis::ALL
                    .iter()
                    .any(|axis| steps_nm(*axis, *tick).abs() > 500_000)
            })
            .unwrap() as u64;
        let worst = |shift: u64| {
            let mut worst = 0;
            for tick in (first_moved as usize..samples.len())
                .step_by(7)
                .chain([samples.len() - 1])
            {
                let until = begin + (first_period + 1 + tick as u64 + shift - first_moved) * PERIOD;
                for axis in Axis::ALL {
                    worst = worst.max((taken(axis, until) * 1_000_000 - steps_nm(axis, tick)).abs());
                }
            }
            worst
        };
        let (off, shift) = (0..3).map(|shift| (worst(shift), shift)).min().unwrap();
        println!(
            "{}: {off} millionths of a step, shift {shift}; {} pulses",
            board.id,
            of_axes.iter().map(Vec::len).sum::<usize>()
        );
        assert!(
            off <= 1_000_000,
            "{}: {off} millionths of a step off, with a shift of {shift}",
            board.id
        );
        for axis in Axis::ALL {
            let left = (taken(axis, u64::MAX) * 1_000_000 - steps_nm(axis, samples.len() - 1)).abs();
            assert!(
                left <= 510_000,
                "{axis:?}: {left} millionths of a step at the end"
            );
        }
    }
}

/// A run in which something happens a third of a second after the first pulse; what the host says, and then the board's status.
fn disturbed(board: &'static Board, what: &str) -> (Ended, String, String) {
    let emulated = Emulated::recorded(board, &["--seed", "6", "--at", &format!("motion+333.3:{what}")]);
    let (done, said) = emulated.run(&Job::slow_square().path, "0,0,60");
    assert!(!done, "{what}: {said}");
    let status = emulated.status();
    let ended = emulated.end();
    ended.no_complaint();
    // A processor that has stopped hears nothing.
    if ended.number("resets") == 0 {
        ended.no_byte_lost();
    }
    (ended, said, status)
}

/// Emergency stop and drive fault switch the drives off: immediately, and after three ticks. A limit switch stops the run along its path.
#[test]
fn each_safety_input_stops_the_run() {
    // From the edge on: the next tick and the time it takes; two more for a third look.
    let at_once = PERIOD + 100 * CYCLES_US;
    let (board, every) = (
        &STM32F405,
        [
            "emergency-stop",
            "drive-fault",
            "x-min",
            "x-max",
            "y-min",
            "y-max",
            "z-min",
            "z-max",
        ],
    );
    let some = ["emergency-stop", "drive-fault", "z-max"];
    for (board, input) in every
        .map(|input| (board, input))
        .into_iter()
        .chain(some.map(|input| (&SKR_PRO, input)))
    {
        let (ended, said, status) = disturbed(board, input);
        let event = ended.event(input);
        let off = ended.drives(false, event).map(|at| at - event);
        match input {
            "emergency-stop" => assert!(off.is_some_and(|off| off <= at_once), "{off:?}"),
            "drive-fault" => assert!(
                off.is_some_and(|off| (2 * PERIOD..=at_once + 2 * PERIOD).contains(&off)),
                "{off:?}"
            ),
            _ => {
                assert_eq!(off, None, "{input}: the drives hold");
                // 10 mm/s at 100 mm/s^2 and 1000 mm/s^3: 0.2 s.
                let stopped = ended.last_pulse(u64::MAX) - event;
                assert!(
                    (2 * PERIOD..400 * PERIOD).contains(&stopped),
                    "{input}: {stopped}"
                );
            }
        }
        let name = if input.contains('-') && input.len() == 5 {
            "limit"
        } else {
            &input.replace('-', " ")
        };
        assert!(
            said.contains(name) && status.contains(name),
            "{input}: {said}\n{status}"
        );
    }
}

/// The watchdog resets a chip whose processor hangs, 8 to 23 ms after it was last fed, at any LSI frequency; pulses stop earlier.
#[test]
fn a_processor_that_hangs_is_reset() {
    for (lsi_hz, us) in [("47000", 8_000), ("32000", 11_750), ("17000", 22_118)] {
        let emulated = Emulated::recorded(&STM32F405, &["--lsi-hz", lsi_hz, "--at", "motion+333.3:hang"]);
        let (done, said) = emulated.run(&Job::slow_square().path, "0,0,60");
        assert!(!done, "{said}");
        let status = emulated.status();
        let ended = emulated.end();
        ended.no_complaint();
        let (hang, reset) = (ended.event("hang"), ended.event("reset"));
        assert!(
            ended.last_pulse(reset) - hang <= 2 * PERIOD,
            "what was worked out, and no more"
        );
        let after_us = (reset - hang) / CYCLES_US;
        assert!(
            (us - 1_100..=us + 10).contains(&after_us),
            "{lsi_hz} Hz: {after_us} us"
        );
        let rest = ended.rest_after(reset, reset + REST_US * RESET_CYCLES_US);
        assert!(rest > reset, "the outputs were let go, and set again");
        assert!(status.contains("last reset: watchdog"), "{status}");
    }
}

/// A hard fault: outputs at rest first, then the log, then the watchdog.
#[test]
fn a_hard_fault_puts_the_outputs_to_rest() {
    let (ended, _, status) = disturbed(&SKR_PRO, "fault");
    let (fault, reset) = (ended.event("fault"), ended.event("reset"));
    assert_eq!(ended.number("hard_faults"), 1);
    let off = ended.drives(false, fault).unwrap() - fault;
    assert!(off <= 20 * CYCLES_US, "{off} cycles");
    assert!(ended.last_pulse(reset) - fault <= 2 * PERIOD);
    assert!(status.contains("last reset: watchdog"), "{status}");
}

/// Brown-out: the outputs float, are inactive again within 100 us, and stay inactive; the status reports the cause.
#[test]
fn a_brown_out_leaves_everything_at_rest() {
    for board in [&STM32F405, &SKR_PRO] {
        let (ended, _, status) = disturbed(board, "brown-out");
        let reset = ended.event("reset");
        assert_eq!(ended.number("resets"), 1);
        let rest = ended.rest_after(reset, reset + REST_US * RESET_CYCLES_US);
        assert!(rest > reset);
        assert_eq!(ended.drives(true, reset), None, "no drive is on afterwards");
        assert!(status.contains("brown"), "{status}");
    }
}
