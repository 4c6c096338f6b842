//! The bounds of the feed along one path, from standstill to standstill; see [`super`].
//!
//! A path is cut into cells by stations. [`Plan::begin`], [`Plan::add`] with each station in turn, [`Plan::settle`] once, then [`Plan::work`]
//! until it says that it is done: each of these is a fixed portion of work.

mod bounds;
mod cell;

use self::cell::{Cell, Most, between, whole_nm};
use super::demand::{Room, ZONE_JERK, cube_root, root, squared};
use super::profile::{WINDOW_MAX, braked, landing};
use super::{QUANTA_BITS, QUANTA_PER_MM, STEP_MAX};
use crate::job::CELLS_MAX;
use crate::math::number::{Bounded, to_f32, to_quanta};

/// Cells to each side that a bound may reach into, and that are looked through ahead of an acceleration.
const REACH: usize = 8;

/// Cells that are worked on in a tick in which the tool moves, and in one in which it stands and waits for the plan.
pub(crate) const CELLS_MOVING: u8 = 1;
pub(crate) const CELLS_STANDING: u8 = 3;

/// Cells that are merged, and whose time is taken, for one that is bounded: that is as much work.
const MERGED: u16 = 4;
const TIMED: u16 = 2;

/// Share of the greatest change of the acceleration that the feed is left near a jump: it comes twice, when it begins and when it leaves
/// the mean.
const ZONE_SHARE: f32 = 0.5 * ZONE_JERK;

/// Lengths of the mean that are tried.
const TRIES: u8 = 5;

/// Speed that a cell counts with at least, mm/s.
const SPEED_MIN: f32 = 1e-3;

/// Cells that a period may pass.
const CELLS_A_PERIOD: u8 = 4;

/// What the path is to be followed with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Top {
    /// Greatest speed that may be wanted, mm/s.
    pub(crate) speed: f32,
    /// Speed that is wanted as a rule, mm/s.
    pub(crate) usual: f32,
    /// s.
    pub(crate) period_s: f32,
}

/// What is being worked on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// Makes one cell of neighbours that are alike.
    Merge,
    /// Bounds, from the end backwards.
    Bounds,
    /// The time that they allow, forwards.
    Time,
    Done,
}

/// Bounds of the feed along a path.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    cells: [Cell; CELLS_MAX],
    count: u16,
    /// Arc up to each station, nm, however cells are merged.
    stations: [u32; CELLS_MAX],
    /// Cells that are left of those merged so far, and the most of the last of them.
    kept: u16,
    most: Most,
    stage: Stage,
    /// Cells that are still to be worked on.
    left: u16,
    /// Lengths of the mean that are still to be tried, and the best of those that were, with its time.
    tries: u8,
    longest: u8,
    best: (f32, u8),
    /// Speed at the start of the cell whose time is taken next, quanta a period; whether it was rising; periods so far.
    speed: f32,
    rises: bool,
    elapsed: f32,
    /// From this cell on, all braking is for the end.
    tail: u16,
    /// Least jerk along the path, mm/s^3; greatest acceleration, mm/s^2; time at the cells' own speeds, s.
    least: f32,
    accel: f32,
    time: f32,
    /// Length, quanta.
    pub(crate) end: i64,
    /// Greatest change of the acceleration in a period, and within the mean, quanta a period^2.
    change: f32,
    pub(crate) swing: f32,
    /// Periods of the mean.
    pub(crate) window: u8,
}

impl Plan {
    /// Of no path.
    pub(crate) const NONE: Self = Self {
        cells: [Cell::NONE; CELLS_MAX],
        count: 0,
        stations: [0; CELLS_MAX],
        kept: 0,
        most: Most::NONE,
        stage: Stage::Done,
        left: 0,
        tries: 0,
        longest: 1,
        best: (f32::MAX, 1),
        speed: 0.0,
        rises: false,
        elapsed: 0.0,
        tail: 0,
        least: f32::MAX,
        accel: 0.0,
        time: 0.0,
        end: 0,
        change: 0.0,
        swing: 0.0,
        window: 1,
    };

