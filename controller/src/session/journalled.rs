//! The journal of the loaded job's runs.

use interp_core::sample::State;
use protocol::message::{Journal, PassDigest, Status};

use super::Session;
use crate::{journal::Journalling, machine::Machine};

impl Session {
    /// Journals that a run of the loaded job begins at a pass.
    #[inline(never)]
    pub(super) fn journal_start(&mut self, machine: &mut impl Machine, pass: u32) {
        self.journalling = Journalling::NONE;
        if let Some(journal) = self.journal(pass, false) {
            // A run is not hindered by a journal that is full, or absent.
            let _ = machine.keep_journal(&journal);
        }
    }

    /// How far a run of the loaded job came, if its runs are journalled.
    fn journal(&self, pass: u32, is_finished: bool) -> Option<Journal> {
        self.job.map(|job| Journal {
            job,
            profile: self.profile,
            pass,
            is_finished,
        })
    }

    /// A pass of a run is over.
    pub(crate) fn note_pass(&mut self, pass: &PassDigest) {
        self.journalling
            .note(self.journal(pass.pass.saturating_add(1), false));
    }

    /// A run has come to its end, or to that of its ticks.
    pub(crate) fn note_halt(&mut self, status: &Status) {
        if status.state == State::Finished {
            self.journalling.note(self.journal(status.pass, true));
        } else if !status.state.is_under_way() {
            // Its last pass is not complete.
            self.journalling = Journalling::NONE;
        }
    }

    /// Journals what is due.
    pub(crate) fn keep_journal(&mut self, now: u32, machine: &mut impl Machine) {
        if let Some(journal) = self.journalling.due(now) {
            let _ = machine.keep_journal(&journal);
        }
    }
}
