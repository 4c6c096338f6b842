//! Hold, resume, override: the pace r of a motion as a fraction of its plan's own, and its changes.
//!
//! A constant pace of at most 1 keeps every limit: velocity, acceleration and jerk shrink by r, r^2, r^3. The pace changes by profiles and quintics only,
//! each of which was followed over its whole length beforehand: per axis `a r^2 + q' v r'` and `j r^3 + 3 a r r' + q' v r''`. A pace above 1 is part of such a
//! change, which ends at 1. So by induction every period is within the limits, whatever the order of the commands.

use super::profile::{ProfilePlace, Profiles, SlotAt, Span};
use super::room::{SPACING, SPACING_WIDE};
use super::search::{ABOVE_MIN, Above, Bounds, Inertia, Search, spacing};
use crate::math::arith::truncated;
use crate::math::number::{Bounded, to_f32};

pub(crate) use super::change::Change;
pub(crate) use super::room::{Use, room_of};

/// Periods from the start of a search to the begin of the change that it finds: these, and one per [`PLACES_A_PERIOD`] places that the search may take.
const LATENCY: u16 = 5;
const LATENCY_OF_PROFILE: u16 = 3;
const LATENCY_ABOVE: u16 = 3;
const PLACES_A_PERIOD: f32 = 11.0;
/// Most periods of a latency.
const LATENCY_MAX: u16 = 96;
/// Most steps over the latency, in which the place where a change begins is found.
const STEPS_AHEAD: u16 = 24;

/// Places that a search takes, as a multiple of those of the shortest change: of a quintic, a profile, a profile of the finest slots, and a pace above 1.
const QUINTIC_PLACES: f32 = 1.3;
const PROFILE_PLACES: f32 = 2.5;
const PLACES_FINE: f32 = 1.4;
const ABOVE_PLACES: f32 = 1.4;

/// Failures after which half of the wanted change is tried.
const WHOLE_CHANGE: f32 = 2.0;

/// Least duration of a profile's slot, s.
const SLOT_MIN: f32 = 2e-3;
/// Duration of a slot where the trajectory is uneven, and after two attempts that failed, s.
const SLOT_FINE: f32 = 1e-3;
/// Factor on the duration of a slot after a search that did not end in time.
const SLOT_COARSER: f32 = 2.0;
/// Slots of the shortest change, from which the duration of a slot follows.
const SLOTS_ENOUGH: f32 = 80.0;
/// Longest slot as a share of [`Trajectory::ramp_s`]: within a longer one the acceleration would change its sign.
const SLOT_OF_RAMP: f32 = 0.5;
/// Most slots of the shortest change.
const SLOTS_MOST: f32 = 250.0;
/// Longest period with profiles, s.
const PROFILE_PERIOD_MAX: f32 = 2.5e-3;

/// Time before the end of a pace above 1 at which the next one is sought, s.
const RENEWED_S: f32 = 0.12;
/// Periods from a search for a pace above 1 that failed to the next.
const ABOVE_WAIT: u16 = 40;
/// Greatest pace of the first change above 1, so that it is short and soon found.
const ABOVE_FIRST: f32 = 1.25;
/// Greatest share of the velocity limits at a pace above 1.
const ABOVE_VELOCITY: f32 = 0.996;
/// Two paces above 1 of a smaller difference are one.
const ABOVE_SAME: f32 = 0.01;

/// A stop of a longer duration, s, is searched for again, because the next plan has to wait for its end.
const LONG_STOP_S: f32 = 0.35;
/// Most searches for a shorter one.
const LONG_STOP_SEARCHES: u8 = 2;

/// Longest stop that the first searches try, as a multiple of the shortest: one that begins after a place that leaves little ends earlier.
const SHORT: f32 = 1.6;
/// Number of these searches.
const SHORT_SEARCHES: u8 = 5;

/// Searches that find nothing from rest, after which the next plan comes first.
const STUCK: u8 = 2;

