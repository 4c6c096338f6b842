//! Stations of passes of constant scallop height, and the words that they take in the store.

use crate::job::program::Job;
use crate::math::arith::{count_to_f32, power_of_two};
use crate::sample::SpanParameter;

/// Words of a station.
const COLUMNS: usize = 13;
/// Words of a station of a job with a region: a front that holds no pass has columns of its own.
const COLUMNS_OF_REGION: usize = COLUMNS + 2;
/// Least number of parts of each path span between stations, as a power of two.
const BITS_MIN: u8 = 1;
/// Greatest number of these parts on a surface of many spans, as a power of two.
const BITS_MANY: u8 = 3;
/// Greatest number of parts of the whole path parameter, except where [`BITS_MANY`] gives more.
const PARTS: u32 = 64;
/// Fewest parts of the whole path parameter.
const INTERVALS_MIN: u32 = 8;
/// Greatest number of parts of the whole path parameter on any surface: bounds the loops over the stations.
const PARTS_MAX: u32 = 512;

/// Most spans of the path parameter.
pub(crate) const SPANS_MAX: u16 = 128;

/// The stations: even parts of each span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Stations {
    pub(crate) spans: u16,
    /// Parts of a span, as a power of two.
    pub(crate) bits: u8,
}

impl Stations {
    /// As many as are needed at most on this number of spans.
    pub(crate) const fn most(spans: u16) -> Self {
        let mut bits = BITS_MANY;
        while (spans as u32) << bits < PARTS {
            bits += 1;
        }
        while bits > BITS_MIN && (spans as u32) << bits > PARTS_MAX {
            bits -= 1;
        }
        Self { spans, bits }
    }

    /// The fewest with at least this number of intervals, not above the most.
    pub(crate) fn for_intervals(spans: u16, intervals: f32) -> Self {
        let mut stations = Self::most(spans);
        while stations.bits > BITS_MIN
            && stations.intervals() > INTERVALS_MIN
            && count_to_f32(stations.intervals() / 2) >= intervals
        {
            stations.bits -= 1;
        }
        stations
    }

    /// Intervals between stations.
    pub(crate) const fn intervals(self) -> u32 {
        (self.spans as u32) << self.bits
    }

    /// Number of stations.
    #[allow(clippy::cast_possible_truncation, reason = "at most PARTS_MAX")]
    pub(crate) const fn count(self) -> u16 {
        self.intervals() as u16 + 1
    }

    /// Words of the table, of a job with or without a region.
    pub(crate) const fn words(self, in_region: bool) -> usize {
        let columns = if in_region { COLUMNS_OF_REGION } else { COLUMNS };
        columns * self.count() as usize
    }

    /// Path span of an interval.
    pub(crate) const fn span(self, interval: u16) -> u16 {
        interval >> self.bits
    }

    /// Place of a station.
    pub(crate) fn place(self, station: u16) -> SpanParameter {
        if station + 1 >= self.count() {
            return SpanParameter {
                span: self.spans.saturating_sub(1),
                fraction: u64::MAX,
            };
        }
        let within = u64::from(station & ((1 << self.bits) - 1));
        SpanParameter {
            span: self.span(station),
            fraction: within << (64 - u32::from(self.bits)),
        }
    }

    /// Place within an interval, `at` in units of 2^-31.
    pub(crate) fn place_within(self, interval: u16, at: i32) -> SpanParameter {
        let start = self.place(interval);
        let part = u64::from(at.cast_unsigned()) << (33 - u32::from(self.bits));
        SpanParameter {
            span: start.span,
            fraction: start.fraction.saturating_add(part),
        }
    }

    /// The interval of a place, and the place within it, units of 2^-31.
    #[allow(clippy::cast_possible_truncation, reason = "the upper bits")]
    pub(crate) const fn interval(self, place: SpanParameter) -> (u16, i32) {
        let bits = self.bits as u32;
        let within = (place.fraction >> (64 - bits)) as u16;
        let rest = (place.fraction << bits) >> 33;
        ((place.span << bits) | within, rest as i32)
    }

    /// Length of an interval in the path parameter.
    pub(crate) fn length(self, job: &Job<'_>, interval: u16) -> f32 {
        job.path_width(self.span(interval)) * power_of_two(-i32::from(self.bits))
    }
}
