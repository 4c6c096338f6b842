//! A program in G-code, as LinuxCNC's interpreter (`rs274`) reads it, at the programmed feed of each move: neither acceleration nor blending,
//! because these are the machine's and not the program's.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use glam::DVec3;
use job::units::S_PER_MIN;
use job::{AxisLimits, Job};

use super::{Motion, MotionError};

/// Largest number of positions of a program.
const POSITIONS_MAX: f64 = 5e7;
/// A time this near the end of a period, as a share of it, is on it: the rounding of the sum of all times.
const ON_PERIOD: f64 = 1e-6;
const HELP: &str = "install LinuxCNC's interpreter (package linuxcnc-uspace), or give samples as CSV";

/// How long a move takes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pace {
    /// At this feed, mm/s.
    Feed(f64),
    /// At the axes' velocities.
    Rapid,
    /// This time, s, at rest.
    Dwell(f64),
}

/// A motion command of the interpreter.
#[derive(Clone, Copy, Debug)]
struct Move {
    from: DVec3,
    to: DVec3,
    /// Two axes of the arc's plane, centre in the plane, angle, rad: above 0 counterclockwise.
    arc: Option<([usize; 2], [f64; 2], f64)>,
    pace: Pace,
}

impl Move {
    /// Duration, s, with these velocities of the axes, mm/s.
    fn time_s(&self, velocity: DVec3) -> f64 {
        match self.pace {
            Pace::Feed(_) if self.length() <= 0.0 => 0.0,
            Pace::Feed(feed_mm_s) => self.length() / feed_mm_s,
            Pace::Rapid => ((self.to - self.from).abs() / velocity).max_element(),
            Pace::Dwell(time_s) => time_s,
        }
    }

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
    let moves = moves(path, &interpret(path, &text)?)?;
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

/// Calls that have no part in the path of the tool's centre, nor in its feed.
const WITHOUT_MOTION: [&str; 38] = [
    "CHANGE_TOOL",
    "CHANGE_TOOL_NUMBER",
    "CLEAR_AUX_OUTPUT_BIT",
    "CLEAR_MOTION_OUTPUT_BIT",
    "COMMENT",
    "DISABLE_ADAPTIVE_FEED",
    "DISABLE_FEED_HOLD",
    "DISABLE_FEED_OVERRIDE",
    "DISABLE_SPEED_OVERRIDE",
    "ENABLE_FEED_HOLD",
    "ENABLE_FEED_OVERRIDE",
    "ENABLE_SPEED_OVERRIDE",
    "FLOOD_OFF",
    "FLOOD_ON",
    "LOG",
    "LOGAPPEND",
    "LOGCLOSE",
    "LOGOPEN",
    "MESSAGE",
    "MIST_OFF",
    "MIST_ON",
    "ON_RESET",
    "OPTIONAL_PROGRAM_STOP",
    "ORIENT_SPINDLE",
    "PROGRAM_END",
    "PROGRAM_STOP",
    "SELECT_TOOL",
    "SET_AUX_OUTPUT_BIT",
    "SET_AUX_OUTPUT_VALUE",
    "SET_FEED_REFERENCE",
    "SET_MOTION_OUTPUT_BIT",
    "SET_MOTION_OUTPUT_VALUE",
    "SET_SPINDLE_MODE",
    "SET_SPINDLE_SPEED",
    "START_SPINDLE_CLOCKWISE",
    "START_SPINDLE_COUNTERCLOCKWISE",
    "STOP_SPINDLE_TURNING",
    "WAIT_SPINDLE_ORIENT_COMPLETE",
];

/// Calls of the machine's blending of moves, which is not simulated.
const OF_BLENDING: [&str; 2] = ["SET_MOTION_CONTROL_MODE", "SET_NAIVECAM_TOLERANCE"];

/// A call that the interpreter prints: `    9 N..... SET_FEED_RATE(600.0000)`.
#[derive(Clone, Copy, Debug)]
struct Call<'a> {
    /// The number of the call, from 1, and the program's own number of the block (N word) if it has one.
    number: u32,
    block: &'a str,
    name: &'a str,
    arguments: &'a str,
}

