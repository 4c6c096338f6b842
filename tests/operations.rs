//! Operations of a sample, counted from the executed instructions of the firmware, against the operations in the source of the
//! core, summed by hand. Needs `qemu-system-arm`; builds the firmware and the plugin.

use cycle_plugin::plan::Stage;
use cycles::golden;
use cycles::measure::Ticks;
use cycles::operations::{Operations, count, of_tick};
use study::operations::{PAPER, in_table};

use crate::images;

/// Ticks of the three jobs of Table 1, in its order.
fn measured() -> [&'static Ticks; 3] {
    PAPER.map(|row| images::ticks_of(row.surface))
}

// Additions and multiplications in the source. First the stages of all surfaces: the parameter step with the 64-bit sum of the
// parameter, the check that the ball fits, the cutter location, the check for a fold, and 1/interval^2 (of a surface without weights).
const STEP: [u32; 2] = [5 + 1, 8];
const FIT: [u32; 2] = [1, 2];
const LOCATE: [u32; 2] = [6, 6];
const FOLD: [u32; 2] = [2, 3];
const DENSITY: [u32; 2] = [0, 1];

const CUBIC: [u32; 2] = [3, 3];
const TANGENT: [u32; 2] = [5, 4];
const JET: [u32; 2] = [6, 4];
const DOT: [u32; 2] = [2, 3];
const CROSS: [u32; 2] = [3, 6];
const INVERSE_ROOT: [u32; 2] = [5, 10];

fn total(parts: &[(u32, [u32; 2])]) -> [u32; 2] {
    let sum = |k: usize| parts.iter().map(|(times, part)| times * part[k]).sum();
    [sum(0), sum(1)]
}

/// A bicubic patch: three jets, tangents and cubics; then the fundamental forms.
fn bicubic() -> [u32; 2] {
    total(&[
        (3, JET),
        (3, TANGENT),
        (3, CUBIC),
        // A x B; E, F, F^2; the bound of the least sine.
        (1, CROSS),
        (3, DOT),
        (1, [0, 2]),
        // 1/W, r N, 1/|A|, 1/E, F/E.
        (2, INVERSE_ROOT),
        (1, [0, 1 + 3]),
        (1, [0, 1 + 1]),
        // L, M, N, A . A', each with a factor; M also with 1/2, A . A' also with 1/E.
        (4, DOT),
        (1, [0, 4 + 1 + 1]),
        // Shear, its sum, twist and its square, sheared, lateral^2, along, across.
        (1, [1 + 1 + 1 + 2, 1 + 1 + 1 + 1 + 1 + 1]),
        (1, STEP),
        (1, FIT),
        (1, LOCATE),
        (1, FOLD),
        (1, DENSITY),
    ])
}

/// A pass along the profile: radius and height, and the values that are independent of the angle.
fn profile() -> [u32; 2] {
    total(&[
        (2, JET),
        // E; second derivatives; 1/|A|, 1/E; lateral speed and its square.
        (1, [1, 2 + 2]),
        (1, INVERSE_ROOT),
        (1, [0, 1 + 2]),
        // r N in the profile's plane; the circle; r N.
        (1, [0, 3]),
        (1, [0, 2]),
        (1, [0, 2 + 1 + 3]),
        // Logarithmic derivative of the speed, curvature along, across.
        (1, [1 + 2 + 1, 3 + 3 + 2]),
        (1, STEP),
        // The fit without a twist.
        (1, [0, 2]),
        (1, LOCATE),
        (1, FOLD),
        (1, DENSITY),
    ])
}

/// A pass around the axis: the angle, sine and cosine, the circle, the offset; the weight of 1/interval^2 is stored.
fn circle() -> [u32; 2] {
    const SIN_COS: [u32; 2] = [2 * 5 + 2, 2 * 5 + 2];
    total(&[
        (1, [1, 1]),
        (1, SIN_COS),
        // Sine and cosine doubled.
        (1, [2, 0]),
        (1, [0, 2]),
        (1, [0, 1 + 2 + 3]),
        (1, STEP),
        (1, FIT),
        (1, LOCATE),
        (1, FOLD),
        (1, [0, 1]),
        (1, DENSITY),
    ])
}

/// Largest difference between executed operations and those of the source. The compiler merges products by powers of two and common
/// factors; roundings and range reductions are additional integer additions, which the sums of the source leave out.
const DIFFERENCE_MAX: u32 = 12;

