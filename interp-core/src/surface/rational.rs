//! A rational bicubic patch `S = P / w`, and its collapse to cubics on a pass.
//!
//! Record, [`RATIONAL_WORDS`] words: as a polynomial patch's, with 16 more coefficients for the weight. The first three
//! coordinates are the numerators `w (S - origin)` in units of 2^-shift nm; the weight is in units of 2^-30 and lies within
//! [1/2, 2) on the patch (a host scales it, and splits a patch whose weights vary more). Where a boundary collapses, the
//! origin is that point, so that the numerators vanish there; at most one boundary of a patch may collapse.

use super::polynomial::{
    collapses, derivative, divided, float_cubic, float_derivative, line, parabola, second_side, side_factor,
    slope, split_head, travel_sign, turn, unit_mm,
};
use super::range::{BAD_PATCH, Edges, HeadWord, Root, fits, patch_bound};
use super::{Contact, Derivatives, PassLine, PathFactor};
use crate::arith::{centred_to_f32, cubic, mul_q29, quadratic, reciprocal_q29, to_f32};
use crate::fault::Result;
use crate::vec3::Vec3;

/// Words of a rational patch.
pub const RATIONAL_WORDS: usize = 68;

/// Least and largest weight on a patch, units of 2^-30: a hair within [1/2, 2), for the rounding of its evaluation.
const WEIGHT_MIN: i32 = (1 << 29) + 8;
const WEIGHT_MAX: i32 = i32::MAX - 8;

/// 2^-30, the unit of the weight.
const WEIGHT_UNIT: f32 = 1.0 / 1_073_741_824.0;

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
        let mut words = [0; RATIONAL_WORDS];
        let head = HeadWord {
            shift: self.shift,
            edges: self.edges,
        }
        .to_word();
        let all = self
            .origin_nm
            .into_iter()
            .chain([head])
            .chain(self.coefficients.into_iter().flatten().flatten());
        for (word, value) in words.iter_mut().zip(all) {
            *word = value;
        }
        words
    }

    /// The record of these words; meaningless bits of the head word are dropped.
    #[must_use]
    pub fn from_words(words: &[i32; RATIONAL_WORDS]) -> Self {
        let ([x, y, z, head], rest) = split_head(words);
        let HeadWord { shift, edges } = HeadWord::from_word(head);
        let mut coefficients = [[[0; 4]; 4]; 4];
        for (slot, value) in coefficients.iter_mut().flatten().flatten().zip(rest) {
            *slot = *value;
        }
        Self {
            origin_nm: [x, y, z],
            shift,
            edges,
            coefficients,
        }
    }

    /// Whether the side boundaries collapse, start and end.
    pub(crate) fn side_edges(words: &[i32; RATIONAL_WORDS]) -> [bool; 2] {
        let ([.., head], _) = split_head(words);
        let edges = HeadWord::from_word(head).edges;
        [edges.side_start, edges.side_end]
    }

    /// Whether the board takes the patch: nothing can overflow, the weight stays within [1/2, 2), at most one boundary
    /// collapses, and where one does the numerators vanish.
    ///
    /// # Errors
    /// [`crate::fault::FaultKind::BadPatch`].
    pub fn check(words: &[i32; RATIONAL_WORDS]) -> Result<()> {
        let ([.., head], _) = split_head(words);
        let record = Self::from_words(words);
        let [x, y, z, weight] = &record.coefficients;
        let edges = record.edges;
        let vanishes =
            |c: &[[i32; 4]; 4]| edges.count() == 0 || (collapses(c, edges) && touches_zero(c, edges));
        let good = HeadWord::check(head)
            && fits(weight)
            // Half of i32: the quotient by a weight of at least 1/2 has to fit too.
            && [x, y, z].into_iter().all(|c| patch_bound(c) < 1 << 30)
            && [x, y, z].into_iter().all(vanishes)
            && weight_in_range(weight);
        if good { Ok(()) } else { BAD_PATCH }
    }
}

/// Whether a coordinate is zero (to 8 units) in the middle of its collapsed boundary.
fn touches_zero(c: &[[i32; 4]; 4], edges: Edges) -> bool {
    let end = |root: Root| if root == Root::Start { i32::MIN } else { i32::MAX };
    let (w, y) = (
        edges.path_root(false).map_or(0, end),
        edges.side_root().map_or(0, end),
    );
    cubic(&c.map(|row| cubic(&row, y)), w).abs() <= 8
}

