//! The search for a change of the pace: trials, each followed over its whole length, from the state that the motion will have when the search is over.

use super::change::Change;
use super::pace::Trajectory;
use super::profile::{Making, Profiles, Slot};
use super::room::{SPACING, Use, room_of_change};
use crate::math::arith::sqrt;
use crate::math::number::Bounded;

/// Durations that a search tries, shortest first, and the ratio of one to the next.
const TRIALS: u8 = 12;
const RATIO_MIN: f32 = 1.1;
const RATIO_MAX: f32 = 1.5;

/// Least and greatest number of places of a trial, and the one that is enough.
const PLACES_MIN: f32 = 16.0;
const PLACES_ENOUGH: f32 = 100.0;
const PLACES_MAX: f32 = 200.0;

/// Greatest change of the pace in a period: where the tool hardly moves, the plan's own motion changes as fast.
const CHANGE_MAX: f32 = 0.05;

/// Paces below 0 and above the greatest that are rounding, the latter as a ratio.
const PACE_MIN: f32 = -2e-6;
const PACE_MAX: f32 = 1.000_008;

/// Shares of the room that a profile uses: what happens within a slot.
const PROFILE_ACCELERATION: f32 = 0.995;
const PROFILE_JERK: f32 = 0.99;

/// The least pace above 1 that is worth it.
pub(super) const ABOVE_MIN: f32 = 1.02;
/// Trials of a pace above 1; the share of what is above 1 that the next one keeps; the ratio up to which one is made slower instead.
const ABOVE_TRIALS: u8 = 7;
const LOWER: f32 = 0.5;
const SLOWER_MAX: f32 = 1.25;
const SLOWER: f32 = 1.05;
/// Duration of the first stay above 1, of the whole change later on, and by how much later that has to return to be better, s.
const STAY_S: f32 = 0.02;
const WHOLE_S: f32 = 0.36;
const LATER_S: f32 = 0.02;
/// Duration of the return as a multiple of the shortest one.
const BACK: f32 = 1.1;

/// Time between the places of a trial of this duration, s.
pub(super) fn spacing(duration: f32, widest: f32) -> f32 {
    SPACING
        .at_least((duration / PLACES_ENOUGH).at_most(widest))
        .at_most(duration / PLACES_MIN)
        .at_least(duration / PLACES_MAX)
}

/// Uses of the limits by r' = 1 and by r'' = 1 at a place: how fast the pace could change there if the plan's own motion took nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inertia {
    by_first: f32,
    by_second: f32,
}

impl Inertia {
    pub(super) fn at<P: Trajectory>(trajectory: &P, at: &P::Cursor) -> Self {
        let [first, second] =
            [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|[_, r1, r2]| trajectory.use_at(at, [1e-9, r1, r2], 0.0));
        Self {
            by_first: first.acceleration,
            by_second: second.jerk,
        }
    }

    /// Shortest duration of a quintic that changes the pace by `apart`, s.
    pub(super) fn shortest(&self, apart: f32, period: f32) -> f32 {
        let apart = apart.abs().at_least(0.01);
        (1.9 * apart * self.by_first)
            .at_least(sqrt(5.8 * apart * self.by_second))
            .at_least(period * (10.0_f32).at_least(apart * (1.9 / CHANGE_MAX)))
    }
}

/// What a change may do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub(super) is_fault: bool,
    /// Greatest pace on the way.
    pub(super) ceiling: f32,
    pub(super) period: f32,
}

/// A pace above 1 that is tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Above {
    inertia: Inertia,
    top: f32,
    /// The one that is followed, or 1.
    kept: f32,
    rise_s: f32,
    stay_s: f32,
    back_s: f32,
    /// Factor of the durations.
    slower: f32,
    /// The time after which it has to return at the earliest, s.
    least_s: f32,
}

