//! Operator commands typed while `run --port` or `attach` follows a run.

use std::io::{BufRead, stdin};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use indicatif::ProgressBar;
use protocol::message::{OVERRIDE_NORMAL_PERCENT, Request, Status};

use super::operate::{sentence, typed};
use super::out::to_stderr;
use machine::remote::RemoteError;
use machine::remote::operate::Operator;

/// The commands, for the prompt.
pub(super) const WORDS: &str = "hold, pause, resume, stop, abort, override 50, coolant off, status";

/// The lines of standard input, read in a thread, which ends with standard input or with the process.
pub(super) fn lines() -> Receiver<String> {
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    });
    lines
}

/// The operator at the terminal: reads lines from standard input, prints the answers above the progress bar.
pub(super) struct Console {
    lines: Receiver<String>,
    /// Standard input has not ended.
    open: bool,
    bar: ProgressBar,
    /// Whether the job has limits, so that it obeys the feed override; unknown for a run that another command started.
    has_limits: Option<bool>,
}

impl Console {
    /// Starts to read standard input.
    pub(super) fn new(bar: ProgressBar, has_limits: Option<bool>) -> Self {
        Self {
            lines: lines(),
            open: true,
            bar,
            has_limits,
        }
    }

    fn say(&self, what: &str) {
        self.bar.suspend(|| to_stderr(format_args!("{what}")));
    }
}

impl Operator for Console {
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

    fn obeys_override(&self) -> bool {
        self.has_limits == Some(true)
    }

    fn begins(&mut self, status: &Status) {
        match status.safety.feed_override {
            OVERRIDE_NORMAL_PERCENT => {}
            _ if self.has_limits == Some(false) => {}
            0 => self.say("warning: the feed override is 0 %: the tool does not move. Type override 100"),
            percent => self.say(&format!(
                "the feed override is {percent} %, so the run is not compared"
            )),
        }
    }

    fn paused(&mut self, cause: &'static str) {
        self.say(&format!("paused: {cause}"));
    }

    fn replied(&mut self, _: &Request, came: Result<Status, RemoteError>) {
        match came {
            Ok(status) => {
                let percent = status.safety.feed_override;
                self.say(&format!("{}, feed override {percent} %", sentence(&status)));
            }
            Err(error) => self.say(&error.to_string()),
        }
    }
}
