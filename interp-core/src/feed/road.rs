//! The plan that is followed and, through the turn after it, the next: where a change of the pace may lead. And the last place of a plan from which
//! the tool still stops before the next begins.

use super::pace::{Change, Trajectory, Use, room_of};
use super::plan::{Cursor, Gate, Plan};
use super::profile::{SlotAt, Span};
use crate::math::arith::inverse_sqrt;
use crate::math::number::Bounded;

/// Use of the limits where the tool may not go.
const FORBIDDEN: f32 = 100.0;

/// Duration of the shortest stop that is tried, s, the ratio of one to the next, and their number.
const SHORTEST_S: f32 = 0.06;
const LONGER: f32 = 1.15;
const TRIES: u8 = 24;
/// Share of the pace that is kept where no stop holds.
const SLOWER: f32 = 0.85;
/// Time between the stop and the end of the plan, s.
const MARGIN_S: f32 = 0.006;
/// Places of a stop that are looked at.
const PLACES: f32 = 64.0;

/// The plans ahead of the tool.
pub(crate) struct Road<'a> {
    pub(crate) now: &'a Plan,
    /// The next plan, once it is known.
    pub(crate) next: Option<&'a Plan>,
    /// Greatest pace on the next plan.
    pub(crate) next_pace: f32,
    /// Whether the tool is to stand in the end.
    pub(crate) stops: bool,
}

impl Road<'_> {
    const fn plan(&self, cursor: &Cursor) -> &Plan {
        match self.next {
            Some(next) if cursor.is_next => next,
            _ => self.now,
        }
    }

    /// Whether a cursor is where the plans end without an end.
    fn is_beyond(&self, cursor: &Cursor) -> bool {
        let plan = self.plan(cursor);
        let is_last = cursor.is_next || self.next.is_none();
        is_last && plan.goes_on() && (plan.is_over(cursor) || (!self.stops && plan.is_past_gate(cursor)))
    }
}

impl Trajectory for Road<'_> {
    type Cursor = Cursor;

    fn advance(&self, cursor: &mut Cursor, seconds: f32) {
        self.plan(cursor).advance(cursor, seconds);
        if !cursor.is_next
            && self.now.goes_on()
            && self.now.is_over(cursor)
            && let Some(next) = self.next
        {
            let beyond = self.now.beyond(cursor);
            *cursor = Cursor {
                is_next: true,
                ..Cursor::START
            };
            next.advance(cursor, beyond);
        }
    }

    fn is_over(&self, cursor: &Cursor) -> bool {
        let plan = self.plan(cursor);
        !plan.goes_on() && plan.is_over(cursor)
    }

    fn use_at(&self, cursor: &Cursor, rates: [f32; 3], around: f32) -> Use {
        if self.is_beyond(cursor) {
            return Use {
                jerk: FORBIDDEN,
                ..Use::NONE
            };
        }
        let mut most = self.plan(cursor).use_at(cursor, rates, around);
        let [pace, ..] = rates;
        if cursor.is_next && pace > self.next_pace * 1.001 {
            most.jerk = most.jerk.at_least(FORBIDDEN);
        }
        most
    }

    fn is_uneven(&self, cursor: &Cursor) -> bool {
        self.plan(cursor).is_uneven(cursor)
    }

    fn ramp_s(&self) -> f32 {
        self.now.ramp_s()
    }

    fn span_at(&self, cursor: &Cursor, slot: &SlotAt, room: &Use) -> Span {
        if self.is_beyond(cursor) || (cursor.is_next && slot.r > self.next_pace * 1.001) {
            return Span::NONE;
        }
        self.plan(cursor).span_at(cursor, slot, room)
    }
}

/// The search for a plan's last place to stop at.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GateSearch {
    gate: Gate,
    cursor: Cursor,
    time: f32,
    tried: u8,
    is_placed: bool,
}

impl GateSearch {
    pub(crate) const START: Self = Self {
        gate: Gate {
            interval: 0,
            duration: SHORTEST_S,
            before_end: 0.0,
        },
        cursor: Cursor::START,
        time: 0.0,
        tried: 0,
        is_placed: false,
    };

    /// Whether the next piece of work is a place of a stop.
    pub(crate) const fn is_placed(&self) -> bool {
        self.is_placed
    }

    /// One place of a stop, or the place of the next; whether the gate is found.
    #[inline(never)]
    pub(crate) fn work(&mut self, plan: &mut Plan) -> bool {
        if !self.is_placed {
            self.place(plan);
            return false;
        }
        let change = Change::new([plan.pace_max, 0.0, 0.0], 0.0, self.gate.duration);
        let step = self.gate.duration * (1.0 / PLACES);
        let rates = change.rates(self.time);
        let [pace, ..] = rates;
        let used = plan.use_at(&self.cursor, rates, 0.5 * step);
        if plan.is_over(&self.cursor) || used.ratio(room_of(false, pace)) > 1.0 {
            self.gate.duration *= LONGER;
            self.tried += 1;
            self.is_placed = false;
            return false;
        }
        if self.time >= self.gate.duration {
            plan.gate = self.gate;
            return true;
        }
        let [middle, ..] = change.rates(self.time + 0.5 * step);
        plan.advance(&mut self.cursor, step * middle.at_least(0.0));
        self.time = (self.time + step).at_most(self.gate.duration);
        false
    }

    /// Finds the node that a stop has to begin at.
    fn place(&mut self, plan: &mut Plan) {
        let needed = plan.pace_max * 0.5 * self.gate.duration + MARGIN_S;
        let mut left = 0.0;
        let mut node = plan.intervals;
        while left < needed && node > 0 {
            node -= 1;
            let [pace, ..] = plan.interval(node).pace_rates(0.5);
            left += plan.step_s * inverse_sqrt(pace.at_least(1e-9));
        }
        if left < needed || self.tried >= TRIES {
            plan.pace_max *= SLOWER;
            *self = Self::START;
            return;
        }
        self.gate.interval = node;
        self.gate.before_end = left;
        self.cursor = Cursor::at_node(plan, node);
        self.time = 0.0;
        self.is_placed = true;
    }
}
