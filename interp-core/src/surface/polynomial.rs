//! A bicubic polynomial patch, and its collapse to cubics on a pass.
//!
//! Record, [`POLYNOMIAL_WORDS`] words: origin x, y, z in nm; the head word (shift, collapsed boundaries); then for each
//! of x, y, z the 16 coefficients `c[i][j]` of `path^i side^j`, j fastest, in units of 2^-shift nm, both parameters centred
//! (-1/2 to 1/2).

use super::range::{BAD_PATCH, Edges, HeadWord, Root, fits};
use super::{Contact, Derivatives, PassLine, PathFactor};
use crate::arith::{centred_to_f32, count_to_f32, cubic, quadratic, to_f32};
use crate::fault::Result;
use crate::vec3::Vec3;

/// Words of a polynomial patch.
pub const POLYNOMIAL_WORDS: usize = 52;

/// Millimetres per nanometre.
pub(crate) const MM_PER_NM: f32 = 1e-6;

/// A polynomial patch, unpacked: what a loader writes and a test reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PolynomialRecord {
    /// Origin of the patch, nm.
    pub origin_nm: [i32; 3],
    /// Units of the coefficients are 2^-shift nm; at most [`super::SHIFT_MAX`].
    pub shift: u8,
    /// Boundaries that collapse into a point.
    pub edges: Edges,
    /// `c[axis][i][j]` of `path^i side^j`, parameters centred.
    pub coefficients: [[[i32; 4]; 4]; 3],
}

