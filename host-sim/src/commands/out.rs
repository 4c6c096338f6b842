//! Standard output and standard error of all commands. A closed pipe (`cargo sim ... | head`) must not panic.
//!
//! Once the reader has closed standard output, further output is dropped and the command continues: it writes its files and returns its
//! proper exit code. Other write errors, such as a full disk, are returned by [`finish`].

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use programs::with_command_name;

/// What came of writing to standard output.
#[derive(Debug)]
enum Output {
    Open,
    /// The reader has closed the pipe.
    Closed,
    Failed(io::Error),
}

/// Whether anything was printed to standard output.
static PRINTED: AtomicBool = AtomicBool::new(false);
static OUTPUT: Mutex<Output> = Mutex::new(Output::Open);

/// Writes, unless an earlier write failed.
fn attempt(write: impl FnOnce() -> io::Result<()>) {
    let mut output = OUTPUT.lock().unwrap_or_else(PoisonError::into_inner);
    if let (Output::Open, Err(error)) = (&*output, write()) {
        *output = if error.kind() == ErrorKind::BrokenPipe {
            Output::Closed
        } else {
            Output::Failed(error)
        };
    }
}

/// Prints to standard output.
pub(super) fn to_stdout(text: Arguments<'_>) {
    PRINTED.store(true, Ordering::Relaxed);
    attempt(|| stdout().write_all(with_command_name(&text.to_string()).as_bytes()));
}

/// Whether anything was printed to standard output.
pub(super) fn printed() -> bool {
    PRINTED.load(Ordering::Relaxed)
}

/// Prints a line to standard error; a write error is ignored.
pub(super) fn to_stderr(text: Arguments<'_>) {
    let _ = writeln!(stderr(), "{}", with_command_name(&text.to_string()));
}

/// Flushes the output. Returns the first write error, except for a pipe that the reader closed.
pub(super) fn finish() -> Option<io::Error> {
    attempt(|| stdout().flush());
    let mut output = OUTPUT.lock().unwrap_or_else(PoisonError::into_inner);
    match std::mem::replace(&mut *output, Output::Closed) {
        Output::Failed(error) => Some(error),
        Output::Open | Output::Closed => None,
    }
}

/// Prints a line to standard output.
macro_rules! say {
    () => { $crate::commands::out::to_stdout(format_args!("\n")) };
    ($text:literal $($rest:tt)*) => {
        $crate::commands::out::to_stdout(format_args!("{}\n", format_args!($text $($rest)*)))
    };
}

/// Prints to standard output, without ending the line.
macro_rules! say_part {
    ($($text:tt)*) => { $crate::commands::out::to_stdout(format_args!($($text)*)) };
}

/// Prints a line to standard error.
macro_rules! complain {
    ($($text:tt)*) => { $crate::commands::out::to_stderr(format_args!($($text)*)) };
}

pub(super) use {complain, say, say_part};