/// Changes of the pace below this are ignored.
const SAME: f32 = 1e-6;

/// A planned motion from rest to rest.
pub(crate) trait Trajectory {
    /// A place on it.
    type Cursor: Copy;

    /// Whether [`Self::span_at`] holds for the whole of a slot, however long: a shorter one tells nothing more.
    const IS_KNOWN_BETWEEN: bool = false;

    /// Moves on by this time at the plan's own pace, s.
    fn advance(&self, cursor: &mut Self::Cursor, seconds: f32);

    /// Whether the motion is over.
    fn is_over(&self, cursor: &Self::Cursor) -> bool;

    /// Use of the limits at a place and a pace with its first two derivatives, 1, 1/s, 1/s^2. `around`: time before and after that the place
    /// stands for, s.
    fn use_at(&self, cursor: &Self::Cursor, rates: [f32; 3], around: f32) -> Use;

    /// Whether the path changes much within a slot near a place.
    fn is_uneven(&self, _cursor: &Self::Cursor) -> bool {
        false
    }

    /// Least time in which the motion's own acceleration may rise from 0 to its limit, s.
    fn ramp_s(&self) -> f32;

    /// What the room leaves to the derivatives of the pace in a slot of a profile, at the place of its middle.
    fn span_at(&self, cursor: &Self::Cursor, slot: &SlotAt, room: &Use) -> Span;
}

/// The pace of a motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace<C> {
    change: Option<Change>,
    /// Time since the change began, s.
    time: f32,
    /// Whether a profile is followed, the place on it, and r, r', r'' there.
    on_profile: bool,
    place: ProfilePlace,
    there: [f32; 3],
    goal: f32,
    wanted: f32,
    is_fault: bool,
    /// Whether the motion has not moved yet.
    is_at_start: bool,
    /// Whether a long stop is followed that a search may find a shorter one for.
    is_long_stop: bool,
    /// Pace above 1 that is commanded, or 1.
    above: f32,
    /// Greatest pace for which the next pass is planned in time.
    most: f32,
    /// Periods until the next search above 1.
    wait: u16,
    /// Greatest pace of the change being followed.
    ceiling: f32,
    search: Option<Search<C>>,
    /// Searches in a row that found nothing, and that were not complete in time.
    failures: u8,
    timeouts: u8,
    period: f32,
}

impl<C: Copy> Pace<C> {
    /// At rest.
    pub(crate) const REST: Self = Self {
        change: None,
        time: 0.0,
        on_profile: false,
        place: ProfilePlace::START,
        there: [0.0; 3],
        goal: 0.0,
        wanted: 0.0,
        is_fault: false,
        is_at_start: false,
        is_long_stop: false,
        above: 1.0,
        most: 1.0,
        wait: 0,
        ceiling: 1.0,
        search: None,
        failures: 0,
        timeouts: 0,
        period: 1e-3,
    };

    /// At the start of a motion: any constant pace is possible.
    pub(crate) fn begin(&mut self, pace: f32, period: f32) {
        // Field by field: a search that is none needs no copy of the rest of it.
        self.change = None;
        self.on_profile = false;
        self.search = None;
        self.time = 0.0;
        self.is_fault = false;
        (self.above, self.ceiling, self.wait) = (1.0, 1.0, 0);
        self.is_long_stop = false;
        (self.failures, self.timeouts) = (0, 0);
        (self.goal, self.wanted, self.period) = (pace, pace, period);
        self.is_at_start = true;
    }

    /// Sets the pace that is wanted, above 1 where the axes leave it; a controlled stop after a fault may use more than the limits.
    pub(crate) fn want(&mut self, pace: f32, is_fault: bool) {
        let wanted = pace.at_most(1.0);
        let is_new = (wanted - self.wanted).abs() > SAME || is_fault != self.is_fault;
        let above = pace.at_least(1.0);
        if is_new || (above - self.above).abs() > SAME {
            (self.wanted, self.above) = (wanted, above);
            self.is_fault = is_fault;
            self.search = None;
            self.wait = 0;
            (self.failures, self.timeouts) = (0, 0);
            if self.is_at_start {
                self.goal = wanted;
            }
        }
    }

