//! Look-ahead over the next pass while the tool is still moving on the current one. Stations at equal fractions of each patch, in order, yield the bounds of the
//! feed ([`Plan`]), the interval to the following pass, and the checks that the ball fits and the axes stay within their travel at every station.
//!
//! Stations depend on the surface, not on the samples, so holds and overrides do not change the passes.

use crate::command::OVERRIDE_MAX;
use crate::fault::{Fault, FaultKind, Result};
use crate::feed::demand::{Jump, PathLimits, Stencil, over_jump, root};
use crate::feed::plan::{CELLS_MOVING, FeedLimits, Plan};
use crate::job::program::Job;
use crate::job::{AxisLimits, Pattern, Spacing};
use crate::math::number::{Bounded, nm_to_mm};
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::schedule;
use crate::pass::step_over::{PassMaximum, StepOverEstimator};
use crate::sample::{SpanParameter, interval_of};
use crate::surface::{Contact, PathSpeed};

/// Nominal cells of a pass; the number per patch is rounded to an integer. At most [`crate::job::CELLS_MAX`].
const CELLS_WANTED: u16 = 160;
/// Maximum cells of a patch.
const CELLS_PER_PATCH_MAX: u16 = 64;
/// Change of r times a curvature below which the curvature counts as continuous: the rounding error of f32.
const NO_JUMP: f32 = 4e-6;
/// Cells before a station over which its differences extend.
const STENCIL_CELLS: usize = 2;

/// The plan of one pass: its feed bounds, its ends, and the pass after it.
#[derive(Clone, Debug)]
pub(crate) struct PassPlan {
    pub(crate) plan: Plan,
    pub(crate) pass: u32,
    pub(crate) side: SpanParameter,
    /// Cells of a patch.
    pub(crate) cells_per_patch: u16,
    /// Fraction of the patch per cell.
    pub(crate) cell_fraction: u64,
    /// The pass is a single point.
    pub(crate) point: bool,
    /// Cutter location at start and end, nm, and whether the surface faces up there.
    pub(crate) ends: [[i32; 3]; 2],
    pub(crate) faces_up: [bool; 2],
    /// Minimum interval of the pass.
    pub(crate) interval: f32,
    /// The pass after this one.
    pub(crate) next: Option<SpanParameter>,
}

impl PassPlan {
    /// No plan.
    pub(crate) const NONE: Self = Self {
        plan: Plan::NONE,
        pass: 0,
        side: SpanParameter { span: 0, fraction: 0 },
        cells_per_patch: 1,
        cell_fraction: u64::MAX,
        point: false,
        ends: [[0; 3]; 2],
        faces_up: [false; 2],
        interval: f32::INFINITY,
        next: None,
    };
}

/// The next task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    Patch,
    Station,
    /// Compute the differences that end at the station.
    Cell,
    /// Compute the path limits from the differences.
    Limits,
    /// Close the cell that ends at the station.
    Add,
    /// Run the step-over estimator, with this number of evaluations left at the station.
    Estimate(u8),
    Close,
    Bound,
    Done,
}

/// Curvatures at the last stations, which distinguish a curvature jump between patches from a continuous change.
#[derive(Clone, Copy, Debug)]
struct CurvatureHistory {
    /// 1 - r k along the path and r times the twist, at the last three stations of the patch, the newest first.
    values: [[f32; 2]; 3],
    /// Lengths between these stations, mm.
    lengths: [f32; 2],
    /// Slopes at the end of the previous patch.
    slopes: Option<[f32; 2]>,
}

impl CurvatureHistory {
    const START: Self = Self {
        values: [[0.0; 2]; 3],
        lengths: [0.0; 2],
        slopes: None,
    };

    const fn push(&mut self, value: [f32; 2], length: f32) {
        let [newest, middle, _] = self.values;
        self.values = [value, newest, middle];
        self.lengths = [length, self.lengths[0]];
    }

