//! `index.html`: view, charts, figures and warnings on one self-contained page.

use std::fmt::Write;

use super::content::Content;
use super::number::{duration, fixed, grouped, significant};
use super::payload::payload;
use super::scallops::Scallops;
use super::svg::escape;
use job::{Along, Job};
use verify::survey::SurveyResult;

/// Style sheet of the pages.
pub const STYLE: &str = include_str!("page.css");
const REPORT_STYLE: &str = concat!(
    include_str!("viewer/uplot.min.css"),
    include_str!("viewer/view.css")
);
/// Content security policy: the browser refuses to load anything.
const POLICY: &str =
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:";
/// Libraries of view and charts, built by `scripts/viewer`.
const LIBRARIES: &str = include_str!("viewer/three-bundle.min.js");
/// Scripts of the page, which share one scope.
const SCRIPTS: [&str; 8] = [
    include_str!("viewer/data.js"),
    include_str!("viewer/words.js"),
    include_str!("viewer/scene.js"),
    include_str!("viewer/setting.js"),
    include_str!("viewer/panel.js"),
    include_str!("viewer/charts.js"),
    include_str!("viewer/binding.js"),
    include_str!("viewer/main.js"),
];
const VIEW: &str = include_str!("viewer/view.html");
const CHARTS: &str = include_str!("viewer/charts.html");
const LICENCES: &str = include_str!("viewer/three-bundle.licence.txt");

/// What the chart of the limits shows.
const BINDING_WORDS: &str = "The speed of the cutter contact (CC) as emitted, and the fastest motion on the same pass that an offline solver finds within the \
programmed feed and the limits of the axes, coloured by what binds: of velocity, acceleration and jerk of x, y, z, as differences of that motion's samples, \
the one that uses most of its limit. The solver's motion holds every limit but is not proved to be the fastest, so the emitted speed may be above it in places. The first, the middle and the last pass, and \
those that could be slowest. At a turn beyond the boundary the fastest motion may begin and end at any speed.";

/// The whole page.
pub(super) fn page(content: &Content<'_>) -> String {
    let title = escape(&content.words.title);
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\"/>\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
         <meta name=\"color-scheme\" content=\"light dark\"/>\n<title>{title}: tool path</title>\n\
         <style>\n{STYLE}{REPORT_STYLE}</style>\n</head>\n<body>\n<main class=\"report\">\n"
    );
    let _ = writeln!(
        out,
        "<header><h1>{title}</h1>\n<p class=\"sub\">{}</p></header>",
        escape(&subtitle(content))
    );
    remarks(&mut out, content);
    tiles(&mut out, content);
    out.push_str(VIEW);
    let _ = writeln!(
        out,
        "<figure class=\"picture\" id=\"picture\">\n{}</figure>\n\
         <p class=\"note\" id=\"no-view\" hidden=\"\">This browser draws no WebGL; the picture stands in for the view that turns.</p>\n\
         <noscript><p class=\"note\">View and charts need JavaScript, which is off; the picture and the figures do not.</p></noscript>\n\
         <p hidden=\"\" id=\"picture-words\">{}</p>\n<p class=\"note\">{}</p>",
        content.picture.svg,
        escape(&content.words.description),
        drawn_words(content)
    );
    out.push_str(
        &CHARTS
            .replace("@series", &series_words(content))
            .replace("@intervals", &interval_words(content))
            .replace("@binding", BINDING_WORDS),
    );
    tables(&mut out, content);
    footer(&mut out, content);
    scripts(&mut out, content);
    out.push_str("</main>\n</body>\n</html>\n");
    out
}

/// The line under the title.
fn subtitle(content: &Content<'_>) -> String {
    let job = content.job;
    match &content.remarks.source {
        None => content.words.subtitle.clone(),
        Some(source) => format!(
            "{source} on the job's {} surface · {} in contact · {} mm/min programmed at the cutter contact · scallop limit {} mm",
            job.surface.kind(),
            match content.findings.passes {
                1 => "one stretch".to_owned(),
                stretches => format!("{} stretches", grouped(stretches.into())),
            },
            job.feed_mm_min,
            job.scallop_mm
        ),
    }
}

/// Failures and warnings.
fn remarks(out: &mut String, content: &Content<'_>) {
    let remarks = content.remarks;
    let mut failures = remarks.failures.clone();
    if !content.findings.report.complete && failures.is_empty() {
        failures.push("The run ended before its last pass was complete.".to_owned());
    }
    if remarks.verified && failures.is_empty() {
        out.push_str("<p class=\"verdict good\"><b>Passed.</b> Every check of this job holds.</p>\n");
    }
    for (class, word, texts) in [
        ("bad", "Failed", &failures),
        ("warning", "Warning", &remarks.warnings),
    ] {
        for text in texts {
            let (first, help) = text.split_once('\n').unwrap_or((text, ""));
            let _ = write!(
                out,
                "<p class=\"verdict {class}\"><b>{word}.</b> {}",
                escape(first)
            );
            if !help.is_empty() {
                let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
                let _ = write!(out, "<br/><span>{}</span>", escape(&help));
            }
            out.push_str("</p>\n");
        }
    }
}

