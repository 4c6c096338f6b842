//! A hop from the end of a pass to the start of the next, above the surface: up, across and down as one motion. Across moves x and y only, and only while
//! the ball is at the safe height or above; up and down move z only, so each axis keeps its limits whatever the others do.

use crate::feed::curve::{Curve, CurveCursor};
use crate::feed::pace::{Pace, Trajectory, Use};
use crate::feed::profile::{Profiles, SlotAt, Span};
use crate::job::AxisLimits;
use crate::math::arith::{sqrt, truncated};
use crate::math::number::Bounded;
use crate::sequence::link::StraightPath;
use crate::sequence::lookahead::check_travel;

/// Greatest height above the safe height that a hop takes, mm.
const ABOVE_MAX_MM: f32 = 10.0;
/// Time by which across keeps away from the safe height's passing, s.
const APART_S: f32 = 1e-4;
/// Bisections of the time at which a height is passed.
const BISECTIONS: u8 = 20;

/// A place in time: since the start, s, and on each of the three curves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HopCursor {
    time: f32,
    curves: [CurveCursor; 3],
}

/// The curves of a hop: up, across, down, and when each begins, s.
#[derive(Clone, Copy, Debug)]
struct Curves {
    curves: [Curve; 3],
    begins: [f32; 3],
}

impl Trajectory for Curves {
    type Cursor = HopCursor;

    const IS_KNOWN_BETWEEN: bool = true;

    fn advance(&self, cursor: &mut HopCursor, seconds: f32) {
        let places = cursor.curves.iter_mut().zip(&self.curves).zip(&self.begins);
        for ((place, curve), begin) in places {
            let left = seconds - (begin - cursor.time).at_least(0.0);
            if left > 0.0 && !curve.is_over(place) {
                curve.advance(place, left);
            }
        }
        cursor.time += seconds;
    }

    fn is_over(&self, cursor: &HopCursor) -> bool {
        let mut each = cursor.curves.iter().zip(&self.curves);
        each.all(|(place, curve)| curve.is_over(place))
    }

    fn use_at(&self, cursor: &HopCursor, rates: [f32; 3], around: f32) -> Use {
        let mut most = Use::NONE;
        for (place, curve) in self.moving(cursor, rates[0] * around) {
            most.add(&curve.use_at(place, rates, around));
        }
        most
    }

    fn ramp_s(&self) -> f32 {
        (self.curves.iter()).fold(f32::MAX, |least, curve| least.at_most(curve.ramp_s()))
    }

    fn span_at(&self, cursor: &HopCursor, slot: &SlotAt, room: &Use) -> Span {
        let mut most = Span::WIDE;
        for (place, curve) in self.moving(cursor, slot.r * (slot.around + slot.slot_s)) {
            most.add(&curve.span_at(place, slot, room));
        }
        most
    }
}

impl Curves {
    /// The curves that are under way, or within this time, and the places on them.
    fn moving<'a>(
        &'a self,
        cursor: &'a HopCursor,
        around: f32,
    ) -> impl Iterator<Item = (&'a CurveCursor, &'a Curve)> {
        let places = cursor.curves.iter().zip(&self.curves).zip(&self.begins);
        let now = cursor.time + around;
        places
            .filter(move |((place, curve), begin)| **begin <= now && !curve.is_over(place))
            .map(|(of, _)| of)
    }
}

/// A hop from pass to pass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hop {
    curves: Curves,
    paths: [StraightPath; 3],
    cursor: HopCursor,
    pace: Pace<HopCursor>,
    /// It is planned, from and to these positions.
    ends: Option<[[i32; 3]; 2]>,
}

impl Hop {
    /// None.
    pub(crate) const NONE: Self = Self {
        curves: Curves {
            curves: [Curve::NONE; 3],
            begins: [0.0; 3],
        },
        paths: [StraightPath::NONE; 3],
        cursor: HopCursor {
            time: 0.0,
            curves: [CurveCursor::START; 3],
        },
        pace: Pace::REST,
        ends: None,
    };

    /// Forgets the hop.
    pub(crate) const fn clear(&mut self) {
        self.ends = None;
    }

    /// Whether it is planned from here to there.
    pub(crate) fn leads(&self, from: [i32; 3], to: [i32; 3]) -> bool {
        self.ends == Some([from, to])
    }

