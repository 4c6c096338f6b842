//! Step output of the axes: decimal numbers as written, converted to fractions without rounding.

use interp_core::StepConfig;
use interp_core::steps::{AxisSteps, PULSE_SLOTS_MAX, SETUP_SLOTS_MAX, SLOTS};
use job::{JobError, PERIOD_RANGE_US, Ratio, StepOutput};
use toml::de::DeValue;

use crate::section::{Section, Value};

/// Remedy of an error in the steps of an axis.
const WANT: &str =
    "give three numbers from 1/1000 to 500000, or fractions in quotes, such as [400, 78.74, \"3200/5\"]";

/// The keys of `[machine]` that this module reads.
pub(super) const KEYS: [&str; 4] = [
    "steps_per_mm",
    "pulse_us",
    "direction_setup_us",
    "direction_inverted",
];

/// A number in decimal notation as a fraction in lowest terms; `None` if it does not fit.
fn decimal(text: &str) -> Option<(u32, u32)> {
    let text = text.replace('_', "");
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text.as_str(), 0),
    };
    let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let part = part.trim_end_matches('0');
    let digits = format!("{}{part}", whole.trim_start_matches('+'));
    let mut numerator: u64 = digits.parse().ok()?;
    let mut exponent = exponent.checked_sub(i32::try_from(part.len()).ok()?)?;
    while exponent < 0 && numerator != 0 && numerator.is_multiple_of(10) {
        numerator /= 10;
        exponent += 1;
    }
    let scale = |by: i32| 10_u64.checked_pow(u32::try_from(by).ok()?);
    let (numerator, denominator) = if exponent < 0 {
        (numerator, scale(exponent.checked_neg()?)?)
    } else {
        (numerator.checked_mul(scale(exponent)?)?, 1)
    };
    Some((u32::try_from(numerator).ok()?, u32::try_from(denominator).ok()?))
}

/// `"3200/5"`, or a number in quotes.
fn fraction(text: &str) -> Option<(u32, u32)> {
    match text.split_once('/') {
        Some((steps, mm)) => Some((steps.trim().parse().ok()?, mm.trim().parse().ok()?)),
        None => decimal(text.trim()),
    }
}

/// Default length of a pulse, µs; limited to the longest that the period allows.
const PULSE_DEFAULT_US: f64 = 1.0;
/// Default direction setup time, µs; limited to the longest that the period allows.
const SETUP_DEFAULT_US: f64 = 5.0;

/// Longest pulse and longest direction setup time at a sampling period, µs.
#[must_use]
pub fn slots_max_us(period_us: f64) -> [f64; 2] {
    [u16::from(PULSE_SLOTS_MAX), SETUP_SLOTS_MAX].map(|most| f64::from(most) / f64::from(SLOTS) * period_us)
}

/// Steps per millimetre of one axis.
fn axis(value: &Value<'_, '_>) -> Result<Ratio, JobError> {
    let (numerator, denominator) = match value.get() {
        DeValue::Float(float) => decimal(float.as_str()),
        DeValue::Integer(integer) => u32::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .map(|steps| (steps, 1)),
        DeValue::String(text) => fraction(text),
        // The message names the value found.
        _ => value.number().map(|_| None)?,
    }
    .ok_or_else(|| {
        value.error(
            "is neither a number of steps nor a fraction with both parts below 2^32",
            WANT,
        )
    })?;
    let steps = AxisSteps {
        steps: numerator,
        mm: denominator,
        inverted: false,
    };
    let config = StepConfig {
        axes: [steps; 3],
        ..StepConfig::DEFAULT
    };
    if config.check().is_err() {
        let what = format!("must be from 1/1000 to 500000, not {numerator}/{denominator}");
        return Err(value.error(&what, WANT));
    }
    Ok(Ratio {
        numerator,
        denominator,
    })
}

/// A time of at most `most_us`, µs; `default_us` where the key is missing.
fn time(machine: &Section<'_>, key: &str, default_us: f64, most_us: f64) -> Result<f64, JobError> {
    if !machine.has(key) {
        return Ok(default_us.min(most_us));
    }
    let value = machine.number(key)?;
    // Allows for the rounding of the period.
    if (0.0..=most_us * (1.0 + 1e-12)).contains(&value) {
        return Ok(value);
    }
    let what = format!("`{key}` must be 0 to {most_us} (at this period), not {value}");
    Err(machine.error(
        key,
        what,
        "give the time required by the drive's manual, in microseconds",
    ))
}

/// Length of a pulse, us: above 0, because a drive does not see a pulse of no length.
fn pulse_time(machine: &Section<'_>, key: &str, most_us: f64) -> Result<f64, JobError> {
    let value = time(machine, key, PULSE_DEFAULT_US, most_us)?;
    if value > 0.0 {
        return Ok(value);
    }
    Err(machine.error(
        key,
        format!("`{key}` must be above 0, at most {most_us} (at this period)"),
        "give the least length of a pulse in the drive's manual, in microseconds, e.g. 2.5",
    ))
}

