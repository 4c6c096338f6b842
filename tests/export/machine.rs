//! What a job says of its machine, in exported programs: safe height, home, travel, fixtures, stock, spindle.

use approach::Kind;
use approach::export::{Dialect, ExportError, export};
use approach::gcode::FeedMode;
use job::{Block, Fixture, Job, Pattern, Spindle};

use super::interpreter::{Move, distance, interpret};
use super::{ROUNDED_MM, RUN_UP_S, check_grbl, job, options};

const HOME_MM: [f64; 3] = [-80.0, -60.0, 120.0];
const BOTH: [Dialect; 2] = [Dialect::Linuxcnc, Dialect::Grbl];

fn program(job: &Job, dialect: Dialect) -> String {
    let options = options(dialect, Kind::Linear, FeedMode::G94);
    export(job, &options, &|| ()).unwrap().text
}

/// The sentence and the remedy of a refused export.
fn refusal(job: &Job) -> String {
    let options = options(Dialect::Grbl, Kind::Linear, FeedMode::G94);
    match export(job, &options, &|| ()) {
        Err(ExportError::Refused(error)) => format!("{}; {}", error.what(), error.remedy()),
        other => panic!("{other:?}"),
    }
}

/// Extent of a job's cuts in x, least and greatest, mm.
fn extent_x(job: &Job) -> [f64; 2] {
    let cuts = interpret(&program(job, Dialect::Grbl));
    let xs = cuts.iter().filter(|cut| !cut.rapid).map(|cut| cut.to[0]);
    xs.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
        [low.min(x), high.max(x)]
    })
}

/// The torus with a home, a safe height and passes in one direction, so that the tool retracts after each.
fn with_home(safe_z_mm: f64) -> Job {
    let mut job = job("torus", 0.05);
    job.pattern = Pattern::Zig;
    (job.machine.home_mm, job.machine.safe_z_mm) = (Some(HOME_MM), Some(safe_z_mm));
    job
}

/// The first move does not go down, traverses are at the job's height, and the tool comes back to its home.
#[test]
fn traverses_are_at_the_safe_height_of_the_job() {
    for (dialect, safe_z_mm) in BOTH
        .into_iter()
        .flat_map(|dialect| [(dialect, 90.0), (dialect, 150.0)])
    {
        let job = with_home(safe_z_mm);
        let moves = interpret(&program(&job, dialect));
        let over_mm = safe_z_mm.max(HOME_MM[2]);
        let first = moves.iter().find(|step| !step.rapid).unwrap();
        let before: Vec<&Move> = moves.iter().take_while(|step| step.rapid).collect();
        assert!((before[0].to[2] - over_mm).abs() < ROUNDED_MM, "{:?}", before[0]);
        for step in &before[1..] {
            let crosses = step.from[..2] != step.to[..2];
            assert!(!crosses || (step.to[2] - over_mm).abs() < ROUNDED_MM, "{step:?}");
        }
        assert!(before.iter().any(|step| step.to[..2] == HOME_MM[..2]));
        assert!(
            (first.from[2] - first.to[2] - job.machine.plunge_mm).abs() < ROUNDED_MM,
            "{first:?}"
        );
        let crossing = |step: &&Move| step.rapid && step.from[..2] != step.to[..2];
        let heights: Vec<f64> = moves.iter().filter(crossing).map(|step| step.to[2]).collect();
        assert!(
            heights.iter().all(|z| *z >= safe_z_mm - ROUNDED_MM),
            "{heights:?}"
        );
        assert!(
            heights
                .iter()
                .filter(|z| (**z - safe_z_mm).abs() < ROUNDED_MM)
                .count()
                > 2
        );
        assert!(distance(moves.last().unwrap().to, HOME_MM) < ROUNDED_MM);
    }
}

