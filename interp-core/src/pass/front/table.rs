//! The stations of the fronts, a column of words for each quantity, in the job store after the job's words.

use core::ops::{Deref, DerefMut};

use crate::job::stations::Stations;

/// Mark of an interval whose crests, within it and at the end of the pass, are not measured.
pub(crate) const UNMEASURED: i32 = 3;

/// Columns of one front, its distances and slopes, by their number: up to 2, the last one in jobs with a region only.
pub(crate) type Pair = u8;

/// A pair other than these, the first one.
pub(crate) const fn free_pair(used: [Pair; 2]) -> Pair {
    match used {
        [0, 1] | [1, 0] => 2,
        [0, _] | [_, 0] => 1,
        _ => 0,
    }
}

/// A column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Column {
    /// The current front, units of the side parameter's 2^-28, and its slope (f32).
    Front,
    Slope,
    /// The next front.
    Next,
    NextSlope,
    /// Greatest slope upwards and downwards (f32).
    Rise,
    Fall,
    /// Change of the slope per radian of turn (f32).
    Turn,
    /// Stations of the convex hull.
    Step,
    /// Elimination of the spline (f32), then by how much a station is to be lowered.
    Scratch,
    /// The step in the middle of the interval from the station, units of the fronts.
    Middle,
    /// Length of the pass per path parameter, mm (f32).
    Speed,
    /// Path parameter (f32).
    Abscissa,
    /// Whether the crest in the interval from the station has still to be measured.
    Mark,
}

/// A column of a pair.
const fn column_of(pair: Pair, slope: usize) -> usize {
    match pair {
        0 => slope,
        1 => 2 + slope,
        _ => Column::Mark as usize + 1 + slope,
    }
}

/// The table: for reading in the tick, for writing in the planning.
#[derive(Debug)]
pub(crate) struct Table<W> {
    words: W,
    stations: Stations,
    /// The columns of the current front and of the next one.
    pairs: [Pair; 2],
}

impl<W: Deref<Target = [i32]>> Table<W> {
    pub(crate) const fn new(words: W, stations: Stations, pairs: [Pair; 2]) -> Self {
        Self {
            words,
            stations,
            pairs,
        }
    }

    pub(crate) const fn stations(&self) -> Stations {
        self.stations
    }

    const fn index(&self, column: Column, station: u16) -> usize {
        let [current, next] = self.pairs;
        let column = match column {
            Column::Front => column_of(current, 0),
            Column::Slope => column_of(current, 1),
            Column::Next => column_of(next, 0),
            Column::NextSlope => column_of(next, 1),
            other => other as usize,
        };
        column * self.stations.count() as usize + station as usize
    }

    /// A word; 0 outside the table.
    #[inline(always)]
    pub(crate) fn word(&self, column: Column, station: u16) -> i32 {
        self.words.get(self.index(column, station)).copied().unwrap_or(0)
    }

    /// A float.
    #[inline(always)]
    pub(crate) fn real(&self, column: Column, station: u16) -> f32 {
        f32::from_bits(self.word(column, station).cast_unsigned())
    }
}

impl<W: DerefMut<Target = [i32]>> Table<W> {
    #[inline(always)]
    pub(crate) fn set_word(&mut self, column: Column, station: u16, value: i32) {
        let index = self.index(column, station);
        if let Some(word) = self.words.get_mut(index) {
            *word = value;
        }
    }

    /// Lowers a station of the next front; the crests beside it are to be measured again.
    pub(crate) fn lower(&mut self, station: u16, to: i32) {
        if to < self.word(Column::Next, station) {
            self.set_word(Column::Next, station, to);
            for at in station.saturating_sub(2)..station.saturating_add(2) {
                self.set_word(Column::Mark, at, UNMEASURED);
            }
        }
    }

    #[inline(always)]
    pub(crate) fn set_real(&mut self, column: Column, station: u16, value: f32) {
        self.set_word(column, station, value.to_bits().cast_signed());
    }
}
