//! The walk along a path that a plan scales: an acceleration-limited motion below rough caps of the speed, smoothed by a moving average, with nodes
//! close together where the speed changes.

mod means;
mod nodes;
mod speeds;

use super::deadlines::Deadlines;
use super::knots::find_knots;
use super::limits::MotionLimits;
use super::lists::Lists;
use super::plan::Plan;
use super::stations::{STATIONS_MAX, Station};
use crate::math::arith::sqrt;
use crate::math::number::Bounded;
use nodes::GROWTH;
pub(crate) use nodes::NODES_COUNT;

/// Usual spacing of nodes, s: a finer one makes no better plan.
const SPACING: f32 = 5e-3;
/// Bisections of the spacing.
const BISECTIONS: u8 = 12;
/// Tries to coarsen the ends.
const COARSENINGS: u8 = 20;
const STATIONS_A_PORTION: u16 = 24;
const JUMPS_A_PORTION: u16 = 6;
const CELLS_A_PORTION: u16 = 84;
const NODES_A_PORTION: u16 = 60;
const PLACES_A_PORTION: u16 = 50;
const BUSY_A_PORTION: u16 = 56;
const KNOTS_A_PORTION: u16 = 40;
/// Jumps in the intervals of a portion, but for those of the last one.
const KNOTS_FOUND: u16 = 10;

