//! Encoding of numbers in the page: 16-bit steps of a range, in base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// Number of steps of a range.
const STEPS: f64 = 65_534.0;
/// Code of a missing value.
const NONE: u16 = u16::MAX;

/// 16-bit numbers, little-endian, in base64.
pub(super) fn words(words: impl Iterator<Item = u16>) -> String {
    STANDARD.encode(words.flat_map(u16::to_le_bytes).collect::<Vec<_>>())
}

/// A range in steps: the value of step k is `low + k * step`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub(super) low: f64,
    pub(super) step: f64,
}

impl Scale {
    /// The scale of the finite ones of these values.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Self {
        let [low, high] = values
            .filter(|value| value.is_finite())
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            });
        if low > high {
            return Self { low: 0.0, step: 0.0 };
        }
        Self {
            low,
            step: (high - low) / STEPS,
        }
    }

    /// The nearest step.
    pub(super) fn nearest(self, value: f64) -> u16 {
        self.with(value, f64::round)
    }

    /// The step below: rounds a minimum down.
    pub(super) fn below(self, value: f64) -> u16 {
        self.with(value, f64::floor)
    }

    /// The step above: rounds a maximum up.
    pub(super) fn above(self, value: f64) -> u16 {
        self.with(value, f64::ceil)
    }

    fn with(self, value: f64, round: fn(f64) -> f64) -> u16 {
        if !value.is_finite() {
            return NONE;
        }
        if self.step == 0.0 {
            return 0;
        }
        // The rounding error of the quotient must not change the step.
        let steps = (value - self.low) / self.step;
        let whole = steps.round();
        let steps = if (steps - whole).abs() < 1e-6 {
            whole
        } else {
            round(steps)
        };
        steps.clamp(0.0, STEPS) as u16
    }

    /// The scale and words in it as JSON.
    pub(super) fn json(self, words: String) -> Value {
        json!({ "low": self.low, "step": self.step, "data": words })
    }
}

/// Values of one quantity, each rounded to the nearest step.
pub(super) fn column(values: impl Iterator<Item = f64> + Clone) -> Value {
    let scale = Scale::of(values.clone());
    scale.json(words(values.map(|value| scale.nearest(value))))
}
