//! A board with an STM32F405 or F407 at 168 MHz: an 8 MHz crystal, an LED, USART1 on PA9 (TX) and PA10 (RX).
//!
//! The pins are those of the Olimex STM32-H405. The log goes to the debug probe (RTT), and so does a panic.
//! An STM32F4DISCOVERY runs it too, with its LED elsewhere (PD12) and the capacitor on PA9 removed.

use controller::step_output::{Pin, Port, Wiring};
use defmt_rtt as _;
use interp_core::StepConfig;
use stm32f4xx_hal::{
    gpio::{Output, PC12},
    pac,
    prelude::*,
    rcc::{self, Enable},
};

use super::Board;
use crate::design_parameters::{PERIOD_US, SERIAL_BAUD};

/// Name of the board.
pub(crate) const NAME: &str = "stm32f405";

/// The crystal, MHz.
const CRYSTAL_MHZ: u32 = 8;

/// The processor's clock, MHz: the most that the chip is made for.
const CORE_MHZ: u32 = 168;

/// APB1, MHz: a quarter of the core clock, its limit being 42 MHz.
const APB1_MHZ: u32 = CORE_MHZ / 4;

/// APB2, MHz: half the core clock, its limit being 84 MHz.
const APB2_MHZ: u32 = CORE_MHZ / 2;

/// Timers on a divided APB1 count at twice its clock (RM0090, 7.2).
pub(crate) const TIMER_HZ: u32 = 2 * APB1_MHZ * 1_000_000;

/// Timers on a divided APB2, TIM1 among them, count at twice its clock.
pub(crate) const STEP_TIMER_HZ: u32 = 2 * APB2_MHZ * 1_000_000;

/// Step and direction pins.
pub(crate) const WIRING: Wiring = Wiring {
    step_port: Port::B,
    step: [12, 13, 14],
    direction: [Pin(Port::C, 6), Pin(Port::C, 7), Pin(Port::C, 8)],
};

/// What the drives want until a host says otherwise.
pub(crate) const STEPS: StepConfig = StepConfig::DEFAULT;

/// The timer counts from 0 to the reload value inclusive.
pub(crate) const TIMER_RELOAD: u32 = TIMER_HZ / 1_000_000 * PERIOD_US - 1;

/// USART1 hangs on APB2; 16 samples a bit make the divider the plain quotient, here rounded.
pub(crate) const SERIAL_DIVIDER: u16 = {
    let apb2_hz = APB2_MHZ * 1_000_000;
    let divider = (apb2_hz + SERIAL_BAUD / 2) / SERIAL_BAUD;
    // Both ends together may differ by about 3 % before the stop bit is missed; a third of it is ours.
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

/// The LED. It shines when the pin is low.
pub(crate) type StatusPin = PC12<Output>;

/// Sets up clocks and pins. Waits for crystal and PLL: without a crystal the board stays here.
pub(crate) fn init(device: pac::Peripherals) -> Board {
    let mut rcc = device.RCC.freeze(
        rcc::Config::hse(CRYSTAL_MHZ.MHz())
            .sysclk(CORE_MHZ.MHz())
            .hclk(CORE_MHZ.MHz())
            .pclk1(APB1_MHZ.MHz())
            .pclk2(APB2_MHZ.MHz()),
    );
    // The constants above are what the timers and the link rely on.
    defmt::assert_eq!(rcc.clocks.sysclk().raw(), CORE_MHZ * 1_000_000);
    defmt::assert_eq!(rcc.clocks.timclk1().raw(), TIMER_HZ);
    defmt::assert_eq!(rcc.clocks.timclk2().raw(), STEP_TIMER_HZ);
    defmt::assert_eq!(rcc.clocks.pclk2().raw(), APB2_MHZ * 1_000_000);

    let gpioa = device.GPIOA.split(&mut rcc);
    let _tx = gpioa.pa9.into_alternate::<7>();
    // The pull-up keeps an open line quiet.
    let _rx = gpioa.pa10.into_alternate::<7>().internal_pull_up(true);
    let gpioc = device.GPIOC.split(&mut rcc);
    let status_pin = gpioc
        .pc12
        .into_push_pull_output_in_state(stm32f4xx_hal::gpio::PinState::High);

    pac::TIM2::enable(&mut rcc);
    pac::TIM5::enable(&mut rcc);
    pac::USART1::enable(&mut rcc);
    // The probe reads the log while the processor sleeps.
    device.DBGMCU.cr().modify(|_, w| w.dbg_sleep().set_bit());
    // Halted by a debugger, all timers stand still, so that a breakpoint is not a missed period, and no pulse goes out.
    device
        .DBGMCU
        .apb1_fz()
        .modify(|_, w| w.dbg_tim2_stop().set_bit().dbg_tim5_stop().set_bit());
    device.DBGMCU.apb2_fz().modify(|_, w| w.dbg_tim1_stop().set_bit());

    Board {
        tim1: device.TIM1,
        tim2: device.TIM2,
        tim5: device.TIM5,
        dma2: device.DMA2,
        usart1: device.USART1,
        status_pin,
    }
}

/// Stays here. Nothing moves any more, and a debugger finds everything as it was.
pub(crate) fn stop_for_good() -> ! {
    loop {
        cortex_m::asm::nop();
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    // Nothing is to move meanwhile, nor to panic in between.
    cortex_m::interrupt::disable();
    super::log_panic(info);
    stop_for_good()
}
