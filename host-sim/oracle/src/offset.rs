//! The tool centre's path over a pass: its derivative (Lo eqn 4 in its general form), and the foot point of a
//! commanded centre.

use super::contact::{Contact, Oracle, OracleError};
use super::derivatives::Derivatives;
use glam::DVec3;
use job::Along;

/// Step into the surface at which derivatives at a pole are evaluated, as a share of the range.
const INWARDS: f64 = 1e-6;
/// Below this share of the other one, each times its range, a first derivative is near a pole, where the derivative of the centre along a curve is
/// extrapolated: the curve's slope multiplies the quotients that vanish there.
const NEAR_POLE_SHARE: f64 = 1e-5;
/// Steps of that extrapolation, as a share of the range: three of them leave a relative error near 1e-8.
const POLE_STEP: f64 = 1e-3;
/// Distance from a break, as a share of the range, at which the two sides are compared: a continuous ratio
/// changes by less than a relative 1e-9 between them.
const BESIDE: f64 = 1e-10;
/// Iterations of [`Oracle::foot`]. Each multiplies the error by (distance from the path) x (its curvature), at most 1e-3 for
/// every approach here; six reduce a hundredth of a millimetre to rounding.
const FOOT_STEPS: usize = 6;
/// A correction below this share of the range ends the iteration: the remaining error is a thousandth of it.
const FOOT_TOLERANCE: f64 = 1e-11;

/// A point of a pass with the derivative of the tool centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffsetPoint {
    /// Path parameter.
    pub path: f64,
    /// The contact.
    pub contact: Contact,
    /// dCL / d(path parameter), mm per unit.
    pub cl_velocity: DVec3,
}

impl OffsetPoint {
    /// Speed of the centre per unit speed of the contact: `|A + r N_u| / |A|`; 1 on a pass that is a single point.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        if self.contact.path_speed > 0.0 {
            self.cl_velocity.length() / self.contact.path_speed
        } else {
            1.0
        }
    }
}

impl Oracle {
    /// Contact and derivative of the tool centre at a point of a pass.
    ///
    /// # Errors
    /// [`OracleError::Degenerate`] where there is no normal.
    pub fn offset(&self, path: f64, side: f64) -> Result<OffsetPoint, OracleError> {
        let (u, v) = self.swapped(path, side);
        let at = self.surface.at(u, v);
        let contact = self.contact_of(&at, u, v)?;
        let cl_velocity = match self.cl_velocity(&at, contact.normal) {
            Some(velocity) => velocity,
            None => self.velocity_beside(path, side).unwrap_or_default(),
        };
        Ok(OffsetPoint {
            path,
            contact,
            cl_velocity,
        })
    }

    /// [`Oracle::offset`] at a point of a curve `side(path)` with this slope: path speed and derivative of the centre are those along the curve.
    ///
    /// # Errors
    /// As [`Oracle::offset`].
    pub fn offset_on_curve(&self, path: f64, side: f64, slope: f64) -> Result<OffsetPoint, OracleError> {
        if slope == 0.0 {
            return self.offset(path, side);
        }
        let (u, v) = self.swapped(path, side);
        let at = self.surface.at(u, v);
        let mut contact = self.contact_of(&at, u, v)?;
        let (a, b) = self.along_and_across(&at);
        contact.path_speed = (a + b * slope).length();
        let [length, width] = [self.path_range(), self.side_range()].map(|[low, high]| high - low);
        let (along, across) = (a.length() * length, b.length() * width);
        let cl_velocity = if along.min(across) > NEAR_POLE_SHARE * along.max(across) {
            self.curve_velocity(&at, contact.normal, slope)
        } else {
            self.velocity_near_pole(path, side, slope, along < across)?
        };
        Ok(OffsetPoint {
            path,
            contact,
            cl_velocity,
        })
    }

    fn along_and_across(&self, at: &Derivatives) -> (DVec3, DVec3) {
        match self.along {
            Along::U => (at.u, at.v),
            Along::V => (at.v, at.u),
        }
    }

    /// Derivative of the centre on a curve of this slope, away from poles.
    fn curve_velocity(&self, at: &Derivatives, normal: DVec3, slope: f64) -> DVec3 {
        let (a, b) = self.along_and_across(at);
        let (aa, bb) = match self.along {
            Along::U => (at.uu, at.vv),
            Along::V => (at.vv, at.uu),
        };
        let (e, f, g) = (a.length_squared(), a.dot(b), b.length_squared());
        // The second fundamental form of the tangent with A and with B.
        let mixed = at.uv.dot(normal);
        let l = aa.dot(normal) + slope * mixed;
        let m = mixed + slope * bb.dot(normal);
        let turned = a * (g * l - f * m) + b * (e * m - f * l);
        a + b * slope - turned * (self.radius_mm / a.cross(b).length_squared())
    }