    /// Slopes at the newest (`at_newest`) or the oldest of three stations, by the parabola through them.
    fn slopes(&self, at_newest: bool) -> [f32; 2] {
        let [newest, middle, oldest] = self.values;
        let [h1, h2] = self.lengths.map(|length| length.at_least(1e-9));
        let slope = |c: f32, b: f32, a: f32| {
            let (late, early) = ((c - b) / h1, (b - a) / h2);
            let bend = (late - early) / (h1 + h2);
            if at_newest {
                late + bend * h1
            } else {
                early - bend * h2
            }
        };
        let ([c0, c1], [b0, b1], [a0, a1]) = (newest, middle, oldest);
        [slope(c0, b0, a0), slope(c1, b1, a1)]
    }
}

/// The look-ahead over one pass.
#[derive(Clone, Debug)]
pub(crate) struct Lookahead {
    pub(crate) patch: Patch,
    step_over: StepOverEstimator,
    task: Task,
    line: PassPosition,
    /// Station within the patch, from 0.
    station: u16,
    speed: PathSpeed,
    stencil: Stencil,
    history: CurvatureHistory,
    /// The station whose cell is to be closed: contact, and ball centre in nm.
    here: Option<(Contact, [i32; 3])>,
    /// Length of the open cell, mm.
    length: f32,
    /// Path limits at the last station.
    limits: PathLimits,
    maximum: PassMaximum,
}

impl Lookahead {
    /// No pass yet.
    pub(crate) const START: Self = Self {
        patch: Patch::NONE,
        step_over: StepOverEstimator::START,
        task: Task::Done,
        line: PassPosition {
            side: SpanParameter { span: 0, fraction: 0 },
            reversed: false,
            span: 0,
        },
        station: 0,
        speed: PathSpeed::STILL,
        stencil: Stencil::START,
        history: CurvatureHistory::START,
        here: None,
        length: 0.0,
        limits: PathLimits::WIDE,
        maximum: PassMaximum::NONE,
    };

    /// Resets to the state before the first pass.
    pub(crate) const fn restart(&mut self) {
        self.step_over.restart();
        self.task = Task::Done;
    }

    /// Whether the plan is complete.
    pub(crate) const fn is_done(&self) -> bool {
        matches!(self.task, Task::Done)
    }

    /// Whether the next task collapses a patch.
    pub(crate) fn makes_patch(&self) -> bool {
        match self.task {
            Task::Patch => true,
            Task::Estimate(_) => self.step_over.makes_patch(&self.line),
            _ => false,
        }
    }

    /// Begins to plan this pass.
    pub(crate) fn begin(&mut self, job: &Job<'_>, pass: u32, side: SpanParameter, out: &mut PassPlan) {
        let spans = job.header.path_spans;
        let reversed = job.header.pattern == Pattern::Zigzag && pass % 2 == 1;
        self.line = PassPosition {
            side,
            reversed,
            span: if reversed { spans.saturating_sub(1) } else { 0 },
        };
        self.task = Task::Patch;
        self.station = 0;
        self.history = CurvatureHistory::START;
        self.limits = PathLimits::WIDE;
        self.maximum = PassMaximum::NONE;
        self.step_over.begin();
        out.plan.begin();
        out.pass = pass;
        out.side = side;
        let cells = (CELLS_WANTED / spans.max(1)).clamp(1, CELLS_PER_PATCH_MAX);
        out.cells_per_patch = cells;
        // Never zero; checked, so that the division has no panic branch wherever it is inlined.
        out.cell_fraction = u64::MAX.checked_div(u64::from(cells)).unwrap_or(u64::MAX);
        out.point = false;
        out.next = None;
    }

