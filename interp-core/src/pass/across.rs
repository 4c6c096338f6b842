//! Step 5 with foresight: how far the next pass may lie.
//!
//! The interval of eqns 10 and 11 is of first order: it takes lengths and curvatures of the pass for those of the whole gap, and a parabola
//! for the ball. What that leaves out is a percent or two of the scallop height where lines spread or the surface bends more from pass to
//! pass, h/(2r) everywhere, and up to four times the height at the end of a pass whose lines are skew. So a pass is also looked at from
//! outside: in ticks that have little else to do, the density `1/interval^2` is taken on two lines beside it, half a step-over and a whole
//! one further, at the same path parameter. The step to the next pass is the one over which the mean density makes the scallop.

use crate::job::Header;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use crate::pass::patch::Patch;
use crate::pass::position::Line;
use crate::pass::schedule;
use crate::sample::{Place, interval_of};
use crate::surface::{Contact, Pass as _};

/// A slack tick in so many looks across, at one line and the other in turn: the densities of neighbouring samples hardly differ.
pub(crate) const EVERY: u32 = 4;

/// Longest step over the first order's: no further is looked at.
const STEP_MAX: f32 = 1.25;
/// Shortest: where densities rise faster than that, no pass is looked at closely enough.
const STEP_MIN: f32 = 0.25;
/// Newton steps to the root of a cubic, from at most four times the root: four bring it to a few percent there. Where the density changes
/// by a tenth two are enough: a step of [`NEWTON_LAST`] leaves 1e-6.
const NEWTON_STEPS: u8 = 4;
const NEWTON_LAST: f32 = 1e-3;
/// The first pass has no step before it by which to choose the lines. They are chosen anew when the greatest density has grown by so
/// much since.
const AIM_AGAIN: f32 = 1.25;

/// What is to be done next for a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Choose it.
    Aim,
    /// Make its patch beside the one that the pass is on.
    Patch,
    /// The density at its start.
    Start,
    /// The densities on it, until the last patch of the pass.
    Look,
    /// The density at its end.
    End,
    /// The densities on it, to the end.
    LookOn,
    /// Nothing: the surface ends before it, or it cannot be had.
    Rest,
}

/// A line beside the pass.
#[derive(Clone, Copy, Debug)]
struct Beside {
    /// How far out it is, of a step-over.
    share: f32,
    patch: Patch,
    task: Task,
    /// Path span that `patch` is on, and how many spans it was on.
    span: u16,
    spans: u16,
    side: Place,
    /// The step-over, in the side parameter, and the density by which it was chosen.
    step: f32,
    aimed: f32,
    /// Greatest density on the line.
    most: f32,
}

/// The greatest density of the samples of a pass, and of the surface there `across` and `lateral_squared` of the [`Contact`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct Densities {
    pub(crate) most: f32,
    pub(crate) shape: [f32; 2],
}

impl Densities {
    /// Of nothing.
    pub(crate) const NONE: Self = Self {
        most: 0.0,
        shape: [0.0; 2],
    };
}

/// What is known of a pass's ends and the lines beside it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Across {
    lines: [Beside; 2],
    /// Greatest density at the ends of the pass, and which of them are still to be looked at.
    edge: f32,
    ends: [bool; 2],
    /// Step of the pass before.
    before: Option<f32>,
    /// Which line has its turn.
    second: bool,
}

impl Across {
    /// Before the first pass.
    pub(crate) const START: Self = Self {
        lines: [Beside::new(0.5), Beside::new(1.0)],
        edge: 0.0,
        ends: [false; 2],
        before: None,
        second: false,
    };

    /// Back to before the first pass. What else there is, each pass begins anew.
    pub(crate) const fn restart(&mut self) {
        self.before = None;
        self.second = false;
    }

    /// A pass begins.
    pub(crate) fn begin(&mut self) {
        let [half, whole] = &mut self.lines;
        half.begin();
        whole.begin();
        self.edge = 0.0;
        self.ends = [true; 2];
    }

    /// Looks no more on this pass.
    #[cfg(test)]
    pub(crate) fn rest(&mut self) {
        self.ends = [false; 2];
        self.lines = Self::START.lines;
    }

