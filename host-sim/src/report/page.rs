//! `index.html`: the picture, the figures and the charts on one page that needs nothing else.

use std::fmt::Write;
use std::io;
use std::path::Path;

use super::chart::{BLUE, Chart, Series, VIOLET, WARM};
use super::measure;
use super::picture::Words;
use super::record::Record;
use super::svg::escape;
use crate::approach::Kind;
use crate::job_file::{Along, JobFile, Pattern};
use crate::oracle::Oracle;
use crate::survey::Findings;

pub(super) const STYLE: &str = include_str!("page.css");

/// A speed that keeps within this share of the feed is called steady.
const STEADY_SHARE: f64 = 0.01;

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
    speed(&mut out, content)?;
    intervals(&mut out, content)?;
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

/// The speeds along the middle pass.
fn speed(out: &mut String, content: &Content<'_>) -> io::Result<()> {
    let speeds = measure::speeds(content.oracle, content.record);
    let pick = |of: fn(&measure::Speed) -> f64| {
        speeds
            .iter()
            .map(move |at| [at.arc_mm, of(at)])
            .collect::<Vec<_>>()
    };
    let (contact, centre) = (pick(|at| at.cc_mm_s), pick(|at| at.cl_mm_s));
    let range = |points: &[[f64; 2]]| {
        points
            .iter()
            .fold([f64::INFINITY, 0.0_f64], |[low, high], [_, y]| {
                [low.min(*y), high.max(*y)]
            })
    };
    let sentence = speed_sentence(content.job.feed_mm_s(), range(&contact), range(&centre));
    let chart = Chart {
        x_title: "arc along the pass, mm",
        y_title: "speed, mm/s",
        series: vec![
            Series {
                colour: WARM,
                points: contact,
            },
            Series {
                colour: VIOLET,
                points: centre,
            },
        ],
        ..Chart::default()
    };
    let Some(svg) = chart.svg()? else {
        return Ok(());
    };
    let (pass, last) = (
        content.record.middle_pass,
        content.findings.passes.saturating_sub(1),
    );
    let _ = writeln!(
        out,
        "<section><h2>Speed along pass {pass} (of 0 to {last})</h2>\n<p>{sentence}</p>"
    );
    legend(
        out,
        &[
            ("warm", "cutter contact (CC)"),
            ("violet dashed", "tool centre (CL)"),
        ],
    );
    let _ = writeln!(out, "<figure class=\"chart\">{svg}</figure></section>");
    Ok(())
}

/// What the speeds come to: slowest and fastest of the contact and of the centre.
fn speed_sentence(feed: f64, contact: [f64; 2], centre: [f64; 2]) -> String {
    let is_steady = |[slowest, fastest]: [f64; 2]| fastest - slowest < STEADY_SHARE * feed;
    let is_held = contact
        .iter()
        .all(|speed| (speed - feed).abs() < STEADY_SHARE * feed);
    let feed = significant(feed);
    let held = if is_held {
        format!("The feed of {feed} mm/s is held where the cutter touches the surface")
    } else {
        format!(
            "Of the feed of {feed} mm/s the cutter contact runs at {:.2} to {:.2} mm/s",
            contact[0], contact[1]
        )
    };
    let bends = if is_steady(centre) {
        format!(
            "the tool's centre runs at {:.2} mm/s, as the surface bends evenly along the pass",
            centre[1]
        )
    } else {
        format!(
            "the tool's centre has to run at {:.2} to {:.2} mm/s, as the surface bends under it",
            centre[0], centre[1]
        )
    };
    format!("{held}; {bends}.")
}

