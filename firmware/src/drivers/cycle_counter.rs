//! Processor cycles, by the cycle counter of the DWT. QEMU has none, so every difference is 0.

use cortex_m::peripheral::{DCB, DWT};

/// The running counter. It wraps after 2^32 cycles (25 s at 168 MHz); differences are valid up to that time.
pub(crate) struct CycleCounter {
    _dwt: DWT,
}

impl CycleCounter {
    /// Starts the counter.
    pub(crate) fn new(mut dcb: DCB, mut dwt: DWT) -> Self {
        dcb.enable_trace();
        dwt.enable_cycle_counter();
        Self { _dwt: dwt }
    }

    /// Cycles now.
    pub(crate) fn now(&self) -> u32 {
        DWT::cycle_count()
    }

    /// Cycles since `then`.
    pub(crate) fn since(&self, then: u32) -> u32 {
        self.now().wrapping_sub(then)
    }
}
