//! Spindle and coolant: those of a job from the start of a run to its end, those of a command outside a run for as long as the host is heard.
//!
//! A start or resume on a free clock waits until the spindle is at speed, by time or by its contact; a contact that is silent for the whole time is a fault. Every end of a
//! run switches off: finished, stopped, aborted, a fault, the drives off. So does a run that is held because the host is gone, or while it is held; its resume switches on again and waits. A contact
//! that opens in a run for [`BELOW_TICKS`] pauses it.

use protocol::message::{AtSpeed, InputLines, PWM_STEPS, Reason, SpindleOrder, SpindleSettings, Turning};

/// Bits of [`crate::realtime::RealTime::outputs`]; the duty cycle in [`PWM_STEPS`] is in the upper half.
pub mod output {
    /// The drives are enabled.
    pub const DRIVES: u32 = 1;
    /// The spindle is enabled.
    pub const SPINDLE: u32 = 2;
    /// The spindle turns counterclockwise.
    pub const COUNTERCLOCKWISE: u32 = 4;
    /// Coolant.
    pub const COOLANT: u32 = 8;
    /// First of the bits of the axes whose drives are enabled by the level opposite to the one in the board's table.
    pub const ENABLE_INVERTED_SHIFT: u32 = 4;
    /// First of the bits of the axes whose step pulses are inverted likewise.
    pub const STEP_INVERTED_SHIFT: u32 = 7;
    /// First bit of the duty cycle.
    pub const DUTY_SHIFT: u32 = 16;
}

/// Ticks after switching on in which the contact is ignored, at 1 ms: a drive takes its time to withdraw the report of its last speed.
pub const SETTLE_TICKS: u32 = 100;

/// Ticks below its speed in a row that pause a run, at 1 ms: longer than a tooth's load.
pub const BELOW_TICKS: u32 = 100;

/// Whether a start or resume can go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Readiness {
    /// The spindle is at speed, or is not needed.
    AtSpeed,
    /// The spindle is not at speed yet.
    Waits,
    /// The spindle did not report its speed in time.
    TooSlow,
}

/// The state of spindle and coolant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spindle {
    settings: Option<SpindleSettings>,
    /// Spindle and coolant of the job's runs.
    order: SpindleOrder,
    /// The operator's coolant for the rest of the present run, in place of the job's.
    run_coolant: Option<bool>,
    /// As switched now.
    now: SpindleOrder,
    /// The outputs for `now`, as in [`output`].
    output: u32,
    /// A start or resume waits for the spindle.
    waits: bool,
    /// Periods that starts and resumes have waited since the spindle was switched on.
    waited: u32,
    /// Switched on by a command outside a run.
    is_commanded: bool,
    /// Ticks below its speed in a row.
    below: u32,
}

impl Spindle {
    pub(crate) const NEW: Self = Self {
        settings: None,
        order: SpindleOrder::OFF,
        run_coolant: None,
        now: SpindleOrder::OFF,
        output: 0,
        waits: false,
        waited: 0,
        is_commanded: false,
        below: 0,
    };

    pub(crate) const fn set_up(&mut self, settings: Option<SpindleSettings>) {
        self.settings = settings;
        self.clear();
    }

    /// Another job or profile: no spindle until it is ordered.
    pub(crate) const fn clear(&mut self) {
        self.order = SpindleOrder::OFF;
        self.end_run();
    }

    #[inline]
    pub(crate) const fn output(&self) -> u32 {
        self.output
    }

    /// As switched now.
    pub(crate) const fn now(&self) -> SpindleOrder {
        self.now
    }

    pub(crate) fn turns(&self) -> bool {
        self.now.turning != Turning::Off
    }

    /// The speed that a run wants, 1/min.
    pub(crate) const fn ordered_rpm(&self) -> u32 {
        self.order.rpm
    }

    /// A run, or a start that has waited, is over: off, and the next run has the job's coolant again.
    pub(crate) const fn end_run(&mut self) {
        self.run_coolant = None;
        self.off();
    }

    /// Switches off; a run that is held keeps its order for the resume.
    pub(crate) const fn off(&mut self) {
        self.now = SpindleOrder::OFF;
        self.output = 0;
        self.waits = false;
        self.is_commanded = false;
        self.below = 0;
    }

    /// Whether a start or resume waits for it.
    pub(crate) const fn is_awaited(&self) -> bool {
        self.waits
    }

    /// Nothing waits for it any more.
    pub(crate) const fn stop_waiting(&mut self) {
        self.waits = false;
    }

    /// Whether it is on by a command outside a run, and so for as long as the host is heard.
    pub(crate) const fn is_commanded(&self) -> bool {
        self.is_commanded
    }