impl Above {
    /// The first trial. `kept`: the pace above 1 that is followed, or 1; `rising_s`: duration left of a rise to the same pace;
    /// `until_s`: time until it returns.
    pub(super) fn new(
        inertia: Inertia,
        [pace, ..]: [f32; 3],
        [top, kept]: [f32; 2],
        [rising_s, until_s]: [f32; 2],
        period: f32,
    ) -> Self {
        let mut above = Self {
            inertia,
            top,
            kept,
            rise_s: rising_s,
            stay_s: STAY_S,
            back_s: 0.0,
            slower: 1.0,
            least_s: 0.0,
        };
        if !(rising_s > 0.0) {
            above.rise_s = inertia.shortest(top - pace, period);
        }
        above.back_s = BACK * inertia.shortest(top - 1.0, period);
        if until_s > 0.0 {
            above.least_s = until_s + LATER_S;
            above.stay_s = (WHOLE_S - above.rise_s - above.back_s).at_least(STAY_S);
        }
        above
    }

    /// The pace that is tried.
    pub(super) const fn top(&self) -> f32 {
        self.top
    }

    /// Whole duration, s.
    pub(super) fn duration(&self) -> f32 {
        self.rise_s + self.stay_s + self.back_s
    }

    pub(super) fn change(&self, rates: [f32; 3]) -> Change {
        Change::above(rates, self.top, [self.rise_s, self.stay_s, self.back_s])
    }

    /// The next trial, where one used this ratio of the room after this time; whether there is one.
    fn lower(&mut self, [pace, ..]: [f32; 3], time: f32, ratio: f32, period: f32) -> bool {
        let is_rising = time <= self.rise_s;
        let stay_s = time - self.rise_s - self.back_s - 2.0 * period;
        if is_rising && ratio < SLOWER_MAX && self.slower <= 1.0 {
            self.slower = SLOWER * ratio;
            self.rise_s *= self.slower;
            self.back_s *= self.slower;
        } else if !is_rising && stay_s > 0.0 {
            // It has returned before that place.
            self.stay_s = stay_s.at_most(self.stay_s);
            self.back_s *= SLOWER;
        } else {
            let top = 1.0 + LOWER * (self.top - 1.0);
            self.top = if self.kept < self.top {
                top.at_least(self.kept)
            } else {
                top
            };
            let shortest = |apart: f32| self.slower * self.inertia.shortest(apart, period);
            (self.rise_s, self.back_s) = (shortest(self.top - pace), BACK * shortest(self.top - 1.0));
        }
        self.top >= ABOVE_MIN && self.rise_s + self.stay_s >= self.least_s
    }
}

/// A search for a change.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search<C> {
    /// Where the motion is and what the pace is when the change begins.
    pub(super) from: C,
    rates: [f32; 3],
    /// The pace that it leads to.
    pub(super) goal: f32,
    /// Periods until then.
    pub(super) left: u16,
    trial: u8,
    /// Longest duration that is tried, s.
    longest: f32,
    /// Greatest time between the places of a trial, s.
    widest: f32,
    pub(super) change: Change,
    /// A profile is being made, in the list that is not followed.
    making: Option<Making>,
    pub(super) is_profile: bool,
    /// A pace above 1 is sought.
    pub(super) above: Option<Above>,
    /// The trial's place, and points looked at.
    at: C,
    points: u16,
    /// Whether the change holds.
    pub(super) found: bool,
}

impl<C: Copy> Search<C> {
    pub(super) const fn new(
        (from, rates): (C, [f32; 3]),
        goal: f32,
        left: u16,
        widest: f32,
        change: Change,
    ) -> Self {
        Self {
            from,
            rates,
            goal,
            left,
            trial: 0,
            longest: f32::MAX,
            widest,
            change,
            making: None,
            is_profile: false,
            above: None,
            at: from,
            points: 0,
            found: false,
        }
    }

    /// With its places moved on; none where one of them cannot be.
    pub(super) fn relocated(self, of: impl Fn(&C) -> Option<C>) -> Option<Self> {
        let (from, at) = (of(&self.from)?, of(&self.at)?);
        Some(Self { from, at, ..self })
    }

    /// Tries nothing longer than this, s.
    pub(super) const fn limit(&mut self, longest: f32) {
        self.longest = longest;
    }

    /// Makes a profile of slots of this duration, or as short as the finest, s, before quintics are tried.
    pub(super) fn make_profile<P: Trajectory<Cursor = C>>(
        &mut self,
        trajectory: &P,
        profiles: &mut Profiles,
        [slot_s, finest]: [f32; 2],
    ) {
        let [pace, first, _] = self.rates;
        profiles.made().clear([pace, first], self.goal, slot_s);
        let making = Making::new([pace, first], finest);
        self.place_first_slot(trajectory, &making, slot_s);
        self.making = Some(making);
        self.is_profile = true;
    }

