//! A rational bicubic patch `S = P / w`, and its evaluation on a pass.
//!
//! Record, [`RATIONAL_WORDS`] words: as a polynomial patch's, with 16 more coefficients for the weight. The first three
//! coordinates are the numerators `w (S - origin)` in units of 2^-shift nm; the weight is in units of 2^-30 and lies within
//! [1/2, 2) on the patch (a host scales it, and splits a patch whose weights vary more). Where a boundary collapses, the
//! origin is that point, so that the numerators vanish there; at most one boundary of a patch may collapse.

use super::Ball;
use super::grid::GridPass;
use super::lines::{CoordinatePoint, coefficients, collapses, record_words, split};
use super::range::{BAD_PATCH, Edges, HeadWord, Root, fits, patch_bound};
use super::{Contact, Factors, Local, Pass, PathSpeed};
use crate::fault::Result;
use crate::math::arith::{centred, cubic, mul_hi, mul_q29, quarter_of, reciprocal_q29, subtract, to_f32};

/// Words of a rational patch.
pub const RATIONAL_WORDS: usize = 68;

/// Least and largest weight on a patch, units of 2^-30: slightly inside [1/2, 2), by the rounding error of its evaluation.
const WEIGHT_MIN: i32 = (1 << 29) + 8;
const WEIGHT_MAX: i32 = i32::MAX - 8;

/// 2^-30, the unit of the weight.
const WEIGHT_UNIT: f32 = 1.0 / 1_073_741_824.0;

/// A weight of 1.
pub(super) const WEIGHT_ONE: i32 = 1 << 30;

/// A rational patch, unpacked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RationalRecord {
    /// Origin of the patch, nm; the pole where a boundary collapses.
    pub origin_nm: [i32; 3],
    /// Units of the numerators are 2^-shift nm; at most [`super::SHIFT_MAX`].
    pub shift: u8,
    /// Boundaries that collapse into a point; at most one.
    pub edges: Edges,
    /// `c[axis][i][j]` of `path^i side^j`, parameters centred; axis 3 is the weight.
    pub coefficients: [[[i32; 4]; 4]; 4],
}

impl RationalRecord {
    /// The record's words.
    #[must_use]
    pub fn to_words(&self) -> [i32; RATIONAL_WORDS] {
        record_words(self.origin_nm, self.shift, self.edges, &self.coefficients)
    }

    /// The record of these words; unused bits of the head word are dropped.
    #[must_use]
    pub fn from_words(words: &[i32; RATIONAL_WORDS]) -> Self {
        let ([x, y, z, head], blocks) = split(words);
        let HeadWord { shift, edges } = HeadWord::from_word(head);
        Self {
            origin_nm: [x, y, z],
            shift,
            edges,
            coefficients: coefficients(blocks),
        }
    }

    /// Checks that no evaluation can overflow, the weight stays within [1/2, 2), at most one boundary
    /// collapses, and the numerators vanish on a collapsed boundary.
    ///
    /// # Errors
    /// [`crate::fault::FaultKind::BadPatch`].
    pub fn check(words: &[i32; RATIONAL_WORDS]) -> Result<()> {
        let ([.., head], blocks) = split(words);
        let HeadWord { edges, .. } = HeadWord::from_word(head);
        let vanishes =
            |c: &[[i32; 4]; 4]| edges.count() == 0 || (collapses(c, edges) && touches_zero(c, edges));
        // Half the range of i32, because the quotient by a weight of at least 1/2 has to fit too.
        let is_numerator = |c: &[[i32; 4]; 4]| patch_bound(c) < 1 << 30 && vanishes(c);
        let is_weight = |c: &[[i32; 4]; 4]| fits(c) && weight_in_range(c);
        let mut axes = blocks
            .iter()
            .zip(0..)
            .map(|(block, axis)| (block.as_chunks().0.first_chunk(), axis));
        let good = HeadWord::check(head)
            && axes.all(|(c, axis)| c.is_some_and(|c| if axis < 3 { is_numerator(c) } else { is_weight(c) }));
        if good { Ok(()) } else { BAD_PATCH }
    }
}

/// Whether a coordinate is zero (within 8 units) in the middle of its collapsed boundary.
#[inline(never)]
fn touches_zero(c: &[[i32; 4]; 4], edges: Edges) -> bool {
    let end = |root: Root| if root == Root::Start { i32::MIN } else { i32::MAX };
    let (w, y) = (
        edges.path_root(false).map_or(0, end),
        edges.side_root().map_or(0, end),
    );
    cubic(&c.map(|row| cubic(&row, y)), w).abs() <= 8
}

