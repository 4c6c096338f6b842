//! The acceleration-limited motion below caps of the speed: at a station, around jumps, at ends at speed.

use super::nodes::MEAN_MAX;
use super::{ACCEL, SPACING, SPEED_SQR, TIME, Walker};
use crate::feed::cell_motion::CellMotion;
use crate::feed::limits::{MotionLimits, SLOPE_MIN};
use crate::feed::lists::{Lists, get, put};
use crate::feed::plan::Plan;
use crate::feed::stations::{Derivatives, between};
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, cube_root};

const FLAT: f32 = 1.0;

/// Speed over a jump below which the walk rests there, as a share of the one that a ramp without constant acceleration reaches, and as a share of the one
/// beside the jump: a rest costs more than a slow place. Nodes by which the rest is longer than the mean.
const REST_BELOW: f32 = 0.5;
const REST_BELOW_BESIDE: f32 = 0.1;
const REST_NODES: f32 = 1.0;

/// Stations on either side of a jump that the speed over it bounds.
const JUMP_STATIONS: u16 = 10;

impl Walker {
    /// Caps of speed and acceleration at a station.
    pub(super) fn cap(
        &mut self,
        lists: &mut Lists,
        station: u16,
        q: &Derivatives,
        limits: &MotionLimits,
        share: f32,
    ) {
        let mut square = 1.0 / limits.inverse_speed_sqr(q);
        for (axis, [_, second, third]) in limits.axes.iter().zip(q) {
            square = square.at_most(0.85 * axis.acceleration / second.abs().at_least(1e-9));
            let speed = cube_root(0.7 * axis.jerk / third.abs().at_least(1e-9));
            square = square.at_most(speed * speed);
        }
        let jerk = least_jerk(q, limits);
        let speed = sqrt(square);
        let mut accel = f32::MAX;
        for (axis, [first, second, _]) in limits.axes.iter().zip(q) {
            let bend = second.abs().at_least(1e-9);
            let left = (axis.acceleration - bend * square).at_least(0.3 * axis.acceleration);
            accel = accel
                .at_most(0.7 * left / first.abs().at_least(SLOPE_MIN))
                .at_most(0.5 * axis.jerk / (3.0 * bend * speed));
        }
        self.jerk = self.jerk.at_most(jerk);
        self.acceleration = self.acceleration.at_least(accel);
        self.speed = self.speed.at_least(speed);
        let is_capped = speed < 0.999 * limits.feed;
        let [start, end] = self.speeds;
        let least = square.at_most(start.at_least(end) * start.at_least(end));
        let (square, accel) = if share < 1.0 {
            ((share * square).at_least(least), share * accel)
        } else {
            (square, accel)
        };
        put(lists, SPEED_SQR, station, square);
        put(lists, ACCEL, station, if is_capped { -accel } else { accel });
    }

    /// Bounds the speed around a jump, down to a rest.
    pub(super) fn slow_at_jump(&self, lists: &mut Lists, plan: &Plan, jump: u16, limits: &MotionLimits) {
        let speed = limits.jump_speed(&plan.stations.jump(jump));
        if speed >= limits.feed {
            return;
        }
        let jerk = [jump, jump + 1]
            .map(|station| least_jerk(&plan.stations.get(station).q, limits))
            .into_iter()
            .fold(f32::MAX, f32::at_most);
        let accel = [jump, jump + 1].map(|station| get(lists, ACCEL, station).abs());
        let accel = accel.into_iter().fold(f32::MAX, f32::at_most);
        let square = [jump, jump + 1].map(|station| get(lists, SPEED_SQR, station));
        let beside = sqrt(square.into_iter().fold(f32::MAX, f32::at_most));
        // Below this a rest is better: the walk's mean would not leave so narrow a slow place.
        let rest_below = (REST_BELOW * accel * accel / jerk).at_most(REST_BELOW_BESIDE * beside);
        let speed = if self.may_rest(plan, jump) && speed < rest_below {
            0.0
        } else {
            speed
        };
        let at = plan.stations.get(jump).arc_nm;
        let from = jump.saturating_sub(JUMP_STATIONS);
        let to = plan.stations.count().min(jump + JUMP_STATIONS);
        for station in from..to {
            let arc = plan.stations.get(station).arc_nm;
            let away = if arc < at {
                between(arc, at)
            } else {
                between(at, arc)
            };
            let root = cube_root(6.0 * away / self.jerk);
            let most = speed + 0.5 * self.jerk * root * root;
            let square = get(lists, SPEED_SQR, station).at_most(most * most);
            put(lists, SPEED_SQR, station, square);
        }
    }

