//! Limits of a front, which only lower it: its slope, how far it turns from station to station towards the next front (where the front's normals converge, a corner would form)
//! and away from it.

use core::ops::DerefMut;

use crate::job::program::Job;
use crate::math::arith::{to_f32, truncated};
use crate::math::number::Bounded;
use crate::pass::front::side::{UNIT, WHOLE};
use crate::pass::front::table::{Column, Table};

/// Greatest turn from interval to interval towards the next front, rad.
const TURN: f32 = 0.10;
/// Greatest turn from interval to interval away from the next front, rad.
const TURN_BACK: f32 = 0.15;
/// Unit of the hull's ordinates: bits that are dropped of the front's.
const HULL_BITS: u32 = 6;
/// Greatest second difference that is added for the hull, a share of the whole side parameter.
const BEND_MAX: f32 = 0.1;
/// Twice the largest sum of second differences over a front, in wholes: the hull's ordinates hold 512.
const SUM_MAX: f32 = 900.0;
/// Members that leave the hull in one call.
const MEMBERS_MAX: u8 = 8;
/// Change of the front that is left as it is, units of the hull.
const HULL_NOISE: i32 = 1;

/// The sweeps over a front.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limiter {
    /// Greatest turn per mm of the pass.
    pub(crate) turn_per_mm: f32,
    /// A station is being added to the hull.
    is_open: bool,
    /// State of the hull: its size, and the sums of its second differences.
    size: u16,
    slope: f32,
    sum: f32,
    /// The segment of the hull that is applied.
    segment: u16,
}

impl Limiter {
    pub(crate) const NONE: Self = Self {
        turn_per_mm: f32::INFINITY,
        is_open: false,
        size: 0,
        slope: 0.0,
        sum: 0.0,
        segment: 0,
    };

    /// Sweeps over the interval from a station to its neighbour, forwards or backwards.
    pub(crate) fn sweep<W: DerefMut<Target = [i32]>>(
        &self,
        table: &mut Table<W>,
        job: &Job<'_>,
        station: u16,
        forwards: bool,
    ) {
        let stations = table.stations();
        let last = stations.count().saturating_sub(1);
        let (to, interval, before) = if forwards {
            (station.saturating_add(1), station, station.checked_sub(1))
        } else {
            let before = station.checked_add(1).filter(|before| *before <= last);
            (station.saturating_sub(1), station.saturating_sub(1), before)
        };
        if to > last || to == station {
            return;
        }
        let length = stations.length(job, interval);
        let limit = if forwards { Column::Rise } else { Column::Fall };
        let steepest = table.real(limit, station).at_most(table.real(limit, to));
        let at = table.word(Column::Next, station);
        let mut most = steepest * length;
        if let Some(before) = before {
            let back = stations.length(job, if forwards { before } else { station });
            let came = to_f32(at.wrapping_sub(table.word(Column::Next, before))) * UNIT / back;
            let turn = self.turn(table, station, length, TURN);
            let slope = if came > 0.0 { came + turn } else { 0.5 * turn };
            most = (slope * length).at_most(most);
        }
        let most = at.saturating_add(truncated(most.at_most(1.5) * to_f32(WHOLE)));
        if table.word(Column::Next, to) > most {
            table.lower(to, most);
        }
    }

    /// Greatest change of the slope over an interval.
    fn turn<W: DerefMut<Target = [i32]>>(
        &self,
        table: &Table<W>,
        station: u16,
        length: f32,
        most: f32,
    ) -> f32 {
        let speed = table.real(Column::Speed, station);
        let most = (self.turn_per_mm * speed * length).at_most(most);
        most * table.real(Column::Turn, station)
    }

    /// Begins the convex hull.
    pub(crate) const fn begin(&mut self) {
        (self.size, self.slope, self.sum, self.segment) = (0, 0.0, 0.0, 0);
        self.is_open = false;
    }

    /// Adds a station to the hull of the front and a parabola of the greatest turn. The ordinates replace the column of slopes. False where the hull has to be
    /// gone back further, in another call.
    pub(crate) fn add<W: DerefMut<Target = [i32]>>(
        &mut self,
        table: &mut Table<W>,
        job: &Job<'_>,
        station: u16,
    ) -> bool {
        if !self.is_open {
            self.is_open = true;
            self.set_ordinate(table, job, station);
        }
        for _ in 0..MEMBERS_MAX {
            if self.size < 2 || self.is_convex(table, station) {
                table.set_word(Column::Step, self.size, i32::from(station));
                self.size += 1;
                self.is_open = false;
                return true;
            }
            self.size -= 1;
        }
        false
    }

    fn set_ordinate<W: DerefMut<Target = [i32]>>(
        &mut self,
        table: &mut Table<W>,
        job: &Job<'_>,
        station: u16,
    ) {
        let stations = table.stations();
        if station > 0 {
            let length = stations.length(job, station - 1);
            self.sum += self.slope * length;
            let turn = self.turn(table, station, length, TURN_BACK);
            let intervals = f32::from(stations.count().saturating_sub(1)).at_least(1.0);
            let bend = BEND_MAX.at_most(SUM_MAX / (intervals * intervals));
            self.slope += turn.at_most(bend / length);
        }
        let front = table.word(Column::Next, station) >> HULL_BITS;
        let scale = to_f32(WHOLE >> HULL_BITS);
        let ordinate = front.saturating_add(truncated(self.sum * scale));
        table.set_word(Column::NextSlope, station, ordinate);
    }

    /// Whether the hull's last segment is below the line from its end to a station.
    fn is_convex<W: DerefMut<Target = [i32]>>(&self, table: &Table<W>, station: u16) -> bool {
        let top = self.member(table, self.size.saturating_sub(1));
        let below = self.member(table, self.size.saturating_sub(2));
        let slope = |from: u16, to: u16| {
            let rise = table
                .word(Column::NextSlope, to)
                .wrapping_sub(table.word(Column::NextSlope, from));
            to_f32(rise) / (abscissa(table, to) - abscissa(table, from))
        };
        slope(below, top) < slope(top, station)
    }

    fn member<W: DerefMut<Target = [i32]>>(&self, table: &Table<W>, index: u16) -> u16 {
        let last = table.stations().count().saturating_sub(1);
        u16::try_from(table.word(Column::Step, index)).map_or(last, |station| station.min(last))
    }

    /// Lowers a station to the hull, in the order of the stations.
    pub(crate) fn apply<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>, station: u16) {
        let end = self.segment.saturating_add(1);
        if end >= self.size {
            return;
        }
        let (from, to) = (self.member(table, self.segment), self.member(table, end));
        if station >= to {
            self.segment = end;
            return;
        }
        if station <= from {
            return;
        }
        let [low, high, own] = [from, to, station].map(|at| table.word(Column::NextSlope, at));
        let [x0, x1, x] = [from, to, station].map(|at| abscissa(table, at));
        let share = (x - x0) / (x1 - x0);
        let hull = low.saturating_add(truncated(to_f32(high.wrapping_sub(low)) * share));
        let excess = own.saturating_sub(hull);
        if excess > HULL_NOISE {
            let lower = table
                .word(Column::Next, station)
                .saturating_sub(excess.saturating_mul(1 << HULL_BITS));
            table.lower(station, lower);
        }
    }
}

fn abscissa<W: DerefMut<Target = [i32]>>(table: &Table<W>, station: u16) -> f32 {
    table.real(Column::Abscissa, station)
}
