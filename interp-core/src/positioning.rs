//! Point-to-point motion of an axis, or of several along a [`Line`], outside a job, from rest to rest within its limits: what homing, jog and probing are made of.
//!
//! The periods are counted in integers, and the position is a sum of sums of the jerk: the third difference of the positions is the jerk itself, so a move is
//! within its limits exactly, apart from the rounding to nanometres. With `n` periods of jerk, `m` of acceleration (both ramps of it included) and `l` of
//! velocity, a distance of `d` takes `l + m + n` periods, at a velocity of `d / l`, an acceleration of `d / (l m)` and a jerk of `d / (l m n)`, where `n <= m`
//! and `m + n <= l`: three moving averages, one after the other (L. Biagiotti, C. Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 2008,
//! section 4.5). The durations are the shortest that the limits allow, in whole periods.
//!
//! ```text
//! jerk   +n  0  -n | cruise | -n  0  +n       periods:  n, m - n, n, l - m - n, n, m - n, n
//! ```
//!
//! A stop takes the acceleration to 0 at the move's jerk, then brakes by the mirror image of how it has accelerated: exact in integers as well.

mod line;

use crate::math::arith::sqrt;
use crate::math::number::{Bounded, cube_root, integer_part, to_f32};

pub use line::{Line, LineLimits};

/// Binary places of a position, below a nanometre.
const PLACES: u32 = 28;
#[allow(clippy::cast_precision_loss, reason = "a power of two")]
const ONE: f32 = (1_u32 << PLACES) as f32;

/// Most periods of jerk, and of acceleration: more than a minute at 1 ms.
const RAMP_MAX: u32 = 1 << 16;
/// Most periods of a move: 12 days at 1 ms.
const PERIODS_MAX: i64 = 1 << 30;

/// Limits of an axis for its sampling period, in units of 2^-28 nm and periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MoveLimits {
    velocity: i64,
    acceleration: i64,
    jerk: i64,
}

impl MoveLimits {
    /// From mm/s, mm/s^2, mm/s^3 and the period, s. Each is at least one unit.
    #[must_use]
    pub fn new(velocity: f32, acceleration: f32, jerk: f32, period_s: f32) -> Self {
        let nm = crate::math::number::NM_PER_MM_F32 * ONE * period_s;
        let unit = |value: f32| integer_part(value.at_most(MOST)).max(1);
        Self {
            velocity: unit(velocity * nm),
            acceleration: unit(acceleration * nm * period_s),
            jerk: unit(jerk * nm * period_s * period_s),
        }
    }

    /// These limits with a velocity of at most `velocity`, mm/s.
    #[must_use]
    pub fn at_speed(self, velocity: f32, period_s: f32) -> Self {
        let nm = crate::math::number::NM_PER_MM_F32 * ONE * period_s;
        let velocity = integer_part((velocity * nm).at_most(MOST)).max(1);
        Self {
            velocity: velocity.min(self.velocity),
            ..self
        }
    }
}

/// Greatest limit, units: 2^57, so that every sum of two fits.
const MOST: f32 = 1.44e17;

/// The quotient, rounded up; of positive numbers.
fn divide_up(of: i64, by: i64) -> i64 {
    let rounded = of.saturating_add(by.saturating_sub(1));
    rounded.checked_div(by).unwrap_or(0)
}

/// Periods of jerk, of acceleration, of velocity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Periods {
    jerk: i64,
    acceleration: i64,
    velocity: i64,
}

impl Periods {
    /// The shortest of a move over a distance, in units.
    fn shortest(distance: i64, limits: &MoveLimits) -> Self {
        let [of_jerk, of_acceleration] = estimate(distance, limits);
        let mut best: Option<Self> = None;
        // The best whole numbers are next to the best real ones.
        for jerk in [of_jerk, of_jerk + 1] {
            for acceleration in [of_acceleration, of_acceleration + 1, of_acceleration + 2] {
                let trial = Self::with(distance, limits, jerk.max(1), acceleration.max(jerk).max(1));
                if best.is_none_or(|best| trial.sum() < best.sum()) {
                    best = Some(trial);
                }
            }
        }
        best.unwrap_or(Self {
            jerk: 1,
            acceleration: 1,
            velocity: PERIODS_MAX,
        })
    }