    /// Sets the greatest pace at which the motion is not over too early.
    pub(crate) const fn allow_above(&mut self, most: f32) {
        self.most = most;
    }

    /// Whether the motion stands, and will until another pace is wanted.
    pub(crate) fn is_at_rest(&self) -> bool {
        !self.is_changing() && self.goal == 0.0 && self.wanted == 0.0
    }

    /// Whether there is work for [`Self::work`].
    pub(crate) fn has_work(&self) -> bool {
        match &self.search {
            Some(search) => !search.found,
            None => self.is_seeking() || self.seeks_above(),
        }
    }

    /// Stops within this time, s.
    pub(crate) fn stop_within(&mut self, seconds: f32) {
        self.change = Some(Change::new(self.rates(), 0.0, seconds));
        (self.time, self.goal, self.wanted) = (0.0, 0.0, 0.0);
        self.on_profile = false;
        self.search = None;
        self.failures = 0;
        self.is_long_stop = seconds > LONG_STOP_S;
    }

    /// The pace that it comes to.
    pub(crate) const fn goal(&self) -> f32 {
        self.goal
    }

    /// The pace that is wanted, at most 1.
    pub(crate) const fn wanted(&self) -> f32 {
        self.wanted
    }

    /// Whether the pace changes, or is above 1.
    pub(crate) const fn is_changing(&self) -> bool {
        self.change.is_some() || self.on_profile
    }

    /// Moves the places of a search on; it ends where one of them cannot be.
    pub(crate) fn relocate(&mut self, of: impl Fn(&C) -> Option<C>) {
        self.search = self.search.and_then(|search| search.relocated(of));
    }

    /// Whether it stands and searches found no way on: with the place up to which the next plan is not needed just ahead, only that plan helps.
    pub(crate) fn is_stuck(&self) -> bool {
        self.failures >= STUCK && self.search.is_none() && !self.is_changing() && self.goal == 0.0
    }

    /// Whether a search begins with the next piece of work: its place is a good number of periods ahead.
    pub(crate) const fn begins_search(&self) -> bool {
        self.search.is_none()
    }

    /// The pace now.
    pub(crate) fn now(&self) -> f32 {
        let [pace, _, _] = self.rates();
        pace.at_least(0.0)
    }

    /// Whether the change that is followed, or none, does not lead to what is wanted: another goal, or less above 1.
    fn is_seeking(&self) -> bool {
        let is_too_fast = || match self.above_until(0.0) {
            Some([top, until_s]) => until_s > 0.0 && top > self.above + SAME,
            None => false,
        };
        let is_slow_to_stop = self.is_long_stop && self.wanted == 0.0 && self.failures < LONG_STOP_SEARCHES;
        (self.wanted - self.goal).abs() > SAME || is_slow_to_stop || is_too_fast()
    }

    /// Whether a pace above 1 is to be sought: at a constant 1, or before the return from above.
    fn seeks_above(&self) -> bool {
        let is_renewed = || match self.above_until(0.0) {
            Some([_, until_s]) => until_s > 0.0 && until_s < RENEWED_S,
            None => !self.is_changing(),
        };
        self.may_seek_above() && self.goal == 1.0 && is_renewed()
    }

    fn may_seek_above(&self) -> bool {
        self.above.at_most(self.most) >= ABOVE_MIN && self.wait == 0 && !self.is_fault
    }

    /// The pace above 1 that is followed, and the time until its return some time ahead, s.
    fn above_until(&self, ahead: f32) -> Option<[f32; 2]> {
        let (top, until_s) = self.change.as_ref()?.above_until()?;
        Some([top, until_s - self.time - ahead])
    }

