//! Look-ahead over the next pass: stations at equal fractions of each patch, in order, yield the derivatives of the path that its feed is planned
//! from, the interval to the following pass, and the checks that the ball fits and the axes stay within their travel at every station.
//!
//! Stations depend on the surface, not on the samples, so holds and overrides do not change the passes.

mod maximum;
mod pass_plan;
mod short_patch;
mod stations;
mod stretch;
mod turn_search;
mod within;

use crate::fault::{Fault, FaultKind, Result};
use crate::feed::stations::{Derivatives, STATIONS_MAX, Station, Window};
use crate::feed::turn::{self, Turn, TurnEnd};
use crate::feed::{MM_PER_Q10, to_q10};
use crate::job::program::Job;
use crate::job::{AxisLimits, Pattern, Spacing};
use crate::math::number::{Bounded, MM_PER_NM, nm_to_mm, to_f32};
use crate::pass::lines::{self, NextPass, RegionLines};
use crate::pass::patch::Patch;
use crate::pass::route::{Piece, Route};
use crate::pass::schedule;
use crate::pass::step_over::{PassMaximum, StepOverEstimator};
use crate::sample::{SpanParameter, interval_of};
use crate::surface::PathSpeed;
use maximum::LastPlaces;
use pass_plan::PIECE_WORDS;
pub(crate) use pass_plan::PassPlan;
use short_patch::ShortPatch;
use within::WholePass;

/// Length of a cell between kept stations that is short enough, mm.
const CELL_KEPT_MM: f32 = 0.3;
/// Most stations of a pass, and most patches of which both ends are kept.
#[allow(clippy::cast_possible_truncation, reason = "168")]
const STATIONS: u16 = STATIONS_MAX as u16;
const PATCHES: u16 = STATIONS / 2;
/// Least length of a stretch of a pass on a front that does not end at a knot, mm.
const STRETCH_MIN_MM: f32 = 0.6;
/// Most patches of a pass with turns: both ends of each are kept.
const SPANS_TURNED: u16 = (STATIONS - 2 * turn::STATIONS) / 2;

/// The next task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    Patch,
    /// Lengthen the stretch of a pass on a front by a piece, or end it.
    Extend,
    Station,
    /// Evaluate the pass where its interval is least between the stations, so often.
    Maximum(u8),
    /// Compute the derivatives at one of the last stations, by its place in the window, up to another.
    Derivatives(u8, u8),
    /// Run the step-over estimator, with this number of evaluations left at the station.
    Estimate(u8),
    /// Slow the pass down over a short patch.
    SlowDown,
    Close,
    /// Seek the next pass of a region.
    Seek,
    /// Append a station of the half of the turn before the pass.
    Head(u16),
    /// Begin to look at the start of the next pass, at one of its stations.
    Across,
    Start,
    /// Find the turn to the next pass, in rounds.
    Turn(u8),
    /// Bound the turn's speed by a station of each half.
    Bound(u16),
    /// Append a station of the half of the turn after the pass.
    Tail(u16),
    Done,
}

/// What the derivatives along a patch are differences of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum DifferencesOf {
    Positions,
    /// First derivatives, which are known in closed form at each station.
    Directions,
    /// Positions, because directions do not tell the path at cells of any length.
    PositionsAfterAll,
}

/// Cycles of the tasks, by the pessimistic model of `cargo sim budget`.
mod cycles {
    pub(super) use crate::pass::scan::cycles::{ESTIMATE, NEXT, PATCH, STATION};

    /// A station with the direction of the centre's path, and differences of these.
    pub(super) const DIRECTED_STATION: u32 = STATION + 700;
    pub(super) const DIRECTED_DERIVATIVES: u32 = 3_800;
    /// On a front: the first patch of a stretch, a later piece, the search for it, a station.
    pub(super) const FRONT_PATCH: u32 = 5_600;
    pub(super) const PIECE: u32 = 5_000;
    pub(super) const EXTEND: u32 = 3_500;
    pub(super) const FRONT_STATION: u32 = 6_000;
    pub(super) const DERIVATIVES: u32 = 3_400;
    pub(super) const SLOW_DOWN: u32 = 5_000;
    pub(super) const CLOSE: u32 = 1_700;
    pub(super) const HALF: u32 = 1_500;
    pub(super) const BOUND: u32 = 5_000;
    pub(super) const TURN: u32 = 15_000;
}

