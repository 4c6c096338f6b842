//! The crests between the current front and the next one, measured in each interval and at the ends.

use core::ops::DerefMut;

use super::{Advance, MEASUREMENTS, ROWS_A_PORTION, Task};
use crate::job::program::Job;
use crate::math::arith::{to_f32, truncated};
use crate::math::number::Bounded;
use crate::pass::front::crest::{CURRENT, NEXT, Place, Tools};
use crate::pass::front::side::UNIT;
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Table, UNMEASURED};

/// Greatest scallop height beside a straight front, as a share of the limit.
const LEVEL_MARGIN: f32 = 0.9999;
/// A front is lowered by this many times the excess of its crests.
const LOWER: f32 = 1.1;
/// Factor on the excess after the last measurement, because the lowered front is not measured again.
const LAST: i32 = 2;
/// Places in each interval at which crests may be measured; in an interval that is not bent, the middle alone.
const PLACES: u16 = 4;
/// Bend of a front over an interval from which the interval counts as bent, as a share of the step there.
const BENT: f32 = 0.06;
/// [`BENT`] of a pass with half the stations (`Advance::is_coarse`).
const BENT_COARSE: f32 = 0.02;
/// Greatest measured scallop height, as a share of the limit: crests between the places are higher.
const MEASURED_MARGIN: f32 = 0.990;
/// [`MEASURED_MARGIN`] of a pass with half the stations.
const MEASURED_MARGIN_COARSE: f32 = 0.983;
/// Intervals on either side of a crest that is too high whose crests are measured again.
const BESIDE: u16 = 2;

impl Advance {
    /// Places at which crests are measured: four in each interval, its middle first, then its start and the quarters; at last both ends.
    pub(super) fn crest_place(&self, number: u16) -> Place {
        let intervals = self.stations.count().saturating_sub(1);
        let station = number / PLACES;
        if station < intervals {
            let at = match number % PLACES {
                0 => 1 << 30,
                1 => 0,
                2 => 1 << 29,
                _ => 3 << 29,
            };
            (station, at)
        } else if number == PLACES * intervals {
            (0, 0)
        } else {
            (intervals.saturating_sub(1), i32::MAX)
        }
    }

    /// Begins a round over all crests.
    pub(super) fn begin_crests(&mut self) {
        self.again_before = 0;
        self.search.begin(self.crest_place(0));
    }

    /// The station whose mark stands for a place.
    fn mark_of(&self, number: u16) -> u16 {
        let intervals = self.stations.count().saturating_sub(1);
        let station = number / PLACES;
        if station < intervals {
            station
        } else if number == PLACES * intervals {
            0
        } else {
            intervals.saturating_sub(1)
        }
    }

    /// Whether the front is bent so much in an interval that a crest away from the middle may be the highest.
    fn is_bent<W: DerefMut<Target = [i32]>>(&self, job: &Job<'_>, table: &Table<W>, station: u16) -> bool {
        let length = self.stations.length(job, station);
        let [front, next] = [CURRENT, NEXT].map(|columns| Cubic::of(table, columns, station, length));
        let step = to_f32(next.value(1 << 30).saturating_sub(front.value(1 << 30))) * UNIT;
        let bent = if self.is_coarse { BENT_COARSE } else { BENT };
        let [start, end] = [0, i32::MAX].map(|at| next.point(at, length).bend.abs());
        // It is linear between.
        !(start.at_least(end) * length * length <= bent * step)
    }

    /// Whether the crest is to be measured at a place.
    fn has_crest<W: DerefMut<Target = [i32]>>(&self, table: &Table<W>, number: u16) -> bool {
        let places = PLACES * self.stations.count().saturating_sub(1);
        let station = self.mark_of(number);
        let bit = if number < places { 1 } else { 2 };
        let is_there = if number < places {
            self.is_interval_within(station)
        } else {
            self.is_within(if number == places { 0 } else { station + 1 })
        };
        if table.word(Column::Mark, station) & bit == 0 || !is_there {
            return false;
        }
        let [low, high] = [station, station.saturating_add(1)].map(|at| table.word(Column::Front, at));
        let is_before = |front: i32| front < self.direction.end;
        is_before(low) || is_before(high)
    }

