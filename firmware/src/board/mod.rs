//! The seam between the application and the board it runs on: the only file that knows which boards there
//! are.
//!
//! A board is one file beside this one, with the same items in each:
//!
//! | item | what |
//! |---|---|
//! | `NAME` | the board's name, for the log and for the host |
//! | `TIMER_HZ` | what TIM2 and TIM5 count |
//! | `TIMER_RELOAD` | auto-reload value of TIM2 for one period |
//! | `STEP_TIMER_HZ` | what TIM1 counts |
//! | `WIRING` | step and direction pins |
//! | `STEPS` | what the drives want, until a host says otherwise |
//! | `SERIAL_DIVIDER` | `BRR` of USART1 |
//! | `StatusPin` | the pin of the status LED |
//! | `init` | clocks and pins; hands back what the drivers do not take |
//! | `stop_for_good` | what follows a fault of the processor |
//!
//! The panic handler and the transport of the log come with the board's file, too. To add a board, add its
//! file, its feature in `Cargo.toml`, and its lines here.

#[cfg(all(feature = "board-qemu", feature = "board-stm32f405"))]
compile_error!("choose one board: `cargo fw-qemu` or `cargo fw-chip`");
#[cfg(not(any(feature = "board-qemu", feature = "board-stm32f405")))]
compile_error!("choose a board: `cargo fw-qemu` or `cargo fw-chip`");

#[cfg(feature = "board-qemu")]
mod qemu;
#[cfg(feature = "board-qemu")]
pub(crate) use qemu::{
    NAME, SERIAL_DIVIDER, STEP_TIMER_HZ, STEPS, StatusPin, TIMER_HZ, TIMER_RELOAD, WIRING, init,
    stop_for_good,
};

#[cfg(feature = "board-stm32f405")]
mod stm32f405;
#[cfg(feature = "board-stm32f405")]
pub(crate) use stm32f405::{
    NAME, SERIAL_DIVIDER, STEP_TIMER_HZ, STEPS, StatusPin, TIMER_HZ, TIMER_RELOAD, WIRING, init,
    stop_for_good,
};

use stm32f4xx_hal::pac;

/// What remains of the chip once clocks and pins are set up: the parts that the drivers take.
pub(crate) struct Board {
    /// The timer of the step output.
    pub(crate) tim1: pac::TIM1,
    /// The sample timer.
    pub(crate) tim2: pac::TIM2,
    /// The reference clock that missed periods are counted by.
    pub(crate) tim5: pac::TIM5,
    /// The DMA of the step output.
    pub(crate) dma2: pac::DMA2,
    /// The link to the host.
    pub(crate) usart1: pac::USART1,
    /// The status LED.
    pub(crate) status_pin: StatusPin,
}

/// Where a panic happened, and its message where that is a plain text: `core`'s machinery for any other is 4 KB.
fn log_panic(info: &core::panic::PanicInfo<'_>) {
    let message = info.message().as_str().unwrap_or("");
    match info.location() {
        Some(at) => defmt::error!("panic at {=str}:{=u32}: {=str}", at.file(), at.line(), message),
        None => defmt::error!("panic: {=str}", message),
    }
}
