//! Progress bars on stderr, if that is a terminal and the output is not JSON.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

/// Redraw interval of a bar.
const TICK: Duration = Duration::from_millis(100);
/// Set with `--json`: no bars, even if stderr is a terminal.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Disables all bars.
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
    // A bar that is dropped on an error is cleared, so that only the message remains.
    bar.with_finish(ProgressFinish::AndClear)
}

/// A bar for a known amount of work.
pub(super) fn progress(length: u64, what: &'static str) -> ProgressBar {
    let template = "{msg} {wide_bar} {percent:>3} % {elapsed} of {duration}";
    drawn(ProgressBar::new(length), template, what)
}

/// A spinner for an unknown amount of work.
pub(super) fn spinner(what: &'static str) -> ProgressBar {
    drawn(ProgressBar::new_spinner(), "{msg} {spinner} {elapsed}", what)
}

/// One bar for all parts of an inspection.
pub(super) struct Bar(ProgressBar);

impl Bar {
    /// A bar that is empty until the first part begins.
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