    /// Executes one task.
    ///
    /// # Errors
    /// The fault of the surface at the next station; [`FaultKind::SoftLimit`] where the station is outside the travel.
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, axes: &AxisLimits, out: &mut PassPlan) -> Result<()> {
        self.task = match self.task {
            Task::Patch => {
                self.patch.collapse(job, &self.line)?;
                out.point |= self.patch.point;
                Task::Station
            }
            Task::Station => {
                self.visit(axes, out)?;
                Task::Cell
            }
            Task::Cell => {
                self.differences(out);
                Task::Limits
            }
            Task::Limits => {
                if self.station > 0 && !out.point {
                    self.limits = self.stencil.limits(axes, &top(job));
                }
                Task::Add
            }
            Task::Add => {
                self.close_cell(job, axes, out);
                self.estimates(job, out)
            }
            Task::Estimate(looks) => {
                self.estimate(job, out);
                match looks.checked_sub(1) {
                    Some(looks) if looks > 0 => Task::Estimate(looks),
                    _ => self.next_station(job, out),
                }
            }
            Task::Close => {
                self.close(job, out)?;
                Task::Bound
            }
            Task::Bound if out.point || out.plan.work(CELLS_MOVING) => Task::Done,
            task => task,
        };
        Ok(())
    }

    /// Pass, path and side parameter of the station.
    pub(crate) fn surface_position(&self, out: &PassPlan) -> (u32, SpanParameter, SpanParameter) {
        let fraction = self.fraction(out);
        let own = if self.line.reversed { !fraction } else { fraction };
        let path = SpanParameter {
            span: self.line.span,
            fraction: own,
        };
        (out.pass, path, out.side)
    }

    fn fraction(&self, out: &PassPlan) -> u64 {
        if self.station >= out.cells_per_patch {
            return u64::MAX;
        }
        u64::from(self.station) * out.cell_fraction
    }

    /// Evaluations of the step-over estimator at a station: one for each neighbouring line, two where its patch has to be collapsed, and more at
    /// the lines' ends.
    fn estimates(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        if job.header.spacing == Spacing::FirstOrder || out.point {
            return self.next_station(job, out);
        }
        let first = self.station == 0;
        let begins = first && out.plan.count() == 0;
        let ends = self.station >= out.cells_per_patch && self.line.next(job.header.path_spans).is_none();
        Task::Estimate(2 + 2 * u8::from(first) + 6 * u8::from(begins) + 6 * u8::from(ends))
    }

    fn estimate(&mut self, job: &Job<'_>, out: &PassPlan) {
        let fraction = self.fraction(out);
        let most = self.maximum.inv_interval_sq;
        self.step_over.work(job, &self.line, &self.patch, fraction, most);
    }

    /// Advances to the next station, the next patch, or the end.
    fn next_station(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
        if self.station < out.cells_per_patch {
            self.station += 1;
            return Task::Station;
        }
        match self.line.next(job.header.path_spans) {
            Some(line) => {
                self.line = line;
                self.station = 0;
                Task::Patch
            }
            None => Task::Close,
        }
    }

    /// Evaluates the station: fit of the ball, travel, inverse square interval.
    fn visit(&mut self, axes: &AxisLimits, out: &mut PassPlan) -> Result<()> {
        let fraction = self.fraction(out);
        let patch = &self.patch;
        let (contact, located) = patch.evaluate(fraction)?;
        check_travel(axes, &located.cl_nm)?;
        check_height(axes, &located.cl_nm)?;
        let inv_interval_sq = patch.interval.inv_interval_sq(&contact);
        if inv_interval_sq > self.maximum.inv_interval_sq {
            self.maximum = PassMaximum {
                inv_interval_sq,
                shape: [contact.across, contact.lateral_squared],
            };
        }
        let is_up = patch.faces_up(contact.offset);
        let begins = out.plan.count() == 0 && self.station == 0;
        if begins || out.point {
            (out.ends, out.faces_up) = ([located.cl_nm; 2], [is_up; 2]);
        }
        (out.ends[1], out.faces_up[1]) = (located.cl_nm, is_up);
        self.here = Some((contact, located.cl_nm));
        Ok(())
    }

    /// Computes the differences up to the station.
    fn differences(&mut self, out: &PassPlan) {
        let Some((contact, centre_nm)) = self.here.filter(|_| !out.point) else {
            return;
        };
        self.length = self.cell_length(out, &contact);
        self.speed = contact.path;
        if self.station > 0 {
            self.stencil.add(centre_nm, self.length);
        } else if out.plan.count() == 0 {
            self.stencil.begin(centre_nm);
        }
    }

    /// Closes the cell up to the station.
    fn close_cell(&mut self, job: &Job<'_>, axes: &AxisLimits, out: &mut PassPlan) {
        let Some((contact, _)) = self.here.take().filter(|_| !out.point) else {
            return;
        };
        let top = top(job);
        if self.station > 0 {
            out.plan.add(self.length, &self.limits, STENCIL_CELLS, &top);
        }
        self.limit_at_jumps(axes, &contact, self.length, &top, out);
    }

    /// Arc from the last station, mm: Hermite's two-point rule.
    fn cell_length(&self, out: &PassPlan, contact: &Contact) -> f32 {
        let length = 1.0 / f32::from(out.cells_per_patch);
        let (first, last) = (1.0 / self.speed.inv_speed, 1.0 / contact.path.inv_speed);
        let bow = first * self.speed.log_speed_derivative - last * contact.path.log_speed_derivative;
        length * (0.5 * (first + last) + bow * length * (1.0 / 12.0)) / self.patch.per_mm
    }

    /// Jumps of the curvature between the previous patch and this one limit the feed at the boundary; jumps of its slope do so once three stations
    /// on this side are known.
    fn limit_at_jumps(
        &mut self,
        axes: &AxisLimits,
        contact: &Contact,
        length: f32,
        top: &FeedLimits,
        out: &mut PassPlan,
    ) {
        let twist = if contact.lateral_squared > 0.0 {
            root(contact.twist_squared / contact.lateral_squared)
        } else {
            0.0
        };
        let value = [contact.along, twist];
        let before = self.history.values[0];
        if self.station == 0 {
            let first = changed(&before, &value, NO_JUMP);
            self.history.slopes = (out.cells_per_patch >= 2).then(|| self.history.slopes(true));
            self.history.values = [value; 3];
            if out.plan.count() > 0 {
                let jump = Jump {
                    first,
                    second: [0.0; 2],
                };
                self.limit_at_jump(1, &jump, axes, top, out);
            }
            return;
        }
        self.history.push(value, length);
        if self.station == 2
            && out.plan.count() > out.cells_per_patch
            && let Some(slopes) = self.history.slopes
        {
            let here = self.history.slopes(false);
            let shortest = self.history.lengths[0]
                .at_most(self.history.lengths[1])
                .at_least(1e-9);
            let second = changed(&slopes, &here, 4.0 * NO_JUMP / shortest);
            let jump = Jump {
                first: [0.0; 2],
                second,
            };
            self.limit_at_jump(3, &jump, axes, top, out);
        }
    }

    /// Limits the feed at a curvature jump at the end of a cell, `back` cells before the last.
    fn limit_at_jump(&self, back: u16, jump: &Jump, axes: &AxisLimits, top: &FeedLimits, out: &mut PassPlan) {
        let square = over_jump(
            jump,
            &self.stencil.cosines(),
            self.limits.taken,
            axes,
            top.period_s,
        );
        out.plan.gate(out.plan.count().saturating_sub(back), square, top);
    }

    /// Completes the plan: the feed filter, the interval, and the next pass.
    fn close(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Result<()> {
        out.plan.settle(&top(job));
        let header = job.header;
        out.interval = interval_of(self.maximum.inv_interval_sq);
        let step = match header.spacing {
            Spacing::Exact if !out.point => self.step_over.step(header, self.maximum),
            _ => out.interval,
        };
        let width = |span| job.side_width(span);
        out.next = if schedule::is_last(out.side, header.side_spans) {
            None
        } else {
            Some(schedule::next_side(out.side, step, header.side_spans, width)?)
        };
        Ok(())
    }
}

/// The speeds for which a pass is planned.
pub(crate) fn top(job: &Job<'_>) -> FeedLimits {
    FeedLimits {
        speed: OVERRIDE_MAX * job.header.feed_mm_s,
        usual: job.header.feed_mm_s,
        period_s: job.header.period_s,
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

/// Norm of the difference of two pairs, beyond the rounding error.
fn changed(from: &[f32; 2], to: &[f32; 2], noise: f32) -> [f32; 2] {
    let ([from0, from1], [to0, to1]) = (from, to);
    let apart = |from: &f32, to: &f32| ((to - from).abs() - noise).at_least(0.0);
    [apart(from0, to0), apart(from1, to1)]
}
