//! Step 5 with look-ahead: the step-over from a pass to the next one.
//!
//! The interval of eqns 10 and 11 is a first-order approximation: it uses the lengths and curvatures at the pass for the whole gap, and a parabola
//! for the ball. Its error is 1 to 2 % of the scallop height where the path lines diverge or the curvature increases from pass to
//! pass, h/(2r) everywhere, and up to four times the height at the end of a pass with skew path lines. So the estimator also
//! evaluates the surface beside the pass: in ticks with little other work it computes the inverse square interval, `1/interval^2`, on two neighbouring
//! lines, half a step-over and a whole one away, at the same path parameter. The mean inverse square interval over the step to the next pass
//! gives the scallop height.

use crate::job::Header;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::schedule;
use crate::sample::{SpanParameter, interval_of};
use crate::surface::{Contact, Pass as _};

/// One of this number of ticks without other work evaluates a neighbouring line, alternating between the two: the intervals of adjacent samples
/// differ little.
pub(crate) const EVERY: u32 = 4;

/// Maximum ratio of the step to the first-order step: the neighbouring lines extend no further.
const STEP_MAX: f32 = 1.25;
/// Minimum ratio of the step to the first-order step: where the inverse square interval rises faster, the two lines do not resolve it.
const STEP_MIN: f32 = 0.25;
/// Maximum Newton iterations for the root of a cubic, from a start of at most four times the root, where four leave an error of a few percent. Where the inverse square interval changes
/// by 10 %, two are enough: after a correction of [`NEWTON_LAST`] the error is 1e-6.
const NEWTON_STEPS: u8 = 4;
const NEWTON_LAST: f32 = 1e-3;
/// The first pass has no previous step from which to place the lines. They are placed again when the maximum inverse square interval has grown by
/// this factor since.
const REPLACE_FACTOR: f32 = 1.25;

/// The next task on a neighbouring line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Choose the line's side parameter.
    Place,
    /// Collapse the line's patch beside the pass's current patch.
    Patch,
    /// Evaluate the inverse square interval at the line's start.
    Start,
    /// Evaluate inverse square intervals on the line, up to the last patch of the pass.
    Evaluate,
    /// Evaluate the inverse square interval at the line's end.
    End,
    /// Evaluate inverse square intervals on the line's last patch.
    EvaluateLast,
    /// No task: the line is beyond the surface, or its patch is faulty.
    Idle,
}

/// A line at a constant side parameter beside the pass, towards the next pass.
#[derive(Clone, Copy, Debug)]
struct NeighbourLine {
    /// Distance from the pass, as a fraction of a step-over.
    share: f32,
    patch: Patch,
    task: Task,
    /// Path span of `patch`, and the number of spans evaluated so far.
    span: u16,
    spans: u16,
    side: SpanParameter,
    /// The step-over, in the side parameter, and the inverse square interval from which it was chosen.
    step: f32,
    placed_for: f32,
    /// Maximum inverse square interval on the line.
    most: f32,
}

/// The maximum inverse square interval of the samples of a pass, with `across` and `lateral_squared` of the [`Contact`] at that sample.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PassMaximum {
    pub(crate) inv_interval_sq: f32,
    pub(crate) shape: [f32; 2],
}

impl PassMaximum {
    /// No sample yet.
    pub(crate) const NONE: Self = Self {
        inv_interval_sq: 0.0,
        shape: [0.0; 2],
    };
}

/// The maximum inverse square intervals at a pass's ends and on the two neighbouring lines.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StepOverEstimator {
    lines: [NeighbourLine; 2],
    /// Maximum inverse square interval at the ends of the pass, and the ends still to be evaluated.
    edge: f32,
    ends: [bool; 2],
    /// Step of the previous pass.
    before: Option<f32>,
    /// The line to evaluate next.
    second: bool,
}

impl StepOverEstimator {
    /// State before the first pass.
    pub(crate) const START: Self = Self {
        lines: [NeighbourLine::new(0.5), NeighbourLine::new(1.0)],
        edge: 0.0,
        ends: [false; 2],
        before: None,
        second: false,
    };

    /// Resets to the state before the first pass. [`Self::begin`] resets the other fields.
    pub(crate) const fn restart(&mut self) {
        self.before = None;
        self.second = false;
    }

    /// Begins a pass.
    pub(crate) fn begin(&mut self) {
        let [half, whole] = &mut self.lines;
        half.begin();
        whole.begin();
        self.edge = 0.0;
        self.ends = [true; 2];
    }

    /// Ends evaluation on this pass.
    #[cfg(test)]
    pub(crate) fn disable(&mut self) {
        self.ends = [false; 2];
        self.lines = Self::START.lines;
    }

