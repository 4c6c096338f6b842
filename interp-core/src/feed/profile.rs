//! A change of the pace that uses at each place what the axes leave there: in slots of equal duration, each with a constant second derivative.
//!
//! The pace r goes towards its goal with the greatest r'' that every axis's jerk allows, up to the r' that the accelerations allow, until it has to
//! come to rest at the goal: from there on r'' is what a parabola to the goal needs. Each slot is chosen and checked in its middle; where nothing is allowed,
//! the next attempt is more careful.

use crate::math::number::Bounded;

/// Segments of a profile: slots in a row of the same r''.
const SEGMENTS: usize = 64;
/// Share of the segments that one is.
const PART_OF_SEGMENTS: f32 = 1.0 / 64.0;
/// Most slots of a segment.
const SLOTS_A_SEGMENT: u32 = 0xff;
/// Most slots of a profile.
const SLOTS_MAX: u16 = 400;
/// Most slots that a place moves on by at once.
const SLOTS_A_STEP: u8 = 8;
/// Part of a slot by which rounding may be short of its end.
const ROUNDING: f32 = 1e-3;
/// Difference of r'' from the one that is best, as a share of it, for which a segment goes on.
const SAME: f32 = 0.08;
/// Factor on the difference [`SAME`] after an attempt that ran out of segments.
const COARSER: f32 = 2.5;
/// Greatest difference: 1 would accept any r''.
const COARSEST: f32 = 0.6;
/// Share of the difference by which a new segment takes less than the best r'', so that it can go on where the axes leave less.
const LESS: f32 = 0.5;
/// Difference where segments become few.
const COARSE: f32 = 0.3;
/// Share of the segments that is taken, from which on the difference is [`COARSE`], and [`COARSEST`].
const TAKEN: [f32; 2] = [0.5, 0.75];
/// Lead of that share over the share of the way to the goal, from which on the difference is [`COARSE`], and [`COARSEST`].
const TAKEN_BEYOND: [f32; 2] = [0.1, 0.3];
/// Paces that differ by less count as equal.
const SAME_PACE: f32 = 1e-6;
/// Pace below 0 that is rounding.
const PACE_MIN: f32 = -1e-5;
/// Greatest r'', as a multiple of one over the square of a slot.
const SECOND_MAX: f32 = 4.0;
/// Share of the r' allowed by the accelerations that is aimed at.
const AIMED: f32 = 0.985;
/// Share of it allowed for rounding and changes within a slot.
const BEYOND: f32 = 0.004;
/// Share of it down to which a segment goes on.
const KEPT: f32 = 0.97;
/// Greatest r', as a multiple of one over a slot: where the tool hardly moves, speed and acceleration of the plan change much within a slot.
const FIRST_MAX: f32 = 0.05;
/// Parts of the best r'' that are tried where it is too much before the goal.
const PARTS: [f32; 4] = [1.0, 0.5, 0.25, 0.125];

/// Most attempts.
const ATTEMPTS: u8 = 6;
/// Share of r' that the next attempt takes up to where nothing was allowed, once.
const SLOWER: f32 = 0.55;
/// Share of r'' with which the first attempt comes to rest at the goal.
const TO_REST: f32 = 0.9;
/// Factor on that share where it was too much.
const LESS_TO_REST: f32 = 0.75;
/// Share of the range of r'' that the next slot is assumed to have at least.
const HALF_KEPT: f32 = 0.85;
/// The attempt from which on slots are as short as can be.
const FINE: u8 = 2;

/// What the axes allow at a place: r' by acceleration, 1/s, and r'' by jerk, 1/s^2.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    pub(crate) first: [f32; 2],
    pub(crate) second: [f32; 2],
}

impl Span {
    /// Everything.
    pub(crate) const WIDE: Self = Self {
        first: [-1e9, 1e9],
        second: [-1e9, 1e9],
    };
    /// Nothing.
    pub(crate) const NONE: Self = Self {
        first: [1.0, -1.0],
        second: [1.0, -1.0],
    };