/// The look-ahead over one pass.
#[derive(Clone, Debug)]
pub(crate) struct Lookahead {
    patch: Patch,
    task: Task,
    /// The piece of the pass that is looked at, and the range of the path span whose stations are counted: the piece's, or on a front that of a stretch of several
    /// pieces in one span, long enough for differences.
    piece: Piece,
    range: [u64; 2],
    /// The first and the last piece of the stretch, and the piece after it.
    stretch: [Piece; 2],
    after: Option<Piece>,
    /// The stretch is too short for derivatives of its own; none was long enough so far.
    is_short: bool,
    has_derivatives: bool,
    /// The surface is smooth where the stretch begins.
    may_join: bool,
    /// Stations before the stretch, or the patch; halvings of its cells, because the path bends; the path turns too far within a cell.
    begun: u16,
    halvings: u8,
    is_coarse: bool,
    /// The stretch is one piece; the path span, and the place in it up to which those of a front are, because it bends.
    by_pieces: bool,
    bends_until: Option<(u16, u64)>,
    /// Stations of the patch are kept at its even cells alone.
    keeps_even: bool,
    /// Least length of a stretch of the pass, mm, and length of the last pass.
    least_mm: f32,
    pass_mm: f32,
    /// Station within the patch, from 0, and patches so far.
    station: u16,
    patches: u16,
    /// Cells of the patch: those between kept stations, those that are looked at for each of them, and all of these, with the fraction of the patch of one.
    kept: u16,
    looks: u16,
    cells: u16,
    cell_fraction: u64,
    /// Cells that are looked at for each between kept stations before any are halved.
    first_looks: u16,
    /// Mean length of a patch of the last pass, mm, or the greatest by the way of the centre around an edge; the greatest of those so far.
    patch_mm: f32,
    centre_mm: f32,
    /// Whether the centre's path bent much more than the contact's on the last pass, and so far; the ball hardly fits into a half of
    /// this patch, or goes around an edge there.
    has_bend: bool,
    bends: bool,
    may_turn: bool,
    differences: DifferencesOf,
    /// Stations are kept wherever derivatives change, not at even parts alone: on a pass of one patch, unless its derivatives are differences of positions and the ball's centre moves
    /// much farther than the contact there, or less.
    adapts: bool,
    /// Whether the curvature jumped at a patch boundary of the last pass, and so far.
    has_jump: bool,
    jumps: bool,
    /// What is continuous if the direction of the tool centre's path is, at the end of the last patch: 1 - r k along the path, r times the twist;
    /// on a front 1 - r k across, too.
    bend: [f32; 3],
    /// Whether it is, from the last patch to this.
    is_smooth: bool,
    speed: PathSpeed,
    window: Window,
    short: ShortPatch,
    /// The inverse limits of acceleration and jerk, and the inverse square and cube of the feed; the place before the window's, if it is not kept; the greatest
    /// derivatives for which there is no room, for the next station.
    per_limit: [[f32; 2]; 3],
    slowest: [f32; 2],
    /// Stations that a straight pass may have, with those of the turn before it.
    most: u16,
    before: Option<Station>,
    missed: Option<Derivatives>,
    /// Arc from the start of the patch, mm, and of the pass to the patch, units of 2^-10 nm.
    arc_mm: f32,
    start_q10: i64,
    maximum: PassMaximum,
    last_places: LastPlaces,
    /// Side parameter of the pass, and whether the pass before is on the same line.
    line: Option<SpanParameter>,
    goes_on: bool,
    /// The turn before the pass; then the one after it, its ends and the length that is tried.
    turn: Turn,
    ends: [TurnEnd; 2],
    length: f32,
    /// Passes for which no turn is tried, because the last one slowed its pass down.
    without: u8,
    /// The rest of a pass is looked at, for its plan alone: what all of it has given.
    whole: Option<WholePass>,
}

