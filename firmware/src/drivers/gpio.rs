//! Access to single pins of the board's table, which [`crate::board`] has set up directly after the reset.
//!
//! An output is switched by the port's set/reset register: one write, which changes no other pin, so that drivers with pins on
//! the same port are independent.

use core::{
    convert::Infallible,
    sync::atomic::{AtomicU32, Ordering},
};

use boards::{Pin, Port};
use embedded_hal::digital::{ErrorType, OutputPin};
use stm32f4xx_hal::pac;

use super::{drive_enable::WritePorts, safety_inputs::ReadPorts};

/// Distance of one port's registers from the next one's (RM0090, 2.3).
const PORT_BYTES: usize = 0x400;

/// The registers of a port. Ports A and B have types of their own in the `pac`, which differ in the values after reset only.
fn registers(port: Port) -> &'static pac::gpioi::RegisterBlock {
    let first = pac::GPIOA::ptr().cast::<u8>();
    // SAFETY: RM0090, 2.3: the ports A to H lie `PORT_BYTES` apart from GPIOA on, and all have the registers of 8.4.11; `Port`
    // names no other. The memory is that of the device, valid for 'static, and accessed through volatile cells.
    #[allow(unsafe_code, reason = "one type for all ports")]
    unsafe {
        &*first.add(port.index() * PORT_BYTES).cast()
    }
}

/// Pins of each port whose inactive level is the opposite of the table's, by the machine's profile.
static INVERTED: [AtomicU32; Port::ALL.len()] = [const { AtomicU32::new(0) }; Port::ALL.len()];

/// Makes every output inactive: drives, heaters and fans are off. `rest`: the words for the ports' set/reset registers
/// ([`boards::setup::rest`]); a port without an output may have no clock, and is not written.
pub(crate) fn rest(rest: &[u32; Port::ALL.len()]) {
    for ((port, bits), inverted) in Port::ALL.into_iter().zip(rest).zip(&INVERTED) {
        if *bits != 0 {
            let pins = inverted.load(Ordering::Relaxed) * 0x1_0001;
            let bits = bits & !pins | bits.rotate_left(16) & pins;
            // SAFETY: any bits may be written here; these are the table's outputs.
            #[allow(unsafe_code, reason = "a whole register is written")]
            registers(port).bsrr().write(|w| unsafe { w.bits(bits) });
        }
    }
}

/// All ports of the chip.
#[derive(Clone, Copy)]
pub(crate) struct Ports;

impl ReadPorts for Ports {
    #[inline]
    fn input(&self, port: Port) -> u32 {
        registers(port).idr().read().bits()
    }
}

impl WritePorts for Ports {
    fn set_reset(&mut self, port: Port, bits: u32) {
        // SAFETY: any bits may be written here; the caller's are its own pins'.
        #[allow(unsafe_code, reason = "a whole register is written")]
        registers(port).bsrr().write(|w| unsafe { w.bits(bits) });
    }

    fn invert(&mut self, pin: Pin, is_inverted: bool) {
        if let Some(inverted) = INVERTED.get(pin.port.index()) {
            let others = inverted.load(Ordering::Relaxed) & !pin.bit();
            inverted.store(
                if is_inverted { others | pin.bit() } else { others },
                Ordering::Relaxed,
            );
        }
    }

    fn duty(&mut self, steps: u32) {
        super::speed_output::set(steps);
    }
}

/// An output.
pub(crate) struct Output(Pin);

impl Output {
    /// The output on this pin, which has been set up.
    pub(crate) const fn new(pin: Pin) -> Self {
        Self(pin)
    }

    fn write(&mut self, bits: u32) {
        // SAFETY: any bits may be written here; these are this pin's.
        #[allow(unsafe_code, reason = "a whole register is written")]
        registers(self.0.port).bsrr().write(|w| unsafe { w.bits(bits) });
    }
}

impl ErrorType for Output {
    type Error = Infallible;
}

impl OutputPin for Output {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.write(self.0.bit() << 16);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.write(self.0.bit());
        Ok(())
    }
}