    /// Whether the walk can rest at a jump: there are two cells at least to the next jump and to the ends.
    fn may_rest(&self, plan: &Plan, jump: u16) -> bool {
        let stations = &plan.stations;
        jump >= 2
            && jump + 3 < stations.count()
            && !stations.is_jump(jump - 2)
            && !stations.is_jump(jump + 2)
            && self.is_from_rest_to_rest()
    }

    /// Whether the walk rests in a cell: in that of no length of a jump whose speed is 0.
    pub(super) fn rests_in(&self, lists: &Lists, plan: &Plan, cell: u16) -> bool {
        plan.stations.is_jump(cell) && get(lists, SPEED_SQR, cell) == 0.0
    }

    pub(super) fn accel(&self, lists: &Lists, cell: u16) -> f32 {
        let most = sqrt(self.speed * self.jerk);
        let of = |station| get(lists, ACCEL, station).abs().at_most(most);
        0.5 * (of(cell) + of(cell + 1))
    }

    pub(super) fn backwards(&self, lists: &mut Lists, plan: &Plan) {
        let last = plan.stations.count().saturating_sub(1);
        let [start, end] = self.speeds;
        put(lists, SPEED_SQR, 0, start * start);
        put(lists, SPEED_SQR, last, end * end);
        for cell in (0..last).rev() {
            let reach =
                get(lists, SPEED_SQR, cell + 1) + 2.0 * self.accel(lists, cell) * plan.stations.cell_mm(cell);
            let square = get(lists, SPEED_SQR, cell).at_most(reach);
            let square = self.unless_held(plan, cell, square);
            put(lists, SPEED_SQR, cell, square);
        }
    }

    /// The square of the speed of an end that is not a rest, at a station where it is held because the mean reaches there; 0 elsewhere.
    pub(super) fn held(&self, plan: &Plan, station: u16) -> f32 {
        let [start, end] = self.speeds;
        let stations = &plan.stations;
        let time = FLAT * (self.acceleration / self.jerk).at_most(MEAN_MAX);
        // With the first station beyond, so that the speed is held over the whole of the cell before it.
        let before = stations.get(station.saturating_sub(1)).arc_nm;
        let after = stations
            .get((station + 1).min(stations.count().saturating_sub(1)))
            .arc_nm;
        if start > 0.0 && between(0, before) < start * time {
            start * start
        } else if end > 0.0 && between(after, stations.length_nm()) < end * time {
            end * end
        } else {
            0.0
        }
    }

    /// Holds the speeds of the ends that are not rests.
    pub(super) fn flatten(&self, lists: &mut Lists, plan: &Plan) {
        for station in 0..plan.stations.count() {
            let held = self.held(plan, station);
            if held > 0.0 {
                put(lists, SPEED_SQR, station, held);
            }
        }
    }

    /// The square of a speed where it is not held.
    fn unless_held(&self, plan: &Plan, station: u16, square: f32) -> f32 {
        if self.is_from_rest_to_rest() {
            square
        } else {
            square.at_least(self.held(plan, station))
        }
    }

    /// Accelerations and times from a station on, up to another.
    pub(super) fn forwards(&mut self, lists: &mut Lists, plan: &Plan, from: u16, to: u16) {
        let mut time = if from == 0 { 0.0 } else { self.duration };
        put(lists, TIME, from, time);
        for cell in from..to {
            let length = plan.stations.cell_mm(cell);
            let here = get(lists, SPEED_SQR, cell);
            let reach = here + 2.0 * self.accel(lists, cell) * length;
            let there = get(lists, SPEED_SQR, cell + 1).at_most(reach);
            let there = self.unless_held(plan, cell + 1, there);
            put(lists, SPEED_SQR, cell + 1, there);
            time += CellMotion::of(here, there, length, self.accel(lists, cell)).duration;
            put(lists, TIME, cell + 1, time);
        }
        self.duration = time;
    }

    /// Inserts the rests at jumps: somewhat longer than the mean, so that the mean's speed is 0 there, too.
    pub(super) fn rest_at_jumps(&mut self, lists: &mut Lists, plan: &Plan) {
        let spacing = SPACING.at_least(self.duration / f32::from(self.intervals));
        let rest = self.mean_s + REST_NODES * spacing;
        let last = plan.stations.count().saturating_sub(1);
        let mut later = 0.0;
        for cell in 0..last {
            if self.rests_in(lists, plan, cell) {
                later += rest;
            }
            let time = get(lists, TIME, cell + 1);
            put(lists, TIME, cell + 1, time + later);
        }
        self.duration += later;
    }
}

/// Jerk along the path that every axis allows where nothing else needs any, mm/s^3.
fn least_jerk(q: &Derivatives, limits: &MotionLimits) -> f32 {
    let mut jerk = f32::MAX;
    for (axis, [first, _, _]) in limits.axes.iter().zip(q) {
        jerk = jerk.at_most(0.8 * axis.jerk / first.abs().at_least(SLOPE_MIN));
    }
    jerk
}
