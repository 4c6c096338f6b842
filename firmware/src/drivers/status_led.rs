//! The status LED: off without a run, on while the tool moves, blinking after a fault. For any output pin of
//! `embedded-hal`.

use boards::Level;
use embedded_hal::digital::{OutputPin, PinState};
use interp_core::sample::State;

/// Half a blink, in periods, as a power of two: 256 ms at 1 ms.
const BLINK_BIT: u32 = 8;

/// The LED.
pub(crate) struct StatusLed<P> {
    pin: P,
    shines_at: Level,
    lit: bool,
}

impl<P: OutputPin> StatusLed<P> {
    /// The LED on this pin, initially off. It is lit when the pin has this level.
    pub(crate) fn new(pin: P, shines_at: Level) -> Self {
        let mut led = Self {
            pin,
            shines_at,
            lit: true,
        };
        led.set(false);
        led
    }

    /// Shows this state; `periods` is the time in periods, for the blinking.
    pub(crate) fn show(&mut self, state: State, periods: u32) {
        self.set(match state {
            State::Idle | State::Ready | State::Held | State::Finished => false,
            State::Running | State::Linking | State::Holding | State::Stopping => true,
            State::Faulted => (periods >> BLINK_BIT) & 1 == 0,
        });
    }

    fn set(&mut self, lit: bool) {
        if lit != self.lit {
            self.lit = lit;
            let high = lit == (self.shines_at == Level::High);
            // A failure of the status LED is ignored.
            let _ = self.pin.set_state(PinState::from(high));
        }
    }
}
