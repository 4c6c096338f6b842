//! The reset cause, by the flags in `RCC_CSR` (RM0090, 7.3.21).

use protocol::message::ResetCause;

/// `RMVF`: clears all flags.
pub(crate) const TAKE_BACK: u32 = 1 << 24;

/// The cause for these flags. Every internal reset also sets the reset pin's flag, and power-on sets
/// both power-on and brown-out: the most specific flag counts.
pub(crate) const fn cause(csr: u32) -> ResetCause {
    const LOW_POWER: u32 = 1 << 31;
    const WATCHDOGS: u32 = 1 << 30 | 1 << 29;
    const SOFTWARE: u32 = 1 << 28;
    const POWER_ON: u32 = 1 << 27;
    const PIN: u32 = 1 << 26;
    const BROWNOUT: u32 = 1 << 25;
    if csr & WATCHDOGS != 0 {
        ResetCause::Watchdog
    } else if csr & LOW_POWER != 0 {
        ResetCause::LowPower
    } else if csr & SOFTWARE != 0 {
        ResetCause::Software
    } else if csr & POWER_ON != 0 {
        ResetCause::PowerOn
    } else if csr & BROWNOUT != 0 {
        ResetCause::Brownout
    } else if csr & PIN != 0 {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    }
}
