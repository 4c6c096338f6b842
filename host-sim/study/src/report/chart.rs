//! Line charts as inline SVG. Each colour is one of the page's style sheet, which replaces it in dark mode.

use std::io;

use plotters::prelude::*;

use ::report::svg::simplified;

/// Colour of the cutter contact, and of bounds.
pub(super) const WARM: RGBColor = RGBColor(0xd5, 0x5e, 0x00);
/// Colour of the tool centre, dashed by the style sheet.
pub(super) const VIOLET: RGBColor = RGBColor(0x6f, 0x2d, 0xa8);
/// Colour of the curve interpolator, dotted by the style sheet.
pub(super) const GREEN: RGBColor = RGBColor(0x00, 0x7a, 0x5a);
/// Colour of the passes, and of the surface interpolator.
pub(super) const BLUE: RGBColor = RGBColor(0x0a, 0x4f, 0x94);
/// Tolerance of the simplification of lines, pixels.
const TOLERANCE: f64 = 0.1;
const BAND: RGBColor = RGBColor(0xc9, 0xdc, 0xf0);
pub(super) const INK: RGBColor = RGBColor(0x1c, 0x27, 0x33);
pub(super) const AXIS: RGBColor = RGBColor(0x80, 0x8c, 0x99);
pub(super) const GRID: RGBColor = RGBColor(0xe2, 0xe7, 0xec);

/// Drawing units of a pixel: the library rounds to whole units, which would show as steps in a gentle slope.
pub(super) const FINE: u32 = 8;
/// Default size of a chart, pixels.
pub(super) const SIZE: (u32, u32) = (900, 340);
/// Margin above the greatest value, as a share of it.
const HEADROOM: f64 = 0.15;

/// A line of a chart.
pub(super) struct Series {
    pub(super) colour: RGBColor,
    pub(super) points: Vec<[f64; 2]>,
}

/// A chart; its axes start at 0 unless a range is given.
#[derive(Default)]
pub(super) struct Chart<'a> {
    pub(super) x_title: &'a str,
    pub(super) y_title: &'a str,
    pub(super) series: Vec<Series>,
    /// Whether the area between the first two series is shaded.
    pub(super) band: bool,
    /// Marked points with their colours.
    pub(super) marks: Vec<(RGBColor, [f64; 2])>,
    /// Ranges of x and y instead of those of the series.
    pub(super) ranges: [Option<[f64; 2]>; 2],
    /// Height, pixels, instead of the default.
    pub(super) height: Option<u32>,
}

impl Chart<'_> {
    /// The chart as an SVG element; `None` without points.
    ///
    /// # Errors
    /// Those of the chart library, which writing into memory does not cause.
    pub(super) fn svg(&self) -> io::Result<Option<String>> {
        let points = || self.series.iter().flat_map(|series| &series.points);
        let fold =
            |k: usize, start: f64, choose: fn(f64, f64) -> f64| points().map(|p| p[k]).fold(start, choose);
        let x = [fold(0, 0.0, f64::min), fold(0, f64::NEG_INFINITY, f64::max)];
        let y = [0.0, fold(1, 0.0, f64::max) * (1.0 + HEADROOM)];
        let [x, y] = [self.ranges[0].unwrap_or(x), self.ranges[1].unwrap_or(y)];
        if points().count() < 2 || x[0] >= x[1] || y[0] >= y[1] || !y[1].is_finite() {
            return Ok(None);
        }
        let mut text = String::new();
        self.draw(&mut text, x, y)
            .map_err(|error| io::Error::other(error.to_string()))?;
        Ok(Some(text))
    }

    fn draw(&self, text: &mut String, x: [f64; 2], y: [f64; 2]) -> Result<(), Box<dyn std::error::Error>> {
        let height = self.height.unwrap_or(SIZE.1);
        let root = SVGBackend::with_string(text, (SIZE.0 * FINE, height * FINE)).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin_top(8 * FINE)
            .margin_right(24 * FINE)
            .x_label_area_size(50 * FINE)
            .y_label_area_size(82 * FINE)
            .build_cartesian_2d(x[0]..x[1], y[0]..y[1])?;
        let font = |pixels: u32| ("sans-serif", pixels * FINE).into_font().color(&INK);
        chart
            .configure_mesh()
            .disable_x_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID.stroke_width(FINE))
            .axis_style(AXIS.stroke_width(FINE))
            .set_all_tick_mark_size(5 * FINE)
            .x_labels(10)
            .y_labels(8)
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
            let scale = [
                f64::from(SIZE.0) / (x[1] - x[0]),
                f64::from(height) / (y[1] - y[0]),
            ];
            let pixels: Vec<_> = series
                .points
                .iter()
                .map(|point| [point[0] * scale[0], point[1] * scale[1]])
                .collect();
            let points = simplified(&pixels, TOLERANCE)
                .into_iter()
                .map(|[x, y]| (x / scale[0], y / scale[1]));
            chart.draw_series(LineSeries::new(points, series.colour.stroke_width(2 * FINE)))?;
        }
        let marks = self
            .marks
            .iter()
            .map(|(colour, [x, y])| Circle::new((*x, *y), 5 * FINE, colour.filled()));
        chart.draw_series(marks)?;
        root.present()?;
        Ok(())
    }
}

/// Label of an axis: shortest decimal at seven significant digits.
pub(super) fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.6e}").parse().unwrap_or(value);
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}
