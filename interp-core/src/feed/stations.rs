//! Stations of a path: its derivatives at places in order, two stations at each patch boundary.

use super::{MM_PER_Q10, Q10_BITS};
use crate::math::arith::truncated;
use crate::math::number::{Bounded, MM_PER_NM, nm_to_mm};

/// Greatest number of stations of a path.
pub(crate) const STATIONS_MAX: usize = 168;

/// Halvings until one of the stations is left.
const CELL_BISECTIONS: u8 = 8;
const _: () = assert!(STATIONS_MAX <= 1 << CELL_BISECTIONS);

/// For each axis its first, second and third derivative by the contact's arc: 1, 1/mm, 1/mm^2.
pub(crate) type Derivatives = [[f32; 3]; 3];

/// Sizes of the jumps of q' (1) and q'' (1/mm) of each axis at a patch boundary.
pub(crate) type Jump = [[f32; 2]; 3];

/// A place of the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Station {
    /// Arc from the start, nm.
    pub(crate) arc_nm: u32,
    pub(crate) q: Derivatives,
}

/// The stations of a path, in order of their arcs. Two at the same arc are the two sides of a jump.
#[derive(Clone, Debug)]
pub(crate) struct Stations {
    list: [Station; STATIONS_MAX],
    count: u16,
    /// Length of a cell that the derivatives of each station were taken over, 2^-7 mm, rounded down; the greatest where they are exact.
    spacing: [u8; STATIONS_MAX],
    /// Patches of which the outer stations are kept.
    group: u16,
}

/// Parts of a millimetre that a spacing is kept in.
const SPACING_PARTS: f32 = 128.0;

/// Error of a derivative by differences of positions rounded to a nanometre, times the cell's length to its power: three standard deviations
/// at the end of a window.
const FIRST_NOISE: f32 = 2e-6;
const SECOND_NOISE: f32 = 12e-6;
const THIRD_NOISE: f32 = 60e-6;
/// The same by differences of first derivatives in single precision, of which none is above 1: of the first, of the second times the length, of the third times its square.
const DIRECTION_NOISE: [f32; 3] = [1e-6, 1.6e-6, 4e-6];

/// Least mean length of cells for differences of first derivatives, mm, and what a distance of positions rounded to a nanometre is off by, mm.
const DIRECTIONS_MIN_MM: f32 = 5e-4;
const ROUNDING_MM: f32 = 2e-6;

/// Least length of a cell, mm: a shorter one has differences of rounded positions.
pub(crate) const CELL_MIN_MM: f32 = 0.15;

/// Length of a cell that derivatives are good to, mm, and fewest cells for them: a patch has its own second derivative.
pub(crate) const CELL_FINE_MM: f32 = 0.25;
pub(crate) const CELLS_FINE: u16 = 4;

/// Length of a cell, mm, above which its derivatives are not straight from end to end: a patch much longer than the others of its pass has such cells.
const LONG_MM: f32 = 0.6;

/// Most cells that derivatives are taken over for one between stations.
pub(crate) const PARTS_MAX: u16 = 32;

/// Cells between the stations of a patch that are fine as they are.
pub(crate) const CELLS_MANY: u16 = 8;

/// Parts of each of the cells of a patch of this length, mm, that derivatives are taken over.
pub(crate) fn parts_of_cell(length: f32, cells: u16) -> u16 {
    if cells >= CELLS_MANY {
        return 1;
    }
    let whole = |value: f32| u16::try_from(truncated(value)).unwrap_or(u16::MAX);
    let fine = whole(length / CELL_FINE_MM).max(CELLS_FINE);
    let most = whole(length / CELL_MIN_MM).max(2);
    fine.min(most).div_ceil(cells.max(1)).clamp(1, PARTS_MAX)
}

impl Station {
    const NONE: Self = Self {
        arc_nm: 0,
        q: [[0.0; 3]; 3],
    };
}

impl Stations {
    pub(crate) const NONE: Self = Self {
        list: [Station::NONE; STATIONS_MAX],
        count: 0,
        spacing: [u8::MAX; STATIONS_MAX],
        group: 1,
    };

    pub(crate) const fn clear(&mut self) {
        self.count = 0;
        self.group = 1;
    }

    /// Of this many patches the outer stations are kept.
    pub(crate) const fn note_group(&mut self, patches: u16) {
        self.group = patches;
    }