    /// What both allow.
    pub(crate) fn add(&mut self, other: &Self) {
        let both = |one: &mut [f32; 2], [low, high]: [f32; 2]| {
            *one = [one[0].at_least(low), one[1].at_most(high)];
        };
        both(&mut self.first, other.first);
        both(&mut self.second, other.second);
    }

    /// An axis: the fraction of the limit that it uses at a constant pace, in the middle and at the end of the slot, and for each unit of r', and the
    /// greatest.
    #[inline(always)]
    pub(crate) fn add_acceleration(&mut self, [middle, end]: [f32; 2], slope: f32, most: f32) {
        let at = [middle.at_most(end), middle.at_least(end)];
        narrow(&mut self.first, at, slope, most);
    }

    /// The same, the least and greatest fraction around the place, for each unit of r'' at the start and at the end of a slot.
    #[inline(always)]
    pub(crate) fn add_jerk(&mut self, at: [f32; 2], slopes: [f32; 2], most: f32) {
        for slope in slopes {
            narrow(&mut self.second, at, slope, most);
        }
    }

    /// The same in the other direction, if asked for.
    fn mirrored(&self, is_mirrored: bool) -> Self {
        if !is_mirrored {
            return *self;
        }
        let mirror = |[low, high]: [f32; 2]| [-high, -low];
        Self {
            first: mirror(self.first),
            second: mirror(self.second),
        }
    }
}

/// Narrows a range to `|at + slope x| <= most` for everything between two values.
#[inline(always)]
fn narrow([low, high]: &mut [f32; 2], [least, greatest]: [f32; 2], slope: f32, most: f32) {
    let inverse = 1.0 / slope.abs().at_least(1e-9);
    let (below, above) = ((-most - least) * inverse, (most - greatest) * inverse);
    let (from, to) = if slope < 0.0 {
        (-above, -below)
    } else {
        (below, above)
    };
    *low = low.at_least(from);
    *high = high.at_most(to);
}

/// The greatest speed within a time of a place with this speed, acceleration and jerk.
#[inline(always)]
pub(crate) fn fastest_around([v, a, j]: [f32; 3], around: f32) -> f32 {
    v + around * (a.abs() + 0.5 * j.abs() * around)
}

/// A slot of a profile that is to be chosen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlotAt {
    /// r in its middle, and r' at its start, 1/s.
    pub(crate) r: f32,
    pub(crate) first: f32,
    /// Its duration, and the time before and after its middle that the place stands for, s.
    pub(crate) slot_s: f32,
    pub(crate) around: f32,
}

/// Slots in a row of the same r'': the bits of r'', 1/s^2, but for the last eight, which count the slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Segment(u32);

impl Segment {
    /// r'' as a segment has it.
    const fn short(second: f32) -> f32 {
        f32::from_bits(second.to_bits() & !SLOTS_A_SEGMENT)
    }

    const fn second(self) -> f32 {
        f32::from_bits(self.0 & !SLOTS_A_SEGMENT)
    }

    const fn slots(self) -> u32 {
        self.0 & SLOTS_A_SEGMENT
    }
}

/// A change of the pace.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Profile {
    segments: [Segment; SEGMENTS],
    count: u8,
    /// Duration of a slot, s.
    slot_s: f32,
    /// r and r' at the start.
    start: [f32; 2],
    goal: f32,
    /// Duration of the parabola after the last segment, s.
    end_s: f32,
}

impl Profile {
    pub(crate) const NONE: Self = Self {
        segments: [Segment(0); SEGMENTS],
        count: 0,
        slot_s: 1.0,
        start: [0.0; 2],
        goal: 0.0,
        end_s: 0.0,
    };

    /// The place at the start.
    pub(crate) const fn begin(&self) -> ProfilePlace {
        ProfilePlace {
            segment: 0,
            slot: 0,
            rates: self.start,
            since: 0.0,
        }
    }

    /// Empties it.
    pub(crate) const fn clear(&mut self, start: [f32; 2], goal: f32, slot_s: f32) {
        (self.start, self.goal, self.slot_s) = (start, goal, slot_s);
        (self.count, self.end_s) = (0, 0.0);
    }

    /// Duration of a slot, s.
    pub(crate) const fn slot_s(&self) -> f32 {
        self.slot_s
    }

