//! QEMU's `netduinoplus2`: the same chip without clocks, pins, flash timing or a debugger.
//!
//! Clock and pin registers read as zero there (on newer versions clocks are plain storage), so no clock is set
//! up and nothing is waited for. The log goes through semihosting to QEMU's standard output; a panic ends
//! QEMU with exit code 101.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use boards::Port;
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

/// The bare chip's table: registers of pins are not there, writes to them are lost, and they read as zero (no input is active).
pub(crate) const BOARD: &boards::Board = &boards::Board {
    id: "qemu-netduinoplus2",
    ..boards::STM32F405
};

/// QEMU feeds every timer with 1 GHz, whatever the clock registers say.
pub(crate) const TIMER_HZ: u32 = 1_000_000_000;

/// In lockstep a tick need not wait for the timer: each update of a timer is handed from one of QEMU's threads to another, which takes ten
/// times as long as the tick itself.
pub(crate) const TIME_IS_SIMULATED: bool = true;

/// QEMU's period is the reload value itself, not one more as on the chip.
pub(crate) const TIMER_RELOAD: u32 = TIMER_HZ / 1_000_000 * PERIOD_US;

/// What TIM1 would count, as on the chip: there is none.
pub(crate) const STEP_TIMER_HZ: u32 = 168_000_000;

/// QEMU has no baud rate; any value other than zero will do.
pub(crate) const SERIAL_DIVIDER: u16 = 91;

/// Exit code of QEMU after a panic: that of a panicking Rust program.
const EXIT_PANIC: i32 = 101;

/// Exit code of QEMU after a fault of the processor.
const EXIT_FAULT: i32 = 102;

/// Sorts out the peripherals.
pub(crate) fn init(device: pac::Peripherals) -> Board {
    Board {
        tim1: device.TIM1,
        tim2: device.TIM2,
        tim5: device.TIM5,
        dma2: device.DMA2,
        usart1: device.USART1,
        iwdg: device.IWDG,
        reset: take_reset_cause(&device.RCC),
    }
}

/// Stands for the input registers of the ports: what the host has set, and nothing before.
static INPUTS: [AtomicU32; Port::ALL.len()] = [const { AtomicU32::new(0) }; Port::ALL.len()];

/// The ports of which [`INPUTS`] are the inputs.
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

/// Ends QEMU, so that whoever waits for it learns of the fault.
pub(crate) fn stop_for_good() -> ! {
    gpio::rest(&super::REST);
    semihosting::process::exit(EXIT_FAULT)
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    static AGAIN: AtomicBool = AtomicBool::new(false);
    // The log itself may be what panicked; then the exit code has to do.
    if !AGAIN.swap(true, Ordering::Relaxed) {
        super::log_panic(info);
    }
    semihosting::process::exit(EXIT_PANIC)
}