/// Requirements of the drives; `None` where the job gives none.
pub(super) fn read(machine: &Section<'_>, period_us: f64) -> Result<Option<StepOutput>, JobError> {
    debug_assert!(period_us >= PERIOD_RANGE_US[0]);
    let [steps, pulse, setup, inverted] = KEYS;
    if !machine.has(steps) {
        let alone = [pulse, setup, inverted].into_iter().find(|key| machine.has(key));
        return alone.map_or(Ok(None), |key| {
            let what = format!("`{key}` has no effect without `{steps}`");
            Err(machine.error(key, what, WANT))
        });
    }
    let value = machine.value(steps)?;
    let mut steps_per_mm = [Ratio {
        numerator: 1,
        denominator: 1,
    }; 3];
    for (target, entry) in steps_per_mm.iter_mut().zip(value.list_of(3, "number")?) {
        *target = axis(&entry)?;
    }
    let [pulse_max_us, setup_max_us] = slots_max_us(period_us);
    Ok(Some(StepOutput {
        steps_per_mm,
        direction_inverted: read_inverted(machine, inverted)?,
        pulse_us: pulse_time(machine, pulse, pulse_max_us)?,
        direction_setup_us: time(machine, setup, SETUP_DEFAULT_US, setup_max_us)?,
    }))
}

/// One Boolean per axis; all false where the key is missing.
pub(super) fn read_inverted(machine: &Section<'_>, key: &str) -> Result<[bool; 3], JobError> {
    let mut inverted = [false; 3];
    if machine.has(key) {
        let flags = machine.value(key)?.list_of(3, "switch")?;
        for (target, flag) in inverted.iter_mut().zip(flags) {
            let DeValue::Boolean(value) = flag.get() else {
                return Err(flag.error("must be true or false", "give one for each of x, y and z"));
            };
            *target = *value;
        }
    }
    Ok(inverted)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TORUS: &str = include_str!("../../../jobs/torus.toml");

    fn read_from(machine: &str) -> Result<Option<StepOutput>, String> {
        let text = format!(
            "{}\n[machine]\n{machine}\n",
            TORUS.split("[machine]").next().unwrap()
        );
        crate::parse("job.toml", &text)
            .map(|job| job.machine.step_output)
            .map_err(|error| error.what().to_owned())
    }

    #[test]
    fn fractions_are_exact() {
        let ratios = |machine: &str| {
            let config = read_from(machine).unwrap().unwrap();
            config
                .steps_per_mm
                .map(|ratio| (ratio.numerator, ratio.denominator))
        };
        assert_eq!(
            ratios(r#"steps_per_mm = [400, 78.7402, "3200/5"]"#),
            [(400, 1), (787_402, 10_000), (3200, 5)]
        );
        assert_eq!(
            ratios(r#"steps_per_mm = [1_600.50, "80.25", 4e2]"#),
            [(16_005, 10), (8025, 100), (400, 1)]
        );
    }

    #[test]
    fn times_default_and_are_bounded_by_the_period() {
        let steps = "steps_per_mm = [400, 400, 400]";
        let config = |more: &str| read_from(&format!("{steps}\n{more}")).map(Option::unwrap);
        let given = config("").unwrap();
        assert_eq!((given.pulse_us, given.direction_setup_us), (1.0, 5.0));
        let given =
            config("pulse_us = 2.5\ndirection_setup_us = 5\ndirection_inverted = [false, true, false]");
        let given = given.unwrap();
        assert_eq!((given.pulse_us, given.direction_setup_us), (2.5, 5.0));
        assert_eq!(given.direction_inverted, [false, true, false]);
        let given = config("period_us = 500\npulse_us = 2.5\ndirection_setup_us = 0").unwrap();
        assert_eq!((given.pulse_us, given.direction_setup_us), (2.5, 0.0));
        // At the shortest period the defaults are limited to the period's shares.
        let given = config("period_us = 10").unwrap();
        assert!(
            given.pulse_us == 0.24 && given.direction_setup_us == 4.8,
            "{given:?}"
        );
        for wrong in ["25", "0", "0.0", "-0.0", "-1", "nan"] {
            let said = config(&format!("pulse_us = {wrong}")).unwrap_err();
            assert!(said.contains("`pulse_us`"), "{wrong}: {said}");
        }
        assert!(read_from("pulse_us = 2").unwrap_err().contains("steps_per_mm"));
    }

    #[test]
    fn invalid_steps_are_refused() {
        for (steps, what) in [
            ("[400, 400]", "3 numbers"),
            ("[400, 0, 400]", "1/1000"),
            ("[400, 500001, 400]", "1/1000"),
            (r#"[400, "1/1001", 400]"#, "1/1000"),
            ("[400, -4.5, 400]", "a number of steps"),
            (r#"[400, "5/0", 400]"#, "1/1000"),
            (r#"[400, "a/5", 400]"#, "a number of steps"),
            ("[400, true, 400]", "must be a number"),
            ("[400, 0.12345678912345, 400]", "a number of steps"),
        ] {
            let said = read_from(&format!("steps_per_mm = {steps}")).unwrap_err();
            assert!(said.contains(what), "{steps}: {said}");
        }
    }
}