/// Cycles of a portion with no item.
const PORTION_LEAST: u32 = 1_500;
/// Cycles for a jump of the curvature, on top of the others.
const BUSY_JUMP: u32 = 200;
const KNOT: u32 = 750;
/// Most stations.
const STATIONS: u16 = 168;
const _: () = assert!(STATIONS as usize == STATIONS_MAX);

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
    /// Tries whether there are enough nodes for the usual spacing everywhere,
    TryEven,
    /// or for one that grows away from places where the speed changes;
    TryGrowing,
    /// if not, makes the spacing at the ends coarser.
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
    /// Least jerk along the path, mm/s^3.
    jerk: f32,
    /// Greatest acceleration, mm/s^2.
    acceleration: f32,
    /// Greatest speed, mm/s, and the square of the walk's.
    speed: f32,
    top: f32,
    /// Jumps among the stations.
    jumps: u16,
    /// Duration of the acceleration-limited motion, s.
    duration: f32,
    /// Length of the moving average, s.
    mean_s: f32,
    intervals: u16,
    busy: u16,
    vary: Vary,
    low: f32,
    high: f32,
    /// Spacing at the ends, s.
    ends: f32,
    /// Greatest growth of the spacing, s/s.
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
    /// Set where more intervals were chosen than can be planned within the plan's own duration: the number that can, and the least periods of a plan
    /// when they were chosen.
    usual: Option<(u16, u32)>,
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
        top: 0.0,
        jumps: 0,
        duration: 0.0,
        mean_s: 0.0,
        intervals: 0,
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
        usual: None,
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

    /// Set where more intervals were chosen than can be planned within the plan's own duration: the number that can, and the least periods of a plan
    /// when they were chosen.
    pub(crate) const fn usual(&self) -> Option<(u16, u32)> {
        self.usual
    }

    /// Cycles of the next portion, by the pessimistic model of `cargo sim budget`.
    pub(crate) fn cycles(&self, plan: &Plan) -> u32 {
        let stations = plan.stations.count();
        let left = |of: u16, most: u16| of.saturating_sub(self.index).min(most);
        // Cycles in proportion to the number of items, from those of a full portion.
        let (cycles, [count, most]) = match self.stage {
            Stage::Caps => (18_100, [left(stations, STATIONS_A_PORTION), STATIONS_A_PORTION]),
            Stage::Jumps => (20_000, [self.jumps, JUMPS_A_PORTION]),
            Stage::Rests => (12_000, [stations, STATIONS]),
            Stage::Backwards => (25_000, [stations, STATIONS]),
            Stage::Busy => (
                8_500 + BUSY_JUMP * u32::from(self.jumps.min(BUSY_A_PORTION / 2)),
                [left(stations, BUSY_A_PORTION), BUSY_A_PORTION],
            ),
            Stage::Flatten => (17_000, [stations, STATIONS]),
            Stage::Forwards => (17_000, [left(stations, CELLS_A_PORTION), CELLS_A_PORTION]),
            Stage::TryEven | Stage::TryGrowing | Stage::Coarsen | Stage::Bisect(_) | Stage::Times => (
                25_500,
                [self.intervals + stations / 4, NODES_COUNT + STATIONS / 4],
            ),
            Stage::Increments => (21_500, [left(self.times, PLACES_A_PORTION), PLACES_A_PORTION]),
            Stage::Means => (
                10_500,
                [left(self.intervals + 2, NODES_A_PORTION), NODES_A_PORTION],
            ),
            Stage::Nodes => (
                15_000,
                [left(self.intervals + 1, PLACES_A_PORTION), PLACES_A_PORTION],
            ),
            Stage::Knots => (
                10_500 + KNOT * u32::from(self.jumps.min(KNOTS_FOUND)),
                [left(self.intervals, KNOTS_A_PORTION), KNOTS_A_PORTION],
            ),
            Stage::Done => return 0,
        };
        let count = if plan.has_turn() { most } else { count.min(most) };
        let [count, most] = [count, most].map(u32::from);
        PORTION_LEAST + (cycles - PORTION_LEAST) * count / most
    }

    /// One portion. Returns whether the walk is complete.
    #[inline(never)]
    pub(crate) fn work(
        &mut self,
        lists: &mut Lists,
        plan: &mut Plan,
        limits: &MotionLimits,
        deadlines: Deadlines,
    ) -> bool {
        self.stage = match self.stage {
            Stage::Caps => self.cap_stations(lists, plan, limits),
            Stage::Jumps => self.slow_at_jumps(lists, plan, limits),
            Stage::Flatten => {
                self.flatten(lists, plan);
                Stage::Backwards
            }
            Stage::Backwards => {
                self.backwards(lists, plan);
                Stage::Forwards
            }
            Stage::Forwards => self.go_forwards(lists, plan, limits, deadlines),
            Stage::Rests => {
                self.rest_at_jumps(lists, plan);
                Stage::Busy
            }
            Stage::Busy => self.busy_cells(lists, plan, limits),
            Stage::TryEven => self.try_even(lists),
            Stage::TryGrowing => self.try_growing(lists),
            Stage::Coarsen => self.coarsen(lists),
            Stage::Bisect(BISECTIONS..) => Stage::Times,
            Stage::Bisect(tried) => self.bisect(lists, tried),
            Stage::Times => {
                self.times(lists, plan);
                Stage::Increments
            }
            Stage::Increments => self.increments(lists, plan),
            Stage::Means => self.means(lists, plan),
            Stage::Nodes => self.place_nodes(plan),
            Stage::Knots => self.find_knots(plan, limits),
            Stage::Done => Stage::Done,
        };
        self.stage == Stage::Done
    }

    fn cap_stations(&mut self, lists: &mut Lists, plan: &Plan, limits: &MotionLimits) -> Stage {
        self.speeds = plan.ends;
        let count = plan.stations.count();
        let end = count.min(self.index + STATIONS_A_PORTION);
        for station in self.index..end {
            let Station { arc_nm, q } = plan.stations.get(station);
            let share = if plan.is_near_turn(*arc_nm) {
                self.tightened
            } else {
                1.0
            };
            self.cap(lists, station, q, limits, share);
            self.jumps += u16::from(plan.stations.is_jump(station));
        }
        let next = if self.jumps > 0 {
            Stage::Jumps
        } else {
            self.after_jumps()
        };
        self.next(end, end == count, Stage::Caps, next)
    }

    fn after_jumps(&self) -> Stage {
        if self.is_from_rest_to_rest() {
            Stage::Backwards
        } else {
            Stage::Flatten
        }
    }

    fn slow_at_jumps(&mut self, lists: &mut Lists, plan: &Plan, limits: &MotionLimits) -> Stage {
        let count = plan.stations.count();
        let mut left = JUMPS_A_PORTION;
        let mut station = self.index;
        while station < count && left > 0 {
            if plan.stations.is_jump(station) {
                self.slow_at_jump(lists, plan, station, limits);
                left -= 1;
            }
            station += 1;
        }
        self.next(station, station >= count, Stage::Jumps, self.after_jumps())
    }

    fn go_forwards(
        &mut self,
        lists: &mut Lists,
        plan: &mut Plan,
        limits: &MotionLimits,
        deadlines: Deadlines,
    ) -> Stage {
        let last = plan.stations.count().saturating_sub(1);
        let end = last.min(self.index + CELLS_A_PORTION);
        self.forwards(lists, plan, self.index, end);
        if end == last {
            self.choose_mean(plan);
            self.choose_intervals(limits, deadlines);
        }
        self.next(end, end == last, Stage::Forwards, Stage::Rests)
    }

    fn busy_cells(&mut self, lists: &mut Lists, plan: &Plan, limits: &MotionLimits) -> Stage {
        let last = plan.stations.count().saturating_sub(1);
        let end = last.min(self.index + BUSY_A_PORTION);
        if self.index == 0 {
            self.begin_busy(lists, last);
        }
        self.find_busy(lists, plan, limits, self.index..end);
        if end == last {
            self.add_busy(lists, self.duration);
        }
        self.next(end, end == last, Stage::Busy, Stage::TryEven)
    }

    /// The usual spacing, s: not below the finest.
    fn usual_spacing(&self) -> f32 {
        SPACING.at_least(self.finest)
    }

    /// Mean spacing of the nodes, s.
    fn mean_spacing(&self) -> f32 {
        (self.duration + self.mean_s) / f32::from(self.intervals)
    }

    fn try_even(&mut self, lists: &Lists) -> Stage {
        let usual = self.usual_spacing();
        if !self.fits(lists, usual, 0.0) {
            return Stage::TryGrowing;
        }
        self.vary = Vary::Even;
        let least = 0.25 * self.mean_spacing();
        (self.low, self.high) = (least.at_least(self.finest).at_most(usual), usual);
        Stage::Bisect(0)
    }

    fn try_growing(&mut self, lists: &Lists) -> Stage {
        let usual = self.usual_spacing();
        if self.fits(lists, usual, self.growth) {
            self.vary = Vary::Growth;
            (self.low, self.high) = (1e-4, self.growth);
            return Stage::Bisect(0);
        }
        self.vary = Vary::Coarse;
        (self.low, self.high) = (usual, (8.0 * self.mean_spacing()).at_least(usual));
        Stage::Coarsen
    }

    fn coarsen(&mut self, lists: &Lists) -> Stage {
        if self.fits(lists, self.high, self.growth) || self.coarsenings >= COARSENINGS {
            return Stage::Bisect(0);
        }
        // The usual spacing may fit now. The moving average takes the nodes that are left over, and must not be longer than the rests.
        self.ends *= 1.5;
        self.coarsenings += 1;
        Stage::TryEven
    }

    fn bisect(&mut self, lists: &Lists, tried: u8) -> Stage {
        let middle = sqrt(self.low * self.high);
        let [spacing, growth] = self.spacing(middle);
        if self.fits(lists, spacing, growth) {
            self.high = middle;
        } else {
            self.low = middle;
        }
        Stage::Bisect(tried + 1)
    }

    fn increments(&mut self, lists: &mut Lists, plan: &mut Plan) -> Stage {
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

    fn means(&mut self, lists: &mut Lists, plan: &mut Plan) -> Stage {
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

    fn place_nodes(&mut self, plan: &mut Plan) -> Stage {
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

    fn find_knots(&mut self, plan: &mut Plan, limits: &MotionLimits) -> Stage {
        let most = plan.knot_count.saturating_add(KNOTS_FOUND);
        let mut end = self.index;
        for interval in self.index..plan.intervals.min(self.index + KNOTS_A_PORTION) {
            if plan.knot_count >= most {
                break;
            }
            find_knots(plan, interval, limits);
            end = interval + 1;
        }
        self.next(end, end == plan.intervals, Stage::Knots, Stage::Done)
    }

    /// Goes on at `index` of a stage, or to the next stage where this one is over.
    const fn next(&mut self, index: u16, is_over: bool, stage: Stage, next: Stage) -> Stage {
        self.index = if is_over { 0 } else { index };
        if is_over { next } else { stage }
    }

    /// Whether the walk is from rest to rest.
    fn is_from_rest_to_rest(&self) -> bool {
        self.speeds == [0.0; 2]
    }
}
