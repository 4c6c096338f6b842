//! Data size against ripple, all approaches on all jobs.

use std::fmt::Write;
use std::io;

use plotters::coord::combinators::LogCoord;
use plotters::prelude::*;

use super::super::chart::{AXIS, BLUE, FINE, GREEN, GRID, INK, SIZE, VIOLET, WARM};
use super::super::page::legend;
use crate::approach::Kind;
use crate::paper::Study;

/// Ranges, both logarithmic: bytes, and % of the feed.
const BYTES: [f64; 2] = [20.0, 3e6];
const RIPPLE: [f64; 2] = [3e-6, 300.0];
/// Pixels.
const HEIGHT: u32 = 460;
const MARK: i32 = 7;

type Area<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;

fn colour(kind: Kind) -> RGBColor {
    match kind {
        Kind::ConstantCl => WARM,
        Kind::Linear => VIOLET,
        Kind::Curve => GREEN,
        Kind::Surface => BLUE,
    }
}

/// The section with the figure.
pub(super) fn section(out: &mut String, study: &Study) -> io::Result<()> {
    let mut svg = String::new();
    draw(&mut svg, study).map_err(|error| io::Error::other(error.to_string()))?;
    out.push_str("<section><h2>Data against ripple</h2>\n");
    legend(
        out,
        &[
            ("warm", "constant-cl"),
            ("violet", "linear, 1 ms"),
            ("green", "curve"),
            ("blue", "surface"),
        ],
    );
    let _ = writeln!(
        out,
        "<figure class=\"chart\">{svg}</figure>\n<p class=\"caption\">What the CNC has to be fed for the whole job, and how far the contact's \
         speed is off at worst; both axes are logarithmic, best is bottom left. Circles: Example 1; squares: Example 2, reconstructed; \
         triangles: the freeform shell.</p></section>"
    );
    Ok(())
}

fn draw(text: &mut String, study: &Study) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(text, (SIZE.0 * FINE, HEIGHT * FINE)).into_drawing_area();
    let font = |pixels: u32| ("sans-serif", pixels * FINE).into_font().color(&INK);
    let mut chart = ChartBuilder::on(&root)
        .margin_top(8 * FINE)
        .margin_right(24 * FINE)
        .x_label_area_size(50 * FINE)
        .y_label_area_size(92 * FINE)
        .build_cartesian_2d(
            (BYTES[0]..BYTES[1]).log_scale(),
            (RIPPLE[0]..RIPPLE[1]).log_scale(),
        )?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID.stroke_width(FINE))
        .axis_style(AXIS.stroke_width(FINE))
        .set_all_tick_mark_size(5 * FINE)
        .label_style(font(17))
        .axis_desc_style(font(17))
        .x_label_formatter(&|value| decimal(*value))
        .y_label_formatter(&|value| decimal(*value))
        .x_desc("program, bytes")
        .y_desc("ripple at most, %")
        .draw()?;
    for (index, comparison) in study.comparisons.iter().enumerate() {
        for kind in Kind::ALL {
            if let Some(row) = comparison.row(kind) {
                let place = (
                    row.measured.planned.bytes as f64,
                    row.measured.findings.report.ripple_pct.max,
                );
                mark(&mut chart, index, place, colour(kind))?;
            }
        }
    }
    root.present()?;
    Ok(())
}

/// One point, its shape by the job.
fn mark(
    chart: &mut Area<'_, '_>,
    job: usize,
    place: (f64, f64),
    colour: RGBColor,
) -> Result<(), Box<dyn std::error::Error>> {
    let size = MARK * FINE as i32;
    match job {
        0 => {
            chart.draw_series([Circle::new(place, size, colour.filled())])?;
        }
        1 => {
            let square =
                EmptyElement::at(place) + Rectangle::new([(-size, -size), (size, size)], colour.filled());
            chart.draw_series([square])?;
        }
        _ => {
            chart.draw_series([TriangleMarker::new(place, size + size / 2, colour.filled())])?;
        }
    }
    Ok(())
}

/// A label without needless zeros.
fn decimal(value: f64) -> String {
    let exponent = value.log10().round() as i32;
    match exponent {
        -3..=3 => super::super::chart::short(value),
        exponent if exponent > 3 => format!("{value:.0}"),
        _ => super::super::page::significant(value).replace("1.0·", ""),
    }
}
