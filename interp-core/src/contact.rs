//! Step 2: the next cutter contact at the wanted feed (Lo 1998, eqn 9).
//!
//! The paper's step is the Taylor series of u(s) to second order. Here it goes to third, `u''' = (4 p^2 - q) / |A|^3` with
//! p = A.A'/|A|^2 and q = (A'.A' + A.A'')/|A|^2, which costs a dozen cycles, needs no second evaluation of the surface, and
//! leaves a relative error of (step / radius of curvature)^3. One over the square root and everything else is shared with
//! the offset and the interval.

use crate::fault::{Fault, FaultKind, Result};
use crate::surface::PathSpeed;

/// Largest correction of the first-order step, relative, for which the series is trusted. At 1/2 the parametrisation
/// doubles or halves its speed within one period; past -1 the step would run backwards.
const CORRECTION_MAX: f32 = 0.5;

/// What one period's arc comes to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<'a> {
    /// The parametrisation at the last sample.
    pub(crate) from: &'a PathSpeed,
}

impl Step<'_> {
    /// Increment of the path fraction for an arc in mm, relative truncation error (arc/radius)^3.
    ///
    /// # Errors
    /// [`FaultKind::ParameterBackwards`] where the series cannot be trusted; its value is the correction, -1 or less where
    /// the parameter would run backwards.
    #[inline(always)]
    pub(crate) fn fraction(&self, arc_mm: f32) -> Result<f32> {
        let PathSpeed { inverse, stretch, stretch_change, .. } = *self.from;
        let first = arc_mm * inverse;
        let third = (4.0 * stretch * stretch - stretch_change) * (1.0 / 6.0);
        let correction = first * (third * first - 0.5 * stretch);
        // Not `>`: a NaN must not pass.
        if !(correction.abs() <= CORRECTION_MAX) {
            return Err(Fault::new(FaultKind::ParameterBackwards, correction));
        }
        Ok(first + first * correction)
    }

    /// Arc in mm of an increment of the path fraction: the inverse series, to the same order.
    pub(crate) fn arc(&self, fraction: f32) -> f32 {
        let PathSpeed { speed, stretch, stretch_change, .. } = *self.from;
        let third = (stretch_change - stretch * stretch) * (1.0 / 6.0);
        speed * fraction * (1.0 + fraction * (0.5 * stretch + fraction * third))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// |A| = e^(k u): arc = (e^(k u) - 1)/k, u = ln(1 + k s)/k; stretch = k, stretch change = 2 k^2.
    fn exponential(k: f32) -> PathSpeed {
        PathSpeed { speed: 1.0, inverse: 1.0, stretch: k, stretch_change: 2.0 * k * k }
    }

    #[test]
    fn third_order() {
        for (k, arc) in [(0.5_f64, 0.01_f64), (-0.5, 0.01), (1.0, 0.02), (2.0, 0.005)] {
            let path = exponential(k as f32);
            let step = Step { from: &path };
            let want = (1.0 + k * arc).ln() / k;
            let got = f64::from(step.fraction(arc as f32).unwrap());
            assert!((got / want - 1.0).abs() < (k * arc).powi(3) + 2e-7, "{k} {arc}: {got} for {want}");
            let back = f64::from(step.arc(want as f32));
            assert!((back / arc - 1.0).abs() < (k * arc).powi(3) + 2e-7, "{k} {arc}: {back}");
        }
    }

    #[test]
    fn never_backwards() {
        for k in [-1e6_f32, -300.0, 300.0, 1e6, f32::INFINITY, f32::NAN] {
            let path = exponential(k);
            match (Step { from: &path }).fraction(0.01) {
                Ok(step) => assert!(step > 0.0),
                Err(fault) => assert_eq!(fault.kind, FaultKind::ParameterBackwards),
            }
        }
    }
}
