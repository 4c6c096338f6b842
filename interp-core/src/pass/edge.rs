//! The scallop crest at an end of a gap, where the side line of the surface's boundary goes from the end of a pass to that of the next one.
//!
//! Where side lines are not at right angles to the passes, one of the two balls that leave the crest stands at the end of its pass, and the other is somewhere
//! on its pass. With skew and curvature that change from pass to pass no formula of one line gives the crest, so it is measured: from the surface point on the
//! boundary where the crest is expected, the height of each pass's swept ball along the normal, with the next pass at the distance that is expected.

use crate::job::program::Job;
use crate::math::arith::{fraction_from_f32, sqrt};
use crate::math::number::Bounded;
use crate::math::vec3::Vec3;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::schedule;
use crate::pass::step_over::{exact_at, height_limit_mm, skew_factor, step_over};
use crate::surface::Contact;

/// Share of the chord between the contacts at which the first ball off the pass's end is tried: that of side lines at 45 degrees.
const FIRST_TRIAL: f32 = 0.7;
/// Two trials closer together than this share of the farther one's distance make no parabola.
const APART_MIN: f32 = 0.1;
/// Least inverse square interval of the pass itself, as a share of that at a distance.
const HERE_MIN: f32 = 0.1;
/// Newton iterations for the place of the crest, from where it was in the last gap: it moves by a few percent.
const CREST_STEPS: u8 = 3;
/// The crest is at least this share of the step-over away from both passes.
const SHARE_MIN: f32 = 0.1;
/// Greatest change of the root of a ball's height from that of constant curvature, as a share, that is taken for a change of curvature.
const BEND_MAX: f32 = 0.5;
/// A crest that is farther than this from where it was expected is searched again in the first gap.
const REPEAT_MIN: f32 = 0.02;
/// Balls of a pass that are tried.
const TRIALS: u8 = 4;
/// A fourth ball is tried where it is farther than this from the third one, as a share of the distance from the end.
const FOURTH_MIN: f32 = 0.02;
/// Evaluations of one round: a line between the passes, the point on it, and the balls of each pass.
pub(crate) const EVALUATIONS: u8 = 2 + 2 * TRIALS;

// The first four margins in height are per relative difference of the step from the distance at which the crest was measured. All are by the campaign of
// `tests/scallop_limit`.
/// Margin as a share of the difference between the mean over the distance and the mean of a linear inverse square interval.
const MARGIN_OF_CHANGE: f32 = 0.4;
/// Margin as a share of the square of the rise of the mean over the inverse square interval of the pass.
const MARGIN_OF_RISE: f32 = 0.25;
/// Margin for a knot within the distance.
const MARGIN_OF_KNOT: f32 = 0.02;
/// Margin on every surface.
const MARGIN: f32 = 0.003;
/// Margin in height for a knot within the distance, also at the distance: the balls' heights have a jump in their second derivative there.
const MARGIN_AT_KNOT: f32 = 0.005;
/// Inverse of the change of the inverse square interval, 5 %, from which [`MARGIN_AT_KNOT`] counts in full; on a plane it does not count.
const VARIES: f32 = 20.0;
/// Margin in height at the distance on any surface, as a share of the variation of the inverse square interval.
const MARGIN_OF_VARIATION: f32 = 0.02;
/// Greatest margin in height by the variation.
const MARGIN_OF_VARIATION_MAX: f32 = 5e-5;
/// Greatest margin in the step.
const MARGIN_MAX: f32 = 0.05;

/// A crest's inverse square interval, measured between a pass and a line at a distance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeCrest {
    /// Distance of the line, side parameter.
    pub(crate) distance: f32,
    /// Inverse square interval in the limit of a small distance, and at this one.
    pub(crate) here: f32,
    pub(crate) mean: f32,
    /// The former, at the line.
    pub(crate) beyond: f32,
}

