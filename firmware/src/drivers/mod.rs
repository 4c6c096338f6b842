//! Drivers of the chip's peripherals, one file each, independent of board and features.

pub(crate) mod cycle_counter;
pub(crate) mod drive_enable;
#[cfg(not(feature = "board-qemu"))]
pub(crate) mod flash;
pub(crate) mod gpio;
mod hard_fault;
mod iwdg;
pub(crate) mod reset_cause;
pub(crate) mod safety_inputs;
pub(crate) mod sample_timer;
pub(crate) mod serial;
pub(crate) mod speed_output;
pub(crate) mod status_led;
pub(crate) mod step_output;
pub(crate) mod supply;
pub(crate) mod watchdog;
