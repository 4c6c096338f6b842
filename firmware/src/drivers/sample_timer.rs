//! The sample timer: TIM2 triggers one tick per period, TIM5 counts missed periods.
//!
//! Restrictions of QEMU's timers, which do not affect the chip: a write to `CNT` or to
//! `EGR.UG` would lengthen every later period, a prescaler other than zero may hang, and counting begins with
//! the write of `ARR`. So this driver does none of the first three, and writes `ARR` last.

use core::sync::atomic::{AtomicU32, Ordering};

use stm32f4xx_hal::pac;

/// Periods since the start, for the log's time stamps. Wraps after 49 days.
static UPTIME_PERIODS: AtomicU32 = AtomicU32::new(0);

/// Periods since the start.
pub(crate) fn uptime_periods() -> u32 {
    UPTIME_PERIODS.load(Ordering::Relaxed)
}

/// Whether a count of the clock is `now` or earlier: by less than half of its range.
const fn is_past(count: u32, now: u32) -> bool {
    now.wrapping_sub(count) <= u32::MAX / 2
}

/// Both timers and the timing of the last period.
pub(crate) struct SampleTimer {
    timer: pac::TIM2,
    clock: pac::TIM5,
    period_counts: u32,
    /// Due time of the current tick, in counts of the clock; unknown before the first.
    due: Option<u32>,
    /// Whether an update of the timer started the current tick; where time is simulated, a tick may be started without one.
    is_timed: bool,
}

impl SampleTimer {
    /// Starts both timers. `reload` is TIM2's auto-reload value for a period of `period_counts` counts of
    /// TIM5; both timers count at the same rate.
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

    /// At the beginning of a tick: clears the interrupt flag.
    pub(crate) fn begin(&mut self) {
        let was_timed = self.is_timed;
        self.is_timed = self.timer.sr().read().uif().bit_is_set();
        self.timer.sr().write(|w| w.uif().clear_bit());
        UPTIME_PERIODS.store(uptime_periods().wrapping_add(1), Ordering::Relaxed);
        if !self.is_timed {
            // Not due at any time, so that no deadline is missed.
            self.due = None;
        } else if !was_timed || self.due.is_none() {
            self.due = Some(self.clock.cnt().read().cnt().bits());
        }
    }

    /// At the end of a tick: the number of further periods that have begun since this one was due. 0 as long as every
    /// tick ends before the next; each counted period has missed its deadline.
    #[inline]
    pub(crate) fn end(&mut self) -> u32 {
        let now = self.clock.cnt().read().cnt().bits();
        // A due time that lies ahead comes from a tick that was itself served late: this tick was due by now.
        let due = self.due.filter(|due| is_past(*due, now)).unwrap_or(now);
        let late = now.wrapping_sub(due);
        // The flag decides whether a period has begun; the clock yields the number of periods.
        let pending = self.timer.sr().read().uif().bit_is_set();
        self.due = Some(due.wrapping_add(self.period_counts));
        if late < self.period_counts && !(pending && self.is_timed) {
            return 0;
        }
        self.missed(due, late)
    }

    /// Counts the periods that have begun, one at least.
    #[cold]
    #[inline(never)]
    fn missed(&mut self, due: u32, late: u32) -> u32 {
        // The period is never zero; checked, so that the division has no panic branch.
        let missed = late.checked_div(self.period_counts).unwrap_or(0).max(1);
        // One interrupt is pending however many periods have begun: the next tick is that of the latest of
        // them.
        self.due = Some(due.wrapping_add(missed.wrapping_mul(self.period_counts)));
        missed
    }
}
