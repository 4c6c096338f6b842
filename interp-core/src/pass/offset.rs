//! Step 3: from cutter contact to cutter location, `CL = CC + r N` (Lo 1998, eqns 2 and 3), and whether the ball fits.

use crate::fault::{Fault, FaultKind, Result};
use crate::math::arith::{add_product, power_of_two, q30_to_f32, sqrt, truncated, whole_q30};
use crate::math::number::MM_PER_NM;
use crate::math::vec3::Vec3;
use crate::surface::{Contact, OffsetUnits};

/// Least clearance between ball and surface, as 1 - r k: the error of the f32 curvature is a few 1e-6, so a ball whose radius is within 1e-5
/// of the surface's radius of curvature counts as not fitting.
const ROOM_MIN: f32 = 1e-5;

/// Below this lateral speed^2 over path speed^2 a contact is at a pole, where the side direction does not determine the
/// curvature; the adjacent samples do.
const POLE_MIN: f32 = 1e-10;

/// Cosine between the normals of neighbouring samples (120 degrees) below which the surface has folded over in between.
/// A fold turns the normal by 180 degrees less the turn of the surface between the samples; a surface that turns by 120 degrees without a fold
/// has a radius of curvature below the scallop height.
const FOLD_COSINE: f32 = -0.5;

/// Offset from contact to cutter location on one patch.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Locator {
    /// Minimum upper word of the scalar product of two adjacent offsets.
    fold_min: i32,
    /// The patch's unit and the offset's unit, in units of 2^-30 nm.
    unit: i32,
    offset_unit: i32,
}

/// Cutter contact and cutter location, nm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Located {
    pub(crate) cc_nm: [i32; 3],
    pub(crate) cl_nm: [i32; 3],
}

impl Locator {
    /// No patch yet.
    pub(crate) const NONE: Self = Self {
        fold_min: 0,
        unit: 0,
        offset_unit: 0,
    };

    /// For these units.
    pub(crate) fn new(units: &OffsetUnits) -> Self {
        let radius = units.radius;
        Self {
            fold_min: truncated(radius * power_of_two(-32) * radius * FOLD_COSINE),
            unit: 1 << (30 - units.shift),
            offset_unit: 1 << (30 - units.fine),
        }
    }

    /// Whether the surface has folded over between two samples, by the scalar product of their offsets.
    #[inline(always)]
    pub(crate) const fn folds(&self, product: i32) -> bool {
        product < self.fold_min
    }

    /// Cutter contact and location on a patch with this origin ([`origin_q30`]), each rounded to the nanometre once.
    ///
    /// # Errors
    /// [`FaultKind::OutOfRange`] where a coordinate is outside ±2.147 m.
    #[inline(always)]
    pub(crate) fn locate(&self, contact: &Contact, origin: &[i64; 3]) -> Result<Located> {
        let ([x, y, z], [ox, oy, oz]) = (contact.position, contact.offset);
        let [x0, y0, z0] = *origin;
        // No sum reaches 2^63: the origin is below 2^61, the position below 2^61, the offset below 2^60.
        let axis = |origin: i64, position: i32, offset: i32| {
            let contact = add_product(origin, position, self.unit);
            let ((cc, cc_excess), (cl, cl_excess)) = (
                whole_q30(contact),
                whole_q30(add_product(contact, offset, self.offset_unit)),
            );
            (cc, cl, cc_excess | cl_excess)
        };
        let ((cx, lx, ex), (cy, ly, ey), (cz, lz, ez)) = (axis(x0, x, ox), axis(y0, y, oy), axis(z0, z, oz));
        if (ex | ey | ez) >> 30 != 0 {
            return Err(self.explain_range(contact.position, contact.offset, origin));
        }
        Ok(Located {
            cc_nm: [cx, cy, cz],
            cl_nm: [lx, ly, lz],
        })
    }

    /// Cutter contact on a patch with this origin ([`origin_q30`]), units of 2^-30 nm, half a nanometre too large in each coordinate.
    pub(crate) fn contact_q30(&self, contact: &Contact, origin: &[i64; 3]) -> [i64; 3] {
        let ([x, y, z], [x0, y0, z0]) = (contact.position, *origin);
        [(x, x0), (y, y0), (z, z0)].map(|(position, origin)| add_product(origin, position, self.unit))
    }

    /// The vector from cutter contact to cutter location, mm.
    pub(crate) fn offset_mm(&self, contact: &Contact) -> Vec3 {
        Vec3::of(contact.offset) * (q30_to_f32(i64::from(self.offset_unit)) * MM_PER_NM)
    }

    #[cold]
    #[inline(never)]
    fn explain_range(&self, position: [i32; 3], offset: [i32; 3], origin: &[i64; 3]) -> Fault {
        let mut worst = 0.0_f32;
        for ((position, offset), origin) in position.into_iter().zip(offset).zip(*origin) {
            let contact = add_product(origin, position, self.unit);
            for value in [contact, add_product(contact, offset, self.offset_unit)] {
                let metres = q30_to_f32(value) * 1e-9;
                if metres.abs() > worst.abs() {
                    worst = metres;
                }
            }
        }
        Fault::new(FaultKind::OutOfRange, worst)
    }
}

/// Checks that, to second order, the ball touches the surface only in this point: with t along the path and d across it,
/// `I - r II` is positive definite, so that no principal curvature towards the tool reaches 1/r.
///
/// # Errors
/// [`FaultKind::BallDoesNotFit`], its value r times the larger principal curvature (along the path where that alone is
/// too much).
#[inline(always)]
pub(crate) fn check_fit(contact: &Contact) -> Result<()> {
    let room = ROOM_MIN * contact.lateral_squared;
    if contact.along > ROOM_MIN && contact.along * contact.across - contact.twist_squared > room {
        return Ok(());
    }
    explain_fit(
        contact.along,
        contact.across,
        contact.twist_squared,
        contact.lateral_squared,
        contact.speed_squared,
    )
}

/// A patch's origin in units of 2^-30 nm, and half a nanometre for the rounding.
pub(crate) fn origin_q30(origin_nm: [i32; 3]) -> [i64; 3] {
    origin_nm.map(|nm| (i64::from(nm) << 30) + (1 << 29))
}

/// The rare branch of [`check_fit`]: a pole, or the fault with its value.
#[cold]
#[inline(never)]
fn explain_fit(along: f32, across: f32, twist_squared: f32, lateral: f32, speed_squared: f32) -> Result<()> {
    if !(lateral > POLE_MIN * speed_squared) {
        return if along > ROOM_MIN {
            Ok(())
        } else {
            Err(Fault::new(FaultKind::BallDoesNotFit, 1.0 - along))
        };
    }
    // Least eigenvalue of [[along, t], [t, across]] with the lateral speed scaled out; 1 minus it is r k.
    let (p, q, t_squared) = (along, across / lateral, twist_squared / lateral);
    let half = 0.5 * (p - q);
    let least = 0.5 * (p + q) - sqrt(half * half + t_squared);
    Err(Fault::new(FaultKind::BallDoesNotFit, 1.0 - least))
}
