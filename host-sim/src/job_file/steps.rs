//! Steps of the axes: numbers as they are written, made fractions without a rounding.

use interp_core::steps::{AxisSteps, PULSE_SLOTS_MAX, SETUP_SLOTS_MAX, SLOTS, StepConfig};
use toml::de::DeValue;

use super::section::{Section, Value};
use super::{JobFileError, PERIOD_RANGE_US};

/// What is wanted of the steps of an axis.
const WANT: &str =
    "give three numbers from 1/1000 to 500000, or fractions in quotes, such as [400, 78.74, \"3200/5\"]";

/// The keys of `[machine]` that are read here.
pub(super) const KEYS: [&str; 4] = [
    "steps_per_mm",
    "pulse_us",
    "direction_setup_us",
    "direction_inverted",
];

/// A number in decimal notation as a fraction in lowest terms of tens; none where it does not fit.
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

fn axis(value: &Value<'_, '_>) -> Result<AxisSteps, JobFileError> {
    let (steps, mm) = match value.get() {
        DeValue::Float(float) => decimal(float.as_str()),
        DeValue::Integer(integer) => u32::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .map(|steps| (steps, 1)),
        DeValue::String(text) => fraction(text),
        // Says what is there instead.
        _ => value.number().map(|_| None)?,
    }
    .ok_or_else(|| {
        value.error(
            "is no number of steps, nor a fraction whose two parts are below 2^32",
            WANT,
        )
    })?;
    Ok(AxisSteps {
        steps,
        mm,
        inverted: false,
    })
}

/// A time as slots, rounded up.
fn slots(machine: &Section<'_>, key: &str, period_us: f64, most: u16) -> Result<u16, JobFileError> {
    let slot_us = period_us / f64::from(SLOTS);
    let value = machine.number(key)?;
    // Less a rounding of the period.
    let slots = (value / slot_us - 1e-9).ceil();
    if value >= 0.0 && slots <= f64::from(most) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the range that was checked"
        )]
        return Ok(slots.max(0.0) as u16);
    }
    let most_us = slot_us * f64::from(most);
    let what = format!("`{key}` must be 0 to {most_us} (at this period), not {value}");
    Err(machine.error(
        key,
        what,
        "give the time that the drive's manual asks for, in microseconds",
    ))
}

/// The steps of the axes, where the job names them.
pub(super) fn read(machine: &Section<'_>, period_us: f64) -> Result<Option<StepConfig>, JobFileError> {
    debug_assert!(period_us >= PERIOD_RANGE_US[0]);
    let [steps, pulse, setup, inverted] = KEYS;
    if !machine.has(steps) {
        let alone = [pulse, setup, inverted].into_iter().find(|key| machine.has(key));
        return alone.map_or(Ok(None), |key| {
            let what = format!("`{key}` says nothing without `{steps}`");
            Err(machine.error(key, what, WANT))
        });
    }
    let mut config = StepConfig::DEFAULT;
    let value = machine.value(steps)?;
    for (target, entry) in config.axes.iter_mut().zip(value.list_of(3, "number")?) {
        *target = axis(&entry)?;
        let mut one = StepConfig::DEFAULT;
        one.axes[0] = *target;
        if one.check().is_err() {
            let what = format!(
                "must be from 1/1000 to 500000, not {}/{}",
                target.steps, target.mm
            );
            return Err(entry.error(&what, WANT));
        }
    }
    if machine.has(pulse) {
        let slots = slots(machine, pulse, period_us, PULSE_SLOTS_MAX.into())?;
        config.pulse_slots = u8::try_from(slots.max(1)).unwrap_or(PULSE_SLOTS_MAX);
    }
    if machine.has(setup) {
        config.setup_slots = slots(machine, setup, period_us, SETUP_SLOTS_MAX)?;
    }
    if machine.has(inverted) {
        let flags = machine.value(inverted)?.list_of(3, "switch")?;
        for (axis, flag) in config.axes.iter_mut().zip(flags) {
            let DeValue::Boolean(flag) = flag.get() else {
                return Err(flag.error("must be true or false", "give one for each of x, y and z"));
            };
            axis.inverted = *flag;
        }
    }
    Ok(Some(config))
}

#[cfg(test)]
mod tests {
    use super::super::JobFile;
    use super::*;

    const TORUS: &str = include_str!("../../../jobs/torus.toml");

    fn read_from(machine: &str) -> Result<Option<StepConfig>, String> {
        let text = format!(
            "{}\n[machine]\n{machine}\n",
            TORUS.split("[machine]").next().unwrap()
        );
        JobFile::parse("job.toml", &text)
            .map(|job| job.machine.steps)
            .map_err(|error| error.what().to_owned())
    }

    #[test]
    fn fractions_are_exact() {
        let ratios = |machine: &str| {
            let config = read_from(machine).unwrap().unwrap();
            config.axes.map(|axis| (axis.steps, axis.mm))
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
    fn times_are_slots_and_never_shorter() {
        let steps = "steps_per_mm = [400, 400, 400]";
        let config = |more: &str| read_from(&format!("{steps}\n{more}")).map(Option::unwrap);
        assert_eq!(config("").unwrap(), StepConfig::DEFAULT);
        let given =
            config("pulse_us = 2.5\ndirection_setup_us = 5\ndirection_inverted = [false, true, false]");
        let given = given.unwrap();
        assert_eq!((given.pulse_slots, given.setup_slots), (3, 5));
        assert_eq!(given.axes.map(|axis| axis.inverted), [false, true, false]);
        let given = config("period_us = 500\npulse_us = 2.5\ndirection_setup_us = 0").unwrap();
        assert_eq!((given.pulse_slots, given.setup_slots), (5, 0));
        assert!(config("pulse_us = 25").unwrap_err().contains("`pulse_us`"));
        assert!(read_from("pulse_us = 2").unwrap_err().contains("steps_per_mm"));
    }

    #[test]
    fn what_is_no_steps_is_said() {
        for (steps, what) in [
            ("[400, 400]", "3 numbers"),
            ("[400, 0, 400]", "1/1000"),
            ("[400, 500001, 400]", "1/1000"),
            ("[400, -4.5, 400]", "no number of steps"),
            (r#"[400, "5/0", 400]"#, "1/1000"),
            (r#"[400, "a/5", 400]"#, "no number of steps"),
            ("[400, true, 400]", "must be a number"),
            ("[400, 0.12345678912345, 400]", "no number of steps"),
        ] {
            let said = read_from(&format!("steps_per_mm = {steps}")).unwrap_err();
            assert!(said.contains(what), "{steps}: {said}");
        }
    }
}
