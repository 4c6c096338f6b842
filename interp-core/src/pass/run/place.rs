//! Where the run is on its pass, for the feed.

use super::Run;
use crate::math::arith::{fraction_to_f32, truncated};
use crate::sample::SpanParameter;

/// Last part of a patch, 2^-64, whose arc two points give: the speed may be many times that in its middle.
const LAST_PART: u64 = 1 << 61;

impl Run {
    /// Pass, path and side parameter of the tool, in the surface's own direction.
    pub(crate) const fn surface_position(&self) -> (u32, SpanParameter, SpanParameter) {
        let travel = &self.travel;
        let (piece, fraction) = self.here();
        let path = SpanParameter {
            span: piece.position.span,
            fraction: travel.route.turned(fraction),
        };
        (travel.pass, path, travel.side)
    }

    /// Number of the patch from the start of the pass, and of the cell within the patch, at the position, by the number of cells of each patch; none where
    /// the pass is over.
    pub(crate) fn cell(&self, cells_of: impl Fn(u16) -> u16) -> Option<[u16; 2]> {
        if !self.is_along() {
            return None;
        }
        let travel = &self.travel;
        if let Some(front) = &travel.piece.front {
            return Some([front.number, 0]);
        }
        let [start, _] = travel.route.ends;
        let patch = travel.span().abs_diff(start.span);
        let piece = &travel.piece;
        let cells = cells_of(patch);
        let within = if piece.is_whole() {
            let high = (travel.fraction >> 32) * u64::from(cells);
            u16::try_from(high >> 32).unwrap_or(0)
        } else {
            let part = fraction_to_f32(travel.fraction.saturating_sub(piece.start()))
                / fraction_to_f32(piece.end().saturating_sub(piece.start()));
            let cell = u16::try_from(truncated(part * f32::from(cells))).unwrap_or(0);
            cell.min(cells.saturating_sub(1))
        };
        Some([patch, within])
    }

    /// Arc since the start of a cell of [`Self::cell`], mm, by the number of cells of its patch and the fraction of a whole patch in one of them; none where, by
    /// rounding, the position is before the cell.
    pub(crate) fn since_station(&self, [_, within]: [u16; 2], (cells, part): (u16, u64)) -> Option<f32> {
        let travel = &self.travel;
        let piece = &travel.piece;
        let part = if piece.is_whole() {
            part
        } else {
            let length = piece.end().saturating_sub(piece.start());
            length.checked_div(u64::from(cells))?
        };
        let start = piece.start() + u64::from(within).wrapping_mul(part);
        let length = fraction_to_f32(travel.fraction.checked_sub(start)?);
        let mean = 1.0 - 0.5 * travel.path.log_speed_derivative * length;
        Some(length * mean / (travel.path.inv_speed * self.buffer.patch().per_mm))
    }

    /// Arc to the end of the pass, mm, by Hermite's two-point rule; none before the last part of its last piece, and where
    /// its end is not evaluated.
    pub(crate) fn arc_left(&self) -> Option<f32> {
        let (travel, patch) = (&self.travel, self.buffer.patch());
        if !self.is_along() || !patch.has_end() || !self.buffer.is_last() {
            return None;
        }
        let left = travel.piece.end().checked_sub(travel.fraction)?;
        if left > LAST_PART {
            return None;
        }
        let length = fraction_to_f32(left);
        let (here, end) = (&travel.path, patch.end());
        let (first, last) = (1.0 / here.inv_speed, 1.0 / end.inv_speed);
        let bow = first * here.log_speed_derivative - last * end.log_speed_derivative;
        let mean = 0.5 * (first + last) + bow * length * (1.0 / 12.0);
        // Not at a pole, where the speed is 0.
        let mm = length * mean / patch.per_mm;
        mm.is_finite().then_some(mm)
    }

    /// Whether the surface faces up at the tool, so that the tool can retract upwards.
    pub(crate) fn faces_up(&self) -> bool {
        self.buffer.patch().faces_up(self.travel.offset)
    }
}
