//! Step 2: the next cutter contact at the wanted feed (Lo 1998, eqn 9).
//!
//! The paper's step is the Taylor series of u(s) to second order. Here it goes to third, `u''' = (2 p^2 - p')/|A|^3` with
//! `p = A.A'/|A|^2`, and p' is taken from the last two samples, which costs a subtraction and leaves a relative error of (step /
//! radius of curvature)^3. Where the parametrisation changes its speed within the step by more than [`FINE`], a step is not small
//! ([`small_step`]), or there is only one sample yet, [`solve`] takes over: the step's arc by Gauss's two points and one or
//! two Newton steps. That is rare, and costs two evaluations of the first derivative a step.

use crate::arith::{fraction_from_f32, fraction_to_f32, small_step};
use crate::fault::{Fault, FaultKind, Result};
use crate::surface::{PathSpeed, Surface};

/// Largest correction of the first-order step, relative, for which a series is trusted as a first guess. At 1/2 the
/// parametrisation doubles or halves its speed within one period; past -1 the step would run backwards.
const CORRECTION_MAX: f32 = 0.5;

/// Largest correction of the first-order step, relative, that the series alone is trusted with: its error is then below
/// the third power, 6e-8 times a small factor.
const FINE: f32 = 1.0 / 256.0;

/// Largest correction of the guess, relative, for which Newton's method is trusted.
const CORRECTED_MAX: f32 = 1.0 / 16.0;

/// Largest correction of a guess, relative, after which no further one is needed: its square is below f32's last place.
const CORRECTED_FINE: f32 = 1.0 / 1024.0;

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
    if correction.abs() > FINE {
        return None;
    }
    small_step(first + first * correction)
}

/// Arc from a fraction of the patch over `length` more, and the speed at its end relative to the mean: Gauss's two points.
fn arc_over(surface: &Surface, from: u64, length: f32) -> Result<(f32, f32)> {
    const NEAR: f32 = 0.211_324_87;
    // Slope between the points, from the further one to the end: (1 - 0.789)/(0.789 - 0.211).
    const BEYOND: f32 = 0.366_025_4;
    let at = |part: f32| from.saturating_add(fraction_from_f32(part * length));
    let near = 1.0 / surface.path_at(at(NEAR))?.inverse;
    let far = 1.0 / surface.path_at(at(1.0 - NEAR))?.inverse;
    let mean = 0.5 * (near + far);
    let end = far + BEYOND * (far - near);
    Ok((mean * length, end))
}

/// Where an arc ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Reach {
    /// On the patch, at this fraction.
    Within(u64),
    /// Beyond the patch, up to whose end there was this arc.
    Beyond(f32),
}

/// Where an arc from a place ends, by quadrature.
///
/// # Errors
/// [`FaultKind::ParameterBackwards`] where neither series nor quadrature can be trusted; its value is what would have to be
/// added to the first-order step, over that step: -1 or less where the parameter would run backwards. What is wrong with the surface.
pub(crate) fn solve(surface: &Surface, from: u64, start: &PathSpeed, arc: f32) -> Result<Reach> {
    let room = fraction_to_f32(!from);
    let first = arc * start.inverse;
    // The series is about a small part of the patch: where the arc may be all of it, the end is looked at first.
    let long = first > LONG_STEP;
    if long {
        let (covered, _) = arc_over(surface, from, room)?;
        if covered <= arc {
            return Ok(Reach::Beyond(covered));
        }
    }
    let bend = first * start.stretch;
    let correction = bend * (bend * 0.5 - 0.5);
    // Not `>`: a NaN must not pass.
    if !(correction.abs() <= CORRECTION_MAX) {
        return Err(Fault::new(FaultKind::ParameterBackwards, correction));
    }
    let mut guess = first + first * correction;
    if guess >= room {
        guess = room;
        let (covered, _) = arc_over(surface, from, room)?;
        if covered <= arc {
            return Ok(Reach::Beyond(covered));
        }
    }
    for _ in 0..NEWTON_STEPS {
        let (covered, end) = arc_over(surface, from, guess)?;
        let fraction = corrected(guess, arc, covered, end);
        let correction = (fraction - guess).abs();
        // Not `>`: a NaN must not pass.
        if !(correction <= CORRECTED_MAX * guess) {
            return Err(Fault::new(FaultKind::ParameterBackwards, fraction / first - 1.0));
        }
        guess = fraction;
        if correction <= CORRECTED_FINE * guess {
            break;
        }
    }
    Ok(Reach::Within(from.saturating_add(fraction_from_f32(guess))))
}

/// A guess corrected by what its arc misses, from the arc that it covers and the speed at its end.
fn corrected(guess: f32, arc: f32, covered: f32, end: f32) -> f32 {
    let more = (arc - covered) / end;
    // The speed's relative slope over the guess, for the second order of the rest: from its mean to its end.
    let slope = 2.0 * (end * guess - covered) / (end * guess * guess);
    guess + more * (1.0 - 0.5 * slope * more)
}
