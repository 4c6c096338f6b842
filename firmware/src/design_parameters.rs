//! The figures that the firmware is designed around, each with its reason; what they must satisfy is asserted
//! when it is built. What differs from board to board (clocks, reload values, dividers) is in
//! [`crate::board`].

use core::mem::size_of;

use crate::guarded_machine::BoardRealTime;
use controller::{
    machine::{Event, Events, Instruction},
    step_output::{Buffers, slot_counts},
};
use interp_core::job::{STORE_WORDS, SurfaceKind, patches_max};
use protocol::{frame::FRAME_MAX, message::SAMPLES_MAX};

use crate::{board, drivers::watchdog, sample_task::EventQueue};

/// Version that the host is told and the log begins with.
pub(crate) const FIRMWARE_VERSION: [u16; 3] = [
    version_part(env!("CARGO_PKG_VERSION_MAJOR")),
    version_part(env!("CARGO_PKG_VERSION_MINOR")),
    version_part(env!("CARGO_PKG_VERSION_PATCH")),
];

/// Sampling period, us. The paper's, and what servo drives take set points at.
pub(crate) const PERIOD_US: u32 = 1_000;

/// One period in counts of the reference clock (TIM5).
pub(crate) const PERIOD_COUNTS: u32 = board::TIMER_HZ / 1_000_000 * PERIOD_US;

/// The chip's fastest clock, Hz, which the figures in cycles are for.
const CORE_HZ: u32 = 168_000_000;

/// Cycles that a tick may take while the tool moves: a fifth of the period, half of it for the pulses. What `cargo sim budget` shows of the
/// worst tick is well below, so more is a defect; four fifths are left to the link.
pub(crate) const TICK_BUDGET_CYCLES: u32 = CORE_HZ / 1_000_000 * PERIOD_US / 5;

/// Clocks of TIM1 a slot of the step output: 168, a whole number.
pub(crate) const SLOT_COUNTS: u16 = match slot_counts(board::STEP_TIMER_HZ, PERIOD_US) {
    Some(counts) => counts,
    None => panic!("a slot has to be a whole number of clocks"),
};

/// Baud rate of the link: the first usual rate at which every sample of a run can be reported.
pub(crate) const SERIAL_BAUD: u32 = 921_600;

/// Periods without one that met its deadline after which the watchdog resets the chip, at least; 2.8 times as many at most,
/// as its clock is coarse. One late tick is a fault of the run, which stops along its path; it takes a processor that hangs to get here.
const WATCHDOG_PERIODS: u32 = 8;

/// The watchdog's reload value for that.
pub(crate) const WATCHDOG_RELOAD: u16 = watchdog::reload(WATCHDOG_PERIODS * PERIOD_US);

/// Words of surface data that fit: the core's own figure, 64 KiB of the chip's 128.
pub(crate) const JOB_WORDS: usize = STORE_WORDS;

/// Non-rational patches that have to fit at least.
const PATCHES_REQUIRED: usize = 200;

/// Bytes from the host that may wait. The host has one request under way and may repeat it once before the
/// answer reaches it; one more than is needed, because a queue's last place stays empty.
pub(crate) const RECEIVE_PLACES: usize = 1_024;

/// Commands that may wait for the next tick. The host waits for an answer to each request, and a tick takes
/// one: more than one waits only where answers come faster than ticks. A full queue is answered with "busy".
pub(crate) const COMMAND_PLACES: usize = 8;

/// Events that may wait for the link. While the link sends its longest frame, about four samples are made;
/// the rest is for requests that take longer to answer.
pub(crate) const EVENT_PLACES: usize = 64;

/// Periods after which samples that fill no frame are sent all the same: short to a person, long to a run.
pub(crate) const FLUSH_PERIODS: u32 = 32;

/// Periods between two looks at the state, for LED and log. Short to a person; the look costs the tick's time
/// a lock.
pub(crate) const LOOK_PERIODS: u32 = 64;

/// RAM of the chip, bytes; `memory.x` says so, too.
const RAM_BYTES: usize = 128 * 1024;

/// RAM that is kept for the stack, bytes. flip-link makes an overflow a fault.
const STACK_BYTES: usize = 16 * 1024;

const _: () = {
    // Time.
    assert!(
        board::TIMER_HZ.is_multiple_of(1_000_000),
        "a period has to be a whole number of counts"
    );
    assert!(board::TIMER_RELOAD == PERIOD_COUNTS || board::TIMER_RELOAD + 1 == PERIOD_COUNTS);
    // The reference clock wraps; a stall of up to a second has to be counted right.
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
        RECEIVE_PLACES + COMMAND_PLACES * size_of::<Instruction>() + EVENT_PLACES * size_of::<Event>();
    assert!(
        machine + queues + STACK_BYTES <= RAM_BYTES,
        "no room is left for the stack"
    );
};

/// A decimal number in text, as Cargo gives versions.
const fn version_part(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) => number,
        Err(_) => panic!("the package's version is made of numbers"),
    }
}