impl PolynomialRecord {
    /// The record's words.
    #[must_use]
    pub fn to_words(&self) -> [i32; POLYNOMIAL_WORDS] {
        let mut words = [0; POLYNOMIAL_WORDS];
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
    pub fn from_words(words: &[i32; POLYNOMIAL_WORDS]) -> Self {
        let ([x, y, z, head], rest) = split_head(words);
        let HeadWord { shift, edges } = HeadWord::from_word(head);
        let mut coefficients = [[[0; 4]; 4]; 3];
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
    pub(crate) fn side_edges(words: &[i32; POLYNOMIAL_WORDS]) -> [bool; 2] {
        let ([.., head], _) = split_head(words);
        let edges = HeadWord::from_word(head).edges;
        [edges.side_start, edges.side_end]
    }

    /// Whether the board takes the patch: nothing can overflow, and flagged boundaries do collapse (to 8 units).
    ///
    /// # Errors
    /// [`crate::fault::FaultKind::BadPatch`].
    pub fn check(words: &[i32; POLYNOMIAL_WORDS]) -> Result<()> {
        let ([.., head], _) = split_head(words);
        let record = Self::from_words(words);
        if !HeadWord::check(head) || !record.coefficients.iter().all(fits) {
            return BAD_PATCH;
        }
        let collapses = |c: &[[i32; 4]; 4]| collapses(c, record.edges);
        if record.coefficients.iter().all(collapses) {
            Ok(())
        } else {
            BAD_PATCH
        }
    }
}

/// Splits a record into its four head words and its coefficients.
pub(super) fn split_head(words: &[i32]) -> ([i32; 4], &[i32]) {
    match words.split_first_chunk::<4>() {
        Some((head, rest)) => (*head, rest),
        None => ([0; 4], &[]),
    }
}

/// Units by which a collapsed boundary may miss being a point: the rounding of its coefficients.
const COLLAPSE_UNITS: i32 = 8;

/// Whether the flagged boundaries of one coordinate are constant along themselves.
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

/// A polynomial patch on one pass: cubics in the path parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PolynomialPass {
    pub(crate) origin_nm: [i32; 3],
    pub(crate) shift: u8,
    /// mm per unit.
    scale: f32,
    /// S, fixed point.
    position: [[i32; 4]; 3],
    /// Ã, fixed point.
    path: [[i32; 3]; 3],
    /// B̃, fixed point.
    side: [[i32; 4]; 3],
    /// Ã', mm.
    path2: [[f32; 2]; 3],
    /// Ã'', mm.
    path3: Vec3,
    /// S_path,side, mm.
    mixed: [[f32; 3]; 3],
    /// S_side,side, mm.
    side2: [[f32; 4]; 3],
    /// a.
    path_factor: PathFactor,
    /// b = offset + slope w.
    side_factor: [f32; 2],
    tool_sign: f32,
}

/// One coordinate of a [`PolynomialPass`].
struct Axis {
    position: [i32; 4],
    path: [i32; 3],
    side: [i32; 4],
    mixed: [f32; 3],
    side2: [f32; 4],
}

/// Negates the odd powers: the same polynomial travelled backwards.
pub(super) const fn turn(c: [i32; 4], reversed: bool) -> [i32; 4] {
    let [c0, c1, c2, c3] = c;
    if reversed { [c0, -c1, c2, -c3] } else { c }
}

/// The derivative's coefficients.
pub(super) const fn derivative(c: &[i32; 4]) -> [i32; 3] {
    let [_, c1, c2, c3] = *c;
    [c1, c2.wrapping_mul(2), c3.wrapping_mul(3)]
}

/// Side derivative of a row at a side parameter.
pub(super) const fn slope(row: &[i32; 4], y: i32) -> i32 {
    quadratic(&derivative(row), y)
}

/// Second side derivative of a row at a side parameter, in units.
pub(super) fn second(row: &[i32; 4], y: f32) -> f32 {
    let [_, _, r2, r3] = *row;
    2.0 * to_f32(r2) + 6.0 * to_f32(r3) * y
}

/// Derivative of a cubic in mm, as coefficients of a float polynomial.
pub(super) fn float_derivative(c: &[i32; 4], scale: f32) -> [f32; 3] {
    let [_, c1, c2, c3] = c.map(to_f32);
    [c1 * scale, 2.0 * c2 * scale, 3.0 * c3 * scale]
}

#[inline(always)]
pub(super) fn line(c: &[f32; 2], w: f32) -> f32 {
    let [c0, c1] = *c;
    c0 + c1 * w
}

#[inline(always)]
pub(super) fn parabola(c: &[f32; 3], w: f32) -> f32 {
    let [c0, c1, c2] = *c;
    c0 + (c1 + c2 * w) * w
}

#[inline(always)]
pub(super) fn float_cubic(c: &[f32; 4], w: f32) -> f32 {
    let [c0, c1, c2, c3] = *c;
    c0 + (c1 + (c2 + c3 * w) * w) * w
}

/// The second side derivative on the pass, as a cubic in mm (or weight).
pub(super) fn second_side(rows: &[[i32; 4]; 4], at: &PassLine, scale: f32) -> [f32; 4] {
    let [b0, b1, b2, b3] = rows.map(|row| second(&row, centred_to_f32(at.side)) * scale);
    if at.reversed {
        [b0, -b1, b2, -b3]
    } else {
        [b0, b1, b2, b3]
    }
}

/// A float cubic with a root divided out; the same where there is none.
pub(super) fn divided(c: [f32; 4], root: Option<Root>) -> [f32; 4] {
    let [_, c1, c2, c3] = c;
    match root {
        None => c,
        Some(Root::Start) => {
            let q1 = c2 - 0.5 * c3;
            [c1 - 0.5 * q1, q1, c3, 0.0]
        }
        Some(Root::End) => {
            let q1 = c2 + 0.5 * c3;
            [-(c1 + 0.5 * q1), -q1, -c3, 0.0]
        }
    }
}

fn collapse_axis(rows: &[[i32; 4]; 4], at: &PassLine, edges: Edges, scale: f32) -> Axis {
    let y = at.side;
    let position = turn(rows.map(|row| cubic(&row, y)), at.reversed);
    let side = turn(rows.map(|row| slope(&row, y)), at.reversed);
    let side2 = divided(second_side(rows, at, scale), edges.path_root(at.reversed));
    let path = match edges.side_root() {
        None => derivative(&position),
        Some(root) => derivative(&turn(
            rows.map(|row| quadratic(&root.divide(&row), y)),
            at.reversed,
        )),
    };
    let side_divided = match edges.path_root(at.reversed) {
        None => side,
        Some(root) => {
            let [q0, q1, q2] = root.divide(&side);
            [q0, q1, q2, 0]
        }
    };
    Axis {
        position,
        path,
        side: side_divided,
        mixed: float_derivative(&side, scale),
        side2,
    }
}

/// b of a patch with these collapsed boundaries, as offset and slope.
pub(super) fn side_factor(edges: Edges, at: &PassLine) -> [f32; 2] {
    edges.path_root(at.reversed).map_or([1.0, 0.0], Root::linear)
}

/// Sign on `path x side` in the direction of travel.
pub(super) fn travel_sign(at: &PassLine) -> f32 {
    if at.reversed { -at.tool_sign } else { at.tool_sign }
}

/// mm per unit of 2^-shift nm.
pub(super) fn unit_mm(shift: u8) -> f32 {
    MM_PER_NM / count_to_f32(1 << shift.min(super::SHIFT_MAX))
}

impl PolynomialPass {
    /// The patch at the pass's side parameter.
    pub(crate) fn collapse(words: &[i32; POLYNOMIAL_WORDS], at: &PassLine) -> Self {
        let record = PolynomialRecord::from_words(words);
        let scale = unit_mm(record.shift);
        let axes = record
            .coefficients
            .each_ref()
            .map(|rows| collapse_axis(rows, at, record.edges, scale));
        let path2 = axes.each_ref().map(|axis| {
            let [_, p1, p2] = axis.path.map(to_f32);
            [p1 * scale, 2.0 * p2 * scale]
        });
        Self {
            origin_nm: record.origin_nm,
            shift: record.shift,
            scale,
            position: axes.each_ref().map(|axis| axis.position),
            path: axes.each_ref().map(|axis| axis.path),
            side: axes.each_ref().map(|axis| axis.side),
            path2,
            path3: Vec3::each(&path2, |[_, slope]| *slope),
            mixed: axes.each_ref().map(|axis| axis.mixed),
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

    /// The contact at a centred path parameter.
    #[inline(always)]
    pub(crate) fn contact(&self, w: i32) -> Result<Contact> {
        let float = centred_to_f32(w);
        Derivatives {
            path: Vec3::scaled(self.path.each_ref().map(|c| quadratic(c, w)), self.scale),
            path2: Vec3::each(&self.path2, |c| line(c, float)),
            path3: self.path3,
            side: Vec3::scaled(self.side.each_ref().map(|c| cubic(c, w)), self.scale),
            mixed: Vec3::each(&self.mixed, |c| parabola(c, float)),
            side2: Vec3::each(&self.side2, |c| float_cubic(c, float)),
            path_factor: self.path_factor,
            side_factor: line(&self.side_factor, float),
            tool_sign: self.tool_sign,
        }
        .contact(self.position.each_ref().map(|c| cubic(c, w)))
    }
}