impl<'a> Call<'a> {
    /// `None`: the line is no call, but for example what the program prints.
    fn parse(line: &'a str) -> Option<Self> {
        let (number, rest) = line.trim_start().split_once(' ')?;
        let (block, call) = rest.split_once(' ')?;
        let (name, arguments) = call.trim().split_once('(')?;
        Some(Self {
            number: number.parse().ok()?,
            block: block.strip_prefix('N')?.trim_matches('.'),
            name,
            arguments: arguments.trim_end_matches(')'),
        })
    }

    /// The numbers among the arguments.
    fn values(&self) -> Vec<f64> {
        let words = self.arguments.split([',', ' ']);
        words.filter_map(|word| word.parse().ok()).collect()
    }

    /// The refusal of a program with this call.
    fn refused(&self, path: &Path, why: &str, remedy: &str) -> MotionError {
        let Self {
            number,
            block,
            name,
            arguments,
        } = self;
        let block = match *block {
            "" => String::new(),
            block => format!(", block N{block}"),
        };
        MotionError::new(
            format!(
                "{}: {name}({arguments}), call {number} of rs274{block}: {why}",
                path.display()
            ),
            remedy,
        )
    }
}

/// Why a call makes another motion than the coordinates in the output say, with the remedy; `None` for one that does not.
fn misleads(call: &Call<'_>, values: &[f64]) -> Option<(&'static str, &'static str)> {
    let is_any =
        |values: Option<&[f64]>| values.is_some_and(|values| values.iter().any(|value| *value != 0.0));
    match call.name {
        // The first value is the number of the coordinate system.
        "SET_G5X_OFFSET" => is_any(values.get(1..)).then_some((
            "the coordinates after it are not the job's",
            "remove the work offset (G10 L2, G10 L20), or move the job: [placement] translate_mm",
        )),
        "SET_G92_OFFSET" => is_any(Some(values)).then_some((
            "the coordinates after it are not the job's",
            "remove the offset (G92)",
        )),
        "USE_TOOL_LENGTH_OFFSET" => is_any(Some(values)).then_some((
            "the coordinates after it are not those of the ball",
            "remove the tool length offset (G43); --tip if the positions are those of the ball's lowest point",
        )),
        "SET_XY_ROTATION" => is_any(Some(values)).then_some((
            "the coordinates after it are not the job's",
            "remove the rotation (R of G10 L2)",
        )),
        "SET_FEED_MODE" => is_any(values.last().map(std::slice::from_ref)).then_some((
            "the feed is one per revolution of the spindle",
            "write the feed in mm/min (G94) or as inverse time (G93)",
        )),
        "START_SPEED_FEED_SYNC" | "START_SPEED_FEED_SYNCH" => Some((
            "the feed follows the spindle",
            "write the cut with a feed of its own (G1), not as a thread (G33, G76)",
        )),
        "ENABLE_ADAPTIVE_FEED" => Some((
            "the feed is the machine's",
            "remove the adaptive feed (M52)",
        )),
        "NURBS_FEED" => Some((
            "rs274 does not print the curve",
            "write lines and arcs (G1, G2, G3) instead of splines (G5, G5.1, G5.2)",
        )),
        "STRAIGHT_PROBE" => Some(("a probe move ends where it touches", "remove the probe moves (G38)")),
        "RIGID_TAP" => Some(("it comes back by itself", "remove the tapping (G33.1)")),
        "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => is_any(values.get(3..)).then_some(ROTARY),
        "ARC_FEED" => is_any(values.get(6..)).then_some(ROTARY),
        "STOP_SPEED_FEED_SYNCH" | "USE_LENGTH_UNITS" | "SET_FEED_RATE" | "SELECT_PLANE" | "DWELL" => None,
        name if WITHOUT_MOTION.contains(&name) || OF_BLENDING.contains(&name) => None,
        _ => Some((
            "the call is not known, and may move the tool",
            "remove it from the program, or give samples as CSV",
        )),
    }
}

const ROTARY: (&str, &str) = (
    "an axis other than x, y and z is not at 0",
    "judge the motion of three axes, or give samples of the ball's centre on the part as CSV",
);

/// The moves that the interpreter prints.
///
/// # Errors
/// A call that is not known, or that makes another motion than the coordinates in the output say.
fn moves(path: &Path, canonical: &str) -> Result<Vec<Move>, MotionError> {
    let mut moves = Vec::new();
    let mut modes = Modes {
        at: DVec3::ZERO,
        feed_mm_s: 0.0,
        plane: [0, 1, 2],
        per_unit: 1.0,
    };
    for call in canonical.lines().filter_map(Call::parse) {
        let values = call.values();
        if let Some((why, remedy)) = misleads(&call, &values) {
            return Err(call.refused(path, why, remedy));
        }
        let one = modes
            .follow(&call, &values)
            .ok_or_else(|| call.refused(path, "its arguments are not understood", "give samples as CSV"))?;
        moves.extend(one);
    }
    Ok(moves)
}

