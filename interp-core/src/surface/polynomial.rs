//! A bicubic polynomial patch, and its evaluation on a pass.
//!
//! Record, [`POLYNOMIAL_WORDS`] words: origin x, y, z in nm; the head word (shift, collapsed boundaries); then for each
//! of x, y, z the 16 coefficients `c[i][j]` of `path^i side^j`, j fastest, in units of 2^-shift nm, both parameters centred
//! (-1/2 to 1/2).

use super::Ball;
use super::grid::GridPass;
use super::lines::{CoordinateCubics, coefficients, collapses, record_words, split};
use super::range::{BAD_PATCH, Edges, HeadWord, fits};
use super::{Contact, Factors, Local, Pass, PathSpeed};
use crate::fault::Result;
use crate::math::arith::{centred, cubic, jet, tangent};

/// Words of a polynomial patch.
pub const POLYNOMIAL_WORDS: usize = 52;

/// A polynomial patch, unpacked.
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

    /// The record of these words; unused bits of the head word are dropped.
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

    /// Checks that no evaluation can overflow, and that flagged boundaries collapse (to 8 units).
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

/// A polynomial patch on one pass.
pub(crate) struct PolynomialPass<'a>(pub(super) &'a GridPass);

/// A ruled patch on one pass.
pub(crate) struct RuledPass<'a>(pub(super) &'a GridPass);

/// An extruded patch on one pass.
pub(crate) struct ExtrudedPass<'a>(pub(super) &'a GridPass);

/// `MIXED` and `SIDE2`: whether those derivatives are computed; without `MIXED` the side derivative is constant.
#[inline(always)]
fn local<const MIXED: bool, const SIDE2: bool>(pass: &GridPass, fraction: u64) -> Local {
    let w = centred(fraction);
    let [x, y, z] = &pass.axes;
    let side = |line: &CoordinateCubics| {
        if MIXED {
            tangent(&line.side, w)
        } else {
            let [constant, ..] = line.side;
            [constant, 0]
        }
    };
    let side2 = |line: &CoordinateCubics| if SIDE2 { cubic(&line.side2, w) } else { 0 };
    let ([x0, x1, x2], [y0, y1, y2], [z0, z1, z2]) = (jet(&x.value, w), jet(&y.value, w), jet(&z.value, w));
    let ([xs, xm], [ys, ym], [zs, zm]) = (side(x), side(y), side(z));
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

impl PolynomialPass<'_> {
    pub(super) fn local(&self, fraction: u64) -> Local {
        local::<true, true>(self.0, fraction)
    }

    /// The parametrisation at a fraction of the patch.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        let local = local::<false, false>(self.0, fraction);
        PathSpeed::new(&local.path, &local.path2, 0.0, 1.0)
    }
}

impl Pass for PolynomialPass<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let local = local::<true, true>(self.0, fraction);
        local.contact::<true, true>(ball, &Factors::ONE)
    }
}

impl Pass for RuledPass<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let local = local::<true, false>(self.0, fraction);
        local.contact::<true, false>(ball, &Factors::ONE)
    }
}

impl Pass for ExtrudedPass<'_> {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        let local = local::<false, false>(self.0, fraction);
        local.contact::<false, false>(ball, &Factors::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::grid::GridKind;
    use crate::surface::{IsoLine, OffsetUnits};

    /// The derivatives that a specialised shape omits are zero: each result is bit-identical to the general one.
    #[test]
    fn shapes_are_the_free_patch_to_the_bit() {
        let path = [
            [0, 90_000_000, 7_000_000, -3_000_000],
            [0, 5_000_000, -20_000_000, 1_000_000],
        ];
        for (twist, want) in [(0, GridKind::Extruded), (9_000_000, GridKind::Ruled)] {
            let mut block = [[0_i32; 16]; 3];
            for (axis, [c0, c1, c2, c3]) in block.iter_mut().zip([path[0], path[1], [0; 4]]) {
                (axis[0], axis[4], axis[8], axis[12]) = (c0, c1, c2, c3);
                axis[5] = twist;
            }
            block[2][1] = 70_000_000;
            for (side, reversed) in [(0, false), (1 << 30, true), (i32::MIN, false)] {
                let at = IsoLine {
                    fraction: 0,
                    side,
                    reversed,
                };
                let mut pass = GridPass::NONE;
                pass.collapse(&block, Edges::default(), &at);
                assert_eq!(pass.kind, want);
                let ball = Ball::new(&OffsetUnits::new(5.0, 3), 1.0);
                for part in 0..16_u64 {
                    let fraction = part << 60;
                    let free = PolynomialPass(&pass).contact(fraction, &ball).unwrap();
                    let shaped = match want {
                        GridKind::Extruded => ExtrudedPass(&pass).contact(fraction, &ball),
                        _ => RuledPass(&pass).contact(fraction, &ball),
                    };
                    assert_eq!(std::format!("{:?}", shaped.unwrap()), std::format!("{free:?}"));
                }
            }
        }
    }
}
