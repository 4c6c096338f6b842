//! Evaluation of a patch on a pass, used by the run, the look-ahead, the links and the public
//! [`crate::Interpolator::evaluate`]: contact, fit, cutter location.

use crate::fault::Result;
use crate::math::vec3::Vec3;
use crate::pass::offset::{Located, check_fit};
use crate::pass::patch::Patch;
use crate::surface::{Contact, Pass};

/// Least z of the unit normal towards the tool at which a surface counts as facing up or sideways: 0 minus the rounding error of a normal.
const UP_MIN: f32 = -2e-6;

impl Patch {
    /// Contact, fit and cutter location at a fraction of the patch, in the direction of travel, on `pass`, the patch's surface. Inlined, so that the
    /// sample path has one copy for each kind of pass.
    ///
    /// # Errors
    /// [`crate::FaultKind::DegenerateSurface`], [`crate::FaultKind::BallDoesNotFit`], [`crate::FaultKind::OutOfRange`].
    #[inline(always)]
    pub(crate) fn evaluate_on<P: Pass>(&self, pass: &P, fraction: u64) -> Result<(Contact, Located)> {
        let contact = pass.contact(fraction, &self.ball)?;
        check_fit(&contact)?;
        let located = self.locator.locate(&contact, &self.origin)?;
        Ok((contact, located))
    }

    /// [`Self::evaluate_on`] the patch's surface, for callers outside the sample path.
    ///
    /// # Errors
    /// As [`Self::evaluate_on`].
    #[inline(always)]
    pub(crate) fn evaluate(&self, fraction: u64) -> Result<(Contact, Located)> {
        self.evaluate_on(&self.surface, fraction)
    }

    /// [`Self::evaluate`], and the derivative of the centre by the contact's arc; none near a pole.
    ///
    /// # Errors
    /// As [`Self::evaluate_on`].
    pub(crate) fn evaluate_with_direction(&self, fraction: u64) -> Result<(Contact, Located, Option<Vec3>)> {
        let (contact, direction) = self.surface.contact_and_direction(fraction, &self.ball)?;
        check_fit(&contact)?;
        let located = self.locator.locate(&contact, &self.origin)?;
        Ok((contact, located, direction))
    }

    /// [`Self::evaluate`] on a line of constant side parameter.
    ///
    /// # Errors
    /// As [`Self::evaluate_on`].
    pub(crate) fn evaluate_on_line(&self, fraction: u64) -> Result<(Contact, Located)> {
        let contact = self.surface.contact_on_line(fraction, &self.ball)?;
        check_fit(&contact)?;
        let located = self.locator.locate(&contact, &self.origin)?;
        Ok((contact, located))
    }

    /// Whether the surface faces up at a contact with this offset, so that the tool can retract upwards.
    pub(crate) fn faces_up(&self, offset: [i32; 3]) -> bool {
        let [_, _, z] = self.ball.normal(offset);
        z > UP_MIN
    }
}
