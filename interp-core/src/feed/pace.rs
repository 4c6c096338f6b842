//! Hold, resume, override: the pace r of a motion as a fraction of its plan's own, and its changes.
//!
//! A constant pace of at most 1 keeps every limit: velocity, acceleration and jerk shrink by r, r^2, r^3. The pace changes by quintics only,
//! each of which was followed over its whole length beforehand: per axis `a r^2 + q' v r'` and `j r^3 + 3 a r r' + q' v r''`. So by induction every
//! period is within the limits, whatever the order of the commands.

use super::profile::{Making, ProfilePlace, Profiles, Slot, SlotAt, Span};
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, to_f32};

/// Periods from the start of a search to the change that it finds, for the search: some, and as many as the places of two short trials take.
const LATENCY: u16 = 8;
const PLACES_A_PERIOD: f32 = 12.0;
/// The most of it, and steps in which the place there is found.
const LATENCY_MAX: u16 = 96;
const STEPS_AHEAD: u16 = 24;

/// The same of a profile: least periods, and places for the shortest change, as a multiple of its slots.
const LATENCY_OF_PROFILE: u16 = 3;
const PROFILE_PLACES: f32 = 2.5;
const PLACES_FINE: f32 = 1.4;
/// Least duration of a slot of a profile, s, first and where that fails, and slots of the shortest change that are enough; longest period with profiles, s.
const SLOT_MIN: f32 = 2e-3;
const SLOT_FINE: f32 = 1e-3;
const SLOTS_ENOUGH: f32 = 80.0;
/// Shares of the room that a profile uses: what happens within a slot.
const PROFILE_ACCELERATION: f32 = 0.995;
const PROFILE_JERK: f32 = 0.99;
const PROFILE_PERIOD_MAX: f32 = 2.5e-3;

/// Durations that a search tries, shortest first, and the ratio of one to the next.
const TRIALS: u8 = 12;
const RATIO_MIN: f32 = 1.1;
const RATIO_MAX: f32 = 1.5;

/// Time between the places of a trial that are looked at, s: close together, and as far apart as keeps to a number of places; and their least
/// and greatest number.
const SPACING: f32 = 1.0e-3;
const SPACING_WIDE: f32 = 2.0e-3;
const PLACES_MIN: f32 = 16.0;
const PLACES_ENOUGH: f32 = 100.0;
const PLACES_MAX: f32 = 200.0;

/// Greatest change of the pace in a period: where the tool hardly moves, the plan's own motion changes as fast.
const CHANGE_MAX: f32 = 0.05;

/// Paces below 0 and above 1 that are rounding.
const PACE_MIN: f32 = -2e-6;
const PACE_MAX: f32 = 1.00002;

/// Fractions of the limits that a changing pace may use. The jerk is seen between periods, and its peaks are narrower.
const ROOM: Use = Use {
    feed: 1.0,
    velocity: 1.0,
    acceleration: 0.997,
    jerk: 0.98,
};
/// The same at nearly the plan's own pace: what a checked plan uses is never refused.
const ROOM_PLANNED: Use = Use {
    feed: 1.001,
    velocity: 1.0005,
    acceleration: 1.001,
    jerk: 1.001,
};
const NEARLY_PLANNED: f32 = 0.97;
/// Share of the jerk in [`ROOM`] that a change may use near a turn, whose jerk is known at its stations only.
const JERK_NEAR_TURNS: f32 = 0.9;
/// The same after a fault.
const ROOM_FAULT: Use = Use {
    feed: 1.0,
    velocity: 1.001,
    acceleration: 1.1,
    jerk: 1.5,
};

/// Change of the pace that is none.
const SAME: f32 = 1e-6;

/// Fractions of the limits, the most of the three axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Use {
    /// Of the programmed feed.
    pub(crate) feed: f32,
    pub(crate) velocity: f32,
    pub(crate) acceleration: f32,
    pub(crate) jerk: f32,
}

impl Use {
    pub(crate) const NONE: Self = Self {
        feed: 0.0,
        velocity: 0.0,
        acceleration: 0.0,
        jerk: 0.0,
    };

    pub(crate) fn add(&mut self, other: &Self) {
        self.feed = self.feed.at_least(other.feed);
        self.velocity = self.velocity.at_least(other.velocity);
        self.acceleration = self.acceleration.at_least(other.acceleration);
        self.jerk = self.jerk.at_least(other.jerk);
    }

    /// The greatest ratio to the room.
    pub(crate) fn ratio(&self, room: &Self) -> f32 {
        (self.velocity / room.velocity)
            .at_least(self.acceleration / room.acceleration)
            .at_least(self.jerk / room.jerk)
    }
}

