//! Step 2: the next cutter contact at the commanded feed (Lo 1998, eqn 9).
//!
//! The paper's step is the Taylor series of u(s) to second order. This one is to third order, `u''' = (2 p^2 - p')/|A|^3` with
//! `p = A.A'/|A|^2`, and p' is the difference of the last two samples' p, which costs a subtraction and leaves a relative error of (step /
//! radius of curvature)^3. Where the correction of the first-order step exceeds [`FINE`], the step is not small
//! ([`small_step`]), or the patch has only one sample yet, [`solve`] is used: arcs by Hermite quadrature, from the speed and its derivative
//! at both ends, and one or two Newton steps. [`solve`] is rare; it costs an evaluation of the first derivatives for each Newton step,
//! and one more where the speed is far from a cubic ([`SMOOTH`]).

use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{fraction_from_f32, fraction_to_f32, small_step};
use crate::math::number::Bounded;
use crate::surface::PathSpeed;

/// Maximum relative correction of the first-order step with which the series is used as a starting value. At 1/2 the
/// parametrisation doubles or halves its speed within one period; below -1 the step is backwards.
const CORRECTION_MAX: f32 = 0.5;

/// Maximum relative correction of the first-order step with which the series is used alone: its error is then below
/// the third power of the correction, 6e-8 times a small factor.
const FINE: f32 = 1.0 / 256.0;

/// Weight of the change of p from one sample to the next: p' from two samples is of first order, and a
/// change of 1/2048 leaves an error below 1e-5 of the step for the p'' implied by the change.
const CHANGE: f32 = 8.0;

/// Maximum relative correction of the starting value for which Newton's method is used.
const CORRECTED_MAX: f32 = 1.0 / 16.0;

/// Maximum relative correction after which no further iteration is needed: the correction is of second order, and its
/// third power is below the resolution of f32.
const CORRECTED_FINE: f32 = 1.0 / 256.0;

/// Maximum Newton iterations.
const NEWTON_STEPS: u8 = 2;

/// First-order step, as a fraction of the patch, beyond which the arc up to the patch's end is computed before the series.
const LONG_STEP: f32 = 0.25;

/// Increment of the path fraction for an arc, units of 2^-64, from the parametrisation at its start and the logarithmic speed derivative one
/// sample earlier (NaN where there is none); none where the series is not accurate enough.
#[inline(always)]
pub(crate) fn step(from: &PathSpeed, log_speed_derivative_before: f32, arc: f32) -> Option<u64> {
    const THIRD: f32 = 1.0 / 3.0;
    const SIXTH: f32 = 1.0 / 6.0;
    let PathSpeed {
        inv_speed: inverse,
        log_speed_derivative,
    } = *from;
    let first = arc * inverse;
    let bend = first * log_speed_derivative;
    let change = first * (log_speed_derivative - log_speed_derivative_before);
    let correction = bend * (bend * THIRD - 0.5) - change * SIXTH;
    // A NaN returns none.
    if correction.abs() + change.abs() * CHANGE > FINE {
        return None;
    }
    small_step(first + first * correction)
}

/// Maximum relative deviation of the speed from a cubic over an arc for which the two-point rule is enough: the share of its second derivative in
/// the arc, and 64 times that of its third. An exponential speed then changes by 8 % within the arc, with a relative error of 4e-8.
const SMOOTH: f32 = 1.0 / 256.0;

/// Maximum relative difference of the two-point and three-point rules for which the latter is accepted: over a whole arc, and over a part of one, where the speed changes
/// most. The error is a third of its power of 3/2: 1e-5.
const APART: f32 = 1.0 / 128.0;
const APART_IN_PART: f32 = 1.0 / 1024.0;