/// The main figures.
fn tiles(out: &mut String, content: &Content<'_>) {
    let (job, findings) = (content.job, content.findings);
    let report = &findings.report;
    let time_s = job.machine.time_s(findings.samples);
    let scallops = content.remarks.scallops.as_ref().map(Scallops::largest_mm);
    let scallop = match scallops.filter(|height| height.is_finite()) {
        Some(height) => ("Scallop height, max", fixed(height.into(), 5), "mm"),
        None => (
            "Scallop height, by formula",
            fixed(report.scallop_mm.max, 5),
            "mm",
        ),
    };
    let tiles = [
        ("Machining time", duration(time_s), ""),
        (
            if content.remarks.source.is_some() {
                "Stretches in contact"
            } else {
                "Passes"
            },
            grouped(findings.passes.into()),
            "",
        ),
        ("CC path", fixed(report.cc_length_mm * 1e-3, 2), "m"),
        scallop,
        ("Feed error, max", significant(report.ripple_pct.max), "%"),
        ("CL error, max", fixed(report.position_nm.max, 1), "nm"),
    ];
    out.push_str("<dl class=\"tiles\">\n");
    for (what, value, unit) in tiles {
        let _ = writeln!(
            out,
            "<div><dt>{what}</dt><dd>{value} <small>{unit}</small></dd></div>"
        );
    }
    out.push_str("</dl>\n");
}

/// Sampling of the view: passes, points, samples per point.
fn drawn_words(content: &Content<'_>) -> String {
    let track = content.track;
    let (passes, drawn) = (content.findings.passes as usize, track.drawn());
    let which = match (drawn == passes, track.every) {
        (true, _) => format!("all {} passes", grouped(passes as u64)),
        (_, every) => format!(
            "{} of {} passes, one in {every}",
            grouped(drawn as u64),
            grouped(passes as u64)
        ),
    };
    let stands = match track.strides() {
        [_, 1] => "one per sample".to_owned(),
        [least, most] if least >= most => {
            format!("one stands for {most} samples, coloured by the worst of them")
        }
        [least, most] => format!("one stands for {least} to {most} samples, coloured by the worst of them"),
    };
    format!(
        "The view draws {which} with {} points: {stands}.",
        grouped(track.points() as u64)
    )
}

/// Sampling of the charts.
fn series_words(content: &Content<'_>) -> String {
    let ticks = content.series.ticks();
    let samples = grouped(content.findings.samples);
    let kept = if ticks == 1 {
        format!("All {samples} samples are in the charts.")
    } else {
        format!(
            "{samples} samples are in the charts as spans of {ticks} samples, each with its least and largest value, so that \
             no peak is lost; one pass in the middle and the one with the largest error are kept finer."
        )
    };
    let [low, high] = [content.findings.speeds.cl.min, content.findings.speeds.cl.max];
    let bends = if low.is_finite() && high - low > 0.01 * high {
        format!(
            " The speed of the cutter location (CL) is {low:.2} to {high:.2} mm/s: it varies with the curvature of the surface."
        )
    } else {
        String::new()
    };
    let ends = if content.oracle.overruns {
        "The first pass begins and the last one ends at standstill; turns and other links between passes are not in the charts."
    } else if content.job.machine.has_limits() {
        "Each pass runs from standstill to standstill; links between passes are not in the charts."
    } else {
        "The last period of a pass is shorter than the others and has no speed."
    };
    format!(
        "{}{bends} {kept} {ends} Accelerations are taken over 8 periods before and after, as \
         positions are whole nanometres, but where those over single periods differ by more than 8 nm per period²: there they are as \
         emitted.",
        feed_words(content)
    )
}

/// A sentence about the range of the feed.
fn feed_words(content: &Content<'_>) -> String {
    /// Largest deviation of a constant feed, as a share of the feed.
    const HELD_SHARE: f64 = 0.01;
    let feed = content.job.feed_mm_s();
    let [low, high] = [content.findings.speeds.cc.min, content.findings.speeds.cc.max];
    if !low.is_finite() {
        return String::new();
    }
    let shown = significant(feed);
    if [low, high]
        .iter()
        .all(|speed| (speed - feed).abs() < HELD_SHARE * feed)
    {
        format!("The cutter contact (CC) moves at the programmed feed of {shown} mm/s.")
    } else {
        format!("Programmed feed {shown} mm/s; speed of the cutter contact (CC) {low:.2} to {high:.2} mm/s.")
    }
}

