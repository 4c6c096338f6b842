//! The speed of a motion along a pass, and the limit that binds it, place by place.
//!
//! Velocity, acceleration and jerk of each axis are differences of the motion's own samples, as a drive gets them. The one with the largest share
//! of its limit binds.

use super::path::PassPath;
use super::timing::Timing;
use crate::swept::ToolPathPass;
use glam::DVec3;
use job::AxisLimits;

/// What limits the speed of the contact at a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// The programmed feed.
    Feed,
    /// Velocity of an axis, from 0.
    Velocity(usize),
    /// Acceleration of an axis, from 0.
    Acceleration(usize),
    /// Jerk of an axis, from 0.
    Jerk(usize),
}

impl Binding {
    /// Every limit: the feed, then velocity, acceleration and jerk of x, y, z.
    pub const ALL: [Self; 10] = [
        Self::Feed,
        Self::Velocity(0),
        Self::Velocity(1),
        Self::Velocity(2),
        Self::Acceleration(0),
        Self::Acceleration(1),
        Self::Acceleration(2),
        Self::Jerk(0),
        Self::Jerk(1),
        Self::Jerk(2),
    ];

    /// Index in [`Self::ALL`].
    #[must_use]
    pub fn index(self) -> usize {
        match self {
            Self::Feed => 0,
            Self::Velocity(axis) => 1 + axis,
            Self::Acceleration(axis) => 4 + axis,
            Self::Jerk(axis) => 7 + axis,
        }
    }
}

/// The fastest motion found at one period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedPoint {
    /// Length of the contact's path from the pass's beginning, mm.
    pub arc_mm: f64,
    /// Speed of the contact, mm/s.
    pub speed_mm_s: f64,
    /// The limit of which it uses the largest share.
    pub binding: Binding,
    /// That share, 1 at the limit.
    pub share: f64,
}

impl SpeedPoint {
    /// Turns a profile round, for a pass of this length against its path parameter.
    pub(super) fn reverse(profile: &mut [Self], length_mm: f64) {
        profile.reverse();
        for point in profile {
            point.arc_mm = length_mm - point.arc_mm;
        }
    }
}

/// Mean speed of the job's own contact from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmittedSpeed {
    /// Tick of the first of the two samples.
    pub tick: u64,
    /// Length of the contact's path from the pass's beginning to the middle between them, mm.
    pub arc_mm: f64,
    /// mm/s.
    pub speed_mm_s: f64,
}

/// A larger share than the one of an earlier limit by less than this does not bind: at the feed the axes may be at their limits as well.
const TIE: f64 = 1e-3;

impl Timing {
    /// The motion, slowed down by a factor, at each period from its beginning.
    pub(super) fn profile(
        &self,
        path: &PassPath<'_>,
        feed_mm_s: f64,
        limits: &AxisLimits,
        period_s: f64,
        slower: f64,
    ) -> Vec<SpeedPoint> {
        #[allow(clippy::cast_possible_truncation, reason = "a count of periods")]
        let count = (self.duration_s() * slower / period_s).floor() as i32;
        // At rest the samples continue at the ends; beyond a free end there are none.
        let (first, last) = (
            if self.rests(0) { -2 } else { 0 },
            if self.rests(1) { count + 3 } else { count },
        );
        let samples: Vec<(f64, DVec3)> = (first..=last)
            .map(|tick| {
                let (arc, _) = self.at(f64::from(tick) * period_s / slower);
                (arc, path.position(arc))
            })
            .collect();
        let arc = |tick: i32| Some(samples.get(usize::try_from(tick - first).ok()?)?.0);
        let place = |tick: i32| Some(samples.get(usize::try_from(tick - first).ok()?)?.1);
        let velocity = |tick: i32| Some((place(tick + 1)? - place(tick)?) / period_s);
        let acceleration = |tick: i32| Some((velocity(tick)? - velocity(tick - 1)?) / period_s);
        let jerk = |tick: i32| Some((acceleration(tick + 1)? - acceleration(tick)?) / period_s);
        let most =
            |a: Option<DVec3>, b: Option<DVec3>| a.unwrap_or_default().abs().max(b.unwrap_or_default().abs());
        (0..=count)
            .filter_map(|tick| {
                let (before, after) = (arc(tick - 1).map(|at| (at, -1)), arc(tick + 1).map(|at| (at, 1)));
                let here = (arc(tick)?, 0);
                let ((from, a), (to, b)) = (before.unwrap_or(here), after.unwrap_or(here));
                let speed_mm_s = (to - from) / (f64::from((b - a).max(1)) * period_s);
                let uses = [
                    most(velocity(tick - 1), velocity(tick)) / DVec3::from(limits.velocity_mm_s),
                    acceleration(tick).unwrap_or_default().abs() / DVec3::from(limits.acceleration_mm_s2),
                    most(jerk(tick - 1), jerk(tick)) / DVec3::from(limits.jerk_mm_s3),
                ];
                let shares =
                    std::iter::once(speed_mm_s / feed_mm_s).chain(uses.iter().flat_map(DVec3::to_array));
                let (binding, share) = Binding::ALL.into_iter().zip(shares).fold(
                    (Binding::Feed, 0.0),
                    |best: (Binding, f64), next| {
                        if next.1 > best.1 + TIE { next } else { best }
                    },
                );
                Some(SpeedPoint {
                    arc_mm: here.0,
                    speed_mm_s,
                    binding,
                    share,
                })
            })
            .collect()
    }
}

/// Speeds of a pass as emitted, between its first and its last sample (`ends`, path parameters). `slow`: ticks and path parameters of the samples
/// that the track leaves out.
pub(super) fn emitted_speeds(
    path: &PassPath<'_>,
    track: &ToolPathPass,
    slow: &[(u64, f64)],
    ends: [f64; 2],
    period_s: f64,
) -> Vec<EmittedSpeed> {
    let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
    let from_mm = path.arc_of(ends[0]);
    let stored = track.periods.iter().zip(&track.path);
    let mut points: Vec<(u64, f64)> = stored
        .map(|(period, at)| (track.first_tick + u64::from(*period), *at))
        .chain(slow.iter().copied())
        .filter(|(_, at)| (low..=high).contains(at))
        .map(|(tick, at)| (tick, (path.arc_of(at) - from_mm).abs()))
        .collect();
    points.sort_by_key(|(tick, _)| *tick);
    #[allow(clippy::cast_precision_loss, reason = "a count of periods")]
    let time_s = |periods: u64| periods as f64 * period_s;
    points
        .windows(2)
        .filter(|pair| pair[1].0 > pair[0].0)
        .map(|pair| EmittedSpeed {
            tick: pair[0].0,
            arc_mm: 0.5 * (pair[0].1 + pair[1].1),
            speed_mm_s: (pair[1].1 - pair[0].1) / time_s(pair[1].0 - pair[0].0),
        })
        .collect()
}
