//! The walk along a path that a plan scales: an acceleration-limited motion below rough caps of the speed, smoothed by a moving average, with nodes
//! close together where the speed changes.

use super::cell_motion::CellMotion;
use super::knots::find_knots;
use super::limits::{MotionLimits, SLOPE_MIN};
use super::lists::{Lists, draft_mut, get, put};
use super::node_times::NodeTimes;
use super::plan::{NODES_FEW, NODES_MAX, NODES_MIN, Plan};
use super::stations::{Derivatives, Station, between};
use super::{MM_PER_Q10, to_q10};
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, cube_root, to_f32};

/// Spacing of nodes that is fine enough, s; its growth per second away from busy places; the widest, s.
const SPACING: f32 = 5e-3;
const GROWTH: f32 = 0.12;
/// The same for a pass that takes longer than this, s, so that its nodes are still fine at the rests.
const GROWTH_LONG: f32 = 0.25;
const LONG: f32 = 20.0;
const SPACING_MAX: f32 = 0.1;
/// Time between nodes that is worth its planning, s.
const SPACING_WORTH: f32 = 4e-3;
/// Longest mean of a walk with an end at speed, s, and the time for which it has that speed, as a multiple of it.
const MEAN_MAX: f32 = 0.05;
const FLAT: f32 = 1.0;
/// Periods that the rest of the planning takes: for a node, for a place of the check, and for what is left.
const PERIODS_A_NODE: f32 = 3.2;
const PERIODS_A_PLACE: f32 = 0.07;
const PERIODS_A_PLAN: f32 = 55.0;
/// The same for the last stop before a turn, and the shares of the walk's time that a plan takes: with an end at speed, and from rest to rest.
const PERIODS_A_STOP: f32 = 150.0;
const WALKED: f32 = 0.75;
const WALKED_TO_REST: f32 = 0.7;
/// Speed over a jump below which the walk rests there, as a share of the one that a ramp without constant acceleration reaches; nodes by which the rest is
/// longer than the mean.
const REST_BELOW: f32 = 0.05;
const REST_NODES: f32 = 1.5;
/// Bisections of the spacing.
const BISECTIONS: u8 = 12;
/// Tries to coarsen the ends.
const COARSENINGS: u8 = 20;
/// Stations on either side of a jump that the speed over it bounds.
const JUMP_STATIONS: u16 = 10;
const STATIONS_A_PORTION: u16 = 24;
const JUMPS_A_PORTION: u16 = 6;
const CELLS_A_PORTION: u16 = 84;
const NODES_A_PORTION: u16 = 60;
const PLACES_A_PORTION: u16 = 50;
const KNOTS_A_PORTION: u16 = 40;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Done,
    Caps,
    Jumps,
    /// The speed of an end that is not a rest is held.
    Flatten,
    Backwards,
    Forwards,
    /// Inserts the rests at jumps.
    Rests,
    Busy,
    /// Whether even spacing is fine enough.
    TryEven,
    /// Whether it is, growing away from busy places.
    TryGrowing,
    /// Coarser until the widest spacing fits.
    Coarsen,
    Bisect(u8),
    Times,
    Increments,
    Means,
    Nodes,
    Knots,
}

/// What is varied to fit the nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Vary {
    Even,
    Growth,
    Coarse,
}

/// The making of a walk.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Walker {
    stage: Stage,
    index: u16,
    /// Least jerk along the path, mm/s^3; greatest acceleration, mm/s^2; greatest speed, mm/s.
    jerk: f32,
    acceleration: f32,
    speed: f32,
    /// Duration of the acceleration-limited motion, and length of the mean, s.
    duration: f32,
    mean_s: f32,
    intervals: u16,
    /// The plan takes no longer than its planning: the fewest steps are to be made.
    pub(crate) is_short: bool,
    busy: u16,
    vary: Vary,
    low: f32,
    high: f32,
    /// Spacing at the ends, s, and its greatest growth.
    ends: f32,
    growth: f32,
    /// Least spacing, s.
    finest: f32,
    /// Nodes of the unsmoothed walk, and what their times are scaled by.
    times: u16,
    scale: f32,
    /// Cell, and the place before it: station and mm beyond it.
    cell: u16,
    before: (u32, f32),
    /// Sums over the mean: length, units of 2^-10 nm, and time, s.
    sum_q10: i64,
    sum_s: f32,
    coarsenings: u8,
    /// Speeds at the ends, mm/s, and nodes of the mean where one is not a rest.
    speeds: [f32; 2],
    mean: u16,
    tightened: f32,
}

