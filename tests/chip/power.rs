//! A supply that fails while a job runs on the flashed image, with a machine around it: home, touch-off, job, cuts, and after each of them home and resume, to the finished part.
//! The carriages pass every place of the passes, and nothing is machined twice but the last moments before a cut. In real time, because the host keeps a motion going.

use std::collections::HashMap;
use std::path::Path;

use boards::SKR_PRO;

use super::emulated::{Emulated, sim};
use super::machine::{MACHINE, PROFILE};
use super::settings::session;

/// A surface of 20 x 6 mm, some passes of it.
const JOB: &str = "[surface]
kind = \"ruled\"
rail0_mm = [[0, 0, 20, 0], [0, 0, 0, 0], [0, -2, 2, 0]]
rail1_mm = [[0, 0, 20, 0], [0, 0, 0, 6], [0, -2, 2, 0]]
[tool]
kind = \"ball\"
radius_mm = 3
[cut]
feed_mm_min = 900
scallop_mm = 0.05
along = \"u\"
side = \"up\"
pattern = \"zigzag\"
";
const FEED_MM_S: f64 = 15.0;
const STEPS_PER_MM: f64 = 400.0;

/// Time from the drives' loss of power to the voltage detector's level, ms.
const LAG_MS: u32 = 60;
/// Longest way machined again after a cut with time for a record, mm: 150 periods at the feed, a few periods until the record is written, and the last half millimetre of a
/// pass, whose places are not recorded.
const AGAIN_MAX_MM: f64 = FEED_MM_S * 0.155 + 0.55;

struct Bench {
    emulated: Emulated,
    folder: tempfile::TempDir,
}

impl Bench {
    /// Homed, with a work offset at the plate. The switches do not bounce: each home is the same to a step, and a short one is as good.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bench = Self {
            emulated: Emulated::tracked(&SKR_PRO, MACHINE),
            folder,
        };
        let profile = PROFILE.replace("back_off_mm = [2.0, 2.0, 2.0]", "back_off_mm = [1.5, 1.5, 1.5]");
        std::fs::write(bench.file("machine.toml"), profile).unwrap();
        std::fs::write(bench.file("job.toml"), JOB).unwrap();
        let port = bench.emulated.port();
        let (is_done, said) = sim([
            "settings",
            "--port",
            &port,
            "--machine",
            &bench.file("machine.toml"),
        ]);
        assert!(is_done, "{said}");
        bench.home();
        bench.operate(&["goto", "20,15,-15"]);
        bench.operate(&["touch", "z-10", "--work", "1", "--radius", "3"]);
        bench.operate(&["zero", "xy", "--work", "1"]);
        bench.operate(&["goto", "20,15,-10"]);
        bench
    }

    fn file(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    fn operate(&self, words: &[&str]) {
        let port = self.emulated.port();
        let (is_done, said) = sim([&["operate", "--port", &port], words].concat());
        assert!(is_done, "{words:?}: {said}");
    }

    fn home(&self) {
        // After a cut the board may erase a sector before it answers: on a busy machine for longer than the tool's patience.
        drop(session(&self.emulated, 1));
        self.operate(&["on"]);
        self.operate(&["home"]);
    }

    /// The command that runs the job, with what else it is given.
    fn command(&self, words: &[&str]) -> Vec<String> {
        let (job, port) = (self.file("job.toml"), self.emulated.port());
        let all = [&["run", &job, "--port", &port, "--work", "1"], words].concat();
        all.into_iter().map(str::to_owned).collect()
    }

    fn runs(&self, words: &[&str]) -> String {
        let (is_done, said) = sim(self.command(words));
        assert!(is_done && said.contains("bit for bit the same"), "{said}");
        said
    }
}

/// The way of the tool on the passes, in steps of the carriages, and where each place comes in it.
struct Way {
    places: Vec<[i32; 3]>,
    arcs_mm: Vec<f64>,
    cells: HashMap<[i32; 3], Vec<usize>>,
    /// Least height above all passes, and arc of the longest pass.
    above: i32,
    pass_mm: f64,
}

/// Places are the same to within this number of steps.
const NEAR: i32 = 3;
/// Steps of the way between two places of a run that is complete.
const GAP: usize = 8;

