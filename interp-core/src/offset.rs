//! Step 3: from cutter contact to cutter location, `CL = CC + r N` (Lo 1998, eqns 2 and 3), and whether the ball fits.

use crate::arith::{power_of_two, sqrt, to_f32, to_top, truncated};
use crate::fault::{Fault, FaultKind, Result};
use crate::surface::{Contact, SHIFT_MAX};
use crate::vec3::Vec3;

/// Least room between ball and surface, as 1 - r k: the f32 curvature is good to a few 1e-6, so a ball that is within 1e-5
/// of the surface's own radius counts as not fitting.
const ROOM_MIN: f32 = 1e-5;

/// Below this lateral speed^2 over path speed^2 a contact is at a pole, where the side direction says nothing about
/// curvature; the neighbouring samples do.
const POLE_MIN: f32 = 1e-10;

/// Cosine between the normals of neighbouring samples (120 degrees) below which the surface has folded over in between.
/// A fold turns the normal by 180 degrees less what the surface bends on the way; what bends by 120 degrees without a fold
/// has a radius below the scallop height.
const FOLD_COSINE: f32 = -0.5;

/// The ball on one patch, whose units are 2^-shift nm. Its offsets are in units of 2^-fine nm, the finest in which the radius is below
/// 2^30: the same on every patch of a job.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Ball {
    /// r in the offsets' units, with the sign that turns `path x side` towards the tool.
    signed_radius: f32,
    /// What one count of the upper word of (offset . half second derivative) means for r k |.|^2, units^2.
    product: f32,
    /// Least upper word of the product of two neighbours' offsets.
    fold_min: i32,
    /// Half a nanometre in the patch's units, and in those of the sum.
    half: i32,
    sum_half: i32,
    shift: u8,
    /// Units in which contact and offset are added, 2^-sum_shift nm: coarser than both where one asks for it, and by a bit in any
    /// case, so that neither exceeds 2^30 and their sum fits.
    sum_shift: u8,
    /// From the patch's units, and from the offsets', to those of the sum.
    coarser: u8,
    coarser_offset: u8,
}

/// Cutter contact and cutter location, nm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Located {
    pub(crate) cc_nm: [i32; 3],
    pub(crate) cl_nm: [i32; 3],
}

impl Ball {
    /// No ball yet.
    pub(crate) const NONE: Self = Self {
        signed_radius: 0.0,
        product: 0.0,
        fold_min: 0,
        half: 0,
        sum_half: 0,
        shift: 0,
        sum_shift: 0,
        coarser: 0,
        coarser_offset: 0,
    };

    /// The ball of this radius, 1e-6 to 1000 mm, for a patch in units of 2^-shift nm.
    pub(crate) fn new(radius_mm: f32, shift: u8, sign: f32) -> Self {
        let shift = shift.min(SHIFT_MAX);
        let (radius, fine) = to_top(radius_mm * 1e6);
        let sum_shift = shift.saturating_sub(1).min(fine);
        let change = i32::from(shift) - i32::from(fine);
        Self {
            signed_radius: sign * radius,
            product: power_of_two(33 + change),
            fold_min: truncated(radius * power_of_two(-32) * radius * FOLD_COSINE),
            half: (1 << shift) >> 1,
            sum_half: (1 << sum_shift) >> 1,
            shift,
            sum_shift,
            coarser: shift - sum_shift,
            coarser_offset: fine - sum_shift,
        }
    }

    /// `r N` from a vector along the normal: `vector` times `inverse` is a unit vector. Within a unit.
    #[inline(always)]
    pub(crate) fn offset(&self, vector: Vec3, inverse: f32) -> [i32; 3] {
        let Vec3 { x, y, z } = vector * (self.signed_radius * inverse);
        [truncated(x), truncated(y), truncated(z)]
    }

    /// What one count of the upper word of (offset . half a second derivative) is of `r` times a second fundamental form, units^2.
    #[inline(always)]
    pub(crate) const fn product(&self) -> f32 {
        self.product
    }

