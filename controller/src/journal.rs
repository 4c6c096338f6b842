//! The journal of a run: its records, and when they are written.
//!
//! **After each pass** a record is written, some periods later: the step output lags behind the samples, and only then the axes have reached the end of the pass.
//! **Within a pass** a record is prepared for a failing supply ([`crate::storage::Storage::prepare`]) and for a run that is cut short. It says that the pass is complete up to a
//! place that the tool left 100 to 150 periods before. The board may notice that much later that the drives let go or a cutter broke;
//! a resume machines this part again. Without such a record the one before stands, and the pass is machined again.

use interp_core::sample::RunStart;
use protocol::message::Journal;

/// Periods from the first sample of a pass until the one before is complete at the axes: two of the step output, and one in which the sample may have been late.
const LAG_PERIODS: u32 = 3;

/// Periods between two places that are noted.
const PLACE_PERIODS: u32 = 50;
/// Places that are kept; the oldest one is journalled.
const PLACES: usize = 3;

/// The record that is due next, and the places that the tool was at last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Journalling {
    /// The record that is due once the axes have followed.
    next: Option<Journal>,
    /// Since when it waits, periods since power-up.
    since: Option<u32>,
    /// The latest places, the oldest first.
    places: [Option<RunStart>; PLACES],
    /// When the last place was noted, periods since power-up.
    noted: u32,
}

impl Journalling {
    pub(crate) const NONE: Self = Self {
        next: None,
        since: None,
        places: [None; PLACES],
        noted: 0,
    };

    /// Notes how far a run has come, in place of an earlier note that was not written yet.
    pub(crate) fn note(&mut self, next: Option<Journal>) {
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
        self.note(None);
        // Places on passes that the record says are complete.
        for place in &mut self.places {
            *place = place.filter(|place| place.pass >= next.pass && !next.is_finished);
        }
        Some(next)
    }

    /// Forgets the places: another job is loaded, or another profile is in force.
    pub(crate) const fn forget_places(&mut self) {
        self.places = [None; PLACES];
    }

    /// Whether a place is to be noted.
    pub(crate) const fn is_place_due(&self, now: u32) -> bool {
        now.wrapping_sub(self.noted) >= PLACE_PERIODS
    }

    /// Notes where the tool is; off the passes it was last where it was before.
    pub(crate) fn note_place(&mut self, now: u32, place: Option<RunStart>) {
        self.noted = now;
        let [_, second, third] = self.places;
        self.places = [second, third, place.or(third)];
    }

    /// The run has ended: its place does not come nearer any more. The drives may have let go before the board noticed the end.
    pub(crate) fn freeze(&mut self) {
        self.places = [self.place(); PLACES];
    }

    /// The place up to which the run is complete for certain.
    pub(crate) const fn place(&self) -> Option<RunStart> {
        let [oldest, ..] = self.places;
        oldest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use interp_core::sample::SpanParameter;

    fn at(pass: u32, fraction: u64) -> Option<RunStart> {
        let path = SpanParameter { span: 0, fraction };
        Some(RunStart { pass, path })
    }

    #[test]
    fn the_place_is_that_of_two_notes_ago() {
        let mut journalling = Journalling::NONE;
        assert!(journalling.is_place_due(PLACE_PERIODS) && !journalling.is_place_due(PLACE_PERIODS - 1));
        for (fraction, wanted) in [(1, None), (2, None), (3, at(4, 1)), (4, at(4, 2))] {
            journalling.note_place(PLACE_PERIODS, at(4, fraction));
            assert_eq!(journalling.place(), wanted);
        }
        // In a link it comes nearer, and stays.
        for wanted in [3, 4, 4] {
            journalling.note_place(PLACE_PERIODS, None);
            assert_eq!(journalling.place(), at(4, wanted));
        }
        // A record of the pass after it is worth more.
        let next = Journal {
            job: 0,
            profile: 0,
            pass: 5,
            is_finished: false,
            path: SpanParameter::NONE,
        };
        journalling.note(Some(next));
        assert_eq!(journalling.due(100), None);
        assert_eq!(journalling.due(101 + LAG_PERIODS), Some(next));
        assert_eq!(journalling.place(), None);
    }
}
