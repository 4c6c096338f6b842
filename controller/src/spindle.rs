//! Spindle and coolant: on from the start of a run to its end, and at no other time.
//!
//! A start or resume on a free clock waits until the spindle is at speed. Every end of a run switches off: finished, stopped, aborted, a fault, the drives off. So does
//! a run that is held because the host is gone; its resume switches on again and waits.

use protocol::message::{PWM_STEPS, Reason, SpindleOrder, SpindleSettings, Turning};

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

/// The state of spindle and coolant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spindle {
    settings: Option<SpindleSettings>,
    order: SpindleOrder,
    /// The outputs, as in [`output`]; 0: all off.
    output: u32,
    /// Periods left until it is at speed.
    waits: u32,
}

impl Spindle {
    pub(crate) const NEW: Self = Self {
        settings: None,
        order: SpindleOrder::OFF,
        output: 0,
        waits: 0,
    };

    pub(crate) const fn set_up(&mut self, settings: Option<SpindleSettings>) {
        self.settings = settings;
        self.clear();
    }

    /// The next run has none.
    pub(crate) const fn clear(&mut self) {
        self.order = SpindleOrder::OFF;
        self.off();
    }

    #[inline]
    pub(crate) const fn output(&self) -> u32 {
        self.output
    }

    pub(crate) const fn off(&mut self) {
        self.output = 0;
        self.waits = 0;
    }

    /// Whether it stands while the tool is lifted for a pause.
    pub(crate) fn stops_at_pause(&self) -> bool {
        self.settings.is_none_or(|settings| settings.stops_at_pause)
    }

    /// Takes the order for the next run.
    pub(crate) fn order(&mut self, order: SpindleOrder) -> Result<(), Reason> {
        if order != SpindleOrder::OFF {
            let settings = self.settings.ok_or(Reason::NoSpindle)?;
            if order.rpm > settings.max_rpm {
                return Err(Reason::OutOfRange {
                    most: settings.max_rpm,
                    wanted: order.rpm,
                });
            }
        }
        self.order = order;
        Ok(())
    }

    /// One period of a start that waits: switches on, and returns whether the spindle is at speed.
    #[cold]
    #[inline(never)]
    pub(crate) fn is_ready(&mut self) -> bool {
        let wanted = self.wanted();
        if self.output != wanted {
            self.output = wanted;
            self.waits = match (self.order.turning, self.settings) {
                (Turning::Off, _) | (_, None) => 0,
                (_, Some(settings)) => settings.at_speed_ticks,
            };
        }
        self.waits = self.waits.saturating_sub(1);
        self.waits == 0
    }

    fn wanted(&self) -> u32 {
        let coolant = if self.order.coolant { output::COOLANT } else { 0 };
        let turning = match self.order.turning {
            Turning::Off => return coolant,
            Turning::Clockwise => output::SPINDLE,
            Turning::Counterclockwise => output::SPINDLE | output::COUNTERCLOCKWISE,
        };
        let most = self.settings.map_or(1, |settings| settings.max_rpm).max(1);
        let duty = u64::from(self.order.rpm) * u64::from(PWM_STEPS) / u64::from(most);
        let duty = u32::try_from(duty).unwrap_or(PWM_STEPS).min(PWM_STEPS);
        coolant | turning | duty << output::DUTY_SHIFT
    }
}
