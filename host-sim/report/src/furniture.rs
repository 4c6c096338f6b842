//! The annotations of the picture: background, texts, ball, axis triad, scale bar, legend.

use std::fmt::Write;

use super::scene::Ball;
use super::svg::{escape, tenths};
use super::texts::PictureTexts;
use super::view::View;
use glam::{DVec2, DVec3};

const STYLE: &str = include_str!("picture.css");
/// Largest length of the scale bar, pixels.
const BAR_MAX: f64 = 150.0;
/// Length of the triad's arms, pixels.
const ARM: f64 = 34.0;
/// Distance from a point to the middle of its label, pixels.
const NAME_AWAY: f64 = 15.0;

/// The document's head, the card, the title.
pub(super) fn open(out: &mut String, [width, height]: [f64; 2], words: &PictureTexts) {
    let (w, h) = (tenths(width), tenths(height));
    let _ = writeln!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" \
         role=\"img\" aria-labelledby=\"iso-title iso-desc\">"
    );
    let _ = writeln!(out, "<title id=\"iso-title\">{}</title>", escape(&words.title));
    let _ = writeln!(out, "<desc id=\"iso-desc\">{}</desc>", escape(&words.description));
    let _ = writeln!(out, "<style>\n{STYLE}</style>");
    out.push_str(
        "<defs><radialGradient id=\"iso-ball\" cx=\".38\" cy=\".32\" r=\".72\">\
         <stop offset=\"0\" stop-color=\"#fff\" stop-opacity=\".82\"/>\
         <stop offset=\".55\" stop-color=\"#e9c46a\" stop-opacity=\".58\"/>\
         <stop offset=\"1\" stop-color=\"#8a6410\" stop-opacity=\".72\"/></radialGradient></defs>\n",
    );
    let (w, h) = (tenths(width - 1.0), tenths(height - 1.0));
    let _ = writeln!(
        out,
        "<rect class=\"iso-card\" x=\".5\" y=\".5\" width=\"{w}\" height=\"{h}\" rx=\"10\"/>"
    );
    text(
        out,
        "iso-ink",
        [28.0, 40.0],
        21.0,
        "font-weight=\"600\"",
        &words.title,
    );
    text(out, "iso-soft", [28.0, 64.0], 15.0, "", &words.subtitle);
}

pub(super) fn text(out: &mut String, class: &str, [x, y]: [f64; 2], size: f64, more: &str, words: &str) {
    let (x, y, size, words) = (tenths(x), tenths(y), tenths(size), escape(words));
    let _ = writeln!(
        out,
        "<text class=\"iso-text {class}\" x=\"{x}\" y=\"{y}\" font-size=\"{size}\" {more}>{words}</text>"
    );
}

fn line(out: &mut String, class: &str, from: [f64; 2], to: [f64; 2]) {
    let [x1, y1, x2, y2] = [from[0], from[1], to[0], to[1]].map(tenths);
    let _ = writeln!(
        out,
        "<path class=\"iso-line {class}\" d=\"M{x1} {y1} {x2} {y2}\"/>"
    );
}

fn dot(out: &mut String, class: &str, [x, y]: [f64; 2], radius: f64) {
    let [x, y, r] = [x, y, radius].map(tenths);
    let _ = writeln!(
        out,
        "<circle class=\"{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{r}\" stroke=\"#fff\" stroke-width=\"1\"/>"
    );
}

/// The ball, to scale, semi-transparent.
pub(super) fn ball(out: &mut String, ball: &Ball) {
    let [x, y, r] = [ball.cl.x, ball.cl.y, ball.radius].map(tenths);
    let _ = writeln!(
        out,
        "<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" fill=\"url(#iso-ball)\" stroke=\"#6b4e0c\" stroke-width=\"1.2\"/>"
    );
}

