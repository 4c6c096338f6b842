//! The oracle against the golden table: every value at every point, and the schedules.

use std::path::Path;

use integration_tests::golden::{self, Case, Point};
use job::{Along, Spacing};
use oracle::Oracle;

/// Bound of the relative f64 rounding error in the longest of the formulas.
const TOLERANCE: f64 = 2e-13;

/// Steps of the table's scan for the least interval of a pass. The oracle also searches between the steps.
const GOLDEN_SCAN: u32 = 4000;
/// Bound of the relative error of an interval by that scan, and so of a side parameter; measured: 1.2e-8.
const GOLDEN_SCAN_ERROR: f64 = 2e-8;
/// Bound of the relative error of the table's lengths, by the trapezoidal rule on the same steps; measured: 2.7e-8.
const GOLDEN_LENGTH_ERROR: f64 = 3e-8;

/// The job file of a golden case, and its oracle.
fn oracle_of(case: &Case) -> Oracle {
    let name = match (case.surface.as_str(), case.along.as_str()) {
        ("revolved", "u") => "revolved",
        ("revolved", "v") => "revolved_v",
        ("ruled_as_printed", "u") => "ruled_printed",
        ("ruled_reconstructed", "u") => "ruled_reconstructed",
        ("plate", "u") => "plate",
        ("plate", "v") => "plate_v",
        other => panic!("no job for {other:?}"),
    };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../jobs/{name}.toml"));
    let mut job = job_file::load(&path).unwrap();
    // The table's schedules use the paper's first-order interval.
    job.spacing = Spacing::FirstOrder;
    assert_eq!(job.surface.domain(), case.range, "{name}");
    assert_eq!(
        (job.radius_mm, job.scallop_mm),
        (case.radius_mm, case.scallop_mm),
        "{name}"
    );
    assert_eq!(job.along == Along::U, case.along == "u", "{name}");
    let oracle = Oracle::new(&job).unwrap();
    assert_eq!(oracle.normal_sign, case.tool_side, "{name}");
    oracle
}

/// Largest difference of the coordinates of two vectors, relative to `size`.
fn difference(ours: impl Into<[f64; 3]>, golden: &[f64; 3], size: f64) -> f64 {
    ours.into()
        .iter()
        .zip(golden)
        .map(|(a, b)| (a - b).abs() / size)
        .fold(0.0, f64::max)
}

/// Differences of all values at a point, each relative to the magnitude of its kind of value.
fn differences(oracle: &Oracle, point: &Point) -> Vec<(&'static str, f64)> {
    let at = oracle.surface.at(point.u, point.v);
    let contact = oracle.contact(point.u, point.v).unwrap();
    let (a, b, aa, bb) = match oracle.along {
        Along::U => (at.u, at.v, at.uu, at.vv),
        Along::V => (at.v, at.u, at.vv, at.uu),
    };
    const SIZE_MM: f64 = 100.0;
    const SECOND_MM: f64 = 500.0;
    let relative = |ours: f64, golden: f64| (ours / golden - 1.0).abs();
    // The error of a curvature is relative to the second derivatives, which may cancel in it.
    let bend_path = SECOND_MM / (contact.path_speed * contact.path_speed);
    let bend_side = SECOND_MM / (contact.lateral_speed * contact.lateral_speed);
    vec![
        ("cc", difference(at.point, &point.cc, SIZE_MM)),
        ("a", difference(a, &point.a, SIZE_MM)),
        ("b", difference(b, &point.b, SIZE_MM)),
        ("aa", difference(aa, &point.aa, SECOND_MM)),
        ("ab", difference(at.uv, &point.ab, SECOND_MM)),
        ("bb", difference(bb, &point.bb, SECOND_MM)),
        ("normal", difference(contact.normal, &point.normal, 1.0)),
        (
            "curvature_path",
            (contact.curvature_path - point.curvature_path).abs() / bend_path,
        ),
        (
            "curvature_side",
            (contact.curvature_side - point.curvature_side).abs() / bend_side,
        ),
        (
            "lateral_speed",
            relative(contact.lateral_speed, point.lateral_speed),
        ),
        ("step_over", relative(contact.step_over_mm, point.step_over)),
        ("interval", relative(contact.interval, point.interval)),
        ("cl", difference(contact.cl_mm, &point.cl, SIZE_MM)),
    ]
}

#[test]
fn the_table_is_complete() {
    let cases = golden::cases();
    assert_eq!(cases.len(), 6);
    for case in &cases {
        assert_eq!(case.points.len(), 40, "{} along {}", case.surface, case.along);
        assert_eq!(
            case.passes.len(),
            case.pass_count,
            "{} along {}",
            case.surface,
            case.along
        );
    }
}

#[test]
fn every_value_of_every_place_agrees() {
    for case in golden::cases() {
        let oracle = oracle_of(&case);
        let mut worst: Vec<(&str, f64)> = Vec::new();
        for point in &case.points {
            let found = differences(&oracle, point);
            if worst.is_empty() {
                worst = found;
            } else {
                worst
                    .iter_mut()
                    .zip(found)
                    .for_each(|(worst, new)| worst.1 = worst.1.max(new.1));
            }
        }
        let list: Vec<String> = worst
            .iter()
            .map(|(name, difference)| format!("{name} {difference:.1e}"))
            .collect();
        println!("{} along {}: {}", case.surface, case.along, list.join(", "));
        let failed: Vec<_> = worst
            .iter()
            .filter(|(_, difference)| *difference > TOLERANCE)
            .collect();
        assert!(
            failed.is_empty(),
            "{} along {}: {failed:?}",
            case.surface,
            case.along
        );
    }
}

/// Least interval of a pass among the points of the golden table's scan.
fn least_of_golden_scan(oracle: &Oracle, side: f64) -> f64 {
    let [start, end] = oracle.path_range();
    let interval = |k: u32| {
        let path = start + (end - start) * f64::from(k) / f64::from(GOLDEN_SCAN);
        let (u, v) = oracle.swapped(path, side);
        oracle.contact(u, v).unwrap().interval
    };
    (0..=GOLDEN_SCAN).map(interval).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_schedules_agree() {
    for case in golden::cases() {
        let oracle = oracle_of(&case);
        let name = format!("{} along {}", case.surface, case.along);
        let schedule = oracle.schedule().unwrap();
        assert_eq!(schedule.len(), case.pass_count, "{name}");
        let [path_start, path_end] = oracle.path_range();
        let (mut side, mut interval, mut scanned, mut length_mm) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0);
        for (pass, golden) in schedule.iter().zip(&case.passes) {
            side = side.max((pass.side - golden[0]).abs());
            interval = interval.max((pass.interval / golden[1] - 1.0).abs());
            scanned = scanned.max((least_of_golden_scan(&oracle, golden[0]) / golden[1] - 1.0).abs());
            length_mm += oracle.arc_length(path_start, path_end, pass.side);
        }
        let length = (length_mm / case.cc_length_mm - 1.0).abs();
        println!(
            "{name}: side {side:.1e}, interval {interval:.1e}, as scanned {scanned:.1e}, length {length:.1e}"
        );
        assert!(
            scanned < TOLERANCE,
            "{name}: interval off by {scanned:e} where the table looked"
        );
        assert!(
            interval < GOLDEN_SCAN_ERROR,
            "{name}: least interval off by {interval:e}"
        );
        assert!(side < GOLDEN_SCAN_ERROR, "{name}: side parameter off by {side:e}");
        assert!(length < GOLDEN_LENGTH_ERROR, "{name}: length off by {length:e}");
    }
}
