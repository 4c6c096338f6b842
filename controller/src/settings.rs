//! The machine's profile, kept beyond a power cut.

use embedded_storage::nor_flash::NorFlash;
use protocol::message::{PROFILE_BYTES_MAX, Profile};

use crate::storage::{Kind, Storage, StorageError};

/// The profile, and where it is kept.
#[derive(Debug)]
pub struct Settings<F> {
    storage: Storage<F>,
    profile: Option<Profile>,
}

impl<F: NorFlash> Settings<F> {
    /// Reads the profile; see [`Storage::open`] for the time that this takes.
    pub fn open(flash: F) -> Self {
        let mut storage = Storage::open(flash);
        let profile = storage
            .newest(Kind::Profile)
            .and_then(|payload| Profile::read(payload.bytes()));
        Self { storage, profile }
    }

    /// The flash.
    pub fn into_flash(self) -> F {
        self.storage.into_flash()
    }

    /// The profile, if one is kept.
    #[must_use]
    pub const fn profile(&self) -> Option<Profile> {
        self.profile
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
}
