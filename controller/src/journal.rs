//! What of a run is journalled, and when.
//!
//! A record is due some periods after the pass that it reports as complete: the step output lags behind the samples, so only then the axes have been there.
//! Before, the supply's failure leaves the record before, and the pass is cut again.

use protocol::message::Journal;

/// Periods from the first sample of a pass until the one before is complete at the axes: two of the step output, and one in which the sample may have been late.
const LAG_PERIODS: u32 = 3;

/// The record that is due next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Journalling {
    next: Option<Journal>,
    since: Option<u32>,
}

impl Journalling {
    pub(crate) const NONE: Self = Self {
        next: None,
        since: None,
    };

    /// A run has come this far, in place of what was noted before.
    pub(crate) const fn note(&mut self, next: Option<Journal>) {
        self.next = next;
        self.since = None;
    }

    /// The record, once it is due. `now`: periods since power-up.
    pub(crate) fn due(&mut self, now: u32) -> Option<Journal> {
        let next = self.next?;
        let since = *self.since.get_or_insert(now);
        if now.wrapping_sub(since) <= LAG_PERIODS {
            return None;
        }
        *self = Self::NONE;
        Some(next)
    }
}
