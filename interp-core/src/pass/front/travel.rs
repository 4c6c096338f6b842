//! The samples along the fronts, from the first line to the last one.

use crate::fault::{Fault, FaultKind, Result};
use crate::job::program::Job;
use crate::job::stations::Stations;
use crate::job::{Pattern, Spacing};
use crate::math::arith::{advanced, dot_hi};
use crate::math::number::Bounded;
use crate::pass::buffer::PatchBuffer;
use crate::pass::contact::{self, Reach};
use crate::pass::front::advance::{Advance, Made};
use crate::pass::front::side::{Direction, SideCursor, fine};
use crate::pass::front::spline::{Cubic, CurvePoint};
use crate::pass::front::table::{Column, Table};
use crate::pass::offset::check_fit;
use crate::pass::patch::Patch;
use crate::pass::position::PassPosition;
use crate::sample::{Sample, SpanParameter};
use crate::surface::{Contact, Pass as _, PathSpeed};

/// Cycles of the planning in a period of 1 ms, a share of the period; never less than one portion, nor more than in 1 ms.
const PORTION_CYCLES: f32 = 26_500.0;
const PORTION_PERIOD_S: f32 = 1e-3;
/// Most portions of a period.
const PORTIONS_MAX: u8 = 8;
/// Stations and path spans that a period's arc may end beyond: stations are two periods apart, except on short passes.
const CROSSINGS_MAX: u8 = 3;

/// The line that the tool is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Line {
    /// The first one.
    First,
    /// The current front.
    Front,
    /// The boundary that the fronts move to.
    Last,
}

/// The task of the next tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    /// Begin the run.
    Start,
    /// Advance by one period's arc.
    Along,
    /// Begin the next pass, once it is made.
    Over,
    /// None: the last sample was emitted.
    End,
}

/// Position and progress of a run of constant scallop height.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurveRun {
    next: Next,
    line: Line,
    reversed: bool,
    /// The table's columns of the current front and of the next one are swapped.
    swapped: bool,
    /// Part of the surface, from 0, and fronts so far.
    part: u8,
    fronts: u32,
    /// The sequence of part and fronts goes on with the next one.
    begins_part: bool,
    direction: Direction,
    cursor: SideCursor,
    /// Place in the surface's own direction, and its fraction in the direction of travel.
    place: SpanParameter,
    fraction: u64,
    side: SpanParameter,
    /// Start and end of the pass in the surface's own direction, whether they are on the last side boundary, and the station after the end.
    ends: [SpanParameter; 2],
    are_on_boundary: [bool; 2],
    after: u16,
    /// The parametrisation at the last sample, per mm, and the logarithmic speed derivative at the sample before.
    path: PathSpeed,
    log_speed_derivative_before: f32,
    offset: [i32; 3],
    max_inv_interval_sq: f32,
    last_interval: f32,
    ticks: u32,
    pass: u32,
    advance: Advance,
}

/// A sample's contact on a curve.
struct OnCurve {
    contact: Contact,
    path: PathSpeed,
    side: SpanParameter,
}

impl CurveRun {
    pub(crate) const START: Self = Self {
        next: Next::Start,
        line: Line::First,
        reversed: false,
        swapped: false,
        part: 0,
        fronts: 0,
        begins_part: false,
        direction: Direction::FROM_EDGE,
        cursor: SideCursor::NONE,
        place: SpanParameter { span: 0, fraction: 0 },
        fraction: 0,
        side: SpanParameter { span: 0, fraction: 0 },
        ends: [SpanParameter { span: 0, fraction: 0 }; 2],
        are_on_boundary: [false; 2],
        after: 0,
        path: PathSpeed::STILL,
        log_speed_derivative_before: f32::NAN,
        offset: [0; 3],
        max_inv_interval_sq: 0.0,
        last_interval: f32::INFINITY,
        ticks: 0,
        pass: 0,
        advance: Advance::START,
    };

    /// Resets to the start.
    pub(crate) const fn restart(&mut self) {
        self.next = Next::Start;
        (self.pass, self.ticks) = (0, 0);
        self.place = SpanParameter { span: 0, fraction: 0 };
        self.side = self.place;
        self.last_interval = f32::INFINITY;
        self.advance.stop();
    }

    /// Pass, path and side parameter of the tool.
    pub(crate) const fn surface_position(&self) -> (u32, SpanParameter, SpanParameter) {
        (self.pass, self.place, self.side)
    }

    /// Whether the next sample continues the pass.
    pub(crate) fn is_along(&self) -> bool {
        self.next == Next::Along
    }

