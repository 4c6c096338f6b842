//! A step-over from the end of a pass to the start of the next, on the surface, along the boundary.

use super::{NOTHING_NM, Progress, distance, to_mm};
use crate::fault::Result;
use crate::feed::curve::{Curve, CurveCursor, CurveLimits};
use crate::feed::limits::{MotionLimits, SLOPE_MIN};
use crate::feed::pace::Trajectory as _;
use crate::feed::profile::Profiles;
use crate::feed::stations::{Derivatives, WINDOW, Window};
use crate::job::AxisLimits;
use crate::job::program::Job;
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, cube_root, to_f32};
use crate::pass::offset::Located;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::pass::schedule;
use crate::sample::SpanParameter;
use crate::sequence::lookahead::{check_crease, check_travel};

/// Shares of the acceleration that a bend of a step-over may take.
const BEND_SHARE: f32 = 0.5;
/// Share of the jerk that it may take at most, so that something is left to move with.
const BEND_JERK_SHARE: f32 = 0.6;

/// Knots of a step-over that are looked at: a step crosses no more.
const KNOTS_MAX: u16 = schedule::WALK_MAX;
/// In a rise bounded by jerk alone, max(v a) is smaller than max(v) max(a) by this share: 1 - (2/3)^(3/2).
const V_TIMES_A: f32 = 0.456;
/// Share of the jerk that a jump of the direction may take in the periods that see it.
const JUMP_JERK_SHARE: f32 = 0.1;

/// Time of a step-over at the speed at which it passes jumps of the direction from which on a lift is shorter, s.
const LIFT_S: f32 = 1.0;

/// Rounds in which the speed of a step-over and what its bends leave are adapted to each other.
const ROUNDS: u8 = 3;

/// What the planning of a step-over does next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Begin.
    Begin,
    /// Locate the ends, for its length.
    Ends,
    /// Find whether the curvature jumps at the knot after the n-th span of the step-over.
    Knot(u16),
    /// Locate the n-th station.
    Station(u8),
    /// Compute the derivatives at the n-th station.
    Derivatives(u8),
    Done,
}

/// An end of a pass on a boundary of the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundaryEnd {
    pub(crate) path: SpanParameter,
    pub(crate) side: SpanParameter,
}

/// The parameter that changes along a step-over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Along {
    /// The boundary is an end of the path parameter.
    Side,
    /// It is the last one of the side parameter.
    Path,
}

impl Along {
    /// Width of a span.
    fn width(self, job: &Job<'_>, span: u16) -> f32 {
        match self {
            Self::Side => job.side_width(span),
            Self::Path => job.path_width(span),
        }
    }

    const fn spans(self, job: &Job<'_>) -> u16 {
        match self {
            Self::Side => job.header.side_spans,
            Self::Path => job.header.path_spans,
        }
    }
}

/// A step-over from the end of a pass to the start of the next, along the boundary.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoundaryStepOver {
    pub(crate) progress: Progress,
    patch: Patch,
    from: SpanParameter,
    to: SpanParameter,
    /// The parameter from and to which it leads, and its distance.
    along: Along,
    reach: f32,
    /// The patch at the end of the pass, and the fraction of its path span there.
    line: PassPosition,
    at: u64,
    task: Task,
    window: Window,
    length: f32,
    /// Limits over the stations so far: of the speed, and of what the bends leave.
    limits: MotionLimits,
    curve: CurveLimits,
    /// Greatest derivatives over the stations.
    bends: Derivatives,
    /// The knot with the greatest jump of the curvature: its share of the way and the jump of the centre's speed there, as a share of the contact's; and the
    /// greatest jump at another knot.
    jump_at: f32,
    jump: f32,
    jump_beside: f32,
    /// The place before: the contact at the last station, the centre at a side of a knot.
    place: [i32; 3],
    /// A share of the way that is located ahead of the tick that comes there.
    ahead: Option<(f32, Located)>,
    /// Maximum ratio of the length of the contact's path to the length in the plan.
    contact_ratio: f32,
    /// Feed for which it was planned, mm/s.
    feed: f32,
}

/// Stations of a step-over.
const STATIONS: u8 = 5;
const _: () = assert!(STATIONS as usize == WINDOW);

