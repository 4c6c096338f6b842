//! QEMU plugin that counts the cycles of a Cortex-M4F, and the arithmetic operations, of each stage of a tick.
//!
//! ```text
//!  host tool ── plan (code, stage of each instruction, task) ──► plan.rs
//!                                                                  │
//!  QEMU ── ffi.rs: address executed ──► account.rs ◄───────────────┘
//!                                        │ decode/        instruction class and registers
//!                                        │ cost.rs        cycles in two models, with sources and limits
//!                                        │ operations.rs  arithmetic operations
//!  host tool ◄── record.rs: one record a tick
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
