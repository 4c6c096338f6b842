//! The golden table: cycles of each stage and operations of a sample as last recorded, and what differs from them now.

use std::fmt::Write;
use std::path::PathBuf;

use super::BudgetError;
use super::figures::{Figure, Model, TICK, TICK_AND_PULSES};
use super::measure::MeasurementSetup;
use super::operations::Operations;
use super::session::MeasurementSession;
use machine::prepare::prepare;

/// Relative growth of cycles that is accepted.
pub const GROWTH_MAX: f64 = 0.02;

/// Stages whose longest tick varies from run to run, most on a busy computer: the code that reports a change of pass. The cause is not known. Their means have no allowance.
const REPORTS: [&str; 3] = ["everything else", TICK, TICK_AND_PULSES];
/// Allowance for the longest tick of these stages, cycles: the largest variation seen.
const REPORT_CYCLES: f64 = 180.0;

/// Relative difference of a number of operations that is accepted in either direction: a compiler may choose other instructions.
const OPERATIONS_DIFFERENCE_MAX: f64 = 0.02;

/// Absolute difference of a number of operations that is always accepted.
const OPERATIONS_DIFFERENCE: u32 = 1;

/// The row of the operations.
const OPERATIONS: &str = "operations of steps 2-4";

/// The table's header.
const HEADER: &str = "\
# Cycles of each stage of the sample task on the Cortex-M4F, and of the planning task: surface, stage, model, mean, max.
# Mean over the ticks in which the stage takes any cycles, and over the portions of the planning. Written by `cargo sim budget --bless`, checked by tests/cycles.rs.
# Rows of operations: additions, multiplications, divisions, square roots of the most frequent sample, by the convention of
# host-sim/cycle-plugin/src/operations.rs.
";

/// Path of the table.
#[must_use]
pub fn path() -> PathBuf {
    programs::golden("cycles.txt")
}

/// The worst jobs that searches have found, of `tests/golden`, with the names of their rows; the worst-case tick of each is part of the table.
pub const WORST_JOBS: [(&str, &str); 4] = [
    ("worst job found", "worst_tick"),
    (
        "worst job found, constant height, limits",
        "worst_tick_constant_limits",
    ),
    (
        "worst job found, constant height, region",
        "worst_tick_constant_region",
    ),
    (
        "worst job found, constant height, region, limits",
        "worst_tick_constant_region_limits",
    ),
];

/// Rows of the worst-case ticks of [`WORST_JOBS`].
///
/// # Errors
/// As [`MeasurementSession::run`]; a job cannot be read.
pub fn worst_ticks(setup: &MeasurementSetup) -> Result<Vec<Figure>, BudgetError> {
    let mut figures = Vec::new();
    for (name, file) in WORST_JOBS {
        let path = programs::golden(&format!("{file}.toml"));
        let unusable = |error: &dyn std::fmt::Display| BudgetError::File(path.clone(), error.to_string());
        let job = job_file::load(&path).map_err(|error| unusable(&error))?;
        let prepared = prepare(&job).map_err(|error| unusable(&error))?;
        let mut session = MeasurementSession::new(setup)?;
        let run = session.run(&prepared, WORST_TICKS)?;
        let worst = session.worst_tick(&prepared, &run)?;
        figures.extend(Model::ALL.map(|model| Figure::of_tick(name, model, &worst.record)));
    }
    Ok(figures)
}

/// Ticks of the worst jobs' runs.
const WORST_TICKS: u32 = 2000;

/// The table of these figures, and of each surface's operations.
#[must_use]
pub fn table(figures: &[Figure], operations: &[(String, Operations)]) -> String {
    let mut text = HEADER.to_owned();
    for figure in figures {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} | {:.1} | {}", key(figure), figure.mean, figure.max);
    }
    for (surface, operations) in operations {
        let [add, multiply, divide, root] = operations.to_array();
        let _ = writeln!(
            text,
            "{surface} | {OPERATIONS} | {add} | {multiply} | {divide} | {root}"
        );
    }
    text
}

fn key(figure: &Figure) -> String {
    format!("{} | {} | {}", figure.surface, figure.stage, figure.model.name())
}

