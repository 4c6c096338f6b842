//! The step at each station and in the middle of each interval.

use core::ops::DerefMut;

use super::{Advance, ROWS_A_PORTION, SLOPE_MAX, Task};
use crate::job::program::Job;
use crate::job::stations::Stations;
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use crate::math::vec3::Vec3;
use crate::pass::front::crest::{CURRENT, Place, Tools};
use crate::pass::front::foot::Found;
use crate::pass::front::frame::{Frame, MARGIN};
use crate::pass::front::side::WHOLE;
use crate::pass::front::spline::Cubic;
use crate::pass::front::table::{Column, Table, UNMEASURED};
use crate::sample::SpanParameter;

/// Points on the first line and on the last one by which the pass's length is measured.
const LENGTH_POINTS: u16 = 9;
/// Shortest interval between stations, in periods at the feed.
const INTERVAL_PERIODS: f32 = 2.0;
/// Shortest interval between stations, in step-overs.
const INTERVAL_STEPS: f32 = 0.5;
/// [`INTERVAL_STEPS`] of a pass shorter than [`SHORT_PERIODS`].
const INTERVAL_STEPS_SHORT: f32 = 2.0;
/// Duration at the feed, in periods, below which a pass within axis limits has fewer stations: a front of 64 intervals is made in some 300 periods, the plan of a pass in as
/// many, and the pass is slowed to both.
const SHORT_PERIODS: f32 = 1_000.0;
/// Greatest turn of a pass in one period, rad.
const TURN_PER_PERIOD: f32 = 0.05;
/// Least radius of a pass in the tangent plane, in step-overs.
const RADIUS_STEPS: f32 = 1.0;
/// Tangent of the greatest angle of a pass to the lines of the side parameter: 80 degrees.
const TANGENT_MAX: f32 = 5.671_282;
/// Step where the surface is faulty, units of the fronts.
const FAULTY_STEP: i32 = WHOLE / 256;
/// Stations beside those before the boundary up to which a front is stepped: the spline through them forgets what lies farther away.
pub(super) const REACH: u16 = 8;
/// Squares of the derivatives' lengths, side to path, below which an end of the passes is a pole.
const POLE_MAX: f32 = 1e-10;