impl EdgeCrest {
    /// The step at which the crest is as high as the limit; infinite where it does not bound the step.
    ///
    /// `jumps`: whether the curvature may jump at a knot within the distance.
    pub(crate) fn step(&self, jumps: bool) -> f32 {
        // At a pole the pass itself knows no interval.
        let here = self.here.at_least(HERE_MIN * self.mean);
        let step = step_over(here, self.mean, self.distance);
        // The mean is exact at the distance, and taken as linear from there to the step.
        let (rise, change) = (self.mean / here - 1.0, self.beyond / here - 1.0);
        let of_change = MARGIN_OF_CHANGE * (0.5 * change - rise).abs() + MARGIN_OF_RISE * rise * rise;
        let of_knot = if jumps { MARGIN_OF_KNOT } else { 0.0 };
        let variation = rise.abs() + change.abs();
        let varies = (VARIES * variation).at_most(1.0);
        let always = (MARGIN_OF_VARIATION * variation).at_most(MARGIN_OF_VARIATION_MAX);
        let at_knot = if jumps { MARGIN_AT_KNOT * varies } else { 0.0 };
        let off = (1.0 - step / self.distance).abs().at_most(1.0);
        let margin = off * (of_change + of_knot + MARGIN) + at_knot + always;
        // A NaN: no margin.
        step * (1.0 - (0.5 * margin).at_least(0.0).at_most(MARGIN_MAX))
    }
}

/// The ball of a pass that reaches a surface point deepest.
#[derive(Clone, Copy, Debug)]
struct DeepestBall {
    /// Fractions of the patch from its end, and the power of the point there with respect to the ball, mm^2: of a straight path it is a parabola.
    trials: [[f32; 2]; 3],
    /// Where the fourth ball is tried.
    last: f32,
    /// Second derivative of the power by the fraction, mm^2.
    bend: f32,
    /// Inverse square interval at the end, at right angles to the pass, and for a ball that stands at the end.
    swept: f32,
    standing: f32,
    /// r times the curvature away from the ball, at right angles to the pass.
    curvature: f32,
    /// Height, mm, once found, and whether the ball is off the end.
    height: f32,
    is_inside: bool,
}

impl DeepestBall {
    const NONE: Self = Self {
        trials: [[0.0; 2]; 3],
        last: 0.0,
        bend: 0.0,
        swept: 0.0,
        standing: 0.0,
        curvature: 0.0,
        height: 0.0,
        is_inside: false,
    };
}

/// The search at one end of a gap, one evaluation at a time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeSearch {
    /// Number of the next evaluation; [`EVALUATIONS`]: none is left.
    next: u8,
    /// At the end of the passes, not at their start; at the end of the path parameter.
    at_end: bool,
    at_far_boundary: bool,
    /// Another round follows where the crest was elsewhere.
    may_repeat: bool,
    /// Distance of the next pass as expected, side parameter.
    distance: f32,
    /// Where the crest is expected at each boundary, as a share of the step-over: where it was in the last gap.
    shares: [f32; 2],
    /// The surface point there, units of 2^-30 nm, and the ball's radius along its normal, mm.
    point: [i64; 3],
    normal_mm: Vec3,
    balls: [DeepestBall; 2],
}

impl EdgeSearch {
    /// None begun.
    pub(crate) const DONE: Self = Self {
        next: EVALUATIONS,
        at_end: false,
        at_far_boundary: false,
        may_repeat: false,
        distance: 0.0,
        shares: [0.5; 2],
        point: [0; 3],
        normal_mm: Vec3::new(0.0, 0.0, 0.0),
        balls: [DeepestBall::NONE; 2],
    };

    /// Begins a search at the start of the passes or at their end, with the next pass at this distance. `is_first`: the place of the crest is not known from
    /// another gap.
    pub(crate) const fn begin(&mut self, at_far_boundary: bool, at_end: bool, distance: f32, is_first: bool) {
        self.next = 0;
        self.at_end = at_end;
        self.at_far_boundary = at_far_boundary;
        self.may_repeat = is_first;
        self.distance = distance;
    }

