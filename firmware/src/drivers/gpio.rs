//! Pins by the board's table: set up together, then each written or read by itself.
//!
//! An output is switched by the port's set/reset register: one write, which touches no other pin, so that drivers with pins on
//! the same port need not know of each other.

use core::convert::Infallible;

use boards::{
    Line, Pin, Port,
    setup::{self, PortSetup},
};
use embedded_hal::digital::{ErrorType, OutputPin};
use stm32f4xx_hal::pac;

use super::{drive_enable::WritePorts, safety_inputs::ReadPorts};

/// Distance of one port's registers from the next one's (RM0090, 2.3).
const PORT_BYTES: usize = 0x400;

/// The registers of a port. Ports A and B have types of their own in the `pac`, which differ in the values after reset only.
fn registers(port: Port) -> &'static pac::gpioi::RegisterBlock {
    let first = pac::GPIOA::ptr().cast::<u8>();
    // SAFETY: RM0090, 2.3: the ports A to H lie `PORT_BYTES` apart from GPIOA on, and all have the registers of 8.4.11; `Port`
    // names no other. The memory is the device's, there for good, and of volatile cells.
    #[allow(unsafe_code, reason = "one type for all ports")]
    unsafe {
        &*first.add(port.index() * PORT_BYTES).cast()
    }
}

/// Sets up every pin of the table: outputs are inactive from the first moment on.
pub(crate) fn set_up(rcc: &pac::rcc::RegisterBlock, lines: &[Line]) {
    for (port, setup) in Port::ALL.into_iter().zip(setup::ports(lines)) {
        if setup.is_used() {
            set_up_port(rcc, port, &setup);
        }
    }
}

#[allow(unsafe_code, reason = "whole registers are written")]
fn set_up_port(rcc: &pac::rcc::RegisterBlock, port: Port, setup: &PortSetup) {
    let port_registers = registers(port);
    // SAFETY: sets the port's clock bit (RM0090, 7.3.10: bit 0 is port A's), and leaves the others.
    rcc.ahb1enr()
        .modify(|r, w| unsafe { w.bits(r.bits() | 1 << port.index()) });
    // The clock is there two cycles later (7.3.10); the read waits for that.
    let _ = rcc.ahb1enr().read();
    // SAFETY: any bits may be written here; zeros do nothing.
    port_registers
        .bsrr()
        .write(|w| unsafe { w.bits(setup.set_reset) });
    // SAFETY: fields of two bits, each value of which is defined; those of other pins stay.
    port_registers
        .ospeedr()
        .modify(|r, w| unsafe { w.bits(setup.speed.apply(r.bits())) });
    // SAFETY: likewise; 0b11, which is reserved, is not among the table's.
    port_registers
        .pupdr()
        .modify(|r, w| unsafe { w.bits(setup.pull.apply(r.bits())) });
    // SAFETY: fields of four bits, each value of which is defined.
    port_registers
        .afrl()
        .modify(|r, w| unsafe { w.bits(setup.alternate[0].apply(r.bits())) });
    // SAFETY: likewise.
    port_registers
        .afrh()
        .modify(|r, w| unsafe { w.bits(setup.alternate[1].apply(r.bits())) });
    // SAFETY: fields of two bits, each value of which is defined.
    port_registers
        .moder()
        .modify(|r, w| unsafe { w.bits(setup.mode.apply(r.bits())) });
}

/// Makes every output inactive: drives let go, heaters and fans are off.
pub(crate) fn rest(lines: &[Line]) {
    for (port, setup) in Port::ALL.into_iter().zip(setup::ports(lines)) {
        // SAFETY: any bits may be written here; these are the table's outputs.
        #[allow(unsafe_code, reason = "a whole register is written")]
        registers(port)
            .bsrr()
            .write(|w| unsafe { w.bits(setup.set_reset) });
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