    /// r'' of the last segment.
    fn last(&self) -> f32 {
        let index = usize::from(self.count).wrapping_sub(1);
        self.segments.get(index).map_or(0.0, |segment| segment.second())
    }

    /// Least difference of r'' for which a segment goes on at this pace: greater where few segments are left, or fewer than the way to the goal.
    fn least_same(&self, pace: f32) -> f32 {
        let [start, _] = self.start;
        let taken = f32::from(self.count) * PART_OF_SEGMENTS;
        let way = 1.0 - (pace - self.goal).abs() / (start - self.goal).abs().at_least(SAME_PACE);
        let ([half, most], [half_beyond, most_beyond]) = (TAKEN, TAKEN_BEYOND);
        if taken >= most || taken - way > most_beyond {
            COARSEST
        } else if taken >= half || taken - way > half_beyond {
            COARSE
        } else {
            0.0
        }
    }

    /// Appends a slot of an r'' as segments have it; returns whether there is room for it.
    fn push(&mut self, second: f32) -> bool {
        let index = usize::from(self.count).wrapping_sub(1);
        if let Some(segment) = self.segments.get_mut(index)
            && segment.slots() < SLOTS_A_SEGMENT
            && segment.second() == second
        {
            segment.0 += 1;
            return true;
        }
        match self.segments.get_mut(usize::from(self.count)) {
            Some(segment) => {
                *segment = Segment(second.to_bits() | 1);
                self.count += 1;
                true
            }
            None => false,
        }
    }

    /// r'' in the slot of a place; none in the parabola.
    fn second_at(&self, place: &ProfilePlace) -> Option<f32> {
        let segment = self.segments.get(usize::from(place.segment))?;
        (place.segment < self.count).then_some(segment.second())
    }
}

/// The profile that is followed, and the one that is being made, for whatever moves.
#[derive(Clone, Debug)]
pub(crate) struct Profiles {
    lists: [Profile; 2],
    second: bool,
}

impl Profiles {
    pub(crate) const NONE: Self = Self {
        lists: [Profile::NONE; 2],
        second: false,
    };

    /// The profile that is followed.
    pub(crate) const fn followed(&self) -> &Profile {
        let [one, other] = &self.lists;
        if self.second { other } else { one }
    }

    /// The one that was made, which [`Self::swap`] has followed.
    pub(crate) const fn next(&self) -> &Profile {
        let [one, other] = &self.lists;
        if self.second { one } else { other }
    }

    /// The one that is being made.
    pub(crate) const fn made(&mut self) -> &mut Profile {
        let [one, other] = &mut self.lists;
        if self.second { one } else { other }
    }

    /// Follows the one that was made.
    pub(crate) const fn swap(&mut self) {
        self.second = !self.second;
    }
}

/// A place on a profile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ProfilePlace {
    segment: u8,
    slot: u8,
    /// r and r' at the start of the slot.
    rates: [f32; 2],
    /// Time since then, s.
    since: f32,
}

impl ProfilePlace {
    pub(crate) const START: Self = Self {
        segment: 0,
        slot: 0,
        rates: [0.0; 2],
        since: 0.0,
    };

    /// Moves on by this time, s: a few slots.
    pub(crate) fn advance(&mut self, profile: &Profile, seconds: f32) {
        self.since += seconds;
        for _ in 0..SLOTS_A_STEP {
            let Some(second) = profile.second_at(self) else {
                return;
            };
            if self.since < (1.0 - ROUNDING) * profile.slot_s {
                return;
            }
            self.rates = after(self.rates, second, profile.slot_s);
            self.since -= profile.slot_s;
            self.slot += 1;
            let segment = profile.segments.get(usize::from(self.segment));
            if u32::from(self.slot) >= segment.map_or(0, |segment| segment.slots()) {
                (self.segment, self.slot) = (self.segment + 1, 0);
            }
        }
    }

