//! A line beside the pass, and the maximum of the inverse square interval on it.

use super::means::exact_at;
use crate::job::program::Job;
use crate::math::number::Bounded;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::schedule;
use crate::sample::{SpanParameter, interval_of};

/// The first pass has no previous step from which to place the lines. They are placed again when the maximum inverse square interval has grown by
/// this factor since.
const REPLACE_FACTOR: f32 = 1.25;

/// The next task on a neighbouring line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Task {
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

/// Maximum of a function that is evaluated at even stations of each patch, in order. Between stations it is that of the parabola through three.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peak {
    pub(super) most: f32,
    /// The last two values, the older one first; NaN where they are on another patch.
    pub(super) last: [f32; 2],
    /// The last station.
    pub(super) fraction: u64,
}

impl Peak {
    pub(super) const NONE: Self = Self {
        most: 0.0,
        last: [f32::NAN; 2],
        fraction: 0,
    };

    /// The next value is on another patch.
    pub(super) const fn cut(&mut self) {
        self.last = [f32::NAN; 2];
    }

    pub(super) fn see(&mut self, value: f32, fraction: u64) {
        let [before, middle] = self.last;
        self.most = value.at_least(self.most);
        if !middle.is_nan() && fraction == self.fraction {
            return;
        }
        let (rise, fall) = (middle - before, middle - value);
        if rise > 0.0 && fall > 0.0 {
            let tilt = rise - fall;
            self.most = (middle + tilt * tilt / (8.0 * (rise + fall))).at_least(self.most);
        }
        self.last = [middle, value];
        self.fraction = fraction;
    }
}

/// A place on the pass.
pub(super) struct PlaceOnPass {
    pub(super) position: PassPosition,
    pub(super) fraction: u64,
    /// Fractions at the start of the pass and at its end.
    pub(super) range: [u64; 2],
    /// On the last patch.
    pub(super) is_last: bool,
}

/// A line at a constant side parameter beside the pass, towards the next pass.
#[derive(Clone, Copy, Debug)]
pub(super) struct NeighbourLine {
    /// Distance from the pass, as a fraction of a step-over.
    pub(super) share: f32,
    pub(super) patch: Patch,
    pub(super) task: Task,
    /// Path span of `patch`, and the number of spans evaluated so far.
    pub(super) span: u16,
    pub(super) spans: u16,
    pub(super) side: SpanParameter,
    /// Distance of the farther line from the pass, in the side parameter.
    pub(super) distance: f32,
    /// Inverse square interval by which that distance was chosen.
    pub(super) placed_for: f32,
    /// The farther line is at the surface's boundary.
    pub(super) is_at_boundary: bool,
    /// The line was placed again after the start of the pass, so the stations before that place were not evaluated on it.
    is_late: bool,
    /// Inverse square interval on the line.
    pub(super) peak: Peak,
}

impl NeighbourLine {
    /// A line not placed yet, for this fraction of a step-over.
    pub(super) const fn new(share: f32) -> Self {
        Self {
            share,
            patch: Patch::NONE,
            task: Task::Idle,
            span: 0,
            spans: 0,
            side: SpanParameter { span: 0, fraction: 0 },
            distance: 0.0,
            placed_for: 0.0,
            is_at_boundary: false,
            is_late: false,
            peak: Peak::NONE,
        }
    }

    /// Evaluates the line's start or end.
    fn see_end(&mut self, job: &Job<'_>, fraction: u64) {
        if let Ok(contact) = self.patch.surface.contact_on_line(fraction, &self.patch.ball) {
            self.peak.most = exact_at(job, &self.patch, &contact).at_least(self.peak.most);
        }
    }

    pub(super) const fn begin(&mut self) {
        self.task = Task::Place;
        self.spans = 0;
        self.is_late = false;
        self.peak = Peak::NONE;
    }

    /// Another pass begins on the same line.
    pub(super) const fn go_on(&mut self) {
        if !matches!(self.task, Task::Idle | Task::Place) {
            self.task = Task::Patch;
        }
        self.peak.cut();
    }

    #[inline(never)]
    pub(super) fn work(
        &mut self,
        job: &Job<'_>,
        place: &PlaceOnPass,
        most: f32,
        expected: Option<f32>,
        spans: u16,
    ) {
        let PlaceOnPass {
            position,
            fraction,
            range: [start, end],
            is_last,
        } = place;
        let is_first = expected.is_none();
        let next = if *is_last { Task::End } else { Task::Evaluate };
        self.task = match self.task {
            Task::Place => self.place(job, position, most, expected, spans),
            _ if is_first && most > REPLACE_FACTOR * self.placed_for => {
                self.is_late = true;
                self.place(job, position, most, expected, spans)
            }
            Task::Patch => self.make_patch(job, position, Task::Start),
            Task::Start => {
                self.see_end(job, *start);
                next
            }
            Task::Evaluate if self.span != position.span => self.make_patch(job, position, next),
            Task::End => {
                self.see_end(job, *end);
                Task::EvaluateLast
            }
            Task::Evaluate | Task::EvaluateLast => {
                if let Ok(contact) = self.patch.surface.contact_on_line(*fraction, &self.patch.ball) {
                    self.peak.see(exact_at(job, &self.patch, &contact), *fraction);
                }
                self.task
            }
            Task::Idle => Task::Idle,
        };
    }

    /// Places the line at the expected step, or at the step that the stations of this pass so far allow, but not beyond the end of the first `spans` side spans, which are in the
    /// store.
    fn place(
        &mut self,
        job: &Job<'_>,
        position: &PassPosition,
        most: f32,
        expected: Option<f32>,
        spans: u16,
    ) -> Task {
        let width = |span| job.side_width(span);
        if schedule::is_last(position.side, spans) {
            return Task::Idle;
        }
        let end = SpanParameter {
            span: spans.saturating_sub(1),
            fraction: u64::MAX,
        };
        let step = expected.unwrap_or_else(|| interval_of(most));
        let apart = schedule::apart(position.side, end, width);
        self.is_at_boundary = step >= apart;
        self.distance = step.at_most(apart);
        self.placed_for = most;
        match schedule::next_side(position.side, self.share * self.distance, spans, width) {
            Ok(side) => {
                self.side = side;
                self.spans = 0;
                self.peak = Peak::NONE;
                Task::Patch
            }
            Err(_) => Task::Idle,
        }
    }

    fn make_patch(&mut self, job: &Job<'_>, position: &PassPosition, then: Task) -> Task {
        let beside = PassPosition {
            side: self.side,
            ..*position
        };
        self.peak.cut();
        self.span = position.span;
        self.spans = self.spans.saturating_add(1);
        match self.patch.collapse(job, &beside) {
            Ok(()) => then,
            Err(_) => Task::Idle,
        }
    }

    /// Whether it was evaluated beside this number of patches, or cannot be.
    pub(super) fn is_seen(&self, patches: u16) -> bool {
        match self.task {
            Task::EvaluateLast => self.spans >= patches && !self.is_late,
            Task::Idle => true,
            Task::Place | Task::Patch | Task::Start | Task::Evaluate | Task::End => false,
        }
    }

    /// Maximum inverse square interval on the line beside this number of patches; for a line evaluated in part, at least that of the pass.
    pub(super) fn found(&self, patches: u16, here: f32) -> Option<f32> {
        match self.task {
            Task::EvaluateLast if self.is_seen(patches) => Some(self.peak.most),
            Task::EvaluateLast | Task::End | Task::Evaluate => Some(self.peak.most.at_least(here)),
            Task::Place | Task::Patch | Task::Start | Task::Idle => None,
        }
    }
}
