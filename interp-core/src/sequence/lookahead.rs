//! Look-ahead over the next pass: stations at equal fractions of each patch, in order, yield the derivatives of the path that its feed is planned
//! from, the interval to the following pass, and the checks that the ball fits and the axes stay within their travel at every station.
//!
//! Stations depend on the surface, not on the samples, so holds and overrides do not change the passes.

use crate::fault::{Fault, FaultKind, Result};
use crate::feed::limits::MotionLimits;
use crate::feed::plan::Plan;
use crate::feed::stations::{Derivatives, STATIONS_MAX, Station, WINDOW, Window};
use crate::feed::turn::{self, Turn, TurnEnd};
use crate::feed::{MM_PER_Q10, Q10_BITS, to_q10};
use crate::job::program::Job;
use crate::job::{AxisLimits, Pattern, Spacing, SurfaceKind};
use crate::math::arith::{fraction_to_f32, sqrt, truncated};
use crate::math::number::{Bounded, MM_PER_NM, nm_to_mm, to_f32};
use crate::pass::lines::{self, NextPass, RegionLines};
use crate::pass::patch::Patch;
use crate::pass::route::{Piece, Route};
use crate::pass::schedule;
use crate::pass::step_over::{PassMaximum, StepOverEstimator};
use crate::sample::{SpanParameter, interval_of};
use crate::sequence::link::{Along, BoundaryEnd};
use crate::surface::{Contact, PathSpeed};

/// Least length of a cell, mm: a shorter one has differences of rounded positions.
const CELL_MIN_MM: f32 = 0.15;
/// Length of a cell between kept stations that is short enough, mm.
const CELL_KEPT_MM: f32 = 0.3;
/// Length of a cell that derivatives are good to, mm, and fewest cells for them: a patch has its own second derivative.
const CELL_FINE_MM: f32 = 0.25;
const CELLS_FINE: u16 = 4;
/// Most cells that are looked at for one between kept stations.
const LOOKS_MAX: u16 = 32;
/// Cells between kept stations of a patch that are fine as they are.
const CELLS_MANY: u16 = 8;
/// Change of 1 - r k from patch to patch below which it is rounding of single precision.
const NO_JUMP: f32 = 4e-6;
/// Most stations of a pass, and most patches of which both ends are kept.
const STATIONS: u16 = 168;
const PATCHES: u16 = STATIONS / 2;
/// Relative difference of the two-point and the three-point rule of a cell's arc from which on the latter is taken, and up to which: below is rounding, above
/// neither is trusted.
const ARC_NOISE: f32 = 1e-6;
const ARC_APART: f32 = 1.0 / 16.0;
/// Words of a bit for each piece of a pass on a front: intervals between stations, and as many crossings of knots; a stretch beyond begins without its arc noted.
const PIECE_WORDS: usize = 20;
/// Least length of a stretch of a pass on a front, mm, and of one that ends at a knot; shorter ones have no derivatives of their own.
const STRETCH_MIN_MM: f32 = 0.6;
const STRETCH_KNOT_MM: f32 = 0.3;
const STRETCH_SHORT_MM: f32 = 0.2;
/// Greatest distance of two passes between which the tool stays on the boundary, mm, in a job of constant scallop height.
const BESIDE_MM: f32 = 6.0;
/// Most path spans of a pass on a front that are divided into stretches.
const SPANS_DIVIDED: u16 = 60;
const _: () = assert!(STATIONS as usize == STATIONS_MAX);
/// Most patches of a pass with turns: both ends of each are kept.
const SPANS_TURNED: u16 = (STATIONS - 2 * turn::STATIONS) / 2;

/// The plan of one pass: its feed, its ends, and the pass after it.
#[derive(Clone, Debug)]
pub(crate) struct PassPlan {
    pub(crate) plan: Plan,
    pub(crate) pass: u32,
    pub(crate) route: Route,
    /// Cells of a patch (on a front: of a stretch) between kept stations, 0 before the first patch, and the fraction of the patch per cell.
    cells: u16,
    cell_fraction: u64,
    /// Patches of a group: where a pass has more than [`PATCHES`], the ends of groups are kept, with the greatest derivatives within them.
    group: u16,
    /// The pass is a single point.
    pub(crate) point: bool,
    /// The pace at the programmed feed.
    full_pace: f32,
    /// Cutter location at start and end, nm, and whether the surface faces up there.
    pub(crate) ends: [[i32; 3]; 2],
    pub(crate) faces_up: [bool; 2],
    /// Side parameter at start and end.
    pub(crate) sides: [SpanParameter; 2],
    /// Of a pass on a front, a bit for each piece with which a stretch begins.
    starts: [u32; PIECE_WORDS],
    /// Minimum interval of the pass.
    pub(crate) interval: f32,
    /// The pass after this one, where that is known from the pass alone, and whether a step-over on the surface leads there: along the boundary where both end.
    pub(crate) next: Option<Route>,
    pub(crate) steps_over: bool,
    /// There is no pass after this one.
    pub(crate) is_last: bool,
    /// Stations of half the turn before the pass, and its length, units of 2^-10 nm.
    head: u16,
    pub(crate) head_q10: i64,
    /// The turn to the next pass, if there is one, and the arc at which it begins, units of 2^-10 nm.
    pub(crate) tail: Turn,
    pub(crate) tail_q10: i64,
}

