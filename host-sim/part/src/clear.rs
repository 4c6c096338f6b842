//! Whether a tool may touch a place of a face: steepness, fit of the ball, and everything else of the part.

use glam::DVec3;
use oracle::Surface;

use crate::body::{OwnContact, Part};
use crate::proof::DISTANCE_ERROR_MM;
use crate::tool::{Reason, Tool};

/// The share of the tool's permitted depth that a region uses; the rest is for rounding.
const DEPTH_SHARE: f64 = 0.5;
/// Share of that depth up to which a place is clear with a margin, see [`Clearance::surely`].
const SURE_SHARE: f64 = 0.1;
/// Places of the own face nearer to the contact than this share of the ball's radius do not count where the depth is below the error of a distance.
const OWN_SHARE: f64 = 0.3;
/// Largest product of the ball's radius and the curvature towards the ball: towards 1 the step-over grows without bound, and the board refuses larger products.
const FIT_MAX: f64 = 0.97;

/// Least sine of the angle between the derivatives by u and v: below it, the board's normal is off by more than 1e-6 rad.
const SKEW_MIN: f64 = 0.1;
/// Least derivative, as a share of its change over the patch at the rate there. Between two rows of poles that coincide the normal is off by 1e-6 rad where this share is
/// 0.02 to 0.04.
const STATIONARY_MIN: f64 = 1.0 / 32.0;

/// A face, the tool and the part.
pub struct Clearance<'a> {
    /// The face's surface as it is machined.
    pub surface: &'a Surface,
    /// Sign of the tool's side on `S_u x S_v`.
    pub sign: f64,
    /// The tool.
    pub tool: &'a Tool,
    /// Least z of the normal.
    pub normal_z_min: f64,
    /// How deep the tool may enter the part, mm.
    pub touch_mm: f64,
    /// The part, and the index of the face in it; `None`: only the face's own rules.
    pub part: Option<(&'a Part, Option<usize>)>,
    /// Parameters u and v at which its patches meet, with the ends of their ranges.
    pub breaks: [Vec<f64>; 2],
}

/// A contact.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// On the surface.
    pub point: DVec3,
    /// Towards the tool.
    pub normal: DVec3,
    /// Area of the surface for each unit of u and v, mm2.
    pub area: f64,
    /// The surface itself is in the way of its passes.
    pub fault: Option<Reason>,
}

impl Clearance<'_> {
    /// The contact at a place.
    #[must_use]
    pub fn place(&self, [u, v]: [f64; 2]) -> Place {
        let at = self.surface.at(u, v);
        let cross = at.u.cross(at.v);
        let area = cross.length();
        let normal = cross * (self.sign / area);
        let lengths = [at.u.length(), at.v.length()];
        let changes = [
            at.uu.length() * self.patch(0, u),
            at.vv.length() * self.patch(1, v),
        ];
        // Not true where something is not a number, either.
        let is_regular = area > SKEW_MIN * lengths[0] * lengths[1]
            && (0..2).all(|k| lengths[k] > STATIONARY_MIN * changes[k]);
        let fault = if is_regular {
            let [_, most] = at.principal_curvatures(normal);
            (most * self.tool.radius > FIT_MAX).then_some(Reason::Fit)
        } else {
            Some(Reason::Degenerate)
        };
        Place {
            point: at.point,
            normal,
            area,
            fault,
        }
    }

    /// Length of the patch at a parameter.
    fn patch(&self, k: usize, at: f64) -> f64 {
        let breaks = &self.breaks[k];
        let above = breaks.partition_point(|knot| *knot <= at);
        let above = above.clamp(1, breaks.len() - 1);
        breaks[above] - breaks[above - 1]
    }

    /// The first rule that a place breaks.
    ///
    /// # Errors
    /// The rule.
    pub fn check(&self, uv: [f64; 2]) -> Result<(), Reason> {
        self.check_to(uv, DEPTH_SHARE)
    }

    /// Whether a place is clear with a margin: all places between four of these, the corners of a square with sides of [`Self::spacing_mm`], are clear to the permitted
    /// depth.
    #[must_use]
    pub fn surely(&self, uv: [f64; 2]) -> bool {
        self.check_to(uv, SURE_SHARE).is_ok()
    }

    /// Spacing of a square grid on a plane, mm, between whose places an obstacle enters the tool by at most the permitted depth, where it does by at most a
    /// tenth of it at the places (as [`Self::surely`] says): over a point of the part the depth falls by d^2 / (2 r) at a distance d.
    #[must_use]
    pub fn spacing_mm(&self) -> f64 {
        2.0 * ((1.0 - 2.0 * SURE_SHARE) * self.touch_mm * self.tool.radius).sqrt()
    }

    fn check_to(&self, uv: [f64; 2], share: f64) -> Result<(), Reason> {
        let place = self.place(uv);
        if place.normal.z < self.normal_z_min {
            return Err(Reason::Steep);
        }
        if let Some(fault) = place.fault {
            return Err(fault);
        }
        self.check_part(&place, share * self.touch_mm)
    }

    fn check_part(&self, place: &Place, depth: f64) -> Result<(), Reason> {
        let Some((part, own)) = self.part else {
            return Ok(());
        };
        let centre = place.point + place.normal * self.tool.radius;
        // The ball touches its own face in the contact: at no depth below the error of a distance can it be told from entering there.
        let own = own.filter(|_| depth < DISTANCE_ERROR_MM);
        let own = own.map(|face| OwnContact {
            face,
            place: place.point,
            radius: OWN_SHARE * self.tool.radius,
        });
        if part
            .nearest(centre, self.tool.radius - depth, own.as_ref(), true)
            .is_some()
        {
            return Err(Reason::Ball);
        }
        for column in &self.tool.columns {
            let z = column.z.map(|z| centre.z + z);
            if part.beside(centre, z, column.radius - depth, true).is_some() {
                return Err(column.part);
            }
        }
        Ok(())
    }
}