    /// r, r', r'' now.
    fn rates(&self) -> [f32; 3] {
        if self.on_profile {
            self.there
        } else {
            self.rates_of_change(0.0)
        }
    }

    fn rates_of_change(&self, ahead: f32) -> [f32; 3] {
        rates_after(self.change.as_ref(), self.goal, self.time + ahead)
    }

    /// One period: the pace in its middle.
    pub(crate) fn tick(&mut self, profiles: &mut Profiles) -> f32 {
        self.wait = self.wait.saturating_sub(1);
        self.is_at_start &= self.goal == 0.0;
        if let Some(search) = &mut self.search {
            if search.left > 0 {
                search.left -= 1;
            } else if search.found {
                self.follow_found(profiles);
            } else if self.is_changing() || self.goal != 0.0 {
                self.timeouts = self.timeouts.saturating_add(1);
                self.search = None;
            }
        }
        let half = 0.5 * self.period;
        if self.on_profile {
            let followed = profiles.followed();
            let [pace, _, _] = self.place.rates(followed, half);
            self.place.advance(followed, self.period);
            self.there = self.place.rates(followed, 0.0);
            self.on_profile = !self.place.is_over(followed);
            return pace.at_least(0.0);
        }
        let [pace, _, _] = self.rates_of_change(half);
        self.time += self.period;
        if self
            .change
            .as_ref()
            .is_some_and(|change| self.time >= change.duration())
        {
            self.change = None;
            self.ceiling = 1.0;
            self.is_long_stop = false;
        }
        pace.at_least(0.0)
    }

    /// What [`Self::tick`] returns next, if nothing else is wanted until then.
    pub(crate) fn next(&self, profiles: &Profiles) -> f32 {
        let half = 0.5 * self.period;
        let begins = (self.search.as_ref()).filter(|search| search.left == 0 && search.found);
        let (on_profile, change) = match begins {
            Some(search) if search.is_profile => {
                let followed = profiles.next();
                (Some((followed.begin(), followed)), None)
            }
            Some(search) => (None, Some((Some(&search.change), search.goal, half))),
            None if self.on_profile => (Some((self.place, profiles.followed())), None),
            None => (None, Some((self.change.as_ref(), self.goal, self.time + half))),
        };
        let [pace, _, _] = match (on_profile, change) {
            (Some((place, followed)), _) => place.rates(followed, half),
            (_, Some((change, goal, time))) => rates_after(change, goal, time),
            _ => [0.0; 3],
        };
        pace.at_least(0.0)
    }

    /// Follows the change that was found.
    fn follow_found(&mut self, profiles: &mut Profiles) {
        let Some(search) = &self.search else {
            return;
        };
        self.on_profile = search.is_profile;
        if search.is_profile {
            self.change = None;
            profiles.swap();
            self.place = profiles.followed().begin();
        } else {
            let top = search.change.above_until().map_or(1.0, |(top, _)| top);
            self.ceiling = self.ceiling.at_least(top);
            self.change = Some(search.change);
        }
        (self.time, self.goal) = (0.0, search.goal);
        (self.failures, self.timeouts) = (0, 0);
        self.is_long_stop = false;
        self.search = None;
    }

    /// One place of the search. `at`: where the motion is.
    pub(crate) fn work<P: Trajectory<Cursor = C>>(
        &mut self,
        trajectory: &P,
        at: &C,
        profiles: &mut Profiles,
    ) {
        if !self.has_work() {
            return;
        }
        let Some(search) = &mut self.search else {
            self.search = self.begin_search(trajectory, at, profiles);
            if self.search.is_none() {
                self.wait = ABOVE_WAIT;
            }
            return;
        };
        let bounds = Bounds {
            is_fault: self.is_fault,
            ceiling: self
                .ceiling
                .at_least(search.above.map_or(1.0, |above| above.top())),
            period: self.period,
        };
        if !search.work(trajectory, &bounds, profiles) {
            if search.above.is_some() {
                self.wait = ABOVE_WAIT;
            } else {
                self.failures = self.failures.saturating_add(1);
            }
            self.search = None;
        }
    }

