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

/// The polynomial patch on one pass: cubics of the path parameter.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PolynomialPass {
    axes: [Line; 3],
}

impl PolynomialPass {
    /// Of no patch yet.
    pub(crate) const NONE: Self = Self {
        axes: [Line::NONE; 3],
    };

    /// Collapses a patch without a pole.
    pub(crate) fn collapse(&mut self, blocks: &[[i32; 16]], at: &PassLine) {
        for (line, block) in self.axes.iter_mut().zip(blocks) {
            line.collapse(block, at);
        }
    }

    /// The parametrisation at a fraction of the patch.
    pub(crate) fn path_at(&self, fraction: u64) -> PathSpeed {
        self.local(fraction).path_speed(1.0)
    }

    #[inline(always)]
    fn local(&self, fraction: u64) -> Local {
        let w = centred(fraction);
        let [x, y, z] = &self.axes;
        let ([x0, x1, x2], [y0, y1, y2], [z0, z1, z2]) =
            (jet(&x.value, w), jet(&y.value, w), jet(&z.value, w));
        let ([xs, xm, _], [ys, ym, _], [zs, zm, _]) = (jet(&x.side, w), jet(&y.side, w), jet(&z.side, w));
        Local {
            position: [x0, y0, z0],
            path: [x1, y1, z1],
            side: [xs, ys, zs],
            path2: [x2, y2, z2],
            mixed: [xm, ym, zm],
            side2: [cubic(&x.side2, w), cubic(&y.side2, w), cubic(&z.side2, w)],
            g: 1.0,
            inverse_g: 1.0,
            excess: 0.0,
        }
    }
}

impl Pass for PolynomialPass {
    #[inline(always)]
    fn contact(&self, fraction: u64, ball: &Ball) -> Result<Contact> {
        self.local(fraction).contact(ball, &Factors::ONE)
    }
}