    /// A new path.
    pub(crate) const fn begin(&mut self) {
        self.count = 0;
        self.left = 0;
        self.stage = Stage::Done;
        self.least = f32::MAX;
        self.accel = 0.0;
        self.time = 0.0;
        self.end = 0;
    }

    /// Cells so far.
    pub(crate) const fn count(&self) -> u16 {
        self.count
    }

    /// Arc up to the station at which the so manieth cell began, before any were merged, quanta.
    pub(crate) fn start_of(&self, cell: u16) -> i64 {
        let before = cell.checked_sub(1);
        let end_nm = before.and_then(|before| self.stations.get(usize::from(before)));
        i64::from(end_nm.copied().unwrap_or(0)) << QUANTA_BITS
    }

    fn start_nm(&self, cell: u16) -> u32 {
        let before = cell.checked_sub(1).and_then(|before| self.cell(before));
        before.map_or(0, |before| before.end_nm)
    }

    fn cell(&self, cell: u16) -> Option<&Cell> {
        self.cells.get(usize::from(cell))
    }

    /// One more cell, of this length, mm. What its end leaves goes for the `back` cells before, too.
    pub(crate) fn add(&mut self, length: f32, room: &Room, back: usize, top: &Top) {
        self.end += quanta(length);
        self.least = self.least.at_most(room.jerk);
        self.accel = self.accel.at_least(room.accel);
        self.time += length / root(room.square).at_most(top.usual).at_least(SPEED_MIN);
        let scale = top.period_s * QUANTA_PER_MM;
        let square = squared((root(room.square) * scale).at_most(STEP_MAX));
        let accel = room.accel * top.period_s * scale;
        let index = usize::from(self.count);
        let Some(cell) = self.cells.get_mut(index) else {
            return;
        };
        let end_nm = whole_nm(self.end + (1 << (QUANTA_BITS - 1)));
        if let Some(station) = self.stations.get_mut(index) {
            *station = end_nm;
        }
        *cell = Cell {
            end_nm,
            square,
            accel,
            ..Cell::NONE
        };
        self.count += 1;
        for cell in self
            .cells
            .get_mut(index.saturating_sub(back)..index)
            .into_iter()
            .flatten()
        {
            cell.square = cell.square.at_most(square);
            cell.accel = cell.accel.at_most(accel);
        }
    }

    /// A bound of the square of the speed, (mm/s)^2, at the end of a cell, where the path jumps.
    pub(crate) fn gate(&mut self, cell: u16, square: f32, top: &Top) {
        if square >= squared(top.speed) {
            return;
        }
        if let Some(cell) = self.cells.get_mut(usize::from(cell)) {
            cell.jump = cell.jump.at_most(root(square) * top.period_s * QUANTA_PER_MM);
        }
    }

    /// The path is complete: chooses the mean. Its length is that of the fastest way from rest to rest over the whole path
    /// (acceleration, speed and arc as they are): `A/J`, `sqrt(v/J)` or `cbrt(s/(2 J))`, whichever is least. Where the speed varies, its
    /// mean over time counts.
    pub(crate) fn settle(&mut self, top: &Top) {
        let jerk = self.least;
        let arc = mm(self.end);
        let speed = arc / self.time.at_least(top.period_s);
        let time = (self.accel / jerk)
            .at_most(root(speed / jerk))
            .at_most(cube_root(0.5 * arc / jerk));
        self.longest = upwards(time / top.period_s);
        self.change = jerk * squared(top.period_s) * top.period_s * QUANTA_PER_MM;
        self.best = (f32::MAX, self.longest);
        self.stage = Stage::Merge;
        (self.left, self.kept) = (0, 0);
    }

    /// Begins anew with a mean of so many periods.
    fn take(&mut self, window: u8) {
        self.window = window;
        self.swing = self.change * f32::from(window);
        self.stage = Stage::Bounds;
        self.left = self.count;
        self.tail = self.count;
    }