    /// Minimum path interval of the last finished pass.
    pub(crate) const fn last_interval(&self) -> f32 {
        self.last_interval
    }

    /// Whether [`Self::plan`] has anything to do.
    pub(crate) fn has_to_plan(&self) -> bool {
        self.advance.has_work()
    }

    /// The planning of one period.
    #[inline(never)]
    pub(crate) fn plan(&mut self, job: &Job<'_>, words: &mut [i32]) {
        let share = (job.header.period_s / PORTION_PERIOD_S).at_most(1.0);
        let mut left = share * PORTION_CYCLES;
        for portion in 0..PORTIONS_MAX {
            let cycles = f32::from(u16::try_from(self.advance.cycles()).unwrap_or(u16::MAX));
            if cycles == 0.0 || (cycles > left && portion > 0) {
                return;
            }
            left -= cycles;
            let mut table = Table::new(&mut *words, self.advance.stations(), self.swapped);
            self.advance.work(job, &mut table);
        }
    }

    /// Writes the next sample into `last`; false after the last sample. `feed_factor`: share of a period's arc.
    ///
    /// # Errors
    /// The fault that stops the run; `last` is unchanged.
    #[inline(never)]
    pub(crate) fn advance(
        &mut self,
        job: &Job<'_>,
        words: &[i32],
        buffer: &mut PatchBuffer,
        feed_factor: f32,
        last: &mut Sample,
    ) -> Result<bool> {
        let begins = !self.is_along();
        match self.next {
            Next::Start => self.start(job),
            Next::Along => {
                let feed_mm_s = self.along(job, words, buffer, feed_factor)?;
                last.feed_mm_s = feed_mm_s;
            }
            Next::Over => {
                if !self.step_over(job, words)? {
                    // The next pass is not made yet: the tool stands.
                    last.tick = self.ticks;
                    last.feed_mm_s = 0.0;
                    self.ticks = self.ticks.wrapping_add(1);
                    return Ok(true);
                }
                if self.next == Next::End {
                    return Ok(false);
                }
            }
            Next::End => return Ok(false),
        }
        if begins {
            last.feed_mm_s = job.header.feed_mm_s * feed_factor;
            self.max_inv_interval_sq = 0.0;
            self.next = Next::Along;
        }
        self.sample(job, words, buffer, begins, last)?;
        if !self.is_along() {
            self.last_interval = crate::sample::interval_of(self.max_inv_interval_sq);
        }
        Ok(true)
    }

    fn start(&mut self, job: &Job<'_>) {
        self.cursor = SideCursor::new(job);
        (self.part, self.fronts, self.swapped) = (0, 0, false);
        self.direction = if job.header.spacing == Spacing::ConstantFromMiddle {
            let [first, _] = Direction::FROM_MIDDLE;
            first
        } else {
            Direction::FROM_EDGE
        };
        self.advance.begin(self.cursor, self.direction, true);
        self.begin_line(job, Line::First);
    }

    /// Whether the front of this number is travelled backwards.
    const fn is_reversed(&self, pattern: Pattern) -> bool {
        match pattern {
            Pattern::Zigzag => self.fronts % 2 == 1,
            // The other direction keeps the side on which the material is.
            Pattern::Zig => self.part == 1,
        }
    }

    /// Begins a line from end to end.
    fn begin_line(&mut self, job: &Job<'_>, line: Line) {
        self.reversed = self.is_reversed(job.header.pattern);
        self.line = line;
        let far = SpanParameter {
            span: job.header.path_spans.saturating_sub(1),
            fraction: u64::MAX,
        };
        let near = SpanParameter { span: 0, fraction: 0 };
        let (start, end) = if self.reversed { (far, near) } else { (near, far) };
        self.begin_at(start);
        self.ends = [start, end];
        self.are_on_boundary = [false; 2];
        self.after = u16::MAX;
    }

    const fn begin_at(&mut self, place: SpanParameter) {
        self.place = place;
        self.fraction = self.turned(place.fraction);
        self.path.log_speed_derivative = f32::NAN;
    }

    /// A fraction in the direction of travel, from one in the surface's own direction, or back.
    const fn turned(&self, fraction: u64) -> u64 {
        if self.reversed { !fraction } else { fraction }
    }

    fn stations(&self) -> Stations {
        self.advance.stations()
    }