    /// r, r', r'' a part of a period ahead, within the slot.
    pub(crate) fn rates(&self, profile: &Profile, ahead: f32) -> [f32; 3] {
        let t = self.since + ahead;
        let [r, first] = self.rates;
        if let Some(second) = profile.second_at(self) {
            let [r, first] = after([r, first], second, t);
            return [r, first, second];
        }
        if t >= profile.end_s {
            return [profile.goal, 0.0, 0.0];
        }
        let inverse = 1.0 / profile.end_s;
        let left = 1.0 - t * inverse;
        let apart = r - profile.goal;
        [
            profile.goal + apart * left * left,
            -2.0 * apart * left * inverse,
            2.0 * apart * inverse * inverse,
        ]
    }

    /// Whether the goal is reached.
    pub(crate) fn is_over(&self, profile: &Profile) -> bool {
        self.segment >= profile.count && self.since >= profile.end_s
    }
}

/// r and r' after a time at this r''.
fn after([r, first]: [f32; 2], second: f32, t: f32) -> [f32; 2] {
    [r + t * (first + 0.5 * second * t), first + second * t]
}

/// What came of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Slot {
    /// It is appended.
    Appended,
    /// The goal is reached.
    Complete,
    /// Nothing is allowed: a new attempt begins at the start.
    Again,
    /// No attempt is left.
    Failed,
}

/// The making of a profile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Making {
    rates: [f32; 2],
    slots: u16,
    attempt: u8,
    /// Shortest slot, s.
    finest: f32,
    /// Difference of r'' for which a segment goes on.
    same: f32,
    /// Greatest r' towards the goal up to a slot, 1/s.
    most: f32,
    until: u16,
    /// Share of r'' that is counted on to come to rest, and half of the range of r'' that the axes leave at a constant pace: at a single place it may be little.
    to_rest: f32,
    half: f32,
}

impl Making {
    pub(crate) const fn new(start: [f32; 2], finest: f32) -> Self {
        Self {
            finest,
            same: SAME,
            rates: start,
            slots: 0,
            attempt: 0,
            most: f32::MAX,
            until: 0,
            to_rest: TO_REST,
            half: 0.0,
        }
    }

    /// r and r' at the start of the slot.
    pub(crate) const fn rates(&self) -> [f32; 2] {
        self.rates
    }

    /// The slot that is to be chosen; `more`: time around it that it stands for, s.
    pub(crate) fn slot(&self, profile: &Profile, more: f32) -> SlotAt {
        let Profile { slot_s, .. } = *profile;
        let [r, _] = after(self.rates, profile.last(), 0.5 * slot_s);
        let [_, first] = self.rates;
        SlotAt {
            r: r.at_least(0.0),
            first,
            slot_s,
            around: 0.5 * slot_s + more,
        }
    }

    /// Appends a slot in whose middle the axes allow this, at paces up to `most`.
    pub(crate) fn append(&mut self, profile: &mut Profile, span: &Span, most: f32) -> Slot {
        let Profile { goal, slot_s, .. } = *profile;
        let [r, first] = self.rates;
        let is_down = goal < r;
        let span = span.mirrored(is_down);
        // Towards the goal.
        let sign = if is_down { -1.0 } else { 1.0 };
        let (left, first) = (sign * (goal - r), sign * first);
        let last = sign * profile.last();
        // Where the parabola ends within the slot, it is the end.
        if first > 0.0 && 2.0 * left <= first * slot_s {
            let [low, _] = span.second;
            let end_s = 2.0 * left / first;
            if first > -low * end_s * (1.0 + ROUNDING) {
                self.to_rest *= LESS_TO_REST;
                return self.try_again(profile);
            }
            profile.end_s = end_s;
            return Slot::Complete;
        }
        let same = self.same.at_least(profile.least_same(r));
        let Some(second) = self.choose(&span, [left, first], last, [slot_s, same]) else {
            return self.try_again(profile);
        };
        let second = Segment::short(sign * second);
        let rates = after(self.rates, second, slot_s);
        let [pace, _] = rates;
        self.slots += 1;
        if self.slots > SLOTS_MAX || !(PACE_MIN..=most).contains(&pace) {
            return self.try_again(profile);
        }
        if !profile.push(second) {
            self.same = (COARSER * self.same).at_most(COARSEST);
            return self.try_again(profile);
        }
        self.rates = rates;
        Slot::Appended
    }

