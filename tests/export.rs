//! Exported programs, read by LinuxCNC's own interpreter (`rs274`), against the exact path of the tool centre.

mod curved;
mod interpreter;
mod machine;

use approach::export::{Dialect, ExportError, ExportedProgram, Options, export};
use approach::gcode::FeedMode;
use approach::{Kind, PassPath, job_passes, side_curves};
use interpreter::{Move, distance, interpret};
use job::{Job, Pattern};
use oracle::Oracle;
use programs::checkout;

/// Rounding of a position: program and interpreter print four decimals each, with an error of half the last digit per axis, mm.
const ROUNDED_MM: f64 = 1.8e-4;
/// Dwell after the spindle is switched on, s.
const RUN_UP_S: f64 = 2.5;
/// Number of points checked on each cut.
const PLACES: u32 = 8;

/// Tolerances of an approach: distance of a cut's ends and of its inner points from the exact path, mm; deviation of
/// the contact's speed from the feed, as a fraction of it, on average over a cut and over an eighth of a cut.
struct Bounds {
    ends_mm: f64,
    places_mm: f64,
    mean: f64,
    eighth: f64,
}

/// Greatest distance of two curved passes between which the tool stays on the boundary, mm.
const BESIDE_MM: f64 = 6.0;
/// Steps of the length of a pass, mm.
const STEP_MM: f64 = 0.05;

/// Length of the contact's path between two path parameters of a pass, mm.
fn arc_mm(pass: &PassPath<'_>, from: f64, to: f64) -> f64 {
    if pass.curve.is_none() {
        return pass.oracle.arc_length(from, to, pass.side).abs();
    }
    let speed = |path: f64| pass.at(path).unwrap().contact.path_speed;
    let about = speed(0.5 * (from + to)) * (to - from).abs();
    let steps = (about / STEP_MM).ceil().max(1.0);
    let width = (to - from) / steps;
    let mut sum = 0.0;
    for step in 0..steps as u32 {
        let middle = from + width * (f64::from(step) + 0.5);
        // Gauss-Legendre, two points.
        sum += [-1.0, 1.0]
            .map(|sign| speed(middle + sign * width / 12_f64.sqrt()))
            .iter()
            .sum::<f64>();
    }
    0.5 * (sum * width).abs()
}

/// Checks the moves of one pass; returns their number and their time, s. At a single point the tool does not move.
fn follow(job: &Job, pass: &PassPath<'_>, moves: &[Move], bounds: &Bounds) -> (usize, f64) {
    if pass.is_point() {
        return (0, 0.0);
    }
    let end = pass.at(pass.ends[1]).unwrap().contact.cl_mm.to_array();
    let mut path = pass.ends[0];
    let mut time_s = 0.0;
    for (count, cut) in moves.iter().enumerate() {
        // Both conditions are needed, because a closed pass ends at its start.
        let left_mm = || arc_mm(pass, path, pass.ends[1]);
        if distance(cut.from, end) < ROUNDED_MM && left_mm() < 2.0 * ROUNDED_MM {
            // The last arc may be as short as the rounding.
            let is_rest = |cut: &&Move| !cut.rapid && distance(cut.from, cut.to) < ROUNDED_MM;
            let rest = moves[count..].iter().take_while(is_rest);
            let rest_s: f64 = rest.clone().map(|cut| cut.length() / cut.feed_mm_s).sum();
            return (count + rest.count(), time_s + rest_s);
        }
        assert!(!cut.rapid, "pass {} is left", pass.pass);
        let (begin, takes) = (path, cut.length() / cut.feed_mm_s);
        for k in 1..=PLACES {
            let place = cut.at(f64::from(k) / f64::from(PLACES));
            let foot = pass.foot(place.into(), path).unwrap();
            let off = distance(place, foot.contact.cl_mm.to_array());
            let most = if k == PLACES {
                bounds.ends_mm
            } else {
                bounds.places_mm
            };
            assert!(
                off <= most + ROUNDED_MM,
                "pass {}, {cut:?}: {off} mm off",
                pass.pass
            );
            let arc = arc_mm(pass, path, foot.path);
            check_speed(job, arc, takes / f64::from(PLACES), bounds.eighth, cut);
            path = foot.path;
        }
        let arc = arc_mm(pass, begin, path);
        check_speed(job, arc, takes, bounds.mean, cut);
        time_s += takes;
    }
    panic!("pass {} does not end", pass.pass);
}