    /// So many cells, one at a time; whether there is nothing left to do.
    ///
    /// A long mean allows a high acceleration, and a short one rides closer to what is narrow: which is faster is tried.
    pub(crate) fn work(&mut self, cells: u8) -> bool {
        for _ in 0..cells {
            match self.stage {
                Stage::Done => return true,
                Stage::Merge if self.left < self.count => {
                    for index in self.left..(self.left + MERGED).min(self.count) {
                        self.merge(index);
                    }
                }
                Stage::Merge => {
                    self.count = self.kept;
                    // On a leg nothing is to be traded.
                    self.tries = if self.count > 2 { TRIES } else { 0 };
                    self.take(self.longest);
                }
                Stage::Bounds => match self.left.checked_sub(1) {
                    Some(cell) => {
                        self.left = cell;
                        self.bound(usize::from(cell));
                    }
                    None if self.tries > 0 => {
                        self.stage = Stage::Time;
                        (self.speed, self.rises, self.elapsed) = (0.0, false, f32::from(self.window));
                    }
                    None => self.stage = Stage::Done,
                },
                Stage::Time if self.left < self.count => {
                    for index in self.left..(self.left + TIMED).min(self.count) {
                        self.pass_cell(index);
                        self.left += 1;
                    }
                }
                Stage::Time => self.judge(),
            }
        }
        self.stage == Stage::Done
    }

    /// Puts a cell behind those that are kept, or into the last of them.
    fn merge(&mut self, index: u16) {
        self.left += 1;
        let Some(&next) = self.cell(index) else {
            return;
        };
        let last = self.kept.checked_sub(1);
        let last = last.and_then(|last| self.cells.get_mut(usize::from(last)));
        if last.is_some_and(|last| last.absorb(&next, &mut self.most)) {
            return;
        }
        if let Some(place) = self.cells.get_mut(usize::from(self.kept)) {
            *place = next;
        }
        self.most = Most::of(&next);
        self.kept += 1;
    }

    /// The time of a try is known: the next one, or the best.
    fn judge(&mut self) {
        let (least, _) = self.best;
        if self.elapsed < least {
            self.best = (self.elapsed, self.window);
        }
        self.tries -= 1;
        let (_, best) = self.best;
        if self.tries > 0 {
            // 3/4, 1/2, 3/8, 1/4 of the longest.
            let parts = [2_u16, 3, 4, 6]
                .get(usize::from(self.tries) - 1)
                .copied()
                .unwrap_or(8);
            let window = u16::from(self.longest) * parts / 8;
            self.take(u8::try_from(window.max(1)).unwrap_or(1));
        } else if best == self.window {
            self.stage = Stage::Done;
        } else {
            self.take(best);
        }
    }

    /// Periods that a cell takes, near enough to compare: faster as it may, slower as it must; the speed that it is left with.
    fn pass_cell(&mut self, index: u16) {
        let Some(&cell) = self.cell(index) else {
            return;
        };
        let periods = f32::from(self.window);
        let length = between(self.start_nm(index), cell.end_nm);
        let accel = cell.accel_all.at_least(1.0);
        let enter = squared(self.speed).at_most(cell.enter);
        let leave = self
            .leave(index)
            .at_most(squared(cell.gate))
            .at_most(enter + 2.0 * accel * length);
        let peak = cell.square_all.at_most(0.5 * (enter + leave) + accel * length);
        let [enter, leave, peak] = [enter, leave, peak].map(root);
        let ramps = (2.0 * squared(peak) - squared(enter) - squared(leave)) / (2.0 * accel);
        self.elapsed +=
            (2.0 * peak - enter - leave) / accel + (length - ramps).at_least(0.0) / peak.at_least(1.0);
        if cell.gate < f32::MAX {
            // The way through its zone, instead of at the cell's speed.
            self.elapsed += 2.0 * periods * (1.0 - cell.gate / peak.at_least(cell.gate));
        }
        let rises = leave > enter;
        if self.rises && !rises {
            // From faster to slower there is a wait for the mean.
            self.elapsed += 0.5 * periods;
        }
        self.rises = rises;
        self.speed = leave;
    }

    /// The cell that a place is in, from this one on.
    pub(crate) fn cell_at(&self, mut cell: u16, place: i64) -> u16 {
        let place_nm = whole_nm(place);
        for _ in 0..CELLS_A_PERIOD {
            let end_nm = self.cell(cell).map_or(u32::MAX, |cell| cell.end_nm);
            if cell + 1 >= self.count || place_nm < end_nm {
                break;
            }
            cell += 1;
        }
        cell
    }

