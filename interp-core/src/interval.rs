//! Step 4: from the scallop limit to the path interval (Lo 1998, eqns 10 and 11).
//!
//! With k the normal curvature across the path towards the tool and c = -k, the step-over along the surface is
//! `l = sqrt(8 r h / (1 + r c))`, and the interval of the side parameter `l / |(N x t) . S_side|`. Squared and with the
//! lateral speed inside, that is one division and one square root: `sqrt(8 r h / (lateral^2 - r lateral^2 k))`.

use crate::arith::sqrt;
use crate::surface::Contact;

/// The interval of one ball and scallop limit.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Interval {
    radius_mm: f32,
    /// 8 r h, mm^2.
    eight_rh: f32,
}

impl Interval {
    /// No limit yet.
    pub(crate) const NONE: Self = Self {
        radius_mm: 0.0,
        eight_rh: 0.0,
    };

    /// The interval of a ball and a scallop limit, mm.
    pub(crate) fn new(radius_mm: f32, scallop_mm: f32) -> Self {
        Self {
            radius_mm,
            eight_rh: 8.0 * radius_mm * scallop_mm,
        }
    }

    /// Candidate at a contact that the ball fits, in fractions of the side span; infinite at a pole, where the side
    /// direction moves nothing.
    #[inline(always)]
    pub(crate) fn candidate(&self, contact: &Contact) -> f32 {
        let room = contact.lateral_squared - self.radius_mm * contact.lateral_bend;
        if room > 0.0 {
            sqrt(self.eight_rh / room)
        } else {
            f32::INFINITY
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a cylinder of radius R, machined lengthwise, the exact step-over is known: two balls on its outside meet at the
    /// scallop height h where the centres' angle a obeys (R + h)^2 + r^2 ... ; to first order sqrt(8 r h R/(R + r)).
    #[test]
    fn first_order_of_the_cylinder() {
        for (radius, side) in [(50.0_f64, -1.0_f64), (50.0, 1.0), (1e9, 1.0)] {
            let (r, h) = (4.0_f64, 0.005_f64);
            let contact = Contact {
                lateral_squared: 1.0,
                lateral_bend: (side / radius) as f32,
                ..Contact::default()
            };
            let got = f64::from(Interval::new(r as f32, h as f32).candidate(&contact));
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
