//! Step 2: the next cutter contact at the wanted feed (Lo 1998, eqn 9).
//!
//! The paper's step is the Taylor series of u(s) to second order. Here it goes to third, `u''' = (2 p^2 - p')/|A|^3` with
//! `p = A.A'/|A|^2`, and p' is taken from the last two samples, which costs a subtraction and leaves a relative error of (step /
//! radius of curvature)^3. Where the parametrisation changes its speed within the step by more than [`FINE`], a step is not small
//! ([`small_step`]), or there is only one sample yet, [`solve`] takes over: arcs by Hermite quadrature, from the speed and its slope
//! at both ends, and one or two Newton steps. That is rare, and costs an evaluation of the first derivatives for each Newton step,
//! and one more where the speed is far from a cubic.

use crate::arith::{fraction_from_f32, fraction_to_f32, small_step};
use crate::fault::{Fault, FaultKind, Result};
use crate::scalar::{Real, float};
use crate::surface::{PathSpeed, Surface};

/// Largest correction of the first-order step, relative, for which a series is trusted as a first guess. At 1/2 the
/// parametrisation doubles or halves its speed within one period; past -1 the step would run backwards.
const CORRECTION_MAX: f32 = 0.5;

/// Largest correction of the first-order step, relative, that the series alone is trusted with: its error is then below
/// the third power, 6e-8 times a small factor.
const FINE: f32 = 1.0 / 256.0;

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
pub(crate) fn step(from: &PathSpeed, stretch_before: Real, arc: Real) -> Option<u64> {
    const THIRD: f32 = 1.0 / 3.0;
    const SIXTH: f32 = 1.0 / 6.0;
    let PathSpeed { inverse, stretch } = *from;
    let first = arc * inverse;
    let bend = first * stretch;
    let change = first * (stretch - stretch_before);
    let correction = bend * (bend * THIRD - 0.5) - change * SIXTH;
    // A NaN makes the step none.
    if correction.abs() > FINE {
        return None;
    }
    small_step(first + first * correction)
}

/// By how much the speed's change over an arc may differ from its slopes' mean, relative to the speed, for which the two ends are
/// enough. For an exponential, whose change of speed within the arc is then 9 %, the arc's error is 1e-7 of itself.
const ROUGH: f32 = 1.0 / 16384.0;

/// Arc from a fraction of the patch over `length` more, where the parametrisation is `end`: Hermite's rule of two points (error
/// `length^5 s^(4) / 720` for a speed s), or of three (`length^7 s^(6) / 604800`).
fn arc_over(surface: &Surface, from: u64, start: &PathSpeed, end: &PathSpeed, length: Real) -> Real {
    let (first, last) = (1.0 / start.inverse, 1.0 / end.inverse);
    let (rise, fall) = (first * start.stretch * length, last * end.stretch * length);
    let (sum, bow) = (first + last, rise - fall);
    if (last - first - 0.5 * (rise + fall)).abs() <= ROUGH * sum {
        return length * (0.5 * sum + bow * (1.0 / 12.0));
    }
    let middle = surface.path_at(from.saturating_add(fraction_from_f32(0.5 * length)));
    length * (sum * (7.0 / 30.0) + bow * (1.0 / 60.0) + 16.0 / 30.0 / middle.inverse)
}

/// The path fraction of an arc within another, both from the same place: Hermite's cubic of the path over the arc.
fn inverse_cubic(arc: Real, start: &PathSpeed, end: &PathSpeed, covered: Real, length: Real) -> Real {
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
    Beyond(Real),
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
    patch_end: impl FnOnce() -> PathSpeed,
    arc: Real,
) -> Result<Reach> {
    let room = fraction_to_f32(!from);
    let first = arc * start.inverse;
    let bend = first * start.stretch;
    let correction = bend * (bend * 0.5 - 0.5);
    let mut guess = first + first * correction;
    // The series is about a small part of the patch: where the arc may be all of it, the end is looked at first.
    let end = if first > LONG_STEP || guess >= room {
        let end = patch_end().checked()?;
        let covered = arc_over(surface, from, start, &end, room);
        if covered <= arc {
            return Ok(Reach::Beyond(covered));
        }
        Some((end, covered))
    } else {
        None
    };
    // Not `>`: a NaN must not pass.
    if !(correction.abs() <= CORRECTION_MAX) {
        return Err(Fault::new(FaultKind::ParameterBackwards, float(correction)));
    }
    if let Some((end, covered)) = end {
        guess = inverse_cubic(arc, start, &end, covered, room);
    }
    for _ in 0..NEWTON_STEPS {
        let end = surface
            .path_at(from.saturating_add(fraction_from_f32(guess)))
            .checked()?;
        let covered = arc_over(surface, from, start, &end, guess);
        let more = (arc - covered) * end.inverse;
        let correction = more - 0.5 * end.stretch * more * more;
        // Not `>`: a NaN must not pass.
        if !(correction.abs() <= CORRECTED_MAX * guess) {
            return Err(Fault::new(
                FaultKind::ParameterBackwards,
                float((guess + correction) / first - 1.0),
            ));
        }
        guess += correction;
        if correction.abs() <= CORRECTED_FINE * guess {
            break;
        }
    }
    Ok(Reach::Within(from.saturating_add(fraction_from_f32(guess))))
}
