//! The next front, made in portions in the planning of each period.

use core::ops::DerefMut;

use crate::fault::{Fault, FaultKind};
use crate::job::program::Job;
use crate::job::stations::Stations;
use crate::math::arith::{sqrt, to_f32, truncated};
use crate::math::number::{Bounded, MM_PER_NM, to_f32 as wide_to_f32};
use crate::pass::front::cost;
use crate::pass::front::crest::{CURRENT, CrestSearch, NEXT, Place, Tools};
use crate::pass::front::foot::{FootStep, Found};
use crate::pass::front::frame::{Frame, FreePatch, MARGIN};
use crate::pass::front::limits::Limiter;
use crate::pass::front::side::{Direction, SideCursor, UNIT, WHOLE};
use crate::pass::front::spline::{self, Cubic};
use crate::pass::front::table::{Column, Table, UNMEASURED};
use crate::sample::SpanParameter;

/// Points on the first line and on the last one by which the pass's length is measured.
const LENGTH_POINTS: u16 = 9;
/// Shortest interval between stations, in periods at the feed and in step-overs.
const INTERVAL_PERIODS: f32 = 2.0;
const INTERVAL_STEPS: f32 = 0.5;
/// Greatest turn of a pass in one period, rad.
const TURN_PER_PERIOD: f32 = 0.05;
/// Least radius of a pass in the tangent plane, in step-overs.
const RADIUS_STEPS: f32 = 1.0;
/// Tangent of the greatest angle of a pass to the lines of the side parameter: 80 degrees.
const TANGENT_MAX: f32 = 5.671_282;
/// Rounds in which a front is lowered where its curve is too far between the stations, and after the crests are measured; by how much more than the excess.
const ROUNDS: u8 = 4;
const MEASUREMENTS: u8 = 3;
/// Ratio of the steps up to which a straight front stays straight, and how much longer its step is: all of the limit but for an error.
const LEVEL: f32 = 1.002;
const LEVEL_MORE: f32 = 1.0034;
const LEVEL_MARGIN: f32 = 0.9999;
/// Turn of the curve beyond which a front is not taken, as a multiple of the limit by length, and between stations, rad.
const SHARP: f32 = 2.5;
const SHARP_TURN: f32 = 0.5;
/// Tolerance of the curve between stations, over the step there.
const MIDDLE_TOLERANCE: f32 = 1.0005;
/// Step where the surface is faulty, units of the fronts.
const FAULTY_STEP: i32 = WHOLE / 256;
const LOWER: f32 = 1.1;
/// Places in each interval at which crests are measured, and the bend of a front over an interval above which all of them are, as a share of the step there.
const PLACES: u16 = 3;
const BENT: f32 = 0.1;
/// Scallop height to which the crests are measured, as a share of the limit.
const MEASURED_MARGIN: f32 = 0.990;
/// Rows of a sweep in one portion, and places that are passed over.
const CHUNK: u16 = 16;
/// Stations beside those before the boundary up to which a front is stepped: the spline through them forgets what lies farther away.
const REACH: u16 = 8;
/// Greatest slope.
const SLOPE_MAX: f32 = 1e9;
/// Squares of the derivatives' lengths, side to path, below which an end of the passes is a pole.
const POLE_MAX: f32 = 1e-10;
/// Least advance of a front, as a share of the whole side parameter.
const ADVANCE_MIN: f32 = 1e-6;

/// The next portion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Measure the length of the passes.
    Length,
    /// Set the front to the first line.
    Clear,
    /// Step at each station and in the middle of each interval.
    Step,
    /// A straight front at the least step, in place of the limits.
    Level,
    /// The current front, moved.
    Shift,
    /// The limits: sweeps and hull, twice.
    Forwards,
    Backwards,
    Hull,
    Apply,
    /// The spline.
    Eliminate,
    Substitute,
    /// Compare the curve with the steps between the stations.
    Compare,
    /// Measure the crests.
    Crest,
    /// Lower where the front is too far.
    Lower,
    /// The front is made, or none is wanted.
    Done,
}

/// What has been made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Made {
    /// A front with a part before the boundary.
    Front,
    /// Every station is at the boundary or beyond it.
    Beyond,
}