    /// Ends the search.
    pub(crate) const fn stop(&mut self) {
        self.next = EVALUATIONS;
    }

    /// Whether the search is at the end of the passes, not at their start.
    pub(crate) const fn is_at_end(&self) -> bool {
        self.at_end
    }

    /// Whether evaluations are left.
    pub(crate) const fn is_active(&self) -> bool {
        self.next < EVALUATIONS
    }

    /// Whether the next evaluation collapses a patch.
    pub(crate) const fn makes_patch(&self) -> bool {
        self.next == 0
    }

    fn share(&self) -> f32 {
        let [near, far] = self.shares;
        if self.at_far_boundary { far } else { near }
    }

    /// One evaluation: on the pass, the line at the distance, or a line between that is collapsed for it; the crest after the last one.
    #[inline(never)]
    pub(crate) fn work(
        &mut self,
        job: &Job<'_>,
        position: &PassPosition,
        [pass, whole]: [&Patch; 2],
        between: &mut Patch,
    ) -> Option<EdgeCrest> {
        let number = self.next;
        self.next = number.saturating_add(1);
        match number {
            0 => {
                let width = |span| job.side_width(span);
                let distance = self.share() * self.distance;
                let side = schedule::next_side(position.side, distance, job.header.side_spans, width);
                let made = side.and_then(|side| between.collapse(job, &PassPosition { side, ..*position }));
                if made.is_err() {
                    self.stop();
                }
            }
            1 => match between.surface.contact_on_line(self.fraction(0.0), &between.ball) {
                Ok(contact) => {
                    self.point = between.locator.contact_q30(&contact, &between.origin);
                    self.normal_mm = between.locator.offset_mm(&contact);
                }
                Err(_) => self.stop(),
            },
            _ if number < 2 + TRIALS => self.try_ball(job, pass, false, number - 2),
            _ => self.try_ball(job, whole, true, number.saturating_sub(2 + TRIALS)),
        }
        if self.next == EVALUATIONS && number + 1 == EVALUATIONS {
            self.finish(job)
        } else {
            None
        }
    }

    /// The crest, unless another round follows.
    fn finish(&mut self, job: &Job<'_>) -> Option<EdgeCrest> {
        let expected = self.share();
        let (at, crest) = self.crest(job);
        let [near, far] = self.shares;
        let crest = crest?;
        self.shares = if self.at_far_boundary {
            [near, at]
        } else {
            [at, far]
        };
        if self.may_repeat && (at - expected).abs() > REPEAT_MIN {
            self.may_repeat = false;
            self.next = 0;
            return None;
        }
        Some(crest)
    }

    /// The fraction of a patch that is this far from the end of the pass.
    fn fraction(&self, from_end: f32) -> u64 {
        let fraction = fraction_from_f32(from_end);
        if self.at_end { !fraction } else { fraction }
    }