/// Lists of this stage.
const SPEED_SQR: usize = 0;
const TIME: usize = 1;
/// Acceleration, negative where the speed is capped below the feed.
const ACCEL: usize = 2;
/// Times of busy places, those of rests with a minus; then the steps between nodes.
pub(super) const BUSY: usize = 3;
const NODES: usize = 4;

impl Walker {
    pub(crate) const IDLE: Self = Self {
        stage: Stage::Done,
        index: 0,
        jerk: 0.0,
        acceleration: 0.0,
        speed: 0.0,
        duration: 0.0,
        mean_s: 0.0,
        intervals: 0,
        is_short: false,
        busy: 0,
        vary: Vary::Even,
        low: 0.0,
        high: 0.0,
        ends: 0.0,
        growth: GROWTH,
        finest: 0.0,
        times: 0,
        scale: 0.0,
        cell: 0,
        before: (0, 0.0),
        sum_q10: 0,
        sum_s: 0.0,
        coarsenings: 0,
        speeds: [0.0; 2],
        mean: 0,
        tightened: 1.0,
    };

    /// `tightened`: share of the acceleration near an end at speed.
    pub(crate) const fn begin(&mut self, period: f32, tightened: f32) {
        *self = Self::IDLE;
        self.tightened = tightened;
        // Nodes much closer together than periods would not be seen.
        self.finest = 0.5 * period;
        self.stage = Stage::Caps;
        self.jerk = f32::MAX;
    }

    /// Cycles of the next portion, by the pessimistic model of `cargo sim budget`.
    pub(crate) const fn cycles(&self) -> u32 {
        match self.stage {
            Stage::Caps => 18_100,
            Stage::Jumps | Stage::Means | Stage::Knots => 10_500,
            Stage::Rests => 12_000,
            Stage::Backwards | Stage::Busy => 25_000,
            Stage::Forwards | Stage::Flatten => 17_000,
            Stage::TryEven | Stage::TryGrowing | Stage::Coarsen | Stage::Bisect(_) | Stage::Times => 25_500,
            Stage::Increments => 21_500,
            Stage::Nodes => 15_000,
            Stage::Done => 0,
        }
    }

