//! Chart of a budget as SVG: mean cycles of each stage, the worst-case tick, and the distribution of the ticks.

use std::io;
use std::path::Path;

use cycle_plugin::plan::{STAGES, Stage};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::PERIOD_CYCLES;
use super::figures::{Histogram, Model, histogram, tick_cycles};
use super::measure::Ticks;

/// Size of the chart, pixels.
const SIZE: (u32, u32) = (1100, 900);
/// Height of the part with the bars, pixels.
const BARS_HEIGHT: u32 = 420;

/// Least share of the ticks on the axis.
const SHARE_MIN: f64 = 1e-5;

/// Cycles of a bin.
const BIN_CYCLES: u32 = 50;

/// A colour for each stage, distinguishable by the colour-blind (Okabe and Ito 2008).
const COLOURS: [RGBColor; STAGES] = [
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xf0, 0xe4, 0x42),
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0xb8, 0xb8, 0xb8),
    RGBColor(0x40, 0x40, 0x40),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0x8c, 0x6d, 0x31),
    RGBColor(0xe8, 0xe8, 0xe8),
];

/// A colour for each job of the table.
const LINES: [RGBColor; 10] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0xf0, 0xe4, 0x42),
    RGBColor(0x40, 0x40, 0x40),
    RGBColor(0x8c, 0x6d, 0x31),
    RGBColor(0xb8, 0xb8, 0xb8),
];

const FONT: &str = "sans-serif";

type DrawResult = Result<(), Box<dyn std::error::Error>>;

/// A surface's bar and line.
struct Bar {
    name: String,
    /// Mean cycles of each stage over all ticks.
    means: [f64; STAGES],
    worst: u32,
    histogram: Histogram,
}

impl Bar {
    fn new(name: &str, ticks: &Ticks) -> Self {
        let mut means = [0.0; STAGES];
        for record in &ticks.records {
            for (mean, cycles) in means.iter_mut().zip(record.stages) {
                *mean += f64::from(cycles.pessimistic);
            }
        }
        #[allow(clippy::cast_precision_loss, reason = "far below 2^53")]
        let count = ticks.records.len().max(1) as f64;
        let cycles = ticks
            .records
            .iter()
            .map(|record| tick_cycles(record, Model::Pessimistic));
        Self {
            name: name.to_owned(),
            means: means.map(|sum| sum / count),
            worst: cycles.max().unwrap_or(0),
            histogram: histogram(ticks, Model::Pessimistic, BIN_CYCLES),
        }
    }
}

/// Writes the chart of these jobs.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, jobs: &[(String, Ticks)]) -> io::Result<()> {
    let bars: Vec<Bar> = jobs.iter().map(|(name, ticks)| Bar::new(name, ticks)).collect();
    let mut text = String::new();
    draw(&mut text, &bars).map_err(|error| io::Error::other(error.to_string()))?;
    std::fs::write(path, text)
}

fn draw(text: &mut String, bars: &[Bar]) -> DrawResult {
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let most = bars.iter().map(|bar| bar.worst).max().unwrap_or(1);
    let most = f64::from(most) * 1.12;
    let (upper, lower) = root.split_vertically(BARS_HEIGHT);
    draw_bars(&upper, bars, most)?;
    draw_lines(&lower, bars, most)?;
    root.present()?;
    Ok(())
}

/// Share of the period, %.
fn share_pct(cycles: f64) -> f64 {
    100.0 * cycles / f64::from(PERIOD_CYCLES)
}