    /// Derivatives of a station, by its number from the end of the list, were taken over cells of this length, mm.
    pub(crate) fn note_spacing(&mut self, back: u16, mm: f32) {
        let index = usize::from(self.count.saturating_sub(back));
        if let Some(place) = self.spacing.get_mut(index) {
            *place = u8::try_from(truncated(mm * SPACING_PARTS)).unwrap_or(u8::MAX);
        }
    }

    /// Appends a station; ignored where the list is full.
    pub(crate) fn push(&mut self, station: Station) {
        if let Some(place) = self.list.get_mut(usize::from(self.count)) {
            *place = station;
            self.count += 1;
            self.note_spacing(1, f32::MAX);
        }
    }

    /// Removes the stations after this number of them.
    pub(crate) const fn truncate(&mut self, count: u16) {
        if count < self.count {
            self.count = count;
        }
    }

    /// A station by its number from the end of the list, 1 for the last.
    pub(crate) fn back_mut(&mut self, back: u16) -> Option<&mut Station> {
        let index = self.count.checked_sub(back)?;
        self.list.get_mut(usize::from(index))
    }

    pub(crate) const fn count(&self) -> u16 {
        self.count
    }

    /// The station; that of no path beyond the last.
    pub(crate) fn get(&self, index: u16) -> &Station {
        const NONE: Station = Station::NONE;
        self.list.get(usize::from(index)).unwrap_or(&NONE)
    }

    /// Length of the path, nm.
    pub(crate) fn length_nm(&self) -> u32 {
        self.get(self.count.saturating_sub(1)).arc_nm
    }

    /// Length of the cell that begins at a station, mm; 0 at a jump and at the end.
    pub(crate) fn cell_mm(&self, cell: u16) -> f32 {
        if cell + 1 >= self.count {
            return 0.0;
        }
        between(self.get(cell).arc_nm, self.get(cell + 1).arc_nm)
    }

    /// Whether the station is the first side of a jump.
    pub(crate) fn is_jump(&self, station: u16) -> bool {
        station + 1 < self.count && self.get(station).arc_nm == self.get(station + 1).arc_nm
    }

    /// Length of the cells that the derivatives of a station were taken over, mm.
    fn spacing_at(&self, station: u16) -> f32 {
        match self.spacing.get(usize::from(station)) {
            Some(parts) if *parts < u8::MAX => f32::from(*parts) * (1.0 / SPACING_PARTS),
            _ => f32::MAX,
        }
    }

    /// The jump at a station, less what rounding can make of it in the cells beside it.
    pub(crate) fn jump(&self, station: u16) -> Jump {
        let least = self.spacing_at(station).at_most(self.spacing_at(station + 1));
        let inverse = 1.0 / least.at_least(1e-3);
        let noise = [FIRST_NOISE * inverse, SECOND_NOISE * inverse * inverse];
        let mut jump = [[0.0; 2]; 3];
        let sides = self.get(station).q.iter().zip(&self.get(station + 1).q);
        for (jump, (from, to)) in jump.iter_mut().zip(sides) {
            for (((jump, from), to), noise) in jump.iter_mut().zip(from).zip(to).zip(&noise) {
                *jump = ((to - from).abs() - noise).at_least(0.0);
            }
        }
        jump
    }

    /// The cell that an arc is in, from one cell to another. A cell without length is skipped.
    pub(crate) fn cell_between(&self, from: u16, to: u16, arc_q10: i64) -> u16 {
        let (mut low, mut beyond) = (from, (to + 1).min(self.count.saturating_sub(1)));
        for _ in 0..CELL_BISECTIONS {
            if low + 1 >= beyond {
                break;
            }
            let middle = u16::midpoint(low, beyond);
            if i64::from(self.get(middle).arc_nm) << Q10_BITS <= arc_q10 {
                low = middle;
            } else {
                beyond = middle;
            }
        }
        low
    }

    /// Distance from a station to an arc after it, mm.
    pub(crate) fn since(&self, station: u16, arc_q10: i64) -> f32 {
        let from = i64::from(self.get(station).arc_nm) << Q10_BITS;
        crate::math::number::to_f32(arc_q10 - from) * MM_PER_Q10
    }

