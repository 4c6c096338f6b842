//! The times of a walk's nodes: close together at busy places and at the ends, farther apart away from them.

use super::lists::{Lists, get};
use super::walk::BUSY;
use crate::math::number::Bounded;

/// The times of nodes, one after the other.
pub(super) struct NodeTimes {
    /// Duration of the unsmoothed walk, and length of the mean, s.
    pub(super) duration: f32,
    pub(super) mean_s: f32,
    /// Spacing at busy places, s, its growth away from them, per second, and the widest.
    pub(super) spacing: f32,
    pub(super) growth: f32,
    pub(super) widest: f32,
    /// The same at the ends.
    pub(super) end_spacing: f32,
    pub(super) end_growth: f32,
    pub(super) at: f32,
    pub(super) busy: u16,
    pub(super) busy_count: u16,
    /// Times of the busy places before and after, and of the rests, s; the place from which the next rest is sought.
    pub(super) last: f32,
    pub(super) following: f32,
    pub(super) rests: [f32; 2],
    pub(super) rest: u16,
    pub(super) count: u16,
}

impl NodeTimes {
    /// The time of the next node, s; none after the last. Inlined, so that the fields are in registers while nodes are counted.
    #[inline(always)]
    pub(super) fn next(&mut self, lists: &Lists) -> Option<f32> {
        if self.count == 0 {
            self.count = 1;
            return Some(0.0);
        }
        if self.at >= self.duration {
            return None;
        }
        let now = self.spacing_at(lists, self.at);
        self.at += self.spacing_at(lists, self.at + 0.5 * now);
        self.count += 1;
        Some(self.at)
    }

    #[inline(always)]
    fn spacing_at(&mut self, lists: &Lists, at: f32) -> f32 {
        while self.busy + 1 < self.busy_count && self.following.abs() < at {
            self.busy += 1;
            self.last = self.following;
            self.following = get(lists, BUSY, self.busy);
        }
        let [_, rest] = self.rests;
        if at >= rest {
            // By value: a reference to the fields would keep all of them in memory.
            let (next, time) = rest_from(lists, self.rest, self.busy_count);
            self.rest = next;
            self.rests = [rest, time.at_most(self.duration)];
        }
        let before = (at - self.last.abs()).abs();
        let after = (self.following.abs() - at).abs();
        let away = (before.at_most(after) - self.mean_s).at_least(0.0);
        let there = (self.spacing + self.growth * away).at_most(self.widest);
        let [rest_before, rest_after] = self.rests;
        let from_end = (at - rest_before).at_most((rest_after - at).abs()) - self.mean_s;
        there.at_most(self.end_spacing + self.end_growth * from_end.at_least(0.0))
    }
}

/// Time of the first rest among the busy places from this one on, and the place after it.
#[cold]
#[inline(never)]
fn rest_from(lists: &Lists, from: u16, count: u16) -> (u16, f32) {
    for place in from..count {
        let time = get(lists, BUSY, place);
        if time < 0.0 {
            return (place + 1, -time);
        }
    }
    (count, f32::MAX)
}