fn check_speed(job: &Job, arc_mm: f64, time_s: f64, share: f64, cut: &Move) {
    let wanted = job.feed_mm_s() * time_s;
    // The positions at both ends are rounded.
    let off = (arc_mm - wanted).abs() - 2.0 * ROUNDED_MM;
    assert!(
        off <= share * wanted,
        "{cut:?}: contact at {} of its feed",
        arc_mm / wanted
    );
}

/// Exports a job, and compares the interpreter's moves with the exact path.
fn check(job: &Job, options: &Options, bounds: &Bounds) -> ExportedProgram {
    let exported = export(job, options, &|| ()).unwrap();
    if options.dialect == Dialect::Grbl {
        check_grbl(&exported.text);
    }
    let moves = interpret(&exported.text);
    let oracle = Oracle::new(job).unwrap();
    let curves = side_curves(job).unwrap();
    let passes = job_passes(&oracle, &curves).unwrap();
    assert_eq!(exported.passes, passes.len());
    let mut highest = f64::NEG_INFINITY;
    let mut before: Option<&PassPath<'_>> = None;
    let (mut next, mut time_s) = (0, 0.0);
    for pass in &passes {
        let begin = pass.at(pass.ends[0]).unwrap().contact.cl_mm.to_array();
        let link = moves[next..]
            .iter()
            .position(|link| distance(link.to, begin) < ROUNDED_MM)
            .unwrap();
        let link = &moves[next..=next + link];
        next += link.len();
        match before.filter(|_| job.pattern == Pattern::Zigzag) {
            Some(before) if steps_over(before, pass) && !is_tip(before) => {
                check_step_over(job, before, pass, link)
            }
            _ => check_plunge(job, link, exported.safe_z_mm),
        }
        before = Some(pass);
        let (count, took) = follow(job, pass, &moves[next..], bounds);
        for cut in &moves[next..next + count] {
            highest = highest.max(cut.to[2]).max(cut.from[2]);
        }
        next += count;
        time_s += took;
    }
    let [retract] = moves[next..] else {
        panic!("moves after the last pass: {:?}", &moves[next..]);
    };
    assert!(retract.rapid && exported.safe_z_mm >= highest + job.machine.clearance_mm - ROUNDED_MM);
    assert!(
        (time_s / exported.cutting_time_s - 1.0).abs() < 1e-4,
        "{time_s} s"
    );
    exported
}

/// Checks a link of retract, traverse and plunge, the last part of the plunge at the feed.
fn check_plunge(job: &Job, link: &[Move], safe_z_mm: f64) {
    let (plunge, rapids) = link.split_last().unwrap();
    assert!(!plunge.rapid && plunge.from[..2] == plunge.to[..2], "{plunge:?}");
    assert!(plunge.from[2] >= plunge.to[2] + job.machine.plunge_mm - ROUNDED_MM);
    for rapid in rapids {
        assert!(rapid.rapid);
        let crosses = rapid.from[..2] != rapid.to[..2];
        assert!(
            !crosses || (rapid.from[2] - safe_z_mm).abs() < ROUNDED_MM,
            "{rapid:?}"
        );
        assert!(!crosses || rapid.from[2] == rapid.to[2], "{rapid:?}");
    }
}

/// Path and side parameter of an end of a pass.
fn end_of(pass: &PassPath<'_>, end: usize) -> [f64; 2] {
    [pass.ends[end], pass.side_at(pass.ends[end])]
}

