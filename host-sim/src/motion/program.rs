//! A program in G-code, as LinuxCNC's interpreter (`rs274`) reads it, at the programmed feed of each move: neither acceleration nor blending,
//! because these are the machine's and not the program's.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use glam::DVec3;
use job::{AxisLimits, Job};

use super::{Motion, MotionError};

/// Largest number of positions of a program.
const POSITIONS_MAX: f64 = 5e7;
const HELP: &str = "install LinuxCNC's interpreter (package linuxcnc-uspace), or give samples as CSV";

/// A motion command of the interpreter.
#[derive(Clone, Copy, Debug)]
struct Move {
    from: DVec3,
    to: DVec3,
    /// Two axes of the arc's plane, centre in the plane, angle, rad: above 0 counterclockwise.
    arc: Option<([usize; 2], [f64; 2], f64)>,
    feed_mm_s: f64,
}

impl Move {
    fn length(&self) -> f64 {
        let straight = self.to - self.from;
        let Some(([x, y], centre, angle)) = self.arc else {
            return straight.length();
        };
        let radius = (self.from[x] - centre[0]).hypot(self.from[y] - centre[1]);
        let across = straight[3 - x - y];
        (angle * radius).hypot(across)
    }

    /// Position at a share of the length.
    fn at(&self, share: f64) -> DVec3 {
        let mut place = self.from + (self.to - self.from) * share;
        if let Some(([x, y], centre, angle)) = self.arc {
            let arm = [self.from[x] - centre[0], self.from[y] - centre[1]];
            let (sine, cosine) = (share * angle).sin_cos();
            place[x] = centre[0] + arm[0] * cosine - arm[1] * sine;
            place[y] = centre[1] + arm[0] * sine + arm[1] * cosine;
        }
        place
    }
}

/// Reads the program.
pub(super) fn read(path: &Path, job: &Job) -> Result<Motion, MotionError> {
    let name = path.display();
    let text = fs::read_to_string(path).map_err(|error| {
        MotionError::new(
            format!("{name}: {error}"),
            "give a CSV file of samples, or a program in G-code",
        )
    })?;
    let moves = moves(&interpret(path, &text)?).ok_or_else(|| {
        MotionError::new(
            format!("{name}: rs274 prints something that is not understood"),
            "give samples as CSV",
        )
    })?;
    // The first move comes from where the machine happens to be.
    sampled(path, moves.get(1..).unwrap_or_default(), job)
}

/// The interpreter: the one that `scripts/setup.sh` unpacks in a checkout, else the installed one.
fn interpreter() -> PathBuf {
    let unpacked = programs::checkout().map(|root| root.join("target/rs274/rs274"));
    unpacked
        .filter(|program| program.exists())
        .unwrap_or_else(|| PathBuf::from("rs274"))
}

