//! Contact geometry: tool normal, curvatures, step-over and interval (Lo eqns 2, 3, 10, 11, corrected).

use std::fmt;

use super::derivatives::Derivatives;
use super::region::RegionEdges;
use super::smooth::SmoothParameter;
use super::surface::Surface;
use glam::DVec3;
use job::{Along, Job, Pattern, Region, Side, Spacing, Start};

/// A first derivative shorter than this share of the other one (each times its range) marks a pole, where the patch's
/// edge collapses to a point. Rounding leaves about 1e-15 there; a regular surface stays above 1e-4.
const POLE_SHARE: f64 = 1e-9;
/// Below this share the curvatures are extrapolated as at the pole. They are quotients of quantities that vanish with the square of the share:
/// f64 rounding of 1e-16 gives errors above 1e-6 below it (at 1e-9, noise alone). A tool that starts from standstill reaches such points.
const NEAR_POLE_SHARE: f64 = 1e-5;
/// `|S_u x S_v|` below this share of `|S_u| |S_v|` gives no reliable normal.
const SINE_MIN: f64 = 1e-9;
/// Step away from a pole for its curvatures, as a share of the range: extrapolation from three such steps has a relative error near 1e-8,
/// from truncation and rounding alike.
const POLE_STEP: f64 = 1e-3;
/// Grid points per parameter for the decision which side is up.
const ORIENTATION_GRID: u32 = 48;
/// Least |sum of the normal's z| over the surface, as a share of the sum of |z|, for a definite upper side.
const ORIENTATION_SHARE: f64 = 0.1;
/// Least sum of |z|, as a share of the surface's area: a vertical wall has no upper side.
const UPWARD_SHARE: f64 = 1e-3;

/// Reason for which the oracle has no result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OracleError {
    /// `S_u x S_v` vanishes at a point that is not a pole.
    Degenerate {
        /// Parameter u of the point.
        u: f64,
        /// Parameter v of the point.
        v: f64,
    },
    /// The ball does not fit the surface's curvature.
    BallDoesNotFit {
        /// Parameter u of the point.
        u: f64,
        /// Parameter v of the point.
        v: f64,
        /// Ball radius times curvature towards the tool, 1 or more.
        fit: f64,
    },
    /// `side = "up"` is ambiguous: the normal's z, summed over the surface, nearly cancels.
    NoUpperSide,
    /// The path interval converges to 0 before the passes reach the other boundary.
    TooManyPasses,
}

impl fmt::Display for OracleError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Degenerate { u, v } => write!(out, "the surface has no normal at u = {u}, v = {v}"),
            Self::BallDoesNotFit { u, v, fit } => {
                write!(
                    out,
                    "the ball does not fit at u = {u}, v = {v}: curvature times ball radius is {fit:.4}"
                )
            }
            Self::NoUpperSide => {
                write!(
                    out,
                    "the surface faces up as much as down, so side = \"up\" is ambiguous; write \"+\" or \"-\""
                )
            }
            Self::TooManyPasses => write!(
                out,
                "the path interval becomes too small to reach the other boundary"
            ),
        }
    }
}

impl std::error::Error for OracleError {}

/// Contact geometry of the ball and the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Cutter contact CC, mm.
    pub cc_mm: DVec3,
    /// Unit normal N from the material to the tool.
    pub normal: DVec3,
    /// Cutter location CL = CC + r N, mm.
    pub cl_mm: DVec3,
    /// Speed of the path parameter |A|, mm per unit of the parameter; 0 on a pass that degenerates to a pole.
    pub path_speed: f64,
    /// Normal curvature along the pass, 1/mm.
    pub curvature_path: f64,
    /// Normal curvature across the pass, 1/mm.
    pub curvature_side: f64,
    /// Least and largest principal curvature, 1/mm.
    pub principal: [f64; 2],
    /// |(N x t) . B|: distance across the pass per unit of the side parameter, mm; 0 at a pole between passes.
    pub lateral_speed: f64,
    /// Step-over l along the surface, mm; NaN where the ball does not fit.
    pub step_over_mm: f64,
    /// Candidate of the path interval, in units of the side parameter: infinite at a pole, NaN where the ball does not fit.
    pub interval: f64,
}

