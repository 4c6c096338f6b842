//! Data of the charts: minimum and maximum of each quantity in spans of time, so that decimation does not remove peaks.

use job::units::MM_PER_NM;
use serde_json::{Value, json};

use super::embed::{Scale, words};
use oracle::{PassSample, SampleCheck};

/// A quantity over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(super) enum Channel {
    /// Speed of the cutter contact (CC), mm/s.
    CcSpeed,
    /// Speed of the cutter location (CL), mm/s.
    ClSpeed,
    /// Error of the cutter location, nm.
    ClError,
    /// Feed error, %.
    FeedError,
    /// Velocity of x, the first of three, mm/s.
    Velocity,
    /// Acceleration of x, the first of three, mm/s².
    Acceleration = 7,
}

/// Names of the channels in the page, in the order of [`Channel`].
const NAMES: [&str; CHANNELS] = [
    "cc_speed",
    "cl_speed",
    "cl_error",
    "feed_error",
    "velocity_x",
    "velocity_y",
    "velocity_z",
    "acceleration_x",
    "acceleration_y",
    "acceleration_z",
];
const CHANNELS: usize = 10;

/// Largest number of spans over the whole run: about thirty per pixel of a wide chart.
const SPANS_MAX: usize = 32_768;
/// Largest number of spans of a pass stored in detail; one per sample if the pass is not longer.
const DETAIL_MAX: usize = 8192;

/// Periods before and after a position over which the wide acceleration is computed.
const REACH: usize = 8;
/// Largest difference between the accelerations over single periods and over wide ones that is attributed to noise, nm per
/// period². Positions are whole nanometres within some nanometres of the exact ones; a second difference has four of them.
const NOISE_NM: f64 = 8.0;

/// Minimum and maximum of each channel; NaN without values.
type Span = [[f32; 2]; CHANNELS];
const EMPTY: Span = [[f32::NAN; 2]; CHANNELS];

/// Spans of equal length, which doubles when the capacity is reached.
#[derive(Clone, Debug)]
pub(super) struct Spans {
    most: usize,
    first_tick: Option<u64>,
    /// Binary logarithm of the length of a span in ticks.
    doublings: u32,
    spans: Vec<Span>,
}

impl Spans {
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            first_tick: None,
            doublings: 0,
            spans: Vec::new(),
        }
    }

    /// Adds a value at a tick, which may be slightly before the latest.
    pub(super) fn put(&mut self, tick: u64, channel: usize, value: f64) {
        let first = *self.first_tick.get_or_insert(tick);
        let since = tick.saturating_sub(first);
        while since >> self.doublings >= self.most as u64 {
            self.halve();
        }
        let index = (since >> self.doublings) as usize;
        if index >= self.spans.len() {
            self.spans.resize(index + 1, EMPTY);
        }
        let [least, largest] = &mut self.spans[index][channel];
        // The rounding to f32 is far below the resolution of 16 bits.
        *least = least.min(value as f32);
        *largest = largest.max(value as f32);
    }

    fn halve(&mut self) {
        let halved = self.spans.chunks(2).map(|pair| {
            let mut span = pair[0];
            for (into, from) in span.iter_mut().zip(pair.get(1).unwrap_or(&EMPTY)) {
                *into = [into[0].min(from[0]), into[1].max(from[1])];
            }
            span
        });
        self.spans = halved.collect();
        self.doublings += 1;
    }

    /// Maximum of a channel; NaN without values.
    fn largest(&self, channel: usize) -> f32 {
        self.spans
            .iter()
            .map(|span| span[channel][1])
            .fold(f32::NAN, f32::max)
    }

    /// Ticks per span.
    pub(super) fn ticks(&self) -> u64 {
        1 << self.doublings
    }

    fn json(&self) -> Value {
        let channel = |index: usize| {
            let ends = self.spans.iter().map(|span| span[index].map(f64::from));
            let scale = Scale::of(ends.clone().flatten());
            let [least, largest] = [0, 1].map(|end| {
                let rounded = ends.clone().map(move |ends| match end {
                    0 => scale.below(ends[0]),
                    _ => scale.above(ends[1]),
                });
                words(rounded)
            });
            json!({ "low": scale.low, "step": scale.step, "least": least, "largest": largest })
        };
        let channels: serde_json::Map<_, _> = (0..CHANNELS)
            .map(|index| (NAMES[index].to_owned(), channel(index)))
            .collect();
        json!({
            "first_tick": self.first_tick.unwrap_or(0),
            "ticks": self.ticks(),
            "count": self.spans.len(),
            "channels": channels,
        })
    }
}

