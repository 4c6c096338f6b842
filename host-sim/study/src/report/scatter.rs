//! Data size against ripple, all approaches on all jobs.

use std::fmt::Write;
use std::io;

use plotters::coord::combinators::LogCoord;
use plotters::prelude::*;

use super::chart::{AXIS, BLUE, FINE, GREEN, GRID, INK, SIZE, VIOLET, WARM};
use crate::paper::Study;
use approach::Kind;

/// Range of the horizontal axis, bytes; logarithmic.
const BYTES: [f64; 2] = [20.0, 3e6];
/// Range of the vertical axis, % of the feed; logarithmic.
const RIPPLE: [f64; 2] = [3e-6, 300.0];
/// Height of the chart, pixels.
const HEIGHT: u32 = 460;
/// Size of a mark, pixels.
const MARK: i32 = 7;
/// Offset of a label from its mark, right and up, pixels.
const LABEL_OFFSET: i32 = 9;
/// Labels of the jobs, in the study's order.
const NAMES: [&str; 3] = ["1", "2", "F"];

type Area<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;

/// Colour, class of the colour in the style sheet, and shape of an approach.
fn style(kind: Kind) -> (RGBColor, &'static str, char) {
    match kind {
        Kind::ConstantCl => (WARM, "warm", '✕'),
        Kind::Linear => (VIOLET, "violet", '■'),
        Kind::Curve => (GREEN, "green", '▲'),
        Kind::Surface => (BLUE, "blue", '●'),
    }
}

/// The section with the figure.
pub(super) fn section(out: &mut String, study: &Study) -> io::Result<()> {
    let mut svg = String::new();
    draw(&mut svg, study).map_err(|error| io::Error::other(error.to_string()))?;
    out.push_str("<section><h2>Data against ripple</h2>\n<p class=\"legend\">");
    for kind in Kind::ALL {
        let (_, class, shape) = style(kind);
        let _ = write!(
            out,
            "<span><b class=\"{class}\">{shape}</b>{}</span>",
            kind.name()
        );
    }
    let _ = writeln!(
        out,
        "</p>\n<figure class=\"chart\">{svg}</figure>\n<p class=\"caption\">Size of the program for the whole job against the \
         greatest deviation of the contact's speed, period 1 ms; both axes are logarithmic. 1: Example 1; 2: Example 2, \
         reconstructed; F: the freeform shell.</p></section>"
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
                mark(&mut chart, kind, place)?;
                let name = NAMES.get(index).copied().unwrap_or("?");
                let label = EmptyElement::at(place)
                    + Text::new(
                        name,
                        (LABEL_OFFSET * FINE as i32, -LABEL_OFFSET * FINE as i32),
                        font(15),
                    );
                chart.draw_series([label])?;
            }
        }
    }
    root.present()?;
    Ok(())
}

/// One point, its shape by the approach.
fn mark(chart: &mut Area<'_, '_>, kind: Kind, place: (f64, f64)) -> Result<(), Box<dyn std::error::Error>> {
    let (colour, ..) = style(kind);
    let size = MARK * FINE as i32;
    match kind {
        Kind::ConstantCl => {
            chart.draw_series([Cross::new(place, size, colour.stroke_width(3 * FINE))])?;
        }
        Kind::Linear => {
            let square =
                EmptyElement::at(place) + Rectangle::new([(-size, -size), (size, size)], colour.filled());
            chart.draw_series([square])?;
        }
        Kind::Curve => {
            chart.draw_series([TriangleMarker::new(place, size + size / 2, colour.filled())])?;
        }
        Kind::Surface => {
            chart.draw_series([Circle::new(place, size, colour.filled())])?;
        }
    }
    Ok(())
}

/// Label of a power of ten, without trailing zeros.
fn decimal(value: f64) -> String {
    let exponent = value.log10().round() as i32;
    match exponent {
        -3..=3 => super::chart::short(value),
        exponent if exponent > 3 => format!("{value:.0}"),
        _ => ::report::number::significant(value).replace("1.0·", ""),
    }
}
