//! Stretches of a pass on a front: pieces of one path span, together long enough for differences.

use super::stations::widen;
use super::{DifferencesOf, Lookahead, PATCHES, PassPlan, STATIONS, STRETCH_MIN_MM, Task, has_turns};
use crate::fault::Result;
use crate::feed::limits::{AxisMotion, MotionLimits};
use crate::feed::stations::{CELL_FINE_MM, CELLS_FINE, Derivatives, PARTS_MAX, Station, Window};
use crate::feed::{MM_PER_Q10, Q10_BITS, to_q10, turn};
use crate::job::AxisLimits;
use crate::job::program::Job;
use crate::math::arith::{fraction_to_f32, power_of_two, sqrt, truncated};
use crate::math::number::{Bounded, MM_PER_NM, to_f32};
use crate::pass::route::Piece;
use crate::surface::PathSpeed;

/// Length that a stretch leaves to the rest of its span, and the least of one that is looked at again, mm.
const STRETCH_KNOT_MM: f32 = 0.3;
/// The least with derivatives of its own, mm.
const STRETCH_SHORT_MM: f32 = 0.02;
const PIECE_SHORT_MM: f32 = 0.002;
/// Fewest cells of a stretch that is one piece: the derivative of its directions is straight. Least length of a cell of any stretch, mm.
const CELLS_OF_PIECE: u16 = 2;
const CELL_FRONT_MIN_MM: f32 = 0.03;

/// Change of a second and of a third derivative of an axis from which on a station within a stretch is kept, as shares of what takes the axis to its limit.
const NOTABLE_SECOND: f32 = 0.03;
const NOTABLE_THIRD: f32 = 0.06;
/// Stations kept of those looked at on a piece up to which these shares hold, and by how much more they are at most where there is room for fewer.
const KEPT_SHARE: f32 = 1.0;
const LESS_NOTABLE_MAX: f32 = 1.4;
/// Turn within a cell, and its change from one to the next, from which on a stretch is looked at again with shorter cells, rad; how often they are halved.
const TURN_OF_CELL: f32 = 0.06;
const CHANGE_OF_CELL: f32 = 0.004;
const HALVINGS_MAX: u8 = 3;
/// The same on the patch of a straight pass of one, and on one into which the ball hardly fits, or where it goes around an edge: all of it is looked at again.
const TURN_STRAIGHT: f32 = 0.12;
const CHANGE_STRAIGHT: f32 = 0.04;
/// How often its cells are halved, and length of one that is not, mm: by differences of directions, and of positions.
const HALVINGS_DIRECTIONS: u8 = 6;
const HALVED_DIRECTIONS_MIN_MM: f32 = 0.002;
const HALVINGS_POSITIONS: u8 = 4;
pub(super) const HALVED_MIN_MM: f32 = 0.03;
/// Stations that are left for pieces beyond those expected.
const SPARE: u16 = 6;

/// Most path spans of a pass on a front that are divided into stretches.
const SPANS_DIVIDED: u16 = 60;

impl Lookahead {
    /// Length of a part of the path span on this patch, roughly, mm; 0 where it is not known.
    fn part_mm(&self, part: u64) -> f32 {
        let length = fraction_to_f32(part) / self.speed.inv_speed;
        if length.is_finite() { length } else { 0.0 }
    }

    /// Begins a stretch of a pass on a front. Its derivatives are differences of directions.
    pub(super) fn begin_stretch(&mut self, out: &mut PassPlan) -> Result<()> {
        let PathSpeed {
            inv_speed,
            log_speed_derivative,
        } = self.patch.start().checked()?;
        self.speed = PathSpeed {
            inv_speed: inv_speed * self.patch.per_mm,
            log_speed_derivative,
        };
        if self.halvings > 0 {
            // The same stretch again.
            self.stretch = [self.piece; 2];
            return Ok(());
        }
        self.begun = out.plan.stations.count();
        let span = self.piece.position.span;
        self.by_pieces = self
            .bends_until
            .is_some_and(|(bent, end)| bent == span && self.piece.start() < end);
        let [_, before] = self.stretch;
        // Between stations of a front, not at a knot of the surface.
        let is_at_knot = before.front.is_none_or(|front| front.is_at_knot());
        self.may_join = before.position.span == self.piece.position.span && !is_at_knot;
        self.stretch = [self.piece; 2];
        if self.patches > 0 {
            return Ok(());
        }
        self.may_join = false;
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
        out.set_cells(1);
        Ok(())
    }