    /// Derivatives at a fraction of a cell: straight; the first one of a long cell with the second ones at both ends (Hermite), where these are the places' own.
    pub(crate) fn blend(&self, cell: u16, part: f32) -> Derivatives {
        let from = &self.get(cell).q;
        let to = &self.get((cell + 1).min(self.count.saturating_sub(1))).q;
        let mut q = *from;
        for (q, to) in q.iter_mut().zip(to) {
            for (q, to) in q.iter_mut().zip(to) {
                *q += part * (*to - *q);
            }
        }
        let length = self.cell_mm(cell);
        if length > LONG_MM && !self.is_of_groups() {
            let rest = 1.0 - part;
            for (([q, ..], [first, second, _]), [to_first, to_second, _]) in q.iter_mut().zip(from).zip(to) {
                let rise = to_first - first;
                let bow = rest * (length * second - rise) - part * (length * to_second - rise);
                *q += part * rest * bow;
            }
        }
        q
    }

    /// Whether a station stands for a group of patches, with their greatest derivatives.
    const fn is_of_groups(&self) -> bool {
        self.group > 1
    }
}

/// Millimetres from one arc to a later one.
#[allow(clippy::cast_precision_loss, reason = "24 bits resolve a cell")]
pub(crate) fn between(from_nm: u32, to_nm: u32) -> f32 {
    to_nm.wrapping_sub(from_nm) as f32 * MM_PER_NM
}

/// Greatest number of positions that a derivative is taken from.
pub(crate) const WINDOW: usize = 5;

/// The last positions of the tool centre along a patch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Position, nm, and arc, mm; the oldest first.
    points: [([i32; 3], f32); WINDOW],
    /// First derivative by the arc at each; how many of the last ones are known, and the greatest component so far.
    directions: [[f32; 3]; WINDOW],
    known: usize,
    greatest: f32,
    count: usize,
}

impl Window {
    pub(crate) const EMPTY: Self = Self {
        points: [([0; 3], 0.0); WINDOW],
        directions: [[0.0; 3]; WINDOW],
        known: 0,
        greatest: 1.0,
        count: 0,
    };

    pub(crate) const fn count(&self) -> usize {
        self.count
    }

    /// Arc of one of the positions, mm.
    pub(crate) fn arc_mm(&self, at: usize) -> f32 {
        self.points.get(at).map_or(0.0, |(_, arc)| *arc)
    }

    /// Mean distance of the positions, mm.
    pub(crate) fn spacing_mm(&self) -> f32 {
        let last = self.count.saturating_sub(1);
        let intervals = u8::try_from(last).map_or(1.0, f32::from).at_least(1.0);
        (self.arc_mm(last) - self.arc_mm(0)) / intervals
    }

    /// Appends a position with the first derivative there, if it is known; the oldest is dropped.
    pub(crate) fn push(&mut self, centre_nm: [i32; 3], arc_mm: f32, direction: Option<[f32; 3]>) {
        if self.count == WINDOW {
            let [_, b, c, d, e] = self.points;
            self.points = [b, c, d, e, e];
            let [_, b, c, d, e] = self.directions;
            self.directions = [b, c, d, e, e];
            self.count -= 1;
        }
        if let Some(place) = self.points.get_mut(self.count) {
            *place = (centre_nm, arc_mm);
            self.known = if let Some(direction) = direction {
                if let Some(place) = self.directions.get_mut(self.count) {
                    *place = direction;
                }
                for part in direction {
                    self.greatest = self.greatest.at_least(part.abs());
                }
                (self.known + 1).min(WINDOW)
            } else {
                0
            };
            self.count += 1;
        }
    }

    /// Whether the first derivative is known at all of the positions, and these are far enough apart for its differences.
    pub(crate) fn has_directions(&self) -> bool {
        self.known >= self.count && self.spacing_mm() > DIRECTIONS_MIN_MM
    }

