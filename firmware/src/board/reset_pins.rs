//! Pins at rest right after a reset, before memory is initialised: drives, heaters and fans are off some 30 us after the chip begins to run, on
//! its 16 MHz. (Initialising 64 KiB of memory alone takes milliseconds.) Until then, and in the reset itself, pins float: a drive's enable line
//! wants a pull resistor of its own.
//!
//! No Rust code may run before memory is initialised. So this is assembly, in registers alone, and works off a table in flash, computed when
//! the image is built and tested in `boards`.

use boards::setup::{Write, writes, writes_count};

use super::BOARD;

/// How many registers are written.
const COUNT: usize = writes_count(BOARD.lines);

/// What is written.
static WRITES: [Write; COUNT] = writes(BOARD.lines);

// `cortex-m-rt` calls it first of all; a later one of this name takes the place of its own, which does nothing.
#[allow(unsafe_code, reason = "no Rust code may run there")]
mod pre_init {
    core::arch::global_asm!(
        ".section .text.__pre_init, \"ax\"",
        ".global __pre_init",
        ".type __pre_init,%function",
        ".thumb_func",
        "__pre_init:",
        "movw r0, #:lower16:{writes}",
        "movt r0, #:upper16:{writes}",
        "movw r1, #{bytes}",
        "add r1, r0, r1",
        "2:",
        "ldr r2, [r0], #4",
        "ldr r3, [r2]",
        "ldr r12, [r0], #4",
        "bic.w r3, r3, r12",
        "ldr r12, [r0], #4",
        "orr.w r3, r3, r12",
        "str r3, [r2]",
        "cmp r0, r1",
        "bne 2b",
        "bx lr",
        ".size __pre_init, . - __pre_init",
        writes = sym super::WRITES,
        bytes = const core::mem::size_of::<[super::Write; super::COUNT]>(),
    );
}