    /// r'' of a slot, towards the goal; none where nothing is allowed.
    fn choose(
        &mut self,
        span: &Span,
        [left, first]: [f32; 2],
        last: f32,
        [slot_s, same]: [f32; 2],
    ) -> Option<f32> {
        let most = SECOND_MAX / (slot_s * slot_s);
        let [low, high] = [span.second[0].at_least(-most), span.second[1].at_most(most)];
        // Not even the greatest change of r' leads to what the accelerations allow.
        let [_, allowed] = span.first;
        let is_too_fast = first + low * slot_s > allowed + BEYOND * allowed.abs();
        if low > high || is_too_fast {
            // Where a slower change fails as well, the pace is constant up to there, which every limit allows.
            let is_first = self.slots > self.until;
            self.most = if is_first {
                SLOWER * first.at_least(0.0)
            } else {
                0.0
            };
            self.until = self.until.max(self.slots + 1);
            return None;
        }
        // To rest on the parabola from here.
        let rest = if first > 0.0 {
            -0.5 * first * first / left.at_least(1e-9)
        } else {
            0.0
        };
        let [_, fastest] = span.first;
        let mut fastest = fastest.at_most(FIRST_MAX / slot_s);
        if self.slots <= self.until {
            fastest = fastest.at_most(self.most);
        }
        // A little less than the accelerations allow, so that a segment goes on where that changes a little.
        let aimed = fastest.at_most(AIMED * fastest);
        let best = high.at_most((aimed - first) / slot_s).at_least(low);
        // What slows the pace down to the goal: what the axes leave here, but the motion of the plan itself matters less at a slower pace.
        let half = (0.5 * (high - low)).at_least(HALF_KEPT * self.half);
        self.half = half;
        let braking = self.to_rest * half.at_most((-low).at_least(0.5 * half));
        let is_early = |second: f32| {
            let [moved, first] = after([0.0, first], second, slot_s);
            let left = left - moved;
            first <= 0.0 || (left > 0.0 && 0.5 * first * first <= braking * left)
        };
        let reached = first + last * slot_s;
        let is_same = (last - best).abs() <= same * best.abs() || reached >= KEPT * fastest;
        let goes_on = is_same && (low..=high).contains(&last) && reached <= fastest;
        let best = if best > 0.0 {
            best * (1.0 - LESS * (same - SAME))
        } else {
            best
        };
        let wanted = if goes_on && is_early(last) {
            Some(last)
        } else {
            PARTS
                .iter()
                .map(|part| part * best)
                .find(|second| is_early(*second))
        };
        // Where the axes ask for more than the parabola, it ends later.
        let second = wanted.unwrap_or(rest.at_most((allowed - first) / slot_s));
        // On the parabola r'' stays what it is, but for rounding.
        let is_same = (second - last).abs() <= 1e-3 * last.abs() && (low..=high).contains(&last);
        let second = if is_same { last } else { second };
        // Less than that is made up for later: at a slower pace the axes leave more.
        let second = second.at_least(low);
        if second > high || -rest > 2.0 * half {
            self.to_rest *= LESS_TO_REST;
            return None;
        }
        Some(second)
    }

    /// The motion ends here: what is left of the profile does not matter.
    pub(crate) fn end(&self, profile: &mut Profile) {
        let [r, first] = self.rates;
        let left = profile.goal - r;
        let rate = first * if left < 0.0 { -1.0 } else { 1.0 };
        profile.end_s = 2.0 * left.abs() / rate.at_least(1e-3);
    }

    fn try_again(&mut self, profile: &mut Profile) -> Slot {
        self.attempt += 1;
        (self.slots, self.half) = (0, 0.0);
        self.rates = profile.start;
        let mut slot_s = profile.slot_s;
        if self.attempt == FINE && slot_s > self.finest {
            // Places that are closer together tell apart what happens at them, as at a patch boundary.
            slot_s = self.finest;
            (self.most, self.until, self.to_rest) = (f32::MAX, 0, TO_REST);
        }
        profile.clear(profile.start, profile.goal, slot_s);
        if self.attempt < ATTEMPTS {
            Slot::Again
        } else {
            Slot::Failed
        }
    }
}
