//! Step 5 with look-ahead: the step-over from a pass to the next one.
//!
//! The interval of eqns 10 and 11 is a first-order approximation: it uses the lengths and curvatures at the pass for the whole gap, and a parabola
//! for the ball. Its error is 1 to 2 % of the scallop height where the path lines diverge or the curvature increases from pass to
//! pass, h/(2r) everywhere, and up to four times the height at the end of a pass with skew path lines. So the estimator also
//! evaluates the surface beside the pass: at stations along the pass it computes the inverse square interval, `1/interval^2`, on two neighbouring
//! lines, half a step-over and a whole one away, at the same path parameter. The mean inverse square interval over the step to the next pass
//! gives the scallop height.
//!
//! The stations are the caller's ([`crate::pass::scan`], or the look-ahead of a job with axis limits): even parts of each patch, in order.

use crate::fault::Result;
use crate::job::program::Job;
use crate::job::{Header, Spacing};
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use crate::pass::edge::{self, EdgeCrest, EdgeSearch};
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::route::Route;
use crate::pass::row_history::RowHistory;
use crate::pass::schedule;
use crate::sample::{SpanParameter, interval_of};
use crate::surface::Contact;

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
/// Maximum ratio of the expected step to the previous one.
const FORECAST_MAX: f32 = 1.4;
/// Margin in height, per relative difference of the step from the distance of the lines, as a share of the second difference of the inverse square interval.
const MARGIN_OF_BEND: f32 = 0.1;
/// The lines of the first pass are placed again where the step differs by more than this share from their distance.
const AGAIN_MIN: f32 = 0.03;
/// Error of the emitted cutter location along the normal, by which the scallop limit is lowered: half a nanometre in each of three coordinates, and the
/// rounding of the normal to 24 bits, times the ball's radius.
const LOCATION_ERROR_MM: f32 = 0.87e-6;
const LOCATION_ERROR_SHARE: f32 = 1.0 / 16_777_216.0;
/// Minimum share of the scallop limit that is left by the location error.
const HEIGHT_SHARE_MIN: f32 = 0.5;

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

/// Maximum of a function that is evaluated at even stations of each patch, in order. Between stations it is that of the parabola through three.
#[derive(Clone, Copy, Debug)]
struct Peak {
    most: f32,
    /// The last two values, the older one first; NaN where they are on another patch.
    last: [f32; 2],
    /// The last station.
    fraction: u64,
}

impl Peak {
    const NONE: Self = Self {
        most: 0.0,
        last: [f32::NAN; 2],
        fraction: 0,
    };

    /// The next value is on another patch.
    const fn cut(&mut self) {
        self.last = [f32::NAN; 2];
    }

