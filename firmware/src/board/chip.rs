//! Code common to all boards with an STM32F405 or F407: clocks at 168 MHz from the crystal, USART1, the log through the debug probe (RTT), and
//! the panic handler.

use defmt_rtt as _;
use protocol::message::{InputLines, PWM_STEPS};
use stm32f4xx_hal::{
    pac,
    prelude::*,
    rcc::{self, Enable},
};

use super::{BOARD, Board, take_reset_cause};
use crate::{
    design_parameters::{PERIOD_US, SERIAL_BAUD},
    drivers::{flash::sectors, gpio},
};

/// The processor's clock, MHz: the chip's maximum.
const CORE_MHZ: u32 = 168;

/// APB1, MHz: a quarter of the core clock, its limit being 42 MHz.
const APB1_MHZ: u32 = CORE_MHZ / 4;

/// APB2, MHz: half the core clock, its limit being 84 MHz.
const APB2_MHZ: u32 = CORE_MHZ / 2;

/// Timers on a divided APB1 count at twice its clock (RM0090, 7.2).
pub(crate) const TIMER_HZ: u32 = 2 * APB1_MHZ * 1_000_000;

/// Timers on a divided APB2, TIM1 among them, count at twice its clock.
pub(crate) const STEP_TIMER_HZ: u32 = 2 * APB2_MHZ * 1_000_000;

/// Ticks are triggered only by the timer.
pub(crate) const TIME_IS_SIMULATED: bool = false;

/// The timer counts from 0 to the reload value inclusive.
pub(crate) const TIMER_RELOAD: u32 = TIMER_HZ / 1_000_000 * PERIOD_US - 1;

/// USART1 is on APB2; with 16 samples per bit the divider is the quotient, rounded.
pub(crate) const SERIAL_DIVIDER: u16 = {
    let apb2_hz = APB2_MHZ * 1_000_000;
    let divider = (apb2_hz + SERIAL_BAUD / 2) / SERIAL_BAUD;
    // Both ends together may differ by about 3 % before the stop bit is missed; a third of it is the limit for this end.
    let real_baud = apb2_hz / divider;
    assert!(
        real_baud.abs_diff(SERIAL_BAUD) < SERIAL_BAUD / 100,
        "the baud rate cannot be met"
    );
    assert!(
        divider >= 16 && divider <= u16::MAX as u32,
        "the baud rate is out of USART1's range"
    );
    divider as u16
};

/// Sets up the clocks; the pins are at rest since the reset. Waits for crystal and PLL; without a crystal this does not return.
pub(crate) fn init(device: pac::Peripherals) -> Board {
    let reset = take_reset_cause(&device.RCC);
    let mut rcc = device.RCC.freeze(
        rcc::Config::hse(BOARD.crystal_mhz.MHz())
            .sysclk(CORE_MHZ.MHz())
            .hclk(CORE_MHZ.MHz())
            .pclk1(APB1_MHZ.MHz())
            .pclk2(APB2_MHZ.MHz()),
    );
    // Timers and link depend on the constants above.
    defmt::assert_eq!(rcc.clocks.sysclk().raw(), CORE_MHZ * 1_000_000);
    defmt::assert_eq!(rcc.clocks.timclk1().raw(), TIMER_HZ);
    defmt::assert_eq!(rcc.clocks.pclk2().raw(), APB2_MHZ * 1_000_000);

    pac::TIM2::enable(&mut rcc);
    pac::TIM5::enable(&mut rcc);
    pac::TIM12::enable(&mut rcc);
    pac::USART1::enable(&mut rcc);
    // Keeps the clocks on in sleep, so that the probe can read the log.
    device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    // Halted by a debugger, timers and watchdog stand still, so that a breakpoint is neither a missed period nor a reset.
    device.DBGMCU.apb1_fz().modify(|_, w| {
        w.dbg_tim2_stop()
            .set_bit()
            .dbg_tim5_stop()
            .set_bit()
            .dbg_iwdg_stop()
            .set_bit()
    });

    device.DBGMCU.apb2_fz().modify(|_, w| w.dbg_tim1_stop().set_bit());

    begin_speed_output(&device.TIM12);
    pac::PWR::enable(&mut rcc);
    watch_supply(&device.PWR, &device.EXTI);
    let (settings, jobs, falling) = sectors(device.FLASH);

    Board {
        tim1: device.TIM1,
        tim2: device.TIM2,
        tim5: device.TIM5,
        dma2: device.DMA2,
        usart1: device.USART1,
        iwdg: device.IWDG,
        settings,
        jobs,
        falling,
        reset,
    }
}

