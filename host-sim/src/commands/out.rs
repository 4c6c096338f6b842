//! Standard output and standard error of all commands. A closed pipe (`cargo sim ... | head`) must not panic.
//!
//! Once the reader has closed standard output, further output is dropped and the command continues: it writes its files and returns its
//! proper exit code. Other write errors, such as a full disk, are returned by [`finish`].

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write, stderr, stdout};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use job::printable;
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

/// The text as a terminal may have it: printable, with the colours of messages.
fn coloured(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for (index, part) in text.split('\u{1b}').enumerate() {
        let colour = part.strip_prefix('[').and_then(|rest| {
            let numbers = rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';');
            let rest = numbers.strip_prefix('m')?;
            Some((&part[..part.len() - rest.len()], rest))
        });
        match (index, colour) {
            (0, _) => out.push_str(&printable(part)),
            (_, Some((code, rest))) => {
                out.push('\u{1b}');
                out.push_str(code);
                out.push_str(&printable(rest));
            }
            _ => {
                out.push_str("\\u001b");
                out.push_str(&printable(part));
            }
        }
    }
    out
}

/// Prints to standard output, with escapes for control characters, as JSON has them.
pub(super) fn to_stdout(text: Arguments<'_>) {
    PRINTED.store(true, Ordering::Relaxed);
    let text = text.to_string();
    attempt(|| stdout().write_all(with_command_name(&printable(&text)).as_bytes()));
}

/// Whether anything was printed to standard output.
pub(super) fn printed() -> bool {
    PRINTED.load(Ordering::Relaxed)
}

/// Prints a line to standard error; a write error is ignored.
pub(super) fn to_stderr(text: Arguments<'_>) {
    let _ = writeln!(stderr(), "{}", with_command_name(&coloured(&text.to_string())));
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

#[cfg(test)]
mod tests {
    use super::coloured;

    #[test]
    fn only_colours_pass() {
        let message = "\u{1b}[31merror\u{1b}[0m: \u{1b}[38;5;2mx";
        assert_eq!(coloured(message), message);
        assert_eq!(
            coloured("a\u{1b}[2Jb\u{1b}]0;t\u{7}c\u{9b}1m\r\n\u{1b}"),
            "a\\u001b[2Jb\\u001b]0;t\\u0007c\\u009b1m\\u000d\n\\u001b"
        );
    }
}