impl PassPlan {
    /// No plan.
    pub(crate) const NONE: Self = Self {
        plan: Plan::NONE,
        pass: 0,
        route: Route::NONE,
        cells: 0,
        cell_fraction: 0,
        group: 1,
        point: false,
        full_pace: 1.0,
        ends: [[0; 3]; 2],
        faces_up: [false; 2],
        sides: [SpanParameter { span: 0, fraction: 0 }; 2],
        starts: [0; PIECE_WORDS],
        interval: 0.0,
        next: None,
        steps_over: false,
        is_last: false,
        head: 0,
        head_q10: 0,
        tail: Turn::NONE,
        tail_q10: 0,
    };

    /// Cells of a patch between kept stations, and the fraction of the patch per cell.
    pub(crate) const fn kept_cells(&self) -> (u16, u64) {
        (self.cells, self.cell_fraction)
    }

    /// The pace at a feed factor, 0 to 1.
    pub(crate) fn pace(&self, feed_factor: f32) -> f32 {
        (feed_factor * self.full_pace).at_most(1.0)
    }

    /// Sets the limits that it is planned for.
    pub(crate) fn set_limits(&mut self, job: &Job<'_>, limits: MotionLimits) {
        self.full_pace = job.header.feed_mm_s / limits.feed;
        self.plan.limits = limits;
    }

    /// Arc at the start of a cell between kept stations, units of 2^-10 nm, by the number of the patch from the start of the pass and of the cell
    /// within the patch.
    pub(crate) fn arc_q10(&self, [patch, within]: [u16; 2]) -> Option<i64> {
        let group = patch.checked_div(self.group)?;
        if group * self.group != patch {
            return None;
        }
        let station = self.head + group * (self.cells + 1) + within;
        Some(i64::from(self.plan.stations.get(station).arc_nm) << Q10_BITS)
    }
}

impl PassPlan {
    /// Arc at the start of a piece of a pass on a front, units of 2^-10 nm, if a stretch begins with it.
    pub(crate) fn arc_at_piece_q10(&self, number: u16) -> Option<i64> {
        let (word, bit) = (usize::from(number >> 5), number & 31);
        let starts = *self.starts.get(word)?;
        if starts >> bit & 1 == 0 {
            return None;
        }
        let mut index = (starts & ((1 << bit) - 1)).count_ones();
        for starts in self.starts.iter().take(word) {
            index += starts.count_ones();
        }
        let station = u16::try_from(index).ok()?.saturating_mul(self.cells + 1);
        Some(i64::from(self.plan.stations.get(station).arc_nm) << Q10_BITS)
    }

    /// The start of the pass.
    pub(crate) const fn start(&self) -> BoundaryEnd {
        let ([path, _], [side, _]) = (self.route.ends, self.sides);
        BoundaryEnd { path, side }
    }

    /// The end of the pass.
    pub(crate) const fn end(&self) -> BoundaryEnd {
        let ([_, path], [_, side]) = (self.route.ends, self.sides);
        BoundaryEnd { path, side }
    }

    /// The parameter that changes along the boundary that the pass ends on.
    pub(crate) fn end_boundary(&self, _job: &Job<'_>) -> Along {
        match self.route.front {
            Some(front) if front.are_on_boundary[1] => Along::Path,
            _ => Along::Side,
        }
    }

    /// Whether the next pass begins on the boundary that this one ends on, near that end.
    pub(crate) fn is_beside(&self, next: &Self, job: &Job<'_>) -> bool {
        let (end, start) = (self.end(), next.start());
        let is_on_it = match self.end_boundary(job) {
            Along::Path => start.side == end.side,
            Along::Side => start.path == end.path,
        };
        let mut square = 0.0;
        for (from, to) in self.ends[1].iter().zip(&next.ends[0]) {
            let mm = to_f32(i64::from(*to) - i64::from(*from)) * MM_PER_NM;
            square += mm * mm;
        }
        is_on_it && square <= BESIDE_MM * BESIDE_MM
    }

    /// Notes the piece with which a stretch begins.
    fn note_stretch(&mut self, number: u16) {
        if let Some(starts) = self.starts.get_mut(usize::from(number >> 5)) {
            *starts |= 1 << (number & 31);
        }
    }
}

/// The next task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    Patch,
    /// Lengthen the stretch of a pass on a front by a piece, or end it.
    Extend,
    Station,
    /// Compute the derivatives at one of the last stations, by its place in the window, up to another.
    Derivatives(u8, u8),
    /// Run the step-over estimator, with this number of evaluations left at the station.
    Estimate(u8),
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
    /// Append a station of the half of the turn behind the pass.
    Tail(u16),
    Done,
}

