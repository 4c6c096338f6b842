//! Rest to rest along one coordinate in closed form, for links: constant jerk, constant acceleration, constant jerk, cruise, and back.

use super::pace::{Trajectory, Use};
use super::profile::{SlotAt, Span, fastest_around};
use super::{MM_PER_Q10, to_q10};
use crate::math::arith::sqrt;
use crate::math::number::{Bounded, cube_root, to_f32};

/// Limits along the coordinate: mm/s, mm/s^2, mm/s^3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CurveLimits {
    pub(crate) speed: f32,
    pub(crate) acceleration: f32,
    pub(crate) jerk: f32,
}

/// Fractions of the limits that a link uses: what is left is for a hold, and for the rounding of positions.
const ACCELERATION: f32 = 0.98;
const JERK: f32 = 0.96;

/// A place just before the end of a ramp, as a share of it.
const BEFORE_END: f32 = 0.999;

/// A piece: a ramp from one speed to another, then a cruise at that speed.
#[derive(Clone, Copy, Debug)]
struct Piece {
    from: f32,
    to: f32,
    /// Duration of the jerk at either end of the ramp, s, and of the ramp.
    jerk_s: f32,
    ramp_s: f32,
    /// Acceleration in the middle of the ramp, mm/s^2, and jerk at its begin, mm/s^3.
    peak: f32,
    jerk: f32,
    /// Length of the cruise, units of 2^-10 nm.
    cruise_q10: i64,
}

impl Piece {
    const NONE: Self = Self {
        from: 0.0,
        to: 0.0,
        jerk_s: 0.0,
        ramp_s: 0.0,
        peak: 0.0,
        jerk: 0.0,
        cruise_q10: 0,
    };

    fn new(from: f32, to: f32, limits: &CurveLimits, cruise_q10: i64) -> Self {
        let [jerk_s, ramp_s] = ramp(from - to, limits);
        let (mut peak, mut jerk) = (0.0, 0.0);
        if ramp_s > 0.0 {
            peak = (to - from) / (ramp_s - jerk_s);
            jerk = peak / jerk_s;
        }
        Self {
            from,
            to,
            jerk_s,
            ramp_s,
            peak,
            jerk,
            cruise_q10: cruise_q10.max(0),
        }
    }

    /// Speed, acceleration and jerk at a time of the ramp.
    fn rates(&self, t: f32) -> [f32; 3] {
        let phase = if t >= self.ramp_s || self.ramp_s <= 0.0 {
            Phase::Cruise
        } else if t < self.jerk_s {
            Phase::Begin
        } else if self.ramp_s - t > self.jerk_s {
            Phase::Steady
        } else {
            Phase::End
        };
        self.rates_in(phase, t)
    }

    /// The same where the phase is known: at its ends rounding could make it another.
    fn rates_in(&self, phase: Phase, t: f32) -> [f32; 3] {
        if let Phase::Cruise = phase {
            return [self.to, 0.0, 0.0];
        }
        // The acceleration rises to its peak, stays, and falls.
        let (peak, jerk) = (self.peak, self.jerk);
        if let Phase::Steady = phase {
            return [self.from + peak * (t - 0.5 * self.jerk_s), peak, 0.0];
        }
        if let Phase::Begin = phase {
            return [self.from + 0.5 * jerk * t * t, jerk * t, jerk];
        }
        let left = self.ramp_s - t;
        [self.to - 0.5 * jerk * left * left, jerk * left, -jerk]
    }

    /// Least and greatest acceleration between two times, the cruise included.
    fn accelerations(&self, from: f32, to: f32) -> [f32; 2] {
        let at = |time: f32| {
            let [_, acceleration, _] = self.rates(time.at_least(0.0));
            acceleration
        };
        let (one, other) = (at(from), at(to));
        let mut range = [one.at_most(other), one.at_least(other)];
        let steady = [self.jerk_s, self.ramp_s - self.jerk_s];
        if self.ramp_s > 0.0 && from <= steady[1] && to >= steady[0] {
            range = [range[0].at_most(self.peak), range[1].at_least(self.peak)];
        }
        range
    }