/// Velocities and accelerations of the cutter location on a pass, from its last positions.
#[derive(Clone, Debug, Default)]
struct Axes {
    /// The last positions, nm; the newest last.
    places: std::collections::VecDeque<[i32; 3]>,
    /// The latest wide acceleration, nm per period².
    wide: Option<[f64; 3]>,
    /// Accelerations over single periods for which the wide one is still missing, with their middle ticks.
    waiting: Vec<(u64, [f64; 3])>,
}

impl Axes {
    fn begin(&mut self, place: [i32; 3]) {
        self.places.clear();
        self.places.push_back(place);
        self.wide = None;
        self.waiting.clear();
    }

    /// Second difference of three positions, `reach` apart, about the one `back` before the newest; nm.
    fn second_difference(&self, back: usize, reach: usize) -> Option<[f64; 3]> {
        let newest = self.places.len().checked_sub(1)?;
        let middle = newest.checked_sub(back)?;
        let (before, after) = (middle.checked_sub(reach)?, middle + reach);
        let [before, middle, after] = [before, middle, after].map(|index| self.places.get(index));
        let (before, middle, after) = (before?, middle?, after?);
        Some(std::array::from_fn(|k| {
            f64::from(after[k]) - 2.0 * f64::from(middle[k]) + f64::from(before[k])
        }))
    }

    /// Adds the next position; passes on accelerations, nm per period², with their ticks.
    fn add(&mut self, tick: u64, place: [i32; 3], mut each: impl FnMut(u64, [f64; 3])) {
        self.places.push_back(place);
        if self.places.len() > 2 * REACH + 1 {
            self.places.pop_front();
        }
        if let Some(narrow) = self.second_difference(1, 1) {
            self.waiting.push((tick - 1, narrow));
        }
        if let Some(wide) = self.second_difference(REACH, REACH) {
            let wide = wide.map(|x| x / (REACH * REACH) as f64);
            self.wide = Some(wide);
            // Accelerations at its middle and, at the start of a pass, before it.
            let ready = self
                .waiting
                .partition_point(|(at, _)| *at + (REACH as u64) <= tick);
            for (at, narrow) in self.waiting.drain(..ready) {
                each(at, settled(narrow, wide));
            }
        }
    }

    /// The remaining accelerations, for which no wide one follows.
    fn finish(&mut self, mut each: impl FnMut(u64, [f64; 3])) {
        let wide = self.wide;
        for (at, narrow) in self.waiting.drain(..) {
            each(at, wide.map_or(narrow, |wide| settled(narrow, wide)));
        }
    }
}

/// The acceleration over single periods, or the wide one if the difference may be noise of the positions.
fn settled(narrow: [f64; 3], wide: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| {
        if (narrow[k] - wide[k]).abs() <= NOISE_NM {
            wide[k]
        } else {
            narrow[k]
        }
    })
}

/// A pass stored in detail.
#[derive(Clone, Debug)]
struct Detail {
    pass: u32,
    spans: Spans,
}

/// The series of a run.
#[derive(Clone, Debug)]
pub(super) struct Series {
    period_s: f64,
    middle_pass: u32,
    whole: Spans,
    current: Option<Detail>,
    middle: Option<Detail>,
    /// The pass with the largest CL error.
    worst: Option<Detail>,
    axes: Axes,
}

impl Series {
    /// Series of a run with this period; `middle_pass` is stored in detail.
    pub(super) fn new(period_s: f64, middle_pass: u32) -> Self {
        Self {
            period_s,
            middle_pass,
            whole: Spans::new(SPANS_MAX),
            current: None,
            middle: None,
            worst: None,
            axes: Axes::default(),
        }
    }