/// Whether a weight stays in range on its patch: its Bernstein coefficients do, and they enclose it.
fn weight_in_range(c: &[[i32; 4]; 4]) -> bool {
    // Rows to Bernstein coefficients times 24, then columns likewise: 576 in all, well within i64.
    let bernstein = |c: [i64; 4]| {
        let [c0, c1, c2, c3] = c;
        // p(w), w = t - 1/2, as 24 p = sum of (24, 12, 6, 3) c_i (2w)^i; 2w = -1 .. 1 has the coefficients below.
        let (d0, d1, d2, d3) = (24 * c0, 12 * c1, 6 * c2, 3 * c3);
        [
            d0 - d1 + d2 - d3,
            d0 - d1 / 3 - d2 / 3 + d3,
            d0 + d1 / 3 - d2 / 3 - d3,
            d0 + d1 + d2 + d3,
        ]
    };
    let [r0, r1, r2, r3] = c.map(|row| bernstein(row.map(i64::from)));
    let columns = [0, 1, 2, 3_usize].map(|j| {
        let pick = |row: [i64; 4]| row.get(j).copied().unwrap_or(0);
        bernstein([pick(r0), pick(r1), pick(r2), pick(r3)])
    });
    let range = i64::from(WEIGHT_MIN) * 576..=i64::from(WEIGHT_MAX) * 576;
    columns.into_iter().flatten().all(|value| range.contains(&value))
}

/// The weight on a pass: a cubic, and its derivatives.
#[derive(Clone, Copy, Debug)]
struct Weight {
    value: [i32; 4],
    path: [f32; 3],
    path2: [f32; 2],
    path3: f32,
    side: [f32; 4],
    mixed: [f32; 3],
    side2: [f32; 4],
}

/// A rational patch on one pass: cubics in the path parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RationalPass {
    pub(crate) origin_nm: [i32; 3],
    pub(crate) shift: u8,
    scale: f32,
    weight: Weight,
    /// P, fixed point.
    position: [[i32; 4]; 3],
    /// P, or P with the pole's root divided out, fixed point: what the reduced derivative is taken of.
    reduced: [[i32; 4]; 3],
    pole: Pole,
    /// P̃_path, P̃_path,path, P̃_path,path,path (of `reduced` where the pass runs near a pole), mm.
    path: [[i32; 3]; 3],
    path2: [[f32; 2]; 3],
    path3: Vec3,
    /// P̃_side, fixed point.
    side: [[i32; 4]; 3],
    mixed: [[f32; 3]; 3],
    side2: [[f32; 4]; 3],
    path_factor: PathFactor,
    side_factor: [f32; 2],
    tool_sign: f32,
}

/// Which derivative of the pass is reduced by a root.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pole {
    None,
    /// B vanishes at an end of the pass.
    AtEnd,
    /// A vanishes all along the boundary beside the pass.
    Beside,
}

/// One numerator on a pass.
struct Axis {
    position: [i32; 4],
    reduced: [i32; 4],
    side: [i32; 4],
    side_plain: [i32; 4],
    side2: [f32; 4],
}

fn with_zero([q0, q1, q2]: [i32; 3]) -> [i32; 4] {
    [q0, q1, q2, 0]
}

fn collapse_axis(rows: &[[i32; 4]; 4], at: &PassLine, edges: Edges, scale: f32) -> Axis {
    let position = turn(rows.map(|row| cubic(&row, at.side)), at.reversed);
    let side_plain = turn(rows.map(|row| slope(&row, at.side)), at.reversed);
    let plain = second_side(rows, at, scale);
    let (reduced, side) = match (edges.side_root(), edges.path_root(at.reversed)) {
        (Some(root), _) => (
            turn(
                rows.map(|row| quadratic(&root.divide(&row), at.side)),
                at.reversed,
            ),
            side_plain,
        ),
        (None, Some(root)) => (
            with_zero(root.divide(&position)),
            with_zero(root.divide(&side_plain)),
        ),
        (None, None) => (position, side_plain),
    };
    Axis {
        position,
        reduced,
        side,
        side_plain,
        side2: divided(plain, edges.path_root(at.reversed)),
    }
}

fn collapse_weight(rows: &[[i32; 4]; 4], at: &PassLine) -> Weight {
    let value = turn(rows.map(|row| cubic(&row, at.side)), at.reversed);
    let side = turn(rows.map(|row| slope(&row, at.side)), at.reversed);
    let path = float_derivative(&value, WEIGHT_UNIT);
    let [_, p1, p2] = path;
    Weight {
        value,
        path,
        path2: [p1, 2.0 * p2],
        path3: 2.0 * p2,
        side: side.map(|c| to_f32(c) * WEIGHT_UNIT),
        mixed: float_derivative(&side, WEIGHT_UNIT),
        side2: second_side(rows, at, WEIGHT_UNIT),
    }
}

