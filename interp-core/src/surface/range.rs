//! The head word of a patch record, and bounds that prove that a patch's polynomials cannot overflow.

use crate::fault::{Fault, FaultKind, Result};

/// Maximum shift: units of 2^-12 nm, finer than any application requires.
pub const SHIFT_MAX: u8 = 12;

/// The boundary of a patch that collapses into a point; at most one, because the polynomials are divided by the distance from it. It has to be flagged: the normal
/// beside one that is not loses its digits, and the run ends in [`FaultKind::DegenerateSurface`] on it. A flagged one has to be a point exactly: all its coefficients
/// (of a rational patch its numerators, from the point as the origin) vanish.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// The boundary at the start of the path parameter.
    pub path_start: bool,
    /// The boundary at the end of the path parameter.
    pub path_end: bool,
    /// The boundary at the start of the side parameter.
    pub side_start: bool,
    /// The boundary at the end of the side parameter.
    pub side_end: bool,
}

impl Edges {
    /// Number of collapsed boundaries.
    #[must_use]
    pub const fn count(self) -> u8 {
        self.path_start as u8 + self.path_end as u8 + self.side_start as u8 + self.side_end as u8
    }

    /// The root of B along the path, if any (in the direction of travel).
    pub(crate) const fn path_root(self, reversed: bool) -> Option<Root> {
        Root::of(self.path_start, self.path_end, reversed)
    }

    /// The root of A across the pass, if any.
    pub(crate) const fn side_root(self) -> Option<Root> {
        Root::of(self.side_start, self.side_end, false)
    }
}

/// A polynomial's zero at an end of the span.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Root {
    /// At w = -1/2; the factor is 1/2 + w.
    Start,
    /// At w = 1/2; the factor is 1/2 - w.
    End,
}

impl Root {
    const fn of(start: bool, end: bool, reversed: bool) -> Option<Self> {
        match (start, end, reversed) {
            (true, _, false) | (false, true, true) => Some(Self::Start),
            (false, true, false) | (true, _, true) => Some(Self::End),
            (false, false, _) => None,
        }
    }

    /// Quotient of a cubic by the root's factor (non-negative on the span), rounded to a unit.
    pub(crate) const fn divide(self, c: &[i32; 4]) -> [i32; 3] {
        let [_, c1, c2, c3] = *c;
        match self {
            // (w + 1/2) q
            Self::Start => {
                let q1 = c2.wrapping_sub(c3 >> 1);
                [c1.wrapping_sub(q1 >> 1), q1, c3]
            }
            // (1/2 - w) q
            Self::End => {
                let q1 = c2.wrapping_add(c3 >> 1);
                [
                    c1.wrapping_add(q1 >> 1).wrapping_neg(),
                    q1.wrapping_neg(),
                    c3.wrapping_neg(),
                ]
            }
        }
    }

    /// The factor at a centred parameter, units of 2^-32; exactly 0 at the root.
    pub(crate) const fn factor(self, w: i32) -> u32 {
        match self {
            Self::Start => w.wrapping_sub(i32::MIN).cast_unsigned(),
            Self::End => i32::MAX.wrapping_sub(w).cast_unsigned(),
        }
    }

    /// The factor as offset and slope of a linear function of w.
    pub(crate) const fn linear(self) -> [f32; 2] {
        match self {
            Self::Start => [0.5, 1.0],
            Self::End => [0.5, -1.0],
        }
    }
}

/// Word 3 of a patch record: bits 0 to 7 the shift, bit 8 path start, 9 path end, 10 side start, 11 side end collapsed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct HeadWord {
    /// Units are 2^-shift nm.
    pub(crate) shift: u8,
    /// Collapsed boundaries.
    pub(crate) edges: Edges,
}

impl HeadWord {
    pub(crate) const fn to_word(self) -> i32 {
        let e = self.edges;
        self.shift as i32
            | (e.path_start as i32) << 8
            | (e.path_end as i32) << 9
            | (e.side_start as i32) << 10
            | (e.side_end as i32) << 11
    }

    /// Unused bits are ignored here; [`HeadWord::check`] refuses them.
    pub(crate) const fn from_word(word: i32) -> Self {
        let [shift, flags, ..] = word.to_le_bytes();
        Self {
            shift: if shift > SHIFT_MAX { SHIFT_MAX } else { shift },
            edges: Edges {
                path_start: flags & 1 != 0,
                path_end: flags & 2 != 0,
                side_start: flags & 4 != 0,
                side_end: flags & 8 != 0,
            },
        }
    }

    /// Whether the word is valid: no unknown bit, at most one boundary collapsed.
    pub(crate) const fn check(word: i32) -> bool {
        let head = Self::from_word(word);
        head.to_word() == word && head.edges.count() <= 1
    }
}

