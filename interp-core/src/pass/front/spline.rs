//! The curve of a front: a cubic spline with continuous curvature through the stations.

use core::ops::{Deref, DerefMut};

use crate::job::program::Job;
use crate::math::arith::{power_of_two, to_f32, truncated};
use crate::math::number::Bounded;
use crate::pass::front::side::{FINE_BITS, UNIT, WHOLE, coarse, fine};
use crate::pass::front::table::{Column, Table};

/// 2^-31, the unit of a place within an interval.
const WITHIN: f32 = power_of_two(-31);

/// The cubic between two stations: its coefficients in units of the front times 2^-shift, as fine as they allow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cubic {
    pub(super) shift: u32,
    pub(super) start: i32,
    pub(super) first: i32,
    pub(super) second: i32,
    pub(super) third: i32,
}

/// A point of a front: distance, and the first two derivatives of its share of the whole by the path parameter.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CurvePoint {
    pub(crate) at: i32,
    pub(crate) slope: f32,
    pub(crate) bend: f32,
}

impl Cubic {
    /// The cubic of an interval with this length.
    pub(crate) fn of<W: Deref<Target = [i32]>>(
        table: &Table<W>,
        [front, slope]: [Column; 2],
        interval: u16,
        length: f32,
    ) -> Self {
        let next = interval.saturating_add(1);
        let start = table.word(front, interval);
        let rise = table.word(front, next).wrapping_sub(start);
        let scale = length * to_f32(WHOLE);
        let ends = [interval, next].map(|station| table.real(slope, station) * scale);
        let [from, to] = ends.map(|slope| truncated(slope).unsigned_abs());
        let size = from.max(to).max(rise.unsigned_abs()).max(1);
        // The sums below are at most 8 times as large.
        let shift = size.leading_zeros().saturating_sub(4).min(FINE_BITS);
        let [from, to] = ends.map(|slope| truncated(slope * power_of_two(shift.cast_signed())));
        let rise = rise.wrapping_shl(shift);
        let rest = from.wrapping_add(to).wrapping_sub(rise.wrapping_mul(2));
        Self {
            shift,
            start,
            first: from,
            second: rise.wrapping_sub(from).wrapping_sub(rest),
            third: rest,
        }
    }

    /// The distance at a place within the interval (units of 2^-31), fine units.
    pub(crate) fn fine(&self, at: i32) -> i64 {
        let times = |value: i32| mul_31(value, at);
        let sum = self.second.wrapping_add(times(self.third));
        let sum = self.first.wrapping_add(times(sum));
        let rise = i64::from(sum).wrapping_mul(i64::from(at));
        fine(self.start).wrapping_add(rise >> (31 + self.shift).saturating_sub(FINE_BITS))
    }

    /// The distance at a place within the interval (units of 2^-31), units of the front.
    pub(crate) fn value(&self, at: i32) -> i32 {
        coarse(self.fine(at))
    }

    /// The point at a place within the interval.
    pub(crate) fn point(&self, at: i32, length: f32) -> CurvePoint {
        let t = to_f32(at) * WITHIN;
        let unit = UNIT * power_of_two(-self.shift.cast_signed());
        let [first, second, third] = [self.first, self.second, self.third].map(|value| to_f32(value) * unit);
        let inverse = 1.0 / length;
        CurvePoint {
            at: self.value(at),
            slope: (first + t * (2.0 * second + 3.0 * third * t)) * inverse,
            bend: (2.0 * second + 6.0 * third * t) * (inverse * inverse),
        }
    }