    /// Length between two times of the ramp, mm: by each phase's own rates, so that no long lengths are subtracted.
    fn length(&self, from: f32, to: f32) -> f32 {
        let mut at = from;
        let mut length = 0.0;
        for (phase, end) in [
            (Phase::Begin, self.jerk_s),
            (Phase::Steady, self.ramp_s - self.jerk_s),
            (Phase::End, self.ramp_s),
        ] {
            let end = to.at_most(end);
            let step = end - at;
            if step > 0.0 {
                let [v, a, j] = self.rates_in(phase, at);
                length += step * (v + step * (0.5 * a + step * j * (1.0 / 6.0)));
                at = end;
            }
        }
        length
    }
}

/// A part of a piece.
#[derive(Clone, Copy, Debug)]
enum Phase {
    /// Constant jerk at the begin of the ramp.
    Begin,
    /// Constant acceleration.
    Steady,
    /// Constant jerk at the end of the ramp.
    End,
    /// Constant speed.
    Cruise,
}

/// Durations of the jerk and of the whole ramp for a change of speed.
fn ramp(change: f32, limits: &CurveLimits) -> [f32; 2] {
    let change = change.abs();
    let (a, j) = (limits.acceleration, limits.jerk);
    if change * j < a * a {
        let jerk_s = sqrt(change / j);
        [jerk_s, 2.0 * jerk_s]
    } else {
        let jerk_s = a / j;
        [jerk_s, change / a + jerk_s]
    }
}

/// Length of a ramp, mm.
fn ramp_length(from: f32, to: f32, limits: &CurveLimits) -> f32 {
    let [_, ramp_s] = ramp(from - to, limits);
    0.5 * (from + to) * ramp_s
}

/// The same in units of 2^-10 nm, in which lengths are added: in f32 half a metre is rounded to 60 nm, by which a move would end too early.
fn ramp_length_q10(from: f32, to: f32, limits: &CurveLimits) -> i64 {
    to_q10(ramp_length(from, to, limits))
}

/// Speed that is reached at most on this length from rest to rest.
fn peak_speed(length: f32, limits: &CurveLimits) -> f32 {
    let CurveLimits {
        speed,
        acceleration: a,
        jerk: j,
    } = *limits;
    if 2.0 * ramp_length(0.0, speed, limits) <= length {
        return speed;
    }
    let jerk_s = cube_root(0.5 * length / j);
    if j * jerk_s <= a {
        return (j * jerk_s * jerk_s).at_most(speed);
    }
    let jerk_s = a / j;
    let steady_s = 0.5 * (sqrt(jerk_s * jerk_s + 4.0 * length / a) - 3.0 * jerk_s);
    (a * (jerk_s + steady_s.at_least(0.0))).at_most(speed)
}

/// What a link uses of its limits.
fn planned(machine: &CurveLimits) -> CurveLimits {
    CurveLimits {
        speed: machine.speed,
        acceleration: ACCELERATION * machine.acceleration,
        jerk: JERK * machine.jerk,
    }
}

/// From rest to rest over a length, mm, with this peak of the speed.
fn there_and_back(length: f32, peak: f32, limits: &CurveLimits) -> [Piece; 2] {
    let cruise_q10 = to_q10(length) - 2 * ramp_length_q10(0.0, peak, limits);
    [
        Piece::new(0.0, peak, limits, cruise_q10),
        Piece::new(peak, 0.0, limits, 0),
    ]
}

/// Bisections of a speed.
const BISECTIONS: u8 = 12;

/// A motion of this length from rest to rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    pieces: [Piece; 4],
    /// The piece that ends at rest at the curve's end.
    last: u8,
    limits: CurveLimits,
}

impl Curve {
    /// No motion.
    pub(crate) const NONE: Self = Self {
        pieces: [Piece::NONE; 4],
        last: 0,
        limits: CurveLimits {
            speed: 1.0,
            acceleration: 1.0,
            jerk: 1.0,
        },
    };

