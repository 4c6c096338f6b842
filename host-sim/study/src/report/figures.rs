//! Figures 3, 4, 5, 7, 8, 9, and a comparison of the approaches.

use std::fmt::Write;
use std::io;
use std::path::Path;

use super::chart::{BLUE, Chart, GREEN, Series, VIOLET, WARM};
use super::legend;
use crate::paper::figures::SpeedTrack;
use crate::paper::{Comparison, Study};
use approach::Kind;
use verify::speeds::PeriodSpeed;

/// Ranges of the section: millimetres, the same scale both ways in a chart of this height.
const SECTION: [[f64; 2]; 2] = [[10.0, 97.0], [15.0, 65.0]];
const SECTION_HEIGHT: u32 = 520;
/// Common range of the speeds, mm/s.
const SPEEDS: [f64; 2] = [4.0, 16.0];
/// Range of the deviations from the feed, %.
const DEVIATIONS: [f64; 2] = [-8.0, 8.0];

const LENGTH: &str = "length along the pass on the surface, mm";
const SPEED: &str = "speed, mm/s";

/// All figures.
pub(super) fn figures(out: &mut String, study: &Study) -> io::Result<()> {
    out.push_str(
        "<section><h2>The figures</h2>\n<p>One pass along u of Example 1's bell, r = 10 mm, feed 10 mm/s, unless stated \
         otherwise. CC is the cutter contact on the surface, CL the centre of the ball.</p>\n",
    );
    figure_3(out, study)?;
    speeds(out, study)?;
    deviations(out, study)?;
    out.push_str("</section>\n");
    pictures(out, study)
}

fn put(out: &mut String, class: &str, chart: &Chart<'_>, caption: &str) -> io::Result<()> {
    if let Some(svg) = chart.svg()? {
        let _ = writeln!(
            out,
            "<figure class=\"chart{class}\">{svg}</figure>\n<p class=\"caption\">{caption}</p>"
        );
    }
    Ok(())
}

const CONTACT_AND_CENTRE: [(&str, &str); 2] = [
    ("warm", "cutter contact (CC)"),
    ("violet dashed", "tool centre (CL)"),
];

/// The paths of contact and centre.
fn figure_3(out: &mut String, study: &Study) -> io::Result<()> {
    let section = &study.figures.section;
    legend(out, &CONTACT_AND_CENTRE);
    let line = |colour, points: &[[f64; 2]]| Series {
        colour,
        points: points.to_vec(),
    };
    let chart = Chart {
        x_title: "distance from the axis, mm",
        y_title: "height, mm",
        series: vec![line(WARM, &section.cc_mm), line(VIOLET, &section.cl_mm)],
        ranges: SECTION.map(Some),
        height: Some(SECTION_HEIGHT),
        ..Chart::default()
    };
    let [contact, centre] = study.figures.lengths_mm;
    put(
        out,
        "",
        &chart,
        &format!(
            "<b>Figure 3.</b> The profile that is turned about the axis, and the path of the tool's centre over it. Near the axis the \
             surface is convex, and the path of the centre is longer; near the rim it is concave. The paths are \
             {contact:.2} and {centre:.2} mm long."
        ),
    )
}

/// Speeds of contact and centre of a track.
fn of_track(track: &SpeedTrack) -> Vec<Series> {
    let pick = |of: fn(&PeriodSpeed) -> f64| track.speeds.iter().map(|at| [at.arc_mm, of(at)]).collect();
    vec![
        Series {
            colour: WARM,
            points: pick(|at| at.cc_mm_s),
        },
        Series {
            colour: VIOLET,
            points: pick(|at| at.cl_mm_s),
        },
    ]
}

/// Writes a chart of speeds with its legend; a stepped line of the centre is not dashed.
fn put_speeds(out: &mut String, class: &str, chart: &Chart<'_>, caption: &str) -> io::Result<()> {
    let centre = if class.is_empty() {
        "violet dashed"
    } else {
        "violet"
    };
    let entries = [("warm", "cutter contact (CC)"), (centre, "tool centre (CL)")];
    let first = if chart.series.len() == 1 { 1 } else { 0 };
    legend(out, &entries[first..]);
    put(out, class, chart, caption)
}

