//! QEMU's `netduinoplus2`: the same chip without clocks, pins, flash timing or a debugger.
//!
//! Clock and pin registers read as zero there (on newer versions clocks are plain storage), so no clock is set
//! up, without waiting for one. The log goes through semihosting to QEMU's standard output; a panic ends
//! QEMU with exit code 101.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use boards::Port;
use controller::ram_flash::RamFlash;
use protocol::message::InputLines;
use stm32f4xx_hal::pac;

use super::{Board, take_reset_cause};
use crate::{
    design_parameters::PERIOD_US,
    drivers::{
        gpio,
        safety_inputs::{ReadPorts, pins_of},
    },
};

// The log: this crate is linked for its `defmt` logger.
use defmt_semihosting as _;

/// The bare chip's table: pin registers are absent, writes to them are lost, and they read as zero (no input is active).
pub(crate) const BOARD: &boards::Board = &boards::Board {
    id: "qemu-netduinoplus2",
    ..boards::STM32F405
};

/// QEMU clocks every timer with 1 GHz, independent of the clock registers.
pub(crate) const TIMER_HZ: u32 = 1_000_000_000;

/// In lockstep a tick need not wait for the timer: each timer update is passed between two threads of QEMU, which takes ten
/// times as long as the tick itself.
pub(crate) const TIME_IS_SIMULATED: bool = true;

/// QEMU's period is the reload value itself, not one more as on the chip.
pub(crate) const TIMER_RELOAD: u32 = TIMER_HZ / 1_000_000 * PERIOD_US;

/// Clock of TIM1 on the chip; QEMU has no TIM1.
pub(crate) const STEP_TIMER_HZ: u32 = 168_000_000;

/// QEMU has no baud rate; any value other than zero will do.
pub(crate) const SERIAL_DIVIDER: u16 = 91;

/// Exit code of QEMU after a panic: that of a panicking Rust program.
const EXIT_PANIC: i32 = 101;

/// Exit code of QEMU after a fault of the processor.
const EXIT_FAULT: i32 = 102;

/// Returns the peripherals, with no input asserted.
pub(crate) fn init(device: pac::Peripherals) -> Board {
    simulate(InputLines::NONE);
    Board {
        tim1: device.TIM1,
        tim2: device.TIM2,
        tim5: device.TIM5,
        dma2: device.DMA2,
        usart1: device.USART1,
        iwdg: device.IWDG,
        settings: SettingsFlash::new(),
        jobs: JobFlash::new(),
        falling: FallingFlash::new(),
        reset: take_reset_cause(&device.RCC),
    }
}

/// QEMU's flash cannot be written: settings are kept as long as QEMU runs.
pub(crate) type SettingsFlash = RamFlash<512>;
/// No jobs, and no journal: nothing survives the end of QEMU, and RAM is short.
pub(crate) type JobFlash = RamFlash<0>;
pub(crate) type FallingFlash = RamFlash<0>;
pub(crate) const HAS_JOURNAL: bool = false;

/// No voltage detector.
pub(crate) const fn supply_is_low() -> bool {
    false
}

/// Simulated input registers of the ports: the inputs set by the host.
static INPUTS: [AtomicU32; Port::ALL.len()] = [const { AtomicU32::new(0) }; Port::ALL.len()];

/// The ports whose inputs are [`INPUTS`].
pub(crate) struct InputPorts;

impl ReadPorts for InputPorts {
    #[inline]
    fn input(&self, port: Port) -> u32 {
        INPUTS
            .get(port.index())
            .map_or(0, |input| input.load(Ordering::Relaxed))
    }
}

/// Sets the pins as these inputs would.
pub(crate) fn simulate(lines: InputLines) -> bool {
    for (port, input) in Port::ALL.into_iter().zip(&INPUTS) {
        input.store(pins_of(BOARD.lines, port, lines), Ordering::Relaxed);
    }
    true
}

/// Ends QEMU with an exit code that reports the fault.
pub(crate) fn stop_for_good() -> ! {
    gpio::rest(&super::REST);
    semihosting::process::exit(EXIT_FAULT)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    static AGAIN: AtomicBool = AtomicBool::new(false);
    // If the log itself panicked, only the exit code reports it.
    if !AGAIN.swap(true, Ordering::Relaxed) {
        super::log_panic(info);
    }
    semihosting::process::exit(EXIT_PANIC)
}