    /// Whether the next thing to be done at this place is a patch.
    pub(crate) fn makes_patch(&self, line: &Line) -> bool {
        let [half, whole] = &self.lines;
        let beside = if self.second { whole } else { half };
        match beside.task {
            Task::Patch => true,
            Task::Look => beside.span != line.span,
            _ => false,
        }
    }

    /// Does one thing, for a run at this fraction of this patch. `most`: greatest density of the pass so far.
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, line: &Line, patch: &Patch, fraction: u64, most: f32) {
        let [start, end] = self.ends;
        if start {
            self.ends = [false, end];
            self.edge = at_end(job, patch, 0);
        } else if end && line.next(job.header.path_spans).is_none() {
            self.ends = [false; 2];
            self.edge = at_end(job, patch, u64::MAX).at_least(self.edge);
        } else {
            let [half, whole] = &mut self.lines;
            let beside = if self.second { whole } else { half };
            self.second = !self.second;
            beside.work(job, line, fraction, most, self.before);
        }
    }

    /// The step to the next pass, in units of the side parameter, after the last sample of this one; infinite where nothing sets
    /// a limit.
    pub(crate) fn step(&mut self, header: &Header, densities: Densities) -> f32 {
        let Densities { most, shape } = densities;
        if !(most > 0.0) {
            self.before = None;
            return f32::INFINITY;
        }
        let here = exact(header, most, shape).at_least(self.edge);
        let [half, whole] = self.lines.each_ref().map(|line| line.found(header, here));
        let mean = match (half, whole) {
            (Some(half), Some(whole)) => mean(here, half, whole),
            // The surface ends before the second line, or there was no time to look.
            (Some(half), None) => half.at_least(here),
            _ => here,
        };
        let [_, Beside { step: distance, .. }] = self.lines;
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

impl Beside {
    /// No line yet, to be so far out.
    const fn new(share: f32) -> Self {
        Self {
            share,
            patch: Patch::NONE,
            task: Task::Rest,
            span: 0,
            spans: 0,
            side: Place { span: 0, fraction: 0 },
            step: 0.0,
            aimed: 0.0,
            most: 0.0,
        }
    }

    const fn begin(&mut self) {
        self.task = Task::Aim;
        self.spans = 0;
        self.most = 0.0;
    }

    #[inline(never)]
    fn work(&mut self, job: &Job<'_>, line: &Line, fraction: u64, most: f32, before: Option<f32>) {
        let is_first = before.is_none();
        self.task = match self.task {
            Task::Aim => self.aim(job, line, most, before),
            _ if is_first && most > AIM_AGAIN * self.aimed => self.aim(job, line, most, before),
            Task::Patch => self.make_patch(job, line, Task::Start),
            Task::Start => {
                self.most = at_end(job, &self.patch, 0).at_least(self.most);
                Task::Look
            }
            Task::Look if self.span != line.span => self.make_patch(job, line, Task::Look),
            Task::Look if line.next(job.header.path_spans).is_none() => Task::End,
            Task::End => {
                self.most = at_end(job, &self.patch, u64::MAX).at_least(self.most);
                Task::LookOn
            }
            Task::Look | Task::LookOn => {
                if let Ok(contact) = self.patch.surface.contact(fraction, &self.patch.ball) {
                    self.most = exact_at(job, &self.patch, &contact).at_least(self.most);
                }
                self.task
            }
            Task::Rest => Task::Rest,
        };
    }

    /// Chooses the line: by the step before, or by what the pass's samples so far would come to.
    fn aim(&mut self, job: &Job<'_>, line: &Line, most: f32, before: Option<f32>) -> Task {
        self.step = before.unwrap_or_else(|| interval_of(most));
        self.aimed = most;
        let spans = job.header.side_spans;
        let width = |span| job.side_width(span);
        match schedule::next_side(line.side, self.share * self.step, spans, width) {
            Ok(side) if !schedule::is_last(side, spans) => {
                self.side = side;
                self.most = 0.0;
                Task::Patch
            }
            _ => Task::Rest,
        }
    }

    fn make_patch(&mut self, job: &Job<'_>, line: &Line, then: Task) -> Task {
        let beside = Line {
            side: self.side,
            ..*line
        };
        self.span = line.span;
        self.spans = self.spans.saturating_add(1);
        match self.patch.collapse(job, &beside) {
            Ok(()) => then,
            Err(_) => Task::Rest,
        }
    }

    /// Greatest density on the line; a line of which a part was not seen is taken to be no flatter than the pass.
    fn found(&self, header: &Header, here: f32) -> Option<f32> {
        match self.task {
            Task::LookOn if self.spans >= header.path_spans => Some(self.most),
            Task::LookOn | Task::End | Task::Look => Some(self.most.at_least(here)),
            Task::Aim | Task::Patch | Task::Start | Task::Rest => None,
        }
    }
}

/// Mean density over a step-over, from the values at its start, middle and end. Where the middle stands out, a parabola's; where the ends
/// do, that of two straight lines, because a density may have a kink at a knot.
fn mean(here: f32, half: f32, whole: f32) -> f32 {
    let parabola = (here + 4.0 * half + whole) * (1.0 / 6.0);
    let lines = (here + 2.0 * half + whole) * 0.25;
    parabola.at_least(lines)
}

/// The density at an end of a line, 0 where there is no contact. There the crest between two passes is beyond the end of one of them, where
/// lines are skew: from the last ball of that one it is as far as the side line leads, from the other one at right angles to the pass.
/// With a and b for |d|^2 (1 + r c) of these two directions, the crest is 4/(1 + sqrt(a/b))^2 as high.
#[inline(never)]
fn at_end(job: &Job<'_>, patch: &Patch, fraction: u64) -> f32 {
    let Ok(contact) = patch.surface.contact(fraction, &patch.ball) else {
        return 0.0;
    };
    let density = exact_at(job, patch, &contact);
    let part = contact.across / contact.outwards;
    // Not so at a pole, where it is a part of nothing, nor where the side line bends that much less that it rises slower.
    if !(part > 0.0 && part < 1.0) {
        return density;
    }
    let mean = 0.5 * (1.0 + sqrt(part));
    density / (mean * mean)
}

fn exact_at(job: &Job<'_>, patch: &Patch, contact: &Contact) -> f32 {
    let shape = [contact.across, contact.lateral_squared];
    exact(job.header, patch.interval.density(contact), shape)
}

/// The density without the first order's approximations in h/r. The ball's circle instead of its parabola makes it 1/(1 - h/(2r)) of itself, and
/// the scallop's own height above a surface of curvature c another 1 + h c; `across` over `lateral_squared` is 1 + r c.
fn exact(header: &Header, density: f32, [across, lateral_squared]: [f32; 2]) -> f32 {
    let height = header.scallop_mm / header.ball_radius_mm;
    let bend = if lateral_squared > 0.0 {
        across / lateral_squared - 1.0
    } else {
        0.0
    };
    density * (1.0 + height * bend) / (1.0 - 0.5 * height)
}

/// The step x over which a density that begins as `here` has the mean `here + rise x`, which is 1/x^2.
fn step_over(here: f32, rise: f32) -> f32 {
    let first = interval_of(here);
    // In units of the first order's step, where here = 1.
    let rise = rise * first / here;
    let mut step = 1.0_f32;
    for _ in 0..NEWTON_STEPS {
        let slope = step * (2.0 + 3.0 * rise * step);
        // Where the density vanishes within the step there is no root: as far as is allowed.
        let next = step - (step * step * (1.0 + rise * step) - 1.0) / slope.at_least(0.5);
        // A NaN becomes the shortest step.
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

    /// Steps over a density that is known everywhere end where the mean of the density is 1/step^2.
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
        // No further than is known, and not without end.
        let first = interval_of(1.0);
        assert!((step_over(1.0, -1.0) / first - STEP_MAX).abs() < 1e-6);
        assert!((step_over(1.0, 1e9) / first - STEP_MIN).abs() < 1e-6);
        assert!(step_over(1.0, f32::NAN).is_finite());
    }

    /// A parabola is met exactly where it bends down, a kink where it bends up; what is even stays.
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
            let density = exact(&header, (bend * level) as f32, [bend as f32, 1.0]);
            let step = 1.0 / f64::from(density).sqrt();
            let height = if curvature == 0.0 {
                r - (r * r - 0.25 * step * step).sqrt()
            } else {
                // Curvature away from the ball is above 0: inside a hollow cylinder radius and heights count inwards.
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
