//! A bicubic polynomial patch, and its collapse to cubics on a pass.
//!
//! Record, [`POLYNOMIAL_WORDS`] words: origin x, y, z in nm; the head word (shift, collapsed boundaries); then for each
//! of x, y, z the 16 coefficients `c[i][j]` of `path^i side^j`, j fastest, in units of 2^-shift nm, both parameters centred
//! (-1/2 to 1/2).

use super::lines::{Line, coefficients, collapses, record_words, split};
use super::range::{BAD_PATCH, Edges, HeadWord, fits};
use super::{Contact, Factors, Local, Pass, PassLine, PathSpeed};
use crate::arith::{centred, cubic, jet};
use crate::fault::Result;
use crate::offset::Ball;

/// Words of a polynomial patch.
pub const POLYNOMIAL_WORDS: usize = 52;

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
        record_words(self.origin_nm, self.shift, self.edges, &self.coefficients)
    }

    /// The record of these words; meaningless bits of the head word are dropped.
    #[must_use]
    pub fn from_words(words: &[i32; POLYNOMIAL_WORDS]) -> Self {
        let ([x, y, z, head], blocks) = split(words);
        let HeadWord { shift, edges } = HeadWord::from_word(head);
        Self {
            origin_nm: [x, y, z],
            shift,
            edges,
            coefficients: coefficients(blocks),
        }
    }

    /// Whether the board takes the patch: nothing can overflow, and flagged boundaries do collapse (to 8 units).
    ///
    /// # Errors
    /// [`crate::fault::FaultKind::BadPatch`].
    pub fn check(words: &[i32; POLYNOMIAL_WORDS]) -> Result<()> {
        let ([.., head], _) = split(words);
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

/// What of a patch vanishes, so that its samples need not evaluate it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Shape {
    /// Nothing.
    #[default]
    Free,
    /// The second side derivative: ruled across the pass.
    Ruled,
    /// The mixed derivative too: every ruling is the same, and the surface an extrusion of its passes.
    Extruded,
}

/// The polynomial patch on one pass: cubics of the path parameter.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PolynomialPass {
    axes: [Line; 3],
    shape: Shape,
}

/// A pass on a ruled patch.
pub(crate) struct Ruled<'a>(pub(crate) &'a PolynomialPass);

/// A pass on an extruded patch.
pub(crate) struct Extruded<'a>(pub(crate) &'a PolynomialPass);

impl PolynomialPass {
    /// Of no patch yet.
    pub(crate) const NONE: Self = Self {
        axes: [Line::NONE; 3],
        shape: Shape::Free,
    };

    /// What of the patch vanishes.
    pub(crate) const fn shape(&self) -> Shape {
        self.shape
    }

    /// Collapses a patch without a pole.
    pub(crate) fn collapse(&mut self, blocks: &[[i32; 16]], at: &PassLine) {
        let (mut side2, mut mixed) = (0, 0);
        for (line, block) in self.axes.iter_mut().zip(blocks) {
            line.collapse(block, at);
            let ([_, s1, s2, s3], [h0, h1, h2, h3]) = (line.side, line.side2);
            mixed |= s1 | s2 | s3;
            side2 |= h0 | h1 | h2 | h3;
        }
        self.shape = match (side2, mixed) {
            (0, 0) => Shape::Extruded,
            (0, _) => Shape::Ruled,
            _ => Shape::Free,
        };
    }

    /// The parametrisation at a fraction of the patch.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let local = self.local::<false, false>(fraction);
        PathSpeed::new(&local.path, &local.path2, 0.0, 1.0)
    }

    /// `MIXED` and `SIDE2`: whether those derivatives are wanted; without the former the side derivative is constant.
    #[inline(always)]
    fn local<const MIXED: bool, const SIDE2: bool>(&self, fraction: u64) -> Local {
        let w = centred(fraction);
        let [x, y, z] = &self.axes;
        let side = |line: &Line| {
            if MIXED {
                jet(&line.side, w)
            } else {
                let [constant, ..] = line.side;
                [constant, 0, 0]
            }
        };
        let side2 = |line: &Line| if SIDE2 { cubic(&line.side2, w) } else { 0 };
        let ([x0, x1, x2], [y0, y1, y2], [z0, z1, z2]) =
            (jet(&x.value, w), jet(&y.value, w), jet(&z.value, w));
        let ([xs, xm, _], [ys, ym, _], [zs, zm, _]) = (side(x), side(y), side(z));
        Local {
            position: [x0, y0, z0],
            path: [x1, y1, z1],
            side: [xs, ys, zs],
            path2: [x2, y2, z2],
            mixed: [xm, ym, zm],
            side2: [side2(x), side2(y), side2(z)],
            g: 1.0,
            inverse_g: 1.0,
            excess: 0.0,
        }
    }
}

impl Pass for PolynomialPass {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let local = self.local::<true, true>(fraction);
        local.contact::<true, true>(ball, &Factors::ONE)
    }
}

impl Pass for Ruled<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let local = self.0.local::<true, false>(fraction);
        local.contact::<true, false>(ball, &Factors::ONE)
    }
}

impl Pass for Extruded<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let local = self.0.local::<false, false>(fraction);
        local.contact::<false, false>(ball, &Factors::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::PassLine;

    /// What a shape leaves out is nothing: each agrees with the free one to the last bit.
    #[test]
    fn shapes_are_the_free_patch_to_the_bit() {
        let path = [
            [0, 90_000_000, 7_000_000, -3_000_000],
            [0, 5_000_000, -20_000_000, 1_000_000],
        ];
        for (twist, want) in [(0, Shape::Extruded), (9_000_000, Shape::Ruled)] {
            let mut block = [[0_i32; 16]; 3];
            for (axis, [c0, c1, c2, c3]) in block.iter_mut().zip([path[0], path[1], [0; 4]]) {
                (axis[0], axis[4], axis[8], axis[12]) = (c0, c1, c2, c3);
                axis[5] = twist;
            }
            block[2][1] = 70_000_000;
            for (side, reversed) in [(0, false), (1 << 30, true), (i32::MIN, false)] {
                let at = PassLine {
                    fraction: 0,
                    side,
                    reversed,
                };
                let mut pass = PolynomialPass::default();
                pass.collapse(&block, &at);
                assert_eq!(pass.shape(), want);
                let ball = Ball::new(5.0, 3, 1.0);
                for part in 0..16_u64 {
                    let fraction = part << 60;
                    let free = pass.contact(fraction, &ball).unwrap();
                    let shaped = match want {
                        Shape::Extruded => Extruded(&pass).contact(fraction, &ball),
                        _ => Ruled(&pass).contact(fraction, &ball),
                    };
                    assert_eq!(std::format!("{:?}", shaped.unwrap()), std::format!("{free:?}"));
                }
            }
        }
    }
}