    /// The place at which a cubic crosses a distance that is between those of its ends, by bisection.
    pub(crate) fn crossing(&self, distance: i32) -> i32 {
        let (mut low, mut high) = (0, i32::MAX);
        let rises = self.start < distance;
        for _ in 0..31 {
            let middle = low + (high - low) / 2;
            if (self.value(middle) < distance) == rises {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}

/// `value at / 2^31`.
#[allow(clippy::cast_possible_truncation, reason = "at is below 2^31")]
const fn mul_31(value: i32, at: i32) -> i32 {
    ((value as i64 * at as i64) >> 31) as i32
}

/// Slope at the middle one of three stations' parabola, or at its first: rises over intervals of these lengths.
fn end_slope([near, far]: [f32; 2], [first, second]: [f32; 2]) -> f32 {
    let whole = first + second;
    near * (whole / (first * second)) - (near + far) * (first / (second * whole))
}

/// A sweep of the elimination, forwards (which also sets the slopes at both ends) or backwards: the rows of a portion from `station`. Returns whether rows are left.
pub(crate) fn eliminate<W: DerefMut<Target = [i32]>>(
    table: &mut Table<W>,
    job: &Job<'_>,
    [front, slope]: [Column; 2],
    station: u16,
) {
    let stations = table.stations();
    let last = stations.count().saturating_sub(1);
    let rise = |table: &Table<W>, interval: u16| {
        let ends = [interval, interval.saturating_add(1)].map(|at| table.word(front, at));
        let [from, to] = ends;
        to_f32(to.wrapping_sub(from)) * UNIT
    };
    let length = |interval: u16| stations.length(job, interval);
    if station == 0 || station >= last {
        let [near, far] = if station == 0 {
            [0, 1]
        } else {
            [last.saturating_sub(1), last.saturating_sub(2)]
        };
        let value = end_slope([rise(table, near), rise(table, far)], [length(near), length(far)]);
        table.set_real(slope, station, bounded(value, length(near)));
        table.set_real(Column::Scratch, station, 0.0);
        return;
    }
    let before = station - 1;
    let [back, on] = [before, station].map(|interval| 1.0 / length(interval));
    let right = 3.0 * (rise(table, before) * (back * back) + rise(table, station) * (on * on));
    let pivot = 1.0 / (2.0 * (back + on) - back * table.real(Column::Scratch, before));
    table.set_real(Column::Scratch, station, on * pivot);
    let value = (right - back * table.real(slope, before)) * pivot;
    table.set_real(slope, station, value);
}

/// A row of the back substitution.
pub(crate) fn substitute<W: DerefMut<Target = [i32]>>(
    table: &mut Table<W>,
    job: &Job<'_>,
    slope: Column,
    station: u16,
) {
    let stations = table.stations();
    if station == 0 || station + 1 >= stations.count() {
        return;
    }
    let next = table.real(slope, station + 1);
    let value = table.real(slope, station) - table.real(Column::Scratch, station) * next;
    let length = stations
        .length(job, station)
        .at_least(stations.length(job, station - 1));
    table.set_real(slope, station, bounded(value, length));
}

/// Limits the slope at a station so that no cubic between two stations before a boundary reaches beyond it: its Bernstein coefficients are before it.
pub(crate) fn keep_before<W: DerefMut<Target = [i32]>>(
    table: &mut Table<W>,
    job: &Job<'_>,
    [front, slope]: [Column; 2],
    station: u16,
    boundary: i32,
) {
    let stations = table.stations();
    if station >= stations.count() {
        return;
    }
    let value = table.real(slope, station);
    let (interval, beside) = if value > 0.0 {
        (station, station + 1)
    } else {
        (station.wrapping_sub(1), station.wrapping_sub(1))
    };
    let left = |station: u16| boundary.saturating_sub(table.word(front, station));
    if beside >= stations.count() || left(station) <= 0 || left(beside) <= 0 {
        return;
    }
    let most = 3.0 * to_f32(left(station)) * UNIT;
    let length = stations.length(job, interval);
    if value.abs() * length > most {
        table.set_real(
            slope,
            station,
            value.at_most(most / length).at_least(-most / length),
        );
    }
}

/// A slope that changes by the whole parameter over an interval of this length at most, so that no coefficient overflows.
fn bounded(slope: f32, length: f32) -> f32 {
    let most = 1.0 / length;
    slope.at_most(most).at_least(-most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::stations::Stations;
    use std::vec;

    const COLUMNS: [Column; 2] = [Column::Front, Column::Slope];

    /// The cubic has its stations' distances and slopes, in fine units and whole ones, and crosses a distance where it is.
    #[test]
    fn a_cubic_between_stations() {
        let stations = Stations::most(1);
        let mut words = vec![0; stations.words(false)];
        let mut table = Table::new(words.as_mut_slice(), stations, [0, 1]);
        let (low, high) = (3_000_000, 7_500_001);
        table.set_word(Column::Front, 4, low);
        table.set_word(Column::Front, 5, high);
        table.set_real(Column::Slope, 4, 0.5);
        table.set_real(Column::Slope, 5, 2.0);
        let length = 1.0 / 64.0;
        let cubic = Cubic::of(&table, COLUMNS, 4, length);
        assert_eq!(cubic.value(0), low);
        assert!((cubic.value(i32::MAX) - high).abs() <= 1);
        for (at, slope) in [(0, 0.5_f32), (i32::MAX, 2.0)] {
            assert!((cubic.point(at, length).slope - slope).abs() < 1e-4);
        }
        let middle = i32::midpoint(low, high);
        let at = cubic.crossing(middle);
        assert!((cubic.value(at) - middle).abs() <= 1);
        // By the cubic's formula, to a fiftieth of a unit.
        let t = f64::from(at) / 2_f64.powi(31);
        let [from, to] = [0.5, 2.0].map(|slope: f64| slope * f64::from(length) * f64::from(WHOLE));
        let rise = f64::from(high - low);
        let rest = from + to - 2.0 * rise;
        let want = f64::from(low) + t * (from + t * (rise - from - rest + t * rest));
        let got = cubic.fine(at) as f64 / f64::from(1 << FINE_BITS);
        assert!((got - want).abs() < 0.1, "{got} for {want}");
    }

    /// Stations are even parts of each span, the last one at the end; an interval and the place in it are those of a place.
    #[test]
    fn places_of_stations() {
        for spans in [1, 3, 64, 128] {
            let stations = Stations::most(spans);
            assert!(stations.count() <= 513);
            for interval in 0..stations.count() - 1 {
                let place = stations.place_within(interval, 1 << 30);
                assert_eq!(stations.interval(place), (interval, 1 << 30));
            }
        }
    }
}
