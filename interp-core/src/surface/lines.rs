//! One coordinate of a patch on a pass, and the records' common parts.

use super::range::{HeadWord, Root};
use super::rational::WEIGHT_ONE;
use super::{Edges, IsoLine};
use crate::math::arith::{add, cubic, jet, mul_hi, quadratic, tangent};

/// One coordinate on a pass: cubics of the path parameter, fixed point.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CoordinateCubics {
    /// S.
    pub(crate) value: [i32; 4],
    /// S_side.
    pub(crate) side: [i32; 4],
    /// Half of S_side,side.
    pub(crate) side2: [i32; 4],
}

impl CoordinateCubics {
    /// Zero.
    pub(crate) const NONE: Self = Self {
        value: [0; 4],
        side: [0; 4],
        side2: [0; 4],
    };

    /// A weight of 1.
    pub(super) const ONE: Self = Self {
        value: [WEIGHT_ONE, 0, 0, 0],
        side: [0; 4],
        side2: [0; 4],
    };

    /// One coordinate of a [`super::Local`] at a path parameter.
    #[inline(always)]
    pub(super) fn point(&self, w: i32) -> CoordinatePoint {
        let [value, path, path2] = jet(&self.value, w);
        let [side, mixed] = tangent(&self.side, w);
        [value, path, path2, side, mixed, cubic(&self.side2, w)]
    }

    /// Those of a block at a side parameter, in the surface's own direction.
    #[inline(always)]
    pub(super) fn at(block: &[i32; 16], side: i32) -> Self {
        let [row0, row1, row2, row3] = rows(block);
        // Not by `map`, which is a loop.
        let ([v0, s0, h0], [v1, s1, h1]) = (jet(row0, side), jet(row1, side));
        let ([v2, s2, h2], [v3, s3, h3]) = (jet(row2, side), jet(row3, side));
        Self {
            value: [v0, v1, v2, v3],
            side: [s0, s1, s2, s3],
            side2: [h0, h1, h2, h3],
        }
    }

    /// Collapses `c[i][j]` of `path^i side^j`, j fastest, at a side parameter.
    #[inline(always)]
    pub(crate) fn collapse(&mut self, block: &[i32; 16], at: &IsoLine) {
        let (rows, _) = block.as_chunks::<4>();
        let slots = self.value.iter_mut().zip(&mut self.side).zip(&mut self.side2);
        let mut odd = false;
        for (row, ((value, side), side2)) in rows.iter().zip(slots) {
            let [v, s, h] = jet(row, at.side);
            let turned = odd && at.reversed;
            *value = turn(v, turned);
            *side = turn(s, turned);
            *side2 = turn(h, turned);
            odd = !odd;
        }
    }
}

/// One coordinate: position, path, half of path,path; side, mixed, half of side,side.
pub(super) type CoordinatePoint = [i32; 6];

/// The rows of a block.
#[inline(always)]
fn rows(block: &[i32; 16]) -> [&[i32; 4]; 4] {
    const NONE: [i32; 4] = [0; 4];
    match block.as_chunks().0 {
        [row0, row1, row2, row3] => [row0, row1, row2, row3],
        _ => [&NONE; 4],
    }
}

/// [`CoordinateCubics::point`] of a block, to the same bits: row by row from the highest power of the path, so that nothing but six sums lives from row to row, for
/// which a Cortex-M has registers.
#[inline(always)]
pub(super) fn point_by_rows(block: &[i32; 16], side: i32, w: i32) -> CoordinatePoint {
    let row = |row: &[i32; 4]| jet(row, side);
    let [row0, row1, row2, row3] = rows(block);
    let [v3, s3, h3] = row(row3);
    let (v3, s3, h3) = (mul_hi(v3, w), mul_hi(s3, w), mul_hi(h3, w));
    let [v2, s2, h2] = row(row2);
    let (v2, s2, h2) = (add(v2, v3), add(s2, s3), add(h2, h3));
    let [v1, s1, h1] = row(row1);
    let (v1, s1, h1) = (
        add(v1, mul_hi(v2, w)),
        add(s1, mul_hi(s2, w)),
        add(h1, mul_hi(h2, w)),
    );
    let (v2, s2) = (add(v2, v3), add(s2, s3));
    let [v0, s0, h0] = row(row0);
    [
        add(v0, mul_hi(v1, w)),
        add(v1, mul_hi(v2, w)),
        add(v2, v3),
        add(s0, mul_hi(s1, w)),
        add(s1, mul_hi(s2, w)),
        add(h0, mul_hi(h1, w)),
    ]
}

