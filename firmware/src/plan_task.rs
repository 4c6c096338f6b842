//! The body of the planning task, without RTIC, so that it can be linked separately: `no-panic`
//! proves that no panic is reachable from this file and the functions that it calls.

use controller::realtime::RealTime;
use cortex_m::peripheral::NVIC;
use stm32f4xx_hal::pac::Interrupt;

/// The interrupt of the task: that of external line 0, which is not connected. The sample task pends it.
const INTERRUPT: Interrupt = Interrupt::EXTI0;

/// The sample timer's interrupt: pending while the task holds the machine, the next sample is due.
const SAMPLE: Interrupt = Interrupt::TIM2;

/// Starts the task after the sample task, if there is anything to plan.
#[inline]
pub(crate) fn pend<S: AsRef<[i32]> + AsMut<[i32]>>(real_time: &RealTime<S>) {
    if real_time.has_to_plan() {
        NVIC::pend(INTERRUPT);
    }
}

/// The planning of one period. To be called with the machine locked: the sample task cannot run before the end.
#[inline]
pub(crate) fn plan<S: AsRef<[i32]> + AsMut<[i32]>>(real_time: &mut RealTime<S>) {
    real_time.plan();
    if NVIC::is_pending(SAMPLE) {
        real_time.planning_was_late();
    }
}