    /// Over `length` mm, the last `slow` mm of it at no more than `slow_speed`.
    pub(crate) fn new(length: f32, machine: &CurveLimits, slow: f32, slow_speed: f32) -> Self {
        let limits = planned(machine);
        let slow = slow.at_most(length);
        let last = ramp_length(slow_speed, 0.0, &limits);
        let peak = peak_speed(length, &limits);
        let (pieces, last) = if slow > 0.0 && last < slow && peak > slow_speed {
            let fast = length - slow;
            let needed = |top: f32| ramp_length(0.0, top, &limits) + ramp_length(top, slow_speed, &limits);
            let mut top = limits.speed;
            if needed(top) > fast {
                let mut low = slow_speed;
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (low + top);
                    if needed(middle) > fast {
                        top = middle;
                    } else {
                        low = middle;
                    }
                }
                top = low;
            }
            // Where even the slow speed is not reached on the fast part, it is cruised at from there on.
            let slow_q10 = to_q10(slow);
            let ramps_q10 = ramp_length_q10(0.0, top, &limits) + ramp_length_q10(top, slow_speed, &limits);
            let cruise_q10 = to_q10(length) - slow_q10 - ramps_q10;
            let slow_cruise_q10 = slow_q10 - ramp_length_q10(slow_speed, 0.0, &limits) + cruise_q10.min(0);
            let pieces = [
                Piece::new(0.0, top, &limits, cruise_q10),
                Piece::new(top, slow_speed, &limits, slow_cruise_q10),
                Piece::new(slow_speed, 0.0, &limits, 0),
                Piece::NONE,
            ];
            (pieces, 2)
        } else {
            let [up, down] = there_and_back(length, peak, &limits);
            ([up, down, Piece::NONE, Piece::NONE], 1)
        };
        Self {
            pieces,
            last,
            limits: *machine,
        }
    }

    /// A curve of two pieces, and after its rest a further length, mm, to another rest.
    #[inline(never)]
    pub(crate) fn and_then(self, length: f32) -> Self {
        let limits = planned(&self.limits);
        let [up, down, ..] = self.pieces;
        let [again, end] = there_and_back(length, peak_speed(length, &limits), &limits);
        Self {
            pieces: [up, down, again, end],
            last: 3,
            ..self
        }
    }

    /// Limits of the coordinate.
    pub(crate) const fn limits(&self) -> CurveLimits {
        self.limits
    }

    /// Greatest speed, mm/s.
    pub(crate) fn peak(&self) -> f32 {
        let [first, _, third, _] = &self.pieces;
        first.to.at_least(third.to)
    }

    fn piece(&self, index: u8) -> &Piece {
        const NONE: Piece = Piece::NONE;
        self.pieces.get(usize::from(index)).unwrap_or(&NONE)
    }

    /// Becomes a curve without length: its start is its end.
    pub(crate) const fn clear(&mut self) {
        let [first, ..] = &mut self.pieces;
        *first = Piece::NONE;
        self.last = 0;
    }

    /// The cursor at the start.
    pub(crate) fn start(&self) -> CurveCursor {
        CurveCursor {
            piece: 0,
            time: 0.0,
            left_q10: self.piece(0).cruise_q10,
            moved_q10: 0,
        }
    }

    /// Speed at a place, mm/s.
    pub(crate) fn speed(&self, cursor: &CurveCursor) -> f32 {
        let [speed, _, _] = self.piece(cursor.piece).rates(cursor.time);
        speed
    }

    /// Duration, s.
    pub(crate) fn duration(&self) -> f32 {
        let mut sum = 0.0;
        for piece in &self.pieces {
            sum += piece.ramp_s;
            if piece.cruise_q10 > 0 {
                sum += to_f32(piece.cruise_q10) * MM_PER_Q10 / piece.to;
            }
        }
        sum
    }
}

/// A place on a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CurveCursor {
    piece: u8,
    /// Time since the ramp's start, s.
    time: f32,
    /// What is left of the cruise, and the length so far, units of 2^-10 nm.
    left_q10: i64,
    pub(crate) moved_q10: i64,
}