/// Negates the coefficients of odd powers where the pass runs backwards.
#[inline(always)]
pub(crate) const fn turn(value: i32, turned: bool) -> i32 {
    let mask = -(turned as i32);
    (value ^ mask).wrapping_sub(mask)
}

/// A cubic with its parameter reversed.
pub(crate) const fn turn_cubic([c0, c1, c2, c3]: [i32; 4], turned: bool) -> [i32; 4] {
    [c0, turn(c1, turned), c2, turn(c3, turned)]
}

/// Splits a record into its four head words and the blocks of its coordinates.
pub(super) fn split(words: &[i32]) -> ([i32; 4], &[[i32; 16]]) {
    match words.split_first_chunk::<4>() {
        Some((head, rest)) => (*head, rest.as_chunks().0),
        None => ([0; 4], &[]),
    }
}

/// The words of a patch record: origin, head, coefficients.
pub(super) fn record_words<const WORDS: usize, const AXES: usize>(
    origin_nm: [i32; 3],
    shift: u8,
    edges: Edges,
    coefficients: &[[[i32; 4]; 4]; AXES],
) -> [i32; WORDS] {
    let mut words = [0; WORDS];
    let head = HeadWord { shift, edges }.to_word();
    let coefficients = coefficients.iter().flatten().flatten();
    let all = origin_nm.into_iter().chain([head]).chain(coefficients.copied());
    for (word, value) in words.iter_mut().zip(all) {
        *word = value;
    }
    words
}

/// The coefficients of a record's blocks.
pub(super) fn coefficients<const AXES: usize>(blocks: &[[i32; 16]]) -> [[[i32; 4]; 4]; AXES] {
    let mut coefficients = [[[0; 4]; 4]; AXES];
    let slots = coefficients.iter_mut().flatten().flatten();
    for (slot, value) in slots.zip(blocks.iter().flatten()) {
        *slot = *value;
    }
    coefficients
}

/// Maximum extent of a collapsed boundary, units: the rounding of its coefficients.
const COLLAPSE_UNITS: i32 = 8;

/// Whether one coordinate is constant along the flagged boundaries.
pub(super) fn collapses(c: &[[i32; 4]; 4], edges: Edges) -> bool {
    let small = |value: i32| value.abs() <= COLLAPSE_UNITS;
    let at = |root: Root, c: &[i32; 4]| cubic(c, if root == Root::Start { i32::MIN } else { i32::MAX });
    let [c0, c1, c2, c3] = c;
    let across = edges
        .side_root()
        .is_none_or(|root| [c1, c2, c3].into_iter().all(|row| small(at(root, row))));
    let column = |j: usize| [c0, c1, c2, c3].map(|row| row.get(j).copied().unwrap_or(0));
    let along = edges
        .path_root(false)
        .is_none_or(|root| (1..4).all(|j| small(at(root, &column(j)))));
    across && along
}

/// The quotient of each row by a root, at a side parameter: a cubic of the path.
pub(super) fn quotient_across(block: &[i32; 16], root: Root, at: &IsoLine) -> [i32; 4] {
    let mut out = [0; 4];
    for (slot, row) in out.iter_mut().zip(block.as_chunks::<4>().0) {
        *slot = quadratic(&root.divide(row), at.side);
    }
    turn_cubic(out, at.reversed)
}

/// A cubic divided by a root, as a cubic.
pub(super) fn quotient_along(c: &[i32; 4], root: Root) -> [i32; 4] {
    let [q0, q1, q2] = root.divide(c);
    [q0, q1, q2, 0]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By rows, the same bits as by the cubics of the path.
    #[test]
    fn a_point_by_rows_is_that_of_the_cubics() {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.cast_signed() >> 4
        };
        for _ in 0..10_000 {
            let block = [0; 16].map(|_: i32| random());
            let (side, w) = (random() << 4, random() << 4);
            let want = CoordinateCubics::at(&block, side).point(w);
            assert_eq!(point_by_rows(&block, side, w), want);
        }
    }
}