    /// Begins the next pass. False where it is not made yet.
    fn step_over(&mut self, job: &Job<'_>, words: &[i32]) -> Result<bool> {
        if self.line == Line::Front && self.next_part_of_front(job, words) {
            self.pass = self.pass.wrapping_add(1);
            return Ok(true);
        }
        if self.line == Line::Last && !self.begins_part {
            self.next = Next::End;
            return Ok(true);
        }
        let Some(made) = self.advance.made() else {
            return Ok(false);
        };
        let made = made?;
        if self.begins_part {
            self.part = 1;
        }
        self.begins_part = false;
        self.direction = self.advance.direction;
        self.fronts = self.fronts.wrapping_add(1);
        match made {
            Made::Front => {
                self.swapped = !self.swapped;
                self.advance.go_on();
                self.line = Line::Front;
                self.reversed = self.is_reversed(job.header.pattern);
                self.after = 0;
                if !self.next_part_of_front(job, words) {
                    return Err(Fault::new(FaultKind::IntervalTooSmall, 0.0));
                }
            }
            Made::Beyond => {
                self.begin_line(job, Line::Last);
                let [_, second] = Direction::FROM_MIDDLE;
                if job.header.spacing == Spacing::ConstantFromMiddle && self.part == 0 {
                    self.advance.begin(self.cursor, second, false);
                    self.begins_part = true;
                } else {
                    self.advance.stop();
                }
            }
        }
        self.pass = self.pass.wrapping_add(1);
        Ok(true)
    }

    /// Begins the next part of the front that is before the boundary, from the station `after` in the order of travel. False where there is none.
    fn next_part_of_front(&mut self, job: &Job<'_>, words: &[i32]) -> bool {
        let stations = self.stations();
        let table = Table::new(words, stations, self.swapped);
        let count = stations.count();
        let boundary = self.direction.end;
        let own = |index: u16| {
            if self.reversed {
                count.saturating_sub(index + 1)
            } else {
                index
            }
        };
        let is_before = |index: u16| table.word(Column::Front, own(index)) < boundary;
        let crossing = |index: u16| {
            let interval = own(index).min(own(index + 1));
            let length = stations.length(job, interval);
            let cubic = Cubic::of(&table, [Column::Front, Column::Slope], interval, length);
            stations.place_within(interval, cubic.crossing(boundary))
        };
        let mut index = self.after;
        while index < count && !is_before(index) {
            index += 1;
        }
        if index >= count {
            return false;
        }
        let (start, is_from_boundary) = if index == 0 {
            (stations.place(own(0)), false)
        } else {
            (crossing(index - 1), true)
        };
        while index < count && is_before(index) {
            index += 1;
        }
        let (end, is_beyond) = if index < count {
            (crossing(index - 1), true)
        } else {
            (stations.place(own(count - 1)), false)
        };
        self.ends = [start, end];
        self.are_on_boundary = [is_from_boundary, is_beyond];
        self.after = index;
        self.begin_at(start);
        true
    }

    /// The point of the line at a place in the surface's own direction.
    fn point(&self, job: &Job<'_>, words: &[i32], place: SpanParameter) -> CurvePoint {
        match self.line {
            Line::First => CurvePoint::default(),
            Line::Last => CurvePoint {
                at: self.direction.end,
                fine: fine(self.direction.end),
                ..CurvePoint::default()
            },
            Line::Front => {
                let stations = self.stations();
                let table = Table::new(words, stations, self.swapped);
                let (interval, within) = stations.interval(place);
                let length = stations.length(job, interval);
                Cubic::of(&table, [Column::Front, Column::Slope], interval, length).point(within, length)
            }
        }
    }

    /// The contact at a place in the surface's own direction.
    fn evaluate(
        &mut self,
        job: &Job<'_>,
        words: &[i32],
        patch: &mut Patch,
        place: SpanParameter,
    ) -> Result<OnCurve> {
        let mut point = self.point(job, words, place);
        for (end, is_on_boundary) in self.ends.iter().zip(self.are_on_boundary) {
            if place == *end && is_on_boundary {
                point.fine = fine(self.direction.end);
            }
        }
        let (side, share) = self.cursor.seek(job, &self.direction, point.fine);
        let position = PassPosition {
            side,
            reversed: false,
            span: place.span,
        };
        patch.collapse(job, &position)?;
        let contact = patch.surface.contact(place.fraction, &patch.ball)?;
        let by = patch.surface.derivatives(place.fraction);
        let width = job.path_width(place.span);
        let out = self.direction.sign() / share;
        let (slope, bend) = (point.slope * width * out, point.bend * width * width * out);
        let tangent = by.path + by.side * slope;
        let change = by.path2 + by.mixed * (2.0 * slope) + by.side2 * (slope * slope) + by.side * bend;
        let squared = tangent.dot(tangent);
        let turn = if self.reversed { -1.0 } else { 1.0 };
        Ok(OnCurve {
            contact,
            path: PathSpeed {
                inv_speed: patch.per_mm / crate::math::arith::sqrt(squared),
                log_speed_derivative: turn * tangent.dot(change) / squared,
            },
            side,
        })
    }

