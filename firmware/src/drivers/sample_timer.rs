//! The sample timer: TIM2 says "one more period", TIM5 counts the periods that nobody heard.
//!
//! QEMU's timers have habits that this file respects, and the chip does not mind: a write to `CNT` or to
//! `EGR.UG` would lengthen every later period, a prescaler other than zero may hang, and counting begins with
//! the write of `ARR`. So none of the first three is done, and `ARR` comes last.

use core::sync::atomic::{AtomicU32, Ordering};

use stm32f4xx_hal::pac;

/// Periods since the start, for the log's time stamps. Wraps after 49 days.
static UPTIME_PERIODS: AtomicU32 = AtomicU32::new(0);

/// Periods since the start.
pub(crate) fn uptime_periods() -> u32 {
    UPTIME_PERIODS.load(Ordering::Relaxed)
}

/// Both timers and what is known of the last period.
pub(crate) struct SampleTimer {
    timer: pac::TIM2,
    clock: pac::TIM5,
    period_counts: u32,
    /// When the tick in work was due, in counts of the clock; unknown before the first.
    due: Option<u32>,
    /// The tick in work was started by an update of the timer; where time is simulated, a tick may be started without one.
    is_timed: bool,
}

impl SampleTimer {
    /// Starts both timers. `reload` is TIM2's auto-reload value for a period of `period_counts` counts of
    /// TIM5; both timers count alike.
    pub(crate) fn new(timer: pac::TIM2, clock: pac::TIM5, reload: u32, period_counts: u32) -> Self {
        clock.cr1().write(|w| w.cen().set_bit());
        clock.arr().write(|w| w.arr().set(u32::MAX));
        timer.dier().write(|w| w.uie().set_bit());
        timer.cr1().write(|w| w.cen().set_bit());
        timer.arr().write(|w| w.arr().set(reload));
        Self {
            timer,
            clock,
            period_counts,
            due: None,
            is_timed: true,
        }
    }

    /// At the beginning of a tick: takes the interrupt's flag back.
    pub(crate) fn begin(&mut self) {
        self.is_timed = self.timer.sr().read().uif().bit_is_set();
        if !self.is_timed {
            return;
        }
        self.timer.sr().write(|w| w.uif().clear_bit());
        UPTIME_PERIODS.store(uptime_periods().wrapping_add(1), Ordering::Relaxed);
        if self.due.is_none() {
            self.due = Some(self.clock.cnt().read().cnt().bits());
        }
    }

    /// At the end of a tick: how many further periods have begun since this one was due. 0 as long as every
    /// tick is over before the next; every one counted has missed its deadline.
    #[inline]
    pub(crate) fn end(&mut self) -> u32 {
        if !self.is_timed {
            return 0;
        }
        let now = self.clock.cnt().read().cnt().bits();
        let due = self.due.unwrap_or(now);
        let late = now.wrapping_sub(due);
        // The flag is the last word on whether a period has begun; the clock can only say how many.
        let pending = self.timer.sr().read().uif().bit_is_set();
        self.due = Some(due.wrapping_add(self.period_counts));
        if late < self.period_counts && !pending {
            return 0;
        }
        self.missed(due, late)
    }

    /// Counts the periods that have begun, one at least.
    #[cold]
    #[inline(never)]
    fn missed(&mut self, due: u32, late: u32) -> u32 {
        // The period is no zero; checked, so that no panic is there to be proved unreachable.
        let missed = late.checked_div(self.period_counts).unwrap_or(0).max(1);
        // One interrupt is pending however many periods have begun: the next tick stands for the latest of
        // them.
        self.due = Some(due.wrapping_add(missed.wrapping_mul(self.period_counts)));
        missed
    }
}