fn interval_words(content: &Content<'_>) -> String {
    let side = match content.job.along {
        Along::U => "v",
        Along::V => "u",
    };
    let thinned = match content.record.intervals.stride() {
        1 => String::new(),
        stride => format!(" One pass in {stride} is shown."),
    };
    if content.job.spacing.is_constant() {
        return format!(
            "Each pass is a curve whose scallop to the one before reaches {} mm wherever a limit of the curve does not forbid it. Heights are by gap, the strip \
             between two neighbouring curves. The last chart shows the least interval that any sample of a pass allows to first order, in the side parameter \
             {side}.{thinned}",
            content.job.scallop_mm
        );
    }
    format!(
        "The next pass lies where the scallop between the two stays within {} mm everywhere: the chart shows the least interval \
         that any sample of a pass allows to first order, in the side parameter {side}. In millimetres across the passes that is a range: \
         where it is broad, passes of constant {side} crowd. The last distance, which the boundary cuts short, is left \
         out.{thinned}",
        content.job.scallop_mm
    )
}

fn footer(out: &mut String, content: &Content<'_>) {
    let emitter = match (&content.remarks.source, content.approach) {
        (Some(source), _) => format!("those of {}", escape(source)),
        (None, None) => "those that the core emitted".to_owned(),
        (None, Some(approach)) => format!("those of the approach <code>{approach}</code>, in f64"),
    };
    let _ = writeln!(
        out,
        "<footer><p>Written by Isofeed. Positions and speeds are {emitter}; surface, arc lengths and errors are by the \
         independent f64 oracle. The page needs no network.</p>\n<details><summary>Libraries in this page, and their \
         licences</summary><pre>{}</pre></details></footer>",
        escape_lines(LICENCES)
    );
}

/// [`escape`] for each line.
fn escape_lines(text: &str) -> String {
    text.lines().map(escape).collect::<Vec<_>>().join("\n")
}

/// Data and scripts, after the elements that they use.
fn scripts(out: &mut String, content: &Content<'_>) {
    // `<` is escaped, so that no text can end the script element.
    let data = payload(content).to_string().replace('<', "\\u003c");
    let _ = writeln!(
        out,
        "<script type=\"application/json\" id=\"iso-data\">{data}</script>"
    );
    let _ = writeln!(out, "<script>\n{LIBRARIES}</script>");
    let _ = writeln!(
        out,
        "<script>\n\"use strict\";\n(() => {{\n{}}})();\n</script>",
        SCRIPTS.join("\n")
    );
}

/// A row of a table: name, raw value, formatted value, unit.
struct Row(&'static str, f64, String, &'static str);

fn tables(out: &mut String, content: &Content<'_>) {
    out.push_str("<div class=\"tables\">\n");
    if content.remarks.source.is_none() {
        table(out, "Run", &run_rows(content.job, content.findings));
        table(out, "Against the oracle, at most", &oracle_rows(content.findings));
    }
    table(out, "Job", &job_rows(content.job));
    let figures = &content.remarks.figures;
    if !figures.is_empty() {
        let caption = if content.remarks.source.is_some() {
            "Judged: given, and this core"
        } else {
            "Verified"
        };
        let _ = writeln!(out, "<table><caption>{caption}</caption><tbody>");
        for figure in figures {
            let _ = writeln!(
                out,
                "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
                escape(&figure.what),
                escape(&figure.value)
            );
        }
        out.push_str("</tbody></table>\n");
    }
    out.push_str("</div>\n");
}

fn run_rows(job: &Job, findings: &SurveyResult) -> [Row; 6] {
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
        Row("CC path", cc_mm, fixed(cc_mm, 1), "mm"),
        Row("CL path", cl_mm, fixed(cl_mm, 1), "mm"),
        Row("Least path interval", interval, significant(interval), side),
    ]
}

fn oracle_rows(findings: &SurveyResult) -> [Row; 7] {
    let report = &findings.report;
    let (ripple, ripple_rms) = (report.ripple_pct.max, report.ripple_pct.rms());
    let [cl, cc, normal] =
        [report.position_nm, report.contact_nm, report.normal_rad].map(|figure| figure.max);
    let (scallop, scallop_mean) = (report.scallop_mm.max, report.scallop_mean_mm());
    [
        Row("Feed ripple", ripple, significant(ripple), "%"),
        Row("Feed ripple, rms", ripple_rms, significant(ripple_rms), "%"),
        Row("CL error", cl, fixed(cl, 2), "nm"),
        Row("CC error", cc, fixed(cc, 2), "nm"),
        Row("Normal error", normal, significant(normal), "rad"),
        Row("Scallop height, by formula", scallop, fixed(scallop, 6), "mm"),
        Row(
            "Scallop height, by formula, mean",
            scallop_mean,
            fixed(scallop_mean, 6),
            "mm",
        ),
    ]
}

fn job_rows(job: &Job) -> [Row; 4] {
    let row = |what, value: f64, unit| Row(what, value, value.to_string(), unit);
    [
        row("Ball radius", job.radius_mm, "mm"),
        row("Feed (CC)", job.feed_mm_min, "mm/min"),
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
