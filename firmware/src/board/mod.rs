//! The interface between application and board: the only file with conditional compilation per
//! board.
//!
//! A board is one file beside this one, with the same items in each:
//!
//! | item | meaning |
//! |---|---|
//! | `BOARD` | its table: name, crystal, pins (crate `boards`) |
//! | `TIMER_HZ` | clock of TIM2 and TIM5 |
//! | `TIMER_RELOAD` | auto-reload value of TIM2 for one period |
//! | `TIME_IS_SIMULATED` | in lockstep, ticks need not wait for the timer |
//! | `STEP_TIMER_HZ` | clock of TIM1 |
//! | `WIRING` | step and direction pins |
//! | `STEPS` | default settings of the drives, until the host sends others |
//! | `SERIAL_DIVIDER` | `BRR` of USART1 |
//! | `init` | sets up the clocks; returns the peripherals for the drivers |
//! | `InputPorts` | source of the safety inputs: the chip's ports, or simulated ones |
//! | `SettingsFlash`, `JobFlash`, `FallingFlash` | where settings with the journal are kept, jobs, and the record of a failing supply |
//! | `HAS_JOURNAL` | the journal outlives the power |
//! | `supply_is_low` | acknowledges the voltage detector's interrupt; whether the voltage is low |
//! | `simulate` | sets the simulated inputs of a board without pins |
//! | `stop_for_good` | final state after a processor fault |
//!
//! Pins are set up earlier, directly after a reset (`reset_pins.rs`). For boards with a chip, `chip.rs` provides all items but the first, the panic handler and the transport of the
//! log; QEMU has its own. Drivers take their pins from `BOARD`. To add a board, add its table in `boards`, its file here, its
//! feature in `Cargo.toml`, and its lines below.

#[cfg(not(any(
    feature = "board-qemu",
    feature = "board-stm32f405",
    feature = "board-skr-pro"
)))]
compile_error!("choose a board: `cargo fw-qemu`, `cargo fw-chip` or `cargo fw-skr-pro`");
#[cfg(any(
    all(feature = "board-qemu", feature = "board-stm32f405"),
    all(feature = "board-qemu", feature = "board-skr-pro"),
    all(feature = "board-stm32f405", feature = "board-skr-pro")
))]
compile_error!("choose one board: `cargo fw-qemu`, `cargo fw-chip` or `cargo fw-skr-pro`");

#[cfg(feature = "board-qemu")]
mod qemu;
#[cfg(feature = "board-qemu")]
pub(crate) use qemu::{
    BOARD, FallingFlash, HAS_JOURNAL, InputPorts, JobFlash, SERIAL_DIVIDER, STEP_TIMER_HZ, SettingsFlash,
    TIME_IS_SIMULATED, TIMER_HZ, TIMER_RELOAD, init, simulate, stop_for_good, supply_is_low,
};

#[cfg(not(feature = "board-qemu"))]
mod chip;
#[cfg(not(feature = "board-qemu"))]
pub(crate) use chip::{
    FallingFlash, HAS_JOURNAL, InputPorts, JobFlash, SERIAL_DIVIDER, STEP_TIMER_HZ, SettingsFlash,
    TIME_IS_SIMULATED, TIMER_HZ, TIMER_RELOAD, init, simulate, stop_for_good, supply_is_low,
};

#[cfg(feature = "board-stm32f405")]
mod stm32f405;
#[cfg(feature = "board-stm32f405")]
pub(crate) use stm32f405::BOARD;

#[cfg(feature = "board-skr-pro")]
mod skr_pro;
#[cfg(feature = "board-skr-pro")]
pub(crate) use skr_pro::BOARD;

#[cfg(feature = "behind-loader")]
mod behind_loader;
mod reset_pins;

use boards::{Axis, Level, Line};
use controller::step_output::{Pin, Port, Wiring};
use interp_core::StepConfig;
use protocol::message::ResetCause;
use stm32f4xx_hal::pac;

