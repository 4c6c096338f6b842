//! The machine's profile, work offsets and tool length, kept beyond a power cut.

use embedded_storage::nor_flash::NorFlash;
use protocol::message::{OFFSETS_BYTES_MAX, Offsets, PROFILE_BYTES_MAX, Profile};

use crate::storage::{Kind, Storage, StorageError};

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
        let profile = storage
            .newest(Kind::Profile)
            .and_then(|payload| Profile::read(payload.bytes()));
        let offsets = storage
            .newest(Kind::Offsets)
            .and_then(|payload| Offsets::read(payload.bytes()));
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
    pub const fn profile(&self) -> Option<Profile> {
        self.profile
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
}