impl Advance {
    /// Measures the length of the first and of the last line, then chooses the stations.
    pub(super) fn measure_length(&mut self, job: &Job<'_>) {
        let spans = job.header.path_spans;
        let number = self.station % LENGTH_POINTS;
        let at = self.length_at(spans, number, LENGTH_POINTS - 1);
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
            let way = Vec3::between_q30(&from, &to);
            self.length_mm += sqrt(way.dot(way));
        }
        self.before = point;
        self.station += 1;
        if self.station == 2 * LENGTH_POINTS {
            let longest = self.length_mm.at_least(self.advanced) * self.extent_inverse(spans);
            let header = job.header;
            let step = sqrt(8.0 * header.ball_radius_mm * header.scallop_mm);
            let period = header.feed_mm_s * header.period_s;
            self.is_coarse = header.axes.is_some() && longest < SHORT_PERIODS * period;
            let steps = if self.is_coarse {
                INTERVAL_STEPS_SHORT
            } else {
                INTERVAL_STEPS
            };
            let interval = (INTERVAL_PERIODS * period).at_least(steps * step);
            self.stations = Stations::for_intervals(spans, longest / interval);
            self.period_mm = period;
            self.limiter.turn_per_mm = (TURN_PER_PERIOD / period).at_most(1.0 / (RADIUS_STEPS * step));
            self.choose_range();
            (self.task, self.station) = (Task::Ahead, 0);
        }
    }

    /// Looks whether the boundary ahead is a single point, then the first line.
    pub(super) fn look_at_boundary(&mut self, job: &Job<'_>) {
        let middle = SpanParameter {
            span: 0,
            fraction: 1 << 63,
        };
        let is_first_line = self.station > 0;
        let at = if is_first_line { 0 } else { self.direction.end };
        let direction = &self.direction;
        let frame = Frame::at(&mut self.patch, job, &mut self.cursor, direction, middle, at);
        let is_point = frame.is_ok_and(|frame| frame.e <= POLE_MAX * frame.g);
        if is_first_line {
            self.is_point_after = is_point;
            (self.task, self.station) = (Task::Clear, 0);
        } else {
            self.is_point_ahead = is_point;
            self.station = 1;
        }
    }

    /// Passes over places so far beyond the boundary that no pass comes near them: the front there is as far as the limits allow.
    pub(super) fn pass_over<W: DerefMut<Target = [i32]>>(&mut self, table: &mut Table<W>) {
        let count = self.stations.count();
        let begun = self.station;
        for _ in 0..ROWS_A_PORTION {
            let station = self.station >> 1;
            if self.task != Task::Step || self.foot.next > 0 || self.is_near(table, station) {
                break;
            }
            let cap = self.direction.cap();
            if self.station & 1 == 1 {
                table.set_word(Column::Middle, station, cap);
            } else if self.is_stepped(station) {
                table.set_word(Column::Next, station, cap);
                table.set_word(Column::Mark, station, UNMEASURED);
            } else {
                self.leave_gap(table, station);
            }
            self.next_station(2 * count - 1);
        }
        if self.task == Task::Step && self.station != begun {
            self.foot.begin(self.step_place(self.station));
        }
    }

    /// Whether the front is before the boundary at a station near this one.
    fn is_near<W: DerefMut<Target = [i32]>>(&self, table: &Table<W>, station: u16) -> bool {
        let [first, last] = self.within;
        let from = station.saturating_sub(REACH).max(first);
        let to = station.saturating_add(REACH + 1).min(last);
        self.is_stepped(station) && (from..=to).any(|at| table.word(Column::Front, at) < self.direction.end)
    }

    /// An evaluation of the step at a station, or in the middle of the interval after it.
    pub(super) fn step<W: DerefMut<Target = [i32]>>(&mut self, job: &Job<'_>, table: &mut Table<W>) {
        let count = self.stations.count();
        let number = self.station;
        let (station, is_middle) = (number >> 1, number & 1 == 1);
        let is_end = !is_middle && (station == 0 || station + 1 == count);
        let mut tools = Tools {
            patch: &mut self.patch,
            job,
            cursor: &mut self.cursor,
            direction: &self.direction,
            is_point_ahead: self.is_point_ahead,
        };
        let front = match self.foot.work(&mut tools, table, is_end, MARGIN) {
            Found::More(half) => {
                if let (Some((frame, slope)), false) = (half, is_middle) {
                    self.note(table, station, &frame, slope);
                    self.front_mm += table.real(Column::Speed, station) * self.stations.length(job, station);
                }
                return;
            }
            Found::Front(front) => front,
            // In a region the pass may be elsewhere.
            Found::Faulty(fault) if self.extent.is_some() => {
                self.fault = Some(fault);
                if is_middle {
                    table.set_word(Column::Middle, station, self.direction.cap());
                } else {
                    self.leave_gap(table, station);
                }
                self.end_step(count);
                return;
            }
            // The tool reports the fault where it reaches it.
            Found::Faulty(fault) => {
                self.fault = Some(fault);
                table.word(Column::Front, station).saturating_add(FAULTY_STEP)
            }
        };
        let own = front_at(table, station, is_middle, job);
        let is_within = self.is_within(station);
        if is_within {
            self.line = self.line.min(front);
            self.is_whole &= own < self.direction.end;
            self.note_point(own, front);
        }
        if own < self.direction.end && is_within {
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
        self.end_step(count);
    }

    fn end_step(&mut self, count: u16) {
        self.next_station(2 * count - 1);
        if self.task == Task::Step {
            self.foot.begin(self.step_place(self.station));
        }
    }

    /// Notes how near the next front is to a boundary that is a single point, where it would bend sharply. The point ahead is a pass for all stations, or for none: a front
    /// through it would leave and enter it in a corner.
    fn note_point(&mut self, own: i32, front: i32) {
        let half = self.foot.half_step();
        let step = half.saturating_mul(2);
        if self.is_point_ahead {
            let end = self.direction.end;
            let is_covered = own >= end.saturating_sub(half);
            self.is_covered &= is_covered;
            self.reaches_point &= front >= end || is_covered;
            self.is_near_point |= front >= end.saturating_sub(step);
        }
        self.is_near_point |= self.is_point_after && own <= step;
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
