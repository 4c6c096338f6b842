//! Contact geometry: tool normal, curvatures, step-over and interval (Lo eqns 2, 3, 10, 11, as mended).

use std::fmt;

use super::surface::{Derivatives, Surface};
use super::vector::{Vector, add, cross, dot, length, scale};
use crate::job_file::{Along, JobFile, Pattern, Side, Spacing};

/// A first derivative shorter than this share of the other one (each times its range) marks a pole, where the patch's
/// edge collapses to a point. Rounding leaves some 1e-15 there; a proper surface keeps above 1e-4.
const POLE_SHARE: f64 = 1e-9;
/// `|S_u x S_v|` below this share of `|S_u| |S_v|` leaves no trustworthy normal.
const SINE_MIN: f64 = 1e-9;
/// Step away from a pole for its curvatures, as a share of the range: three such steps, extrapolated, leave a relative
/// error near 1e-8 of truncation and of rounding alike.
const POLE_STEP: f64 = 1e-3;
/// Places a side, on a grid over the surface, that decide which side is up.
const ORIENTATION_GRID: u32 = 48;
/// The normal's z, summed over the surface, must reach this share of the sum of its magnitudes to tell up from down.
const ORIENTATION_SHARE: f64 = 0.1;
/// That sum of magnitudes must reach this share of the surface's area: a vertical wall has no upper side.
const UPWARD_SHARE: f64 = 1e-3;

/// Why the oracle has no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OracleError {
    /// `S_u x S_v` vanishes where it is no mere pole.
    Degenerate {
        /// Parameter u of the place.
        u: f64,
        /// Parameter v of the place.
        v: f64,
    },
    /// The ball does not fit the surface's curvature.
    BallDoesNotFit {
        /// Parameter u of the place.
        u: f64,
        /// Parameter v of the place.
        v: f64,
        /// Ball radius times curvature towards the tool, 1 or more.
        fit: f64,
    },
    /// `side = "up"` means nothing here: the normal's z, summed over the surface, nearly cancels.
    NoUpperSide,
    /// The path interval shrinks so far that the passes never reach the other boundary.
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

/// Geometry where the ball touches the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Cutter contact CC, mm.
    pub cc_mm: [f64; 3],
    /// Unit normal N from the material to the tool.
    pub normal: [f64; 3],
    /// Cutter location CL = CC + r N, mm.
    pub cl_mm: [f64; 3],
    /// Speed of the path parameter |A|, mm per unit; 0 on a pass that lies on a pole.
    pub path_speed: f64,
    /// Normal curvature along the pass, 1/mm.
    pub curvature_path: f64,
    /// Normal curvature across the pass, 1/mm.
    pub curvature_side: f64,
    /// Least and largest principal curvature, 1/mm.
    pub principal: [f64; 2],
    /// |(N x t) . B|: distance across the pass for a unit of the side parameter, mm; 0 on a pole between passes.
    pub lateral_speed: f64,
    /// Step-over l along the surface, mm; NaN where the ball does not fit.
    pub step_over_mm: f64,
    /// Candidate of the path interval, in the side parameter: infinite on a pole, NaN where the ball does not fit.
    pub interval: f64,
}

impl Contact {
    /// Ball radius times the largest curvature towards the tool: the ball fits below 1.
    #[must_use]
    pub fn fit(&self, radius_mm: f64) -> f64 {
        radius_mm * self.principal[1]
    }
}

/// A job's geometry: what a machine should do, place by place.
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
    /// How far apart the passes lie.
    pub spacing: Spacing,
    /// Sampling period T, s.
    pub period_s: f64,
    /// Programmed feed, mm/s.
    pub feed_mm_s: f64,
}

