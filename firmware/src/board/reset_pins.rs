//! Sets every output inactive directly after a reset, before memory is initialised: drives, heaters and fans are off about 30 us after the chip starts, on
//! its 16 MHz HSI. (Initialising 64 KiB of memory alone takes milliseconds.) Until then, and during the reset, pins float: a drive's enable line
//! needs an external pull resistor.
//!
//! No Rust code may run before memory is initialised. So this is assembly without memory accesses except to a table in flash, which is computed when
//! the image is built and tested in `boards`.

use boards::setup::{Write, writes, writes_count};

use super::BOARD;

/// Number of register writes.
const COUNT: usize = writes_count(BOARD.lines);

/// The register writes.
static WRITES: [Write; COUNT] = writes(BOARD.lines);

/// The function's name. `cortex-m-rt` calls `__pre_init` first, which overrides the crate's weak default, an empty one. Behind a boot loader another
/// function comes before (`behind_loader.rs`).
#[cfg(not(feature = "behind-loader"))]
macro_rules! entry {
    () => {
        "__pre_init"
    };
}
#[cfg(feature = "behind-loader")]
macro_rules! entry {
    () => {
        "isofeed_reset_pins"
    };
}

#[allow(unsafe_code, reason = "no Rust code may run there")]
mod pre_init {
    core::arch::global_asm!(
        ".section .text.__pre_init, \"ax\"",
        concat!(".global ", entry!()),
        concat!(".type ", entry!(), ",%function"),
        ".thumb_func",
        concat!(entry!(), ":"),
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
        concat!(".size ", entry!(), ", . - ", entry!()),
        writes = sym super::WRITES,
        bytes = const core::mem::size_of::<[super::Write; super::COUNT]>(),
    );
}