/// The board of the image: `cargo sim flash` finds it by this name, and refuses another board's image.
// SAFETY: the symbol name is unique; it equals `boards::MARK_SYMBOL`.
#[allow(unsafe_code, reason = "a name that is not the compiler's")]
#[unsafe(export_name = "isofeed_board")]
pub(crate) static MARK: [u8; boards::MARK_BYTES] = BOARD.mark();
use crate::drivers::reset_cause::{TAKE_BACK, cause};

/// The words that make every output inactive, one per port; computed at compile time, because they are used after a processor fault.
pub(crate) static REST: [u32; boards::Port::ALL.len()] = boards::setup::rest(BOARD.lines);

/// Step and direction pins, by the board's table.
pub(crate) const WIRING: Wiring = {
    let [x, y, z] = [BOARD.axis(Axis::X), BOARD.axis(Axis::Y), BOARD.axis(Axis::Z)];
    Wiring {
        step_port: port(BOARD.step_port()),
        step: [x.step.pin.number, y.step.pin.number, z.step.pin.number],
        direction: [pin(x.direction), pin(y.direction), pin(z.direction)],
    }
};

const fn pin(line: Line) -> Pin {
    Pin(port(line.pin.port), line.pin.number)
}

const fn port(port: boards::Port) -> Port {
    match port {
        boards::Port::A => Port::A,
        boards::Port::B => Port::B,
        boards::Port::C => Port::C,
        boards::Port::D => Port::D,
        boards::Port::E => Port::E,
        boards::Port::F => Port::F,
        boards::Port::G => Port::G,
        boards::Port::H => Port::H,
    }
}

/// Axes whose direction pin is high towards plus, one bit each: those whose active level in the board's table is high.
pub(crate) const PLUS_IS_HIGH: u8 =
    plus_is_high(Axis::X) | plus_is_high(Axis::Y) << 1 | plus_is_high(Axis::Z) << 2;

const fn plus_is_high(axis: Axis) -> u8 {
    matches!(BOARD.axis(axis).direction.active, Level::High) as u8
}

/// Default settings of the drives, until the host sends others.
pub(crate) const STEPS: StepConfig = StepConfig::DEFAULT;

/// The peripherals for the drivers, after the clocks are set up.
pub(crate) struct Board {
    /// The timer of the step output.
    pub(crate) tim1: pac::TIM1,
    /// The sample timer.
    pub(crate) tim2: pac::TIM2,
    /// The reference clock for counting missed periods.
    pub(crate) tim5: pac::TIM5,
    /// The DMA of the step output.
    pub(crate) dma2: pac::DMA2,
    /// The link to the host.
    pub(crate) usart1: pac::USART1,
    /// The watchdog, not started.
    pub(crate) iwdg: pac::IWDG,
    /// Flash sectors of settings and journal.
    pub(crate) settings: SettingsFlash,
    /// Flash sectors of jobs.
    pub(crate) jobs: JobFlash,
    /// Flash sectors of settings and journal, for the record of a failing supply.
    pub(crate) falling: FallingFlash,
    /// Why the chip started.
    pub(crate) reset: ResetCause,
}

/// The reset cause. To be called once, because it clears the flags.
#[allow(unsafe_code, reason = "a whole register is written")]
fn take_reset_cause(rcc: &pac::rcc::RegisterBlock) -> ResetCause {
    let flags = rcc.csr().read().bits();
    // SAFETY: clears the flags; the LSI's enable bit, the other field of this register, is preserved.
    rcc.csr().write(|w| unsafe { w.bits(flags | TAKE_BACK) });
    cause(flags)
}

/// Location of a panic, and its message if it is a constant string: formatting any other takes 4 KB of `core`.
fn log_panic(info: &core::panic::PanicInfo<'_>) {
    let message = info.message().as_str().unwrap_or("");
    match info.location() {
        Some(at) => defmt::error!("panic at {=str}:{=u32}: {=str}", at.file(), at.line(), message),
        None => defmt::error!("panic: {=str}", message),
    }
}
