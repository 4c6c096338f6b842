//! Elements of SVG text.

use std::fmt::Write;

/// A number with at most one decimal: 0.1 pixel is below the resolution of a screen.
pub(super) fn tenths(value: f64) -> String {
    let mut text = String::new();
    push_tenths(&mut text, round_tenths(value), true);
    text
}

/// Escapes text for use between tags and in attributes.
#[must_use]
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // XML forbids control characters even when escaped.
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// Path data of a polyline: one absolute point, then relative steps in tenths; rounding does not accumulate.
pub(super) fn polyline(points: &[[f64; 2]]) -> String {
    let mut data = String::new();
    let mut at = [0_i64; 2];
    for (index, point) in points.iter().enumerate() {
        let to = point.map(round_tenths);
        match index {
            0 => data.push('M'),
            1 => data.push('l'),
            _ => {}
        }
        push_tenths(&mut data, to[0] - at[0], index < 2);
        push_tenths(&mut data, to[1] - at[1], false);
        at = to;
    }
    data
}

/// Simplifies a polyline; the result is within `tolerance` of the given one (Douglas and Peucker).
#[must_use]
pub fn simplified(points: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    if points.len() < 3 {
        return points.to_vec();
    }
    let mut keep = vec![false; points.len()];
    keep[0] = true;
    keep[points.len() - 1] = true;
    // Each iteration removes a span or splits it, so there are fewer iterations than twice the number of points.
    let mut spans = vec![(0, points.len() - 1)];
    while let Some((first, last)) = spans.pop() {
        let (index, distance) = (first + 1..last)
            .map(|k| (k, distance_to_segment(points[k], points[first], points[last])))
            .fold(
                (first, 0.0),
                |most, next| if next.1 > most.1 { next } else { most },
            );
        if distance > tolerance {
            keep[index] = true;
            spans.extend([(first, index), (index, last)]);
        }
    }
    points
        .iter()
        .zip(keep)
        .filter_map(|(point, keep)| keep.then_some(*point))
        .collect()
}

fn distance_to_segment(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let away = [point[0] - from[0], point[1] - from[1]];
    let squared = along[0] * along[0] + along[1] * along[1];
    let share = if squared > 0.0 {
        ((away[0] * along[0] + away[1] * along[1]) / squared).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (away[0] - share * along[0]).hypot(away[1] - share * along[1])
}

fn round_tenths(value: f64) -> i64 {
    (value * 10.0).round() as i64
}

/// Appends a number of tenths; `first`: no separator needed.
fn push_tenths(text: &mut String, tenths: i64, first: bool) {
    if tenths < 0 {
        text.push('-');
    } else if !first {
        text.push(' ');
    }
    let (whole, rest) = (tenths.unsigned_abs() / 10, tenths.unsigned_abs() % 10);
    // Writing to a `String` cannot fail.
    let _ = match (whole, rest) {
        (_, 0) => write!(text, "{whole}"),
        (0, _) => write!(text, ".{rest}"),
        _ => write!(text, "{whole}.{rest}"),
    };
}
