//! The same machine behind a serial line: on a board, or in QEMU.
//!
//! ```text
//! drive.rs    loads and runs a job there, compares with the result of this process
//! operate.rs  drives, home, hold and resume: commands of an operator
//! session.rs  requests, replies, events; retransmission
//! script.rs   executes the commands of an operator, period by period
//! qemu.rs     starts and ends QEMU with the firmware   |   port.rs  a serial port
//! ```

pub mod drive;
pub mod operate;
pub mod port;
pub mod qemu;
pub mod script;
pub mod session;

pub use session::{RemoteError, Session, Stream};