/// The generator of fronts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Advance {
    task: Task,
    station: u16,
    /// Second pass of the limits; rounds of measuring.
    again: bool,
    /// The current front is straight, and the next one.
    is_straight: bool,
    is_next_straight: bool,
    /// The next one is made straight; the least and the greatest step, units of the fronts.
    is_level: bool,
    steps: [i32; 2],
    /// The curve turns too sharply; it was replaced by the current one, moved by the least advance, units of the fronts.
    is_sharp: bool,
    is_shifted: bool,
    shift: i32,
    round: u8,
    measured: u8,
    is_lowered: bool,
    stations: Stations,
    pub(crate) direction: Direction,
    cursor: SideCursor,
    patch: FreePatch,
    limiter: Limiter,
    foot: FootStep,
    search: CrestSearch,
    before: Option<[i64; 3]>,
    length_mm: f32,
    /// Greatest advance, as a share of the whole side parameter.
    advanced: f32,
    /// The passes' ends are poles.
    poles: [bool; 2],
    made: Option<Made>,
}

impl Advance {
    pub(crate) const START: Self = Self {
        task: Task::Done,
        station: 0,
        again: false,
        is_straight: true,
        is_next_straight: true,
        is_level: false,
        steps: [0; 2],
        is_sharp: false,
        is_shifted: false,
        shift: 0,
        round: 0,
        measured: 0,
        is_lowered: false,
        stations: Stations { spans: 1, bits: 6 },
        direction: Direction::FROM_EDGE,
        cursor: SideCursor::NONE,
        patch: FreePatch::NONE,
        limiter: Limiter::NONE,
        foot: FootStep::NONE,
        search: CrestSearch::NONE,
        before: None,
        length_mm: 0.0,
        advanced: 0.0,
        poles: [false; 2],
        made: None,
    };

    /// Begins with the front after the first line in this direction. `is_first`: the stations are not chosen yet.
    pub(crate) const fn begin(&mut self, cursor: SideCursor, direction: Direction, is_first: bool) {
        self.direction = direction;
        self.is_straight = true;
        self.made = None;
        self.station = 0;
        if is_first {
            self.cursor = cursor;
            self.patch.forget();
            self.advanced = 0.0;
            self.length_mm = 0.0;
            self.before = None;
        }
        self.task = if is_first { Task::Length } else { Task::Clear };
    }

    /// Begins with the front after the current one.
    pub(crate) const fn go_on(&mut self) {
        self.made = None;
        self.is_straight = self.is_next_straight;
        self.start_front();
    }

    /// Ends the work.
    pub(crate) const fn stop(&mut self) {
        self.task = Task::Done;
        self.made = None;
    }

    const fn start_front(&mut self) {
        self.task = Task::Step;
        self.station = 0;
        self.round = 0;
        self.measured = 0;
        self.again = false;
        self.advanced = 0.0;
        self.steps = [i32::MAX, 0];
        self.is_level = false;
        self.is_shifted = false;
        self.foot.begin((0, 0));
    }

    pub(crate) fn has_work(&self) -> bool {
        self.task != Task::Done
    }

    pub(crate) const fn stations(&self) -> Stations {
        self.stations
    }

    /// What was made, once it is.
    ///
    /// # Errors
    /// [`FaultKind::IntervalTooSmall`] where the front does not move.
    pub(crate) fn made(&self) -> Option<Result<Made, Fault>> {
        if self.has_work() {
            return None;
        }
        let made = self.made?;
        Some(if self.advanced < ADVANCE_MIN && made == Made::Front {
            Err(Fault::new(FaultKind::IntervalTooSmall, self.advanced))
        } else {
            Ok(made)
        })
    }

    /// Most cycles of the next portion.
    pub(crate) const fn cycles(&self) -> u32 {
        match self.task {
            Task::Done => 0,
            _ => self.expected_cycles().saturating_add(cost::RECORD),
        }
    }