    /// The shortest with these ramps.
    fn with(distance: i64, limits: &MoveLimits, jerk: i64, acceleration: i64) -> Self {
        let by_jerk = limits.jerk.saturating_mul(jerk).saturating_mul(acceleration);
        let by_acceleration = limits.acceleration.saturating_mul(acceleration);
        let velocity = divide_up(distance, limits.velocity.min(by_acceleration).min(by_jerk));
        Self {
            jerk,
            acceleration,
            velocity: velocity.max(jerk + acceleration).min(PERIODS_MAX),
        }
    }

    const fn sum(&self) -> i64 {
        self.jerk + self.acceleration + self.velocity
    }
}

/// Periods of jerk and of acceleration in the best move without whole periods, rounded down.
fn estimate(distance: i64, limits: &MoveLimits) -> [i64; 2] {
    let [d, v, a, j] = [distance, limits.velocity, limits.acceleration, limits.jerk].map(to_f32);
    let of_jerk = a / j;
    let fast = if v / a < of_jerk {
        let both = sqrt(v / j);
        [both, both]
    } else {
        [of_jerk, v / a]
    };
    let [jerk, acceleration] = if d / v >= fast[0] + fast[1] {
        fast
    } else {
        let acceleration = 0.5 * (sqrt(of_jerk * of_jerk + 4.0 * d / a) - of_jerk);
        if acceleration >= of_jerk {
            [of_jerk, acceleration]
        } else {
            let both = cube_root(0.5 * d / j);
            [both, both]
        }
    };
    #[allow(clippy::cast_precision_loss, reason = "2^16 is exact")]
    let most = RAMP_MAX as f32;
    [jerk, acceleration].map(|periods| integer_part(periods.at_most(most)))
}

/// Periods of constant jerk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Phase {
    jerk: i64,
    periods: i64,
}

/// The phase of constant velocity.
const CRUISE: usize = 3;
const PHASES: usize = 7;

/// A move of one axis, and its state. [`Self::tick`] gives the position of each period.
#[derive(Clone, Copy, Debug)]
pub struct Move {
    phases: [Phase; PHASES],
    /// The present phase, and the periods left of it.
    index: usize,
    left: i64,
    acceleration: i64,
    velocity: i64,
    /// The way from the start, units of 2^-28 nm.
    way: i64,
    /// What is added to the way in each period, because the jerk is a whole number.
    drift: i64,
    from_nm: i32,
    is_minus: bool,
    /// The end, unless the move is stopped.
    goal_nm: Option<i32>,
    at_nm: i32,
}

impl Move {
    /// No motion, at this position, nm.
    #[must_use]
    pub const fn rest(at_nm: i32) -> Self {
        Self {
            phases: [Phase { jerk: 0, periods: 0 }; PHASES],
            index: PHASES,
            left: 0,
            acceleration: 0,
            velocity: 0,
            way: 0,
            drift: 0,
            from_nm: at_nm,
            is_minus: false,
            goal_nm: Some(at_nm),
            at_nm,
        }
    }

    /// The shortest move between two positions within the limits, nm. Takes some thousand cycles.
    #[must_use]
    pub fn new(from_nm: i32, to_nm: i32, limits: &MoveLimits) -> Self {
        let length = i64::from(to_nm) - i64::from(from_nm);
        // Below 2^60.
        let distance = length.abs() << PLACES;
        if distance == 0 {
            return Self::rest(from_nm);
        }
        let periods = Periods::shortest(distance, limits);
        let Periods {
            jerk: n,
            acceleration: m,
            velocity: l,
        } = periods;
        let product = n.saturating_mul(m).saturating_mul(l);
        let jerk = distance.checked_div(product).unwrap_or(0);
        let rest = distance.saturating_sub(jerk.saturating_mul(product));
        let drift = rest.checked_div(periods.sum()).unwrap_or(0);
        let phase = |sign: i64, periods: i64| Phase {
            jerk: sign * jerk,
            periods,
        };
        let phases = [
            phase(1, n),
            phase(0, m - n),
            phase(-1, n),
            phase(0, l - m - n),
            phase(-1, n),
            phase(0, m - n),
            phase(1, n),
        ];
        Self {
            phases,
            index: 0,
            left: n,
            drift,
            is_minus: length < 0,
            goal_nm: Some(to_nm),
            ..Self::rest(from_nm)
        }
    }