/// Time between the places of a trial of this duration, s.
fn spacing(duration: f32, widest: f32) -> f32 {
    SPACING
        .at_least((duration / PLACES_ENOUGH).at_most(widest))
        .at_most(duration / PLACES_MIN)
        .at_least(duration / PLACES_MAX)
}

/// A planned motion from rest to rest.
pub(crate) trait Course {
    /// A place on it.
    type Cursor: Copy;

    /// Moves on by this time at the plan's own pace, s.
    fn advance(&self, cursor: &mut Self::Cursor, seconds: f32);

    /// Whether the motion is over.
    fn is_over(&self, cursor: &Self::Cursor) -> bool;

    /// Use of the limits at a place and a pace with its first two derivatives, 1, 1/s, 1/s^2. `around`: time before and behind that the place
    /// stands for, s.
    fn use_at(&self, cursor: &Self::Cursor, rates: [f32; 3], around: f32) -> Use;

    /// Whether the path changes much within a slot near a place.
    fn is_uneven(&self, _cursor: &Self::Cursor) -> bool {
        false
    }

    /// What the room leaves to the derivatives of the pace in a slot of a profile, at the place of its middle.
    fn span_at(&self, cursor: &Self::Cursor, slot: &SlotAt, room: &Use) -> Span;
}

/// A change of the pace: from these rates to rest at the goal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    coefficients: [f32; 6],
    duration: f32,
}

impl Change {
    pub(crate) fn new([r, d, e]: [f32; 3], goal: f32, duration: f32) -> Self {
        let inverse = 1.0 / duration;
        let (h, d, e) = (goal - r, d * duration, e * duration * duration);
        let [i3, i4, i5] = {
            let i2 = inverse * inverse;
            [i2 * inverse, i2 * i2, i2 * i2 * inverse]
        };
        Self {
            coefficients: [
                r,
                d * inverse,
                0.5 * e * inverse * inverse,
                (10.0 * h - 6.0 * d - 1.5 * e) * i3,
                (-15.0 * h + 8.0 * d + 1.5 * e) * i4,
                (6.0 * h - 3.0 * d - 0.5 * e) * i5,
            ],
            duration,
        }
    }

    pub(crate) fn rates(&self, t: f32) -> [f32; 3] {
        let [c0, c1, c2, c3, c4, c5] = self.coefficients;
        [
            c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
        ]
    }
}

/// Fractions of the limits that a changing pace may use.
pub(crate) fn room_of(is_fault: bool, pace: f32) -> &'static Use {
    match (is_fault, pace > NEARLY_PLANNED) {
        (true, _) => &ROOM_FAULT,
        (false, true) => &ROOM_PLANNED,
        (false, false) => &ROOM,
    }
}

/// The same of a change that is looked at at places at most so far apart, s: closer ones are near a turn.
fn room_of_change(is_fault: bool, pace: f32, widest: f32) -> Use {
    let mut room = *room_of(is_fault, pace);
    if widest < SPACING_WIDE && pace <= NEARLY_PLANNED {
        room.jerk *= JERK_NEAR_TURNS;
    }
    room
}

