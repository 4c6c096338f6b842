//! What every command prints goes through here, so that a reader who goes away (`cargo sim ... | head`) is no panic.
//!
//! Once nobody reads standard output any more, the rest is dropped, and the command goes on to its end: its files are written and its exit
//! code means what it says. A disk that is full is an error, and [`finish`] says so.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::sync::{Mutex, PoisonError};

use programs::with_command_name;

/// What came of writing to standard output.
#[derive(Debug)]
enum Output {
    Open,
    /// Nobody reads it.
    Gone,
    Failed(io::Error),
}

static OUTPUT: Mutex<Output> = Mutex::new(Output::Open);

/// Writes unless that has failed before.
fn attempt(write: impl FnOnce() -> io::Result<()>) {
    let mut output = OUTPUT.lock().unwrap_or_else(PoisonError::into_inner);
    if let (Output::Open, Err(error)) = (&*output, write()) {
        *output = if error.kind() == ErrorKind::BrokenPipe {
            Output::Gone
        } else {
            Output::Failed(error)
        };
    }
}

/// Prints to standard output.
pub(super) fn to_stdout(text: Arguments<'_>) {
    attempt(|| stdout().write_all(with_command_name(&text.to_string()).as_bytes()));
}

/// Prints a line to standard error; nothing can be said about it if that fails.
pub(super) fn to_stderr(text: Arguments<'_>) {
    let _ = writeln!(stderr(), "{}", with_command_name(&text.to_string()));
}

/// Ends the output; tells why it did not all arrive, unless its reader had seen enough.
pub(super) fn finish() -> Option<io::Error> {
    attempt(|| stdout().flush());
    let mut output = OUTPUT.lock().unwrap_or_else(PoisonError::into_inner);
    match std::mem::replace(&mut *output, Output::Gone) {
        Output::Failed(error) => Some(error),
        Output::Open | Output::Gone => None,
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
