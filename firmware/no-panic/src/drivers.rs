//! The firmware's drivers that the tasks are made of: the same files.
#![allow(dead_code, reason = "the time stamp is the log's, which is not here")]

#[path = "../../src/drivers/cycle_counter.rs"]
pub(crate) mod cycle_counter;
#[path = "../../src/drivers/drive_enable.rs"]
pub(crate) mod drive_enable;
#[path = "../../src/drivers/flash.rs"]
pub(crate) mod flash;
#[path = "../../src/drivers/gpio.rs"]
pub(crate) mod gpio;
#[path = "../../src/drivers/iwdg.rs"]
mod iwdg;
#[path = "../../src/drivers/safety_inputs.rs"]
pub(crate) mod safety_inputs;
#[path = "../../src/drivers/sample_timer.rs"]
pub(crate) mod sample_timer;
#[path = "../../src/drivers/speed_output.rs"]
pub(crate) mod speed_output;
#[path = "../../src/drivers/step_output.rs"]
pub(crate) mod step_output;
#[path = "../../src/drivers/supply.rs"]
pub(crate) mod supply;
#[path = "../../src/drivers/watchdog.rs"]
pub(crate) mod watchdog;
