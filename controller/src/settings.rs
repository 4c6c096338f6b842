//! The machine's profile, work offsets, tool length and the journal, kept beyond a power cut.

use embedded_storage::nor_flash::NorFlash;
use protocol::message::{Journal, OFFSETS_BYTES_MAX, Offsets, PROFILE_BYTES_MAX, Profile};

use crate::storage::{Kind, PAYLOAD_MAX, Prepared, Storage, StorageError};

/// The profile, and where it is kept.
#[derive(Debug)]
pub struct Settings<F> {
    storage: Storage<F>,
    profile: Option<Profile>,
    offsets: Offsets,
}

impl<F: NorFlash> Settings<F> {
    /// Reads the profile; see [`Storage::open`] for the time that this takes.
    pub fn open(flash: F) -> Self {
        let mut storage = Storage::open(flash);
        let mut bytes = [0; PAYLOAD_MAX];
        let profile = storage.newest(Kind::Profile, &mut bytes).and_then(Profile::read);
        let offsets = storage.newest(Kind::Offsets, &mut bytes).and_then(Offsets::read);
        Self {
            storage,
            profile,
            offsets: offsets.unwrap_or(Offsets::NONE),
        }
    }

    /// The flash.
    pub fn into_flash(self) -> F {
        self.storage.into_flash()
    }

    /// The profile, if one is kept.
    #[must_use]
    pub const fn profile(&self) -> Option<&Profile> {
        self.profile.as_ref()
    }

    /// Work offsets and tool length.
    #[must_use]
    pub const fn offsets(&self) -> Offsets {
        self.offsets
    }

    /// Keeps work offsets and tool length.
    ///
    /// # Errors
    /// The flash cannot be written: they are as before.
    pub fn keep_offsets(&mut self, offsets: &Offsets) -> Result<(), StorageError> {
        let mut bytes = [0; OFFSETS_BYTES_MAX];
        self.storage.keep(Kind::Offsets, offsets.write(&mut bytes))?;
        self.offsets = *offsets;
        Ok(())
    }

    /// Keeps a profile; none: forgets it.
    ///
    /// # Errors
    /// The flash cannot be written: the profile is as before.
    pub fn keep(&mut self, profile: Option<&Profile>) -> Result<(), StorageError> {
        let mut bytes = [0; PROFILE_BYTES_MAX];
        let payload = profile.map_or(&[][..], |profile| profile.write(&mut bytes));
        self.storage.keep(Kind::Profile, payload)?;
        self.profile = profile.copied();
        Ok(())
    }

    /// How far the last run came; none where none was journalled.
    pub fn journal(&mut self) -> Option<Journal> {
        let mut bytes = [0; PAYLOAD_MAX];
        Journal::read(self.storage.newest(Kind::Journal, &mut bytes)?)
    }

    /// Journals how far a run came.
    ///
    /// # Errors
    /// The flash cannot be written, or is full until the next power-up.
    pub fn keep_journal(&mut self, journal: &Journal) -> Result<(), StorageError> {
        self.storage.keep(Kind::Journal, &journal.write())
    }

    /// Where [`Self::keep_journal`] finds the flash full: journals the end of the run that the newest record is of, so that it is not resumed in place of a later one.
    ///
    /// # Errors
    /// The flash cannot be written.
    pub fn end_journal(&mut self) -> Result<(), StorageError> {
        match self.journal() {
            Some(journal) if !journal.is_finished => {
                let ended = Journal {
                    is_finished: true,
                    ..journal
                };
                self.storage.keep_last(Kind::Journal, &ended.write())
            }
            _ => Ok(()),
        }
    }

    /// A record of the journal for [`Storage::prepare`]. `was_written`: the one before was.
    pub fn prepare_journal(&mut self, journal: Option<&Journal>, was_written: bool) -> Option<Prepared> {
        if was_written {
            self.storage.look_again();
        }
        self.storage.prepare(Kind::Journal, &journal?.write())
    }
}