impl BoundaryStepOver {
    /// No move.
    pub(crate) const NONE: Self = Self {
        progress: Progress::NONE,
        patch: Patch::NONE,
        from: SpanParameter { span: 0, fraction: 0 },
        to: SpanParameter { span: 0, fraction: 0 },
        along: Along::Side,
        at: u64::MAX,
        reach: 0.0,
        line: PassPosition {
            side: SpanParameter { span: 0, fraction: 0 },
            reversed: false,
            span: 0,
        },
        task: Task::Done,
        window: Window::EMPTY,
        length: 0.0,
        limits: MotionLimits::NONE,
        curve: Curve::NONE.limits(),
        bends: [[0.0; 3]; 3],
        jump_at: 0.0,
        jump: 0.0,
        jump_beside: 0.0,
        place: [0; 3],
        ahead: None,
        contact_ratio: 1.0,
        feed: 1.0,
    };

    /// Begins to plan a step-over from the end of a pass, travelled in this direction, to the start of another, at this feed, mm/s.
    pub(crate) fn begin(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        (along, reversed): (Along, bool),
        [end, start]: [BoundaryEnd; 2],
        feed: f32,
    ) {
        let width = |span| along.width(job, span);
        (self.from, self.to) = match along {
            Along::Side => (end.side, start.side),
            Along::Path => (end.path, start.path),
        };
        self.along = along;
        self.reach = if self.goes_back() {
            schedule::apart(self.to, self.from, width)
        } else {
            schedule::apart(self.from, self.to, width)
        };
        let reversed = reversed && along == Along::Side;
        self.at = if reversed {
            !end.path.fraction
        } else {
            end.path.fraction
        };
        self.line = PassPosition {
            side: end.side,
            reversed,
            span: end.path.span,
        };
        self.task = Task::Ends;
        self.window = Window::EMPTY;
        self.limits = MotionLimits::new(axes, feed, job.header.period_s);
        self.bends = [[0.0; 3]; 3];
        (self.jump_at, self.jump, self.jump_beside) = (0.0, 0.0, 0.0);
        self.contact_ratio = 1.0;
        self.ahead = None;
        self.feed = feed;
    }

    /// A step-over is to be planned: [`Self::begin`] does so later, in a portion of the planning.
    pub(crate) const fn request(&mut self) {
        self.task = Task::Begin;
    }

    /// Whether [`Self::begin`] is due.
    pub(crate) fn is_requested(&self) -> bool {
        self.task == Task::Begin
    }

    /// Whether the planning is complete.
    pub(crate) fn is_planned(&self) -> bool {
        self.task == Task::Done
    }

    /// Whether the length of the step-over is negligible.
    pub(crate) fn is_nothing(&self) -> bool {
        !(self.length > to_mm(NOTHING_NM))
    }

    /// Whether the parameter decreases.
    fn goes_back(&self) -> bool {
        (self.to.span, self.to.fraction) < (self.from.span, self.from.fraction)
    }

    /// The parameter at this fraction of the step-over, 0 to 1.
    fn parameter(&self, job: &Job<'_>, part: f32) -> SpanParameter {
        let width = |span| self.along.width(job, span);
        let spans = self.along.spans(job);
        if part >= 1.0 {
            self.to
        } else if !self.goes_back() {
            schedule::next_side(self.from, self.reach * part, spans, width).unwrap_or(self.from)
        } else if part <= 0.0 {
            self.from
        } else {
            schedule::next_side(self.to, self.reach * (1.0 - part), spans, width).unwrap_or(self.to)
        }
    }

    /// Contact and ball centre at this fraction of the step-over, 0 to 1.
    ///
    /// # Errors
    /// The fault of the surface there.
    fn locate(&mut self, job: &Job<'_>, part: f32) -> Result<Located> {
        let parameter = self.parameter(job, part);
        let at = self.move_to(job, parameter)?;
        let (_, located) = self.patch.evaluate_on_line(at)?;
        Ok(located)
    }

    /// Collapses the patch at a place of the boundary. Returns the fraction of its path span.
    fn move_to(&mut self, job: &Job<'_>, parameter: SpanParameter) -> Result<u64> {
        let (position, at) = match self.along {
            Along::Side => {
                let position = PassPosition {
                    side: parameter,
                    ..self.line
                };
                (position, self.at)
            }
            Along::Path => {
                let position = PassPosition {
                    span: parameter.span,
                    ..self.line
                };
                (position, parameter.fraction)
            }
        };
        self.patch.collapse(job, &position)?;
        Ok(at)
    }