    /// Whether it stops while the tool is lifted for a pause.
    pub(crate) fn stops_at_pause(&self) -> bool {
        self.settings.is_none_or(|settings| settings.stops_at_pause)
    }

    /// Whether the machine's spindle can do this.
    fn check(&self, order: SpindleOrder) -> Result<(), Reason> {
        if order == SpindleOrder::OFF {
            return Ok(());
        }
        let settings = self.settings.ok_or(Reason::NoSpindle)?;
        if order.rpm > settings.max_rpm {
            return Err(Reason::OutOfRange {
                most: settings.max_rpm,
                wanted: order.rpm,
            });
        }
        Ok(())
    }

    /// Takes the order for the next run.
    pub(crate) fn order(&mut self, order: SpindleOrder) -> Result<(), Reason> {
        self.check(order)?;
        self.order = order;
        Ok(())
    }

    /// Switches the spindle at once, outside a run.
    pub(crate) fn turn(&mut self, turning: Turning, rpm: u32) -> Result<(), Reason> {
        let turning = if rpm == 0 { Turning::Off } else { turning };
        let order = SpindleOrder {
            turning,
            rpm: if turning == Turning::Off { 0 } else { rpm },
            ..self.now
        };
        self.check(order)?;
        self.switch(order);
        self.is_commanded = order != SpindleOrder::OFF;
        Ok(())
    }

    /// Switches the coolant at once; in a run, or while its start waits, also for the rest of the run.
    pub(crate) fn coolant(&mut self, on: bool, is_in_run: bool) -> Result<(), Reason> {
        let order = SpindleOrder {
            coolant: on,
            ..self.now
        };
        self.check(order)?;
        self.switch(order);
        if is_in_run {
            self.run_coolant = Some(on);
        } else {
            self.is_commanded = order != SpindleOrder::OFF;
        }
        Ok(())
    }

    /// One period of a start or resume: switches on, and returns whether the spindle is at speed.
    #[cold]
    #[inline(never)]
    pub(crate) fn readiness(&mut self, lines: InputLines) -> Readiness {
        let at_speed = self
            .settings
            .map_or(AtSpeed::ByTime, |settings| settings.at_speed);
        if !self.waits {
            let order = SpindleOrder {
                coolant: self.run_coolant.unwrap_or(self.order.coolant),
                ..self.order
            };
            let is_on = self.now == order && !self.is_commanded;
            // By time, one that is on waits for the rest of the time, or is at speed.
            if !is_on || at_speed != AtSpeed::ByTime {
                self.waited = 0;
            }
            self.is_commanded = false;
            self.switch(order);
        }
        let needed = match (self.order.turning, self.settings) {
            (Turning::Off, _) | (_, None) => 0,
            (_, Some(settings)) => settings.at_speed_ticks,
        };
        self.waited = self.waited.saturating_add(1);
        let readiness = match at_speed {
            _ if self.order.turning == Turning::Off => Readiness::AtSpeed,
            AtSpeed::ByTime if self.waited >= needed => Readiness::AtSpeed,
            AtSpeed::ByTime => Readiness::Waits,
            _ if self.waited > SETTLE_TICKS && lines.has(InputLines::AT_SPEED) => Readiness::AtSpeed,
            _ if self.waited > SETTLE_TICKS.max(needed) => Readiness::TooSlow,
            _ => Readiness::Waits,
        };
        self.waits = readiness == Readiness::Waits;
        self.below = 0;
        readiness
    }

    /// One tick of a run: whether the spindle is below its speed, and now for too long. Without a contact it never is.
    pub(crate) fn is_below(&mut self, lines: InputLines) -> [bool; 2] {
        let has_contact = self
            .settings
            .is_some_and(|settings| settings.at_speed != AtSpeed::ByTime);
        let is_below = has_contact && self.turns() && !self.waits && !lines.has(InputLines::AT_SPEED);
        self.below = if is_below { self.below.saturating_add(1) } else { 0 };
        [is_below, self.below == BELOW_TICKS]
    }

    /// Switches the outputs.
    fn switch(&mut self, order: SpindleOrder) {
        self.now = order;
        let coolant = if order.coolant { output::COOLANT } else { 0 };
        let turning = match order.turning {
            Turning::Off => {
                self.output = coolant;
                return;
            }
            Turning::Clockwise => output::SPINDLE,
            Turning::Counterclockwise => output::SPINDLE | output::COUNTERCLOCKWISE,
        };
        let most = self.settings.map_or(1, |settings| settings.max_rpm).max(1);
        let duty = u64::from(order.rpm) * u64::from(PWM_STEPS) / u64::from(most);
        let duty = u32::try_from(duty).unwrap_or(PWM_STEPS).min(PWM_STEPS);
        self.output = coolant | turning | duty << output::DUTY_SHIFT;
    }
}