/// Whether the tool stays on the boundary between two passes: curved ones end on the same one, near each other.
fn steps_over(before: &PassPath<'_>, pass: &PassPath<'_>) -> bool {
    let (from, to) = (end_of(before, 1), end_of(pass, 0));
    let centre = |pass: &PassPath<'_>, path: f64| pass.at(path).unwrap().contact.cl_mm.to_array();
    let apart = distance(centre(before, from[0]), centre(pass, to[0]));
    pass.curve.is_none() || ((from[0] == to[0] || from[1] == to[1]) && apart <= BESIDE_MM)
}

/// Whether the pass is a point at which normals differ: its centre's first and last place, or those between.
fn is_tip(pass: &PassPath<'_>) -> bool {
    let centre = |path: f64| pass.at(path).unwrap().contact.cl_mm;
    let [start, end] = pass.ends;
    let places = (1..=PLACES).map(|k| start + (end - start) * f64::from(k) / f64::from(PLACES));
    pass.is_point()
        && places
            .into_iter()
            .any(|path| centre(path).distance(centre(start)) > 2e-5)
}

/// Checks a step-over along the boundary: each point is one radius off the surface at the boundary's parameter.
fn check_step_over(job: &Job, before: &PassPath<'_>, pass: &PassPath<'_>, link: &[Move]) {
    let (from, to) = (end_of(before, 1), end_of(pass, 0));
    let mut oracle = pass.oracle.clone();
    let (mut at, boundary) = if from[0] == to[0] {
        oracle.along = pass.oracle.across();
        (to[1], to[0])
    } else {
        (to[0], to[1])
    };
    for cut in link.iter().rev() {
        assert!(!cut.rapid, "{cut:?}");
        for k in (0..PLACES).rev() {
            let place = cut.at(f64::from(k) / f64::from(PLACES));
            let foot = oracle.foot(place.into(), at, boundary).unwrap();
            let off = distance(place, foot.contact.cl_mm.to_array());
            assert!(off <= job.chord_mm + ROUNDED_MM, "{cut:?}: {off} mm off");
            at = foot.path;
        }
    }
}

/// Checks the restrictions of Grbl 1.1: length of its line buffer, set of words.
fn check_grbl(program: &str) {
    const WORDS: [&str; 20] = [
        "G0", "G1", "G2", "G3", "G17", "G18", "G19", "G21", "G40", "G90", "G91.1", "G93", "G94", "G4", "M2",
        "M3", "M4", "M5", "M8", "M9",
    ];
    // Centres are relative to the start of the arc, whatever the program before this one has set.
    let first = program.lines().find(|line| line.starts_with('G'));
    assert!(
        first.is_some_and(|line| line.contains("G91.1")),
        "centres of arcs may be read as absolute"
    );
    for line in program.lines() {
        assert!(line.len() <= 80 && line.is_ascii(), "{line}");
        if line.starts_with('(') {
            continue;
        }
        let starts: Vec<usize> = line
            .match_indices(|c: char| c.is_ascii_uppercase())
            .map(|(at, _)| at)
            .collect();
        assert_eq!(starts.first(), Some(&0), "{line}");
        for (index, start) in starts.iter().enumerate() {
            let word = &line[*start..starts.get(index + 1).copied().unwrap_or(line.len())];
            let number = word[1..].parse::<f32>();
            let known = match &word[..1] {
                "G" | "M" => WORDS.contains(&word),
                letter => "XYZIJKFSP".contains(letter),
            };
            assert!(known && number.is_ok(), "{word} in {line}");
        }
    }
}

fn options(dialect: Dialect, kind: Kind, feed_mode: FeedMode) -> Options {
    Options {
        dialect,
        kind,
        feed_mode,
        run_up_s: RUN_UP_S,
    }
}

/// A sample job with a larger scallop height limit, and so fewer passes.
fn job(name: &str, scallop_mm: f64) -> Job {
    let path = checkout().unwrap().join(format!("jobs/{name}.toml"));
    let mut job = job_file::load(&path).unwrap();
    job.scallop_mm = scallop_mm;
    job
}