impl CurveCursor {
    pub(crate) const START: Self = Self {
        piece: 0,
        time: 0.0,
        left_q10: 0,
        moved_q10: 0,
    };
}

impl Trajectory for Curve {
    type Cursor = CurveCursor;

    const IS_KNOWN_BETWEEN: bool = true;

    fn advance(&self, cursor: &mut CurveCursor, seconds: f32) {
        let mut left = seconds;
        // A period may end a ramp and a cruise of each piece.
        for _ in 0..self.pieces.len() {
            let piece = self.piece(cursor.piece);
            if cursor.time < piece.ramp_s {
                let end = (cursor.time + left).at_most(piece.ramp_s);
                let moved = piece.length(cursor.time, end);
                cursor.moved_q10 += to_q10(moved.at_least(0.0));
                left -= end - cursor.time;
                cursor.time = end;
            }
            if cursor.time < piece.ramp_s {
                return;
            }
            let step = to_q10((piece.to * left).at_least(0.0));
            if step < cursor.left_q10 {
                cursor.left_q10 -= step;
                cursor.moved_q10 += step;
                return;
            }
            cursor.moved_q10 += cursor.left_q10;
            if piece.to > 0.0 {
                left -= to_f32(cursor.left_q10) * MM_PER_Q10 / piece.to;
            }
            cursor.left_q10 = 0;
            if self.is_last(cursor.piece) || !(left > 0.0) {
                return;
            }
            cursor.piece += 1;
            cursor.time = 0.0;
            cursor.left_q10 = self.piece(cursor.piece).cruise_q10;
        }
    }

    fn is_over(&self, cursor: &CurveCursor) -> bool {
        self.is_last(cursor.piece) && cursor.time >= self.piece(cursor.piece).ramp_s
    }

    fn use_at(&self, cursor: &CurveCursor, [r, r1, r2]: [f32; 3], around: f32) -> Use {
        let [v, a, j] = self.piece(cursor.piece).rates(cursor.time);
        let limits = &self.limits;
        // The jerk steps, and the acceleration may change its sign, between two places.
        let around = r * around;
        let accelerations = self.accelerations_beside(cursor, [around; 2], v);
        let jerks = self.jerks_beside(cursor, around, [v, j]);
        let [one, other] = accelerations.map(|a| (a * r * r + v * r1).abs());
        let fastest = fastest_around([v, a, j], around);
        let [by_one, by_other] = accelerations.map(|a| 3.0 * a * r * r1);
        let least = jerks[0] * r * r * r + by_one.at_most(by_other);
        let greatest = jerks[1] * r * r * r + by_one.at_least(by_other);
        let [least, greatest] = [least, greatest].map(|jerk| (jerk + fastest * r2).abs());
        Use {
            feed: 0.0,
            velocity: v * r / limits.speed,
            acceleration: one.at_least(other) / limits.acceleration,
            jerk: least.at_least(greatest) / limits.jerk,
        }
    }

    fn ramp_s(&self) -> f32 {
        self.limits.acceleration / self.limits.jerk
    }

    fn span_at(&self, cursor: &CurveCursor, slot: &SlotAt, room: &Use) -> Span {
        let SlotAt {
            r,
            first,
            slot_s,
            around,
        } = *slot;
        let [v, a, j] = self.piece(cursor.piece).rates(cursor.time);
        let limits = &self.limits;
        let mut span = Span::WIDE;
        // The acceleration may change its sign within a slot: what follows up to the middle of the slot belongs to its begin.
        let around = r * around;
        let fastest = fastest_around([v, a, j], around);
        let accelerations = self.accelerations_beside(cursor, [around, around + 0.5 * r * slot_s], v);
        let at = accelerations.map(|a| a * r * r);
        span.add_acceleration(at, fastest, room.acceleration * limits.acceleration);
        // The speed changes over the time around the place, and the jerk steps.
        let [one_slope, other_slope] = accelerations.map(|a| 3.0 * a * r);
        let [one, other] = [one_slope * first, other_slope * first];
        let [least, greatest] = self.jerks_beside(cursor, around, [v, j]).map(|j| j * r * r * r);
        span.add_jerk(
            [least + one.at_most(other), greatest + one.at_least(other)],
            [
                fastest + one_slope.at_most(0.0) * slot_s,
                fastest + other_slope.at_least(0.0) * slot_s,
            ],
            room.jerk * limits.jerk,
        );
        span
    }
}