/// Modal state of the interpreter.
struct Modes {
    at: DVec3,
    feed_mm_s: f64,
    /// The two axes of the plane of arcs, and the one normal to it.
    plane: [usize; 3],
    /// Millimetres in a unit of length.
    per_unit: f64,
}

impl Modes {
    /// Follows a call: the move that it makes, if it makes one. `None`: its arguments are not understood.
    fn follow(&mut self, call: &Call<'_>, values: &[f64]) -> Option<Option<Move>> {
        let (mut to, mut arc) = (self.at, None);
        let pace = match call.name {
            "USE_LENGTH_UNITS" => {
                self.per_unit = match call.arguments {
                    "CANON_UNITS_MM" => 1.0,
                    "CANON_UNITS_INCHES" => 25.4,
                    _ => return None,
                };
                return Some(None);
            }
            "SET_FEED_RATE" => {
                self.feed_mm_s = values.first()? * self.per_unit / S_PER_MIN;
                return Some(None);
            }
            "SELECT_PLANE" => {
                self.plane = match call.arguments {
                    "CANON_PLANE_XY" => [0, 1, 2],
                    "CANON_PLANE_XZ" => [2, 0, 1],
                    "CANON_PLANE_YZ" => [1, 2, 0],
                    _ => return None,
                };
                return Some(None);
            }
            "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => {
                to = DVec3::from_slice(values.get(..3)?) * self.per_unit;
                match call.name {
                    "STRAIGHT_TRAVERSE" => Pace::Rapid,
                    _ => Pace::Feed(self.feed_mm_s),
                }
            }
            "ARC_FEED" => {
                let ends = [values.first()?, values.get(1)?, values.get(5)?];
                for (axis, value) in self.plane.into_iter().zip(ends) {
                    to[axis] = value * self.per_unit;
                }
                let [x, y, _] = self.plane;
                let centre = [values.get(2)? * self.per_unit, values.get(3)? * self.per_unit];
                arc = Some((
                    [x, y],
                    centre,
                    angle(self.at, to, [x, y], centre, *values.get(4)?),
                ));
                Pace::Feed(self.feed_mm_s)
            }
            "DWELL" => Pace::Dwell(*values.first()?),
            _ => return Some(None),
        };
        let from = std::mem::replace(&mut self.at, to);
        Some(Some(Move { from, to, arc, pace }))
    }
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