impl Contact {
    /// Ball radius times the largest curvature towards the tool: the ball fits where it is below 1.
    #[must_use]
    pub fn fit(&self, radius_mm: f64) -> f64 {
        radius_mm * self.principal[1]
    }
}

/// The exact geometry of a job.
#[derive(Clone, Debug)]
pub struct Oracle {
    /// The surface.
    pub surface: Surface,
    /// The path parameter.
    pub along: Along,
    /// Order of the passes.
    pub pattern: Pattern,
    /// Sign of the tool normal on `S_u x S_v`: 1 or -1.
    pub normal_sign: f64,
    /// Ball radius r, mm.
    pub radius_mm: f64,
    /// Scallop height limit h, mm.
    pub scallop_mm: f64,
    /// Rule for the distance between passes.
    pub spacing: Spacing,
    /// Sampling period T, s.
    pub period_s: f64,
    /// Programmed feed, mm/s.
    pub feed_mm_s: f64,
    /// Whether turns beyond the boundary join the passes: these then begin and end within a period's step of it.
    pub overruns: bool,
    /// Whether there are axis limits: a boundary that is a single point is then cut with one normal.
    pub has_limits: bool,
    /// The region that is machined; `None` for the whole surface.
    pub region: Option<RegionEdges>,
    /// What of it is machined line by line, one after the other.
    pub(super) cells: Vec<RegionEdges>,
}

/// Curvatures of a contact, 1/mm; see [`Contact`].
struct Curvatures {
    curvature_path: f64,
    curvature_side: f64,
    principal: [f64; 2],
}

impl Oracle {
    /// The oracle of a job.
    ///
    /// # Errors
    /// [`OracleError::NoUpperSide`] if the job requests the upper side and the surface has none.
    pub fn new(job: &Job) -> Result<Self, OracleError> {
        let surface = Surface::new(&job.surface);
        let normal_sign = match job.side {
            Side::Up => upper_side(&surface)?,
            Side::Plus => 1.0,
            Side::Minus => -1.0,
        };
        let breaks = match job.along {
            Along::U => [Along::U, Along::V],
            Along::V => [Along::V, Along::U],
        };
        let edges = |region: &Region| {
            RegionEdges::new(
                region,
                job.along,
                breaks.map(|parameter| surface.breaks(parameter)),
                job.spacing.is_constant(),
            )
        };
        let region = job.region.as_ref().map(edges);
        let parts = job.region.as_ref().map_or_else(Vec::new, Region::parts);
        let cells = parts.iter().map(edges).collect();
        Ok(Self {
            surface,
            region,
            cells,
            along: job.along,
            pattern: job.pattern,
            normal_sign,
            radius_mm: job.radius_mm,
            scallop_mm: job.scallop_mm,
            spacing: job.spacing,
            period_s: job.machine.period_s(),
            feed_mm_s: job.feed_mm_s(),
            overruns: job.overrun_mm > 0.0 && job.pattern == Pattern::Zigzag && job.machine.has_limits(),
            has_limits: job.machine.has_limits(),
        })
    }

    /// The side parameter's name.
    #[must_use]
    pub fn across(&self) -> Along {
        match self.along {
            Along::U => Along::V,
            Along::V => Along::U,
        }
    }

    /// Range of the path parameter.
    #[must_use]
    pub fn path_range(&self) -> [f64; 2] {
        self.surface.range(self.along)
    }

    /// Range of the side parameter.
    #[must_use]
    pub fn side_range(&self) -> [f64; 2] {
        self.surface.range(self.across())
    }

