//! A turn from the end of a pass to the start of the next: a curve of the ball centre that leaves the one along its tangent and comes back on the
//! other, with position, first and second derivative of both.
//!
//! The plan's arc along a turn is the parameter of a polynomial of degree 7, so no arc has to be measured: at both ends it is the contact's arc, and
//! between them the centre moves with the derivatives by it, as on a pass. The plans of the two passes meet at the apex, the middle, at a speed
//! that the turn alone decides.

use super::limits::MotionLimits;
use super::stations::Derivatives;
use super::{MM_PER_Q10, Q10_BITS};
use crate::math::arith::{sqrt, truncated};
use crate::math::number::{Bounded, MM_PER_NM, NM_PER_MM_F32, cube_root, to_f32};

/// Cells of half a turn between stations.
pub(crate) const CELLS: u16 = 10;
/// Stations of half a turn.
pub(crate) const STATIONS: u16 = CELLS + 1;

/// Length of the plan's arc along a turn, for the time t that the step takes at its jerk limit, as a multiple of a t^2 and of v t.
const REVERSAL: f32 = 4.0;
const CRUISE: f32 = 2.4;
/// Time of a step from rest to rest at its jerk limit, as a multiple of the cube root of distance over jerk: 4 / 2^(1/3).
const STEP_TIME: f32 = 3.17;
/// Greatest time of a turn at the speed of its apex, as a multiple of that of two rests and the step.
const WORTH: f32 = 0.9;

/// Rounds in which the length is adapted to the greatest overrun.
pub(crate) const ROUNDS: u8 = 4;
/// Least length of half a turn, mm: a shorter one is noise of rounded positions.
const HALF_MIN_MM: f32 = 0.05;

/// Shares of the limits at the apex.
const ACCELERATION_SHARE: f32 = 0.95;
const JERK_SHARE: f32 = 0.75;

/// The end of a pass at a turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TurnEnd {
    /// Ball centre, nm.
    pub(crate) cl_nm: [i32; 3],
    /// Derivatives by the contact's arc.
    pub(crate) q: Derivatives,
}

impl TurnEnd {
    /// No end.
    pub(crate) const NONE: Self = Self {
        cl_nm: [0; 3],
        q: [[0.0; 3]; 3],
    };
}

/// A turn, or none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    from_nm: [i32; 3],
    /// Coefficients by the distance from the apex as a fraction of half the length, mm, the lowest power first: they are no larger than the turn.
    coefficients: [[f32; 8]; 3],
    /// Half the length of the plan's arc, nm, and its inverse, 1/mm.
    half_nm: u32,
    inverse: f32,
    /// Speed at the apex, mm/s of the plan's arc; 0 where there is no turn.
    pub(crate) speed: f32,
}

impl Turn {
    /// No turn: the pass ends at rest.
    pub(crate) const NONE: Self = Self {
        from_nm: [0; 3],
        coefficients: [[0.0; 8]; 3],
        half_nm: 0,
        inverse: 0.0,
        speed: 0.0,
    };

    /// A turn between two ends, and how far it overruns them, mm. `length`: of the plan's arc, mm; 0 for the first try.
    pub(crate) fn try_length(
        from: &TurnEnd,
        to: &TurnEnd,
        limits: &MotionLimits,
        length: f32,
    ) -> (Self, f32) {
        let length = if length > 0.0 {
            length
        } else {
            Step::new(from, to, limits).turn_length(limits)
        };
        let turn = Self::of(from, to, length);
        let over = turn.overrun(from, to);
        (turn, over)
    }

    /// The length of the next try for this overrun; none where the turn would be too small.
    pub(crate) fn shorter(&self, over_mm: f32, overrun_mm: f32) -> Option<f32> {
        let length = 2.0 * self.half_mm() * 0.98 * overrun_mm / over_mm;
        (length > 2.0 * HALF_MIN_MM).then_some(length)
    }

    /// Whether it is long enough to be one.
    pub(crate) fn is_long(&self) -> bool {
        self.half_mm() >= HALF_MIN_MM
    }