    /// Derivative of the centre along a curve near a pole, extrapolated from three places on the curve; `beside`: the pole is beside the passes.
    fn velocity_near_pole(
        &self,
        path: f64,
        side: f64,
        slope: f64,
        beside: bool,
    ) -> Result<DVec3, OracleError> {
        let (t, [low, high]) = match beside {
            true => (side, self.side_range()),
            false => (path, self.path_range()),
        };
        let step = POLE_STEP
            * if t - low <= high - t {
                high - low
            } else {
                low - high
            };
        let velocity = |steps: f64| {
            let (path, side) = match beside {
                true => (path, side + steps * step),
                false => (path + steps * step, side + steps * step * slope),
            };
            let (u, v) = self.swapped(path, side);
            let at = self.surface.at(u, v);
            let normal = self.contact_of(&at, u, v)?.normal;
            Ok(self.curve_velocity(&at, normal, slope))
        };
        Ok((velocity(1.0)? - velocity(2.0)?) * 3.0 + velocity(3.0)?)
    }

    /// `A + r N_A` by the Weingarten equations; `None` where the derivatives do not span the tangent plane.
    fn cl_velocity(&self, at: &Derivatives, normal: DVec3) -> Option<DVec3> {
        let (a, b, aa) = match self.along {
            Along::U => (at.u, at.v, at.uu),
            Along::V => (at.v, at.u, at.vv),
        };
        let (e, f, g) = (a.length_squared(), a.dot(b), b.length_squared());
        let product = a.cross(b);
        let determinant = product.length_squared();
        if determinant.is_nan() || determinant <= 1e-18 * e * g {
            return None;
        }
        let (l, m) = (aa.dot(normal), at.uv.dot(normal));
        let turned = a * (g * l - f * m) + b * (e * m - f * l);
        Some(a - turned * (self.radius_mm / determinant))
    }

    /// The derivative at a small step into the surface from a pole.
    fn velocity_beside(&self, path: f64, side: f64) -> Option<DVec3> {
        let inwards = |t: f64, [low, high]: [f64; 2]| {
            let step = INWARDS * (high - low);
            if t - low <= high - t { t + step } else { t - step }
        };
        for (path, side) in [
            (inwards(path, self.path_range()), side),
            (path, inwards(side, self.side_range())),
        ] {
            let (u, v) = self.swapped(path, side);
            let velocity = self
                .contact(u, v)
                .ok()
                .and_then(|contact| self.cl_velocity(&self.surface.at(u, v), contact.normal));
            if velocity.is_some() {
                return velocity;
            }
        }
        None
    }

    /// Largest step of the centre's speed, per unit speed of the contact, at the patch boundaries on a pass:
    /// 0, up to rounding, where the patches are curvature continuous.
    ///
    /// # Errors
    /// As [`Oracle::offset`].
    pub fn ratio_step(&self, side: f64) -> Result<f64, OracleError> {
        let breaks = self.surface.breaks(self.along);
        let mut most = 0.0_f64;
        for at in &breaks[1..breaks.len() - 1] {
            let beside = |by: f64| self.offset(at + by * (breaks[breaks.len() - 1] - breaks[0]), side);
            most = most.max((beside(BESIDE)?.ratio() - beside(-BESIDE)?.ratio()).abs());
        }
        Ok(most)
    }

    /// Path parameter of the point of the offset path nearest to a commanded centre close to the path; `guess`: a
    /// parameter near it.
    ///
    /// # Errors
    /// As [`Oracle::offset`].
    pub fn foot(&self, cl_mm: DVec3, guess: f64, side: f64) -> Result<OffsetPoint, OracleError> {
        foot_on(cl_mm, guess, self.path_range(), |path| self.offset(path, side))
    }
}

/// [`Oracle::foot`] on any path between two path parameters, given by its offset points.
///
/// # Errors
/// Those of `offset`.
pub fn foot_on(
    cl_mm: DVec3,
    guess: f64,
    [low, high]: [f64; 2],
    offset: impl Fn(f64) -> Result<OffsetPoint, OracleError>,
) -> Result<OffsetPoint, OracleError> {
    let mut at = offset(guess.clamp(low, high))?;
    for _ in 0..FOOT_STEPS {
        let squared = at.cl_velocity.length_squared();
        if squared <= 0.0 {
            break;
        }
        let by = (cl_mm - at.contact.cl_mm).dot(at.cl_velocity) / squared;
        let next = (at.path + by).clamp(low, high);
        let moved = (next - at.path).abs();
        at = offset(next)?;
        if moved <= FOOT_TOLERANCE * (high - low) {
            break;
        }
    }
    Ok(at)
}