/// Contact and centre of the ball with their labels.
pub(super) fn contact(out: &mut String, ball: &Ball) {
    let [cc, cl] = [ball.cc, ball.cl].map(|at| at.truncate().to_array());
    line(out, "iso-radius", cl, cc);
    dot(out, "iso-one-fill", cc, 4.0);
    dot(out, "iso-cl-fill", cl, 4.0);
    // Each label is outside of its end of the radius, so that the two do not overlap.
    let apart = [cc[0] - cl[0], cc[1] - cl[1]];
    let length = apart[0].hypot(apart[1]);
    let [right, down] = if length > 1.0 {
        apart.map(|x| x / length)
    } else {
        [0.6, 0.8]
    };
    let beyond = |[x, y]: [f64; 2], by: f64| [x + 1.3 * by * right, y + by * down + 5.0];
    let bold = "font-weight=\"600\" text-anchor=\"middle\"";
    text(
        out,
        "iso-cl-fill iso-halo",
        beyond(cl, -NAME_AWAY),
        15.0,
        bold,
        "CL",
    );
    text(
        out,
        "iso-one-fill iso-halo",
        beyond(cc, NAME_AWAY),
        15.0,
        bold,
        "CC",
    );
}

/// The directions of the axes.
pub(super) fn triad(out: &mut String, view: &View, [x, y]: [f64; 2]) {
    for (name, direction) in ["x", "y", "z"].into_iter().zip(DVec3::AXES) {
        let DVec2 { x: right, y: up } = view.turn(direction).truncate();
        let tip = [x + ARM * right, y - ARM * up];
        let length = right.hypot(up);
        if length < 0.1 {
            continue;
        }
        line(out, "iso-rule", [x, y], tip);
        let beyond = 11.0 / length;
        let place = [tip[0] + beyond * right, tip[1] - beyond * up + 5.0];
        text(
            out,
            "iso-ink",
            place,
            14.0,
            "text-anchor=\"middle\" font-style=\"italic\"",
            name,
        );
    }
    let (x, y) = (tenths(x), tenths(y));
    let _ = writeln!(out, "<circle class=\"iso-ink\" cx=\"{x}\" cy=\"{y}\" r=\"2\"/>");
}

/// The scale bar, a round number of millimetres; `right` is its right end.
pub(super) fn scale_bar(out: &mut String, scale: f64, right: [f64; 2]) {
    let length_mm = round_below(BAR_MAX / scale);
    let [x, y] = right;
    let left = x - length_mm * scale;
    line(out, "iso-rule", [left, y], [x, y]);
    for end in [left, x] {
        line(out, "iso-rule", [end, y - 5.0], [end, y + 5.0]);
    }
    let words = format!("{length_mm} mm");
    text(
        out,
        "iso-ink",
        [0.5 * (left + x), y - 10.0],
        14.0,
        "text-anchor=\"middle\"",
        &words,
    );
}

/// The largest of 1, 2, 5 times a power of ten that is not above a value.
pub(super) fn round_below(value: f64) -> f64 {
    let power = value.max(1e-9).log10().floor() as i32;
    // Formatted and parsed, so that 0.2 is the f64 nearest to 0.2.
    let decade = |factor: i32| format!("{factor}e{power}").parse::<f64>().unwrap_or(1.0);
    [5, 2]
        .into_iter()
        .map(decade)
        .find(|round| *round <= value)
        .unwrap_or_else(|| decade(1))
}

/// The legend.
pub(super) fn key(out: &mut String, words: &PictureTexts, has_tool: bool, [x, y]: [f64; 2]) {
    let mut entries = vec![
        ("iso-pass iso-key-pass", words.passes.as_str()),
        ("iso-one iso-key-one", "highlighted pass"),
    ];
    if has_tool {
        entries.push(("iso-cl iso-key-cl", "cutter location (CL) of that pass"));
        entries.push(("", &words.ball));
    }
    for (index, (class, what)) in entries.iter().enumerate() {
        let (column, row) = ((index / 2) as f64, (index % 2) as f64);
        let [x, y] = [x + 330.0 * column, y + 24.0 * row];
        if class.is_empty() {
            let (x, y) = (tenths(x + 15.0), tenths(y));
            let _ = writeln!(
                out,
                "<circle cx=\"{x}\" cy=\"{y}\" r=\"8\" fill=\"url(#iso-ball)\" stroke=\"#6b4e0c\" stroke-width=\"1.2\"/>"
            );
        } else {
            line(out, class, [x, y], [x + 30.0, y]);
        }
        text(out, "iso-soft", [x + 40.0, y + 5.0], 15.0, "", what);
    }
}
