//! The journal of the loaded job's runs.

use interp_core::sample::{RunStart, SpanParameter, State};
use protocol::message::{Journal, PassDigest, Status};

use super::Session;
use crate::{journal::Journalling, machine::Machine};

impl Session {
    /// Journals that a run of the loaded job begins here.
    #[inline(never)]
    pub(super) fn journal_start(&mut self, machine: &mut impl Machine, start: RunStart) {
        self.journalling = Journalling::NONE;
        machine.prepare_journal(None);
        if let Some(journal) = self.journal(start, false)
            && machine.keep_journal(&journal).is_err()
        {
            // A run is not hindered by a journal that is full, or absent; but an earlier one is not resumed in its place.
            let _ = machine.end_journal();
        }
    }

    /// Forgets the places of the last run, before another job is loaded. No record is prepared from here on, so that other records may be written.
    pub(super) fn forget_places(&mut self, machine: &mut impl Machine) {
        self.journalling.forget_places();
        machine.prepare_journal(None);
    }

    /// How far a run of the loaded job came, if its runs are journalled.
    fn journal(&self, start: RunStart, is_finished: bool) -> Option<Journal> {
        let RunStart { pass, path } = start;
        self.job.map(|job| Journal {
            job,
            profile: self.profile,
            pass,
            is_finished,
            path,
        })
    }

    /// A pass of a run is over.
    pub(crate) fn note_pass(&mut self, pass: &PassDigest) {
        self.journalling
            .note(self.journal(at_start(pass.pass.saturating_add(1)), false));
    }

    /// A run has ended, or its ticks are used up.
    pub(crate) fn note_halt(&mut self, status: &Status) {
        if status.state == State::Finished {
            self.journalling.note(self.journal(at_start(status.pass), true));
        } else if !status.state.is_under_way() {
            // Its last pass is complete up to a place, or not known to be.
            self.journalling.freeze();
            let place = self.journalling.place();
            self.journalling
                .note(place.and_then(|place| self.journal(place, false)));
        }
    }

    /// Writes the record that is due, and keeps the one for a failing supply up to date.
    #[inline(never)]
    pub(crate) fn keep_journal(&mut self, now: u32, machine: &mut impl Machine) {
        let due = self.journalling.due(now);
        if let Some(journal) = &due {
            let _ = machine.keep_journal(journal);
        }
        let is_place_due = self.job.is_some() && self.journalling.is_place_due(now);
        if is_place_due {
            self.journalling.note_place(now, machine.place());
        }
        if due.is_some() || is_place_due {
            let place = self.journalling.place();
            let record = place.and_then(|place| self.journal(place, false));
            machine.prepare_journal(record.as_ref());
        }
    }
}

const fn at_start(pass: u32) -> RunStart {
    RunStart {
        pass,
        path: SpanParameter::NONE,
    }
}