    /// Evaluates a trial of a pass's ball.
    fn try_ball(&mut self, job: &Job<'_>, patch: &Patch, is_whole: bool, trial: u8) {
        let [first, second] = self.balls;
        let mut ball = if is_whole { second } else { first };
        let [_, [near, _], [foot, _]] = ball.trials;
        let at = match trial {
            0 => 0.0,
            1 => near,
            2 => foot,
            _ => ball.last,
        };
        if trial > 0 && !(at > 0.0) {
            return;
        }
        let Ok(contact) = patch.surface.contact_on_line(self.fraction(at), &patch.ball) else {
            return;
        };
        let seen = self.see(patch, &contact);
        let power = seen.power;
        let [end, near, foot] = &mut ball.trials;
        match trial {
            0 => {
                *end = [0.0, power];
                let arc = contact.path.inv_speed * patch.per_mm;
                *near = [(FIRST_TRIAL * seen.chord_mm * arc).at_most(1.0), 0.0];
                *foot = [0.0; 2];
                ball.last = 0.0;
                ball.bend = 2.0 * contact.along / (arc * arc);
                let single = exact_at(job, patch, &contact);
                // A pass on a twisted surface has balls on both sides of the nearest contact's that reach deeper.
                let twist = contact.twist_squared / (contact.along * contact.across);
                ball.swept = single * (1.0 - twist).at_least(0.0);
                ball.standing = single * (contact.outwards / contact.across);
                ball.curvature = contact.across / contact.lateral_squared - 1.0;
                (ball.height, ball.is_inside) = (seen.height(power), false);
            }
            1 => {
                let [_, at_end] = *end;
                *near = [at, power];
                let slope = (power - at_end) / at - 0.5 * ball.bend * at;
                // NaN: no foot.
                *foot = [(-slope / ball.bend).at_most(1.0).at_least(0.0), 0.0];
            }
            2 => {
                *foot = [at, power];
                ball.is_inside = true;
                let (last, least) = lowest(&ball.trials);
                ball.height = seen.height(power).at_most(ball.height);
                if (last - at).abs() < FOURTH_MIN * at {
                    ball.height = seen.height(least).at_most(ball.height);
                } else {
                    ball.last = last.at_most(1.0);
                }
            }
            _ => ball.height = seen.height(power).at_most(ball.height),
        }
        self.balls = if is_whole { [first, ball] } else { [ball, second] };
    }

    /// The point, seen from a contact of a ball.
    fn see(&self, patch: &Patch, contact: &Contact) -> Seen {
        let chord = Vec3::between_q30(&self.point, &patch.locator.contact_q30(contact, &patch.origin));
        let offset = patch.locator.offset_mm(contact);
        let radius = sqrt(self.normal_mm.dot(self.normal_mm));
        Seen {
            chord_mm: sqrt(chord.dot(chord)),
            power: chord.dot(chord) + 2.0 * chord.dot(offset),
            middle: self.normal_mm.dot(chord + offset) / radius,
        }
    }

    /// The crest between the two balls: its place as a share of the distance, and its inverse square interval.
    fn crest(&self, job: &Job<'_>) -> (f32, Option<EdgeCrest>) {
        let [first, second] = &self.balls;
        let (distance, expected) = (self.distance, self.share());
        let limit = height_limit_mm(job.header);
        // The root of a ball's height is linear in the distance from its pass, but for a change of curvature: slope and second coefficient, per step-over.
        let curve = |ball: &DeepestBall, apart: f32| {
            let measured = sqrt(ball.height) / apart;
            let inv_interval_sq = if ball.is_inside { ball.swept } else { ball.standing };
            let slope = 2.0 * sqrt(limit * inv_interval_sq.at_least(0.0)) * distance;
            // Where the slope is unknown, or far from the measured one, the root is taken as linear.
            if (slope - measured).abs() < BEND_MAX * measured {
                (slope, (measured - slope) / apart)
            } else {
                (measured, 0.0)
            }
        };
        let ((near, near_bend), (far, far_bend)) = (curve(first, expected), curve(second, 1.0 - expected));
        let (from_near, from_far) = (
            |s: f32| (near + near_bend * s) * s,
            |s: f32| (far + far_bend * s) * s,
        );
        let mut at = expected;
        for _ in 0..CREST_STEPS {
            let back = 1.0 - at;
            let slope = near + 2.0 * near_bend * at + far + 2.0 * far_bend * back;
            let next = at - (from_near(at) - from_far(back)) / slope;
            at = next.at_least(SHARE_MIN).at_most(1.0 - SHARE_MIN);
        }
        let root = from_near(at).at_least(from_far(1.0 - at));
        let height = root * root;
        // The inverse square interval is that of a crest as high as the limit.
        let bend = (first.curvature + 0.5).at_least(0.0);
        let to_limit = 1.0 + bend * (limit - height) / job.header.ball_radius_mm;
        let mean = height * to_limit / (limit * (distance * distance));
        let alone = |ball: &DeepestBall| ball.swept * skew_factor(ball.standing / ball.swept);
        let crest = EdgeCrest {
            distance,
            here: alone(first),
            mean,
            beyond: alone(second),
        };
        (at, (mean > 0.0 && mean.is_finite()).then_some(crest))
    }
}