    /// The search for what is wanted; none where no pace above 1 is worth it.
    fn begin_search<P: Trajectory<Cursor = C>>(
        &self,
        trajectory: &P,
        at: &C,
        profiles: &mut Profiles,
    ) -> Option<Search<C>> {
        let is_uneven = trajectory.is_uneven(at);
        let widest = if is_uneven { SPACING } else { SPACING_WIDE };
        // At rest a resume comes first.
        if self.may_seek_above() && self.wanted == 1.0 && (self.goal > 0.0 || self.is_changing()) {
            let above = self.begin_above(trajectory, at, profiles, widest);
            if above.is_some() || !self.is_seeking() {
                return above;
            }
        }
        let [pace, ..] = self.rates();
        let shortest = Inertia::at(trajectory, at).shortest(self.wanted - pace, self.period);
        let makes_profile = self.makes_profile();
        let finest = self.slot_of(SLOT_FINE);
        let slot_s = if is_uneven {
            finest
        } else {
            self.slot::<P>(shortest, trajectory.ramp_s())
        };
        let (least, places) = if makes_profile {
            let share = if is_uneven { PLACES_FINE } else { PROFILE_PLACES };
            (LATENCY_OF_PROFILE, share * shortest / slot_s)
        } else {
            (LATENCY, QUINTIC_PLACES * shortest / spacing(shortest, widest))
        };
        let latency = self.latency(least, places);
        let (from, rates) = self.ahead(trajectory, at, profiles, latency);
        let [pace, ..] = rates;
        let goal = self.goal_from(pace);
        let shortest = Inertia::at(trajectory, &from).shortest(goal - pace, self.period);
        let change = Change::new(rates, goal, shortest);
        let mut search = Search::new((from, rates), goal, latency, widest, change);
        if self.wanted == 0.0 && self.failures < SHORT_SEARCHES {
            search.limit(SHORT * shortest);
        }
        if makes_profile {
            let finest = if P::IS_KNOWN_BETWEEN { slot_s } else { finest };
            search.make_profile(trajectory, profiles, [slot_s, finest]);
        }
        Some(search)
    }

    /// The goal of a search: where the axes leave too little for the whole change, a part of it comes first. At rest a pace that is small enough is possible anywhere.
    fn goal_from(&self, pace: f32) -> f32 {
        if self.failures == 0 || self.wanted == 0.0 {
            return self.wanted;
        }
        let failures = f32::from(self.failures);
        self.wanted + (pace - self.wanted) * failures / (failures + WHOLE_CHANGE)
    }

    /// The search for a pace above 1; none where the velocity limits leave none.
    fn begin_above<P: Trajectory<Cursor = C>>(
        &self,
        trajectory: &P,
        at: &C,
        profiles: &Profiles,
        widest: f32,
    ) -> Option<Search<C>> {
        let above = |place: &C, rates: [f32; 3], ahead: f32| {
            let used = trajectory.use_at(place, [1.0, 0.0, 0.0], 0.0);
            let top = self
                .above
                .at_most(self.most)
                .at_most(ABOVE_VELOCITY / used.velocity.at_least(1e-6));
            let inertia = Inertia::at(trajectory, place);
            (top >= ABOVE_MIN).then(|| match self.above_until(ahead) {
                Some([kept, until_s]) if until_s > 0.0 && kept <= top => {
                    let top = if top - kept < ABOVE_SAME { kept } else { top };
                    let rising_s = if top == kept { self.rise_left(ahead) } else { 0.0 };
                    Above::new(inertia, rates, [top, kept], [rising_s, until_s], self.period)
                }
                followed => {
                    let top = if followed.is_some() {
                        top
                    } else {
                        top.at_most(ABOVE_FIRST)
                    };
                    Above::new(inertia, rates, [top, 1.0], [0.0; 2], self.period)
                }
            })
        };
        let first = above(at, self.rates(), 0.0)?;
        let latency = self.latency(LATENCY_ABOVE, ABOVE_PLACES * first.duration() / widest);
        let (from, rates) = self.ahead(trajectory, at, profiles, latency);
        let above = above(&from, rates, self.period * f32::from(latency))?;
        let mut search = Search::new((from, rates), 1.0, latency, widest, above.change(rates));
        search.above = Some(above);
        Some(search)
    }