    /// Side parameter of the first pass and of the last: on the boundaries; from the middle to the first boundary; from the last boundary to the first where passes
    /// of constant scallop height begin on the edge, and the last one alone is a point.
    #[must_use]
    pub fn outer_passes(&self) -> [f64; 2] {
        let [first, last] = self.side_range();
        match self.spacing {
            Spacing::Constant(Start::Middle) => [SmoothParameter::new(self, self.across()).middle(), first],
            Spacing::Constant(Start::Edge) if self.is_point(last) && !self.is_point(first) => [last, first],
            _ => [first, last],
        }
    }

    /// Whether the line at a side parameter is a point.
    pub(crate) fn is_point(&self, side: f64) -> bool {
        let [low, high] = self.path_range();
        let [first, last] = self.side_range();
        let (u, v) = self.swapped(0.5 * (low + high), side);
        let at = self.surface.at(u, v);
        let (along, across) = match self.along {
            Along::U => (at.u, at.v),
            Along::V => (at.v, at.u),
        };
        along.length() * (high - low) <= POLE_SHARE * across.length() * (last - first)
    }

    /// Converts (path, side) to (u, v), and back.
    #[must_use]
    pub fn swapped(&self, first: f64, second: f64) -> (f64, f64) {
        match self.along {
            Along::U => (first, second),
            Along::V => (second, first),
        }
    }

    /// Contact geometry at (u, v). At a pole (one of S_u, S_v vanishes on a boundary) the normal is the limit by the
    /// mixed derivative, and the curvatures are extrapolated from points near the pole (relative error about 1e-8).
    ///
    /// # Errors
    /// [`OracleError::Degenerate`] where there is no normal.
    pub fn contact(&self, u: f64, v: f64) -> Result<Contact, OracleError> {
        self.contact_of(&self.surface.at(u, v), u, v)
    }

    /// Unit normal N from the material to the tool at (u, v); `at`: the surface's derivatives there. At a pole as in [`Oracle::contact`].
    ///
    /// # Errors
    /// [`OracleError::Degenerate`] where there is no normal.
    pub fn normal(&self, at: &Derivatives, u: f64, v: f64) -> Result<DVec3, OracleError> {
        let [[u0, u1], [v0, v1]] = self.surface.domain();
        let reach = (at.u.length() * (u1 - u0), at.v.length() * (v1 - v0));
        let (least, most) = (reach.0.min(reach.1), reach.0.max(reach.1));
        let (limit_u, limit_v) = if least <= POLE_SHARE * most {
            self.limits_at_pole(u, v, at, reach.0 < reach.1)
        } else {
            (at.u, at.v)
        };
        let product = limit_u.cross(limit_v);
        let area = product.length();
        if area.is_nan() || area <= SINE_MIN * limit_u.length() * limit_v.length() {
            return Err(OracleError::Degenerate { u, v });
        }
        Ok(product * (self.normal_sign / area))
    }

    /// Directions of S_u and S_v at a pole: near it the derivative that vanishes is the mixed one times the signed step into the surface.
    fn limits_at_pole(&self, u: f64, v: f64, at: &Derivatives, u_vanishes: bool) -> (DVec3, DVec3) {
        let inwards = self.inwards(u, v, u_vanishes);
        if u_vanishes {
            (at.uv * inwards, at.v)
        } else {
            (at.u, at.uv * inwards)
        }
    }

    /// As [`Oracle::contact`], with the surface's derivatives precomputed.
    pub(super) fn contact_of(&self, at: &Derivatives, u: f64, v: f64) -> Result<Contact, OracleError> {
        let [[u0, u1], [v0, v1]] = self.surface.domain();
        let (speed_u, speed_v) = (at.u.length(), at.v.length());
        let reach = (speed_u * (u1 - u0), speed_v * (v1 - v0));
        let u_vanishes = reach.0 < reach.1;
        let (least, most) = (reach.0.min(reach.1), reach.0.max(reach.1));
        if least <= POLE_SHARE * most {
            return self.contact_at_pole(u, v, at, u_vanishes);
        }
        let contact = self.regular_contact(at, self.normal(at, u, v)?);
        if least > NEAR_POLE_SHARE * most {
            return Ok(contact);
        }
        let beside = self.beside_pole(u, v, u_vanishes)?;
        Ok(self.with_curvatures(
            contact.cc_mm,
            contact.normal,
            contact.path_speed,
            contact.lateral_speed,
            [beside.curvature_path, beside.curvature_side],
            beside.principal,
        ))
    }