    /// Plans one portion.
    ///
    /// # Errors
    /// The fault of the surface at a station; [`FaultKind::SoftLimit`](crate::FaultKind::SoftLimit) where a station is outside the travel.
    #[inline(never)]
    pub(crate) fn work(&mut self, job: &Job<'_>, axes: &AxisLimits) -> Result<()> {
        self.task = match self.task {
            Task::Ends => {
                let here = self.locate(job, 0.0)?;
                let there = self.locate(job, 1.0)?;
                self.length =
                    distance(&here.cc_nm, &there.cc_nm).at_least(distance(&here.cl_nm, &there.cl_nm));
                if self.is_nothing() {
                    Task::Done
                } else {
                    self.next_knot(0)
                }
            }
            Task::Knot(index) => {
                self.look_at_knot(job, axes, index)?;
                self.next_knot(index + 1)
            }
            Task::Station(index) => {
                let part = f32::from(index) * (1.0 / f32::from(STATIONS - 1));
                let here = self.locate(job, part)?;
                check_travel(axes, &here.cl_nm)?;
                self.window.push(here.cl_nm, part * self.length, None);
                if index > 0 {
                    let cell = self.length * (1.0 / f32::from(STATIONS - 1));
                    let ratio = distance(&self.place, &here.cc_nm) / cell;
                    self.contact_ratio = self.contact_ratio.at_least(ratio);
                }
                self.place = here.cc_nm;
                if index + 1 < STATIONS {
                    Task::Station(index + 1)
                } else {
                    Task::Derivatives(0)
                }
            }
            Task::Derivatives(index) => {
                let q = self.window.derivatives(usize::from(index));
                for (bends, q) in self.bends.iter_mut().zip(&q) {
                    for (bend, q) in bends.iter_mut().zip(q) {
                        *bend = bend.at_least(q.abs());
                    }
                }
                if index + 1 < STATIONS {
                    Task::Derivatives(index + 1)
                } else {
                    self.choose_curve();
                    Task::Done
                }
            }
            task @ (Task::Begin | Task::Done) => task,
        };
        Ok(())
    }

    /// The task for a knot, if the step-over crosses as many; the first station else.
    const fn next_knot(&self, index: u16) -> Task {
        let apart = self.to.span.abs_diff(self.from.span);
        if index < KNOTS_MAX && index < apart {
            Task::Knot(index)
        } else {
            Task::Station(0)
        }
    }

    /// Where the curvature across a knot jumps, so does the direction of the centre's motion.
    fn look_at_knot(&mut self, job: &Job<'_>, axes: &AxisLimits, index: u16) -> Result<()> {
        let span = self.from.span.min(self.to.span) + index;
        let before = SpanParameter {
            span,
            fraction: u64::MAX,
        };
        let after = SpanParameter {
            span: span + 1,
            fraction: 0,
        };
        let mut sides = [0.0; 2];
        for (of_side, parameter) in sides.iter_mut().zip([before, after]) {
            let at = self.move_to(job, parameter)?;
            let (contact, located) = self.patch.evaluate_on_line(at)?;
            if parameter.span > span {
                check_crease(job, axes, [&self.place, &located.cl_nm])?;
            }
            self.place = located.cl_nm;
            *of_side = match self.along {
                Along::Side => contact.across / contact.lateral_squared,
                Along::Path => contact.along,
            };
        }
        let [bend_before, bend_after] = sides;
        let jump = (bend_after - bend_before).abs();
        // A NaN, at a pole, is none.
        if jump > self.jump {
            let width = |span| self.along.width(job, span);
            self.jump_beside = self.jump;
            self.jump = jump;
            self.jump_at = if self.goes_back() {
                schedule::apart(after, self.from, width) / self.reach
            } else {
                schedule::apart(self.from, after, width) / self.reach
            };
        } else if jump > self.jump_beside {
            self.jump_beside = jump;
        }
        Ok(())
    }

    /// The curve that the bends leave room for, with a rest where the centre's direction jumps.
    fn choose_curve(&mut self) {
        let limits = &self.limits;
        let top = 1.0 / sqrt(limits.inverse_speed_sqr(&self.bends));
        let mut speed = top.at_most(self.feed / self.contact_ratio);
        for (axis, [_, second, third]) in limits.axes.iter().zip(&self.bends) {
            speed = speed
                .at_most(sqrt(BEND_SHARE * axis.acceleration / second.at_least(1e-9)))
                .at_most(cube_root(BEND_JERK_SHARE * axis.jerk / third.at_least(1e-9)));
        }
        speed = speed.at_most(self.passed(self.jump_beside));
        let rests = self.passed(self.jump) < speed;
        let jump = if rests { self.jump_beside } else { self.jump };
        let first = if rests {
            self.jump_at * self.length
        } else {
            self.length
        };
        let mut curve = Curve::NONE;
        let mut peak = 0.0;
        for _ in 0..ROUNDS {
            self.curve = self.left_at(speed, peak, jump);
            curve = Curve::new(first, &self.curve, 0.0, 0.0);
            if rests {
                curve = curve.and_then(self.length - first);
            }
            peak = curve.peak();
        }
        self.progress.lead(self.length, curve);
    }