    /// Passes over places at which no crest has to be measured. Returns whether it has found one at which a crest has to be.
    pub(super) fn finds_crest<W: DerefMut<Target = [i32]>>(
        &mut self,
        job: &Job<'_>,
        table: &mut Table<W>,
    ) -> bool {
        for _ in 0..ROWS_A_PORTION {
            if self.search.next > 0 || self.has_crest(table, self.station) {
                return true;
            }
            self.end_crest(job, table);
            if self.task != Task::Crest {
                break;
            }
        }
        false
    }

    pub(super) fn measure_crest<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) {
        let margin = match (self.is_level, self.is_coarse) {
            (true, _) => LEVEL_MARGIN,
            (false, false) => MEASURED_MARGIN,
            (false, true) => MEASURED_MARGIN_COARSE,
        };
        let mut tools = Tools {
            patch: &mut self.patch,
            job,
            cursor: &mut self.cursor,
            direction: &self.direction,
            is_point_ahead: self.is_point_ahead,
        };
        let Some(excess) = self.search.work(&mut tools, table, margin) else {
            return;
        };
        // A front that the last measurement lowers is not measured again.
        let is_last = self.measured + 1 >= MEASUREMENTS;
        let excess = if is_last {
            excess.saturating_mul(LAST)
        } else {
            excess
        };
        if excess > 0 {
            self.measure_again(table);
        }
        // The front is lowered at the crest, and where its ball is, of the part that is made.
        let [from, to] = self.within;
        let foot = self.search.foot().min(to.saturating_sub(1)).max(from);
        self.note_excess(table, self.mark_of(self.station), excess);
        self.note_excess(table, foot, excess);
        self.end_crest(job, table);
    }

    /// The crests beside one that is too high are to be measured again once the front is lowered: it may be lowered some intervals from here.
    fn measure_again<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>) {
        let station = self.mark_of(self.station);
        for beside in [1, BESIDE] {
            let at = station.saturating_sub(beside);
            table.set_word(Column::Mark, at, UNMEASURED);
        }
        self.again_before = station.saturating_add(BESIDE + 1);
    }

    /// Goes on to the next place: from the middle of an interval that is not bent to the next one.
    fn end_crest<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) {
        let places = PLACES * self.stations.count().saturating_sub(1);
        let station = self.mark_of(self.station);
        let is_middle = self.station < places && self.station.is_multiple_of(PLACES);
        if is_middle && (table.word(Column::Mark, station) & 1 == 0 || !self.is_bent(job, table, station)) {
            self.station += PLACES - 1;
        }
        let number = self.station;
        let bit = if number < places { 1 } else { 2 };
        let is_over = number >= places || (number + 1).is_multiple_of(PLACES);
        if is_over && station >= self.again_before {
            let mark = table.word(Column::Mark, station);
            table.set_word(Column::Mark, station, mark & !bit);
        }
        if number + 1 >= places {
            self.again_before = 0;
        }
        self.next_station(places + 2);
        if self.task == Task::Crest {
            let place = self.crest_place(self.station);
            self.search.begin(place);
        }
    }

    /// Notes that the front is too far at an interval.
    pub(super) fn note_excess<W: DerefMut<Target = [i32]>>(
        &mut self,
        table: &mut Table<W>,
        station: u16,
        excess: i32,
    ) {
        if excess > 0 {
            self.is_lowered = true;
            let lower = truncated(LOWER * to_f32(excess)).max(1);
            self.excess = self.excess.max(lower);
            for at in [station, station + 1] {
                let most = table.word(Column::Scratch, at).max(lower);
                table.set_word(Column::Scratch, at, most);
            }
        }
    }
}
