//! Numbers of the command line, checked where they are parsed: a NaN would pass every comparison with a limit.

use std::result::Result;

use job_file::HEIGHT_MAX_MM;

/// Largest magnitude of a length, mm: a position is 32 bits of nanometres.
const LENGTH_MAX_MM: f64 = 2147.0;
/// Longest time, s: a day.
const TIME_MAX_S: f64 = 86_400.0;

/// A finite number that is valid; `expected` names it in the error.
fn number(text: &str, expected: &str, is_valid: impl Fn(f64) -> bool) -> Result<f64, String> {
    let number = text.trim().parse().ok();
    number
        .filter(|number: &f64| number.is_finite() && is_valid(*number))
        .ok_or_else(|| format!("expected {expected}"))
}

/// Turns a minute, above 0 and at most those of a job.
pub(super) fn rpm(text: &str) -> Result<f64, String> {
    let expected = "turns a minute above 0 and at most 1e6, such as 12000";
    number(text, expected, |rpm| rpm > 0.0 && rpm <= 1e6)
}

/// A speed of the axes in mm/s: above 0, and within what 32 bits hold.
pub(super) fn speed(text: &str) -> Result<f32, String> {
    let expected = "a speed in mm/s above 0, such as 10";
    #[expect(clippy::cast_possible_truncation, reason = "checked after the conversion")]
    let speed = number(text, expected, |speed| speed > 0.0)? as f32;
    if speed > 0.0 && speed.is_finite() {
        Ok(speed)
    } else {
        Err(format!("expected {expected}"))
    }
}

/// A coordinate in mm, of either sign.
pub(super) fn coordinate(text: &str) -> Result<f64, String> {
    number(
        text,
        &format!("a coordinate in mm, within {LENGTH_MAX_MM} of 0"),
        |mm| mm.abs() <= LENGTH_MAX_MM,
    )
}

/// A thickness or radius in mm that may be 0.
pub(super) fn thickness(text: &str) -> Result<f64, String> {
    number(text, &format!("a length in mm from 0 to {LENGTH_MAX_MM}"), |mm| {
        (0.0..=LENGTH_MAX_MM).contains(&mm)
    })
}

/// A height in mm that may be 0, as those of a job.
pub(super) fn height(text: &str) -> Result<f64, String> {
    number(text, &format!("a height in mm from 0 to {HEIGHT_MAX_MM}"), |mm| {
        (0.0..=HEIGHT_MAX_MM).contains(&mm)
    })
}

/// A length in mm above 0.
pub(super) fn length(text: &str) -> Result<f64, String> {
    number(
        text,
        &format!("a length in mm above 0 and at most {LENGTH_MAX_MM}"),
        |mm| mm > 0.0 && mm <= LENGTH_MAX_MM,
    )
}

/// A time in seconds above 0, a day at most.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    number(
        text,
        &format!("a time in seconds above 0 and at most {TIME_MAX_S}, such as 60"),
        |seconds| seconds > 0.0 && seconds <= TIME_MAX_S,
    )
}

/// A share from 0 to 100 %: `1%` or `0.01`.
pub(super) fn share(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let (digits, unit) = text
        .strip_suffix('%')
        .map_or((text, 1.0), |digits| (digits, 0.01));
    let is_share = |number: f64| (0.0..=1.0).contains(&(number * unit));
    number(digits, "a share from 0 to 100 %, e.g. 1% or 0.01", is_share).map(|number| number * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_option_takes_what_is_no_number() {
        for text in ["nan", "-nan", "inf", "-inf", "infinity", "1e999", "", "x", "1 2"] {
            assert!(speed(text).is_err(), "{text}");
            for parse in [rpm, coordinate, thickness, height, length, seconds, share] {
                assert!(parse(text).is_err(), "{text}");
            }
        }
    }

    #[test]
    fn numbers_are_within_their_bounds() {
        assert_eq!((speed("0.5"), speed("1e3")), (Ok(0.5), Ok(1000.0)));
        // Below and above what 32 bits hold.
        for text in ["0", "-1", "1e-60", "1e39"] {
            assert!(speed(text).is_err(), "{text}");
        }
        assert!(rpm("0").is_err() && rpm("-1").is_err());
        assert_eq!(coordinate("-2147"), Ok(-2147.0));
        assert!(coordinate("2148").is_err());
        assert_eq!(thickness("0"), Ok(0.0));
        assert!(thickness("-0.1").is_err());
        assert_eq!((height("0"), height("1000")), (Ok(0.0), Ok(1000.0)));
        assert!(height("-1").is_err() && height("1000.1").is_err());
        assert_eq!(length("1e-3"), Ok(1e-3));
        assert!(length("0").is_err() && length("-3").is_err() && length("2148").is_err());
        assert_eq!((seconds("0.5"), seconds("86400")), (Ok(0.5), Ok(86_400.0)));
        assert!(seconds("0").is_err() && seconds("1e20").is_err());
    }

    #[test]
    fn shares_are_percents_or_numbers() {
        for (text, exact) in [
            ("1%", 0.01),
            ("0.5 %", 0.005),
            ("0.01", 0.01),
            ("0", 0.0),
            ("100%", 1.0),
        ] {
            assert!((share(text).unwrap() - exact).abs() < 1e-15, "{text}");
        }
        for text in ["%", "-1%", "101%", "1 percent", "2"] {
            assert!(share(text).is_err(), "{text}");
        }
    }
}
