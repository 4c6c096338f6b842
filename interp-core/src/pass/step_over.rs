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

mod line;
mod means;

pub(crate) use means::{exact_at, height_limit_mm, skew_factor, step_over};

use self::line::{NeighbourLine, Peak, PlaceOnPass, Task};
use self::means::{at_end, exact, forecast, mean, nearer};
use crate::fault::Result;
use crate::job::program::Job;
use crate::job::stream::RowsNeeded;
use crate::job::{Header, Spacing};
use crate::math::number::Bounded;
use crate::pass::edge::{self, EdgeCrest, EdgeSearch};
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::route::Route;
use crate::pass::row_history::RowHistory;
use crate::sample::SpanParameter;
use crate::surface::Contact;

/// Maximum ratio of the expected step to the previous one.
const FORECAST_MAX: f32 = 1.4;
/// The lines of the first pass are placed again where the step differs by more than this share from their distance.
const AGAIN_MIN: f32 = 0.03;

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
    /// The first pass is being evaluated for the second time.
    looked_again: bool,
    /// Side span of the pass.
    side_span: u16,
    /// Number of patches of the pass so far.
    patches: u16,
    /// The last path span of the pass.
    last_span: u16,
    /// Fractions at which the pass starts on its first patch and ends on its last one, 2^-64.
    range: [u64; 2],
    /// Whether the pass starts, and ends, on the surface's boundary.
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

    /// The pass that is looked at from here on is in this row. `is_turned`: a turn leads to it.
    pub(crate) fn enter_row(&mut self, header: &Header, row: u16, is_turned: bool) {
        self.rows.enter(header, row, is_turned);
    }

    /// The pass that is looked at from here on does not follow the one before by a step: its lines have no previous step to be placed by.
    pub(crate) const fn begin_apart(&mut self) {
        self.before = None;
        self.looked_again = false;
    }

    /// Rows of the last passes.
    pub(crate) const fn rows(&self) -> &RowHistory {
        &self.rows
    }

    /// The rows that the next pass needs are there.
    pub(crate) const fn grant_rows(&mut self, needed: &RowsNeeded) {
        self.rows.grant(needed);
    }

    /// Side parameter of the pass after the one at `from`, by the step to it.
    ///
    /// # Errors
    /// Those of [`next_side`](crate::pass::schedule::next_side).
    pub(crate) fn next_side(&self, job: &Job<'_>, from: SpanParameter, step: f32) -> Result<SpanParameter> {
        self.rows
            .next_side(job.header, from, step, |span| job.side_width(span))
    }

    /// The rows of patches that the planning of the next pass needs, at this side parameter.
    pub(crate) fn rows_needed(&self, job: &Job<'_>, side: SpanParameter) -> RowsNeeded {
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

    /// Whether the first pass of a job, or of a part of its region, is not followed yet: the lines then have no previous step to be placed by.
    pub(crate) const fn is_first(&self) -> bool {
        self.before.is_none()
    }

    /// Evaluations at a station in this span: one for each neighbouring line, two where its patch has to be collapsed, three where that is the last one, and more
    /// at the passes' ends. `begins_patch`, `begins`, `ends`: the station is the first of a patch, the first and the last of the pass.
    pub(crate) fn evaluations(&self, span: u16, begins_patch: bool, begins: bool, ends: bool) -> u8 {
        let rounds = 1 + u8::from(self.is_first());
        let of_end = |is_whole: bool| 4 + u8::from(is_whole) * rounds * edge::EVALUATIONS;
        let [start, end] = self.is_whole;
        let at_start = if begins { of_end(start) } else { 0 };
        let at_end = if ends { of_end(end) } else { 0 };
        let of_patch = 2 * u8::from(begins_patch) + 2 * u8::from(begins_patch && span == self.last_span);
        2 + of_patch + at_start + at_end
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
        let is_evaluated = matches!(whole.task, Task::Evaluate | Task::End);
        if at_start && whole.spans == 1 && is_evaluated && half.task == Task::Patch {
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

    /// Whether the first pass is to be looked at again, because its lines were placed far from the step that they showed, or so late that they were not seen
    /// along all of it. They are placed by that step then.
    pub(crate) fn looks_again(&mut self, header: &Header) -> bool {
        if !self.is_first() || self.looked_again {
            return false;
        }
        let Some((step, _)) = self.allowed(header, PassMaximum::NONE) else {
            return false;
        };
        let [half, whole] = &self.lines;
        let is_far = (step - whole.distance).abs() > AGAIN_MIN * whole.distance && !whole.is_at_boundary;
        let are_seen = half.is_seen(self.patches) && whole.is_seen(self.patches);
        if step < f32::INFINITY && (is_far || !are_seen) {
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
