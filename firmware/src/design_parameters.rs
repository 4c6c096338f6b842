//! The design parameters of the firmware, each with its reason; their constraints are asserted
//! at compile time. Board-specific values (clocks, reload values, dividers) are in
//! [`crate::board`].

use core::mem::size_of;

use crate::guarded_machine::BoardRealTime;
use controller::{
    machine::{Events, Instruction},
    step_output::{Buffers, slot_counts},
};
use interp_core::job::{STORE_WORDS, SurfaceKind, patches_max};
use protocol::{frame::FRAME_MAX, message::SAMPLES_MAX};

use crate::{
    board,
    drivers::watchdog,
    events::{EventMemory, EventQueue},
};

/// Version reported to the host and in the first line of the log.
pub(crate) const FIRMWARE_VERSION: [u16; 3] = [
    version_part(env!("CARGO_PKG_VERSION_MAJOR")),
    version_part(env!("CARGO_PKG_VERSION_MINOR")),
    version_part(env!("CARGO_PKG_VERSION_PATCH")),
];

/// Sampling period, us: a common set-point period of servo drives.
pub(crate) const PERIOD_US: u32 = 1_000;

/// One period in counts of the reference clock (TIM5).
pub(crate) const PERIOD_COUNTS: u32 = board::TIMER_HZ / 1_000_000 * PERIOD_US;

/// The chip's fastest clock, Hz, for which figures in cycles are given.
const CORE_HZ: u32 = 168_000_000;

/// Cycle budget of a tick while the tool moves: a fifth of the period, half of it for the pulses. The worst-case tick of `cargo sim budget`
/// is well below, so exceeding the budget is a defect; four fifths of the period are left for the link.
pub(crate) const TICK_BUDGET_CYCLES: u32 = CORE_HZ / 1_000_000 * PERIOD_US / 5;

/// TIM1 counts per slot of the step output: 168, an integer.
pub(crate) const SLOT_COUNTS: u16 = match slot_counts(board::STEP_TIMER_HZ, PERIOD_US) {
    Some(counts) => counts,
    None => panic!("a slot has to be a whole number of clocks"),
};

/// Baud rate of the link: the lowest standard rate at which every sample of a run can be reported.
pub(crate) const SERIAL_BAUD: u32 = 921_600;

/// Periods without one that met its deadline after which the watchdog resets the chip, at least; at most 2.8 times as many,
/// because of the tolerance of its clock. One late tick is a fault of the run, which stops along its path; the watchdog resets only a processor that hangs.
const WATCHDOG_PERIODS: u32 = 8;

/// The watchdog's reload value for that.
pub(crate) const WATCHDOG_RELOAD: u16 = watchdog::reload(WATCHDOG_PERIODS * PERIOD_US);

/// Capacity for surface data, words: that of the core, 64 KiB of the chip's 128.
pub(crate) const JOB_WORDS: usize = STORE_WORDS;

/// Minimum capacity in non-rational patches.
const PATCHES_REQUIRED: usize = 200;

/// Capacity of the receive queue, bytes. The host has one request outstanding and may repeat it once before the
/// answer arrives; plus one, because one slot of a queue stays empty.
pub(crate) const RECEIVE_PLACES: usize = 1_024;

/// Capacity of the command queue. The host waits for an answer to each request, and a tick takes
/// one: more than one is queued only where answers are faster than ticks. A full queue is answered with "busy".
pub(crate) const COMMAND_PLACES: usize = 8;

/// Capacity of the event queue. While the link sends its longest frame, about four samples are produced;
/// the remaining capacity is for requests that take longer to answer.
pub(crate) const EVENT_PLACES: usize = 32;

/// Periods after which an incomplete frame of samples is sent: short for an operator, long for a run.
pub(crate) const FLUSH_PERIODS: u32 = 32;

/// Periods between two reads of the state for LED and log. Short for an operator; each read takes
/// a lock against the tick.
pub(crate) const LOOK_PERIODS: u32 = 64;

/// RAM of the chip, bytes, as in `memory.x`.
const RAM_BYTES: usize = 128 * 1024;

/// RAM reserved for the stack, bytes: more than the deepest stack found in the images (15 292 bytes; `tests/cycles.rs` holds it below the room
/// that is left). With flip-link an overflow is a fault.
const STACK_BYTES: usize = 15_360;

const _: () = {
    // Time.
    assert!(
        board::TIMER_HZ.is_multiple_of(1_000_000),
        "a period has to be a whole number of counts"
    );
    assert!(board::TIMER_RELOAD == PERIOD_COUNTS || board::TIMER_RELOAD + 1 == PERIOD_COUNTS);
    // The reference clock wraps; a stall of up to 1 s has to be counted correctly.
    assert!(PERIOD_COUNTS <= u32::MAX / 1_000);

    // The link keeps up with a run that reports every sample: ten bits a byte, the longest frames.
    let line_bytes_s = SERIAL_BAUD as usize / 10;
    let run_bytes_s = FRAME_MAX * (1_000_000 / PERIOD_US as usize) / SAMPLES_MAX;
    assert!(
        run_bytes_s <= line_bytes_s,
        "the link is too slow for a run that reports every sample"
    );

    // Capacities.
    assert!(
        patches_max(SurfaceKind::Polynomial, JOB_WORDS) >= PATCHES_REQUIRED,
        "too few patches fit"
    );
    assert!(
        RECEIVE_PLACES > 2 * FRAME_MAX,
        "a request and its repetition have to fit"
    );
    let frame_periods = (FRAME_MAX * 10 * 1_000_000).div_ceil(SERIAL_BAUD as usize * PERIOD_US as usize);
    assert!(
        EVENT_PLACES > 2 * frame_periods * EventQueue::TICK_MAX,
        "events have to outlast a frame"
    );

    // Memory.
    let machine = size_of::<BoardRealTime>() + 4 * JOB_WORDS + size_of::<Buffers>();
    let queues =
        RECEIVE_PLACES + COMMAND_PLACES * size_of::<Instruction>() + size_of::<EventMemory<EVENT_PLACES>>();
    assert!(
        machine + queues + STACK_BYTES <= RAM_BYTES,
        "no room is left for the stack"
    );
};

/// Parses a decimal number of a Cargo version.
const fn version_part(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("the package's version is made of numbers"),
    }
}