    fn place_first_slot<P: Trajectory<Cursor = C>>(&mut self, trajectory: &P, making: &Making, slot_s: f32) {
        let [pace, first] = making.rates();
        self.at = self.from;
        let way = 0.5 * slot_s * (pace + 0.25 * slot_s * first);
        trajectory.advance(&mut self.at, way.at_least(0.0));
    }

    /// One place; whether there is hope.
    pub(super) fn work<P: Trajectory<Cursor = C>>(
        &mut self,
        trajectory: &P,
        bounds: &Bounds,
        profiles: &mut Profiles,
    ) -> bool {
        if self.is_profile {
            self.work_on_profile(trajectory, bounds, profiles);
            return true;
        }
        self.work_on_change(trajectory, bounds)
    }

    fn work_on_profile<P: Trajectory<Cursor = C>>(
        &mut self,
        trajectory: &P,
        bounds: &Bounds,
        profiles: &mut Profiles,
    ) {
        let Some(mut making) = self.making else {
            return;
        };
        let profile = profiles.made();
        let slot_at = making.slot(profile, 0.5 * bounds.period);
        let room = room_of_change(bounds.is_fault, slot_at.r, self.widest);
        let room = Use {
            acceleration: PROFILE_ACCELERATION * room.acceleration,
            jerk: PROFILE_JERK * room.jerk,
            ..room
        };
        let span = trajectory.span_at(&self.at, &slot_at, &room);
        let slot = making.append(profile, &span, PACE_MAX * bounds.ceiling);
        let step = profile.slot_s();
        match slot {
            Slot::Appended if trajectory.is_over(&self.at) => {
                making.end(profile);
                self.found = true;
            }
            Slot::Appended => {
                let [pace, _] = making.rates();
                trajectory.advance(&mut self.at, step * pace.at_least(0.0));
            }
            Slot::Complete => self.found = true,
            Slot::Again => self.place_first_slot(trajectory, &making, step),
            Slot::Failed => (self.at, self.is_profile) = (self.from, false),
        }
        self.making = Some(making);
    }

    fn work_on_change<P: Trajectory<Cursor = C>>(&mut self, trajectory: &P, bounds: &Bounds) -> bool {
        let duration = self.change.duration();
        let step = match self.above {
            Some(_) => self.widest.at_least(bounds.period),
            None => spacing(duration, self.widest),
        };
        let time = (step * f32::from(self.points)).at_most(duration);
        let rates = self.change.rates(time);
        let [pace, first, _] = rates;
        let room = room_of_change(bounds.is_fault, pace, self.widest);
        let mut ratio = trajectory.use_at(&self.at, rates, 0.5 * step).ratio(&room);
        ratio = ratio.at_least(first.abs() * bounds.period * (1.0 / CHANGE_MAX));
        let most = PACE_MAX * bounds.ceiling;
        if !(PACE_MIN..=most).contains(&pace) {
            ratio = ratio.at_least(RATIO_MAX);
        }
        if ratio > 1.0 {
            return self.try_next(bounds, time, ratio);
        }
        self.points += 1;
        if time >= duration || trajectory.is_over(&self.at) {
            self.found = true;
            return true;
        }
        let [middle, _, _] = self.change.rates((time + 0.5 * step).at_most(duration));
        trajectory.advance(&mut self.at, step * middle.at_least(0.0));
        true
    }

    /// The next trial. Where no change holds from there, one may from a later place, or to another goal.
    fn try_next(&mut self, bounds: &Bounds, time: f32, ratio: f32) -> bool {
        self.trial += 1;
        (self.at, self.points) = (self.from, 0);
        if let Some(above) = &mut self.above {
            let is_left = self.trial < ABOVE_TRIALS && above.lower(self.rates, time, ratio, bounds.period);
            self.change = above.change(self.rates);
            return is_left;
        }
        let longer = self.change.duration() * ratio.at_least(RATIO_MIN).at_most(RATIO_MAX);
        self.change = Change::new(self.rates, self.goal, longer);
        self.trial < TRIALS && longer <= self.longest
    }
}
