//! The tables of the page.

use job::units::S_PER_MIN;
use std::fmt::Write;

use super::{percent, shown};
use crate::paper::{Comparison, Item, Row, SpacingTable, Study};
use ::report::number::fixed;
use ::report::svg::escape;
use approach::Kind;
use verify::speeds::SpeedRange;

/// The four approaches on whole jobs.
pub(super) fn comparisons(out: &mut String, study: &Study) {
    out.push_str(
        "<section><h2>Four approaches on whole jobs</h2>\n\
         <p>Each job at the same scallop height, tolerance and feed for all. The period is 1 ms unless stated. Times exclude \
         links between passes.</p>\n",
    );
    for comparison in &study.comparisons {
        table(out, comparison);
    }
    out.push_str("</section>\n");
}

fn table(out: &mut String, comparison: &Comparison) {
    let _ = writeln!(
        out,
        "<div class=\"scroll\"><table class=\"wide\"><caption>{} <span class=\"sub\">(feed {} mm/s, scallop {} mm, tolerance {} mm)</span>\
         </caption>\n<thead><tr><th>approach</th><th>time<br/>min</th><th>segments</th><th>program<br/>bytes</th><th>ripple<br/>%, most</th>\
         <th>ripple<br/>%, rms</th><th>CC speed<br/>mm/s</th><th>CL speed<br/>mm/s</th><th>CL steps<br/>mm/s</th></tr></thead><tbody>",
        escape(comparison.title),
        comparison.feed_mm_s,
        comparison.scallop_mm,
        comparison.chord_mm
    );
    for row in &comparison.rows {
        let Row { measured, .. } = row;
        let range = |span: &SpeedRange| format!("{:.2} to {:.2}", span.min, span.max);
        let segments = shown(measured.planned.segments as f64, 0);
        let segments = match (row.kind, measured.planned.segments) {
            (Kind::Surface, 1) => "1 patch".to_owned(),
            (Kind::Surface, _) => format!("{segments} patches"),
            _ => segments,
        };
        let _ = writeln!(
            out,
            "<tr{}><th scope=\"row\">{}</th><td>{:.2}</td><td>{segments}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
             <td>{:.2}</td></tr>",
            if row.kind == Kind::Surface {
                " class=\"best\""
            } else {
                ""
            },
            row.name(),
            measured.time_s / S_PER_MIN,
            shown(measured.planned.bytes as f64, 0),
            percent(measured.findings.report.ripple_pct.max),
            percent(measured.findings.report.ripple_pct.rms()),
            range(&measured.findings.speeds.cc),
            range(&measured.findings.speeds.cl),
            measured.findings.speeds.cl_step_mm_s
        );
    }
    out.push_str("</tbody></table></div>\n");
}

/// Passes of constant scallop height beside straight ones.
pub(super) fn spacings(out: &mut String, study: &Study) {
    out.push_str(
        "<section><h2>Passes of constant scallop height</h2>\n\
         <p>The paper's passes are lines of constant parameter, and the narrowest place of a gap sets its width. <code>first-order</code> is \
         the paper's interval, <code>exact</code> the step over which the limit is kept; with <code>constant</code> each pass is a curve at \
         the scallop height from the last one, made while the tool is on that, from the surface's edge or from its middle. Crests are those of the \
         swept ball, as shares of the limit. Zigzag, with the axis limits of <code>jobs/plate_machine.toml</code>: times include rests and \
         links. Bold: the fastest within the limit.</p>\n",
    );
    for table in &study.spacings {
        spacing(out, table);
    }
    out.push_str("</section>\n");
}

fn spacing(out: &mut String, table: &SpacingTable) {
    let _ = writeln!(
        out,
        "<div class=\"scroll\"><table class=\"wide\"><caption>{} <span class=\"sub\">(feed {} mm/s, scallop {} mm)</span>\
         </caption>\n<thead><tr><th>passes</th><th>number</th><th>partial</th><th>length<br/>mm</th><th>of<br/>first-order</th>\
         <th>whole time<br/>min</th><th>of<br/>first-order</th><th>highest<br/>crest</th><th>mean<br/>crest</th></tr></thead><tbody>",
        escape(table.title),
        table.feed_mm_s,
        table.scallop_mm
    );
    let fastest = table.fastest();
    for row in &table.rows {
        let is_best = fastest == Some(row);
        let _ = writeln!(
            out,
            "<tr{}><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{:.2}</td><td>{:.3}</td><td>{:.3}</td><td>{:.3}</td></tr>",
            if is_best { " class=\"best\"" } else { "" },
            row.name(),
            row.path.passes,
            row.path.partial,
            fixed(row.path.length_mm, 0),
            table.length_ratio(row),
            row.path.time_s / S_PER_MIN,
            table.time_ratio(row),
            row.crest_max,
            row.crest_mean
        );
    }
    out.push_str("</tbody></table></div>\n");
}

/// All numbers of the paper by its parts.
pub(super) fn items(out: &mut String, study: &Study) {
    out.push_str(
        "<section><h2>Every number</h2>\n<p>Printed in the paper, and ours; no difference where the paper prints none.</p>\n",
    );
    let parts = study.items.chunk_by(|a, b| a.part == b.part);
    for items in parts {
        let _ = writeln!(
            out,
            "<div class=\"scroll\"><table class=\"wide\"><caption>{}</caption>\n<thead><tr><th></th><th>printed</th><th>ours</th>\
             <th>difference</th><th class=\"left\"></th></tr></thead><tbody>",
            items.first().map_or("", |item| item.part)
        );
        for item in items {
            row(out, item);
        }
        out.push_str("</tbody></table></div>\n");
    }
    out.push_str("</section>\n");
}

fn row(out: &mut String, item: &Item) {
    let unit = if item.unit.is_empty() {
        String::new()
    } else {
        format!(", {}", item.unit)
    };
    let value =
        |value: Option<f64>, none: &str| value.map_or(none.to_owned(), |value| shown(value, item.decimals));
    let difference = item.difference_pct().map_or(String::new(), |difference| {
        let magnitude = fixed(difference.abs(), 1);
        match difference {
            _ if magnitude == "0.0" => "0.0 %".to_owned(),
            d if d < 0.0 => format!("−{magnitude} %"),
            _ => format!("+{magnitude} %"),
        }
    });
    let _ = writeln!(
        out,
        "<tr><th scope=\"row\">{}{unit}</th><td>{}</td><td>{}</td><td>{difference}</td><td class=\"note\">{}</td></tr>",
        escape(&item.what),
        value(item.printed, ""),
        value(item.ours, ""),
        escape(&item.note)
    );
}
