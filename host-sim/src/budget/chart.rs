//! The histogram of the whole tick, a line a surface, as SVG.

use std::io;
use std::path::Path;

use plotters::prelude::*;

use super::figures::Histogram;

/// Pixels.
const SIZE: (u32, u32) = (1000, 560);

/// Least share of the ticks that is drawn: one in a million.
const SHARE_MIN: f64 = 1e-6;

/// Writes the chart: the share of ticks that took at least so many cycles, which shows the rare long ones.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, histograms: &[(String, Histogram)]) -> io::Result<()> {
    let mut text = String::new();
    draw(&mut text, histograms).map_err(|error| io::Error::other(error.to_string()))?;
    std::fs::write(path, text)
}

/// Points of a line: cycles, and the share of ticks that took at least those.
fn at_least(histogram: &Histogram) -> Vec<(f64, f64)> {
    let total: u32 = histogram.bins.iter().map(|bin| bin.1).sum();
    let mut left = total;
    let mut points = Vec::new();
    for (begin, count) in &histogram.bins {
        let share = f64::from(left) / f64::from(total.max(1));
        points.push((f64::from(*begin), share));
        left -= count;
        points.push((
            f64::from(begin + histogram.width),
            (f64::from(left) / f64::from(total.max(1))).max(SHARE_MIN),
        ));
    }
    points
}

fn draw(text: &mut String, histograms: &[(String, Histogram)]) -> Result<(), Box<dyn std::error::Error>> {
    let most = histograms
        .iter()
        .filter_map(|(_, histogram)| histogram.bins.last())
        .map(|bin| bin.0)
        .max()
        .unwrap_or(1);
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(48)
        .y_label_area_size(80)
        .build_cartesian_2d(0.0..f64::from(most) * 1.1, (SHARE_MIN * 10.0..1.0).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("cycles of the sample task, pessimistic model")
        .y_desc("share of ticks that take at least these")
        .draw()?;
    for (index, (name, histogram)) in histograms.iter().enumerate() {
        let colour = Palette99::pick(index).to_rgba();
        chart
            .draw_series(LineSeries::new(at_least(histogram), colour.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(2)));
    }
    chart
        .configure_series_labels()
        .background_style(WHITE)
        .border_style(BLACK)
        .draw()?;
    root.present()?;
    Ok(())
}
