//! `index.html`: the picture, the figures and the charts on one page that needs nothing else.

use std::fmt::Write;
use std::io;
use std::path::Path;

use super::curves;
use super::number::{duration, fixed, grouped, significant};
use super::picture::Words;
use super::record::Record;
use super::svg::escape;
use crate::approach::Kind;
use crate::job_file::{Along, JobFile, Pattern};
use crate::oracle::Oracle;
use crate::survey::Findings;

pub(super) const STYLE: &str = include_str!("page.css");

/// What the page is made of.
pub(super) struct Content<'a> {
    pub(super) job: &'a JobFile,
    pub(super) approach: Kind,
    pub(super) oracle: &'a Oracle,
    pub(super) record: &'a Record,
    pub(super) findings: &'a Findings,
    pub(super) words: &'a Words,
    pub(super) picture: &'a str,
}

/// What picture and page say about the job.
pub(super) fn words(job: &JobFile, record: &Record, job_name: &Path, findings: &Findings) -> Words {
    let title = job_name
        .file_stem()
        .map_or_else(|| "job".to_owned(), |name| name.to_string_lossy().into_owned());
    let along = parameter(job.along);
    let passes = findings.passes;
    let plural = if passes == 1 { "pass" } else { "passes" };
    let order = match job.pattern {
        Pattern::Zig => "one way",
        Pattern::Zigzag => "to and fro",
    };
    let subtitle = format!(
        "{} surface · {passes} {plural} along {along}, {order} · {} mm/min at the cutter contact · scallop {} mm",
        job.surface.kind(),
        job.feed_mm_min,
        job.scallop_mm
    );
    let drawn = record.drawn.len();
    let drawn_of = if drawn == passes as usize {
        String::new()
    } else {
        format!("{drawn} of ")
    };
    Words {
        subtitle,
        passes: format!("cutter contact, {drawn_of}{passes} {plural}"),
        ball: format!("ball, radius {} mm, to scale", job.radius_mm),
        description: format!(
            "The {} surface of job {title} in parallel projection, with {drawn} of its {passes} {plural} along {along}. \
             One pass is emphasised; the path of the tool's centre runs above it, and a ball of {} mm radius touches \
             the surface on it.",
            job.surface.kind(),
            job.radius_mm
        ),
        title,
    }
}

fn parameter(along: Along) -> &'static str {
    match along {
        Along::U => "u",
        Along::V => "v",
    }
}

/// The whole page.
///
/// # Errors
/// As [`Chart::svg`].
pub(super) fn page(content: &Content<'_>) -> io::Result<String> {
    let title = escape(&content.words.title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n<title>{title}: tool path</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<h1>Tool path report</h1>\n"
    );
    if !content.findings.report.complete {
        out.push_str("<p class=\"warning\">The run ended before its last pass was complete.</p>\n");
    }
    let _ = writeln!(out, "<figure class=\"picture\">\n{}</figure>", content.picture);
    tables(&mut out, content);
    curves::speed(&mut out, content)?;
    curves::intervals(&mut out, content)?;
    let emitter = match content.approach {
        Kind::Surface => "those that the core emitted".to_owned(),
        other => format!("those of the approach <code>{}</code>, in f64", other.name()),
    };
    let _ = writeln!(
        out,
        "<footer>Written by <code>cargo sim</code>. Positions and speeds are {emitter}; \
         surface, arc lengths and errors are by the independent f64 oracle.</footer>\n\
         </main>\n</body>\n</html>"
    );
    Ok(out)
}

/// A row of a table: what, raw value, value for people, unit.
struct Row(&'static str, f64, String, &'static str);

fn tables(out: &mut String, content: &Content<'_>) {
    out.push_str("<div class=\"tables\">\n");
    table(out, "Run", &run_rows(content.job, content.findings));
    table(out, "Against the oracle, at most", &oracle_rows(content.findings));
    table(out, "Job", &job_rows(content.job));
    out.push_str("</div>\n");
}

fn run_rows(job: &JobFile, findings: &Findings) -> [Row; 6] {
    let side = match job.along {
        Along::U => "of v",
        Along::V => "of u",
    };
    let samples = findings.samples as f64;
    let time_s = samples * job.machine.period_s();
    let [cc_mm, cl_mm] = [findings.report.cc_length_mm, findings.speeds.cl_length_mm];
    let interval = findings.interval_min;
    [
        Row(
            "Passes",
            findings.passes.into(),
            grouped(findings.passes.into()),
            "",
        ),
        Row("Samples", samples, grouped(findings.samples), ""),
        Row("Machining time", time_s, duration(time_s), ""),
        Row("Cutter contact path", cc_mm, fixed(cc_mm, 1), "mm"),
        Row("Tool centre path", cl_mm, fixed(cl_mm, 1), "mm"),
        Row("Least path interval", interval, significant(interval), side),
    ]
}

fn oracle_rows(findings: &Findings) -> [Row; 7] {
    let report = &findings.report;
    let (ripple, ripple_rms) = (report.ripple_pct.max, report.ripple_pct.rms());
    let [cl, cc, normal] =
        [report.position_nm, report.contact_nm, report.normal_rad].map(|figure| figure.max);
    let (scallop, scallop_mean) = (report.scallop_mm.max, report.scallop_mean_mm());
    [
        Row("Feed ripple", ripple, significant(ripple), "%"),
        Row("Feed ripple, rms", ripple_rms, significant(ripple_rms), "%"),
        Row("Tool centre error", cl, fixed(cl, 2), "nm"),
        Row("Cutter contact error", cc, fixed(cc, 2), "nm"),
        Row("Normal error", normal, significant(normal), "rad"),
        Row("Scallop by formula", scallop, fixed(scallop, 6), "mm"),
        Row(
            "Scallop by formula, mean",
            scallop_mean,
            fixed(scallop_mean, 6),
            "mm",
        ),
    ]
}

fn job_rows(job: &JobFile) -> [Row; 4] {
    let row = |what, value: f64, unit| Row(what, value, value.to_string(), unit);
    [
        row("Ball radius", job.radius_mm, "mm"),
        row("Feed of the contact", job.feed_mm_min, "mm/min"),
        row("Scallop height limit", job.scallop_mm, "mm"),
        row("Sampling period", job.machine.period_us, "µs"),
    ]
}

fn table(out: &mut String, caption: &str, rows: &[Row]) {
    let _ = writeln!(out, "<table><caption>{caption}</caption><tbody>");
    for Row(what, value, shown, unit) in rows {
        let space = if unit.is_empty() { "" } else { " " };
        let _ = writeln!(
            out,
            "<tr><th scope=\"row\">{what}</th><td><data value=\"{value}\">{shown}</data>{space}{unit}</td></tr>"
        );
    }
    out.push_str("</tbody></table>\n");
}

pub(super) fn legend(out: &mut String, entries: &[(&str, &str)]) {
    out.push_str("<p class=\"legend\">");
    for (class, what) in entries {
        let _ = write!(out, "<span><i class=\"{class}\"></i>{what}</span>");
    }
    out.push_str("</p>\n");
}