#[allow(clippy::cast_precision_loss, reason = "a handful")]
fn draw_bars(area: &DrawingArea<SVGBackend, Shift>, bars: &[Bar], most: f64) -> DrawResult {
    let mut chart = ChartBuilder::on(area)
        .caption(
            "Cycles of a tick on the Cortex-M4F, pessimistic model: mean by stage, and the worst-case tick",
            (FONT, 18),
        )
        .margin(12)
        .margin_right(24)
        .x_label_area_size(46)
        .y_label_area_size(160)
        .build_cartesian_2d(0.0..most, 0.0..bars.len() as f64 + 1.1)?;
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .light_line_style(TRANSPARENT)
        .x_labels(8)
        .x_label_formatter(&|cycles| format!("{cycles:.0} ({:.1} %)", share_pct(*cycles)))
        .x_desc("cycles (share of the 168 000 of a period)")
        .label_style((FONT, 14))
        .axis_desc_style((FONT, 14))
        .draw()?;
    let right = (FONT, 15)
        .into_font()
        .color(&BLACK)
        .pos(Pos::new(HPos::Right, VPos::Center));
    let left = (FONT, 14)
        .into_font()
        .color(&BLACK)
        .pos(Pos::new(HPos::Left, VPos::Center));
    let top = bars.len() as f64;
    for (index, bar) in bars.iter().enumerate() {
        let middle = top - index as f64 - 0.5;
        let mut from = 0.0;
        for (mean, colour) in bar.means.iter().zip(COLOURS) {
            let corners = [(from, middle - 0.3), (from + mean, middle + 0.3)];
            chart.draw_series([Rectangle::new(corners, colour.filled())])?;
            from += mean;
        }
        let worst = f64::from(bar.worst);
        chart.draw_series([
            PathElement::new([(from, middle), (worst, middle)], BLACK.stroke_width(1)),
            PathElement::new(
                [(worst, middle - 0.3), (worst, middle + 0.3)],
                BLACK.stroke_width(3),
            ),
        ])?;
        chart.draw_series([Text::new(
            format!("{}", bar.worst),
            (worst + 0.008 * most, middle),
            left.clone(),
        )])?;
        chart.draw_series([Text::new(
            format!("{from:.0}"),
            (from + 0.006 * most, middle + 0.2),
            left.clone(),
        )])?;
        let name = EmptyElement::at((0.0, middle)) + Text::new(bar.name.clone(), (-10, 0), right.clone());
        chart.plotting_area().draw(&name)?;
    }
    let legend = Stage::ALL.into_iter().zip(COLOURS);
    let labels = legend.map(|(stage, colour)| (label(stage), ShapeStyle::from(colour).filled()));
    let labels = labels.chain([("worst-case tick", BLACK.stroke_width(3))]);
    let mut at = 0.0;
    for (label, style) in labels {
        let width = if style.filled { 0.012 } else { 0.003 } * most;
        let corners = [(at, top + 0.5), (at + width, top + 0.8)];
        chart.draw_series([Rectangle::new(corners, style.color.filled())])?;
        chart.draw_series([Text::new(label, (at + 0.016 * most, top + 0.65), left.clone())])?;
        at += (0.034 + 0.0088 * label.len() as f64) * most;
    }
    Ok(())
}

/// Short name of a stage for the legend.
const fn label(stage: Stage) -> &'static str {
    match stage {
        Stage::Step => "step",
        Stage::Surface => "surface",
        Stage::Exception => "entry and exit",
        other => other.name(),
    }
}

/// Points of a line: cycles, and the share of ticks that take at least those.
fn at_least(histogram: &Histogram) -> Vec<(f64, f64)> {
    let total: u32 = histogram.bins.iter().map(|bin| bin.1).sum();
    let share = |count: u32| (f64::from(count) / f64::from(total.max(1))).max(SHARE_MIN);
    let mut left = total;
    let mut points = vec![(0.0, 1.0)];
    for (begin, count) in &histogram.bins {
        points.push((f64::from(*begin), share(left)));
        left -= count;
        points.push((f64::from(begin + histogram.width), share(left)));
    }
    points
}

fn draw_lines(area: &DrawingArea<SVGBackend, Shift>, bars: &[Bar], most: f64) -> DrawResult {
    let mut chart = ChartBuilder::on(area)
        .caption(
            "Distribution: share of the ticks that take at least a number of cycles",
            (FONT, 18),
        )
        .margin(12)
        .margin_right(24)
        .x_label_area_size(46)
        .y_label_area_size(160)
        .build_cartesian_2d(0.0..most, (SHARE_MIN..1.0).log_scale())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .x_labels(8)
        .x_label_formatter(&|cycles| format!("{cycles:.0} ({:.1} %)", share_pct(*cycles)))
        .y_label_formatter(&|share| format!("{} %", 100.0 * share))
        .x_desc("cycles (share of the 168 000 of a period)")
        .y_desc("share of the ticks")
        .label_style((FONT, 14))
        .axis_desc_style((FONT, 14))
        .draw()?;
    for (index, bar) in bars.iter().enumerate() {
        let colour = LINES[index % LINES.len()];
        chart
            .draw_series(LineSeries::new(at_least(&bar.histogram), colour.stroke_width(2)))?
            .label(bar.name.clone())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(3)));
    }
    chart
        .configure_series_labels()
        .label_font((FONT, 14))
        .background_style(WHITE)
        .border_style(RGBColor(0xb8, 0xb8, 0xb8))
        .draw()?;
    Ok(())
}