    /// Bounds the speed at the apex by a station of each half, so that the whole turn could be passed at it. The first one sets it.
    pub(crate) fn bound_speed(&mut self, station: u16, limits: &MotionLimits) {
        if station == 0 {
            self.speed = limits.feed;
        }
        for second in [false, true] {
            let q = self.station(second, station);
            for (axis, [first, second, third]) in limits.axes.iter().zip(&q) {
                self.speed = self
                    .speed
                    .at_most(axis.velocity / first.abs().at_least(1e-6))
                    .at_most(sqrt(
                        ACCELERATION_SHARE * axis.acceleration / second.abs().at_least(1e-9),
                    ))
                    .at_most(cube_root(JERK_SHARE * axis.jerk / third.abs().at_least(1e-9)));
            }
        }
    }

    /// Whether the turn is faster than two rests with a step between them.
    pub(crate) fn is_worth(&self, from: &TurnEnd, to: &TurnEnd, limits: &MotionLimits) -> bool {
        let turn = 2.0 * self.half_mm() / self.speed.at_least(1e-6);
        let Step {
            time,
            distance,
            jerk,
            acceleration,
        } = Step::new(from, to, limits);
        let ramp = limits.feed / acceleration + acceleration / jerk;
        let ramp = ramp.at_most(2.0 * sqrt(limits.feed / jerk));
        let step = (STEP_TIME * time).at_least(distance / limits.feed);
        turn < WORTH * (ramp + step)
    }

    /// Of this length, mm.
    fn of(from: &TurnEnd, to: &TurnEnd, length: f32) -> Self {
        let half_nm = u32::try_from(truncated(0.5 * length * NM_PER_MM_F32)).unwrap_or(0);
        let half = nm_to_mm(half_nm);
        let mut coefficients = [[0.0; 8]; 3];
        let apart = apart_mm(&from.cl_nm, &to.cl_nm);
        for (((c, apart), a), b) in coefficients.iter_mut().zip(apart).zip(&from.q).zip(&to.q) {
            let ([a1, a2, _], [b1, b2, _]) = (*a, *b);
            // Even and odd parts by their value and derivatives at 1; the third ones are 0.
            let place = 0.5 * apart;
            let [slope, odd_slope] = [b1 - a1, b1 + a1].map(|sum| 0.5 * half * sum);
            let [bend, odd_bend] = [b2 + a2, b2 - a2].map(|sum| 0.5 * half * half * sum);
            let c6 = (slope - bend) * (1.0 / 16.0);
            let c4 = -5.0 * c6;
            let c2 = 0.5 * slope + 7.0 * c6;
            let c7 = (2.5 * (odd_slope - place) - odd_bend) * (1.0 / 8.0);
            let c5 = (place - odd_slope) * (1.0 / 16.0) - 4.0 * c7;
            let c3 = -10.0 * c5 - 35.0 * c7;
            let c1 = place - c3 - c5 - c7;
            *c = [place - c2 - c4 - c6, c1, c2, c3, c4, c5, c6, c7];
        }
        Self {
            from_nm: from.cl_nm,
            coefficients,
            half_nm,
            inverse: 1.0 / half.at_least(1e-6),
            speed: 0.0,
        }
    }

    /// Whether there is a turn.
    pub(crate) fn exists(&self) -> bool {
        self.speed > 0.0
    }

    /// Length of half the turn, units of 2^-10 nm.
    pub(crate) fn half_q10(&self) -> i64 {
        i64::from(self.half_nm) << Q10_BITS
    }

    fn half_mm(&self) -> f32 {
        nm_to_mm(self.half_nm)
    }

    /// Arc from the start of a half to one of its stations, nm.
    pub(crate) fn station_nm(&self, station: u16) -> u32 {
        let part = u64::from(self.half_nm) * u64::from(station);
        u32::try_from(part.checked_div(u64::from(CELLS)).unwrap_or(0)).unwrap_or(0)
    }

    /// Derivatives at a station of the first or of the second half, by the plan's arc.
    pub(crate) fn station(&self, second: bool, station: u16) -> Derivatives {
        let start = if second { 0.0 } else { self.half_mm() };
        self.derivatives((nm_to_mm(self.station_nm(station)) - start) * self.inverse)
    }

    /// Ball centre at a station, nm.
    pub(crate) fn place(&self, second: bool, station: u16) -> [i32; 3] {
        let start = if second { 0.0 } else { self.half_mm() };
        self.position((nm_to_mm(self.station_nm(station)) - start) * self.inverse)
    }

    /// Ball centre at this arc from the start, units of 2^-10 nm.
    pub(crate) fn position_at(&self, arc_q10: i64) -> [i32; 3] {
        self.position(self.part(arc_q10))
    }

