//! The spindle's speed output: a pulse-width signal of TIM12 (RM0090, 18.4), for a converter to 0 .. 10 V or a drive's own input.

use protocol::message::PWM_STEPS;
use stm32f4xx_hal::pac;

/// The duty cycle of the output, in steps of [`PWM_STEPS`]; the timer's next period has it.
pub(crate) fn set(steps: u32) {
    // SAFETY: TIM12 belongs to this module; `begin` has set it up. Any value may be written to `CCR2`.
    #[allow(unsafe_code, reason = "the tick has no peripherals of its own")]
    unsafe {
        (*pac::TIM12::ptr()).ccr2().write(|w| w.bits(steps));
    }
}

/// Sets up channel 2, with a duty cycle of 0. Its clock has to be on.
#[allow(unsafe_code, reason = "whole registers are written")]
pub(crate) fn begin(timer: &pac::TIM12) {
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
