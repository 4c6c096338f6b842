//! Cycles of a Cortex-M4F, counted in QEMU, which counts none itself.
//!
//! ```text
//!  host tool ── plan (code, stage of each instruction, task) ──► plan.rs
//!                                                                  │
//!  QEMU ── ffi.rs: "this address is executed" ──► account.rs ◄─────┘
//!                                                  │ decode/  what the instruction is
//!                                                  │ cost.rs  what it takes, in two models, with sources and limits
//!  host tool ◄── record.rs: one record a tick ─────┘
//! ```
//!
//! QEMU loads the library with `-plugin libcycle_plugin.so,plan=FILE,records=FILE`; one build serves 7.2 to 10.

pub mod account;
pub mod cost;
pub mod decode;
mod ffi;
pub mod operations;
pub mod plan;
pub mod record;