    fn see(&mut self, value: f32, fraction: u64) {
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
struct PlaceOnPass {
    position: PassPosition,
    fraction: u64,
    /// Fractions at the start of the pass and at its end.
    range: [u64; 2],
    /// On the last patch.
    is_last: bool,
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
    /// Distance of the farther line from the pass, in the side parameter, and the inverse square interval from which it was chosen.
    distance: f32,
    placed_for: f32,
    /// The farther line is at the surface's boundary.
    is_at_boundary: bool,
    /// Inverse square interval on the line.
    peak: Peak,
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
    /// Inverse square interval at the stations of the pass.
    own: Peak,
    /// Inverse square interval at the ends of the pass, from the pass alone, and the ends still to be evaluated.
    edges: [f32; 2],
    ends: [bool; 2],
    /// The crests at the ends of the gap, once measured, and the search for the next one.
    crests: [Option<EdgeCrest>; 2],
    searches: [bool; 2],
    search: EdgeSearch,
    /// Evaluations of the lines at the last station.
    at_last: u8,
    /// Step of the previous pass.
    before: Option<f32>,
    /// The step that is expected of this pass, by what the lines of the previous one showed.
    expected: f32,
    /// The first pass is looked at for the second time.
    looked_again: bool,
    /// Side span of the pass, and patches of it so far.
    side_span: u16,
    patches: u16,
    /// The last path span of the pass, the fractions at which it starts on its first patch and ends on its last, and whether these are the surface's boundaries.
    last_span: u16,
    range: [u64; 2],
    is_whole: [bool; 2],
    /// The line to evaluate next.
    second: bool,
    rows: RowHistory,
}

impl StepOverEstimator {
    /// State before the first pass.
    pub(crate) const START: Self = Self {
        lines: [NeighbourLine::new(0.5), NeighbourLine::new(1.0)],
        own: Peak::NONE,
        edges: [0.0; 2],
        ends: [false; 2],
        crests: [None; 2],
        searches: [false; 2],
        search: EdgeSearch::DONE,
        at_last: 0,
        before: None,
        expected: 0.0,
        looked_again: false,
        side_span: 0,
        patches: 0,
        last_span: 0,
        range: [0, u64::MAX],
        is_whole: [true; 2],
        second: false,
        rows: RowHistory::START,
    };

    /// Resets to the state before the first pass. [`Self::begin`] resets the other fields.
    pub(crate) const fn restart(&mut self) {
        self.before = None;
        self.looked_again = false;
        self.rows = RowHistory::START;
        self.second = false;
        self.search = EdgeSearch::DONE;
    }

    /// The pass that is looked at from here on is in this row.
    pub(crate) const fn enter_row(&mut self, row: u16) {
        self.rows.enter(row);
    }

    /// Side parameter of the pass after the one at `from`, by the step to it.
    ///
    /// # Errors
    /// Those of [`schedule::next_side`].
    pub(crate) fn next_side(&self, job: &Job<'_>, from: SpanParameter, step: f32) -> Result<SpanParameter> {
        self.rows
            .next_side(job.header, from, step, |span| job.side_width(span))
    }

    /// The first and the last row of patches that the planning of the next pass needs, at this side parameter.
    pub(crate) fn rows_needed(&self, job: &Job<'_>, side: SpanParameter) -> [u16; 2] {
        let expected = if job.header.spacing == Spacing::FirstOrder {
            Some(0.0)
        } else {
            self.expects()
        };
        self.rows
            .needed(job.header, side, expected, |span| job.side_width(span))
    }

    /// Begins a pass on a new line.
    pub(crate) fn begin(&mut self, job: &Job<'_>, route: &Route) {
        let [half, whole] = &mut self.lines;
        half.begin();
        whole.begin();
        self.own = Peak::NONE;
        self.edges = [0.0; 2];
        self.crests = [None; 2];
        self.patches = 0;
        self.begin_range(job, route);
    }

    /// Begins another pass on the same line: the step-over is that of both.
    pub(crate) fn go_on(&mut self, job: &Job<'_>, route: &Route) {
        let [half, whole] = &mut self.lines;
        half.go_on();
        whole.go_on();
        self.own.cut();
        self.begin_range(job, route);
    }

    fn begin_range(&mut self, job: &Job<'_>, route: &Route) {
        let (first, last) = (route.first(job), route.last_on_line());
        self.is_whole = route.reach_boundaries(job);
        self.ends = self.is_whole;
        self.searches = self.is_whole;
        self.range = [first.start(), last.end()];
        self.last_span = last.position.span;
        self.search.stop();
        self.at_last = 0;
    }

    /// A patch of the pass begins.
    pub(crate) const fn begin_patch(&mut self) {
        self.own.cut();
        self.patches = self.patches.saturating_add(1);
    }

    /// A station of the pass.
    pub(crate) fn see(&mut self, job: &Job<'_>, patch: &Patch, contact: &Contact, fraction: u64) {
        self.own.see(exact_at(job, patch, contact), fraction);
    }

    /// Maximum inverse square interval at the stations so far.
    pub(crate) const fn most(&self) -> f32 {
        self.own.most
    }

    /// Whether the first pass is not followed yet: the lines then have no previous step to be placed by.
    pub(crate) const fn is_first(&self) -> bool {
        self.before.is_none()
    }

    /// Evaluations at a station: one for each neighbouring line, two where its patch has to be collapsed, and more at the passes' ends. `begins_patch`,
    /// `begins`, `ends`: the station is the first of a patch, the first and the last of the pass.
    pub(crate) fn evaluations(&self, begins_patch: bool, begins: bool, ends: bool) -> u8 {
        let rounds = 1 + u8::from(self.is_first());
        let of_end = |is_whole: bool| 4 + u8::from(is_whole) * rounds * edge::EVALUATIONS;
        let [start, end] = self.is_whole;
        let at_start = if begins { of_end(start) } else { 0 };
        let at_end = if ends { of_end(end) } else { 0 };
        2 + 2 * u8::from(begins_patch) + at_start + at_end
    }

    /// Whether the next task at this fraction of this patch collapses a patch.
    pub(crate) fn makes_patch(&self, position: &PassPosition, fraction: u64) -> bool {
        if self.search.is_active() {
            return self.search.makes_patch();
        }
        if self.due_search(self.is_end(position, fraction)).is_some() {
            return true;
        }
        let beside = self.next_line();
        match beside.task {
            Task::Patch => true,
            Task::Evaluate => beside.span != position.span,
            _ => false,
        }
    }

    /// The line to evaluate next.
    fn next_line(&self) -> &NeighbourLine {
        let [half, whole] = &self.lines;
        if self.is_second_next() { whole } else { half }
    }

    /// Whether the farther line is evaluated next: the line halfway waits for the search at the start, which uses its patch.
    fn is_second_next(&self) -> bool {
        let [at_start, _] = self.searches;
        let [half, whole] = &self.lines;
        self.second || (at_start && half.task == Task::Patch && whole.task != Task::Idle)
    }

    /// The search for the crest at an end of the gap that is due, and whether it is that at the end of the passes. At the start it uses the patch of the line
    /// halfway before that is collapsed, at the end after its last station.
    fn due_search(&self, is_end: bool) -> Option<bool> {
        let [half, whole] = &self.lines;
        let [at_start, at_end] = self.searches;
        if at_start && whole.spans == 1 && whole.task == Task::Evaluate && half.task == Task::Patch {
            return Some(false);
        }
        let are_seen = self.at_last >= 2 && whole.task == Task::EvaluateLast;
        (at_end && is_end && are_seen).then_some(true)
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
        let [edge_start, edge_end] = self.edges;
        let is_end = self.is_end(position, fraction);
        let is_last = position.span == self.last_span;
        if start {
            self.ends = [false, end];
            self.edges = [at_end(job, patch, 0), edge_end];
        } else if end && is_last {
            self.ends = [start, false];
            self.edges = [edge_start, at_end(job, patch, u64::MAX)];
        } else if self.search.is_active() {
            self.search(job, position, patch);
        } else if let Some(at_end) = self.due_search(is_end) {
            let [at_start, _] = self.searches;
            self.searches = [at_start && at_end, !at_end];
            let [_, whole] = &self.lines;
            self.search.begin(
                at_end != position.reversed,
                at_end,
                whole.distance,
                self.is_first(),
            );
            self.search(job, position, patch);
        } else {
            let is_second = self.is_second_next();
            self.second = !is_second;
            self.side_span = position.side.span;
            self.at_last = self.at_last.saturating_add(u8::from(is_end));
            let expected = self.expects();
            let most = edge_start.at_least(edge_end).at_least(most);
            let [half, whole] = &mut self.lines;
            let beside = if is_second { whole } else { half };
            let spans = self.rows.spans(job.header);
            let place = PlaceOnPass {
                position: *position,
                fraction,
                range: self.range,
                is_last,
            };
            beside.work(job, &place, most, expected, spans);
        }
    }

    /// Whether this is the end of the pass.
    fn is_end(&self, position: &PassPosition, fraction: u64) -> bool {
        let [_, end] = self.range;
        fraction == end && position.span == self.last_span
    }

    /// One evaluation of the search for a crest.
    fn search(&mut self, job: &Job<'_>, position: &PassPosition, patch: &Patch) {
        let [half, whole] = &mut self.lines;
        let crest = self
            .search
            .work(job, position, [patch, &whole.patch], &mut half.patch);
        if crest.is_some() {
            let [start, end] = self.crests;
            self.crests = if self.search.is_at_end() {
                [start, crest]
            } else {
                [crest, end]
            };
        }
    }

    /// The step to the next pass, in units of the side parameter, after the last sample of this one; infinite where the scallop limit does
    /// not bound the step.
    pub(crate) fn step(&mut self, header: &Header, maximum: PassMaximum) -> f32 {
        let Some((step, next)) = self.allowed(header, maximum) else {
            self.before = None;
            return f32::INFINITY;
        };
        // A second look that was not finished in time does not go beyond the first one.
        let [_, is_unfinished] = self.searches;
        let step = if self.is_first() && self.looked_again && is_unfinished {
            self.expected.at_most(step)
        } else {
            step
        };
        self.expected = next.at_most(step * FORECAST_MAX).at_least(step / FORECAST_MAX);
        self.before = Some(step);
        step
    }

    /// Whether the first pass is to be looked at again, because its lines were placed far from the step that they showed. They are placed by it then.
    pub(crate) fn looks_again(&mut self, header: &Header) -> bool {
        if !self.is_first() || self.looked_again {
            return false;
        }
        let Some((step, _)) = self.allowed(header, PassMaximum::NONE) else {
            return false;
        };
        let [_, whole] = &self.lines;
        let is_far = (step - whole.distance).abs() > AGAIN_MIN * whole.distance && step < f32::INFINITY;
        if is_far && !whole.is_at_boundary {
            self.looked_again = true;
            self.expected = step;
        }
        self.looked_again
    }

    /// The step of the next pass that is expected, if it is.
    fn expects(&self) -> Option<f32> {
        (self.before.is_some() || self.looked_again).then_some(self.expected)
    }

    /// The step that a pass allows, and that expected of the next one; none where the scallop limit does not bound it.
    fn allowed(&self, header: &Header, maximum: PassMaximum) -> Option<(f32, f32)> {
        let PassMaximum {
            inv_interval_sq: most,
            shape,
        } = maximum;
        let here = exact(header, most, shape).at_least(self.own.most);
        if !(here > 0.0) {
            return None;
        }
        let [half, whole] = &self.lines;
        let found = |line: &NeighbourLine| line.found(self.patches, here);
        let knots = [
            half.side.span != self.side_span,
            whole.side.span != half.side.span,
        ];
        let mean = match (found(half), found(whole)) {
            (Some(half), Some(whole)) => mean(here, half, whole, knots),
            // The farther line was not evaluated in time.
            (Some(half), None) => half.at_least(here),
            _ => here,
        };
        let mut step = step_over(here, mean, whole.distance);
        let [first, second] = knots;
        let jumps = first || second;
        if let (Some(half), Some(whole_line)) = (found(half), found(whole)) {
            step = step.at_most(nearer(here, [half, whole_line], step, whole.distance, knots));
        }
        let beyond = found(whole).unwrap_or(here);
        let mut next = forecast(mean, beyond - here, step, whole.distance);
        for (crest, edge) in self.crests.iter().zip(&self.edges) {
            let allowed = match crest {
                Some(crest) => crest.step(jumps),
                // No boundary.
                None if !(*edge > 0.0) => f32::INFINITY,
                // As the pass itself where the crest was not measured in time.
                None => step_over(*edge, *edge * (mean / here).at_least(1.0), whole.distance),
            };
            if let Some(crest) = crest {
                let change = crest.beyond - crest.here;
                next = forecast(crest.mean, change, allowed, crest.distance).at_most(next);
            }
            step = allowed.at_most(step);
        }
        Some((step, next))
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
            distance: 0.0,
            placed_for: 0.0,
            is_at_boundary: false,
            peak: Peak::NONE,
        }
    }

    /// Evaluates the line's start or end.
    fn see_end(&mut self, job: &Job<'_>, fraction: u64) {
        if let Ok(contact) = self.patch.surface.contact_on_line(fraction, &self.patch.ball) {
            self.peak.most = exact_at(job, &self.patch, &contact).at_least(self.peak.most);
        }
    }

    const fn begin(&mut self) {
        self.task = Task::Place;
        self.spans = 0;
        self.peak = Peak::NONE;
    }

    /// Another pass begins on the same line.
    const fn go_on(&mut self) {
        if !matches!(self.task, Task::Idle | Task::Place) {
            self.task = Task::Patch;
        }
        self.peak.cut();
    }

    #[inline(never)]
    fn work(&mut self, job: &Job<'_>, place: &PlaceOnPass, most: f32, expected: Option<f32>, spans: u16) {
        let PlaceOnPass {
            position,
            fraction,
            range: [start, end],
            is_last,
        } = place;
        let is_first = expected.is_none();
        self.task = match self.task {
            Task::Place => self.place(job, position, most, expected, spans),
            _ if is_first && most > REPLACE_FACTOR * self.placed_for => {
                self.place(job, position, most, expected, spans)
            }
            Task::Patch => self.make_patch(job, position, Task::Start),
            Task::Start => {
                self.see_end(job, *start);
                Task::Evaluate
            }
            Task::Evaluate if self.span != position.span => self.make_patch(job, position, Task::Evaluate),
            Task::Evaluate if *is_last => Task::End,
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

    /// Places the line: by the expected step, or by the step that the samples of this pass so far allow; at most at the end of these spans, those of the surface that
    /// are in the store.
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

    /// Maximum inverse square interval on the line beside this number of patches; for a line evaluated in part, at least that of the pass.
    fn found(&self, patches: u16, here: f32) -> Option<f32> {
        match self.task {
            Task::EvaluateLast if self.spans >= patches => Some(self.peak.most),
            Task::EvaluateLast | Task::End | Task::Evaluate => Some(self.peak.most.at_least(here)),
            Task::Place | Task::Patch | Task::Start | Task::Idle => None,
        }
    }
}

/// Mean inverse square interval over a step-over, from the values at its start, middle and end. By Simpson's rule where the middle is the maximum; where the ends
/// are, by the trapezoidal rule, because the curvature counts with a weight that falls from the ends to the middle.
///
/// At a knot the curvature may jump. `knots`: whether there are any in the first half, in the second. The weight of what lies beyond a knot in the first half
/// is 1/2 to 1, in the second half 0 to 1/2; the mean is the greatest of these.
fn mean(here: f32, half: f32, whole: f32, knots: [bool; 2]) -> f32 {
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
fn at_end(job: &Job<'_>, patch: &Patch, fraction: u64) -> f32 {
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
fn exact(header: &Header, inv_interval_sq: f32, [across, lateral_squared]: [f32; 2]) -> f32 {
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
fn nearer(here: f32, [half, whole]: [f32; 2], step: f32, distance: f32, knots: [bool; 2]) -> f32 {
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
fn forecast(mean: f32, change: f32, step: f32, distance: f32) -> f32 {
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