/// What the interpreter prints for a program.
fn interpret(path: &Path, text: &str) -> Result<String, MotionError> {
    let name = path.display();
    let failed =
        |error: std::io::Error| MotionError::new(format!("{name}: rs274 does not run: {error}"), HELP);
    let folder = tempfile::tempdir().map_err(failed)?;
    for (file, text) in [("program.ngc", text), ("tool.tbl", ""), ("parameters.var", "")] {
        fs::write(folder.path().join(file), text).map_err(failed)?;
    }
    let output = Command::new(interpreter())
        .args(["-t", "tool.tbl", "-v", "parameters.var", "-g", "program.ngc"])
        .current_dir(folder.path())
        // It maps a file of its tools there into memory; a second interpreter would truncate it meanwhile.
        .env("HOME", folder.path())
        .stdin(Stdio::null())
        .output()
        .map_err(failed)?;
    let canonical = String::from_utf8_lossy(&output.stdout).into_owned();
    if output.status.success() && canonical.contains("PROGRAM_END()") {
        return Ok(canonical);
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let said = said
        .lines()
        .rfind(|line| !matches!(line.trim(), "" | "executing"));
    let said = said.map_or_else(|| output.status.to_string(), str::to_owned);
    Err(MotionError::new(
        format!("{name}: rs274 refuses the program: {said}"),
        "correct the program; it must end with M2 or M30",
    ))
}

/// The moves; `None` if a line is not understood.
fn moves(canonical: &str) -> Option<Vec<Move>> {
    let mut moves = Vec::new();
    let (mut at, mut feed_mm_s, mut plane) = (DVec3::ZERO, 0.0, [0, 1, 2]);
    let mut per_unit = 1.0;
    for line in canonical.lines() {
        let call = line.split_whitespace().skip(2).collect::<Vec<_>>().join(" ");
        let Some((name, arguments)) = call.trim_end_matches(')').split_once('(') else {
            continue;
        };
        let values: Vec<f64> = arguments
            .split(", ")
            .filter_map(|value| value.parse().ok())
            .collect();
        let (mut to, mut arc) = (at, None);
        match name {
            "USE_LENGTH_UNITS" => per_unit = if arguments.contains("INCHES") { 25.4 } else { 1.0 },
            "SET_FEED_RATE" => feed_mm_s = values.first()? * per_unit / 60.0,
            "SELECT_PLANE" => {
                plane = match arguments {
                    "CANON_PLANE_XY" => [0, 1, 2],
                    "CANON_PLANE_XZ" => [2, 0, 1],
                    "CANON_PLANE_YZ" => [1, 2, 0],
                    _ => return None,
                }
            }
            "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => to = DVec3::from_slice(values.get(..3)?) * per_unit,
            "ARC_FEED" => {
                let [x, y, _] = plane;
                for (axis, value) in plane
                    .into_iter()
                    .zip([values.first()?, values.get(1)?, values.get(5)?])
                {
                    to[axis] = value * per_unit;
                }
                let centre = [values.get(2)? * per_unit, values.get(3)? * per_unit];
                arc = Some(([x, y], centre, angle(at, to, [x, y], centre, *values.get(4)?)));
            }
            _ => {}
        }
        if name.starts_with("STRAIGHT") || name == "ARC_FEED" {
            let rapid = name == "STRAIGHT_TRAVERSE";
            moves.push(Move {
                from: at,
                to,
                arc,
                feed_mm_s: if rapid { f64::INFINITY } else { feed_mm_s },
            });
            at = to;
        }
    }
    Some(moves)
}

/// Angle of an arc with this number of turns, of which the sign is the sense.
fn angle(from: DVec3, to: DVec3, [x, y]: [usize; 2], centre: [f64; 2], turns: f64) -> f64 {
    use std::f64::consts::TAU;
    let of = |at: DVec3| (at[y] - centre[1]).atan2(at[x] - centre[0]);
    let swept = (turns.signum() * (of(to) - of(from))).rem_euclid(TAU);
    // Equal ends are a full turn.
    let swept = if swept < 1e-9 { TAU } else { swept };
    turns.signum() * (swept + TAU * (turns.abs() - 1.0).max(0.0))
}

/// One position a period: moves at their feed, traverses at the axes' velocities.
fn sampled(path: &Path, moves: &[Move], job: &Job) -> Result<Motion, MotionError> {
    let name = path.display();
    let period_s = job.machine.period_s();
    let limits = job.machine.limits.unwrap_or(AxisLimits::DEFAULT);
    let velocity = DVec3::from(limits.velocity_mm_s);
    let mut centres_mm: Vec<DVec3> = moves.first().map(|first| first.from).into_iter().collect();
    // Time since the last position, s.
    let mut since_s = 0.0;
    let mut whole_s = 0.0;
    for one in moves {
        let length = one.length();
        if length <= 0.0 {
            continue;
        }
        let takes_s = if one.feed_mm_s.is_finite() {
            length / one.feed_mm_s
        } else {
            ((one.to - one.from).abs() / velocity).max_element()
        };
        whole_s += takes_s;
        if whole_s.is_nan() || whole_s / period_s > POSITIONS_MAX {
            return Err(MotionError::new(
                format!("{name}: the program takes more than {POSITIONS_MAX:e} periods"),
                "give every cut a feed (F), or a longer period_us",
            ));
        }
        let mut next_s = period_s - since_s;
        while next_s <= takes_s {
            centres_mm.push(one.at(next_s / takes_s));
            next_s += period_s;
        }
        since_s = takes_s - (next_s - period_s);
    }
    Ok(Motion { period_s, centres_mm })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CANONICAL: &str = "\
    1 N..... USE_LENGTH_UNITS(CANON_UNITS_MM)
    2 N..... STRAIGHT_TRAVERSE(0.0000, 0.0000, 5.0000, 0.0000, 0.0000, 0.0000)
    3 N..... SET_FEED_RATE(600.0000)
    4 N..... STRAIGHT_FEED(10.0000, 0.0000, 5.0000, 0.0000, 0.0000, 0.0000)
    5 N..... ARC_FEED(0.0000, 10.0000, 0.0000, 0.0000, 1, 5.0000, 0.0000, 0.0000, 0.0000)
    6 N..... PROGRAM_END()
";

    #[test]
    fn moves_are_sampled_at_their_feed() {
        let job = job_file::parse("torus.toml", include_str!("../../../jobs/torus.toml")).unwrap();
        let moves = moves(CANONICAL).unwrap();
        let motion = sampled(Path::new("x"), &moves[1..], &job).unwrap();
        // 10 mm and a quarter of a circle of 10 mm at 10 mm/s.
        let exact = (10.0 + 5.0 * std::f64::consts::PI) / 10.0 / 1e-3;
        assert!(
            (motion.centres_mm.len() as f64 - 1.0 - exact).abs() <= 1.0,
            "{}",
            motion.centres_mm.len()
        );
        for pair in motion.centres_mm.windows(2) {
            let step = pair[0].distance(pair[1]);
            assert!((step - 0.01).abs() < 1e-5, "{step}");
        }
        let on_arc = motion.centres_mm[1500];
        assert!((on_arc.truncate().length() - 10.0).abs() < 1e-9 && on_arc.y > 0.0 && on_arc.z == 5.0);
    }

    #[test]
    fn full_turns_and_both_senses() {
        let (from, to) = (DVec3::new(10.0, 0.0, 0.0), DVec3::new(0.0, 10.0, 0.0));
        let turn = |to, turns| angle(from, to, [0, 1], [0.0; 2], turns).to_degrees();
        assert!((turn(to, 1.0) - 90.0).abs() < 1e-9 && (turn(to, -1.0) + 270.0).abs() < 1e-9);
        assert!((turn(from, 1.0) - 360.0).abs() < 1e-9 && (turn(to, 2.0) - 450.0).abs() < 1e-9);
    }
}