/// Settings, journal and jobs are kept in the chip's flash.
pub(crate) use crate::drivers::flash::{FallingFlash, JobFlash, SettingsFlash};
pub(crate) const HAS_JOURNAL: bool = true;
/// The safety inputs are pins.
pub(crate) use crate::drivers::gpio::Ports as InputPorts;

/// Line of the voltage detector in EXTI.
const PVD_LINE: u32 = 1 << 16;
/// Output of the voltage detector in `PWR_CSR`: the supply is below its level.
const PVDO: u32 = 1 << 2;

/// Has the voltage detector interrupt at 2.9 V, its highest level, falling and rising.
#[allow(unsafe_code, reason = "whole registers are written")]
fn watch_supply(power: &pac::PWR, lines: &pac::EXTI) {
    const PVDE: u32 = 1 << 4;
    const PLS: u32 = 0b111 << 5;
    // SAFETY: values of the reference manual (5.4.1, 12.3).
    unsafe {
        power.cr().modify(|r, w| w.bits(r.bits() | PVDE | PLS));
        lines.rtsr().modify(|r, w| w.bits(r.bits() | PVD_LINE));
        lines.ftsr().modify(|r, w| w.bits(r.bits() | PVD_LINE));
        lines.imr().modify(|r, w| w.bits(r.bits() | PVD_LINE));
    }
}

/// Takes the detector's interrupt back; whether the voltage is low.
#[allow(unsafe_code, reason = "registers are read by their address")]
pub(crate) fn supply_is_low() -> bool {
    // SAFETY: nothing else uses this line, or writes these registers after the start.
    unsafe {
        (*pac::EXTI::ptr()).pr().write(|w| w.bits(PVD_LINE));
        (*pac::PWR::ptr()).csr().read().bits() & PVDO != 0
    }
}

/// This board has pins of its own.
pub(crate) fn simulate(_lines: InputLines) -> bool {
    false
}

/// Loops forever with every output inactive; pulses still output by DMA have no effect, because the drives are off. The watchdog is no longer fed
/// and resets the chip after some periods; the log then reports the cause.
pub(crate) fn stop_for_good() -> ! {
    gpio::rest(&super::REST);
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    // No motion and no further panic in the meantime.
    cortex_m::interrupt::disable();
    gpio::rest(&super::REST);
    super::log_panic(info);
    stop_for_good()
}

/// Sets up channel 2 of the spindle's speed output with a duty cycle of 0. Its clock has to be on.
#[allow(unsafe_code, reason = "whole registers are written")]
fn begin_speed_output(timer: &pac::TIM12) {
    // SAFETY: values of the reference manual: reload, PWM mode 1 with preload on channel 2, its output, start with preloaded reload.
    unsafe {
        timer.arr().write(|w| w.bits(PWM_STEPS - 1));
        timer.ccr2().write(|w| w.bits(0));
        timer.ccmr1_output().write(|w| w.bits(0b110 << 12 | 1 << 11));
        timer.ccer().write(|w| w.bits(1 << 4));
        timer.egr().write(|w| w.bits(1));
        timer.cr1().write(|w| w.bits(1 << 7 | 1));
    }
}