    pub(super) fn add(&mut self, sample: &PassSample, checked: &SampleCheck) {
        if sample.first_of_pass || self.current.is_none() {
            self.end_pass();
            self.current = Some(Detail {
                pass: sample.pass,
                spans: Spans::new(DETAIL_MAX),
            });
            self.axes.begin(sample.cl_nm);
        }
        // The last step of a pass is shorter than a period's and gives no speed.
        if let (Some(arc_mm), false) = (checked.arc_mm, sample.last_of_pass) {
            self.add_rates(sample, arc_mm);
        }
        self.put(
            sample.tick,
            Channel::ClError as usize,
            checked.position_nm.unwrap_or(f64::NAN),
        );
        self.put(
            sample.tick,
            Channel::FeedError as usize,
            checked.ripple_pct.unwrap_or(f64::NAN),
        );
    }

    fn add_rates(&mut self, sample: &PassSample, arc_mm: f64) {
        let before = self.axes.places.back().copied().unwrap_or(sample.cl_nm);
        let step: [f64; 3] =
            std::array::from_fn(|k| (f64::from(sample.cl_nm[k]) - f64::from(before[k])) * MM_PER_NM);
        let way_mm = (step[0] * step[0] + step[1] * step[1] + step[2] * step[2]).sqrt();
        self.put(sample.tick, Channel::CcSpeed as usize, arc_mm / self.period_s);
        self.put(sample.tick, Channel::ClSpeed as usize, way_mm / self.period_s);
        for (k, step_mm) in step.into_iter().enumerate() {
            self.put(
                sample.tick,
                Channel::Velocity as usize + k,
                step_mm / self.period_s,
            );
        }
        let mut axes = std::mem::take(&mut self.axes);
        axes.add(sample.tick, sample.cl_nm, |tick, nm| {
            self.put_acceleration(tick, nm);
        });
        self.axes = axes;
    }

    fn put_acceleration(&mut self, tick: u64, nm: [f64; 3]) {
        for (k, nm) in nm.into_iter().enumerate() {
            let value = nm * MM_PER_NM / (self.period_s * self.period_s);
            self.put(tick, Channel::Acceleration as usize + k, value);
        }
    }

    fn put(&mut self, tick: u64, channel: usize, value: f64) {
        self.whole.put(tick, channel, value);
        if let Some(current) = &mut self.current {
            current.spans.put(tick, channel, value);
        }
    }

    fn end_pass(&mut self) {
        let mut axes = std::mem::take(&mut self.axes);
        axes.finish(|tick, nm| self.put_acceleration(tick, nm));
        self.axes = axes;
        let Some(pass) = self.current.take() else {
            return;
        };
        let error = |detail: &Detail| detail.spans.largest(Channel::ClError as usize);
        if pass.pass == self.middle_pass {
            self.middle = Some(pass);
        } else if self
            .worst
            .as_ref()
            .is_none_or(|worst| error(&pass) > error(worst))
        {
            self.worst = Some(pass);
        }
    }

    /// Completes the series after the last sample.
    pub(super) fn finished(&self) -> Self {
        let mut series = self.clone();
        series.end_pass();
        series
    }

    /// Ticks per span of the whole run; call after [`Series::finished`].
    pub(super) fn ticks(&self) -> u64 {
        self.whole.ticks()
    }

    /// JSON of these spans.
    #[cfg(test)]
    pub(super) fn replace_whole(&mut self, spans: Spans) {
        self.whole = spans;
    }

    /// JSON of the series; call after [`Series::finished`].
    pub(super) fn json(&self) -> Value {
        // If every sample is stored, no pass is stored in detail.
        let details = [&self.middle, &self.worst].into_iter().flatten();
        let finer = details.filter(|detail| detail.spans.ticks() < self.whole.ticks());
        let details: Vec<_> = finer
            .map(|detail| {
                let mut value = detail.spans.json();
                value["pass"] = json!(detail.pass);
                value
            })
            .collect();
        json!({ "whole": self.whole.json(), "details": details })
    }
}