    /// Whether the next task at this position collapses a patch.
    pub(crate) fn makes_patch(&self, position: &PassPosition) -> bool {
        let [half, whole] = &self.lines;
        let beside = if self.second { whole } else { half };
        match beside.task {
            Task::Patch => true,
            Task::Evaluate => beside.span != position.span,
            _ => false,
        }
    }

    /// Executes one task, for a run at this fraction of this patch. `most`: maximum inverse square interval of the pass so far.
    #[inline(never)]
    pub(crate) fn work(
        &mut self,
        job: &Job<'_>,
        position: &PassPosition,
        patch: &Patch,
        fraction: u64,
        most: f32,
    ) {
        let [start, end] = self.ends;
        if start {
            self.ends = [false, end];
            self.edge = at_end(job, patch, 0);
        } else if end && position.next(job.header.path_spans).is_none() {
            self.ends = [false; 2];
            self.edge = at_end(job, patch, u64::MAX).at_least(self.edge);
        } else {
            let [half, whole] = &mut self.lines;
            let beside = if self.second { whole } else { half };
            self.second = !self.second;
            beside.work(job, position, fraction, most, self.before);
        }
    }

    /// The step to the next pass, in units of the side parameter, after the last sample of this one; infinite where the scallop limit does
    /// not bound the step.
    pub(crate) fn step(&mut self, header: &Header, maximum: PassMaximum) -> f32 {
        let PassMaximum {
            inv_interval_sq: most,
            shape,
        } = maximum;
        if !(most > 0.0) {
            self.before = None;
            return f32::INFINITY;
        }
        let here = exact(header, most, shape).at_least(self.edge);
        let [half, whole] = self.lines.each_ref().map(|line| line.found(header, here));
        let mean = match (half, whole) {
            (Some(half), Some(whole)) => mean(here, half, whole),
            // The second line is beyond the surface, or was not evaluated in time.
            (Some(half), None) => half.at_least(here),
            _ => here,
        };
        let [_, NeighbourLine { step: distance, .. }] = self.lines;
        let rise = if mean == here {
            0.0
        } else {
            (mean - here) / distance
        };
        let step = step_over(here, rise);
        self.before = Some(step);
        step
    }
}

impl NeighbourLine {
    /// A line not placed yet, for this fraction of a step-over.
    const fn new(share: f32) -> Self {
        Self {
            share,
            patch: Patch::NONE,
            task: Task::Idle,
            span: 0,
            spans: 0,
            side: SpanParameter { span: 0, fraction: 0 },
            step: 0.0,
            placed_for: 0.0,
            most: 0.0,
        }
    }

    const fn begin(&mut self) {
        self.task = Task::Place;
        self.spans = 0;
        self.most = 0.0;
    }

    #[inline(never)]
    fn work(
        &mut self,
        job: &Job<'_>,
        position: &PassPosition,
        fraction: u64,
        most: f32,
        before: Option<f32>,
    ) {
        let is_first = before.is_none();
        self.task = match self.task {
            Task::Place => self.place(job, position, most, before),
            _ if is_first && most > REPLACE_FACTOR * self.placed_for => {
                self.place(job, position, most, before)
            }
            Task::Patch => self.make_patch(job, position, Task::Start),
            Task::Start => {
                self.most = at_end(job, &self.patch, 0).at_least(self.most);
                Task::Evaluate
            }
            Task::Evaluate if self.span != position.span => self.make_patch(job, position, Task::Evaluate),
            Task::Evaluate if position.next(job.header.path_spans).is_none() => Task::End,
            Task::End => {
                self.most = at_end(job, &self.patch, u64::MAX).at_least(self.most);
                Task::EvaluateLast
            }
            Task::Evaluate | Task::EvaluateLast => {
                if let Ok(contact) = self.patch.surface.contact(fraction, &self.patch.ball) {
                    self.most = exact_at(job, &self.patch, &contact).at_least(self.most);
                }
                self.task
            }
            Task::Idle => Task::Idle,
        };
    }

    /// Places the line: by the previous step, or by the step that the samples of this pass so far allow.
    fn place(&mut self, job: &Job<'_>, position: &PassPosition, most: f32, before: Option<f32>) -> Task {
        self.step = before.unwrap_or_else(|| interval_of(most));
        self.placed_for = most;
        let spans = job.header.side_spans;
        let width = |span| job.side_width(span);
        match schedule::next_side(position.side, self.share * self.step, spans, width) {
            Ok(side) if !schedule::is_last(side, spans) => {
                self.side = side;
                self.most = 0.0;
                Task::Patch
            }
            _ => Task::Idle,
        }
    }

