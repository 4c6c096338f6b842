//! A board's image on the models of its chip, and its output: the report, and every change of the pins.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use boards::{Axis, Board, Level, Line, Role, SKR_PRO, STM32F405};
use serde_json::Value;

/// Cycles of the core clock per microsecond during a run.
pub(super) const CYCLES_US: u64 = 168;
/// Cycles of the core clock per microsecond directly after a reset.
pub(super) const RESET_CYCLES_US: u64 = 16;
/// Cycles of a sampling period.
pub(super) const PERIOD: u64 = 1_000 * CYCLES_US;
/// Cycles of a byte on the line at 921 600 baud.
const BYTE: u64 = 1_820;
/// Time after a reset within which every output must be at rest, us.
pub(super) const REST_US: u64 = 100;

/// The programs that the tests run, built once together with an image for each board.
struct Built {
    chip: PathBuf,
    sim: PathBuf,
}

pub(super) fn workspace() -> PathBuf {
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

/// The tool.
pub(super) fn tool() -> PathBuf {
    built().sim.clone()
}

/// The image for a board.
pub(super) fn image(board: &Board) -> PathBuf {
    built();
    let image = format!("target/{}/thumbv7em-none-eabihf/release/firmware", board.build.1);
    workspace().join(image)
}

/// Runs the tool with these arguments and an empty standard input. Returns whether it succeeded, and its output.
pub(super) fn sim<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> (bool, String) {
    sim_typed(arguments, "")
}

/// Begins to run the tool with these arguments.
pub(super) fn begin_sim<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Child {
    Command::new(&built().sim)
        .args(arguments)
        .current_dir(workspace())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Runs the tool with these arguments and this standard input. Returns whether it succeeded, and its output.
pub(super) fn sim_typed<S: AsRef<std::ffi::OsStr>>(
    arguments: impl IntoIterator<Item = S>,
    typed: &str,
) -> (bool, String) {
    let mut child = begin_sim(arguments);
    // The end of standard input comes with the drop.
    child.stdin.take().unwrap().write_all(typed.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (
        output.status.success(),
        String::from_utf8_lossy(&said).into_owned(),
    )
}

/// A board's image in execution, as fast as the host allows.
pub(super) struct Emulated {
    board: &'static Board,
    child: Child,
    folder: tempfile::TempDir,
}

/// The output of an execution that has ended.
pub(super) struct Ended {
    pub(super) board: &'static Board,
    pub(super) report: Value,
    pub(super) edges: Vec<Edge>,
    /// Every step of a machine's carriages, if they were tracked: cycle, place in steps.
    pub(super) track: Vec<(u64, [i32; 3])>,
}

/// A change of a port's output levels or directions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) at: u64,
    port: usize,
    levels: u16,
    outputs: u16,
}

impl Emulated {
    pub(super) fn start(board: &'static Board, arguments: &[&str]) -> Self {
        Self::begin(board, &[&["--fast"], arguments].concat(), false)
    }

    /// Starts an execution in real time, for what waits for the host.
    pub(super) fn in_real_time(board: &'static Board) -> Self {
        Self::begin(board, &[], false)
    }

    /// The same, with a machine around the board.
    pub(super) fn with_machine(board: &'static Board, machine: &str) -> Self {
        Self::begin(board, &["--machine", machine], false)
    }

    /// The same, and each step of its carriages is kept.
    pub(super) fn tracked(board: &'static Board, machine: &str) -> Self {
        Self::begin(board, &["--machine", machine, "--track", "track"], false)
    }

    /// Has an event happen now.
    pub(super) fn happens(&mut self, event: &str) {
        let input = self.child.stdin.as_mut().unwrap();
        writeln!(input, "{event}").unwrap();
        input.flush().unwrap();
    }

    /// Starts an execution of another image that records every change of the outputs.
    pub(super) fn of_image(board: &'static Board, image: &Path, arguments: &[&str]) -> Self {
        Self::begin_image(board, image, &[&["--fast"], arguments].concat(), true)
    }

    fn begin(board: &'static Board, arguments: &[&str], is_recorded: bool) -> Self {
        Self::begin_image(board, &image(board), arguments, is_recorded)
    }

    fn begin_image(board: &'static Board, image: &Path, arguments: &[&str], is_recorded: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut command = Command::new(&built().chip);
        if is_recorded {
            command.arg("--edges").arg(folder.path().join("edges"));
        }
        // What it writes by a relative path goes there, too.
        let child = command
            .current_dir(folder.path())
            .arg(image)
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

    /// Starts an execution that records every change of the outputs.
    pub(super) fn recorded(board: &'static Board, arguments: &[&str]) -> Self {
        Self::begin(board, &[&["--fast"], arguments].concat(), true)
    }

    /// An event that happens now: an input of the board's table, as `door` or `x-min=closed`.
    pub(super) fn happen(&mut self, event: &str) {
        let input = self.child.stdin.as_mut().unwrap();
        writeln!(input, "{event}").and_then(|()| input.flush()).unwrap();
    }

    pub(super) fn port(&self) -> String {
        self.folder.path().join("line").to_str().unwrap().to_owned()
    }

    /// Runs a job by `cargo sim run` over the emulated line.
    pub(super) fn run(&self, job: &Path, home: &str) -> (bool, String) {
        sim([
            "run",
            job.to_str().unwrap(),
            "--port",
            &self.port(),
            "--home",
            home,
        ])
    }

    pub(super) fn status(&self) -> String {
        sim(["operate", "--port", &self.port(), "status"]).1
    }

    /// Ends the execution.
    pub(super) fn end(mut self) -> Ended {
        drop(self.child.stdin.take());
        self.wait()
    }

    /// Waits until the execution ends.
    pub(super) fn wait(mut self) -> Ended {
        // `Child::wait` would close the standard input, which ends the execution.
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
        let track = std::fs::read(self.folder.path().join("track")).unwrap_or_default();
        let track = track.chunks_exact(20).map(|bytes| {
            let word = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            let cycle = u64::from_le_bytes(bytes[..8].try_into().unwrap());
            (cycle, [word(8), word(12), word(16)])
        });
        Ended {
            board: self.board,
            report,
            edges: edges.unwrap_or_default(),
            track: track.collect(),
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

/// The level changes of a line: cycle, level. The level is None while the pin is not an output.
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
    // Those of peripherals are no outputs of the port.
    !line.role.is_input() && !matches!(line.role, Role::SerialTx | Role::SpindleSpeed)
}

impl Ended {
    pub(super) fn number(&self, key: &str) -> u64 {
        self.report[key]
            .as_u64()
            .unwrap_or_else(|| panic!("{key}: {}", self.report[key]))
    }

    /// Cycle of the first event of this name.
    pub(super) fn event(&self, what: &str) -> u64 {
        let event = self.report["events"]
            .as_array()
            .unwrap()
            .iter()
            .find(|event| event["what"] == what);
        event.unwrap_or_else(|| panic!("no {what}: {}", self.report["events"]))["cycle"]
            .as_u64()
            .unwrap()
    }

    pub(super) fn no_complaint(&self) {
        assert_eq!(
            self.number("complained"),
            0,
            "{}: {:#}",
            self.board.id,
            self.report["complaints"]
        );
    }

    /// No byte of the host was lost, and each was read within half of a byte's time: but for words that were written to flash meanwhile, which take longer than a byte.
    pub(super) fn no_byte_lost(&self) {
        assert_eq!(self.number("bytes_lost"), 0, "{:#}", self.report["notes"]);
        let wait = self.number("byte_wait_max_cycles");
        assert!(wait < BYTE / 2, "a byte waited {wait} cycles of {BYTE}");
    }

    pub(super) fn changes(&self, line: &Line) -> Vec<(u64, Option<bool>)> {
        changes(&self.edges, line)
    }

    /// Last level change of any output between two cycles. At the end, each pin must be an output at its inactive level.
    pub(super) fn rest_after(&self, from: u64, until: u64) -> u64 {
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

    /// Cycle of the first change of a step pin while the drives are on.
    pub(super) fn first_pulse(&self) -> u64 {
        let on = self.drives(true, 0).expect("the drives were on");
        let changes = Axis::ALL.map(|axis| self.changes(&self.board.axis(axis).step));
        let after = changes.iter().flatten().map(|(at, _)| *at).filter(|at| *at > on);
        after.min().expect("there were pulses")
    }

    /// Cycle of the last rising edge of a step pin before a cycle.
    pub(super) fn last_pulse(&self, until: u64) -> u64 {
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

    /// Cycle at which the last of the enable lines reached this state after a cycle; None if one did not.
    pub(super) fn drives(&self, on: bool, from: u64) -> Option<u64> {
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

/// A job file in a temporary folder.
pub(super) struct Job {
    _folder: tempfile::TempDir,
    pub(super) path: PathBuf,
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

    /// A sample job without a hold on a heartbeat timeout, because emulated time runs faster than the host's.
    pub(super) fn sample(name: &str, changes: &[(&str, &str)]) -> Self {
        let mut text = std::fs::read_to_string(workspace().join("jobs").join(name))
            .unwrap()
            .replace("host_gone = \"hold\"", "host_gone = \"finish\"");
        for (from, to) in changes {
            assert!(text.contains(from), "{name}: {from}");
            text = text.replace(from, to);
        }
        Self::new(&text)
    }

    /// A level square as in the bring-up guide, with these lines added to `[machine]`.
    pub(super) fn square(mm: f64, feed_mm_min: f64, machine: &str) -> Self {
        Self::new(&format!(
            "[surface]\nkind = \"ruled\"\nrail0_mm = [[0, 0, {mm}, 0], [0, 0, 0, 0], [0, 0, 0, 50]]\n\
             rail1_mm = [[0, 0, {mm}, 0], [0, 0, 0, {mm}], [0, 0, 0, 50]]\nu = [0, 1]\nv = [0, 1]\n\
             [tool]\nkind = \"ball\"\nradius_mm = 5\n\
             [cut]\nfeed_mm_min = {feed_mm_min}\nscallop_mm = 0.5\nalong = \"u\"\nside = \"up\"\npattern = \"zigzag\"\n\
             [machine]\nhome_mm = [0, 0, 60]\n{machine}"
        ))
    }

    pub(super) fn slow_square() -> Self {
        let limits = "velocity_max_mm_s = [20, 20, 10]\nacceleration_max_mm_s2 = [100, 100, 50]\njerk_max_mm_s3 = [1000, 1000, 500]";
        Self::square(
            20.0,
            600.0,
            &format!("{limits}\nsteps_per_mm = [400, 400, 400]\n"),
        )
    }
}
