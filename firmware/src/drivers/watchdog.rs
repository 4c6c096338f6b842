//! The independent watchdog (IWDG, RM0090 chapter 21): resets the chip if not fed for some periods.
//!
//! Its clock is the LSI, so it works when all other clocks have stopped; once started, only a reset stops it. The LSI
//! has a wide tolerance: 17 to 47 kHz (data sheet DS8626, table 35). The timeout is computed for the fastest LSI, and is 2.8 times as long at
//! the slowest.

/// Highest frequency of the LSI, kHz.
const LSI_MAX_KHZ: u32 = 47;

/// The prescaler's least division, with code 0: the finest resolution, with a sufficient range.
const DIVISION: u32 = 4;

/// Largest reload value.
const RELOAD_MAX: u32 = 0xfff;

/// `KR`: prescaler and reload may be written.
const UNLOCK: u16 = 0x5555;
/// `KR`: reload the counter.
const FEED: u16 = 0xaaaa;
/// `KR`: start; switches the LSI on, too.
const START: u16 = 0xcccc;

/// `SR`: an update of prescaler or reload is still pending.
const UPDATING: u16 = 0b11;

/// Maximum reads of `SR` before a timeout. The update takes five clocks of the LSI (RM0090, 21.4.4), 300 us at the slowest; a read takes at
/// least two cycles of 168 MHz.
const LOOKS_MAX: u32 = 50_000;

/// A register of the watchdog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Register {
    /// `KR`, offset 0.
    Key,
    /// `PR`, offset 4.
    Prescaler,
    /// `RLR`, offset 8.
    Reload,
    /// `SR`, offset 12.
    Status,
}

/// The watchdog's registers.
pub(crate) trait Registers {
    /// Writes a register.
    fn write(&mut self, register: Register, value: u16);
    /// Reads a register.
    fn read(&mut self, register: Register) -> u16;
}

/// The reload value for a timeout of at least this number of microseconds at any LSI frequency.
///
/// # Panics
/// The timeout exceeds the range of the finest division. For use in constants.
pub(crate) const fn reload(least_us: u32) -> u16 {
    let counts = (least_us * LSI_MAX_KHZ).div_ceil(1_000 * DIVISION);
    assert!(
        counts > 0 && counts - 1 <= RELOAD_MAX,
        "the watchdog cannot wait so long"
    );
    (counts - 1) as u16
}

/// The running watchdog.
pub(crate) struct Watchdog<R> {
    registers: R,
    settled: bool,
}

impl<R: Registers> Watchdog<R> {
    /// Starts it with this reload value.
    pub(crate) fn start(mut registers: R, reload: u16) -> Self {
        // Started first, because the other registers update only with the LSI on. Until then the timeout is the longest.
        registers.write(Register::Key, START);
        registers.write(Register::Key, UNLOCK);
        registers.write(Register::Prescaler, 0);
        registers.write(Register::Reload, reload);
        let settled = (0..LOOKS_MAX).any(|_| registers.read(Register::Status) & UPDATING == 0);
        registers.write(Register::Key, FEED);
        Self { registers, settled }
    }

    /// Whether the timeout was set; otherwise the reset takes up to a second.
    pub(crate) const fn is_settled(&self) -> bool {
        self.settled
    }

    /// Feeds the watchdog. To be called only by a tick that has met its deadline.
    #[inline]
    pub(crate) fn feed(&mut self) {
        self.registers.write(Register::Key, FEED);
    }
}