    /// Sets what notable changes of derivatives are measured by, for a pass.
    pub(super) fn measure_by(&mut self, job: &Job<'_>, axes: &AxisLimits) {
        self.most = if has_turns(job) {
            STATIONS - turn::STATIONS
        } else {
            STATIONS
        };
        let feed = job.header.feed_mm_s;
        let limits = MotionLimits::new(axes, feed, job.header.period_s);
        self.per_limit = limits.inverse.map(
            |AxisMotion {
                 acceleration, jerk, ..
             }| [acceleration, jerk],
        );
        let inverse = 1.0 / feed;
        self.slowest = [inverse * inverse, inverse * inverse * inverse];
    }

    /// Lengthens the stretch by a piece, or ends it.
    pub(super) fn extend_stretch(&mut self, job: &Job<'_>, out: &mut PassPlan) -> Task {
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
            out.note_first(self.patches / out.group.max(1), 0);
        }
        let [start, end] = self.range;
        let length = self.part_mm(end.saturating_sub(start));
        let whole = |value: f32| u16::try_from(truncated(value)).unwrap_or(u16::MAX);
        let share = power_of_two(-i32::from(self.halvings));
        let fewest = if self.by_pieces {
            CELLS_OF_PIECE
        } else {
            CELLS_FINE
        };
        let fine = whole(length / CELL_FINE_MM).max(fewest) << self.halvings;
        // Near a rest the tool is slow, and rounding does no harm.
        let least = if self.by_pieces {
            fine
        } else if self.patches == 0 || self.after.is_none() {
            CELLS_FINE
        } else {
            2
        };
        let most = whole(length / (CELL_FRONT_MIN_MM * share)).max(least);
        self.is_short = length
            < if self.by_pieces {
                PIECE_SHORT_MM
            } else {
                STRETCH_SHORT_MM
            };
        self.looks = if self.is_short {
            1
        } else {
            fine.min(most).clamp(1, PARTS_MAX)
        };
        self.cells = self.looks;
        let part = end.saturating_sub(start).checked_div(u64::from(self.cells));
        self.cell_fraction = part.unwrap_or(u64::MAX);
        self.window = Window::EMPTY;
        self.arc_mm = 0.0;
        self.station = 0;
        Task::Station
    }

    /// Whether the stretch ends with this piece: at a knot of the surface, where the path may bend; elsewhere it has the length for differences, and leaves it to the rest of
    /// the span.
    fn is_long_enough(&self, last: &Piece, out: &PassPlan) -> bool {
        let [start, end] = self.range;
        let [_, pass_end] = out.route.ends;
        let span = last.position.span;
        // Each span that is left takes a stretch.
        let spans = span.abs_diff(pass_end.span) + 2;
        let has_room = self.least_mm < f32::MAX
            && self.patches + spans < PATCHES
            && out.plan.stations.count() + 2 * spans < STATIONS;
        if self.by_pieces || last.front.is_some_and(|front| front.is_at_knot()) {
            return has_room;
        }
        let span_end = if span == pass_end.span {
            out.route.turned(pass_end.fraction)
        } else {
            u64::MAX
        };
        let least = if self.halvings > 0 {
            self.least_mm.at_most(STRETCH_KNOT_MM)
        } else {
            self.least_mm
        };
        has_room
            && self.part_mm(end.saturating_sub(start)) >= least
            && self.part_mm(span_end.saturating_sub(end)) >= STRETCH_KNOT_MM
    }

    /// Begins the stretch, or the patch of a straight pass, again with cells half as long where the path turns too far within one. Returns the task by which it does.
    pub(super) fn looks_finer(&mut self, out: &mut PassPlan) -> Option<Task> {
        let is_coarse = core::mem::take(&mut self.is_coarse);
        let is_on_front = self.is_on_front();
        let is_by_directions = !is_on_front && self.differences == DifferencesOf::Directions;
        let (most, least_mm) = match self.differences {
            _ if is_on_front => (HALVINGS_MAX, 0.0),
            DifferencesOf::Directions => (HALVINGS_DIRECTIONS, HALVED_DIRECTIONS_MIN_MM),
            DifferencesOf::Positions => (HALVINGS_POSITIONS, HALVED_MIN_MM),
            DifferencesOf::PositionsAfterAll => (1 + HALVINGS_POSITIONS, HALVED_MIN_MM),
        };
        let is_last = self.halvings >= most || self.arc_mm < least_mm * f32::from(self.cells);
        let is_known_coarsely = is_last && !is_by_directions && (!self.adapts || self.keeps_even);
        if !is_coarse || is_known_coarsely {
            (self.halvings, self.keeps_even) = (0, false);
            return None;
        }
        if is_last {
            if is_by_directions {
                self.differences = DifferencesOf::PositionsAfterAll;
                self.adapts = !self.may_turn;
                (self.halvings, self.looks) = (1, self.first_looks);
            } else {
                // Too coarsely for stations of its own.
                self.keeps_even = true;
            }
            out.plan.stations.truncate(self.begun);
            self.divide_patch();
            return Some(Task::Station);
        }
        self.halvings += 1;
        out.plan.stations.truncate(self.begun);
        if !is_on_front {
            self.looks = (2 * self.looks).min(PARTS_MAX);
            self.divide_patch();
            return Some(Task::Station);
        }
        // The first stretch may now be too short.
        self.has_derivatives &= self.begun > 0;
        let [first, _] = self.stretch;
        self.piece = first;
        if !self.by_pieces && self.has_room_for_pieces(out) {
            let [_, end] = self.range;
            self.bends_until = Some((first.position.span, end));
            self.by_pieces = true;
        }
        Some(Task::Patch)
    }

    /// Whether there is room for a stretch of each piece of the one that is looked at, besides those of the rest of the pass.
    fn has_room_for_pieces(&self, out: &PassPlan) -> bool {
        let [first, last] = self.stretch;
        let (Some(from), Some(to)) = (first.front, last.front) else {
            return false;
        };
        let done_mm = to_f32(self.start_q10) * MM_PER_Q10;
        let rest = truncated((self.pass_mm - done_mm) / self.least_mm);
        let rest = u16::try_from(rest).unwrap_or(PATCHES);
        let [_, pass_end] = out.route.ends;
        let spans = first.position.span.abs_diff(pass_end.span) + 2;
        let wanted = (to.number - from.number)
            .saturating_add(rest)
            .saturating_add(spans);
        self.least_mm < f32::MAX && self.patches.saturating_add(wanted) < PATCHES
    }

    /// Whether the stretch or the patch is looked at again where its cells are too long.
    const fn looks_again(&self) -> bool {
        self.adapts || self.may_turn || self.is_on_front()
    }

    /// Notes whether the path bends and bends back within the last cell.
    pub(super) fn note_within(&mut self) {
        if self.station == 0 || !self.looks_again() {
            return;
        }
        let cell = self.window.spacing_mm();
        let most = if self.is_on_front() {
            CHANGE_OF_CELL * cell
        } else {
            CHANGE_STRAIGHT * cell * self.window.greatest()
        };
        self.is_coarse |= self.window.third_within() > most;
    }

    /// Notes whether the path turns too far within a cell that these derivatives were taken over.
    pub(super) fn note_turn(&mut self, q: &Derivatives) {
        let cell = self.window.spacing_mm();
        let (mut way, mut turn, mut change) = (cell, TURN_OF_CELL, CHANGE_OF_CELL);
        if !self.is_on_front() {
            (turn, change) = (TURN_STRAIGHT, CHANGE_STRAIGHT);
            // Where such a patch rolls off, the centre moves much farther than the contact.
            for [first, ..] in q {
                way = way.at_least(first.abs() * cell);
            }
        }
        let [_, _, noise] = self.window.noise();
        for [_, second, third] in q {
            self.is_coarse |= second.abs() * cell * cell > turn * way
                || (third.abs() - noise) * cell * cell * cell > change * way;
        }
    }

    /// Stores the derivatives at a place of the window in the station at the stretch's start, or appends a station: at its end, and wherever the derivatives have changed
    /// notably since the last one. Between stations they are taken for linear.
    pub(super) fn keep_derivatives(&mut self, station: u16, at: usize, out: &mut PassPlan) {
        let q = self.window.derivatives(at);
        if self.looks_again() {
            self.note_turn(&q);
        }
        let here = Station {
            arc_nm: self.arc_nm(self.window.arc_mm(at)),
            q,
        };
        if station == 0 {
            self.store_start(1, q, out);
            self.join(out);
            (self.before, self.missed) = (None, None);
            return;
        }
        let is_end = station == self.cells;
        let is_even = !self.is_on_front() && station.is_multiple_of(self.looks);
        let is_kept = is_end || is_even;
        let (room, tolerance) = self.room(out);
        if let Some(last) = out.plan.stations.back_mut(1)
            && self.is_notable(&last.q, &q, tolerance)
        {
            let before = self.before.take();
            let (wants_before, wants_here) = match &before {
                Some(before) => (true, self.is_notable(&before.q, &q, tolerance)),
                None => (false, true),
            };
            let wanted = u16::from(wants_before) + u16::from(wants_here && !is_kept);
            if !self.is_on_front() && !self.adapts {
                // The even stations alone.
            } else if wanted > room || self.keeps_even {
                // The greatest on both sides instead.
                let missed = self.missed.get_or_insert(q);
                for q in before.iter().map(|before| &before.q).chain([&q]) {
                    widen(&mut last.q, q, false);
                    widen(missed, q, false);
                }
            } else {
                if let Some(before) = before {
                    self.append(before, out);
                }
                if wants_here && !is_kept {
                    self.append(here, out);
                    return;
                }
            }
        }
        if is_kept {
            if is_even {
                self.note_even(station, out);
            }
            self.before = None;
            self.append(here, out);
        } else {
            self.before = Some(here);
        }
    }

    /// Leaves out the first station of a stretch where it has the derivatives of the last one's end: the second one is continuous at the stations of a front.
    fn join(&self, out: &mut PassPlan) {
        let (_, tolerance) = self.room(out);
        let stations = &mut out.plan.stations;
        let Some(start) = stations.back_mut(1).copied() else {
            return;
        };
        if self.may_join
            && let Some(end) = stations.back_mut(2)
            && end.arc_nm == start.arc_nm
            && !self.is_notable(&end.q, &start.q, tolerance)
        {
            let count = stations.count();
            stations.truncate(count.saturating_sub(1));
            out.note_first(self.patches / out.group.max(1), 1);
        }
    }

    fn append(&mut self, mut station: Station, out: &mut PassPlan) {
        if let Some(missed) = self.missed.take() {
            widen(&mut station.q, &missed, false);
        }
        out.plan.stations.push(station);
        out.plan.stations.note_spacing(1, self.window.noise_spacing_mm());
    }

    /// Stations that may be kept besides those at the stretches' ends: one of each piece that is left, two where a knot is crossed.
    fn room(&self, out: &PassPlan) -> (u16, f32) {
        if !self.is_on_front() {
            let [_, end] = out.route.ends;
            let patches = self.piece.position.span.abs_diff(end.span);
            let here = self.cells.saturating_sub(self.station) / self.looks.max(1) + 1;
            let left = patches * (out.cells + 1) + here;
            let room = self.most.saturating_sub(out.plan.stations.count() + left + SPARE);
            // Where there is room for few of those that are looked at, for the most notable.
            let looks = self.cells.saturating_sub(self.station);
            return (room, (f32::from(looks) / f32::from(room.max(1))).at_least(1.0));
        }
        let [_, last] = self.stretch;
        let number = last.front.map_or(0, |front| front.number);
        let pieces = out.route.front.map_or(0, |front| front.pieces);
        let [_, end] = out.route.ends;
        let spans = last.position.span.abs_diff(end.span);
        let stretches = PATCHES.saturating_sub(self.patches);
        let left = pieces.saturating_sub(number).min(stretches);
        let room = STATIONS.saturating_sub(out.plan.stations.count() + left + left / 4 + 2 * spans + SPARE);
        let per_piece = f32::from(room) / f32::from(left.max(1));
        (
            room,
            (KEPT_SHARE / per_piece).at_least(1.0).at_most(LESS_NOTABLE_MAX),
        )
    }

    /// Whether the higher derivatives differ by more than a share of what takes an axis to its limit, at the feed or the lower speed that they allow.
    fn is_notable(&self, from: &Derivatives, to: &Derivatives, tolerance: f32) -> bool {
        let [_, _, noise] = self.window.noise();
        // Inverse powers of the speed.
        let [mut square, mut cube] = self.slowest;
        for q in [from, to] {
            for ([_, second, third], [acceleration, jerk]) in q.iter().zip(&self.per_limit) {
                square = square.at_least(second.abs() * acceleration);
                cube = cube.at_least(third.abs() * jerk);
            }
        }
        cube = cube.at_least(square * sqrt(square));
        (square, cube) = (square * tolerance, cube * tolerance);
        let mut is_notable = false;
        for (([acceleration, jerk], from), to) in self.per_limit.iter().zip(from).zip(to) {
            let ([_, from2, from3], [_, to2, to3]) = (*from, *to);
            is_notable |= (to2 - from2).abs() * acceleration > NOTABLE_SECOND * square
                || ((to3 - from3).abs() - noise) * jerk > NOTABLE_THIRD * cube;
        }
        is_notable
    }

    /// Arc from the start of the pass to an arc of the stretch, nm.
    pub(super) fn arc_nm(&self, arc_mm: f32) -> u32 {
        let arc_q10 = self.start_q10 + to_q10(arc_mm);
        u32::try_from((arc_q10 + (1 << (Q10_BITS - 1))) >> Q10_BITS).unwrap_or(u32::MAX)
    }

    /// A pass that is too short for derivatives is straight.
    pub(super) fn finish_short(&self, out: &mut PassPlan) {
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
