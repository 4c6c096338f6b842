//! A sample as emitted by a machine, in plain numbers.

use oracle::PassSample;

/// A sample on a pass or between passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedSample {
    /// Tick, from 0.
    pub tick: u64,
    /// State of the machine, by its name in traces.
    pub state: &'static str,
    /// Pass, from 0.
    pub pass: u32,
    /// (u, v) of the contact; `None` between passes, where there is no contact.
    pub parameters: Option<[f64; 2]>,
    /// Cutter contact, nm; undefined between passes.
    pub cc_nm: [i32; 3],
    /// Cutter location, nm.
    pub cl_nm: [i32; 3],
    /// Commanded feed along the surface, mm/s.
    pub feed_mm_s: f32,
    /// Candidate of the path interval, in units of the side parameter; infinite where there is no candidate.
    pub interval: f32,
}

impl EmittedSample {
    /// The sample in the oracle's form; `None` between passes.
    #[must_use]
    pub fn emitted(&self, first_of_pass: bool, last_of_pass: bool) -> Option<PassSample> {
        let [u, v] = self.parameters?;
        Some(PassSample {
            tick: self.tick,
            pass: self.pass,
            u,
            v,
            cc_nm: self.cc_nm,
            cl_nm: self.cl_nm,
            feed_mm_s: self.feed_mm_s.into(),
            interval: self.interval.into(),
            first_of_pass,
            last_of_pass,
        })
    }
}
