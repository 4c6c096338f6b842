//! What a change of the pace may use of the limits.

use crate::math::number::Bounded;

/// Time between the places of a trial that are looked at, s: close together near a turn, and apart elsewhere.
pub(super) const SPACING: f32 = 1.0e-3;
pub(super) const SPACING_WIDE: f32 = 2.0e-3;

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
/// The same above it, where the follower may be faster than the plan by [`super::limits::FeedChange`], and changes its speed as many times faster.
const ROOM_ABOVE: Use = Use {
    feed: 1.0,
    velocity: 0.9965,
    acceleration: 0.985,
    jerk: 0.95,
};
const ABOVE_PLANNED: f32 = 1.002;
/// Share of the jerk in [`ROOM`] that a change may use near a turn, whose jerk is known at its stations only.
const JERK_NEAR_TURNS: f32 = 0.89;
/// The least that it may use there, times the cube of the pace: somewhat more than the plan's own jerk at that pace, which cannot be less.
const JERK_OF_PLAN: f32 = 0.985;
/// The same after a fault.
const ROOM_FAULT: Use = Use {
    feed: 1.0,
    velocity: 1.001,
    acceleration: 1.1,
    jerk: 1.5,
};

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

/// Fractions of the limits that a changing pace may use.
pub(crate) fn room_of(is_fault: bool, pace: f32) -> &'static Use {
    if is_fault {
        &ROOM_FAULT
    } else if pace > ABOVE_PLANNED {
        &ROOM_ABOVE
    } else if pace > NEARLY_PLANNED {
        &ROOM_PLANNED
    } else {
        &ROOM
    }
}

/// The same of a change that is looked at at places at most so far apart, s: closer ones are near a turn.
pub(super) fn room_of_change(is_fault: bool, pace: f32, widest: f32) -> Use {
    let mut room = *room_of(is_fault, pace);
    let is_planned = (NEARLY_PLANNED..=ABOVE_PLANNED).contains(&pace);
    if widest < SPACING_WIDE && !is_planned {
        room.jerk = (JERK_NEAR_TURNS * room.jerk)
            .at_least(JERK_OF_PLAN * pace * pace * pace)
            .at_most(room.jerk);
    }
    room
}