impl Oracle {
    /// The oracle of a job.
    ///
    /// # Errors
    /// [`OracleError::NoUpperSide`] if the job asks for the upper side and there is none.
    pub fn new(job: &JobFile) -> Result<Self, OracleError> {
        let surface = Surface::new(&job.surface);
        let normal_sign = match job.side {
            Side::Up => upper_side(&surface)?,
            Side::Plus => 1.0,
            Side::Minus => -1.0,
        };
        Ok(Self {
            surface,
            along: job.along,
            pattern: job.pattern,
            normal_sign,
            radius_mm: job.radius_mm,
            scallop_mm: job.scallop_mm,
            spacing: job.spacing,
            period_s: job.machine.period_s(),
            feed_mm_s: job.feed_mm_s(),
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

    /// (path, side) -> (u, v), and back.
    #[must_use]
    pub fn swapped(&self, first: f64, second: f64) -> (f64, f64) {
        match self.along {
            Along::U => (first, second),
            Along::V => (second, first),
        }
    }

    /// Contact geometry at (u, v). At a pole (one of S_u, S_v vanishes on a boundary) the normal is the limit by the
    /// mixed derivative, and the curvatures are extrapolated from beside the pole (relative error about 1e-8).
    ///
    /// # Errors
    /// [`OracleError::Degenerate`] where there is no normal.
    pub fn contact(&self, u: f64, v: f64) -> Result<Contact, OracleError> {
        self.contact_of(&self.surface.at(u, v), u, v)
    }

    /// As [`Oracle::contact`], with the surface's derivatives at hand.
    pub(super) fn contact_of(&self, at: &Derivatives, u: f64, v: f64) -> Result<Contact, OracleError> {
        let [[u0, u1], [v0, v1]] = self.surface.domain();
        let (speed_u, speed_v) = (length(at.u), length(at.v));
        let reach = (speed_u * (u1 - u0), speed_v * (v1 - v0));
        if reach.0.min(reach.1) <= POLE_SHARE * reach.0.max(reach.1) {
            return self.contact_at_pole(u, v, at, reach.0 < reach.1);
        }
        let product = cross(at.u, at.v);
        let area = length(product);
        if area <= SINE_MIN * speed_u * speed_v {
            return Err(OracleError::Degenerate { u, v });
        }
        Ok(self.regular_contact(at, scale(product, self.normal_sign / area)))
    }

    /// Steps 3 and 4 where both derivatives are sound.
    fn regular_contact(&self, at: &Derivatives, normal: Vector) -> Contact {
        let (a, b, aa, bb) = match self.along {
            Along::U => (at.u, at.v, at.uu, at.vv),
            Along::V => (at.v, at.u, at.vv, at.uu),
        };
        let (e, f) = (dot(a, a), dot(a, b));
        let (l, m, n) = (dot(aa, normal), dot(at.uv, normal), dot(bb, normal));
        let alpha = -f / e;
        // |a A + B|^2 without the cancellation of E a^2 + 2 F a + G
        let across = add(scale(a, alpha), b);
        let across_squared = dot(across, across);
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

    /// What follows from the curvatures: step-over and interval.
    fn with_curvatures(
        &self,
        cc_mm: Vector,
        normal: Vector,
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
            cl_mm: add(cc_mm, scale(normal, self.radius_mm)),
            path_speed,
            curvature_path,
            curvature_side,
            principal,
            lateral_speed,
            step_over_mm,
            interval: step_over_mm / lateral_speed,
        }
    }

    /// Contact at a pole. `u_vanishes`: it is S_u that vanishes (the boundary of constant v collapses).
    fn contact_at_pole(
        &self,
        u: f64,
        v: f64,
        at: &Derivatives,
        u_vanishes: bool,
    ) -> Result<Contact, OracleError> {
        // Beside the pole the vanishing derivative is the mixed one times the (signed) step into the surface.
        let [range_u, range_v] = self.surface.domain();
        let (range, t) = if u_vanishes { (range_v, v) } else { (range_u, u) };
        let inwards = if t - range[0] <= range[1] - t { 1.0 } else { -1.0 };
        let (limit_u, limit_v) = if u_vanishes {
            (scale(at.uv, inwards), at.v)
        } else {
            (at.u, scale(at.uv, inwards))
        };
        let product = cross(limit_u, limit_v);
        let area = length(product);
        if area.is_nan() || area <= SINE_MIN * length(limit_u) * length(limit_v) {
            return Err(OracleError::Degenerate { u, v });
        }
        let normal = scale(product, self.normal_sign / area);
        let step = POLE_STEP * inwards * (range[1] - range[0]);
        let beside: [Result<Contact, OracleError>; 3] = std::array::from_fn(|k| {
            let moved = t + step * (k as f64 + 1.0);
            let (u, v) = if u_vanishes { (u, moved) } else { (moved, v) };
            let at = self.surface.at(u, v);
            let product = cross(at.u, at.v);
            let area = length(product);
            if area > 0.0 {
                Ok(self.regular_contact(&at, scale(product, self.normal_sign / area)))
            } else {
                Err(OracleError::Degenerate { u, v })
            }
        });
        let [one, two, three] = beside;
        let (one, two, three) = (one?, two?, three?);
        let limit = |of: fn(&Contact) -> f64| 3.0 * (of(&one) - of(&two)) + of(&three);
        let pass_collapses = u_vanishes == (self.along == Along::U);
        let path_speed = if pass_collapses {
            0.0
        } else {
            length(if u_vanishes { at.v } else { at.u })
        };
        // On a pole every side line leaves in its own direction: its own speed and curvature count.
        let (side, side2) = if u_vanishes { (at.v, at.vv) } else { (at.u, at.uu) };
        let (lateral_speed, curvature_side) = if pass_collapses {
            (length(side), dot(side2, normal) / dot(side, side))
        } else {
            (0.0, limit(|c| c.curvature_side))
        };
        let curvatures = [limit(|c| c.curvature_path), curvature_side];
        let principal = [limit(|c| c.principal[0]), limit(|c| c.principal[1])];
        Ok(self.with_curvatures(at.point, normal, path_speed, lateral_speed, curvatures, principal))
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
            let product = cross(at.u, at.v);
            sum += product[2];
            magnitudes += product[2].abs();
            area += length(product);
        }
    }
    let decided = sum.abs() > ORIENTATION_SHARE * magnitudes && magnitudes > UPWARD_SHARE * area;
    if decided {
        Ok(sum.signum())
    } else {
        Err(OracleError::NoUpperSide)
    }
}