    /// Cycles of the next portion on the patch of the last one.
    const fn expected_cycles(&self) -> u32 {
        match self.task {
            Task::Done => 0,
            Task::Length => cost::LENGTH,
            Task::Step => cost::of(&cost::STEP, self.foot.next),
            Task::Crest => cost::of(&cost::CREST, self.search.next),
            Task::Clear | Task::Apply | Task::Level | Task::Shift => cost::COPY,
            Task::Forwards | Task::Backwards | Task::Compare | Task::Lower | Task::Eliminate => cost::SWEEP,
            Task::Hull => cost::HULL,
            Task::Substitute => cost::SUBSTITUTE,
        }
    }

    /// Executes a portion. Returns its cycles.
    pub(crate) fn work<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) -> u32 {
        let cycles = self.expected_cycles();
        let record = self.patch.record();
        match self.task {
            Task::Length => self.measure_length(job),
            Task::Step => {
                self.pass_over(table);
                if self.task == Task::Step {
                    self.step(job, table);
                }
            }
            Task::Crest => {
                if self.finds_crest(job, table) {
                    self.measure_crest(job, table);
                }
            }
            Task::Done => {}
            _ => {
                for _ in 0..CHUNK {
                    let task = self.task;
                    self.sweep(job, table);
                    if self.task != task {
                        break;
                    }
                }
            }
        }
        if self.patch.record() == record {
            cycles
        } else {
            cycles.saturating_add(cost::RECORD)
        }
    }

    /// Measures the length of the first and of the last line, then chooses the stations.
    fn measure_length(&mut self, job: &Job<'_>) {
        let spans = job.header.path_spans;
        let number = self.station % LENGTH_POINTS;
        let at = u64::from(number) * u64::from(spans) * (1 << 32) / u64::from(LENGTH_POINTS - 1);
        let span = u16::try_from(at >> 32).unwrap_or(0);
        let path = if span >= spans {
            SpanParameter {
                span: spans.saturating_sub(1),
                fraction: u64::MAX,
            }
        } else {
            SpanParameter {
                span,
                fraction: at << 32,
            }
        };
        let distance = if self.station < LENGTH_POINTS {
            0
        } else {
            self.direction.end
        };
        let frame = Frame::at(
            &mut self.patch,
            job,
            &mut self.cursor,
            &self.direction,
            path,
            distance,
        );
        let point = frame.ok().map(|frame| frame.point);
        if number == 0 {
            self.advanced = self.advanced.at_least(self.length_mm);
            self.length_mm = 0.0;
        } else if let (Some(from), Some(to)) = (self.before, point) {
            self.length_mm += distance_mm(&from, &to);
        }
        self.before = point;
        self.station += 1;
        if self.station == 2 * LENGTH_POINTS {
            let longest = self.length_mm.at_least(self.advanced);
            let header = job.header;
            let step = sqrt(8.0 * header.ball_radius_mm * header.scallop_mm);
            let period = header.feed_mm_s * header.period_s;
            let interval = (INTERVAL_PERIODS * period).at_least(INTERVAL_STEPS * step);
            self.stations = Stations::for_intervals(spans, longest / interval);
            self.limiter.turn_per_mm = (TURN_PER_PERIOD / period).at_most(1.0 / (RADIUS_STEPS * step));
            (self.task, self.station) = (Task::Clear, 0);
        }
    }

    fn next_station(&mut self, end: u16) {
        self.station += 1;
        if self.station < end {
            return;
        }
        let count = self.stations.count();
        (self.task, self.station) = match self.task {
            Task::Clear => {
                self.start_front();
                return;
            }
            Task::Step => {
                let [least, most] = self.steps.map(to_f32);
                self.is_level = self.is_straight && most <= LEVEL * least;
                let next = if self.is_level {
                    Task::Level
                } else {
                    Task::Forwards
                };
                (next, 0)
            }
            Task::Level => (Task::Eliminate, 0),
            Task::Shift => (Task::Eliminate, 0),
            Task::Forwards => (Task::Backwards, 0),
            Task::Backwards => {
                self.limiter.begin();
                (Task::Hull, 0)
            }
            Task::Hull => (Task::Apply, 0),
            Task::Apply if !self.again => {
                self.again = true;
                (Task::Forwards, 0)
            }
            Task::Apply => (Task::Eliminate, 0),
            Task::Eliminate => (Task::Substitute, 0),
            Task::Substitute => {
                self.is_lowered = false;
                if self.is_sharp && !self.is_shifted {
                    self.is_shifted = true;
                    (Task::Shift, 0)
                } else if self.is_level || self.is_shifted {
                    self.search.begin(self.crest_place(0));
                    (Task::Crest, 0)
                } else {
                    (Task::Compare, 0)
                }
            }
            Task::Compare if self.is_lowered && self.round < ROUNDS => {
                self.round += 1;
                self.again = false;
                (Task::Lower, 0)
            }
            Task::Compare if self.measured < MEASUREMENTS => {
                self.is_lowered = false;
                self.search.begin(self.crest_place(0));
                (Task::Crest, 0)
            }
            Task::Crest if self.is_lowered && self.is_level => {
                // Not straight after all, or with the common margin.
                self.is_level = false;
                (Task::Level, 0)
            }
            Task::Crest if self.is_lowered && self.measured < MEASUREMENTS => {
                self.is_shifted = false;
                self.measured += 1;
                self.round = 0;
                self.again = false;
                (Task::Lower, 0)
            }
            Task::Lower => (Task::Forwards, 0),
            _ => (Task::Done, count),
        };
    }

    /// A row of a sweep.
    fn sweep<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) {
        let count = self.stations.count();
        let station = self.station;
        let backwards = count.saturating_sub(station + 1);
        match self.task {
            Task::Clear => self.clear(job, table),
            Task::Eliminate => {
                spline::eliminate(table, job, [Column::Next, Column::NextSlope], station);
            }
            Task::Substitute => {
                spline::substitute(table, job, Column::NextSlope, backwards);
                self.finish_station(job, table, backwards);
            }
            Task::Compare => self.compare(job, table, station),
            Task::Forwards => self.limiter.sweep(table, job, station, true),
            Task::Backwards => self.limiter.sweep(table, job, backwards, false),
            Task::Hull if !self.limiter.add(table, job, station) => return,
            Task::Apply => {
                self.limiter.apply(table, station);
                self.floor(table, station);
                self.at_poles(table, station);
            }
            Task::Lower => self.lower(table, station),
            Task::Level => {
                let [least, _] = self.steps;
                let more = if self.is_level { LEVEL_MORE } else { 1.0 };
                let step = truncated(to_f32(least) * more);
                let next = table.word(Column::Front, station).saturating_add(step);
                table.set_word(Column::Next, station, next.min(self.direction.cap()));
                table.set_word(Column::Mark, station, UNMEASURED);
            }
            Task::Shift => {
                let next = table.word(Column::Front, station).saturating_add(self.shift);
                table.lower(station, next.min(self.direction.cap()));
            }
            _ => {}
        }
        self.next_station(count);
    }

    fn clear<W: DerefMut<Target = [i32]>>(&self, job: &Job<'_>, table: &mut Table<W>) {
        let station = self.station;
        let stations = self.stations;
        let abscissa = match station.checked_sub(1) {
            Some(before) => table.real(Column::Abscissa, before) + stations.length(job, before),
            None => 0.0,
        };
        table.set_real(Column::Abscissa, station, abscissa);
        for column in [Column::Front, Column::Slope, Column::Step, Column::Speed] {
            table.set_word(column, station, 0);
        }
        for column in [Column::Rise, Column::Fall, Column::Turn] {
            table.set_real(column, station, SLOPE_MAX);
        }
    }

    /// Passes over places so far beyond the boundary that no pass comes near them: the front there is as far as the limits allow.
    fn pass_over<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>) {
        let count = self.stations.count();
        let begun = self.station;
        for _ in 0..CHUNK {
            let station = self.station >> 1;
            if self.task != Task::Step || self.foot.next > 0 || self.is_near(table, station) {
                break;
            }
            let cap = self.direction.cap();
            if self.station & 1 == 1 {
                table.set_word(Column::Middle, station, cap);
            } else {
                table.set_word(Column::Next, station, cap);
                table.set_word(Column::Mark, station, UNMEASURED);
            }
            self.next_station(2 * count - 1);
        }
        if self.task == Task::Step && self.station != begun {
            self.foot.begin(self.step_place(self.station));
        }
    }

    /// Whether the front is before the boundary at a station near this one.
    fn is_near<W: DerefMut<Target = [i32]>>(&self, table: &Table<W>, station: u16) -> bool {
        let last = self.stations.count().saturating_sub(1);
        let from = station.saturating_sub(REACH);
        let to = station.saturating_add(REACH + 1).min(last);
        (from..=to).any(|at| table.word(Column::Front, at) < self.direction.end)
    }

    /// An evaluation of the step at a station, or in the middle of the interval after it.
    fn step<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) {
        let count = self.stations.count();
        let number = self.station;
        let (station, is_middle) = (number >> 1, number & 1 == 1);
        let is_end = !is_middle && (station == 0 || station + 1 == count);
        let mut tools = Tools {
            patch: &mut self.patch,
            job,
            cursor: &mut self.cursor,
            direction: &self.direction,
        };
        let front = match self.foot.work(&mut tools, table, is_end, MARGIN) {
            Found::More(half) => {
                if let (Some((frame, slope)), false) = (half, is_middle) {
                    self.note(table, station, &frame, slope);
                }
                return;
            }
            Found::Front(front) => front,
            // The tool reports the fault where it reaches it.
            Found::Faulty => table.word(Column::Front, station).saturating_add(FAULTY_STEP),
        };
        let own = front_at(table, station, is_middle, job);
        if own < self.direction.end {
            let step = front.saturating_sub(own);
            let [least, most] = self.steps;
            self.steps = [least.min(step), most.max(step)];
        }
        if is_middle {
            table.set_word(Column::Middle, station, front);
        } else {
            table.set_word(Column::Next, station, front);
            table.set_word(Column::Mark, station, UNMEASURED);
        }
        self.next_station(2 * count - 1);
        if self.task == Task::Step {
            self.foot.begin(self.step_place(self.station));
        }
    }

    /// Stations and the middles between them, in turns.
    fn step_place(&self, number: u16) -> Place {
        let intervals = self.stations.count().saturating_sub(1);
        let station = number >> 1;
        if number & 1 == 1 {
            (station, 1 << 30)
        } else if station < intervals {
            (station, 0)
        } else {
            (intervals.saturating_sub(1), i32::MAX)
        }
    }

    /// The limits at a station.
    fn note<W: DerefMut<Target = [i32]>>(
        &mut self,
        table: &mut Table<W>,
        station: u16,
        frame: &Frame,
        slope: f32,
    ) {
        let speed_squared = frame.speed_squared(slope);
        let area = frame.area();
        let is_pole = frame.g <= POLE_MAX * frame.e;
        let [start, end] = self.poles;
        if station == 0 {
            self.poles = [is_pole, end];
        } else if station + 1 == self.stations.count() {
            self.poles = [start, is_pole];
        }
        table.set_real(Column::Speed, station, sqrt(speed_squared));
        table.set_real(Column::Turn, station, speed_squared / area);
        let most = |down: f32| {
            let room = area + down * frame.f * TANGENT_MAX;
            if room > 1e-9 {
                (frame.e * TANGENT_MAX / room).at_most(SLOPE_MAX)
            } else {
                SLOPE_MAX
            }
        };
        table.set_real(Column::Rise, station, most(-1.0));
        table.set_real(Column::Fall, station, most(1.0));
    }

    /// Compares the curve with the step in the middle of an interval.
    fn compare<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>, station: u16) {
        if station + 1 >= self.stations.count() {
            return;
        }
        let length = self.stations.length(job, station);
        let [low, high] =
            [CURRENT, NEXT].map(|columns| Cubic::of(table, columns, station, length).value(1 << 30));
        let boundary = self.direction.end;
        if low.saturating_add(high) / 2 > boundary.saturating_add(boundary / 20) {
            return;
        }
        let step = table.word(Column::Middle, station).saturating_sub(low);
        let most = low.saturating_add(truncated(MIDDLE_TOLERANCE * to_f32(step)));
        self.note_excess(table, station, high.saturating_sub(most));
    }

    /// Notes that the front is too far at an interval.
    fn note_excess<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>, station: u16, excess: i32) {
        if excess > 0 {
            self.is_lowered = true;
            let lower = truncated(LOWER * to_f32(excess)).max(1);
            for at in [station, station + 1] {
                let most = table.word(Column::Scratch, at).max(lower);
                table.set_word(Column::Scratch, at, most);
            }
        }
    }

    /// At a pole every distance is the same: the front goes on as beside it, once that is limited.
    fn at_poles<W: DerefMut<Target = [i32]>>(&self, table: &mut Table<W>, station: u16) {
        let last = self.stations.count().saturating_sub(1);
        let [at_start, at_end] = self.poles;
        let ends = [
            (at_start && station == 2, [0, 1, 2]),
            (
                at_end && station == last,
                [last, last.saturating_sub(1), last.saturating_sub(2)],
            ),
        ];
        for (is_due, [pole, near, far]) in ends {
            if is_due {
                let [near, far] = [near, far].map(|at| table.word(Column::Next, at));
                let most = near
                    .saturating_add(near.saturating_sub(far))
                    .min(self.direction.cap());
                table.lower(pole, most);
                self.floor(table, pole);
            }
        }
    }

    /// A front never goes back.
    fn floor<W: DerefMut<Target = [i32]>>(&self, table: &mut Table<W>, station: u16) {
        let front = table.word(Column::Front, station);
        if table.word(Column::Next, station) < front {
            table.set_word(Column::Next, station, front);
        }
    }

    /// Takes a station into account of the finished front.
    fn finish_station<W: DerefMut<Target = [i32]>>(
        &mut self,
        job: &Job<'_>,
        table: &mut Table<W>,
        station: u16,
    ) {
        let (front, next) = (
            table.word(Column::Front, station),
            table.word(Column::Next, station),
        );
        if station + 1 == self.stations.count() {
            self.made = Some(Made::Beyond);
            self.advanced = 0.0;
            self.is_sharp = false;
            self.is_next_straight = true;
            self.shift = i32::MAX;
        } else {
            self.look_at_bend(job, table, station);
        }
        self.is_next_straight &= table.real(Column::NextSlope, station) == 0.0;
        if next < self.direction.end {
            self.made = Some(Made::Front);
        }
        if front < self.direction.end {
            self.shift = self.shift.min(next.saturating_sub(front));
            let advance = to_f32(next.saturating_sub(front)) * UNIT;
            self.advanced = self.advanced.at_least(advance);
        }
        table.set_word(Column::Scratch, station, 0);
    }

    /// Looks whether the curve turns too sharply at a station.
    fn look_at_bend<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &Table<W>, station: u16) {
        if table
            .word(Column::Next, station)
            .min(table.word(Column::Next, station + 1))
            >= self.direction.end
        {
            return;
        }
        let length = self.stations.length(job, station);
        let bend = Cubic::of(table, NEXT, station, length).point(0, length).bend;
        let speed = table.real(Column::Speed, station);
        let per_mm = bend.abs() / (table.real(Column::Turn, station) * speed);
        let most = (SHARP * self.limiter.turn_per_mm).at_most(SHARP_TURN / (speed * length));
        self.is_sharp |= per_mm > most;
    }

    /// Places at which crests are measured: three in each interval, its middle first, then both ends.
    fn crest_place(&self, number: u16) -> Place {
        let intervals = self.stations.count().saturating_sub(1);
        let station = number / PLACES;
        if station < intervals {
            let at = match number % PLACES {
                0 => 1 << 30,
                1 => 1 << 29,
                _ => 3 << 29,
            };
            (station, at)
        } else if number == PLACES * intervals {
            (0, 0)
        } else {
            (intervals.saturating_sub(1), i32::MAX)
        }
    }

    /// The station whose mark stands for a place.
    fn mark_of(&self, number: u16) -> u16 {
        let intervals = self.stations.count().saturating_sub(1);
        let station = number / PLACES;
        if station < intervals {
            station
        } else if number == PLACES * intervals {
            0
        } else {
            intervals.saturating_sub(1)
        }
    }

    /// Whether the front is bent so much in an interval that its middle alone does not tell the crest.
    fn is_bent<W: DerefMut<Target = [i32]>>(&self, job: &Job<'_>, table: &Table<W>, station: u16) -> bool {
        let length = self.stations.length(job, station);
        let bend = Cubic::of(table, NEXT, station, length)
            .point(1 << 30, length)
            .bend;
        let [front, next] =
            [CURRENT, NEXT].map(|columns| Cubic::of(table, columns, station, length).value(1 << 30));
        let step = to_f32(next.saturating_sub(front)) * UNIT;
        !(bend.abs() * length * length <= BENT * step)
    }

    /// Whether the crest is to be measured at a place.
    fn has_crest<W: DerefMut<Target = [i32]>>(&self, job: &Job<'_>, table: &Table<W>, number: u16) -> bool {
        let places = PLACES * self.stations.count().saturating_sub(1);
        let station = self.mark_of(number);
        let bit = if number < places { 1 } else { 2 };
        let is_middle = number.is_multiple_of(PLACES) || number >= places;
        if table.word(Column::Mark, station) & bit == 0 {
            return false;
        }
        let [low, high] = [station, station.saturating_add(1)].map(|at| table.word(Column::Front, at));
        let is_before = |front: i32| front < self.direction.end;
        (is_before(low) || is_before(high)) && (is_middle || self.is_bent(job, table, station))
    }

    /// Passes over places at which no crest is to be measured. Whether it came to one where it is.
    fn finds_crest<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) -> bool {
        for _ in 0..CHUNK {
            if self.search.next > 0 || self.has_crest(job, table, self.station) {
                return true;
            }
            self.end_crest(table);
            if self.task != Task::Crest {
                break;
            }
        }
        false
    }

    fn measure_crest<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) {
        let margin = if self.is_level {
            LEVEL_MARGIN
        } else {
            MEASURED_MARGIN
        };
        let mut tools = Tools {
            patch: &mut self.patch,
            job,
            cursor: &mut self.cursor,
            direction: &self.direction,
        };
        let Some(excess) = self.search.work(&mut tools, table, margin) else {
            return;
        };
        self.note_excess(table, self.mark_of(self.station), excess);
        self.end_crest(table);
    }

    /// Goes on to the next place.
    fn end_crest<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>) {
        let places = PLACES * self.stations.count().saturating_sub(1);
        let number = self.station;
        let station = self.mark_of(number);
        let bit = if number < places { 1 } else { 2 };
        if number >= places || (number + 1).is_multiple_of(PLACES) {
            let mark = table.word(Column::Mark, station);
            table.set_word(Column::Mark, station, mark & !bit);
        }
        self.next_station(places + 2);
        if self.task == Task::Crest {
            let place = self.crest_place(self.station);
            self.search.begin(place);
        }
    }

    /// Lowers a station by what was measured beside it.
    fn lower<W: DerefMut<Target = [i32]>>(&self, table: &mut Table<W>, station: u16) {
        let by = table.word(Column::Scratch, station);
        if by > 0 {
            let lower = table.word(Column::Next, station).saturating_sub(by);
            table.lower(station, lower);
            self.floor(table, station);
        }
    }
}

/// The current front at a station, or in the middle of the interval after it.
fn front_at<W: DerefMut<Target = [i32]>>(
    table: &Table<W>,
    station: u16,
    is_middle: bool,
    job: &Job<'_>,
) -> i32 {
    if is_middle {
        let length = table.stations().length(job, station);
        Cubic::of(table, CURRENT, station, length).value(1 << 30)
    } else {
        table.word(Column::Front, station)
    }
}

fn distance_mm(from: &[i64; 3], to: &[i64; 3]) -> f32 {
    const MM_PER_Q30: f32 = MM_PER_NM / 1_073_741_824.0;
    let mut sum = 0.0;
    for (from, to) in from.iter().zip(to) {
        let mm = wide_to_f32(to.wrapping_sub(*from)) * MM_PER_Q30;
        sum += mm * mm;
    }
    sqrt(sum)
}