    /// Steps 3 and 4 where both derivatives are regular.
    fn regular_contact(&self, at: &Derivatives, normal: DVec3) -> Contact {
        let (a, b, aa, bb) = match self.along {
            Along::U => (at.u, at.v, at.uu, at.vv),
            Along::V => (at.v, at.u, at.vv, at.uu),
        };
        let (e, f) = (a.length_squared(), a.dot(b));
        let (l, m, n) = (aa.dot(normal), at.uv.dot(normal), bb.dot(normal));
        let alpha = -f / e;
        // |a A + B|^2 without the cancellation of E a^2 + 2 F a + G
        let across = a * alpha + b;
        let across_squared = across.length_squared();
        let curvature_side = (l * alpha * alpha + 2.0 * m * alpha + n) / across_squared;
        let curvature_path = l / e;
        // The same form in the orthogonal directions: torsion of the pass, then Mohr's circle.
        let twist = (l * alpha + m) / (e * across_squared).sqrt();
        let mean = 0.5 * (curvature_path + curvature_side);
        let spread = (0.5 * (curvature_path - curvature_side)).hypot(twist);
        self.with_curvatures(
            at.point,
            normal,
            e.sqrt(),
            across_squared.sqrt(),
            [curvature_path, curvature_side],
            [mean - spread, mean + spread],
        )
    }

    /// The contact with the step-over and the interval that follow from the curvatures.
    fn with_curvatures(
        &self,
        cc_mm: DVec3,
        normal: DVec3,
        path_speed: f64,
        lateral_speed: f64,
        [curvature_path, curvature_side]: [f64; 2],
        principal: [f64; 2],
    ) -> Contact {
        let room = 1.0 - self.radius_mm * curvature_side;
        let step_over_mm = if room > 0.0 {
            (8.0 * self.radius_mm * self.scallop_mm / room).sqrt()
        } else {
            f64::NAN
        };
        Contact {
            cc_mm,
            normal,
            cl_mm: cc_mm + normal * self.radius_mm,
            path_speed,
            curvature_path,
            curvature_side,
            principal,
            lateral_speed,
            step_over_mm,
            interval: step_over_mm / lateral_speed,
        }
    }

    /// Contact at a pole. `u_vanishes`: S_u vanishes (the boundary of constant v collapses).
    fn contact_at_pole(
        &self,
        u: f64,
        v: f64,
        at: &Derivatives,
        u_vanishes: bool,
    ) -> Result<Contact, OracleError> {
        let normal = self.normal(at, u, v)?;
        let beside = self.beside_pole(u, v, u_vanishes)?;
        let pass_collapses = u_vanishes == (self.along == Along::U);
        let path_speed = if pass_collapses {
            0.0
        } else {
            (if u_vanishes { at.v } else { at.u }).length()
        };
        // At a pole every side line has its own direction: its own speed and curvature apply.
        let (side, side2) = if u_vanishes { (at.v, at.vv) } else { (at.u, at.uu) };
        let (lateral_speed, curvature_side) = if pass_collapses {
            (side.length(), side2.dot(normal) / side.length_squared())
        } else {
            (0.0, beside.curvature_side)
        };
        let curvatures = [beside.curvature_path, curvature_side];
        Ok(self.with_curvatures(
            at.point,
            normal,
            path_speed,
            lateral_speed,
            curvatures,
            beside.principal,
        ))
    }