/// Largest |value| of a cubic's partial Horner sums and of its value, for |w| <= 1/2 (and one unit of rounding a step).
pub(crate) fn bound(c: &[i64; 4]) -> i64 {
    let mut tail = 0_i64;
    let mut worst = 0_i64;
    for c in c.iter().rev() {
        tail = c.abs().saturating_add((tail >> 1) + 1);
        worst = worst.max(tail);
    }
    worst
}

/// Bound of one coordinate of a patch, `c[i][j]` times `path^i side^j`, over everything that `collapse` and `contact` evaluate
/// in fixed point: the cubics, their derivatives up to the second (halves of the pure second ones), and those divided by a root.
pub(crate) fn patch_bound(c: &[[i32; 4]; 4]) -> i64 {
    let wide = |row: &[i32; 4]| -> [i64; 4] { row.map(i64::from) };
    let [c0, c1, c2, c3] = c;
    let rows = [
        bound(&wide(c0)),
        bound(&wide(c1)),
        bound(&wide(c2)),
        bound(&wide(c3)),
    ];
    let slope = |row: &[i32; 4]| {
        let [_, r1, r2, r3] = wide(row);
        // Divided by a root, a quotient's coefficients are at most these tails; the derivative's own bound is below.
        let t3 = r3.abs();
        let t2 = r2.abs() + t3 / 2 + 1;
        let t1 = r1.abs() + t2 / 2 + 1;
        bound(&[r1, 2 * r2, 3 * r3, 0]).max(t1 + t2 / 2 + t3 / 4)
    };
    let slopes = [slope(c0), slope(c1), slope(c2), slope(c3)];
    let [r0, r1, r2, r3] = rows;
    let value = bound(&[r0, r1, r2, r3]);
    let along = bound(&[r1, 2 * r2, 3 * r3, 0]);
    // A quotient along the path, of the side derivative.
    let [s0, s1, s2, s3] = slopes;
    let (t3, t2) = (s3, s2 + s3 / 2 + 1);
    let across = bound(&[s0, s1, s2, s3]).max(s1 + t2 / 2 + 1 + t2 / 2 + t3 / 4);
    // The mixed derivative, or a path derivative of a quotient across the pass.
    let mixed = bound(&[s1, 2 * s2, 3 * s3, 0]);
    // Half the second side derivative, and its quotient along the path.
    let half = |row: &[i32; 4]| {
        let [_, _, r2, r3] = wide(row);
        r2.abs() + (3 * r3.abs() + 1) / 2 + 1
    };
    let [h0, h1, h2, h3] = [half(c0), half(c1), half(c2), half(c3)];
    let t2 = h2 + h3 / 2 + 1;
    let second = bound(&[h0, h1, h2, h3]).max(h1 + t2 / 2 + 1 + t2 / 2 + h3 / 4);
    value.max(along).max(across).max(mixed).max(second)
}

/// Whether a bound stays within i32 with a margin of half a nanometre.
pub(crate) fn fits_range(bound: i64) -> bool {
    bound < i64::from(i32::MAX) - (1 << SHIFT_MAX)
}

/// Whether all of a coordinate's values stay within i32.
pub(crate) fn fits(c: &[[i32; 4]; 4]) -> bool {
    fits_range(patch_bound(c))
}

/// [`FaultKind::BadPatch`]; the caller sets the patch's index as the value.
pub(crate) const BAD_PATCH: Result<()> = Err(Fault::new(FaultKind::BadPatch, 0.0));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn root_division_is_exact_up_to_a_unit() {
        for root in [Root::Start, Root::End] {
            let q = [123_456_i32, -98_768, 45_640];
            // p = factor q, multiplied out.
            let [h, s] = root.linear().map(f64::from);
            let [q0, q1, q2] = q.map(f64::from);
            let p = [h * q0, h * q1 + s * q0, h * q2 + s * q1, s * q2].map(|c| c.round() as i32);
            for (got, want) in root.divide(&p).into_iter().zip(q) {
                assert!((got - want).abs() <= 2, "{root:?}: {got} for {want}");
            }
        }
        assert_eq!(Root::Start.factor(i32::MIN), 0);
        assert_eq!(Root::End.factor(i32::MAX), 0);
        assert_eq!(Root::End.factor(i32::MIN), u32::MAX);
    }

    #[test]
    fn head_word_round_trip() {
        for word in 0..=0xfff {
            assert_eq!(HeadWord::check(word), {
                word & 0xff <= i32::from(SHIFT_MAX) && (word >> 8).count_ones() <= 1
            });
        }
        assert!(!HeadWord::check(0x1000));
        assert!(!HeadWord::check(-1));
    }
}
