//! The passes in the 3D view: points at equal times, each with the worst of the samples it represents.

use job::units::MM_PER_NM;
use serde_json::{Value, json};

use super::embed::{column, words};
use oracle::{PassSample, SampleCheck};

/// Approximate number of points of all passes.
const POINTS: usize = 60_000;
/// Least number of points of a pass, which preserves its shape, and largest number.
const PASS_POINTS: [usize; 2] = [24, 8192];
/// Largest number of points, if the run has more passes than expected.
const POINTS_MAX: usize = 2 * POINTS;

/// Worst values of the samples of a point; NaN without samples.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Worst {
    /// Speed of the cutter contact with the largest deviation from the feed, mm/s.
    cc_mm_s: f32,
    /// Largest speed of the cutter location, mm/s.
    cl_mm_s: f32,
    /// Largest error of the cutter location, nm.
    cl_nm: f32,
    /// Largest feed error by magnitude, %.
    feed_pct: f32,
}

impl Worst {
    const NONE: Self = Self {
        cc_mm_s: f32::NAN,
        cl_mm_s: f32::NAN,
        cl_nm: f32::NAN,
        feed_pct: f32::NAN,
    };

    fn merged(self, other: Self, feed_mm_s: f32) -> Self {
        let off = |speed: f32| (speed - feed_mm_s).abs();
        let takes_other = self.cc_mm_s.is_nan() || off(other.cc_mm_s) > off(self.cc_mm_s);
        Self {
            cc_mm_s: if takes_other { other.cc_mm_s } else { self.cc_mm_s },
            cl_mm_s: self.cl_mm_s.max(other.cl_mm_s),
            cl_nm: self.cl_nm.max(other.cl_nm),
            feed_pct: self.feed_pct.max(other.feed_pct),
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Point {
    cc_nm: [i32; 3],
    cl_nm: [i32; 3],
    worst: Worst,
}

/// A pass that is drawn.
#[derive(Clone, Debug)]
struct Pass {
    pass: u32,
    first_tick: u64,
    last_tick: u64,
    /// Samples per point.
    stride: usize,
    seen: usize,
    points: Vec<Point>,
    /// The last sample, with the values since the last point.
    last: Option<Point>,
}

impl Pass {
    fn add(&mut self, point: Point, most: usize, feed_mm_s: f32) {
        let before = self.last.take().map_or(Worst::NONE, |last| last.worst);
        let point = Point {
            worst: before.merged(point.worst, feed_mm_s),
            ..point
        };
        if !self.seen.is_multiple_of(self.stride) {
            self.last = Some(point);
        } else if self.points.len() < most {
            self.points.push(point);
        } else {
            // The number of points is even: the last one is merged into this one.
            let before = self.points.last().map_or(Worst::NONE, |last| last.worst);
            self.halve(feed_mm_s);
            self.points.push(Point {
                worst: before.merged(point.worst, feed_mm_s),
                ..point
            });
        }
        self.seen += 1;
    }

    /// Merges every second point into the next one.
    fn halve(&mut self, feed_mm_s: f32) {
        let halved = self.points.chunks(2).enumerate().map(|(index, pair)| {
            let before = match index {
                0 => Worst::NONE,
                _ => self.points[2 * index - 1].worst,
            };
            Point {
                worst: before.merged(pair[0].worst, feed_mm_s),
                ..pair[0]
            }
        });
        let halved: Vec<_> = halved.collect();
        self.points = halved;
        self.stride *= 2;
    }

    fn points(&self) -> impl Iterator<Item = &Point> + Clone {
        self.points.iter().chain(&self.last)
    }
}

/// The drawn passes of a run.
#[derive(Clone, Debug)]
pub(super) struct Track {
    feed_mm_s: f32,
    period_s: f64,
    /// One of this number of passes is drawn.
    pub(super) every: u32,
    final_pass: u32,
    most: usize,
    passes: Vec<Pass>,
    kept: usize,
    is_drawn: bool,
    last_cl_nm: [i32; 3],
    /// Number of passes so far.
    seen: u32,
}

impl Track {
    /// Track of a run with this feed and period; `passes`: expected number.
    pub(super) fn new(feed_mm_s: f64, period_s: f64, passes: usize) -> Self {
        let passes = passes.max(1);
        let [least, most] = PASS_POINTS;
        let every = passes.div_ceil(POINTS / least);
        Self {
            feed_mm_s: feed_mm_s as f32,
            period_s,
            every: u32::try_from(every).unwrap_or(u32::MAX),
            final_pass: u32::try_from(passes - 1).unwrap_or(u32::MAX),
            // Even, so that merging pairs leaves no single point.
            most: (POINTS / passes.div_ceil(every)).clamp(least, most) / 2 * 2,
            passes: Vec::new(),
            kept: 0,
            is_drawn: false,
            last_cl_nm: [0; 3],
            seen: 0,
        }
    }

    pub(super) fn add(&mut self, sample: &PassSample, checked: &SampleCheck) {
        if sample.first_of_pass || self.seen == 0 {
            self.begin_pass(sample);
        }
        let step = |k: usize| f64::from(sample.cl_nm[k]) - f64::from(self.last_cl_nm[k]);
        let way_mm = (step(0).powi(2) + step(1).powi(2) + step(2).powi(2)).sqrt() * MM_PER_NM;
        self.last_cl_nm = sample.cl_nm;
        let Some(pass) = self.passes.last_mut().filter(|_| self.is_drawn) else {
            return;
        };
        // The last step of a pass is shorter than a period's and gives no speed.
        let arc_mm = checked.arc_mm.filter(|_| !sample.last_of_pass);
        let number = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
        pass.last_tick = sample.tick;
        let point = Point {
            cc_nm: sample.cc_nm,
            cl_nm: sample.cl_nm,
            worst: Worst {
                cc_mm_s: number(arc_mm.map(|arc| arc / self.period_s)),
                cl_mm_s: number(arc_mm.map(|_| way_mm / self.period_s)),
                cl_nm: number(checked.position_nm),
                feed_pct: number(checked.ripple_pct.map(f64::abs)),
            },
        };
        pass.add(point, self.most, self.feed_mm_s);
    }

    fn begin_pass(&mut self, sample: &PassSample) {
        self.seen += 1;
        if self.is_drawn {
            self.kept += self.passes.last().map_or(0, |pass| pass.points.len() + 1);
        }
        let is_wanted = sample.pass.is_multiple_of(self.every) || sample.pass == self.final_pass;
        self.is_drawn = is_wanted && self.kept + self.most < POINTS_MAX;
        if self.is_drawn {
            self.passes.push(Pass {
                pass: sample.pass,
                first_tick: sample.tick,
                last_tick: sample.tick,
                stride: 1,
                seen: 0,
                points: Vec::new(),
                last: None,
            });
        }
    }

    /// Number of drawn points.
    pub(super) fn points(&self) -> usize {
        self.passes.iter().map(|pass| pass.points().count()).sum()
    }

    /// Number of drawn passes.
    pub(super) fn drawn(&self) -> usize {
        self.passes.len()
    }

    /// Least and largest number of samples per drawn point.
    pub(super) fn strides(&self) -> [usize; 2] {
        self.passes
            .iter()
            .map(|pass| pass.stride)
            .fold([usize::MAX, 1], |[low, high], stride| {
                [low.min(stride), high.max(stride)]
            })
    }

    /// Positions of contact and centre at all points, nm.
    pub(super) fn places(&self) -> impl Iterator<Item = [i32; 3]> {
        let points = self.passes.iter().flat_map(Pass::points);
        points.flat_map(|point| [point.cc_nm, point.cl_nm])
    }

    /// JSON of the track. `place`: converts a position, nm, to 16-bit steps.
    pub(super) fn json(&self, place: impl Fn([i32; 3]) -> [u16; 3]) -> Value {
        let points = || self.passes.iter().flat_map(Pass::points);
        let of = |pick: fn(&Worst) -> f32| column(points().map(move |point| pick(&point.worst).into()));
        let passes: Vec<_> = self
            .passes
            .iter()
            .map(|pass| {
                json!([
                    pass.pass,
                    pass.first_tick,
                    pass.last_tick,
                    pass.stride,
                    pass.points().count()
                ])
            })
            .collect();
        json!({
            "passes": passes,
            "cc": words(points().flat_map(|point| place(point.cc_nm))),
            "cl": words(points().flat_map(|point| place(point.cl_nm))),
            "values": {
                "cc_speed": of(|worst| worst.cc_mm_s),
                "cl_speed": of(|worst| worst.cl_mm_s),
                "cl_error": of(|worst| worst.cl_nm),
                "feed_error": of(|worst| worst.feed_pct),
            },
        })
    }
}