    /// One portion; whether the walk is complete. `least`: periods that the plan has to take at least, for the planning so far.
    #[inline(never)]
    pub(crate) fn work(
        &mut self,
        lists: &mut Lists,
        plan: &mut Plan,
        limits: &MotionLimits,
        least: u32,
    ) -> bool {
        let count = plan.stations.count();
        self.stage = match self.stage {
            Stage::Caps => {
                self.speeds = plan.ends;
                let end = count.min(self.index + STATIONS_A_PORTION);
                for station in self.index..end {
                    let Station { arc_nm, q } = plan.stations.get(station);
                    let share = if plan.is_near_turn(*arc_nm) {
                        self.tightened
                    } else {
                        1.0
                    };
                    self.cap(lists, station, q, limits, share);
                }
                self.next(end, end == count, Stage::Caps, Stage::Jumps)
            }
            Stage::Jumps => {
                let mut left = JUMPS_A_PORTION;
                let mut station = self.index;
                while station < count && left > 0 {
                    if plan.stations.is_jump(station) {
                        self.slow_at_jump(lists, plan, station, limits);
                        left -= 1;
                    }
                    station += 1;
                }
                let next = if self.is_from_rest_to_rest() {
                    Stage::Backwards
                } else {
                    Stage::Flatten
                };
                self.next(station, station >= count, Stage::Jumps, next)
            }
            Stage::Flatten => {
                self.flatten(lists, plan);
                Stage::Backwards
            }
            Stage::Backwards => {
                self.backwards(lists, plan);
                Stage::Forwards
            }
            Stage::Forwards => {
                let last = count.saturating_sub(1);
                let end = last.min(self.index + CELLS_A_PORTION);
                self.forwards(lists, plan, self.index, end);
                if end == last {
                    self.choose_mean(plan);
                    self.choose_intervals(limits, least);
                }
                self.next(end, end == last, Stage::Forwards, Stage::Rests)
            }
            Stage::Rests => {
                self.rest_at_jumps(lists, plan);
                Stage::Busy
            }
            Stage::Busy => {
                self.find_busy(lists, plan, limits);
                Stage::TryEven
            }
            Stage::TryEven => {
                if self.fits(lists, SPACING.at_least(self.finest), 0.0) {
                    self.vary = Vary::Even;
                    let least = 0.25 * (self.duration + self.mean_s) / f32::from(self.intervals);
                    let fine = SPACING.at_least(self.finest);
                    (self.low, self.high) = (least.at_least(self.finest).at_most(fine), fine);
                    Stage::Bisect(0)
                } else {
                    Stage::TryGrowing
                }
            }
            Stage::TryGrowing => {
                if self.fits(lists, SPACING.at_least(self.finest), self.growth) {
                    self.vary = Vary::Growth;
                    (self.low, self.high) = (1e-4, self.growth);
                    Stage::Bisect(0)
                } else {
                    self.vary = Vary::Coarse;
                    let widest = 8.0 * (self.duration + self.mean_s) / f32::from(self.intervals);
                    let fine = SPACING.at_least(self.finest);
                    (self.low, self.high) = (fine, widest.at_least(fine));
                    Stage::Coarsen
                }
            }
            Stage::Coarsen => {
                if self.fits(lists, self.high, self.growth) || self.coarsenings >= COARSENINGS {
                    Stage::Bisect(0)
                } else {
                    self.ends *= 1.5;
                    self.coarsenings += 1;
                    Stage::Coarsen
                }
            }
            Stage::Bisect(BISECTIONS..) => Stage::Times,
            Stage::Bisect(tried) => {
                let middle = sqrt(self.low * self.high);
                let [spacing, growth] = self.spacing(middle);
                if self.fits(lists, spacing, growth) {
                    self.high = middle;
                } else {
                    self.low = middle;
                }
                Stage::Bisect(tried + 1)
            }
            Stage::Times => {
                self.times(lists, plan);
                Stage::Increments
            }
            Stage::Increments => {
                let end = self.times.min(self.index + PLACES_A_PORTION);
                for node in self.index..end {
                    self.increment(lists, plan, node);
                }
                if end == self.times && self.is_from_rest_to_rest() {
                    self.begin_means(plan);
                } else if end == self.times {
                    self.begin_means_at_speed(lists, plan);
                }
                self.next(end, end == self.times, Stage::Increments, Stage::Means)
            }
            Stage::Means => {
                let count = plan.intervals + 2;
                let end = count.min(self.index + NODES_A_PORTION);
                for index in self.index..end {
                    if self.is_from_rest_to_rest() {
                        self.mean(lists, plan, index);
                    } else {
                        self.mean_at_speed(lists, plan, index);
                    }
                }
                if end == count {
                    (self.cell, self.sum_q10) = (0, 0);
                    plan.trim_q10 = 0;
                }
                self.next(end, end == count, Stage::Means, Stage::Nodes)
            }
            Stage::Nodes => {
                let count = plan.intervals + 1;
                let end = count.min(self.index + PLACES_A_PORTION);
                for node in self.index..end {
                    (self.cell, self.sum_q10) = plan.place_node(node, self.cell, self.sum_q10);
                }
                if end == count {
                    plan.trim(self.sum_q10);
                    plan.knot_count = 0;
                }
                self.next(end, end == count, Stage::Nodes, Stage::Knots)
            }
            Stage::Knots => {
                let end = plan.intervals.min(self.index + KNOTS_A_PORTION);
                for interval in self.index..end {
                    find_knots(plan, interval, limits);
                }
                self.next(end, end == plan.intervals, Stage::Knots, Stage::Done)
            }
            Stage::Done => Stage::Done,
        };
        self.stage == Stage::Done
    }

    const fn next(&mut self, index: u16, is_over: bool, stage: Stage, next: Stage) -> Stage {
        self.index = if is_over { 0 } else { index };
        if is_over { next } else { stage }
    }