    /// 1 where the parameter that leads away from the pole (v, if S_u vanishes) increases into the surface, else -1.
    fn inwards(&self, u: f64, v: f64, u_vanishes: bool) -> f64 {
        let [range_u, range_v] = self.surface.domain();
        let ([from, to], t) = if u_vanishes { (range_v, v) } else { (range_u, u) };
        if t - from <= to - t { 1.0 } else { -1.0 }
    }

    /// Curvatures at or near a pole, extrapolated from three points farther from the pole.
    fn beside_pole(&self, u: f64, v: f64, u_vanishes: bool) -> Result<Curvatures, OracleError> {
        let [[u0, u1], [v0, v1]] = self.surface.domain();
        let range = if u_vanishes { v1 - v0 } else { u1 - u0 };
        let step = POLE_STEP * self.inwards(u, v, u_vanishes) * range;
        let beside: [Result<Contact, OracleError>; 3] = std::array::from_fn(|k| {
            let by = step * (k as f64 + 1.0);
            let (u, v) = if u_vanishes { (u, v + by) } else { (u + by, v) };
            let at = self.surface.at(u, v);
            let product = at.u.cross(at.v);
            let area = product.length();
            if area > 0.0 {
                Ok(self.regular_contact(&at, product * (self.normal_sign / area)))
            } else {
                Err(OracleError::Degenerate { u, v })
            }
        });
        let [one, two, three] = beside;
        let (one, two, three) = (one?, two?, three?);
        let limit = |of: fn(&Contact) -> f64| 3.0 * (of(&one) - of(&two)) + of(&three);
        Ok(Curvatures {
            curvature_path: limit(|c| c.curvature_path),
            curvature_side: limit(|c| c.curvature_side),
            principal: [limit(|c| c.principal[0]), limit(|c| c.principal[1])],
        })
    }
}

/// Sign on `S_u x S_v` that points towards +z: by the normal's z summed over the surface.
fn upper_side(surface: &Surface) -> Result<f64, OracleError> {
    let [[u0, u1], [v0, v1]] = surface.domain();
    let place = |range: (f64, f64), index: u32| {
        range.0 + (range.1 - range.0) * (f64::from(index) + 0.5) / f64::from(ORIENTATION_GRID)
    };
    let (mut sum, mut magnitudes, mut area) = (0.0, 0.0, 0.0);
    for i in 0..ORIENTATION_GRID {
        for j in 0..ORIENTATION_GRID {
            let at = surface.at(place((u0, u1), i), place((v0, v1), j));
            let product = at.u.cross(at.v);
            sum += product.z;
            magnitudes += product.z.abs();
            area += product.length();
        }
    }
    let decided = sum.abs() > ORIENTATION_SHARE * magnitudes && magnitudes > UPWARD_SHARE * area;
    if decided {
        Ok(sum.signum())
    } else {
        Err(OracleError::NoUpperSide)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tool that starts at the pole from standstill takes arbitrarily small steps: f64 cannot resolve the curvature there, points farther away can.
    #[test]
    fn a_sphere_is_a_sphere_however_near_its_pole() {
        let job = job_file::parse("sphere_cap", include_str!("../../../jobs/sphere_cap.toml")).unwrap();
        for along in [Along::U, Along::V] {
            let oracle = Oracle::new(&Job { along, ..job.clone() }).unwrap();
            for u in [1e-12, 1e-10, 1.1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3] {
                for v in [0.0, 0.3, 0.446_874_612_011_015_4, 1.0] {
                    let contact = oracle.contact(u, v).unwrap();
                    let off = contact.normal - contact.cc_mm / 25.0;
                    assert!(off.abs().max_element() < 1e-6, "u = {u}, v = {v}");
                    for curvature in contact.principal {
                        assert!(
                            (curvature + 1.0 / 25.0).abs() < 1e-6,
                            "u = {u}, v = {v}: {curvature}"
                        );
                    }
                }
            }
        }
    }
}
