//! Decimated record of a stream of samples, in bounded memory.

use glam::DVec3;
use job::units::MM_PER_NM;
use job::{Along, Job, Pattern};
use oracle::PassSample;

/// Largest number of drawn passes besides the last one: more would merge in a picture of 900 pixels.
const DRAWN_MAX: usize = 60;
/// Largest number of points of a drawn pass: one every two to five pixels.
const POINTS_MAX: usize = 300;
/// Largest number of passes whose interval is stored: two per pixel of a chart.
const INTERVALS_MAX: usize = 2048;

/// A decimated stream: every `stride`-th item is stored, and the stride doubles when the capacity is reached. The last
/// item is always stored.
#[derive(Clone, Debug)]
pub(super) struct DecimatedStream<T> {
    most: usize,
    stride: u64,
    seen: u64,
    kept: Vec<T>,
    last: Option<T>,
}

impl<T: Copy> DecimatedStream<T> {
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

    /// The stored items in order, and the last item.
    pub(super) fn items(&self) -> Vec<T> {
        let last_is_kept = self.seen == 0 || (self.seen - 1).is_multiple_of(self.stride);
        let last = self.last.filter(|_| !last_is_kept);
        self.kept.iter().copied().chain(last).collect()
    }

    /// Items per stored item.
    pub(super) fn stride(&self) -> u64 {
        self.stride
    }
}

/// Cutter contact (CC) and ball centre (CL) of one sample, mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    pub(super) cc_mm: DVec3,
    pub(super) cl_mm: DVec3,
}

/// A pass that is drawn.
#[derive(Clone, Debug)]
pub(super) struct DrawnPass {
    pub(super) pass: u32,
    pub(super) places: DecimatedStream<Place>,
}

/// Side parameter of a pass and its least interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PassInterval {
    pub(super) pass: u32,
    /// Side parameter of the pass.
    pub(super) side: f64,
    /// Least candidate of the path interval, in the side parameter; infinite if no sample had one.
    pub(super) least: f64,
    /// Side parameter of the next pass minus that of this one.
    pub(super) step: f64,
}

/// The record of one run.
#[derive(Clone, Debug)]
pub(super) struct Record {
    along: Along,
    /// One of this number of passes is drawn.
    stride: u32,
    /// Index of the last expected pass.
    final_pass: u32,
    /// Index of the highlighted pass.
    pub(super) middle_pass: u32,
    pub(super) drawn: Vec<DrawnPass>,
    pub(super) intervals: DecimatedStream<PassInterval>,
    current: Option<PassInterval>,
    is_drawn: bool,
}

impl Record {
    pub(super) fn new(job: &Job, passes: usize) -> Self {
        let passes = u32::try_from(passes).unwrap_or(u32::MAX).max(1);
        let mut stride = passes.div_ceil(DRAWN_MAX as u32).max(1);
        if job.pattern == Pattern::Zigzag {
            // Odd, so that the drawn passes alternate in direction with zigzag.
            stride |= 1;
        }
        Self {
            along: job.along,
            stride,
            final_pass: passes - 1,
            middle_pass: passes / 2 / stride * stride,
            drawn: Vec::new(),
            intervals: DecimatedStream::new(INTERVALS_MAX),
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
        // The second condition bounds the record if there are more passes than expected.
        self.is_drawn = (sample.pass.is_multiple_of(self.stride) && sample.pass <= self.final_pass)
            || sample.pass == self.final_pass;
        if self.is_drawn {
            self.drawn.push(DrawnPass {
                pass: sample.pass,
                places: DecimatedStream::new(POINTS_MAX),
            });
        }
    }
}

fn millimetres(nm: [i32; 3]) -> DVec3 {
    DVec3::from(nm.map(f64::from)) * MM_PER_NM
}