    /// Whether the axis stands at the end.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        self.index >= PHASES
    }

    /// The position of the last period, nm.
    #[must_use]
    pub const fn at_nm(&self) -> i32 {
        self.at_nm
    }

    /// The position of the next period, nm; the end once the move is over.
    pub fn tick(&mut self) -> i32 {
        self.skip_empty();
        if let Some(phase) = self.phases.get(self.index) {
            self.left -= 1;
            self.acceleration = self.acceleration.wrapping_add(phase.jerk);
            self.velocity = self.velocity.wrapping_add(self.acceleration);
            self.way = self.way.wrapping_add(self.velocity.wrapping_add(self.drift));
            self.at_nm = self.position();
            self.skip_empty();
            if self.is_over() {
                self.at_nm = self.goal_nm.unwrap_or(self.at_nm);
            }
        }
        self.at_nm
    }

    /// Stops within the limits, as soon as possible: the next periods brake. No effect where they do already.
    pub fn stop(&mut self) {
        let [rise, steady, fall, ..] = self.phases;
        let is_braking = self.index > CRUISE || self.goal_nm.is_none();
        if is_braking {
            return;
        }
        self.goal_nm = None;
        let phase = |jerk: i64, periods: i64| Phase { jerk, periods };
        let none = phase(0, 0);
        match self.index {
            // The acceleration to 0 and on, and back: as many periods as it has risen.
            0 => {
                let risen = rise.periods - self.left;
                let down = phase(-rise.jerk, risen);
                self.phases = [none, none, none, down, down, none, phase(rise.jerk, risen)];
            }
            1 => {
                let held = steady.periods - self.left;
                let down = phase(-rise.jerk, rise.periods);
                self.phases = [none, none, none, down, down, phase(0, held), rise];
            }
            // What is left of the fall, and no cruise.
            2 => {
                let [.., down, held, up] = self.phases;
                let rest = phase(fall.jerk, self.left);
                self.phases = [none, none, none, rest, down, held, up];
            }
            _ => {
                let [.., down, held, up] = self.phases;
                self.phases = [none, none, none, none, down, held, up];
            }
        }
        self.index = CRUISE;
        self.left = self.phases.get(CRUISE).map_or(0, |phase| phase.periods);
        self.skip_empty();
    }

    /// Ends the move at once, where the axis is: for drives that are off.
    pub const fn abandon(&mut self) {
        *self = Self::rest(self.at_nm);
    }

    fn skip_empty(&mut self) {
        for _ in 0..PHASES {
            if self.left > 0 || self.index >= PHASES {
                return;
            }
            self.index += 1;
            self.left = self.phases.get(self.index).map_or(0, |phase| phase.periods);
        }
    }

    /// The position at the way so far, rounded to the nearest nanometre.
    fn position(&self) -> i32 {
        let nm = (self.way + (1 << (PLACES - 1))) >> PLACES;
        let at = i64::from(self.from_nm) + if self.is_minus { -nm } else { nm };
        i32::try_from(at).unwrap_or(self.at_nm)
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;

    const PERIOD_S: f32 = 0.001;

    /// Positions from the start to the end, with two periods of rest at either end.
    fn positions(mut moving: Move, stop_after: Option<usize>) -> Vec<i64> {
        let start = i64::from(moving.at_nm());
        let mut all = std::vec![start; 3];
        let mut ticks = 0;
        while !moving.is_over() {
            // Again and again, as an input that stays asserted does.
            if stop_after.is_some_and(|after| ticks >= after) {
                moving.stop();
                if moving.is_over() {
                    break;
                }
            }
            all.push(moving.tick().into());
            ticks += 1;
            assert!(ticks < 3_000_000);
        }
        let end = all[all.len() - 1];
        all.extend([end; 3]);
        all
    }

    /// Greatest first, second and third difference, less the rounding of their positions, as shares of the limits.
    fn shares(positions: &[i64], limits: [f32; 3]) -> [f64; 3] {
        let mut differences = positions.to_vec();
        let mut shares = [0.0; 3];
        for (order, (share, limit)) in (1..).zip(shares.iter_mut().zip(limits)) {
            differences = differences.windows(2).map(|two| two[1] - two[0]).collect();
            let greatest = differences.iter().map(|nm| nm.abs()).max().unwrap();
            let rounding = 1_i64 << (order - 1);
            let per_period = f64::from(limit) * 1e6 * f64::from(PERIOD_S).powi(order);
            *share = (greatest - rounding).max(0) as f64 / per_period;
        }
        shares
    }

    /// The closed form of the best move: seconds.
    fn optimum_s(distance: f64, [v, a, j]: [f64; 3]) -> f64 {
        let ramp = |v: f64| {
            if v * j >= a * a {
                v / a + a / j
            } else {
                2.0 * (v / j).sqrt()
            }
        };
        let lag = a * a / j;
        let reached = 0.5 * ((lag * lag + 4.0 * a * distance).sqrt() - lag);
        let reached = if reached >= lag {
            reached
        } else {
            (0.25 * distance * distance * j).cbrt()
        };
        let peak = reached.min(v);
        if peak < v {
            2.0 * ramp(peak)
        } else {
            distance / v + ramp(v)
        }
    }

    fn limits_of(limits: [f32; 3]) -> MoveLimits {
        MoveLimits::new(limits[0], limits[1], limits[2], PERIOD_S)
    }

    prop_compose! {
        fn any_limits()(v in -1.0_f32..3.0, a in 1.0_f32..4.0, j in 2.0_f32..6.0) -> [f32; 3] {
            [v, a, j].map(|exponent| 10_f32.powf(exponent))
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        /// Within the limits, at the goal, and at most four periods longer than the best move of any period.
        #[test]
        fn a_move_is_within_its_limits_and_the_shortest(
            from in -1_000_000_000_i32..1_000_000_000, exponent in 0.0_f64..8.0, minus: bool, limits in any_limits()
        ) {
            let length = 10_f64.powf(exponent) as i32;
            let to = if minus { from - length } else { from + length };
            let all = positions(Move::new(from, to, &limits_of(limits)), None);
            prop_assert_eq!(all[all.len() - 1], i64::from(to));
            let shares = shares(&all, limits);
            prop_assert!(shares.iter().all(|share| *share <= 1.0 + 1e-6), "{shares:?}");
            let best = optimum_s(f64::from(length) * 1e-6, limits.map(f64::from)) / f64::from(PERIOD_S);
            let periods = (all.len() - 6) as f64;
            prop_assert!(periods <= best * (1.0 + 1e-6) + 4.0, "{periods} periods, {best} at best");
        }

        /// A stop at any time is within the limits, never beyond the goal, and no longer than from full speed.
        #[test]
        fn a_stop_is_within_the_limits(
            exponent in 3.0_f64..8.0, limits in any_limits(), share in 0.0_f64..1.0
        ) {
            let to = 10_f64.powf(exponent) as i32;
            let moving = Move::new(0, to, &limits_of(limits));
            let whole = positions(moving, None).len() - 6;
            let after = (whole as f64 * share) as usize;
            let all = positions(moving, Some(after));
            let [.., end] = all[..] else { unreachable!() };
            prop_assert!((0..=i64::from(to)).contains(&end), "{end} of {to}");
            let shares = shares(&all, limits);
            prop_assert!(shares.iter().all(|share| *share <= 1.0 + 1e-6), "{shares:?}");
            // From where it was: the best stop from its greatest speed.
            let speed = all.windows(2).map(|two| two[1] - two[0]).max().unwrap() as f64 * 1e-6 / f64::from(PERIOD_S);
            let [v, a, j] = limits.map(f64::from);
            let speed = speed.min(v);
            let ramp = if speed * j >= a * a { speed / a + a / j } else { 2.0 * (speed / j).sqrt() };
            let took = (all.len() - 6 - after) as f64 * f64::from(PERIOD_S);
            prop_assert!(took <= ramp * 1.5 + 0.010, "{took} s, {ramp} at best from full speed");
        }
    }

    #[test]
    fn the_ends_of_the_range() {
        let fast = MoveLimits::new(1e9, 1e9, 1e9, 1.0);
        let all = positions(Move::new(i32::MIN, i32::MAX, &fast), None);
        assert_eq!(all[all.len() - 1], i64::from(i32::MAX));
        let slow = MoveLimits::new(0.0, f32::NAN, 0.0, PERIOD_S);
        let mut moving = Move::new(0, 1_000_000, &slow);
        for _ in 0..100_000 {
            assert!((0..=1_000_000).contains(&moving.tick()));
        }
        moving.stop();
        assert!(Move::new(5, 5, &slow).is_over());
        assert_eq!(positions(Move::new(0, -1, &fast), None).last(), Some(&-1));
    }
}
