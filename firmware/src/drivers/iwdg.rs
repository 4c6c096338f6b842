//! The registers of the independent watchdog.

use stm32f4xx_hal::pac;

use super::watchdog::{Register, Registers};

impl Registers for pac::IWDG {
    #[inline]
    #[allow(unsafe_code, reason = "whole registers are written")]
    fn write(&mut self, register: Register, value: u16) {
        match register {
            // SAFETY: any value may be written; others than the three keys do nothing (RM0090, 21.4.1).
            Register::Key => self.kr().write(|w| unsafe { w.bits(value) }),
            // SAFETY: three bits, each value of which is defined; the watchdog ignores the others.
            Register::Prescaler => self.pr().write(|w| unsafe { w.bits(value) }),
            // SAFETY: twelve bits, any of them; the watchdog ignores the others.
            Register::Reload => self.rlr().write(|w| unsafe { w.bits(value) }),
            // It can only be read.
            Register::Status => return,
        };
    }

    fn read(&mut self, register: Register) -> u16 {
        match register {
            // It can only be written.
            Register::Key => 0,
            Register::Prescaler => self.pr().read().bits(),
            Register::Reload => self.rlr().read().bits(),
            Register::Status => self.sr().read().bits(),
        }
    }
}
