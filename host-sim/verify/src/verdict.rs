//! The verdict on one figure.

/// What a measurement says about a requirement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verdict {
    /// The requirement is met.
    #[default]
    Met,
    /// The requirement is violated.
    Violated,
    /// The measurement is too coarse for a verdict.
    Unknown,
}

impl Verdict {
    /// Whether the requirement is met.
    #[must_use]
    pub fn is_met(self) -> bool {
        self == Self::Met
    }
}