    /// Acceleration at a place, quanta a period^2: the cell's; near a jump little, so that the jerk is left to the jump.
    pub(crate) fn accel(&self, index: u16, place: i64) -> f32 {
        let Some(cell) = self.cell(index) else {
            return 0.0;
        };
        if self.is_in_zone(index, place) {
            cell.accel_all.at_most(ZONE_SHARE * self.swing)
        } else {
            cell.accel_all
        }
    }

    /// Whether a place is within the window's reach of a jump at one of its cell's ends.
    fn is_in_zone(&self, index: u16, place: i64) -> bool {
        let periods = f32::from(self.window);
        let near = |cell: Option<&Cell>| {
            cell.is_some_and(|cell| {
                let apart = to_f32((i64::from(cell.end_nm) << QUANTA_BITS) - place);
                cell.gate < f32::MAX && apart.abs() <= periods * cell.gate
            })
        };
        near(self.cell(index)) || near(index.checked_sub(1).and_then(|before| self.cell(before)))
    }

    /// Greatest speed at a place, quanta a period: the cell's own, and such that what follows is kept.
    pub(crate) fn ceiling(&self, index: u16, place: i64) -> f32 {
        let Some(cell) = self.cell(index) else {
            return 0.0;
        };
        let end = if index + 1 == self.count {
            self.end
        } else {
            i64::from(cell.end_nm) << QUANTA_BITS
        };
        let room = to_f32(end - place);
        let accel = cell.accel_all;
        let brake = if index + 1 >= self.tail {
            landing(accel, to_f32(self.end - place))
        } else {
            braked(self.leave(index), accel, room)
        };
        let mut speed = root(cell.square_all).at_most(brake);
        let periods = f32::from(self.window);
        if cell.gate < f32::MAX {
            let zone = periods * cell.gate;
            speed = speed.at_most(if room <= zone {
                cell.gate
            } else {
                braked(squared(cell.gate), accel, room - zone)
            });
        }
        let before = index.checked_sub(1).and_then(|before| self.cell(before));
        match before {
            Some(Cell { gate, end_nm, .. })
                if *gate < f32::MAX
                    && to_f32(place - (i64::from(*end_nm) << QUANTA_BITS)) <= periods * gate =>
            {
                speed.at_most(*gate)
            }
            _ => speed,
        }
    }

    /// Square of the speed that a cell may be left with.
    fn leave(&self, index: u16) -> f32 {
        if index + 1 < self.count {
            self.cell(index + 1).map_or(0.0, |after| after.enter)
        } else {
            0.0
        }
    }

    /// Whether a speed can be kept from a place over so many quanta, and braking still is in time.
    pub(crate) fn is_clear(&self, index: u16, place: i64, over: f32, speed: f32) -> bool {
        let last = place + to_quanta(over);
        let last_nm = whole_nm(last);
        let square = squared(speed);
        let (first, count) = (usize::from(index), usize::from(self.count));
        let cells = self.cells.get(first..(first + REACH).min(count));
        let mut at = index;
        let mut ahead = cells.unwrap_or_default().iter().peekable();
        while let Some(cell) = ahead.next() {
            if at + 1 >= self.count || last_nm < cell.end_nm {
                return last < self.end && speed <= self.ceiling(at, last);
            }
            let leave = ahead.peek().map_or(0.0, |after| after.enter);
            if square > leave || speed > cell.gate {
                return false;
            }
            at += 1;
        }
        false
    }
}

fn mm(quanta: i64) -> f32 {
    to_f32(quanta) * (1.0 / QUANTA_PER_MM)
}

/// Quanta of a length in mm, in two parts so that none of its 24 bits is lost.
pub(crate) fn quanta(mm: f32) -> i64 {
    to_quanta(mm * QUANTA_PER_MM)
}

/// The next whole number of periods, at least 1.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the cast saturates, and a NaN becomes 0"
)]
fn upwards(periods: f32) -> u8 {
    let whole = periods as u8;
    let more = if f32::from(whole) < periods { 1 } else { 0 };
    whole.saturating_add(more).clamp(1, WINDOW_MAX)
}
