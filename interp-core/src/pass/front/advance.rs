//! The next front, made in portions in the planning of each period.

mod curve;
mod measuring;
mod stepping;
mod within;

use core::ops::DerefMut;

use crate::fault::{Fault, FaultKind};
use crate::job::program::Job;
use crate::job::stations::Stations;
use crate::math::arith::{to_f32, truncated};
use crate::pass::front::cost;
use crate::pass::front::crest::CrestSearch;
use crate::pass::front::foot::FootStep;
use crate::pass::front::frame::FreePatch;
use crate::pass::front::limits::Limiter;
use crate::pass::front::side::{Direction, SideCursor};
use crate::pass::front::spline;
use crate::pass::front::table::{Column, Table, UNMEASURED};

/// Most rounds in which a front is lowered because its curve is too far between the stations.
const ROUNDS: u8 = 4;
/// Most rounds in which the crests are measured and the front is lowered.
const MEASUREMENTS: u8 = 3;
/// Ratio of the greatest to the least step up to which the front after a straight one stays straight.
const LEVEL: f32 = 1.002;
/// Factor on the step of a front that stays straight: it uses the whole limit but for an error.
const LEVEL_MORE: f32 = 1.0034;
/// Rows of a sweep, or places without a crest, in one portion.
const ROWS_A_PORTION: u16 = 16;
/// Greatest slope.
const SLOPE_MAX: f32 = 1e9;
/// Least advance of a front, as a share of the whole side parameter.
const ADVANCE_MIN: f32 = 1e-6;

/// The next portion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Task {
    /// Measure the length of the passes.
    Length,
    /// Find whether the boundary ahead is a single point, and whether the first line is one.
    Ahead,
    /// Set the front to the first line.
    Clear,
    /// Step at each station and in the middle of each interval.
    Step,
    /// Give stations where the surface is not evaluated the steps beside them.
    FillForwards,
    FillBackwards,
    /// A straight front at the least step, in place of the limits.
    Level,
    /// The current front, moved.
    Shift,
    /// The point ahead, in place of the limits.
    Point,
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