/// A search for a change.
#[derive(Clone, Copy, Debug)]
struct Search<C> {
    /// Where the motion is and what the pace is when the change begins.
    from: C,
    rates: [f32; 3],
    /// Periods until then.
    left: u16,
    trial: u8,
    /// Greatest time between the places of a trial, s.
    widest: f32,
    change: Change,
    /// A profile is being made, in the list that is not followed.
    making: Option<Making>,
    is_profile: bool,
    /// The trial's place, and points looked at.
    at: C,
    points: u16,
    /// Whether the change holds.
    found: bool,
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
        (self.failures, self.timeouts) = (0, 0);
        (self.goal, self.wanted, self.period) = (pace, pace, period);
    }

    /// Sets the pace that is wanted, 0 to 1; a controlled stop after a fault may use more than the limits.
    pub(crate) fn want(&mut self, pace: f32, is_fault: bool) {
        if (pace - self.wanted).abs() > SAME || is_fault != self.is_fault {
            self.wanted = pace;
            self.is_fault = is_fault;
            self.search = None;
            (self.failures, self.timeouts) = (0, 0);
        }
    }

    /// Whether the motion stands, and will until another pace is wanted.
    pub(crate) fn is_at_rest(&self) -> bool {
        !self.is_changing() && self.goal == 0.0 && self.wanted == 0.0
    }

    /// Whether the pace stays as it is.
    pub(crate) fn is_constant(&self) -> bool {
        !self.is_changing() && !self.is_seeking()
    }

    /// Whether there is work for [`Self::work`].
    pub(crate) fn has_work(&self) -> bool {
        match &self.search {
            Some(search) => !search.found,
            None => self.is_seeking(),
        }
    }

    /// Stops within this time, s.
    pub(crate) fn stop_within(&mut self, seconds: f32) {
        self.change = Some(Change::new(self.rates(), 0.0, seconds));
        (self.time, self.goal, self.wanted) = (0.0, 0.0, 0.0);
        self.on_profile = false;
        self.search = None;
    }

    /// The pace that it comes to.
    pub(crate) const fn goal(&self) -> f32 {
        self.goal
    }

    /// The pace that is wanted.
    pub(crate) const fn wanted(&self) -> f32 {
        self.wanted
    }

    /// Whether the pace changes.
    pub(crate) const fn is_changing(&self) -> bool {
        self.change.is_some() || self.on_profile
    }

    /// Moves the places of a search on; it ends where one of them cannot be.
    pub(crate) fn relocate(&mut self, of: impl Fn(&C) -> Option<C>) {
        self.search = match self.search {
            Some(search) => match (of(&search.from), of(&search.at)) {
                (Some(from), Some(at)) => Some(Search { from, at, ..search }),
                _ => None,
            },
            None => None,
        };
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

    fn is_seeking(&self) -> bool {
        (self.wanted - self.goal).abs() > SAME
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
        let time = self.time + ahead;
        match &self.change {
            Some(change) if time < change.duration => change.rates(time),
            _ => [self.goal, 0.0, 0.0],
        }
    }

    /// One period: the pace in its middle.
    pub(crate) fn tick(&mut self, profiles: &mut Profiles) -> f32 {
        if let Some(search) = &mut self.search {
            if search.left > 0 {
                search.left -= 1;
            } else if search.found {
                self.take(profiles);
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
        if self.change.is_some_and(|change| self.time >= change.duration) {
            self.change = None;
        }
        pace.at_least(0.0)
    }

    /// Follows the change that was found.
    fn take(&mut self, profiles: &mut Profiles) {
        let Some(search) = &self.search else {
            return;
        };
        self.on_profile = search.is_profile;
        if search.is_profile {
            self.change = None;
            profiles.swap();
            self.place = profiles.followed().begin();
        } else {
            self.change = Some(search.change);
        }
        (self.time, self.goal) = (0.0, self.wanted);
        (self.failures, self.timeouts) = (0, 0);
        self.search = None;
    }

    /// One place of the search. `at`: where the motion is.
    pub(crate) fn work<P: Course<Cursor = C>>(&mut self, course: &P, at: &C, profiles: &mut Profiles) {
        if !self.has_work() {
            return;
        }
        let Some(search) = &mut self.search else {
            self.search = Some(self.begin_search(course, at, profiles));
            return;
        };
        if let Some(making) = &mut search.making {
            let profile = profiles.made();
            let slot_at = making.slot(profile, 0.5 * self.period);
            let room = room_of_change(self.is_fault, slot_at.r, search.widest);
            let room = Use {
                acceleration: PROFILE_ACCELERATION * room.acceleration,
                jerk: PROFILE_JERK * room.jerk,
                ..room
            };
            let span = course.span_at(&search.at, &slot_at, &room);
            let slot = making.append(profile, &span, PACE_MAX);
            let step = profile.slot_s();
            match slot {
                Slot::Appended if course.is_over(&search.at) => {
                    making.end(profile);
                    search.found = true;
                }
                Slot::Appended => {
                    let [pace, _] = making.rates();
                    course.advance(&mut search.at, step * pace.at_least(0.0));
                }
                Slot::Complete => search.found = true,
                Slot::Again | Slot::Failed => {
                    search.at = search.from;
                    let [pace, first] = making.rates();
                    course.advance(
                        &mut search.at,
                        0.5 * step * (pace + 0.25 * step * first).at_least(0.0),
                    );
                    if slot == Slot::Failed {
                        (search.at, search.making, search.is_profile) = (search.from, None, false);
                    }
                }
            }
            return;
        }
        let duration = search.change.duration;
        let step = spacing(duration, search.widest);
        let time = (step * f32::from(search.points)).at_most(duration);
        let rates = search.change.rates(time);
        let [pace, first, _] = rates;
        let room = room_of_change(self.is_fault, pace, search.widest);
        let mut ratio = course.use_at(&search.at, rates, 0.5 * step).ratio(&room);
        ratio = ratio.at_least(first.abs() * self.period * (1.0 / CHANGE_MAX));
        if !(PACE_MIN..=PACE_MAX).contains(&pace) {
            ratio = ratio.at_least(RATIO_MAX);
        }
        if ratio > 1.0 {
            search.trial += 1;
            if search.trial >= TRIALS {
                // No change holds from there: from a later place one may, or at rest a longer one.
                self.search = None;
                self.failures = self.failures.saturating_add(1);
                return;
            }
            let longer = duration * ratio.at_least(RATIO_MIN).at_most(RATIO_MAX);
            search.change = Change::new(search.rates, self.wanted, longer);
            (search.at, search.points) = (search.from, 0);
            return;
        }
        search.points += 1;
        if time >= duration || course.is_over(&search.at) {
            search.found = true;
            return;
        }
        let [middle, _, _] = search.change.rates((time + 0.5 * step).at_most(duration));
        course.advance(&mut search.at, step * middle.at_least(0.0));
    }

    /// Duration of the shortest change that the velocity along the path alone would allow at a place, s.
    fn shortest<P: Course<Cursor = C>>(&self, course: &P, at: &C, [pace, _, _]: [f32; 3]) -> f32 {
        let apart = (self.wanted - pace).abs().at_least(0.01);
        let [of_accel, of_jerk] =
            [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|[_, r1, r2]| course.use_at(at, [1e-9, r1, r2], 0.0));
        (1.9 * apart * of_accel.acceleration)
            .at_least(sqrt(5.8 * apart * of_jerk.jerk))
            .at_least(10.0 * self.period)
    }

    fn begin_search<P: Course<Cursor = C>>(&self, course: &P, at: &C, profiles: &mut Profiles) -> Search<C> {
        let shortest = self.shortest(course, at, self.rates());
        let makes_profile = self.makes_profile();
        let finest = self.slot_of(SLOT_FINE);
        let is_uneven = course.is_uneven(at);
        let widest = if is_uneven { SPACING } else { SPACING_WIDE };
        let slot_s = if is_uneven { finest } else { self.slot(shortest) };
        let places = if makes_profile {
            let share = if is_uneven { PLACES_FINE } else { PROFILE_PLACES };
            share * shortest / slot_s
        } else {
            2.0 * shortest / spacing(shortest, widest)
        };
        let latency = u16::try_from(truncated(places / PLACES_A_PERIOD)).unwrap_or(LATENCY_MAX);
        let least = if makes_profile {
            LATENCY_OF_PROFILE
        } else {
            LATENCY
        };
        let latency = least
            .saturating_add(latency)
            .saturating_mul(1 + u16::from(self.timeouts))
            .min(LATENCY_MAX);
        let mut from = *at;
        let mut ahead = 0.0;
        let mut place = self.place;
        let steps = latency.min(STEPS_AHEAD);
        let step = self.period * f32::from(latency) / f32::from(steps.max(1));
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
            course.advance(&mut from, step * pace.at_least(0.0));
            ahead += step;
        }
        let rates = if self.on_profile {
            place.rates(profiles.followed(), 0.0)
        } else {
            self.rates_of_change(ahead)
        };
        let is_standing = !self.is_changing() && self.goal == 0.0;
        let longer = if is_standing {
            1.0 + f32::from(self.failures)
        } else {
            1.0
        };
        let shortest = longer * self.shortest(course, &from, rates);
        let mut search = Search {
            from,
            rates,
            left: latency,
            trial: 0,
            widest,
            change: Change::new(rates, self.wanted, shortest),
            making: None,
            is_profile: false,
            at: from,
            points: 0,
            found: false,
        };
        if makes_profile {
            let [pace, first, _] = rates;
            let profile = profiles.made();
            profile.clear([pace, first], self.wanted, slot_s);
            search.making = Some(Making::new([pace, first], finest));
            search.is_profile = true;
            course.advance(
                &mut search.at,
                0.5 * slot_s * (pace + 0.25 * slot_s * first).at_least(0.0),
            );
        }
        search
    }

    /// Whether a profile is made for the change that is wanted.
    fn makes_profile(&self) -> bool {
        self.period <= PROFILE_PERIOD_MAX && self.wanted == 0.0
    }

    /// Duration of a slot, s: whole periods.
    fn slot(&self, shortest: f32) -> f32 {
        self.slot_of(SLOT_MIN.at_least(shortest * (1.0 / SLOTS_ENOUGH)))
    }

    /// Whole periods, s.
    fn slot_of(&self, wanted: f32) -> f32 {
        let periods = truncated(wanted / self.period + 0.99).max(1);
        to_f32(i64::from(periods)) * self.period
    }
}