impl Lookahead {
    /// No pass yet.
    pub(crate) const START: Self = Self {
        patch: Patch::NONE,
        task: Task::Done,
        piece: Piece::NONE,
        range: [0, u64::MAX],
        stretch: [Piece::NONE; 2],
        after: None,
        is_short: false,
        has_derivatives: false,
        may_join: false,
        begun: 0,
        halvings: 0,
        is_coarse: false,
        by_pieces: false,
        bends_until: None,
        keeps_even: false,
        least_mm: STRETCH_MIN_MM,
        pass_mm: 0.0,
        station: 0,
        patches: 0,
        kept: 1,
        looks: 1,
        cells: 1,
        cell_fraction: 0,
        first_looks: 1,
        patch_mm: 0.0,
        centre_mm: 0.0,
        has_bend: false,
        bends: false,
        may_turn: false,
        differences: DifferencesOf::Positions,
        adapts: false,
        has_jump: false,
        jumps: false,
        bend: [0.0; 3],
        is_smooth: false,
        speed: PathSpeed::STILL,
        window: Window::EMPTY,
        short: ShortPatch::NONE,
        per_limit: [[0.0; 2]; 3],
        slowest: [0.0; 2],
        most: 0,
        before: None,
        missed: None,
        arc_mm: 0.0,
        start_q10: 0,
        maximum: PassMaximum::NONE,
        last_places: LastPlaces::NONE,
        line: None,
        goes_on: false,
        turn: Turn::NONE,
        ends: [TurnEnd::NONE; 2],
        length: 0.0,
        without: 0,
        whole: None,
    };

    /// Resets to the state before the first pass.
    pub(crate) const fn restart(&mut self) {
        self.line = None;
        (self.patch_mm, self.pass_mm) = (0.0, 0.0);
        (self.has_bend, self.has_jump) = (false, false);
        self.without = 0;
        self.whole = None;
        self.task = Task::Done;
    }

    /// Whether every station is located.
    pub(crate) const fn is_done(&self) -> bool {
        matches!(self.task, Task::Done)
    }

    /// Cycles of the next task.
    pub(crate) fn cycles(&self, estimator: Option<&StepOverEstimator>) -> u32 {
        let makes_patch =
            |estimator: &StepOverEstimator| estimator.makes_patch(&self.piece.position, self.fraction());
        match self.task {
            Task::Patch if self.is_on_front() => cycles::FRONT_PATCH,
            Task::Patch => cycles::PATCH,
            Task::Extend => cycles::EXTEND,
            Task::Station if self.is_on_front() && self.is_beyond_piece() => cycles::PIECE,
            Task::Station if self.is_on_front() => cycles::FRONT_STATION,
            Task::Station if self.differences == DifferencesOf::Directions => cycles::DIRECTED_STATION,
            Task::Station | Task::Maximum(_) => cycles::STATION,
            Task::Derivatives(..) if self.differences == DifferencesOf::Directions => {
                cycles::DIRECTED_DERIVATIVES
            }
            Task::Derivatives(..) => cycles::DERIVATIVES,
            Task::Estimate(1..) if estimator.is_some_and(makes_patch) => cycles::PATCH,
            Task::Estimate(0) => cycles::NEXT,
            Task::Estimate(_) => cycles::ESTIMATE,
            Task::SlowDown => cycles::SLOW_DOWN,
            Task::Close => cycles::CLOSE,
            Task::Seek => lines::PORTION_CYCLES,
            Task::Across => cycles::PATCH,
            Task::Start => cycles::STATION,
            Task::Turn(_) => cycles::TURN,
            Task::Head(_) | Task::Tail(_) => cycles::HALF,
            Task::Bound(_) => cycles::BOUND,
            Task::Done => 0,
        }
    }

    /// Begins to look over this pass.
    pub(crate) fn begin(&mut self, pass: u32, route: Route, head: &Turn, out: &mut PassPlan) {
        let goes_on = pass > 0 && self.line == Some(route.side);
        self.line = Some(route.side);
        let has_head = head.exists();
        self.turn = *head;
        self.task = if has_head { Task::Head(0) } else { Task::Patch };
        (self.station, self.patches) = (0, 0);
        (self.halvings, self.is_coarse, self.keeps_even) = (0, false, false);
        (self.by_pieces, self.bends_until) = (false, None);
        self.start_q10 = if has_head { head.half_q10() } else { 0 };
        out.head = if has_head { turn::STATIONS } else { 0 };
        out.head_q10 = self.start_q10;
        out.tail = Turn::NONE;
        out.plan.ends = [head.speed, 0.0];
        // The step-over is that of all passes on the line.
        self.goes_on = goes_on;
        if !goes_on {
            self.maximum = PassMaximum::NONE;
        }
        out.plan.stations.clear();
        out.pass = pass;
        out.route = route;
        out.set_cells(0);
        (self.centre_mm, self.bends, self.jumps) = (0.0, false, false);
        self.short = ShortPatch::NONE;
        (out.point, out.is_tip) = (false, false);
        out.full_pace = 1.0;
        out.next = None;
        out.steps_over = false;
        out.is_last = false;
        out.starts = [0; PIECE_WORDS];
        // Only stretches of a front may be too short for derivatives. The stations before a straight pass are those of its turn.
        self.has_derivatives = !route.is_on_front();
    }

