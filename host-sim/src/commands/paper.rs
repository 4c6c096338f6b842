//! `paper`: reproduces every example, table and figure of Lo's paper.

use job::units::{MM_PER_NM, S_PER_MIN};
use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::out::say;
use super::{Result, output_file, progress};
use study::paper::{Comparison, Item, Row, STEPS, SpacingTable, study};
use study::report as page;
use verify::speeds::SpeedRange;

/// Reproduces every example, table and figure of Lo's paper (1998), and compares the four approaches, and passes of constant scallop height.
///
/// Example: cargo sim paper --report out
#[derive(Debug, Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Writes a page with the figures, and their data as JSON, into this folder.
    #[arg(long, value_name = "DIR")]
    report: Option<PathBuf>,
    /// Overwrites existing files of --report.
    #[arg(long)]
    force: bool,
    /// Prints JSON instead of tables.
    #[arg(long)]
    pub(super) json: bool,
}

/// The items as JSON.
fn json(items: &[Item]) -> Value {
    let rows = items.iter().map(|item| {
        json!({
            "item": item.name(),
            "printed": item.printed,
            "ours": item.ours,
            "difference_pct": item.difference_pct(),
            "note": item.note,
        })
    });
    rows.collect()
}

/// The comparisons of approaches as items without a printed figure.
fn compared(comparisons: &[Comparison]) -> Vec<Item> {
    let mut items = Vec::new();
    for comparison in comparisons {
        for row in &comparison.rows {
            let Row { measured, .. } = row;
            let figures = [
                ("machining time", "min", 3, measured.time_s / S_PER_MIN),
                ("segments", "", 0, measured.planned.segments as f64),
                ("program", "bytes", 0, measured.planned.bytes as f64),
                ("ripple at most", "%", 5, measured.findings.report.ripple_pct.max),
                ("ripple rms", "%", 5, measured.findings.report.ripple_pct.rms()),
                ("slowest contact", "mm/s", 4, measured.findings.speeds.cc.min),
                ("fastest contact", "mm/s", 4, measured.findings.speeds.cc.max),
                ("slowest centre", "mm/s", 4, measured.findings.speeds.cl.min),
                ("fastest centre", "mm/s", 4, measured.findings.speeds.cl.max),
                (
                    "step of the centre's speed",
                    "mm/s",
                    4,
                    measured.findings.speeds.cl_step_mm_s,
                ),
                (
                    "centre off its path",
                    "mm",
                    6,
                    measured.findings.report.position_nm.max * MM_PER_NM,
                ),
            ];
            items.extend(figures.map(|(what, unit, decimals, ours)| Item {
                part: "Comparison",
                what: format!("{}: {}: {what}", comparison.name, row.name()),
                unit,
                decimals,
                printed: None,
                ours: Some(ours),
                note: String::new(),
            }));
        }
    }
    items
}

/// Passes of constant scallop height beside straight ones, as items without a printed figure.
fn spaced(tables: &[SpacingTable]) -> Vec<Item> {
    let mut items = Vec::new();
    for table in tables {
        for row in &table.rows {
            let figures = [
                ("passes", "", 0, row.path.passes as f64),
                ("partial passes", "", 0, row.path.partial as f64),
                ("length of all passes", "mm", 1, row.path.length_mm),
                ("whole time", "min", 3, row.path.time_s / S_PER_MIN),
                ("highest crest over the limit", "", 4, row.crest_max),
                ("mean crest over the limit", "", 4, row.crest_mean),
                ("error of the crests over the limit", "", 5, row.error),
            ];
            items.extend(figures.map(|(what, unit, decimals, ours)| Item {
                part: "Spacing",
                what: format!("{}: {}: {what}", table.name, row.name()),
                unit,
                decimals,
                printed: None,
                ours: Some(ours),
                note: String::new(),
            }));
        }
    }
    items
}