/// A clamp between home and the part that is higher than the safe height is in the way, and one below it is not.
#[test]
fn fixtures_on_the_way_are_found() {
    let mut job = with_home(90.0);
    // From home the tool crosses at 120 mm; between passes at 90 mm.
    let [least_x, most_x] = extent_x(&job);
    let clamp = |low_x: f64, high_x: f64, top: f64| Fixture {
        name: "clamp".to_owned(),
        block: Block {
            low_mm: [low_x, -200.0, -50.0],
            high_mm: [high_x, 200.0, top],
        },
    };
    job.setup.fixtures = vec![clamp(least_x - 30.0, least_x - 20.0, 100.0)];
    program(&job, Dialect::Grbl);
    job.setup.fixtures = vec![clamp(least_x - 30.0, least_x - 20.0, 119.0)];
    let reported = refusal(&job);
    assert!(
        reported.contains("fixture clamp") && reported.contains("raise safe_z_mm"),
        "{reported}"
    );
    // A bar above the part: in the way of every retract.
    job.setup.fixtures = vec![clamp(least_x - 1.0, most_x + 1.0, 80.0)];
    job.setup.fixtures[0].block.low_mm[2] = 70.0;
    assert!(refusal(&job).contains("fixture clamp"));
    // Without a home the way from the tool's place is not known.
    job.machine.home_mm = None;
    job.setup.fixtures = vec![clamp(least_x - 30.0, least_x - 20.0, 100.0)];
    let reported = refusal(&job);
    assert!(
        reported.contains("begins where the tool") && reported.contains("home_mm"),
        "{reported}"
    );
}

#[test]
fn stock_and_travel_are_kept() {
    let mut job = with_home(90.0);
    job.machine.travel_mm = Some([[-100.0, 100.0], [-100.0, 100.0], [-50.0, 110.0]]);
    let reported = refusal(&job);
    assert!(
        reported.contains("moves z from") && reported.contains("110 mm"),
        "{reported}"
    );
    job.machine.travel_mm = None;
    // A wall of stock beside the part, as high as the traverses from home.
    let [least_x, most_x] = extent_x(&job);
    job.setup.stock = Some(Block {
        low_mm: [least_x - 30.0, -100.0, -50.0],
        high_mm: [most_x + 10.0, 100.0, 119.0],
    });
    let reported = refusal(&job);
    assert!(reported.contains("the stock"), "{reported}");
    job.machine.safe_z_mm = Some(-100.0);
    assert!(refusal(&job).contains("below the highest cut"));
}

/// Spindle and coolant are on from before the first motion to after the last one, in the job's direction.
#[test]
fn a_spindle_is_switched_on_and_off() {
    for (dialect, counterclockwise, word) in [
        (Dialect::Grbl, false, "S12000M3"),
        (Dialect::Linuxcnc, true, "S12000M4"),
    ] {
        let mut job = with_home(90.0);
        let spindle = Spindle {
            rpm: 12_000,
            counterclockwise,
            coolant: true,
        };
        job.machine.spindle = Some(spindle);
        let text = program(&job, dialect);
        if dialect == Dialect::Grbl {
            check_grbl(&text);
        }
        let place = |what: &str| text.lines().position(|line| line == what).unwrap();
        let moves = |line: &str| line.starts_with("G0") || line.starts_with("G1X");
        let first = text.lines().position(moves).unwrap();
        assert_eq!(place(&format!("G4P{RUN_UP_S}")), place(word) + 1);
        assert!(place("M8") < first && place(word) < first);
        assert_eq!([place("M9") + 1, place("M5") + 1], [place("M5"), place("M2")]);
        interpret(&text);
        // A speed of 0 leaves the spindle alone.
        job.machine.spindle = Some(Spindle { rpm: 0, ..spindle });
        let silent = program(&job, dialect);
        assert!(!silent.contains("M3") && !silent.contains("M5") && silent.contains("M8"));
    }
    let silent = program(&job("torus", 0.05), Dialect::Grbl);
    assert!(
        ["M3", "M5", "M8", "G4P"]
            .iter()
            .all(|word| !silent.contains(word))
    );
}

/// Turns are not exported, and the program says so.
#[test]
fn a_program_says_that_it_has_no_turns() {
    let mut job = with_home(90.0);
    (job.pattern, job.overrun_mm) = (Pattern::Zigzag, 5.0);
    let exported = export(&job, &options(Dialect::Grbl, Kind::Linear, FeedMode::G94), &|| ()).unwrap();
    let note = "overrun_mm = 5 is not used: exported programs have no turns";
    assert_eq!(exported.notes, [note]);
    assert!(exported.text.contains(&format!("({note})")));
    check_grbl(&exported.text);
}
