//! Step 2: the next cutter contact at the wanted feed (Lo 1998, eqn 9).
//!
//! The paper's step is the Taylor series of u(s) to second order. Here it goes to third, `u''' = (4 p^2 - q) / |A|^3` with
//! p = A.A'/|A|^2 and q = (A'.A' + A.A'')/|A|^2, which costs a dozen cycles, needs no second evaluation of the surface, and
//! leaves a relative error of (step / radius of curvature)^3. Where the parametrisation changes its speed within the step by
//! more than [`FINE`], or a step is more than [`FINE_FRACTION`] of its patch, one corrector step about the step's midpoint takes the error to fourth order with a small constant; that is
//! rare, and costs one more evaluation.

use crate::fault::{Fault, FaultKind, Result};
use crate::surface::PathSpeed;

/// Largest correction of the first-order step, relative, for which the series is trusted. At 1/2 the parametrisation
/// doubles or halves its speed within one period; past -1 the step would run backwards.
const CORRECTION_MAX: f32 = 0.5;

/// Largest correction of the first-order step, relative, that the series alone is trusted with: its error is then below
/// the third power, 6e-8 times a small factor.
const FINE: f32 = 1.0 / 256.0;

/// Largest part of a patch likewise: a cubic's speed changes by its own size over a patch, the series' error is a small factor
/// times the third power, 4e-6.
const FINE_FRACTION: f32 = 1.0 / 64.0;

/// A step of the path fraction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step {
    /// Increment of the fraction of the span.
    pub(crate) fraction: f32,
    /// The series is not enough: correct it with [`corrected`].
    pub(crate) coarse: bool,
}

/// Increment of the path fraction for an arc in mm, from the parametrisation at its start.
///
/// # Errors
/// [`FaultKind::ParameterBackwards`] where the series cannot be trusted; its value is the correction, -1 or less where
/// the parameter would run backwards.
#[inline(always)]
pub(crate) fn step(from: &PathSpeed, arc_mm: f32) -> Result<Step> {
    let PathSpeed {
        inverse,
        stretch,
        stretch_change,
        ..
    } = *from;
    let first = arc_mm * inverse;
    let third = (4.0 * stretch * stretch - stretch_change) * (1.0 / 6.0);
    let correction = first * (third * first - 0.5 * stretch);
    // Not `>`: a NaN must not pass.
    if !(correction.abs() <= CORRECTION_MAX) {
        return Err(Fault::new(FaultKind::ParameterBackwards, correction));
    }
    Ok(Step {
        fraction: first + first * correction,
        coarse: correction.abs() > FINE || first > FINE_FRACTION,
    })
}

/// Arc in mm of an increment of the fraction, from the parametrisation at its midpoint: the odd terms cancel, and the
/// relative error is the increment's fourth power over 1920.
pub(crate) fn arc_about(middle: &PathSpeed, fraction: f32) -> f32 {
    let PathSpeed {
        speed,
        stretch,
        stretch_change,
        ..
    } = *middle;
    let bend = stretch_change - stretch * stretch;
    speed * fraction * (1.0 + fraction * fraction * bend * (1.0 / 24.0))
}

/// Largest correction of a coarse step, relative: its square times a small factor is what one corrector step leaves.
const CORRECTED_MAX: f32 = 1.0 / 16.0;

/// A coarse step, corrected by what its arc misses.
///
/// # Errors
/// [`FaultKind::ParameterBackwards`] where it misses too much for one corrector step; its value is the correction.
pub(crate) fn corrected(coarse: f32, arc_mm: f32, middle: &PathSpeed) -> Result<f32> {
    let PathSpeed {
        speed,
        stretch,
        stretch_change,
        ..
    } = *middle;
    let half = 0.5 * coarse;
    let end_speed = speed * (1.0 + half * (stretch + 0.5 * half * (stretch_change - stretch * stretch)));
    let more = (arc_mm - arc_about(middle, coarse)) / end_speed;
    let fraction = coarse + more * (1.0 - 0.5 * stretch * more);
    // Not `>`: a NaN must not pass.
    if !((fraction - coarse).abs() <= CORRECTED_MAX * coarse) {
        return Err(Fault::new(FaultKind::ParameterBackwards, fraction / coarse - 1.0));
    }
    Ok(fraction)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// |A| = e^(k u): arc = (e^(k u) - 1)/k, u = ln(1 + k s)/k; stretch = k, stretch change = 2 k^2.
    fn exponential(k: f32, u: f32) -> PathSpeed {
        let speed = (f64::from(k) * f64::from(u)).exp() as f32;
        PathSpeed {
            speed,
            inverse: 1.0 / speed,
            stretch: k,
            stretch_change: 2.0 * k * k,
        }
    }

    #[test]
    fn third_order_then_corrected() {
        for (k, arc) in [
            (0.5_f64, 0.01_f64),
            (-0.5, 0.01),
            (1.0, 0.02),
            (2.0, 0.005),
            (1.0, 0.1),
            (-3.0, 0.1),
            (3.0, 0.1),
        ] {
            let want = (1.0 + k * arc).ln() / k;
            let coarse = step(&exponential(k as f32, 0.0), arc as f32).unwrap();
            let error = |fraction: f32| (f64::from(fraction) / want - 1.0).abs();
            assert!(
                error(coarse.fraction) < (k * arc).abs().powi(3) + 2e-7,
                "{k} {arc}: {coarse:?} for {want}"
            );
            assert_eq!(
                coarse.coarse,
                (k * arc).abs() > 0.007 || arc > 1.0 / 64.0,
                "{k} {arc}: {coarse:?}"
            );
            let middle = exponential(k as f32, 0.5 * coarse.fraction);
            let fine = corrected(coarse.fraction, arc as f32, &middle).unwrap();
            assert!(
                error(fine) < (k * arc).powi(4) / 200.0 + 2e-7,
                "{k} {arc}: {fine} for {want}"
            );
        }
    }

    #[test]
    fn never_backwards() {
        for k in [-1e6_f32, -300.0, 300.0, 1e6, f32::INFINITY, f32::NAN] {
            match step(&exponential(k, 0.0), 0.01) {
                Ok(step) => assert!(step.fraction > 0.0),
                Err(fault) => assert_eq!(fault.kind, FaultKind::ParameterBackwards),
            }
            match corrected(0.01, 0.01, &exponential(k, 0.5)) {
                Ok(fraction) => assert!(fraction > 0.0),
                Err(fault) => assert_eq!(fault.kind, FaultKind::ParameterBackwards),
            }
        }
    }
}
