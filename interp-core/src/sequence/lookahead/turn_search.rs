//! The search for the turn to the next pass, and its stations.

use super::stations::check_height;
use super::{Lookahead, PassPlan, Task, check_travel, has_turns};
use crate::feed::Q10_BITS;
use crate::feed::limits::MotionLimits;
use crate::feed::stations::{Station, WINDOW, Window};
use crate::feed::turn::{self, Turn, TurnEnd};
use crate::job::AxisLimits;
use crate::job::program::Job;
use crate::pass::row_history::RowHistory;

impl Lookahead {
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
    pub(super) fn look_across(&mut self, job: &Job<'_>, out: &PassPlan) -> Task {
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
        // The last piece of the pass may have been longer, or shorter.
        let [start, end] = self.range;
        let part = end.saturating_sub(start).checked_div(u64::from(self.cells));
        self.cell_fraction = part.unwrap_or(u64::MAX);
        self.window = Window::EMPTY;
        (self.station, self.arc_mm) = (0, 0.0);
        Task::Start
    }

    /// A station at the start of the next pass.
    pub(super) fn visit_start(&mut self, job: &Job<'_>, axes: &AxisLimits) -> Task {
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
        self.window.push(located.cl_nm, self.arc_mm, None);
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
    pub(super) fn find_turn(&mut self, job: &Job<'_>, axes: &AxisLimits, round: u8) -> Task {
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
    pub(super) fn bound_turn(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        index: u16,
        out: &mut PassPlan,
    ) -> Task {
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
    pub(super) fn push_half(&self, second: bool, index: u16, out: &mut PassPlan) {
        let from_nm = if second {
            0
        } else {
            u32::try_from(out.tail_q10 >> Q10_BITS).unwrap_or(0)
        };
        let station = Station {
            arc_nm: from_nm.saturating_add(self.turn.station_nm(index)),
            q: self.turn.station(second, index),
        };
        out.plan.stations.push(station);
    }

    /// Begins to look for a turn where there may be one. `rows`: those of the last passes.
    pub(super) fn choose_link(
        &mut self,
        job: &Job<'_>,
        axes: &AxisLimits,
        rows: Option<&RowHistory>,
        out: &PassPlan,
    ) -> Task {
        let rests = self.without > 0;
        self.without = self.without.saturating_sub(1);
        let has_rows = out.next.zip(rows).is_none_or(|(next, rows)| {
            rows.may_turn(job.header, [out.route.side, next.side], |span| {
                job.side_width(span)
            })
        });
        if !rests && has_rows && self.may_turn(job, axes, out) {
            Task::Across
        } else {
            Task::Done
        }
    }
}

/// Passes without a turn after one whose plan had to be slowed down for it.
const PASSES_WITHOUT: u8 = 3;
