//! How far the work is: bars on stderr, where that is a terminal and nobody asked for JSON.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

/// How often what moves on a terminal is drawn anew.
const TICK: Duration = Duration::from_millis(100);
/// With `--json` there are no bars, wherever stderr goes: the caller is a program.
static QUIET: AtomicBool = AtomicBool::new(false);

/// No bars from now on.
pub(super) fn silence() {
    QUIET.store(true, Ordering::Relaxed);
}

fn drawn(bar: ProgressBar, template: &str, what: &'static str) -> ProgressBar {
    if QUIET.load(Ordering::Relaxed) || bar.is_hidden() {
        return ProgressBar::hidden();
    }
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar.enable_steady_tick(TICK);
    // An error on the way drops the bar: nothing of it is to stand above the message.
    bar.with_finish(ProgressFinish::AndClear)
}

/// A bar that fills.
pub(super) fn progress(length: u64, what: &'static str) -> ProgressBar {
    let template = "{msg} {wide_bar} {percent:>3} % {elapsed} of {duration}";
    drawn(ProgressBar::new(length), template, what)
}

/// Something that moves while there is no telling how far the work is.
pub(super) fn spinner(what: &'static str) -> ProgressBar {
    drawn(ProgressBar::new_spinner(), "{msg} {spinner} {elapsed}", what)
}

/// One bar for all parts of an inspection.
pub(super) struct Bar(ProgressBar);

impl Bar {
    /// A bar that shows nothing before the first part begins.
    pub(super) fn new() -> Self {
        Self(progress(0, ""))
    }

    /// Removes the bar.
    pub(super) fn clear(&self) {
        self.0.finish_and_clear();
    }
}

impl verify::swept::Progress for Bar {
    fn begin(&self, what: &'static str, steps: u64) {
        self.0.reset();
        self.0.set_length(steps);
        self.0.set_message(what);
    }

    fn done(&self, steps: u64) {
        self.0.inc(steps);
    }
}