    /// Speed of the ball centre at this arc and a speed of the plan, mm/s.
    pub(crate) fn speed_at(&self, arc_q10: i64, speed: f32) -> f32 {
        let [[x, ..], [y, ..], [z, ..]] = self.derivatives(self.part(arc_q10));
        speed * sqrt(x * x + y * y + z * z)
    }

    /// The distance from the apex of an arc from the start, as a fraction of half the length.
    fn part(&self, arc_q10: i64) -> f32 {
        let part = to_f32(arc_q10 - self.half_q10()) * MM_PER_Q10 * self.inverse;
        part.at_least(-1.0).at_most(1.0)
    }

    fn position(&self, part: f32) -> [i32; 3] {
        let mut at = self.from_nm;
        for (at, c) in at.iter_mut().zip(&self.coefficients) {
            let mut mm = 0.0;
            for c in c.iter().rev() {
                mm = mm * part + c;
            }
            let nm = mm * NM_PER_MM_F32;
            *at = at.saturating_add(truncated(if nm < 0.0 { nm - 0.5 } else { nm + 0.5 }));
        }
        at
    }

    fn derivatives(&self, part: f32) -> Derivatives {
        let mut q = [[0.0; 3]; 3];
        for (q, c) in q.iter_mut().zip(&self.coefficients) {
            let [mut value, mut first, mut second, mut third] = [0.0_f32; 4];
            for c in c.iter().rev() {
                third = third * part + second;
                second = second * part + first;
                first = first * part + value;
                value = value * part + c;
            }
            let inverse = self.inverse;
            let square = inverse * inverse;
            *q = [
                first * inverse,
                2.0 * second * square,
                6.0 * third * square * inverse,
            ];
        }
        q
    }

    /// Greatest distance beyond an end along its tangent, in the half next to it, mm.
    fn overrun(&self, from: &TurnEnd, to: &TurnEnd) -> f32 {
        let mut most = 0.0_f32;
        for station in 0..STATIONS {
            for (second, end, sign) in [(false, from, 1.0), (true, to, -1.0)] {
                let apart = apart_mm(&end.cl_nm, &self.place(second, station));
                let (mut along, mut square) = (0.0, 0.0);
                for (apart, [first, ..]) in apart.iter().zip(&end.q) {
                    along += sign * apart * first;
                    square += first * first;
                }
                most = most.at_least(along / sqrt(square).at_least(1e-6));
            }
        }
        most
    }
}

/// A step from one end to the other, and the limits of the reversal.
struct Step {
    /// The cube root of the distance over the jerk limit in its direction, s; the distance, mm.
    time: f32,
    distance: f32,
    /// Jerk limit of the step, mm/s^3, and acceleration limit along the pass, mm/s^2.
    jerk: f32,
    acceleration: f32,
}

impl Step {
    fn new(from: &TurnEnd, to: &TurnEnd, limits: &MotionLimits) -> Self {
        let apart = apart_mm(&from.cl_nm, &to.cl_nm);
        let [x, y, z] = apart;
        let distance = sqrt(x * x + y * y + z * z);
        let (mut jerk, mut acceleration) = (f32::MAX, f32::MAX);
        for ((axis, apart), [first, ..]) in limits.axes.iter().zip(&apart).zip(&from.q) {
            jerk = jerk.at_most(axis.jerk * distance / apart.abs().at_least(1e-3 * distance).at_least(1e-9));
            acceleration = acceleration.at_most(axis.acceleration / first.abs().at_least(1e-3));
        }
        Self {
            time: cube_root(distance / jerk),
            distance,
            jerk,
            acceleration,
        }
    }

    /// The length of the plan's arc for which a turn is fast: while the step takes its time, which its jerk bounds, the axes reverse.
    fn turn_length(&self, limits: &MotionLimits) -> f32 {
        (REVERSAL * self.acceleration * self.time * self.time).at_most(CRUISE * limits.feed * self.time)
    }
}

fn apart_mm(from: &[i32; 3], to: &[i32; 3]) -> [f32; 3] {
    let mut apart = [0.0; 3];
    for ((apart, from), to) in apart.iter_mut().zip(from).zip(to) {
        *apart = to_f32(i64::from(*to) - i64::from(*from)) * MM_PER_NM;
    }
    apart
}

#[allow(clippy::cast_precision_loss, reason = "24 bits resolve a turn to nanometres")]
const fn nm_to_mm(nm: u32) -> f32 {
    nm as f32 * MM_PER_NM
}