fn speeds(out: &mut String, study: &Study) -> io::Result<()> {
    let figures = &study.figures;
    let feed = study.cases.revolved.job.feed_mm_s();
    let chart = |series, marks| Chart {
        x_title: LENGTH,
        y_title: SPEED,
        series,
        marks,
        ranges: [None, Some(SPEEDS)],
        ..Chart::default()
    };
    let of = |track| chart(of_track(track), Vec::new());
    let slow = figures.constant_cl.measured.findings.speeds.cc;
    let wanted_ends = figures
        .wanted
        .iter()
        .fold([f64::INFINITY, 0.0_f64], |[low, high], [_, speed]| {
            [low.min(*speed), high.max(*speed)]
        });
    let segments = |track: &SpeedTrack| track.measured.planned.segments;
    put_speeds(
        out,
        "",
        &of(&figures.constant_cl),
        &format!(
            "<b>Figure 4.</b> Existing practice. The centre moves at a constant {:.0} mm/s, the contact at {:.2} where the surface \
             is convex and at {:.2} where it is concave.",
            figures.constant_cl.measured.findings.speeds.cl.mean(),
            slow.min,
            slow.max
        ),
    )?;
    let wanted = Series {
        colour: VIOLET,
        points: figures.wanted.clone(),
    };
    put_speeds(
        out,
        "",
        &chart(vec![wanted], Vec::new()),
        &format!(
            "<b>Figure 5.</b> The speed of the centre that moves the contact at a constant {feed} mm/s: {:.2} to {:.2}.",
            wanted_ends[0], wanted_ends[1]
        ),
    )?;
    put_speeds(
        out,
        " steps",
        &of(&figures.linear_printed),
        &format!(
            "<b>Figure 7.</b> Method 1, linear interpolator, the {} segments of eqn 6, sampled each {} ms. The speed of the centre is constant on \
             each segment, that of the contact deviates from the feed. The peak in the middle is the segment that spans \
             the inflection; the drop at the end is the shorter last segment.",
            segments(&figures.linear_printed),
            figures.linear_printed.period_us * 1e-3
        ),
    )?;
    put_speeds(
        out,
        " steps",
        &of(&figures.linear_held),
        &format!(
            "<b>Figure 7, with segments within the tolerance.</b> Figure 7 with {} segments whose error is measured, not estimated.",
            segments(&figures.linear_held)
        ),
    )?;
    let marks = figures.curve_ends.iter().map(|end| (VIOLET, *end)).collect();
    put_speeds(
        out,
        "",
        &chart(of_track(&figures.curve), marks),
        &format!(
            "<b>Figure 8.</b> Method 2, curve interpolator. {0} cubics for the path and, on the same segments, {0} for the speed of the \
             centre; the dots are their ends.",
            segments(&figures.curve)
        ),
    )?;
    put_speeds(
        out,
        "",
        &of(&figures.surface),
        "<b>Figure 9.</b> Method 3, surface interpolator, as the core runs it each millisecond. The contact keeps the feed; the speed of the \
         centre follows from it.",
    )
}

/// Deviation from the feed of the methods that control the contact's speed.
fn deviations(out: &mut String, study: &Study) -> io::Result<()> {
    let figures = &study.figures;
    let feed = study.cases.revolved.job.feed_mm_s();
    let series = |track: &SpeedTrack, colour| Series {
        colour,
        points: track
            .speeds
            .iter()
            .map(|at| [at.arc_mm, 100.0 * (at.cc_mm_s / feed - 1.0)])
            .collect(),
    };
    let segments = |track: &SpeedTrack| track.measured.planned.segments;
    let linear = format!("linear, 1 ms, {} segments", segments(&figures.linear_1_ms));
    let curve = format!("curve, {} cubics", segments(&figures.curve));
    let slow = figures.constant_cl.measured.findings.speeds.cc;
    legend(
        out,
        &[
            ("violet", &*linear),
            ("green dashdot", &*curve),
            ("blue dashed", "surface"),
        ],
    );
    let chart = Chart {
        x_title: LENGTH,
        y_title: "contact against feed, %",
        series: vec![
            series(&figures.linear_1_ms, VIOLET),
            series(&figures.curve, GREEN),
            series(&figures.surface, BLUE),
        ],
        ranges: [None, Some(DEVIATIONS)],
        ..Chart::default()
    };
    put(
        out,
        " steps broken",
        &chart,
        &format!(
            "<b>Side by side.</b> Deviation of the contact's speed from the feed, period 1 ms. Constant speed of the centre, Figure 4, \
             deviates by −{:.0} to +{:.0} %, outside the chart.",
            100.0 * (1.0 - slow.min / feed),
            100.0 * (slow.max / feed - 1.0)
        ),
    )
}

/// The surfaces with their passes.
fn pictures(out: &mut String, study: &Study) -> io::Result<()> {
    out.push_str("<section><h2>The surfaces and their passes</h2>\n<p>Passes of the core; the first picture belongs to Figure 3.</p>\n");
    for (index, comparison) in study.comparisons.iter().enumerate() {
        if let Some(picture) = picture(comparison)? {
            // Identifiers must be unique on the page.
            let picture = picture
                .replace("iso-title", &format!("iso-title-{index}"))
                .replace("iso-desc", &format!("iso-desc-{index}"))
                .replace("iso-ball", &format!("iso-ball-{index}"));
            let _ = writeln!(out, "<figure class=\"picture\">\n{picture}</figure>");
        }
    }
    out.push_str("</section>\n");
    Ok(())
}

fn picture(comparison: &Comparison) -> io::Result<Option<String>> {
    let Some(row) = comparison.row(Kind::Surface) else {
        return Ok(None);
    };
    let name = format!("{}.toml", comparison.name);
    let draw = |sketch: &::report::Sketch| sketch.picture(Path::new(&name), &row.measured.findings);
    row.sketch.as_ref().map(draw).transpose()
}
