//! Step 2: the next cutter contact at the wanted feed (Lo 1998, eqn 9).
//!
//! The paper's step is the Taylor series of u(s) to second order. Here it goes to third, `u''' = (2 p^2 - p')/|A|^3` with
//! `p = A.A'/|A|^2`, and p' is taken from the last two samples, which costs a subtraction and leaves a relative error of (step /
//! radius of curvature)^3. Where the change of the speed moves the step's end by more than [`FINE`], a step is not small
//! ([`small_step`]), or there is only one sample yet, [`solve`] takes over: arcs by Hermite quadrature, from the speed and its slope
//! at both ends, and one or two Newton steps. That is rare, and costs an evaluation of the first derivatives for each Newton step,
//! and one more where the speed is far from a cubic ([`SMOOTH`]).

use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{fraction_from_f32, fraction_to_f32, small_step};
use crate::surface::{PathSpeed, Surface};

/// Largest correction of the first-order step, relative, for which a series is trusted as a first guess. At 1/2 the
/// parametrisation doubles or halves its speed within one period; past -1 the step would run backwards.
const CORRECTION_MAX: f32 = 0.5;

/// Largest correction of the first-order step, relative, that the series alone is trusted with: its error is then below
/// the third power, 6e-8 times a small factor.
const FINE: f32 = 1.0 / 256.0;

/// How much more the change of p from one sample to the next counts: p' from two samples is good to first order, and a
/// change of 1/2048 leaves less than 1e-5 of the step where p'' is what the change says.
const CHANGE: f32 = 8.0;

/// Largest correction of the guess, relative, for which Newton's method is trusted.
const CORRECTED_MAX: f32 = 1.0 / 16.0;

/// Largest correction of a guess, relative, after which no further one is needed: a correction is of second order, and its
/// third power is below f32's last place.
const CORRECTED_FINE: f32 = 1.0 / 256.0;

/// Newton steps at most.
const NEWTON_STEPS: u8 = 2;

/// First-order step, as a fraction of the patch, beyond which the patch's end is looked at before the series.
const LONG_STEP: f32 = 0.25;

/// Increment of the path fraction for an arc, units of 2^-64, from the parametrisation at its start and the stretch one
/// sample earlier (NaN where there is none); none where the series is not enough.
#[inline(always)]
pub(crate) fn step(from: &PathSpeed, stretch_before: f32, arc: f32) -> Option<u64> {
    const THIRD: f32 = 1.0 / 3.0;
    const SIXTH: f32 = 1.0 / 6.0;
    let PathSpeed { inverse, stretch } = *from;
    let first = arc * inverse;
    let bend = first * stretch;
    let change = first * (stretch - stretch_before);
    let correction = bend * (bend * THIRD - 0.5) - change * SIXTH;
    // A NaN makes the step none.
    if correction.abs() + change.abs() * CHANGE > FINE {
        return None;
    }
    small_step(first + first * correction)
}

/// How far the speed may be from a cubic over an arc, relative, for which its two ends are enough: its second derivative's share of
/// the arc, and 64 times its third's. An exponential then changes by 8 % within the arc, whose error is 4e-8 of itself.
const SMOOTH: f32 = 1.0 / 256.0;

/// How far the rules of two and three points may be apart, relative, for the latter to be trusted.
const APART: f32 = 1.0 / 128.0;

/// Arc from a fraction of the patch over `length` more, where the parametrisation is `end`: Hermite's rule of two points (error
/// `length^5 s^(4) / 720` for a speed s), or of three (`length^7 s^(6) / 604800`). An error where both are too far apart to be trusted.
fn arc_over(
    surface: &Surface,
    from: u64,
    start: &PathSpeed,
    end: &PathSpeed,
    length: f32,
) -> core::result::Result<f32, f32> {
    let (first, last) = (1.0 / start.inverse, 1.0 / end.inverse);
    let (rise, fall) = (first * start.stretch * length, last * end.stretch * length);
    let (sum, bow) = (first + last, rise - fall);
    let jerk = last - first - 0.5 * (rise + fall);
    let two = 0.5 * sum + bow * (1.0 / 12.0);
    if bow.abs() + 64.0 * jerk.abs() <= SMOOTH * sum {
        return Ok(length * two);
    }
    let middle = surface.path_at(from.saturating_add(fraction_from_f32(0.5 * length)));
    let three = sum * (7.0 / 30.0) + bow * (1.0 / 60.0) + 16.0 / 30.0 / middle.inverse;
    // A NaN is not to be trusted either.
    if (two - three).abs() <= APART * three {
        Ok(length * three)
    } else {
        Err(length * three)
    }
}