/// A surface point, seen from a ball's contact.
pub(crate) struct Seen {
    /// Distance of the two surface points, mm.
    pub(crate) chord_mm: f32,
    /// Power of the point with respect to the ball, mm^2: with e the chord, e^2 + 2 r e.N'.
    pub(crate) power: f32,
    /// Distance of the ball's centre along the point's normal, mm.
    pub(crate) middle: f32,
}

impl Seen {
    /// Height of a ball of this power above the point, along the normal, mm; infinite where the normal does not meet it. The normal meets the ball at t, where
    /// t^2 - 2 t `middle` + `power` = 0.
    pub(crate) fn height(&self, power: f32) -> f32 {
        let root = self.middle * self.middle - power;
        if root > 0.0 {
            (power / (self.middle + sqrt(root))).at_least(0.0)
        } else {
            f32::INFINITY
        }
    }
}

/// Place and value of the least of the parabola through three trials, or the last of the trials where they make none.
fn lowest(trials: &[[f32; 2]; 3]) -> (f32, f32) {
    let [[_, a], [near, b], [foot, c]] = *trials;
    let apart = (foot - near).abs().at_most(foot);
    if !(apart > APART_MIN * near.at_least(foot)) {
        return (foot, c);
    }
    let (first, second) = ((b - a) / near, (c - a) / foot);
    let bend = (second - first) / (foot - near);
    let slope = first - bend * near;
    if bend > 0.0 && slope < 0.0 {
        (-0.5 * slope / bend, a - slope * slope / (4.0 * bend))
    } else {
        (foot, c)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least of a parabola is exact; trials too close together give the last one.
    #[test]
    fn the_deepest_ball_is_the_parabolas_least() {
        let parabola = |at: f32| [at, 2.0 + (at - 0.3) * (at - 0.3)];
        let (at, least) = lowest(&[parabola(0.0), parabola(0.2), parabola(0.5)]);
        assert!(
            (at - 0.3).abs() < 1e-5 && (least - 2.0).abs() < 1e-6,
            "{at} {least}"
        );
        assert_eq!(
            lowest(&[parabola(0.0), parabola(0.2), parabola(0.201)]),
            (0.201, parabola(0.201)[1])
        );
    }

    /// A ball of 4 mm on a plane, its contact 0.3 mm away: r - sqrt(r^2 - 0.09). A ray that misses the ball has no height.
    #[test]
    fn height_of_a_ball_on_a_plane() {
        let seen = |chord_mm: f32| Seen {
            chord_mm,
            power: chord_mm * chord_mm,
            middle: 4.0,
        };
        let want = 4.0 - (16.0_f64 - 0.09).sqrt();
        let got = f64::from(seen(0.3).height(0.09));
        assert!((got / want - 1.0).abs() < 1e-6, "{got} for {want}");
        assert_eq!(seen(5.0).height(25.0), f32::INFINITY);
    }

    /// Where the crest was measured at the step there is no margin; away from it there is one, of a few percent at most.
    #[test]
    fn margin_grows_with_the_distance_from_where_the_crest_was_measured() {
        let crest = |distance: f32| EdgeCrest {
            distance,
            here: 1.0,
            mean: 1.0,
            beyond: 1.0,
        };
        assert!((crest(1.0).step(false) - 1.0).abs() < 1e-6);
        let (smooth, jumps) = (crest(0.8).step(false), crest(0.8).step(true));
        assert!(jumps < smooth && smooth < 1.0 && jumps > 0.95, "{smooth} {jumps}");
    }
}
