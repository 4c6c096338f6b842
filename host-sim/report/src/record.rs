//! What is kept of a stream of samples: a bounded amount, whatever the job's length.

use job::{Along, Job, Pattern};
use oracle::PassSample;

/// Passes that are drawn at most, besides the last one: more would run together in a picture of 900 pixels.
const DRAWN_MAX: usize = 60;
/// Points kept of a drawn pass at most: one every two to five pixels.
const POINTS_MAX: usize = 300;
/// Passes whose interval is kept at most: two to a chart's pixel.
const INTERVALS_MAX: usize = 2048;

const MM_PER_NM: f64 = 1e-6;

/// A stream thinned as it grows: every `stride`-th item is kept, and the stride doubles when there are too many. The
/// last item is always kept.
#[derive(Clone, Debug)]
pub(super) struct Thinned<T> {
    most: usize,
    stride: u64,
    seen: u64,
    kept: Vec<T>,
    last: Option<T>,
}

impl<T: Copy> Thinned<T> {
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            stride: 1,
            seen: 0,
            kept: Vec::new(),
            last: None,
        }
    }

    pub(super) fn push(&mut self, item: T) {
        if self.seen.is_multiple_of(self.stride) {
            if self.kept.len() == self.most {
                let mut index = 0;
                self.kept.retain(|_| {
                    index += 1;
                    index % 2 == 1
                });
                self.stride *= 2;
            }
            if self.seen.is_multiple_of(self.stride) {
                self.kept.push(item);
            }
        }
        self.seen += 1;
        self.last = Some(item);
    }

    /// What was kept, in order, and the last item of all.
    pub(super) fn items(&self) -> Vec<T> {
        let last_is_kept = self.seen == 0 || (self.seen - 1).is_multiple_of(self.stride);
        let last = self.last.filter(|_| !last_is_kept);
        self.kept.iter().copied().chain(last).collect()
    }

    /// How many items there were for each one kept.
    pub(super) fn stride(&self) -> u64 {
        self.stride
    }
}

/// Cutter contact and tool centre at one sample, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) cc_mm: [f64; 3],
    pub(super) cl_mm: [f64; 3],
}

/// A pass that is drawn.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    pub(super) pass: u32,
    pub(super) places: Thinned<Place>,
}

/// Where a pass lies, and the least interval on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PassInterval {
    pub(super) pass: u32,
    /// Its side parameter.
    pub(super) side: f64,
    /// Least candidate of the path interval, in the side parameter; infinite where no sample had one.
    pub(super) least: f64,
    /// Side parameter of the next pass less this one's.
    pub(super) step: f64,
}

/// The record of one run.
#[derive(Clone, Debug)]
pub(super) struct Record {
    along: Along,
    /// Every so many passes one is drawn.
    stride: u32,
    /// The pass that is expected to be the last.
    final_pass: u32,
    /// The pass that is set off from the others.
    pub(super) middle_pass: u32,
    pub(super) drawn: Vec<Drawn>,
    pub(super) intervals: Thinned<PassInterval>,
    current: Option<PassInterval>,
    is_drawn: bool,
}

impl Record {
    pub(super) fn new(job: &Job, passes: usize) -> Self {
        let passes = u32::try_from(passes).unwrap_or(u32::MAX).max(1);
        let mut stride = passes.div_ceil(DRAWN_MAX as u32).max(1);
        if job.pattern == Pattern::Zigzag {
            // Odd, so that the drawn passes run to and fro as the real ones do.
            stride |= 1;
        }
        Self {
            along: job.along,
            stride,
            final_pass: passes - 1,
            middle_pass: passes / 2 / stride * stride,
            drawn: Vec::new(),
            intervals: Thinned::new(INTERVALS_MAX),
            current: None,
            is_drawn: false,
        }
    }

    pub(super) fn add(&mut self, sample: &PassSample) {
        if sample.first_of_pass {
            self.begin_pass(sample);
        }
        if let Some(current) = &mut self.current {
            current.least = current.least.min(sample.interval);
        }
        if !self.is_drawn {
            return;
        }
        let place = Place {
            cc_mm: millimetres(sample.cc_nm),
            cl_mm: millimetres(sample.cl_nm),
        };
        if let Some(drawn) = self.drawn.last_mut() {
            drawn.places.push(place);
        }
    }

    fn begin_pass(&mut self, sample: &PassSample) {
        let side = match self.along {
            Along::U => sample.v,
            Along::V => sample.u,
        };
        if let Some(before) = self.current {
            self.intervals.push(PassInterval {
                step: side - before.side,
                ..before
            });
        }
        self.current = Some(PassInterval {
            pass: sample.pass,
            side,
            least: f64::INFINITY,
            step: 0.0,
        });
        // The second condition bounds the record should there be more passes than were expected.
        self.is_drawn = (sample.pass.is_multiple_of(self.stride) && sample.pass <= self.final_pass)
            || sample.pass == self.final_pass;
        if self.is_drawn {
            self.drawn.push(Drawn {
                pass: sample.pass,
                places: Thinned::new(POINTS_MAX),
            });
        }
    }
}

fn millimetres(nm: [i32; 3]) -> [f64; 3] {
    nm.map(|nm| f64::from(nm) * MM_PER_NM)
}
