//! Step 4: from the scallop limit to the path interval (Lo 1998, eqns 10 and 11).
//!
//! With k the normal curvature across the path towards the tool and c = -k, the step-over along the surface is
//! `l = sqrt(8 r h / (1 + r c))`, and the interval of the side parameter `l / |(N x t) . S_side|`. With the lateral speed under the root,
//! `interval^2 = 8 r h / (lateral^2 - r lateral^2 k)`. The interval of a pass is the minimum over its samples: a sample yields
//! [`Sample::inv_interval_sq`](crate::Sample::inv_interval_sq), `1 / interval^2`, which takes multiplications only; the root and the quotient are
//! computed once per pass.

use crate::surface::Contact;

/// The candidates of the path interval for one ball and scallop limit on one patch.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Interval {
    /// 1 / (8 r h), units^-2, divided by the square of the side span's width.
    factor: f32,
}

impl Interval {
    /// No patch yet.
    pub(crate) const NONE: Self = Self { factor: 0.0 };

    /// For a ball and a scallop limit, mm, on a patch with this number of units per mm, in a span of this width.
    pub(crate) fn new(radius_mm: f32, scallop_mm: f32, units_per_mm: f32, width: f32) -> Self {
        let span = units_per_mm * width;
        Self {
            factor: 1.0 / (8.0 * radius_mm * scallop_mm * (span * span)),
        }
    }

    /// Inverse square interval at a contact that the ball fits, in the side parameter's units; 0 at a pole, where the side derivative is
    /// zero.
    #[inline(always)]
    pub(crate) fn inv_interval_sq(&self, contact: &Contact) -> f32 {
        contact.across * contact.gauge * self.factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample::interval_of;

    /// On a cylinder of radius R, machined lengthwise, the step-over has a closed form: two balls on its outside meet at the
    /// scallop height h where the centres' angle a obeys (R + h)^2 + r^2 ... ; to first order sqrt(8 r h R/(R + r)).
    #[test]
    fn first_order_of_the_cylinder() {
        for (radius, side) in [(50.0_f64, -1.0_f64), (50.0, 1.0), (1e9, 1.0)] {
            let (r, h) = (4.0_f64, 0.005_f64);
            let contact = Contact {
                across: (1.0 - r * side / radius) as f32,
                gauge: 1.0,
                ..Contact::default()
            };
            let inv_interval_sq = Interval::new(r as f32, h as f32, 1.0, 1.0).inv_interval_sq(&contact);
            let got = f64::from(interval_of(inv_interval_sq));
            // Exact: centres at R - side r, cusp at R - side h (side = +1 is the inside), half angle by the cosine law.
            let centre = radius - side * r;
            let cusp = radius - side * h;
            let want = if radius > 1e6 {
                2.0 * (2.0 * r * h - h * h).sqrt()
            } else {
                2.0 * radius * ((centre * centre + cusp * cusp - r * r) / (2.0 * centre * cusp)).acos()
            };
            assert!(
                (got / want - 1.0).abs() < 2.0 * h / r,
                "R {radius}: {got} for {want}"
            );
        }
    }
}
