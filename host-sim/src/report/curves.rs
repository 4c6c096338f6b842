//! The sections of the page with charts: speeds along a pass, intervals from pass to pass.

use std::fmt::Write;
use std::io;

use super::chart::{BLUE, Chart, Series, VIOLET, WARM};
use super::measure;
use super::number::significant;
use super::page::{Content, legend};
use crate::job_file::Along;

/// A speed that keeps within this share of the feed is called steady.
const STEADY_SHARE: f64 = 0.01;

/// The speeds along the middle pass.
pub(super) fn speed(out: &mut String, content: &Content<'_>) -> io::Result<()> {
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
pub(super) fn intervals(out: &mut String, content: &Content<'_>) -> io::Result<()> {
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