/// Cycles of the tasks, by the pessimistic model of `cargo sim budget`.
mod cycles {
    pub(super) use crate::pass::scan::cycles::{ESTIMATE, NEXT, PATCH, STATION};

    /// On a front: the first patch of a stretch, a later piece, the search for it, a station.
    pub(super) const FRONT_PATCH: u32 = 5_600;
    pub(super) const PIECE: u32 = 5_000;
    pub(super) const EXTEND: u32 = 3_500;
    pub(super) const FRONT_STATION: u32 = 4_800;
    pub(super) const DERIVATIVES: u32 = 3_400;
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
    /// Least length of a stretch of the pass, mm, and length of the last pass.
    least_mm: f32,
    pass_mm: f32,
    /// Station within the patch, from 0, and patches so far.
    station: u16,
    patches: u16,
    /// Cells of the patch that are looked at: for each of those between kept stations, and all of them, with the fraction of the patch of one.
    looks: u16,
    cells: u16,
    cell_fraction: u64,
    /// Mean length of a patch of the last pass, mm.
    patch_mm: f32,
    /// What is continuous if the direction of the tool centre's path is, at the end of the last patch: 1 - r k along the path, r times the twist;
    /// on a front 1 - r k across, too.
    bend: [f32; 3],
    /// Whether it is, from the last patch to this.
    is_smooth: bool,
    speed: PathSpeed,
    window: Window,
    /// Arc from the start of the patch, mm, and of the pass to the patch, units of 2^-10 nm.
    arc_mm: f32,
    start_q10: i64,
    maximum: PassMaximum,
    /// Side parameter of the pass, and whether the pass before is on the same line.
    line: Option<SpanParameter>,
    goes_on: bool,
    /// The turn before the pass; then the one behind it, its ends and the length that is tried.
    turn: Turn,
    ends: [TurnEnd; 2],
    length: f32,
    /// Passes for which no turn is tried, because the last one slowed its pass down.
    without: u8,
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
        least_mm: STRETCH_MIN_MM,
        pass_mm: 0.0,
        station: 0,
        patches: 0,
        looks: 1,
        cells: 1,
        cell_fraction: 0,
        patch_mm: 0.0,
        bend: [0.0; 3],
        is_smooth: false,
        speed: PathSpeed::STILL,
        window: Window::EMPTY,
        arc_mm: 0.0,
        start_q10: 0,
        maximum: PassMaximum::NONE,
        line: None,
        goes_on: false,
        turn: Turn::NONE,
        ends: [TurnEnd::NONE; 2],
        length: 0.0,
        without: 0,
    };

    /// Resets to the state before the first pass.
    pub(crate) const fn restart(&mut self) {
        self.line = None;
        (self.patch_mm, self.pass_mm) = (0.0, 0.0);
        self.without = 0;
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
            Task::Station => cycles::STATION,
            Task::Derivatives(..) => cycles::DERIVATIVES,
            Task::Estimate(1..) if estimator.is_some_and(makes_patch) => cycles::PATCH,
            Task::Estimate(0) => cycles::NEXT,
            Task::Estimate(_) => cycles::ESTIMATE,
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
        out.cells = 0;
        out.point = false;
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
        mut estimator: Option<&mut StepOverEstimator>,
        lines: &mut RegionLines,
        out: &mut PassPlan,
    ) -> Result<()> {
        self.task = match self.task {
            Task::Patch => {
                let first = self.patches == 0;
                if first {
                    self.piece = out.route.first(job);
                }
                self.patch.lay(job, &out.route, &self.piece)?;
                self.range = self.piece.range;
                if self.is_on_front() {
                    self.begin_stretch(out)?;
                    self.task = Task::Extend;
                    return Ok(());
                }
                out.point |= self.patch.point;
                if let Some(estimator) = estimator {
                    if first && self.goes_on {
                        estimator.go_on(job, &out.route);
                    } else if first {
                        estimator.begin(job, &out.route);
                    }
                    estimator.begin_patch();
                }
                self.choose_cells(job, out);
                self.window = Window::EMPTY;
                self.arc_mm = 0.0;
                Task::Station
            }
            Task::Extend => self.extend_stretch(job, out),
            Task::Station if self.is_on_front() && self.is_beyond_piece() => {
                let next = out.route.next(job, &self.piece);
                self.piece = next.ok_or(Fault::new(FaultKind::PatchTooShort, 0.0))?;
                self.patch.lay(job, &out.route, &self.piece)?;
                Task::Station
            }
            Task::Station => {
                self.visit(job, axes, estimator.as_deref_mut(), out)?;
                self.after_station(job, estimator.as_deref(), out)
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
            Task::Close => {
                if !self.goes_on && looks_again(job, estimator.as_deref_mut()) {
                    let (pass, route, head) = (out.pass, out.route, self.turn);
                    self.line = None;
                    self.begin(pass, route, &head, out);
                    return Ok(());
                }
                if self.close(job, estimator, lines, out)? {
                    self.choose_link(job, axes, out)
                } else {
                    Task::Seek
                }
            }
            Task::Seek => match lines.seek(job, out.pass)? {
                NextPass::Sought => Task::Seek,
                NextPass::Found => {
                    out.next = lines.take(job.header);
                    let is_joined = |route: &Route| lines.joins(job.header, &out.route, route);
                    out.steps_over =
                        job.header.pattern == Pattern::Zigzag && out.next.as_ref().is_some_and(is_joined);
                    self.choose_link(job, axes, out)
                }
                NextPass::None => self.choose_link(job, axes, out),
            },
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

    /// Length of a part of the path span on this patch, roughly, mm; 0 where it is not known.
    fn part_mm(&self, part: u64) -> f32 {
        let length = fraction_to_f32(part) / self.speed.inv_speed;
        if length.is_finite() { length } else { 0.0 }
    }

    /// Begins a stretch of a pass on a front.
    fn begin_stretch(&mut self, out: &mut PassPlan) -> Result<()> {
        let PathSpeed {
            inv_speed,
            log_speed_derivative,
        } = self.patch.start().checked()?;
        self.speed = PathSpeed {
            inv_speed: inv_speed * self.patch.per_mm,
            log_speed_derivative,
        };
        self.stretch = [self.piece; 2];
        if self.patches > 0 {
            return Ok(());
        }
        let [start, end] = out.route.ends;
        let spans = start.span.abs_diff(end.span) + 1;
        let pieces = out.route.front.map_or(1, |front| front.pieces);
        out.group = if spans > SPANS_DIVIDED {
            spans.div_ceil(PATCHES)
        } else {
            1
        };
        let room = PATCHES.saturating_sub(SPANS_DIVIDED.min(spans)).saturating_sub(8);
        self.least_mm = if spans > SPANS_DIVIDED {
            f32::MAX
        } else if pieces + 4 <= PATCHES {
            STRETCH_MIN_MM
        } else {
            (self.pass_mm / f32::from(room)).at_least(STRETCH_MIN_MM)
        };
        let expected = pieces.min(PATCHES - 4) + 4;
        let fit = STATIONS
            .checked_div(expected)
            .unwrap_or(1)
            .saturating_sub(1)
            .max(1);
        let kept = u16::try_from(truncated(self.least_mm / CELL_KEPT_MM)).unwrap_or(u16::MAX);
        out.cells = kept.clamp(1, fit);
        if out.group > 1 {
            out.cells = 1;
        }
        Ok(())
    }

    /// Lengthens the stretch by a piece, or ends it.
    fn extend_stretch(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Task {
        let [first, last] = self.stretch;
        self.after = out.route.next(job, &last);
        let span = first.position.span;
        if let Some(next) = self.after.filter(|next| next.position.span == span)
            && !self.is_long_enough(&last, out)
        {
            self.stretch = [first, next];
            self.range = [self.range[0], next.end()];
            return Task::Extend;
        }
        if let Some(front) = first.front.filter(|_| self.patches.is_multiple_of(out.group)) {
            out.note_stretch(front.number);
        }
        let [start, end] = self.range;
        let length = self.part_mm(end.saturating_sub(start));
        let whole = |value: f32| u16::try_from(truncated(value)).unwrap_or(u16::MAX);
        let fine = whole(length / CELL_FINE_MM).max(CELLS_FINE);
        let most = whole(length / CELL_MIN_MM).max(2);
        self.is_short = length < STRETCH_SHORT_MM;
        self.looks = if self.is_short {
            1
        } else {
            fine.min(most).div_ceil(out.cells.max(1)).clamp(1, LOOKS_MAX)
        };
        self.cells = out.cells * self.looks;
        let part = end.saturating_sub(start).checked_div(u64::from(self.cells));
        self.cell_fraction = part.unwrap_or(u64::MAX);
        if !self.is_short {
            out.plan.stations.note_spacing(length / f32::from(self.cells));
        }
        self.window = Window::EMPTY;
        self.arc_mm = 0.0;
        self.station = 0;
        Task::Station
    }

    /// Whether the stretch that ends with this piece has the length for differences, and leaves it to the rest of the span.
    fn is_long_enough(&self, last: &Piece, out: &PassPlan) -> bool {
        let [start, end] = self.range;
        let [_, pass_end] = out.route.ends;
        let span = last.position.span;
        let span_end = if span == pass_end.span {
            out.route.turned(pass_end.fraction)
        } else {
            u64::MAX
        };
        let at_knot = last.front.is_some_and(|front| front.is_at_knot());
        let least = if at_knot {
            self.least_mm.at_most(STRETCH_KNOT_MM)
        } else {
            self.least_mm
        };
        // Each span that is left takes a stretch.
        let spans = span.abs_diff(pass_end.span) + 2;
        let taken = (self.patches + spans).saturating_mul(out.cells + 1);
        self.least_mm < f32::MAX
            && taken < STATIONS
            && self.part_mm(end.saturating_sub(start)) >= least
            && self.part_mm(span_end.saturating_sub(end)) >= STRETCH_KNOT_MM
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

    /// Chooses the cells of a patch: those between kept stations by the number of patches and their length, the same for the whole pass; those
    /// that are looked at by the length of this patch.
    fn choose_cells(&mut self, job: &Job<'_>, out: &mut PassPlan) {
        let spans = job.header.path_spans.max(1);
        let whole = |value: f32| u16::try_from(truncated(value)).unwrap_or(u16::MAX);
        let whole_part = self.piece.end().saturating_sub(self.piece.start());
        let part = |cells: u16| whole_part.checked_div(u64::from(cells)).unwrap_or(u64::MAX);
        let length = self.patch_length();
        if out.cells == 0 {
            let [start, end] = out.route.ends;
            let spans = if job.header.edges > 0 {
                start.span.abs_diff(end.span).saturating_add(1)
            } else {
                spans
            };
            let fit = stations_of(job)
                .checked_div(spans)
                .unwrap_or(1)
                .saturating_sub(1)
                .max(1);
            let mean = if job.header.edges > 0 || job.header.spacing.is_constant() {
                // The last pass may have been one of a small part of the patch, or short stretches of a front.
                if spans > 1 {
                    self.patch_mm.at_least(length)
                } else {
                    length
                }
            } else if self.patch_mm > 0.0 {
                self.patch_mm
            } else {
                length
            };
            out.cells = whole(mean / CELL_KEPT_MM).clamp(1, fit);
            if spans == 1 {
                // A place between the rests.
                out.cells = out.cells.max(2);
            }
            out.cell_fraction = u64::MAX.checked_div(u64::from(out.cells)).unwrap_or(u64::MAX);
            out.group = spans.div_ceil(PATCHES);
        }
        let fine = whole(length / CELL_FINE_MM).max(CELLS_FINE);
        let most = whole(length / CELL_MIN_MM).max(2);
        self.looks = if out.cells >= CELLS_MANY {
            1
        } else {
            fine.min(most).div_ceil(out.cells.max(1)).clamp(1, LOOKS_MAX)
        };
        self.cells = out.cells * self.looks;
        self.cell_fraction = part(self.cells);
        out.plan.stations.note_spacing(length / f32::from(self.cells));
    }

    /// Length of the patch, roughly, mm; 0 where its surface is not evaluated.
    fn patch_length(&self) -> f32 {
        let at = |fraction| self.patch.evaluate_on_line(fraction).map(|located| located.cc_nm);
        let [start, end] = self.piece.range;
        let middle = start + end.saturating_sub(start).div_ceil(2);
        let (Ok(start), Ok(middle), Ok(end)) = (at(start), at(middle), at(end)) else {
            return 0.0;
        };
        let apart = |from: &[i32; 3], to: &[i32; 3]| {
            let mut sum = 0.0;
            for (from, to) in from.iter().zip(to) {
                let mm = to_f32(i64::from(*to) - i64::from(*from)) * MM_PER_NM;
                sum += mm * mm;
            }
            sqrt(sum)
        };
        apart(&start, &middle) + apart(&middle, &end)
    }

    /// The derivatives that can be taken after a station.
    fn after_station(&self, job: &Job<'_>, estimator: Option<&StepOverEstimator>, out: &PassPlan) -> Task {
        if out.point || (self.is_on_front() && self.is_short) {
            return self.estimates(job, estimator, out);
        }
        let is_end = self.is_end();
        let count = self.window.count();
        let last = count.saturating_sub(1);
        let middle = WINDOW / 2;
        // Where the window is full for the first time, also those before its middle; at the patch's end also those behind it.
        let from = if usize::from(self.station) + 1 == count {
            0
        } else {
            middle
        };
        let to = if is_end { last } else { middle };
        if count < WINDOW && !is_end {
            return self.estimates(job, estimator, out);
        }
        match (u8::try_from(from), u8::try_from(to)) {
            (Ok(from), Ok(to)) => Task::Derivatives(from, to),
            _ => self.estimates(job, estimator, out),
        }
    }

    /// Stores the derivatives at a place of the window, if its station is kept or belongs to a group.
    fn differentiate(&mut self, at: u8, out: &mut PassPlan) {
        let behind = self.window.count().saturating_sub(1 + usize::from(at));
        let station = self.station.saturating_sub(u16::try_from(behind).unwrap_or(0));
        let looks = self.looks.max(1);
        let (kept, rest) = (station / looks, station % looks);
        let stations = &mut out.plan.stations;
        if out.group > 1 {
            let q = self.window.derivatives(usize::from(at));
            let begins = station == 0 && self.patches.is_multiple_of(out.group);
            for back in [1, 2] {
                if let Some(place) = stations.back_mut(back) {
                    widen(&mut place.q, &q, begins || back == 1);
                }
            }
        } else if rest == 0 {
            let back = self.station / looks - kept + 1;
            if let Some(place) = stations.back_mut(back) {
                // The direction at the start of a patch is that at the end of the last, where it is known not to jump.
                let direction = place.q;
                place.q = self.window.derivatives(usize::from(at));
                if station == 0 && self.is_smooth && self.has_derivatives {
                    for (q, direction) in place.q.iter_mut().zip(&direction) {
                        q[0] = direction[0];
                    }
                }
                if !self.has_derivatives {
                    // Those before were too short for derivatives of their own.
                    self.has_derivatives = true;
                    let q = place.q;
                    for before in back..=stations.count() {
                        if let Some(place) = stations.back_mut(before) {
                            place.q = q;
                        }
                    }
                }
            }
        }
    }

    /// Evaluations of the step-over estimator at a station.
    fn estimates(&self, job: &Job<'_>, estimator: Option<&StepOverEstimator>, out: &PassPlan) -> Task {
        let first = self.station == 0;
        let begins = first && self.patches == 0;
        let ends = self.is_end() && out.route.next(job, &self.piece).is_none();
        let estimator = estimator.filter(|_| job.header.spacing == Spacing::Exact);
        Task::Estimate(estimator.map_or(0, |estimator| estimator.evaluations(first, begins, ends)))
    }

    /// Advances to the next station, the next patch, or the end.
    fn next_station(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        if !self.is_end() {
            self.station += 1;
            return Task::Station;
        }
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

    /// Evaluates the station: fit of the ball, travel, inverse square interval, arc.
    fn visit(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        estimator: Option<&mut StepOverEstimator>,
        out: &mut PassPlan,
    ) -> Result<()> {
        let fraction = self.fraction();
        let (contact, located) = self.patch.evaluate(fraction)?;
        check_travel(axes, &located.cl_nm)?;
        check_height(axes, &located.cl_nm)?;
        let inv_interval_sq = self.patch.interval.inv_interval_sq(&contact);
        if inv_interval_sq > self.maximum.inv_interval_sq {
            self.maximum = PassMaximum {
                inv_interval_sq,
                shape: [contact.across, contact.lateral_squared],
            };
        }
        if let Some(estimator) = estimator {
            estimator.see(job, &self.patch, &contact, fraction);
        }
        let side = self.patch.side_at(&self.piece.position, fraction);
        let is_up = self.patch.faces_up(contact.offset);
        if (self.patches == 0 && self.station == 0) || out.point {
            (out.ends, out.faces_up, out.sides) = ([located.cl_nm; 2], [is_up; 2], [side; 2]);
        }
        (out.ends[1], out.faces_up[1], out.sides[1]) = (located.cl_nm, is_up, side);
        if out.point {
            return Ok(());
        }
        let path = self.speed_of(&contact);
        if self.station > 0 {
            self.arc_mm += self.cell_length(job, &path);
        }
        let twist = if contact.lateral_squared > 0.0 {
            sqrt((contact.twist_squared / contact.lateral_squared).at_least(0.0))
        } else {
            0.0
        };
        let across = if self.is_on_front() {
            contact.across / contact.lateral_squared
        } else {
            0.0
        };
        let bend = [contact.along, twist, across];
        if self.station == 0 {
            let apart = |(from, to): (&f32, &f32)| (to - from).abs() > NO_JUMP;
            self.is_smooth = self.patches > 0 && !self.bend.iter().zip(&bend).any(apart);
        }
        self.bend = bend;
        self.speed = path;
        self.window.push(located.cl_nm, self.arc_mm);
        self.keep(out);
        Ok(())
    }

    /// Appends the station to the plan's if it is kept, with the last one's derivatives until its own are taken.
    fn keep(&self, out: &mut PassPlan) {
        let arc_q10 = self.start_q10 + to_q10(self.arc_mm);
        let stations = &mut out.plan.stations;
        let arc_nm = u32::try_from((arc_q10 + (1 << (Q10_BITS - 1))) >> Q10_BITS).unwrap_or(u32::MAX);
        let q = stations.back_mut(1).map_or([[0.0; 3]; 3], |last| last.q);
        let begins = self.station == 0 && self.patches.is_multiple_of(out.group);
        if out.group > 1 {
            if begins {
                let station = Station {
                    arc_nm,
                    q: [[0.0; 3]; 3],
                };
                stations.push(station);
                stations.push(station);
            } else if let Some(last) = stations.back_mut(1) {
                last.arc_nm = arc_nm;
            }
        } else if self.station.is_multiple_of(self.looks) {
            stations.push(Station { arc_nm, q });
        }
    }

    /// Arc from the last station, mm: Hermite's two-point rule.
    fn cell_length(&self, job: &Job<'_>, path: &PathSpeed) -> f32 {
        let [start, end] = self.range;
        let length = fraction_to_f32(end.saturating_sub(start)) / f32::from(self.cells);
        let (first, last) = (1.0 / self.speed.inv_speed, 1.0 / path.inv_speed);
        let bow = first * self.speed.log_speed_derivative - last * path.log_speed_derivative;
        let two = 0.5 * (first + last) + bow * length * (1.0 / 12.0);
        let units = if job.header.kind == SurfaceKind::Rational {
            length * self.three_point(path, two, length)
        } else {
            length * two
        };
        if self.is_on_front() {
            units
        } else {
            units / self.patch.per_mm
        }
    }

    /// Mean speed of a cell of a rational patch, by Hermite's three-point rule where the two-point one is not enough. The reciprocal of the speed of an arc is a
    /// polynomial, so the middle follows from the ends: half of a quarter arc within 5e-6 of its radius, where two points leave 8e-4.
    fn three_point(&self, path: &PathSpeed, two: f32, length: f32) -> f32 {
        let (from, to) = (self.speed.inv_speed, path.inv_speed);
        let bow = to * path.log_speed_derivative - from * self.speed.log_speed_derivative;
        let inverse = 0.5 * (from + to) + bow * length * (1.0 / 8.0);
        let (first, last) = (1.0 / from, 1.0 / to);
        let rise = first * self.speed.log_speed_derivative - last * path.log_speed_derivative;
        let three = (first + last) * (7.0 / 30.0) + rise * length * (1.0 / 60.0) + 16.0 / 30.0 / inverse;
        // A NaN is rejected too.
        if (three - two).abs() > ARC_NOISE * two && (three - two).abs() < ARC_APART * two {
            three
        } else {
            two
        }
    }

    /// The parametrisation at a station; on a front, where the next station may be on another patch, per mm.
    fn speed_of(&self, contact: &Contact) -> PathSpeed {
        let PathSpeed {
            inv_speed,
            log_speed_derivative,
        } = contact.path;
        PathSpeed {
            inv_speed: if self.is_on_front() {
                inv_speed * self.patch.per_mm
            } else {
                inv_speed
            },
            log_speed_derivative,
        }
    }

    /// No turn is tried for some passes: the plan before the last one is slower than a rest would make it.
    pub(crate) const fn avoid_turns(&mut self) {
        self.without = PASSES_WITHOUT;
    }

    /// Whether a turn may lead to the next pass.
    fn may_turn(&self, job: &Job<'_>, axes: &AxisLimits, out: &PassPlan) -> bool {
        let [_, is_up] = out.faces_up;
        axes.overrun_mm > 0.0
            && has_turns(job)
            && out.next.is_some()
            && out.steps_over
            && is_up
            && !out.point
            && out.group == 1
    }

    /// Turns to the start of the next pass; without a turn where it cannot be evaluated.
    fn look_across(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        let Some(next) = out.next else {
            return Task::Done;
        };
        let last = self.window.count().saturating_sub(1);
        let [_, cl_nm] = out.ends;
        let from = TurnEnd {
            cl_nm,
            q: self.window.derivatives(last),
        };
        self.ends = [from, from];
        self.piece = next.first(job);
        if self.patch.lay(job, &next, &self.piece).is_err() || self.patch.point {
            return Task::Done;
        }
        self.range = self.piece.range;
        self.window = Window::EMPTY;
        (self.station, self.arc_mm) = (0, 0.0);
        Task::Start
    }

    /// A station at the start of the next pass.
    fn visit_start(&mut self, job: &Job<'_>, axes: &AxisLimits) -> Task {
        let Ok((contact, located)) = self.patch.evaluate(self.fraction()) else {
            return Task::Done;
        };
        if self.station == 0 {
            let [_, to] = &mut self.ends;
            to.cl_nm = located.cl_nm;
            if !self.patch.faces_up(contact.offset) || check_travel(axes, &located.cl_nm).is_err() {
                return Task::Done;
            }
        } else {
            self.arc_mm += self.cell_length(job, &contact.path);
        }
        self.speed = contact.path;
        self.window.push(located.cl_nm, self.arc_mm);
        if self.window.count() < WINDOW && !self.is_end() {
            self.station += 1;
            return Task::Start;
        }
        let [_, to] = &mut self.ends;
        to.q = self.window.derivatives(0);
        self.length = 0.0;
        Task::Turn(0)
    }

    /// Tries a length of the turn; the last round checks the places of the turn.
    fn find_turn(&mut self, job: &Job<'_>, axes: &AxisLimits, round: u8) -> Task {
        let [from, to] = &self.ends;
        if round < turn::ROUNDS {
            let limits = MotionLimits::new(axes, job.header.feed_mm_s, job.header.period_s);
            let (turn, over_mm) = Turn::try_length(from, to, &limits, self.length);
            if !turn.is_long() {
                return Task::Done;
            }
            self.turn = turn;
            if over_mm <= axes.overrun_mm {
                return Task::Turn(turn::ROUNDS);
            }
            let Some(length) = turn.shorter(over_mm, axes.overrun_mm) else {
                return Task::Done;
            };
            self.length = length;
            return if round + 1 < turn::ROUNDS {
                Task::Turn(round + 1)
            } else {
                Task::Done
            };
        }
        for station in 0..turn::STATIONS {
            for second in [false, true] {
                let place = self.turn.place(second, station);
                if check_travel(axes, &place).is_err() || check_height(axes, &place).is_err() {
                    return Task::Done;
                }
            }
        }
        Task::Bound(0)
    }

    /// Bounds the turn's speed; at last, takes the turn where it is faster than two rests with a step-over between them.
    fn bound_turn(&mut self, job: &Job<'_>, axes: &AxisLimits, index: u16, out: &mut PassPlan) -> Task {
        let limits = MotionLimits::new(axes, job.header.feed_mm_s, job.header.period_s);
        self.turn.bound_speed(index, &limits);
        if index + 1 < turn::STATIONS {
            return Task::Bound(index + 1);
        }
        let [from, to] = &self.ends;
        if !self.turn.is_worth(from, to, &limits) {
            return Task::Done;
        }
        out.tail_q10 = i64::from(out.plan.stations.length_nm()) << Q10_BITS;
        Task::Tail(0)
    }

    /// Appends a station of half a turn.
    fn push_half(&self, second: bool, index: u16, out: &mut PassPlan) {
        let from_nm = if second {
            0
        } else {
            u32::try_from(out.tail_q10 >> Q10_BITS).unwrap_or(0)
        };
        out.plan.stations.push(Station {
            arc_nm: from_nm.saturating_add(self.turn.station_nm(index)),
            q: self.turn.station(second, index),
        });
    }

    /// Begins to look for a turn where there may be one.
    fn choose_link(&mut self, job: &Job<'_>, axes: &AxisLimits, out: &PassPlan) -> Task {
        let rests = self.without > 0;
        self.without = self.without.saturating_sub(1);
        if !rests && self.may_turn(job, axes, out) {
            Task::Across
        } else {
            Task::Done
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
        let patches = f32::from(self.patches.saturating_add(1));
        self.pass_mm = to_f32(self.start_q10 - out.head_q10) * MM_PER_Q10;
        self.patch_mm = self.pass_mm / patches;
        let header = job.header;
        out.interval = interval_of(self.maximum.inv_interval_sq);
        if let Some(route) = lines.take(header) {
            out.next = Some(route);
            return Ok(true);
        }
        let step = match header.spacing {
            Spacing::Exact => {
                let estimator = estimator.as_deref_mut();
                estimator.map_or(out.interval, |estimator| estimator.step(header, self.maximum))
            }
            Spacing::FirstOrder => out.interval,
            Spacing::Constant | Spacing::ConstantFromMiddle => {
                self.finish_short(out);
                return Ok(true);
            }
        };
        if header.edges > 0 {
            return Ok(!lines.go_on(job, step)?);
        }
        if !schedule::is_last(out.route.side, header.side_spans) {
            let side = match estimator {
                Some(estimator) => estimator.next_side(job, out.route.side, step)?,
                None => out.route.side,
            };
            out.next = Some(Route::of_pass(header, out.pass.wrapping_add(1), side));
            out.steps_over = header.pattern == Pattern::Zigzag;
        }
        Ok(true)
    }

    /// A pass that is too short for derivatives is straight.
    fn finish_short(&self, out: &mut PassPlan) {
        if !out.route.is_on_front() || self.has_derivatives {
            return;
        }
        let [from, to] = out.ends;
        let length = self.pass_mm.at_least(MM_PER_NM);
        let mut q = [[0.0; 3]; 3];
        for ((q, from), to) in q.iter_mut().zip(from).zip(to) {
            q[0] = to_f32(i64::from(to) - i64::from(from)) * MM_PER_NM / length;
        }
        for station in 1..=out.plan.stations.count() {
            if let Some(place) = out.plan.stations.back_mut(station) {
                place.q = q;
            }
        }
    }
}

/// Whether the first pass is to be looked at again for the step-over.
fn looks_again(job: &Job<'_>, estimator: Option<&mut StepOverEstimator>) -> bool {
    let estimator = estimator.filter(|_| job.header.spacing == Spacing::Exact);
    estimator.is_some_and(|estimator| estimator.looks_again(job.header))
}

/// Passes without a turn after one whose plan had to be slowed down for it.
const PASSES_WITHOUT: u8 = 15;

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

/// The direction at the station, and of each higher derivative the one that is greater.
fn widen(most: &mut Derivatives, q: &Derivatives, is_here: bool) {
    for ([direction, bends @ ..], [first, higher @ ..]) in most.iter_mut().zip(q) {
        if is_here {
            *direction = *first;
        }
        for (most, q) in bends.iter_mut().zip(higher) {
            if q.abs() > most.abs() {
                *most = *q;
            }
        }
    }
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

/// # Errors
/// [`FaultKind::LinkBlocked`] with the distance above the safe height, mm.
fn check_height(axes: &AxisLimits, [_, _, z]: &[i32; 3]) -> Result<()> {
    if *z > axes.safe_z_nm {
        return Err(Fault::new(
            FaultKind::LinkBlocked,
            nm_to_mm(z.saturating_sub(axes.safe_z_nm)),
        ));
    }
    Ok(())
}