/// Chords end on the exact path; by eqn 7 the contact's mean speed on each chord is the feed.
fn of_linear(job: &Job) -> Bounds {
    Bounds {
        ends_mm: 0.0,
        places_mm: job.chord_mm,
        mean: 1e-3,
        eighth: 0.2,
    }
}

/// The bounds of linear programs without the speed on parts of a chord: beside a point the centre turns far within one chord, so the contact's speed varies.
fn only_mean(job: &Job) -> Bounds {
    Bounds {
        eighth: f64::INFINITY,
        ..of_linear(job)
    }
}

/// Arcs keep the path tolerance everywhere, and the contact's speed within 1 % of the feed.
fn of_curve(job: &Job) -> Bounds {
    Bounds {
        ends_mm: job.chord_mm,
        places_mm: job.chord_mm,
        mean: 1e-3,
        eighth: 0.01,
    }
}

#[test]
fn lines_are_the_exact_path_at_the_feed() {
    for (name, scallop_mm, feed_mode) in [
        ("freeform", 0.05, FeedMode::G94),
        ("freeform", 0.05, FeedMode::G93),
        ("torus", 0.005, FeedMode::G93),
        ("sphere_cap", 0.05, FeedMode::G94),
    ] {
        let job = job(name, scallop_mm);
        for dialect in [Dialect::Linuxcnc, Dialect::Grbl] {
            check(&job, &options(dialect, Kind::Linear, feed_mode), &of_linear(&job));
        }
    }
}

#[test]
fn arcs_hold_the_tolerances_in_every_plane() {
    for (name, scallop_mm) in [
        ("revolved", 0.5),
        ("revolved_v", 0.5),
        ("freeform", 0.05),
        ("torus", 0.005),
    ] {
        let job = job(name, scallop_mm);
        for (dialect, feed_mode) in [(Dialect::Linuxcnc, FeedMode::G94), (Dialect::Grbl, FeedMode::G93)] {
            let exported = check(&job, &options(dialect, Kind::Curve, feed_mode), &of_curve(&job));
            if name == "revolved" {
                // Passes at every angle to the axes: the program switches between arcs in the XZ and YZ planes.
                assert!(
                    ["G18", "G19", "G2", "G3"]
                        .iter()
                        .all(|word| exported.text.contains(word))
                );
            }
            if name.ends_with("_v") {
                // Circles of 144 degrees: two pairs of arcs at any radius.
                assert_eq!(exported.cuts, 4 * exported.passes);
            }
        }
    }
}

#[test]
fn the_centre_runs_at_the_feed_where_that_is_asked() {
    let job = job("ruled_printed", 0.5);
    let exported = export(
        &job,
        &options(Dialect::Grbl, Kind::ConstantCl, FeedMode::G94),
        &|| (),
    )
    .unwrap();
    let moves = interpret(&exported.text);
    let cuts: Vec<_> = moves.iter().filter(|cut| !cut.rapid).collect();
    assert!(cuts.len() > exported.passes);
    assert!(cuts.iter().all(|cut| cut.feed_mm_s == job.feed_mm_s()));
}

#[test]
fn what_no_machine_could_follow_is_refused() {
    let plain = options(Dialect::Linuxcnc, Kind::Linear, FeedMode::G94);
    let mut plate = job("plate", 0.05);
    let surface = Options {
        kind: Kind::Surface,
        ..plain
    };
    let refused = export(&plate, &surface, &|| ()).unwrap_err();
    assert!(matches!(refused, ExportError::SurfaceNeedsTheCore), "{refused:?}");
    let sides = [job::Side::Plus, job::Side::Minus];
    let faces_down = sides.map(|side| {
        plate.side = side;
        matches!(export(&plate, &plain, &|| ()), Err(ExportError::FacesDown { .. }))
    });
    assert!(
        faces_down[0] != faces_down[1],
        "one of the sides is the upper: {faces_down:?}"
    );
}