fn print(items: &[Item]) {
    let mut part = "";
    for item in items {
        if item.part != part {
            part = item.part;
            say!("\n{part:<58} {:>12} {:>14} {:>9}", "printed", "ours", "diff %");
        }
        let unit = if item.unit.is_empty() {
            String::new()
        } else {
            format!(", {}", item.unit)
        };
        let shown = |value: Option<f64>, none: &str| {
            value.map_or(none.to_owned(), |value| page::number(value, item.decimals))
        };
        let difference = item
            .difference_pct()
            .map_or(String::new(), |difference| format!("{difference:.1}"));
        say!(
            "  {:<56} {:>12} {:>14} {difference:>9}",
            format!("{}{unit}", item.what),
            shown(item.printed, ""),
            shown(item.ours, "not yet"),
        );
        if !item.note.is_empty() {
            say!("      {}", item.note);
        }
    }
}

fn print_comparison(comparison: &Comparison) {
    say!(
        "\n{} ({}): feed {} mm/s, scallop {} mm, tolerance {} mm",
        comparison.title,
        comparison.name,
        comparison.feed_mm_s,
        comparison.scallop_mm,
        comparison.chord_mm
    );
    say!(
        "  {:<14} {:>9} {:>9} {:>10} {:>10} {:>10} {:>17} {:>17} {:>10}",
        "",
        "time, min",
        "segments",
        "bytes",
        "ripple, %",
        "rms, %",
        "CC, mm/s",
        "CL, mm/s",
        "step, mm/s"
    );
    for row in &comparison.rows {
        let Row { measured, .. } = row;
        let range = |span: &SpeedRange| format!("{:.3}..{:.3}", span.min, span.max);
        say!(
            "  {:<14} {:>9.2} {:>9} {:>10} {:>10} {:>10} {:>17} {:>17} {:>10.3}",
            row.name(),
            measured.time_s / S_PER_MIN,
            measured.planned.segments,
            measured.planned.bytes,
            page::percent(measured.findings.report.ripple_pct.max),
            page::percent(measured.findings.report.ripple_pct.rms()),
            range(&measured.findings.speeds.cc),
            range(&measured.findings.speeds.cl),
            measured.findings.speeds.cl_step_mm_s,
        );
    }
}

fn print_spacing(table: &SpacingTable) {
    say!(
        "\n{} ({}): feed {} mm/s, scallop {} mm, zigzag with the axis limits of jobs/plate_machine.toml",
        table.title,
        table.name,
        table.feed_mm_s,
        table.scallop_mm
    );
    say!(
        "  {:<16} {:>7} {:>8} {:>10} {:>6} {:>9} {:>6} {:>8} {:>8} {:>8}",
        "",
        "passes",
        "partial",
        "length, mm",
        "ratio",
        "time, min",
        "ratio",
        "crest",
        "mean",
        "+-"
    );
    for row in &table.rows {
        say!(
            "  {:<16} {:>7} {:>8} {:>10.1} {:>6.3} {:>9.2} {:>6.3} {:>8.4} {:>8.4} {:>8.4}",
            row.name(),
            row.path.passes,
            row.path.partial,
            row.path.length_mm,
            table.length_ratio(row),
            row.path.time_s / S_PER_MIN,
            table.time_ratio(row),
            row.crest_max,
            row.crest_mean,
            row.error,
        );
    }
}

pub(super) fn command(arguments: &Arguments) -> Result<()> {
    if let Some(folder) = &arguments.report {
        // Before the work, which takes minutes.
        output_file::prepare_folder(folder, &page::FILES, arguments.force)?;
    }
    let bar = progress(STEPS, "reproducing");
    let study = study(&|| bar.inc(1))?;
    bar.finish_and_clear();
    let mut items = study.items.clone();
    items.extend(compared(&study.comparisons));
    items.extend(spaced(&study.spacings));
    if let Some(folder) = &arguments.report {
        output_file::write_folder(folder, &page::FILES, arguments.force, |made| {
            page::write(made, &study)
        })?;
    }
    if arguments.json {
        say!("{}", json(&items));
        return Ok(());
    }
    say!(
        "C.-C. Lo, A new approach to CNC tool path generation, Computer-Aided Design 30 (1998): printed against ours"
    );
    print(&study.items);
    for comparison in &study.comparisons {
        print_comparison(comparison);
    }
    say!(
        "\nPasses of constant scallop height beside straight ones; crests by the swept ball, over the limit"
    );
    study.spacings.iter().for_each(print_spacing);
    if let Some(folder) = &arguments.report {
        say!("\nreport: {}", folder.join(page::PAGE).display());
    }
    Ok(())
}