/// Whether a weight stays in range on its patch: its Bernstein coefficients do, and they enclose it. Apart from the caller, so that their frames do not add up.
#[inline(never)]
fn weight_in_range(c: &[[i32; 4]; 4]) -> bool {
    // p(w), w = t - 1/2, as 24 p = sum of (24, 12, 6, 3) c_i (2w)^i; 2w = -1 .. 1 has these coefficients.
    let bernstein = |[c0, c1, c2, c3]: [i64; 4]| {
        let (c0, d1, d2, c3) = (24 * c0, 4 * c1, 2 * c2, 3 * c3);
        [
            c0 - 3 * d1 + 3 * d2 - c3,
            c0 - d1 - d2 + c3,
            c0 + d1 - d2 - c3,
            c0 + 3 * d1 + 3 * d2 + c3,
        ]
    };
    // Rows to Bernstein coefficients times 24, then columns likewise: 576 in all, well within i64.
    let rows = c.map(|row| bernstein(row.map(i64::from)));
    let range = i64::from(WEIGHT_MIN) * 576..=i64::from(WEIGHT_MAX) * 576;
    (0..4).all(|j| {
        let column = rows.map(|row| row.get(j).copied().unwrap_or(0));
        bernstein(column).into_iter().all(|value| range.contains(&value))
    })
}

/// The weight and its derivatives at a point of a pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    /// 1/w in units of 2^-29.
    reciprocal: i32,
    /// w/4.
    pub(super) g: f32,
    /// 4/w.
    pub(super) inverse_g: f32,
    /// 2 w'/w.
    pub(super) excess: f32,
    /// Derivatives in units of 2^-30: path, half of path,path; side, mixed, half of side,side.
    pub(super) path: i32,
    pub(super) path2: i32,
    pub(super) side: i32,
    pub(super) mixed: i32,
    pub(super) side2: i32,
}

impl Weight {
    #[inline(always)]
    pub(super) fn new([value, path, path2, side, mixed, side2]: CoordinatePoint) -> Self {
        let float = to_f32(value) * WEIGHT_UNIT;
        let inverse = 1.0 / float;
        Self {
            reciprocal: reciprocal_q29(value, inverse),
            g: 0.25 * float,
            inverse_g: 4.0 * inverse,
            excess: to_f32(path) * (2.0 * WEIGHT_UNIT) * inverse,
            path,
            path2,
            side,
            mixed,
            side2,
        }
    }

    /// A [`Local`] of three coordinates.
    #[inline(always)]
    pub(super) const fn local(&self, x: CoordinatePoint, y: CoordinatePoint, z: CoordinatePoint) -> Local {
        let ([x0, x1, x2, xs, xm, xx], [y0, y1, y2, ys, ym, yy], [z0, z1, z2, zs, zm, zz]) = (x, y, z);
        Local {
            position: [x0, y0, z0],
            path: [x1, y1, z1],
            side: [xs, ys, zs],
            path2: [x2, y2, z2],
            mixed: [xm, ym, zm],
            side2: [xx, yy, zz],
            g: self.g,
            inverse_g: self.inverse_g,
            excess: self.excess,
        }
    }

    /// Relative change of the weight along the path and across it.
    pub(super) fn log_derivatives(&self) -> [f32; 2] {
        let inverse = 0.25 * WEIGHT_UNIT * self.inverse_g;
        [to_f32(self.path) * inverse, to_f32(self.side) * inverse]
    }

    /// A numerator over the weight.
    #[inline(always)]
    pub(super) fn divide(&self, numerator: i32) -> i32 {
        mul_q29(numerator, self.reciprocal)
    }
}

/// A quarter of `numerator' - quotient w'`: w/4 times the quotient's derivative, up to tangential components.
#[inline(always)]
pub(super) fn quarter(numerator: i32, quotient: i32, weight: i32) -> i32 {
    subtract(quarter_of(numerator), mul_hi(quotient, weight))
}

/// A rational patch on one pass.
pub(crate) struct RationalPass<'a>(pub(super) &'a GridPass);

/// One coordinate of a [`Local`], from that of the numerator.
#[inline(always)]
pub(super) fn quotient(
    [value, path, path2, side, mixed, side2]: CoordinatePoint,
    weight: &Weight,
) -> CoordinatePoint {
    let s = weight.divide(value);
    [
        s,
        quarter(path, s, weight.path),
        quarter(path2, s, weight.path2),
        quarter(side, s, weight.side),
        quarter(mixed, s, weight.mixed),
        quarter(side2, s, weight.side2),
    ]
}

impl RationalPass<'_> {
    /// The parametrisation at a fraction of the patch.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let local = self.local(fraction);
        PathSpeed::new(&local.path, &local.path2, local.excess, local.g)
    }

    /// The quotient rule with the numerators' derivatives relative to the point: `w S_path = P_path - S w_path`, and
    /// `w N . S_xy = N . (P_xy - S w_xy)`, because the omitted terms are tangential.
    #[inline(always)]
    pub(super) fn local(&self, fraction: u64) -> Local {
        let w = centred(fraction);
        let weight = Weight::new(self.0.weight.point(w));
        let [x, y, z] = &self.0.axes;
        weight.local(
            quotient(x.point(w), &weight),
            quotient(y.point(w), &weight),
            quotient(z.point(w), &weight),
        )
    }
}

impl Pass for RationalPass<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        self.local(fraction).contact::<true, true>(ball, &Factors::ONE)
    }
}