    /// Plans a hop that crosses at this height, nm, or above the ends, if its top is within the travel and each part of it has a length. Takes some 15 000 cycles.
    #[inline(never)]
    pub(crate) fn plan(
        &mut self,
        [from, to]: [[i32; 3]; 2],
        height_nm: i32,
        feed_mm_s: f32,
        axes: &AxisLimits,
    ) {
        self.ends = None;
        let safe = from[2].max(to[2]).max(height_nm);
        let mut above_mm = braking_mm(axes).at_most(ABOVE_MAX_MM);
        if height_nm < axes.safe_z_nm {
            above_mm = above_mm.at_most(above_for(&from, &to, axes));
        }
        let above_nm = truncated(1e6 * above_mm);
        let [_, _, [_, highest]] = axes.travel_nm;
        let top = safe.saturating_add(above_nm).min(highest).max(safe);
        let above = [from[0], from[1], top];
        let there = [to[0], to[1], top];
        if check_travel(axes, &above).is_err() || check_travel(axes, &there).is_err() {
            return;
        }
        let ways = [
            (from, above, 0.0),
            (above, there, 0.0),
            (there, to, axes.plunge_mm),
        ];
        let curves = self.curves.curves.iter_mut().zip(&mut self.paths);
        for ((curve, path), (from, to, slow_mm)) in curves.zip(ways) {
            let Some((length, limits)) = path.lead(from, to, axes) else {
                return;
            };
            *curve = Curve::new(length, &limits, slow_mm, feed_mm_s);
        }
        let [rise, move_, fall] = &self.curves.curves;
        // Across begins when the ball passes the safe height, and ends before it passes it again.
        let leaves = time_at(rise, nm_q10(safe, from[2])) + APART_S;
        let returns = time_at(fall, nm_q10(top, safe)) - APART_S;
        let falls = rise.duration().at_least(leaves + move_.duration() - returns);
        self.curves.begins = [0.0, leaves, falls];
        self.cursor = HopCursor {
            time: 0.0,
            curves: self.curves.curves.each_ref().map(Curve::start),
        };
        self.ends = Some([from, to]);
    }

    /// Begins at this pace.
    pub(crate) fn begin(&mut self, pace: f32, period: f32) {
        self.pace.begin(pace, period);
    }

    /// One period; returns whether the end is reached.
    pub(crate) fn tick(&mut self, pace: f32, is_fault: bool, period: f32, profiles: &mut Profiles) -> bool {
        self.pace.want(pace, is_fault);
        let pace = self.pace.tick(profiles);
        self.curves.advance(&mut self.cursor, pace * period);
        self.curves.is_over(&self.cursor)
    }

    pub(crate) fn is_at_rest(&self) -> bool {
        self.pace.is_at_rest()
    }

    /// Whether a change of the pace is sought.
    pub(crate) fn has_work(&self) -> bool {
        self.pace.has_work()
    }

    /// One place of the search for a change of the pace.
    pub(crate) fn work(&mut self, profiles: &mut Profiles) {
        self.pace.work(&self.curves, &self.cursor, profiles);
    }

    /// The position.
    pub(crate) fn position(&self) -> [i32; 3] {
        let falls = self.cursor.time > self.curves.begins[2];
        let [across, vertical] = [1, if falls { 2 } else { 0 }].map(|leg: usize| {
            let (path, curve) = (self.paths.get(leg), self.curves.curves.get(leg));
            let places = path.zip(curve).zip(self.cursor.curves.get(leg));
            places.map_or([0; 3], |((path, curve), place)| path.position_at(curve, place))
        });
        [across[0], across[1], vertical[2]]
    }

    /// Speed, mm/s.
    pub(crate) fn speed(&self) -> f32 {
        let mut sum = 0.0;
        let Curves { curves, begins } = &self.curves;
        for ((place, curve), begin) in self.cursor.curves.iter().zip(curves).zip(begins) {
            if self.cursor.time > *begin && !curve.is_over(place) {
                let speed = curve.speed(place);
                sum += speed * speed;
            }
        }
        self.pace.now() * sqrt(sum)
    }
}

/// Height above the crossing at which a short hop spends as long as it takes to cross, mm: both by the jerk alone, `2 (6 above / j_z)^(1/3) = (32 apart / j)^(1/3)`.
fn above_for(from: &[i32; 3], to: &[i32; 3], axes: &AxisLimits) -> f32 {
    let [jx, jy, jz] = axes.jerk_mm_s3;
    let [x, y] = [0, 1].map(|axis: usize| {
        let ends = from.get(axis).zip(to.get(axis));
        ends.map_or(0.0, |(from, to)| {
            crate::math::number::nm_to_mm(from.saturating_sub(*to)).abs()
        })
    });
    2.0 / 3.0 * jz * (x / jx).at_least(y / jy)
}

/// Length in which the z axis comes to rest from its greatest speed, mm.
fn braking_mm(axes: &AxisLimits) -> f32 {
    let [_, _, v] = axes.velocity_mm_s;
    let [_, _, a] = axes.acceleration_mm_s2;
    let [_, _, j] = axes.jerk_mm_s3;
    0.5 * v * (v / a + a / j).at_least(2.0 * sqrt(v / j).at_most(a / j))
}

/// Height between two levels, units of 2^-10 nm.
fn nm_q10(high: i32, low: i32) -> i64 {
    (i64::from(high) - i64::from(low)) << 10
}

/// Time at which a curve has covered this length, s, from below.
fn time_at(curve: &Curve, length_q10: i64) -> f32 {
    let (mut low, mut high) = (0.0, curve.duration());
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        let mut at = curve.start();
        curve.advance(&mut at, middle);
        if at.moved_q10 < length_q10 {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}
