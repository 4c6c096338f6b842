//! The peripherals of the chip, one file each.

pub(crate) mod debug;
pub(crate) mod dma;
pub(crate) mod flash;
pub(crate) mod gpio;
pub(crate) mod nvic;
pub(crate) mod pwm;
pub(crate) mod rcc;
pub(crate) mod supply;
pub(crate) mod timer;
pub(crate) mod usart;
pub(crate) mod watchdog;
