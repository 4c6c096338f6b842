//! The supply: the chip's voltage detector (PVD, 2.9 V) reports that it falls, and the journal's record is written before the voltage is too low for it.
//!
//! The record is prepared in advance, so that only its ten words have to be written: 0.2 ms, 1.1 ms at most. A record that was cut short does not
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

    /// Sets the record that is written when the supply falls.
    pub(crate) fn set(&mut self, prepared: Option<Prepared>) {
        self.prepared = prepared;
    }

    /// Withdraws the record: nothing is written until [`Self::set`]. Returns whether it was written already, so that its slot is not blank any more.
    pub(crate) const fn withdraw(&mut self) -> bool {
        self.prepared = None;
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
