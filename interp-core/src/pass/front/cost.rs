//! Cycles of the portions of a front, by the pessimistic model of `cargo sim budget`: the greatest of the sample jobs, rational surfaces with a pole.

/// A portion on another patch than the last one takes its record in addition.
pub(crate) const RECORD: u32 = 2_100;
/// A point of a line.
pub(crate) const LENGTH: u32 = 3_900;
/// The evaluations of a step at a place, in order.
pub(crate) const STEP: [u32; 4] = [7_300, 4_400, 4_800, 4_900];
/// The evaluations of a crest, in order.
pub(crate) const CREST: [u32; 3] = [5_100, 6_300, 7_200];
/// Rows of the sweeps, a portion.
pub(crate) const COPY: u32 = 4_300;
pub(crate) const SWEEP: u32 = 7_400;
pub(crate) const COMPARE: u32 = 15_200;
pub(crate) const HULL: u32 = 8_400;
pub(crate) const SUBSTITUTE: u32 = 11_000;

/// Stations of a front, in search for its parts, a portion.
pub(crate) const PART: u32 = 7_500;
/// Edges of a region against a front, a portion.
pub(crate) const CLIP: u32 = 9_000;

/// Cycles of an evaluation; those after the last one are the last.
pub(crate) const fn of<const N: usize>(evaluations: &[u32; N], number: u8) -> u32 {
    let mut left = number;
    let mut rest = evaluations.as_slice();
    while let [_, after @ ..] = rest
        && left > 0
        && !after.is_empty()
    {
        rest = after;
        left -= 1;
    }
    match rest {
        [first, ..] => *first,
        [] => 0,
    }
}
