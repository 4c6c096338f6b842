//! Number formats of the pages.

use job::units::S_PER_MIN;

/// A count in groups of three digits.
pub(super) fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

/// A number with `decimals` decimals, its integer part in groups of three digits.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() || value.abs() >= 1e15 {
        return significant(value);
    }
    let text = format!("{value:.decimals$}");
    let (whole, rest) = text
        .split_once('.')
        .map_or((text.as_str(), ""), |(whole, rest)| (whole, rest));
    let point = if rest.is_empty() { "" } else { "." };
    match whole.parse::<u64>() {
        Ok(count) => format!("{}{point}{rest}", grouped(count)),
        Err(_) => text.clone(),
    }
}

/// A number with five significant digits; as `m·10^e` if it is small or large.
#[must_use]
pub fn significant(value: f64) -> String {
    if !value.is_finite() {
        return "none".to_owned();
    }
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        let digits = if value == 0.0 {
            0.0
        } else {
            value.abs().log10().floor()
        };
        let text = format!("{value:.*}", (4.0 - digits).clamp(0.0, 9.0) as usize);
        // Leading zeros count as decimals.
        return if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        };
    }
    let text = format!("{value:.1e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    format!(
        "{mantissa}·10{}",
        exponent.chars().filter_map(superscript).collect::<String>()
    )
}

fn superscript(c: char) -> Option<char> {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    match c {
        '-' => Some('⁻'),
        _ => c
            .to_digit(10)
            .and_then(|digit| DIGITS.get(digit as usize).copied()),
    }
}

/// A duration in s, min or h.
pub(super) fn duration(seconds: f64) -> String {
    match seconds {
        s if s < S_PER_MIN => format!("{s:.1} s"),
        s if s < 3600.0 => format!("{:.1} min", s / S_PER_MIN),
        s => format!("{:.2} h", s / 3600.0),
    }
}
