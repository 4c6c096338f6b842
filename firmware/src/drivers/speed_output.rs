//! The spindle's speed output: a pulse-width signal of TIM12 (RM0090, 18.4), for a converter to 0 .. 10 V or a drive's own input.

use stm32f4xx_hal::pac;

/// Sets the duty cycle of the output, in steps of [`protocol::message::PWM_STEPS`], from the timer's next period on.
pub(crate) fn set(steps: u32) {
    // SAFETY: TIM12 belongs to this module; the board's set-up has started it. Any value may be written to `CCR2`.
    #[allow(unsafe_code, reason = "the tick has no peripherals of its own")]
    unsafe {
        (*pac::TIM12::ptr()).ccr2().write(|w| w.bits(steps));
    }
}
