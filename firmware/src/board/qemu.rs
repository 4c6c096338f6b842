//! QEMU's `netduinoplus2`: the same chip without clocks, pins, flash timing or a debugger.
//!
//! Clock and pin registers read as zero there (on newer versions they are plain storage), so nothing is set
//! up and nothing is waited for. The log goes through semihosting to QEMU's standard output; a panic ends
//! QEMU with exit code 101.

use core::{
    convert::Infallible,
    sync::atomic::{AtomicBool, Ordering},
};

use controller::step_output::{Pin, Port, Wiring};
use embedded_hal::digital::{ErrorType, OutputPin};
use interp_core::StepConfig;
use stm32f4xx_hal::pac;

use super::Board;
use crate::design_parameters::PERIOD_US;

// The log: this crate is linked for its `defmt` logger.
use defmt_semihosting as _;

/// Name of the board.
pub(crate) const NAME: &str = "qemu-netduinoplus2";

/// QEMU feeds every timer with 1 GHz, whatever the clock registers say.
pub(crate) const TIMER_HZ: u32 = 1_000_000_000;

/// QEMU's period is the reload value itself, not one more as on the chip.
pub(crate) const TIMER_RELOAD: u32 = TIMER_HZ / 1_000_000 * PERIOD_US;

/// What TIM1 would count, as on the chip: there is none.
pub(crate) const STEP_TIMER_HZ: u32 = 168_000_000;

/// Step and direction pins, as on the chip: there are none.
pub(crate) const WIRING: Wiring = Wiring {
    step_port: Port::B,
    step: [12, 13, 14],
    direction: [Pin(Port::C, 6), Pin(Port::C, 7), Pin(Port::C, 8)],
};

/// What the drives want until a host says otherwise.
pub(crate) const STEPS: StepConfig = StepConfig::DEFAULT;

/// QEMU has no baud rate; any value other than zero will do.
pub(crate) const SERIAL_DIVIDER: u16 = 91;

/// Exit code of QEMU after a panic: that of a panicking Rust program.
const EXIT_PANIC: i32 = 101;

/// Exit code of QEMU after a fault of the processor.
const EXIT_FAULT: i32 = 102;

/// There is no LED.
pub(crate) struct StatusPin;

impl ErrorType for StatusPin {
    type Error = Infallible;
}

impl OutputPin for StatusPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Sorts out the peripherals; there is nothing to set up.
pub(crate) fn init(device: pac::Peripherals) -> Board {
    Board {
        tim1: device.TIM1,
        tim2: device.TIM2,
        tim5: device.TIM5,
        dma2: device.DMA2,
        usart1: device.USART1,
        status_pin: StatusPin,
    }
}

/// Ends QEMU, so that whoever waits for it learns of the fault.
pub(crate) fn stop_for_good() -> ! {
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
