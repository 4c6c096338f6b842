//! Entry of a ray from the surface into the swept ball.
//!
//! From the surface point P the ray `P + t N` follows the tool normal. It enters a ball of radius r about C at
//! `t = m.N - sqrt((m.N)^2 - |m|^2 + r^2)`, m = C - P. Between two samples the centre moves on a straight line, so the ball
//! sweeps a capsule: a cylinder with a hemisphere at each end; the entry is the least of theirs.

use super::track::{ToolPathPass, across};
use glam::DVec3;

/// Newton steps towards the nearest sample: each squares the error; the search over neighbours afterwards corrects the rest.
const NEWTON_STEPS: usize = 12;
/// Distance of the samples compared, as a share of the ball's radius. Over it the distance from the ray changes by 1/8000 of the radius,
/// far more than by rounding to nanometres.
const STRIDE_SHARE: f64 = 1.0 / 64.0;
/// Iterations of: nearest sample to the point on the ray, then the ray's entry there. The first entry's error is of second
/// order in the nearest sample's; three iterations reduce it to rounding.
const ROUNDS: usize = 3;
/// Iteration ends when the entry moves by less than this, mm.
const ENTRY_TOLERANCE_MM: f64 = 1e-9;

/// A ray: a point of the surface and the tool normal there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) from: DVec3,
    pub(super) along: DVec3,
}

impl Ray {
    pub(super) fn at(&self, t: f64) -> DVec3 {
        self.from + self.along * t
    }

    /// Parameters at which the ray enters and leaves a ball.
    pub(super) fn through_ball(&self, centre: DVec3, radius: f64) -> Option<[f64; 2]> {
        let m = centre - self.from;
        let along = m.dot(self.along);
        // |m - (m.N) N|^2 without the cancellation of |m|^2 - (m.N)^2.
        let off = across(m, self.along);
        let inside = radius * radius - off.length_squared();
        (inside >= 0.0).then(|| {
            let half = inside.sqrt();
            [along - half, along + half]
        })
    }

    /// Entry of the ray into the capsule between two centres; infinite if the ray misses the capsule, or leaves it below
    /// the surface.
    pub(super) fn entry(&self, [from, to]: [DVec3; 2], radius: f64) -> f64 {
        let mut first = f64::INFINITY;
        for centre in [from, to] {
            if let Some([enters, leaves]) = self.through_ball(centre, radius)
                && leaves >= 0.0
            {
                first = first.min(enters);
            }
        }
        let axis = to - from;
        let squared = axis.length_squared();
        if squared <= 0.0 {
            return first;
        }
        let axis = axis / squared.sqrt();
        let m = from - self.from;
        let (m_off, n_off) = (across(m, axis), across(self.along, axis));
        let (a, b) = (n_off.length_squared(), m_off.dot(n_off));
        if a <= 0.0 {
            return first;
        }
        // |m_off|^2 - b^2 / a: squared distance of the two lines.
        let apart = m_off - n_off * (b / a);
        let inside = (radius * radius - apart.length_squared()) / a;
        if inside < 0.0 {
            return first;
        }
        let half = inside.sqrt();
        let on_cylinder = |t: f64| {
            let s = (self.at(t) - from).dot(axis);
            s >= 0.0 && s * s <= squared
        };
        let (enters, leaves) = (b / a - half, b / a + half);
        if leaves >= 0.0 && enters < first && on_cylinder(enters) {
            first = enters;
        }
        first
    }
}

/// The heights left by one pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct PassHeight<'a> {
    pass: &'a ToolPathPass,
    radius: f64,
    stride: usize,
}

impl<'a> PassHeight<'a> {
    pub(super) fn new(pass: &'a ToolPathPass, radius: f64) -> Self {
        let samples = pass.cl_nm.len();
        let spacing = pass.spacing_mm();
        let stride = STRIDE_SHARE * radius / spacing.max(1e-9);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "positive, and clamped"
        )]
        let stride = (stride as usize).clamp(1, (samples / 4).max(1));
        Self { pass, radius, stride }
    }

    pub(super) fn pass(&self) -> &'a ToolPathPass {
        self.pass
    }

    /// Height at which the ray enters this pass's swept ball, and the nearest sample; infinite if the ray misses the ball.
    /// `hint`: a sample near it; the search finds the nearest local minimum from there.
    pub(super) fn of(&self, ray: &Ray, hint: usize) -> (f64, usize) {
        self.iterate(ray, hint, ROUNDS)
    }

    /// One iteration only: an upper bound, with an error of second order in that of the nearest sample.
    pub(super) fn about(&self, ray: &Ray, hint: usize) -> (f64, usize) {
        self.iterate(ray, hint, 1)
    }

    fn iterate(&self, ray: &Ray, hint: usize, rounds: usize) -> (f64, usize) {
        let mut index = hint;
        let mut height = f64::INFINITY;
        for _ in 0..rounds {
            let target = if height.is_finite() {
                ray.at(height)
            } else {
                ray.from
            };
            index = self.nearest(target, index);
            let before = height;
            (height, index) = self.entry_near(ray, index);
            if (height - before).abs() <= ENTRY_TOLERANCE_MM {
                break;
            }
        }
        (height, index)
    }

    fn squared(&self, index: usize, target: DVec3) -> f64 {
        let off = self.pass.centre(index) - target;
        off.length_squared()
    }

    /// The sample nearest to a point, by Newton's method in strides, then by descent over neighbours.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "indices of samples, clamped to the pass"
    )]
    fn nearest(&self, target: DVec3, hint: usize) -> usize {
        let last = self.pass.cl_nm.len() - 1;
        let mut index = hint.min(last);
        let mut least = self.squared(index, target);
        if last >= 2 * self.stride {
            for _ in 0..NEWTON_STEPS {
                let middle = index.clamp(self.stride, last - self.stride);
                let [low, mid, high] =
                    [middle - self.stride, middle, middle + self.stride].map(|k| self.squared(k, target));
                let (slope, bend) = (0.5 * (high - low), high - 2.0 * mid + low);
                let by = if bend > 0.0 {
                    (-slope / bend).clamp(-64.0, 64.0)
                } else {
                    -4.0 * slope.signum()
                };
                let next = (middle as f64 + by * self.stride as f64)
                    .clamp(0.0, last as f64)
                    .round() as usize;
                let there = self.squared(next, target);
                if there >= least {
                    break;
                }
                (index, least) = (next, there);
            }
        }
        loop {
            let mut moved = false;
            for next in [index.wrapping_sub(1), index + 1] {
                if next <= last {
                    let there = self.squared(next, target);
                    if there < least {
                        (index, least, moved) = (next, there, true);
                    }
                }
            }
            if !moved {
                return index;
            }
        }
    }

    /// The ray's entry over the samples next to one.
    fn entry_near(&self, ray: &Ray, index: usize) -> (f64, usize) {
        let last = self.pass.cl_nm.len() - 1;
        let (from, to) = (index.saturating_sub(2), (index + 2).min(last));
        if from == to {
            let centre = self.pass.centre(index);
            return (ray.entry([centre; 2], self.radius), index);
        }
        let mut best = (f64::INFINITY, index);
        let mut centre = self.pass.centre(from);
        for k in from..to {
            let next = self.pass.centre(k + 1);
            let entry = ray.entry([centre, next], self.radius);
            if entry < best.0 {
                best = (entry, k);
            }
            centre = next;
        }
        best
    }
}