/// One position a period: moves at their feed, traverses at the axes' velocities. The last one is the end of the program, reached within its period.
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
        let takes_s = one.time_s(velocity);
        if takes_s <= 0.0 {
            continue;
        }
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
    if let Some(last) = moves.last().filter(|_| since_s > ON_PERIOD * period_s) {
        centres_mm.push(last.to);
    }
    Ok(Motion {
        period_s,
        centres_mm,
        is_program: true,
    })
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
        let moves = moves(Path::new("x"), CANONICAL).unwrap();
        let motion = sampled(Path::new("x"), &moves[1..], &job).unwrap();
        // 10 mm and a quarter of a circle of 10 mm at 10 mm/s.
        let exact = (10.0 + 5.0 * std::f64::consts::PI) / 10.0 / 1e-3;
        // The last step is the rest of the way.
        assert_eq!(motion.centres_mm.len() as f64, exact.ceil() + 1.0);
        let (last, whole) = motion.centres_mm.split_last().unwrap();
        assert_eq!(*last, DVec3::new(0.0, 10.0, 5.0));
        for pair in whole.windows(2) {
            let step = pair[0].distance(pair[1]);
            assert!((step - 0.01).abs() < 1e-5, "{step}");
        }
        let on_arc = motion.centres_mm[1500];
        assert!((on_arc.truncate().length() - 10.0).abs() < 1e-9 && on_arc.y > 0.0 && on_arc.z == 5.0);
    }

    /// A program that ends with a period has no position twice; a dwell is a time at rest.
    #[test]
    fn the_last_position_is_the_end() {
        let job = job_file::parse("torus.toml", include_str!("../../../jobs/torus.toml")).unwrap();
        let text = "\
    1 N..... STRAIGHT_TRAVERSE(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    2 N..... SET_FEED_RATE(600.0000)
    3 N..... STRAIGHT_FEED(0.0300, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)
    4 N..... DWELL(0.0020)
";
        let moves = moves(Path::new("x"), text).unwrap();
        let motion = sampled(Path::new("x"), &moves[1..], &job).unwrap();
        let x: Vec<_> = motion
            .centres_mm
            .iter()
            .map(|centre| (centre.x * 1e4).round())
            .collect();
        assert_eq!(x, [0.0, 100.0, 200.0, 300.0, 300.0, 300.0]);
    }

    /// Every call that would make another motion than its coordinates is refused by its name, with a remedy; what LinuxCNC prints at the beginning and
    /// at the end of every program is not.
    #[test]
    fn calls_that_mislead_are_refused() {
        let refusal = |call: &str| moves(Path::new("x.ngc"), &format!("    7 N0120   {call}\n")).err();
        for (call, word) in [
            (
                "SET_G5X_OFFSET(1, 0.0000, 2.0000, 0.0000, 0.0000, 0.0000, 0.0000)",
                "G10",
            ),
            (
                "SET_G92_OFFSET(-4.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)",
                "G92",
            ),
            (
                "USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 5.0000, 0.0000 0.0000 0.0000, 0.0000 0.0000 0.0000)",
                "G43",
            ),
            ("SET_XY_ROTATION(10.0000)", "G10"),
            ("SET_FEED_MODE(0, 1)", "G94"),
            ("START_SPEED_FEED_SYNC(1.000000,0)", "G33"),
            ("NURBS_FEED(3, ...)", "G5.2"),
            (
                "STRAIGHT_PROBE(8.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)",
                "G38",
            ),
            ("RIGID_TAP(-1.0000, -2.0000, -1.0000)", "G33.1"),
            ("ENABLE_ADAPTIVE_FEED()", "M52"),
            (
                "STRAIGHT_FEED(1.0000, 0.0000, 0.0000, 5.0000, 0.0000, 0.0000)",
                "three axes",
            ),
            (
                "ARC_FEED(0.0, 10.0, 0.0, 0.0, 1, 5.0, 3.0, 0.0, 0.0)",
                "three axes",
            ),
            ("SPINDLE_RETRACT_TRAVERSE()", "CSV"),
            ("SELECT_PLANE(CANON_PLANE_UNKNOWN)", "CSV"),
            ("STRAIGHT_FEED(1.0000)", "CSV"),
        ] {
            let error = refusal(call).unwrap_or_else(|| panic!("{call} is accepted"));
            let name = call.split('(').next().unwrap();
            assert!(
                error.what.starts_with(&format!("x.ngc: {name}("))
                    && error.what.contains("call 7 of rs274, block N0120"),
                "{error:?}"
            );
            assert!(error.remedy.contains(word), "{error:?}");
        }
        for call in [
            "SET_G5X_OFFSET(2, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)",
            "SET_G92_OFFSET(0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000)",
            "USE_TOOL_LENGTH_OFFSET(0.0000 0.0000 0.0000, 0.0000 0.0000 0.0000, 0.0000 0.0000 0.0000)",
            "SET_XY_ROTATION(0.0000)",
            "SET_FEED_MODE(0, 0)",
            "SET_MOTION_CONTROL_MODE(CANON_CONTINUOUS, 0.001000)",
            "SET_SPINDLE_MODE(0 0.0000)",
            "COMMENT(\"NURBS_FEED(3, ...)\")",
        ] {
            assert_eq!(refusal(call), None, "{call}");
        }
        assert!(
            moves(Path::new("x"), "executing\nprinted by the program (PRINT, ...)\n")
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn full_turns_and_both_senses() {
        let (from, to) = (DVec3::new(10.0, 0.0, 0.0), DVec3::new(0.0, 10.0, 0.0));
        let turn = |to, turns| angle(from, to, [0, 1], [0.0; 2], turns).to_degrees();
        assert!((turn(to, 1.0) - 90.0).abs() < 1e-9 && (turn(to, -1.0) + 270.0).abs() < 1e-9);
        assert!((turn(from, 1.0) - 360.0).abs() < 1e-9 && (turn(to, 2.0) - 450.0).abs() < 1e-9);
    }
}