    /// Executes one task.
    ///
    /// # Errors
    /// The fault of the surface at the next station; [`FaultKind::SoftLimit`] where the station is outside the travel.
    #[inline(never)]
    pub(crate) fn work(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        estimator: Option<&mut StepOverEstimator>,
        lines: &mut RegionLines,
        out: &mut PassPlan,
    ) -> Result<()> {
        // The second look at a patch is for the derivatives alone.
        let is_first_look = self.halvings == 0 || self.is_on_front();
        let mut estimator = estimator.filter(|_| self.whole.is_none() && is_first_look);
        self.task = match self.task {
            Task::Patch => self.begin_patch(job, axes, estimator, out)?,
            Task::Extend => self.extend_stretch(job, out),
            Task::Station if self.is_on_front() && self.is_beyond_piece() => {
                let next = out.route.next(job, &self.piece);
                self.piece = next.ok_or(Fault::new(FaultKind::PatchTooShort, 0.0))?;
                self.patch.lay(job, &out.route, &self.piece)?;
                Task::Station
            }
            Task::Station => {
                self.visit(job, axes, estimator.as_deref_mut(), out)?;
                if self.has_maximum(job) {
                    Task::Maximum(maximum::EVALUATIONS)
                } else {
                    self.after_station(job, estimator.as_deref(), out)
                }
            }
            Task::Maximum(left) => {
                if self.see_maximum() && left > 1 {
                    Task::Maximum(left - 1)
                } else {
                    self.after_station(job, estimator.as_deref(), out)
                }
            }
            Task::Derivatives(at, last) => {
                self.differentiate(at, out);
                if at < last {
                    Task::Derivatives(at + 1, last)
                } else {
                    self.estimates(job, estimator.as_deref(), out)
                }
            }
            Task::Estimate(0) => self.next_station(job, out),
            Task::Estimate(looks) => {
                let fraction = self.fraction();
                let most = self.maximum.inv_interval_sq;
                if let Some(estimator) = estimator {
                    estimator.work(job, &self.piece.position, &self.patch, fraction, most);
                }
                Task::Estimate(looks - 1)
            }
            Task::SlowDown => {
                self.slow_down(job, out)?;
                self.next_patch(job, out)
            }
            Task::Close => self.close_pass(job, axes, estimator, lines, out)?,
            Task::Seek => self.seek_next(job, axes, estimator.as_deref(), lines, out)?,
            Task::Head(index) => {
                self.push_half(true, index, out);
                if index + 1 < turn::STATIONS {
                    Task::Head(index + 1)
                } else {
                    Task::Patch
                }
            }
            Task::Across => self.look_across(job, out),
            Task::Start => self.visit_start(job, axes),
            Task::Turn(round) => self.find_turn(job, axes, round),
            Task::Bound(index) => self.bound_turn(job, axes, index, out),
            Task::Tail(index) => {
                self.push_half(false, index, out);
                if index + 1 < turn::STATIONS {
                    Task::Tail(index + 1)
                } else {
                    out.tail = self.turn;
                    let [start, _] = out.plan.ends;
                    out.plan.ends = [start, self.turn.speed];
                    Task::Done
                }
            }
            Task::Done => Task::Done,
        };
        Ok(())
    }

