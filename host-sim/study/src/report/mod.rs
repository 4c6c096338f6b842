//! The page of `cargo sim paper`: a self-contained replication report.

mod chart;
mod figures;
mod scatter;
mod tables;
mod text;

use std::fmt::Write;
use std::io;
use std::path::Path;

use serde_json::{Value, json};

use crate::paper::figures::SpeedTrack;
use crate::paper::{Figures, Study};
use ::report::number::fixed;
use ::report::page::STYLE;

/// The page.
pub const PAGE: &str = "index.html";
/// The files that [`write()`] makes.
pub const FILES: [&str; 2] = [DATA, PAGE];
/// The figures' data.
const DATA: &str = "figures.json";

const PAPER_STYLE: &str = include_str!("paper.css");

/// Formats a number for a table.
#[must_use]
pub fn number(value: f64, decimals: usize) -> String {
    if decimals == 0 && (value - value.round()).abs() > 1e-9 {
        format!("{value:.2}")
    } else {
        format!("{value:.decimals$}")
    }
}

/// Formats a ripple with decimals by its magnitude.
#[must_use]
pub fn percent(value: f64) -> String {
    let decimals = if value >= 0.1 {
        2
    } else if value >= 0.001 {
        4
    } else {
        6
    };
    format!("{value:.decimals$}")
}

/// Formats a number for the page, with separated thousands.
fn shown(value: f64, decimals: usize) -> String {
    if decimals == 0 && (value - value.round()).abs() > 1e-9 {
        fixed(value, 2)
    } else {
        fixed(value, decimals)
    }
}

/// Writes the [`FILES`] into an existing folder.
///
/// # Errors
/// The files cannot be written.
pub fn write(folder: &Path, study: &Study) -> io::Result<()> {
    std::fs::write(folder.join(DATA), data(&study.figures).to_string())?;
    let page = page(study)?;
    std::fs::write(folder.join(PAGE), programs::with_command_name(&page).as_ref())
}

/// The whole page.
///
/// # Errors
/// Those of the chart library, which writing into memory does not cause.
pub fn page(study: &Study) -> io::Result<String> {
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n<title>Lo (1998), reproduced</title>\n\
         <style>\n{STYLE}{PAPER_STYLE}</style>\n</head>\n<body>\n<main>\n"
    );
    text::opening(&mut out, study);
    tables::comparisons(&mut out, study);
    tables::spacings(&mut out, study);
    text::disagreements(&mut out, study);
    figures::figures(&mut out, study)?;
    scatter::section(&mut out, study)?;
    tables::items(&mut out, study);
    text::closing(&mut out);
    let _ = writeln!(out, "</main>\n</body>\n</html>");
    Ok(out)
}

/// The figures' data.
fn data(figures: &Figures) -> Value {
    let track = |track: &SpeedTrack| {
        let column =
            |of: fn(&verify::speeds::PeriodSpeed) -> f64| track.speeds.iter().map(of).collect::<Vec<_>>();
        json!({
            "approach": track.kind.name(),
            "period_us": track.period_us,
            "time_s": column(|speed| speed.time_s),
            "arc_mm": column(|speed| speed.arc_mm),
            "cc_mm_s": column(|speed| speed.cc_mm_s),
            "cl_mm_s": column(|speed| speed.cl_mm_s),
        })
    };
    json!({
        "figure_3": { "cc_radius_height_mm": figures.section.cc_mm, "cl_radius_height_mm": figures.section.cl_mm },
        "figure_4": track(&figures.constant_cl),
        "figure_5": { "arc_mm_cl_mm_s": figures.wanted },
        "figure_7": {
            "equation_6": track(&figures.linear_printed),
            "tolerance_held": track(&figures.linear_held),
            "tolerance_held_1_ms": track(&figures.linear_1_ms),
        },
        "figure_8": { "cubics": track(&figures.curve), "ends_arc_mm_cl_mm_s": figures.curve_ends },
        "figure_9": track(&figures.surface),
    })
}

/// Writes the key of a figure: classes of the style sheet with their meaning.
fn legend(out: &mut String, entries: &[(&str, &str)]) {
    out.push_str("<p class=\"legend\">");
    for (class, what) in entries {
        let _ = write!(out, "<span><i class=\"{class}\"></i>{what}</span>");
    }
    out.push_str("</p>\n");
}