/// The operations of a surface in a text of the table.
#[must_use]
pub fn operations(table: &str, surface: &str) -> Option<Operations> {
    let row = format!("{surface} | {OPERATIONS} | ");
    let line = table.lines().find_map(|line| line.strip_prefix(&row))?;
    let mut numbers = line.split(" | ").map(|number| number.trim().parse().ok());
    let mut next = || numbers.next().flatten();
    Some(Operations::new(next()?, next()?, next()?, next()?))
}

/// Differences from a table: stages that grew by more than [`GROWTH_MAX`], operations that became more or less, and missing lines.
#[must_use]
pub fn differences(table: &str, figures: &[Figure], operations: &[(String, Operations)]) -> Vec<String> {
    let cycles = figures.iter().filter_map(|figure| growth(table, figure));
    let operations = operations
        .iter()
        .filter_map(|(surface, now)| difference(table, surface, *now));
    cycles.chain(operations).collect()
}

fn difference(table: &str, surface: &str, now: Operations) -> Option<String> {
    let Some(old) = operations(table, surface) else {
        return Some(format!("{surface} | {OPERATIONS}: not in the golden table"));
    };
    let close = |(old, now): (u32, u32)| {
        let difference = now.abs_diff(old);
        difference <= OPERATIONS_DIFFERENCE
            || f64::from(difference) <= OPERATIONS_DIFFERENCE_MAX * f64::from(old)
    };
    let (old, now) = (old.to_array(), now.to_array());
    let holds = old.into_iter().zip(now).all(close);
    (!holds).then(|| format!("{surface} | {OPERATIONS}: {old:?} -> {now:?}"))
}

fn growth(table: &str, figure: &Figure) -> Option<String> {
    let key = key(figure);
    let line = table
        .lines()
        .find_map(|line| line.strip_prefix(key.as_str())?.strip_prefix(" | "));
    let Some((mean, max)) = line.and_then(|line| line.split_once(" | ")) else {
        return Some(format!("{key}: not in the golden table"));
    };
    let more = if REPORTS.contains(&figure.stage) {
        REPORT_CYCLES
    } else {
        0.0
    };
    let is_kept = |old: &str, new: f64, more: f64| {
        let old = old.trim().parse::<f64>();
        old.is_ok_and(|old| new <= old + more.max(old * GROWTH_MAX))
    };
    let holds = is_kept(mean, figure.mean, 0.0) && is_kept(max, f64::from(figure.max), more);
    (!holds).then(|| {
        format!(
            "{key}: mean {mean} -> {:.1}, max {max} -> {}",
            figure.mean, figure.max
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(mean: f64, max: u32) -> Figure {
        Figure {
            surface: "ruled".into(),
            stage: "offset",
            model: Model::Nominal,
            ticks: 10,
            min: 90,
            mean,
            max,
            stack_bytes: 0,
            histogram: crate::figures::Histogram::default(),
        }
    }

    #[test]
    fn growth_beyond_two_percent_is_named_with_both_figures() {
        let table = table(&[figure(100.0, 200)], &[]);
        assert!(differences(&table, &[figure(102.0, 204)], &[]).is_empty());
        assert!(differences(&table, &[figure(50.0, 60)], &[]).is_empty());
        assert_eq!(
            differences(&table, &[figure(102.1, 204)], &[]),
            ["ruled | offset | nominal: mean 100.0 -> 102.1, max 200 -> 204"]
        );
        assert_eq!(differences(&table, &[figure(100.0, 205)], &[]).len(), 1);
        assert_eq!(differences("", &[figure(100.0, 200)], &[]).len(), 1);
    }

    #[test]
    fn operations_that_differ_either_way_are_named() {
        let row = |add, multiply| vec![("ruled".to_owned(), Operations::new(add, multiply, 0, 0))];
        let table = table(&[], &row(100, 20));
        assert_eq!(operations(&table, "ruled"), Some(Operations::new(100, 20, 0, 0)));
        assert_eq!(operations(&table, "bicubic"), None);
        for close in [row(100, 20), row(102, 21), row(98, 19)] {
            assert_eq!(differences(&table, &[], &close), [""; 0]);
        }
        for far in [row(103, 20), row(97, 20), row(100, 22), row(100, 18)] {
            assert_eq!(differences(&table, &[], &far).len(), 1);
        }
        assert_eq!(
            differences(&table, &[], &row(103, 20)),
            ["ruled | operations of steps 2-4: [100, 20, 0, 0] -> [103, 20, 0, 0]"]
        );
        assert_eq!(differences("", &[], &row(1, 1)).len(), 1);
    }
}
