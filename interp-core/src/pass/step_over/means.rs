//! The step from inverse square intervals: means over a step-over, ends of passes, the exact height of a round ball.

use crate::job::Header;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use crate::pass::patch::Patch;
use crate::sample::interval_of;
use crate::surface::Contact;

/// Maximum ratio of the step to the first-order step: the neighbouring lines extend no further.
const STEP_MAX: f32 = 1.25;
/// Minimum ratio of the step to the first-order step: where the inverse square interval rises faster, the two lines do not resolve it.
const STEP_MIN: f32 = 0.25;
/// Maximum Newton iterations for the root of a cubic, from a start of at most four times the root, where four leave an error of a few percent. Where the inverse square interval changes
/// by 10 %, two are enough: after a correction of [`NEWTON_LAST`] the error is 1e-6.
const NEWTON_STEPS: u8 = 4;
const NEWTON_LAST: f32 = 1e-3;
/// Margin in height, per relative difference of the step from the distance of the lines, as a share of the second difference of the inverse square interval.
const MARGIN_OF_BEND: f32 = 0.1;
/// Error of the emitted cutter location along the normal, by which the scallop limit is lowered: half a nanometre in each of three coordinates, and the
/// rounding of the normal to 24 bits, times the ball's radius.
const LOCATION_ERROR_MM: f32 = 0.87e-6;
const LOCATION_ERROR_SHARE: f32 = 1.0 / 16_777_216.0;
/// Minimum share of the scallop limit that is left by the location error.
const HEIGHT_SHARE_MIN: f32 = 0.5;

/// Mean inverse square interval over a step-over, from the values at its start, middle and end. By Simpson's rule where the middle is the maximum; where the ends
/// are, by the trapezoidal rule, because the curvature counts with a weight that falls from the ends to the middle.
///
/// At a knot the curvature may jump. `knots`: whether there are any in the first half, in the second. The weight of what lies beyond a knot in the first half
/// is 1/2 to 1, in the second half 0 to 1/2; the mean is the greatest of these.
pub(super) fn mean(here: f32, half: f32, whole: f32, knots: [bool; 2]) -> f32 {
    let parabola = (here + 4.0 * half + whole) * (1.0 / 6.0);
    let lines = (here + 2.0 * half + whole) * 0.25;
    let [first, second] = knots;
    let mut mean = parabola.at_least(lines);
    if first {
        mean = (0.5 * (half + whole)).at_least(mean);
    }
    if second {
        mean = (0.5 * (here + half)).at_least(mean);
    }
    if first || second {
        mean = (0.5 * (here + whole)).at_least(mean);
    }
    mean
}

/// The inverse square interval at an end of a line; 0 where there is no contact. Where path lines are skew, the scallop crest between two passes lies beyond
/// the end of one of them: the distance from the last ball of that pass is along the side line, from the other pass at right angles to it.
/// With a and b for |d|^2 (1 + r c) of these two directions, the crest height is multiplied by 4/(1 + sqrt(a/b))^2.
#[inline(never)]
pub(super) fn at_end(job: &Job<'_>, patch: &Patch, fraction: u64) -> f32 {
    let Ok(contact) = patch.surface.contact_on_line(fraction, &patch.ball) else {
        return 0.0;
    };
    let inv_interval_sq = exact_at(job, patch, &contact);
    inv_interval_sq * skew_factor(contact.outwards / contact.across)
}

/// Factor of the crest's height where one of two passes has its ball at its end: from the ratio of the inverse square interval along the boundary to that at
/// right angles to the pass.
pub(crate) fn skew_factor(ratio: f32) -> f32 {
    // Not at a pole, where the ratio is 0/0, nor where the side line's lower curvature makes the ratio 1 or less.
    if !(ratio > 1.0 && ratio.is_finite()) {
        return 1.0;
    }
    let mean = 0.5 * (1.0 + 1.0 / sqrt(ratio));
    1.0 / (mean * mean)
}

pub(crate) fn exact_at(job: &Job<'_>, patch: &Patch, contact: &Contact) -> f32 {
    let shape = [contact.across, contact.lateral_squared];
    exact(job.header, patch.interval.inv_interval_sq(contact), shape)
}

/// The inverse square interval without the first-order approximations in h/r. The ball's circle instead of the parabola
/// multiplies the inverse square interval by 1/(1 - h/(2r)),
/// and the scallop's height above a surface of curvature c by 1 + h c; `across / lateral_squared` is 1 + r c.
///
/// The limit is lowered by the error of the emitted location.
pub(super) fn exact(header: &Header, inv_interval_sq: f32, [across, lateral_squared]: [f32; 2]) -> f32 {
    let height = header.scallop_mm / header.ball_radius_mm;
    let bend = if lateral_squared > 0.0 {
        across / lateral_squared - 1.0
    } else {
        0.0
    };
    let left = height_limit_mm(header) / header.scallop_mm;
    inv_interval_sq * (1.0 + height * bend) / ((1.0 - 0.5 * height) * left)
}

/// The scallop limit, lowered by the error of the emitted location, mm.
pub(crate) fn height_limit_mm(header: &Header) -> f32 {
    let error_mm = LOCATION_ERROR_MM + LOCATION_ERROR_SHARE * header.ball_radius_mm;
    header.scallop_mm * (1.0 - error_mm / header.scallop_mm).at_least(HEIGHT_SHARE_MIN)
}