    /// The third derivative between the last two positions by which the first ones there lead from one to the other, times the cube of the cell's length and less its error by
    /// rounding, mm: far more than at the positions where the path bends and bends back between them. 0 where the first derivatives are not known.
    pub(crate) fn third_within(&self) -> f32 {
        let last = self.count.saturating_sub(1);
        let before = last.saturating_sub(1);
        let (Some((from, from_arc)), Some((to, to_arc)), true) =
            (self.points.get(before), self.points.get(last), self.known >= 2)
        else {
            return 0.0;
        };
        let half = 0.5 * (to_arc - from_arc);
        let mut most = 0.0_f32;
        for (axis, (from, to)) in from.iter().zip(to).enumerate() {
            let direction = |at: usize| {
                self.directions
                    .get(at)
                    .and_then(|parts| parts.get(axis))
                    .map_or(0.0, |part| *part)
            };
            let off = nm_to_mm(to.wrapping_sub(*from)) - half * (direction(before) + direction(last));
            most = most.at_least(12.0 * (off.abs() - ROUNDING_MM));
        }
        most
    }

    /// The greatest component of a first derivative so far, at least 1.
    pub(crate) const fn greatest(&self) -> f32 {
        self.greatest
    }

    /// Errors of the three derivatives, by rounding.
    pub(crate) fn noise(&self) -> [f32; 3] {
        let inverse = 1.0 / self.spacing_mm().at_least(1e-3);
        let [square, cube] = [inverse * inverse, inverse * inverse * inverse];
        if self.has_directions() {
            let [first, second, third] = DIRECTION_NOISE.map(|noise| noise * self.greatest);
            [first, second * inverse, third * square]
        } else {
            [FIRST_NOISE * inverse, SECOND_NOISE * square, THIRD_NOISE * cube]
        }
    }

    /// Length of cells with differences of positions that are as good as these derivatives, mm; see [`Stations::note_spacing`].
    pub(crate) fn noise_spacing_mm(&self) -> f32 {
        if self.has_directions() {
            self.spacing_mm().at_least(CELL_MIN_MM)
        } else {
            self.spacing_mm()
        }
    }

    /// Derivatives at one of the positions, of the polynomial through all of them, or through the first derivatives where these are known: Newton's divided
    /// differences.
    pub(crate) fn derivatives(&self, at: usize) -> Derivatives {
        let mut q = [[0.0; 3]; 3];
        let points = self.points.get(..self.count).unwrap_or(&[]);
        let Some((origin, start)) = points.get(at) else {
            return q;
        };
        let mut arcs = [0.0; WINDOW];
        for (arc, (_, from_start)) in arcs.iter_mut().zip(points) {
            *arc = from_start - start;
        }
        let has_directions = self.has_directions();
        for (axis, q) in q.iter_mut().enumerate() {
            let mut differences = [0.0; WINDOW];
            if has_directions {
                for (difference, direction) in differences.iter_mut().zip(&self.directions) {
                    *difference = direction.get(axis).copied().unwrap_or(0.0);
                }
            } else {
                for (difference, (centre, _)) in differences.iter_mut().zip(points) {
                    let of = |centre: &[i32; 3]| centre.get(axis).copied().unwrap_or(0);
                    *difference = nm_to_mm(of(centre).wrapping_sub(of(origin)));
                }
            }
            divide(&mut differences, &arcs, points.len());
            let series = taylor(&differences, &arcs, points.len());
            *q = if has_directions {
                let [first, second, third, _] = series;
                [first, second, 2.0 * third]
            } else {
                let [_, first, second, third] = series;
                [first, 2.0 * second, 6.0 * third]
            };
        }
        q
    }
}

/// Values at these arguments become divided differences.
fn divide(values: &mut [f32; WINDOW], at: &[f32; WINDOW], count: usize) {
    for order in 1..WINDOW.min(count) {
        for index in (order..WINDOW.min(count)).rev() {
            let apart = get(at, index) - get(at, index - order);
            let difference = (get(values, index) - get(values, index - 1)) / apart.at_least(1e-7);
            if let Some(value) = values.get_mut(index) {
                *value = difference;
            }
        }
    }
}

/// The first four coefficients by powers of the argument of a polynomial in Newton's form.
fn taylor(differences: &[f32; WINDOW], at: &[f32; WINDOW], count: usize) -> [f32; 4] {
    let mut c = [0.0; 4];
    for index in (0..WINDOW.min(count)).rev() {
        let t = get(at, index);
        let [c0, c1, c2, c3] = c;
        c = [
            get(differences, index) - t * c0,
            c0 - t * c1,
            c1 - t * c2,
            c2 - t * c3,
        ];
    }
    c
}

fn get(values: &[f32; WINDOW], index: usize) -> f32 {
    values.get(index).copied().unwrap_or(0.0)
}
