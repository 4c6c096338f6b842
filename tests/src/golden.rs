//! The golden table `golden/points.txt`: six jobs computed independently with 40 digits. The header of the file describes its format.

use std::str::FromStr;

/// The table's text.
const TABLE: &str = include_str!("../golden/points.txt");

/// Numbers of a `point` line.
const POINT_NUMBERS: usize = 31;

/// A golden job.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Case {
    /// Name of the surface.
    pub surface: String,
    /// Path parameter: `u` or `v`.
    pub along: String,
    /// Sign of the tool normal on `S_u x S_v`.
    pub tool_side: f64,
    /// Ball radius, mm.
    pub radius_mm: f64,
    /// Scallop height limit, mm.
    pub scallop_mm: f64,
    /// Ranges of u and of v.
    pub range: [[f64; 2]; 2],
    /// Number of passes.
    pub pass_count: usize,
    /// Length of all passes, mm.
    pub cc_length_mm: f64,
    /// Points on the surface.
    pub points: Vec<Point>,
    /// Side parameter and least interval of each pass.
    pub passes: Vec<[f64; 2]>,
}

/// Golden values at a point. Derivatives by the path parameter (`a`) and the side parameter (`b`).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// Parameter u.
    pub u: f64,
    /// Parameter v.
    pub v: f64,
    /// Cutter contact, mm.
    pub cc: [f64; 3],
    /// First derivative along the path.
    pub a: [f64; 3],
    /// First derivative across.
    pub b: [f64; 3],
    /// Second derivative along the path.
    pub aa: [f64; 3],
    /// Mixed derivative.
    pub ab: [f64; 3],
    /// Second derivative across.
    pub bb: [f64; 3],
    /// Unit normal towards the tool.
    pub normal: [f64; 3],
    /// Normal curvature along the path, 1/mm, above 0 towards the tool.
    pub curvature_path: f64,
    /// Normal curvature across the path.
    pub curvature_side: f64,
    /// `|(N x t) . B|`, mm.
    pub lateral_speed: f64,
    /// Step-over along the surface, mm.
    pub step_over: f64,
    /// Path interval in the side parameter.
    pub interval: f64,
    /// Cutter location, mm.
    pub cl: [f64; 3],
}

/// All golden jobs.
///
/// # Panics
/// If the table does not have the form that its header describes; the message names the line.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases: Vec<Case> = Vec::new();
    for (index, line) in TABLE.lines().enumerate() {
        let bad = || -> ! { panic!("golden/points.txt:{}: cannot read `{line}`", index + 1) };
        let mut words = line.split_whitespace();
        match (words.next(), cases.last_mut()) {
            (None, _) => {}
            (Some(word), _) if word.starts_with('#') => {}
            (Some("case"), _) => cases.push(read_case(words).unwrap_or_else(|| bad())),
            (Some(word), Some(case)) => read_line(case, word, words).unwrap_or_else(|| bad()),
            _ => bad(),
        }
    }
    cases
}

fn read_case<'a>(mut words: impl Iterator<Item = &'a str>) -> Option<Case> {
    let (surface, along) = (words.next()?.to_owned(), words.next()?.to_owned());
    let [tool_side, radius_mm, scallop_mm] = numbers(words)?;
    Some(Case {
        surface,
        along,
        tool_side,
        radius_mm,
        scallop_mm,
        ..Case::default()
    })
}

fn read_line<'a>(case: &mut Case, word: &str, words: impl Iterator<Item = &'a str>) -> Option<()> {
    match word {
        "range" => {
            let [u0, u1, v0, v1] = numbers(words)?;
            case.range = [[u0, u1], [v0, v1]];
        }
        "total" => {
            let words: Vec<&str> = words.collect();
            let [passes, length] = words.as_slice() else {
                return None;
            };
            case.pass_count = passes.parse().ok()?;
            case.cc_length_mm = length.parse().ok()?;
        }
        "point" => case.points.push(read_point(&numbers(words)?)),
        "pass" => case.passes.push(numbers(words)?),
        _ => return None,
    }
    Some(())
}

fn read_point(n: &[f64; POINT_NUMBERS]) -> Point {
    let vector = |at: usize| [n[at], n[at + 1], n[at + 2]];
    Point {
        u: n[0],
        v: n[1],
        cc: vector(2),
        a: vector(5),
        b: vector(8),
        aa: vector(11),
        ab: vector(14),
        bb: vector(17),
        normal: vector(20),
        curvature_path: n[23],
        curvature_side: n[24],
        lateral_speed: n[25],
        step_over: n[26],
        interval: n[27],
        cl: vector(28),
    }
}

/// Exactly `N` numbers.
fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> Option<[f64; N]> {
    let numbers: Vec<f64> = words.map(f64::from_str).collect::<Result<_, _>>().ok()?;
    numbers.try_into().ok()
}