    fn begin_patch(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        estimator: Option<&mut StepOverEstimator>,
        out: &mut PassPlan,
    ) -> Result<Task> {
        let is_first = self.patches == 0;
        if is_first {
            self.piece = out.route.first(job);
        }
        self.patch.lay(job, &out.route, &self.piece)?;
        self.range = self.piece.range;
        self.last_places = LastPlaces::NONE;
        if is_first {
            self.measure_by(job, axes);
        }
        if self.is_on_front() {
            (self.adapts, self.differences) = (false, DifferencesOf::Directions);
            self.begin_stretch(out)?;
            return Ok(Task::Extend);
        }
        self.may_join = false;
        out.point |= self.patch.point;
        if let Some(estimator) = estimator {
            if is_first && self.goes_on {
                estimator.go_on(job, &out.route);
            } else if is_first {
                estimator.begin(job, &out.route);
            }
            estimator.begin_patch();
        }
        self.choose_cells(job, out);
        Ok(Task::Station)
    }

    /// After the last patch: looks again at the whole pass, or chooses the next pass and the link to it.
    fn close_pass(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        mut estimator: Option<&mut StepOverEstimator>,
        lines: &mut RegionLines,
        out: &mut PassPlan,
    ) -> Result<Task> {
        if let Some(whole) = self.whole {
            self.close_within(&whole, out);
            return Ok(self.choose_link(job, axes, None, out));
        }
        if !self.goes_on && looks_again(job, estimator.as_deref_mut()) {
            let (pass, route, head) = (out.pass, out.route, self.turn);
            self.line = None;
            self.begin(pass, route, &head, out);
            return Ok(self.task);
        }
        let rows = estimator.as_deref().map(|estimator| *estimator.rows());
        Ok(if self.close(job, estimator, lines, out)? {
            self.choose_link(job, axes, rows.as_ref(), out)
        } else {
            Task::Seek
        })
    }

    /// Seeks the next line of a region, in portions.
    fn seek_next(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        estimator: Option<&StepOverEstimator>,
        lines: &mut RegionLines,
        out: &mut PassPlan,
    ) -> Result<Task> {
        Ok(match lines.seek(job, out.pass)? {
            NextPass::Sought => Task::Seek,
            NextPass::Found => {
                out.next = lines.next_route(job.header);
                let rows = estimator.map(StepOverEstimator::rows);
                let is_joined = |route: &Route| lines.joins(job.header, &out.route, route, rows);
                out.steps_over = job.header.pattern == Pattern::Zigzag
                    && !out.is_tip
                    && out.next.as_ref().is_some_and(is_joined);
                self.choose_link(job, axes, rows, out)
            }
            NextPass::None => self.choose_link(job, axes, None, out),
        })
    }

    /// Pass, path and side parameter of the station.
    pub(crate) fn surface_position(&self, out: &PassPlan) -> (u32, SpanParameter, SpanParameter) {
        let fraction = self.fraction();
        let path = SpanParameter {
            span: self.piece.position.span,
            fraction: out.route.turned(fraction),
        };
        (out.pass, path, self.patch.side_at(&self.piece.position, fraction))
    }

    const fn is_on_front(&self) -> bool {
        self.piece.front.is_some()
    }

    /// Whether the station is on a later piece.
    const fn is_beyond_piece(&self) -> bool {
        self.fraction() > self.piece.end()
    }

    const fn is_end(&self) -> bool {
        self.station >= self.cells
    }

    const fn fraction(&self) -> u64 {
        let [start, end] = self.range;
        if self.is_end() {
            return end;
        }
        start + self.station as u64 * self.cell_fraction
    }