    /// Duration left of the rise some time ahead, s.
    fn rise_left(&self, ahead: f32) -> f32 {
        self.change.as_ref().map_or(0.0, Change::rise_s) - self.time - ahead
    }

    /// Periods of a search that looks at some places.
    fn latency(&self, least: u16, places: f32) -> u16 {
        let latency = u16::try_from(truncated(places / PLACES_A_PERIOD)).unwrap_or(LATENCY_MAX);
        least
            .saturating_add(latency)
            .saturating_mul(1 + u16::from(self.timeouts))
            .min(LATENCY_MAX)
    }

    /// Where the motion will be after some periods, and its pace there.
    #[inline(never)]
    fn ahead<P: Trajectory<Cursor = C>>(
        &self,
        trajectory: &P,
        at: &C,
        profiles: &Profiles,
        periods: u16,
    ) -> (C, [f32; 3]) {
        let mut from = *at;
        let mut ahead = 0.0;
        let mut place = self.place;
        let steps = periods.min(STEPS_AHEAD);
        let step = self.period * f32::from(periods) / f32::from(steps.max(1));
        for _ in 0..steps {
            let pace = if self.on_profile {
                let followed = profiles.followed();
                place.advance(followed, 0.5 * step);
                let [pace, _, _] = place.rates(followed, 0.0);
                place.advance(followed, 0.5 * step);
                pace
            } else {
                let [pace, _, _] = self.rates_of_change(ahead + 0.5 * step);
                pace
            };
            trajectory.advance(&mut from, step * pace.at_least(0.0));
            ahead += step;
        }
        let rates = if self.on_profile {
            place.rates(profiles.followed(), 0.0)
        } else {
            self.rates_of_change(ahead)
        };
        (from, rates)
    }

    /// Whether a profile is made for the change that is wanted.
    fn makes_profile(&self) -> bool {
        self.period <= PROFILE_PERIOD_MAX && (self.wanted == 0.0 || self.wanted + 0.05 < self.now())
    }

    /// Duration of a slot, s: whole periods.
    fn slot<P: Trajectory<Cursor = C>>(&self, shortest: f32, ramp_s: f32) -> f32 {
        let wanted = (shortest * (1.0 / SLOTS_ENOUGH)).at_least(SLOT_MIN);
        let is_late = P::IS_KNOWN_BETWEEN && self.timeouts > 0;
        let coarser = if is_late { SLOT_COARSER } else { 1.0 };
        let least = SLOT_MIN.at_least(shortest * (1.0 / SLOTS_MOST));
        self.slot_of((coarser * wanted).at_most(SLOT_OF_RAMP * ramp_s).at_least(least))
    }

    /// Whole periods, s.
    fn slot_of(&self, wanted: f32) -> f32 {
        let periods = truncated(wanted / self.period + 0.99).max(1);
        to_f32(i64::from(periods)) * self.period
    }
}

/// r, r', r'' some time after a change to a goal has begun, s.
fn rates_after(change: Option<&Change>, goal: f32, time: f32) -> [f32; 3] {
    match change {
        Some(change) if time < change.duration() => change.rates(time),
        _ => [goal, 0.0, 0.0],
    }
}