/// What of a trace's row matters here.
struct Row {
    is_running: bool,
    pass: u32,
    cl_nm: [f64; 3],
}

impl Row {
    fn all(trace: &Path) -> Vec<Self> {
        let text = std::fs::read_to_string(trace).unwrap();
        let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let header = lines.next().unwrap();
        let column = |name: &str| header.iter().position(|head| *head == name).unwrap();
        let [state, pass] = ["state", "pass"].map(column);
        let cl = ["cl_x_nm", "cl_y_nm", "cl_z_nm"].map(column);
        let row = |line: Vec<&str>| Self {
            is_running: line[state] == "running",
            pass: line[pass].parse().unwrap(),
            cl_nm: cl.map(|column| line[column].parse().unwrap()),
        };
        lines.map(row).collect()
    }
}

impl Way {
    /// That of a trace: what the host has computed. `end`: the carriages at its end.
    fn new(trace: &Path, end: [i32; 3]) -> Self {
        let rows = Row::all(trace);
        let last = rows.last().unwrap().cl_nm;
        // Machine and carriages count from other places.
        let steps = |row: &Row| {
            [0, 1, 2].map(|axis| (row.cl_nm[axis] - last[axis]) * 1e-6 * STEPS_PER_MM + f64::from(end[axis]))
        };
        let mut way = Self {
            places: Vec::new(),
            arcs_mm: Vec::new(),
            cells: HashMap::new(),
            above: i32::MIN,
            pass_mm: 0.0,
        };
        let (mut arc_mm, mut began_mm) = (0.0, 0.0);
        let rows: Vec<&Row> = rows.iter().filter(|row| row.is_running).collect();
        for pair in rows.windows(2) {
            if pair[0].pass != pair[1].pass {
                began_mm = arc_mm;
                continue;
            }
            let [from, to] = [steps(pair[0]), steps(pair[1])];
            let apart = [0, 1, 2].map(|axis| to[axis] - from[axis]);
            let length = apart.iter().map(|apart| apart * apart).sum::<f64>().sqrt();
            let parts = length.ceil().max(1.0);
            for part in 0..parts as u32 {
                let at = [0, 1, 2].map(|axis| from[axis] + apart[axis] * f64::from(part) / parts);
                way.add(
                    at.map(|at| at.round() as i32),
                    arc_mm + length * f64::from(part) / parts / STEPS_PER_MM,
                );
            }
            arc_mm += length / STEPS_PER_MM;
            way.pass_mm = way.pass_mm.max(arc_mm - began_mm);
        }
        way
    }

    fn add(&mut self, at: [i32; 3], arc_mm: f64) {
        if self.places.last() == Some(&at) {
            return;
        }
        self.above = self.above.max(at[2] + NEAR + 1);
        let cell = at.map(|steps| steps.div_euclid(NEAR));
        self.cells.entry(cell).or_default().push(self.places.len());
        self.places.push(at);
        self.arcs_mm.push(arc_mm);
    }

    /// Where a place comes in the way; none beside it.
    fn index(&self, at: [i32; 3]) -> Option<usize> {
        let cell = at.map(|steps| steps.div_euclid(NEAR));
        let near = |index: &&usize| (0..3).all(|axis| (self.places[**index][axis] - at[axis]).abs() <= NEAR);
        let apart = |index: &usize| {
            (0..3)
                .map(|axis| (self.places[*index][axis] - at[axis]).pow(2))
                .sum::<i32>()
        };
        let around = (0..27).flat_map(|number| {
            let there = [number / 9, number / 3 % 3, number % 3].map(|part| part - 1);
            let cell = [0, 1, 2].map(|axis| cell[axis] + there[axis]);
            self.cells.get(&cell).into_iter().flatten()
        });
        around.filter(near).min_by_key(|index| apart(index)).copied()
    }