    /// Advances to the next station, the next patch, or the end.
    fn next_station(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Task {
        if !self.is_end() {
            self.station += 1;
            return Task::Station;
        }
        if let Some(again) = self.looks_finer(out) {
            return again;
        }
        if self.slows_down(job, out) {
            Task::SlowDown
        } else {
            self.next_patch(job, out)
        }
    }

    fn next_patch(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        self.start_q10 += to_q10(self.arc_mm);
        let next = if self.is_on_front() {
            self.after
        } else {
            out.route.next(job, &self.piece)
        };
        match next {
            Some(piece) => {
                self.piece = piece;
                self.station = 0;
                self.patches += 1;
                Task::Patch
            }
            None => Task::Close,
        }
    }

    /// Number of patches of the pass, or of stretches of one on a front; parts of patches count as such.
    fn patches_of(&self, route: &Route) -> f32 {
        if route.is_on_front() {
            f32::from(self.patches.saturating_add(1))
        } else {
            route.spans()
        }
    }

    /// Computes the interval and the next pass; returns whether that is known, and not to be sought in a region.
    fn close(
        &mut self,
        job: &Job<'_>,
        mut estimator: Option<&mut StepOverEstimator>,
        lines: &mut RegionLines,
        out: &mut PassPlan,
    ) -> Result<bool> {
        self.pass_mm = to_f32(self.start_q10 - out.head_q10) * MM_PER_Q10;
        self.patch_mm = (self.pass_mm / self.patches_of(&out.route)).at_least(self.centre_mm);
        (self.has_bend, self.has_jump) = (self.bends, self.jumps);
        let header = job.header;
        out.interval = interval_of(self.maximum.inv_interval_sq);
        if let Some(route) = lines.next_route(header) {
            out.next = Some(route);
            return Ok(true);
        }
        let step = match header.spacing {
            Spacing::Exact | Spacing::ExactToPoint => {
                let estimator = estimator.as_deref_mut();
                estimator.map_or(out.interval, |estimator| estimator.step(header, self.maximum))
            }
            Spacing::FirstOrder => out.interval,
            Spacing::Constant | Spacing::ConstantFromMiddle | Spacing::ConstantFromEnd => {
                self.finish_short(out);
                return Ok(true);
            }
        };
        let step = if out.point && header.spacing.is_exact() {
            schedule::from_point(step)
        } else {
            step
        };
        if header.edges > 0 {
            let rows = estimator.as_deref().map(StepOverEstimator::rows);
            return Ok(!lines.go_on(job, step, rows)?);
        }
        if !schedule::is_last(out.route.side, header.side_spans) {
            let step = schedule::to_point(header, step, out.route.side, |span| job.side_width(span));
            let side = match estimator {
                Some(estimator) => estimator.next_side(job, out.route.side, step)?,
                None => out.route.side,
            };
            out.next = Some(Route::of_pass(header, out.pass.wrapping_add(1), side));
            out.steps_over = header.pattern == Pattern::Zigzag && !out.is_tip;
        }
        Ok(true)
    }
}

/// Whether the first pass is to be looked at again for the step-over.
fn looks_again(job: &Job<'_>, estimator: Option<&mut StepOverEstimator>) -> bool {
    let estimator = estimator.filter(|_| job.header.spacing.is_exact());
    estimator.is_some_and(|estimator| estimator.looks_again(job.header))
}

/// Stations that a pass may have: in a job with turns there is room for their halves.
fn stations_of(job: &Job<'_>) -> u16 {
    if has_turns(job) {
        STATIONS - 2 * turn::STATIONS
    } else {
        STATIONS
    }
}

/// Whether the passes of a job may be joined by turns.
pub(crate) fn has_turns(job: &Job<'_>) -> bool {
    let overruns = job.header.axes.is_some_and(|axes| axes.overrun_mm > 0.0);
    overruns && job.header.pattern == Pattern::Zigzag && job.header.path_spans <= SPANS_TURNED
}

/// Where the tangent plane jumps at a knot, so does the ball's centre: `sides` are its places on both.
///
/// # Errors
/// [`FaultKind::DegenerateSurface`] with the value 0 where an axis would be faster than its limit in the period that crosses the knot.
pub(crate) fn check_crease(job: &Job<'_>, axes: &AxisLimits, sides: [&[i32; 3]; 2]) -> Result<()> {
    let [before, after] = sides;
    for ((before, after), velocity) in before.iter().zip(after).zip(&axes.velocity_mm_s) {
        let apart_mm = to_f32(i64::from(*after) - i64::from(*before)) * MM_PER_NM;
        if apart_mm.abs() > velocity * job.header.period_s {
            return Err(Fault::new(FaultKind::DegenerateSurface, 0.0));
        }
    }
    Ok(())
}

/// # Errors
/// [`FaultKind::SoftLimit`] with the distance outside of the travel, mm.
pub(crate) fn check_travel(axes: &AxisLimits, place_nm: &[i32; 3]) -> Result<()> {
    for (place, [least, most]) in place_nm.iter().zip(&axes.travel_nm) {
        let outside = (i64::from(*least) - i64::from(*place)).max(i64::from(*place) - i64::from(*most));
        if outside > 0 {
            let outside = i32::try_from(outside).unwrap_or(i32::MAX);
            return Err(Fault::new(FaultKind::SoftLimit, nm_to_mm(outside)));
        }
    }
    Ok(())
}
