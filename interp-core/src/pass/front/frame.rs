//! The metric at a surface point, and the distance to the next pass.

use crate::fault::Result;
use crate::job::Header;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use crate::math::vec3::Vec3;
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::offset::check_fit;
use crate::pass::patch::Patch;
use crate::pass::step_over::height_limit_mm;
use crate::sample::SpanParameter;

/// Scallop height for which the fronts are made, as a share of the limit.
pub(crate) const MARGIN: f32 = 0.993;

/// A patch that is evaluated at any place, with the spans of its record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FreePatch {
    patch: Patch,
    record: Option<[u16; 2]>,
}

impl FreePatch {
    pub(crate) const NONE: Self = Self {
        patch: Patch::NONE,
        record: None,
    };

    /// The spans of its record, if it has one.
    pub(crate) const fn record(&self) -> Option<[u16; 2]> {
        self.record
    }

    /// Forgets the record: the job may be another.
    pub(crate) const fn forget(&mut self) {
        self.record = None;
    }
}

/// First fundamental form (e, f, g) and `I - r II` (a, b, c) by the path parameter and the share of the whole side parameter, mm^2.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Frame {
    /// Cutter contact, units of 2^-30 nm.
    pub(crate) point: [i64; 3],
    /// From contact to ball centre, mm.
    pub(crate) offset: Vec3,
    /// Derivatives along the path and across, mm.
    pub(crate) path: Vec3,
    pub(crate) side: Vec3,
    pub(crate) e: f32,
    pub(crate) f: f32,
    pub(crate) g: f32,
    pub(crate) a: f32,
    pub(crate) b: f32,
    pub(crate) c: f32,
}

impl Frame {
    /// At a place on the path and a distance from the first front.
    ///
    /// # Errors
    /// As [`Patch::evaluate`].
    #[inline(never)]
    pub(crate) fn at(
        patch: &mut FreePatch,
        job: &Job<'_>,
        cursor: &mut SideCursor,
        direction: &Direction,
        path: SpanParameter,
        distance: i32,
    ) -> Result<Self> {
        let (side, share) = cursor.seek(job, direction, fine(distance));
        let record = [path.span, side.span];
        if patch.record != Some(record) {
            patch.record = None;
            patch.patch.take_record(job, record)?;
            patch.record = Some(record);
        }
        let patch = &patch.patch;
        let (contact, by) = patch.surface_at(path.fraction, side.fraction)?;
        check_fit(&contact)?;
        let along = 1.0 / (job.path_width(path.span) * patch.per_mm);
        let out = direction.sign() / (share * patch.per_mm);
        let offset = patch.locator.offset_mm(&contact);
        let per_mm = patch.per_mm;
        let (a, b) = (by.path * along, by.side * out);
        let (e, f, g) = (a.dot(a), a.dot(b), b.dot(b));
        Ok(Self {
            point: patch.locator.contact_q30(&contact, &patch.origin),
            offset,
            path: a,
            side: b,
            e,
            f,
            g,
            a: e - by.path2.dot(offset) * (along * along * per_mm),
            b: f - by.mixed.dot(offset) * (along * out * per_mm),
            c: g - by.side2.dot(offset) * (out * out * per_mm),
        })
    }

    /// The surface's area per parameters.
    pub(crate) fn area(&self) -> f32 {
        sqrt((self.e * self.g - self.f * self.f).at_least(0.0))
    }

    /// The metric's square of the direction of a pass with this slope.
    pub(crate) fn stretch(&self, slope: f32) -> f32 {
        self.a + slope * (2.0 * self.b + self.c * slope)
    }

    /// Square of the length of a pass with this slope per path parameter.
    pub(crate) fn speed_squared(&self, slope: f32) -> f32 {
        self.e + slope * (2.0 * self.f + self.g * slope)
    }

    /// `1/K` for a step in this direction: the metric's square of it, times this, is 1 at the distance to the next pass.
    pub(crate) fn scale(&self, header: &Header, along: f32, across: f32, margin: f32) -> f32 {
        let radius = header.ball_radius_mm;
        let height = margin * height_limit_mm(header);
        let (du, dv) = (along, across);
        let metric = self.a * du * du + 2.0 * self.b * du * dv + self.c * dv * dv;
        let length = self.e * du * du + 2.0 * self.f * du * dv + self.g * dv * dv;
        let ratio = metric / length;
        let bend = if ratio.is_finite() { ratio - 1.0 } else { 0.0 };
        let share = height / radius;
        (1.0 + share * bend) / (8.0 * radius * height * (1.0 - 0.5 * share))
    }
}
