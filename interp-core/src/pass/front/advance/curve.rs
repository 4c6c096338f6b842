//! The curve through the next front's stations: compares it with the steps between the stations, lowers it, and checks its bends.

use core::ops::DerefMut;

use super::{Advance, Made};
use crate::job::program::Job;
use crate::math::arith::{to_f32, truncated};
use crate::math::number::Bounded;
use crate::pass::front::crest::{CURRENT, NEXT};
use crate::pass::front::side::UNIT;
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Table};

/// Greatest turn per length of an accepted front, as a multiple of the limit.
const SHARP: f32 = 2.5;
/// Greatest turn of an accepted front between stations, rad.
const SHARP_TURN: f32 = 0.5;
/// Tolerance of the curve between stations, over the step there.
const MIDDLE_TOLERANCE: f32 = 1.0005;

impl Advance {
    /// Compares the curve with the step in the middle of an interval.
    pub(super) fn compare<W: DerefMut<Target = [i32]>>(
        &mut self,
        job: &Job<'_>,
        table: &mut Table<W>,
        station: u16,
    ) {
        if station + 1 >= self.stations.count() || !self.is_interval_within(station) {
            return;
        }
        let length = self.stations.length(job, station);
        let [current, next] = [CURRENT, NEXT].map(|columns| Cubic::of(table, columns, station, length));
        let [low, high] = [&current, &next].map(|cubic| cubic.value(1 << 30));
        let boundary = self.direction.end;
        if low.saturating_add(high) / 2 > boundary.saturating_add(boundary / 20) {
            return;
        }
        let step = table.word(Column::Middle, station).saturating_sub(low);
        let most = low.saturating_add(truncated(MIDDLE_TOLERANCE * to_f32(step)));
        let excess = high.saturating_sub(most).max(self.beyond(table, station, &next));
        self.note_excess(table, station, excess);
    }

    /// By how much the curve between two stations before the boundary is beyond it: the pass would have corners there.
    fn beyond<W: DerefMut<Target = [i32]>>(&self, table: &Table<W>, station: u16, curve: &Cubic) -> i32 {
        let boundary = self.direction.end;
        let ends = [station, station.saturating_add(1)].map(|at| table.word(Column::Next, at));
        let mut beyond = 0;
        if ends.iter().all(|front| *front < boundary) {
            for at in curve.extrema().into_iter().flatten() {
                beyond = beyond.max(curve.value(at).saturating_sub(boundary).saturating_add(1));
            }
        }
        beyond
    }

    /// Lowers a station by the excess measured beside it.
    pub(super) fn lower<W: DerefMut<Target = [i32]>>(&self, table: &mut Table<W>, station: u16) {
        let by = table.word(Column::Scratch, station);
        if by > 0 {
            let lower = table.word(Column::Next, station).saturating_sub(by);
            table.lower(station, lower);
            self.floor(table, station);
        }
    }

    /// A front never goes back.
    pub(super) fn floor<W: DerefMut<Target = [i32]>>(&self, table: &mut Table<W>, station: u16) {
        let front = table.word(Column::Front, station);
        if table.word(Column::Next, station) < front {
            table.set_word(Column::Next, station, front);
        }
    }

    /// At a pole every distance is the same: the front goes on as beside it, once that is limited.
    pub(super) fn at_poles<W: DerefMut<Target = [i32]>>(&self, table: &mut Table<W>, station: u16) {
        let last = self.stations.count().saturating_sub(1);
        let [at_start, at_end] = self.poles;
        let ends = [
            (at_start && station == 2, [0, 1, 2]),
            (
                at_end && station == last,
                [last, last.saturating_sub(1), last.saturating_sub(2)],
            ),
        ];
        for (is_due, [pole, near, far]) in ends {
            if is_due {
                let [near, far] = [near, far].map(|at| table.word(Column::Next, at));
                let most = near
                    .saturating_add(near.saturating_sub(far))
                    .min(self.direction.cap());
                table.lower(pole, most);
                self.floor(table, pole);
            }
        }
    }

    /// Takes a station into account of the finished front.
    pub(super) fn finish_station<W: DerefMut<Target = [i32]>>(
        &mut self,
        job: &Job<'_>,
        table: &mut Table<W>,
        station: u16,
    ) {
        let (front, next) = (
            table.word(Column::Front, station),
            table.word(Column::Next, station),
        );
        if station + 1 == self.stations.count() {
            self.made = Some(Made::Beyond);
            self.advanced = 0.0;
            self.is_sharp = false;
            self.is_next_straight = true;
            self.shift = i32::MAX;
        } else if self.is_interval_within(station) {
            self.look_at_bend(job, table, station);
        }
        table.set_word(Column::Scratch, station, 0);
        if !self.is_within(station) {
            return;
        }
        self.is_next_straight &= table.real(Column::NextSlope, station) == 0.0;
        if next < self.direction.end {
            self.made = Some(if self.is_short {
                Made::Line(next)
            } else {
                Made::Front
            });
        }
        if front < self.direction.end {
            self.shift = self.shift.min(next.saturating_sub(front));
            let advance = to_f32(next.saturating_sub(front)) * UNIT;
            self.advanced = self.advanced.at_least(advance);
        }
    }

    /// Looks whether the curve turns too sharply at a station.
    fn look_at_bend<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &Table<W>, station: u16) {
        if table
            .word(Column::Next, station)
            .min(table.word(Column::Next, station + 1))
            >= self.direction.end
        {
            return;
        }
        let length = self.stations.length(job, station);
        let bend = Cubic::of(table, NEXT, station, length).point(0, length).bend;
        let speed = table.real(Column::Speed, station);
        let per_mm = bend.abs() / (table.real(Column::Turn, station) * speed);
        let most = (SHARP * self.limiter.turn_per_mm).at_most(SHARP_TURN / (speed * length));
        self.is_sharp |= per_mm > most;
    }
}