    /// The unit normal of an offset.
    pub(crate) fn normal(&self, offset: [i32; 3]) -> Vec3 {
        let inverse = 1.0 / self.signed_radius.abs();
        Vec3::each(&offset, |x| to_f32(*x) * inverse)
    }

    /// Whether the product of two neighbours' offsets says that the surface has folded over between them.
    #[inline(always)]
    pub(crate) const fn folds(&self, product: i32) -> bool {
        product < self.fold_min
    }

    /// The ball touches the surface in this point alone, up to second order: with t along the path and d across it,
    /// `I - r II` is positive definite, so that no principal curvature towards the tool reaches 1/r.
    ///
    /// # Errors
    /// [`FaultKind::BallDoesNotFit`], its value r times the larger principal curvature (along the path where that alone is
    /// too much).
    #[inline(always)]
    pub(crate) fn check_fit(&self, contact: &Contact) -> Result<()> {
        let room = ROOM_MIN * contact.lateral_squared;
        if contact.along > ROOM_MIN && contact.along * contact.across - contact.twist_squared > room {
            return Ok(());
        }
        explain_fit(contact)
    }

    /// Cutter contact and location. The contact is rounded to the nanometre for the report only.
    ///
    /// # Errors
    /// [`FaultKind::OutOfRange`] where a coordinate is outside ±2.147 m.
    #[inline(always)]
    pub(crate) fn locate(&self, contact: &Contact, origin_nm: &[i32; 3]) -> Result<Located> {
        let ([x, y, z], [ox, oy, oz]) = (contact.position, contact.offset);
        let [x0, y0, z0] = *origin_nm;
        // A position stays half a nanometre clear of the range (`surface::range`).
        let cc = |position: i32, origin: i32| {
            origin.checked_add(position.wrapping_add(self.half).wrapping_shr(self.shift.into()))
        };
        let cl = |position: i32, offset: i32, origin: i32| {
            let position = position.wrapping_shr(self.coarser.into());
            let offset = offset.wrapping_shr(self.coarser_offset.into());
            let sum = position.wrapping_add(self.sum_half).checked_add(offset)?;
            origin.checked_add(sum.wrapping_shr(self.sum_shift.into()))
        };
        match (
            (cc(x, x0), cl(x, ox, x0)),
            (cc(y, y0), cl(y, oy, y0)),
            (cc(z, z0), cl(z, oz, z0)),
        ) {
            ((Some(cx), Some(lx)), (Some(cy), Some(ly)), (Some(cz), Some(lz))) => Ok(Located {
                cc_nm: [cx, cy, cz],
                cl_nm: [lx, ly, lz],
            }),
            _ => Err(self.explain_range(contact, origin_nm)),
        }
    }

    #[cold]
    #[inline(never)]
    fn explain_range(&self, contact: &Contact, origin_nm: &[i32; 3]) -> Fault {
        let metres = |count: i32, shift: u8| to_f32(count) * 1e-9 * power_of_two(-i32::from(shift));
        let mut worst = 0.0_f32;
        let places = contact.position.into_iter().zip(contact.offset).zip(*origin_nm);
        for ((position, offset), origin) in places {
            let value = metres(origin, 0)
                + metres(position, self.shift)
                + metres(offset, self.sum_shift + self.coarser_offset);
            if value.abs() > worst.abs() {
                worst = value;
            }
        }
        Fault::new(FaultKind::OutOfRange, worst)
    }
}

/// The uncommon end of [`Ball::check_fit`]: a pole, or the fault with its value.
#[cold]
#[inline(never)]
fn explain_fit(contact: &Contact) -> Result<()> {
    let Contact {
        along,
        across,
        twist_squared,
        lateral_squared: lateral,
        ..
    } = *contact;
    if !(lateral > POLE_MIN * contact.speed_squared) {
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