/// Intervals and distances, pass by pass.
fn intervals(out: &mut String, content: &Content<'_>) -> io::Result<()> {
    let passes = content.record.intervals.items();
    let least: Vec<_> = passes
        .iter()
        .filter(|p| p.least.is_finite())
        .map(|p| [f64::from(p.pass), p.least])
        .collect();
    let (unit, side) = match content.job.along {
        Along::U => ("least interval, in v", "v"),
        Along::V => ("least interval, in u", "u"),
    };
    let interval = Chart {
        x_title: "pass",
        y_title: unit,
        series: vec![Series {
            colour: BLUE,
            points: least,
        }],
        ..Chart::default()
    };
    let gaps = measure::gaps(content.oracle, &passes);
    let pick = |of: fn(&measure::Gap) -> f64| {
        gaps.iter()
            .map(move |gap| [f64::from(gap.pass), of(gap)])
            .collect()
    };
    let gap = Chart {
        x_title: "pass",
        y_title: "distance to the next pass, mm",
        series: vec![
            Series {
                colour: WARM,
                points: pick(|gap| gap.widest_mm),
            },
            Series {
                colour: BLUE,
                points: pick(|gap| gap.narrowest_mm),
            },
        ],
        band: true,
        ..Chart::default()
    };
    let (Some(interval), Some(gap)) = (interval.svg()?, gap.svg()?) else {
        return Ok(());
    };
    let thinned = match content.record.intervals.stride() {
        1 => String::new(),
        stride => format!(" One pass in {stride} is shown."),
    };
    let _ = writeln!(
        out,
        "<section><h2>Path interval</h2>\n<p>The next pass lies where the scallop between the two stays, to first order, within {} mm \
         everywhere: the least interval that any sample of a pass allowed, in the side parameter {side}.{thinned}</p>\n\
         <figure class=\"chart\">{interval}</figure>\n<p>The same in millimetres across the passes. The shaded range \
         lies between the widest and the narrowest place of each pass: where it is broad, passes of constant {side} \
         crowd. The last distance, which the boundary cuts short, is left out.</p>",
        content.job.scallop_mm
    );
    legend(
        out,
        &[
            ("warm", "at the widest place"),
            ("blue", "at the narrowest place"),
        ],
    );
    let _ = writeln!(out, "<figure class=\"chart\">{gap}</figure></section>");
    Ok(())
}

pub(super) fn legend(out: &mut String, entries: &[(&str, &str)]) {
    out.push_str("<p class=\"legend\">");
    for (class, what) in entries {
        let _ = write!(out, "<span><i class=\"{class}\"></i>{what}</span>");
    }
    out.push_str("</p>\n");
}

/// A count in groups of three digits.
pub(super) fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A number with so many decimals, its whole part in groups.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() || value.abs() >= 1e15 {
        return significant(value);
    }
    let text = format!("{value:.decimals$}");
    let (whole, rest) = text
        .split_once('.')
        .map_or((text.as_str(), ""), |(whole, rest)| (whole, rest));
    let point = if rest.is_empty() { "" } else { "." };
    match whole.parse::<u64>() {
        Ok(count) => format!("{}{point}{rest}", grouped(count)),
        Err(_) => text.clone(),
    }
}

/// A number with five significant digits; as `m·10^e` where it is small or large.
pub(super) fn significant(value: f64) -> String {
    if !value.is_finite() {
        return "none".to_owned();
    }
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        let digits = if value == 0.0 {
            0.0
        } else {
            value.abs().log10().floor()
        };
        let text = format!("{value:.*}", (4.0 - digits).clamp(0.0, 9.0) as usize);
        // Zeros before the point count.
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    let text = format!("{value:.1e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!(
        "{mantissa}·10{}",
        exponent.chars().filter_map(superscript).collect::<String>()
    )
}

fn superscript(c: char) -> Option<char> {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match c {
        '-' => Some('⁻'),
        _ => c
            .to_digit(10)
            .and_then(|digit| DIGITS.get(digit as usize).copied()),
    }
}

/// A time for people.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 60.0 => format!("{s:.1} s"),
        s if s < 3600.0 => format!("{:.1} min", s / 60.0),
        s => format!("{:.2} h", s / 3600.0),
    }
}
