//! The same machine behind a serial line: on a board, in QEMU, or a board's image on models of its chip.
//!
//! ```text
//! drive.rs    loads and runs a job there, compares with what was computed here
//! operate.rs  drives, home, hold and resume: what an operator asks
//! axes.rs     jog, homing, probing: followed to their end
//! session/    requests, answers; retransmission   |   events.rs  events in order, lost ones again
//! feed.rs     the words of a job that is larger than the board's store
//! script.rs   plays what an operator does, period by period
//! qemu.rs     starts and ends QEMU with the firmware   |   port.rs  a serial port   |   chip.rs  a board's image without the board
//!             └── guard.rs   their folder; ends them and removes it where this process is killed ──┘
//! ```

pub mod axes;
pub mod chip;
pub mod drive;
mod events;
mod feed;
mod guard;
pub mod operate;
pub mod port;
pub mod qemu;
pub mod script;
pub mod session;

pub use session::{RemoteError, Session, Stream};
