//! The checks of a region at load.

use super::{CROSSINGS_MAX, CellWords, EDGES_A_RECORD, Edge, FirstLine, RegionWords, ScanLine, end_of};
use crate::job::Header;

/// The checks of a region at load, record after record. They find the first line on the way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegionCheck {
    first: FirstLine,
    /// Head of the cell that is checked.
    cell: u16,
    /// Lower end of the last edge.
    before: i32,
    /// Combination of all ends that is 0 where each occurs an even number of times.
    parity: u32,
}

impl RegionCheck {
    /// Before the first record.
    pub(crate) const START: Self = Self {
        first: FirstLine {
            side: 0,
            taken: 0,
            count: 0,
            active: [0; CROSSINGS_MAX],
        },
        cell: 0,
        before: 0,
        parity: 0,
    };

    /// The first line, once every record is checked.
    pub(crate) const fn first_line(&self) -> &FirstLine {
        &self.first
    }

    /// Begins with the first record.
    pub(crate) const fn begin(&mut self) {
        *self = Self::START;
    }

    /// Checks a portion of records, and after the last of them, on a line that is free, the first line. Whether they are sound: edges on the surface, upwards, in order,
    /// closed in each cell; cells up to the last record.
    pub(crate) fn check(
        &mut self,
        header: &Header,
        region: &RegionWords<'_>,
        portion: u32,
        line: &mut ScanLine,
    ) -> bool {
        let from = portion.saturating_mul(EDGES_A_RECORD);
        let Some(mut cell) = region.cell(self.cell) else {
            return false;
        };
        for index in from..from.saturating_add(EDGES_A_RECORD).min(header.edges.into()) {
            let Ok(index) = u16::try_from(index) else {
                return false;
            };
            if index == cell.next() {
                if self.parity != 0 {
                    return false;
                }
                self.cell = index;
                self.before = 0;
                let Some(next) = region.cell(index) else {
                    return false;
                };
                cell = next;
            }
            let is_sound = match index.checked_sub(self.cell.saturating_add(1)) {
                None => self.check_head(header, &cell),
                Some(number) => cell
                    .edge(number)
                    .is_some_and(|edge| self.check_edge(header, &edge, number)),
            };
            if !is_sound {
                return false;
            }
        }
        if from + EDGES_A_RECORD < u32::from(header.edges) {
            return true;
        }
        let Some(first) = region.cell(0) else {
            return false;
        };
        line.restart(&self.first);
        line.finish(&first, end_of(header.path_spans)).is_ok()
            && line.intervals() > 0
            && self.parity == 0
            && cell.next() == header.edges
    }

    fn check_head(&mut self, header: &Header, cell: &CellWords<'_>) -> bool {
        if self.cell == 0 {
            self.first.side = cell.first();
        }
        cell.is_sound(header)
    }

    fn check_edge(&mut self, header: &Header, edge: &Edge, number: u16) -> bool {
        let [lower, upper] = edge.side;
        if !edge.is_sound(header) || lower < self.before {
            return false;
        }
        self.before = lower;
        self.parity ^= mixed(lower) ^ mixed(upper);
        let first = &mut self.first;
        if self.cell == 0 && lower <= first.side {
            first.taken = number.saturating_add(1);
            if edge.meets(first.side) {
                let Some(place) = first.active.get_mut(usize::from(first.count)) else {
                    return false;
                };
                *place = number;
                first.count += 1;
            }
        }
        true
    }
}

/// A place with its bits mixed, so that different ones do not cancel.
const fn mixed(at: i32) -> u32 {
    let mut bits = at.cast_unsigned().wrapping_mul(0x9e37_79b1);
    bits ^= bits >> 15;
    bits = bits.wrapping_mul(0x85eb_ca77);
    bits ^ (bits >> 13)
}
