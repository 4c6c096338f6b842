//! Runs jobs: prepares them for the core, runs the core in this process, drives boards and QEMU.
//!
//! ```text
//! Job ──prepare──► Prepared ──in_process──► samples
//!                     └──────remote───────► the same from a board or QEMU
//! ```

pub mod advice;
mod cells;
pub mod direction;
mod in_process;
pub mod links;
pub mod prepare;
pub mod profile;
pub mod remote;
pub mod script;
pub mod travel;
pub mod work;

pub use cells::PASS_S;
pub use in_process::Machine;