impl RationalPass {
    /// The patch at the pass's side parameter.
    pub(crate) fn collapse(words: &[i32; RATIONAL_WORDS], at: &PassLine) -> Self {
        let record = RationalRecord::from_words(words);
        let scale = unit_mm(record.shift);
        let [x, y, z, weight] = &record.coefficients;
        let axes = [x, y, z].map(|rows| collapse_axis(rows, at, record.edges, scale));
        let pole = match (record.edges.side_root(), record.edges.path_root(at.reversed)) {
            (Some(_), _) => Pole::Beside,
            (None, Some(_)) => Pole::AtEnd,
            (None, None) => Pole::None,
        };
        let path_of = |axis: &Axis| {
            if pole == Pole::Beside {
                axis.reduced
            } else {
                axis.position
            }
        };
        let path2 = axes.each_ref().map(|axis| {
            let [_, p1, p2] = float_derivative(&path_of(axis), scale);
            [p1, 2.0 * p2]
        });
        Self {
            origin_nm: record.origin_nm,
            shift: record.shift,
            scale,
            weight: collapse_weight(weight, at),
            position: axes.each_ref().map(|axis| axis.position),
            reduced: axes.each_ref().map(|axis| axis.reduced),
            pole,
            path: axes.each_ref().map(|axis| derivative(&path_of(axis))),
            path2,
            path3: Vec3::each(&path2, |[_, slope]| *slope),
            side: axes.each_ref().map(|axis| axis.side),
            mixed: axes
                .each_ref()
                .map(|axis| float_derivative(&axis.side_plain, scale)),
            side2: axes.each_ref().map(|axis| axis.side2),
            path_factor: PathFactor::of(record.edges, at),
            side_factor: side_factor(record.edges, at),
            tool_sign: travel_sign(at),
        }
    }

    /// The whole pass is one point: the side boundary that it lies on collapses.
    pub(crate) fn is_point(&self) -> bool {
        self.path_factor.factor <= 0.0
    }

    /// The contact at a centred path parameter: the quotient rule, with `N . S_xy = (N . P_xy - w_xy N . S) / w` for the
    /// side's second derivatives, whose tangential parts do not matter.
    #[inline(always)]
    pub(crate) fn contact(&self, w: i32) -> Result<Contact> {
        let at = centred_to_f32(w);
        let weight_q30 = cubic(&self.weight.value, w);
        let inverse = 1.0 / (to_f32(weight_q30) * WEIGHT_UNIT);
        let reciprocal = reciprocal_q29(weight_q30, inverse);
        let position = self.position.each_ref().map(|c| mul_q29(cubic(c, w), reciprocal));
        let s = Vec3::scaled(position, self.scale);
        let (s_path, s_side) = match self.pole {
            Pole::None => (s, s),
            Pole::AtEnd => (s, self.reduced_point(w, inverse)),
            Pole::Beside => (self.reduced_point(w, inverse), s),
        };

        let w_path = parabola(&self.weight.path, at);
        let w_path2 = line(&self.weight.path2, at);
        let p = Vec3::scaled(self.path.each_ref().map(|c| quadratic(c, w)), self.scale);
        let path = (p - s_path * w_path) * inverse;
        let p2 = Vec3::each(&self.path2, |c| line(c, at));
        let path2 = (p2 - path * (2.0 * w_path) - s_path * w_path2) * inverse;
        let curve = path2 * (3.0 * w_path) + path * (3.0 * w_path2) + s_path * self.weight.path3;
        let path3 = (self.path3 - curve) * inverse;

        let p_side = Vec3::scaled(self.side.each_ref().map(|c| cubic(c, w)), self.scale);
        let side = (p_side - s_side * float_cubic(&self.weight.side, at)) * inverse;
        let p_mixed = Vec3::each(&self.mixed, |c| parabola(c, at));
        let mixed = (p_mixed - s * parabola(&self.weight.mixed, at)) * inverse;
        let p_side2 = Vec3::each(&self.side2, |c| float_cubic(c, at));
        let side2 = (p_side2 - s_side * float_cubic(&self.weight.side2, at)) * inverse;
        Derivatives {
            path,
            path2,
            path3,
            side,
            mixed,
            side2,
            path_factor: self.path_factor,
            side_factor: line(&self.side_factor, at),
            tool_sign: self.tool_sign,
        }
        .contact(position)
    }

    /// The reduced numerators over the weight, mm.
    fn reduced_point(&self, w: i32, inverse: f32) -> Vec3 {
        Vec3::scaled(self.reduced.each_ref().map(|c| cubic(c, w)), self.scale * inverse)
    }
}