    /// Indices of the way's places that a track passes, ascending, from the first time at which it is above all passes: before that, a run leaves the place of the last run.
    fn passed(&self, track: &[(u64, [i32; 3])]) -> Vec<usize> {
        let begin = track.iter().position(|(_, at)| at[2] > self.above);
        let track = begin.map_or(&[][..], |begin| &track[begin..]);
        let mut passed: Vec<usize> = track.iter().filter_map(|(_, at)| self.index(*at)).collect();
        passed.sort_unstable();
        passed.dedup();
        passed
    }
}

/// Pulses of all axes until the drives let go, and how long the supply holds from the low voltage on, ms: enough for a record, or not. The first is on the way to the passes; one
/// comes on the way back to where another cut was.
const CUTS: [(u32, u32); 8] = [
    (3_000, 4),
    (25_000, 4),
    (4_000, 4),
    (27_311, 0),
    (30_017, 3),
    (33_503, 4),
    (33_333, 0),
    (41_001, 4),
];

#[test]
fn a_part_is_finished_after_power_cuts() {
    let whole = Bench::new();
    let trace = whole.file("trace.csv");
    whole.runs(&["--trace", &trace]);
    let Bench { emulated, folder } = whole;
    let ended = emulated.end();
    ended.no_complaint();
    let way = Way::new(Path::new(&trace), ended.track.last().unwrap().1);
    let passed = way.passed(&ended.track);
    is_complete(&passed, 0);
    assert!(way.places.len() - passed.last().unwrap() <= GAP);
    drop(folder);

    let mut bench = Bench::new();
    for (number, (pulses, holds_ms)) in CUTS.into_iter().enumerate() {
        let resume: &[&str] = if number > 0 { &["--resume"] } else { &[] };
        bench
            .emulated
            .happens(&format!("pulses+{pulses}:power={LAG_MS},{holds_ms}"));
        let (is_done, said) = sim(bench.command(resume));
        assert!(!is_done, "the run is over before cut {number}: {said}");
        bench.home();
    }
    let last = bench.runs(&["--resume"]);
    assert!(last.contains("resumed"), "{last}");
    let ended = bench.emulated.end();
    ended.no_complaint();

    let events = ended.report["events"].as_array().unwrap();
    let cuts = events.iter().filter(|event| event["what"] == "power cut");
    let cut_at: Vec<u64> = cuts.map(|event| event["cycle"].as_u64().unwrap()).collect();
    assert_eq!(cut_at.len(), CUTS.len(), "{events:#?}");
    let mut begin = 0;
    // Places that are done; whether a record was missed since.
    let (mut done, mut was_missed, mut within) = (0, false, 0);
    for (number, cycle) in cut_at.into_iter().chain([u64::MAX]).enumerate() {
        let end = ended.track.partition_point(|(at, _)| *at <= cycle);
        // The first run is cut on its way to the passes; before, the touch-off comes near them.
        let passed = match number {
            0 => Vec::new(),
            _ => way.passed(&ended.track[begin..end]),
        };
        begin = end;
        if let [first, .., last] = passed[..] {
            is_complete(&passed, done);
            let again_mm = way.arcs_mm[done] - way.arcs_mm[first];
            println!(
                "run {number}: from {:.3} to {:.3} mm, {again_mm:.3} mm again",
                way.arcs_mm[first], way.arcs_mm[last]
            );
            let most = if was_missed { way.pass_mm } else { 0.0 };
            assert!(
                again_mm <= most + AGAIN_MAX_MM,
                "{again_mm} mm are machined again"
            );
            within += u32::from(first > 0 && !was_missed);
            (done, was_missed) = (done.max(last), was_missed && last <= done);
        }
        was_missed |= CUTS.get(number).is_some_and(|(_, holds_ms)| *holds_ms == 0);
    }
    assert!(way.places.len() - done <= GAP, "{done} of {}", way.places.len());
    assert!(within >= 3, "{within} runs went on within a pass");
}

/// Fails where a place of the way was left out, from those that are done on.
fn is_complete(passed: &[usize], done: usize) {
    let [first, ..] = *passed else {
        panic!("nothing was machined")
    };
    assert!(first <= done + GAP, "from {first} after {done}");
    for pair in passed.windows(2) {
        assert!(
            pair[1] - pair[0] <= GAP,
            "nothing from {} to {}",
            pair[0],
            pair[1]
        );
    }
}
