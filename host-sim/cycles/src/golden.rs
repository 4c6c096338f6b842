//! The golden table of cycles: what each stage took when it was last looked at, and which have grown since.

use std::fmt::Write;
use std::path::PathBuf;

use super::BudgetError;
use super::figures::{Figure, Model};
use super::lab::Lab;
use super::measure::Bench;
use machine::prepare::prepare;

/// Growth that passes.
pub const GROWTH_MAX: f64 = 0.02;

/// The table's header.
const HEADER: &str = "\
# Cycles of each stage of the sample task on the Cortex-M4F: surface, stage, model, mean, max.
# Mean over the ticks in which the stage took any. Written by `cargo sim budget --bless`, held by tests/cycles.rs.
";

/// Where the table stands.
#[must_use]
pub fn path() -> PathBuf {
    programs::golden("cycles.txt")
}

/// The worst job that a search has found; its worst tick is part of the table.
#[must_use]
pub fn worst_job() -> PathBuf {
    programs::golden("worst_tick.toml")
}

/// Rows of the worst tick of [`worst_job`].
///
/// # Errors
/// As [`Lab::run`]; the job cannot be read.
pub fn worst(bench: &Bench) -> Result<Vec<Figure>, BudgetError> {
    let path = worst_job();
    let unusable = |error: &dyn std::fmt::Display| BudgetError::File(path.clone(), error.to_string());
    let job = job_file::load(&path).map_err(|error| unusable(&error))?;
    let prepared = prepare(&job).map_err(|error| unusable(&error))?;
    let mut lab = Lab::new(bench)?;
    let run = lab.run(&prepared, WORST_TICKS)?;
    let worst = lab.worst(&prepared, &run)?;
    Ok(Model::ALL
        .map(|model| Figure::of_tick("worst job found", model, &worst.record))
        .to_vec())
}

/// Ticks of the worst job.
const WORST_TICKS: u32 = 2000;

/// The table of these figures.
#[must_use]
pub fn table(figures: &[Figure]) -> String {
    let mut text = HEADER.to_owned();
    for figure in figures {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} | {:.1} | {}", key(figure), figure.mean, figure.max);
    }
    text
}

fn key(figure: &Figure) -> String {
    format!("{} | {} | {}", figure.surface, figure.stage, figure.model.name())
}

/// What is wrong with these figures by a table: stages that grew by more than [`GROWTH_MAX`], and lines that are missing.
#[must_use]
pub fn complaints(table: &str, figures: &[Figure]) -> Vec<String> {
    figures
        .iter()
        .filter_map(|figure| complaint(table, figure))
        .collect()
}

fn complaint(table: &str, figure: &Figure) -> Option<String> {
    let key = key(figure);
    let line = table
        .lines()
        .find_map(|line| line.strip_prefix(key.as_str())?.strip_prefix(" | "));
    let Some((mean, max)) = line.and_then(|line| line.split_once(" | ")) else {
        return Some(format!("{key}: not in the golden table"));
    };
    let grew = |old: &str, new: f64| {
        old.trim()
            .parse::<f64>()
            .is_ok_and(|old| new <= old * (1.0 + GROWTH_MAX))
    };
    let holds = grew(mean, figure.mean) && grew(max, f64::from(figure.max));
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
        let table = table(&[figure(100.0, 200)]);
        assert!(complaints(&table, &[figure(102.0, 204)]).is_empty());
        assert!(complaints(&table, &[figure(50.0, 60)]).is_empty());
        assert_eq!(
            complaints(&table, &[figure(102.1, 204)]),
            ["ruled | offset | nominal: mean 100.0 -> 102.1, max 200 -> 204"]
        );
        assert_eq!(complaints(&table, &[figure(100.0, 205)]).len(), 1);
        assert_eq!(complaints("", &[figure(100.0, 200)]).len(), 1);
    }
}
