//! The supply: its falling is noticed by the chip's voltage detector (PVD, 2.9 V), and journalled before it is too low.
//!
//! The record was made before, so that its ten words are all that is left to do: 0.2 ms, 1.1 ms at most. Whatever the voltage does then, a record that is not whole does not
//! count. While the voltage is low the drives count as faulty.

use core::sync::atomic::{AtomicBool, Ordering};

use controller::storage::Prepared;
use embedded_storage::nor_flash::NorFlash;
use protocol::message::InputLines;

/// The voltage is low.
static IS_LOW: AtomicBool = AtomicBool::new(false);

/// The supply's input, while the voltage is low.
#[inline]
pub(crate) fn lines() -> InputLines {
    if IS_LOW.load(Ordering::Relaxed) {
        InputLines::SUPPLY
    } else {
        InputLines::NONE
    }
}

/// The record of a failing supply, and where it is written.
pub struct FallingRecord<F> {
    flash: F,
    prepared: Option<Prepared>,
    is_written: bool,
}

impl<F: NorFlash> FallingRecord<F> {
    pub(crate) const fn new(flash: F) -> Self {
        Self {
            flash,
            prepared: None,
            is_written: false,
        }
    }

    /// Has this record written when the supply falls.
    pub(crate) fn set(&mut self, prepared: Option<Prepared>) {
        self.prepared = prepared;
    }

    /// Whether a record was written since the last call.
    pub(crate) const fn take_written(&mut self) -> bool {
        core::mem::replace(&mut self.is_written, false)
    }

    /// The voltage has become low, or is not any more.
    pub(crate) fn changed(&mut self, low: bool) {
        IS_LOW.store(low, Ordering::Relaxed);
        if let Some(Prepared { offset, bytes }) = self.prepared.take_if(|_| low) {
            // If it cannot be written, the record before it stands.
            let _ = self.flash.write(offset, &bytes);
            self.is_written = true;
        }
    }
}
