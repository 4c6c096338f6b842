//! LinuxCNC's interpreter (`rs274`): a program's motion commands.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use programs::checkout;

/// A motion command of the interpreter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    pub(super) rapid: bool,
    pub(super) from: [f64; 3],
    pub(super) to: [f64; 3],
    /// Two axes of the arc's plane and the one normal to it, centre in the plane, sense of rotation (1 or -1).
    pub(super) arc: Option<([usize; 3], [f64; 2], f64)>,
    pub(super) feed_mm_s: f64,
}

impl Move {
    /// Angle of an arc, rad, and its radius, mm. The arc must be less than half a turn.
    pub(super) fn turn(&self) -> Option<(f64, f64)> {
        let ([x, y, _], centre, sense) = self.arc?;
        let arm = |at: [f64; 3]| [at[x] - centre[0], at[y] - centre[1]];
        let (a, b) = (arm(self.from), arm(self.to));
        let angle = sense * (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]);
        assert!(angle > 0.0, "more than half a turn: {self:?}");
        // Maximum difference of the radii at both ends: Grbl 0.005 mm, LinuxCNC 0.0013 mm.
        assert!((a[0].hypot(a[1]) - b[0].hypot(b[1])).abs() < 1e-3, "{self:?}");
        Some((angle, a[0].hypot(a[1])))
    }

    pub(super) fn length(&self) -> f64 {
        let apart = |k: usize| self.to[k] - self.from[k];
        match (self.arc, self.turn()) {
            (Some(([.., across], ..)), Some((angle, radius))) => (angle * radius).hypot(apart(across)),
            _ => distance(self.from, self.to),
        }
    }

    /// Position at a fraction of the move's length.
    pub(super) fn at(&self, share: f64) -> [f64; 3] {
        let mut place = [0, 1, 2].map(|k| self.from[k] + share * (self.to[k] - self.from[k]));
        if let (Some(([x, y, _], centre, sense)), Some((angle, radius))) = (self.arc, self.turn()) {
            let begin = (self.from[y] - centre[1]).atan2(self.from[x] - centre[0]);
            let (sine, cosine) = (begin + sense * share * angle).sin_cos();
            (place[x], place[y]) = (centre[0] + radius * cosine, centre[1] + radius * sine);
        }
        place
    }
}

pub(super) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1]).hypot(a[2] - b[2])
}

/// The interpreter that `scripts/setup.sh` unpacks, else the installed one.
fn interpreter() -> PathBuf {
    let unpacked = checkout().unwrap().join("target/rs274/rs274");
    if unpacked.exists() {
        unpacked
    } else {
        PathBuf::from("rs274")
    }
}

/// The interpreter's output for a program.
pub(super) fn interpret(program: &str) -> Vec<Move> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in [("program.ngc", program), ("tool.tbl", ""), ("parameters.var", "")] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let output = Command::new(interpreter())
        .args(["-t", "tool.tbl", "-v", "parameters.var", "-g", "program.ngc"])
        .current_dir(folder.path())
        // It maps a file of its tools there into memory; a second interpreter would truncate it meanwhile.
        .env("HOME", folder.path())
        .stdin(Stdio::null())
        .output()
        .expect("LinuxCNC's rs274 is needed: ./check brings it in, or install the package linuxcnc-uspace");
    let canonical = String::from_utf8(output.stdout).unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success() && canonical.contains("PROGRAM_END()"),
        "{}: {errors}",
        output.status
    );
    moves(&canonical)
}

fn moves(canonical: &str) -> Vec<Move> {
    let mut moves = Vec::new();
    let (mut at, mut feed_mm_s, mut plane) = ([0.0; 3], 0.0, [0, 1, 2]);
    for line in canonical.lines() {
        let call = line.split_whitespace().skip(2).collect::<Vec<_>>().join(" ");
        let (name, arguments) = call.trim_end_matches(')').split_once('(').unwrap();
        let values: Vec<f64> = arguments
            .split(", ")
            .filter_map(|value| value.parse().ok())
            .collect();
        let mut to = at;
        let mut arc = None;
        match name {
            "SET_FEED_RATE" => feed_mm_s = values[0] / 60.0,
            "SELECT_PLANE" => {
                plane = match arguments {
                    "CANON_PLANE_XY" => [0, 1, 2],
                    "CANON_PLANE_XZ" => [2, 0, 1],
                    "CANON_PLANE_YZ" => [1, 2, 0],
                    other => panic!("plane {other}"),
                }
            }
            "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => to.copy_from_slice(&values[..3]),
            "ARC_FEED" => {
                for (axis, value) in plane.into_iter().zip([values[0], values[1], values[5]]) {
                    to[axis] = value;
                }
                assert_eq!(values[4].abs(), 1.0, "one turn at most");
                arc = Some((plane, [values[2], values[3]], values[4]));
            }
            _ => {}
        }
        if name.starts_with("STRAIGHT") || name == "ARC_FEED" {
            moves.push(Move {
                rapid: name == "STRAIGHT_TRAVERSE",
                from: at,
                to,
                arc,
                feed_mm_s,
            });
            at = to;
        }
    }
    moves
}