    fn make_patch(&mut self, job: &Job<'_>, position: &PassPosition, then: Task) -> Task {
        let beside = PassPosition {
            side: self.side,
            ..*position
        };
        self.span = position.span;
        self.spans = self.spans.saturating_add(1);
        match self.patch.collapse(job, &beside) {
            Ok(()) => then,
            Err(_) => Task::Idle,
        }
    }

    /// Maximum inverse square interval on the line; for a line evaluated in part, at least that of the pass.
    fn found(&self, header: &Header, here: f32) -> Option<f32> {
        match self.task {
            Task::EvaluateLast if self.spans >= header.path_spans => Some(self.most),
            Task::EvaluateLast | Task::End | Task::Evaluate => Some(self.most.at_least(here)),
            Task::Place | Task::Patch | Task::Start | Task::Idle => None,
        }
    }
}

/// Mean inverse square interval over a step-over, from the values at its start, middle and end. By Simpson's rule where the middle is the maximum; where the ends
/// are, by the trapezoidal rule, because an inverse square interval may have a kink at a knot.
fn mean(here: f32, half: f32, whole: f32) -> f32 {
    let parabola = (here + 4.0 * half + whole) * (1.0 / 6.0);
    let lines = (here + 2.0 * half + whole) * 0.25;
    parabola.at_least(lines)
}

/// The inverse square interval at an end of a line; 0 where there is no contact. Where path lines are skew, the scallop crest between two passes lies beyond
/// the end of one of them: the distance from the last ball of that pass is along the side line, from the other pass at right angles to it.
/// With a and b for |d|^2 (1 + r c) of these two directions, the crest height is multiplied by 4/(1 + sqrt(a/b))^2.
#[inline(never)]
fn at_end(job: &Job<'_>, patch: &Patch, fraction: u64) -> f32 {
    let Ok(contact) = patch.surface.contact(fraction, &patch.ball) else {
        return 0.0;
    };
    let inv_interval_sq = exact_at(job, patch, &contact);
    let part = contact.across / contact.outwards;
    // Not at a pole, where the ratio is 0/0, nor where the side line's lower curvature makes the ratio 1 or more.
    if !(part > 0.0 && part < 1.0) {
        return inv_interval_sq;
    }
    let mean = 0.5 * (1.0 + sqrt(part));
    inv_interval_sq / (mean * mean)
}

fn exact_at(job: &Job<'_>, patch: &Patch, contact: &Contact) -> f32 {
    let shape = [contact.across, contact.lateral_squared];
    exact(job.header, patch.interval.inv_interval_sq(contact), shape)
}

/// The inverse square interval without the first-order approximations in h/r. The ball's circle instead of the parabola
/// multiplies the inverse square interval by 1/(1 - h/(2r)),
/// and the scallop's height above a surface of curvature c by 1 + h c; `across / lateral_squared` is 1 + r c.
fn exact(header: &Header, inv_interval_sq: f32, [across, lateral_squared]: [f32; 2]) -> f32 {
    let height = header.scallop_mm / header.ball_radius_mm;
    let bend = if lateral_squared > 0.0 {
        across / lateral_squared - 1.0
    } else {
        0.0
    };
    inv_interval_sq * (1.0 + height * bend) / (1.0 - 0.5 * height)
}

/// The step x at which the mean inverse square interval `here + rise x` over the step is 1/x^2.
fn step_over(here: f32, rise: f32) -> f32 {
    let first = interval_of(here);
    // In units of the first-order step, where here = 1.
    let rise = rise * first / here;
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
            let x = f64::from(step_over(here as f32, (rise * here / first) as f32)) / first;
            let height = x * x * (1.0 + rise * x);
            let tolerance = if rise > 1.0 { 3e-2 } else { 2e-6 };
            assert!((height - 1.0).abs() < tolerance, "rise {rise}: {height}");
        }
        // Within the bounds and finite.
        let first = interval_of(1.0);
        assert!((step_over(1.0, -1.0) / first - STEP_MAX).abs() < 1e-6);
        assert!((step_over(1.0, 1e9) / first - STEP_MIN).abs() < 1e-6);
        assert!(step_over(1.0, f32::NAN).is_finite());
    }

    /// A concave parabola and a convex kink are integrated exactly; a constant is unchanged.
    #[test]
    fn means_of_parabolas_and_kinks() {
        let near = |got: f32, want: f64| assert!((f64::from(got) - want).abs() < 1e-6, "{got} for {want}");
        near(mean(1.0, 1.0, 1.0), 1.0);
        near(mean(1.0, 1.1, 1.2), 1.1);
        // 1 + x (1 - x): mean 1 + 1/2 - 1/3.
        near(mean(1.0, 1.25, 1.0), 1.0 + 1.0 / 6.0);
        // |1 - 2 x|: mean 1/2.
        near(mean(1.0, 0.0, 1.0), 0.5);
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
