//! Step 3: from cutter contact to cutter location, `CL = CC + r N` (Lo 1998, eqns 2 and 3), and whether the ball fits.

use crate::arith::{count_to_f32, round_to_i32};
use crate::fault::{Fault, FaultKind, Result};
use crate::surface::{Contact, SHIFT_MAX};

/// Least room between ball and surface, as 1 - r k: the f32 curvature is good to a few 1e-6, so a ball that is within 1e-5
/// of the surface's own radius counts as not fitting.
const ROOM_MIN: f32 = 1e-5;

/// Below this lateral speed^2 over path speed^2 a contact is at a pole, where the side direction says nothing about
/// curvature; the neighbouring samples do.
const POLE_MIN: f32 = 1e-10;

/// The offset of one kind of ball in one patch's units.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Offset {
    radius_mm: f32,
    /// r in units of 2^-sum_shift nm.
    radius_units: f32,
    /// The contact's units are 2^-shift nm.
    shift: u8,
    /// Units in which contact and offset are added: coarser than the contact's where the ball asks for it, and by a bit in
    /// any case, so that neither exceeds 2^30 and their sum fits.
    sum_shift: u8,
}

/// Cutter contact and cutter location, nm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Located {
    pub(crate) cc_nm: [i32; 3],
    pub(crate) cl_nm: [i32; 3],
}

impl Offset {
    /// No ball yet.
    pub(crate) const NONE: Self = Self {
        radius_mm: 0.0,
        radius_units: 0.0,
        shift: 0,
        sum_shift: 0,
    };

    /// The ball of this radius, for contacts in units of 2^-shift nm.
    pub(crate) fn new(radius_mm: f32, shift: u8) -> Self {
        const HALF_RANGE: f32 = 1_073_741_824.0;
        let shift = shift.min(SHIFT_MAX);
        let mut sum_shift = shift.saturating_sub(1);
        let mut radius_units = radius_mm * (1e6 * count_to_f32(1 << sum_shift));
        // At most SHIFT_MAX rounds.
        while sum_shift > 0 && radius_units >= HALF_RANGE {
            sum_shift -= 1;
            radius_units *= 0.5;
        }
        Self {
            radius_mm,
            radius_units,
            shift,
            sum_shift,
        }
    }

    /// The ball touches the surface in this point alone, up to second order: with t along the path and d across it,
    /// `I - r II` is positive definite, so that no principal curvature towards the tool reaches 1/r.
    ///
    /// # Errors
    /// [`FaultKind::BallDoesNotFit`], its value r times the larger principal curvature (along the path where that alone is
    /// too much).
    #[inline(always)]
    pub(crate) fn check_fit(&self, contact: &Contact) -> Result<()> {
        let r = self.radius_mm;
        let along = 1.0 - r * contact.path_bend;
        let lateral = contact.lateral_squared;
        let across = lateral - r * contact.lateral_bend;
        let twist = r * r * contact.twist_squared;
        let room = ROOM_MIN * lateral;
        if along > ROOM_MIN && along * across - twist > room {
            return Ok(());
        }
        self.explain_fit(contact, along, across, twist)
    }

    /// The uncommon end of [`Self::check_fit`]: a pole, or the fault with its value.
    #[cold]
    fn explain_fit(&self, contact: &Contact, along: f32, across: f32, twist: f32) -> Result<()> {
        let lateral = contact.lateral_squared;
        let speed = contact.path.speed;
        if !(lateral > POLE_MIN * speed * speed) {
            return if along > ROOM_MIN {
                Ok(())
            } else {
                Err(Fault::new(FaultKind::BallDoesNotFit, 1.0 - along))
            };
        }
        // Least eigenvalue of [[along, t], [t, across]] with the lateral speed scaled out; 1 minus it is r k.
        let (p, q, t_squared) = (along, across / lateral, twist / lateral);
        let half = 0.5 * (p - q);
        let least = 0.5 * (p + q) - crate::arith::sqrt(half * half + t_squared);
        Err(Fault::new(FaultKind::BallDoesNotFit, 1.0 - least))
    }

    /// Cutter contact and location. The contact is rounded to the nanometre for the report only.
    ///
    /// # Errors
    /// [`FaultKind::OutOfRange`] where a coordinate is outside ±2.147 m.
    #[inline(always)]
    pub(crate) fn locate(&self, contact: &Contact, origin_nm: &[i32; 3]) -> Result<Located> {
        let half = (1_i32 << self.shift) >> 1;
        let sum_half = (1_i32 << self.sum_shift) >> 1;
        let coarser = self.shift - self.sum_shift;
        let [x, y, z] = contact.position;
        let n = contact.normal;
        let offset = [n.x, n.y, n.z].map(|n| round_to_i32(n * self.radius_units));
        let [ox, oy, oz] = offset;
        let [x0, y0, z0] = *origin_nm;
        let place = |position: i32, offset: i32, origin: i32| {
            let cc = origin.checked_add(position.checked_add(half)? >> self.shift)?;
            let sum = (position >> coarser).checked_add(offset)?.checked_add(sum_half)?;
            let cl = origin.checked_add(sum >> self.sum_shift)?;
            Some((cc, cl))
        };
        match (place(x, ox, x0), place(y, oy, y0), place(z, oz, z0)) {
            (Some((cx, lx)), Some((cy, ly)), Some((cz, lz))) => Ok(Located {
                cc_nm: [cx, cy, cz],
                cl_nm: [lx, ly, lz],
            }),
            _ => Err(self.explain_range(contact, origin_nm)),
        }
    }

    #[cold]
    fn explain_range(&self, contact: &Contact, origin_nm: &[i32; 3]) -> Fault {
        let metres_per_unit = 1e-9 / count_to_f32(1 << self.shift);
        let [x, y, z] = contact
            .position
            .map(|p| crate::arith::to_f32(p) * metres_per_unit);
        let [x0, y0, z0] = origin_nm.map(|o| crate::arith::to_f32(o) * 1e-9);
        let (n, r) = (contact.normal, self.radius_mm * 1e-3);
        let worst = [x0 + x + r * n.x, y0 + y + r * n.y, z0 + z + r * n.z]
            .into_iter()
            .fold(
                0.0_f32,
                |worst, value| if value.abs() > worst.abs() { value } else { worst },
            );
        Fault::new(FaultKind::OutOfRange, worst)
    }
}
