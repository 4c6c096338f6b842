//! What touches the chip's registers, one file a device. They know no board and no feature.

pub(crate) mod cycle_counter;
mod hard_fault;
pub(crate) mod sample_timer;
pub(crate) mod serial;
pub(crate) mod status_led;
pub(crate) mod step_output;