/// Arc from a fraction of the patch to `length` beyond it, where the parametrisation is `end`: Hermite's two-point rule (error
/// `length^5 s^(4) / 720` for a speed s), or of three (`length^7 s^(6) / 604800`). An error where both differ by more than the tolerance.
fn arc_over(
    path_at: &mut impl FnMut(u64) -> PathSpeed,
    from: u64,
    start: &PathSpeed,
    end: &PathSpeed,
    (length, apart): (f32, f32),
) -> core::result::Result<f32, f32> {
    let (first, last) = (1.0 / start.inv_speed, 1.0 / end.inv_speed);
    let (rise, fall) = (
        first * start.log_speed_derivative * length,
        last * end.log_speed_derivative * length,
    );
    let (sum, bow) = (first + last, rise - fall);
    let jerk = last - first - 0.5 * (rise + fall);
    let two = 0.5 * sum + bow * (1.0 / 12.0);
    if bow.abs() + 64.0 * jerk.abs() <= SMOOTH * sum {
        return Ok(length * two);
    }
    let middle = path_at(from.saturating_add(fraction_from_f32(0.5 * length)));
    let three = sum * (7.0 / 30.0) + bow * (1.0 / 60.0) + 16.0 / 30.0 / middle.inv_speed;
    // A NaN is rejected too.
    if (two - three).abs() <= apart * three {
        Ok(length * three)
    } else {
        Err(length * three)
    }
}

/// The path fraction of an arc within a longer one from the same start: cubic Hermite interpolation of the path over the arc.
fn inverse_cubic(arc: f32, start: &PathSpeed, end: &PathSpeed, covered: f32, length: f32) -> f32 {
    let part = arc / covered;
    let rest = 1.0 - part;
    let (first, last) = (covered * start.inv_speed, covered * end.inv_speed);
    part * (rest * rest * first + part * ((3.0 - 2.0 * part) * length - rest * last))
}

/// Largest number of refused arcs in a step: one more is a fault.
const REFUSALS_MAX: u8 = 16;
/// Length of the first part of a period's arc, as a share of the arc.
const FIRST_PART: f32 = 0.25;

/// The parts in which a period's arc is found where a front bends so sharply that the speed changes too much over the whole arc. A part is half as long after one that was
/// too long, and twice as long after two that were not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parts {
    length: f32,
    refusals: u8,
    /// The last part was not refused.
    goes_on: bool,
}

impl Parts {
    /// The whole arc at once.
    pub(crate) const WHOLE: Self = Self {
        length: f32::INFINITY,
        refusals: 0,
        goes_on: true,
    };

    /// The length of the next part, of the rest of the arc.
    pub(crate) fn next(&self, rest: f32) -> f32 {
        self.length.at_most(rest)
    }

    /// Halves the parts after one that was too long. Returns false after too many of these.
    pub(crate) fn shorten(&mut self, length: f32) -> bool {
        self.length = length * if self.refusals == 0 { FIRST_PART } else { 0.5 };
        self.goes_on = false;
        self.refusals += 1;
        self.refusals <= REFUSALS_MAX
    }

    /// After an arc that was found.
    pub(crate) fn lengthen(&mut self) {
        if self.goes_on {
            self.length *= 2.0;
        }
        self.goes_on = true;
    }

    /// Difference of the rules up to which an arc is accepted.
    fn apart(&self) -> f32 {
        if self.refusals > 0 { APART_IN_PART } else { APART }
    }
}

/// End of an arc.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reach {
    /// On the patch, at this fraction.
    Within(u64),
    /// Beyond the patch; the arc up to the patch's end.
    Beyond(f32),
}

/// The parametrisation at the end of the patch, or of the pass on it, and the arc to there.
#[inline(always)]
fn covered_to_end(
    path_at: &mut impl FnMut(u64) -> PathSpeed,
    patch_end: &impl Fn() -> Option<PathSpeed>,
    [from, limit]: [u64; 2],
    start: &PathSpeed,
    room: (f32, f32),
) -> Result<(PathSpeed, core::result::Result<f32, f32>)> {
    let end = patch_end().unwrap_or_else(|| path_at(limit)).checked()?;
    let covered = arc_over(path_at, from, start, &end, room);
    Ok((end, covered))
}

