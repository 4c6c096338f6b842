//! Ctrl-C while this command has the axes move or the spindle turn: they are stopped before it ends, instead of a second later by the board, which no longer hears it.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use super::out::to_stderr;

/// Exit code of a program that Ctrl-C has ended.
const INTERRUPTED: i32 = 130;

static ASKED: AtomicBool = AtomicBool::new(false);

/// Begins to catch Ctrl-C and a termination, and says at a terminal what they do; the second one ends the program.
pub(super) fn watch(what: &str) {
    static WATCHED: Once = Once::new();
    WATCHED.call_once(|| {
        let caught = ctrlc::set_handler(|| {
            if ASKED.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED);
            }
        });
        // An interrupt that cannot be caught ends the program, and the board stops the motion at its heartbeat timeout.
        if caught.is_ok() && console::user_attended_stderr() {
            to_stderr(format_args!("{what}"));
        }
    });
}

/// Whether it was pressed.
pub(super) fn is_asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}