/// The path fraction of an arc within another, both from the same place: Hermite's cubic of the path over the arc.
fn inverse_cubic(arc: f32, start: &PathSpeed, end: &PathSpeed, covered: f32, length: f32) -> f32 {
    let part = arc / covered;
    let rest = 1.0 - part;
    let (first, last) = (covered * start.inverse, covered * end.inverse);
    part * (rest * rest * first + part * ((3.0 - 2.0 * part) * length - rest * last))
}

/// Where an arc ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reach {
    /// On the patch, at this fraction.
    Within(u64),
    /// Beyond the patch, up to whose end there was this arc.
    Beyond(f32),
}

/// Where an arc from a place ends, by quadrature. `patch_end` is the parametrisation at the patch's end, asked for where it may matter.
///
/// # Errors
/// [`FaultKind::ParameterBackwards`] where neither series nor quadrature can be trusted; its value is what would have to be
/// added to the first-order step, over that step: -1 or less where the parameter would run backwards.
/// [`FaultKind::DegenerateSurface`] where the speed vanishes.
pub(crate) fn solve(
    surface: &Surface,
    from: u64,
    start: &PathSpeed,
    patch_end: impl Fn() -> PathSpeed,
    arc: f32,
) -> Result<Reach> {
    let room = fraction_to_f32(!from);
    let first = arc * start.inverse;
    let bend = first * start.stretch;
    let correction = bend * (bend * 0.5 - 0.5);
    let mut guess = first + first * correction;
    let refused = |guess: f32| Fault::new(FaultKind::ParameterBackwards, guess / first - 1.0);
    // The series is about a small part of the patch: where the arc may be all of it, the end is looked at first.
    let to_end = || -> Result<(PathSpeed, core::result::Result<f32, f32>)> {
        let end = patch_end().checked()?;
        let covered = arc_over(surface, from, start, &end, room);
        Ok((end, covered))
    };
    let refused_at_end = |end: &PathSpeed, untrusted: f32| Err(refused(room + path_of(arc - untrusted, end)));
    let mut end = None;
    if first > LONG_STEP || guess >= room {
        match to_end()? {
            (_, Ok(covered)) if covered <= arc => return Ok(Reach::Beyond(covered)),
            (speed, Ok(covered)) => end = Some((speed, covered)),
            (speed, Err(untrusted)) if guess >= room => return refused_at_end(&speed, untrusted),
            // The arc itself may be short enough to be trusted.
            (_, Err(_)) => {}
        }
    }
    // Not `>`: a NaN must not pass.
    if !(correction.abs() <= CORRECTION_MAX) {
        return Err(Fault::new(FaultKind::ParameterBackwards, correction));
    }
    if let Some((end, covered)) = end {
        guess = inverse_cubic(arc, start, &end, covered, room);
    }
    for _ in 0..NEWTON_STEPS {
        let end = surface
            .path_at(from.saturating_add(fraction_from_f32(guess)))
            .checked()?;
        let covered = arc_over(surface, from, start, &end, guess);
        let (Ok(length) | Err(length)) = covered;
        let correction = path_of(arc - length, &end);
        // Not `>`: a NaN must not pass.
        if covered.is_err() || !(correction.abs() <= CORRECTED_MAX * guess) {
            return Err(refused(guess + correction));
        }
        guess += correction;
        if correction.abs() <= CORRECTED_FINE * guess {
            break;
        }
    }
    // The guess was short of the patch's end, and the arc is not.
    if guess >= room && end.is_none() {
        match to_end()? {
            (_, Ok(covered)) if covered <= arc => return Ok(Reach::Beyond(covered)),
            (_, Ok(_)) => {}
            (speed, Err(untrusted)) => return refused_at_end(&speed, untrusted),
        }
    }
    Ok(Reach::Within(from.saturating_add(fraction_from_f32(guess))))
}

/// The path of a short arc, to second order, from where the parametrisation is `end`.
fn path_of(arc: f32, end: &PathSpeed) -> f32 {
    let more = arc * end.inverse;
    more - 0.5 * end.stretch * more * more
}

#[cfg(test)]
mod tests;