/// The executed additions and multiplications are those of the source; no division or root is executed.
#[test]
fn executed_operations_are_those_of_the_source() {
    let source = [profile(), circle(), bicubic()];
    for ((ticks, source), row) in measured().iter().zip(source).zip(PAPER) {
        let operations = count(ticks).unwrap().operations;
        for (executed, written) in [operations.add, operations.multiply].into_iter().zip(source) {
            assert!(
                executed.abs_diff(written) <= DIFFERENCE_MAX,
                "{}: {operations:?}, source {source:?}",
                row.surface
            );
        }
        assert_eq!((operations.divide, operations.root), (0, 0), "{}", row.surface);
    }
}

/// The operations of steps 3 and 4 are those counted by hand, within one multiply-add: in the image, the location is two `SMLAL` for each axis, the fit two
/// `VMUL` and a `VSUB` (no `VSUB` without a twist), r N of a patch four `VMUL`, 1/interval^2 one `VMUL`, or two with a stored weight.
#[test]
fn offset_and_interval_by_hand() {
    let offset = [
        total(&[(1, LOCATE), (1, [0, 2])]),
        total(&[(1, LOCATE), (1, FIT)]),
        total(&[(1, LOCATE), (1, FIT), (1, [0, 1 + 3])]),
    ];
    let interval = [DENSITY, [0, 2], DENSITY];
    for (row, ticks) in measured().iter().enumerate() {
        for (stage, [add, multiply]) in [(Stage::Offset, offset[row]), (Stage::Interval, interval[row])] {
            let want = Operations::new(add, multiply, 0, 0);
            // Line tables charge at most one multiply-add of a neighbouring stage to this one.
            let differ = |record: &&cycle_plugin::record::Record| {
                let found = &record.operations[stage as usize];
                found.add.abs_diff(want.add) > 1
                    || found.multiply.abs_diff(want.multiply) > 1
                    || (found.divide, found.root) != (0, 0)
            };
            // The first sample of a pass is evaluated in the planning before its tick.
            let evaluated = ticks
                .records
                .iter()
                .filter(|record| record.stages[Stage::Surface as usize].nominal > 0);
            let others = evaluated.clone().filter(differ).count();
            assert_eq!(
                others,
                0,
                "{}: {} is not {want:?} but {:?}",
                PAPER[row].surface,
                stage.name(),
                evaluated
                    .clone()
                    .find(differ)
                    .map(|record| record.operations[stage as usize])
            );
        }
    }
}

/// Ticks at the ends of a pass that execute other code: the first sample, its two successors, which have no history of steps, the last sample.
const ENDS_OF_A_PASS: usize = 4;

/// All samples within a pass execute the same operations, except for one addition of the sine's range reduction.
#[test]
fn samples_within_a_pass_take_the_same() {
    for (ticks, row) in measured().iter().zip(PAPER) {
        let usual = count(ticks).unwrap();
        let close = |operations: Operations| {
            let pairs = operations.to_array().into_iter().zip(usual.operations.to_array());
            pairs.map(|(a, b)| a.abs_diff(b)).sum::<u32>() <= 1
        };
        // The first sample of a pass has no parameter step.
        let begins = |operations: &Operations| *operations == Operations::default();
        let steps = ticks
            .records
            .iter()
            .map(|record| record.operations[Stage::Step as usize]);
        let passes = steps.filter(begins).count();
        let others = ticks
            .records
            .iter()
            .filter(|record| !close(of_tick(record)))
            .count();
        assert!((1..100).contains(&passes), "{}: {passes} passes", row.surface);
        assert!(
            others <= ENDS_OF_A_PASS * passes,
            "{}: {others} samples of {passes} passes differ from {usual:?}",
            row.surface
        );
    }
}

/// Table 1 has the operations that the firmware executes.
#[test]
fn table_1_is_up_to_date() {
    let table = std::fs::read_to_string(golden::path()).unwrap();
    let rows: Vec<(String, Operations)> = measured()
        .iter()
        .zip(PAPER)
        .map(|(ticks, row)| (row.surface.to_owned(), count(ticks).unwrap().operations))
        .collect();
    assert_eq!(golden::differences(&table, &[], &rows), [""; 0]);
    assert!(in_table(&table).is_some());
}
