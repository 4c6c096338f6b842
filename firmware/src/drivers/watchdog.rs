//! The independent watchdog (IWDG, RM0090 chapter 21): resets the chip when it was not fed for some periods.
//!
//! It has a clock of its own, the LSI, so it works when all others stand still; once started, nothing but a reset stops it. The LSI
//! is coarse: 17 to 47 kHz (data sheet DS8626, table 35). The time is chosen for the fastest one, and is 2.8 times as long at
//! the slowest.

/// Highest frequency of the LSI, kHz.
const LSI_MAX_KHZ: u32 = 47;

/// The prescaler's least division, with code 0: the time is the finest there is, and long enough.
const DIVISION: u32 = 4;

/// Largest reload value.
const RELOAD_MAX: u32 = 0xfff;

/// `KR`: prescaler and reload may be written.
const UNLOCK: u16 = 0x5555;
/// `KR`: begin again to count down.
const FEED: u16 = 0xaaaa;
/// `KR`: start; switches the LSI on, too.
const START: u16 = 0xcccc;

/// `SR`: prescaler or reload are still on their way to the watchdog's clock.
const UPDATING: u16 = 0b11;

/// Looks at `SR` before it is given up. The way takes five clocks of the LSI (RM0090, 21.4.4), 300 us at the slowest; a look takes at
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
    /// Writes one.
    fn write(&mut self, register: Register, value: u16);
    /// Reads one.
    fn read(&mut self, register: Register) -> u16;
}

/// The reload value for a time of at least so many microseconds, whatever the LSI.
///
/// # Panics
/// The time is longer than the finest division counts. For constants.
pub(crate) const fn reload(least_us: u32) -> u16 {
    let counts = (least_us * LSI_MAX_KHZ).div_ceil(1_000 * DIVISION);
    assert!(
        counts > 0 && counts - 1 <= RELOAD_MAX,
        "the watchdog cannot wait so long"
    );
    (counts - 1) as u16
}

/// The watchdog, once it runs.
pub(crate) struct Watchdog<R> {
    registers: R,
    settled: bool,
}

impl<R: Registers> Watchdog<R> {
    /// Starts it with this reload value.
    pub(crate) fn start(mut registers: R, reload: u16) -> Self {
        // Started first: only with the LSI on do the other values arrive. Until then it counts its longest time.
        registers.write(Register::Key, START);
        registers.write(Register::Key, UNLOCK);
        registers.write(Register::Prescaler, 0);
        registers.write(Register::Reload, reload);
        let settled = (0..LOOKS_MAX).any(|_| registers.read(Register::Status) & UPDATING == 0);
        registers.write(Register::Key, FEED);
        Self { registers, settled }
    }

    /// Whether the time has arrived; otherwise it waits for up to a second before it resets.
    pub(crate) const fn is_settled(&self) -> bool {
        self.settled
    }

    /// Begins to count anew. To be called by a tick that has met its deadline, and by nothing else.
    #[inline]
    pub(crate) fn feed(&mut self) {
        self.registers.write(Register::Key, FEED);
    }
}