/// Result of making a front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Made {
    /// A front with a part before the boundary.
    Front,
    /// A straight front, too short for its stations or beside a point: the line at this distance from the first one.
    Line(i32),
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
    /// The next one is made straight: an interval between its stations would be shorter than a period's arc, mm, or it would pass by a point ahead. Its length, and where it is.
    is_short: bool,
    period_mm: f32,
    front_mm: f32,
    line: i32,
    /// The current front is before the boundary everywhere.
    is_whole: bool,
    /// The curve turns too sharply; it was replaced by the current one, moved by the least advance, units of the fronts.
    is_sharp: bool,
    is_shifted: bool,
    shift: i32,
    round: u8,
    measured: u8,
    is_lowered: bool,
    /// Most by which a station is to be lowered.
    excess: i32,
    /// The crests of the intervals before this one are measured again.
    again_before: u16,
    stations: Stations,
    /// The intervals between the stations are longer than a step-over may be.
    is_coarse: bool,
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
    /// Path of the region, places; the stations around it, and those that are stepped; some of them could not be.
    extent: Option<[i32; 2]>,
    within: [u16; 2],
    stepped: [u16; 2],
    has_gaps: bool,
    /// The passes' ends are poles.
    poles: [bool; 2],
    /// The boundary ahead is a single point, and the first line.
    is_point_ahead: bool,
    is_point_after: bool,
    /// Every station steps as far as the point, or is covered; some come within a step of it; the next pass is the point.
    reaches_point: bool,
    is_near_point: bool,
    is_on_point: bool,
    /// The current front is half a step before the point, or nearer.
    is_covered: bool,
    /// The surface is faulty at a step.
    fault: Option<Fault>,
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
        is_short: false,
        period_mm: 0.0,
        front_mm: 0.0,
        line: 0,
        is_whole: true,
        is_sharp: false,
        is_shifted: false,
        shift: 0,
        round: 0,
        measured: 0,
        is_lowered: false,
        excess: 0,
        again_before: 0,
        stations: Stations { spans: 1, bits: 6 },
        is_coarse: false,
        direction: Direction::FROM_EDGE,
        cursor: SideCursor::NONE,
        patch: FreePatch::NONE,
        limiter: Limiter::NONE,
        foot: FootStep::NONE,
        search: CrestSearch::NONE,
        before: None,
        length_mm: 0.0,
        advanced: 0.0,
        extent: None,
        within: [0; 2],
        stepped: [0; 2],
        has_gaps: false,
        poles: [false; 2],
        is_point_ahead: false,
        is_point_after: false,
        reaches_point: true,
        is_near_point: false,
        is_on_point: false,
        is_covered: false,
        fault: None,
        made: None,
    };

    /// Begins with the front after the first line in this direction. `is_first`: the stations are not chosen yet.
    pub(crate) const fn begin(&mut self, cursor: SideCursor, direction: Direction, is_first: bool) {
        self.direction = direction;
        self.is_straight = true;
        self.made = None;
        self.station = 0;
        if is_first {
            self.extent = None;
            self.cursor = cursor;
            self.patch.forget();
            self.advanced = 0.0;
            self.length_mm = 0.0;
            self.before = None;
        }
        self.task = if is_first { Task::Length } else { Task::Ahead };
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
        self.is_short = false;
        (self.front_mm, self.line, self.is_whole) = (0.0, i32::MAX, true);
        self.is_shifted = false;
        self.fault = None;
        (self.reaches_point, self.is_covered) = (true, true);
        (self.is_near_point, self.is_on_point) = (false, false);
        self.has_gaps = false;
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
    /// Where the front does not move: that of the surface ahead, or [`FaultKind::IntervalTooSmall`].
    pub(crate) fn made(&self) -> Option<Result<Made, Fault>> {
        if self.has_work() {
            return None;
        }
        let made = self.made?;
        Some(if self.advanced < ADVANCE_MIN && made != Made::Beyond {
            let stalled = Fault::new(FaultKind::IntervalTooSmall, self.advanced);
            Err(self.fault.unwrap_or(stalled))
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
            Task::Length | Task::Ahead => cost::LENGTH,
            Task::Step => cost::of(&cost::STEP, self.foot.next),
            Task::Crest => cost::of(&cost::CREST, self.search.next),
            Task::Clear
            | Task::Apply
            | Task::Level
            | Task::Shift
            | Task::Point
            | Task::FillForwards
            | Task::FillBackwards => cost::COPY,
            Task::Forwards | Task::Backwards | Task::Lower | Task::Eliminate => cost::SWEEP,
            Task::Compare => cost::COMPARE,
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
            Task::Ahead => self.look_at_boundary(job),
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
                for _ in 0..ROWS_A_PORTION {
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

    /// By how much a front that would be too sharp is moved: the least advance; half the least step where a station would not advance at all.
    fn shift(&self) -> i32 {
        let [least, _] = self.steps;
        if self.shift < least / 16 {
            least / 2
        } else {
            self.shift
        }
    }

    /// Goes on to the next station, and after the last one of these to the next task.
    fn next_station(&mut self, end: u16) {
        self.station += 1;
        if self.station < end {
            return;
        }
        self.task = match self.task {
            Task::Clear => {
                self.start_front();
                return;
            }
            Task::Step => self.after_stepping(),
            Task::FillForwards => Task::FillBackwards,
            Task::FillBackwards => self.after_steps(false),
            Task::Level | Task::Shift | Task::Point => Task::Eliminate,
            Task::Lower => Task::Forwards,
            Task::Forwards => Task::Backwards,
            Task::Backwards => {
                self.limiter.begin();
                Task::Hull
            }
            Task::Hull => Task::Apply,
            Task::Apply if !self.again => {
                self.again = true;
                Task::Forwards
            }
            Task::Apply => Task::Eliminate,
            Task::Eliminate => Task::Substitute,
            Task::Substitute => self.after_spline(),
            Task::Compare => self.after_comparison(),
            Task::Crest if self.is_lowered && self.is_on_point => {
                self.start_front();
                self.reaches_point = false;
                return;
            }
            Task::Crest => self.after_crests(),
            _ => Task::Done,
        };
        self.station = match self.task {
            Task::Done => self.stations.count(),
            _ => 0,
        };
    }

    /// Every station has made its step.
    fn after_stepping(&mut self) -> Task {
        if self.is_point_ahead && (self.is_covered || self.reaches_point) {
            self.is_on_point = true;
            return Task::Point;
        }
        let [least, most] = self.steps.map(to_f32);
        let [from, to] = self.stepped;
        self.is_short =
            self.is_whole && self.front_mm < self.period_mm * to_f32(i32::from(to.saturating_sub(from)));
        let is_even = most > 0.0 && most <= LEVEL * least;
        self.is_level = self.is_straight && is_even && !self.is_short;
        self.is_short |= self.is_near_point && !self.is_level;
        self.after_steps(self.has_gaps)
    }

    /// The curve through the stations is made.
    fn after_spline(&mut self) -> Task {
        self.is_lowered = false;
        if self.is_sharp && !self.is_shifted && !self.is_short {
            self.is_shifted = true;
            Task::Shift
        } else if self.is_point_ahead && self.is_covered {
            Task::Done
        } else if self.is_level || self.is_short || self.is_shifted || self.is_on_point {
            self.excess = 0;
            self.begin_crests();
            Task::Crest
        } else {
            Task::Compare
        }
    }

    /// The curve was compared with the steps between its stations.
    fn after_comparison(&mut self) -> Task {
        if self.is_lowered && self.round < ROUNDS {
            self.round += 1;
            self.again = false;
            Task::Lower
        } else if self.measured < MEASUREMENTS {
            self.is_lowered = false;
            self.begin_crests();
            Task::Crest
        } else {
            Task::Done
        }
    }

    /// The crests were measured.
    fn after_crests(&mut self) -> Task {
        let is_again = self.is_lowered && self.measured < MEASUREMENTS;
        if self.is_short && is_again {
            self.measured += 1;
            // What is beyond the boundary is a pass on it.
            self.line = self.line.min(self.direction.end).saturating_sub(self.excess);
            Task::Level
        } else if self.is_short {
            Task::Done
        } else if self.is_lowered && self.is_level {
            // Not straight after all, or with the common margin.
            self.is_level = false;
            Task::Level
        } else if is_again {
            self.is_shifted = false;
            self.measured += 1;
            self.round = 0;
            self.again = false;
            Task::Lower
        } else {
            Task::Done
        }
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
                let end = self.direction.end;
                spline::keep_before(table, job, [Column::Next, Column::NextSlope], backwards + 1, end);
                if backwards == 0 {
                    spline::keep_before(table, job, [Column::Next, Column::NextSlope], 0, end);
                }
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
            Task::FillForwards => self.fill(table, station, station.checked_sub(1)),
            Task::FillBackwards => self.fill(table, backwards, Some(backwards.saturating_add(1))),
            Task::Level => {
                let [least, _] = self.steps;
                let more = if self.is_level { LEVEL_MORE } else { 1.0 };
                let step = truncated(to_f32(least) * more);
                let next = if self.is_short {
                    self.line
                } else {
                    table.word(Column::Front, station).saturating_add(step)
                };
                table.set_word(Column::Next, station, next.min(self.direction.cap()));
                table.set_word(Column::Mark, station, UNMEASURED);
            }
            Task::Point => {
                table.set_word(Column::Next, station, self.direction.cap());
                table.set_word(Column::Mark, station, UNMEASURED);
            }
            Task::Shift => {
                let next = table.word(Column::Front, station).saturating_add(self.shift());
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
}