    /// End of the pass, in the direction of travel; of the path span where it goes on beyond.
    fn end(&self) -> u64 {
        let [_, end] = self.ends;
        if end.span == self.place.span {
            self.turned(end.fraction)
        } else {
            u64::MAX
        }
    }

    /// End of the smooth part of the pass: of the interval between stations, or of the pass.
    fn limit(&self) -> u64 {
        let end = self.end();
        if self.line != Line::Front {
            return end;
        }
        let bits = u32::from(self.stations().bits);
        (self.fraction | u64::MAX >> bits).min(end)
    }

    /// Moves by a share of a period's arc. Returns the feed, mm/s.
    fn along(
        &mut self,
        job: &Job<'_>,
        words: &[i32],
        buffer: &mut PatchBuffer,
        feed_factor: f32,
    ) -> Result<f32> {
        let header = job.header;
        let feed_mm_s = header.feed_mm_s * feed_factor;
        let arc = feed_mm_s * header.period_s;
        let limit = self.limit();
        let step = contact::step(&self.path, self.log_speed_derivative_before, arc);
        if let Some(fraction) = step.and_then(|step| advanced(self.fraction, step))
            && fraction < limit
        {
            self.move_to(fraction);
            return Ok(feed_mm_s);
        }
        let mut rest = arc;
        let mut start = self.path;
        for crossings in 0..=CROSSINGS_MAX {
            let limit = self.limit();
            let span = self.place.span;
            let from = self.fraction;
            let (_, patch) = buffer.free();
            let path_at = |fraction: u64| {
                let place = SpanParameter {
                    span,
                    fraction: self.turned(fraction),
                };
                self.evaluate(job, words, patch, place)
                    .map_or(PathSpeed::STILL, |found| found.path)
            };
            let covered = match contact::solve(path_at, [from, limit], &start, || None, rest)? {
                Reach::Within(fraction) => {
                    self.move_to(fraction);
                    return Ok(feed_mm_s);
                }
                Reach::Beyond(covered) => covered,
            };
            rest -= covered;
            let [_, end] = self.ends;
            if span == end.span && limit == self.end() {
                self.move_to(limit);
                self.next = Next::Over;
                return Ok(feed_mm_s);
            }
            if crossings == CROSSINGS_MAX {
                break;
            }
            // A polynomial begins: no difference to the sample before.
            self.path.log_speed_derivative = f32::NAN;
            if limit < u64::MAX {
                self.move_to(limit + 1);
                let (_, patch) = buffer.free();
                start = self.evaluate(job, words, patch, self.place)?.path.checked()?;
                continue;
            }
            self.place.span = if self.reversed {
                span.saturating_sub(1)
            } else {
                span.saturating_add(1)
            };
            self.move_to(0);
            let (_, patch) = buffer.free();
            start = self.evaluate(job, words, patch, self.place)?.path.checked()?;
        }
        Err(Fault::new(FaultKind::PatchTooShort, rest))
    }

    const fn move_to(&mut self, fraction: u64) {
        self.fraction = fraction;
        self.place.fraction = self.turned(fraction);
    }

    /// The sample at the place.
    fn sample(
        &mut self,
        job: &Job<'_>,
        words: &[i32],
        buffer: &mut PatchBuffer,
        begins: bool,
        last: &mut Sample,
    ) -> Result<()> {
        let (patch, _) = buffer.free();
        let OnCurve { contact, path, side } = self.evaluate(job, words, patch, self.place)?;
        check_fit(&contact)?;
        let located = patch.locator.locate(&contact, &patch.origin)?;
        if !begins && patch.locator.folds(dot_hi(&self.offset, &contact.offset)) {
            return Err(Fault::new(FaultKind::DegenerateSurface, 0.0));
        }
        let inv_interval_sq = patch.interval.inv_interval_sq(&contact);
        self.max_inv_interval_sq = inv_interval_sq.at_least(self.max_inv_interval_sq);
        self.offset = contact.offset;
        self.log_speed_derivative_before = self.path.log_speed_derivative;
        self.path = path;
        self.side = side;
        last.tick = self.ticks;
        last.pass = self.pass;
        last.path = self.place;
        last.side = side;
        last.cc_nm = located.cc_nm;
        last.cl_nm = located.cl_nm;
        last.inv_interval_sq = inv_interval_sq;
        self.ticks = self.ticks.wrapping_add(1);
        Ok(())
    }
}
