//! Charts of lines over two axes, as SVG to stand in the page. Each colour here is one of the page's style sheet, which
//! swaps it for its fellow on a dark page.

use std::io;

use plotters::prelude::*;

/// Of the cutter contact, and of what is bounded from above.
pub(super) const WARM: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
/// Of the tool centre; the style sheet dashes it.
pub(super) const VIOLET: RGBColor = RGBColor(0x6f, 0x2d, 0xa8);
/// Of the passes.
pub(super) const BLUE: RGBColor = RGBColor(0x0a, 0x4f, 0x94);
const BAND: RGBColor = RGBColor(0xc9, 0xdc, 0xf0);
const INK: RGBColor = RGBColor(0x1c, 0x27, 0x33);
const AXIS: RGBColor = RGBColor(0x80, 0x8c, 0x99);
const GRID: RGBColor = RGBColor(0xe2, 0xe7, 0xec);

/// Units a pixel: the library draws on whole units only, which would show as steps in a gentle slope.
const FINE: u32 = 8;
/// Pixels.
const SIZE: (u32, u32) = (900, 340);
/// Room left above the highest value, as a share of it.
const HEADROOM: f64 = 0.15;

/// A line of a chart.
pub(super) struct Series {
    pub(super) colour: RGBColor,
    pub(super) points: Vec<[f64; 2]>,
}

/// A chart; its y axis starts at 0.
pub(super) struct Chart<'a> {
    pub(super) x_title: &'a str,
    pub(super) y_title: &'a str,
    pub(super) series: Vec<Series>,
    /// Whether the area between the first two series is shaded.
    pub(super) band: bool,
}

impl Chart<'_> {
    /// The chart as an SVG element; nothing if there is nothing to show.
    ///
    /// # Errors
    /// The chart library's, which writing into memory does not cause.
    pub(super) fn svg(&self) -> io::Result<Option<String>> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let fold =
            |k: usize, start: f64, choose: fn(f64, f64) -> f64| points().map(|p| p[k]).fold(start, choose);
        let x = [fold(0, 0.0, f64::min), fold(0, f64::NEG_INFINITY, f64::max)];
        let top = fold(1, 0.0, f64::max) * (1.0 + HEADROOM);
        if points().count() < 2 || x[0] >= x[1] || top <= 0.0 || !top.is_finite() {
            return Ok(None);
        }
        let mut text = String::new();
        self.draw(&mut text, x, top)
            .map_err(|error| io::Error::other(error.to_string()))?;
        Ok(Some(text))
    }

    fn draw(&self, text: &mut String, x: [f64; 2], top: f64) -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::with_string(text, (SIZE.0 * FINE, SIZE.1 * FINE)).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin_top(8 * FINE)
            .margin_right(24 * FINE)
            .x_label_area_size(50 * FINE)
            .y_label_area_size(82 * FINE)
            .build_cartesian_2d(x[0]..x[1], 0.0..top)?;
        let font = |pixels: u32| ("sans-serif", pixels * FINE).into_font().color(&INK);
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(FINE))
            .axis_style(AXIS.stroke_width(FINE))
            .set_all_tick_mark_size(5 * FINE)
            .x_labels(10)
            .y_labels(6)
            .label_style(font(17))
            .axis_desc_style(font(17))
            .x_label_formatter(&|value| short(*value))
            .y_label_formatter(&|value| short(*value))
            .x_desc(self.x_title)
            .y_desc(self.y_title)
            .draw()?;
        if let (true, [above, below, ..]) = (self.band, self.series.as_slice()) {
            let outline = above
                .points
                .iter()
                .chain(below.points.iter().rev())
                .map(|[x, y]| (*x, *y));
            chart.draw_series([Polygon::new(outline.collect::<Vec<_>>(), BAND.filled())])?;
        }
        for series in &self.series {
            let points = series.points.iter().map(|[x, y]| (*x, *y));
            chart.draw_series(LineSeries::new(points, series.colour.stroke_width(2 * FINE)))?;
        }
        root.present()?;
        Ok(())
    }
}

/// A label of an axis: as many digits as it takes, without the noise of binary fractions.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}
