//! Time and log, passed to every model.

use std::collections::BTreeSet;

/// Time of an event that never occurs.
pub(crate) const NEVER: u64 = u64::MAX;

/// Maximum number of stored complaints; all are counted.
const KEPT: usize = 200;

/// Cycles of the bus clock (HCLK) since the first start, the time in seconds, and the log of the models.
pub(crate) struct World {
    /// Now, in cycles.
    pub(crate) now: u64,
    /// Begin and end of the last operation of the flash, cycles: the program, which is in the same flash, is stopped meanwhile.
    pub(crate) flash_busy: [u64; 2],
    hclk_hz: f64,
    /// Start of the present frequency, cycles and seconds.
    since: (u64, f64),
    /// Complaints: incorrect accesses by the program.
    pub(crate) complaints: Vec<String>,
    /// Number of complaints.
    pub(crate) complained: u64,
    /// Log of the models.
    pub(crate) notes: Vec<String>,
    /// Scripted events and resets, each with its time in cycles.
    pub(crate) events: Vec<(u64, String)>,
    /// Notes go to standard error as they come.
    verbose: bool,
    once: BTreeSet<String>,
}

impl World {
    pub(crate) fn new(hclk_hz: f64, verbose: bool) -> Self {
        Self {
            now: 0,
            flash_busy: [0; 2],
            hclk_hz,
            since: (0, 0.0),
            complaints: Vec::new(),
            complained: 0,
            notes: Vec::new(),
            events: Vec::new(),
            verbose,
            once: BTreeSet::new(),
        }
    }

    /// Lets the time of an operation of the flash pass.
    pub(crate) fn flash_works(&mut self, cycles: u64) {
        let begin = self.now;
        self.now += cycles;
        self.flash_busy = [begin, self.now];
    }

    /// The present frequency, Hz.
    pub(crate) const fn hclk_hz(&self) -> f64 {
        self.hclk_hz
    }

    /// Changes it.
    pub(crate) fn set_hclk(&mut self, hz: f64) {
        self.since = (self.now, self.seconds(self.now));
        self.hclk_hz = hz;
    }

    /// A time in seconds.
    pub(crate) fn seconds(&self, at: u64) -> f64 {
        self.since.1 + (at as f64 - self.since.0 as f64) / self.hclk_hz
    }

    /// A time in cycles, if the frequency stays.
    pub(crate) fn cycles(&self, seconds: f64) -> u64 {
        self.since.0 + ((seconds - self.since.1).max(0.0) * self.hclk_hz) as u64
    }

    /// A duration in cycles.
    pub(crate) fn lasting(&self, seconds: f64) -> u64 {
        (seconds * self.hclk_hz) as u64
    }

    fn stamped(&self, text: &str) -> String {
        format!("{:.6} ms: {text}", self.seconds(self.now) * 1e3)
    }

    /// Reports a complaint.
    pub(crate) fn wrong(&mut self, text: impl AsRef<str>) {
        self.complained += 1;
        if self.complaints.len() < KEPT {
            let line = self.stamped(text.as_ref());
            eprintln!("WRONG {line}");
            self.complaints.push(line);
        }
    }

    /// Reports a complaint, unless one with the same text was reported.
    pub(crate) fn wrong_once(&mut self, text: String) {
        if self.once.insert(text.clone()) {
            self.wrong(text);
        }
    }

    /// Notes an event.
    pub(crate) fn event(&mut self, at: u64, what: &str) {
        self.events.push((at, what.to_owned()));
        self.note(what);
    }

    /// Notes what happened.
    pub(crate) fn note(&mut self, text: impl AsRef<str>) {
        let line = self.stamped(text.as_ref());
        if self.verbose {
            eprintln!("{line}");
        }
        self.notes.push(line);
    }
}