/// The step where it is not the distance of the farther line: with the values at its middle and its end on the parabola through those of the pass and the two
/// lines, less a margin for what a parabola does not know.
pub(super) fn nearer(here: f32, [half, whole]: [f32; 2], step: f32, distance: f32, knots: [bool; 2]) -> f32 {
    let ratio = step / distance;
    let bend = here - 2.0 * half + whole;
    let slope = whole - here - bend;
    let at = |share: f32| here + share * (slope + share * bend);
    let mean = mean(here, at(0.5 * ratio), at(ratio), knots);
    let off = (1.0 - ratio).abs().at_most(1.0);
    let margin = MARGIN_OF_BEND * off * (bend / here).abs();
    step_over(here, mean * (1.0 + margin), step)
}

/// The step that follows a step, from the mean inverse square interval over a distance and the inverse square interval's change over it.
pub(super) fn forecast(mean: f32, change: f32, step: f32, distance: f32) -> f32 {
    if !(step < f32::INFINITY) {
        return f32::INFINITY;
    }
    interval_of((mean + change * (step / distance)).at_least(0.25 * mean))
}

/// The step x at which the mean inverse square interval over the step is 1/x^2, for the inverse square interval `here` and its mean over a distance. The
/// mean is linear in x; where it falls, it falls no further than over that distance.
pub(crate) fn step_over(here: f32, mean: f32, distance: f32) -> f32 {
    let first = interval_of(here);
    // In units of the first-order step, where here = 1.
    let (mean, distance) = (mean / here, distance / first);
    let rise = if mean == 1.0 { 0.0 } else { (mean - 1.0) / distance };
    let mut step = 1.0_f32;
    for _ in 0..NEWTON_STEPS {
        let slope = step * (2.0 + 3.0 * rise * step);
        // Where the inverse square interval becomes zero within the step there is no root: the maximum step.
        let next = step - (step * step * (1.0 + rise * step) - 1.0) / slope.at_least(0.5);
        // A NaN becomes the minimum step.
        let next = next.at_least(STEP_MIN).at_most(STEP_MAX);
        let change = (next - step).abs();
        step = next;
        if change < NEWTON_LAST {
            break;
        }
    }
    if rise < 0.0 && step > distance {
        step = interval_of(mean).at_least(STEP_MIN).at_most(step);
    }
    step * first
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a known linear inverse square interval, its mean over the step is 1/step^2.
    #[test]
    fn the_mean_over_the_step_makes_the_scallop() {
        for rise in [0.0, 0.01, -0.01, 0.3, -0.2, 2.0, 10.0] {
            let here = 2500.0_f64;
            let first = here.sqrt().recip();
            // The mean over twice the first-order step.
            let mean = here * (1.0 + 2.0 * rise);
            let x = f64::from(step_over(here as f32, mean as f32, 2.0 * first as f32)) / first;
            let height = x * x * (1.0 + rise * x);
            let tolerance = if rise > 1.0 { 3e-2 } else { 2e-6 };
            assert!((height - 1.0).abs() < tolerance, "rise {rise}: {height}");
        }
        // Within the bounds and finite.
        let first = interval_of(1.0);
        assert!((step_over(1.0, -1.0, 2.0) / first - STEP_MAX).abs() < 1e-6);
        assert!((step_over(1.0, 1e9, 1.0) / first - STEP_MIN).abs() < 1e-6);
        assert!(step_over(1.0, f32::NAN, 1.0).is_finite());
        // No extrapolation of a fall beyond the lines.
        let step = step_over(1.0, 0.9, 0.5);
        assert!((step - 0.9_f32.sqrt().recip()).abs() < 1e-6, "{step}");
    }

    /// A concave parabola and a convex kink are integrated exactly; a constant is unchanged.
    #[test]
    fn means_of_parabolas_and_kinks() {
        let near = |got: f32, want: f64| assert!((f64::from(got) - want).abs() < 1e-6, "{got} for {want}");
        let smooth = [false; 2];
        near(mean(1.0, 1.0, 1.0, smooth), 1.0);
        near(mean(1.0, 1.1, 1.2, smooth), 1.1);
        // 1 + x (1 - x): mean 1 + 1/2 - 1/3.
        near(mean(1.0, 1.25, 1.0, smooth), 1.0 + 1.0 / 6.0);
        // |1 - 2 x|: mean 1/2.
        near(mean(1.0, 0.0, 1.0, smooth), 0.5);
    }

    /// Two balls on a cylinder of radius R: centres at R + r, the cusp at R + h, half the angle between the centres by the cosine law.
    #[test]
    fn heights_are_exact_on_plane_and_cylinder() {
        for (curvature, r, h) in [
            (0.0, 4.0, 0.5),
            (0.05, 4.0, 0.005),
            (5.0, 4.0, 0.005),
            (0.2, 10.0, 0.1),
            (-0.1, 5.0, 0.05),
        ] {
            let header = Header {
                ball_radius_mm: r as f32,
                scallop_mm: h as f32,
                ..Header::default()
            };
            let (level, bend) = (1.0 / (8.0 * r * h), 1.0 + r * curvature);
            let inv_interval_sq = exact(&header, (bend * level) as f32, [bend as f32, 1.0]);
            let step = 1.0 / f64::from(inv_interval_sq).sqrt();
            let height = if curvature == 0.0 {
                r - (r * r - 0.25 * step * step).sqrt()
            } else {
                // Curvature away from the ball is above 0: inside a concave cylinder radius and heights count inwards.
                let radius = 1.0_f64 / curvature;
                let (centre, half) = (radius + r, 0.5 * step / radius);
                centre * half.cos() - (r * r - (centre * half.sin()).powi(2)).sqrt() - radius
            };
            let share = height / h;
            assert!(
                (0.97..=1.0 + 2e-6).contains(&share),
                "curvature {curvature}, r {r}, h {h}: {share} of the height"
            );
        }
    }
}
