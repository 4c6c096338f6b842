//! The cells of a path, and which of them can be one.

use crate::feed::QUANTA_BITS;
use crate::math::number::Bounded;

/// Most that squares of speeds, and accelerations, of cells may be apart for one cell to be made of them: it costs the feed half a percent
/// at most.
const ALIKE: f32 = 1.01;

/// A cell of a path, and the station at its end. Speeds are quanta a period, accelerations quanta a period^2.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    /// Arc from the path's start to the cell's end, nm.
    pub(super) end_nm: u32,
    /// Square of the greatest speed, and acceleration, by the cell alone.
    pub(super) square: f32,
    pub(super) accel: f32,
    /// The same with what neighbours ask.
    pub(super) square_all: f32,
    pub(super) accel_all: f32,
    /// Greatest speed at the cell's end, where the path jumps, and what of it is used: within the periods of the mean.
    pub(super) jump: f32,
    pub(super) gate: f32,
    /// Square of the greatest speed at the cell's start from which all that follows can be kept.
    pub(super) enter: f32,
}

impl Cell {
    pub(super) const NONE: Self = Self {
        end_nm: 0,
        square: 0.0,
        accel: 0.0,
        square_all: 0.0,
        accel_all: 0.0,
        jump: f32::MAX,
        gate: f32::MAX,
        enter: 0.0,
    };
}

/// The greatest square and acceleration of the cells that one is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Most {
    square: f32,
    accel: f32,
}

impl Most {
    /// Of nothing.
    pub(super) const NONE: Self = Self {
        square: 0.0,
        accel: 0.0,
    };

    pub(super) const fn of(cell: &Cell) -> Self {
        Self {
            square: cell.square,
            accel: cell.accel,
        }
    }
}

impl Cell {
    /// Makes one cell of this and the next, if they ask nearly the same and nothing jumps between them. `most`: of all that this was made
    /// of.
    pub(super) fn absorb(&mut self, next: &Self, most: &mut Most) -> bool {
        let (square, accel) = (self.square.at_most(next.square), self.accel.at_most(next.accel));
        let both = Most {
            square: most.square.at_least(next.square),
            accel: most.accel.at_least(next.accel),
        };
        if self.jump < f32::MAX || both.square > ALIKE * square || both.accel > ALIKE * accel {
            return false;
        }
        *most = both;
        (self.end_nm, self.jump) = (next.end_nm, next.jump);
        (self.square, self.accel) = (square, accel);
        true
    }
}

/// Nanometres that a place is past: it is before a station where they are less than the station's.
#[inline(always)]
pub(super) fn whole_nm(place: i64) -> u32 {
    u32::try_from(place >> QUANTA_BITS).unwrap_or(u32::MAX)
}

/// Arc between two stations, quanta.
#[allow(clippy::cast_precision_loss, reason = "24 bits are enough for a bound")]
pub(super) fn between(from_nm: u32, to_nm: u32) -> f32 {
    to_nm.saturating_sub(from_nm) as f32 * 1024.0
}
