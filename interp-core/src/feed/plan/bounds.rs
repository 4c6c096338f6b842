//! The bounds of one cell, by what it asks, its neighbours ask, and what follows needs.

use super::cell::{Cell, between};
use super::{Plan, REACH};
use crate::feed::QUANTA_BITS;
use crate::feed::demand::squared;
use crate::feed::profile::{braked, landing};
use crate::math::number::{Bounded, to_f32};

impl Plan {
    /// Bounds of a cell, those of all after it known.
    ///
    /// The tool is where the mean of the last n places is: it keeps a speed c somewhere if the places do within n c of there. So what a
    /// cell asks goes for all cells as near as that. A cell that was not looked at, at a distance d, can only ask so of speeds
    /// above d/n.
    pub(super) fn bound(&mut self, index: usize) {
        let Some(&cell) = self.cells.get(index) else {
            return;
        };
        let count = usize::from(self.count);
        let periods = f32::from(self.window);
        let squared_periods = squared(periods);
        let start_nm = index
            .checked_sub(1)
            .and_then(|i| self.cells.get(i))
            .map_or(0, |cell| cell.end_nm);
        let (mut square, mut accel) = (cell.square, cell.accel.at_most(self.swing));
        let mut ask = |cell: &Cell, distance: f32| {
            if squared_periods * cell.square >= squared(distance) {
                square = square.at_most(cell.square);
                accel = accel.at_most(cell.accel);
            }
        };
        let (first, last) = (index.saturating_sub(REACH), (index + 1 + REACH).min(count));
        let mut from = cell.end_nm;
        for other in self.cells.get(index + 1..last).unwrap_or_default() {
            ask(other, between(cell.end_nm, from));
            from = other.end_nm;
        }
        let after = if last < count {
            between(cell.end_nm, from)
        } else {
            f32::MAX
        };
        for other in self.cells.get(first..index).unwrap_or_default() {
            ask(other, between(other.end_nm, start_nm));
        }
        let before = match first.checked_sub(1).and_then(|i| self.cells.get(i)) {
            Some(unseen) => between(unseen.end_nm, start_nm),
            None => f32::MAX,
        };
        square = square.at_most(squared(after.at_most(before) / periods));
        let length = between(start_nm, cell.end_nm);
        let mut gate = cell.jump;
        if gate < f32::MAX {
            // Within n c to each side, which the cells have room for; and the feed hardly changes there, so that what follows has to be
            // kept from its end on.
            if let Some(next) = self.cells.get(index + 1) {
                let beyond = between(cell.end_nm, next.end_nm);
                gate = gate.at_most(length.at_most(beyond) / periods);
                gate = gate.at_most(self.brake_in(index + 1, beyond - periods * gate));
            }
        }
        let next = self
            .cells
            .get(index + 1)
            .filter(|_| index + 1 < usize::from(self.count));
        let ends = usize::from(self.tail) == index + 1;
        let mut enter = if ends {
            // No later cell brakes less, so that what is planned for the end from here on is kept.
            accel = accel.at_most(next.map_or(f32::MAX, |next| next.accel_all));
            squared(landing(
                accel,
                to_f32(self.end - (i64::from(start_nm) << QUANTA_BITS)),
            ))
        } else {
            squared(braked(next.map_or(0.0, |next| next.enter), accel, length))
        };
        if gate < f32::MAX {
            enter = enter.at_most(squared(braked(squared(gate), accel, length - periods * gate)));
        } else if ends && enter < square {
            self.tail -= 1;
        }
        enter = enter.at_most(square);
        if let Some(cell) = self.cells.get_mut(index) {
            (cell.square_all, cell.accel_all, cell.gate, cell.enter) = (square, accel, gate, enter);
        }
    }

    /// Greatest speed in a cell, so many quanta before its end, for what follows it.
    fn brake_in(&self, index: usize, room: f32) -> f32 {
        let Some(cell) = self.cells.get(index) else {
            return 0.0;
        };
        let leave = self
            .cells
            .get(index + 1)
            .filter(|_| index + 1 < usize::from(self.count));
        let mut speed = braked(leave.map_or(0.0, |leave| leave.enter), cell.accel_all, room);
        if cell.gate < f32::MAX {
            let before = room - f32::from(self.window) * cell.gate;
            speed = speed.at_most(braked(squared(cell.gate), cell.accel_all, before));
        }
        speed
    }
}