    /// What the bends, and a jump of the direction that is passed, leave at this speed.
    fn left_at(&self, speed: f32, peak: f32, jump: f32) -> CurveLimits {
        let mut left = CurveLimits {
            speed,
            acceleration: f32::MAX,
            jerk: f32::MAX,
        };
        for (axis, [first, second, _]) in self.limits.axes.iter().zip(&self.bends) {
            let room = (axis.acceleration - second * peak * peak).at_least(0.2 * axis.acceleration);
            left.acceleration = left.acceleration.at_most(room / first.at_least(SLOPE_MIN));
        }
        let mut jerk = f32::MAX;
        for (axis, [first, ..]) in self.limits.axes.iter().zip(&self.bends) {
            jerk = jerk.at_most(axis.jerk / first.at_least(SLOPE_MIN));
        }
        // Speed and acceleration are greatest one after the other: v a <= (1 - 0.456 p) v_max a_max, with p the share of the rise in which the jerk is at its limit.
        let acceleration = left.acceleration.at_most(sqrt(jerk * peak));
        let rise = acceleration * acceleration / (jerk * peak).at_least(1e-9);
        let product = (1.0 - V_TIMES_A * rise) * peak * acceleration;
        let at_jump = peak * jump / (self.limits.period * self.limits.period);
        for (axis, [first, second, third]) in self.limits.axes.iter().zip(&self.bends) {
            let taken = third * peak * peak * peak + 3.0 * second * product + at_jump;
            let room = (axis.jerk - taken).at_least(0.15 * axis.jerk);
            left.jerk = left.jerk.at_most(room / first.at_least(SLOPE_MIN));
        }
        left
    }

    /// Contact and ball centre.
    ///
    /// # Errors
    /// The fault of the surface there.
    pub(crate) fn position(&mut self, job: &Job<'_>) -> Result<Located> {
        let part = self.part_at(&self.progress.cursor);
        match self.ahead.take() {
            Some((at, located)) if at.to_bits() == part.to_bits() => Ok(located),
            _ => self.locate(job, part),
        }
    }

    /// The share of the way at a place of the curve.
    fn part_at(&self, cursor: &CurveCursor) -> f32 {
        let Progress {
            curve, length_q10, ..
        } = &self.progress;
        if curve.is_over(cursor) || cursor.moved_q10 >= *length_q10 {
            1.0
        } else {
            to_f32(cursor.moved_q10) / to_f32(*length_q10)
        }
    }

    /// Whether a place is located ahead.
    pub(crate) const fn is_ahead(&self) -> bool {
        self.ahead.is_some()
    }

    /// Locates where the next period ends. A fault is left for that.
    pub(crate) fn locate_ahead(&mut self, job: &Job<'_>, profiles: &Profiles) {
        let pace = self.progress.pace.next(profiles);
        self.locate_next(job, pace);
    }

    /// The same of the first period, which begins at this pace.
    pub(crate) fn locate_first(&mut self, job: &Job<'_>, pace: f32) {
        self.locate_next(job, pace);
    }

    fn locate_next(&mut self, job: &Job<'_>, pace: f32) {
        let part = self.part_at(&self.progress.next(pace, job.header.period_s));
        self.ahead = self.locate(job, part).ok().map(|located| (part, located));
    }

    /// Whether it takes longer than a lift: it rests at one jump of the direction, and is slow for all others.
    pub(crate) fn is_slower_than_lift(&self) -> bool {
        self.length > LIFT_S * self.passed(self.jump_beside)
    }

    /// Speed at which a jump of the direction is passed, mm/s.
    fn passed(&self, jump: f32) -> f32 {
        let least = self
            .limits
            .axes
            .iter()
            .fold(f32::MAX, |least, axis| least.at_most(axis.jerk));
        let period = self.limits.period;
        JUMP_JERK_SHARE * least * period * period / jump.at_least(1e-9)
    }

    /// Feed for which it was planned, mm/s.
    pub(crate) const fn feed(&self) -> f32 {
        self.feed
    }

    /// Speed of the contact, mm/s.
    pub(crate) fn contact_speed(&self) -> f32 {
        self.contact_ratio * self.progress.speed()
    }
}
