//! What an operator types while `run --port` follows a run.

use std::io::{BufRead, stdin};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use indicatif::ProgressBar;
use protocol::message::{Request, Status};

use super::operate::{sentence, typed};
use super::out::to_stderr;
use machine::remote::RemoteError;
use machine::remote::operate::Operator;

/// What can be typed.
pub(super) const WORDS: &str = "hold, resume, stop, abort, override 50, status";

/// The lines of standard input, and where the answers go: above the bar.
pub(super) struct Typist {
    lines: Receiver<String>,
    /// Standard input has not ended.
    open: bool,
    bar: ProgressBar,
}

impl Typist {
    /// Reads from now on.
    pub(super) fn new(bar: ProgressBar) -> Self {
        let (sender, lines) = channel();
        // It ends with standard input, or with the program.
        std::thread::spawn(move || {
            for line in stdin().lock().lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Self {
            lines,
            open: true,
            bar,
        }
    }

    fn say(&self, what: &str) {
        self.bar.suspend(|| to_stderr(format_args!("{what}")));
    }
}

impl Operator for Typist {
    fn wish(&mut self) -> Option<Request> {
        let line = match self.lines.try_recv() {
            Ok(line) => line,
            Err(error) => {
                self.open = error != TryRecvError::Disconnected;
                return None;
            }
        };
        match typed(&line) {
            Ok(action) => action,
            Err(why) => {
                self.say(why.trim_end());
                None
            }
        }
    }

    fn is_there(&self) -> bool {
        self.open
    }

    fn told(&mut self, _: &Request, came: Result<Status, RemoteError>) {
        match came {
            Ok(status) => {
                let percent = status.safety.feed_override;
                self.say(&format!("{}, feed override {percent} %", sentence(&status)));
            }
            Err(error) => self.say(&error.to_string()),
        }
    }
}
