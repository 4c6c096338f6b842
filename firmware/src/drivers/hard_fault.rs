//! Makes the outputs inactive, logs the fault of the processor, and stops permanently.

use cortex_m_rt::{ExceptionFrame, exception};

use crate::{board, drivers::gpio};

// SAFETY: an exception handler has to be declared `unsafe`; this one only reads the frame that it is given
// and never returns.
#[allow(unsafe_code, reason = "the exception's declaration")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // Before the log, which takes time and may itself be faulty.
    gpio::rest(&board::REST);
    defmt::error!(
        "hard fault at {=u32:#010x}, called from {=u32:#010x}",
        frame.pc(),
        frame.lr()
    );
    board::stop_for_good()
}
