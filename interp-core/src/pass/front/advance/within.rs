//! The part of the path over which fronts are made: in a region as far as that reaches and a few stations more, because the surface beyond may be one that the ball does not
//! fit. What is left out moves like the stations beside it.

use core::ops::DerefMut;

use super::stepping::REACH;
use super::{Advance, Task};
use crate::job::region::{FRACTION_BITS, end_of};
use crate::math::arith::to_f32;
use crate::pass::front::clip::stations_around;
use crate::pass::front::side::{Direction, SideCursor};
use crate::pass::front::table::{Column, Table, UNMEASURED};

/// In place of a front's distance: it is not known.
const GAP: i32 = i32::MIN;

impl Advance {
    /// Begins with the front after the first line of a cell that reaches so far along the path, places.
    pub(crate) const fn begin_within(&mut self, cursor: SideCursor, direction: Direction, extent: [i32; 2]) {
        self.begin(cursor, direction, true);
        self.extent = Some(extent);
    }

    /// The path of a point of the lines whose length is measured, spans times 2^32.
    pub(super) fn length_at(&self, spans: u16, number: u16, last: u16) -> u64 {
        const UP: u32 = 32 - FRACTION_BITS;
        let [from, to] = self.extent.map_or([0, u64::from(spans) << 32], |ends| {
            ends.map(|at| u64::from(at.cast_unsigned()) << UP)
        });
        let part = u64::from(number) * to.saturating_sub(from);
        from + part.checked_div(u64::from(last)).unwrap_or(0)
    }

    /// The whole path as a multiple of what is measured.
    pub(super) fn extent_inverse(&self, spans: u16) -> f32 {
        self.extent.map_or(1.0, |[from, to]| {
            to_f32(end_of(spans)) / to_f32(to.saturating_sub(from).max(1))
        })
    }

    /// Chooses the stations of the fronts.
    pub(super) fn choose_range(&mut self) {
        let last = self.stations.count().saturating_sub(1);
        let [from, to] = self
            .extent
            .map_or([0, last], |extent| stations_around(self.stations, extent));
        self.within = [from, to];
        self.stepped = [from.saturating_sub(REACH), to.saturating_add(REACH).min(last)];
    }

    pub(super) const fn is_within(&self, station: u16) -> bool {
        let [from, to] = self.within;
        from <= station && station <= to
    }

    /// Whether the interval after a station is in the range.
    pub(super) const fn is_interval_within(&self, station: u16) -> bool {
        let [from, to] = self.within;
        from <= station && station < to
    }

    pub(super) const fn is_stepped(&self, station: u16) -> bool {
        let [from, to] = self.stepped;
        from <= station && station <= to
    }

    /// What follows the steps.
    pub(super) const fn after_steps(&self, has_gaps: bool) -> Task {
        if self.is_level || self.is_short {
            Task::Level
        } else if has_gaps {
            Task::FillForwards
        } else {
            Task::Forwards
        }
    }

    /// The front is not known at a station.
    pub(super) fn leave_gap<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>, station: u16) {
        self.has_gaps = true;
        table.set_word(Column::Next, station, GAP);
        table.set_word(Column::Mark, station, UNMEASURED);
    }

    /// A gap takes the step of the station beside it, and what limits the front there.
    pub(super) fn fill<W: DerefMut<Target = [i32]>>(
        &self,
        table: &mut Table<W>,
        station: u16,
        beside: Option<u16>,
    ) {
        let Some(beside) = beside.filter(|beside| *beside < self.stations.count()) else {
            return;
        };
        let next = table.word(Column::Next, beside);
        if table.word(Column::Next, station) != GAP || next == GAP {
            return;
        }
        let step = next.saturating_sub(table.word(Column::Front, beside));
        let moved = table.word(Column::Front, station).saturating_add(step);
        table.set_word(Column::Next, station, moved.min(self.direction.cap()));
        for column in [Column::Rise, Column::Fall, Column::Turn, Column::Speed] {
            table.set_word(column, station, table.word(column, beside));
        }
    }
}