    /// Caps of speed and acceleration at a station.
    fn cap(&mut self, lists: &mut Lists, station: u16, q: &Derivatives, limits: &MotionLimits, share: f32) {
        let mut square = 1.0 / limits.inverse_speed_sqr(q);
        let mut jerk = f32::MAX;
        for (axis, [first, second, third]) in limits.axes.iter().zip(q) {
            square = square.at_most(0.85 * axis.acceleration / second.abs().at_least(1e-9));
            let speed = cube_root(0.7 * axis.jerk / third.abs().at_least(1e-9));
            square = square.at_most(speed * speed);
            jerk = jerk.at_most(0.8 * axis.jerk / first.abs().at_least(SLOPE_MIN));
        }
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
    fn slow_at_jump(&self, lists: &mut Lists, plan: &Plan, jump: u16, limits: &MotionLimits) {
        let speed = limits.jump_speed(&plan.stations.jump(jump));
        if speed >= limits.feed {
            return;
        }
        let speed = if self.may_rest(plan, jump) && speed < self.rest_below() {
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

    /// Speed over a jump, mm/s, below which a rest there is better: the walk's mean would not leave so narrow a slow place.
    fn rest_below(&self) -> f32 {
        REST_BELOW * self.acceleration * self.acceleration / self.jerk
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
    fn rests_in(&self, lists: &Lists, plan: &Plan, cell: u16) -> bool {
        plan.stations.is_jump(cell) && get(lists, SPEED_SQR, cell) == 0.0
    }

    fn accel(&self, lists: &Lists, cell: u16) -> f32 {
        let most = sqrt(self.speed * self.jerk);
        let of = |station| get(lists, ACCEL, station).abs().at_most(most);
        0.5 * (of(cell) + of(cell + 1))
    }

    fn backwards(&self, lists: &mut Lists, plan: &Plan) {
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
    fn held(&self, plan: &Plan, station: u16) -> f32 {
        let [start, end] = self.speeds;
        let stations = &plan.stations;
        let time = FLAT * (self.acceleration / self.jerk).at_most(MEAN_MAX);
        // With the first station beyond, so that the speed is held over the whole of the cell before it.
        let before = stations.get(station.saturating_sub(1)).arc_nm;
        let behind = stations
            .get((station + 1).min(stations.count().saturating_sub(1)))
            .arc_nm;
        if start > 0.0 && between(0, before) < start * time {
            start * start
        } else if end > 0.0 && between(behind, stations.length_nm()) < end * time {
            end * end
        } else {
            0.0
        }
    }

    /// Holds the speeds of the ends that are not rests.
    fn flatten(&self, lists: &mut Lists, plan: &Plan) {
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

    /// Whether the walk is from rest to rest.
    fn is_from_rest_to_rest(&self) -> bool {
        self.speeds == [0.0; 2]
    }

    /// Nodes by which the mean lengthens the walk: half of it at each rest.
    fn lengthening(&self, mean: u16) -> u16 {
        let [start, end] = self.speeds.map(|speed| u16::from(speed == 0.0));
        (start + end) * mean.div_ceil(2)
    }

    /// Accelerations and times from a station on, up to another.
    fn forwards(&mut self, lists: &mut Lists, plan: &Plan, from: u16, to: u16) {
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

    /// Length of the mean, once the duration is known.
    fn choose_mean(&mut self, plan: &Plan) {
        let time = self.duration;
        let length = between(0, plan.stations.length_nm());
        self.mean_s = (self.acceleration / self.jerk)
            .at_most(1.2 * sqrt(length / time / self.jerk))
            .at_most(cube_root(0.5 * length / self.jerk));
        if !self.is_from_rest_to_rest() {
            self.mean_s = self.mean_s.at_most(MEAN_MAX);
        }
        self.mean_s = self.mean_s.at_least(4.0 * self.finest);
    }

    /// Inserts the rests at jumps: somewhat longer than the mean, so that the mean's speed is 0 there, too.
    fn rest_at_jumps(&mut self, lists: &mut Lists, plan: &Plan) {
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

    /// As many intervals as are worth their planning, and no more than leave the plan longer than its planning.
    fn choose_intervals(&mut self, limits: &MotionLimits, least: u32) {
        let whole = |value: f32| u16::try_from(truncated(value.at_least(0.0))).unwrap_or(u16::MAX);
        let time = self.duration;
        let most = whole(time / self.finest).clamp(NODES_LEAST, NODES_COUNT);
        let wanted = whole(time / SPACING_WORTH.at_least(self.finest));
        self.intervals = wanted.clamp(NODES_MIN.min(most), most);
        if least > 0 {
            let (lasts, plan) = if self.is_from_rest_to_rest() {
                (WALKED_TO_REST * (time + self.mean_s), PERIODS_A_PLAN)
            } else {
                (WALKED * time, PERIODS_A_PLAN + PERIODS_A_STOP)
            };
            let lasts = lasts / limits.period;
            let left = lasts * (1.0 - PERIODS_A_PLACE) - plan - to_f32(i64::from(least));
            let planned = whole(left / PERIODS_A_NODE);
            let fewest = NODES_FEW.min(most);
            self.is_short = planned < fewest;
            self.intervals = self.intervals.min(planned).max(fewest);
        }
        self.growth = if time > LONG { GROWTH_LONG } else { GROWTH };
        let parts = if self.is_from_rest_to_rest() { 6.0 } else { 16.0 };
        self.ends = (self.mean_s / parts)
            .at_least(self.finest)
            .at_least(time / (4000.0 * f32::from(self.intervals)));
    }

    /// Times at which something happens.
    fn find_busy(&mut self, lists: &mut Lists, plan: &Plan, limits: &MotionLimits) {
        let last = plan.stations.count().saturating_sub(1);
        let mut top = 0.0;
        for station in 0..=last {
            top = get(lists, SPEED_SQR, station).at_least(top);
        }
        put(lists, BUSY, 0, 0.0);
        self.busy = 1;
        for cell in 0..last {
            let is_busy = if plan.stations.is_jump(cell) {
                limits.jump_speed(&plan.stations.jump(cell)) < 1.5 * limits.feed
            } else {
                let change = get(lists, SPEED_SQR, cell + 1) - get(lists, SPEED_SQR, cell);
                let is_capped = get(lists, ACCEL, cell) < 0.0 || get(lists, ACCEL, cell + 1) < 0.0;
                change.abs() >= 1e-3 * top || is_capped
            };
            if is_busy {
                let middle = 0.5 * (get(lists, TIME, cell) + get(lists, TIME, cell + 1));
                let rests = self.rests_in(lists, plan, cell);
                put(lists, BUSY, self.busy, if rests { -middle } else { middle });
                self.busy += 1;
            }
        }
        put(lists, BUSY, self.busy, self.duration);
        self.busy += 1;
    }

    /// Spacing and growth for a value of what is varied.
    fn spacing(&self, value: f32) -> [f32; 2] {
        match self.vary {
            Vary::Even => [value, 0.0],
            Vary::Growth => [SPACING.at_least(self.finest), value],
            Vary::Coarse => [value, self.growth],
        }
    }

    /// Nodes left for the mean over `n` of them.
    fn room(&self, spacing: f32) -> u16 {
        let mean = self.mean_at(spacing);
        if self.is_from_rest_to_rest() {
            return self.intervals.saturating_sub(mean);
        }
        (self.intervals + 1).saturating_sub(self.lengthening(mean | 1))
    }

    /// Nodes that the mean is over, at a spacing at the ends.
    fn mean_at(&self, spacing: f32) -> u16 {
        let mean = truncated(self.mean_s / spacing.at_most(self.ends) + 0.5).max(2);
        u16::try_from(mean).unwrap_or(u16::MAX).min(self.intervals)
    }

    fn fits(&self, lists: &Lists, spacing: f32, growth: f32) -> bool {
        let room = self.room(spacing);
        let mut nodes = self.nodes_at(lists, spacing, growth);
        while nodes.next(lists).is_some() {
            if nodes.count > room {
                return false;
            }
        }
        true
    }

    fn nodes_at(&self, lists: &Lists, spacing: f32, growth: f32) -> NodeTimes {
        NodeTimes {
            duration: self.duration,
            mean_s: self.mean_s,
            spacing,
            growth,
            widest: SPACING_MAX
                .at_least(3.0 * self.duration / f32::from(self.intervals))
                .at_least(spacing),
            end_spacing: spacing.at_most(self.ends),
            end_growth: self.growth,
            at: 0.0,
            busy: 1,
            busy_count: self.busy,
            last: get(lists, BUSY, 0),
            following: get(lists, BUSY, 1),
            rests: [0.0; 2],
            rest: 1,
            count: 0,
        }
    }

    /// Writes the times of the nodes.
    fn times(&mut self, lists: &mut Lists, plan: &mut Plan) {
        let [spacing, growth] = self.spacing(self.high);
        let mut nodes = self.nodes_at(lists, spacing, growth);
        let most = if self.is_from_rest_to_rest() {
            self.intervals - 2
        } else {
            self.room(spacing)
        };
        let mut last = 0.0;
        while let Some(time) = nodes.next(lists) {
            put(lists, NODES, nodes.count - 1, time);
            last = time;
            if nodes.count >= most {
                break;
            }
        }
        self.times = nodes.count;
        self.scale = self.duration / last.at_least(1e-9);
        (self.cell, self.before) = (0, (0, 0.0));
        plan.step_s = spacing.at_most(self.ends);
        if !self.is_from_rest_to_rest() {
            // The interval is as long as the spacing at an end, so that the walk has the speed there.
            self.mean = self.mean_at(spacing) | 1;
            self.intervals = (self.times - 1)
                .saturating_add(self.lengthening(self.mean))
                .min(NODES_COUNT);
            plan.step_s *= self.scale;
        }
        plan.intervals = self.intervals;
        plan.inverse_step = 1.0 / plan.step_s;
    }

    /// Length from the node before to a node.
    fn increment(&mut self, lists: &mut Lists, plan: &Plan, node: u16) {
        let Some(previous) = node.checked_sub(1) else {
            return;
        };
        let last = plan.stations.count().saturating_sub(1);
        let time = get(lists, NODES, node) * self.scale;
        while self.cell + 1 < last && get(lists, TIME, self.cell + 1) <= time {
            self.cell += 1;
        }
        let [start, end] = self.speeds.map(|speed| speed * plan.step_s);
        let flat = self.mean / 2 + 2;
        let place = if node + 1 == self.times {
            (plan.stations.length_nm(), 0.0)
        } else if start > 0.0 && node <= flat {
            (0, f32::from(node) * start)
        } else if end > 0.0 && node + 1 + flat >= self.times {
            let left = f32::from(self.times - 1 - node) * end;
            (plan.stations.length_nm(), -left)
        } else {
            let since = time - get(lists, TIME, self.cell);
            let [here, there] = [self.cell, self.cell + 1].map(|station| get(lists, SPEED_SQR, station));
            let length = plan.stations.cell_mm(self.cell);
            let motion = CellMotion::of(here, there, length, self.accel(lists, self.cell));
            (
                plan.stations.get(self.cell).arc_nm,
                motion.at(since).at_least(0.0).at_most(length),
            )
        };
        let ((from, from_mm), (to, to_mm)) = (self.before, place);
        put(
            lists,
            BUSY,
            previous,
            self.flat_increment(plan, previous)
                .unwrap_or((between(from, to) + (to_mm - from_mm)).at_least(0.0)),
        );
        self.before = place;
    }

    /// The exact length of an increment at the speed of an end.
    fn flat_increment(&self, plan: &Plan, index: u16) -> Option<f32> {
        let [start, end] = self.speeds;
        let flat = self.mean / 2 + 2;
        if start > 0.0 && index < flat {
            Some(start * plan.step_s)
        } else if end > 0.0 && index + 1 + flat >= self.times {
            Some(end * plan.step_s)
        } else {
            None
        }
    }

    /// Nodes that the mean is over.
    const fn mean_nodes(&self) -> u16 {
        if self.mean > 0 {
            self.mean
        } else {
            self.intervals - self.times
        }
    }

    /// An increment and its time, also beyond the ends, where the speed is that of the end.
    fn step_of(&self, lists: &Lists, plan: &Plan, index: i32) -> (i64, f32) {
        let [start, end] = self.speeds.map(|speed| to_q10(speed * plan.step_s));
        match u16::try_from(index) {
            Err(_) => (start, plan.step_s),
            Ok(index) if index + 1 >= self.times => (end, plan.step_s),
            Ok(index) => (
                to_q10(get(lists, BUSY, index)),
                self.scale * (get(lists, NODES, index + 1) - get(lists, NODES, index)),
            ),
        }
    }

    /// Increments of the mean before the first that the walk has where it begins at speed.
    fn skipped(&self) -> i32 {
        let [start, _] = self.speeds;
        if start > 0.0 {
            i32::from(self.mean + 1) / 2
        } else {
            0
        }
    }

    /// Sums of the mean before the first coefficient.
    fn begin_means_at_speed(&mut self, lists: &Lists, plan: &Plan) {
        let n = i32::from(self.mean);
        let newest = self.skipped() - 3;
        (self.sum_q10, self.sum_s) = (0, 0.0);
        for index in newest + 1 - n..=newest {
            let (q10, seconds) = self.step_of(lists, plan, index);
            self.sum_q10 += q10;
            self.sum_s += seconds;
        }
    }

    /// A coefficient of a walk with an end at speed.
    fn mean_at_speed(&mut self, lists: &mut Lists, plan: &mut Plan, index: u16) {
        let n = i32::from(self.mean);
        let newest = i32::from(index) + self.skipped() - 2;
        let (in_q10, in_s) = self.step_of(lists, plan, newest);
        let (out_q10, out_s) = self.step_of(lists, plan, newest - n);
        self.sum_q10 += in_q10 - out_q10;
        self.sum_s += in_s - out_s;
        let inverse = 1.0 / f32::from(self.mean);
        let [start, end] = plan.pinned();
        let is_pinned = index < start || index + end >= plan.intervals + 2;
        let at = usize::from(index);
        if let (Some(walk), Some(pace)) = (plan.walk.get_mut(at), draft_mut(lists).get_mut(at)) {
            *walk = to_f32(self.sum_q10) * MM_PER_Q10 * inverse;
            let ratio = plan.step_s / (self.sum_s * inverse).at_least(1e-9);
            *pace = if is_pinned { 1.0 } else { ratio * ratio };
        }
    }

    fn begin_means(&mut self, plan: &Plan) {
        self.sum_q10 = 0;
        self.sum_s = f32::from(self.mean_nodes()) * plan.step_s;
    }

    /// A mean: a step of the walk, and its pace as it is.
    fn mean(&mut self, lists: &mut Lists, plan: &mut Plan, index: u16) {
        let pairs = self.times - 1;
        let n = self.mean_nodes();
        let inverse = 1.0 / f32::from(n);
        let h = plan.step_s;
        let increment = |index: u16| to_q10(get(lists, BUSY, index));
        let duration = |index: u16| self.scale * (get(lists, NODES, index + 1) - get(lists, NODES, index));
        // The newest is index - 2, the oldest that leaves is index - 2 - n; beyond the ends nothing moves.
        let newest = index.checked_sub(2).filter(|newest| *newest < pairs);
        let oldest = index.checked_sub(2 + n).filter(|oldest| *oldest < pairs);
        let (mut sum_q10, mut sum_s) = (self.sum_q10, self.sum_s);
        if let Some(newest) = newest {
            sum_q10 += increment(newest);
            sum_s += duration(newest) - h;
        }
        if let Some(oldest) = oldest {
            sum_q10 -= increment(oldest);
            sum_s += h - duration(oldest);
        }
        let index = usize::from(index);
        if let (Some(walk), Some(pace)) = (plan.walk.get_mut(index), draft_mut(lists).get_mut(index)) {
            *walk = to_f32(sum_q10) * MM_PER_Q10 * inverse;
            let ratio = h / (sum_s * inverse).at_least(1e-9);
            *pace = ratio * ratio;
        }
        (self.sum_q10, self.sum_s) = (sum_q10, sum_s);
    }
}

/// Least intervals of a pass of few periods.
const NODES_LEAST: u16 = 12;
/// Most intervals as u16.
const NODES_COUNT: u16 = 160;
const _: () = assert!(NODES_COUNT as usize == NODES_MAX);