impl Curve {
    /// Least and greatest acceleration from one time before to another after a place with this speed.
    fn accelerations_beside(&self, cursor: &CurveCursor, [before, after]: [f32; 2], speed: f32) -> [f32; 2] {
        let piece = self.piece(cursor.piece);
        let mut range = piece.accelerations(cursor.time - before, cursor.time + after);
        let mut add = |[least, greatest]: [f32; 2]| {
            range = [range[0].at_most(least), range[1].at_least(greatest)];
        };
        let moved_mm = to_f32(piece.cruise_q10 - cursor.left_q10) * MM_PER_Q10;
        let earlier = before - cursor.time;
        if earlier > 0.0
            && moved_mm <= 0.0
            && let Some(index) = cursor.piece.checked_sub(1)
        {
            let piece = self.piece(index);
            add(piece.accelerations(piece.ramp_s - earlier, piece.ramp_s));
        }
        let later = cursor.time + after - piece.ramp_s;
        if later > 0.0
            && !self.is_last(cursor.piece)
            && to_f32(cursor.left_q10) * MM_PER_Q10 <= speed.at_least(piece.to) * later
        {
            add(self.piece(cursor.piece + 1).accelerations(0.0, later));
        }
        range
    }

    /// Least and greatest jerk this time before, at, and after a place with this speed and jerk.
    fn jerks_beside(&self, cursor: &CurveCursor, around: f32, [speed, here]: [f32; 2]) -> [f32; 2] {
        let piece = self.piece(cursor.piece);
        let jerk = |piece: &Piece, time: f32| {
            let [_, _, jerk] = piece.rates(time);
            jerk
        };
        let moved = to_f32(piece.cruise_q10 - cursor.left_q10) * MM_PER_Q10;
        let before = match cursor.piece.checked_sub(1).map(|before| self.piece(before)) {
            _ if moved > speed * around => 0.0,
            Some(before) if cursor.time < around && before.cruise_q10 == 0 => {
                jerk(before, before.ramp_s * BEFORE_END)
            }
            _ => jerk(piece, (cursor.time - around).at_least(0.0)),
        };
        let ends =
            cursor.time + around >= piece.ramp_s && to_f32(cursor.left_q10) * MM_PER_Q10 <= speed * around;
        let after = if ends && !self.is_last(cursor.piece) {
            jerk(self.piece(cursor.piece + 1), 0.0)
        } else {
            jerk(piece, cursor.time + around)
        };
        [
            here.at_most(before).at_most(after),
            here.at_least(before).at_least(after),
        ]
    }

    const fn is_last(&self, piece: u8) -> bool {
        piece >= self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: CurveLimits = CurveLimits {
        speed: 100.0,
        acceleration: 1000.0,
        jerk: 20_000.0,
    };

    /// What a motion is short of its length, or beyond it, is a step of the position where it ends.
    #[test]
    fn long_moves_end_where_they_should() {
        for (length, slow) in [
            (576.371, 0.0),
            (1234.567, 2.0),
            (3999.9, 0.0),
            (87.3, 5.0),
            (8.0, 0.0),
        ] {
            let curve = Curve::new(length, &LIMITS, slow, 20.0);
            let mut cursor = curve.start();
            while !curve.is_over(&cursor) {
                curve.advance(&mut cursor, 1e-3);
            }
            let off_nm = (cursor.moved_q10 - to_q10(length)) >> 10;
            assert!(off_nm.abs() <= 8, "{length} mm: {off_nm} nm off");
        }
    }
}