/// Finds the end of an arc by quadrature, on a pass with the parametrisation `path_at`. `limit`: end of the patch, or of the pass on it; `patch_end` returns the
/// parametrisation there, and is called only where the arc may reach it.
///
/// # Errors
/// [`FaultKind::ParameterBackwards`] where neither series nor quadrature is accurate enough; its value is the correction
/// of the first-order step, relative to that step: -1 or less where the parameter would run backwards.
/// [`FaultKind::DegenerateSurface`] where the speed is zero.
pub(crate) fn solve(
    mut path_at: impl FnMut(u64) -> PathSpeed,
    [from, limit]: [u64; 2],
    start: &PathSpeed,
    patch_end: impl Fn() -> Option<PathSpeed>,
    (arc, parts): (f32, &Parts),
) -> Result<Reach> {
    let apart = parts.apart();
    let room = fraction_to_f32(limit.saturating_sub(from));
    let first = arc * start.inv_speed;
    let bend = first * start.log_speed_derivative;
    let correction = bend * (bend * 0.5 - 0.5);
    let mut guess = first + first * correction;
    let refused = |guess: f32| Fault::new(FaultKind::ParameterBackwards, guess / first - 1.0);
    let refused_at_end = |end: &PathSpeed, untrusted: f32| Err(refused(room + path_of(arc - untrusted, end)));
    let mut end = None;
    // The series holds for a small part of the patch: where the arc may cover all of it, the end is evaluated first.
    if first > LONG_STEP || guess >= room {
        match covered_to_end(&mut path_at, &patch_end, [from, limit], start, (room, apart))? {
            (_, Ok(covered)) if covered <= arc => return Ok(Reach::Beyond(covered)),
            (speed, Ok(covered)) => end = Some((speed, covered)),
            (speed, Err(untrusted)) if guess >= room => return refused_at_end(&speed, untrusted),
            // The arc may be short enough for the second-order series.
            (_, Err(_)) => {}
        }
    }
    // Not `>`, so that a NaN is rejected.
    if !(correction.abs() <= CORRECTION_MAX) {
        return Err(Fault::new(FaultKind::ParameterBackwards, correction));
    }
    if let Some((end, covered)) = end {
        guess = inverse_cubic(arc, start, &end, covered, room);
    }
    for _ in 0..NEWTON_STEPS {
        let end = path_at(from.saturating_add(fraction_from_f32(guess))).checked()?;
        let covered = arc_over(&mut path_at, from, start, &end, (guess, apart));
        let (Ok(length) | Err(length)) = covered;
        let correction = path_of(arc - length, &end);
        // Not `>`, so that a NaN is rejected.
        if covered.is_err() || !(correction.abs() <= CORRECTED_MAX * guess) {
            return Err(refused(guess + correction));
        }
        guess += correction;
        if correction.abs() <= CORRECTED_FINE * guess {
            break;
        }
    }
    // The starting value was before the patch's end; the arc ends beyond it.
    if guess >= room && end.is_none() {
        match covered_to_end(&mut path_at, &patch_end, [from, limit], start, (room, apart))? {
            (_, Ok(covered)) if covered <= arc => return Ok(Reach::Beyond(covered)),
            (_, Ok(_)) => {}
            (speed, Err(untrusted)) => return refused_at_end(&speed, untrusted),
        }
    }
    Ok(Reach::Within(from.saturating_add(fraction_from_f32(guess))))
}

/// The path fraction of a short arc, to second order, from the parametrisation `end`.
fn path_of(arc: f32, end: &PathSpeed) -> f32 {
    let more = arc * end.inv_speed;
    more - 0.5 * end.log_speed_derivative * more * more
}

#[cfg(test)]
mod tests;
