//! Numbers as the page carries them: 16-bit steps of a range, as base64.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// Steps of a range.
const STEPS: f64 = 65_534.0;
/// Stands for "none".
const NONE: u16 = u16::MAX;

/// Bytes of 16-bit numbers, the lower one first, as base64.
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
    /// The scale of these values; what is no finite number does not count.
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

    /// The step below, so that a least value is none too high.
    pub(super) fn below(self, value: f64) -> u16 {
        self.with(value, f64::floor)
    }

    /// The step above, so that a largest value is none too low.
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
        // The rounding of the quotient itself must not reach the next step.
        let steps = (value - self.low) / self.step;
        let whole = steps.round();
        let steps = if (steps - whole).abs() < 1e-6 {
            whole
        } else {
            round(steps)
        };
        steps.clamp(0.0, STEPS) as u16
    }

    /// This scale and words in it, as the page reads them.
    pub(super) fn json(self, words: String) -> Value {
        json!({ "low": self.low, "step": self.step, "data": words })
    }
}

/// Values of one kind, each to the nearest step.
pub(super) fn column(values: impl Iterator<Item = f64> + Clone) -> Value {
    let scale = Scale::of(values.clone());
    scale.json(words(values.map(|value| scale.nearest(value))))
}
